/* The shaders of label refinement: their references. Their self-tests: refine_test.c. */
#include "pipeline/gpu/refine.h"

#include <assert.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/gpu/gpu_internal.h"

#define NONE 0xFFFFU

static void add_to(uint32_t v[2], int64_t more)
{
    sst_gpu_split(v, sst_gpu_whole(v) + (uint64_t)more);
}

static bool is_conflict(uint64_t mask)
{
    return (mask & (mask - 1)) != 0;
}

static bool is_mixed(uint64_t mask, uint64_t ground)
{
    return mask & ground && mask & ~ground;
}

void refine_count_reference(const void *push, void *const *buffer, const uint32_t groups[3] SST_UNUSED)
{
    const struct sst_gpu_refine_count *p = push;
    const uint32_t *view = buffer[SST_GPU_REFINE_COUNT_VIEW];
    uint32_t *counts = buffer[SST_GPU_REFINE_COUNT_COUNTS];

    for (int i = 0; i < p->width * p->height; i++) {
        const uint32_t label = view[i] >> 16, q = view[i] & 0xFFFF;

        if (label && label <= p->labels && q < p->bins)
            counts[(size_t)(label - 1) * p->bins + q]++;
    }
}

/* --- grounds ------------------------------------------------------------------------------------------------------ */

static uint64_t miss_of(const struct sst_gpu_refine_ground *g, int x, int y, uint32_t q)
{
    const uint64_t along = sst_gpu_whole(g->a) * (uint64_t)x + sst_gpu_whole(g->b) * (uint64_t)y;
    const uint64_t off = ((uint64_t)q << 24) - (sst_gpu_whole(g->d0) + along);

    return off >> 63 ? -off : off;
}

/* Bit of a pixel's label among those that are fitted; 0: the pixel does not count. */
static uint64_t fitted(const struct sst_gpu_refine_fit *p, uint32_t pixel)
{
    const uint32_t label = pixel >> 16;

    if (!label || label > SST_GPU_REFINE_LABELS || (pixel & 0xFFFF) == NONE)
        return 0;
    return sst_gpu_whole(p->labels) & (uint64_t)1 << (label - 1);
}

void refine_ground_sums_reference(const void *push, void *const *buffer, const uint32_t groups[3] SST_UNUSED)
{
    const struct sst_gpu_refine_fit *p = push;
    const uint32_t *view = buffer[SST_GPU_REFINE_GROUND_SUMS_VIEW];
    const struct sst_gpu_refine_ground *grounds = buffer[SST_GPU_REFINE_GROUND_SUMS_GROUNDS];
    struct sst_gpu_refine_ground_sums *out = buffer[SST_GPU_REFINE_GROUND_SUMS_OUT];

    for (int i = 0; i < p->width * p->height; i++) {
        const int label = (int)(view[i] >> 16);
        const int64_t x = i % p->width, y = i / p->width, q = view[i] & 0xFFFF;
        struct sst_gpu_refine_ground_sums *s;

        if (!fitted(p, view[i]) ||
            miss_of(&grounds[label - 1], (int)x, (int)y, (uint32_t)q) > sst_gpu_whole(grounds[label - 1].limit))
            continue;
        s = &out[label - 1];
        add_to(s->n, 1);
        add_to(s->x, x);
        add_to(s->y, y);
        add_to(s->d, q);
        add_to(s->xx, x * x);
        add_to(s->xy, x * y);
        add_to(s->yy, y * y);
        add_to(s->xd, x * q);
        add_to(s->yd, y * q);
    }
}

