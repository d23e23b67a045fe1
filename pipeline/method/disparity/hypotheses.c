/* Hypotheses of a view in the second pass (visible.c), and the semi-global optimisation over them along four paths. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/method/disparity/visible_internal.h"

#include <errno.h>
#include <string.h>

void hypothesis_lists_fini(struct hypothesis_lists *l)
{
    sst_mem_free(l->hypothesis);
    sst_mem_free(l->cost);
    sst_mem_free(l->sum);
    sst_mem_free(l->count);
    sst_mem_free(l->line[0]);
    sst_mem_free(l->line[1]);
    sst_mem_free(l->colour);
    *l = (struct hypothesis_lists){ 0 };
}

int hypothesis_lists_init(struct hypothesis_lists *l, int width, int height)
{
    const size_t pixels = (size_t)width * (size_t)height, row = (size_t)width * SST_HYPOTHESES;

    if (l->colour && l->width == width && l->height == height)
        return 0;
    hypothesis_lists_fini(l);
    l->width = width;
    l->height = height;
    l->hypothesis = sst_mem_alloc_raw(pixels, SST_HYPOTHESES * sizeof(uint16_t));
    l->cost = sst_mem_alloc_raw(pixels, SST_HYPOTHESES * sizeof(uint16_t));
    l->sum = sst_mem_alloc_raw(pixels, SST_HYPOTHESES * sizeof(uint16_t));
    l->count = sst_mem_alloc_raw(pixels, 1);
    l->line[0] = sst_mem_alloc_raw(row, sizeof(uint16_t));
    l->line[1] = sst_mem_alloc_raw(row, sizeof(uint16_t));
    if (l->hypothesis && l->cost && l->sum && l->count && l->line[0] && l->line[1])
        l->colour = sst_mem_alloc_raw((size_t)width, 1);
    return l->colour ? 0 : -ENOMEM;
}

/* Largest colour step between packed pixels of two rows. */
static void colour_steps(uint8_t *out, const uint32_t *a, const uint32_t *b, int n)
{
    for (int x = 0; x < n; x++) {
        int most = 0;

        for (int c = 0; c < 24; c += 8) {
            const int p = (int)(a[x] >> c & 255), q = (int)(b[x] >> c & 255), step = p > q ? p - q : q - p;

            most = step > most ? step : most;
        }
        out[x] = (uint8_t)most;
    }
}

/* A path starts with the pixels' costs. */
static void start_path(uint16_t *path, uint16_t *sum, const uint16_t *cost, size_t entries)
{
    for (size_t i = 0; i < entries; i++) {
        path[i] = cost[i];
        sum[i] = (uint16_t)(sum[i] + cost[i]);
    }
}

void hypothesis_paths_along(struct hypothesis_lists *l, const struct sst_hypothesis_penalty *penalty,
                            const struct sst_packed_view *view, int y)
{
    const size_t row = (size_t)l->width * SST_HYPOTHESES, at = (size_t)y * row, last = row - SST_HYPOTHESES;
    const uint16_t *cost = l->cost + at, *hypothesis = l->hypothesis + at;
    const uint32_t *pixels = view->pixels + y * view->stride;
    uint16_t *sum = l->sum + at, *path = l->line[0];
    const uint8_t *count = l->count + (size_t)y * (size_t)l->width;
    const size_t n = (size_t)l->width - 1;

    memset(sum, 0, row * sizeof(*sum));
    colour_steps(l->colour, pixels + 1, pixels, l->width - 1); /* between x and x + 1 */
    start_path(path, sum, cost, SST_HYPOTHESES);
    sst_kernels_get()->hypothesis_path_row(path + SST_HYPOTHESES, sum + SST_HYPOTHESES, cost + SST_HYPOTHESES,
                                           hypothesis + SST_HYPOTHESES, path, hypothesis, l->colour, count + 1, penalty,
                                           SST_HYPOTHESES, n);
    start_path(path + last, sum + last, cost + last, SST_HYPOTHESES);
    if (n)
        sst_kernels_get()->hypothesis_path_row(path + last - SST_HYPOTHESES, sum + last - SST_HYPOTHESES,
                                               cost + last - SST_HYPOTHESES, hypothesis + last - SST_HYPOTHESES,
                                               path + last, hypothesis + last, l->colour + n - 1, count + n - 1,
                                               penalty, -SST_HYPOTHESES, n);
}

void hypothesis_paths_down(struct hypothesis_lists *l, const struct sst_hypothesis_penalty *penalty,
                           const struct sst_packed_view *view, int dir)
{
    const size_t row = (size_t)l->width * SST_HYPOTHESES;

    for (int i = 0; i < l->height; i++) {
        const int y = dir > 0 ? i : l->height - 1 - i;
        const size_t at = (size_t)y * row, from = (size_t)(y - dir) * row;
        uint16_t *path = l->line[i % 2];

        if (!i) {
            start_path(path, l->sum + at, l->cost + at, row);
            continue;
        }
        colour_steps(l->colour, view->pixels + y * view->stride, view->pixels + (y - dir) * view->stride, l->width);
        sst_kernels_get()->hypothesis_path_row(
            path, l->sum + at, l->cost + at, l->hypothesis + at, l->line[(i + 1) % 2], l->hypothesis + from, l->colour,
            l->count + (size_t)y * (size_t)l->width, penalty, SST_HYPOTHESES, (size_t)l->width);
    }
}

void hypothesis_choose_row(const struct hypothesis_lists *l, int y, uint16_t *disp, uint8_t *confidence)
{
    for (int x = 0; x < l->width; x++) {
        const size_t pixel = (size_t)y * (size_t)l->width + (size_t)x;
        const uint16_t *sum = l->sum + pixel * SST_HYPOTHESES;
        int best = 0, next = 65535;

        if (l->count[pixel] < 2) {
            disp[x] = l->count[pixel] ? l->hypothesis[pixel * SST_HYPOTHESES] : (uint16_t)SST_DISP_NONE;
            continue;
        }
        for (int i = 1; i < l->count[pixel]; i++)
            best = sum[i] < sum[best] ? i : best;
        for (int i = 0; i < l->count[pixel]; i++)
            next = i != best && sum[i] < next ? sum[i] : next;
        disp[x] = l->hypothesis[pixel * SST_HYPOTHESES + (size_t)best];
        if (best)
            confidence[x] = (uint8_t)(255 * (next - sum[best]) / (next - sum[best] + 128));
    }
}
