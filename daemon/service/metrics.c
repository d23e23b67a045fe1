/* Metrics for Prometheus (text format 0.0.4), from the numbers of the status. */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/border.h"
#include "base/clock.h"
#include "daemon/service/service_internal.h"

static void metric(FILE *f, const char *name, const char *type, const char *help, double value)
{
    fprintf(f, "# HELP sst_%s %s\n# TYPE sst_%s %s\nsst_%s %.17g\n", name, help, name, type, name, value);
}

static void head(FILE *f, const char *name, const char *type, const char *help)
{
    fprintf(f, "# HELP sst_%s %s\n# TYPE sst_%s %s\n", name, help, name, type);
}

static void write_phase(FILE *f, enum sst_service_phase phase)
{
    head(f, "state", "gauge", "1 for the state that the service is in.");
    for (int i = 0; i <= SST_SERVICE_FAILED; i++)
        fprintf(f, "sst_state{state=\"%s\"} %d\n", sst_service_phase_name((enum sst_service_phase)i), (int)phase == i);
}

static void write_capture(FILE *f, const struct array_state *a)
{
    static const double quantiles[] = { 0.5, 0.99, 1 };
    const struct sst_capture_report *r = &a->report;

    metric(f, "cameras", "gauge", "Cameras that the array has.", a->cameras);
    metric(f, "cameras_present", "gauge", "Cameras that deliver.", a->present);
    metric(f, "sets_total", "counter", "Sets captured.", (double)a->sets);
    metric(f, "sets_complete_total", "counter", "Sets with a frame of every camera.", (double)a->complete);
    metric(f, "sets_refused_total", "counter", "Sets for which there was no memory.", (double)a->ring_refused);
    metric(f, "capture_rate_hz", "gauge", "Sets per second.", a->rate_hz);
    metric(f, "trigger_edges", "gauge", "Triggers fired since the cameras were opened.", (double)r->edges);
    head(f, "frames", "gauge", "Frames since the cameras were opened, by where they ended.");
    for (int i = 0; i < SST_BUCKETS; i++)
        fprintf(f, "sst_frames{bucket=\"%s\"} %llu\n", sst_bucket_keys[i], (unsigned long long)r->sets.bucket[i]);
    metric(f, "frames_unexplained", "gauge", "Frames that ended nowhere or twice: 0, or a bug.",
           (double)r->unexplained);
    head(f, "skew_seconds", "summary", "Spread of the exposures of a set since the cameras were opened.");
    for (size_t i = 0; i < ARRAY_LEN(quantiles); i++)
        fprintf(f, "sst_skew_seconds{quantile=\"%g\"} %.9g\n", quantiles[i],
                (double)sst_histogram_quantile(&r->skew_ns, quantiles[i]) / 1e9);
    fprintf(f, "sst_skew_seconds_count %llu\n", (unsigned long long)r->skew_ns.count);
    head(f, "set_delay_seconds", "summary", "From the trigger until its set is there, since the cameras were opened.");
    for (size_t i = 0; i < ARRAY_LEN(quantiles); i++)
        fprintf(f, "sst_set_delay_seconds{quantile=\"%g\"} %.9g\n", quantiles[i],
                (double)sst_histogram_quantile(&a->delay_ns, quantiles[i]) / 1e9);
    fprintf(f, "sst_set_delay_seconds_count %llu\n", (unsigned long long)a->delay_ns.count);
    metric(f, "skewed_sets", "gauge", "Sets with more skew than the limit, since the cameras were opened.",
           (double)r->skewed);
}

static void write_cameras(FILE *f, struct sst_service *s)
{
    struct array_camera *c = calloc(SST_CAMERAS_MAX, sizeof(*c));
    const int n = c ? array_cameras(s->array, c) : 0;

    head(f, "camera_up", "gauge", "1 if the camera delivers.");
    for (int i = 0; i < n; i++)
        fprintf(f, "sst_camera_up{camera=\"r%dc%d\"} %d\n", c[i].row, c[i].col, c[i].state == SST_GRAB_STREAMING);
    head(f, "camera_frames", "gauge", "Frames of the camera since it was opened.");
    for (int i = 0; i < n; i++)
        fprintf(f, "sst_camera_frames{camera=\"r%dc%d\"} %llu\n", c[i].row, c[i].col,
                (unsigned long long)c[i].grab.frames);
    head(f, "camera_bad_frames", "gauge", "Damaged ones among them.");
    for (int i = 0; i < n; i++)
        fprintf(f, "sst_camera_bad_frames{camera=\"r%dc%d\"} %llu\n", c[i].row, c[i].col,
                (unsigned long long)c[i].grab.bad);
    head(f, "camera_skew_seconds", "gauge", "Its exposure against the median of its sets, smoothed.");
    for (int i = 0; i < n; i++)
        fprintf(f, "sst_camera_skew_seconds{camera=\"r%dc%d\"} %.9g\n", c[i].row, c[i].col, c[i].skew_us / 1e6);
    free(c);
}

