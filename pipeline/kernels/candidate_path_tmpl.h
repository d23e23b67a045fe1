/* candidate_path_row: one lane for each candidate of the pixel, one candidate of the predecessor after the other. In
 * the compiler's vectors, because loops of eight are unrolled into scalars instead. */
typedef uint16_t KERNEL(candidate_lanes) __attribute__((vector_size(2 * SST_CANDIDATES), aligned(2), may_alias));

static inline KERNEL(candidate_lanes) KERNEL(candidate_min)(KERNEL(candidate_lanes) a, KERNEL(candidate_lanes) b)
{
    const KERNEL(candidate_lanes) less = (KERNEL(candidate_lanes))(a < b);

    return (a & less) | (b & ~less);
}

static inline void KERNEL(candidate_path)(uint16_t *path, uint16_t *sum, const uint16_t *cost,
                                          const uint16_t *candidate, const uint16_t *from,
                                          const uint16_t *from_candidate, uint16_t p1, uint16_t p2, uint16_t near)
{
    typedef KERNEL(candidate_lanes) lanes;
    const lanes here = *(const lanes *)candidate;
    uint16_t least = from[0];
    lanes best, l;

    for (int j = 1; j < SST_CANDIDATES; j++)
        least = from[j] < least ? from[j] : least;
    best = (lanes){ 0 } + (uint16_t)(least + p2);
    for (int j = 0; j < SST_CANDIDATES; j++) {
        const lanes there = (lanes){ 0 } + from_candidate[j], up = here - there, down = there - here;
        const lanes jump = KERNEL(candidate_min)(up, down); /* the other one wraps around */
        const lanes penalty = (lanes)(jump > near) & p1;

        best = KERNEL(candidate_min)(best, (penalty + from[j]) | (lanes)(jump > (uint16_t)(2 * near)));
    }
    l = *(const lanes *)cost + best - least;
    *(lanes *)path = l;
    *(lanes *)sum += l;
}

static void KERNEL(candidate_path_row)(uint16_t *path, uint16_t *sum, const uint16_t *cost, const uint16_t *candidate,
                                       const uint16_t *from, const uint16_t *from_candidate, const uint8_t *colour,
                                       const struct sst_candidate_penalty *penalty, ptrdiff_t step, size_t n)
{
    for (ptrdiff_t x = 0; x < (ptrdiff_t)n; x++) {
        const ptrdiff_t at = x * step;
        const uint8_t c = colour[at / SST_CANDIDATES];

        KERNEL(candidate_path)
        (path + at, sum + at, cost + at, candidate + at, from + at, from_candidate + at, penalty->p1[c], penalty->p2[c],
         penalty->near);
    }
}
