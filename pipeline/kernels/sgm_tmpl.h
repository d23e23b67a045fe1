/* Semi-global optimisation: 16-bit lanes over the disparities of one pixel. nd is a multiple of 32. */
static inline void KERNEL(sgm_step)(uint16_t *restrict cur, const uint16_t *restrict prev, uint16_t *restrict sum,
                                    const uint8_t *restrict cost, uint16_t p1, uint16_t p2, int first, size_t nd)
{
    const uint16_t prev_min = prev[-2], jump = (uint16_t)(prev_min + p2);
    uint16_t cur_min = SST_SGM_FAR;

    for (size_t d = 0; d < nd; d++) {
        const uint16_t below = prev[(ptrdiff_t)d - 1], above = prev[d + 1];
        const uint16_t near = (uint16_t)((below < above ? below : above) + p1);
        const uint16_t same = prev[d];
        const uint16_t stay = same < near ? same : near;
        const uint16_t best = stay < jump ? stay : jump;
        const uint16_t l = (uint16_t)(cost[d] + best - prev_min);

        cur[d] = l;
        sum[d] = (uint16_t)(first ? l : sum[d] + l);
        cur_min = l < cur_min ? l : cur_min;
    }
    cur[-1] = cur[nd] = SST_SGM_FAR;
    cur[-2] = cur_min;
}

static void KERNEL(sgm_across_row)(uint16_t *cur, const uint16_t *prev, uint16_t *sum, const uint8_t *cost,
                                   const uint8_t *penalty, const uint16_t *p1, const uint16_t *p2, int dx, int first,
                                   size_t n, size_t nd)
{
    const size_t entry = nd + 2 * SST_SGM_PAD;
    uint16_t *c = cur + entry + SST_SGM_PAD;
    const uint16_t *p = prev + (size_t)(1 + dx) * entry + SST_SGM_PAD;

    for (size_t x = 0; x < n; x++, c += entry, p += entry) {
        if (first)
            KERNEL(sgm_step)(c, p, sum + x * nd, cost + x * nd, p1[penalty[x]], p2[penalty[x]], 1, nd);
        else
            KERNEL(sgm_step)(c, p, sum + x * nd, cost + x * nd, p1[penalty[x]], p2[penalty[x]], 0, nd);
    }
}

static void KERNEL(sgm_along_row)(uint16_t *line, uint16_t *sum, const uint8_t *cost, const uint8_t *penalty,
                                  const uint16_t *p1, const uint16_t *p2, int dir, int first, size_t n, size_t nd)
{
    const size_t entry = nd + 2 * SST_SGM_PAD;

    for (size_t i = 0; i < n; i++) {
        const size_t x = dir > 0 ? i : n - 1 - i;
        uint16_t *c = line + (x + 1) * entry + SST_SGM_PAD;
        const uint16_t *p = line + (size_t)((ptrdiff_t)x + 1 - dir) * entry + SST_SGM_PAD;

        if (first)
            KERNEL(sgm_step)(c, p, sum + x * nd, cost + x * nd, p1[penalty[x]], p2[penalty[x]], 1, nd);
        else
            KERNEL(sgm_step)(c, p, sum + x * nd, cost + x * nd, p1[penalty[x]], p2[penalty[x]], 0, nd);
    }
}
