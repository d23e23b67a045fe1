/*
 * What may be at a pixel (design.md, 5.7): its own disparity, the surfaces around it, those that other views project
 * onto it and those that the sweep finds (sweep.c).
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/mem.h"
#include "pipeline/kernels/kernels.h"
#include "pipeline/lightfield/shift.h"
#include "pipeline/method/disparity/visible.h"

/* The farthest and nearest surface that lands at each pixel, as land_row has them. */
struct landed {
    uint32_t *nearest, *farthest;
};

static void project_view(const struct landed *to, const struct sst_visible_view *own,
                         const struct sst_visible_view *from, double disp_min_px)
{
    struct sst_landing l = { .width = own->disp->width, .height = own->disp->height };

    sst_shift_parts(sst_shift_by(from->bx - own->bx, disp_min_px), &l.whole[0], &l.part[0], &l.step[0]);
    sst_shift_parts(sst_shift_by(from->by - own->by, disp_min_px), &l.whole[1], &l.part[1], &l.step[1]);
    for (l.y = 0; l.y < from->disp->height; l.y++)
        sst_kernels_get()->land_row(to->nearest, to->farthest, &l, sst_map_u16_row(from->disp, l.y), NULL,
                                    (size_t)from->disp->width);
}

/* A map of this size, of any content. */
static int keep_map(struct sst_map_u16 *map, const struct sst_map_u16 *size)
{
    if (map->data && map->width == size->width && map->height == size->height)
        return 0;
    sst_map_u16_fini(map);
    return sst_map_u16_init(map, size->width, size->height);
}

/* Let surfaces land where pixels have a choice. */
static void open_pixels(uint32_t *nearest, const struct sst_visible_view *v)
{
    for (int y = 0; y < v->disp->height; y++, nearest += v->disp->width) {
        const uint8_t *agreed = v->agreed && v->agreed->data ? sst_map_u8_row(v->agreed, y) : NULL;
        const uint16_t *d = sst_map_u16_row(v->disp, y);

        for (int x = 0; x < v->disp->width; x++)
            nearest[x] = agreed && agreed[x] && d[x] != SST_DISP_NONE ? SST_LANDED_CLOSED : 0;
    }
}

/* Surfaces of the matched views around. */
static int project_around(struct sst_around *a, const struct sst_visible_views *in, int k)
{
    const struct sst_visible_view *own = &in->view[k];
    const size_t pixels = (size_t)own->disp->width * (size_t)own->disp->height;
    uint32_t *words = sst_mem_keep(&a->lines, 2 * pixels, sizeof(*words));
    const struct landed landed = { words, words + pixels };
    int err = words ? keep_map(&a->projected.far, own->disp) : -ENOMEM;

    err = err ? err : keep_map(&a->projected.near, own->disp);
    if (err)
        return err;
    open_pixels(landed.nearest, own);
    memset(landed.farthest, 0xFF, pixels * sizeof(*words));
    for (int i = 0; i < in->count; i++) {
        const struct sst_visible_view *v = &in->view[i];

        if (i != k && v->image && !v->carried && fabs(v->bx - own->bx) + fabs(v->by - own->by) < sst_visible_reach(in))
            project_view(&landed, own, v, in->disp_min_px);
    }
    for (int y = 0; y < own->disp->height; y++) {
        uint16_t *near = sst_map_u16_row(&a->projected.near, y), *far = sst_map_u16_row(&a->projected.far, y);
        const size_t row = (size_t)y * (size_t)own->disp->width;

        for (size_t x = 0; x < (size_t)own->disp->width; x++) {
            const uint32_t there = landed.nearest[row + x], above = there >> SST_LANDED_DISP; /* 0: nothing */

            near[x] = (uint16_t)(there == SST_LANDED_CLOSED ? 0 : above - (above != 0));
            far[x] = (uint16_t)landed.farthest[row + x];
        }
    }
    return 0;
}

/* Square windows, each made of nine of the one before, `apart` pixels from each other; the last ones are wanted. */
#define LEVELS 4
#define REACH  16 /* of the largest one */
static const struct level {
    int apart, reach;
} levels[LEVELS] = { { 1, 1 }, { 1, 2 }, { 4, 6 }, { 10, REACH } };
#define WANTED (LEVELS - SST_AROUND_EXTREMES / 2)

