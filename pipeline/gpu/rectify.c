/* The shader `rectify`: its reference and self-test. */
#include "pipeline/gpu/rectify.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/gpu/gpu_internal.h"
#include "pipeline/kernels/light_code.h"

#define MAX_TAPS 6

void sst_gpu_rectify_light(float *out)
{
    for (int i = 0; i <= SST_LIGHT_WHITE; i++)
        sst_light_parts((float)i * (1.0f / (1 << SST_LIGHT_SHIFT)), &out[i], &out[SST_LIGHT_WHITE + 1 + i]);
}

/* --- reference ---------------------------------------------------------------------------------------------------- */

/* @return false: it has no place */
static bool place_of(int32_t xy_q8[2], const struct sst_gpu_rectify *p, void *const *buffer, int x, int y)
{
    const int cell = sst_min_int(x >> p->cell_shift, p->cells - 1), column = x - (cell << p->cell_shift);
    const struct sst_places *places = (const struct sst_places *)buffer[SST_GPU_RECTIFY_PLACES] + y * p->cells + cell;
    const int32_t *list = buffer[SST_GPU_RECTIFY_LIST];

    if (places->most[0] >= 0)
        sst_place_row_ref(xy_q8, places, p->part_x + (float)column, 1);
    else if (places->most[0] == SST_PLACES_LISTED)
        memcpy(xy_q8, list + 2 * (size_t)(places->whole_q8[0] + column), 2 * sizeof(*xy_q8));
    else
        return false;
    return xy_q8[0] != INT32_MIN;
}

/* Samples of one position, from a patch of the frame that ends at its border. */
static void sample_at(uint16_t out[3], const struct sst_gpu_rectify *p, void *const *buffer, const int32_t xy_q8[2])
{
    const uint32_t *frame = buffer[SST_GPU_RECTIFY_FRAME];
    const int32_t *weight = buffer[SST_GPU_RECTIFY_WEIGHTS];
    const int before = p->taps / 2 - 1;
    const int32_t at[2] = { before << 8 | (xy_q8[0] & 255), before << 8 | (xy_q8[1] & 255) };
    int16_t narrow[SST_RESAMPLE_PHASES * MAX_TAPS];
    uint32_t patch[MAX_TAPS][MAX_TAPS];
    const struct sst_resample from = {
        .pixel = (const uint8_t *)patch, .stride = sizeof(patch[0]), .weight = narrow, .taps = p->taps
    };

    for (int axis = 0; axis < 2; axis++) {
        for (int i = (at[axis] & 255) * p->taps, n = i + p->taps; i < n; i++)
            narrow[i] = (int16_t)weight[i];
    }
    for (int j = 0; j < p->taps; j++) {
        const int y = sst_clamp_int((xy_q8[1] >> 8) - before + j, 0, p->raw_height - 1);

        for (int i = 0; i < p->taps; i++)
            patch[j][i] = frame[y * p->raw_width + sst_clamp_int((xy_q8[0] >> 8) - before + i, 0, p->raw_width - 1)];
    }
    sst_resample_row_ref((uint16_t *const[3]){ &out[0], &out[1], &out[2] }, &from, at, 1);
}

/* Bilinear between nodes, in the order of operations of the CPU. */
static float factor_at(const struct sst_gpu_rectify *p, const float *grid, int x, int y)
{
    const float width = (float)(1 << p->light_shift);
    const int row = sst_min_int(y >> p->light_shift, p->light_rows - 2);
    const int col = sst_min_int(x >> p->light_shift, p->light_cols - 2);
    const float *node = grid + row * p->light_cols + col;
    const float down = ((float)(y - (row << p->light_shift)) + p->part_y) / width;
    const float left = node[0] + down * (node[p->light_cols] - node[0]);
    const float right = node[1] + down * (node[p->light_cols + 1] - node[1]), slope = (right - left) / width;

    return left + slope * (p->part_x + (float)(x - (col << p->light_shift)));
}

static uint32_t finish(const struct sst_gpu_rectify *p, void *const *buffer, const uint16_t sample[3], int x, int y)
{
    const float *grid = (const float *)buffer[SST_GPU_RECTIFY_LIGHT] + SST_GPU_RECTIFY_LIGHT_FLOATS;
    const bool lit = p->flags & SST_GPU_RECTIFY_LIT;
    const float falloff = lit ? factor_at(p, grid, x, y) : 1;
    const float root = lit ? factor_at(p, grid + p->light_cols * p->light_rows, x, y) : 1;
    uint32_t rgb = 0;

    for (int c = 0; c < 3; c++) {
        const struct sst_light light = { &sample[c], &falloff, &root, p->gain[c], p->gain_root[c] };
        uint8_t byte = (uint8_t)((sample[c] + (1 << (SST_LIGHT_SHIFT - 1))) >> SST_LIGHT_SHIFT);

        if (lit)
            sst_light_row_ref(&byte, &light, 1);
        rgb |= (uint32_t)byte << (8 * c);
    }
    return rgb;
}

