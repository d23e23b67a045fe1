#include "pipeline/kernels/consensus_ref.h"

static int mean(int a, int b)
{
    return (a + b + 1) / 2;
}

static int density(const struct sst_consensus_view *view, int views, int x, const int colour[3])
{
    int sum = 0;

    for (int k = 0; k < views; k += 4) {
        int near[4] = { 0 };

        for (int i = 0; i < 4 && k + i < views; i++) {
            if (view[k + i].seen[x])
                near[i] = sst_max_int(SST_CONSENSUS_REACH - consensus_apart(&view[k + i], x, colour), 0);
        }
        sum += mean(mean(near[0], near[1]), mean(near[2], near[3]));
    }
    return sum;
}

static void find(uint8_t *const out[4], const struct sst_consensus_view *view, int views, int x)
{
    int best = 0, colour[3] = { 0 }, seen = 0;
    bool agrees[SST_CONSENSUS_VIEWS];
    unsigned share;

    for (int k = 0; k < views; k++)
        seen += view[k].seen[x] != 0;
    for (int s = 0; s < views && s < SST_CONSENSUS_SEEDS; s++) {
        const int seed[3] = { view[s].colour[0][x], view[s].colour[1][x], view[s].colour[2][x] };
        const int sum = view[s].seen[x] ? density(view, views, x, seed) : 0;

        for (int c = 0; sum > best && c < 3; c++)
            colour[c] = seed[c];
        best = sst_max_int(sum, best);
    }
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
