/* The status as JSON (docs/integrate/api.md). */
#include <dirent.h>
#include <errno.h>
#include <math.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/clock.h"
#include "daemon/service/service_internal.h"

static json_t *count(uint64_t n)
{
    return json_integer((json_int_t)n);
}

static const char *const rung_keys[] = { "restream", "reopen", "reset", "reauthorise", "power", "back_off" };
static const char *const source_names[] = { "gpio", "software", "free-run", "external" };

static json_t *counts(const char *const *keys, const uint64_t *n, int size)
{
    json_t *o = json_object();

    for (int i = 0; i < size; i++)
        json_object_set_new(o, keys[i], count(n[i]));
    return o;
}

static json_t *skew_json(const struct array_layout *layout, const struct sst_capture_report *r)
{
    const struct sst_config_camera *worst = r->worst_cam >= 0 ? &layout->config.camera[r->worst_cam] : NULL;
    char name[16] = "";

    if (worst)
        snprintf(name, sizeof(name), "r%dc%d", worst->row, worst->col);
    return json_pack("{s:f, s:f, s:f, s:i, s:s, s:I}", "p50", (double)sst_histogram_quantile(&r->skew_ns, 0.5) / 1e3,
                     "p99", (double)sst_histogram_quantile(&r->skew_ns, 0.99) / 1e3, "max",
                     (double)r->skew_ns.max / 1e3, "limit", layout->config.skew_limit_us, "worst", name, "over",
                     (json_int_t)r->skewed);
}

static json_t *delay_json(const struct sst_histogram *h)
{
    return json_pack("{s:f, s:f, s:f}", "p50", (double)sst_histogram_quantile(h, 0.5) / 1e6, "p99",
                     (double)sst_histogram_quantile(h, 0.99) / 1e6, "max", (double)h->max / 1e6);
}

static json_t *capture_json(const struct array_state *a, const struct array_layout *layout)
{
    const struct sst_capture_report *r = &a->report;
    json_t *frames = counts(sst_bucket_keys, r->sets.bucket, SST_BUCKETS);

    json_object_set_new(frames, "delivered", count(r->grab.frames));
    json_object_set_new(frames, "lost_by_drivers", count(r->grab.lost));
    json_object_set_new(frames, "unexplained", count(r->unexplained));
    return json_pack(
        "{s:i, s:i, s:f, s:I, s:I, s:I, s:I, s:o, s:o, s:o, s:o, s:o}", "cameras", a->cameras, "present", a->present,
        "rate_hz", a->rate_hz, "sets", (json_int_t)a->sets, "complete", (json_int_t)a->complete, "dropped",
        (json_int_t)r->sets.dropped, "refused", (json_int_t)a->ring_refused, "trigger",
        json_pack("{s:s, s:I, s:I, s:I, s:b}", "source", source_names[layout->config.source], "edges",
                  (json_int_t)r->edges, "stamped", (json_int_t)r->edges_stamped, "skipped",
                  (json_int_t)r->ticks_skipped, "away", r->trigger_away),
        "frames", frames, "skew_us", skew_json(layout, r), "delay_ms",
        delay_json(&a->delay_ns), "recovery", counts(rung_keys, r->grab.rung, SST_GRAB_RUNGS));
}

static json_t *window_json(const struct time_window *w)
{
    const int64_t now_ns = sst_clock_now_ns();

    return json_pack("{s:o, s:o, s:o}", "p50", sst_api_real(window_quantile(w, 0.5, now_ns)), "p99",
                     sst_api_real(window_quantile(w, 0.99, now_ns)), "max",
                     sst_api_real(window_quantile(w, 1, now_ns)));
}

static json_t *skip_json(bool on, double skipped, double error)
{
    return json_pack("{s:b, s:f, s:o}", "on", on, "skipped_percent", 100 * skipped, "error", sst_api_real(error));
}

static double share(uint64_t done, uint64_t skipped)
{
    return skipped ? (double)skipped / (double)(done + skipped) : 0;
}

/* Skips (design.md, 5.5). */
static json_t *skips_json(const struct engine_state *v, const struct sst_live_settings *s)
{
    const double changed = share(v->tiles_changed, v->tiles - v->tiles_changed);

    return json_pack("{s:o, s:o, s:o, s:o, s:o}", "change", skip_json(s->skip_change, changed, v->error_change), "labels",
                     skip_json(s->skip_labels, share(v->label_runs, v->label_runs_skipped), v->error_labels), "ranges",
                     skip_json(s->skip_ranges, share(v->disps, v->disps_skipped), v->error_ranges), "views",
                     skip_json(s->skip_views, v->rays.rays_skipped, v->rays.error_levels), "tiles",
                     skip_json(s->skip_tiles, v->rays.rays_even, v->rays.error_levels));
}

