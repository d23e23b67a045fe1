/* Named tokens: who a secret belongs to, and whether it still counts. Their file is read again when it has changed. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

#include "base/clock.h"
#include "base/log.h"
#include "daemon/publish/publish_internal.h"

static int64_t now_s(void)
{
    return sst_clock_wall_ns() / 1000000000;
}

void http_tokens_init(struct http_tokens *t, const char *token_file)
{
    memset(t, 0, sizeof(*t));
    pthread_mutex_init(&t->lock, NULL);
    if (token_file && snprintf(t->path, sizeof(t->path), "%s.named", token_file) >= (int)sizeof(t->path))
        t->path[0] = 0;
}

void http_tokens_fini(struct http_tokens *t)
{
    pthread_mutex_destroy(&t->lock);
}

static struct http_stamp stamp_of(const char *path)
{
    struct stat st;

    if (stat(path, &st))
        return (struct http_stamp){ 0 };
    return (struct http_stamp){ .dev = st.st_dev,
                                .ino = st.st_ino,
                                .bytes = st.st_size,
                                .changed_ns = st.st_ctim.tv_sec * INT64_C(1000000000) + st.st_ctim.tv_nsec };
}

/* The file is replaced as a whole, by the service or by `sst token`. */
static void refresh_locked(struct http_tokens *t)
{
    const struct http_stamp now = t->path[0] ? stamp_of(t->path) : t->stamp;
    char error[256];

    if (now.dev == t->stamp.dev && now.ino == t->stamp.ino && now.bytes == t->stamp.bytes &&
        now.changed_ns == t->stamp.changed_ns)
        return;
    t->stamp = now;
    if (sst_access_read(&t->list, t->path, error))
        sst_log_error("tokens: %s", error);
}

/* The first digits of its hash name a token, where sessions have names: no name of a session has a `t`. */
static void id_of(const struct sst_access_token *token, char id[HTTP_SESSION_NAME + 1])
{
    snprintf(id, HTTP_SESSION_NAME + 1, "t%.*s", HTTP_SESSION_NAME - 1, token->sha256);
}

static bool is_valid(const struct sst_access_token *token)
{
    return !token->expires_s || now_s() < token->expires_s;
}

static void grant(const struct sst_access_token *token, struct http_grant *out)
{
    *out = (struct http_grant){ .role = token->rights & SST_RIGHT_CONTROL ? SST_ROLE_CONTROL : SST_ROLE_VIEW,
                                .rights = token->rights };
    snprintf(out->user, sizeof(out->user), "%s", token->name);
    id_of(token, out->id);
}

bool http_tokens_find(struct http_tokens *t, const char *secret, struct http_grant *out)
{
    bool found = false;
    char hash[65];

    sst_access_hash(hash, secret);
    pthread_mutex_lock(&t->lock);
    refresh_locked(t);
    for (int i = 0; i < t->list.tokens; i++) { /* hashes of random secrets: their comparison reveals nothing */
        if (strcmp(t->list.token[i].sha256, hash) != 0 || !is_valid(&t->list.token[i]))
            continue;
        grant(&t->list.token[i], out);
        found = true;
    }
    pthread_mutex_unlock(&t->lock);
    return found;
}

bool http_tokens_lasts(struct http_tokens *t, const char *id, struct http_grant *out)
{
    char own[HTTP_SESSION_NAME + 1];
    bool found = false;

    pthread_mutex_lock(&t->lock);
    refresh_locked(t);
    for (int i = 0; i < t->list.tokens && !found; i++) {
        id_of(&t->list.token[i], own);
        found = !strcmp(own, id) && is_valid(&t->list.token[i]);
        if (found && out)
            grant(&t->list.token[i], out);
    }
    pthread_mutex_unlock(&t->lock);
    return found;
}

json_t *http_tokens_json(struct http_tokens *t)
{
    json_t *list;

    pthread_mutex_lock(&t->lock);
    refresh_locked(t);
    list = sst_access_json(&t->list, now_s());
    pthread_mutex_unlock(&t->lock);
    return list;
}
