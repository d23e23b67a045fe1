/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "daemon/service/service.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/log.h"
#include "base/text.h"
#include "base/thread.h"
#include "capture/access/access.h"
#include "daemon/service/service_internal.h"

#define EVENTS_KEPT   1000
#define STOP_NS       INT64_C(900000000) /* for all of it, */
#define SETS_NS       INT64_C(250000000) /* of which sets on their way have this, to be recorded ... */
#define FREE_NS       INT64_C(500000000) /* ... and cameras and the live picture this: nothing of theirs is needed */
#define CLOCK_STEP_NS INT64_C(500000000)
#define FRESH_NS      INT64_C(3000000000) /* sets that are older are no progress */
#define START_NS      INT64_C(10000000000)
#define UNUSED_S      3                     /* frames that end outside sets for this long are a fault */
#define LIVE_NS       INT64_C(180000000000) /* the first set of a large array is slow on a small machine */

const char *const service_phase_names[] = { "starting", "armed", "capturing", "degraded", "draining", "failed" };

/* --- start -------------------------------------------------------------------------------------------------------- */

static const char *text_or_null(const char *text)
{
    return text[0] ? text : NULL;
}

static int open_http(struct sst_service *s, const struct sst_service_config *cfg)
{
    const struct sst_config *c = &s->config;
    const char *proxies[SST_CONFIG_PROXIES] = { NULL };
    unsigned rights = 0;

    for (int i = 0; i < c->proxy.addresses; i++)
        proxies[i] = c->proxy.address[i];
    for (int i = 0; i < c->proxy.rights; i++)
        rights |= sst_access_right(c->proxy.right[i], strlen(c->proxy.right[i]));

    const struct sst_http_config http = {
        .socket = cfg->socket ? cfg->socket : text_or_null(c->control.socket),
        .socket_fd = cfg->socket_fd,
        .group = text_or_null(c->control.group),
        .view_group = text_or_null(c->control.view_group),
        .address = c->web.enabled ? c->web.address : NULL,
        .port = c->web.port,
        .host = text_or_null(c->web.host),
        .url = text_or_null(c->web.url),
        .token_file = c->web.token_file,
        .proxy = proxies,
        .proxies = c->proxy.addresses,
        .proxy_header = text_or_null(c->proxy.user_header),
        .proxy_rights = rights,
        .tls_certificate = text_or_null(c->web.tls_certificate),
        .tls_key = text_or_null(c->web.tls_key),
        .insecure = c->web.insecure,
        .clients = c->web.clients,
        .streams = c->web.streams,
        .stream_hz = c->web.stream_hz,
        .api = &s->api,
        .counters = &s->counters,
    };

    struct sst_http *opened;
    const int err = sst_http_open(&opened, &http);

    if (err)
        return err;
    pthread_mutex_lock(&s->lock); /* its clients ask already */
    s->http = opened;
    pthread_mutex_unlock(&s->lock);
    return 0;
}

/** A second service would open cameras, lines and folder of the first before it found the socket in use. */
static int check_alone(const char *path)
{
    struct sockaddr_un to = { .sun_family = AF_UNIX };
    int fd, err = 0;

    if (!path || strlen(path) >= sizeof(to.sun_path))
        return 0; /* opening it judges */
    strcpy(to.sun_path, path);
    fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (fd >= 0 && !connect(fd, (const struct sockaddr *)&to, sizeof(to))) {
        sst_log_error("a service listens on %s already: stop it (systemctl stop sstd), or give this one another "
                      "configuration",
                      path);
        err = -EADDRINUSE;
    }
    if (fd >= 0)
        close(fd);
    return err;
}

void service_record_view(struct sst_service *s)
{
    struct sst_slot *slot;

    if (engine_outlet(s->engine, SST_PICTURE_VIEW, "main", &slot))
        return; /* there is no live picture */
    sst_storage_view(s->storage, slot);
    sst_slot_unref(slot);
}

static void count_visits(void *storage, int64_t bytes)
{
    sst_storage_aside(storage, SST_STORAGE_ASIDE_VISITS, bytes);
}

void service_limit_visits(struct sst_service *s)
{
    sst_visits_limit(s->visits, (int64_t)(s->config.storage.quota_gb * 1e9), count_visits, s->storage);
}

