/*
 * Boards in an empty room, drawn without the general renderer. A pixel of the picture is made of 4x4 finer ones, two of
 * them inside it in each direction and one beyond on each side, weights 1 3 3 1; for each of them four samples on a
 * rotated grid determine whether the board is there, and whether it is white. With r = ((x-cx)/f, (y-cy)/f, 1) the ray
 * of a pixel, e the board's centre from the eye, u, v, n the axes of the board, w = 1/Z = n.r / n.e,  s = u.r / w -
 * u.e,  t = v.r / w - v.e.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "simulators/scene/world/world_internal.h"

#define FINE       2 /* fine pixels per pixel, along each side */
#define SAMPLES    4 /* samples per fine pixel */
#define REACH      (0.375 / FINE)
#define NEAREST_MM 1.0

static const double offset_x[SAMPLES] = { 0.125 / FINE, 0.375 / FINE, -0.125 / FINE, -0.375 / FINE };
static const double offset_y[SAMPLES] = { -0.375 / FINE, 0.125 / FINE, 0.375 / FINE, -0.125 / FINE };

/* c + x * pixel x + y * pixel y */
struct affine {
    double x, y, c;
};

struct drawing {
    const struct sim_board_view *v;
    struct affine w, s, t; /* 1/Z, u.r, v.r */
    double ue, ve;         /* u.e, v.e */
    double half_x, half_y; /* of the board with its margin, mm */
    int x0, y0, x1, y1;    /* pixels that the board may cover, ends excluded */
    int width, height;     /* of the fine pictures: (x1 - x0 + 1) * FINE, one fine pixel more on each side */
    float *there, *white;  /* [height][width] samples */
};

static double at(struct affine a, double x, double y)
{
    return a.x * x + a.y * y + a.c;
}

static struct affine along_ray(const struct sim_board_view *v, const double axis[3], double scale)
{
    const double x = axis[0] * scale / v->focal_px, y = axis[1] * scale / v->focal_px;

    return (struct affine){ x, y, axis[2] * scale - x * v->cx - y * v->cy };
}

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* Bounding box of the board in the picture. @return false: outside */
static bool find_box(struct drawing *d, const double e[3], const double u[3], const double t[3], int width, int height)
{
    const struct sim_board_view *v = d->v;
    const double blur = v->board->pose[v->pose].blur_px / 2;
    double lo_x = 1e9, hi_x = -1e9, lo_y = 1e9, hi_y = -1e9;
    bool near = false;

    for (int i = 0; i < 4; i++) {
        const double a = i & 1 ? d->half_x : -d->half_x, b = i & 2 ? d->half_y : -d->half_y;
        const double z = e[2] + a * u[2] + b * t[2];

        near = near || z < NEAREST_MM;
        if (near)
            break;
        lo_x = fmin(lo_x, v->cx + v->focal_px * (e[0] + a * u[0] + b * t[0]) / z);
        hi_x = fmax(hi_x, v->cx + v->focal_px * (e[0] + a * u[0] + b * t[0]) / z);
        lo_y = fmin(lo_y, v->cy + v->focal_px * (e[1] + a * u[1] + b * t[1]) / z);
        hi_y = fmax(hi_y, v->cy + v->focal_px * (e[1] + a * u[1] + b * t[1]) / z);
    }
    if (near) {
        lo_x = lo_y = 0;
        hi_x = width;
        hi_y = height;
    } else if (v->warp) {
        sst_scene_warp_box(v->warp, &lo_x, &hi_x, &lo_y, &hi_y);
    }
    d->x0 = (int)sst_clamp_double(floor(lo_x - blur) - 2, 0, width);
    d->x1 = (int)sst_clamp_double(ceil(hi_x + blur) + 3, 0, width);
    d->y0 = (int)sst_clamp_double(floor(lo_y) - 2, 0, height);
    d->y1 = (int)sst_clamp_double(ceil(hi_y) + 3, 0, height);
    d->width = (d->x1 - d->x0 + 1) * FINE;
    d->height = (d->y1 - d->y0 + 1) * FINE;
    return d->x0 < d->x1 && d->y0 < d->y1;
}

