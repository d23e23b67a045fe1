/* Hypotheses of a view in the second pass (visible.c), and the semi-global optimisation over them along four paths. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/method/disparity/visible_internal.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

void hypothesis_lists_fini(struct hypothesis_lists *l)
{
    sst_mem_free(l->count);
    sst_mem_free(l->first);
    sst_mem_free(l->start);
    sst_mem_free(l->column);
    sst_mem_free(l->hypothesis);
    sst_mem_free(l->cost);
    sst_mem_free(l->sum);
    sst_mem_free(l->line[0]);
    sst_mem_free(l->line[1]);
    *l = (struct hypothesis_lists){ 0 };
}

static int strips_of(const struct hypothesis_lists *l)
{
    return (l->width + HYPOTHESIS_STRIP - 1) / HYPOTHESIS_STRIP;
}

int hypothesis_lists_init(struct hypothesis_lists *l, int width, int height)
{
    const size_t pixels = (size_t)width * (size_t)height, strip = (size_t)(HYPOTHESIS_STRIP + 1) * SST_HYPOTHESES;

    if (l->line[1] && l->width == width && l->height == height)
        return 0;
    hypothesis_lists_fini(l);
    l->width = width;
    l->height = height;
    l->count = sst_mem_alloc_raw(pixels, 1);
    l->first = sst_mem_alloc_raw(pixels, sizeof(*l->first));
    l->start = sst_mem_alloc((size_t)strips_of(l) * (size_t)height + 1, sizeof(*l->start));
    l->column = sst_mem_alloc_raw(pixels, sizeof(*l->column));
    l->hypothesis = sst_mem_alloc_raw(pixels, SST_HYPOTHESES * sizeof(uint16_t));
    l->cost = sst_mem_alloc_raw(pixels, SST_HYPOTHESES * sizeof(uint16_t));
    l->sum = sst_mem_alloc_raw(pixels, SST_HYPOTHESES * sizeof(uint16_t));
    l->line[0] = sst_mem_alloc_raw(strip, sizeof(uint16_t));
    if (l->count && l->first && l->start && l->column && l->hypothesis && l->cost && l->sum && l->line[0])
        l->line[1] = sst_mem_alloc_raw(strip, sizeof(uint16_t));
    return l->line[1] ? 0 : -ENOMEM;
}

/* Pixels with a choice in a row of a strip. */
struct segment {
    int first, n;
};

static struct segment segment_at(const struct hypothesis_lists *l, int strip, int y)
{
    const int *start = l->start + (size_t)strip * (size_t)l->height + y;

    return (struct segment){ start[0], start[1] - start[0] };
}

void hypothesis_lists_add(struct hypothesis_lists *l, const struct hypothesis_part *part, unsigned settled)
{
    const size_t row = (size_t)part->y * (size_t)l->width + (size_t)part->left,
                 bytes = SST_HYPOTHESES * sizeof(uint16_t);
    int *start = l->start + (size_t)(part->left / HYPOTHESIS_STRIP) * (size_t)l->height + part->y;
    int end = start[0];

    for (int i = 0; i < part->n; i++) {
        const uint16_t *hypothesis = part->hypothesis + i * SST_HYPOTHESES, *cost = part->cost + i * SST_HYPOTHESES;
        const int count = part->count[i];
        const bool open = count > 1 && cost[0] >= settled;

        l->first[row + (size_t)i] = hypothesis[0];
        l->count[row + (size_t)i] = (uint8_t)(open ? count : count > 0);
        if (!open)
            continue;
        l->column[end] = (uint16_t)(part->left + i);
        memcpy(l->hypothesis + (size_t)end * SST_HYPOTHESES, hypothesis, bytes);
        memcpy(l->cost + (size_t)end * SST_HYPOTHESES, cost, bytes);
        memset(l->sum + (size_t)end * SST_HYPOTHESES, 0, bytes);
        end++;
    }
    start[1] = end;
}

