/* sst capture array: records framesets of all cameras and accounts for every frame. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <inttypes.h>
#include <jansson.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "capture/array/capture.h"
#include "capture/recording/recorder.h"
#include "cli/cli_internal.h"

struct array_capture {
    struct sst_array_config config;
    struct sst_recorder *recorder; /* NULL: no recording */
    uint64_t wanted;
    double seconds; /* 0: no limit */
    int64_t start_ns, cpu_ns;
    uint64_t bytes; /* writer's thread */
};

static struct sst_capture *running;

static void on_signal(int sig)
{
    (void)sig;
    if (running)
        sst_capture_stop(running);
}

static int on_set(void *arg, const struct sst_frameset *set)
{
    struct array_capture *a = arg;

    for (int i = 0; i < set->cameras; i++)
        a->bytes += set->frame[i] ? set->frame[i]->bytes : 0;
    return a->recorder ? sst_recorder_write(a->recorder, set) : 0;
}

static void on_progress(void *arg, uint64_t sets)
{
    struct array_capture *a = arg;
    const double s = (double)(sst_clock_now_ns() - a->start_ns) / 1e9;

    if (a->wanted)
        cli_progress((char[]){ "capture" }, (double)sets / (double)a->wanted);
    else if (a->seconds > 0)
        cli_progress((char[]){ "capture" }, s < a->seconds ? s / a->seconds : 1);
    if (a->seconds > 0 && s >= a->seconds && running)
        sst_capture_stop(running);
}

static const char *const fault_names[] = { "flagged", "empty",  "short",     "no_soi",
                                           "no_eoi",  "marker", "backwards", "frozen" };
static const char *const rung_names[] = { "restream", "reopen", "reset", "reauthorise", "power", "back_off" };

static json_t *counts(const char *const *names, const uint64_t *n, size_t size)
{
    json_t *o = json_object();

    for (size_t i = 0; i < size; i++)
        json_object_set_new(o, names[i], json_integer((json_int_t)n[i]));
    return o;
}

static json_t *cameras_json(const struct array_capture *a, const struct sst_capture *capture,
                            const struct sst_capture_report *r)
{
    json_t *list = json_array();

    for (int i = 0; i < a->config.bound; i++) {
        const struct sst_grab_device *device;
        struct sst_grab_counters n;

        sst_capture_camera(capture, i, &n, &device);
        json_array_append_new(list,
                              json_pack("{s:i, s:i, s:s, s:s, s:I, s:I, s:I, s:I, s:I, s:o, s:o, s:o}", "row",
                                        a->config.camera[i].row, "col", a->config.camera[i].col, "serial",
                                        device->serial[0] ? device->serial : a->config.camera[i].serial, "port",
                                        device->port[0] ? device->port : a->config.camera[i].port, "frames",
                                        (json_int_t)n.frames, "bad", (json_int_t)n.bad, "lost", (json_int_t)n.lost,
                                        "packets_missing", (json_int_t)n.packets_missing, "packets_resent",
                                        (json_int_t)n.packets_resent,
                                        "buckets", counts(sst_bucket_keys, r->sets.camera[i], SST_BUCKETS), "faults",
                                        counts(fault_names, n.fault, ARRAY_LEN(fault_names)), "recovery",
                                        counts(rung_names, n.rung, ARRAY_LEN(rung_names))));
    }
    return list;
}

static json_t *skew_json(const struct sst_histogram *h)
{
    return json_pack("{s:I, s:f, s:f, s:f, s:f}", "sets", (json_int_t)h->count, "p50_us",
                     (double)sst_histogram_quantile(h, 0.5) / 1e3, "p99_us",
                     (double)sst_histogram_quantile(h, 0.99) / 1e3, "min_us", (double)h->min / 1e3, "max_us",
                     (double)h->max / 1e3);
}