static int open_visits(struct sst_service *s)
{
    char dir[SST_PATH_MAX];
    int err = sst_path_join(dir, s->config.storage.dir, "visits");

    err = err ? err : sst_visits_open(&s->visits, dir, s->config.storage.visits_days);
    if (!err)
        service_limit_visits(s);
    return err;
}

static int open_push(struct sst_service *s)
{
    char site[256], page[512] = "";
    const struct sst_push_config push = {
        .events = s->events, .beside = s->config.web.token_file, .settings = &s->config.push, .site = site, .page = page
    };

    service_site(site, &s->config);
    if (s->config.web.url[0]) /* else the browser knows best by which address it reached this machine */
        sst_config_page(page, &s->config);
    return sst_push_open(&s->push, &push);
}

static int open_parts(struct sst_service *s, const struct sst_service_config *cfg)
{
    struct sst_config *c = &s->config;
    const struct sst_recorder_track none = { 0 }; /* which cameras there are is known once they are opened */
    const int bound = c->array.bound;
    int err = sst_events_create(&s->events, EVENTS_KEPT);

    err = err ? err : sst_ring_create(&s->ring, (size_t)c->storage.ring_mb << 20);
    if (err) {
        sst_log_error("no memory for %d MiB of sets: lower storage: ring_mb", c->storage.ring_mb);
        return err;
    }
    const struct sst_storage_config storage = { .config = c, .ring = s->ring, .events = s->events, .tracks = &none };

    c->array.bound = 0;
    err = sst_storage_open(&s->storage, &storage);
    c->array.bound = bound;
    err = err ? err : array_open(&s->array, &c->array, s->ring, s->events);
    err = err ? err : open_visits(s);
    err = err ? err : service_open_cases(s);
    struct engine_config viewer = {
        .config = c, .ring = s->ring, .storage = s->storage, .visits = s->visits, .events = s->events
    };

    if (!err) {
        viewer.source = array_source(s->array);
        err = engine_open(&s->engine, &viewer);
    }
    err = err ? err : replay_open(&s->replay, s->storage, c);
    if (!err)
        service_record_view(s);
    err = err ? err : open_push(s);
    service_api(s);
    err = err ? err : open_http(s, cfg);
    const struct sst_hooks_config hooks = { .events = s->events, .hook = c->hook, .hooks = c->hooks };

    return err ? err : sst_hooks_open(&s->hooks, &hooks);
}

/* Reloads are refused while parts are opened or closed. */
static void set_open(struct sst_service *s, bool open)
{
    pthread_mutex_lock(&s->parts);
    s->open = open;
    pthread_mutex_unlock(&s->parts);
}

int sst_service_open(struct sst_service **out, const struct sst_config *config, const struct sst_service_config *cfg)
{
    const char *path = cfg->socket ? cfg->socket : text_or_null(config->control.socket);
    struct sst_service *s;
    int err = cfg->socket_fd < 0 ? check_alone(path) : 0;

    if (err)
        return err;
    s = calloc(1, sizeof(*s));
    if (!s)
        return -ENOMEM;
    s->config = *config;
    s->start_ns = s->cpu_at_ns = sst_clock_now_ns();
    s->wall_offset_ns = sst_clock_wall_ns() - s->start_ns;
    snprintf(s->path, sizeof(s->path), "%s", cfg->path ? cfg->path : "");
    pthread_mutex_init(&s->reload, NULL);
    pthread_mutex_init(&s->drawing, NULL);
    pthread_mutex_init(&s->parts, NULL);
    pthread_mutex_init(&s->lock, NULL);
    sst_counters_init(&s->counters);
    err = open_parts(s, cfg);
    if (err) {
        if (!sst_service_stop(s))
            sst_log_warning("something hangs while stopping");
        return err;
    }
    set_open(s, true);
    sst_events_emit(s->events, SST_EVENT_INFO, "start", json_pack("{s:s}", "version", SST_VERSION), "sstd %s started",
                    SST_VERSION);
    *out = s;
    return 0;
}

/* --- states ------------------------------------------------------------------------------------------------------- */

