/* Blobs of high scores: hysteresis, opening, pixels that are connected across gaps. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/posed/find/find_internal.h"

/* Masks of width x height bytes, 0 or 1: pixels of high scores, and pixels by way of which they are connected. */
struct mask {
    int width, height;
    uint8_t *at, *core;
};

struct search {
    struct mask mask;
    const struct sst_map_f32 *score;
    int sign;
    const struct find_blob_config *cfg;
};

/* Largest or least of the window of `reach` around each pixel; pixels outside do not count. */
static void spread_mask(struct mask *m, uint8_t *scratch, int reach, bool largest)
{
    for (int pass = 0; pass < 2; pass++) {
        const uint8_t *from = pass ? scratch : m->at;
        uint8_t *to = pass ? m->at : scratch;

        for (int y = 0; y < m->height; y++) {
            for (int x = 0; x < m->width; x++) {
                uint8_t v = !largest;

                for (int k = -reach; k <= reach; k++) {
                    const int at_x = pass ? x : x + k, at_y = pass ? y + k : y;

                    if (at_x >= 0 && at_y >= 0 && at_x < m->width && at_y < m->height) {
                        const uint8_t one = from[(size_t)at_y * (size_t)m->width + (size_t)at_x];

                        v = largest ? v | one : v & one;
                    }
                }
                to[(size_t)y * (size_t)m->width + (size_t)x] = v;
            }
        }
    }
}

/* Pixels of the core that are connected with one, by way of the mask, from which they are taken. @param stack  [pixels]
 */
static struct sst_blob take(struct mask *m, const struct sst_map_f32 *score, int sign, size_t first, size_t *stack)
{
    struct sst_blob b = { { m->width, m->height, 0, 0 }, 0, 0, -INFINITY, 0 };
    double weights = 0;
    size_t n = 0;

    m->at[first] = 0;
    stack[n++] = first;
    while (n) {
        const size_t at = stack[--n];
        const int x = (int)(at % (size_t)m->width), y = (int)(at / (size_t)m->width);
        const double v = sign * (double)sst_map_f32_row(score, y)[x], weight = isnan(v) ? 0 : fmax(v, 0);

        if (m->core[at]) {
            b.box = (struct sst_rect){ sst_min_int(b.box.x0, x), sst_min_int(b.box.y0, y), sst_max_int(b.box.x1, x + 1),
                                       sst_max_int(b.box.y1, y + 1) };
            b.score = v > b.score ? v : b.score;
            b.x += weight * x;
            b.y += weight * y;
            weights += weight;
            b.pixels++;
        }
        for (int k = 0; k < 9; k++) {
            const int nx = x + k % 3 - 1, ny = y + k / 3 - 1;
            const size_t next = (size_t)ny * (size_t)m->width + (size_t)nx;

            if (nx >= 0 && ny >= 0 && nx < m->width && ny < m->height && m->at[next]) {
                m->at[next] = 0;
                stack[n++] = next;
            }
        }
    }
    b.x = weights > 0 ? b.x / weights : (b.box.x0 + b.box.x1 - 1) / 2.0;
    b.y = weights > 0 ? b.y / weights : (b.box.y0 + b.box.y1 - 1) / 2.0;
    return b;
}

static int compare_blobs(const void *a, const void *b)
{
    const struct sst_blob *x = a, *y = b;

    if (x->score != y->score)
        return x->score < y->score ? 1 : -1;
    return x->box.y0 != y->box.y0 ? x->box.y0 - y->box.y0 : x->box.x0 - y->box.x0;
}

static int collect(struct sst_blob **blob, int *count, struct search *s, size_t *stack)
{
    const size_t pixels = (size_t)s->mask.width * (size_t)s->mask.height;
    int room = 0;

    for (size_t i = 0; i < pixels; i++) {
        struct sst_blob b;

        if (!s->mask.at[i])
            continue;
        b = take(&s->mask, s->score, s->sign, i, stack);
        if (b.score < s->cfg->seed || b.pixels < s->cfg->least_px || b.pixels > s->cfg->most_px)
            continue;
        if (*count == room) {
            struct sst_blob *more = realloc(*blob, (size_t)(room = 2 * room + 16) * sizeof(*more));

            if (!more)
                return -ENOMEM;
            *blob = more;
        }
        (*blob)[(*count)++] = b;
    }
    if (*count)
        qsort(*blob, (size_t)*count, sizeof(**blob), compare_blobs);
    return 0;
}

int find_blobs(struct sst_blob **blob, int *count, const struct sst_map_f32 *score, int sign,
               const struct find_blob_config *cfg)
{
    const size_t pixels = (size_t)score->width * (size_t)score->height;
    struct search s = { { score->width, score->height, malloc(pixels), malloc(pixels) }, score, sign, cfg };
    struct mask *m = &s.mask;
    uint8_t *scratch = malloc(pixels);
    size_t *stack = malloc(pixels * sizeof(*stack));
    int err = m->at && m->core && scratch && stack ? 0 : -ENOMEM;

    *blob = NULL;
    *count = 0;
    for (size_t i = 0; !err && i < pixels; i++) {
        const double v = sign * (double)sst_map_f32_row(score, (int)(i / (size_t)m->width))[i % (size_t)m->width];

        m->at[i] = isgreaterequal(v, cfg->grow * cfg->seed);
    }
    if (!err) {
        spread_mask(m, scratch, 1, false);
        spread_mask(m, scratch, 1, true);
        memcpy(m->core, m->at, pixels);
        spread_mask(m, scratch, cfg->close_px / 2, true);
        err = collect(blob, count, &s, stack);
    }
    if (err) {
        free(*blob);
        *blob = NULL;
        *count = 0;
    }
    free(m->at);
    free(m->core);
    free(scratch);
    free(stack);
    return err;
}
