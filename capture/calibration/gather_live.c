/* Corners from the live array, until the coverage is complete. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "base/clock.h"
#include "base/log.h"
#include "base/mem.h"
#include "base/thread.h"
#include "capture/array/capture.h"
#include "capture/calibration/calibration_internal.h"
#include "pipeline/calibration/board/coverage.h"
#include "pipeline/image/raw.h"

#define STILL_SHARE  0.02   /* of the picture's width: a board that moved less shows nothing new */
#define REPEAT_SHARE 0.0025 /* of the width: a pose is an earlier one if its corners are that close in all cameras */
#define REPEATS_MIN  10
#define STATUS_NS    2000000000ll

struct sst_gather_live {
    /* fixed after open */
    struct sst_gather_config cfg;
    struct sst_gather_live_config live;
    const struct sst_array_config *array;
    int views;
    struct sst_capture *capture;
    int64_t start_ns; /* of run */
    /* writer's thread only, while run lasts */
    struct sst_gathered *out;
    struct sst_coverage *coverage; /* [views] */
    struct gather_result *result;  /* [views] of the current frameset */
    double (*last)[2];             /* [views] middle of the corners in the last accepted frameset; NAN: none */
    const struct sst_frameset *set;
    int *frameset, capacity; /* of the accepted ones: their numbers */
    int framesets, err;
    int repeats; /* poses in a row that are earlier ones */
    bool done;
    int64_t status_ns;
};

static int view_of(const struct sst_array_config *array, int cam)
{
    return array->camera[cam].row * array->cols + array->camera[cam].col;
}

static int detect_one(void *arg, int cam, int worker SST_UNUSED)
{
    struct sst_gather_live *l = arg;
    const struct sst_frame *f = l->set->frame[cam];
    const int view = view_of(l->array, cam);
    struct sst_image image;

    if (!f || sst_raw_decode(&image, &(struct sst_raw){ f->fourcc, f->width, f->height, f->stride, f->data, f->bytes }))
        return 0;
    return gather_detect(&l->result[view], &l->cfg, &image, view, l->out->all.frames);
}

static bool found(const struct sst_gather_live *l, int view)
{
    return l->result[view].present && l->result[view].outcome == SST_DETECT_FOUND;
}

static void middle(const struct sst_detection *d, double out[2])
{
    out[0] = out[1] = 0;
    for (int i = 0; i < d->corners; i++) {
        out[0] += d->corner[i].x / d->corners;
        out[1] += d->corner[i].y / d->corners;
    }
}

/* Whether any camera sees the board elsewhere than in the last accepted frameset, or did not see it there. */
static bool shows_more(struct sst_gather_live *l)
{
    bool more = false;

    for (int k = 0; k < l->views; k++) {
        double at[2];

        if (!found(l, k))
            continue;
        middle(&l->result[k].detection, at);
        more = more || !(hypot(at[0] - l->last[k][0], at[1] - l->last[k][1]) < STILL_SHARE * l->array->width);
    }
    for (int k = 0; k < l->views && more; k++) {
        if (found(l, k))
            middle(&l->result[k].detection, l->last[k]);
        else
            l->last[k][0] = (double)NAN;
    }
    return more;
}

/* Mean distance of the corners that both detections have, in px; infinite without any. */
static double distance(const struct sst_detection *a, const struct sst_detection *b)
{
    double sum = 0;
    int n = 0;

    for (int i = 0, j = 0; i < a->corners && j < b->corners;) {
        if (a->corner[i].id != b->corner[j].id) {
            *(a->corner[i].id < b->corner[j].id ? &i : &j) += 1;
            continue;
        }
        sum += hypot(a->corner[i].x - b->corner[j].x, a->corner[i].y - b->corner[j].y);
        n++;
        i++;
        j++;
    }
    return n ? sum / n : INFINITY;
}

/* Whether an accepted frameset shows every board of this one at the same place. */
static bool is_repeat(const struct sst_gather_live *l)
{
    const struct sst_detections *all = &l->out->all;
    int boards = 0, same = 0;

    for (int k = 0; k < l->views; k++)
        boards += found(l, k);
    for (int i = 0; i < all->count; i++) {
        const struct sst_detection *d = &all->detection[i];

        same = i && d->frame == all->detection[i - 1].frame ? same : 0;
        same += found(l, d->view) && distance(d, &l->result[d->view].detection) < REPEAT_SHARE * l->array->width;
        if (boards && same == boards)
            return true;
    }
    return false;
}

static int accept_frameset(struct sst_gather_live *l, uint64_t index)
{
    char name[64];
    int frame, err = 0;

    snprintf(name, sizeof(name), "set %llu", (unsigned long long)index);
    if (!sst_mem_grow(&l->frameset, l->out->all.frames, &l->capacity, sizeof(*l->frameset)))
        return -ENOMEM;
    frame = sst_detections_frame(&l->out->all, name);
    if (frame < 0)
        return frame;
    l->frameset[frame] = l->framesets;
    for (int k = 0; k < l->views && !err; k++)
        err = gather_add(l->out, &l->result[k]);
    return err;
}

/* Camera of the least coverage. @return its view */
static int least_covered(const struct sst_gather_live *l, double *share)
{
    int worst = -1;

    *share = 1;
    for (int i = 0; i < l->array->bound; i++) {
        const int view = view_of(l->array, i);
        const double covered = sst_coverage_share(&l->coverage[view]);

        if (worst < 0 || covered < *share) {
            worst = view;
            *share = covered;
        }
    }
    return worst;
}