/** Missing parts of a working service. */
static void name_missing(struct sst_service *s, const struct array_state *a, char *why, size_t size)
{
    struct array_camera *c = calloc(SST_CAMERAS_MAX, sizeof(*c));
    const int n = c ? array_cameras(s->array, c) : 0;
    int shown = 0;

    snprintf(why, size, "%d of %d cameras are missing:", a->cameras - a->present, a->cameras);
    for (int i = 0; i < n; i++) {
        if (c[i].state == SST_GRAB_STREAMING)
            continue;
        if (shown++ == 8) {
            sst_text_add(why, size, " ...");
            break;
        }
        sst_text_add(why, size, " r%dc%d (%s)", c[i].row, c[i].col, array_state_names[c[i].state]);
    }
    free(c);
}

static void name_unused(enum sst_bucket bucket, char *why, size_t size)
{
    if (bucket == SST_BUCKET_STRAY)
        snprintf(why, size,
                 "frames come, but they belong to no trigger: set the cameras' triggered mode in cameras: "
                 "controls (trigger_mode: 1), or trigger: source software or free-run");
    else
        snprintf(why, size, "frames come, but nearly all are %s: the journal has the reason for each camera",
                 sst_bucket_name(bucket));
}

static enum sst_service_phase judge(struct sst_service *s, const struct array_state *a, const struct engine_state *v,
                                    char *why, size_t size)
{
    const int64_t now_ns = sst_clock_now_ns();
    const bool flows = a->frame_ns && now_ns - a->frame_ns < FRESH_NS + 3 * a->period_ns;
    char problem[SST_COUNTERS_PROBLEM];

    why[0] = 0;
    if (!a->open) {
        snprintf(why, size, "%s", a->reason);
        return a->failed ? SST_SERVICE_FAILED : SST_SERVICE_STARTING;
    }
    if (!flows && a->report.trigger_away)
        snprintf(why, size, "the trigger's GPIO chip is gone");
    else if (!flows && !a->present) /* being tried again: why it failed is still true */
        snprintf(why, size, "%s", a->reason);
    if (a->present && a->unused_s >= UNUSED_S)
        name_unused(a->unused_bucket, why, size);
    if (!flows && (why[0] || (a->cameras && !a->present && now_ns - s->start_ns > START_NS))) {
        if (!why[0])
            snprintf(why, size, "none of the %d cameras delivers", a->cameras);
        return SST_SERVICE_FAILED;
    }
    if (!flows)
        return a->present ? SST_SERVICE_ARMED : SST_SERVICE_STARTING;
    if (why[0])
        return SST_SERVICE_DEGRADED;
    if (service_hosts_problem(s->array, why, size))
        return SST_SERVICE_DEGRADED;
    if (a->present < a->cameras)
        name_missing(s, a, why, size);
    else if (a->report.trigger_away)
        snprintf(why, size, "the trigger's GPIO chip is gone");
    else if (v->enabled && v->reason[0])
        snprintf(why, size, "no live picture: %.440s", v->reason);
    else if (sst_storage_state(s->storage) == SST_STORAGE_FULL)
        snprintf(why, size, "nothing can be recorded, see storage");
    else if (sst_counters_problem(&s->counters, problem))
        snprintf(why, size, "%s", problem);
    return why[0] ? SST_SERVICE_DEGRADED : SST_SERVICE_CAPTURING;
}

static void watch_clock(struct sst_service *s)
{
    const int64_t offset_ns = sst_clock_wall_ns() - sst_clock_now_ns(), step_ns = offset_ns - s->wall_offset_ns;
    bool steady;

    s->wall_offset_ns = offset_ns;
    steady = sst_clock_is_steady(&s->clock);
    sst_visits_clock(s->visits, steady);
    sst_cases_clock(s->cases, steady);
    if (step_ns > CLOCK_STEP_NS || step_ns < -CLOCK_STEP_NS)
        sst_events_emit(
            s->events, SST_EVENT_WARNING, "clock", json_pack("{s:I}", "step_ms", (json_int_t)(step_ns / 1000000)),
            "the wall clock was set by %+.1f s; sets are timed by another clock and go on", (double)step_ns / 1e9);
}

/** Pass the layout of the cameras to storage, for its recordings. */
static void update_storage(struct sst_service *s)
{
    struct sst_recorder_track *tracks;
    struct array_layout *layout = &s->layout_now;

    if (array_layout(array_source(s->array), layout->generation, layout) == s->generation)
        return;
    tracks = calloc(SST_CAMERAS_MAX, sizeof(*tracks));
    if (tracks) {
        array_tracks(s->array, tracks);
        sst_storage_cameras(s->storage, &layout->config, tracks);
        s->generation = layout->generation;
    }
    free(tracks);
}