static void least_of(uint16_t *restrict to, const uint16_t *a, const uint16_t *b, const uint16_t *c, int n)
{
    for (int i = 0; i < n; i++) {
        const uint16_t least = a[i] < b[i] ? a[i] : b[i];

        to[i] = least < c[i] ? least : c[i];
    }
}

/* Row y of a level's windows along rows; 2 apart + 1 of them are kept. */
static uint16_t *kept_row(uint16_t *rows, int stride, int level, int y)
{
    const int turns = 2 * levels[level].apart + 1;

    for (int i = 0; i < level; i++)
        rows += (2 * levels[i].apart + 1) * stride;
    return rows + (y + REACH) % turns * stride;
}

/* Disparities, or their complements; unknown ones stay. */
static void flip_row(uint16_t *restrict to, const uint16_t *restrict from, int n, uint16_t flip)
{
    const uint16_t sign = flip ? 0xFFFF : 0, add = (uint16_t)(flip + (flip != 0)); /* flip - d = ~d + flip + 1 */

    for (int x = 0; x < n; x++) {
        const uint16_t none = from[x] == (uint16_t)SST_DISP_NONE ? 0xFFFF : 0;

        to[x] = (uint16_t)(((from[x] ^ sign) + add) | none);
    }
}

/* A row of the map, with REACH pixels on both sides, and above and below. */
static void padded_row(uint16_t *row, const struct sst_map_u16 *map, int y, uint16_t flip)
{
    memset(row, 0xFF, ((size_t)map->width + 2 * REACH) * sizeof(*row));
    if (y >= 0 && y < map->height)
        flip_row(row + REACH, sst_map_u16_row(map, y), map->width, flip);
}

/*
 * The farthest (nearest: the nearest) known disparity in the windows of all radii; NONE where nothing is known. The
 * nearest is the least of the complements. Rows go through all levels while they are in the cache.
 * @param out    every `step`-th one @param lines  scratch
 */
static int find_extremes(struct sst_map_u16 *out, int step, const struct sst_map_u16 *map, bool nearest,
                         struct sst_mem_kept *lines)
{
    const int stride = map->width + 2 * REACH;
    const uint16_t flip = nearest ? SST_DISP_MAX_Q6 : 0;
    uint16_t *row = sst_mem_keep(lines, (size_t)stride * (1 + LEVELS + 2 * REACH), sizeof(*row));
    int err = row ? 0 : -ENOMEM;

    for (int i = 0; !err && i < SST_AROUND_EXTREMES / 2; i++)
        err = keep_map(&out[i * step], map);
    for (int t = -REACH; !err && t < map->height + REACH; t++) {
        padded_row(row, map, t, flip);
        for (int i = 0; i < LEVELS && t + REACH >= 2 * (levels[i].reach - levels[i].apart); i++) {
            const int apart = levels[i].apart, reach = levels[i].reach, n = stride - 2 * reach, y = t - reach;
            uint16_t *rows = row + stride;

            least_of(kept_row(rows, stride, i, y + apart) + reach, row + reach - apart, row + reach,
                     row + reach + apart, n);
            if (t + REACH < 2 * reach)
                break;
            least_of(row + reach, kept_row(rows, stride, i, y - apart) + reach, kept_row(rows, stride, i, y) + reach,
                     kept_row(rows, stride, i, y + apart) + reach, n);
            if (i >= WANTED && y >= 0 && y < map->height)
                flip_row(sst_map_u16_row(&out[(i - WANTED) * step], y), row + REACH, map->width, flip);
        }
    }
    return err;
}

/* 0 where a row steps by more than `most` to the pixel on the right or below, 1 elsewhere. */
static void steps_of_row(uint16_t *restrict to, const uint16_t *restrict at, const uint16_t *restrict below, int n,
                         int most)
{
    for (int x = 0; x + 1 < n; x++) {
        const int right = abs(at[x] - at[x + 1]), down = abs(at[x] - below[x]);

        to[x] = (uint16_t)((right <= most) & (down <= most));
    }
    to[n - 1] = abs(at[n - 1] - below[n - 1]) <= most;
}

