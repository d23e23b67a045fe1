/* Sets of a recording or of a simulated world, fed to the live picture; prints their costs.
 *
 *   live_bench SOURCE [name=value ...]
 *
 * SOURCE: the folder of a recording, or the name or file of a simulated world. sets=30 first=0 (of the recording)
 * rate=10 (sets a second of the world) calib=FILE (none: views are as the cameras saw them; truth: the world's own)
 * model=NAME (none) device=NAME (none) out=DIR (pictures of every set, and overlays of the last) threads=0 change=1
 * labels=1 background=0 min=0 max=0 (disparities) focus=NAN width=0 height=0 (of a world; 0: native) same=0 (from this
 * set on the world stands still) absent=-1 from=0 (this camera gives no frames from that set on) lamp=0 gain=1.3 (from
 * this set on the world is brighter by this factor) verify=1 (0: rays count by depth and label alone) clear=0 (1: clear
 * pictures) tracks=0 (1: prints them) alarms=0 (false ones accepted an hour of things behind leaves; 0: no search).
 * slowest=0: stage times of this number of sets, the slowest first. paced=0: as the service does on this number of
 * processors, by CPU time, whatever else runs: sets that come while one is worked on are left out, and sets=N is the
 * number that come; prints sets a second and latencies. steady=0: figures of sets from this one on. truth=LABEL: how
 * right that label is in every set, and how often it is reported to have appeared (of a world with ideal cameras). */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include <linux/videodev2.h>

#include "base/clock.h"
#include "base/log.h"
#include "base/stats.h"
#include "capture/recording/recording.h"
#include "pipeline/image/codec.h"
#include "pipeline/live/live.h"
#include "pipeline/method/network/model_path.h"
#include "simulators/scene/world/sim_world.h"
#include "tests/live_truth.h"
#include "tests/live_zone.h"

#define FRAME_MAX ((size_t)4 << 20)
#define SETS_MAX  10000
#define CAPTURE_S 0.025 /* from the trigger until a set is complete */

static struct {
    const char *name;
    double value;
} options[] = {
    { "sets", 30 },      { "first", 0 },   { "rate", 10 },  { "threads", 0 }, { "change", 1 }, { "labels", 1 },
    { "background", 0 }, { "min", 0 },     { "max", 0 },    { "focus", NAN }, { "width", 0 },  { "height", 0 },
    { "same", 0 },       { "absent", -1 }, { "from", 0 },   { "lamp", 0 },    { "gain", 1.3 }, { "verify", 1 },
    { "clear", 0 },      { "tracks", 0 },  { "alarms", 0 }, { "slowest", 0 },
    { "paced", 0 },      { "steady", 0 },
};
static const char *calib = "none", *model = "pspnet-small", *out_dir, *truth_label, *device;

struct source {
    struct sst_recording *recording;
    struct sst_sim_world *world;
    int rows, cols, width, height, sets;
    uint32_t fourcc;
    int view[SST_MAX_VIEWS]; /* of a camera */
    int cameras;
    uint8_t *data[SST_MAX_VIEWS]; /* by camera */
};

struct cost {
    double stage_ms[SST_LIVE_STAGES + 3][SETS_MAX]; /* and update, picture, JPEG */
    double cpu_ms[SETS_MAX], anew[SETS_MAX], changed[SETS_MAX];
    int set[SETS_MAX], n;
    /* of paced sets */
    double latency_ms[SETS_MAX];
    double begun_s, free_s; /* end of the first one; when the processors are free */
};

static double option(const char *name)
{
    for (size_t i = 0; i < ARRAY_LEN(options); i++) {
        if (!strcmp(options[i].name, name))
            return options[i].value;
    }
    abort();
}

static bool set_option(const char *text)
{
    const char *eq = strchr(text, '=');
    const struct {
        const char *name, **value;
    } texts[] = {
        { "calib", &calib }, { "model", &model }, { "out", &out_dir }, { "truth", &truth_label }, { "device", &device }
    };

    for (size_t i = 0; eq && i < ARRAY_LEN(texts); i++) {
        if (strlen(texts[i].name) == (size_t)(eq - text) && !strncmp(text, texts[i].name, (size_t)(eq - text))) {
            *texts[i].value = eq + 1;
            return true;
        }
    }
    for (size_t i = 0; eq && i < ARRAY_LEN(options); i++) {
        if (strlen(options[i].name) == (size_t)(eq - text) && !strncmp(text, options[i].name, (size_t)(eq - text))) {
            options[i].value = atof(eq + 1);
            return true;
        }
    }
    fprintf(stderr, "live_bench: unknown option %s\n", text);
    return false;
}

