/* Points of a board, from its anchors: predicted from neighbours, refined, and checked against each other. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/stats.h"
#include "pipeline/calibration/board/board_internal.h"
#include "pipeline/calibration/board/homography.h"

#define NEIGHBOURS  14
#define GROW_ROUNDS 12
#define LARGEST_PX  8 /* half width of a window for pictures up to 1000 pixels wide; limits lens distortion */
#define TAG_BORDER  0.2

/* --- prediction --------------------------------------------------------------------------------------------------- */

struct near {
    int index;
    double distance2;
};

/* The nearest anchors in order of distance; ties: the first. */
static int nearest_anchors(struct near out[NEIGHBOURS], const struct anchor *anchor, int n, const double at[2],
                           int skip)
{
    int count = 0;

    for (int i = 0; i < n; i++) {
        const double dx = anchor[i].board[0] - at[0], dy = anchor[i].board[1] - at[1], d2 = dx * dx + dy * dy;
        int k = count;

        if (i == skip || (count == NEIGHBOURS && d2 >= out[count - 1].distance2))
            continue;
        if (count < NEIGHBOURS)
            count++;
        else
            k--;
        for (; k > 0 && out[k - 1].distance2 > d2; k--)
            out[k] = out[k - 1];
        out[k] = (struct near){ i, d2 };
    }
    return count;
}

/* Anchors of a board, and the side of its squares. */
struct anchors {
    const struct anchor *anchor;
    int n;
    double step_mm;
};

/* Predict the pixel of a board position from the anchors around it, leaving one out (skip; -1: none). slope: px per mm
 * there. @return false: no anchors near enough */
static bool predict(double px[2], double slope[4], const struct anchors *on, const double at[2], int skip)
{
    const double step_mm = on->step_mm;
    double from[NEIGHBOURS][2], to[NEIGHBOURS][2], weight[NEIGHBOURS], h[9];
    struct near found[NEIGHBOURS];
    const int count = nearest_anchors(found, on->anchor, on->n, at, skip);

    if (count < 4 || found[0].distance2 > 2.6 * step_mm * step_mm)
        return false;
    for (int i = 0; i < count; i++) {
        const struct anchor *a = &on->anchor[found[i].index];

        memcpy(from[i], a->board, sizeof(from[i]));
        memcpy(to[i], a->px, sizeof(to[i]));
        /* Distant anchors weigh less: lens distortion bends the board. */
        weight[i] = a->weight / (1 + found[i].distance2 / (step_mm * step_mm));
    }
    return sst_homography_fit(h, (const double(*)[2])from, (const double(*)[2])to, weight, count) &&
           sst_homography_apply(h, at, px) && sst_homography_slope(h, at, slope) &&
           slope[0] * slope[3] - slope[1] * slope[2] > 0;
}

/* --- refinement --------------------------------------------------------------------------------------------------- */

/* The surroundings of a point on this board. */
static void describe_point(struct saddle_place *place, const struct sst_board *b, int id, bool other)
{
    if (b->kind == SST_BOARD_APRILGRID) {
        place->sign = id % 2 ? 1 : -1;
        place->half_mm = b->marker * b->square_mm;
        place->core_mm = TAG_BORDER * b->square_mm;
        place->core_sign = -place->sign;
    } else {
        const int i = id % (b->cols - 1), j = id / (b->cols - 1);
        const bool white = (i + j) % 2 != other;

        place->sign = white ? 1 : -1;
        place->half_mm = 0.8 * b->square_mm;
        place->core_mm = b->kind == SST_BOARD_CHARUCO ? (1 - b->marker) / 2 * b->square_mm : INFINITY;
        place->core_sign = place->sign;
    }
}

static double largest_window(const struct sst_map_u8 *luma)
{
    return LARGEST_PX * fmax(1, sqrt(fmax(luma->width, luma->height) / 1000.0));
}

/* Search for a point where the anchors predict it, and set its saddle. */
static bool search_point(struct sighting *s, int id, const struct anchors *on, double reach)
{
    const double pitch = sst_board_pitch_mm(s->board);
    struct saddle_place place;
    double at[2], px[2];

    sst_board_point(s->board, id, at);
    if (!predict(px, place.slope, on, at, -1))
        return false;
    place.x = px[0];
    place.y = px[1];
    describe_point(&place, s->board, id, s->other);
    place.reach_px = reach * (1 + pitch * sqrt(place.slope[0] * place.slope[3] - place.slope[1] * place.slope[2]) / 4);
    return saddle_refine(&s->saddle[id], s->luma, &place, largest_window(s->luma));
}

/* Rebuild the anchors: refined points, and the markers' corners where few refined points are near. */
static int collect(struct anchor *out, int *id, const struct sighting *s, int points)
{
    int n = 0;

    for (int i = 0; i < points; i++) {
        if (!s->seen[i])
            continue;
        sst_board_point(s->board, i, out[n].board);
        out[n].px[0] = s->saddle[i].x;
        out[n].px[1] = s->saddle[i].y;
        out[n].weight = 1;
        if (id)
            id[n] = i;
        n++;
    }
    return n;
}