/* 0 where the map steps by more than 3/2 of `step` to the pixel on the right or below, 1 elsewhere. */
static int find_steps(struct sst_map_u16 *out, const struct sst_map_u16 *map, int step)
{
    const int most = step * 3 / 2, err = keep_map(out, map);

    for (int y = 0; !err && y < map->height; y++) {
        const uint16_t *at = sst_map_u16_row(map, y), *below = y + 1 < map->height ? sst_map_u16_row(map, y + 1) : at;

        steps_of_row(sst_map_u16_row(out, y), at, below, map->width, most);
    }
    return err;
}

void sst_around_fini(struct sst_around *a)
{
    for (int i = 0; i < SST_AROUND_EXTREMES; i++) {
        sst_map_u16_fini(&a->extreme[i]);
        sst_map_u16_fini(&a->flat[i / 2]);
    }
    sst_map_u16_fini(&a->steps);
    sst_map_u16_fini(&a->projected.far);
    sst_map_u16_fini(&a->projected.near);
    sst_sweep_candidates_fini(&a->swept);
    sst_mem_kept_fini(&a->lines);
}

int sst_around_init(struct sst_around *a, const struct sst_visible_views *in, int k, const struct sst_sweeps *sweeps)
{
    const struct sst_map_u16 *map = in->view[k].disp;
    int err = project_around(a, in, k);

    a->apart = sst_max_int(sweeps->plan.step, 1);
    err = err ? err : find_steps(&a->steps, map, sweeps->plan.step);
    err = err ? err : find_extremes(a->flat, 1, &a->steps, false, &a->lines);
    for (int i = 0; !err && i < 2; i++)
        err = find_extremes(&a->extreme[i], 2, map, i, &a->lines);
    sst_sweep_candidates_fini(&a->swept);
    return err ? err : sst_sweep_candidates(&a->swept, sweeps, &in->view[k], in->disp_min_px);
}

/* A row of a view and of what is around it. */
struct around_row {
    const uint16_t *own, *far, *near, *flat[SST_AROUND_EXTREMES / 2], *extreme[SST_AROUND_EXTREMES];
    const uint8_t *seen, *agreed; /* NULL: all are; none is */
    int apart;
};

static void around_row_init(struct around_row *r, const struct sst_around *a, const struct sst_visible_view *v, int y)
{
    r->apart = a->apart;
    r->own = sst_map_u16_row(v->disp, y);
    r->far = sst_map_u16_row(&a->projected.far, y);
    r->near = sst_map_u16_row(&a->projected.near, y);
    for (int i = 0; i < SST_AROUND_EXTREMES; i++) {
        r->flat[i / 2] = sst_map_u16_row(&a->flat[i / 2], y);
        r->extreme[i] = sst_map_u16_row(&a->extreme[i], y);
    }
    r->seen = v->seen && v->seen->data ? sst_map_u8_row(v->seen, y) : NULL;
    r->agreed = v->agreed && v->agreed->data ? sst_map_u8_row(v->agreed, y) : NULL;
}

/* A list in a register. */
typedef uint16_t list_lanes __attribute__((vector_size(2 * SST_HYPOTHESES), aligned(2), may_alias));

/* Add a hypothesis unless it is unknown or closer than `apart` to one in the list, whose unused entries repeat the
 * last. */
static inline int add(list_lanes *list, int count, uint16_t d, int apart)
{
    const list_lanes lane = { 0, 1, 2, 3, 4, 5, 6, 7 }, above = *list - d, below = d - *list; /* one wraps around */
    const list_lanes near = (list_lanes)((above < (uint16_t)apart) | (below < (uint16_t)apart));
    const list_lanes unused = (list_lanes)(lane >= (uint16_t)count);
    uint64_t any[sizeof(near) / sizeof(uint64_t)];

    _Static_assert(SST_HYPOTHESES == 8, "lanes");
    memcpy(any, &near, sizeof(any));
    if (d == SST_DISP_NONE || count == SST_HYPOTHESES || (count && (any[0] | any[1])))
        return count;
    *list = (*list & ~unused) | (unused & d);
    return count + 1;
}

