/* Authentication: Digest of HTTP (RFC 7616, MD5) and WS-UsernameToken. Each proof of the password is accepted once. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <assert.h>
#include <sha1.h>
#include <sha2.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "base/clock.h"
#include "base/log.h"
#include "publishers/onvif/onvif_internal.h"

#define SECOND     INT64_C(1000000000)
#define VALUE      256 /* characters of a value in a header */
#define NONCE_MOST 256 /* bytes of a token's nonce */

void auth_init(struct auth *a, struct sst_login *login)
{
    memset(a, 0, sizeof(*a));
    a->login = login;
    sst_login_ha1(login, a->ha1);
    pthread_mutex_init(&a->lock, NULL);
}

/* The proof is used from now on, by no clock: a proof is never right twice. @return false: it was used before */
static bool use_once(struct auth *a, const char *const *parts)
{
    uint8_t hash[SHA256_DIGEST_LENGTH];
    SHA2_CTX context;
    bool fresh = true;

    SHA256Init(&context);
    for (int i = 0; parts[i]; i++)
        SHA256Update(&context, (const uint8_t *)parts[i], strlen(parts[i]) + 1);
    SHA256Final(hash, &context);
    pthread_mutex_lock(&a->lock);
    for (int i = 0; i < AUTH_TOKENS && fresh; i++)
        fresh = memcmp(a->used[i], hash, sizeof(a->used[i])) != 0;
    if (fresh) {
        memcpy(a->used[a->next], hash, sizeof(a->used[a->next]));
        a->next = (a->next + 1) % AUTH_TOKENS;
    }
    pthread_mutex_unlock(&a->lock);
    return fresh;
}

/* --- Digest ------------------------------------------------------------------------------------------------------- */

/* Value of a parameter, with or without quotation marks. @return false: there is none, or it is too long */
static bool param(const char *header, const char *name, char out[VALUE])
{
    const size_t length = strlen(name);

    while (*header) {
        size_t n = 0;
        bool mine, quoted;

        header += strspn(header, " \t,");
        mine = !strncasecmp(header, name, length) && header[length + strspn(header + length, " \t")] == '=';
        header += strcspn(header, "=,");
        if (*header != '=')
            continue;
        header++;
        header += strspn(header, " \t");
        quoted = *header == '"';
        for (header += quoted; *header && (quoted ? *header != '"' : !strchr(" \t,", *header)); header++) {
            header += quoted && *header == '\\' && header[1];
            if (mine && n == VALUE - 1)
                return false;
            if (mine)
                out[n++] = *header;
        }
        header += *header == '"';
        out[mine ? n : 0] = 0;
        if (mine)
            return true;
    }
    out[0] = 0;
    return false;
}

/* The path of an address, as the server sees it: without scheme, host and question. */
static bool is_path(const char *uri, const char *path)
{
    const char *host = strstr(uri, "://");
    size_t n;

    if (host && host < uri + strcspn(uri, "/?"))
        uri = host + 3 + strcspn(host + 3, "/");
    n = strcspn(uri, "?");
    return n == strlen(path) && !memcmp(uri, path, n);
}

static enum sst_login_verdict judge_digest(struct auth *a, const struct auth_request *r)
{
    char user[VALUE], realm[VALUE], nonce[VALUE], uri[VALUE], response[VALUE], qop[VALUE], nc[VALUE], cnonce[VALUE];
    char joined[3 * VALUE] = "", method_uri[VALUE + 16], want[33];
    const char *header = r->authorization + strlen("Digest ");
    bool old, with_qop;

    if (!param(header, "nonce", nonce))
        return SST_LOGIN_WRONG;
    if (!sst_login_nonce_is_ours(a->login, nonce, r->client.network, &old))
        return SST_LOGIN_STRAY;
    if (!param(header, "username", user) || !param(header, "realm", realm) || !param(header, "uri", uri) ||
        !param(header, "response", response))
        return SST_LOGIN_WRONG;
    with_qop = param(header, "qop", qop);
    if (with_qop && (!param(header, "nc", nc) || !param(header, "cnonce", cnonce) || strcmp(qop, "auth") != 0))
        return SST_LOGIN_WRONG;
    if (with_qop)
        snprintf(joined, sizeof(joined), "%s:%s:%s", nc, cnonce, qop);
    snprintf(method_uri, sizeof(method_uri), "%.10s:%s", r->method, uri);
    sst_login_digest(want, a->ha1, method_uri, nonce, with_qop ? joined : NULL);
    for (char *c = response; *c; c++)
        *c |= *c >= 'A' && *c <= 'F' ? 0x20 : 0;
    if (!sst_login_equal(user, a->login->user) || strcmp(realm, SST_LOGIN_REALM) != 0 || !is_path(uri, r->path) ||
        !sst_login_equal(want, response))
        return SST_LOGIN_WRONG;
    if (old || !use_once(a, (const char *const[]){ nonce, joined, response, NULL }))
        return SST_LOGIN_STALE;
    return SST_LOGIN_RIGHT;
}