static int print_json(const struct array_capture *a, const struct sst_capture *capture,
                      const struct sst_capture_report *r, const char *dir)
{
    json_t *root = json_pack(
        "{s:s?, s:i, s:I, s:I, s:I, s:I, s:f, s:f, s:I, s:o, s:o, s:I, s:o, s:o, s:o, s:o}", "recording", dir,
        "cameras", a->config.bound, "sets", (json_int_t)r->handed, "complete", (json_int_t)r->complete, "empty",
        (json_int_t)r->empty, "refused", (json_int_t)r->refused, "seconds",
        (double)(sst_clock_now_ns() - a->start_ns) / 1e9, "cpu_seconds", (double)(sst_clock_cpu_ns() - a->cpu_ns) / 1e9,
        "bytes", (json_int_t)a->bytes, "trigger",
        json_pack("{s:I, s:I, s:I, s:I}", "edges", (json_int_t)r->edges, "stamped", (json_int_t)r->edges_stamped,
                  "skipped", (json_int_t)r->ticks_skipped, "dropped", (json_int_t)r->sets.dropped),
        "frames",
        json_pack("{s:I, s:I, s:I, s:o, s:I}", "delivered", (json_int_t)r->grab.frames, "bad", (json_int_t)r->grab.bad,
                  "lost_by_driver", (json_int_t)r->grab.lost, "buckets",
                  counts(sst_bucket_keys, r->sets.bucket, SST_BUCKETS), "unexplained", (json_int_t)r->unexplained),
        "skewed_sets", (json_int_t)r->skewed, "skew", skew_json(&r->skew_ns), "from_edge", skew_json(&r->from_edge_ns),
        "recovery", counts(rung_names, r->grab.rung, ARRAY_LEN(rung_names)), "array", cameras_json(a, capture, r));

    if (!root)
        return CLI_MEMORY;
    json_object_set_new(root, "io_errors", json_integer((json_int_t)r->grab.io_errors));
    json_object_set_new(root, "devices_lost", json_integer((json_int_t)r->grab.lost_devices));
    json_object_set_new(root, "devices_found", json_integer((json_int_t)r->grab.found_devices));
    return cli_dump_json(root, JSON_INDENT(2));
}

static void print_text(const struct array_capture *a, const struct sst_capture *capture,
                       const struct sst_capture_report *r, const char *dir)
{
    const struct sst_array_config *c = &a->config;
    const double s = (double)(sst_clock_now_ns() - a->start_ns) / 1e9;

    printf("%" PRIu64 " sets of %d cameras in %.1f s: %" PRIu64 " complete, %" PRIu64 " partial, %.1f MB%s%s\n",
           r->handed, c->bound, s, r->complete, r->handed - r->complete, (double)a->bytes / 1e6, dir ? " in " : "",
           dir ? dir : ", not recorded (use -o DIR)");
    if (r->skew_ns.count)
        printf("skew of a set: p50 %.0f us, p99 %.0f us, max %.0f us (row %d, col %d)\n",
               (double)sst_histogram_quantile(&r->skew_ns, 0.5) / 1e3,
               (double)sst_histogram_quantile(&r->skew_ns, 0.99) / 1e3, (double)r->skew_ns.max / 1e3,
               c->camera[r->worst_cam].row, c->camera[r->worst_cam].col);
    if (r->from_edge_ns.count)
        printf("farthest exposure from the trigger's edge: p50 %.0f us, max %.0f us (%" PRIu64 " of %" PRIu64
               " edges stamped by the loop-back line)\n",
               (double)sst_histogram_quantile(&r->from_edge_ns, 0.5) / 1e3, (double)r->from_edge_ns.max / 1e3,
               r->edges_stamped, r->edges);
    printf("frames: %" PRIu64 " delivered, %" PRIu64 " lost earlier by drivers;", r->grab.frames, r->grab.lost);
    for (int i = 0; i < SST_BUCKETS; i++)
        if (i == SST_BUCKET_SET || r->sets.bucket[i])
            printf("%s %" PRIu64 " %s", i ? "," : "", r->sets.bucket[i], sst_bucket_name((enum sst_bucket)i));
    printf("\n");
    if (r->sets.dropped || r->ticks_skipped)
        printf("triggers without a set: %" PRIu64 " without a free set, since the writer was behind or sets waited for "
               "a camera (raise cameras: buffers), %" PRIu64 " too late to fire\n",
               r->sets.dropped, r->ticks_skipped);
    if (r->unexplained)
        printf("%" PRIu64 " frames are unaccounted for: please report this as a bug\n", r->unexplained);
    for (int i = 0; i < c->bound; i++) {
        const struct sst_grab_device *device;
        struct sst_grab_counters n;
        const uint64_t *b = r->sets.camera[i];

        sst_capture_camera(capture, i, &n, &device);
        if (b[SST_BUCKET_SET] < r->handed)
            printf("  row %d, col %d (%s): missing in %" PRIu64 " sets; %" PRIu64 " bad frames, %" PRIu64
                   " lost by the driver, disconnected %" PRIu64 " times\n",
                   c->camera[i].row, c->camera[i].col, device->serial[0] ? device->serial : c->camera[i].port,
                   r->handed - b[SST_BUCKET_SET], n.bad, n.lost, n.lost_devices);
    }
}

