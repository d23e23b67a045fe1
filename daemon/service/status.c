/* Status, cameras and metrics: one table of fields each for JSON, Prometheus and the descriptions of both. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <dirent.h>
#include <errno.h>
#include <math.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/clock.h"
#include "daemon/service/engine_internal.h"
#include "daemon/service/service_internal.h"

#define ROW      SST_FIELD
#define GROUP    SST_FIELD_GROUP
#define GROUP_IF SST_FIELD_GROUP_IF
#define NAMES    SST_FIELD_NAMES
#define COUNTS   SST_FIELD_COUNTS

static const char *const rung_keys[] = { "restream", "reopen", "reset", "reauthorise", "power", "back_off" };
static const char *const source_names[] = { "gpio", "software", "free-run", "external" };
static const char *const notice_names[] = { "noise",         "blur",        "soft-views", "jpeg",
                                            "missing-views", "blank-views", "misaligned", "time-offsets",
                                            "too-slow",      "removed" };
static const char *const level_names[] = { "info", "warning", "error" };
static const char *const versions[] = { SST_VERSION };

/* --- status ------------------------------------------------------------------------------------------------------- */

struct notice {
    const char *what, *text;
};

/** Values of the status and of the metrics; too large for a stack of a server's thread. */
struct status_now {
    const char *version;
    bool one; /* true */
    enum sst_service_phase phase;
    char reason[512], skew_text[320], worst[16];
    double uptime_s;
    int64_t wall_ns;
    struct array_state array;
    struct array_layout layout;
    struct sst_spread skew_us, delay_ms;
    struct live_now live;
    struct sst_storage_report storage;
    int http, streams, videos, listeners, rtsp, onvif;
    char encoder[16];
    unsigned rtsp_restarts, onvif_restarts;
    uint64_t requests, refused, skipped, slow, sent_bytes, events[3], rss_bytes;
    bool certificate;
    int64_t until_ns;
    double days, cpu_percent, cpu_s;
    int descriptors, notices;
    struct notice notice[SST_NOTICES + 4];
    bool noticed[ARRAY_LEN(notice_names)];
    struct hosts_now hosts, *node, *head; /* of node and head one, or none */
};

#define IN struct notice
static const struct sst_field notice_fields[] = {
    ROW("what", NAME, what, "Kind of the fault", NAMES(notice_names)),
    ROW("text", NAME, text, "One sentence: what, how much, what helps"),
    { 0 },
};
#undef IN

