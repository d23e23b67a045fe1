/* Corners from the live array, with an eye on what is still missing. */
#include <errno.h>
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "base/thread.h"
#include "capture/array/capture.h"
#include "capture/recording/recorder.h"
#include "cli/cli_internal.h"
#include "pipeline/calibration/board/coverage.h"

#define STILL_SHARE 0.02 /* of the picture's width: a board that moved less shows nothing new */
#define TELL_NS     2000000000ll

struct live {
    const struct calibrate_gather_config *cfg;
    struct calibrate_live_config *live;
    const struct sst_array_config *array;
    struct calibrate_gathered *out;
    struct sst_recorder *recorder;
    struct sst_coverage *coverage; /* [views] */
    struct calibrate_shot *shot;   /* [views] of the set at hand */
    double (*last)[2];             /* [views] middle of the corners when the last set was taken */
    const struct sst_set *set;
    int recorded, err, capacity, drawn; /* drawn: frames in the coverage picture */
    bool done;
    int64_t start_ns, told_ns;
};

static struct sst_capture *running;

static void on_signal(int sig)
{
    (void)sig;
    if (running)
        sst_capture_stop(running);
}

static int look(void *arg, int cam, int worker SST_UNUSED)
{
    struct live *l = arg;
    const struct sst_frame *f = l->set->frame[cam];
    const int view = l->array->camera[cam].row * l->array->cols + l->array->camera[cam].col;
    struct sst_image image;

    if (!f || calibrate_decode(&image, f->fourcc, f->width, f->height, f->stride, f->data, f->bytes))
        return 0;
    return calibrate_shoot(&l->shot[view], l->cfg, &image, view, l->out->all.frames);
}

static void middle(const struct sst_detection *d, double out[2])
{
    out[0] = out[1] = 0;
    for (int i = 0; i < d->corners; i++) {
        out[0] += d->corner[i].x / d->corners;
        out[1] += d->corner[i].y / d->corners;
    }
}

/* Does any camera see the board elsewhere than in the last set that was taken, or see it anew? */
static bool shows_more(struct live *l, int views)
{
    bool more = false;

    for (int k = 0; k < views; k++) {
        double at[2];

        if (!l->shot[k].there || l->shot[k].outcome != SST_DETECT_FOUND)
            continue;
        middle(&l->shot[k].detection, at);
        more = more || !(hypot(at[0] - l->last[k][0], at[1] - l->last[k][1]) < STILL_SHARE * l->array->width);
    }
    for (int k = 0; k < views && more; k++) {
        if (l->shot[k].there && l->shot[k].outcome == SST_DETECT_FOUND)
            middle(&l->shot[k].detection, l->last[k]);
        else
            l->last[k][0] = (double)NAN;
    }
    return more;
}

static int take(struct live *l, uint64_t index, int views)
{
    char name[64];
    int frame, err = 0;

    snprintf(name, sizeof(name), "set %llu", (unsigned long long)index);
    if (l->out->all.frames == l->capacity) {
        const int capacity = l->capacity ? 2 * l->capacity : 64;
        int *set = realloc(l->live->set, (size_t)capacity * sizeof(*set));

        if (!set)
            return -ENOMEM;
        l->live->set = set;
        l->capacity = capacity;
    }
    frame = sst_detections_frame(&l->out->all, name);
    if (frame < 0)
        return frame;
    l->live->set[frame] = l->recorded;
    for (int k = 0; k < views && !err; k++)
        err = calibrate_take(l->out, &l->shot[k]);
    return err;
}

static double complete(const struct live *l)
{
    double least = 1;

    for (int i = 0; i < l->array->bound; i++)
        least =
            fmin(least,
                 sst_coverage_share(&l->coverage[l->array->camera[i].row * l->array->cols + l->array->camera[i].col]));
    return least;
}

/* Every two seconds: how far, and the camera that lacks most. */
static int tell(struct live *l, int64_t now_ns)
{
    const struct sst_detections *all = &l->out->all;
    int worst = -1;
    char missing[160];

    if (now_ns - l->told_ns < TELL_NS)
        return 0;
    l->told_ns = now_ns;
    for (int i = 0; i < l->array->bound; i++) {
        const int view = l->array->camera[i].row * l->array->cols + l->array->camera[i].col;

        if (worst < 0 || sst_coverage_share(&l->coverage[view]) < sst_coverage_share(&l->coverage[worst]))
            worst = view;
    }
    sst_coverage_missing(&l->coverage[worst], missing);
    if (!all->frames) {
        fprintf(stderr, "%d sets, and no camera has seen the board yet\n", l->recorded);
        return 0;
    }
    fprintf(stderr, "%d of %d sets taken, coverage %.0f %%; camera %s lacks most: %s\n", all->frames, l->recorded,
            100 * complete(l), all->camera_name[worst], missing[0] ? missing : "nothing");
    if (!l->cfg->coverage || l->drawn == all->frames)
        return 0;
    l->drawn = all->frames;
    return calibrate_write_coverage(all, l->cfg->coverage);
}

