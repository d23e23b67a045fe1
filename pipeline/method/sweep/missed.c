/* Surfaces that a view's map misses: pixels with colours that more views show at another disparity
 * (design.md, 5.7). */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "pipeline/lightfield/lightfield.h"
#include "pipeline/method/sweep/sweep.h"

#define SAMPLES 500 /* pixels that are looked at */
#define LEAST   100 /* samples that say anything */
#define ALIKE   24  /* levels: pixels around count up to this colour step */
#define AGREE   36  /* mean difference of R, G and B together at which a view says nothing, without noise; ... */
#define NOISE   2.4 /* ... more by that for a level of noise */
#define APART   2   /* px between surfaces */

/* Samples of a view. */
struct samples {
    const struct sst_planesweep *in;
    const struct sst_map_u16 *map;
    int k, scale, spacing, agree;
    int *all, *missed; /* of rows of samples */
};

/* The pixels around a sample that look like it. */
struct window {
    int x, y, pixels;
    ptrdiff_t at[9]; /* from the sample, in bytes */
    uint8_t colour[3][9];
};

static void look_around(struct window *w, const struct sst_image *img, int x, int y)
{
    *w = (struct window){ .x = x, .y = y };
    for (int i = 0; i < 9; i++) {
        int step = 0;

        for (int c = 0; c < 3; c++) {
            w->colour[c][w->pixels] = sst_image_row(img, c, y + i / 3 - 1)[x + i % 3 - 1];
            step = sst_max_int(step, abs(w->colour[c][w->pixels] - sst_image_row(img, c, y)[x]));
        }
        w->at[w->pixels] = i % 3 - 1 + (i / 3 - 1) * (sst_image_row(img, 0, y) - sst_image_row(img, 0, y - 1));
        w->pixels += step <= ALIKE;
    }
}

/* How well view v shows the window at disparity d: `agree` where colours are the same. */
static int agrees(const struct samples *s, const struct window *w, const struct sst_planesweep_view *v, double d)
{
    const struct sst_planesweep_view *own = &s->in->view[s->k];
    const int x = w->x + (int)floor(d * (own->bx - v->bx) + 0.5), y = w->y + (int)floor(d * (own->by - v->by) + 0.5);
    int sum = 0;

    if (x < 1 || x > v->image->width - 2 || y < 1 || y > v->image->height - 2 ||
        (v->seen && v->seen->data && !sst_map_u8_row(v->seen, y)[x]))
        return 0;
    for (int c = 0; c < 3; c++) {
        const uint8_t *at = sst_image_row(v->image, c, y) + x;

        for (int i = 0; i < w->pixels; i++)
            sum += abs(w->colour[c][i] - at[w->at[i]]);
    }
    return sst_max_int(s->agree - sum / w->pixels, 0);
}

/* Views that agree at disparity d, together; fewer than `least` where no more than that can be had. */
static int support(const struct samples *s, const struct window *w, double d, int least)
{
    int sum = 0;

    for (int k = 0; k < s->in->views; k++) {
        const struct sst_planesweep_view *v = &s->in->view[k];

        if (sum + (s->in->views - k) * s->agree < least)
            return 0;
        if (v->image && k != s->k)
            sum += agrees(s, w, v, d);
    }
    return sum;
}

/* Has a disparity apart from the map's the support of one view more? */
static bool is_missed(const struct samples *s, int x, int y)
{
    const double map = s->scale * sst_map_u16_row(s->map, y / s->scale)[x / s->scale] / 64.0;
    struct window w;
    int own = 0;

    look_around(&w, s->in->view[s->k].image, x, y);
    for (int i = -2; i <= 2; i++)
        own = sst_max_int(own, support(s, &w, s->in->disp_min_px + map + i / 2.0, own));
    for (int i = 0; i <= 2 * s->in->range; i++) {
        if (fabs(i / 2.0 - map) > APART &&
            support(s, &w, s->in->disp_min_px + i / 2.0, own + s->agree) >= own + s->agree)
            return true;
    }
    return false;
}

static int look_at_row(void *arg, int row, int worker SST_UNUSED)
{
    const struct samples *s = arg;
    const struct sst_planesweep_view *v = &s->in->view[s->k];
    const int y = s->spacing / 2 + row * s->spacing;

    if (s->in->cancel && *s->in->cancel)
        return -ECANCELED;
    for (int x = s->spacing / 2; x < v->image->width - 1; x += s->spacing) {
        const bool there = (!v->seen || !v->seen->data || sst_map_u8_row(v->seen, y)[x]) &&
                           sst_map_u16_row(s->map, y / s->scale)[x / s->scale] != SST_DISP_NONE;

        s->all[row] += there;
        s->missed[row] += there && is_missed(s, x, y);
    }
    return 0;
}

int sst_planesweep_missed(const struct sst_planesweep *in, int view, const struct sst_map_u16 *map, int scale,
                          double *percent)
{
    const struct sst_image *img = in->view[view].image;
    const int spacing = sst_max_int((int)sqrt((double)img->width * img->height / SAMPLES), 2);
    const int rows = sst_max_int((img->height - 1 - spacing / 2 + spacing - 1) / spacing, 0);
    struct samples s = { in, map, view, scale, spacing, AGREE + (int)lround(NOISE * sst_image_noise(img)), NULL, NULL };
    int all = 0, missed = 0, err;

    s.all = calloc((size_t)rows + 1, sizeof(*s.all));
    s.missed = calloc((size_t)rows + 1, sizeof(*s.missed));
    err = s.all && s.missed ? sst_parallel_for(rows, in->threads, look_at_row, &s) : -ENOMEM;
    for (int i = 0; !err && i < rows; i++) {
        all += s.all[i];
        missed += s.missed[i];
    }
    *percent = all >= LEAST ? 100.0 * missed / all : 0;
    free(s.all);
    free(s.missed);
    return err;
}
