#include <errno.h>
#include <math.h>
#include <string.h>

#include "base/mem.h"
#include "pipeline/disparity/stage.h"
#include "pipeline/kernels/kernels.h"

/* Real costs are kept below it, so that it can mark "the neighbour does not see this" inside the tiles. */
#define ABSENT 255
/* Cost of what no neighbour sees: the same for every disparity, so that only smoothness decides. */
#define COST_UNSEEN 96
#define TILES 3

static size_t padded_steps(int steps)
{
    return ((size_t)steps + 31) / 32 * 32;
}

size_t sst_volume_bytes(int width, int height, int steps)
{
    const size_t cells = ((size_t)width + 63) / 64 * 64 * (size_t)height * padded_steps(steps);

    return 3 * cells;
}

int sst_volume_init(struct sst_volume *v, int width, int height, int disp_min, int steps)
{
    struct sst_volume made = { .width = width, .height = height, .disp_min = disp_min, .steps = steps, .divisor = 1,
                               .phase_step = 4 };
    size_t cells, tile;

    made.width_padded = ((size_t)width + 63) / 64 * 64;
    made.steps_padded = padded_steps(steps);
    cells = made.width_padded * (size_t)height * made.steps_padded;
    tile = made.width_padded * made.steps_padded;
    made.cost = sst_mem_alloc_raw(cells, 1);
    made.sum = sst_mem_alloc_raw(cells, sizeof(uint16_t));
    made.scratch = sst_mem_alloc_raw(TILES * tile + made.width_padded, 1);
    if (!made.cost || !made.sum || !made.scratch) {
        sst_volume_fini(&made);
        return -ENOMEM;
    }
    *v = made;
    return 0;
}

void sst_volume_fini(struct sst_volume *v)
{
    sst_mem_free(v->cost);
    sst_mem_free(v->sum);
    sst_mem_free(v->scratch);
    *v = (struct sst_volume){ 0 };
}

/* Where disparity step i puts a pixel in a neighbour at offset b along one axis: in quarter pixels from its own place. */
static int shift_q2(const struct sst_volume *v, int i, double b)
{
    const double d = v->disp_min + (double)i / v->divisor;

    return v->phase_step * (int)floor(-d * b * 4.0 / v->phase_step + 0.5);
}

/* Whole pixels, rounded down, and the quarters left over. */
static int whole(int q2)
{
    return (q2 - (q2 & 3)) / 4;
}

unsigned sst_volume_phases(const struct sst_volume *v, double bx, double by)
{
    unsigned phases = 0;

    for (int i = 0; i < v->steps; i++)
        phases |= 1u << (4 * (shift_q2(v, i, by) & 3) + (shift_q2(v, i, bx) & 3));
    return phases;
}

static uint8_t min_u8(uint8_t a, uint8_t b)
{
    return a < b ? a : b;
}

static uint8_t max_u8(uint8_t a, uint8_t b)
{
    return a > b ? a : b;
}

/* Costs of row y against one neighbour: tile[i][x], i the disparity step. With both costs their mean. @param row  scratch */
static void tile_row(uint8_t *tile, uint8_t *row, const struct sst_volume *v, const struct sst_descriptor *ref,
                     const struct sst_neighbour *n, int y)
{
    const struct sst_kernels *k = sst_kernels_get();
    const int w = v->width;

    memset(tile, ABSENT, v->width_padded * v->steps_padded);
    for (int i = 0; i < v->steps; i++) {
        const int qx = shift_q2(v, i, n->bx), qy = shift_q2(v, i, n->by), phase = 4 * (qy & 3) + (qx & 3);
        const int shift = whole(qx), yn = y + whole(qy);
        /* Features are made for whole pixels only: the nearest ones. */
        const int near_x = whole(qx + 2), near_y = y + whole(qy + 2);
        const int x0 = sst_max_int(0, -sst_min_int(shift, near_x)), x1 = sst_min_int(w, w - sst_max_int(shift, near_x));
        uint8_t *out = tile + (size_t)i * v->width_padded + x0;

        if (yn < 0 || near_y < 0 || yn >= v->height || near_y >= v->height || x1 <= x0)
            continue;
        if (ref->census[0])
            k->hamming_row(out, ref->census[0] + (size_t)y * ref->census_stride + x0,
                           n->desc->census[phase] + (size_t)yn * ref->census_stride + (x0 + shift), (size_t)(x1 - x0));
        if (ref->features)
            k->feature_cost_row(ref->census[0] ? row : out,
                                ref->features + (size_t)y * 32 * ref->feature_stride + 2 * (size_t)x0,
                                n->desc->features + (size_t)near_y * 32 * ref->feature_stride + 2 * (size_t)(x0 + near_x),
                                ref->feature_stride, (size_t)(x1 - x0));
        for (int x = 0; ref->features && x < x1 - x0; x++)
            out[x] = ref->census[0] ? (uint8_t)((out[x] + row[x] + 1) >> 1) : min_u8(out[x], ABSENT - 1);
    }
}