/* @return false: the board is not in the picture, or seen exactly edge on */
static bool prepare(struct drawing *d, const struct sim_board_view *v, int width, int height)
{
    const struct sst_sim_pose *p = &v->board->pose[v->pose];
    double r[9], e[3], board_x, board_y;

    sim_rotation(p->rotation_deg, r);

    const double u[3] = { r[0], r[3], r[6] }, t[3] = { r[1], r[4], r[7] }, n[3] = { r[2], r[5], r[8] };

    for (int i = 0; i < 3; i++)
        e[i] = p->position_mm[i] - v->eye_mm[i];
    if (dot(n, e) == 0)
        return false;
    sim_board_size(v->board, &board_x, &board_y);
    *d = (struct drawing){
        .v = v,
        .w = along_ray(v, n, 1 / dot(n, e)),
        .s = along_ray(v, u, 1),
        .t = along_ray(v, t, 1),
        .ue = dot(u, e),
        .ve = dot(t, e),
        .half_x = board_x / 2 + sim_board_margin(v->board),
        .half_y = board_y / 2 + sim_board_margin(v->board),
    };
    return find_box(d, e, u, t, width, height);
}

/* Index of the pixel before x, extrapolated beyond the outermost pixels, and the remainder. */
static int before(double x, int count, double *rest)
{
    const int i = sst_clamp_int((int)floor(x), 0, sst_max_int(0, count - 2));

    *rest = x - i;
    return i;
}

/* A row of the warp interpolated at y. @param out  columns 0 .. width */
static void warp_row(const float *map, int width, int height, double y, double *out)
{
    double rest;
    const float *up = map + (size_t)before(y, height, &rest) * (size_t)width, *down = height > 1 ? up + width : up;

    for (int x = 0; x < width; x++)
        out[x] = up[x] + rest * (down[x] - up[x]);
    out[width] = out[width - 1]; /* for pictures one pixel wide */
}

/* Count the samples of a fine pixel at (x, y) in the ideal picture. */
static void sample(const struct drawing *d, double x, double y, float *there, float *white)
{
    const struct sim_board_view *v = d->v;
    const double w = at(d->w, x, y);
    double z, s, t, reach_x, reach_y, clear;

    if (!(w > 0)) /* behind the camera */
        return;
    z = 1 / w;
    s = at(d->s, x, y) * z;
    t = at(d->t, x, y) * z;
    if (v->eye_mm[2] + z > v->wall_mm || v->eye_mm[1] + (y - v->cy) / v->focal_px * z > v->floor_mm)
        return;
    reach_x = 1.05 * REACH * z * (fabs(d->s.x - s * d->w.x) + fabs(d->s.y - s * d->w.y));
    reach_y = 1.05 * REACH * z * (fabs(d->t.x - t * d->w.x) + fabs(d->t.y - t * d->w.y));
    if (fabs(s - d->ue) > d->half_x + reach_x || fabs(t - d->ve) > d->half_y + reach_y)
        return;
    if (fabs(s - d->ue) < d->half_x - reach_x && fabs(t - d->ve) < d->half_y - reach_y) {
        const bool is_white = sim_board_white(v->board, s - d->ue, t - d->ve, &clear);

        if (clear > fmax(reach_x, reach_y)) {
            *there = SAMPLES;
            *white = is_white ? SAMPLES : 0;
            return;
        }
    }
    for (int k = 0; k < SAMPLES; k++) {
        const double px = x + offset_x[k], py = y + offset_y[k], near = at(d->w, px, py);
        double sx, sy;

        if (!(near > 0))
            continue;
        sx = at(d->s, px, py) / near - d->ue;
        sy = at(d->t, px, py) / near - d->ve;
        if (fabs(sx) > d->half_x || fabs(sy) > d->half_y)
            continue;
        *there += 1;
        *white += sim_board_white(v->board, sx, sy, &clear);
    }
}

/*
 * Fine pixel (i, j) is at (x0 + (i - 0.5) / 2 - 0.5, ...): the first one is the one beyond pixel x0. Its position in
 * the ideal picture is interpolated between the surrounding pixels.
 * @param rows  room for [2][width + 1]
 */