uint32_t rectify_colour(const struct sst_gpu_rectify *p, void *const *buffer, const int32_t xy_q8[2], int x, int y)
{
    uint16_t sample[3];

    sample_at(sample, p, buffer, xy_q8);
    return finish(p, buffer, sample, x, y);
}

void rectify_reference(const void *push, void *const *buffer, const uint32_t groups[3])
{
    const struct sst_gpu_rectify *p = push;
    const int end = sst_min_int(p->top + (int)groups[1] * SST_GPU_RECTIFY_GROUP_HEIGHT, p->height);
    const uint8_t *labels = buffer[SST_GPU_RECTIFY_LABELS];
    uint8_t *valid = (uint8_t *)buffer[SST_GPU_RECTIFY_VALID] + p->first;
    uint32_t *pixel = (uint32_t *)buffer[SST_GPU_RECTIFY_PIXELS] + p->first;

    for (int y = p->top; y < end; y++) {
        for (int x = 0; x < (p->width + 3) / 4 * 4; x++) {
            const size_t at = (size_t)y * (size_t)p->pitch + (size_t)x;
            const uint32_t label = p->flags & SST_GPU_RECTIFY_LABELLED ? (uint32_t)labels[at] << 24 : 0;
            int32_t xy_q8[2];
            const bool inside = x < p->width, seen = inside && place_of(xy_q8, p, buffer, x, y);

            valid[at] = seen ? 255 : 0;
            if (inside)
                pixel[at] = (seen ? rectify_colour(p, buffer, xy_q8, x, y) : 0) |
                            (p->flags & SST_GPU_RECTIFY_KEEP ? pixel[at] & 0xFF000000U : label);
        }
    }
}

/* --- self-test ---------------------------------------------------------------------------------------------------- */

#define TEST_WIDTH      53
#define TEST_HEIGHT     19
#define TEST_PITCH      56
#define TEST_RAW_WIDTH  47
#define TEST_RAW_HEIGHT 23
#define TEST_SHIFT      4
#define TEST_CELLS      4
#define TEST_LISTED     16
#define TEST_STEP       5 /* 32 pixels between nodes: 3 x 2 */
#define TEST_NODES      6
#define TEST_FIRST      24
#define TEST_BYTES      (TEST_FIRST + TEST_PITCH * TEST_HEIGHT)

struct test {
    int32_t weight[SST_RESAMPLE_PHASES * MAX_TAPS];
    uint32_t frame[TEST_RAW_WIDTH * TEST_RAW_HEIGHT];
    struct sst_places places[TEST_HEIGHT][TEST_CELLS];
    int32_t list[TEST_HEIGHT][TEST_LISTED][2];
    float light[SST_GPU_RECTIFY_LIGHT_FLOATS + 2 * (size_t)TEST_NODES];
    uint8_t labels[TEST_PITCH * TEST_HEIGHT], valid[TEST_BYTES];
    uint32_t pixel[TEST_BYTES];
};

/* Cubics that leave the frame on all sides, with every phase. */
static struct sst_places test_places(uint32_t *state, int y, int cell)
{
    struct sst_places places = { { 256 * (16 * cell - 3), 256 * (y + 1) },
                                 { { 0 } },
                                 { 256 * (TEST_RAW_WIDTH - 1), 256 * (TEST_RAW_HEIGHT - 1) } };

    for (int axis = 0; axis < 2; axis++) {
        places.c[axis][0] = (float)(gpu_random(state) % 4096) / 16;
        places.c[axis][1] = (float)(gpu_random(state) % 512) / 16 + (axis ? -16.0f : 240.0f);
        places.c[axis][2] = (float)(gpu_random(state) % 4096) / 65536 - 1.0f / 32;
        places.c[axis][3] = (float)(gpu_random(state) % 4096) / 1048576 - 1.0f / 512;
    }
    return places;
}

