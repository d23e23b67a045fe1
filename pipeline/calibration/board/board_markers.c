/* Markers of ChArUco boards and AprilGrids, read and kept as far as they agree on one pose of the board. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/calibration/board/board_internal.h"
#include "pipeline/calibration/board/homography.h"

#define TRIES                200
#define GOOD_ENOUGH          6    /* agreeing markers: the larger picture is not searched */
#define MARKER_CORNER_WEIGHT 0.02 /* such a corner is about a pixel off, a refined point less than a tenth */

/* A marker that was read, and where it is on the board. */
struct match {
    struct sst_board_marker on;
    double seen[4][2];
    bool good;
};

/* --- which markers agree ----------------------------------------------------------------------------------------- */

/* True if h predicts each corner of the marker to within half a marker. */
static bool fits(const struct match *m, const double h[9])
{
    for (int k = 0; k < 4; k++) {
        const double *next = m->seen[(k + 1) % 4];
        const double side = hypot(next[0] - m->seen[k][0], next[1] - m->seen[k][1]);
        double px[2];

        if (!sst_homography_apply(h, m->on.corner[k], px) ||
            !(hypot(px[0] - m->seen[k][0], px[1] - m->seen[k][1]) < side / 2))
            return false;
    }
    return true;
}

static int mark(struct match *m, int n, const double h[9])
{
    int count = 0;

    for (int i = 0; i < n; i++) {
        m[i].good = fits(&m[i], h);
        count += m[i].good;
    }
    return count;
}

static bool fit_pair(double h[9], const struct match *a, const struct match *b)
{
    double from[8][2], to[8][2];

    memcpy(from, a->on.corner, sizeof(a->on.corner));
    memcpy(from + 4, b->on.corner, sizeof(b->on.corner));
    memcpy(to, a->seen, sizeof(a->seen));
    memcpy(to + 4, b->seen, sizeof(b->seen));
    return sst_homography_fit(h, (const double(*)[2])from, (const double(*)[2])to, NULL, 8);
}

/* Refit to all inliers and reclassify. @return number of inliers, or -ENOMEM */
static int refit(struct match *m, int n, double h[9])
{
    double(*from)[2] = malloc(8 * (size_t)n * sizeof(*from)), (*to)[2];
    int count = mark(m, n, h);

    if (!from)
        return -ENOMEM;
    to = from + 4 * n;
    for (int round = 0; round < 3; round++) {
        int k = 0;

        for (int i = 0; i < n; i++) {
            if (m[i].good) {
                memcpy(from + k, m[i].on.corner, sizeof(m[i].on.corner));
                memcpy(to + k, m[i].seen, sizeof(m[i].seen));
                k += 4;
            }
        }
        if (!sst_homography_fit(h, (const double(*)[2])from, (const double(*)[2])to, NULL, k))
            break;
        count = mark(m, n, h);
    }
    free(from);
    return count;
}

/* Find the largest set of markers that one homography explains, and mark it as inliers. Candidate homographies come
 * from pairs of markers, the most distant first: these extrapolate best. @return number of inliers, at least 2, or 0,
 * or -ENOMEM */
static int agree(struct match *m, int n)
{
    double best[9], h[9];
    int most = 1, tries = 0;

    for (int apart = n - 1; apart > 0 && tries < TRIES && 10 * most < 9 * n; apart--) {
        for (int i = 0; i + apart < n && tries < TRIES; i++, tries++) {
            int count;

            if (!fit_pair(h, &m[i], &m[i + apart]))
                continue;
            count = mark(m, n, h);
            if (count > most) {
                most = count;
                memcpy(best, h, sizeof(best));
            }
        }
    }
    return most < 2 ? 0 : refit(m, n, best);
}

/* --- reading ----------------------------------------------------------------------------------------------------- */

static int by_number(const void *a, const void *b)
{
    const struct cv_marker *x = a, *y = b;

    return (x->id > y->id) - (x->id < y->id);
}