static void sample_all(struct drawing *d, int width, int height, double *rows)
{
    const struct sst_scene_warp *warp = d->v->warp;
    double *const row_x = rows, *const row_y = rows + width + 1;

    for (int j = 0; j < d->height; j++) {
        const double y = d->y0 + (j - 0.5) / FINE - 0.5;
        const size_t k = (size_t)j * (size_t)d->width;

        if (warp) {
            warp_row(warp->x, width, height, y, row_x);
            warp_row(warp->y, width, height, y, row_y);
        }
        for (int i = 0; i < d->width; i++) {
            const double x = d->x0 + (i - 0.5) / FINE - 0.5;
            double rest, at_x = x, at_y = y;

            if (warp) {
                const int left = before(x, width, &rest);

                at_x = row_x[left] + rest * (row_x[left + 1] - row_x[left]);
                at_y = row_y[left] + rest * (row_y[left + 1] - row_y[left]);
            }
            sample(d, at_x, at_y, &d->there[k + (size_t)i], &d->white[k + (size_t)i]);
        }
    }
}

/* Mean over `blur` fine pixels of each row, pixels at the ends by their share. */
static void blur_rows(float *map, int width, int height, double blur, double *sums)
{
    for (int y = 0; y < height; y++) {
        float *row = map + (size_t)y * (size_t)width;

        sums[0] = 0;
        for (int x = 0; x < width; x++)
            sums[x + 1] = sums[x] + row[x];
        for (int x = 0; x < width; x++) {
            const double ends[2] = { sst_clamp_double(x + 0.5 - blur / 2, 0, width),
                                     sst_clamp_double(x + 0.5 + blur / 2, 0, width) };
            double sum[2];

            for (int k = 0; k < 2; k++) {
                const int whole = sst_min_int((int)ends[k], width - 1);

                sum[k] = sums[whole] + (ends[k] - whole) * (sums[whole + 1] - sums[whole]);
            }
            row[x] = (float)((sum[1] - sum[0]) / blur);
        }
    }
}

static void blend(const struct drawing *d, struct sst_image *image)
{
    static const float weight[4] = { 1, 3, 3, 1 };

    for (int y = d->y0; y < d->y1; y++) {
        for (int x = d->x0; x < d->x1; x++) {
            float there = 0, white = 0;

            for (int j = 0; j < 4; j++) {
                const size_t k = (size_t)((y - d->y0) * FINE + j) * (size_t)d->width + (size_t)((x - d->x0) * FINE);

                for (int i = 0; i < 4; i++) {
                    there += weight[j] * weight[i] * d->there[k + (size_t)i];
                    white += weight[j] * weight[i] * d->white[k + (size_t)i];
                }
            }
            there /= 64 * SAMPLES;
            white /= 64 * SAMPLES;
            for (int c = 0; c < 3 && there > 0; c++) {
                uint8_t *p = &sst_image_row(image, c, y)[x];

                *p = (uint8_t)(white * SST_SIM_BOARD_WHITE + (there - white) * SST_SIM_BOARD_BLACK + (1 - there) * *p +
                               0.5f);
            }
        }
    }
}

int sim_board_draw(const struct sim_board_view *v, struct sst_image *image)
{
    const double blur = v->board->pose[v->pose].blur_px * FINE;
    struct drawing d;
    size_t pixels;
    double *rows;
    int err = 0;

    if (!prepare(&d, v, image->width, image->height))
        return 0;
    pixels = (size_t)d.width * (size_t)d.height;
    d.there = calloc(2 * pixels, sizeof(*d.there));
    rows = calloc(2 * (size_t)sst_max_int(d.width, image->width) + 2, sizeof(*rows));
    if (d.there && rows) {
        d.white = d.there + pixels;
        sample_all(&d, image->width, image->height, rows);
        if (blur > 0) {
            blur_rows(d.there, d.width, d.height, blur, rows);
            blur_rows(d.white, d.width, d.height, blur, rows);
        }
        blend(&d, image);
    } else {
        err = -ENOMEM;
    }
    free(rows);
    free(d.there);
    return err;
}
