/* The shader `label_cells`: its reference and self-test. */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/gpu/gpu_internal.h"
#include "pipeline/gpu/label.h"
#include "pipeline/image/classes.h"
#include "pipeline/kernels/kernels.h"

/* Cells around a pixel. @param across  out, of the guide @return their winner, if it is the same one, else 0 */
static uint32_t find_cells(struct sst_guide *g, float across[SST_GUIDE_CELLS], const struct sst_gpu_label_cells *p,
                           const float *cells, const struct sst_gpu_label_place *px,
                           const struct sst_gpu_label_place *py)
{
    uint32_t single = 0;

    for (int k = 0; k < SST_GUIDE_CELLS; k++) {
        const int x = sst_clamp_int((int)px->first - 1 + k % 4, 0, p->grid_width - 1);
        const int y = sst_clamp_int((int)py->first - 1 + k / 4, 0, p->grid_height - 1);
        const float *cell = cells + (size_t)(y * p->grid_width + x) * (size_t)(p->classes + 5);
        uint32_t winner;

        memcpy(&winner, &cell[p->classes + 4], sizeof(winner));
        g->cell[k] = cell;
        for (int c = 0; c < 3; c++)
            g->colour[c][k] = cell[p->classes + 1 + c];
        across[k] = px->weight[k % 4];
        g->down[k] = py->weight[k / 4];
        single = k == 0 || single == winner ? winner : 0;
    }
    return single;
}

void label_cells_reference(const void *push, void *const *buffer, const uint32_t groups[3] SST_UNUSED)
{
    const struct sst_gpu_label_cells *p = push;
    const int n = p->width * p->height;
    const uint32_t *colours = (const uint32_t *)buffer[SST_GPU_LABEL_CELLS_VIEW] + n;
    const struct sst_gpu_label_place *places = buffer[SST_GPU_LABEL_CELLS_PLACES];
    uint32_t *out = buffer[SST_GPU_LABEL_CELLS_OUT];
    float across[SST_GUIDE_CELLS], prob[SST_MAX_CLASSES + 1], entropy;
    struct sst_guide g = { .cells = SST_GUIDE_CELLS, .values = (size_t)p->classes + 1, .across = across };

    for (int i = 0; i < n; i++) {
        const uint8_t rgb[3] = { (uint8_t)colours[i], (uint8_t)(colours[i] >> 8), (uint8_t)(colours[i] >> 16) };
        const uint32_t single = find_cells(&g, across, p, buffer[SST_GPU_LABEL_CELLS_CELLS], &places[i % p->width],
                                           &places[p->width + i / p->width]);
        uint8_t top;
        float scale;

        for (int c = 0; c < 3; c++)
            g.pixel[c] = &rgb[c];
        sst_guide_cells_ref(prob, &g, 1);
        scale = 1 / prob[p->classes];
        for (int c = 0; c < p->classes; c++)
            prob[c] *= scale;
        sst_class_row_ref(&top, &entropy, prob, 1, (size_t)p->classes, 1);
        out[i] = entropy < p->limit || p->entropies ? (single ? single : top + 1U) : 0;
        if (p->entropies)
            memcpy(&out[n + i], &entropy, sizeof(entropy));
    }
}

#define TEST_WIDTH   43
#define TEST_HEIGHT  21
#define TEST_PIXELS  (TEST_WIDTH * TEST_HEIGHT)
#define TEST_GRID    9 /* columns; 5 rows */
#define TEST_CELLS   45
#define TEST_CLASSES 11
#define TEST_VALUES  (TEST_CLASSES + 5)

struct test {
    uint32_t view[2][TEST_PIXELS], out[2][TEST_PIXELS];
    float cell[TEST_CELLS][TEST_VALUES];
    struct sst_gpu_label_place place[TEST_WIDTH + TEST_HEIGHT];
};

/* Cells from sure of one class to doubtful. */
static void make_cells(struct test *t, uint32_t *state)
{
    for (int i = 0; i < TEST_CELLS; i++) {
        const uint32_t best = i % TEST_GRID < 5 ? 3 : gpu_random(state) % TEST_CLASSES, winner = best + 1;
        const float doubt = (float)(gpu_random(state) % 1000) / (float)(1 << gpu_random(state) % 24);
        float *cell = t->cell[i], sum = 0;

        for (uint32_t c = 0; c < TEST_CLASSES; c++) {
            cell[c] = c == best ? 1000 : doubt * (float)(gpu_random(state) % 1000) * 1e-3F;
            sum += cell[c];
        }
        for (int c = 0; c < TEST_CLASSES; c++)
            cell[c] /= sum;
        cell[TEST_CLASSES] = 1;
        for (int c = 1; c < 4; c++)
            cell[TEST_CLASSES + c] = (float)(gpu_random(state) % 4096) / 16;
        memcpy(&cell[TEST_CLASSES + 4], &winner, sizeof(winner));
    }
}

static struct test *make_test(void)
{
    struct test *t = calloc(1, sizeof(*t));
    uint32_t state = 11;

    if (!t)
        return NULL;
    make_cells(t, &state);
    for (int i = 0; i < TEST_PIXELS; i++)
        t->view[SST_GPU_PLANE_COLOURS][i] = gpu_random(&state) | 255U << 24;
    for (int i = 0; i < TEST_WIDTH + TEST_HEIGHT; i++) {
        t->place[i].first =
            (uint32_t)(i < TEST_WIDTH ? i * TEST_GRID / TEST_WIDTH : (i - TEST_WIDTH) * 5 / TEST_HEIGHT);
        for (int k = 0; k < 4; k++)
            t->place[i].weight[k] = (float)(1 + gpu_random(&state) % 4000) / 4000;
    }
    return t;
}

int label_cells_self_test(struct sst_gpu *g)
{
    struct sst_gpu_label_cells push = { TEST_WIDTH,   TEST_HEIGHT, TEST_GRID, TEST_CELLS / TEST_GRID,
                                        TEST_CLASSES, 0.4F,        0 };
    const struct sst_gpu_work work = { .shader = SST_GPU_LABEL_CELLS,
                                       .push = &push,
                                       .groups = { gpu_groups(TEST_WIDTH, 32), gpu_groups(TEST_HEIGHT, 8), 1 } };
    struct test *t = make_test();
    int err = t ? 0 : -ENOMEM;

    for (uint32_t entropies = 0; entropies < 2 && !err; entropies++) {
        push.entropies = entropies;
        err = gpu_compare(g, &work, (const void *const[]){ t->view, t->cell, t->place, t->out },
                          (const size_t[]){ sizeof(t->view), sizeof(t->cell), sizeof(t->place), sizeof(t->out) },
                          SST_GPU_LABEL_CELLS_OUT, NULL);
    }
    free(t);
    return err;
}