static void write_live(FILE *f, const struct engine_state *v)
{
    static const double quantiles[] = { 0.5, 0.99, 1 };

    metric(f, "live_ready", "gauge", "1 if see-through pictures are made.", v->ready);
    metric(f, "live_sets_total", "counter", "Sets taken into the live picture.", (double)v->sets);
    metric(f, "live_sets_dropped_total", "counter", "Sets passed over for newer ones.", (double)v->dropped);
    metric(f, "live_sets_watched_total", "counter", "Sets of which one view was watched, as no pictures were needed.",
           (double)v->watched);
    metric(f, "live_sets_idle_total", "counter", "Sets in which nothing had changed.", (double)v->idle);
    metric(f, "values_not_finite_total", "counter", "NaN and infinity where results leave a module: faults.",
           (double)sst_border_count());
    metric(f, "live_light_changes_total", "counter", "Sets in which the light or exposure of a view changed.",
           (double)v->relit);
    metric(f, "live_pictures_total", "counter", "Pictures rendered and encoded.", (double)v->pictures);
    metric(f, "visits_total", "counter", "Things that came into view and moved.", (double)v->visits);
    metric(f, "live_rate_hz", "gauge", "Sets per second, over the last ten seconds.", v->rate_hz);
    metric(f, "live_tiles_total", "counter", "Tiles of the sets taken in.", (double)v->tiles);
    metric(f, "live_tiles_changed_total", "counter", "Tiles of them that were recomputed.", (double)v->tiles_changed);
    metric(f, "live_label_runs_total", "counter", "Runs of the segmentation network.", (double)v->label_runs);
    metric(f, "live_label_runs_skipped_total", "counter", "Runs that were not needed.", (double)v->label_runs_skipped);
    metric(f, "live_device_up", "gauge", "1 if pictures are rendered on a device, 0: on the CPU.",
           v->on_device && !v->device.failing);
    metric(f, "live_device_pictures_total", "counter", "Pictures that the device rendered.",
           (double)v->device.pictures);
    metric(f, "live_device_on_cpu_total", "counter", "Pictures that the CPU rendered instead of the device.",
           (double)v->device.on_cpu);
    metric(f, "live_device_failures_total", "counter", "Times that the device failed at pictures.",
           (double)v->device.failures);
    metric(f, "live_device_labels_up", "gauge", "1 if the network runs on a device, 0: on the CPU.",
           v->labels_on_device && !v->label_device.failing);
    metric(f, "live_device_label_runs_total", "counter", "Runs of the network on the device.",
           (double)v->label_device.runs);
    metric(f, "live_device_label_runs_on_cpu_total", "counter", "Runs of it on the CPU instead of the device.",
           (double)v->label_device.on_cpu);
    metric(f, "live_device_label_failures_total", "counter", "Times that the device failed at the network.",
           (double)v->label_device.failures);
    head(f, "live_latency_seconds", "summary",
         "From the trigger to the encoded picture; quantiles of the last minute, NaN: nothing changed.");
    for (size_t i = 0; i < ARRAY_LEN(quantiles); i++)
        fprintf(f, "sst_live_latency_seconds{quantile=\"%g\"} %.9g\n", quantiles[i],
                window_quantile(&v->latency_ms, quantiles[i], sst_clock_now_ns()) / 1e3);
    fprintf(f, "sst_live_latency_seconds_sum %.9g\nsst_live_latency_seconds_count %llu\n", v->latency_ms.sum / 1e3,
            (unsigned long long)v->latency_ms.count);
    head(f, "live_stage_seconds_total", "counter", "Time spent in each stage.");
    for (int i = 0; i < ENGINE_STAGES; i++)
        fprintf(f, "sst_live_stage_seconds_total{stage=\"%s\"} %.9g\n", engine_stage_name((enum engine_stage)i),
                v->stage_ms[i].sum / 1e3);
}

/* Notices: 1 for a present one, of all possible ones. */
static void write_noticed(FILE *f, const struct engine_state *v, const struct array_state *a)
{
    static const char *const what[] = { "noise",         "blur",        "soft-views", "jpeg",
                                        "missing-views", "blank-views", "misaligned", "time-offsets" };
    json_t *list = service_noticed_json(v, (double)sst_histogram_quantile(&a->report.skew_ns, 0.5) / 1e3);

    head(f, "noticed", "gauge", "1 while this is wrong with the pictures.");
    for (size_t i = 0; i < ARRAY_LEN(what); i++) {
        bool now = false;

        for (size_t k = 0; k < json_array_size(list); k++)
            now |= !strcmp(json_string_value(json_object_get(json_array_get(list, k), "what")), what[i]);
        fprintf(f, "sst_noticed{what=\"%s\"} %d\n", what[i], now);
    }
    json_decref(list);
}

/** A number of the status's object, by name. */
static double number(const json_t *o, const char *key)
{
    return json_number_value(json_object_get(o, key));
}

