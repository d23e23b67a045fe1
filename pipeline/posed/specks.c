/* Specks and dots of clear pictures: regions too small for the windows of correlation to tell ground from canopy. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdlib.h>

#include "pipeline/posed/surface_internal.h"

#define SATURATED 0.85 /* of white: mean levels of regions without texture */
#define LARGER    4    /* factor of the size of such a region */

/* Region of pixels above, or not above, a limit. */
struct region {
    struct sst_map_f32 *rays;
    uint8_t *seen; /* [pixels] the regions that were visited */
    size_t *list;  /* [larger + 1] */
    size_t most;   /* pixels of a small one, ... */
    size_t larger; /* and of an enclosed saturated one */
    const struct sst_deep *levels; /* mean of all views */
    float limit;
    bool above, border;
};

static float *rays_at(const struct region *r, size_t at)
{
    return sst_map_f32_row(r->rays, (int)(at / (size_t)r->rays->width)) + at % (size_t)r->rays->width;
}

static bool belongs(const struct region *r, size_t at)
{
    return !r->seen[at] && (*rays_at(r, at) > r->limit) == r->above;
}

/* Visit a pixel's region. @return its size; list holds all of it up to `larger` pixels */
static size_t visit(struct region *r, size_t first, size_t *stack)
{
    const size_t width = (size_t)r->rays->width, height = (size_t)r->rays->height;
    size_t size = 0, n = 0;

    r->border = false;
    r->seen[first] = 1;
    stack[n++] = first;
    while (n) {
        const size_t at = stack[--n], x = at % width, y = at / width;
        const size_t next[4] = { at - 1, at + 1, at - width, at + width };
        const bool inside[4] = { x > 0, x + 1 < width, y > 0, y + 1 < height };

        if (size <= r->larger)
            r->list[size] = at;
        size++;
        for (int i = 0; i < 4; i++) {
            r->border |= !inside[i];
            if (inside[i] && belongs(r, next[i])) {
                r->seen[next[i]] = 1;
                stack[n++] = next[i];
            }
        }
    }
    return size;
}

/* Is it small, or, where it is enclosed, saturated in all channels? */
static bool goes(const struct region *r, size_t size)
{
    const size_t width = (size_t)r->rays->width;

    if (size <= r->most || r->above || size > r->larger)
        return size <= r->most && (r->above || !r->border);
    for (int c = 0; c < r->levels->channels; c++) {
        double sum = 0;

        for (size_t k = 0; k < size; k++)
            sum += sst_map_u16_row(&r->levels->plane[c], (int)(r->list[k] / width))[r->list[k] % width];
        if (sum < SATURATED * r->levels->white * (double)size)
            return false;
    }
    return !r->border;
}

static void set_small(struct region *r, size_t *stack, float value)
{
    const size_t pixels = (size_t)r->rays->width * (size_t)r->rays->height;

    for (size_t i = 0; i < pixels; i++)
        r->seen[i] = 0;
    for (size_t i = 0; i < pixels; i++) {
        size_t size;

        if (!belongs(r, i))
            continue;
        size = visit(r, i, stack);
        if (!goes(r, size))
            continue;
        for (size_t k = 0; k < size; k++)
            *rays_at(r, r->list[k]) = value;
    }
}

int specks_remove(struct sst_map_f32 *rays, const struct sst_deep *levels, const float limits[2], int window_px)
{
    const size_t pixels = (size_t)rays->width * (size_t)rays->height;
    const size_t most = (size_t)window_px * (size_t)window_px / 2;
    struct region r = { .rays = rays, .most = most, .larger = LARGER * most, .levels = levels };
    size_t *stack = malloc(pixels * sizeof(*stack));

    r.seen = malloc(pixels);
    r.list = malloc((r.larger + 1) * sizeof(*r.list));
    if (stack && r.seen && r.list) {
        r.limit = limits[1];
        set_small(&r, stack, limits[1]); /* dots first, which are no edge of a speck then */
        r.above = true;
        r.limit = limits[0];
        set_small(&r, stack, 0);
    }
    free(stack);
    free(r.list);
    free(r.seen);
    return stack && r.seen && r.list ? 0 : -ENOMEM;
}
