/* White patches of boards: located by the corners around them, measured in linear light. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "base/mem.h"
#include "pipeline/calibration/photometric/photometric.h"
#include "pipeline/image/srgb.h"

#define CLIPPED_CODE  254  /* a pixel this bright may have been brighter */
#define CLIPPED_SHARE 0.01 /* noise may reach it; more pixels mean a clipped patch */
#define UNEVEN        0.1  /* standard deviation over mean: beyond: occluded, or a highlight */
#define DARK          0.004
#define CONTRAST      2.0 /* white over black squares, at least */
#define FEWEST_PIXELS 12
#define USUAL_BLUR_PX 0.8

/* A quadrilateral between four points of the board, as the unit square: corners clockwise from (0, 0). Pixels between
 * the margins outside and inside (of a marker in the middle; inner 0: none) belong to it. */
struct patch {
    int id;
    bool odd;     /* chessboards: squares of one colour, either */
    double inner; /* half side of the part in the middle that is not white, 0..0.5 */
    const struct sst_corner *corner[4];
};

struct measured {
    int pixels, clipped;
    double x, y, linear[3], uneven; /* means; uneven: standard deviation over mean, of green */
};

struct pictured {
    const struct sst_image *image;
    double blur_px;
    double light[256];
};

/* --- one patch --------------------------------------------------------------------------------------------------- */

/* Homography of the unit square to the quadrilateral (Heckbert 1989), inverted up to scale. @return false: not convex,
 * or next to nothing */
static bool unit_from_image(const struct patch *p, double inverse[9])
{
    const struct sst_corner *const *q = p->corner;
    const double dx1 = q[1]->x - q[2]->x, dx2 = q[3]->x - q[2]->x, sx = q[0]->x - q[1]->x + q[2]->x - q[3]->x;
    const double dy1 = q[1]->y - q[2]->y, dy2 = q[3]->y - q[2]->y, sy = q[0]->y - q[1]->y + q[2]->y - q[3]->y;
    const double det = dx1 * dy2 - dx2 * dy1;
    double a, b, c, d, e, f, g, h;

    for (int i = 0; i < 4; i++) { /* all corners turn the same way, with a margin */
        const struct sst_corner *o = q[i], *m = q[(i + 1) & 3], *n = q[(i + 2) & 3];

        if (!((m->x - o->x) * (n->y - m->y) - (m->y - o->y) * (n->x - m->x) > 4))
            return false;
    }
    g = (sx * dy2 - dx2 * sy) / det;
    h = (dx1 * sy - sx * dy1) / det;
    a = q[1]->x - q[0]->x + g * q[1]->x;
    b = q[3]->x - q[0]->x + h * q[3]->x;
    c = q[0]->x;
    d = q[1]->y - q[0]->y + g * q[1]->y;
    e = q[3]->y - q[0]->y + h * q[3]->y;
    f = q[0]->y;
    inverse[0] = e - f * h;
    inverse[1] = c * h - b;
    inverse[2] = b * f - c * e;
    inverse[3] = f * g - d;
    inverse[4] = a - c * g;
    inverse[5] = c * d - a * f;
    inverse[6] = d * h - e * g;
    inverse[7] = b * g - a * h;
    inverse[8] = a * e - b * d;
    return true;
}

static double side_px(const struct patch *p, int i)
{
    return hypot(p->corner[(i + 1) & 3]->x - p->corner[i]->x, p->corner[(i + 1) & 3]->y - p->corner[i]->y);
}

/*
 * Distance to keep from the edges in units of the square's width and height. Where the white rim around a marker is
 * thin it is measured closer to the edges: light that leaks over them is much the same in all cameras. @return false:
 * too thin
 */
static bool margins(const struct patch *p, double blur_px, double margin[2])
{
    const double wide = fmin(side_px(p, 0), side_px(p, 2)), high = fmin(side_px(p, 1), side_px(p, 3));
    const double rim_px = (0.5 - p->inner) * fmin(wide, high);
    const double keep_px = fmin(1 + 2.5 * blur_px, 0.5 * rim_px - 0.75);

    if (!(keep_px >= 0.5 + 1.5 * blur_px))
        return false;
    margin[0] = keep_px / wide;
    margin[1] = keep_px / high;
    return true;
}

