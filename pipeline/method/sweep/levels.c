/* The sweep of large views from maps of half size: where colours that many views agree on were found among all planes
 * at half size, the second round alone is left at whole size (design.md, 5.7). */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/method/sweep/sweep_internal.h"

#define LEVELS 4
#define LARGE  600000 /* pixels of a view from which on maps of half size come first */
/* 1/64 px between planes: whole or half pixels, since planes in between attract disparities by the rounding of their
 * shifts; whole ones where half ones are too many or need too much memory. */
#define FINE       32
#define COARSE     64
#define NOISE_COST 2.4 /* mean difference of R, G and B together that a level of noise makes */
#define TEXTURE    10  /* median cost of maps without noise that others made */

/** Views of a size and their maps; the first level has the caller's. */
struct level {
    struct sst_planesweep sweep;
    struct sst_planesweep_view *view; /* [views], owned */
    struct sst_image *image;          /* [views], owned */
    struct sst_map_u8 *seen, *cost;
    struct sst_map_u16 *disp;
};

/* A mask of half size: seen pixels are seen in all four pixels of the whole one. */
static int halve_mask(struct sst_map_u8 *out, const struct sst_map_u8 *mask)
{
    const int err = sst_map_u8_init(out, (mask->width + 1) / 2, (mask->height + 1) / 2);

    if (err)
        return err;
    memset(out->data, 255, out->stride * (size_t)out->height);
    for (int y = 0; y < mask->height; y++) {
        const uint8_t *in = sst_map_u8_row(mask, y);
        uint8_t *to = sst_map_u8_row(out, y / 2);

        for (int x = 0; x < mask->width; x++)
            to[x / 2] &= in[x];
    }
    return 0;
}

static int halve_view(void *arg, int k, int worker SST_UNUSED)
{
    struct level *to = arg;
    const struct sst_planesweep_view from = to->view[k];
    int err;

    if (!from.image)
        return 0;
    err = sst_image_halve(&to->image[k], from.image);
    if (!err && from.seen && from.seen->data)
        err = halve_mask(&to->seen[k], from.seen);
    to->view[k].image = &to->image[k];
    to->view[k].seen = &to->seen[k];
    to->view[k].disp = &to->disp[k];
    to->view[k].cost = &to->cost[k];
    return err;
}

static void level_fini(struct level *l)
{
    for (int k = 0; k < l->sweep.views; k++) {
        if (l->image)
            sst_image_fini(&l->image[k]);
        if (l->seen)
            sst_map_u8_fini(&l->seen[k]);
        if (l->cost)
            sst_map_u8_fini(&l->cost[k]);
        if (l->disp)
            sst_map_u16_fini(&l->disp[k]);
    }
    free(l->view);
    free(l->image);
    free(l->seen);
    free(l->cost);
    free(l->disp);
    *l = (struct level){ .sweep = { 0 } };
}

/* A level of half the size of another. */
static int level_init(struct level *l, const struct sst_planesweep *of)
{
    const size_t views = (size_t)of->views;

    l->sweep = *of;
    l->sweep.disp_min_px = of->disp_min_px / 2;
    l->sweep.range = (of->range + 1) / 2;
    l->view = malloc(views * sizeof(*l->view));
    l->image = calloc(views, sizeof(*l->image));
    l->seen = calloc(views, sizeof(*l->seen));
    l->cost = calloc(views, sizeof(*l->cost));
    l->disp = calloc(views, sizeof(*l->disp));
    if (!l->view || !l->image || !l->seen || !l->cost || !l->disp)
        return -ENOMEM;
    memcpy(l->view, of->view, views * sizeof(*l->view));
    l->sweep.view = l->view;
    return sst_parallel_for(of->views, of->threads, halve_view, l);
}

/* The first view that is there; NULL: none. */
static const struct sst_image *first_image(const struct sst_planesweep *in)
{
    for (int k = 0; k < in->views; k++) {
        if (in->view[k].image)
            return in->view[k].image;
    }
    return NULL;
}

static bool is_large(const struct sst_planesweep *in)
{
    const struct sst_image *image = first_image(in);

    return image && image->width * image->height >= (in->large ? in->large : LARGE);
}

/* How much more the first round's median would cost at whole size: noise, of which half size has less. */
static int more_noise(const struct sst_planesweep *in, const struct sst_planesweep *half)
{
    return (int)lround(NOISE_COST * fmax(sst_image_noise(first_image(in)) - sst_image_noise(first_image(half)), 0));
}

/* The maps of a size, of planes as near each other as memory allows. */
static int sweep_size(const struct sst_planesweep *in, const struct sst_map_u16 *start, bool whole, int *median)
{
    int err = -E2BIG;

    if (in->range * 64 / FINE + 1 <= SWEEP_PLANES)
        err = sweep_run(in, FINE, start, whole, median);
    return err == -E2BIG ? sweep_run(in, COARSE, start, whole, median) : err;
}

/* Maps of whole size from maps that others made. */
static int sweep_start(const struct sst_planesweep *in)
{
    int median = TEXTURE + (int)lround(NOISE_COST * sst_image_noise(first_image(in)));

    return sweep_size(in, in->start, true, &median);
}

int sst_planesweep(const struct sst_planesweep *in)
{
    struct level level[LEVELS] = { { .sweep = *in } };
    int last = 0, median = 0, err = 0;
    bool half = false; /* its maps are there, and good enough */

    if (in->start && first_image(in))
        return sweep_start(in);
    while (!err && last + 1 < LEVELS && is_large(&level[last].sweep)) {
        last++;
        err = level_init(&level[last], &level[last - 1].sweep);
    }
    for (int i = last; i >= 0; i--) {
        const struct sst_map_u16 *start = half ? level[i + 1].disp : NULL;

        if (!err && half)
            median += more_noise(&level[i].sweep, &level[i + 1].sweep);
        err = err ? err : sweep_size(&level[i].sweep, start, !i, &median);
        half = median <= SWEEP_SURE;
        if (i < last)
            level_fini(&level[i + 1]);
    }
    level_fini(&level[0]);
    return err;
}