/* Keep the two cheapest of the costs seen so far, cell by cell. */
static void keep_cheapest(uint8_t *restrict first, uint8_t *restrict second, const uint8_t *restrict tile, size_t cells)
{
    for (size_t i = 0; i < cells; i++) {
        const uint8_t t = tile[i], over = max_u8(first[i], t);

        first[i] = min_u8(first[i], t);
        second[i] = min_u8(second[i], over);
    }
}

/* One cost from the two cheapest ones, into the first. */
static void merge(uint8_t *restrict first, const uint8_t *restrict second, int count, size_t cells)
{
    for (size_t i = 0; i < cells; i++) {
        const unsigned a = first[i], b = second[i];
        const unsigned two = count == 2 ? (3 * a + b + 2) >> 2 : (a + b + 1) >> 1;

        first[i] = (uint8_t)(a == ABSENT ? COST_UNSEEN : b == ABSENT ? a : two);
    }
}

void sst_volume_fill(struct sst_volume *v, const struct sst_descriptor *ref, const struct sst_neighbour *neighbours,
                     int count)
{
    const struct sst_kernels *k = sst_kernels_get();
    const size_t cells = v->width_padded * v->steps_padded, real = v->width_padded * (size_t)v->steps;
    uint8_t *first = v->scratch, *second = first + cells, *tile = second + cells;

    for (int y = 0; y < v->height; y++) {
        memset(first, ABSENT, 2 * cells);
        for (int i = 0; i < count; i++) {
            tile_row(tile, tile + cells, v, ref, &neighbours[i], y);
            keep_cheapest(first, second, tile, real);
        }
        merge(first, second, count, real);
        memset(first + real, SST_COST_MAX, cells - real);
        k->transpose_u8(v->cost + (size_t)y * cells, v->steps_padded, first, v->width_padded, v->width_padded,
                        v->steps_padded);
    }
}

void sst_volume_requantise(struct sst_volume *v)
{
    const size_t pixels = v->width_padded * (size_t)v->height, nd = v->steps_padded;

    for (size_t p = 0; p < pixels; p++) {
        const uint16_t *s = v->sum + p * nd;
        uint8_t *c = v->cost + p * nd;
        uint16_t lowest = 65535;

        for (size_t d = 0; d < nd; d++)
            lowest = s[d] < lowest ? s[d] : lowest;
        for (size_t d = 0; d < nd; d++) {
            const uint16_t above = (uint16_t)(s[d] - lowest);

            c[d] = (uint8_t)(above < SST_COST_MAX ? above : SST_COST_MAX);
        }
    }
}

int sst_parabola_q6(int before, int at, int after)
{
    const int curvature = before - 2 * at + after, slope = 32 * (before - after);

    /* `at` is the least of the three, so curvature >= |slope| / 32 and the result is within half a step. */
    if (curvature <= 0)
        return 0;
    return (slope >= 0 ? slope + curvature / 2 : slope - curvature / 2) / curvature;
}

int sst_volume_winner(const struct sst_volume *v, bool from_cost, struct sst_map_u16 *disp_q6,
                      struct sst_map_u8 *confidence)
{
    const struct sst_kernels *k = sst_kernels_get();
    const size_t n = (size_t)v->width, nd = v->steps_padded, row_cells = v->width_padded * nd;
    uint16_t *wide = from_cost ? sst_mem_alloc_raw(row_cells, sizeof(uint16_t)) : NULL;
    uint16_t *best = sst_mem_alloc_raw(2 * n, sizeof(uint16_t)), *second = best ? best + n : NULL;

    if (!best || (from_cost && !wide)) {
        sst_mem_free(wide);
        sst_mem_free(best);
        return -ENOMEM;
    }
    for (int y = 0; y < v->height; y++) {
        const uint16_t *sum = from_cost ? wide : v->sum + (size_t)y * row_cells;
        uint16_t *disp = sst_map_u16_row(disp_q6, y);
        uint8_t *conf = sst_map_u8_row(confidence, y);

        for (size_t i = 0; from_cost && i < row_cells; i++)
            wide[i] = v->cost[(size_t)y * row_cells + i];
        k->winner_row(best, second, sum, nd, n, (size_t)v->steps);
        for (size_t x = 0; x < n; x++) {
            const uint16_t *s = sum + x * nd;
            const int b = best[x], gap = second[x] - s[b];
            int offset = 0;

            if (b > 0 && b + 1 < v->steps)
                offset = sst_parabola_q6(s[b - 1], s[b], s[b + 1]);
            disp[x] = (uint16_t)((b * 64 + offset + v->divisor / 2) / v->divisor);
            /* Half of full confidence at a gap of 128 cost units. */
            conf[x] = (uint8_t)(gap > 0 ? 255 * gap / (gap + 128) : 0);
        }
    }
    sst_mem_free(wide);
    sst_mem_free(best);
    return 0;
}
