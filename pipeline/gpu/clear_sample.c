/* The shader `clear_sample`: its reference and self-test. */
#include "pipeline/gpu/clear_sample.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/gpu/gpu_internal.h"
#include "pipeline/kernels/place_patch_ref.h"

_Static_assert(sizeof(struct sst_gpu_clear_sample) == 112 && sizeof(struct sst_gpu_clear_state) == 12 &&
                   sizeof(struct sst_place_patch) == 144,
               "the layout of clear_sample.comp");

/* --- reference ---------------------------------------------------------------------------------------------------- */

/* Colour at a position of the view, or a mark where it has no frame. @return false: there is none */
static bool sample(uint32_t *rgb, const struct sst_gpu_clear_sample *p, void *const *buffer, float x, float y)
{
    const int shift = p->frame.cell_shift, i = sst_min_int((int)x >> shift, p->frame.cells - 1);
    const int j = sst_min_int((int)y >> shift, p->cell_rows - 1);
    const struct sst_place_patch *patch =
        (const struct sst_place_patch *)buffer[SST_GPU_SAMPLE_PATCHES] + j * p->frame.cells + i;
    const int32_t most[2] = { 256 * (p->frame.raw_width - 1), 256 * (p->frame.raw_height - 1) };
    struct sst_gpu_rectify frame = p->frame;
    int32_t xy_q8[2];

    if (p->frame.flags & SST_GPU_SAMPLE_PLAIN) {
        *rgb = (uint32_t)SST_GPU_RAY_PLAIN << 24;
        return true;
    }
    if (!sst_place_patch_ref(xy_q8, patch, buffer[SST_GPU_SAMPLE_LIST], 1 << shift, x - (float)(i << shift),
                             y - (float)(j << shift), most))
        return false;
    frame.part_x = x - (float)(int)x;
    frame.part_y = y - (float)(int)y;
    *rgb = rectify_colour(&frame, buffer, xy_q8, (int)x, (int)y);
    return true;
}

/* A landed ray as its colour, if it sees the surface. */
static uint32_t take(const struct sst_gpu_clear_sample *p, void *const *buffer, struct sst_gpu_clear_state *s,
                     uint32_t ray, int x, int row)
{
    const int level = (int)(ray >> 1), whole = (int)s->level, up = (float)whole < s->level;
    const float at_x = (float)x - s->px * p->bx, at_y = (float)(p->top + row) - s->px * p->by;
    uint32_t rgb;

    if (!s->wanted || level < sst_max_int(whole + up - SST_CLEAR_TOLERANCE, 1) || level > whole + SST_CLEAR_TOLERANCE ||
        !(at_x >= 0) || !(at_y >= 0) || at_x > (float)(p->frame.width - 1) || at_y > (float)(p->frame.height - 1) ||
        !sample(&rgb, p, buffer, at_x, at_y))
        return 0;
    s->wanted -= ray & 1;
    return rgb | (uint32_t)(ray & 1 ? SST_GPU_RAY_FULL : SST_GPU_RAY_RIM) << 24;
}

void clear_sample_reference(const void *push, void *const *buffer, const uint32_t groups[3] SST_UNUSED)
{
    const struct sst_gpu_clear_sample *p = push;
    struct sst_gpu_clear_state *state = buffer[SST_GPU_SAMPLE_STATE];
    uint32_t *landed = buffer[SST_GPU_SAMPLE_LANDED];

    landed += (size_t)p->view * (size_t)p->rows * (size_t)p->frame.pitch;
    for (int row = 0; row < p->rows; row++) {
        for (int x = 0; x < p->frame.width; x++) {
            uint32_t *ray = landed + (size_t)row * (size_t)p->frame.pitch + (size_t)x;

            *ray = take(p, buffer, &state[(size_t)row * (size_t)p->frame.width + (size_t)x], *ray, x, row);
        }
    }
}

/* --- self-test ---------------------------------------------------------------------------------------------------- */

#define TEST_WIDTH      45
#define TEST_HEIGHT     19
#define TEST_PITCH      48
#define TEST_TOP        5 /* of a band of the picture */
#define TEST_ROWS       11
#define TEST_VIEWS      2
#define TEST_RAW_WIDTH  47
#define TEST_RAW_HEIGHT 23
#define TEST_SHIFT      4
#define TEST_CELLS      3
#define TEST_CELL_ROWS  2
#define TEST_CORNERS    (17 * 17)
#define TEST_TAPS       4
#define TEST_STEP       5 /* 32 pixels between nodes of light: 3 x 2 */
#define TEST_NODES      6
#define TEST_LEVEL      700

struct test {
    int32_t weight[SST_RESAMPLE_PHASES * TEST_TAPS];
    uint32_t frame[TEST_RAW_WIDTH * TEST_RAW_HEIGHT];
    struct sst_place_patch patches[TEST_CELL_ROWS * TEST_CELLS];
    int32_t list[TEST_CORNERS][2];
    float light[SST_GPU_RECTIFY_LIGHT_FLOATS + 2 * (size_t)TEST_NODES];
    struct sst_gpu_clear_state state[TEST_ROWS * TEST_WIDTH];
    uint32_t landed[TEST_VIEWS * TEST_ROWS * TEST_PITCH];
};