static int open_recording(struct source *s, const char *path)
{
    const struct sst_recording_info *info;
    int err = sst_recording_open(&s->recording, path);

    if (err)
        return err;
    info = sst_recording_info(s->recording);
    s->rows = info->rows;
    s->cols = info->cols;
    s->width = info->width;
    s->height = info->height;
    s->fourcc = info->fourcc;
    s->cameras = info->cameras;
    s->sets = sst_recording_sets(s->recording);
    for (int c = 0; c < s->cameras; c++)
        s->view[c] = info->track[c].row * info->cols + info->track[c].col;
    return 0;
}

static int open_world(struct source *s, const char *name)
{
    const struct sst_sim_settings *world;
    int err = sst_sim_world_open(&s->world, name, NULL);

    if (err)
        return err;
    world = sst_sim_world_settings(s->world);
    s->rows = world->rows;
    s->cols = world->cols;
    s->width = world->width;
    s->height = world->height;
    s->fourcc = V4L2_PIX_FMT_MJPEG;
    s->cameras = s->rows * s->cols;
    s->sets = SETS_MAX;
    if (option("width") > 0) {
        s->width = (int)option("width");
        s->height = (int)option("height");
    }
    for (int c = 0; c < s->cameras; c++) {
        s->view[c] = c;
        s->data[c] = malloc(FRAME_MAX);
        if (!s->data[c])
            return -ENOMEM;
    }
    return 0;
}

static int read_recorded(struct source *s, int i, struct sst_live_input *in)
{
    struct sst_recording_set *set = malloc(sizeof(*set));
    int err = set ? sst_recording_set(s->recording, i, set) : -ENOMEM;

    for (int c = 0; c < s->cameras && !err; c++) {
        free(s->data[c]);
        s->data[c] = NULL;
        if (sst_recording_frame(s->recording, set, c, &s->data[c]))
            continue; /* missing */
        in->frame[s->view[c]].data = s->data[c];
        in->frame[s->view[c]].bytes = set->frame[c].bytes;
        in->frame[s->view[c]].stride = set->frame[c].stride;
    }
    if (!err) {
        in->t_ns = set->t_ns;
        in->set = set->index;
    }
    free(set);
    return err;
}

/* Time of the world in a set. */
static int64_t shown_ns(int i)
{
    const int at = option("same") > 0 ? sst_min_int(i, (int)option("same")) : i;

    return (int64_t)((double)at * 1e9 / option("rate")) + 1000000000;
}

static int read_world(struct source *s, int i, struct sst_live_input *in)
{
    const bool lit = option("lamp") > 0 && i >= option("lamp");

    in->t_ns = (int64_t)((double)i * 1e9 / option("rate")) + 1000000000;
    in->set = (uint64_t)i;
    for (int c = 0; c < s->cameras; c++) {
        const struct sst_sim_exposure e = { .cam = c,
                                            .trigger = (uint64_t)i,
                                            .t_ns = shown_ns(i),
                                            .exposure_us = sst_sim_world_settings(s->world)->exposure_us,
                                            .gain = lit ? option("gain") : 1 };
        int err = sst_sim_world_frame(s->world, &e, (struct sst_sim_format){ s->fourcc, s->width, s->height },
                                      (struct sst_sim_room){ s->data[c], FRAME_MAX }, &in->frame[c].bytes);

        if (err)
            return err;
        in->frame[c].data = s->data[c];
    }
    return 0;
}

static int read_calibration(struct sst_use_calibration *use, const char *world)
{
    char path[64] = "/tmp/live-bench-XXXXXX.yaml";
    int fd, err;

    if (strcmp(calib, "truth"))
        return sst_use_calibration_read(use, calib);
    fd = mkstemps(path, 5);
    if (fd < 0)
        return -errno;
    close(fd);
    err = sst_sim_world_parameters(world, path);
    err = err ? err : sst_use_calibration_read(use, path);
    unlink(path);
    return err;
}

