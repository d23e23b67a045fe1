/*
 * What may be at a pixel (design.md, 5.7): its own disparity, the surfaces around it, those that other views project
 * onto it and those that the sweep finds (sweep.c).
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/mem.h"
#include "pipeline/lightfield/shift.h"
#include "pipeline/method/disparity/stage.h"

static const int radii[SST_AROUND_EXTREMES / 2] = { 2, 6, 16 };

static void project_view(struct sst_projected *to, const struct sst_visible_view *from, double bx, double by,
                         double disp_min_px)
{
    const struct sst_shift across = sst_shift_by(bx, disp_min_px), down = sst_shift_by(by, disp_min_px);

    for (int y = 0; y < from->disp->height; y++) {
        const uint16_t *d = sst_map_u16_row(from->disp, y);

        for (int x = 0; x < from->disp->width; x++) {
            const int xt = sst_shifted(x, across, d[x]), yt = sst_shifted(y, down, d[x]);
            uint16_t *far, *near;

            if (d[x] == SST_DISP_NONE || xt < 0 || yt < 0 || xt >= to->far.width || yt >= to->far.height)
                continue;
            far = &sst_map_u16_row(&to->far, yt)[xt];
            near = &sst_map_u16_row(&to->near, yt)[xt];
            *far = d[x] < *far ? d[x] : *far;
            *near = d[x] > *near ? d[x] : *near;
        }
    }
}

/* A map of this size, of any content. */
static int keep_map(struct sst_map_u16 *map, const struct sst_map_u16 *size)
{
    if (map->data && map->width == size->width && map->height == size->height)
        return 0;
    sst_map_u16_fini(map);
    return sst_map_u16_init(map, size->width, size->height);
}

/* Surfaces of the matched views up to two spacings away on the axes and one on the diagonals. */
static int project_around(struct sst_projected *to, const struct sst_visible_views *in, int k)
{
    const struct sst_visible_view *own = &in->view[k];
    int err = keep_map(&to->far, own->disp);

    err = err ? err : keep_map(&to->near, own->disp);
    if (err)
        return err;
    memset(to->far.data, 0xFF, to->far.stride * (size_t)to->far.height);
    memset(to->near.data, 0, to->near.stride * (size_t)to->near.height);
    for (int i = 0; i < in->count; i++) {
        const struct sst_visible_view *v = &in->view[i];
        const double bx = v->bx - own->bx, by = v->by - own->by;

        if (i != k && v->image && !v->carried && fabs(bx) + fabs(by) < 2.5)
            project_view(to, v, bx, by, in->disp_min_px);
    }
    return 0;
}

/* v[i] = least of v[i .. i + 2 radius], in place; n + 2 radius values. Windows grow by doubling. */
static void least_ahead(uint16_t *v, int n, int radius)
{
    const int total = 2 * radius + 1;

    for (int have = 1, more; have < total; have += more) {
        more = sst_min_int(have, total - have);
        for (int i = 0; i <= n + 2 * radius - have - more; i++)
            v[i] = v[i + more] < v[i] ? v[i + more] : v[i];
    }
}

/* The same over rows of n values. */
static void least_below(uint16_t *v, int n, int rows, int radius)
{
    const int total = 2 * radius + 1;

    for (int have = 1, more; have < total; have += more) {
        more = sst_min_int(have, total - have);
        for (int y = 0; y <= rows + 2 * radius - have - more; y++) {
            uint16_t *a = v + (size_t)y * (size_t)n;
            const uint16_t *b = v + (size_t)(y + more) * (size_t)n;

            for (int x = 0; x < n; x++)
                a[x] = b[x] < a[x] ? b[x] : a[x];
        }
    }
}

/*
 * The farthest (nearest: the nearest) known disparity in windows of 2 radius + 1; NONE where nothing is known. The
 * nearest is the least of the complements.
 * @param lines  scratch
 */
static int find_extreme(struct sst_map_u16 *out, const struct sst_map_u16 *map, int radius, bool nearest,
                        struct sst_mem_kept *lines)
{
    const int w = map->width, h = map->height;
    const uint16_t flip = nearest ? SST_DISP_MAX_Q6 : 0;
    const size_t row = (size_t)w, all = row * (size_t)(h + 2 * radius);
    uint16_t *rows = sst_mem_keep(lines, all + row + 2 * (size_t)radius, sizeof(*rows)), *line = rows + all;
    const int err = rows ? keep_map(out, map) : -ENOMEM;

    for (int y = -radius; !err && y < h + radius; y++) {
        memset(line, 0xFF, (size_t)(w + 2 * radius) * sizeof(*line));
        for (int x = 0; y >= 0 && y < h && x < w; x++) {
            const uint16_t d = sst_map_u16_row(map, y)[x];

            line[x + radius] = d == SST_DISP_NONE ? d : (uint16_t)(nearest ? flip - d : d);
        }
        least_ahead(line, w, radius);
        memcpy(rows + (size_t)(y + radius) * row, line, row * sizeof(*line));
    }
    if (!err)
        least_below(rows, w, h, radius);
    for (int y = 0; !err && y < h; y++) {
        for (int x = 0; x < w; x++) {
            const uint16_t d = rows[(size_t)y * row + (size_t)x];

            sst_map_u16_row(out, y)[x] = d == SST_DISP_NONE ? d : (uint16_t)(nearest ? flip - d : d);
        }
    }
    return err;
}