#define IN struct status_now
const struct sst_field sst_service_status_fields[] = {
    ROW("version", NAME, version, "The version that runs"),
    ROW(NULL, MAP, one, "The version that runs", "info", .label = "version", .item = SST_FIELD_BOOL, NAMES(versions)),
    ROW("state", CHOICE, phase, "State of the service", "state", .label = "state", .names = service_phase_names,
        SST_SERVICE_FAILED + 1),
    ROW("reason", TEXT, reason, "Cause of a state other than capturing, or \"\""),
    ROW("uptime_s", REAL, uptime_s, "Since the start", "uptime_seconds"),
    ROW("time", TIME, wall_ns, "Time of this answer"),
    GROUP(
        "capture", "Capturing of the array",
        ROW("cameras", INTEGER, array.cameras, "Cameras that the array has", "cameras"),
        ROW("present", INTEGER, array.present, "Cameras that deliver", "cameras_present"),
        ROW("rate_hz", REAL, array.rate_hz, "Sets per second", "capture_rate_hz"),
        ROW("sets", INTEGER, array.sets, "Sets captured", "sets_total"),
        ROW("complete", INTEGER, array.complete, "Sets with a frame of every camera", "sets_complete_total"),
        ROW("dropped", INTEGER, array.report.sets.dropped, "Triggers for which no set was free"),
        ROW("refused", INTEGER, array.ring_refused, "Sets for which there was no memory", "sets_refused_total"),
        GROUP(
            "trigger", "The trigger of the cameras",
            ROW("source", CHOICE, layout.config.source, "trigger.source of the configuration", NAMES(source_names)),
            ROW("edges", INTEGER, array.report.edges, "Triggers fired since the cameras were opened", "trigger_edges"),
            ROW("stamped", INTEGER, array.report.edges_stamped, "Triggers with a time stamp of the loop-back line"),
            ROW("skipped", INTEGER, array.report.ticks_skipped, "Triggers that were too late to fire"),
            ROW("away", BOOL, array.report.trigger_away, "Its GPIO chip is gone")),
        GROUP("frames", "Frames by where they ended",
              ROW("", MAP, array.report.sets.bucket, "Frames since the cameras were opened, by where they ended",
                  "frames", .label = "bucket", COUNTS(sst_bucket_keys)),
              ROW("delivered", INTEGER, array.report.grab.frames, "Frames that the cameras delivered"),
              ROW("lost_by_drivers", INTEGER, array.report.grab.lost, "Frames missing from the drivers' sequence"),
              ROW("unexplained", INTEGER, array.report.unexplained, "Frames that ended nowhere or twice: 0, or a bug",
                  "frames_unexplained")),
        GROUP("skew_us", "Spread of the exposures of a set",
              ROW("", SPREAD, skew_us, "Spread of the exposures of a set since the cameras were opened", "skew_seconds",
                  .per = 1e6),
              ROW("limit", INTEGER, layout.config.skew_limit_us, "trigger.skew_limit_us of the configuration"),
              ROW("worst", TEXT, worst, "Camera of the set with the largest spread, or \"\""),
              ROW("over", INTEGER, array.report.skewed,
                  "Sets with more skew than the limit since the cameras were opened", "skewed_sets")),
        GROUP("privacy", "Privacy masks, applied before anything else reads a frame",
              ROW("masks", INTEGER, layout.config.masks, "privacy.masks of the configuration", "privacy_masks"),
              ROW("cameras", INTEGER, array.report.masked, "Cameras whose frames have black regions"),
              ROW("withheld", INTEGER, array.report.withheld,
                  "Damaged frames that were left out of their sets, since masks could not be applied to them; they are "
                  "among the corrupt ones",
                  "privacy_withheld_frames")),
        ROW("delay_ms", SPREAD, delay_ms, "From the trigger until its set is there, since the cameras were opened",
            "set_delay_seconds", .per = 1e3),
        ROW("recovery", MAP, array.report.grab.rung, "Attempts to recover a camera, by their kind", COUNTS(rung_keys))),
    ROW("live", OBJECT, live, "The live picture", .of = engine_live_fields),
    ROW("storage", OBJECT, storage, "Recordings, snapshots and exports", .of = sst_storage_fields),
    GROUP("clients", "Clients of HTTP, RTSP and ONVIF", ROW("http", INTEGER, http, "Connections", "http_clients"),
          ROW("streams", INTEGER, streams, "Moving pictures that are watched over HTTP", "http_streams"),
          ROW("videos", INTEGER, videos, "Of these, as H.264", "http_videos"),
          ROW("encoder", TEXT, encoder,
              "Encoder of H.264, the last one that was opened: h264_vaapi, h264_v4l2m2m (devices), libx264 or libopenh264; "
              "\"\": none yet"),
          ROW("listeners", INTEGER, listeners, "Listeners of the event stream"),
          ROW("rtsp", INTEGER, rtsp, "Clients that watch over RTSP", "rtsp_clients"),
          ROW("rtsp_restarts", INTEGER, rtsp_restarts, "Times that sst-rtsp was started again", "rtsp_restarts_total"),
          ROW("onvif", INTEGER, onvif, "Clients that are subscribed to events over ONVIF", "onvif_clients"),
          ROW("onvif_restarts", INTEGER, onvif_restarts, "Times that sst-onvif was started again",
              "onvif_restarts_total"),
          ROW("requests", INTEGER, requests, "Requests", "http_requests_total"),
          ROW("refused", INTEGER, refused, "Requests that were refused", "http_refused_total"),
          ROW(NULL, INTEGER, sent_bytes, "Bytes sent", "http_sent_bytes_total"),
          ROW("skipped_pictures", INTEGER, skipped, "Pictures that slow viewers did not get",
              "http_pictures_skipped_total"),
          ROW("slow_downloads", INTEGER, slow, "Always 0: slow downloads no longer end for others",
              "http_slow_downloads_total")),
    GROUP_IF("certificate", certificate, "Certificate of HTTPS; null: none", ROW("until", TIME, until_ns, "Its end"),
             ROW("days", REAL, days, "Days that are left of the certificate of HTTPS", "certificate_days")),
    GROUP("process", "The process of the service",
          ROW("rss_bytes", INTEGER, rss_bytes, "Resident memory", "process_resident_memory_bytes"),
          ROW("cpu_percent", REAL, cpu_percent, "CPU time over the last seconds, of one core"),
          ROW("descriptors", INTEGER, descriptors, "Open descriptors", "process_open_fds"),
          ROW(NULL, REAL, cpu_s, "CPU time", "process_cpu_seconds_total")),
    ROW("noticed", LIST, notice,
        "Faults of the pictures now (of all views once after the start, then of one view every ten seconds), and what a "
        "clear picture does not show",
        .of = notice_fields, .stride = sizeof(struct notice), .count_at = offsetof(struct status_now, notices)),
    ROW(NULL, MAP, noticed, "Fault of the pictures", "noticed", .label = "what", .item = SST_FIELD_BOOL,
        NAMES(notice_names), sizeof(bool)),
    ROW("hosts", POINTER, node,
        "Several hosts with one array (docs/use/hosts.md): of a node its head and where its "
        "frames ended, of a head its nodes; null on a single host",
        .of = hosts_node_fields),
    ROW("hosts", POINTER, head, "Several hosts with one array", .of = hosts_head_fields),
    ROW(NULL, MAP, events, "Events by level", "events_total", .label = "level", COUNTS(level_names)),
    { 0 },
};
#undef IN

