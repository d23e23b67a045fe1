/* tests/board_scene.h - exact pictures of calibration boards: through a lens, blurred, noisy. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_TESTS_BOARD_SCENE_H
#define SST_TESTS_BOARD_SCENE_H

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/calibration/board/print.h"
#include "pipeline/camera/calib.h"
#include "pipeline/image/image.h"
#include "tests/camera_project.h"
#include "tests/random.h"

#define SCENE_FINE 5 /* samples along a side of a pixel */

struct board_scene {
    struct sst_board board;
    struct sst_calib_camera cam; /* lens and K; at the origin, unturned */
    double turn[3], at_mm[3];    /* of the board's middle: rotation vector, position */
    int width, height;
    double blur_px, motion_px[2]; /* sigma of a round blur; a straight path during the exposure */
    double noise;                 /* sigma, of 255 */
    double black, white, around;  /* linear light 0..1 of ink, paper and the background */
    double gamma;                 /* grey = 255 light^(1 / gamma) */
    double vignetting;            /* light lost in the corners */
    uint64_t seed;
};

static inline void board_scene_defaults(struct board_scene *s, const struct sst_board *board)
{
    *s = (struct board_scene){ .board = *board,
                               .width = 640,
                               .height = 480,
                               .blur_px = 0.5,
                               .black = 0.02,
                               .white = 0.7,
                               .around = 0.3,
                               .gamma = 2.2,
                               .seed = 1 };
    s->cam = (struct sst_calib_camera){ .known = true, .fx = 600, .fy = 600, .cx = 319.5, .cy = 239.5 };
    s->at_mm[2] = 1000;
    for (int i = 0; i < 3; i++)
        s->cam.rotation[4 * i] = 1;
}

/** Middle of the board in its own axes, mm. */
static inline void board_scene_middle(const struct sst_board *b, double out[2])
{
    double last[2];

    sst_board_point(b, b->kind == SST_BOARD_APRILGRID ? 4 * b->cols * b->rows - 2 : sst_board_points(b) - 1, last);
    out[0] = last[0] / 2;
    out[1] = last[1] / 2;
}

/** Board to camera: columns of the rotation for x and y, and the place of the board's origin. */
static inline void board_scene_pose(const struct board_scene *s, double m[9])
{
    double r[9], middle[2];

    sst_rotation_from_vector(s->turn, r);
    board_scene_middle(&s->board, middle);
    for (int i = 0; i < 3; i++) {
        m[3 * i] = r[3 * i];
        m[3 * i + 1] = r[3 * i + 1];
        m[3 * i + 2] = s->at_mm[i] - r[3 * i] * middle[0] - r[3 * i + 1] * middle[1];
    }
}

/** Where a place of the board is seen. */
static inline bool board_scene_project(const struct board_scene *s, const double p[2], double *x, double *y)
{
    double m[9], X[3];

    board_scene_pose(s, m);
    for (int i = 0; i < 3; i++)
        X[i] = m[3 * i] * p[0] + m[3 * i + 1] * p[1] + m[3 * i + 2];
    return camera_project(&s->cam, X, x, y);
}

/* The print as a texture whose dots are so small that all edges fall between them. */
struct scene_texture {
    struct sst_map_u8 dots;
    double dot_mm, first_mm[2];
};

static inline int scene_texture_init(struct scene_texture *t, const struct sst_board *b, double dot_mm)
{
    struct sst_print p;
    int err = sst_print_board(&p, b);

    if (err)
        return err;
    t->dot_mm = dot_mm;
    memcpy(t->first_mm, p.first_mm, sizeof(t->first_mm));
    err = sst_map_u8_init(&t->dots, (int)lround(p.width_mm / dot_mm), (int)lround(p.height_mm / dot_mm));
    for (int i = 0; i < p.count && !err; i++) {
        for (int y = (int)lround(p.rect[i].y / dot_mm); y < lround((p.rect[i].y + p.rect[i].height) / dot_mm); y++) {
            for (int x = (int)lround(p.rect[i].x / dot_mm); x < lround((p.rect[i].x + p.rect[i].width) / dot_mm); x++)
                sst_map_u8_row(&t->dots, y)[x] = 1;
        }
    }
    sst_print_fini(&p);
    return err;
}

static inline float scene_light(const struct board_scene *s, const struct scene_texture *t, double u, double v)
{
    const double x = floor((u + t->first_mm[0]) / t->dot_mm), y = floor((v + t->first_mm[1]) / t->dot_mm);

    if (!(x >= 0 && y >= 0 && x < t->dots.width && y < t->dots.height))
        return (float)s->around;
    return (float)(sst_map_u8_row(&t->dots, (int)y)[(int)x] ? s->black : s->white);
}

/* Board coordinates of a pixel's upper left corner; NAN where no ray is. */
static inline void scene_unproject(const struct board_scene *s, const double m[9], double x, double y, double out[2])
{
    double a, b, det, c[9];

    out[0] = out[1] = NAN;
    if (!sst_camera_undistort(&s->cam, x, y, &a, &b))
        return;
    /* The ray (a, b, 1) = m (u, v, 1) up to scale: by the adjoint of m. */
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            const int i1 = (i + 1) % 3, i2 = (i + 2) % 3, j1 = (j + 1) % 3, j2 = (j + 2) % 3;

            c[3 * j + i] = m[3 * i1 + j1] * m[3 * i2 + j2] - m[3 * i1 + j2] * m[3 * i2 + j1];
        }
    }
    det = c[6] * a + c[7] * b + c[8];
    out[0] = (c[0] * a + c[1] * b + c[2]) / det;
    out[1] = (c[3] * a + c[4] * b + c[5]) / det;
}