static void fill_test(struct test *t, int taps)
{
    uint32_t state = 7;

    memset(t, 0, sizeof(*t));
    for (int i = 0; i < SST_RESAMPLE_PHASES; i++) {
        int32_t *w = t->weight + i * taps, left = 1 << 14;

        for (int k = 0; k < taps; k++) {
            w[k] = k == taps / 2 ? 0 : (int32_t)(gpu_random(&state) % 4096) - 1024;
            left -= w[k];
        }
        w[taps / 2] = left;
    }
    for (int i = 0; i < TEST_RAW_WIDTH * TEST_RAW_HEIGHT; i++)
        t->frame[i] = gpu_random(&state) | (i % 5 ? 0 : 0xFFFFFFU);
    for (int y = 0; y < TEST_HEIGHT; y++) {
        for (int cell = 0; cell < TEST_CELLS; cell++)
            t->places[y][cell] = test_places(&state, y, cell);
        t->places[y][1].most[0] = SST_PLACES_LISTED;
        t->places[y][1].whole_q8[0] = y * TEST_LISTED;
        for (int i = 0; i < TEST_LISTED; i++) {
            t->list[y][i][0] = i == 3 ? INT32_MIN : (int32_t)(gpu_random(&state) % (256 * (TEST_RAW_WIDTH - 1)));
            t->list[y][i][1] = i == 3 ? INT32_MIN : (int32_t)(gpu_random(&state) % (256 * (TEST_RAW_HEIGHT - 1)));
        }
        if (y % 4 == 3)
            t->places[y][2].most[0] = SST_PLACES_NONE;
    }
    sst_gpu_rectify_light(t->light);
    for (int i = 0; i < TEST_NODES; i++) {
        t->light[SST_GPU_RECTIFY_LIGHT_FLOATS + (size_t)i] = (float)(gpu_random(&state) % 4096) / 1024 + 0.2f;
        t->light[SST_GPU_RECTIFY_LIGHT_FLOATS + TEST_NODES + (size_t)i] =
            (float)(gpu_random(&state) % 1024) / 1024 + 0.5f;
    }
    for (size_t i = 0; i < sizeof(t->labels); i++)
        t->labels[i] = (uint8_t)gpu_random(&state);
    for (size_t i = 0; i < TEST_BYTES; i++)
        t->pixel[i] = gpu_random(&state) << 8;
}

int rectify_self_test(struct sst_gpu *g)
{
    static const struct {
        int taps;
        uint32_t flags;
        float part;
    } cases[] = {
        { 2, 0, 0 },
        { 4, SST_GPU_RECTIFY_LIT | SST_GPU_RECTIFY_LABELLED, 0 },
        { 6, SST_GPU_RECTIFY_LIT | SST_GPU_RECTIFY_KEEP, 0.3F },
    };
    struct test *t = malloc(sizeof(*t));
    int err = t ? 0 : -ENOMEM;

    for (size_t i = 0; i < ARRAY_LEN(cases) && !err; i++) {
        const struct sst_gpu_rectify push = {
            .width = TEST_WIDTH,
            .height = TEST_HEIGHT,
            .pitch = TEST_PITCH,
            .raw_width = TEST_RAW_WIDTH,
            .raw_height = TEST_RAW_HEIGHT,
            .taps = cases[i].taps,
            .cell_shift = TEST_SHIFT,
            .cells = TEST_CELLS,
            .first = TEST_FIRST,
            .flags = cases[i].flags,
            .light_shift = TEST_STEP,
            .light_cols = 3,
            .light_rows = 2,
            .part_x = cases[i].part,
            .part_y = cases[i].part,
            .gain = { 1.25F, 1, 0.75F },
            .gain_root = { 1.1F, 1, 0.9F },
            .top = i == 1 ? 5 : 0,
        };
        const struct sst_gpu_work work = {
            .shader = SST_GPU_RECTIFY,
            .push = &push,
            .groups = { gpu_groups(TEST_WIDTH, SST_GPU_RECTIFY_GROUP_WIDTH),
                        gpu_groups(TEST_HEIGHT, SST_GPU_RECTIFY_GROUP_HEIGHT), 1 },
        };
        const void *const initial[] = {
            t->weight, t->frame, t->places, t->list, t->light, t->labels, t->valid, t->pixel
        };
        const size_t bytes[] = { sizeof(t->weight), sizeof(t->frame),  sizeof(t->places), sizeof(t->list),
                                 sizeof(t->light),  sizeof(t->labels), sizeof(t->valid),  sizeof(t->pixel) };

        fill_test(t, cases[i].taps);
        err = gpu_compare(g, &work, initial, bytes, 0, NULL);
    }
    free(t);
    return err;
}