void refine_ground_misses_reference(const void *push, void *const *buffer, const uint32_t groups[3] SST_UNUSED)
{
    const struct sst_gpu_refine_fit *p = push;
    const uint32_t *view = buffer[SST_GPU_REFINE_GROUND_MISSES_VIEW];
    const struct sst_gpu_refine_ground *grounds = buffer[SST_GPU_REFINE_GROUND_MISSES_GROUNDS];
    uint32_t *out = buffer[SST_GPU_REFINE_GROUND_MISSES_OUT];

    for (int i = 0; i < p->width * p->height; i++) {
        const uint64_t bit = fitted(p, view[i]);
        uint64_t bin;

        if (!bit)
            continue;
        bin = (miss_of(&grounds[(view[i] >> 16) - 1], i % p->width, i / p->width, view[i] & 0xFFFF) + (1 << 23)) >> 24;
        bin = bin < p->bins ? bin : p->bins - 1;
        out[(size_t)__builtin_popcountll(sst_gpu_whole(p->labels) & (bit - 1)) * p->bins + bin]++;
    }
}

void refine_ground_limit_reference(const void *push, void *const *buffer, const uint32_t groups[3] SST_UNUSED)
{
    const struct sst_gpu_refine_fit *p = push;
    uint32_t *misses = buffer[SST_GPU_REFINE_GROUND_LIMIT_MISSES];
    struct sst_gpu_refine_ground *grounds = buffer[SST_GPU_REFINE_GROUND_LIMIT_GROUNDS];

    for (uint64_t left = sst_gpu_whole(p->labels); left; left &= left - 1, misses += p->bins) {
        uint32_t all = 0, below = misses[0], median = 0;
        uint64_t limit;

        for (uint32_t bin = 0; bin < p->bins; bin++)
            all += misses[bin];
        while (2 * below < all && median < p->bins - 1)
            below += misses[++median];
        limit = (uint64_t)p->spread * median;
        sst_gpu_split(grounds[__builtin_ctzll(left)].limit,
                      limit > sst_gpu_whole(p->least) ? limit : sst_gpu_whole(p->least));
        memset(misses, 0, p->bins * sizeof(*misses));
    }
}

/* --- candidates --------------------------------------------------------------------------------------------------- */

static uint64_t candidates_of(const struct sst_gpu_refine_mask *p, void *const *buffer, int x, int y, uint32_t pixel)
{
    const struct sst_gpu_refine_ground *grounds = buffer[SST_GPU_REFINE_MASK_GROUNDS];
    const uint32_t *table = buffer[SST_GPU_REFINE_MASK_TABLE];
    uint64_t mask;

    if (pixel >= NONE) /* it has a label, or no disparity */
        return 0;
    mask = sst_gpu_whole(table + 2 * (size_t)pixel);
    for (uint64_t left = mask & sst_gpu_whole(p->planar); left; left &= left - 1) {
        const int i = __builtin_ctzll(left);

        if (miss_of(&grounds[i], x, y, pixel) > sst_gpu_whole(grounds[i].limit))
            mask &= ~((uint64_t)1 << i);
    }
    return mask;
}

void refine_mask_reference(const void *push, void *const *buffer, const uint32_t groups[3] SST_UNUSED)
{
    const struct sst_gpu_refine_mask *p = push;
    const uint32_t *view = buffer[SST_GPU_REFINE_MASK_VIEW];
    uint32_t(*out)[2] = buffer[SST_GPU_REFINE_MASK_MASK], *seen = buffer[SST_GPU_REFINE_MASK_SEEN];
    struct sst_gpu_refine_choice *choice = buffer[SST_GPU_REFINE_MASK_CHOICE];
    uint64_t all = sst_gpu_whole(seen), mixed = sst_gpu_whole(seen + 2);

    for (int i = 0; i < p->width * p->rows; i++) {
        const uint64_t mask =
            candidates_of(p, buffer, i % p->width, p->top + i / p->width, view[p->top * p->width + i]);

        sst_gpu_split(out[i], mask);
        if (!is_conflict(mask))
            continue;
        choice[i] = (struct sst_gpu_refine_choice){ { 0 }, { 0 }, { 0 } };
        all |= mask;
        mixed |= is_mixed(mask, sst_gpu_whole(p->ground)) ? mask : 0;
    }
    sst_gpu_split(seen, all);
    sst_gpu_split(seen + 2, mixed);
}

/* --- distances ---------------------------------------------------------------------------------------------------- */

