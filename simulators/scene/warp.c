/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <float.h>

#include "base/mem.h"
#include "simulators/scene/surfaces.h"

#define TILE 16 /* px */

int sst_scene_warp_init(struct sst_scene_warp *w, int width, int height)
{
    const size_t pixels = (size_t)width * (size_t)height;

    *w = (struct sst_scene_warp){
        .width = width,
        .height = height,
        .columns = (width + TILE - 1) / TILE,
        .rows = (height + TILE - 1) / TILE,
        .x = sst_mem_alloc_raw(pixels, sizeof(float)),
        .y = sst_mem_alloc_raw(pixels, sizeof(float)),
    };
    w->tiles = sst_mem_alloc_raw((size_t)w->columns * (size_t)w->rows, sizeof(*w->tiles));
    if (w->x && w->y && w->tiles)
        return 0;
    sst_scene_warp_fini(w);
    return -ENOMEM;
}

void sst_scene_warp_fini(struct sst_scene_warp *w)
{
    sst_mem_free(w->tiles);
    sst_mem_free(w->y);
    sst_mem_free(w->x);
    *w = (struct sst_scene_warp){ 0 };
}

static void nothing(float bounds[4])
{
    bounds[0] = bounds[2] = FLT_MAX;
    bounds[1] = bounds[3] = -FLT_MAX;
}

static void include(float into[4], const float bounds[4])
{
    into[0] = fminf(into[0], bounds[0]);
    into[1] = fmaxf(into[1], bounds[1]);
    into[2] = fminf(into[2], bounds[2]);
    into[3] = fmaxf(into[3], bounds[3]);
}

void sst_scene_warp_index(struct sst_scene_warp *w)
{
    nothing(w->all);
    for (int i = 0; i < w->columns * w->rows; i++)
        nothing(w->tiles[i]);
    for (int y = 0; y < w->height; y++) {
        for (int x = 0; x < w->width; x++) {
            const float dx = (float)warp_x(w, x, y) - (float)x, dy = (float)warp_y(w, x, y) - (float)y;

            include(w->tiles[y / TILE * w->columns + x / TILE], (const float[4]){ dx, dx, dy, dy });
        }
    }
    for (int i = 0; i < w->columns * w->rows; i++)
        include(w->all, w->tiles[i]);
}

/* A pixel at x samples x + dx: the pixels that sample lo .. hi are at lo - max dx .. hi - min dx. */
static void shift(const float bounds[4], const double in[4], double out[4])
{
    out[0] = in[0] - bounds[1];
    out[1] = in[1] - bounds[0];
    out[2] = in[2] - bounds[3];
    out[3] = in[3] - bounds[2];
}

static int tile_of(double v, int count)
{
    return (int)sst_clamp_double(floor(v / TILE), 0, count - 1);
}

/* First with the bounds of the whole picture, then with the remaining tiles'. */
void sst_scene_warp_box(const struct sst_scene_warp *w, double *lo_x, double *hi_x, double *lo_y, double *hi_y)
{
    const double in[4] = { *lo_x, *hi_x, *lo_y, *hi_y };
    float bounds[4];
    double out[4];

    shift(w->all, in, out);
    nothing(bounds);
    for (int row = tile_of(out[2] - 1, w->rows); row <= tile_of(out[3] + 1, w->rows); row++) {
        for (int column = tile_of(out[0] - 1, w->columns); column <= tile_of(out[1] + 1, w->columns); column++)
            include(bounds, w->tiles[row * w->columns + column]);
    }
    shift(bounds, in, out);
    *lo_x = out[0];
    *hi_x = out[1];
    *lo_y = out[2];
    *hi_y = out[3];
}
