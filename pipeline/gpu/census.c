/* The shaders `census` and `match_cost`: their references by those of kernels, and their self-tests. */

#include <assert.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/gpu/gpu_internal.h"
#include "pipeline/kernels/kernels.h"

#define MARGIN 4 /* columns that the census reaches to each side */

/* --- references --------------------------------------------------------------------------------------------------- */

static int luma_of(uint32_t p)
{
    return (int)((77 * (p & 0xFF) + 150 * (p >> 8 & 0xFF) + 29 * (p >> 16 & 0xFF) + 128) >> 8);
}

/* Row y of the view sampled at (x, y) + (px, py) / 4, with MARGIN columns repeated beside it; borders repeated. */
static void sample_row(uint8_t *out, const struct sst_gpu_census *p, const uint32_t *pixel, int y, int px, int py)
{
    const uint32_t *a = pixel + (size_t)sst_clamp_int(y, 0, p->height - 1) * (size_t)p->width;
    const uint32_t *b = pixel + (size_t)sst_clamp_int(y + 1, 0, p->height - 1) * (size_t)p->width;

    for (int i = 0; i < p->width + 2 * MARGIN; i++) {
        const int x0 = sst_clamp_int(i - MARGIN, 0, p->width - 1), x1 = sst_min_int(x0 + 1, p->width - 1);
        const int above = (4 - px) * luma_of(a[x0]) + px * luma_of(a[x1]);
        const int below = (4 - px) * luma_of(b[x0]) + px * luma_of(b[x1]);

        out[i] = (uint8_t)(((4 - py) * above + py * below + 8) >> 4);
    }
}

void census_reference(const void *push, void *const *buffer, const uint32_t groups[3])
{
    const struct sst_gpu_census *p = push;
    const size_t width = (size_t)p->width, padded = width + 2 * MARGIN;
    uint8_t *samples = malloc(7 * padded);
    uint64_t *out = buffer[SST_GPU_CENSUS_OUT];

    assert(samples);
    for (uint32_t layer = 0; layer < groups[2]; layer++) {
        const int phase = (int)(p->phase[layer / 8] >> layer % 8 * 4 & 15);

        for (int y = 0; y < p->height; y++, out += width) {
            const uint8_t *rows[7];

            for (int j = 0; j < 7; j++) {
                rows[j] = samples + (size_t)j * padded + MARGIN;
                sample_row(samples + (size_t)j * padded, p, buffer[SST_GPU_CENSUS_PIXELS], y + j - 3, phase % 4,
                           phase / 4);
            }
            sst_census_row_ref(out, rows, width);
        }
    }
    free(samples);
}

/* A row of a tile at one of its disparities. */
struct row {
    const struct sst_gpu_match *push;
    const struct sst_gpu_step *step;
    const uint32_t *pixel, *other;          /* of the view, of the neighbour */
    const uint64_t *census, *other_census;  /* likewise */
    const uint8_t *features;                /* costs of this row and disparity, a pixel each struct sst_gpu_tile.nd */
    uint8_t *first, *second;                /* [pitch] */
};

/* The two cheapest costs with those of this neighbour. */
static void insert_row(const struct row *r, const struct sst_gpu_tile *t, int y)
{
    const struct sst_gpu_step *s = r->step;
    const int width = r->push->width, height = r->push->height, yn = y + s->y;
    const size_t own = (size_t)y * (size_t)width;
    const size_t at = ((size_t)s->layer * (size_t)height + (size_t)yn) * (size_t)width;
    const uint32_t flags = r->push->flags;

    if (yn < 0 || yn >= height || y + s->near_y < 0 || y + s->near_y >= height)
        return;
    for (int i = 0; i < t->pitch; i++) {
        const int x = t->left + i, xn = x + s->x;
        const uint8_t *feature = r->features + (size_t)i * (size_t)t->nd;
        uint8_t census = 0;

        if (xn < 0 || xn >= width || x + s->near_x < 0 || x + s->near_x >= width ||
            (flags & SST_GPU_MATCH_MASKS &&
             (!(r->pixel[own + (size_t)x] >> 24) || !(r->other[(size_t)(yn * width + xn)] >> 24))))
            continue;
        if (!(flags & SST_GPU_MATCH_ALONE))
            sst_hamming_row_ref(&census, r->census + own + x, r->other_census + at + xn, 1);
        sst_cheapest_row_ref(r->first + i, r->second + i, flags & SST_GPU_MATCH_ALONE ? feature : &census,
                             flags & SST_GPU_MATCH_FEATURES ? feature : &census, 1);
    }
}