/* --- WS-UsernameToken --------------------------------------------------------------------------------------------- */

static void log_clock(struct auth *a, const char *address, int64_t ahead_ns)
{
    const int64_t now_ns = sst_clock_now_ns();
    bool log;

    pthread_mutex_lock(&a->lock);
    log = !a->clock_logged_ns || now_ns - a->clock_logged_ns > 60 * SECOND;
    a->clock_logged_ns = log ? now_ns : a->clock_logged_ns;
    pthread_mutex_unlock(&a->lock);
    if (log)
        sst_log_warning("onvif: the clock of %s is %lld s %s this machine's, more than %d s, so that its password is not "
                        "accepted; set both by NTP",
                        address, (long long)(llabs(ahead_ns) / SECOND), ahead_ns > 0 ? "ahead of" : "behind",
                        ONVIF_CLOCK_S);
}

/* PasswordDigest = Base64(SHA-1(nonce, created, password)). */
static bool is_token_right(const struct auth *a, const char *nonce64, const char *created, const char *password)
{
    uint8_t nonce[NONCE_MOST], hash[SHA1_DIGEST_LENGTH];
    char want[4 * ((SHA1_DIGEST_LENGTH + 2) / 3) + 1];
    const int bytes = value_base64(nonce64, nonce, sizeof(nonce));
    SHA1_CTX context;

    if (bytes < 0)
        return false;
    SHA1Init(&context);
    SHA1Update(&context, nonce, (size_t)bytes);
    SHA1Update(&context, (const uint8_t *)created, strlen(created));
    SHA1Update(&context, (const uint8_t *)a->login->password, strlen(a->login->password));
    SHA1Final(hash, &context);
    value_to_base64(want, hash, sizeof(hash));
    return sst_login_equal(want, password);
}

static enum sst_login_verdict judge_token(struct auth *a, const struct auth_request *r, int token, int64_t wall_ns)
{
    const struct soap *s = r->soap;
    const char *user = soap_text(s, token, "Username"), *nonce = soap_text(s, token, "Nonce"),
               *created = soap_text(s, token, "Created"), *password = soap_text(s, token, "Password");
    int64_t at_ns;

    if (!user || !nonce || !created || !password || !*nonce)
        return SST_LOGIN_WRONG;
    if (!sst_login_equal(user, a->login->user) || !is_token_right(a, nonce, created, password) ||
        !value_time(created, &at_ns))
        return SST_LOGIN_WRONG;
    if (llabs(at_ns - wall_ns) > ONVIF_CLOCK_S * SECOND) {
        log_clock(a, r->client.address, at_ns - wall_ns);
        return SST_LOGIN_STALE;
    }
    /* Without the nonce: its bytes have many forms in Base64, and the digest over them has a single form. */
    if (!use_once(a, (const char *const[]){ created, password, NULL }))
        return SST_LOGIN_STALE;
    return SST_LOGIN_RIGHT;
}

/* Neither a password in plain text nor one of nobody is looked at, so that they are no guesses: clients try them before
 * they know better. */
static int find_token(const struct soap *s)
{
    const int token = soap_child(s, soap_child(s, s->header, "Security"), "UsernameToken");
    const int at = soap_child(s, token, "Password");
    const char *user = soap_text(s, token, "Username");

    if (user && !*user)
        return -1;
    return at >= 0 && s->node[at].type && !strstr(s->node[at].type, "#PasswordDigest") ? -1 : token;
}

enum sst_login_verdict auth_judge(struct auth *a, const struct auth_request *r, int64_t wall_ns)
{
    const bool digest = r->authorization && !strncasecmp(r->authorization, "Digest ", strlen("Digest "));
    int token;

    if (!a->login->user[0])
        return SST_LOGIN_RIGHT;
    if (digest)
        return judge_digest(a, r);
    token = r->soap ? find_token(r->soap) : -1;
    return token < 0 ? SST_LOGIN_NONE : judge_token(a, r, token, wall_ns);
}
