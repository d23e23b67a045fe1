/* Update of the views in three steps per set: scan of the block means of some views (all if one changed), decoding of
 * changed tiles, rectification of the tiles that depend on them. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/live/frames/frames.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <linux/videodev2.h>

#include "base/clock.h"
#include "base/log.h"
#include "base/mem.h"
#include "base/thread.h"
#include "pipeline/image/codec.h"
#include "pipeline/image/raw.h"
#include "pipeline/live/frames/frames_internal.h"

#define FOLLOW_SETS 16 /* levels of Y16 are measured in one of this number of sets */
#define ABSENT_NS   2000000000

/* --- changes ------------------------------------------------------------------------------------------------------ */

static int tiles_across(int px)
{
    return (px + SST_LIVE_TILE - 1) / SST_LIVE_TILE;
}

int sst_liveframes_changes_init(struct sst_liveframes_changes *c, const struct sst_lightfield *lf)
{
    *c = (struct sst_liveframes_changes){ .cols = tiles_across(lf->width), .rows = tiles_across(lf->height) };
    for (int k = 0; k < lf->rows * lf->cols; k++) {
        if (!lf->views[k].present && !lf->views[k].image.plane[0])
            continue;
        c->map[k] = sst_mem_alloc((size_t)c->cols, (size_t)c->rows);
        if (!c->map[k]) {
            sst_liveframes_changes_fini(c);
            return -ENOMEM;
        }
    }
    return 0;
}

void sst_liveframes_changes_fini(struct sst_liveframes_changes *c)
{
    for (int k = 0; k < SST_MAX_VIEWS; k++)
        sst_mem_free(c->map[k]);
    *c = (struct sst_liveframes_changes){ 0 };
}

/* --- opening ------------------------------------------------------------------------------------------------------ */

static void choose_keys(struct sst_liveframes *f)
{
    const int r = f->lf->rows - 1, c = f->lf->cols - 1;
    const int place[SST_LIVE_KEY_VIEWS][2] = { { 0, 0 }, { 0, c }, { r, 0 }, { r, c }, { r / 2, c / 2 } };

    for (int i = 0; i < SST_LIVE_KEY_VIEWS; i++) {
        int best = -1, best_far = 0;

        for (int k = 0; k < f->views; k++) {
            const int dy = k / f->lf->cols - place[i][0], dx = k % f->lf->cols - place[i][1], far = dx * dx + dy * dy;

            if (f->view[k].used && (best < 0 || far < best_far)) {
                best = k;
                best_far = far;
            }
        }
        if (best >= 0)
            f->view[best].key = true;
    }
}

/* Source tiles of a block of a rectified tile, and pixels outside of the raw frame. */
static struct from find_source(const struct sst_liveframes *f, const struct live_view *v, struct sst_view *view, int t,
                               int block)
{
    const int side = SST_LIVE_TILE / SST_LIVE_BLOCKS, width = f->lf->width, height = f->lf->height;
    const int x = t % f->cols * SST_LIVE_TILE + block % SST_LIVE_BLOCKS * side;
    const int y = t / f->cols * SST_LIVE_TILE + block / SST_LIVE_BLOCKS * side;
    const struct sst_rect part = { x, y, sst_min_int(x + side, width), sst_min_int(y + side, height) };
    struct from from = { { 0 } };
    int box[4];

    if (x >= width || y >= height ||
        !sst_rectify_map_box(v->map, (enum sst_filter)f->lf->filter, &part, box, &view->valid))
        return from;
    for (int i = 0; i < 4; i++)
        from.tile[i] = (uint16_t)((box[i] + (i < 2 ? 0 : SST_LIVE_TILE - 1)) / SST_LIVE_TILE);
    return from;
}

/* Add the source tiles of a block to its tile's. */
static void join(struct from *all, const struct from *one)
{
    if (one->tile[2] <= one->tile[0])
        return;
    if (all->tile[2] <= all->tile[0])
        *all = *one;
    for (int i = 0; i < 4; i++)
        all->tile[i] =
            (uint16_t)(i < 2 ? sst_min_int(all->tile[i], one->tile[i]) : sst_max_int(all->tile[i], one->tile[i]));
}

