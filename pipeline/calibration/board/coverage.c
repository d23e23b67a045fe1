/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/calibration/board/coverage.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/text.h"
#include "pipeline/calibration/board/homography.h"

#define TILT_COS       0.96592582628906829 /* of 15 degrees */
#define ENOUGH_CORNERS 6                   /* in a cell */

/* --- counting ---------------------------------------------------------------------------------------------------- */

/* Smallest over largest stretch of a map, and the largest: singular values. */
static double stretch(const double by[4], double *largest)
{
    const double a = (by[0] * by[0] + by[1] * by[1] + by[2] * by[2] + by[3] * by[3]) / 2;
    const double det = by[0] * by[3] - by[1] * by[2], root = sqrt(fmax(a * a - det * det, 0));

    *largest = sqrt(a + root);
    return fabs(det) / (a + root);
}

/*
 * Direction of the tilt: the map at the board's middle compresses it by the cosine of the tilt, and the denominator w =
 * h6 u + h7 v + h8 grows with depth. The board faces the direction in which depth grows in the picture, the gradient
 * being J^-T (h6, h7), J the map's slope.
 */
static int tilt_of(const double h[9], const double by[4], double squeeze)
{
    const double x = by[3] * h[6] - by[2] * h[7], y = by[0] * h[7] - by[1] * h[6]; /* det J > 0 */

    if (squeeze > TILT_COS)
        return 0;
    if (fabs(x) >= fabs(y))
        return x < 0 ? 1 : 2;
    return y < 0 ? 3 : 4;
}

/* Tilt and size of one detection; false where its points do not determine them. */
static bool pose(const struct sst_board *board, const struct sst_detection *d, int *tilt, double *size)
{
    double(*from)[2] = malloc(2 * (size_t)d->corners * sizeof(*from)), (*to)[2] = from + d->corners;
    double middle[2] = { 0, 0 }, h[9], by[4], largest, squeeze;
    bool known = false;

    for (int i = 0; from && i < d->corners; i++) {
        sst_board_point(board, d->corner[i].id, from[i]);
        middle[0] += from[i][0] / d->corners;
        middle[1] += from[i][1] / d->corners;
        to[i][0] = d->corner[i].x;
        to[i][1] = d->corner[i].y;
    }
    if (from && sst_homography_fit(h, (const double(*)[2])from, (const double(*)[2])to, NULL, d->corners) &&
        sst_homography_slope(h, middle, by)) {
        squeeze = stretch(by, &largest);
        *tilt = tilt_of(h, by, squeeze);
        *size = largest * board->square_mm;
        known = isfinite(*size) && *size > 0;
    }
    free(from);
    return known;
}

void sst_coverage_count(struct sst_coverage *out, const struct sst_detections *all)
{
    memset(out, 0, (size_t)(all->rows * all->cols) * sizeof(*out));
    for (int i = 0; i < all->count; i++) {
        const struct sst_detection *d = &all->detection[i];
        struct sst_coverage *c = &out[d->view];
        double size;
        int tilt;

        c->frames++;
        c->corners += d->corners;
        for (int k = 0; k < d->corners; k++) {
            const double x = (d->corner[k].x + 0.5) / all->width, y = (d->corner[k].y + 0.5) / all->height;

            if (x >= 0 && y >= 0 && x < 1 && y < 1)
                c->cell[(int)(y * SST_COVERAGE_CELLS)][(int)(x * SST_COVERAGE_CELLS)]++;
        }
        if (!pose(&all->board, d, &tilt, &size))
            continue;
        c->tilt[tilt]++;
        c->near_size = fmax(c->near_size, size);
        c->far_size = c->far_size > 0 ? fmin(c->far_size, size) : size;
    }
}

/* --- criteria ---------------------------------------------------------------------------------------------------- */

bool sst_coverage_cell_done(const struct sst_coverage *c, int row, int col)
{
    return c->cell[row][col] >= ENOUGH_CORNERS;
}

