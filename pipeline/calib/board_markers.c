/* Markers of ChArUco boards and AprilGrids: read, and only those believed that agree on where the board is. */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/calib/detect_parts.h"
#include "pipeline/calib/homography.h"
#include "pipeline/opencv_boards.h"

#define DECODED_MAX  1200
#define TRIES        200
#define GOOD_ENOUGH  6      /* markers that agree: no look at the larger picture */
#define MARKER_CORNER_WEIGHT 0.02 /* such a corner is about a pixel off, a refined point less than a tenth */
#define COARSE_SIDE  1100

/* A marker that was read, and where it is on the board. */
struct match {
    struct sst_board_marker on;
    double seen[4][2];
    bool good;
};

/* --- which markers agree ----------------------------------------------------------------------------------------- */

/* Is the marker where h puts it: each corner within half a marker? */
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

/* Fit to all good ones and mark again. @return how many are good, or -ENOMEM */
static int settle(struct match *m, int n, double h[9])
{
    double(*from)[2] = malloc(8 * (size_t)n * sizeof(*from)), (*to)[2] = from + 4 * n;
    int count = mark(m, n, h);

    if (!from)
        return -ENOMEM;
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

/* Mark as good the largest set of markers that one homography puts where they are. The pairs that it is taken from are
 * those far apart first: theirs reaches over the board. @return how many, at least 2, or 0, or -ENOMEM */
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
    return most < 2 ? 0 : settle(m, n, best);
}

/* --- reading ----------------------------------------------------------------------------------------------------- */

static int by_number(const void *a, const void *b)
{
    const struct sst_cv_marker *x = a, *y = b;

    return (x->id > y->id) - (x->id < y->id);
}

/* Where the markers that were read are on the board. Of one read twice the first counts, which of both it is matters
 * little: they lie on each other, or one of them is wrong and does not agree. */
static int match_markers(struct match *out, const struct sst_cv_marker *read, int n, const struct sst_board_marker *on,
                         int markers, double scale)
{
    int count = 0;

    for (int i = 0; i < n; i++) {
        for (int k = 0; k < markers; k++) {
            if (on[k].number != read[i].id)
                continue;
            out[count].on = on[k];
            for (int c = 0; c < 4; c++) {
                for (int axis = 0; axis < 2; axis++)
                    out[count].seen[c][axis] = scale * (read[i].corner[c][axis] + 0.5) - 0.5;
            }
            count++;
        }
    }
    return count;
}

static int read_markers(struct sst_cv_marker *read, const struct sst_map_u8 *luma, const struct sst_board *board)
{
    int border, dictionary = sst_board_dictionary(board, &border), n, kept = 0;

    n = board->kind == SST_BOARD_APRILGRID ? sst_cv_touching_tags(read, DECODED_MAX, luma, dictionary, border)
                                           : sst_cv_markers(read, DECODED_MAX, luma, dictionary, border);
    if (n < 0)
        return n;
    qsort(read, (size_t)n, sizeof(*read), by_number);
    for (int i = 0; i < n; i++) { /* contours of both sides of an edge give the same tag twice */
        const bool again = kept > 0 && read[kept - 1].id == read[i].id &&
                           hypotf(read[kept - 1].corner[0][0] - read[i].corner[0][0],
                                  read[kept - 1].corner[0][1] - read[i].corner[0][1]) < 8;

        if (!again)
            read[kept++] = read[i];
    }
    return kept;
}

static int keep_anchors(struct sst_sighting *s, const struct match *m, int n, int good)
{
    struct sst_anchor *anchor = malloc(4 * (size_t)good * sizeof(*anchor));

    if (!anchor)
        return -ENOMEM;
    free(s->anchor);
    s->anchor = anchor;
    s->anchors = 0;
    for (int i = 0; i < n; i++) {
        for (int k = 0; k < 4 && m[i].good; k++) {
            struct sst_anchor *a = &s->anchor[s->anchors++];

            memcpy(a->board, m[i].on.corner[k], sizeof(a->board));
            memcpy(a->px, m[i].seen[k], sizeof(a->px));
            a->weight = MARKER_CORNER_WEIGHT;
        }
    }
    return good;
}

/* One picture size. @return markers that agree, their anchors in s where they are more than best */
static int find_at(struct sst_sighting *s, const struct sst_map_u8 *luma, double scale, int best, int *decoded)
{
    const int markers = sst_board_markers(NULL, s->board, false) + sst_board_markers(NULL, s->board, true);
    struct sst_cv_marker *read = malloc(DECODED_MAX * sizeof(*read));
    struct sst_board_marker *on = malloc((size_t)markers * sizeof(*on));
    struct match *m = malloc(2 * DECODED_MAX * sizeof(*m));
    int n = -ENOMEM;

    if (read && on && m)
        n = read_markers(read, luma, s->board);
    if (n >= 0 && n > *decoded)
        *decoded = n;
    for (int other = 0; other < 2 && n > 0; other++) {
        const int known = match_markers(m, read, n, on, sst_board_markers(on, s->board, other), scale);
        const int good = agree(m, known);

        if (good < 0) {
            n = good;
        } else if (good > best) {
            best = keep_anchors(s, m, known, good);
            s->other = other;
            n = best < 0 ? best : n;
        }
    }
    free(read);
    free(on);
    free(m);
    return n < 0 ? n : best;
}

int sst_find_markers(struct sst_sighting *s, int *decoded)
{
    struct sst_map_u8 small[3] = { 0 };
    const struct sst_map_u8 *level[4] = { s->luma };
    int n = 0, best = 0;

    *decoded = 0;
    while (n < 3 && sst_max_int(level[n]->width, level[n]->height) > COARSE_SIDE && best >= 0) {
        best = sst_luma_halve(&small[n], level[n]);
        if (!best) {
            level[n + 1] = &small[n];
            n++;
        }
    }
    for (; n >= 0 && best >= 0 && best < GOOD_ENOUGH; n--)
        best = find_at(s, level[n], 1 << n, best, decoded);
    for (int i = 0; i < 3; i++)
        sst_map_u8_fini(&small[i]);
    return best;
}