static void measure_cpu(struct sst_service *s)
{
    const int64_t now_ns = sst_clock_now_ns(), cpu_ns = sst_clock_cpu_ns();

    if (now_ns - s->cpu_at_ns < 5000000000 && s->cpu_ns)
        return;
    pthread_mutex_lock(&s->lock);
    s->cpu_percent = 100.0 * (double)(cpu_ns - s->cpu_ns) / (double)(now_ns - s->cpu_at_ns);
    pthread_mutex_unlock(&s->lock);
    s->cpu_ns = cpu_ns;
    s->cpu_at_ns = now_ns;
}

enum sst_service_phase sst_service_tick(struct sst_service *s, char status[512])
{
    struct array_state *a = &s->array_now;
    struct engine_state *v = &s->engine_now;
    enum sst_service_phase phase = s->phase, before = s->phase;
    char why[512] = "", latency[32] = "";
    double latency_ms;

    watch_clock(s);
    update_storage(s);
    measure_cpu(s);
    array_state(s->array, a);
    engine_state(s->engine, v);
    phase = judge(s, a, v, why, sizeof(why));
    latency_ms = window_quantile(&v->latency_ms, 0.5, sst_clock_now_ns());
    if (!isnan(latency_ms))
        snprintf(latency, sizeof(latency), ", latency %.0f ms", latency_ms);
    snprintf(status, 512, "%s: %d of %d cameras, %.1f sets/s, live %.1f sets/s%s%s%.300s",
             service_phase_names[phase], a->present, a->cameras, a->rate_hz, v->rate_hz, latency, why[0] ? "; " : "",
             why);
    pthread_mutex_lock(&s->lock);
    s->phase = phase;
    memcpy(s->reason, why, sizeof(s->reason));
    pthread_mutex_unlock(&s->lock);
    if (phase != before)
        sst_events_emit(s->events,
                        phase == SST_SERVICE_FAILED     ? SST_EVENT_ERROR
                        : phase == SST_SERVICE_DEGRADED ? SST_EVENT_WARNING
                                                        : SST_EVENT_INFO,
                        "state", json_pack("{s:s, s:s}", "state", service_phase_names[phase], "reason", why),
                        "%s%s%.480s", service_phase_names[phase], why[0] ? ": " : "", why);
    return phase;
}

bool sst_service_alive(struct sst_service *s, int64_t ns)
{
    struct array_state *a = &s->array_now;
    struct engine_state *v = &s->engine_now;
    const int64_t now_ns = sst_clock_now_ns();
    bool alive;

    array_state(s->array, a);
    engine_state(s->engine, v);
    /* The capturing thread runs; silent cameras hold up its opening for long ... */
    alive = now_ns - a->beat_ns < (a->open ? ns : 3 * ns);
    if (alive && a->open && a->present && !a->report.trigger_away) { /* ... frames come, in sets or not ... */
        const int64_t frame_ns = a->frame_ns > a->unused_ns ? a->frame_ns : a->unused_ns;

        alive = now_ns - (frame_ns > s->start_ns ? frame_ns : s->start_ns) < ns + START_NS + 3 * a->period_ns;
    }
    if (alive) /* ... and pictures are made, however slowly: capturing is not to be ended for slow pictures */
        alive = now_ns - v->beat_ns < (3 * ns > LIVE_NS ? 3 * ns : LIVE_NS);
    return alive;
}

void sst_service_address(struct sst_service *s, char *out, size_t size)
{
    const int port = s->http ? sst_http_port(s->http) : 0;
    const bool tls = s->config.web.tls_certificate[0] != 0, six = strchr(s->config.web.address, ':') != NULL;
    char token[128], page[512];

    out[0] = 0;
    sst_config_page(page, &s->config);
    if (port && s->config.web.url[0])
        snprintf(out, size, "%s/?token=%s", page, sst_file_line(token, sizeof(token), s->config.web.token_file));
    else if (port)
        snprintf(out, size, "%s://%s%s%s:%d/?token=%s", tls ? "https" : "http", six ? "[" : "", s->config.web.address,
                 six ? "]" : "", port, sst_file_line(token, sizeof(token), s->config.web.token_file));
}