static int write_picture(const struct sst_image *image, const char *name, int i)
{
    char path[4200];

    snprintf(path, sizeof(path), "%s/%s-%04d.jpg", out_dir, name, i);
    return sst_image_write_jpeg(image, path, 90);
}

static int write_overlays(struct sst_live *live)
{
    const struct sst_lightfield *lf = sst_live_lightfield(live);
    struct sst_image image = { 0 };
    int err = sst_image_init(&image, lf->width, lf->height);

    if (!err && !sst_livepicture_overlay(live, SST_LIVE_DISPARITY_PICTURE, &image))
        err = write_picture(&image, "disparity", 0);
    if (!err && !sst_livepicture_overlay(live, SST_LIVE_LABELS_PICTURE, &image))
        err = write_picture(&image, "labels", 0);
    sst_image_fini(&image);
    return err ? err : write_picture(&lf->views[lf->ref_view].image, "reference", 0);
}

/* Time of a paced set: a tenth of the work is not shared among the processors. */
static void pace(struct cost *cost, int i)
{
    const double come_s = i / option("rate") + CAPTURE_S, threads = option("paced");
    const double took_s = 1e-3 * cost->cpu_ms[cost->n] * (threads > 0 ? 0.1 + 0.9 / threads : 1);

    cost->free_s = fmax(cost->free_s, come_s) + took_s;
    cost->latency_ms[cost->n] = 1e3 * (cost->free_s - come_s + CAPTURE_S);
    if (!cost->n)
        cost->begun_s = cost->free_s;
}

/* The set after set i that is worked on next. */
static int next_set(const struct cost *cost, int i)
{
    const int newest = (int)floor((cost->free_s - CAPTURE_S) * option("rate"));

    return option("paced") > 0 ? sst_max_int(i + 1, newest) : i + 1;
}

/* One set: taken in, rendered, encoded. */
static void print_tracks(const struct sst_live *live)
{
    static const char *const states[] = { "seen", "covered", "still" };
    struct sst_live_track track[SST_LIVE_TRACKS];
    const int n = option("tracks") ? sst_live_tracks(live, track) : 0;

    for (int i = 0; i < n; i++)
        printf("  track %u %s: %s%s %.0f..%.0f, %.0f..%.0f px, disparity %.2f px, %.0f px/s\n", track[i].id,
               sst_classes_name(&sst_live_lightfield(live)->classes, track[i].label), states[track[i].state],
               track[i].hidden ? " hidden" : "", track[i].x0, track[i].x1, track[i].y0, track[i].y1, track[i].disp_px,
               track[i].vx_px_s);
}

static int follow(struct sst_live *live, struct sst_livepicture *p, const struct sst_live_input *in, struct cost *cost,
                  struct live_truth *truth, int i)
{
    const int64_t cpu_ns = sst_clock_cpu_ns();
    int64_t at[4], anew = 0;
    struct sst_live_report *report = calloc(1, sizeof(*report));
    const struct sst_image *image = NULL;
    struct sst_render_config cfg;
    uint8_t *jpeg = NULL;
    size_t bytes = 0;
    int err;