/* Distance at (x, y) from that in the row before it. */
static uint32_t next_distance(const struct sst_gpu_refine_columns *p, const uint32_t *view, int x, int y, uint32_t d)
{
    return view[y * p->width + x] >> 16 == p->label ? 0 : d < SST_GPU_REFINE_FAR ? d + 1 : d;
}

void refine_columns_reference(const void *push, void *const *buffer, const uint32_t groups[3] SST_UNUSED)
{
    const struct sst_gpu_refine_columns *p = push;
    const uint32_t *view = buffer[SST_GPU_REFINE_COLUMNS_VIEW];
    uint32_t *out = buffer[SST_GPU_REFINE_COLUMNS_OUT];

    for (int x = 0; x < p->width; x++) {
        uint32_t d = SST_GPU_REFINE_FAR;

        for (int y = 0; y < p->top + p->rows; y++) {
            d = next_distance(p, view, x, y, d);
            if (y >= p->top)
                out[(y - p->top) * p->width + x] = d;
        }
        d = SST_GPU_REFINE_FAR;
        for (int y = p->height - 1; y >= p->top; y--) {
            uint32_t *to = &out[(y - p->top) * p->width + x];

            d = next_distance(p, view, x, y, d);
            if (y < p->top + p->rows)
                *to = d < *to ? d : *to;
        }
    }
}

void refine_extents_reference(const void *push, void *const *buffer, const uint32_t groups[3] SST_UNUSED)
{
    const struct sst_gpu_refine_extents *p = push;
    const uint32_t *view = buffer[SST_GPU_REFINE_EXTENTS_VIEW];
    uint32_t *out = buffer[SST_GPU_REFINE_EXTENTS_OUT];

    for (uint32_t i = 0; i < p->labels * (uint32_t)p->height; i++)
        out[i] = NONE;
    for (int i = 0; i < p->width * p->height; i++) {
        const uint32_t label = view[i] >> 16, x = (uint32_t)(i % p->width);
        uint32_t *extent;

        if (!label || label > p->labels)
            continue;
        extent = &out[(label - 1) * (uint32_t)p->height + (uint32_t)(i / p->width)];
        *extent = (*extent == NONE ? x : *extent & 0xFFFF) | x << 16;
    }
}

/* Squared distance to the nearest pixel with the label, from the distances of the columns, the nearest ones first. */
static uint32_t nearest_to(const uint32_t *columns, int width, int x)
{
    uint32_t best = UINT32_MAX;

    for (int r = 0; r < width && (uint32_t)(r * r) < best; r++) {
        for (int side = 0; side < 2; side++) {
            const int at = side ? x + r : x - r;

            if (at >= 0 && at < width && columns[at] < SST_GPU_REFINE_FAR &&
                columns[at] * columns[at] + (uint32_t)(r * r) < best)
                best = columns[at] * columns[at] + (uint32_t)(r * r);
        }
    }
    return best;
}

static uint32_t farthest_to(const int32_t (*hull)[2], uint32_t corners, int x, int y)
{
    int32_t best = 0;

    for (uint32_t i = 0; i < corners; i++) {
        const int32_t dx = hull[i][0] - x, dy = hull[i][1] - y;

        best = sst_max_int(best, dx * dx + dy * dy);
    }
    return (uint32_t)best;
}

void refine_compete_reference(const void *push, void *const *buffer, const uint32_t groups[3] SST_UNUSED)
{
    const struct sst_gpu_refine_compete *p = push;
    const uint32_t(*masks)[2] = buffer[SST_GPU_REFINE_COMPETE_MASK];
    const uint32_t *columns = buffer[SST_GPU_REFINE_COMPETE_COLUMNS];
    struct sst_gpu_refine_choice *choices = buffer[SST_GPU_REFINE_COMPETE_CHOICE];

    for (int i = 0; i < p->width * p->rows; i++) {
        struct sst_gpu_refine_choice *c = &choices[i];
        const int x = i % p->width, row = i / p->width;
        const uint64_t mask = sst_gpu_whole(masks[i]);
        uint32_t nearest2 = 1, farthest2 = 1;

        if (!(mask >> (p->label - 1) & 1) || !is_conflict(mask))
            continue;
        if (p->corners) {
            nearest2 = nearest_to(columns + (size_t)row * (size_t)p->width, p->width, x);
            farthest2 = farthest_to(buffer[SST_GPU_REFINE_COMPETE_HULL], p->corners, x, p->top + row);
        }
        if (!p->weigh || !farthest2) {
            nearest2 = 0;
            farthest2 = 1;
        }
        if (c->label[p->kind] &&
            (uint64_t)nearest2 * c->farthest2[p->kind] >= (uint64_t)c->nearest2[p->kind] * farthest2)
            continue;
        c->nearest2[p->kind] = nearest2;
        c->farthest2[p->kind] = farthest2;
        c->label[p->kind] = p->label;
    }
}

