/* enlarge_row: the left pixels of a block of cells, then the right ones. A block's inputs are widened to 16 bits
 * first, so that the selection is one loop of equal lanes. */

#define ENLARGE_BLOCK 32

struct KERNEL(enlarge_lanes) {
    uint16_t disp[ENLARGE_BLOCK], label[ENLARGE_BLOCK], unlike[ENLARGE_BLOCK];
};

/* Load cells x .. x+n-1 of a row, and their colour distance to the pixels. */
static inline __attribute__((always_inline)) void KERNEL(enlarge_load)(struct KERNEL(enlarge_lanes) *restrict to,
                                                                       const struct sst_enlarge *e, int row, long x,
                                                                       const uint16_t *restrict green, long n)
{
    const uint16_t *restrict disp = e->disp[row] + x, *restrict green4 = e->green4[row] + x;
    const uint8_t *restrict label = e->label[row] + x;

    for (long i = 0; i < n; i++)
        to->disp[i] = disp[i];
    for (long i = 0; i < n; i++)
        to->label[i] = label[i];
    for (long i = 0; i < n; i++)
        to->unlike[i] = (uint16_t)(green4[i] > green[i] ? green4[i] - green[i] : green[i] - green4[i]);
}

/* Select a cell if it belongs to another surface than the pixel's own cell and its colour is nearer than the current
 * selection. */
static inline __attribute__((always_inline)) void
KERNEL(enlarge_choose)(struct KERNEL(enlarge_lanes) *restrict best, const struct KERNEL(enlarge_lanes) *restrict own,
                       const struct KERNEL(enlarge_lanes) *restrict cell, uint16_t step)
{
    for (int i = 0; i < ENLARGE_BLOCK; i++) {
        const uint16_t d = cell->disp[i], o = own->disp[i];
        const uint16_t apart = (uint16_t)(d > o ? d - o : o - d);
        const uint16_t far = (uint16_t) - (apart > step), other = (uint16_t) - (cell->label[i] != own->label[i]);
        const uint16_t less = (uint16_t) - (cell->unlike[i] < best->unlike[i]);
        const uint16_t take = (uint16_t)((far | other) & less), keep = (uint16_t)~take;

        best->disp[i] = (uint16_t)((d & take) | (best->disp[i] & keep));
        best->label[i] = (uint16_t)((cell->label[i] & take) | (best->label[i] & keep));
        best->unlike[i] = (uint16_t)((cell->unlike[i] & take) | (best->unlike[i] & keep));
    }
}

/* The pixels of n cells from x on, n at most ENLARGE_BLOCK, on their left (side -1) or right (1). */
static inline __attribute__((always_inline)) void KERNEL(enlarge_side)(struct KERNEL(enlarge_lanes) *restrict best,
                                                                       const struct sst_enlarge *e, long x, long side,
                                                                       long n)
{
    const uint8_t *restrict pixel = e->green + 2 * x + (side > 0);
    const uint16_t step = (uint16_t)e->step_q6;
    struct KERNEL(enlarge_lanes) own = { { 0 }, { 0 }, { 0 } }, cell = { { 0 }, { 0 }, { 0 } };
    uint16_t green[ENLARGE_BLOCK];

    for (long i = 0; i < n; i++)
        green[i] = (uint16_t)(4 * pixel[2 * i]);
    KERNEL(enlarge_load)(&own, e, 0, x, green, n);
    *best = own;
    KERNEL(enlarge_load)(&cell, e, 0, x + side, green, n);
    KERNEL(enlarge_choose)(best, &own, &cell, step);
    KERNEL(enlarge_load)(&cell, e, 1, x, green, n);
    KERNEL(enlarge_choose)(best, &own, &cell, step);
    KERNEL(enlarge_load)(&cell, e, 1, x + side, green, n);
    KERNEL(enlarge_choose)(best, &own, &cell, step);
}

/* Inlined with a constant count, so that lanes stay in registers. */
static inline __attribute__((always_inline)) void KERNEL(enlarge_cells)(uint16_t *restrict d, uint8_t *restrict l,
                                                                        const struct sst_enlarge *e, long x, long count)
{
    struct KERNEL(enlarge_lanes) side[2];

    KERNEL(enlarge_side)(&side[0], e, x, -1, count);
    KERNEL(enlarge_side)(&side[1], e, x, 1, count);
    for (long i = 0; i < count; i++) {
        d[2 * i] = side[0].disp[i];
        d[2 * i + 1] = side[1].disp[i];
    }
    for (long i = 0; i < count; i++) {
        l[2 * i] = (uint8_t)side[0].label[i];
        l[2 * i + 1] = (uint8_t)side[1].label[i];
    }
}

static void KERNEL(enlarge_row)(uint16_t *disp, uint8_t *label, const struct sst_enlarge *e, size_t n)
{
    long x = 0;

    for (; (long)n - x >= ENLARGE_BLOCK; x += ENLARGE_BLOCK)
        KERNEL(enlarge_cells)(disp + 2 * x, label + 2 * x, e, x, ENLARGE_BLOCK);
    if (x < (long)n)
        KERNEL(enlarge_cells)(disp + 2 * x, label + 2 * x, e, x, (long)n - x);
}

#undef ENLARGE_BLOCK