    if (!report)
        return -ENOMEM;
    sst_render_config_defaults(&cfg);
    cfg.focus_px = option("focus");
    if (option("clear") > 0) {
        cfg.method = SST_RENDER_CLEAR;
        cfg.cut_px = NAN;
    }
    cfg.verify = option("verify") > 0 ? SST_VERIFY_ON : SST_VERIFY_OFF;
    at[0] = sst_clock_now_ns();
    err = sst_live_update(live, in, report);
    at[1] = sst_clock_now_ns();
    err = err ? err : sst_livepicture_render(p, &cfg, &image, &anew);
    at[2] = sst_clock_now_ns();
    if (!err && anew)
        err = sst_image_encode_jpeg(image, 85, &jpeg, &bytes);
    at[3] = sst_clock_now_ns();
    free(jpeg);
    if (err == -ENODATA) {
        printf("set %d: not ready\n", i);
        free(report);
        return 0;
    }
    if (!err) {
        for (int s = 0; s < SST_LIVE_STAGES; s++)
            cost->stage_ms[s][cost->n] = (double)report->stage_ns[s] * 1e-6;
        for (int s = 0; s < 3; s++)
            cost->stage_ms[SST_LIVE_STAGES + s][cost->n] = (double)(at[s + 1] - at[s]) * 1e-6;
        cost->cpu_ms[cost->n] = (double)(sst_clock_cpu_ns() - cpu_ns) * 1e-6;
        cost->anew[cost->n] = 100.0 * (double)anew / ((double)image->width * image->height);
        cost->changed[cost->n] = report->tiles ? 100.0 * (double)report->tiles_changed / (double)report->tiles : 0;
        printf(
            "set %d: update %.1f ms, picture %.1f ms, JPEG %.1f ms, CPU %.1f ms, %.1f %% changed, %.1f %% rendered, %s"
            "focus %.2f, labels run %d\n",
            i, cost->stage_ms[SST_LIVE_STAGES][cost->n], cost->stage_ms[SST_LIVE_STAGES + 1][cost->n],
            cost->stage_ms[SST_LIVE_STAGES + 2][cost->n], cost->cpu_ms[cost->n], cost->changed[cost->n],
            cost->anew[cost->n], report->whole ? "whole, " : "", sst_live_default_focus(live), (int)report->label_runs);
        cost->set[cost->n] = i;
        pace(cost, i);
        cost->n += i > 0 && i >= option("steady") && cost->n < SETS_MAX - 1; /* the first one is another matter */
        print_tracks(live);
        if (truth_label)
            err = live_truth_add_set(truth, sst_live_lightfield(live), report, shown_ns((int)in->set), in->t_ns);
        if (!err && out_dir)
            err = write_picture(image, "picture", i);
    }
    free(report);
    return err;
}

static void print(const char *name, double *v, int n)
{
    double sum = 0;

    for (int i = 0; i < n; i++)
        sum += v[i] / n;
    sst_stats_sort_double(v, n);
    printf("%-22s mean %8.2f  p50 %8.2f  p90 %8.2f  p99 %8.2f  max %8.2f\n", name, sum, v[n / 2], v[n * 9 / 10],
           v[n * 99 / 100], v[n - 1]);
}

static const char *const stage_names[] = { "find changes, ms", "decode, ms",  "rectify, ms",
                                           "disparities, ms",  "labels, ms",  "refine, carry, ms",
                                           "update, ms",       "picture, ms", "JPEG, ms" };

/* Stage times of the slowest sets. */
static void print_slowest(const struct cost *cost)
{
    static bool printed[SETS_MAX];

    for (int n = 0; n < sst_min_int((int)option("slowest"), cost->n); n++) {
        int at = -1;

        for (int i = 0; i < cost->n; i++) {
            if (!printed[i] && (at < 0 || cost->cpu_ms[i] > cost->cpu_ms[at]))
                at = i;
        }
        printed[at] = true;
        printf("slow: set %d, CPU %.1f ms:", cost->set[at], cost->cpu_ms[at]);
        for (size_t s = 0; s < ARRAY_LEN(stage_names); s++)
            printf(" %s %.1f", stage_names[s], cost->stage_ms[s][at]);
        printf("\n");
    }
}

static void summary(struct cost *cost)
{
    double wall = 0, cpu = 0;

    if (!cost->n)
        return;
    for (int i = 0; i < cost->n; i++) {
        cpu += cost->cpu_ms[i];
        for (int s = 0; s < 3; s++)
            wall += cost->stage_ms[SST_LIVE_STAGES + s][i];
    }
    print_slowest(cost);
    printf("\n%d sets after the first: %.1f sets/s; CPU %.1f ms a set\n", cost->n, 1e3 * cost->n / wall, cpu / cost->n);
    for (size_t s = 0; s < ARRAY_LEN(stage_names); s++)
        print(stage_names[s], cost->stage_ms[s], cost->n);
    print("CPU, ms", cost->cpu_ms, cost->n);
    if (option("paced") > 0)
        printf("paced: %.2f sets/s; ", (cost->n - 1) / (cost->free_s - cost->begun_s));
    if (option("paced") > 0)
        print("latency, ms", cost->latency_ms, cost->n);
    print("tiles changed, %", cost->changed, cost->n);
    print("picture rendered, %", cost->anew, cost->n);
}

static void print_device(const struct sst_live *live)
{
    struct sst_render_device_report d;

    if (sst_live_device(live, &d))
        printf("%s: %d pictures, %d on the CPU, %d failures; %.1f MB uploaded in %d "
               "dispatches\n",
               d.name, (int)d.pictures, (int)d.on_cpu, (int)d.failures, 1e-6 * (double)d.upload_bytes,
               (int)d.dispatches);
}