static int on_set(void *arg, const struct sst_set *set)
{
    struct live *l = arg;
    const int views = l->array->rows * l->array->cols;
    int err;

    if (l->err || l->done)
        return 0;
    l->set = set;
    err = l->recorder ? sst_recorder_write(l->recorder, set) : 0;
    if (!err)
        err = sst_parallel_for(set->cameras, l->cfg->threads, look, l);
    if (!err && shows_more(l, views)) {
        err = take(l, set->index, views);
        if (!err)
            sst_coverage_count(l->coverage, &l->out->all);
    }
    for (int k = 0; k < views; k++)
        calibrate_shot_fini(&l->shot[k]);
    l->recorded++;
    if (!err) /* also while nothing is taken: that is when one must know */
        err = tell(l, sst_clock_now_ns());
    l->err = err;
    l->done = l->live->sets ? l->out->all.frames >= l->live->sets : complete(l) >= 1;
    if (err || l->done)
        sst_capture_stop(running);
    return 0;
}

static void on_progress(void *arg, uint64_t sets SST_UNUSED)
{
    struct live *l = arg;

    if (l->live->seconds > 0 && (double)(sst_clock_now_ns() - l->start_ns) / 1e9 >= l->live->seconds)
        sst_capture_stop(running);
}

static int prepare(struct live *l, const struct sst_capture *capture)
{
    const struct sst_array_config *a = l->array;
    const size_t views = (size_t)(a->rows * a->cols);
    int err = sst_detections_init(&l->out->all, &l->cfg->board, a->rows, a->cols, a->width, a->height);

    if (err)
        return err;
    l->coverage = calloc(views, sizeof(*l->coverage));
    l->shot = calloc(views, sizeof(*l->shot));
    l->last = malloc(views * sizeof(*l->last));
    if (!l->coverage || !l->shot || !l->last)
        return -ENOMEM;
    for (size_t k = 0; k < views; k++)
        l->last[k][0] = l->last[k][1] = (double)NAN;
    for (int i = 0; i < a->bound; i++) {
        const struct sst_config_camera *c = &a->camera[i];
        const struct sst_grab_device *device;
        struct sst_grab_counters counters;
        const char *name;

        sst_capture_camera(capture, i, &counters, &device);
        name = device->serial[0] ? device->serial : c->serial[0] ? c->serial : c->port;
        snprintf(l->out->all.camera_name[c->row * a->cols + c->col], sizeof(*l->out->all.camera_name), "%s", name);
    }
    return 0;
}

static int open_recorder(struct live *l, const char *dir)
{
    struct sst_recorder_config rec;

    sst_recorder_config_defaults(&rec);
    rec.dir = dir;
    return cli_open_recorder(&l->recorder, l->array, &rec);
}

int calibrate_live(struct calibrate_gathered *out, const struct calibrate_gather_config *cfg,
                   struct calibrate_live_config *live)
{
    struct live l = { .cfg = cfg, .live = live, .array = live->array, .out = out };
    const struct sst_capture_events events = { .arg = &l, .set = on_set, .progress = on_progress };
    const struct sigaction act = { .sa_handler = on_signal };
    struct sst_capture *capture = NULL;
    struct sigaction old[2];
    int err, closed;

    *out = (struct calibrate_gathered){ 0 };
    err = sst_capture_open(&capture, live->array, &events);
    if (!err)
        err = prepare(&l, capture);
    if (!err && live->keep)
        err = open_recorder(&l, live->keep);
    if (!err) {
        running = capture;
        sigaction(SIGINT, &act, &old[0]);
        sigaction(SIGTERM, &act, &old[1]);
        l.start_ns = sst_clock_now_ns();
        err = sst_capture_run(capture, 0);
        sigaction(SIGINT, &old[0], NULL);
        sigaction(SIGTERM, &old[1], NULL);
    }
    sst_capture_close(capture);
    running = NULL;
    closed = sst_recorder_close(l.recorder);
    err = err ? err : l.err ? l.err : closed;
    if (!err && !out->all.count) {
        char text[128];

        sst_board_format(&cfg->board, text);
        sst_log_error("no camera saw the board %s; is it the right one, lit and in view (--board)?", text);
        err = -EBADMSG;
    }
    free(l.coverage);
    free(l.shot);
    free(l.last);
    if (err) {
        calibrate_gathered_fini(out);
        free(live->set);
        live->set = NULL;
    }
    return err;
}
