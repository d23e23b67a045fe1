/* The shaders `label_grid` and `label_input`: their references and self-tests. */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/gpu/gpu_internal.h"
#include "pipeline/gpu/label.h"
#include "pipeline/image/classes.h"
#include "pipeline/kernels/class_prob.h"

_Static_assert(sizeof(struct sst_gpu_label_grid) == 60, "the layout of label_grid.comp");
_Static_assert(sizeof(struct sst_gpu_label_input) == 72, "the layout of label_input.comp");

#define MOST_CHANNELS 256

static void find_probabilities(float *cell, const struct sst_gpu_label_grid *p, const float *from, uint32_t *table,
                               size_t i)
{
    const size_t plane = (size_t)p->grid_width * (size_t)p->grid_height;
    float value[MOST_CHANNELS];
    uint32_t winner = 0;

    for (int c = 0; c < p->channels; c++)
        value[c] = from[p->from + (size_t)c * plane + i];
    memset(cell, 0, (size_t)p->classes * sizeof(*cell));
    if (!sst_class_probabilities(value, p->channels, p->is_probability, p->per_temperature)) {
        memset(value, 0, sizeof(value));
        table[p->invalid] = 1;
    }
    for (int c = 0; c < p->channels; c++)
        cell[table[p->class_of + (size_t)c]] += value[c];
    for (uint32_t c = 1; c < (uint32_t)p->classes; c++)
        winner = cell[c] > cell[winner] ? c : winner;
    winner++;
    cell[p->classes] = 1;
    memcpy(&cell[p->classes + 4], &winner, sizeof(winner));
}

static float float_of(uint32_t bits)
{
    float value;

    memcpy(&value, &bits, sizeof(value));
    return value;
}

/* @param colours  of the view, in rows of `width` @param tx, ty  of the tables @param channel  0: R */
static float mean_of(const uint32_t *colours, size_t width, const uint32_t *tx, const uint32_t *ty, uint32_t channel)
{
    float sum = 0;

    for (uint32_t i = 0; i < tx[1]; i++) {
        float column = 0;

        for (uint32_t k = 0; k < ty[1]; k++) {
            const uint32_t pixel = colours[(size_t)(ty[0] + k) * width + tx[0] + i];

            column += float_of(ty[2 + k]) * (float)(uint8_t)(pixel >> 8 * channel);
        }
        sum += float_of(tx[2 + i]) * column;
    }
    return sum;
}

void label_grid_reference(const void *push, void *const *buffer, const uint32_t groups[3] SST_UNUSED)
{
    const struct sst_gpu_label_grid *p = push;
    const uint32_t *view = buffer[SST_GPU_LABEL_GRID_VIEW];
    uint32_t *table = buffer[SST_GPU_LABEL_GRID_TABLES];
    float *cells = buffer[SST_GPU_LABEL_GRID_CELLS];
    const size_t grid_width = (size_t)p->grid_width, n = grid_width * (size_t)p->grid_height;

    for (size_t i = 0; i < n; i++) {
        const uint32_t *tx = table + p->across + i % grid_width * p->across_words;
        const uint32_t *ty = table + p->down + i / grid_width * p->down_words;
        float *cell = cells + i * (size_t)(p->classes + 5);

        find_probabilities(cell, p, buffer[SST_GPU_LABEL_GRID_FROM], table, i);
        for (uint32_t c = 0; c < 3; c++)
            cell[(uint32_t)p->classes + 1 + c] =
                mean_of(view + (size_t)p->width * (size_t)p->height, (size_t)p->width, tx, ty, c);
    }
}

void label_input_reference(const void *push, void *const *buffer, const uint32_t groups[3] SST_UNUSED)
{
    const struct sst_gpu_label_input *p = push;
    const uint32_t *colours = (const uint32_t *)buffer[SST_GPU_LABEL_INPUT_VIEW] + (size_t)p->width * (size_t)p->height;
    const uint32_t *table = buffer[SST_GPU_LABEL_INPUT_TABLES];
    const size_t in_width = (size_t)p->in_width, n = in_width * (size_t)p->in_height;
    float *to = (float *)buffer[SST_GPU_LABEL_INPUT_TO] + p->to;

    for (size_t i = 0; i < n; i++) {
        const uint32_t *tx = table + p->across + i % in_width * p->across_words;
        const uint32_t *ty = table + p->down + i / in_width * p->down_words;

        for (size_t c = 0; c < 3; c++)
            to[c * n + i] = mean_of(colours, (size_t)p->width, tx, ty, p->channel[c]) * p->scale[c] - p->shift[c];
    }
}

#define TEST_WIDTH    43
#define TEST_HEIGHT   21
#define TEST_PIXELS   (TEST_WIDTH * TEST_HEIGHT)
#define TEST_ACROSS   11
#define TEST_DOWN     7
#define TEST_CELLS    (TEST_ACROSS * TEST_DOWN)
#define TEST_CHANNELS 13
#define TEST_CLASSES  9
#define TEST_TAPS     5
#define TEST_FROM     3

struct test {
    uint32_t view[2][TEST_PIXELS];
    struct {
        uint32_t tap[TEST_ACROSS + TEST_DOWN][2 + TEST_TAPS], class_of[TEST_CHANNELS], invalid;
    } table;
    float from[TEST_FROM + TEST_CHANNELS * TEST_CELLS], cell[TEST_CELLS][TEST_CLASSES + 5];
};

