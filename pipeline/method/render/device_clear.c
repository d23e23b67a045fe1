/* Clear pictures on a device: rays land at the viewpoint, then the pixels are coloured. All views are there as a whole;
 * where memory does not hold them and their landed rays, the picture is made in bands of rows. Of each view only the
 * rows are uploaded from which rays may land in the band, and the rows that such rays are made of.
 *
 * A ray of stored disparity q moves by floor(q b + c) rows, which is monotonic in q, so that the smallest and the
 * largest disparity bound from where rays come:
 *
 *      view                      picture
 *      top - most - BESIDE   .
 *                            .
 *                            .   top  .   rows move by least .. most
 *                            .   end  .
 *      end - least + BESIDE  .
 *
 * The colour of a ray is found less than a row from where its surface's disparity puts it, between two rows; and a ray
 * from beside a removed pixel counts less. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <string.h>

#include "base/thread.h"
#include "pipeline/method/render/device_internal.h"

#define BESIDE 3 /* rows around the rows from which rays land: neighbours, and pixels that colours are made of */

_Static_assert(sizeof(struct sst_gpu_clear_view) == 40 && sizeof(struct sst_gpu_clear) <= 128,
               "the layout of clear_land.comp and clear_blend.comp");

/* --- views -------------------------------------------------------------------------------------------------------- */

static void describe_view(struct clear_band *b, int k)
{
    const struct sst_clear_view *at = &b->c->view[k].at;
    const int largest = sst_max_int(sst_min_int(b->push.bins - 1, b->push.cut_q6), 0);
    const int move[2] = { (int)floorf(at->y_0), (int)floorf((float)largest * at->y_q6 + at->y_0) };

    b->view[k] = (struct sst_gpu_clear_view){ at->x_q6, at->x_0, at->y_q6, at->y_0, at->bx, at->by };
    b->least[k] = sst_min_int(move[0], move[1]);
    b->most[k] = sst_max_int(move[0], move[1]);
    b->taps.tap[k] = b->c->view[k].tap;
    b->taps.wanted[k] = true;
}

static void describe(struct clear_band *b, struct clear *c)
{
    const double disp_min_px = c->lf->disp_min_px;

    b->c = c;
    b->d = c->runner;
    b->taps.count = c->count;
    b->taps.threads = c->threads;
    b->taps.sampled = false;
    b->taps.rays = c->sampled;
    b->push = (struct sst_gpu_clear){ .width = c->width,
                                      .height = c->height,
                                      .pitch = b->d->pitch,
                                      .bins = c->bins,
                                      .cut_q6 = c->cut_q6,
                                      .remove_label = c->cfg->remove_label,
                                      .coarse = c->coarse,
                                      .rays = c->cfg->rays ? c->cfg->rays : CLEAR_ENOUGH,
                                      .views = (uint32_t)c->count,
                                      .disp_min_px = (float)disp_min_px,
                                      .disp_min_rest_px = (float)(disp_min_px - (double)(float)disp_min_px),
                                      .as_others = c->as_others,
                                      .merged = c->to.surface != NULL,
                                      .sampled = c->sampled };
    for (int k = 0; k < c->count; k++)
        describe_view(b, k);
}

/* Place the rows of the views that a band needs. @return pixels */
static size_t place_rows(struct clear_band *b, int top, int rows)
{
    const int height = b->c->height;

    for (int k = 0; k < b->c->count; k++) {
        struct device_place *p = &b->taps.place[k];

        p->top = sst_clamp_int(top - b->most[k] - BESIDE, 0, height);
        p->end = sst_clamp_int(top + rows - b->least[k] + BESIDE, p->top, height);
    }
    return device_place_rows(b->d, &b->taps, &b->views);
}

/* --- bands -------------------------------------------------------------------------------------------------------- */