/* --- cameras ------------------------------------------------------------------------------------------------------ */

struct camera {
    char place[16];
    bool up;
    double last_s, ptp_offset_us;
    struct array_camera c;
};

struct cameras_now {
    struct array_layout layout;
    int count;
    struct array_camera now[SST_CAMERAS_MAX];
    struct camera camera[SST_CAMERAS_MAX]; /* the same with derived values */
};

#define IN struct camera
static const struct sst_field camera_fields[] = {
    ROW("name", TEXT, place, "Its place, \"r0c5\""),
    ROW("row", INTEGER, c.row, "Row of the grid, from the top"),
    ROW("col", INTEGER, c.col, "Column of the grid, from the left"),
    ROW("state", CHOICE, c.state, "Its state", .names = array_state_names, SST_GRAB_READY + 1),
    ROW(NULL, BOOL, up, "The camera delivers", "camera_up"),
    ROW("serial", TEXT, c.serial, "Serial number, or \"\""),
    ROW("port", TEXT, c.port, "USB port"),
    ROW("device", TEXT, c.name, "Name of the device"),
    ROW("frames", INTEGER, c.grab.frames, "Frames of the camera since it was opened", "camera_frames"),
    ROW("bad", INTEGER, c.grab.bad, "Damaged ones among them", "camera_bad_frames"),
    ROW("lost", INTEGER, c.grab.lost, "Frames missing from the driver's sequence"),
    ROW("packets_missing", INTEGER, c.grab.packets_missing,
        "Of a GigE camera: packets that incomplete frames lack, from the first missing one on", "camera_packets_missing"),
    ROW("packets_resent", INTEGER, c.grab.packets_resent, "Of a GigE camera: packets that came when requested again",
        "camera_packets_resent"),
    ROW("ptp_role", TEXT, c.ptp.role, "Of a GenICam camera: role of its clock by PTP (Slave, Master ...), or \"\""),
    ROW("ptp_offset_us", REAL, ptp_offset_us, "Offset of that clock from its master's; null: unknown", .nullable = true),
    ROW("rate_hz", REAL, c.rate_hz, "Frames in sets, over the last second"),
    ROW("skew_us", REAL, c.skew_us, "Its exposure against the median of its sets, smoothed", "camera_skew_seconds",
        .per = 1e6),
    ROW("masked", REAL, c.masked, "Share of its frames that privacy masks make black, 0..1", "camera_masked_ratio"),
    ROW("last_s", REAL, last_s, "Since its last frame in a set; null: none yet", .nullable = true),
    ROW("buckets", MAP, c.bucket, "Its frames, by where they ended", COUNTS(sst_bucket_keys)),
    ROW("recovery", MAP, c.grab.rung, "Attempts to recover it, by their kind", COUNTS(rung_keys)),
    ROW("reason", TEXT, c.reason, "Reason why it does not stream, or what is odd about its frames, or \"\""),
    { 0 },
};
#undef IN