/* Where the network runs; null: on the CPU, or there is none. */
static json_t *label_device_json(const struct engine_state *v)
{
    const struct sst_network_device_report *d = &v->label_device;

    if (!v->labels_on_device)
        return json_null();
    return json_pack("{s:b, s:I, s:I, s:I, s:s}", "failing", d->failing, "runs", (json_int_t)d->runs, "on_cpu",
                     (json_int_t)d->on_cpu, "failures", (json_int_t)d->failures, "reason",
                     d->failing ? d->failure : d->why);
}

/* Steps of the live picture that the CPU does now, beside the device. */
static json_t *cpu_steps_json(const struct engine_state *v)
{
    /* A device that has run nothing has no form for this network. */
    const bool labels =
        v->labels_on_device && !v->label_device.failing && (v->label_device.runs || !v->label_device.on_cpu);
    const bool pictures = v->on_device && !v->device.failing && (v->device.pictures || !v->device.on_cpu);
    const bool rectified = v->on_device && !v->device.failing && v->device.rectifies;
    json_t *list = json_array();

    for (const char *const *step = sst_live_device_steps; *step; step++)
        if (!(!strcmp(*step, "labels") ? labels : !strcmp(*step, "rectify") ? rectified : pictures))
            json_array_append_new(list, json_string(*step));
    for (const char *const *step = sst_live_cpu_steps; *step; step++)
        json_array_append_new(list, json_string(*step));
    return list;
}

/* Steps of the live picture on a device; null: all on the CPU, as configured. */
static json_t *device_json(const struct engine_state *v)
{
    const struct sst_render_device_report *d = &v->device;
    json_t *root;

    if (!v->on_device)
        return json_null();
    root = json_pack("{s:s, s:s, s:b, s:I, s:I, s:I, s:I, s:I, s:I, s:I, s:s}", "name", d->name, "driver", d->driver,
                     "failing", d->failing, "pictures", (json_int_t)d->pictures, "on_cpu", (json_int_t)d->on_cpu,
                     "verified_on_cpu", (json_int_t)d->verified_on_cpu, "filled_on_cpu", (json_int_t)d->filled_on_cpu,
                     "rectified", (json_int_t)d->rectified, "rectified_on_cpu", (json_int_t)d->rectified_on_cpu,
                     "failures", (json_int_t)d->failures, "reason",
                     d->failing         ? d->failure
                     : *d->why          ? d->why
                     : *d->why_verified ? d->why_verified
                     : *d->why_filled   ? d->why_filled
                                        : d->why_rectified);
    json_object_set_new(root, "labels", label_device_json(v));
    json_object_set_new(root, "stages_on_cpu", cpu_steps_json(v));
    return root;
}

/* Shares of the reference view's disparities, for the slider of the cut; zeros until they are known. */
static json_t *histogram_json(const struct engine_state *v)
{
    json_t *share = json_array();

    for (int i = 0; i < SST_LIVE_HISTOGRAM; i++)
        json_array_append_new(share, json_real(v->counted ? (double)v->share[i] : 0));
    return json_pack("{s:o, s:o, s:o}", "min_px", v->counted ? json_real(v->share_min_px) : json_null(), "max_px",
                     v->counted ? json_real(v->share_max_px) : json_null(), "share", share);
}

static void add_noticed(json_t *list, const char *what, const char *text)
{
    json_array_append_new(list, json_pack("{s:s, s:s}", "what", what, "text", text));
}

json_t *service_noticed_json(const struct engine_state *v, double skew_us)
{
    const struct sst_notices *n = &v->noticed;
    json_t *list = json_array();
    char text[320];

    for (int i = 0; i < n->count; i++)
        add_noticed(list, n->notice[i].what, n->notice[i].text);
    if (v->misaligned)
        add_noticed(list, "misaligned", v->check);
    if (sst_notice_skew(text, skew_us))
        add_noticed(list, "time-offsets", text);
    return list;
}

/* Figures of the pictures, of as many views as were measured. */
static json_t *quality_json(const struct engine_state *v)
{
    const struct sst_notices *n = &v->noticed;

    return json_pack("{s:i, s:o, s:o, s:o, s:i}", "views", v->noticed_views, "noise_levels",
                     sst_api_real(v->noticed_views ? n->noise_levels : NAN), "edge_px", sst_api_real(n->edge_px),
                     "jpeg_quality", sst_api_real(n->jpeg_quality), "soft_views", n->soft);
}