static bool is_inside(const struct patch *p, const double margin[2], double u, double v)
{
    const double from_x = fabs(u - 0.5), from_y = fabs(v - 0.5);

    if (!(from_x <= 0.5 - margin[0]) || !(from_y <= 0.5 - margin[1]))
        return false;
    return !(p->inner > 0) || from_x >= p->inner + margin[0] || from_y >= p->inner + margin[1];
}

static void add_pixel(struct measured *m, double *square, const struct pictured *in, int x, int y)
{
    double green = 0;

    m->pixels++;
    m->x += x;
    m->y += y;
    for (int c = 0; c < 3; c++) {
        const uint8_t code = sst_image_row(in->image, c, y)[x];

        m->clipped += code >= CLIPPED_CODE;
        m->linear[c] += in->light[code];
        green = c == 1 ? in->light[code] : green;
    }
    *square += green * green;
}

/* @return false: too small, or outside the picture */
static bool measure(const struct patch *p, const struct pictured *in, struct measured *out)
{
    struct measured m = { 0 };
    double to_unit[9], margin[2], square = 0, x0 = INFINITY, x1 = -INFINITY, y0 = INFINITY, y1 = -INFINITY, variance;

    for (int i = 0; i < 4; i++) {
        x0 = fmin(x0, p->corner[i]->x);
        x1 = fmax(x1, p->corner[i]->x);
        y0 = fmin(y0, p->corner[i]->y);
        y1 = fmax(y1, p->corner[i]->y);
    }
    if (!(x0 >= 0 && y0 >= 0 && x1 <= in->image->width - 1 && y1 <= in->image->height - 1) ||
        !unit_from_image(p, to_unit) || !margins(p, in->blur_px, margin))
        return false;
    for (int y = (int)y0; y <= (int)y1; y++) {
        for (int x = (int)x0; x <= (int)x1; x++) {
            const double w = to_unit[6] * x + to_unit[7] * y + to_unit[8];
            const double inverse = w != 0 ? 1 / w : 0; /* 0: on the board's horizon, where u = v = 0 keeps it out */
            const double u = (to_unit[0] * x + to_unit[1] * y + to_unit[2]) * inverse;
            const double v = (to_unit[3] * x + to_unit[4] * y + to_unit[5]) * inverse;

            if (is_inside(p, margin, u, v))
                add_pixel(&m, &square, in, x, y);
        }
    }
    if (m.pixels < FEWEST_PIXELS)
        return false;
    m.x /= m.pixels;
    m.y /= m.pixels;
    for (int c = 0; c < 3; c++)
        m.linear[c] /= m.pixels;
    variance = square / m.pixels - m.linear[1] * m.linear[1];
    m.uneven = m.linear[1] > 0 ? sqrt(fmax(variance, 0)) / m.linear[1] : INFINITY;
    *out = m;
    return true;
}

/* --- the patches of a board -------------------------------------------------------------------------------------- */

/* Squares between inner corners, black and white ones. */
static int list_squares(struct patch *list, const struct sst_board *b, const struct sst_corner *const *corner)
{
    const int cols = b->cols - 1;
    int n = 0;

    for (int id = 0; id < cols * (b->rows - 2); id++) {
        struct patch p = { .id = id, .odd = (id % cols + id / cols) & 1 };

        if (id % cols == cols - 1)
            continue;
        p.inner = b->kind == SST_BOARD_CHARUCO ? 0.5 * b->marker : 0;
        p.corner[0] = corner[id];
        p.corner[1] = corner[id + 1];
        p.corner[2] = corner[id + cols + 1];
        p.corner[3] = corner[id + cols];
        if (p.corner[0] && p.corner[1] && p.corner[2] && p.corner[3])
            list[n++] = p;
    }
    return n;
}

/* Gaps to the right of and below each tag, between its side and the next tag's. */
static int list_gaps(struct patch *list, const struct sst_board *b, const struct sst_corner *const *corner)
{
    int n = 0;

    for (int tag = 0; tag < b->cols * b->rows; tag++) {
        const int below = b->bottom_up ? tag - b->cols : tag + b->cols;
        const struct sst_corner *const *own = corner + 4 * tag;

        if (tag % b->cols < b->cols - 1 && own[1] && own[2] && own[4] && own[7])
            list[n++] = (struct patch){ .id = 2 * tag, .corner = { own[1], own[4], own[7], own[2] } };
        if (below >= 0 && below < b->cols * b->rows) {
            const struct sst_corner *const *other = corner + 4 * below;

            if (own[3] && own[2] && other[1] && other[0])
                list[n++] = (struct patch){ .id = 2 * tag + 1, .corner = { own[3], own[2], other[1], other[0] } };
        }
    }
    return n;
}