/* Match the markers read to the board. One read at two places matches twice: at most one will agree. */
static int match_markers(struct match *out, const struct cv_marker *read, int n, const struct sst_board_marker *on,
                         int markers)
{
    int count = 0;

    for (int i = 0; i < n; i++) {
        for (int k = 0; k < markers; k++) {
            if (on[k].number != read[i].id)
                continue;
            out[count].on = on[k];
            for (int c = 0; c < 4; c++) {
                for (int axis = 0; axis < 2; axis++)
                    out[count].seen[c][axis] = read[i].corner[c][axis];
            }
            count++;
        }
    }
    return count;
}

int read_markers(struct cv_marker *read, const struct sst_map_u8 *luma, int dictionary, int border, bool touching)
{
    int kept = 0;
    const int n = touching ? cv_touching_tags(read, SST_MARKERS_MAX, luma, dictionary, border)
                           : cv_markers(read, SST_MARKERS_MAX, luma, dictionary, border);

    if (n < 0)
        return n;
    qsort(read, (size_t)n, sizeof(*read), by_number);
    for (int i = 0; i < n; i++) { /* the contours of both sides of an edge give the same tag twice */
        const bool again = kept > 0 && read[kept - 1].id == read[i].id &&
                           hypotf(read[kept - 1].corner[0][0] - read[i].corner[0][0],
                                  read[kept - 1].corner[0][1] - read[i].corner[0][1]) < 8;

        if (!again)
            read[kept++] = read[i];
    }
    return kept;
}

/* Corners of a reduced picture in the whole one. */
static void enlarge(struct match *m, int n, double scale)
{
    for (int i = 0; i < n; i++) {
        for (int c = 0; c < 4; c++) {
            for (int axis = 0; axis < 2; axis++)
                m[i].seen[c][axis] = scale * (m[i].seen[c][axis] + 0.5) - 0.5;
        }
    }
}

static int keep_anchors(struct sighting *s, const struct match *m, int n, int good)
{
    struct anchor *anchor = malloc(4 * (size_t)good * sizeof(*anchor));

    if (!anchor)
        return -ENOMEM;
    free(s->anchor);
    s->anchor = anchor;
    s->anchors = 0;
    for (int i = 0; i < n; i++) {
        for (int k = 0; k < 4 && m[i].good; k++) {
            struct anchor *a = &s->anchor[s->anchors++];

            memcpy(a->board, m[i].on.corner[k], sizeof(a->board));
            memcpy(a->px, m[i].seen[k], sizeof(a->px));
            a->weight = MARKER_CORNER_WEIGHT;
        }
    }
    return good;
}

int place_markers(struct sighting *s, const struct cv_marker *read, int n, double scale)
{
    const int markers = sst_max_int(sst_board_markers(NULL, s->board, false), sst_board_markers(NULL, s->board, true));
    struct sst_board_marker *on = malloc(((size_t)markers + 1) * sizeof(*on));
    struct match *m = malloc(((size_t)n + 1) * sizeof(*m));
    int best = on && m ? s->anchors / 4 : -ENOMEM;

    for (int other = 0; other < 2 && best >= 0; other++) {
        const int known = match_markers(m, read, n, on, sst_board_markers(on, s->board, other));
        int good;

        enlarge(m, known, scale);
        good = agree(m, known);
        if (good < 0) {
            best = good;
        } else if (good > best) {
            best = keep_anchors(s, m, known, good);
            s->other = other;
        }
    }
    free(on);
    free(m);
    return best;
}

int find_markers(struct sighting *s, bool quick, int *decoded)
{
    int border, dictionary = sst_board_dictionary(s->board, &border), best;
    struct cv_marker *read = malloc(SST_MARKERS_MAX * sizeof(*read));
    struct pyramid p;

    *decoded = 0;
    if (!read)
        return -ENOMEM;
    best = pyramid_init(&p, s->luma);
    for (int n = p.levels - 1; n >= 0 && best >= 0 && best < GOOD_ENOUGH; n--) {
        const int count = read_markers(read, p.level[n], dictionary, border, s->board->kind == SST_BOARD_APRILGRID);

        best = count < 0 ? count : place_markers(s, read, count, 1 << n);
        *decoded = sst_max_int(*decoded, count);
        if (quick)
            break;
    }
    pyramid_fini(&p);
    free(read);
    return best;
}