int cli_open_recorder(struct sst_recorder **out, const struct sst_array_config *c, struct sst_recorder_config *cfg)
{
    struct sst_recorder_track *tracks = calloc((size_t)c->bound, sizeof(*tracks));
    struct sst_grab_device *devices = NULL;
    int n = 0, err;

    if (!tracks)
        return -ENOMEM;
    err = sst_grab_list(&devices, &n);
    if (!err) {
        int all = n;

        (void)sst_grab_select(devices, n, c->fourcc);
        err = sst_grab_list_parts(&devices, &n, &all, sst_capture_split(c));
    }
    for (int i = 0; i < c->bound && !err; i++) {
        const struct sst_config_camera *cam = &c->camera[i];

        tracks[i].row = cam->row;
        tracks[i].col = cam->col;
        memcpy(tracks[i].serial, cam->serial, sizeof(tracks[i].serial));
        memcpy(tracks[i].port, cam->port, sizeof(tracks[i].port));
        for (int k = 0; k < n; k++)
            if (cli_is_node(cam, &devices[k])) {
                memcpy(tracks[i].serial, devices[k].serial, sizeof(tracks[i].serial));
                memcpy(tracks[i].port, devices[k].port, sizeof(tracks[i].port));
                memcpy(tracks[i].name, devices[k].name, sizeof(tracks[i].name));
            }
    }
    cfg->rows = c->rows;
    cfg->cols = c->cols;
    cfg->cameras = c->bound;
    cfg->tracks = tracks;
    cfg->fourcc = c->fourcc;
    cfg->width = c->width;
    cfg->height = c->height;
    cfg->rate_hz = sst_array_sets_hz(c);
    cfg->spacing_mm = c->spacing_mm;
    err = err ? err : sst_recorder_open(out, cfg);
    free(devices);
    free(tracks);
    return err;
}

static int capture(struct array_capture *a, struct sst_recorder_config *rec, bool json)
{
    const struct sst_capture_events events = { .arg = a, .set = on_set, .progress = on_progress };
    const struct sigaction act = { .sa_handler = on_signal };
    struct sst_capture_report *report = calloc(1, sizeof(*report));
    struct sst_capture *capture = NULL;
    struct sigaction old[2];
    int err, closed, code;

    if (!report)
        return CLI_MEMORY;
    a->start_ns = sst_clock_now_ns();
    a->cpu_ns = sst_clock_cpu_ns();
    err = sst_capture_open(&capture, &a->config, &events);
    if (!err && rec->dir)
        err = cli_open_recorder(&a->recorder, &a->config, rec);
    if (!err) {
        running = capture;
        sigaction(SIGINT, &act, &old[0]);
        sigaction(SIGTERM, &act, &old[1]);
        a->start_ns = sst_clock_now_ns();
        err = sst_capture_run(capture, a->wanted);
        cli_progress_end();
        running = NULL;
        sigaction(SIGINT, &old[0], NULL);
        sigaction(SIGTERM, &old[1], NULL);
        sst_capture_report(capture, report);
    }
    closed = sst_recorder_close(a->recorder);
    err = err ? err : closed;
    code = cli_exit_code(err);
    if (report->handed && json)
        code = print_json(a, capture, report, rec->dir) ? CLI_MEMORY : code;
    else if (report->handed)
        print_text(a, capture, report, rec->dir);
    if (!err && report->refused)
        code = CLI_OUTPUT; /* logged by the recorder */
    else if (!err && a->wanted && report->handed + report->sets.dropped < a->wanted)
        code = CLI_INTERRUPTED;
    sst_capture_close(capture);
    free(report);
    return code;
}

struct array_options {
    const char *config, *dir, *format;
    int source, sets, grid[2], size[2];
    double rate_hz, camera_hz, segment_s, sync_s;
    bool append, json;
};