#define IN struct cameras_now
const struct sst_field sst_service_cameras_fields[] = {
    ROW("rows", INTEGER, layout.config.rows, "Rows of the grid"),
    ROW("cols", INTEGER, layout.config.cols, "Columns of the grid"),
    ROW("cameras", LIST, camera, "Cameras of the array", .label = "camera", .of = camera_fields,
        .stride = sizeof(struct camera), .count_at = offsetof(struct cameras_now, count)),
    { 0 },
};
#undef IN

/* --- state now ---------------------------------------------------------------------------------------------------- */

static struct sst_spread histogram_spread(const struct sst_histogram *h, double per)
{
    return (struct sst_spread){ (double)sst_histogram_quantile(h, 0.5) / per,
                                (double)sst_histogram_quantile(h, 0.99) / per, (double)h->max / per, NAN, h->count };
}

static void add_notice(struct status_now *now, const char *what, const char *text)
{
    now->notice[now->notices++] = (struct notice){ what, text };
    for (size_t i = 0; i < ARRAY_LEN(notice_names); i++)
        now->noticed[i] |= !strcmp(what, notice_names[i]);
}

static void gather_notices(struct status_now *now)
{
    const struct engine_state *v = &now->live.engine;

    for (int i = 0; i < v->noticed.count; i++)
        add_notice(now, v->noticed.notice[i].what, v->noticed.notice[i].text);
    if (v->misaligned)
        add_notice(now, "misaligned", v->check);
    if (sst_notice_skew(now->skew_text, now->skew_us.p50))
        add_notice(now, "time-offsets", now->skew_text);
    if (v->too_slow)
        add_notice(now, "too-slow", v->slow_text);
    if (v->removed_count)
        add_notice(now, "removed", v->removed_text);
}

/** Resident memory and open descriptors of this process. */
static void gather_process(struct status_now *now)
{
    FILE *f = fopen("/proc/self/statm", "re");
    DIR *dir = opendir("/proc/self/fd");
    unsigned long long pages = 0;

    if (f && fscanf(f, "%*u %llu", &pages) != 1)
        pages = 0;
    if (f)
        fclose(f);
    now->rss_bytes = (uint64_t)pages * (uint64_t)sysconf(_SC_PAGESIZE);
    now->descriptors = -3; /* ".", ".." and this folder itself */
    while (dir && readdir(dir))
        now->descriptors++;
    if (dir)
        closedir(dir);
    now->cpu_s = (double)sst_clock_cpu_ns() / 1e9;
}

static void gather_clients(struct status_now *now, struct sst_counters *c)
{
    now->http = atomic_load(&c->clients);
    now->streams = atomic_load(&c->streams);
    now->videos = atomic_load(&c->videos);
    sst_counters_encoder(c, now->encoder);
    now->listeners = atomic_load(&c->listeners);
    now->requests = atomic_load(&c->requests);
    now->refused = atomic_load(&c->refused);
    now->skipped = atomic_load(&c->skipped);
    now->slow = atomic_load(&c->slow);
    now->sent_bytes = atomic_load(&c->bytes);
    now->rtsp = sst_counters_clients(c, SST_COUNTERS_RTSP, &now->rtsp_restarts);
    now->onvif = sst_counters_clients(c, SST_COUNTERS_ONVIF, &now->onvif_restarts);
    now->until_ns = atomic_load(&c->certificate_until_s) * 1000000000;
    now->certificate = now->until_ns != 0;
    now->days = now->certificate ? (double)(now->until_ns - now->wall_ns) / 86400e9 : NAN;
}