/* --- stop --------------------------------------------------------------------------------------------------------- */

static int left_ms(int64_t until_ns)
{
    return sst_max_int((int)((until_ns - sst_clock_now_ns()) / 1000000), 50);
}

/* Ask all parts to end. @return true: the thread of the cameras has ended */
static bool start_drain(struct sst_service *s, int64_t until_ns)
{
    const int64_t sets_ns = until_ns - STOP_NS + SETS_NS;
    bool ended = true;

    pthread_mutex_lock(&s->lock);
    s->phase = SST_SERVICE_DRAINING;
    pthread_mutex_unlock(&s->lock);
    if (s->engine)
        engine_stop(s->engine); /* viewers leave, so that servers end at once */
    if (s->replay)
        replay_stop(s->replay);
    if (s->array)
        array_stop(s->array);
    sst_cases_stop(s->cases);
    sst_push_stop(s->push);
    sst_hooks_stop(s->hooks);
    sst_http_stop(s->http);
    if (s->array)
        ended = array_join(s->array, sets_ns);
    if (s->ring)
        sst_ring_shut(s->ring);
    sst_storage_shut(s->storage, left_ms(until_ns));
    return ended;
}

/* Add how long a part took to end, for the log. */
static void note(char *text, size_t size, const char *part, int64_t *since_ns)
{
    const int64_t now_ns = sst_clock_now_ns();

    sst_text_add(text, size, "%s%s %.0f", *text ? ", " : "", part, (double)(now_ns - *since_ns) * 1e-6);
    *since_ns = now_ns;
}

bool sst_service_stop(struct sst_service *s)
{
    const int64_t start_ns = sst_clock_now_ns(), until_ns = start_ns + STOP_NS;
    const int64_t free_ns = start_ns + FREE_NS;
    int64_t since_ns = start_ns;
    bool array, storage, viewer = true;
    char took[256] = "";

    sst_thread_raise_all();
    set_open(s, false);
    if (s->events && s->api.arg)
        sst_events_emit(s->events, SST_EVENT_INFO, "stop", NULL, "sstd is stopping");
    array = start_drain(s, until_ns);
    note(took, sizeof(took), "sets", &since_ns);
    sst_hooks_close(s->hooks);
    note(took, sizeof(took), "hooks", &since_ns);
    if (s->events)
        sst_events_shut(s->events); /* its listeners end */
    sst_http_close(s->http);
    note(took, sizeof(took), "HTTP", &since_ns);
    sst_push_close(s->push);
    storage = sst_cases_close(s->cases, until_ns);
    storage = sst_storage_finish(s->storage, left_ms(until_ns)) && storage;
    note(took, sizeof(took), "disk", &since_ns);
    if (s->engine)
        viewer = engine_join(s->engine, since_ns < free_ns ? free_ns : since_ns);
    note(took, sizeof(took), "live", &since_ns);
    if (s->replay && !replay_join(s->replay, since_ns < free_ns ? free_ns : since_ns))
        viewer = false;
    note(took, sizeof(took), "replay", &since_ns);
    if (viewer)
        sst_visits_close(s->visits, sst_max_int(left_ms(until_ns), 100));
    s->visits = NULL;
    if (!array)
        array = array_join(s->array, since_ns < free_ns ? free_ns : since_ns);
    note(took, sizeof(took), "cameras", &since_ns);
    sst_log_info("stopped in %.0f ms, waiting for %s", (double)(since_ns - start_ns) * 1e-6, took);
    if (!storage)
        sst_log_warning("ending without waiting for the disk; what was acknowledged is on disk");
    if (!array || !storage || !viewer || !sst_storage_close(s->storage, 0))
        return false; /* their threads may still use the others */
    replay_close(s->replay);
    engine_close(s->engine);
    array_close(s->array);
    sst_ring_destroy(s->ring);
    sst_events_destroy(s->events);
    sst_counters_fini(&s->counters);
    pthread_mutex_destroy(&s->lock);
    pthread_mutex_destroy(&s->parts);
    pthread_mutex_destroy(&s->drawing);
    pthread_mutex_destroy(&s->reload);
    free(s);
    return !sst_livescene_left_behind();
}