/* Which of a chessboard's two sets of squares is the white one: 0, 1, or -1 if ambiguous. Clipped and uneven
 * squares vote as well: a set of only such ones must not leave the other as the brighter one. */
static int white_set(const struct patch *list, const struct measured *m, int n)
{
    double sum[2] = { 0, 0 }, mean[2];
    int count[2] = { 0, 0 };

    for (int i = 0; i < n; i++) {
        if (!m[i].pixels)
            continue;
        sum[list[i].odd] += m[i].linear[1];
        count[list[i].odd]++;
    }
    if (!count[0] || !count[1])
        return -1;
    mean[0] = sum[0] / count[0];
    mean[1] = sum[1] / count[1];
    if (mean[0] > CONTRAST * mean[1])
        return 0;
    return mean[1] > CONTRAST * mean[0] ? 1 : -1;
}

static bool is_fair(const struct measured *m)
{
    if (!m->pixels || m->clipped > CLIPPED_SHARE * 3 * m->pixels || !(m->uneven <= UNEVEN))
        return false;
    return m->linear[0] >= DARK && m->linear[1] >= DARK && m->linear[2] >= DARK;
}

static int keep(struct sst_photometric_samples *all, const struct sst_photometric_sample *s)
{
    if (!sst_mem_grow(&all->sample, all->count, &all->capacity, sizeof(*all->sample)))
        return -ENOMEM;
    all->sample[all->count++] = *s;
    return 0;
}

/* Patches of a board. */
struct patches {
    const struct patch *list;
    struct measured *m; /* scratch [n] */
    int n;
    bool squares;
};

/* Measure all patches, keep the white and usable ones. */
static int keep_white(struct sst_photometric_samples *all, const struct patches *patches, const struct pictured *in,
                      const struct sst_detection *det)
{
    const struct patch *list = patches->list;
    struct measured *m = patches->m;
    const int n = patches->n;
    const int before = all->count;
    int white = 0;

    for (int i = 0; i < n; i++) {
        if (!measure(&list[i], in, &m[i]))
            m[i].pixels = 0;
    }
    if (patches->squares)
        white = white_set(list, m, n);
    for (int i = 0; i < n && white >= 0; i++) {
        struct sst_photometric_sample s = { det->view, det->frame, list[i].id, (float)m[i].x, (float)m[i].y, { 0 } };

        for (int c = 0; c < 3; c++)
            s.linear[c] = (float)m[i].linear[c];
        if ((patches->squares && list[i].odd != white) || !is_fair(&m[i]))
            continue;
        if (keep(all, &s)) {
            all->count = before;
            return -ENOMEM;
        }
    }
    return 0;
}

int sst_photometric_collect(struct sst_photometric_samples *all, const struct sst_board *board,
                            const struct sst_image *image, const struct sst_detection *det)
{
    const bool squares = board->kind != SST_BOARD_APRILGRID;
    const int points = squares ? (board->cols - 1) * (board->rows - 1) : 4 * board->cols * board->rows;
    const size_t most = (size_t)points + 1; /* patches: at most one each square, two each tag */
    struct pictured in = { .image = image, .blur_px = det->blur_px > 0 ? det->blur_px : USUAL_BLUR_PX };
    const struct sst_corner **corner;
    struct measured *measured;
    struct patch *list;
    int n, err = -ENOMEM;

    if (points < 4)
        return 0;
    corner = calloc(most, sizeof(*corner));
    list = calloc(most, sizeof(*list));
    measured = calloc(most, sizeof(*measured));
    if (corner && list && measured) {
        for (int i = 0; i < 256; i++)
            in.light[i] = sst_srgb_to_light(i / 255.0);
        for (int i = 0; i < det->corners; i++) {
            const struct sst_corner *c = &det->corner[i];

            if (c->id >= 0 && c->id < points && isfinite(c->x) && isfinite(c->y))
                corner[c->id] = c;
        }
        n = squares ? list_squares(list, board, corner) : list_gaps(list, board, corner);
        err = keep_white(all, &(struct patches){ list, measured, n, squares }, &in, det);
    }
    free(corner);
    free(list);
    free(measured);
    return err;
}

void sst_photometric_samples_fini(struct sst_photometric_samples *all)
{
    free(all->sample);
    *all = (struct sst_photometric_samples){ 0 };
}