static int run(struct source *s, const struct sst_live_config *cfg, struct live_truth *truth)
{
    struct cost *cost = calloc(1, sizeof(*cost));
    struct sst_livepicture *p = NULL;
    struct sst_live *live = NULL;
    int err = cost ? sst_live_open(&live, cfg) : -ENOMEM;
    const int first = (int)option("first"), sets = sst_min_int((int)option("sets"), s->sets - first);

    err = err ? err : sst_livepicture_create(&p, live);
    for (int i = 0; i < sets && !err; i = next_set(cost, i)) {
        struct sst_live_input in = { 0 };
        const int absent = (int)option("absent");

        err = s->world ? read_world(s, first + i, &in) : read_recorded(s, first + i, &in);
        if (absent >= 0 && absent < SST_MAX_VIEWS && i >= option("from"))
            in.frame[absent].data = NULL;
        err = err ? err : follow(live, p, &in, cost, truth, i);
        if (!err && cfg->background && sst_live_unsettled(live))
            printf("set %d: settled %d\n", i, sst_live_settle(live));
        if (cfg->background)
            nanosleep(&(struct timespec){ 0, 100000000 }, NULL);
    }
    if (!err) {
        summary(cost);
        print_device(live);
        if (truth_label)
            live_truth_print(truth);
        err = out_dir ? write_overlays(live) : 0;
    }
    sst_livepicture_destroy(p);
    sst_live_close(live);
    free(cost);
    return err;
}

int main(int argc, char **argv)
{
    struct source s = { 0 };
    struct sst_use_calibration use;
    struct sst_live_config cfg = { .precision = SST_PRECISION_AUTO, .zones = 1 };
    struct live_truth *truth = calloc(1, sizeof(*truth));
    char model_path[SST_PATH_MAX];
    struct stat st;
    int err;

    if (argc < 2) {
        fprintf(stderr, "usage: live_bench RECORDING|WORLD [name=value ...]\n");
        return 2;
    }
    for (int a = 2; a < argc; a++) {
        if (!set_option(argv[a]))
            return 2;
    }
    if (out_dir && mkdir(out_dir, 0777) && errno != EEXIST) {
        fprintf(stderr, "live_bench: %s: %s\n", out_dir, strerror(errno));
        return 1;
    }
    setvbuf(stdout, NULL, _IOLBF, 0);
    sst_use_calibration_defaults(&use);
    err = !stat(argv[1], &st) && S_ISDIR(st.st_mode) ? open_recording(&s, argv[1]) : open_world(&s, argv[1]);
    if (!err && strcmp(calib, "none"))
        err = read_calibration(&use, argv[1]);
    if (!err && strcmp(model, "none"))
        err = sst_model_resolve(model_path, model);
    cfg.rows = s.rows;
    cfg.cols = s.cols;
    cfg.width = s.width;
    cfg.height = s.height;
    cfg.fourcc = s.fourcc;
    for (int c = 0; c < s.cameras; c++)
        cfg.present[s.view[c]] = true;
    cfg.calibration = strcmp(calib, "none") ? &use : NULL;
    cfg.device = device;
    cfg.model = strcmp(model, "none") ? model_path : NULL;
    cfg.threads = (int)option("threads");
    cfg.skip_change = option("change") > 0;
    cfg.alarms_per_hour = option("alarms");
    cfg.skip_labels = option("labels") > 0;
    cfg.background = option("background") > 0;
    cfg.range_min_px = option("min");
    cfg.range_max_px = option("max");
    cfg.zone[0] = live_rectangle(0, LIVE_TRUTH_TOP, 1, 1);
    if (!err && truth_label)
        err = truth ? live_truth_init(truth, argv[1], sst_classes_find(&sst_classes_default, truth_label)) : -ENOMEM;
    err = err ? err : run(&s, &cfg, truth);
    if (err)
        fprintf(stderr, "live_bench: %s\n", strerror(-err));
    if (truth)
        live_truth_fini(truth);
    free(truth);
    sst_use_calibration_fini(&use);
    sst_recording_close(s.recording);
    sst_sim_world_close(s.world);
    for (int c = 0; c < SST_MAX_VIEWS; c++)
        free(s.data[c]);
    return err ? 1 : 0;
}