/* 0 where the map steps by more than 3/2 of `step` to the pixel on the right or below, 1 elsewhere. */
static int find_steps(struct sst_map_u16 *out, const struct sst_map_u16 *map, int step)
{
    const int most = step * 3 / 2, err = keep_map(out, map);

    for (int y = 0; !err && y < map->height; y++) {
        const uint16_t *at = sst_map_u16_row(map, y), *below = y + 1 < map->height ? sst_map_u16_row(map, y + 1) : at;
        uint16_t *to = sst_map_u16_row(out, y);

        for (int x = 0; x < map->width; x++) {
            const int right = at[x + 1 < map->width ? x + 1 : x];

            to[x] = abs(at[x] - right) <= most && abs(at[x] - below[x]) <= most;
        }
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

int sst_around_init(struct sst_around *a, const struct sst_visible_views *in, int k, int step,
                    const struct sst_sweep *sweep, int sweeps)
{
    const struct sst_map_u16 *map = in->view[k].disp;
    int err = project_around(&a->projected, in, k);

    err = err ? err : find_steps(&a->steps, map, step);
    for (int i = 0; !err && i < SST_AROUND_EXTREMES / 2; i++)
        err = find_extreme(&a->flat[i], &a->steps, radii[i], false, &a->lines);
    for (int i = 0; !err && i < SST_AROUND_EXTREMES; i++)
        err = find_extreme(&a->extreme[i], map, radii[i / 2], i % 2, &a->lines);
    sst_sweep_candidates_fini(&a->swept);
    return err ? err
               : sst_sweep_candidates(&a->swept, sweep, sweeps, in->view[k].bx, in->view[k].by, map, in->disp_min_px,
                                      in->range * 64, step);
}

/* A row of a view and of what is around it. */
struct around_row {
    const uint16_t *own, *far, *near, *flat[SST_AROUND_EXTREMES / 2], *extreme[SST_AROUND_EXTREMES];
    const uint8_t *seen, *agreed; /* NULL: all are; none is */
};

static void around_row_init(struct around_row *r, const struct sst_around *a, const struct sst_visible_view *v, int y)
{
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
static inline int add_extremes(list_lanes *list, int count, const struct around_row *r, int window, int x, int apart)
{
    if (r->flat[window][x])
        return count;
    count = add(list, count, r->extreme[2 * window][x], apart);
    return add(list, count, r->extreme[2 * window + 1][x], apart);
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

static bool is_near(uint16_t a, uint16_t b, int apart)
{
    return abs(a - b) < apart;
}

/* Does a pixel inside a surface have no other hypothesis than its own disparity? @param absent  some candidate of the
 * sweep is absent from the map */
static bool is_alone(const struct around_row *r, int x, bool absent, int apart)
{
    const uint16_t own = r->own[x], far = r->far[x], near = r->near[x];

    return own != SST_DISP_NONE && r->flat[SST_AROUND_EXTREMES / 2 - 1][x] && !absent && (!r->seen || r->seen[x]) &&
           (far == SST_DISP_NONE || is_near(far, own, apart)) && (!near || is_near(near, own, apart));
}

/* The hypotheses of a pixel, its own disparity first; unused entries repeat the last, or are 0. @return their number */
static int list_hypotheses(uint16_t *out, const struct around_row *r, const struct sst_sweep_peak *peak, int x,
                           int apart)
{
    const uint16_t near = r->near[x];
    list_lanes list = { 0 };
    int n = 0;

    if (!r->seen || r->seen[x])
        n = add(&list, n, r->own[x], apart);
    if ((!r->seen || r->seen[x]) && !(n && r->agreed && r->agreed[x])) {
        n = add_extremes(&list, n, r, 0, x, apart);
        n = add(&list, n, r->far[x], apart);
        n = add(&list, n, near ? near : (uint16_t)SST_DISP_NONE, apart);
        n = add_candidates(&list, n, peak, r->flat[SST_AROUND_EXTREMES / 2 - 1][x], apart);
        for (int i = 1; i < SST_AROUND_EXTREMES / 2; i++)
            n = add_extremes(&list, n, r, i, x, apart);
    }
    *(list_lanes *)out = list;
    return n;
}

void sst_around_list(uint16_t *list, uint8_t *count, const struct sst_around *a, const struct sst_visible_view *v,
                     int left, int y, int n, int apart)
{
    struct around_row row;
    int next = 0;

    around_row_init(&row, a, v, y);
    for (int x = left; x < left + n; x = next) {
        const struct sst_sweep_peak *peak = sst_sweep_candidates_at(&a->swept, x, y);
        bool absent = false;

        for (int i = 0; i < SST_SWEEP_PEAKS; i++)
            absent |= peak[i].disp != SST_DISP_NONE && peak[i].absent;
        next = sst_min_int((x / a->swept.cell + 1) * a->swept.cell, left + n);
        for (int i = x; i < next; i++) {
            uint16_t *to = list + (i - left) * SST_HYPOTHESES;
            const bool alone = is_alone(&row, i, absent, apart);

            if (alone)
                *(list_lanes *)to = (list_lanes){ 0 } + row.own[i];
            count[i - left] = alone ? 1 : (uint8_t)list_hypotheses(to, &row, peak, i, apart);
        }
    }
}
