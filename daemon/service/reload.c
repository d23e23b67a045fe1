/* Reload: the new configuration applies as a whole, or the old one stays. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "daemon/service/service_internal.h"

/** Parts that all changes together restart. */
struct consequences {
    bool cameras, picture; /* are restarted */
    int later;             /* keys that wait for a restart */
};

static json_t *changes_json(const struct sst_config_change *c, int n, struct consequences *out)
{
    json_t *list = json_array();

    for (int i = 0; i < n; i++) {
        out->cameras |= c[i].class_ == SST_RELOAD_CAMERAS;
        out->picture |= c[i].class_ == SST_RELOAD_PICTURE || c[i].class_ == SST_RELOAD_CAMERAS;
        out->later += c[i].class_ == SST_RELOAD_DAEMON;
        json_array_append_new(list, json_pack("{s:s, s:s, s:s, s:s}", "key", c[i].key, "before", c[i].before, "after",
                                              c[i].after, "takes", sst_reload_class_name(c[i].class_)));
    }
    return list;
}

/* Keys that need a restart are in the answer; until then the parts keep their old values. */
static int apply(struct sst_service *s, struct sst_config *to, const struct sst_config *from,
                 const struct consequences *c)
{
    char site[256];

    pthread_mutex_lock(&s->parts);
    if (!s->open) {
        pthread_mutex_unlock(&s->parts);
        sst_log_error("the service is starting or ending; try again");
        return -EAGAIN;
    }
    sst_config_keep(to, from);
    pthread_mutex_lock(&s->lock);
    s->config = *to;
    pthread_mutex_unlock(&s->lock);
    if (sst_storage_configure(s->storage, to))
        sst_log_warning("storage keeps its settings: out of memory");
    engine_configure(s->engine, to, c->picture);
    if (!sst_array_same_masks(&from->array, &to->array))
        sst_storage_forget_views(s->storage);
    replay_configure(s->replay, to);
    sst_visits_configure(s->visits, to->storage.visits_days);
    service_configure_cases(s, to);
    service_site(site, to);
    sst_push_configure(s->push, &to->push, site);
    service_limit_visits(s);
    service_record_view(s);
    sst_hooks_configure(s->hooks, to->hook, to->hooks);
    if (c->cameras)
        array_configure(s->array, &to->array);
    pthread_mutex_unlock(&s->parts);
    return 0;
}

/* A renewed certificate behind the same names is a change, too. @return 0 or the error of sst_http_renew() */
static int renew(struct sst_service *s, const struct sst_config *to, bool dry_run, json_t *changes)
{
    struct sst_http_certificate before, after;
    char text[2][SST_CLOCK_TEXT];
    struct sst_http *http;
    int done;

    pthread_mutex_lock(&s->lock);
    http = s->http;
    pthread_mutex_unlock(&s->lock);
    /* Without a certificate, or to none: a restart is asked for. */
    if (!http || !sst_http_certificate(http, &before) || !to->web.tls_certificate[0] || !to->web.tls_key[0])
        return 0;
    done = sst_http_renew(http, to->web.tls_certificate, to->web.tls_key, dry_run, &after);
    if (done != 1)
        return done;
    sst_clock_text(text[0], before.until_s * 1000000000);
    sst_clock_text(text[1], after.until_s * 1000000000);
    json_array_append_new(changes, json_pack("{s:s, s:s%, s:s%, s:s}", "key", "certificate until", "before", text[0],
                                             10, "after", text[1], 10, "takes", "live"));
    return 0;
}

/** Apply a configuration, or report the changes that it would make. @return 0 (out->body is made) or an error, logged
 */
static int change(struct sst_service *s, struct sst_config *to, const struct sst_config *from, bool dry_run,
                  struct sst_api_answer *out)
{
    struct sst_config_change *changes;
    struct consequences all = { 0 };
    const int n = sst_config_diff(&changes, from, to);
    json_t *list;
    int err;

    if (n < 0)
        return n;
    list = changes_json(changes, n, &all);
    free(changes);
    if (!sst_array_same_masks(&from->array, &to->array)) /* also by a calibration that was written again */
        all.cameras = true;
    err = renew(s, to, dry_run, list);
    if (!err) {
        out->body = json_pack("{s:b, s:O, s:b, s:i}", "applied", !dry_run, "changes", list, "restarts_cameras",
                              all.cameras, "need_restart", all.later);
        err = out->body ? 0 : -ENOMEM;
    }
    if (!err && !dry_run)
        err = apply(s, to, from, &all);
    if (!err && !dry_run)
        sst_events_emit(s->events, SST_EVENT_INFO, "reload", json_pack("{s:b, s:O}", "applied", 1, "changes", list),
                        "configuration applied, %d keys changed%s", n,
                        all.later ? "; some need a restart of the service" : "");
    if (err) {
        json_decref(out->body);
        out->body = NULL;
    }
    json_decref(list);
    return err;
}

int service_apply(void *arg, bool dry_run, struct sst_api_answer *out)
{
    struct sst_service *s = arg;
    struct sst_config *to = calloc(1, sizeof(*to)), *from = calloc(1, sizeof(*from));
    char why[440] = "";
    int err = to && from ? 0 : -ENOMEM;

    pthread_mutex_lock(&s->reload); /* by signal and by request at a time, parts would get different halves */
    sst_log_copy_errors(why, sizeof(why));
    if (!err) {
        sst_config_defaults(to);
        err = sst_config_read(to, s->path[0] ? s->path : NULL);
    }
    if (!err) {
        pthread_mutex_lock(&s->lock);
        *from = s->config;
        pthread_mutex_unlock(&s->lock);
        err = change(s, to, from, dry_run, out);
    }
    sst_log_copy_errors(NULL, 0);
    if (err)
        snprintf(out->error, sizeof(out->error), "the configuration is not applied, the old one stays: %s",
                 why[0] ? why : strerror(-err));
    if (err && !dry_run)
        sst_events_emit(s->events, SST_EVENT_WARNING, "reload",
                        json_pack("{s:b, s:s}", "applied", 0, "reason", out->error),
                        "configuration refused, the old one stays: %.180s", why[0] ? why : strerror(-err));
    pthread_mutex_unlock(&s->reload);
    free(to);
    free(from);
    return err && err != -ENOMEM && err != -EAGAIN ? -EINVAL : err;
}

int sst_service_reload(struct sst_service *s)
{
    struct sst_api_answer answer = { 0 };
    const int err = service_apply(s, false, &answer);

    json_decref(answer.body);
    return err;
}