static void make_taps(uint32_t (*tap)[2 + TEST_TAPS], int n, int pixels, uint32_t *state)
{
    for (int i = 0; i < n; i++) {
        tap[i][1] = 1 + gpu_random(state) % TEST_TAPS;
        tap[i][0] = gpu_random(state) % ((uint32_t)pixels - tap[i][1] + 1);
        for (int k = 0; k < TEST_TAPS; k++) {
            const float weight = (float)(1 + gpu_random(state) % 4000) / 13000;

            memcpy(&tap[i][2 + k], &weight, sizeof(weight));
        }
    }
}

/* Colours of a view, and weights of its pixels. */
static void make_view(struct test *t, uint32_t *state)
{
    for (int i = 0; i < TEST_PIXELS; i++)
        t->view[SST_GPU_PLANE_COLOURS][i] = gpu_random(state) << 8 ^ gpu_random(state);
    make_taps(t->table.tap, TEST_ACROSS, TEST_WIDTH, state);
    make_taps(t->table.tap + TEST_ACROSS, TEST_DOWN, TEST_HEIGHT, state);
}

/* Logits from sure to doubtful ones, or probabilities of which some are 0 and some below those that count. */
static void make_result(struct test *t, bool is_probability, uint32_t *state)
{
    for (int i = 0; i < TEST_CHANNELS * TEST_CELLS; i++) {
        const float value = (float)(gpu_random(state) % 20000) / (float)(1 << gpu_random(state) % 12);
        const int kind = i % 17;

        t->from[TEST_FROM + i] = !is_probability ? value / 100 - 40
                                 : kind == 0     ? 0
                                 : kind == 1     ? value * 1e-36F
                                                 : value;
    }
}

static int test_result(struct sst_gpu *g, struct test *t, bool is_probability, float per_temperature)
{
    const struct sst_gpu_label_grid push = { .width = TEST_WIDTH,
                                             .height = TEST_HEIGHT,
                                             .grid_width = TEST_ACROSS,
                                             .grid_height = TEST_DOWN,
                                             .channels = TEST_CHANNELS,
                                             .classes = TEST_CLASSES,
                                             .from = TEST_FROM,
                                             .across_words = 2 + TEST_TAPS,
                                             .down = TEST_ACROSS * (2 + TEST_TAPS),
                                             .down_words = 2 + TEST_TAPS,
                                             .class_of = sizeof(t->table.tap) / sizeof(uint32_t),
                                             .invalid = sizeof(t->table.tap) / sizeof(uint32_t) + TEST_CHANNELS,
                                             .is_probability = is_probability,
                                             .per_temperature = per_temperature };
    const struct sst_gpu_work work = { .shader = SST_GPU_LABEL_GRID,
                                       .push = &push,
                                       .groups = { gpu_groups(TEST_ACROSS, 32), gpu_groups(TEST_DOWN, 8), 1 } };
    const void *const initial[] = { t->view, &t->table, t->from, t->cell };
    const size_t bytes[] = { sizeof(t->view), sizeof(t->table), sizeof(t->from), sizeof(t->cell) };

    return gpu_compare(g, &work, initial, bytes, SST_GPU_LABEL_GRID_CELLS, NULL);
}

int label_grid_self_test(struct sst_gpu *g)
{
    struct test *t = calloc(1, sizeof(*t));
    uint32_t state = 5;
    int err = 0;

    if (!t)
        return -ENOMEM;
    make_view(t, &state);
    for (uint32_t i = 0; i < TEST_CHANNELS; i++)
        t->table.class_of[i] = i * 5 % TEST_CLASSES;
    for (int i = 0; i < 4 && !err; i++) {
        make_result(t, i == 3, &state);
        if (i == 2)
            t->from[TEST_FROM + 5 * TEST_CELLS + 9] = INFINITY; /* invalid */
        err = test_result(g, t, i == 3, i ? 0.37F : 1.0F);
    }
    free(t);
    return err;
}

int label_input_self_test(struct sst_gpu *g)
{
    struct test *t = calloc(1, sizeof(*t));
    const struct sst_gpu_label_input push = { .width = TEST_WIDTH,
                                              .height = TEST_HEIGHT,
                                              .in_width = TEST_ACROSS,
                                              .in_height = TEST_DOWN,
                                              .to = TEST_FROM,
                                              .across_words = 2 + TEST_TAPS,
                                              .down = TEST_ACROSS * (2 + TEST_TAPS),
                                              .down_words = 2 + TEST_TAPS,
                                              .channel = { 2, 1, 0 },
                                              .scale = { 1 / 57.375F, 1 / 57.12F, 1 / 58.395F },
                                              .shift = { 1.8044F, 2.0357F, 2.1179F } };
    const struct sst_gpu_work work = { .shader = SST_GPU_LABEL_INPUT,
                                       .push = &push,
                                       .groups = { gpu_groups(TEST_ACROSS, 32), gpu_groups(TEST_DOWN, 8), 1 } };
    uint32_t state = 5;
    int err;

    if (!t)
        return -ENOMEM;
    make_view(t, &state);
    err = gpu_compare(g, &work, (const void *const[]){ t->view, &t->table, t->from },
                      (const size_t[]){ sizeof(t->view), sizeof(t->table), sizeof(t->from) }, SST_GPU_LABEL_INPUT_TO,
                      NULL);
    free(t);
    return err;
}
