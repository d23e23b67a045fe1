/* daemon/publish/sessions_internal.h - clients of the HTTP server: tokens, sessions, users of proxies, the audit log. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_DAEMON_PUBLISH_SESSIONS_INTERNAL_H
#define SST_DAEMON_PUBLISH_SESSIONS_INTERNAL_H

#include <pthread.h>
#include <sys/types.h>

#include "base/brake.h"
#include "base/file.h"
#include "capture/access/access.h"
#include "daemon/publish/http.h"

struct http_request;

#define HTTP_TOKEN_MAX    128   /* characters of a token */

/* --- sessions of browsers (http_sessions.c) ----------------------------------------------------------------------- */

#define HTTP_SESSIONS_ROLE    64 /* of one role: then the one of it that was not used for longest ends, ... */
#define HTTP_SESSIONS_ADDRESS 32 /* ... of one address and role: then one of these */
#define HTTP_SESSIONS_MAX     (2 * HTTP_SESSIONS_ROLE)
#define HTTP_SESSION_S        INT64_C(2592000) /* 30 days after the login */
#define HTTP_SECRET           64               /* hex digits of a cookie's secret: random, 256 bits */
#define HTTP_SESSION_NAME     12               /* its first digits name it; too few to guess the rest */

/** A client that has authenticated. */
struct http_grant {
    enum sst_role role;
    unsigned rights;                     /* enum sst_right */
    char user[SST_ACCESS_NAME + 1];      /* name of the token; "view", "control": one of web.token_file */
    char id[HTTP_SESSION_NAME + 1];      /* of a named token, as http_session_lasts() has it; "": another */
    char session[HTTP_SESSION_NAME + 1]; /* of a cookie; "": none */
};

/* --- named tokens (http_tokens.c) --------------------------------------------------------------------------------- */

struct http_stamp { /* of a file; zeros: there is none */
    dev_t dev;
    ino_t ino;
    off_t bytes;
    int64_t changed_ns;
};

struct http_tokens {
    char path[SST_PATH_MAX]; /* fixed after init; "": there are none */
    pthread_mutex_t lock;    /* within that of sessions */
    /* under lock */
    struct http_stamp stamp; /* of the file when it was read */
    struct sst_access_list list;
};

/** @param token_file  beside which they are kept; NULL: there are none */
void http_tokens_init(struct http_tokens *t, const char *token_file);
void http_tokens_fini(struct http_tokens *t);
/** Find the token of a secret. @return false: no token has it, or it has expired */
bool http_tokens_find(struct http_tokens *t, const char *secret, struct http_grant *out);
/** Does the token of an id still count? @param out  NULL: of no interest */
bool http_tokens_lasts(struct http_tokens *t, const char *id, struct http_grant *out);
json_t *http_tokens_json(struct http_tokens *t);

struct http_session {
    char secret[HTTP_SECRET + 1]; /* "": none */
    char token[HTTP_SESSION_NAME + 1]; /* id of the named token that it was opened with; "": another */
    enum sst_role role;
    uint64_t tag;              /* of the token that it was opened with: another token ends it */
    int64_t since_ns, seen_ns; /* wall */
    char address[64], agent[160];
};

struct http_sessions {
    char path[SST_PATH_MAX]; /* fixed after init; "": they end with the service */
    uint64_t tag[2];         /* fixed after init; of the view token, of the control token */
    struct http_tokens *tokens; /* fixed after init; NULL: no named ones */
    pthread_mutex_t lock;
    struct http_session session[HTTP_SESSIONS_MAX]; /* under lock */
    uint64_t changes;                               /* under lock */
    pthread_mutex_t writing;                        /* before lock */
    uint64_t written;                               /* under writing: the changes that the file has */
    bool failed;                                    /* under writing: they could not be written */
};

/** Write a file that is the service's alone from its creation on, unlike outputs of base/file.h. @return 0 or -errno */
SST_MUST_CHECK int http_write_private(const char *path, const char *text);
/** Random bytes, at most 32, as hexadecimal digits. @return false: there is no source of them */
SST_MUST_CHECK bool http_random_text(char *out, size_t bytes);
/** FNV-1a. */
uint64_t http_hash(const void *data, size_t bytes);
/** @param path  of the control token, beside which they are kept; NULL: nowhere */
void http_sessions_init(struct http_sessions *s, const char *path, const char *control, const char *view);
void http_sessions_fini(struct http_sessions *s);
/** A token was right. @param secret  out, for the cookie @return false: no random bytes */
SST_MUST_CHECK bool http_session_begin(struct http_sessions *s, const struct http_grant *grant, const char *address,
                                       const char *agent, char secret[HTTP_SECRET + 1]);
/** Client of a cookie, noted as its last use. @return false: it is none of a session, or its session has ended */
bool http_session_check(struct http_sessions *s, const char *secret, struct http_grant *out);
/** Has it not ended meanwhile? @param name  of a session, or id of a named token; "": none, which lasts */
bool http_session_lasts(struct http_sessions *s, const char *name);
/** @return false: there is none */
bool http_session_end(struct http_sessions *s, const char *name);
/** [{session, role, address, agent, since, seen, own}]. @param own  name of the one that asks; all: others', too */
json_t *http_sessions_json(struct http_sessions *s, const char *own, bool all);

/* --- authorization (http_auth.c) ---------------------------------------------------------------------------------- */

struct http_auth {
    /* fixed after open */
    char control[HTTP_TOKEN_MAX + 1], view[HTTP_TOKEN_MAX + 1]; /* "": no TCP */
    gid_t group, view_group;                                    /* (gid_t)-1: none */
    char group_name[64];
    struct sst_brake brake;
    struct http_tokens tokens;
    struct http_sessions sessions;
};

SST_MUST_CHECK int http_auth_init(struct http_auth *a, const struct sst_http_config *cfg);
void http_auth_fini(struct http_auth *a);

/** Client of a token: of web.token_file, or a named one. @return false: it is wrong, revoked or expired */
bool http_auth_token(struct http_auth *a, const char *token, struct http_grant *out);

/** Role of the peer of a UNIX socket. @param who  out [96], name of the peer for messages */
enum sst_role http_auth_peer(const struct http_auth *a, int fd, char *who);

/* --- access of users (http_access.c) ------------------------------------------------------------------------------ */

#define HTTP_PROXIES 8

struct http_proxies { /* fixed after open */
    uint8_t address[HTTP_PROXIES][16];
    int count; /* 0: the header is one like others */
    char header[64];
    unsigned rights;
};

struct http_audit {
    char path[SST_PATH_MAX]; /* fixed after open; "": none */
    pthread_mutex_t lock;    /* held while the file is read and written */
    bool failed;             /* under lock */
};

/** Name of the user that asks: of its named token, of the proxy, else the role of its token or group. */
const char *http_user(const struct http_request *q);

void http_proxies_init(struct http_proxies *p, const struct sst_http_config *cfg);
/** The identity that a proxy reports: rights, role and user of the request. @return -1: go on; else answered */
int http_check_proxy(struct http_request *q);
/** Rights of which one is needed. */
unsigned http_rights_of(const struct sst_route *route, bool replay);
void http_audit_init(struct http_audit *a, const char *token_file);
/** Note an action of this client. */
void http_audit(struct http_request *q, const char *action, const char *object);
/** Note what a request has changed, if it has. */
void http_audit_answer(struct http_request *q, int status);

#endif
