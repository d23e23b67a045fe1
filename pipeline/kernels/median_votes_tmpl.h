/* One pixel of the window at a time over a block of pixels. Weights fit 16 bits: 16 * 225. */
static SST_NOINLINE void KERNEL(median_votes_tap)(uint16_t *restrict near, uint16_t *restrict all,
                                                  const uint16_t *restrict d, const uint8_t *restrict r,
                                                  const uint8_t *restrict g, const uint8_t *restrict b,
                                                  const uint16_t *restrict d0, const uint8_t *restrict r0,
                                                  const uint8_t *restrict g0, const uint8_t *restrict b0,
                                                  uint16_t share)
{
    for (int x = 0; x < SST_MEDIAN_BLOCK; x++) {
        const int16_t dr = (int16_t)(r[x] - r0[x]), dg = (int16_t)(g[x] - g0[x]), db = (int16_t)(b[x] - b0[x]);
        const int16_t contrast = (int16_t)((dr < 0 ? -dr : dr) + (dg < 0 ? -dg : dg) + (db < 0 ? -db : db));
        const uint16_t room =
            (uint16_t)(SST_MEDIAN_CONTRAST - (contrast < SST_MEDIAN_CONTRAST ? contrast : SST_MEDIAN_CONTRAST));
        const uint16_t w = (uint16_t)((uint16_t)((uint16_t)(room * room) >> SST_MEDIAN_SHIFT) * share);
        const uint16_t step = (uint16_t)(d[x] > d0[x] ? d[x] - d0[x] : d0[x] - d[x]);

        near[x] = (uint16_t)(near[x] + (step <= SST_MEDIAN_STEP_Q6 ? w : 0));
        all[x] = (uint16_t)(all[x] + w);
    }
}

/* Votes of a row of the window fit 16 bits: its shares sum to 86 at most. */
static void KERNEL(median_votes_row)(uint32_t *restrict near, uint32_t *restrict all,
                                     const uint16_t *const disp[SST_MEDIAN_SIDE],
                                     const uint8_t *const colour[3][SST_MEDIAN_SIDE], size_t n)
{
    const uint16_t *disp_rest[SST_MEDIAN_SIDE];
    const uint8_t *colour_rest[3][SST_MEDIAN_SIDE];
    size_t start = 0;

    for (; start + SST_MEDIAN_BLOCK <= n; start += SST_MEDIAN_BLOCK) {
        const uint16_t *d0 = disp[SST_MEDIAN_REACH] + start;
        const uint8_t *r0 = colour[0][SST_MEDIAN_REACH] + start, *g0 = colour[1][SST_MEDIAN_REACH] + start;
        const uint8_t *b0 = colour[2][SST_MEDIAN_REACH] + start;

        memset(near + start, 0, SST_MEDIAN_BLOCK * sizeof(*near));
        memset(all + start, 0, SST_MEDIAN_BLOCK * sizeof(*all));
        for (int j = 0; j < SST_MEDIAN_SIDE; j++) {
            uint16_t some[SST_MEDIAN_BLOCK] = { 0 }, every[SST_MEDIAN_BLOCK] = { 0 };

            for (int i = 0; i < SST_MEDIAN_SIDE; i++) {
                const ptrdiff_t at = (ptrdiff_t)start + i - SST_MEDIAN_REACH;

                KERNEL(median_votes_tap)
                (some, every, disp[j] + at, colour[0][j] + at, colour[1][j] + at, colour[2][j] + at, d0, r0, g0, b0,
                 sst_median_near[j][i]);
            }
            for (int x = 0; x < SST_MEDIAN_BLOCK; x++) {
                near[start + (size_t)x] += some[x];
                all[start + (size_t)x] += every[x];
            }
        }
    }
    for (int j = 0; j < SST_MEDIAN_SIDE; j++) {
        disp_rest[j] = disp[j] + start;
        for (int c = 0; c < 3; c++)
            colour_rest[c][j] = colour[c][j] + start;
    }
    sst_median_votes_row_ref(near + start, all + start, disp_rest, colour_rest, n - start);
}
