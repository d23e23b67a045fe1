/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "publishers/login.h"

#include <assert.h>
#include <errno.h>
#include <md5.h>
#include <netdb.h>
#include <sha2.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/file.h"
#include "base/log.h"

#define BACKLOG           32
#define PASSWORD_FILE_MAX 4096
#define PASSWORD_LEAST    8 /* characters: 22,000 guesses a day are looked at, from one address */
#define BLOCK             SHA256_BLOCK_LENGTH

/* --- password, secret --------------------------------------------------------------------------------------------- */

static int read_password(struct sst_login *login, const char *path)
{
    struct stat st;
    uint8_t *data;
    size_t size, n;
    int err = sst_file_read_text(path, PASSWORD_FILE_MAX, &data, &size);

    if (err == -EACCES)
        sst_log_error("%s.password_file %s cannot be read by this user; chgrp sst-%s %s && chmod 640 %s",
                      login->section, path, login->section, path, path);
    if (err)
        return err;
    n = strcspn((const char *)data, "\r\n");
    if (n >= PASSWORD_LEAST && n < SST_LOGIN_PASSWORD) {
        memcpy(login->password, data, n);
        login->password[n] = 0;
    } else {
        sst_log_error("%s.password_file %s: its first line is the password, %d to %d characters, not %zu; shorter ones "
                      "are soon guessed",
                      login->section, path, PASSWORD_LEAST, SST_LOGIN_PASSWORD - 1, n);
        err = -EBADMSG;
    }
    free(data);
    if (!err && !stat(path, &st) && (st.st_mode & S_IROTH))
        sst_log_warning("%s.password_file %s can be read by everybody; chmod o= %s", login->section, path, path);
    return err;
}

int sst_login_read(struct sst_login *login, const char *section, const char *user, const char *file)
{
    login->section = section;
    snprintf(login->user, sizeof(login->user), "%s", user);
    return user[0] ? read_password(login, file) : 0;
}

int sst_login_open(struct sst_login *login)
{
    if (getentropy(login->secret, sizeof(login->secret))) {
        const int err = -errno;

        sst_log_error("%s: no random numbers: %s", login->section, strerror(-err));
        return err;
    }
    sst_brake_init(&login->wrong);
    sst_brake_init(&login->stray);
    pthread_mutex_init(&login->lock, NULL);
    return 0;
}

/* --- signatures, Digest ------------------------------------------------------------------------------------------- */

/* HMAC of SHA-256 (RFC 2104): hash of the key xor opad, and the hash of the key xor ipad and the message. */
void sst_login_sign(const struct sst_login *login, char out[65], const void *data, size_t bytes, const char *text)
{
    uint8_t inner[BLOCK], outer[BLOCK], hash[SHA256_DIGEST_LENGTH];
    SHA2_CTX context;

    static_assert(sizeof(login->secret) <= BLOCK, "a longer key is hashed first");
    memset(inner, 0x36, BLOCK);
    memset(outer, 0x5c, BLOCK);
    for (size_t i = 0; i < sizeof(login->secret); i++) {
        inner[i] ^= login->secret[i];
        outer[i] ^= login->secret[i];
    }
    SHA256Init(&context);
    SHA256Update(&context, inner, BLOCK);
    SHA256Update(&context, data, bytes);
    SHA256Update(&context, (const uint8_t *)text, strlen(text));
    SHA256Final(hash, &context);
    SHA256Init(&context);
    SHA256Update(&context, outer, BLOCK);
    SHA256Update(&context, hash, sizeof(hash));
    SHA256End(&context, out);
}

static uint32_t now_s(void)
{
    return (uint32_t)(sst_clock_now_ns() / 1000000000);
}

static void make_nonce(const struct sst_login *login, char out[SST_LOGIN_NONCE], uint32_t at_s,
                       const uint8_t network[16])
{
    char signature[65];

    snprintf(out, SST_LOGIN_NONCE, "%08x", (unsigned)at_s);
    sst_login_sign(login, signature, network, 16, out);
    snprintf(out + 8, SST_LOGIN_NONCE - 8, "%.32s", signature);
}

void sst_login_nonce(const struct sst_login *login, char out[SST_LOGIN_NONCE], const uint8_t network[16])
{
    make_nonce(login, out, now_s(), network);
}

bool sst_login_nonce_is_ours(const struct sst_login *login, const char *nonce, const uint8_t network[16], bool *old)
{
    char ours[SST_LOGIN_NONCE];
    unsigned at_s;

    *old = false;
    if (strlen(nonce) != SST_LOGIN_NONCE - 1 || sscanf(nonce, "%8x", &at_s) != 1)
        return false;
    make_nonce(login, ours, at_s, network);
    *old = now_s() - at_s > SST_LOGIN_NONCE_S;
    return sst_login_equal(ours, nonce);
}

static void md5_join(char out[33], const char *const *parts)
{
    MD5_CTX context;

    MD5Init(&context);
    for (int i = 0; parts[i]; i++) {
        if (i)
            MD5Update(&context, (const uint8_t *)":", 1);
        MD5Update(&context, (const uint8_t *)parts[i], strlen(parts[i]));
    }
    MD5End(&context, out);
}