/* --- planes and normals ------------------------------------------------------------------------------------------- */

void refine_sums_reference(const void *push, void *const *buffer, const uint32_t groups[3] SST_UNUSED)
{
    const struct sst_gpu_refine_window *p = push;
    const uint32_t *view = buffer[SST_GPU_REFINE_SUMS_VIEW];
    struct sst_gpu_refine_sums *out = buffer[SST_GPU_REFINE_SUMS_OUT];

    for (int i = 0; i < p->width * p->rows; i++) {
        const int x = i % p->width, y = p->top + i / p->width;
        struct sst_gpu_refine_sums s = { 0 };

        for (int v = -p->radius; v <= p->radius; v++) {
            uint32_t q;

            if (y + v < 0 || y + v >= p->height)
                continue;
            q = view[(y + v) * p->width + x] & 0xFFFF;
            if (q == NONE)
                continue;
            s.n++;
            s.y += v;
            s.yy += v * v;
            s.d += q;
            s.yd += v * (int)q;
            add_to(s.dd, (int64_t)((uint64_t)q * q));
        }
        out[i] = s;
    }
}

void refine_planes_reference(const void *push, void *const *buffer, const uint32_t groups[3] SST_UNUSED)
{
    const struct sst_gpu_refine_window *p = push;
    const struct sst_gpu_refine_sums *sums = buffer[SST_GPU_REFINE_PLANES_SUMS];
    struct sst_surface_plane *out = buffer[SST_GPU_REFINE_PLANES_OUT];

    for (int i = 0; i < p->width * p->rows; i++) {
        const int x = i % p->width, y = i / p->width;
        struct sst_surface_sums s = { 0 };

        for (int u = -p->radius; u <= p->radius; u++) {
            const struct sst_gpu_refine_sums *c;

            if (x + u < 0 || x + u >= p->width)
                continue;
            c = &sums[y * p->width + x + u];
            s.n += c->n;
            s.x += (int64_t)u * c->n;
            s.y += c->y;
            s.xx += (int64_t)u * u * c->n;
            s.xy += (int64_t)u * c->y;
            s.yy += c->yy;
            s.d += c->d;
            s.xd += (int64_t)u * c->d;
            s.yd += c->yd;
            s.dd += (int64_t)sst_gpu_whole(c->dd);
        }
        out[i] = sst_surface_fit(&s, 0, 0);
    }
}

/* Those that are there, in their places. */
static struct sst_surface_plane *planes_of_view(const struct sst_gpu_refine_normals *p,
                                                const struct sst_surface_plane *planes)
{
    const size_t width = (size_t)p->width, first = (size_t)p->first;
    const size_t rows = (size_t)sst_min_int(p->top + p->rows + p->radius, p->height) - first;
    struct sst_surface_plane *view = calloc(width * (size_t)p->height, sizeof(*view));

    assert(view); /* the dummy device is for tests */
    memcpy(view + first * width, planes, rows * width * sizeof(*view));
    return view;
}

