/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/kernels/consensus_ref.h"

static int mean(int a, int b)
{
    return (a + b + 1) / 2;
}

/* Nearness of view k to a colour. */
static int near_to(const struct sst_consensus_view *view, int k, int x, const int colour[3])
{
    return view[k].seen[x] ? sst_max_int(SST_CONSENSUS_REACH - consensus_apart(&view[k], x, colour), 0) : 0;
}

static int density(const struct sst_consensus_view *view, int views, int x, const int colour[3])
{
    int sum = 0;

    for (int k = 0; k < views; k += 4) {
        int near[4] = { 0 };

        for (int i = 0; i < 4 && k + i < views; i++)
            near[i] = near_to(view, k + i, x, colour);
        sum += mean(mean(near[0], near[1]), mean(near[2], near[3]));
    }
    return sum;
}

/* Nearness of the seeds to one seed, added. */
static int score_of(const struct sst_consensus_view *view, int seeds, int x, const int seed[3])
{
    int sum = 0;

    for (int k = 0; k < seeds; k++)
        sum = sst_min_int(sum + near_to(view, k, x, seed), 255);
    return sum;
}

/* The seed around which the views are densest: quarters of the sum over the seeds, means of four other views each. */
static void start(int colour[3], const struct sst_consensus_view *view, int views, int x)
{
    const int seeds = sst_min_int(views, SST_CONSENSUS_SEEDS);
    int most = 0;

    for (int s = 0; s < seeds; s++) {
        const int seed[3] = { view[s].colour[0][x], view[s].colour[1][x], view[s].colour[2][x] };
        const int others = density(view + seeds, views - seeds, x, seed);
        const int sum = view[s].seen[x] ? score_of(view, seeds, x, seed) / 4 + others : 0;

        for (int c = 0; sum > most && c < 3; c++)
            colour[c] = seed[c];
        most = sst_max_int(sum, most);
    }
}

static void find(uint8_t *const out[4], const struct sst_consensus_view *view, int views, int x)
{
    int colour[3] = { 0 }, seen = 0;
    bool agrees[SST_CONSENSUS_VIEWS];
    unsigned share;

    for (int k = 0; k < views; k++)
        seen += view[k].seen[x] != 0;
    start(colour, view, views, x);
    for (int k = 0; k < views; k++)
        agrees[k] = view[k].seen[x] && consensus_apart(&view[k], x, colour) <= SST_CONSENSUS_NEAR;
    consensus_mean(colour, view, views, agrees, x);
    share = (unsigned)density(view, views, x, colour) * 36 *
                sst_consensus_reciprocal((unsigned)(seen + SST_CONSENSUS_LEAST)) >>
            16;
    for (int c = 0; c < 3; c++)
        out[c][x] = (uint8_t)colour[c];
    out[3][x] =
        (uint8_t)(seen < 2 ? 255 : sst_max_int(SST_CONSENSUS_SPARE - (int)(share * SST_CONSENSUS_SPARE >> 8), 0));
}

void sst_consensus_first_ref(uint8_t *const out[4], const struct sst_consensus_view *view, int views)
{
    for (int x = 0; x < SST_CONSENSUS_BLOCK; x++)
        find(out, view, views, x);
}
