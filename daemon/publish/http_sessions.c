/* Sessions of browsers: role, address, time of login. A cookie holds the secret of one, never the token.
 * They are kept in a file beside the token's, so that sessions survive a restart of the service. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <fcntl.h>
#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/file.h"
#include "base/log.h"
#include "daemon/publish/publish_internal.h"

#define LIFE_NS  (HTTP_SESSION_S * INT64_C(1000000000))
#define FILE_MAX ((size_t)1 << 20)

static bool is_hex(const char *text, size_t n)
{
    return strlen(text) == n && strspn(text, "0123456789abcdef") == n;
}

uint64_t http_hash(const void *data, size_t bytes)
{
    uint64_t h = UINT64_C(14695981039346656037);

    for (const uint8_t *p = data; bytes--; p++)
        h = (h ^ *p) * UINT64_C(1099511628211);
    return h;
}

static bool is_valid_locked(const struct http_sessions *s, const struct http_session *one, int64_t now_ns)
{
    if (!one->secret[0] || now_ns - one->since_ns >= LIFE_NS)
        return false;
    if (one->token[0])
        return s->tokens && http_tokens_lasts(s->tokens, one->token, NULL);
    return one->tag == s->tag[one->role == SST_ROLE_CONTROL];
}

/* --- the file ----------------------------------------------------------------------------------------------------- */

