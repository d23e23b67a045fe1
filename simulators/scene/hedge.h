/* simulators/scene/hedge.h - a hedge in the wind before a wall, with a person between them: pictures of an array, drawn
 * in milliseconds.
 *
 * Every leaf has its own disparity and swings with its twig and by itself; gusts come and go. Cameras are ideal ones
 * with noise. Positions are in px of the reference view, the middle of the grid. The scene `hedge` of simulated worlds
 * is drawn by it, and the hours of simulated time of `make bench-watch`. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_SIMULATORS_SCENE_HEDGE_H
#define SST_SIMULATORS_SCENE_HEDGE_H

#include <stdbool.h>
#include <stdint.h>

#include "pipeline/image/image.h"

#define SST_HEDGE_WIDTH_MAX 640

struct sst_hedge; /* opaque; one thread */

struct sst_hedge_config {
    int rows, cols, width, height;
    uint64_t seed;
    double cover;                       /* fraction of the hedge's area that leaves cover, 0..0.95 */
    double wind;                        /* 0: still; 1: a breeze that swings twigs by 1 px, gusts by 4 px */
    double light;                       /* 1: day; 0.2: night */
    double noise;                       /* standard deviation of a pixel, levels of 255 */
    double near_px, spread_px, wall_px; /* disparities of the nearest leaves, of the hedge's depth, and of the wall */
    double period_s;                    /* the wind repeats; 0: never */
    bool fine;                          /* leaves with veins and people of flesh; false: flat shapes, which are fast */
};

struct sst_hedge_person {
    double x, foot, height; /* px: middle, lower edge, size */
    double disp_px;
    double stride; /* rad: phase of the legs; constant: stands */
    int clothes;   /* colours: any number */
};

/** Day, a breeze, 65 % cover, 6x6 views of 320x240, flat shapes. */
void sst_hedge_config_defaults(struct sst_hedge_config *cfg);

/** @return 0, -EINVAL (sizes, cover), -ENOMEM; not logged */
SST_MUST_CHECK int sst_hedge_create(struct sst_hedge **out, const struct sst_hedge_config *cfg);
void sst_hedge_destroy(struct sst_hedge *h); /* NULL is fine */

/** Another drawer of the same hedge, for another thread; takes a hundredth of the time. @param from  must outlive it @return 0, -ENOMEM */
SST_MUST_CHECK int sst_hedge_share(struct sst_hedge **out, const struct sst_hedge *from);

/** Offset of a view from the reference view, spacings. */
void sst_hedge_offset(const struct sst_hedge *h, int view, double *bx, double *by);

/** Fraction of the hedge's area that leaves cover without wind. */
double sst_hedge_cover(const struct sst_hedge *h);

/**
 * Draw all views. The same time, person and configuration give the same bytes.
 *
 * @param image    out [rows * cols], of the configured size
 * @param visible  out, fraction of the person that the reference view sees; may be NULL
 * @param person   NULL: no person
 */
void sst_hedge_draw(struct sst_hedge *h, double t_s, const struct sst_hedge_person *person, struct sst_image *image,
                    double *visible);

/** Draw one view, without noise. */
void sst_hedge_draw_view(struct sst_hedge *h, double t_s, const struct sst_hedge_person *person, int view,
                         struct sst_image *image);

/* --- the scene of simulated worlds -------------------------------------------------------------------------------- */

#define SST_HEDGE_PERIOD_S 4.0   /* of the wind */
#define SST_HEDGE_PASS_S   8.0   /* in which a person passes: two periods */
#define SST_HEDGE_FOCAL    1200  /* of a picture 1000 px wide */
#define SST_HEDGE_SPACING  100.0 /* mm; the hedge is 3.2 to 4.3 m away, the passer-by 7.7 m, the wall 19 m */

/** @param cfg  in: rows, cols, width, height, seed; out: all */
void sst_hedge_scene_config(struct sst_hedge_config *cfg);

/** The passer-by at 0 <= t_s < SST_HEDGE_PASS_S. */
struct sst_hedge_person sst_hedge_passer_by(const struct sst_hedge_config *cfg, double t_s);

#endif