json_t *service_live_json(const struct engine_state *v, const struct sst_live_settings *settings)
{
    json_t *stages = json_object(), *live;

    for (int i = 0; i < ENGINE_STAGES; i++)
        json_object_set_new(stages, engine_stage_name((enum engine_stage)i), window_json(&v->stage_ms[i]));
    live = json_pack("{s:b, s:b, s:b, s:s, s:f, s:I, s:I, s:I, s:I, s:f, s:f, s:i, s:i}", "enabled", v->enabled,
                     "ready", v->ready, "settling", engine_settling(v), "reason", v->reason, "rate_hz", v->rate_hz,
                     "sets", (json_int_t)v->sets, "dropped", (json_int_t)v->dropped, "idle", (json_int_t)v->idle,
                     "pictures", (json_int_t)v->pictures, "changed_percent", v->changed_percent, "cpu_percent",
                     v->cpu_percent, "views", v->views, "present", v->present);
    if (!live)
        return NULL;
    json_object_set_new(live, "demand", json_string(engine_demand_name(v->demand)));
    json_object_set_new(live, "light_changes", json_integer((json_int_t)v->relit));
    json_object_set_new(live, "watched", json_integer((json_int_t)v->watched));
    json_object_set_new(live, "latency_ms", window_json(&v->latency_ms));
    json_object_set_new(live, "stages_ms", stages);
    json_object_set_new(live, "skips", skips_json(v, settings));
    json_object_set_new(live, "device", device_json(v));
    json_object_set_new(live, "verify_rays", json_boolean(settings->verify_rays));
    json_object_set_new(live, "size", json_pack("[i, i]", v->width, v->height));
    json_object_set_new(live, "range_px",
                        isfinite(v->range_min_px) && isfinite(v->range_max_px)
                            ? json_pack("[f, f]", v->range_min_px, v->range_max_px)
                            : json_null());
    json_object_set_new(live, "focus_px", sst_api_real(v->focus_px));
    json_object_set_new(live, "cut_px", sst_api_real(v->cut_px));
    json_object_set_new(live, "histogram", histogram_json(v));
    json_object_set_new(live, "focal_px", v->focal_px > 0 ? json_real(v->focal_px) : json_null());
    json_object_set_new(live, "spacing_mm", v->spacing_mm > 0 ? json_real(v->spacing_mm) : json_null());
    json_object_set_new(live, "calibration", json_string(v->check));
    json_object_set_new(live, "quality", quality_json(v));
    return live;
}

void service_process(uint64_t *rss_bytes, int *descriptors)
{
    FILE *f = fopen("/proc/self/statm", "re");
    DIR *dir = opendir("/proc/self/fd");
    unsigned long long pages = 0;

    if (f && fscanf(f, "%*u %llu", &pages) != 1)
        pages = 0;
    if (f)
        fclose(f);
    *rss_bytes = (uint64_t)pages * (uint64_t)sysconf(_SC_PAGESIZE);
    *descriptors = -3; /* ".", ".." and this folder itself */
    while (dir && readdir(dir))
        ++*descriptors;
    if (dir)
        closedir(dir);
}

int64_t service_certificate(const struct sst_service *s, double *days)
{
    const int64_t until_s = atomic_load(&s->counters.certificate_until_s);

    *days = (double)(until_s - sst_clock_wall_ns() / 1000000000) / 86400;
    return until_s;
}

static json_t *certificate_json(const struct sst_service *s)
{
    char text[SST_CLOCK_TEXT];
    double days;
    const int64_t until_s = service_certificate(s, &days);

    if (!until_s)
        return json_null();
    sst_clock_text(text, until_s * 1000000000);
    return json_pack("{s:s, s:f}", "until", text, "days", days);
}

static json_t *clients_json(struct sst_service *s)
{
    struct sst_counters *c = &s->counters;
    unsigned restarts;
    const int rtsp = sst_counters_clients(c, SST_COUNTERS_RTSP, &restarts);

    return json_pack("{s:i, s:i, s:i, s:i, s:I, s:I, s:I, s:I, s:I}", "http", atomic_load(&c->clients), "streams",
                     atomic_load(&c->streams), "listeners", atomic_load(&c->listeners), "rtsp", rtsp, "rtsp_restarts",
                     (json_int_t)restarts, "requests", (json_int_t)atomic_load(&c->requests), "refused",
                     (json_int_t)atomic_load(&c->refused), "skipped_pictures", (json_int_t)atomic_load(&c->skipped),
                     "slow_downloads", (json_int_t)atomic_load(&c->slow));
}

