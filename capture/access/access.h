/* capture/access/access.h - named tokens of the service in a file, and the audit log beside it. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_CAPTURE_ACCESS_ACCESS_H
#define SST_CAPTURE_ACCESS_ACCESS_H

#include <jansson.h>

#include "base/base.h"

#define SST_ACCESS_NAME   32 /* characters of a name: letters, digits, - _ . */
#define SST_ACCESS_SECRET 65 /* hexadecimal digits of a token, and the final 0 */
#define SST_ACCESS_TOKENS 64
#define SST_ACCESS_TEXT   64 /* bytes of rights as text */

/** Rights of a client; SST_RIGHT_CONTROL includes all others. */
enum sst_right {
    SST_RIGHT_VIEW = 1,       /* the page, live pictures, state, events, visits */
    SST_RIGHT_SNAPSHOT = 2,   /* single pictures alone: GET /snapshot */
    SST_RIGHT_RECORDINGS = 4, /* lists, plays and downloads recordings */
    SST_RIGHT_CONTROL = 8,    /* changes the service's state */
};
#define SST_RIGHTS_READ (SST_RIGHT_VIEW | SST_RIGHT_SNAPSHOT | SST_RIGHT_RECORDINGS)
#define SST_RIGHTS_ALL  (SST_RIGHTS_READ | SST_RIGHT_CONTROL)

/** A named token. Its secret is random, so that one hash of it reveals nothing. */
struct sst_access_token {
    char name[SST_ACCESS_NAME + 1];
    char sha256[65]; /* of the secret */
    unsigned rights; /* enum sst_right */
    int64_t created_s, expires_s; /* since 1970; expires_s 0: never */
};

struct sst_access_list {
    struct sst_access_token token[SST_ACCESS_TOKENS];
    int tokens;
};

/** "view,recordings" @return 0: a word is none of the rights, or there is none */
unsigned sst_access_rights(const char *text);
/** The right of one word. @return 0: it is none */
unsigned sst_access_right(const char *word, size_t n);
const char *sst_access_rights_text(unsigned rights, char out[SST_ACCESS_TEXT]);
/** ["view", "recordings"] */
json_t *sst_access_rights_json(unsigned rights);

/** Hash of a secret, as the file has it. */
void sst_access_hash(char out[65], const char *secret);

/**
 * Read the tokens of a file; none if there is no file.
 *
 * @param error  out [256], one sentence
 * @return 0, -EPERM (others can read or write it, or another user owns it), -EBADMSG (damaged), or the error of the
 *         read; *out has no tokens then
 */
SST_MUST_CHECK int sst_access_read(struct sst_access_list *out, const char *path, char error[256]);

/**
 * Add a token with a new secret. The file is written whole, with mode 0600 and the owner of the one before or of its
 * folder. Programs that change it wait for each other.
 *
 * @param token   name, rights, expires_s
 * @param secret  out [SST_ACCESS_SECRET]; it is stored nowhere
 * @return 0, -EINVAL (name, rights or time), -EEXIST (a token of that name), -ENOSPC (too many), errors of
 *         sst_access_read() and of the write; error has one sentence
 */
SST_MUST_CHECK int sst_access_add(const char *path, const struct sst_access_token *token, char *secret,
                                  char error[256]);

/** Remove a token by its name. @return 0, -ENOENT (there is none), or as sst_access_add() */
SST_MUST_CHECK int sst_access_revoke(const char *path, const char *name, char error[256]);

/** [{name, rights, created, expires, expired}]; expires is null where the token never does. */
json_t *sst_access_json(const struct sst_access_list *list, int64_t now_s);

#define SST_AUDIT_BYTES (1 << 20) /* of the file; beyond it is renamed to PATH.1, in place of the one before */

/** A line of the audit log: who did what. */
struct sst_audit {
    const char *name, *address, *action, *object; /* object may be "" */
};

/** Append to the file, created with mode 0600. @return 0 or the error of the write. One thread at a time */
SST_MUST_CHECK int sst_audit_write(const char *path, const struct sst_audit *line);

/** The last lines of both files, oldest first, each ended by a newline. @return to free with free(); NULL: no memory */
char *sst_audit_text(const char *path, int limit);

#endif