/* Largest colour step between packed pixels. */
static uint8_t colour_step(uint32_t a, uint32_t b)
{
    int most = 0;

    for (int c = 0; c < 24; c += 8)
        most = sst_max_int(abs((int)(a >> c & 255) - (int)(b >> c & 255)), most);
    return (uint8_t)most;
}

static const uint16_t decided[SST_HYPOTHESES] = { 0,
                                                  SST_HYPOTHESIS_FAR,
                                                  SST_HYPOTHESIS_FAR,
                                                  SST_HYPOTHESIS_FAR,
                                                  SST_HYPOTHESIS_FAR,
                                                  SST_HYPOTHESIS_FAR,
                                                  SST_HYPOTHESIS_FAR,
                                                  SST_HYPOTHESIS_FAR };

/* A row of a strip on its path. Pixels come from (dx, dy) beside them. */
struct walk {
    struct hypothesis_lists *l;
    const struct sst_hypothesis_penalty *penalty;
    const struct sst_packed_view *view;
    int y, dx, dy;
    struct segment here, from; /* from: pixels with a choice in the row before; along a row in the strip before */
    uint16_t *path;            /* out [here.n] */
    const uint16_t *from_path; /* [from.n] */
};

/* The pixel before entry i. @param at  its entry in the row before, or -1 */
static struct sst_hypothesis_before before_of(const struct walk *w, int i, const uint16_t *path, int at)
{
    static const uint16_t start[SST_HYPOTHESES];
    const struct hypothesis_lists *l = w->l;
    const int entry = w->here.first + i, x = l->column[entry] + w->dx, y = w->y + w->dy;

    if (path)
        return (struct sst_hypothesis_before){ path, l->hypothesis + (size_t)at * SST_HYPOTHESES };
    if (x < 0 || x >= l->width || y < 0 || y >= l->height) /* the path starts with the pixel's costs */
        return (struct sst_hypothesis_before){ start, l->hypothesis + (size_t)entry * SST_HYPOTHESES };
    return (struct sst_hypothesis_before){ decided, l->first + (size_t)y * (size_t)l->width + x };
}

/* The path through the pixels of a row of a strip. */
static void walk_row(const struct walk *w, const struct sst_hypothesis_before *before)
{
    struct hypothesis_lists *l = w->l;
    const int last = w->here.n - 1, back = w->dx > 0 ? last : 0;
    const size_t entry = (size_t)(w->here.first + back) * SST_HYPOTHESES;
    uint8_t colour[HYPOTHESIS_STRIP];

    for (int i = 0; i <= last; i++) {
        const int x = l->column[w->here.first + i];
        const uint32_t *at = w->view->pixels + w->y * w->view->stride + x;

        colour[i] = colour_step(at[0], at[w->dy * w->view->stride + w->dx]);
    }
    sst_kernels_get()->hypothesis_path_row(&(struct sst_hypothesis_steps){ .path = w->path + back * SST_HYPOTHESES,
                                                                           .sum = l->sum + entry,
                                                                           .cost = l->cost + entry,
                                                                           .hypothesis = l->hypothesis + entry,
                                                                           .before = before + back,
                                                                           .colour = colour + back },
                                           w->penalty, w->dx > 0 ? -1 : 1, (size_t)w->here.n);
}

/* The last path of a strip, for the first pixel of the next one. */
static void walk_along(const struct walk *w)
{
    const struct hypothesis_lists *l = w->l;
    const uint16_t *column = l->column + w->here.first;
    struct sst_hypothesis_before before[HYPOTHESIS_STRIP];
    const int first = w->dx > 0 ? w->here.n - 1 : 0;

    for (int i = 0; i < w->here.n; i++) {
        const int next = i + w->dx;
        const bool inside = next >= 0 && next < w->here.n && column[next] == column[i] + w->dx;

        before[i] = before_of(w, i, inside ? w->path + next * SST_HYPOTHESES : NULL, w->here.first + next);
    }
    if (w->from.n) {
        const int end = w->dx > 0 ? w->from.first : w->from.first + w->from.n - 1;

        if (l->column[end] == column[first] + w->dx)
            before[first] = before_of(w, first, w->from_path, end);
    }
    walk_row(w, before);
}

