/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/kernels/consensus_ref.h"

static int claims_of(const struct sst_consensus_view *view, int views, const struct sst_consensus_test *t, int x)
{
    int claims = 0;

    for (int k = 0; k < views; k++)
        claims += view[k].seen[x] && view[k].plane[x] >= t->first && view[k].plane[x] <= t->last;
    return claims;
}

static void find(uint8_t *const out[4], const struct sst_consensus_view *view, int views,
                 const struct sst_consensus_test *t, int x)
{
    bool visible[SST_CONSENSUS_VIEWS], has[SST_CONSENSUS_VIEWS];
    int colour[3] = { 0 }, seen = 0, alike = 0, claims;
    unsigned sum = 0;

    for (int k = 0; k < views; k++) {
        visible[k] = view[k].seen[x] && view[k].plane[x] <= t->last;
        has[k] = visible[k] && view[k].plane[x] >= t->first;
        seen += visible[k];
    }
    claims = consensus_mean(colour, view, views, has, x);
    for (int k = 0; k < views; k++)
        has[k] = visible[k] && consensus_apart(&view[k], x, colour) <= t->near;
    consensus_mean(colour, view, views, has, x);
    for (int k = 0; k < views; k++) {
        const int apart = sst_min_int(consensus_apart(&view[k], x, colour), t->most);

        alike += view[k].seen[x] && apart <= t->near;
        sum += visible[k] ? (unsigned)apart : 0;
    }
    sum += (unsigned)(sst_max_int(SST_CONSENSUS_LEAST + 1 - alike, 0) * SST_CONSENSUS_ALONE);
    for (int c = 0; c < 3; c++)
        out[c][x] = (uint8_t)colour[c];
    out[3][x] = (uint8_t)(claims ? sum * sst_consensus_reciprocal((unsigned)(seen + SST_CONSENSUS_LEAST)) >> 16 : 255);
}

uint8_t sst_consensus_again_ref(uint8_t *const out[4], const struct sst_consensus_view *view, int views,
                             const struct sst_consensus_test *test)
{
    unsigned claimed = 0;

    for (int x = 0; x < SST_CONSENSUS_BLOCK; x++)
        claimed |= (unsigned)(claims_of(view, views, test, x) >= test->claims) << x / SST_CONSENSUS_PART;
    for (int x = 0; x < SST_CONSENSUS_BLOCK; x++) {
        const int half = x / SST_CONSENSUS_HALF * (SST_CONSENSUS_HALF / SST_CONSENSUS_PART);

        if (claimed >> half & ((1U << SST_CONSENSUS_HALF / SST_CONSENSUS_PART) - 1))
            find(out, view, views, test, x);
        else
            out[3][x] = 255;
    }
    return (uint8_t)claimed;
}