static void write_storage(FILE *f, struct sst_service *s)
{
    static const char *const names[] = { "OK", "LOW", "FULL" };
    static const char *const kinds[] = { "recordings", "snapshots", "exports" };
    json_t *o = sst_storage_status(s->storage);
    const json_t *r = json_object_get(o, "recording");

    head(f, "storage_state", "gauge", "1 for the state that storage is in.");
    for (int i = 0; i < 3; i++)
        fprintf(f, "sst_storage_state{state=\"%s\"} %d\n", names[i], (int)sst_storage_state(s->storage) == i);
    metric(f, "storage_free_bytes", "gauge", "Free space.", number(o, "free_bytes"));
    metric(f, "storage_used_bytes", "gauge", "Taken by recordings, snapshots and exports.", number(o, "used_bytes"));
    metric(f, "storage_by_hand_bytes", "gauge", "Taken by what was made by hand.", number(o, "by_hand_bytes"));
    metric(f, "storage_by_hand_limit_bytes", "gauge", "Up to this it outlives the rest.",
           number(o, "by_hand_limit_bytes"));
    head(f, "storage_kept", "gauge", "What is kept, by kind.");
    for (size_t i = 0; i < ARRAY_LEN(kinds); i++)
        fprintf(f, "sst_storage_kept{kind=\"%s\"} %.0f\n", kinds[i], number(o, kinds[i]));
    metric(f, "storage_removed_total", "counter", "Removed to keep within the limits.", number(o, "removed"));
    metric(f, "storage_deleted_total", "counter", "Deleted by hand.", number(o, "deleted"));
    metric(f, "storage_downloads", "gauge", "Downloads at work.", number(o, "downloads"));
    metric(f, "recording", "gauge", "1 while something is recorded.", json_is_true(json_object_get(r, "active")));
    metric(f, "recording_sets", "gauge", "Sets in it.", number(r, "sets"));
    metric(f, "recording_dropped", "gauge", "Sets that it lacks.", number(r, "dropped"));
    json_decref(o);
}

static void write_process(FILE *f, struct sst_service *s)
{
    const struct sst_counters *c = &s->counters;
    uint64_t rss_bytes, events[3];
    unsigned restarts;
    double days;
    int descriptors;
    const int rtsp = sst_counters_clients(&s->counters, SST_COUNTERS_RTSP, &restarts);

    service_process(&rss_bytes, &descriptors);
    sst_events_counts(s->events, events);
    metric(f, "http_clients", "gauge", "Connections.", c->clients);
    metric(f, "http_streams", "gauge", "Moving pictures that are watched over HTTP.", c->streams);
    metric(f, "http_requests_total", "counter", "Requests.", (double)c->requests);
    metric(f, "http_refused_total", "counter", "Requests that were refused.", (double)c->refused);
    metric(f, "http_sent_bytes_total", "counter", "Bytes sent.", (double)c->bytes);
    metric(f, "http_slow_downloads_total", "counter", "Downloads that ended for others, their readers being slow.",
           (double)c->slow);
    metric(f, "http_pictures_skipped_total", "counter", "Pictures that slow viewers did not get.", (double)c->skipped);
    metric(f, "rtsp_clients", "gauge", "Clients that watch over RTSP.", rtsp);
    metric(f, "rtsp_restarts_total", "counter", "Times that sst-rtsp was started again.", restarts);
    if (service_certificate(s, &days))
        metric(f, "certificate_days", "gauge", "Days that are left of the certificate of HTTPS.", days);
    head(f, "events_total", "counter", "Events by level.");
    fprintf(f, "sst_events_total{level=\"info\"} %llu\n", (unsigned long long)events[0]);
    fprintf(f, "sst_events_total{level=\"warning\"} %llu\n", (unsigned long long)events[1]);
    fprintf(f, "sst_events_total{level=\"error\"} %llu\n", (unsigned long long)events[2]);
    metric(f, "process_resident_memory_bytes", "gauge", "Resident memory.", (double)rss_bytes);
    metric(f, "process_open_fds", "gauge", "Open descriptors.", descriptors);
    metric(f, "process_cpu_seconds_total", "counter", "CPU time.", (double)sst_clock_cpu_ns() / 1e9);
    metric(f, "uptime_seconds", "gauge", "Since the start.", (double)(sst_clock_now_ns() - s->start_ns) / 1e9);
}

int service_metrics(void *arg, char **text)
{
    struct sst_service *s = arg;
    struct array_state *array = calloc(1, sizeof(*array));
    struct engine_state *viewer = calloc(1, sizeof(*viewer));
    enum sst_service_phase phase;
    char *out = NULL;
    size_t size;
    FILE *f = array && viewer ? open_memstream(&out, &size) : NULL;

    if (f) {
        array_state(s->array, array);
        engine_state(s->engine, viewer);
        pthread_mutex_lock(&s->lock);
        phase = s->phase;
        pthread_mutex_unlock(&s->lock);
        head(f, "info", "gauge", "The version that runs.");
        fprintf(f, "sst_info{version=\"%s\"} 1\n", SST_VERSION);
        write_phase(f, phase);
        write_capture(f, array);
        write_cameras(f, s);
        service_hosts_metrics(f, s->array);
        write_live(f, viewer);
        write_noticed(f, viewer, array);
        write_storage(f, s);
        write_process(f, s);
        if (fclose(f)) {
            free(out);
            out = NULL;
        }
    }
    free(array);
    free(viewer);
    *text = out;
    return out ? 0 : -ENOMEM;
}
