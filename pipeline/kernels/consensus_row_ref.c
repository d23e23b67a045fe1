/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/kernels/consensus_ref.h"

void sst_consensus_cost_row_ref(uint8_t *cost, const uint8_t *const own[3], const uint8_t *const consensus[4],
                                uint8_t most, size_t n)
{
    const struct sst_consensus_view view = { .colour = { own[0], own[1], own[2] } };

    for (size_t x = 0; x < n; x++) {
        const int colour[3] = { consensus[0][x], consensus[1][x], consensus[2][x] };

        cost[x] = (uint8_t)sst_min_int(consensus_apart(&view, (int)x, colour) + consensus[3][x], most);
    }
}

/* Planes of pixel x, and its place in a packed row at the first plane. */
static const uint8_t *listed_at(const struct sst_consensus_listed *l, int planes, size_t x, int *count, size_t *packed)
{
    const size_t block = x / SST_CONSENSUS_BLOCK;

    *count = l->count[block];
    *packed = block * (size_t)planes * SST_CONSENSUS_BLOCK + x % SST_CONSENSUS_BLOCK;
    return l->plane + block * (size_t)planes;
}

static uint8_t mean_at(const struct sst_consensus_rows *r, size_t x, int plane)
{
    const size_t at = (size_t)plane * r->stride + x;
    const uint8_t *row[3] = { r->above + at, r->own + at, r->below + at };
    unsigned sum = row[1][0], count = 1;

    for (int i = 0, k = 0; i < 9; i++) {
        if (i == 4)
            continue;
        if (r->step[k][x] <= r->alike) {
            sum += row[i / 3][i % 3 - 1];
            count++;
        }
        k++;
    }
    return (uint8_t)(sum * sst_consensus_reciprocal(count) >> 16);
}

static uint8_t priced_at(const struct sst_consensus_rows *r, size_t x, int plane)
{
    bool flat = true;

    for (int k = 0; k < 8; k++)
        flat = flat && r->step[k][x] <= r->flat;
    return (uint8_t)sst_min_int(mean_at(r, x, plane) + sst_consensus_price(r, plane, flat), 255);
}

void sst_consensus_mean_row_ref(uint8_t *mean, const struct sst_consensus_rows *r, size_t n)
{
    for (size_t x = 0; x < n; x++) {
        int planes;
        size_t packed;
        const uint8_t *plane = listed_at(&r->listed, r->planes, x, &planes, &packed);

        for (int j = 0; j < planes; j++)
            mean[packed + (size_t)j * SST_CONSENSUS_BLOCK] = mean_at(r, x, plane[j]);
    }
}

void sst_consensus_least_row_ref(uint8_t *const out[2], const struct sst_consensus_rows *r, size_t n)
{
    for (size_t x = 0; x < n; x++) {
        int planes, least;
        size_t packed;
        const uint8_t *plane = listed_at(&r->listed, r->planes, x, &planes, &packed);

        out[0][x] = plane[0];
        least = priced_at(r, x, plane[0]);
        for (int j = 1; j < planes; j++) {
            const int priced = priced_at(r, x, plane[j]);

            if (priced < least) {
                out[0][x] = plane[j];
                least = priced;
            }
        }
        out[1][x] = (uint8_t)mean_at(r, x, out[0][x]);
    }
}

void sst_consensus_path_row_ref(const struct sst_consensus_paths *p, size_t n)
{
    for (size_t x = 0; x < n; x++) {
        int least[2] = { 255, 255 }, planes;
        size_t packed;
        const uint8_t *plane = listed_at(&p->listed, p->planes, x, &planes, &packed);

        for (int j = 0; j < planes; j++, packed += SST_CONSENSUS_BLOCK) {
            const int i = plane[j];
            const size_t at = (size_t)i * p->stride + x;
            int l[2];

            for (int t = 0; t < 2; t++) {
                const uint8_t *from = p->from[t] + at + (t ? 1 : -1);
                const int was = p->from_least[t][(ptrdiff_t)x + (t ? 1 : -1)];
                const int below = i ? *(from - p->stride) : 255, above = i + 1 < p->planes ? from[p->stride] : 255;
                int best = sst_min_int(*from, sst_min_int(below, above) + p->p1);

                best = sst_min_int(sst_min_int(best, was + (p->step[t][x] > p->edge ? p->p2_edge : p->p2)), 255);
                l[t] = sst_min_int(p->cost[packed] + sst_max_int(best - was, 0), 255);
                least[t] = sst_min_int(l[t], least[t]);
                p->to[t][at] = (uint8_t)l[t];
            }
            p->mean[packed] = (uint8_t)((l[0] + l[1] + 1) / 2);
        }
        p->least[0][x] = (uint8_t)least[0];
        p->least[1][x] = (uint8_t)least[1];
    }
}

/* The sum at a place in a packed row. */
static int sum_at(const struct sst_consensus_choice *c, size_t at)
{
    return sst_min_int(c->sum[0][at] + c->sum[1][at], 255);
}

void sst_consensus_choose_row_ref(const struct sst_consensus_choice *c, size_t n)
{
    for (size_t x = 0; x < n; x++) {
        int planes, best = 0;
        size_t packed, at;
        const uint8_t *plane = listed_at(&c->listed, c->planes, x, &planes, &packed);

        for (int j = 1; j < planes; j++) {
            if (sum_at(c, packed + (size_t)j * SST_CONSENSUS_BLOCK) <
                sum_at(c, packed + (size_t)best * SST_CONSENSUS_BLOCK))
                best = j;
        }
        at = packed + (size_t)best * SST_CONSENSUS_BLOCK;
        c->plane[x] = plane[best];
        c->costs[x] = c->cost[at];
        c->before[x] = c->after[x] = 255;
        if (best && plane[best - 1] + 1 == plane[best])
            c->before[x] = (uint8_t)sum_at(c, at - SST_CONSENSUS_BLOCK);
        c->sums[x] = (uint8_t)sum_at(c, at);
        if (best + 1 < planes && plane[best] + 1 == plane[best + 1])
            c->after[x] = (uint8_t)sum_at(c, at + SST_CONSENSUS_BLOCK);
    }
}