/* Memory for bands of some rows. @param whole  views are there as a whole: they come last */
static void reserve(struct sst_run *r, struct clear_band *b, int rows, bool whole)
{
    const struct clear *c = b->c;
    const size_t pitch = (size_t)b->push.pitch, n = (size_t)rows * (size_t)c->width;
    size_t pixels = whole ? (size_t)(c->lf->rows * c->lf->cols) * device_view_pixels(b->d) : 0;

    for (int top = 0; top < c->height && !whole; top += rows) {
        const size_t band = place_rows(b, top, rows);

        pixels = band > pixels ? band : pixels;
    }
    b->landed = sst_run_scratch(r, DEVICE_SCRATCH_LANDED, 4 * (size_t)c->count * (size_t)rows * pitch);
    b->picture = sst_run_scratch(r, DEVICE_SCRATCH_PICTURE, 4 * n);
    b->seen = b->push.merged ? sst_run_scratch(r, DEVICE_SCRATCH_SEEN, 4 * n) : b->picture;
    b->state =
        c->sampled ? sst_run_scratch(r, DEVICE_SCRATCH_STATE, n * sizeof(struct sst_gpu_clear_state)) : b->landed;
    if (c->cfg->remove)
        b->masks = sst_run_scratch(r, DEVICE_SCRATCH_MASKS, pixels + 4);
    if (c->fills && rows == c->height)
        b->levels = sst_run_scratch(r, DEVICE_SCRATCH_LEVELS, clear_fill_bytes(c->width, c->height));
    device_reserve_frames(b->d, &b->taps);
    if (!whole)
        device_reserve_rows(b->d, &b->views, pixels, false);
}

static void upload_mask(struct clear_band *b, int k)
{
    const struct sst_gpu_clear_view *v = &b->view[k];
    const struct sst_map_u8 *mask = &b->c->cfg->remove[b->taps.tap[k]->view];
    const size_t pitch = (size_t)b->push.pitch, n = (size_t)(v->end - v->top) * pitch;
    uint8_t *memory = (void *)sst_run_words(b->d->run, n / sizeof(uint32_t));

    for (int y = v->top; memory && y < v->end; y++)
        memcpy(memory + (size_t)(y - v->top) * pitch, sst_map_u8_row(mask, y), (size_t)mask->width);
    sst_run_write(b->d->run, (struct sst_gpu_range){ b->masks.buffer, v->first }, memory, n);
}

/* Upload the views, or rows that a band needs. @return rows of the largest part of a view */
static int upload_band(struct clear_band *b, int top, int rows, bool whole)
{
    const struct clear *c = b->c;
    int most = 0;

    b->push.top = top;
    b->push.rows = rows;
    if (!whole) {
        (void)place_rows(b, top, rows);
        device_upload_placed(b->d, &b->taps, DEVICE_COLOURS | (b->push.remove_label ? DEVICE_LABELS : 0U));
    }
    for (int k = 0; k < c->count; k++) {
        const struct device_place *p = &b->taps.place[k];
        const struct sst_render_tap *t = b->taps.tap[k];
        struct sst_gpu_clear_view *v = &b->view[k];

        v->top = p->top;
        v->end = p->end;
        v->first = p->first + (uint32_t)(p->top * b->push.pitch);
        v->flags = ((t->frame && !c->sampled) || t->v->valid.data ? SST_GPU_CLEAR_VALID : 0U) |
                   (t->v->label.data ? SST_GPU_CLEAR_LABELS : 0U) |
                   (c->cfg->remove && c->cfg->remove[t->view].data ? SST_GPU_CLEAR_MASK : 0U);
        if (v->flags & SST_GPU_CLEAR_MASK && v->top < v->end)
            upload_mask(b, k);
        most = sst_max_int(most, v->end - v->top);
    }
    return most;
}

/* Rows of the picture from words. */
struct unpacking {
    const struct clear *c;
    const uint32_t *word, *seen; /* or NULL; of the row `top` on */
    int top;
};