/* Options that override the configuration. */
static int apply(const struct cli_command *cmd, const struct array_options *o, struct sst_array_config *c)
{
    if (o->grid[0] && c->bound && (o->grid[0] != c->rows || o->grid[1] != c->cols))
        return cli_usage_error(cmd, "--grid does not fit the cameras that the configuration binds to places");
    if (o->grid[0]) {
        c->rows = o->grid[0];
        c->cols = o->grid[1];
    }
    if (o->size[0]) {
        c->width = o->size[0];
        c->height = o->size[1];
    }
    if (o->format) {
        c->fourcc = sst_array_format(o->format);
        if (!c->fourcc)
            return cli_usage_error(cmd, "--format %s: known are MJPEG YUYV GREY Y16 BGGR8 GBRG8 GRBG8 RGGB8",
                                   o->format);
    }
    if (o->source >= 0)
        c->source = (enum sst_config_source)o->source;
    if (c->source == SST_CONFIG_GPIO && !c->lines)
        return cli_usage_error(cmd, "a gpio trigger needs its lines: trigger: lines in the configuration");
    if (c->source == SST_CONFIG_EXTERNAL && !c->loopback[0])
        return cli_usage_error(cmd, "an external trigger needs its input: trigger: loopback in the configuration");
    if (o->rate_hz > 0)
        c->trigger_hz = o->rate_hz;
    if (o->rate_hz > 0 && c->source == SST_CONFIG_FREE_RUN)
        c->rate_hz = o->rate_hz;
    if (o->camera_hz > 0)
        c->rate_hz = o->camera_hz;
    return CLI_OK;
}

static int run(const struct cli_command *cmd, int argc, char **argv)
{
    struct sst_recorder_config rec;
    struct array_options o = { .source = -1 };
    struct array_capture *a = calloc(1, sizeof(*a));
    int r;

    if (!a)
        return CLI_MEMORY;
    sst_recorder_config_defaults(&rec);
    o.segment_s = rec.segment_s;
    o.sync_s = rec.sync_s;

    const struct cli_option options[] = {
        { "output", 'o', CLI_MADE, &o.dir, "DIR", "record into this folder; default: frames are only counted" },
        { "sets", 'n', CLI_INT, &o.sets, "N", "number of sets; without -n and --duration until Ctrl-C", 1, 1000000000 },
        { "duration", 0, CLI_DOUBLE, &a->seconds, "S", "duration in seconds", 0.001, 1e9 },
        { "config", 0, CLI_STRING, &o.config, "FILE", "configuration; /etc/sst/sstd.yaml" },
        { "grid", 0, CLI_GRID, o.grid, "RxC", "rows and columns of the array; 6x6", 1, SST_CAMERAS_MAX },
        { "size", 0, CLI_SIZE, o.size, "WxH", "pixels of a frame; 640x480", 16, 16384 },
        { "format", 0, CLI_STRING, &o.format, "F", "pixel format; MJPEG" },
        { "trigger", 0, CLI_WORD, &o.source, "SOURCE", "gpio, software, free-run or external", 0, 0,
          "gpio software free-run external" },
        { "rate", 0, CLI_DOUBLE, &o.rate_hz, "HZ", "sets per second; 10", 0.01, 1000 },
        { "camera-rate", 0, CLI_DOUBLE, &o.camera_hz, "HZ", "frame rate requested from the cameras", 0.01, 1000 },
        { "append", 0, CLI_FLAG, &o.append, NULL, "append to an existing recording" },
        { "segment", 0, CLI_DOUBLE, &o.segment_s, "S", "length of each file in seconds", 1, 1e6 },
        { "sync", 0, CLI_DOUBLE, &o.sync_s, "S", "maximum time in seconds that a power cut may lose; 0: sync every set",
          0, 1e6 },
        { "json", 0, CLI_FLAG, &o.json, NULL, "print the frame statistics as JSON" },
    };

    r = cli_parse(cmd, options, ARRAY_LEN(options), argc, argv, NULL, 0, 0);
    if (r == CLI_GO_ON) {
        r = cli_exit_code(sst_array_config_read(&a->config, o.config));
        if (r == CLI_OK)
            r = apply(cmd, &o, &a->config);
        if (r == CLI_OK) {
            a->wanted = (uint64_t)o.sets;
            rec.dir = o.dir;
            rec.append = o.append;
            rec.segment_s = o.segment_s;
            rec.sync_s = o.sync_s;
            r = capture(a, &rec, o.json);
        }
    }
    free(a);
    return r;
}

const struct cli_command cli_capture_array = { "capture array", run };