static void match_row(struct row *r, void *const *buffer, const struct sst_gpu_tile *t, int row)
{
    const size_t nd = (size_t)t->nd, at = 4 * (size_t)t->quad + (size_t)row * (size_t)t->pitch * nd;
    uint16_t *two = (uint16_t *)buffer[SST_GPU_COST_SUM] + at;
    uint8_t *out = (uint8_t *)buffer[SST_GPU_COST_OUT] + at;

    for (size_t d = 0; d < nd; d++) {
        for (size_t x = 0; x < (size_t)t->pitch; x++) {
            const unsigned before =
                r->push->flags & SST_GPU_MATCH_FIRST ? SST_COST_ABSENT | SST_COST_ABSENT << 8 : two[x * nd + d];

            r->first[x] = (uint8_t)before;
            r->second[x] = (uint8_t)(before >> 8);
        }
        r->step = (const struct sst_gpu_step *)buffer[SST_GPU_COST_STEPS] + t->first + d;
        r->features = out + d;
        if (d < (size_t)t->steps)
            insert_row(r, t, t->top + row);
        for (size_t x = 0; x < (size_t)t->pitch && !(r->push->flags & SST_GPU_MATCH_LAST); x++)
            two[x * nd + d] = (uint16_t)(r->first[x] | r->second[x] << 8);
        if (!(r->push->flags & SST_GPU_MATCH_LAST))
            continue;
        sst_cheapest_mean_row_ref(r->first, r->second, r->push->flags & SST_GPU_MATCH_TWO, (size_t)t->pitch);
        for (size_t x = 0; x < (size_t)t->pitch; x++)
            out[x * nd + d] = d < (size_t)t->steps ? r->first[x] : SST_COST_MAX;
    }
}

void match_cost_reference(const void *push, void *const *buffer, const uint32_t groups[3])
{
    const struct sst_gpu_match *p = push;
    uint8_t *memory = malloc(2 * (size_t)p->width);
    struct row r = { .push = p,
                     .pixel = buffer[SST_GPU_COST_PIXELS],
                     .other = buffer[SST_GPU_COST_OTHERS],
                     .census = buffer[SST_GPU_COST_CENSUS],
                     .other_census = buffer[SST_GPU_COST_OTHER_CENSUS],
                     .first = memory };

    assert(memory);
    r.second = memory + p->width;
    for (uint32_t i = 0; i < groups[2]; i++) {
        const struct sst_gpu_tile *t = (const struct sst_gpu_tile *)buffer[SST_GPU_COST_TILES] + i;

        for (int row = 0; row < t->rows; row++)
            match_row(&r, buffer, t, row);
    }
    free(memory);
}

/* --- self-tests --------------------------------------------------------------------------------------------------- */

#define TEST_WIDTH  41 /* no multiple of a group's */
#define TEST_HEIGHT 19
#define TEST_PIXELS (TEST_WIDTH * TEST_HEIGHT)
#define TEST_LAYERS 11

int census_self_test(struct sst_gpu *g)
{
    static const struct sst_gpu_census push = { TEST_WIDTH, TEST_HEIGHT, { 0xFBA71320, 0x00000C65 } };
    const struct sst_gpu_work work = { .shader = SST_GPU_CENSUS,
                                       .push = &push,
                                       .groups = { gpu_groups(TEST_WIDTH, SST_GPU_PLANE_WIDTH),
                                                   gpu_groups(TEST_HEIGHT, SST_GPU_PLANE_HEIGHT), TEST_LAYERS } };
    const size_t bytes[SST_GPU_BUFFERS] = { TEST_PIXELS * sizeof(uint32_t),
                                            (size_t)TEST_PIXELS * TEST_LAYERS * sizeof(uint64_t) };
    uint32_t *pixel = malloc(bytes[SST_GPU_CENSUS_PIXELS]), state = 5;
    uint8_t *out = calloc(1, bytes[SST_GPU_CENSUS_OUT]);
    const void *const initial[SST_GPU_BUFFERS] = { pixel, out };
    int err = pixel && out ? 0 : -ENOMEM;

    for (size_t i = 0; i < TEST_PIXELS && !err; i++) /* single pixels, and planes of equal ones */
        pixel[i] = i % 9 < 4 ? 0x40506070 : gpu_random(&state);
    if (!err)
        err = gpu_compare(g, &work, initial, bytes, SST_GPU_CENSUS_OUT, NULL);
    free(pixel);
    free(out);
    return err;
}

#define TEST_LEFT   3 /* column of the second tile's first cost */
#define TEST_STEPS  40
#define TEST_CELLS  ((size_t)TEST_HEIGHT * TEST_WIDTH * (36 + 32))
#define TEST_OTHERS 3 /* layers */

