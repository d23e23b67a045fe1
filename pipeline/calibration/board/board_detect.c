/* Detection of the board in one picture: grey, find, refine, classify. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "base/stats.h"
#include "pipeline/calibration/board/board_internal.h"

#define LEAST_POINTS  6
#define COARSE_SIDE   1100 /* px: larger pictures are searched only if nothing is found at this size */
#define FLOOR_PX      0.05 /* lower bound of the corner noise: print, flatness, lens model */
#define MOST_ASPECT   1.8  /* of a blur: beyond, the board moved */
#define LEAST_BLUR_PX 0.3  /* a pixel's own width: sharper edges cannot be resolved */
#define FOREIGN_LEAST 4    /* foreign markers that mean another board: fewer are false reads in clutter */

/* --- size -------------------------------------------------------------------------------------------------------- */

int pyramid_init(struct pyramid *p, const struct sst_map_u8 *luma)
{
    *p = (struct pyramid){ .levels = 1, .level = { luma } };
    while (p->levels < (int)ARRAY_LEN(p->level)) {
        const struct sst_map_u8 *last = p->level[p->levels - 1];

        if (sst_max_int(last->width, last->height) <= COARSE_SIDE)
            break;
        if (sst_map_u8_halve(&p->half[p->levels - 1], last)) {
            pyramid_fini(p);
            return -ENOMEM;
        }
        p->level[p->levels] = &p->half[p->levels - 1];
        p->levels++;
    }
    return 0;
}

void pyramid_fini(struct pyramid *p)
{
    for (size_t i = 0; i < ARRAY_LEN(p->half); i++)
        sst_map_u8_fini(&p->half[i]);
    *p = (struct pyramid){ 0 };
}

/* --- classification ---------------------------------------------------------------------------------------------- */

/*
 * Median point spread of all points, as width and aspect. A tone curve shifts the grey level where the edges cross,
 * which appears as skew of opposite sign at points with black and with white at the upper left: the medians of both
 * kinds are averaged.
 */
static int measure_blur(struct sst_detection *d, const struct sighting *s)
{
    double *v = malloc((size_t)d->corners * sizeof(*v)), b[3] = { 0 }, middle, half;

    if (!v)
        return -ENOMEM;
    for (int axis = 0; axis < 3; axis++) {
        int kinds = 0;

        for (int sign = 0; sign < 2; sign++) {
            int n = 0;

            for (int i = 0; i < d->corners; i++) {
                const struct saddle *c = &s->saddle[d->corner[i].id];

                if ((c->contrast > 0) == sign)
                    v[n++] = axis == 0 ? c->blur_xx : axis == 1 ? c->blur_xy : c->blur_yy;
            }
            b[axis] += sst_stats_upper_median(v, n);
            kinds += n > 0;
        }
        b[axis] /= kinds;
    }
    free(v);
    middle = (b[0] + b[2]) / 2;
    half = hypot((b[0] - b[2]) / 2, b[1]);
    d->blur_px = sqrt(fmax(middle, LEAST_BLUR_PX * LEAST_BLUR_PX));
    d->blur_aspect =
        sqrt(fmax(middle + half, LEAST_BLUR_PX * LEAST_BLUR_PX) / fmax(middle - half, LEAST_BLUR_PX * LEAST_BLUR_PX));
    return 0;
}

/* True if the points spread over a plane, not along a line; in board coordinates, where a line differs from a tilt. */
static bool spans_plane(const struct sst_detection *d, const struct sst_board *board)
{
    const double pitch = sst_board_pitch_mm(board);
    double m[2] = { 0, 0 }, xx = 0, xy = 0, yy = 0, p[2];

    for (int i = 0; i < d->corners; i++) {
        sst_board_point(board, d->corner[i].id, p);
        m[0] += p[0] / d->corners;
        m[1] += p[1] / d->corners;
    }
    for (int i = 0; i < d->corners; i++) {
        sst_board_point(board, d->corner[i].id, p);
        xx += (p[0] - m[0]) * (p[0] - m[0]) / d->corners;
        xy += (p[0] - m[0]) * (p[1] - m[1]) / d->corners;
        yy += (p[1] - m[1]) * (p[1] - m[1]) / d->corners;
    }
    return (xx + yy) / 2 - hypot((xx - yy) / 2, xy) > 0.1 * pitch * pitch;
}

/* --- the picture ------------------------------------------------------------------------------------------------- */