static json_t *process_json(double cpu_percent)
{
    uint64_t rss_bytes;
    int descriptors;

    service_process(&rss_bytes, &descriptors);
    return json_pack("{s:I, s:f, s:i}", "rss_bytes", (json_int_t)rss_bytes, "cpu_percent", cpu_percent, "descriptors",
                     descriptors);
}

/* Large together, and not for a stack of a server's thread. */
struct gathered {
    struct array_state array;
    struct engine_state engine;
    struct array_layout layout;
    struct sst_live_settings live;
    enum sst_service_phase phase;
    char reason[512];
    double cpu_percent;
};

int service_status(void *arg, struct sst_api_answer *out)
{
    struct sst_service *s = arg;
    struct gathered *g = calloc(1, sizeof(*g));
    const int64_t now_ns = sst_clock_now_ns();
    char time[SST_CLOCK_TEXT];

    if (!g)
        return -ENOMEM;
    array_state(s->array, &g->array);
    array_layout(s->array, &g->layout);
    engine_state(s->engine, &g->engine);
    pthread_mutex_lock(&s->lock);
    g->live = s->config.live;
    g->phase = s->phase;
    g->cpu_percent = s->cpu_percent;
    memcpy(g->reason, s->reason, sizeof(g->reason));
    if (!g->layout.generation)
        g->layout.config = s->config.array;
    pthread_mutex_unlock(&s->lock);
    sst_clock_text(time, sst_clock_wall_ns());
    out->body =
        json_pack("{s:s, s:s, s:s, s:f, s:s, s:o, s:o, s:o, s:o, s:o, s:o}", "version", SST_VERSION, "state",
                  sst_service_phase_name(g->phase), "reason", g->reason, "uptime_s",
                  (double)(now_ns - s->start_ns) / 1e9, "time", time, "capture", capture_json(&g->array, &g->layout),
                  "live", service_live_json(&g->engine, &g->live), "storage", sst_storage_status(s->storage), "clients",
                  clients_json(s), "certificate", certificate_json(s), "process", process_json(g->cpu_percent));
    if (out->body) {
        const double skew_ns = (double)sst_histogram_quantile(&g->array.report.skew_ns, 0.5);

        json_object_set_new(out->body, "noticed", service_noticed_json(&g->engine, skew_ns / 1e3));
        json_object_set_new(out->body, "hosts", service_hosts_json(s->array));
    }
    free(g);
    return out->body ? 0 : -ENOMEM;
}

/* --- cameras ------------------------------------------------------------------------------------------------------ */

static json_t *camera_json(const struct array_camera *c, int64_t now_ns)
{
    char name[32];

    snprintf(name, sizeof(name), "r%dc%d", c->row, c->col);
    return json_pack("{s:s, s:i, s:i, s:s, s:s, s:s, s:s, s:I, s:I, s:I, s:f, s:f, s:o, s:o, s:o, s:s}", "name", name,
                     "row", c->row, "col", c->col, "state", array_state_name(c->state), "serial", c->serial, "port",
                     c->port, "device", c->name, "frames", (json_int_t)c->grab.frames, "bad", (json_int_t)c->grab.bad,
                     "lost", (json_int_t)c->grab.lost, "rate_hz", c->rate_hz, "skew_us", c->skew_us, "last_s",
                     c->last_ns ? json_real((double)(now_ns - c->last_ns) / 1e9) : json_null(), "buckets",
                     counts(sst_bucket_keys, c->bucket, SST_BUCKETS), "recovery",
                     counts(rung_keys, c->grab.rung, SST_GRAB_RUNGS), "reason", c->reason);
}

int service_cameras(void *arg, struct sst_api_answer *out)
{
    struct sst_service *s = arg;
    struct array_camera *cameras = calloc(SST_CAMERAS_MAX, sizeof(*cameras));
    struct array_layout *layout = calloc(1, sizeof(*layout));
    json_t *list = json_array();
    int n = 0;

    if (cameras && layout) {
        n = array_cameras(s->array, cameras);
        array_layout(s->array, layout);
    }
    for (int i = 0; i < n; i++)
        json_array_append_new(list, camera_json(&cameras[i], sst_clock_now_ns()));
    if (layout)
        out->body =
            json_pack("{s:i, s:i, s:O}", "rows", layout->config.rows, "cols", layout->config.cols, "cameras", list);
    json_decref(list);
    free(cameras);
    free(layout);
    return out->body ? 0 : -ENOMEM;
}