static int open_map(struct sst_liveframes *f, struct live_view *v, struct sst_view *view)
{
    const struct sst_lightfield *lf = f->lf;
    const size_t tiles = (size_t)f->cols * (size_t)f->rows, blocks = SST_LIVE_BLOCKS * SST_LIVE_BLOCKS;
    bool all = true;
    int err = sst_rectify_map_create(&v->map, lf->rectified, lf->calibration, (int)(view - lf->views));

    if (!err)
        err = sst_sampler_create_empty(&v->sampler, v->map, (enum sst_filter)lf->filter);
    if (!err)
        err = sst_map_u8_init(&view->valid, lf->width, lf->height);
    if (err)
        return err;
    v->from = calloc(tiles, sizeof(*v->from));
    v->block = calloc(tiles, blocks * sizeof(*v->block));
    if (!v->from || !v->block)
        return -ENOMEM;
    for (size_t i = 0; i < tiles * blocks; i++) {
        v->block[i] = find_source(f, v, view, (int)(i / blocks), (int)(i % blocks));
        join(&v->from[i / blocks], &v->block[i]);
    }
    for (int y = 0; all && y < lf->height; y++)
        all = !memchr(sst_map_u8_row(&view->valid, y), 0, (size_t)lf->width);
    if (all)
        sst_map_u8_fini(&view->valid);
    return 0;
}

static int open_view(void *arg, int index, int worker SST_UNUSED)
{
    struct sst_liveframes *f = arg;
    struct live_view *v = &f->view[index];
    struct sst_view *view = &f->lf->views[index];
    int err;

    if (!v->used)
        return 0;
    err = sst_image_init(&view->image, f->lf->width, f->lf->height);
    if (!err)
        err = detector_init(&v->watch, f->cfg->width, f->cfg->height);
    if (!err && f->cfg->calibration)
        err = open_map(f, v, view);
    v->dirty = sst_mem_alloc((size_t)f->raw_cols, (size_t)f->raw_rows);
    if (f->last_room) {
        /* of 16x8 px, as cameras make them; frames with smaller ones are decoded whole */
        v->index.room = (size_t)((f->cfg->width + 15) / 16) * (size_t)((f->cfg->height + 7) / 8) + 1;
        v->index.mcu = sst_mem_alloc_raw(v->index.room, sizeof(*v->index.mcu));
        v->index.room = v->index.mcu ? v->index.room : 0; /* without it whole frames are decoded */
    }
    v->last = f->last_room ? sst_mem_alloc(f->last_room, 1) : NULL;
    return err ? err : v->dirty && (v->last || !f->last_room) ? 0 : -ENOMEM;
}

static int open_all(struct sst_liveframes *f)
{
    const struct sst_live_config *cfg = f->cfg;
    int err = frames_burnt_init(&f->burnt, f->raw_cols, f->raw_rows);

    if (err)
        return err;
    f->view = calloc((size_t)f->views, sizeof(*f->view));
    f->decoder = calloc((size_t)f->threads, sizeof(struct decoder *));
    if (!f->view || !f->decoder)
        return -ENOMEM;
    for (int k = 0; k < f->views; k++) {
        f->view[k].used = cfg->present[k] && f->lf->views[k].present;
        f->used += f->view[k].used;
    }
    choose_keys(f);
    for (int i = 0; i < f->threads; i++) {
        err = decoder_create(&f->decoder[i], cfg->fourcc, cfg->width, cfg->height);
        if (err == -EINVAL)
            sst_log_error("the live view does not support frames of format %.4s with %dx%d pixels; choose MJPG, YUYV, "
                          "GREY, Y16, RGB24 or an 8-bit Bayer format",
                          (const char *)&cfg->fourcc, cfg->width, cfg->height);
        if (err)
            return err;
    }
    return sst_parallel_for(f->views, f->threads, open_view, f);
}

int sst_liveframes_open(struct sst_liveframes **out, const struct sst_live_config *cfg, struct sst_lightfield *lf)
{
    struct sst_liveframes *f;
    int err;

    if (cfg->rows != lf->rows || cfg->cols != lf->cols || (cfg->calibration && !(lf->calibration && lf->rectified)) ||
        (!cfg->calibration && (cfg->width != lf->width || cfg->height != lf->height)))
        return -EINVAL;
    f = calloc(1, sizeof(*f));
    if (!f)
        return -ENOMEM;
    f->cfg = cfg;
    f->lf = lf;
    f->threads = sst_thread_count(cfg->threads);
    f->views = lf->rows * lf->cols;
    f->raw_cols = tiles_across(cfg->width);
    f->raw_rows = tiles_across(cfg->height);
    f->cols = tiles_across(lf->width);
    f->rows = tiles_across(lf->height);
    /* Frames of normal quality fit; larger ones are read again even if nothing changed. */
    f->last_room = sst_raw_is_jpeg(cfg->fourcc) ? (size_t)cfg->width * (size_t)cfg->height / 2 : 0;
    f->all = true;
    f->sample = SST_LIVE_SAMPLE_SETS;
    f->stretch = (struct sst_samples){ 0, -1 };
    err = open_all(f);
    if (err) {
        if (err == -ENOMEM)
            sst_log_error("no memory for the live view of %d cameras", f->used);
        sst_liveframes_close(f);
        return err;
    }
    *out = f;
    return 0;
}