static int fill(struct sst_detection *out, const struct sighting *s, int count)
{
    struct sst_detection d = { .corner = calloc((size_t)count + 1, sizeof(*d.corner)) };
    int err;

    if (!d.corner)
        return -ENOMEM;
    for (int i = 0; i < sst_board_points(s->board); i++) {
        const struct saddle *c = &s->saddle[i];

        if (s->seen[i])
            d.corner[d.corners++] = (struct sst_corner){ i, c->x, c->y, FLOOR_PX / hypot(FLOOR_PX, c->noise_px) };
    }
    err = measure_blur(&d, s);
    if (err) {
        sst_detection_fini(&d);
        return err;
    }
    *out = d;
    return 0;
}

/* Classify the points that were found; a usable or nearly usable detection is kept. */
static int classify(struct sst_detection *out, enum sst_detect_outcome *outcome, const struct sighting *s, int count,
                    const struct sst_detect_config *cfg)
{
    const double max_blur = cfg && cfg->max_blur_px > 0 ? cfg->max_blur_px : 3;
    struct sst_detection d;
    int err;

    *outcome = SST_DETECT_FEW;
    if (count < LEAST_POINTS)
        return 0;
    err = fill(&d, s, count);
    if (err)
        return err;
    if (!spans_plane(&d, s->board)) {
        sst_detection_fini(&d);
        return 0;
    }
    *outcome = d.blur_aspect > MOST_ASPECT ? SST_DETECT_MOVING
               : d.blur_px > max_blur      ? SST_DETECT_BLURRED
                                           : SST_DETECT_FOUND;
    *out = d;
    return 0;
}

static int detect_markers(struct sighting *s, struct sst_detection *out, enum sst_detect_outcome *outcome,
                          const struct sst_detect_config *cfg)
{
    int decoded, good = find_markers(s, cfg && cfg->quick, &decoded), count;

    if (good < 0)
        return good;
    if (decoded - good >= FOREIGN_LEAST && decoded > 2 * good) {
        *outcome = SST_DETECT_OTHER_BOARD;
        return 0;
    }
    if (good == 0) {
        *outcome = decoded > 0 ? SST_DETECT_FEW : SST_DETECT_NONE;
        return 0;
    }
    count = find_points(s);
    return count < 0 ? count : classify(out, outcome, s, count, cfg);
}

static int detect_chessboard(struct sighting *s, struct sst_detection *out, enum sst_detect_outcome *outcome,
                             const struct sst_detect_config *cfg)
{
    const int found = find_chessboard(s, cfg && cfg->quick);
    int count;

    *outcome = SST_DETECT_NONE;
    if (found <= 0)
        return found;
    count = find_points(s);
    if (count >= 0 && (chessboard_ends_early(s) || chessboard_goes_on(s))) {
        *outcome = SST_DETECT_OTHER_BOARD;
        return 0;
    }
    return count < 0 ? count : classify(out, outcome, s, count, cfg);
}

static int detect(const struct sst_board *board, const struct sst_map_u8 *luma, const struct sst_detect_config *cfg,
                  struct sst_detection *out, enum sst_detect_outcome *outcome)
{
    const size_t points = (size_t)sst_board_points(board);
    struct sighting s = { .board = board, .luma = luma };
    int err = -ENOMEM;

    s.seen = calloc(points, sizeof(*s.seen));
    s.saddle = calloc(points, sizeof(*s.saddle));
    if (s.seen && s.saddle)
        err = board->kind == SST_BOARD_CHESSBOARD ? detect_chessboard(&s, out, outcome, cfg)
                                                  : detect_markers(&s, out, outcome, cfg);
    free(s.anchor);
    free(s.seen);
    free(s.saddle);
    return err;
}

int sst_board_detect(const struct sst_board *board, const struct sst_image *image, const struct sst_detect_config *cfg,
                     struct sst_detection *out, enum sst_detect_outcome *outcome)
{
    enum sst_detect_outcome what = SST_DETECT_NONE;
    struct sst_detection found = { 0 };
    struct sst_map_u8 luma;
    int err = sst_luma(&luma, image);

    if (err)
        return err;
    err = detect(board, &luma, cfg, &found, &what);
    sst_map_u8_fini(&luma);
    if (err == -EINVAL) { /* OpenCV rejects the picture: nothing can be detected in it */
        err = 0;
        what = SST_DETECT_NONE;
    }
    if (err)
        return err;
    *out = found;
    *outcome = what;
    return 0;
}

void sst_detection_fini(struct sst_detection *detection)
{
    free(detection->corner);
    *detection = (struct sst_detection){ 0 };
}
