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

/* Planes of pixel x. */
static const uint8_t *listed_at(const struct sst_consensus_listed *l, int planes, size_t x, int *count)
{
    *count = l->count[x / SST_CONSENSUS_BLOCK];
    return l->plane + x / SST_CONSENSUS_BLOCK * (size_t)planes;
}

void sst_consensus_mean_row_ref(uint8_t *mean, const struct sst_consensus_rows *r, size_t n)
{
    for (size_t x = 0; x < n; x++) {
        int planes;
        const uint8_t *plane = listed_at(&r->listed, r->planes, x, &planes);

        for (int j = 0; j < planes; j++) {
            const size_t at = (size_t)plane[j] * r->stride + x;
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
            mean[at] = (uint8_t)(sum * sst_consensus_reciprocal(count) >> 16);
        }
    }
}

void sst_consensus_path_row_ref(const struct sst_consensus_paths *p, size_t n)
{
    for (size_t x = 0; x < n; x++) {
        int least[2] = { 255, 255 }, planes;
        const uint8_t *plane = listed_at(&p->listed, p->planes, x, &planes);

        for (int j = 0; j < planes; j++) {
            const int i = plane[j];
            const size_t at = (size_t)i * p->stride + x;
            int l[2];

            for (int t = 0; t < 2; t++) {
                const uint8_t *from = p->from[t] + at + (t ? 1 : -1);
                const int was = p->from_least[t][(ptrdiff_t)x + (t ? 1 : -1)];
                const int below = i ? *(from - p->stride) : 255, above = i + 1 < p->planes ? from[p->stride] : 255;
                int best = sst_min_int(*from, sst_min_int(below, above) + p->p1);

                best = sst_min_int(sst_min_int(best, was + (p->step[t][x] > p->edge ? p->p2_edge : p->p2)), 255);
                l[t] = sst_min_int(p->cost[at] + sst_max_int(best - was, 0), 255);
                least[t] = sst_min_int(l[t], least[t]);
                p->to[t][at] = (uint8_t)l[t];
            }
            p->mean[at] = (uint8_t)((l[0] + l[1] + 1) / 2);
        }
        p->least[0][x] = (uint8_t)least[0];
        p->least[1][x] = (uint8_t)least[1];
    }
}

/* The sum of a plane; 255: it is not listed. */
static int sum_of(const struct sst_consensus_choice *c, const uint8_t *plane, int planes, int of, size_t x)
{
    const size_t at = (size_t)of * c->stride + x;

    for (int j = 0; j < planes; j++) {
        if (plane[j] == of)
            return sst_min_int(c->sum[0][at] + (c->sum[1] ? c->sum[1][at] : 0), 255);
    }
    return 255;
}

void sst_consensus_choose_row_ref(const struct sst_consensus_choice *c, size_t n)
{
    for (size_t x = 0; x < n; x++) {
        int planes, best;
        const uint8_t *plane = listed_at(&c->listed, c->planes, x, &planes);

        best = plane[0];
        for (int j = 1; j < planes; j++)
            best = sum_of(c, plane, planes, plane[j], x) < sum_of(c, plane, planes, best, x) ? plane[j] : best;
        c->plane[x] = (uint8_t)best;
        c->costs[x] = c->cost[(size_t)best * c->stride + x];
        if (!c->sums)
            continue;
        c->before[x] = (uint8_t)sum_of(c, plane, planes, best - 1, x);
        c->sums[x] = (uint8_t)sum_of(c, plane, planes, best, x);
        c->after[x] = (uint8_t)sum_of(c, plane, planes, best + 1, x);
    }
}