double sst_coverage_depth_ratio(const struct sst_coverage *c)
{
    return c->far_size > 0 ? c->near_size / c->far_size : 0;
}

double sst_coverage_share(const struct sst_coverage *c)
{
    const double depth = sst_clamp_double((sst_coverage_depth_ratio(c) - 1) / (SST_COVERAGE_RATIO - 1), 0, 1);
    int cells = 0, tilts = 0;

    for (int row = 0; row < SST_COVERAGE_CELLS; row++) {
        for (int col = 0; col < SST_COVERAGE_CELLS; col++)
            cells += sst_coverage_cell_done(c, row, col);
    }
    for (int i = 0; i < SST_COVERAGE_TILTS; i++)
        tilts += c->tilt[i] > 0;
    return 0.4 * cells / (SST_COVERAGE_CELLS * SST_COVERAGE_CELLS) + 0.25 * tilts / SST_COVERAGE_TILTS + 0.15 * depth +
           0.2 * fmin(1, (double)c->frames / SST_COVERAGE_FRAMES);
}

/* --- text -------------------------------------------------------------------------------------------------------- */

static void append(char out[160], const char *what)
{
    sst_text_add(out, 160, "%s%s", *out ? ", " : "", what);
}

/* Nine regions: cells 0-1, 2, 3-4 each way. The emptiest first; ties: corners before sides. */
static void append_regions(char out[160], const struct sst_coverage *c)
{
    static const char *const names[9] = { "upper left", "upper right", "lower left", "lower right", "left",
                                          "right",      "top",         "bottom",     "middle" };
    static const int place[9][2] = { { 0, 0 }, { 2, 0 }, { 0, 2 }, { 2, 2 }, { 0, 1 },
                                     { 2, 1 }, { 1, 0 }, { 1, 2 }, { 1, 1 } }; /* column, row */
    int missing[9] = { 0 }, regions = 0;

    for (int row = 0; row < SST_COVERAGE_CELLS; row++) {
        for (int col = 0; col < SST_COVERAGE_CELLS; col++) {
            const int x = (col > 1) + (col > 2), y = (row > 1) + (row > 2);

            for (int i = 0; i < 9; i++)
                missing[i] += place[i][0] == x && place[i][1] == y && !sst_coverage_cell_done(c, row, col);
        }
    }
    for (int i = 0; i < 9; i++)
        regions += missing[i] > 0;
    if (regions == 9) {
        append(out, "all regions");
        return;
    }
    for (int listed = 0; listed < sst_min_int(regions, 3); listed++) {
        int most = 0;

        for (int i = 1; i < 9; i++)
            most = missing[i] > missing[most] ? i : most;
        append(out, names[most]);
        missing[most] = 0;
    }
    if (regions > 3)
        append(out, "other regions");
}

void sst_coverage_missing(const struct sst_coverage *c, char out[160])
{
    static const char *const tilts[SST_COVERAGE_TILTS] = { "facing straight", "tilt to the left", "tilt to the right",
                                                           "tilt up", "tilt down" };
    const double ratio = sst_coverage_depth_ratio(c);
    char frames[32];
    int lacking = 0;

    *out = 0;
    if (!c->frames) {
        append(out, "everything");
        return;
    }
    append_regions(out, c);
    for (int i = 0; i < SST_COVERAGE_TILTS; i++)
        lacking += !c->tilt[i];
    if (lacking >= 4)
        append(out, "tilts");
    for (int i = 1; i <= SST_COVERAGE_TILTS && lacking < 4; i++) {
        if (!c->tilt[i % SST_COVERAGE_TILTS])
            append(out, tilts[i % SST_COVERAGE_TILTS]);
    }
    if (ratio < SST_COVERAGE_RATIO)
        append(out, "nearer and farther");
    if (c->frames < SST_COVERAGE_FRAMES) {
        snprintf(frames, sizeof(frames), "%d more frames", SST_COVERAGE_FRAMES - c->frames);
        append(out, frames);
    }
}