void hypothesis_paths_along(struct hypothesis_lists *l, const struct sst_hypothesis_penalty *penalty,
                            const struct sst_packed_view *view, int y)
{
    const int strips = strips_of(l);

    for (int dx = -1; dx <= 1; dx += 2) {
        struct walk w = { .l = l, .penalty = penalty, .view = view, .y = y, .dx = dx };
        uint16_t last[SST_HYPOTHESES];

        w.path = l->line[0];
        w.from_path = last;
        for (int i = 0; i < strips; i++) {
            w.here = segment_at(l, dx < 0 ? i : strips - 1 - i, y);
            if (w.here.n)
                walk_along(&w);
            w.from = w.here;
            if (w.here.n)
                memcpy(last, w.path + (dx < 0 ? w.here.n - 1 : 0) * SST_HYPOTHESES, sizeof(last));
        }
    }
}

/* A row of a strip from the row before. */
static void walk_down(const struct walk *w)
{
    const struct hypothesis_lists *l = w->l;
    struct sst_hypothesis_before before[HYPOTHESIS_STRIP];

    for (int i = 0, k = 0; i < w->here.n; i++) {
        const int x = l->column[w->here.first + i];

        while (k < w->from.n && l->column[w->from.first + k] < x)
            k++;
        before[i] = before_of(
            w, i, k < w->from.n && l->column[w->from.first + k] == x ? w->from_path + k * SST_HYPOTHESES : NULL,
            w->from.first + k);
    }
    walk_row(w, before);
}

void hypothesis_paths_down(struct hypothesis_lists *l, const struct sst_hypothesis_penalty *penalty,
                           const struct sst_packed_view *view, int strip)
{
    for (int dir = 1; dir >= -1; dir -= 2) {
        struct walk w = { .l = l, .penalty = penalty, .view = view, .dy = -dir };

        for (int i = 0; i < l->height; i++) {
            w.y = dir > 0 ? i : l->height - 1 - i;
            w.here = segment_at(l, strip, w.y);
            w.path = l->line[i % 2];
            w.from_path = l->line[(i + 1) % 2];
            if (w.here.n)
                walk_down(&w);
            w.from = w.here;
        }
    }
}

/* The cheapest hypothesis of an entry. */
static void choose_entry(const struct hypothesis_lists *l, int entry, int count, uint16_t *disp, uint8_t *confidence)
{
    const uint16_t *sum = l->sum + (size_t)entry * SST_HYPOTHESES;
    int best = 0, next = 65535;

    for (int i = 1; i < count; i++)
        best = sum[i] < sum[best] ? i : best;
    for (int i = 0; i < count; i++)
        next = i != best && sum[i] < next ? sum[i] : next;
    *disp = l->hypothesis[(size_t)entry * SST_HYPOTHESES + (size_t)best];
    if (best)
        *confidence = (uint8_t)(255 * (next - sum[best]) / (next - sum[best] + 128));
}

void hypothesis_choose_row(const struct hypothesis_lists *l, int y, uint16_t *disp, uint8_t *confidence)
{
    const size_t row = (size_t)y * (size_t)l->width;

    for (int x = 0; x < l->width; x++)
        disp[x] = l->count[row + (size_t)x] ? l->first[row + (size_t)x] : (uint16_t)SST_DISP_NONE;
    for (int strip = 0; strip < strips_of(l); strip++) {
        const struct segment s = segment_at(l, strip, y);

        for (int i = s.first; i < s.first + s.n; i++) {
            const int x = l->column[i];

            choose_entry(l, i, l->count[row + (size_t)x], &disp[x], &confidence[x]);
        }
    }
}
