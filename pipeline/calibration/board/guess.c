/* Guess of the board in a picture, for error messages: kinds, dictionaries and sizes are tried. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "pipeline/calibration/board/board_internal.h"

#define LEAST_MARKERS 4
#define COLS_MAX      24

/* Families of markers, each by its largest dictionary: the smaller ones are its prefixes. */
static const struct {
    int first, last, border;
    bool touching;
} families[] = {
    { 0, 3, 1, false },   { 4, 7, 1, false },   { 8, 11, 1, false }, { 12, 15, 1, false },
    { 16, 16, 1, false }, { 20, 20, 1, false }, { 20, 20, 2, true },
};

struct guess {
    int agree, decoded;
    struct sst_board board;
};

static int highest(const struct cv_marker *read, int n)
{
    return n > 0 ? read[n - 1].id : 0;
}

/* Number of rows seen, by the lowest anchor. */
static int rows_seen(const struct sst_board *b, const struct sighting *s)
{
    const double pitch = b->kind == SST_BOARD_APRILGRID ? (1 + b->marker) * b->square_mm : b->square_mm;
    double low = 0;

    for (int i = 0; i < s->anchors; i++)
        low = fmax(low, s->anchor[i].board[1]);
    return b->kind == SST_BOARD_APRILGRID ? (int)ceil(low / pitch) : (int)ceil(low / pitch) + 1;
}

/* Keep a board of this width if more markers agree on it than on the best so far. */
static int try_board(struct guess *best, struct sst_board b, const struct cv_marker *read, int n, int last)
{
    struct sighting s = { .board = &b };
    const int agree = place_markers(&s, read, n, 1);
    int markers;

    if (agree > best->agree) {
        best->agree = agree;
        best->decoded = n;
        if (!b.bottom_up)
            b.rows = rows_seen(&b, &s);
        /* The smallest dictionary of the family that is large enough. */
        while (b.dictionary < last && sst_board_dictionary_name(b.dictionary, &markers) &&
               markers < sst_board_markers(NULL, &b, s.other))
            b.dictionary++;
        best->board = b;
    }
    free(s.anchor);
    return agree < 0 ? agree : 0;
}

static int try_family(struct guess *best, size_t family, const struct sst_map_u8 *luma, const struct sst_board *given,
                      struct cv_marker *read)
{
    const bool grid = families[family].touching;
    const int n = read_markers(read, luma, families[family].last, families[family].border, grid);
    const int most = highest(read, n) + 1;
    int err = n < 0 ? n : 0;

    for (int cols = grid ? 1 : 3; cols <= COLS_MAX && n >= LEAST_MARKERS && !err; cols++) {
        for (int up = 0; up <= grid && !err; up++) {
            struct sst_board b = { .kind = grid ? SST_BOARD_APRILGRID : SST_BOARD_CHARUCO,
                                   .cols = cols,
                                   .rows = grid ? (most + cols - 1) / cols : 2 * most / cols + 2,
                                   .square_mm = 1,
                                   .marker = given->kind == (grid ? SST_BOARD_APRILGRID : SST_BOARD_CHARUCO)
                                                 ? given->marker
                                                 : (grid ? 0.3 : 0.7),
                                   .dictionary = grid ? 0 : families[family].first,
                                   .bottom_up = up };

            err = try_board(best, b, read, n, grid ? 0 : families[family].last);
        }
    }
    return err;
}

static bool describe(char out[160], const struct guess *g)
{
    const struct sst_board *b = &g->board;

    if (g->agree < LEAST_MARKERS || 2 * g->agree < g->decoded)
        return false;
    if (b->kind == SST_BOARD_APRILGRID)
        snprintf(out, 160, "it shows an AprilGrid %d tags wide and at least %d high, numbered from the %s", b->cols,
                 b->rows, b->bottom_up ? "bottom" : "top");
    else
        snprintf(out, 160, "it shows a ChArUco board %d squares wide and at least %d high of dictionary %s", b->cols,
                 b->rows, sst_board_dictionary_name(b->dictionary, NULL));
    return true;
}

/* The largest chessboard that the detector confirms: the first search sometimes takes clutter beside it for another
 * row. */
static bool guess_chessboard(char out[160], const struct sst_map_u8 *luma, const struct sst_image *image)
{
    int cols, rows;

    if (cv_any_chessboard(luma, &cols, &rows) <= 0)
        return false;
    for (int less = 0; less < 4; less++) {
        const struct sst_board b = { .kind = SST_BOARD_CHESSBOARD,
                                     .cols = sst_max_int(cols, rows) + 1 - less / 2,
                                     .rows = sst_min_int(cols, rows) + 1 - less % 2,
                                     .square_mm = 1 };
        enum sst_detect_outcome outcome = SST_DETECT_NONE;
        struct sst_detection d = { 0 };

        if (b.cols < 4 || b.rows < 4 || sst_board_detect(&b, image, NULL, &d, &outcome))
            continue;
        sst_detection_fini(&d);
        if (outcome == SST_DETECT_FOUND || outcome == SST_DETECT_BLURRED || outcome == SST_DETECT_MOVING) {
            snprintf(out, 160, "it shows a chessboard of %dx%d squares (%dx%d inner corners)", b.cols, b.rows,
                     b.cols - 1, b.rows - 1);
            return true;
        }
    }
    return false;
}

bool sst_board_guess(const struct sst_board *board, const struct sst_image *image, char out[160])
{
    struct cv_marker *read = malloc(SST_MARKERS_MAX * sizeof(*read));
    struct sst_map_u8 luma = { 0 };
    struct pyramid p = { 0 };
    struct guess best = { 0 };
    int err = read ? sst_luma(&luma, image) : -ENOMEM;
    bool known = false;

    err = err ? err : pyramid_init(&p, &luma);
    for (size_t i = 0; i < ARRAY_LEN(families) && !err; i++)
        err = try_family(&best, i, p.level[p.levels - 1], board, read);
    if (!err)
        known = describe(out, &best) || guess_chessboard(out, p.level[p.levels - 1], image);
    pyramid_fini(&p);
    sst_map_u8_fini(&luma);
    free(read);
    return known;
}