void sst_login_ha1(const struct sst_login *login, char out[33])
{
    md5_join(out, (const char *const[]){ login->user, SST_LOGIN_REALM, login->password, NULL });
}

void sst_login_digest(char out[33], const char *ha1, const char *method_uri, const char *nonce, const char *qop)
{
    char ha2[33];

    md5_join(ha2, (const char *const[]){ method_uri, NULL });
    md5_join(out, qop ? (const char *const[]){ ha1, nonce, qop, ha2, NULL }
                      : (const char *const[]){ ha1, nonce, ha2, NULL, NULL });
}

bool sst_login_equal(const char *a, const char *b)
{
    const size_t n = strlen(a);
    unsigned differ = 0;

    if (n != strlen(b)) /* lengths are no secret */
        return false;
    for (size_t i = 0; i < n; i++)
        differ |= (unsigned char)a[i] ^ (unsigned char)b[i];
    return !differ;
}

/* --- guessing clients --------------------------------------------------------------------------------------------- */

/* All clients of an address share its attempts, but a program that has had the right password before: a guessing client
 * beside it does not cut it off. */
static void identify(struct sst_login *login, const struct sst_login_client *c, uint8_t who[16], bool remember)
{
    char signature[65];
    bool known = false;

    sst_login_sign(login, signature, c->network, 16, c->agent ? c->agent : "");
    pthread_mutex_lock(&login->lock);
    for (size_t i = 0; i < ARRAY_LEN(login->viewer) && !known; i++)
        known = !memcmp(login->viewer[i], signature, 16);
    if (remember && !known) {
        memcpy(login->viewer[login->next], signature, 16);
        login->next = (login->next + 1) % (int)ARRAY_LEN(login->viewer);
        known = true;
    }
    pthread_mutex_unlock(&login->lock);
    memcpy(who, known ? (const uint8_t *)signature : c->network, 16);
}

int64_t sst_login_turn(struct sst_login *login, const struct sst_login_client *client)
{
    uint8_t who[16];

    identify(login, client, who, false);
    return sst_brake_turn(&login->wrong, who, sst_clock_now_ns());
}

static void count_attempt(struct sst_login *login, const struct sst_login_client *c)
{
    bool first = false;
    uint8_t who[16];
    int left_s;

    sst_log_warning("%s: %s sent a wrong user or password", login->section, c->address);
    if (login->report)
        login->report(login->arg, c->address);
    identify(login, c, who, false);
    left_s = sst_brake_wrong(&login->wrong, who, sst_clock_now_ns(), &first);
    if (first)
        sst_log_warning("%s: %s sent %d wrong passwords within a minute: for %d s one each %d s is looked at",
                        login->section, c->address, SST_BRAKE_WRONG + 1, left_s, SST_BRAKE_TURN_S);
}

bool sst_login_note(struct sst_login *login, const struct sst_login_client *client, enum sst_login_verdict verdict)
{
    uint8_t who[16];
    bool first;

    if (verdict == SST_LOGIN_RIGHT)
        identify(login, client, who, true);
    /* A few strays a minute are free: every client sends one after a restart. */
    if (verdict == SST_LOGIN_WRONG ||
        (verdict == SST_LOGIN_STRAY &&
         sst_brake_wrong(&login->stray, client->network, sst_clock_now_ns(), &first) > 0))
        count_attempt(login, client);
    return verdict == SST_LOGIN_WRONG || verdict == SST_LOGIN_STRAY;
}

/* --- the listening socket ----------------------------------------------------------------------------------------- */

static int resolve(struct addrinfo **out, const char *address, int port)
{
    const struct addrinfo hints = { .ai_flags = AI_NUMERICHOST | AI_NUMERICSERV | AI_PASSIVE,
                                    .ai_socktype = SOCK_STREAM };
    char service[16];

    snprintf(service, sizeof(service), "%d", port);
    return port < 0 || port > 65535 || getaddrinfo(address, service, &hints, out) ? -EINVAL : 0;
}

int sst_login_listen(const char *section, const char *address, int port)
{
    const int one = 1;
    struct addrinfo *at;
    int fd, err = resolve(&at, address, port);

    if (err)
        return err;
    fd = socket(at->ai_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (fd < 0 || setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &one, sizeof(one)) ||
        bind(fd, at->ai_addr, at->ai_addrlen) || listen(fd, BACKLOG)) {
        err = -errno;
        if (err == -EADDRINUSE)
            sst_log_error("%s.address %s, port %d: another program listens there; `ss -ltnp` names it; stop it or set "
                          "%s.port",
                          section, address, port, section);
        else
            sst_log_error("%s.address %s, port %d: %s; set %s.address and %s.port", section, address, port,
                          strerror(-err), section, section);
        if (fd >= 0)
            close(fd);
    }
    freeaddrinfo(at);
    return err ? err : fd;
}