static int report_status(struct sst_gather_live *l, int64_t now_ns)
{
    struct sst_gather_status status = { .framesets = l->framesets, .accepted = l->out->all.frames };
    char missing[160];
    int worst;

    if (!l->live.status || now_ns - l->status_ns < STATUS_NS)
        return 0;
    l->status_ns = now_ns;
    worst = least_covered(l, &status.coverage);
    sst_coverage_missing(&l->coverage[worst], missing);
    status.row = worst / l->array->cols;
    status.col = worst % l->array->cols;
    status.camera = l->out->all.camera_name[worst];
    status.missing = missing;
    status.all = &l->out->all;
    return l->live.status(l->live.arg, &status);
}

static void warn_repeats(const struct sst_gather_live *l)
{
    char missing[160];
    double share;
    const int worst = least_covered(l, &share);

    sst_coverage_missing(&l->coverage[worst], missing);
    sst_log_warning("the board's poses repeat: calibrated from the %d that differ, coverage %.0f %%; camera %d,%d (%s) "
                    "lacks most: %s",
                    l->out->all.frames, 100 * share, worst / l->array->cols, worst % l->array->cols,
                    l->out->all.camera_name[worst], missing[0] ? missing : "nothing");
}

static bool is_done(const struct sst_gather_live *l)
{
    double least;

    if (l->live.accepted && l->out->all.frames >= l->live.accepted)
        return true;
    if (l->repeats >= sst_max_int(l->out->all.frames, REPEATS_MIN)) {
        warn_repeats(l);
        return true;
    }
    if (l->live.accepted)
        return false;
    least_covered(l, &least);
    return least >= 1 - 1e-9;
}

static int on_set(void *arg, const struct sst_frameset *set)
{
    struct sst_gather_live *l = arg;
    int err;

    if (l->err || l->done)
        return 0;
    l->set = set;
    err = l->live.frameset ? l->live.frameset(l->live.arg, set) : 0;
    err = err ? err : sst_parallel_for(set->cameras, l->cfg.threads, detect_one, l);
    if (!err && shows_more(l)) {
        if (is_repeat(l)) {
            l->repeats++;
        } else {
            l->repeats = 0;
            err = accept_frameset(l, set->index);
            if (!err)
                sst_coverage_count(l->coverage, &l->out->all);
        }
    }
    for (int k = 0; k < l->views; k++)
        gather_result_fini(&l->result[k]);
    l->framesets++;
    if (!err) /* also while nothing is accepted: that is when the user needs it */
        err = report_status(l, sst_clock_now_ns());
    l->err = err;
    l->done = is_done(l);
    if (err || l->done)
        sst_capture_stop(l->capture);
    return 0;
}

static void on_progress(void *arg, uint64_t sets SST_UNUSED)
{
    struct sst_gather_live *l = arg;

    if (l->live.seconds > 0 && (double)(sst_clock_now_ns() - l->start_ns) / 1e9 >= l->live.seconds)
        sst_capture_stop(l->capture);
}

int sst_gather_live_open(struct sst_gather_live **out, const struct sst_gather_config *cfg,
                         const struct sst_gather_live_config *live)
{
    struct sst_gather_live *l = calloc(1, sizeof(*l));
    const struct sst_capture_events events = { .arg = l, .set = on_set, .progress = on_progress };
    int err;

    if (!l)
        return -ENOMEM;
    l->cfg = *cfg;
    l->live = *live;
    l->array = live->array;
    err = sst_capture_open(&l->capture, live->array, &events);
    if (!err) {
        l->views = l->array->rows * l->array->cols;
        l->coverage = calloc((size_t)l->views, sizeof(*l->coverage));
        l->result = calloc((size_t)l->views, sizeof(*l->result));
        l->last = malloc((size_t)l->views * sizeof(*l->last));
        err = l->coverage && l->result && l->last ? 0 : -ENOMEM;
    }
    if (err)
        sst_gather_live_close(l);
    else
        *out = l;
    return err;
}

static int prepare(struct sst_gather_live *l)
{
    const struct sst_array_config *a = l->array;
    const int err = sst_detections_init(
        &l->out->all,
        &(struct sst_detections){
            .board = l->cfg.board, .rows = a->rows, .cols = a->cols, .width = a->width, .height = a->height });

    for (int k = 0; k < l->views; k++)
        l->last[k][0] = l->last[k][1] = (double)NAN;
    for (int i = 0; i < a->bound && !err; i++) {
        const struct sst_config_camera *c = &a->camera[i];
        const struct sst_grab_device *device;
        struct sst_grab_counters counters;
        const char *name;

        sst_capture_camera(l->capture, i, &counters, &device);
        name = device->serial[0] ? device->serial : c->serial[0] ? c->serial : c->port;
        snprintf(l->out->all.camera_name[view_of(a, i)], sizeof(*l->out->all.camera_name), "%s", name);
    }
    return err;
}

int sst_gather_live_run(struct sst_gather_live *l, struct sst_gathered *out, int **frameset)
{
    int err;

    *out = (struct sst_gathered){ 0 };
    l->out = out;
    err = prepare(l);
    if (!err) {
        l->start_ns = sst_clock_now_ns();
        err = sst_capture_run(l->capture, 0);
    }
    l->done = true;
    err = err ? err : l->err;
    if (!err && !out->all.count) {
        char text[128];

        sst_board_format(&l->cfg.board, text);
        sst_log_error("no camera saw the board %s; is it the right one, lit and in view (--board)?", text);
        err = -EBADMSG;
    }
    if (err) {
        sst_gathered_fini(out);
    } else {
        *frameset = l->frameset;
        l->frameset = NULL;
    }
    return err;
}

void sst_gather_live_stop(struct sst_gather_live *l)
{
    sst_capture_stop(l->capture);
}

void sst_gather_live_close(struct sst_gather_live *l)
{
    if (!l)
        return;
    sst_capture_close(l->capture);
    free(l->coverage);
    free(l->result);
    free(l->last);
    free(l->frameset);
    free(l);
}