void sst_liveframes_close(struct sst_liveframes *f)
{
    if (!f)
        return;
    for (int k = 0; f->view && k < f->views; k++) {
        struct live_view *v = &f->view[k];

        detector_fini(&v->watch);
        sst_sampler_destroy(v->sampler);
        sst_rectify_map_destroy(v->map);
        free(v->from);
        free(v->block);
        sst_mem_free(v->dirty);
        sst_mem_free(v->last);
        sst_mem_free(v->index.mcu);
        if (v->used) {
            sst_image_fini(&f->lf->views[k].image);
            sst_map_u8_fini(&f->lf->views[k].valid);
        }
    }
    frames_burnt_fini(&f->burnt);
    detector_fini(&f->watch.detector);
    sst_mem_free(f->watch.dirty);
    for (int i = 0; f->decoder && i < f->threads; i++)
        decoder_destroy(f->decoder[i]);
    free(f->decoder);
    free(f->level);
    free(f->view);
    free(f);
}

void sst_liveframes_cancel(struct sst_liveframes *f)
{
    atomic_store(&f->cancelled, true);
}

/* --- sets --------------------------------------------------------------------------------------------------------- */

static void begin_set(struct sst_liveframes *f, const struct sst_live_input *in, struct sst_liveframes_changes *changes)
{
    f->in = in;
    f->changes = changes;
    for (int k = 0; k < f->views; k++) {
        struct live_view *v = &f->view[k];

        v->verdict = (struct verdict){ 0 };
        v->index.valid = false;
        v->looked = v->refused = v->decoded = false;
        if (v->dirty)
            memset(v->dirty, 0, (size_t)raw_tiles(f));
        if (changes->map[k])
            memset(changes->map[k], 0, (size_t)changes->cols * (size_t)changes->rows);
    }
    changes->changed = 0;
    changes->whole = changes->stretched = false;
}

/* Log once when the frames of a camera become unusable, and once when they are good again. */
static void log_state(const struct sst_liveframes *f, int k)
{
    struct live_view *v = &f->view[k];

    if (v->refused && !v->broken)
        sst_log_warning("a frame of the camera at row %d, column %d is unusable (%s), its view is not updated; check "
                        "its cable and its format",
                        k / f->lf->cols, k % f->lf->cols, v->fault);
    if (v->looked && !v->refused && v->broken)
        sst_log_info("frames of the camera at row %d, column %d are good again", k / f->lf->cols, k % f->lf->cols);
    if (v->looked)
        v->broken = v->refused;
}

/* A view is present from its first picture on, while frames arrive. */
static void follow_presence(struct sst_liveframes *f, int k)
{
    struct live_view *v = &f->view[k];
    struct sst_view *view = &f->lf->views[k];

    if (!v->used)
        return;
    if (has_frame(f, k) && !v->refused && !(v->broken && !v->looked))
        v->seen_ns = f->in->t_ns;
    log_state(f, k);
    view->present = v->made && f->in->t_ns - v->seen_ns < ABSENT_NS;
    if (!view->present && v->made) {
        /* When it returns, all of its tiles count as changed. */
        v->made = false;
        detector_reset(&v->watch);
        memset(f->changes->map[k], 1, (size_t)f->cols * (size_t)f->rows);
    }
}

static void end_set(struct sst_liveframes *f, struct sst_live_report *report)
{
    const int tiles = f->cols * f->rows;
    int decoded = 0, given = 0, whole = 0, relit = 0;

    for (int k = 0; k < f->views; k++) {
        struct live_view *v = &f->view[k];

        follow_presence(f, k);
        given += has_frame(f, k) && !v->refused;
        decoded += v->decoded;
        relit += v->decoded && v->verdict.light > SST_DETECTOR_LIGHT;
        whole += v->decoded && v->verdict.changed == raw_tiles(f);
        for (int t = 0; f->changes->map[k] && t < tiles; t++)
            f->changes->changed += f->changes->map[k][t];
    }
    f->changes->whole = given && whole == given;
    report->views = given;
    report->relit = relit;
    report->tiles = (int64_t)given * tiles;
    report->tiles_changed = f->changes->changed;
    report->decodes = decoded;
    report->decodes_skipped = given - decoded;
    report->whole = f->changes->whole;
}