/* Add the farthest and the nearest of a window that holds a step. */
static inline int add_extremes(list_lanes *list, int count, const struct around_row *r, int window, int x)
{
    if (r->flat[window][x])
        return count;
    count = add(list, count, r->extreme[2 * window][x], r->apart);
    return add(list, count, r->extreme[2 * window + 1][x], r->apart);
}

/* Add the candidates of the sweep; inside a surface without steps, only those that the map does not have. */
static inline int add_candidates(list_lanes *list, int count, const struct sst_sweep_peak *peak, bool flat, int apart)
{
    for (int i = 0; i < SST_SWEEP_PEAKS && peak[i].disp != SST_DISP_NONE; i++) {
        if (!flat || peak[i].absent)
            count = add(list, count, peak[i].disp, apart);
    }
    return count;
}

/* Which pixels have no other hypothesis than their own disparity, from column `left` on: settled pixels, pixels inside
 * a surface? */
static void find_alone(uint8_t *restrict alone, const struct around_row *r, int left, int n)
{
    const int apart = r->apart;
    const uint16_t *own = r->own + left, *far = r->far + left, *near = r->near + left;
    const uint16_t *flat = r->flat[SST_AROUND_EXTREMES / 2 - 1] + left;

    for (int x = 0; x < n; x++) {
        const int d = own[x], off = abs(far[x] - d), near_off = abs(near[x] - d);

        alone[x] = (uint8_t)((d != (int)SST_DISP_NONE) & (flat[x] != 0) & ((far[x] == SST_DISP_NONE) | (off < apart)) &
                             ((near[x] == 0) | (near_off < apart)));
    }
    for (int x = 0; r->agreed && x < n; x++)
        alone[x] |= (uint8_t)((own[x] != SST_DISP_NONE) & (r->agreed[left + x] != 0));
    for (int x = 0; r->seen && x < n; x++)
        alone[x] &= r->seen[left + x] != 0;
}

/* The hypotheses of a pixel, its own disparity first; unused entries repeat the last, or are 0. @return their number */
static int list_hypotheses(uint16_t *out, const struct around_row *r, const struct sst_sweep_peak *peak, int x)
{
    const uint16_t near = r->near[x];
    const int apart = r->apart;
    list_lanes list = { 0 };
    int n = 0;

    if (!r->seen || r->seen[x])
        n = add(&list, n, r->own[x], apart);
    if ((!r->seen || r->seen[x]) && !(n && r->agreed && r->agreed[x])) {
        n = add_extremes(&list, n, r, 0, x);
        n = add(&list, n, r->far[x], apart);
        n = add(&list, n, near ? near : (uint16_t)SST_DISP_NONE, apart);
        n = add_candidates(&list, n, peak, r->flat[SST_AROUND_EXTREMES / 2 - 1][x], apart);
        for (int i = 1; i < SST_AROUND_EXTREMES / 2; i++)
            n = add_extremes(&list, n, r, i, x);
    }
    *(list_lanes *)out = list;
    return n;
}

void sst_around_list(uint16_t *list, uint8_t *count, const struct sst_around *a, const struct sst_visible_view *v,
                     const struct sst_around_part *part)
{
    const int left = part->left, y = part->y, n = part->n;
    struct around_row row;
    int next = 0;

    around_row_init(&row, a, v, y);
    find_alone(count, &row, left, n);
    for (int x = left; x < left + n; x = next) {
        const struct sst_sweep_peak *peak = sst_sweep_candidates_at(&a->swept, x, y);
        bool absent = false; /* from the map is some candidate of the sweep */

        for (int i = 0; i < SST_SWEEP_PEAKS; i++)
            absent |= peak[i].disp != SST_DISP_NONE && peak[i].absent;
        next = sst_min_int((x / a->swept.cell + 1) * a->swept.cell, left + n);
        for (int i = x; i < next; i++) {
            uint16_t *to = list + (i - left) * SST_HYPOTHESES;

            if (count[i - left] && !absent)
                *to = row.own[i];
            else
                count[i - left] = (uint8_t)list_hypotheses(to, &row, peak, i);
        }
    }
}