int http_write_private(const char *path, const char *text)
{
    char fresh[SST_PATH_MAX + 8];
    const size_t n = strlen(text);
    int fd, err = 0;

    snprintf(fresh, sizeof(fresh), "%s.new", path);
    (void)unlink(fresh);
    fd = open(fresh, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
    if (fd < 0)
        return -errno;
    errno = 0;
    if (write(fd, text, n) != (ssize_t)n || fsync(fd))
        err = errno ? -errno : -EIO;
    close(fd);
    if (!err && rename(fresh, path))
        err = -errno;
    if (err)
        (void)unlink(fresh);
    return err;
}

static char *text_locked(const struct http_sessions *s)
{
    json_t *list = json_array();
    char *text;

    for (int i = 0; i < HTTP_SESSIONS_MAX; i++) {
        const struct http_session *one = &s->session[i];

        if (one->secret[0])
            json_array_append_new(list, json_pack("{s:s, s:s, s:b, s:I, s:I, s:I, s:s, s:s}", "secret", one->secret,
                                                  "token", one->token, "control",
                                                  one->role == SST_ROLE_CONTROL, "tag", (json_int_t)one->tag, "since_ns",
                                                  (json_int_t)one->since_ns, "seen_ns", (json_int_t)one->seen_ns,
                                                  "address", one->address, "agent", one->agent));
    }
    text = json_dumps(list, JSON_INDENT(1));
    json_decref(list);
    return text;
}

/* Have all changes up to now in the file. The disk is waited for without the lock, which every request with a cookie
 * needs; changes that come meanwhile are written together. */
static void save(struct http_sessions *s)
{
    uint64_t changes;
    char *text = NULL;
    int err = -ENOMEM;

    if (!s->path[0])
        return;
    pthread_mutex_lock(&s->writing);
    pthread_mutex_lock(&s->lock);
    changes = s->changes;
    if (changes != s->written)
        text = text_locked(s);
    pthread_mutex_unlock(&s->lock);
    if (text)
        err = http_write_private(s->path, text);
    if (changes != s->written) {
        if (err && !s->failed)
            sst_log_warning("sessions %s cannot be written: %s; a restart of the service logs browsers out", s->path,
                            strerror(-err));
        s->failed = err != 0;
        s->written = err ? s->written : changes;
    }
    pthread_mutex_unlock(&s->writing);
    free(text);
}

static void read_one(struct http_session *out, const json_t *o)
{
    const char *secret, *address, *agent, *token = "";
    json_int_t tag, since, seen;
    int control;

    if (json_unpack((json_t *)o, "{s:s, s?s, s:b, s:I, s:I, s:I, s:s, s:s}", "secret", &secret, "token", &token, "control", &control, "tag", &tag,
                    "since_ns", &since, "seen_ns", &seen, "address", &address, "agent", &agent) ||
        !is_hex(secret, HTTP_SECRET))
        return;
    *out = (struct http_session){ .role = control ? SST_ROLE_CONTROL : SST_ROLE_VIEW,
                                  .tag = (uint64_t)tag,
                                  .since_ns = since,
                                  .seen_ns = seen };
    snprintf(out->secret, sizeof(out->secret), "%s", secret);
    snprintf(out->token, sizeof(out->token), "%s", token);
    snprintf(out->address, sizeof(out->address), "%s", address);
    snprintf(out->agent, sizeof(out->agent), "%s", agent);
}

void http_sessions_init(struct http_sessions *s, const char *path, const char *control, const char *view)
{
    uint8_t *text = NULL;
    size_t bytes = 0, i;
    json_t *list = NULL;
    const json_t *one;

    memset(s, 0, sizeof(*s));
    pthread_mutex_init(&s->lock, NULL);
    pthread_mutex_init(&s->writing, NULL);
    s->tag[0] = http_hash(view, strlen(view)); /* of the login's token; the file lies beside the token itself */
    s->tag[1] = http_hash(control, strlen(control));
    if (!path || snprintf(s->path, sizeof(s->path), "%s.sessions", path) >= (int)sizeof(s->path))
        s->path[0] = 0;
    if (s->path[0] && sst_path_exists(s->path) && !sst_file_read(s->path, FILE_MAX, &text, &bytes))
        list = json_loadb((const char *)text, bytes, 0, NULL); /* a damaged one: all log in again */
    json_array_foreach(list, i, one)
    {
        if (i < HTTP_SESSIONS_MAX)
            read_one(&s->session[i], one);
    }
    json_decref(list);
    free(text);
}

void http_sessions_fini(struct http_sessions *s)
{
    pthread_mutex_destroy(&s->lock);
    pthread_mutex_destroy(&s->writing);
    explicit_bzero(s, sizeof(*s));
}

/* --- logging in and out ------------------------------------------------------------------------------------------- */

bool http_random_text(char *out, size_t bytes)
{
    uint8_t random[32];

    if (bytes > sizeof(random) || getentropy(random, bytes))
        return false;
    for (size_t i = 0; i < bytes; i++)
        snprintf(out + 2 * i, 3, "%02x", random[i]);
    return true;
}

/* Text of a client, without characters that a list cannot have. */
static void copy_plain(char *out, size_t size, const char *text)
{
    size_t n = 0;

    for (; text && *text && n + 1 < size; text++)
        if (*text >= ' ' && *text < 127)
            out[n++] = *text;
    out[n] = 0;
}

/* Place of a new session: frequent logins end sessions of the same address and role. */
static struct http_session *make_room_locked(struct http_sessions *s, enum sst_role role, const char *address,
                                             int64_t now_ns)
{
    struct http_session *free_one = NULL, *oldest = NULL, *own = NULL;
    int of_role = 0, of_address = 0;

    for (int i = 0; i < HTTP_SESSIONS_MAX; i++) {
        struct http_session *one = &s->session[i];

        if (!is_valid_locked(s, one, now_ns)) {
            *one = (struct http_session){ 0 };
            free_one = one;
            continue;
        }
        if (one->role != role)
            continue;
        of_role++;
        oldest = !oldest || one->seen_ns < oldest->seen_ns ? one : oldest;
        if (strcmp(one->address, address))
            continue;
        of_address++;
        own = !own || one->seen_ns < own->seen_ns ? one : own;
    }
    if (of_address >= HTTP_SESSIONS_ADDRESS || of_role >= HTTP_SESSIONS_ROLE)
        return of_address >= HTTP_SESSIONS_ADDRESS ? own : oldest;
    return free_one ? free_one : &s->session[0]; /* there is one, unless the file was made by somebody else */
}

bool http_session_begin(struct http_sessions *s, const struct http_grant *grant, const char *address, const char *agent,
                        char secret[HTTP_SECRET + 1])
{
    const int64_t now_ns = sst_clock_wall_ns();
    const enum sst_role role = grant->role;
    struct http_session new = {
        .role = role, .tag = s->tag[role == SST_ROLE_CONTROL], .since_ns = now_ns, .seen_ns = now_ns
    };

    if (!http_random_text(secret, HTTP_SECRET / 2))
        return false;
    memcpy(new.secret, secret, HTTP_SECRET + 1);
    copy_plain(new.address, sizeof(new.address), address);
    copy_plain(new.agent, sizeof(new.agent), agent);
    memcpy(new.token, grant->id, sizeof(new.token));
    pthread_mutex_lock(&s->lock);
    *make_room_locked(s, role, new.address, now_ns) = new;
    s->changes++;
    pthread_mutex_unlock(&s->lock);
    explicit_bzero(&new, sizeof(new));
    save(s);
    return true;
}

/* Rights of a session: of its named token as they are now, else of its role. */
static void grant_locked(const struct http_sessions *s, const struct http_session *one, struct http_grant *out)
{
    const bool control = one->role == SST_ROLE_CONTROL;

    *out = (struct http_grant){ .role = one->role, .rights = control ? SST_RIGHTS_ALL : SST_RIGHTS_READ };
    strcpy(out->user, control ? "control" : "view");
    if (one->token[0] && !http_tokens_lasts(s->tokens, one->token, out))
        *out = (struct http_grant){ 0 };
    snprintf(out->session, sizeof(out->session), "%.*s", HTTP_SESSION_NAME, one->secret);
}

bool http_session_check(struct http_sessions *s, const char *secret, struct http_grant *out)
{
    const int64_t now_ns = sst_clock_wall_ns();

    *out = (struct http_grant){ 0 };
    if (!is_hex(secret, HTTP_SECRET))
        return false;
    pthread_mutex_lock(&s->lock);
    for (int i = 0; i < HTTP_SESSIONS_MAX; i++) {
        struct http_session *one = &s->session[i];
        volatile unsigned difference = !one->secret[0];

        for (size_t k = 0; k < HTTP_SECRET; k++) /* in constant time */
            difference |= (unsigned)(one->secret[k] ^ secret[k]);
        if (difference || !is_valid_locked(s, one, now_ns))
            continue;
        one->seen_ns = now_ns;
        grant_locked(s, one, out);
    }
    pthread_mutex_unlock(&s->lock);
    return out->role != SST_ROLE_ANYONE;
}

static struct http_session *find_locked(struct http_sessions *s, const char *name)
{
    for (int i = 0; i < HTTP_SESSIONS_MAX; i++)
        if (s->session[i].secret[0] && !strncmp(s->session[i].secret, name, HTTP_SESSION_NAME) &&
            is_valid_locked(s, &s->session[i], sst_clock_wall_ns()))
            return &s->session[i];
    return NULL;
}

bool http_session_lasts(struct http_sessions *s, const char *name)
{
    bool lasts;

    if (!name[0])
        return true;
    if (*name == 't') /* no digit of a session's name */
        return s->tokens && http_tokens_lasts(s->tokens, name, NULL);
    pthread_mutex_lock(&s->lock);
    lasts = find_locked(s, name) != NULL;
    pthread_mutex_unlock(&s->lock);
    return lasts;
}

bool http_session_end(struct http_sessions *s, const char *name)
{
    struct http_session *one;

    pthread_mutex_lock(&s->lock);
    one = is_hex(name, HTTP_SESSION_NAME) ? find_locked(s, name) : NULL;
    if (one) {
        explicit_bzero(one, sizeof(*one));
        s->changes++;
    }
    pthread_mutex_unlock(&s->lock);
    if (one)
        save(s);
    return one != NULL;
}

json_t *http_sessions_json(struct http_sessions *s, const char *own, bool all)
{
    const int64_t now_ns = sst_clock_wall_ns();
    json_t *list = json_array();
    struct http_grant grant;
    char since[SST_CLOCK_TEXT], seen[SST_CLOCK_TEXT], name[HTTP_SESSION_NAME + 1];

    pthread_mutex_lock(&s->lock);
    for (int i = 0; i < HTTP_SESSIONS_MAX; i++) {
        const struct http_session *one = &s->session[i];
        const bool mine = own[0] && !strncmp(one->secret, own, HTTP_SESSION_NAME);

        if (!is_valid_locked(s, one, now_ns) || !(all || mine))
            continue;
        snprintf(name, sizeof(name), "%.*s", HTTP_SESSION_NAME, one->secret);
        sst_clock_text(since, one->since_ns);
        sst_clock_text(seen, one->seen_ns);
        grant_locked(s, one, &grant);
        json_array_append_new(list, json_pack("{s:s, s:s, s:s, s:s, s:s, s:s, s:s, s:b}", "session", name, "role",
                                              one->role == SST_ROLE_CONTROL ? "control" : "view", "user", grant.user,
                                              "address", one->address,
                                              "agent", one->agent, "since", since, "seen", seen, "own", mine));
    }
    pthread_mutex_unlock(&s->lock);
    return list;
}