/* A tile with all steps, and one with a window of them over a part of the view. */
static const struct sst_gpu_tile test_tiles[2] = {
    { 0, 0, TEST_WIDTH, TEST_HEIGHT, 0, 0, TEST_WIDTH, TEST_HEIGHT, 0, 34, 36, 0 },
    { 7, 5, 20, 10, TEST_LEFT, 2, TEST_WIDTH - TEST_LEFT, TEST_HEIGHT - 2, 9, 31, 32,
      TEST_WIDTH *TEST_HEIGHT * 36 / 4 },
};

struct test {
    struct sst_gpu_step step[TEST_STEPS];
    uint32_t pixel[TEST_PIXELS], other[TEST_PIXELS];
    uint64_t census[TEST_PIXELS], other_census[TEST_OTHERS][TEST_PIXELS];
    uint16_t sum[TEST_CELLS];
    uint8_t cost[TEST_CELLS];
};

static void set_test(struct test *t)
{
    uint32_t state = 7;

    for (int i = 0; i < TEST_STEPS; i++)
        t->step[i] = (struct sst_gpu_step){ 17 - i, i / 3 - 6, i % TEST_OTHERS, 17 - i - i % 2, i / 3 - 6 + i % 2 };
    for (size_t i = 0; i < TEST_PIXELS; i++) {
        t->pixel[i] = gpu_random(&state) % 5 ? 0xFF000000 : 0x00FFFFFF;
        t->other[i] = gpu_random(&state) % 5 ? 0xFF000000 : 0x00FFFFFF;
        t->census[i] = (uint64_t)gpu_random(&state) << 38 ^ (uint64_t)gpu_random(&state) << 19;
        for (size_t k = 0; k < TEST_OTHERS; k++)
            t->other_census[k][i] = i % 4 ? t->census[i] ^ gpu_random(&state) : (uint64_t)gpu_random(&state) << 40;
    }
}

/* One neighbour; the cheapest costs are kept for the next one. */
static int run_neighbour(struct sst_gpu *g, struct test *t, uint32_t flags)
{
    const struct sst_gpu_match push = { TEST_WIDTH, TEST_HEIGHT, flags };
    const void *const initial[SST_GPU_BUFFERS] = { test_tiles, t->step,         t->pixel, t->other,
                                                   t->census,  t->other_census, t->sum,   t->cost };
    const size_t bytes[SST_GPU_BUFFERS] = { sizeof(test_tiles), sizeof(t->step),   sizeof(t->pixel),
                                            sizeof(t->other),   sizeof(t->census), sizeof(t->other_census),
                                            sizeof(t->sum),     sizeof(t->cost) };
    const struct sst_gpu_work work = { .shader = SST_GPU_MATCH_COST,
                                       .push = &push,
                                       .groups = { sst_gpu_match_blocks(TEST_WIDTH, 36), TEST_HEIGHT,
                                                   ARRAY_LEN(test_tiles) } };
    const bool last = flags & SST_GPU_MATCH_LAST;

    return gpu_compare(g, &work, initial, bytes, last ? SST_GPU_COST_OUT : SST_GPU_COST_SUM,
                       last ? (void *)t->cost : t->sum);
}

int match_cost_self_test(struct sst_gpu *g)
{
    static const uint32_t flags[] = { SST_GPU_MATCH_FIRST | SST_GPU_MATCH_LAST,
                                      SST_GPU_MATCH_FIRST,
                                      SST_GPU_MATCH_MASKS,
                                      SST_GPU_MATCH_LAST | SST_GPU_MATCH_MASKS,
                                      SST_GPU_MATCH_LAST | SST_GPU_MATCH_TWO,
                                      SST_GPU_MATCH_FIRST | SST_GPU_MATCH_FEATURES,
                                      SST_GPU_MATCH_LAST | SST_GPU_MATCH_MASKS | SST_GPU_MATCH_FEATURES |
                                          SST_GPU_MATCH_ALONE };
    struct test *t = calloc(1, sizeof(*t));
    uint32_t state = 9;
    int err = t ? 0 : -ENOMEM;

    if (!err)
        set_test(t);
    for (size_t i = 0; i < ARRAY_LEN(flags) && !err; i++) {
        for (size_t k = 0; k < TEST_CELLS; k++) /* of features, and of what no shader wrote yet */
            t->cost[k] = (uint8_t)(gpu_random(&state) % (SST_FEATURE_COST_MAX + 1));
        for (size_t k = 0; k < TEST_PIXELS; k++) /* another neighbour */
            t->other_census[i % TEST_OTHERS][k] ^= (uint64_t)k << (7 * i);
        err = run_neighbour(g, t, flags[i]);
    }
    free(t);
    return err;
}