static int run(struct sst_liveframes *f, struct sst_live_report *report)
{
    const int64_t start = sst_clock_now_ns();
    int64_t found, decoded;
    int err = frames_scan(f);

    found = sst_clock_now_ns();
    if (!err)
        err = frames_decode(f);
    decoded = sst_clock_now_ns();
    if (!err)
        err = frames_rectify(f);
    report->stage_ns[SST_LIVE_CHANGE] = found - start;
    report->stage_ns[SST_LIVE_DECODE] = decoded - found;
    report->stage_ns[SST_LIVE_RECTIFY] = sst_clock_now_ns() - decoded;
    return err;
}

/* One stretch of all frames of Y16: of the configuration, or followed. When it changes, all is computed again. */
static int follow_levels(struct sst_liveframes *f)
{
    const struct sst_live_config *cfg = f->cfg;
    const bool first = f->stretch.white < 0;
    struct sst_raw frame[SST_MAX_VIEWS];
    int n = 0;

    if (cfg->fourcc != V4L2_PIX_FMT_Y16 || (f->stretch.white >= 0 && (cfg->levels.white || --f->followed > 0)))
        return 0;
    f->followed = FOLLOW_SETS;
    for (int k = 0; k < f->views; k++) {
        if (has_frame(f, k))
            frame[n++] =
                (struct sst_raw){ cfg->fourcc,          cfg->width,           cfg->height, f->in->frame[k].stride,
                                  f->in->frame[k].data, f->in->frame[k].bytes };
    }
    if (cfg->levels.white)
        f->stretch = cfg->levels;
    else if (!sst_raw_follow(&f->stretch, frame, n))
        return 0;
    f->level = f->level ? f->level : malloc(65536);
    if (!f->level)
        return -ENOMEM;
    for (int v = 0; v < 65536; v++)
        f->level[v] = (uint8_t)(f->stretch.white ? sst_samples_scale(v, f->stretch) : v >> 8);
    for (int i = 0; i < f->threads; i++)
        decoder_set_levels(f->decoder[i], f->stretch.white ? f->level : NULL);
    f->all = true;
    f->changes->stretched = !first;
    f->watch.t_ns = INT64_MIN / 2; /* levels of the watched frame differ now */
    return 0;
}

int sst_liveframes_update(struct sst_liveframes *f, const struct sst_live_input *in,
                          struct sst_liveframes_changes *changes, struct sst_live_report *report)
{
    int err;

    begin_set(f, in, changes);
    report->error_change = NAN;
    err = follow_levels(f);
    if (err)
        return err;
    report->levels = f->stretch.white > 0 ? f->stretch : (struct sst_samples){ 0, 0 };
    err = run(f, report);
    f->all = err != 0;
    if (err)
        return err;
    if (f->cfg->skip_change && --f->sample <= 0) {
        f->sample = SST_LIVE_SAMPLE_SETS;
        report->error_change = frames_sample_error(f);
    }
    end_set(f, report);
    return 0;
}

/* --- between updates ---------------------------------------------------------------------------------------------- */

static int open_watch(struct sst_liveframes *f)
{
    int err = 0;

    if (!f->watch.dirty) {
        f->watch.dirty = sst_mem_alloc((size_t)f->raw_cols, (size_t)f->raw_rows);
        err = f->watch.dirty ? detector_init(&f->watch.detector, f->cfg->width, f->cfg->height) : -ENOMEM;
    }
    if (err) {
        sst_mem_free(f->watch.dirty);
        f->watch.dirty = NULL;
    }
    return err;
}

int sst_liveframes_watch(struct sst_liveframes *f, const struct sst_live_input *in, int view,
                         struct sst_liveframes_changes *changes)
{
    struct frames_watch *w = &f->watch;
    struct verdict v;
    bool first;
    int err;

    begin_set(f, in, changes);
    if (!has_frame(f, view) || !changes->map[view])
        return 0;
    err = open_watch(f);
    if (!err)
        err = decoder_read_means(
            f->decoder[0],
            &(struct decoder_frame){ in->frame[view].data, in->frame[view].bytes, in->frame[view].stride },
            &w->detector.now, NULL);
    if (err)
        return err == -EBADMSG ? 0 : err;
    first = w->view != view || in->t_ns - w->t_ns > ABSENT_NS;
    if (first)
        detector_reset(&w->detector);
    w->view = view;
    w->t_ns = in->t_ns;
    v = detector_judge(&w->detector, w->dirty);
    detector_accept(&w->detector, w->dirty);
    if (first)
        return 0;
    if (!v.whole)
        (void)frames_burnt_leave(&f->burnt, w->dirty);
    frames_mark(f, view, w->dirty, changes->map[view]);
    changes->whole = v.whole;
    return 0;
}