static int unpack_row(void *arg, int row, int worker SST_UNUSED)
{
    const struct unpacking *u = arg;
    const struct clear_target *to = &u->c->to;
    const size_t at = (size_t)row * (size_t)u->c->width;

    _Static_assert(SST_GPU_CLEAR_SUPPORT == SST_RENDER_SUPPORT, "devices note it in the same unit");
    for (int x = 0; x < u->c->width && u->word; x++) {
        for (int k = 0; k < 3; k++)
            sst_image_row(to->image, k, u->top + row)[x] = (uint8_t)(u->word[at + (size_t)x] >> (8 * k));
        sst_map_u8_row(to->weight, u->top + row)[x] = (uint8_t)(u->word[at + (size_t)x] >> 24);
    }
    for (int x = 0; x < u->c->width && u->seen; x++) {
        sst_map_u16_row(to->surface, u->top + row)[x] = (uint16_t)u->seen[at + (size_t)x];
        sst_map_u8_row(to->support, u->top + row)[x] = (uint8_t)(u->seen[at + (size_t)x] >> 16);
    }
    return 0;
}

void clear_unpack(struct sst_run *r, const struct clear *c, struct sst_gpu_range picture, int top, int rows)
{
    const struct unpacking u = { c, sst_run_fetch(r, picture, (size_t)rows * (size_t)c->width), NULL, top };

    if (u.word)
        sst_run_fail(r, sst_parallel_for(rows, c->threads, unpack_row, (void *)&u));
}

static void unpack_seen(struct sst_run *r, const struct clear_band *b)
{
    const size_t n = (size_t)b->push.rows * (size_t)b->push.width;
    const struct unpacking u = { b->c, NULL, sst_run_fetch(r, b->seen, n), b->push.top };

    if (u.seen)
        sst_run_fail(r, sst_parallel_for(b->push.rows, b->c->threads, unpack_row, (void *)&u));
}

static void render_band(struct sst_run *r, struct clear_band *b, int most)
{
    const size_t landed = (size_t)b->c->count * (size_t)b->push.rows * (size_t)b->push.pitch;
    const struct sst_gpu_range *v = b->views.plane;
    const struct sst_gpu_range views =
        sst_run_upload(r, DEVICE_SCRATCH_VIEWS, b->view, (size_t)b->c->count * sizeof(b->view[0]));

    sst_run_fill(r, b->landed, 0, landed, 0);
    if (most)
        CLEAR_DISPATCH(r, b, SST_GPU_CLEAR_LAND, &b->push, most, b->c->count, views, v[DEVICE_PIXELS], v[DEVICE_DISP],
                       v[DEVICE_VALID], b->masks.buffer ? b->masks : v[DEVICE_VALID], b->landed);
    if (b->c->sampled)
        clear_sample_rays(r, b);
    CLEAR_DISPATCH(r, b, SST_GPU_CLEAR_BLEND, &b->push, b->push.rows, 1, views, v[DEVICE_PIXELS], b->landed, b->seen,
                   b->state, b->picture);
    if (b->levels.buffer)
        clear_fill_on_device(r, b->c, b->picture, b->levels);
    clear_unpack(r, b->c, b->picture, b->push.top, b->push.rows);
    if (b->push.merged)
        unpack_seen(r, b);
}

/* --- a picture ---------------------------------------------------------------------------------------------------- */

void clear_on_device(struct sst_run *r, void *job, int item)
{
    struct clear *c = (struct clear *)job + item;
    const int rows = sst_run_rows(r, c->bands.rows, 1);
    const bool whole = rows == c->height && !c->sampled;
    struct clear_band b = { 0 };

    device_begin(c->runner, r);
    describe(&b, c);
    reserve(r, &b, rows, whole);
    if (whole && !sst_run_failed(r)) {
        if (device_gather(b.d, &b.taps, true))
            b.views = *b.taps.place[0].chunk;
        else
            sst_run_fail(r, -ENOMEM);
    }
    for (int top = 0; top < c->height && !sst_run_failed(r); top += rows) {
        const int some = sst_min_int(rows, c->height - top), most = upload_band(&b, top, some, whole);

        render_band(r, &b, most);
    }
    b.d->held = false;
    c->bands.rows = sst_run_failed(r) ? c->bands.rows : rows;
    c->filled = b.levels.buffer && !sst_run_failed(r);
}