/* Bicubics that leave the frame on all sides, one piece of a list, one without places. */
static void fill_places(struct test *t, uint32_t *state)
{
    for (int cell = 0; cell < TEST_CELL_ROWS * TEST_CELLS; cell++) {
        struct sst_place_patch *p = &t->patches[cell];

        p->whole_q8[0] = 256 * (16 * (cell % TEST_CELLS) - 1);
        p->whole_q8[1] = 256 * (16 * (cell / TEST_CELLS) + 1);
        for (int i = 0; i < 32; i++) {
            const int axis = i / 16, across = i / 4 % 4, down = i % 4;

            p->c[axis][across][down] = ldexpf((float)(gpu_random(state) % 4096), -4 - 6 * (across + down));
        }
        p->c[0][1][0] += 240;
        p->c[1][0][1] += 270;
    }
    t->patches[1].kind = SST_PLACES_LISTED;
    t->patches[1].whole_q8[0] = 0;
    t->patches[5].kind = SST_PLACES_NONE;
    for (int i = 0; i < TEST_CORNERS; i++) {
        t->list[i][0] = 4096 * (16 + i % 17) + (int32_t)(gpu_random(state) % 2048);
        t->list[i][1] = 4096 * (i / 17) - (int32_t)(gpu_random(state) % 2048);
        if (i % 61 == 60)
            t->list[i][0] = t->list[i][1] = INT32_MIN;
    }
}

static void fill_test(struct test *t)
{
    uint32_t state = 21;

    for (int i = 0; i < SST_RESAMPLE_PHASES; i++) {
        int32_t *w = t->weight + i * TEST_TAPS, left = 1 << 14;

        for (int k = 1; k < TEST_TAPS; k++) {
            w[k] = (int32_t)(gpu_random(&state) % 4096) - 1024;
            left -= w[k];
        }
        w[0] = left;
    }
    for (int i = 0; i < TEST_RAW_WIDTH * TEST_RAW_HEIGHT; i++)
        t->frame[i] = gpu_random(&state);
    fill_places(t, &state);
    sst_gpu_rectify_light(t->light);
    for (int i = 0; i < 2 * TEST_NODES; i++)
        t->light[SST_GPU_RECTIFY_LIGHT_FLOATS + (size_t)i] = (float)(gpu_random(&state) % 1024) / 1024 + 0.5f;
    for (int i = 0; i < TEST_ROWS * TEST_WIDTH; i++) {
        const float level = (float)(TEST_LEVEL * 7 + (int)(gpu_random(&state) % 200)) / 7;

        t->state[i] = (struct sst_gpu_clear_state){ level, (level - 1) / 64 - 3.125f, gpu_random(&state) % 3 };
    }
    for (int i = 0; i < TEST_VIEWS * TEST_ROWS * TEST_PITCH; i++)
        t->landed[i] = i % 11 ? 2 * (TEST_LEVEL - 60 + gpu_random(&state) % 140) + i % 2 : 0;
}

int clear_sample_self_test(struct sst_gpu *g)
{
    struct test *t = calloc(1, sizeof(*t));
    int err = t ? 0 : -ENOMEM;

    for (uint32_t i = 0; i < 3 && !err; i++) {
        const uint32_t lit = i == 1;
        const struct sst_gpu_clear_sample push = {
            .frame = { .width = TEST_WIDTH,
                       .height = TEST_HEIGHT,
                       .pitch = TEST_PITCH,
                       .raw_width = TEST_RAW_WIDTH,
                       .raw_height = TEST_RAW_HEIGHT,
                       .taps = TEST_TAPS,
                       .cell_shift = TEST_SHIFT,
                       .cells = TEST_CELLS,
                       .flags = lit ? SST_GPU_RECTIFY_LIT
                                : i ? SST_GPU_SAMPLE_PLAIN
                                    : 0U,
                       .light_shift = TEST_STEP,
                       .light_cols = 3,
                       .light_rows = 2,
                       .gain = { 1.25F, 1, 0.75F },
                       .gain_root = { 1.1F, 1, 0.9F } },
            .bx = i ? -0.31F : 0,
            .by = i ? 0.43F : 0,
            .top = TEST_TOP,
            .rows = TEST_ROWS,
            .cell_rows = TEST_CELL_ROWS,
            .view = lit,
        };
        const struct sst_gpu_work work = { .shader = SST_GPU_CLEAR_SAMPLE,
                                           .push = &push,
                                           .groups = { gpu_groups(TEST_WIDTH, SST_GPU_CLEAR_GROUP_WIDTH),
                                                       gpu_groups(TEST_ROWS, SST_GPU_CLEAR_GROUP_HEIGHT), 1 } };
        const void *const initial[] = { t->weight, t->frame, t->patches, t->list, t->light, t->state, t->landed };
        const size_t bytes[] = { sizeof(t->weight), sizeof(t->frame), sizeof(t->patches), sizeof(t->list),
                                 sizeof(t->light),  sizeof(t->state), sizeof(t->landed) };

        fill_test(t);
        err = gpu_compare(g, &work, initial, bytes, 0, NULL);
    }
    free(t);
    return err;
}