void refine_normals_reference(const void *push, void *const *buffer, const uint32_t groups[3] SST_UNUSED)
{
    const struct sst_gpu_refine_normals *p = push;
    const uint32_t *view = buffer[SST_GPU_REFINE_NORMALS_VIEW];
    const uint32_t(*masks)[2] = buffer[SST_GPU_REFINE_NORMALS_MASK];
    struct sst_gpu_refine_region *regions = buffer[SST_GPU_REFINE_NORMALS_REGIONS];
    float(*out)[4] = buffer[SST_GPU_REFINE_NORMALS_OUT];
    struct sst_surface_plane *planes = planes_of_view(p, buffer[SST_GPU_REFINE_NORMALS_PLANES]);

    for (int i = 0; i < p->width * p->rows; i++) {
        const uint32_t pixel = view[p->top * p->width + i], label = pixel >> 16, q = pixel & 0xFFFF;
        const bool inside = label >= 1 && label <= SST_GPU_REFINE_LABELS && sst_gpu_whole(p->mixed) >> (label - 1) & 1;
        const struct sst_surface_plane *best = NULL;
        float n[4] = { 0 };
        int at[2];

        if (!inside && !is_mixed(sst_gpu_whole(masks[i]), sst_gpu_whole(p->ground)))
            continue;
        if (q != NONE)
            best = sst_surface_choose(planes, p->width, p->height, p->radius, p->frame.score_max, (int)q, i % p->width,
                                      p->top + i / p->width, at);
        if (best && sst_surface_normal(n, best, at[0], at[1], &p->frame))
            n[3] = 1;
        memcpy(out[i], n, sizeof(n));
        if (!inside)
            continue;
        add_to(regions[label - 1].pixels, 1);
        add_to(regions[label - 1].normals, n[3] != 0);
        for (int c = 0; c < 3; c++)
            add_to(regions[label - 1].sum_q20[c], n[3] != 0 ? sst_surface_q20(n[c]) : 0);
    }
    free(planes);
}

/* --- labels ------------------------------------------------------------------------------------------------------- */

static uint32_t decide(const struct sst_gpu_refine_assign *p, const struct sst_gpu_refine_choice *c,
                       const struct sst_gpu_refine_mean *means, const float normal[4])
{
    const uint32_t object = c->label[0], ground = c->label[1];
    float e_object, e_ground;

    if (!object || !ground)
        return object ? object : ground;
    e_object = p->p_distance * sst_surface_distance(c->nearest2[0], c->farthest2[0]);
    e_ground = p->p_distance * sst_surface_distance(c->nearest2[1], c->farthest2[1]);
    if (p->normals && means[object - 1].known && means[ground - 1].known && normal[3] != 0) {
        e_object += p->p_normal * sst_surface_consistency(normal, means[object - 1].mean, p->tau);
        e_ground += p->p_normal * sst_surface_consistency(normal, means[ground - 1].mean, p->tau);
    }
    if (e_object == e_ground)
        return object < ground ? object : ground;
    return e_object < e_ground ? object : ground;
}

void refine_assign_reference(const void *push, void *const *buffer, const uint32_t groups[3] SST_UNUSED)
{
    const struct sst_gpu_refine_assign *p = push;
    const uint32_t *view = buffer[SST_GPU_REFINE_ASSIGN_VIEW];
    const uint32_t(*masks)[2] = buffer[SST_GPU_REFINE_ASSIGN_MASK];
    const struct sst_gpu_refine_choice *choices = buffer[SST_GPU_REFINE_ASSIGN_CHOICE];
    const float(*normals)[4] = buffer[SST_GPU_REFINE_ASSIGN_NORMALS];
    const int pitch = (p->width + 3) / 4 * 4;
    uint8_t *out = buffer[SST_GPU_REFINE_ASSIGN_OUT];

    for (int i = 0; i < pitch * p->rows; i++) {
        const int x = i % pitch, at = i / pitch * p->width + x;
        uint32_t own;
        uint64_t mask;

        out[i] = 0;
        if (x >= p->width)
            continue;
        own = view[p->top * p->width + at] >> 16;
        mask = sst_gpu_whole(masks[at]);
        out[i] =
            (uint8_t)(own                 ? own
                      : !mask             ? 0
                      : is_conflict(mask) ? decide(p, &choices[at], buffer[SST_GPU_REFINE_ASSIGN_MEANS], normals[at])
                                          : (uint32_t)__builtin_ctzll(mask) + 1);
    }
}
