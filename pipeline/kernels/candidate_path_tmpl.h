/* candidate_path_row: one lane for each candidate of the pixel, one candidate of the predecessor after the other. */
static inline void KERNEL(candidate_path)(uint16_t *path, uint16_t *sum, const uint16_t *cost, const uint16_t *candidate,
                                          const uint16_t *from, const uint16_t *from_candidate, uint16_t p1, uint16_t p2,
                                          uint16_t near)
{
    const uint16_t farther = (uint16_t)(2 * near);
    uint16_t best[SST_CANDIDATES], total[SST_CANDIDATES], least = from[0];

    for (int j = 1; j < SST_CANDIDATES; j++)
        least = from[j] < least ? from[j] : least;
    for (int i = 0; i < SST_CANDIDATES; i++)
        best[i] = (uint16_t)(least + p2);
    for (int j = 0; j < SST_CANDIDATES; j++) {
        const uint16_t there = from_candidate[j], before = from[j];

        for (int i = 0; i < SST_CANDIDATES; i++) {
            const uint16_t a = candidate[i], jump = (uint16_t)(a > there ? a - there : there - a);
            const uint16_t up_to = jump <= farther ? p1 : p2, penalty = jump <= near ? 0 : up_to;
            const uint16_t here = (uint16_t)(before + penalty);

            best[i] = here < best[i] ? here : best[i];
        }
    }
    for (int i = 0; i < SST_CANDIDATES; i++)
        best[i] = (uint16_t)(cost[i] + best[i] - least);
    for (int i = 0; i < SST_CANDIDATES; i++)
        total[i] = (uint16_t)(sum[i] + best[i]);
    memcpy(path, best, sizeof(best));
    memcpy(sum, total, sizeof(total));
}

static void KERNEL(candidate_path_row)(uint16_t *path, uint16_t *sum, const uint16_t *cost, const uint16_t *candidate,
                                       const uint16_t *from, const uint16_t *from_candidate, const uint8_t *colour,
                                       const struct sst_candidate_penalty *penalty, ptrdiff_t step, size_t n)
{
    for (ptrdiff_t x = 0; x < (ptrdiff_t)n; x++) {
        const ptrdiff_t at = x * step;
        const uint8_t c = colour[at / SST_CANDIDATES];

        KERNEL(candidate_path)(path + at, sum + at, cost + at, candidate + at, from + at, from_candidate + at,
                               penalty->p1[c], penalty->p2[c], penalty->near);
    }
}