/* --- checks ------------------------------------------------------------------------------------------------------- */

/* Distance of each point from the position that its neighbours predict, NAN without a prediction, and the scale
 * there. */
static void prediction_errors(double *distance, const struct sighting *s, const struct anchor *anchor, int n)
{
    const struct anchors on = { anchor, n, s->board->square_mm };
    const double pitch = sst_board_pitch_mm(s->board);

    for (int i = 0; i < n; i++) {
        double px[2], slope[4];

        distance[i] = NAN;
        if (!predict(px, slope, &on, anchor[i].board, i))
            continue;
        /* In pitches at 0.04 of one, in px where squares are small. */
        distance[i] = hypot(px[0] - anchor[i].px[0], px[1] - anchor[i].px[1]) /
                      fmax(1, pitch * sqrt(slope[0] * slope[3] - slope[1] * slope[2]) / 25);
    }
}

/*
 * Drop, the worst first, points that differ from the prediction of their neighbours by more than 5 times the median
 * distance, but at least 0.4 px (or 0.016 of the pitch, if larger) and at most 4 times this.
 */
static void drop_outliers(struct sighting *s, struct anchor *anchor, double *distance, int *id, int points)
{
    for (;;) {
        const int n = collect(anchor, id, s, points);
        double *sorted = distance + points, limit;
        int known = 0, worst = -1;

        prediction_errors(distance, s, anchor, n);
        for (int i = 0; i < n; i++) {
            if (isnan(distance[i]))
                continue;
            sorted[known++] = distance[i];
            if (worst < 0 || distance[i] > distance[worst])
                worst = i;
        }
        if (known < 1)
            return;
        limit = sst_clamp_double(5 * sst_stats_upper_median(sorted, known), 0.4, 1.6);
        if (distance[worst] <= limit)
            return;
        s->seen[id[worst]] = false;
    }
}

int find_points(struct sighting *s)
{
    const int points = sst_board_points(s->board);
    struct anchor *anchor = malloc((size_t)(points + s->anchors) * sizeof(*anchor));
    double *distance = malloc(2 * (size_t)points * sizeof(*distance));
    int *id = malloc((size_t)points * sizeof(*id));
    int count = 0, before = -1;

    if (!anchor || !distance || !id) {
        count = -ENOMEM;
        goto out;
    }
    for (int round = 0; round < GROW_ROUNDS && count > before; round++) {
        const int refined = collect(anchor, NULL, s, points);
        const struct anchors on = { anchor, refined + s->anchors, s->board->square_mm };

        before = count;
        memcpy(anchor + refined, s->anchor, (size_t)s->anchors * sizeof(*anchor));
        for (int i = 0; i < points; i++) {
            if (!s->seen[i] && search_point(s, i, &on, round ? 0.6 : 1)) {
                s->seen[i] = true;
                count++;
            }
        }
    }
    drop_outliers(s, anchor, distance, id, points);
    count = collect(anchor, id, s, points);
out:
    free(anchor);
    free(distance);
    free(id);
    return count;
}

/* --- chessboards that are not of this size ------------------------------------------------------------------------ */

bool chessboard_ends_early(const struct sighting *s)
{
    const int cols = s->board->cols - 1, rows = s->board->rows - 1;

    for (int side = 0; side < 4; side++) {
        const int length = side < 2 ? rows : cols;
        int seen = 0;

        for (int k = 0; k < length; k++) {
            const int i = side == 0 ? 0 : side == 1 ? cols - 1 : k, j = side == 2 ? 0 : side == 3 ? rows - 1 : k;

            seen += s->seen[j * cols + i];
        }
        if (2 * seen < length)
            return true;
    }
    return false;
}

bool chessboard_goes_on(const struct sighting *s)
{
    const struct anchors on = { s->anchor, s->anchors, s->board->square_mm };
    const int cols = s->board->cols - 1, rows = s->board->rows - 1;

    for (int side = 0; side < 4; side++) {
        const int length = side < 2 ? rows : cols;
        int crossings = 0;

        /* While they still can be the majority of the side. */
        for (int k = 0; k < length && 2 * (crossings + length - k) > length; k++) {
            const int i = side == 0 ? -1 : side == 1 ? cols : k, j = side == 2 ? -1 : side == 3 ? rows : k;
            const double at[2] = { i * s->board->square_mm, j * s->board->square_mm };
            struct saddle_place place = { .half_mm = 0.8 * s->board->square_mm,
                                          .core_mm = INFINITY,
                                          .core_sign = 1,
                                          .sign = (i + j + 2) % 2 != s->other ? 1 : -1 };
            struct saddle saddle;
            double px[2];

            if (!predict(px, place.slope, &on, at, -1))
                continue;
            place.x = px[0];
            place.y = px[1];
            place.reach_px =
                s->board->square_mm * sqrt(place.slope[0] * place.slope[3] - place.slope[1] * place.slope[2]) / 4;
            crossings += saddle_refine(&saddle, s->luma, &place, largest_window(s->luma));
        }
        if (2 * crossings > length)
            return true;
    }
    return false;
}