/* data becomes its convolution with a round normal distribution; other is as large and is used. */
static inline void scene_blur(float *data, float *other, int w, int h, double sigma)
{
    const int reach = (int)ceil(4 * sigma);
    const size_t bytes = (size_t)w * sizeof(*data);
    float sum = 0;

    for (int j = -reach; j <= reach; j++)
        sum += (float)exp(-j * j / (2 * sigma * sigma));
    memset(other, 0, bytes * (size_t)h);
    for (int y = 0; y < h; y++) {
        for (int j = -reach; j <= reach; j++) {
            const float k = (float)exp(-j * j / (2 * sigma * sigma)) / sum;
            const float *from = data + (size_t)sst_clamp_int(y + j, 0, h - 1) * (size_t)w;
            float *to = other + (size_t)y * (size_t)w;

            for (int x = 0; x < w; x++)
                to[x] += k * from[x];
        }
    }
    memset(data, 0, bytes * (size_t)h);
    for (int y = 0; y < h; y++) {
        float *to = data + (size_t)y * (size_t)w;
        const float *from = other + (size_t)y * (size_t)w;

        for (int j = -reach; j <= reach; j++) { /* beyond the sides it is as at them */
            const float k = (float)exp(-j * j / (2 * sigma * sigma)) / sum;
            const int x0 = sst_min_int(sst_max_int(-j, 0), w), x1 = sst_max_int(sst_min_int(w - j, w), 0);

            for (int x = 0; x < x0; x++)
                to[x] += k * from[0];
            for (int x = x0; x < x1; x++)
                to[x] += k * from[x + j];
            for (int x = x1; x < w; x++)
                to[x] += k * from[w - 1];
        }
    }
}

/** Draw. @param dot_mm  all edges of the print are at multiples of this. @return 0 or a negative errno */
static inline int board_scene_draw(struct sst_image *out, const struct board_scene *s, double dot_mm)
{
    const int w = s->width * SCENE_FINE, h = s->height * SCENE_FINE, steps = 24;
    const double reach = hypot(s->cam.cx, s->cam.cy);
    struct scene_texture t = { 0 };
    float *fine = NULL, *other = NULL;
    uint64_t rng = s->seed * 2654435761u + 12345;
    double m[9];
    int err = scene_texture_init(&t, &s->board, dot_mm);

    if (err)
        return err;
    fine = (float *)malloc((size_t)w * (size_t)h * sizeof(*fine));
    other = (float *)malloc((size_t)w * (size_t)h * sizeof(*other));
    board_scene_pose(s, m);
    for (int y = 0; y < s->height; y++) {
        double left[2][2], right[2][2];

        for (int x = 0; x < s->width; x++) {
            if (x == 0) {
                scene_unproject(s, m, -0.5, y - 0.5, left[0]);
                scene_unproject(s, m, -0.5, y + 0.5, left[1]);
            }
            scene_unproject(s, m, x + 0.5, y - 0.5, right[0]);
            scene_unproject(s, m, x + 0.5, y + 0.5, right[1]);
            for (int k = 0; k < SCENE_FINE * SCENE_FINE; k++) {
                const double a = (k % SCENE_FINE + 0.5) / SCENE_FINE, b = (k / SCENE_FINE + 0.5) / SCENE_FINE;
                double p[2];

                for (int c = 0; c < 2; c++)
                    p[c] = (1 - b) * ((1 - a) * left[0][c] + a * right[0][c]) +
                           b * ((1 - a) * left[1][c] + a * right[1][c]);
                fine[(size_t)(y * SCENE_FINE + k / SCENE_FINE) * (size_t)w +
                     (size_t)(x * SCENE_FINE + k % SCENE_FINE)] = scene_light(s, &t, p[0], p[1]);
            }
            memcpy(left, right, sizeof(left));
        }
    }
    if (s->blur_px > 0)
        scene_blur(fine, other, w, h, s->blur_px * SCENE_FINE);
    free(other);
    err = sst_image_init(out, s->width, s->height);
    for (int y = 0; y < s->height && !err; y++) {
        for (int x = 0; x < s->width; x++) {
            const double r = hypot(x - s->cam.cx, y - s->cam.cy) / reach;
            const bool moves = s->motion_px[0] != 0 || s->motion_px[1] != 0;
            double sum = 0, grey;

            for (int k = 0; k < (moves ? steps : 1); k++) {
                const double path = moves ? (k + 0.5) / steps - 0.5 : 0;
                const int ox = x * SCENE_FINE + (int)lround(path * s->motion_px[0] * SCENE_FINE);
                const int oy = y * SCENE_FINE + (int)lround(path * s->motion_px[1] * SCENE_FINE);

                for (int i = 0; i < SCENE_FINE * SCENE_FINE; i++)
                    sum += fine[(size_t)sst_clamp_int(oy + i / SCENE_FINE, 0, h - 1) * (size_t)w +
                                (size_t)sst_clamp_int(ox + i % SCENE_FINE, 0, w - 1)] /
                           (float)(moves ? steps : 1);
            }
            sum *= (1 - s->vignetting * r * r) / (SCENE_FINE * SCENE_FINE);
            grey = 255 * pow(fmin(fmax(sum, 0), 1), 1 / s->gamma);
            if (s->noise > 0)
                grey += s->noise * test_normal(&rng);
            for (int c = 0; c < 3; c++)
                sst_image_row(out, c, y)[x] = (uint8_t)lround(fmin(fmax(grey, 0), 255));
        }
    }
    free(fine);
    sst_map_u8_fini(&t.dots);
    return err;
}

#endif