static void gather_array(struct status_now *now)
{
    const struct sst_capture_report *r = &now->array.report;
    const struct sst_config_camera *worst = r->worst_cam >= 0 ? &now->layout.config.camera[r->worst_cam] : NULL;

    now->skew_us = histogram_spread(&r->skew_ns, 1e3);
    now->delay_ms = histogram_spread(&now->array.delay_ns, 1e6);
    if (worst)
        snprintf(now->worst, sizeof(now->worst), "r%dc%d", worst->row, worst->col);
}

static void free_status(struct status_now *now)
{
    if (now)
        array_hosts_forget(&now->hosts);
    free(now);
}

/** @return NULL: no memory */
static struct status_now *gather_status(struct sst_service *s)
{
    struct status_now *now = calloc(1, sizeof(*now));
    struct sst_live_settings live;

    if (!now)
        return NULL;
    now->version = SST_VERSION;
    now->one = true;
    array_state(s->array, &now->array);
    (void)array_layout(array_source(s->array), 0, &now->layout);
    pthread_mutex_lock(&s->lock);
    live = s->config.live;
    now->phase = s->phase;
    now->cpu_percent = s->cpu_percent;
    memcpy(now->reason, s->reason, sizeof(now->reason));
    if (!now->layout.generation)
        now->layout.config = s->config.array;
    pthread_mutex_unlock(&s->lock);
    now->uptime_s = (double)(sst_clock_now_ns() - s->start_ns) / 1e9;
    now->wall_ns = sst_clock_wall_ns();
    gather_array(now);
    engine_live(&now->live, s->engine, &live);
    gather_notices(now);
    gather_clients(now, &s->counters);
    gather_process(now);
    sst_storage_report(s->storage, &now->storage);
    sst_events_counts(s->events, now->events);
    if (array_hosts(s->array, &now->hosts))
        *(now->hosts.role == SST_CONFIG_NODE ? &now->node : &now->head) = &now->hosts;
    return now;
}

int service_status(void *arg, struct sst_api_answer *out)
{
    struct status_now *now = gather_status(arg);

    out->body = now ? sst_fields_json(sst_service_status_fields, now) : NULL;
    free_status(now);
    return out->body ? 0 : -ENOMEM;
}

/** @return NULL: no memory */
static struct cameras_now *gather_cameras(struct sst_service *s)
{
    struct cameras_now *now = calloc(1, sizeof(*now));
    const int64_t now_ns = sst_clock_now_ns();

    if (!now)
        return NULL;
    now->count = array_cameras(s->array, now->now);
    (void)array_layout(array_source(s->array), 0, &now->layout);
    for (int i = 0; i < now->count; i++) {
        const struct array_camera *c = &now->now[i];

        now->camera[i] = (struct camera){ .up = c->state == SST_GRAB_STREAMING,
                                          .c = *c,
                                          .last_s = c->last_ns ? (double)(now_ns - c->last_ns) / 1e9 : NAN,
                                          .ptp_offset_us = c->ptp.has_offset ? (double)c->ptp.offset_ns / 1e3 : NAN };
        snprintf(now->camera[i].place, sizeof(now->camera[i].place), "r%dc%d", c->row, c->col);
    }
    return now;
}

int service_cameras(void *arg, struct sst_api_answer *out)
{
    struct cameras_now *now = gather_cameras(arg);

    out->body = now ? sst_fields_json(sst_service_cameras_fields, now) : NULL;
    free(now);
    return out->body ? 0 : -ENOMEM;
}

int service_metrics(void *arg, char **text)
{
    struct status_now *now = gather_status(arg);
    struct cameras_now *cameras = gather_cameras(arg);
    char *out = NULL;
    size_t size;
    FILE *f = now && cameras ? open_memstream(&out, &size) : NULL;

    if (f) {
        sst_fields_metrics(f, sst_service_status_fields, now);
        sst_fields_metrics(f, sst_service_cameras_fields, cameras);
        if (fclose(f)) {
            free(out);
            out = NULL;
        }
    }
    free(cameras);
    free_status(now);
    *text = out;
    return out ? 0 : -ENOMEM;
}
