/*
 * Fixed surfaces are coloured once per camera, not once per picture: the samples of all fixed opaque surfaces are kept,
 * and for each picture the moving ones are drawn over a copy of them, band by band and only in the columns that they
 * touch. Translucent surfaces blend with their background, so in these columns all surfaces are drawn again.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "base/mem.h"
#include "base/thread.h"
#include "simulators/scene/scene_internal.h"

struct sst_scene_layers {
    struct sst_scene_raster r;    /* its world changes with each picture */
    const bool *moving;           /* [count] */
    struct visible_surface *seen; /* [count] */
    struct band fixed;            /* the whole picture before translucent surfaces */
    struct band work;
    struct sst_image picture; /* of all fixed surfaces */
};

static bool same_vec(struct sst_vec3 a, struct sst_vec3 b)
{
    return a.x == b.x && a.y == b.y && a.z == b.z;
}

void sst_scene_world_compare(const struct sst_scene_world *a, const struct sst_scene_world *b, bool *moving)
{
    for (int i = 0; i < a->count; i++) {
        const struct sst_scene_surface *s = &a->surfaces[i], *t = &b->surfaces[i];

        if (!same_vec(s->origin, t->origin) || !same_vec(s->u, t->u) || !same_vec(s->v, t->v) || !same_vec(s->w, t->w))
            moving[i] = true;
    }
}

/* Restore columns x0 .. x1-1 of the work band to the fixed surfaces. */
static void restore(struct sst_scene_layers *l)
{
    struct band *to = &l->work;
    const size_t n = (size_t)(to->x1 - to->x0);

    for (int k = 0; k < SST_COLOURS; k++) {
        for (int y = to->y0; y < to->y0 + to->rows; y++) {
            const size_t at = band_cell(to, k, y, to->x0), from = band_cell(&l->fixed, k, y, to->x0);

            memcpy(to->inv_z + at, l->fixed.inv_z + from, n * sizeof(*to->inv_z));
            memcpy(to->owner + at, l->fixed.owner + from, n * sizeof(*to->owner));
            memcpy(to->colour + at, l->fixed.colour + from, n * sizeof(*to->colour));
        }
    }
}

static void draw_translucent(struct sst_scene_layers *l, bool with_moving)
{
    for (int i = 0; i < l->r.world->count; i++) {
        if (l->r.world->surfaces[i].translucent && (with_moving || !l->moving[i]))
            band_translucent(&l->work, (uint32_t)i);
    }
}

/* The picture of the fixed surfaces, from their samples. */
static void finish_fixed(struct sst_scene_layers *l)
{
    struct sst_image *image = l->r.image;

    l->r.image = &l->picture;
    l->work.x0 = 0;
    l->work.x1 = l->r.width;
    for (l->work.y0 = 0; l->work.y0 < l->r.height; l->work.y0 += SST_BAND_ROWS) {
        l->work.top = l->work.y0;
        l->work.rows = sst_min_int(SST_BAND_ROWS, l->r.height - l->work.y0);
        restore(l);
        draw_translucent(l, false);
        band_store(&l->work);
    }
    l->r.image = image;
}

/* Draw the fixed opaque surfaces in the rows of one band. */
static int draw_fixed(void *arg, int index, int worker SST_UNUSED)
{
    const struct sst_scene_layers *l = arg;
    struct band b = l->fixed;

    b.y0 = index * SST_BAND_ROWS;
    b.rows = sst_min_int(SST_BAND_ROWS, l->r.height - b.y0);
    for (int i = 0; i < l->r.world->count; i++) {
        if (!l->moving[i] && !l->r.world->surfaces[i].translucent)
            band_opaque(&b, (uint32_t)i);
    }
    band_colour(&b, NULL);
    return 0;
}

int sst_scene_layers_create(struct sst_scene_layers **out, const struct sst_scene_raster *r, const bool *moving,
                            int threads)
{
    struct sst_scene_layers *l = calloc(1, sizeof(*l));
    int err = -ENOMEM;

    if (!l)
        return err;
    l->r = *r;
    l->moving = moving;
    l->seen = sst_mem_alloc((size_t)r->world->count + 1, sizeof(*l->seen));
    if (!l->seen || (err = band_init(&l->fixed, &l->r, r->height)) ||
        (err = band_init(&l->work, &l->r, SST_BAND_ROWS)) || (err = sst_image_init(&l->picture, r->width, r->height))) {
        sst_scene_layers_destroy(l);
        return err;
    }
    l->fixed.seen = l->work.seen = l->seen;
    for (int i = 0; i < r->world->count; i++)
        surface_see(r, &r->world->surfaces[i], &l->seen[i]);
    band_clear(&l->fixed);
    err = sst_parallel_for((r->height + SST_BAND_ROWS - 1) / SST_BAND_ROWS, threads, draw_fixed, l);
    if (err) {
        sst_scene_layers_destroy(l);
        return err;
    }
    finish_fixed(l);
    *out = l;
    return 0;
}

void sst_scene_layers_destroy(struct sst_scene_layers *l)
{
    if (!l)
        return;
    sst_image_fini(&l->picture);
    band_fini(&l->work);
    band_fini(&l->fixed);
    sst_mem_free(l->seen);
    free(l);
}

/* Columns of the band that moving surfaces may touch. */
static void find_columns(struct sst_scene_layers *l)
{
    struct band *b = &l->work;

    b->x0 = l->r.width;
    b->x1 = 0;
    for (int i = 0; i < l->r.world->count; i++) {
        const struct visible_surface *g = &l->seen[i];

        if (!l->moving[i] || g->x0 >= g->x1 || g->y0 >= b->y0 + b->rows || g->y1 <= b->y0)
            continue;
        b->x0 = sst_min_int(b->x0, g->x0);
        b->x1 = sst_max_int(b->x1, g->x1);
    }
}

static void draw_band(struct sst_scene_layers *l)
{
    for (int c = 0; c < 3; c++) {
        for (int y = l->work.y0; y < l->work.y0 + l->work.rows; y++)
            memcpy(sst_image_row(l->r.image, c, y), sst_image_row(&l->picture, c, y), (size_t)l->r.width);
    }
    find_columns(l);
    if (l->work.x0 >= l->work.x1)
        return;
    restore(l);
    for (int i = 0; i < l->r.world->count; i++) {
        if (l->moving[i] && !l->r.world->surfaces[i].translucent)
            band_opaque(&l->work, (uint32_t)i);
    }
    band_colour(&l->work, l->moving);
    draw_translucent(l, true);
    band_store(&l->work);
}

void sst_scene_layers_draw(struct sst_scene_layers *l, const struct sst_scene_world *world, int y0, int y1)
{
    l->r.world = world;
    for (int i = 0; i < world->count; i++) {
        if (l->moving[i])
            surface_see(&l->r, &world->surfaces[i], &l->seen[i]);
    }
    for (l->work.y0 = y0; l->work.y0 < y1; l->work.y0 += SST_BAND_ROWS) {
        l->work.top = l->work.y0;
        l->work.rows = sst_min_int(SST_BAND_ROWS, y1 - l->work.y0);
        draw_band(l);
    }
}
