/* publishers/login.h - user and password of a publisher that listens: their file, Digest challenges, and limits on
 * guessing by address. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PUBLISHERS_LOGIN_H
#define SST_PUBLISHERS_LOGIN_H

#include <pthread.h>

#include "base/brake.h"

#define SST_LOGIN_REALM    "sst"
#define SST_LOGIN_USER     64
#define SST_LOGIN_PASSWORD 129 /* bytes, with the NUL */
#define SST_LOGIN_NONCE    41  /* 8 digits of the time, 32 of the signature, NUL */
#define SST_LOGIN_NONCE_S  300 /* a client that has asked its user for the password is back by then */
#define SST_LOGIN_PAUSE_MS 300 /* an attempt is slowed down; each connection has a thread of its own */

enum sst_login_verdict {
    SST_LOGIN_NONE = 0, /* no password was sent: the first request of most clients */
    SST_LOGIN_RIGHT = 1,
    SST_LOGIN_STALE = 2, /* right, but with a nonce that is too old, or was used before */
    SST_LOGIN_WRONG = 3,
    SST_LOGIN_STRAY = 4, /* answers a nonce of another process, as after a restart: not looked at */
};

/** The account of a publisher. */
struct sst_login {
    /* fixed after sst_login_open() */
    const char *section;                                      /* of the configuration: "rtsp" */
    char user[SST_LOGIN_USER], password[SST_LOGIN_PASSWORD];  /* user "": no password is required */
    uint8_t secret[32];
    struct sst_brake wrong, stray;               /* as over HTTP, by address, or by viewer */
    void (*report)(void *arg, const char *from); /* an address sent a wrong password; NULL: nobody is interested */
    void *arg;
    /* under lock */
    pthread_mutex_t lock;
    uint8_t viewer[64][16]; /* address and program of clients with the right password, a ring */
    int next;
};

/** A client, as far as guesses are concerned. */
struct sst_login_client {
    uint8_t network[16]; /* of sst_brake_network() */
    const char *address; /* for messages */
    const char *agent;   /* its User-Agent; NULL: none */
};

/** Read user and password. @param user  "": no password @param file  the password is its first line
 *  @return 0, -ENOENT, -EACCES, -EBADMSG (too short or long); logged */
SST_MUST_CHECK int sst_login_read(struct sst_login *login, const char *section, const char *user, const char *file);

/** Make the secret of nonces. @return 0, -EIO, -ENOSYS (no random numbers; logged) */
SST_MUST_CHECK int sst_login_open(struct sst_login *login);

/** Sign data and a text. @param out  hexadecimal */
void sst_login_sign(const struct sst_login *login, char out[65], const void *data, size_t bytes, const char *text);

/** A nonce for a challenge: its time, signed for the client's address, so that each answer to one of this process is
 * known for the guess that it may be, on whatever connection, and none has to be remembered. */
void sst_login_nonce(const struct sst_login *login, char out[SST_LOGIN_NONCE], const uint8_t network[16]);

/** @param old  out: too old @return false: not of this process, or another address's */
bool sst_login_nonce_is_ours(const struct sst_login *login, const char *nonce, const uint8_t network[16], bool *old);

/** Reserve the turn of an attempt of this client: an address that has guessed waits.
 *  @return ns to wait; -1: too many of it do already */
int64_t sst_login_turn(struct sst_login *login, const struct sst_login_client *client);

/** Note the verdict on an attempt: a client with the right password is not delayed by others beside it, wrong ones are
 * counted. @return true: a guess, to be slowed down by SST_LOGIN_PAUSE_MS */
bool sst_login_note(struct sst_login *login, const struct sst_login_client *client, enum sst_login_verdict verdict);

/** Hash of user, realm and password for Digest. */
void sst_login_ha1(const struct sst_login *login, char out[33]);

/** Response of Digest. @param qop  "nonce count:client's nonce:auth"; NULL: none, as RFC 2069 */
void sst_login_digest(char out[33], const char *ha1, const char *method_uri, const char *nonce, const char *qop);

/** Compare in a time that does not depend on where they differ. */
bool sst_login_equal(const char *a, const char *b);

/** @param address  numeric @return a listening socket that does not block, or -errno; logged */
SST_MUST_CHECK int sst_login_listen(const char *section, const char *address, int port);

#endif
