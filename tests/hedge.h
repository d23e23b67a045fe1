/* tests/hedge.h - a hedge in the wind before a wall, with a person between them: small pictures of an array,
 * drawn in milliseconds, for hours of simulated time.
 *
 * Every leaf has its own disparity and swings with its twig and by itself; gusts come and go. Pictures are those of
 * ideal cameras with noise, without JPEG. Positions are in px of the reference view, the middle of the grid. */
#ifndef SST_TESTS_HEDGE_H
#define SST_TESTS_HEDGE_H

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/image/image.h"
#include "simulators/scene/noise.h"

struct hedge; /* opaque; one thread */

struct hedge_config {
    int rows, cols, width, height;
    uint64_t seed;
    double cover;                       /* fraction of the hedge's area that leaves cover, 0..0.95 */
    double wind;                        /* 0: still; 1: a breeze that swings twigs by 1 px, gusts by 4 px */
    double light;                       /* 1: day; 0.2: night */
    double noise;                       /* standard deviation of a pixel, levels of 255 */
    double near_px, spread_px, wall_px; /* disparities of the nearest leaves, of the hedge's depth, and of the wall */
};

struct hedge_person {
    double x, foot, height; /* px: middle, lower edge, size */
    double disp_px;
    double stride; /* rad: phase of the legs; constant: stands */
    int clothes;   /* colours: any number */
};

#define HEDGE_TOP        0.15 /* of the picture, above the hedge */
#define HEDGE_TWIG_PX    18.0 /* of a picture 320 wide: leaves of one twig lie in cells of this size */
#define HEDGE_LEAF_SIDE  19   /* of a leaf's mask */
#define HEDGE_LEAF_KINDS 24
#define HEDGE_NOISE      65536
#define HEDGE_GUST_S     11.0
#define HEDGE_LEAVES     60000

struct hedge_leaf {
    float x, y, disp; /* at rest */
    float swing, phase, rate;
    uint32_t colour; /* 0xBBGGRR */
    uint8_t kind;
    uint16_t twig;
    int at_x, at_y, disp_q4; /* in the picture that is drawn, 1/16 px */
};

struct hedge_twig {
    double x, swing, phase, rate, dx, dy;
};

struct hedge_mask {
    int y0, y1;
    uint8_t from[HEDGE_LEAF_SIDE], to[HEDGE_LEAF_SIDE]; /* columns of each row */
};

struct hedge {
    struct hedge_config cfg;
    double scale;   /* of a picture 320 wide */
    uint32_t *wall; /* [wall_height][wall_width] */
    int wall_width, wall_height;
    int margin;
    struct hedge_mask mask[HEDGE_LEAF_KINDS];
    struct hedge_leaf *leaf;
    struct hedge_twig *twig;
    int leaves, twigs, twig_cols;
    int8_t noise[HEDGE_NOISE];
    uint32_t *canvas; /* [height][width] */
    double cover;
};

/** Day, a breeze, 65 % cover, 6x6 views of 320x240. */
static inline void hedge_config_defaults(struct hedge_config *cfg)
{
    *cfg = (struct hedge_config){ .rows = 6,
                                  .cols = 6,
                                  .width = 320,
                                  .height = 240,
                                  .seed = 1,
                                  .cover = 0.65,
                                  .wind = 1,
                                  .light = 1,
                                  .noise = 2,
                                  .near_px = 14,
                                  .spread_px = 3,
                                  .wall_px = 2 };
}

/** Offset of a view from the reference view, spacings. */
static inline void hedge_offset(const struct hedge *h, int view, double *bx, double *by)
{
    *bx = view % h->cfg.cols - (h->cfg.cols - 1) / 2;
    *by = view / h->cfg.cols - (h->cfg.rows - 1) / 2;
}

/** Fraction of the hedge's area that leaves cover without wind. */
static inline double hedge_cover(const struct hedge *h)
{
    return h->cover;
}

static uint8_t hedge_level(double v)
{
    return (uint8_t)sst_clamp_double(v + 0.5, 0, 255);
}

static uint32_t hedge_colour(double r, double g, double b)
{
    return hedge_level(r) | (uint32_t)hedge_level(g) << 8 | (uint32_t)hedge_level(b) << 16;
}

/* --- what does not move ------------------------------------------------------------------------------------------- */

/* Smooth in cells of `cell` px, -1..1. */
static double hedge_cloud(int x, int y, double cell, uint32_t seed)
{
    const double u = x / cell, v = y / cell;
    const int i = (int)floor(u), j = (int)floor(v);
    const double a = u - i, b = v - j;
    double at[2][2];

    for (int q = 0; q < 2; q++)
        for (int p = 0; p < 2; p++)
            at[q][p] = sst_noise_hash(i + p, j + q, 0, seed) * 0x1p-31 - 1;
    return (at[0][0] * (1 - a) + at[0][1] * a) * (1 - b) + (at[1][0] * (1 - a) + at[1][1] * a) * b;
}

/* Bricks above, grass below. */
static int hedge_make_wall(struct hedge *h)
{
    const struct hedge_config *c = &h->cfg;
    const double brick = 16 * h->scale;
    const uint32_t seed = (uint32_t)c->seed;

    h->margin = (int)ceil(fabs(c->wall_px) * sst_max_int(c->rows, c->cols) / 2) + 2;
    h->wall_width = c->width + 2 * h->margin;
    h->wall_height = c->height + 2 * h->margin;
    h->wall = malloc((size_t)h->wall_width * (size_t)h->wall_height * sizeof(*h->wall));
    for (int y = 0; y < h->wall_height && h->wall; y++) {
        for (int x = 0; x < h->wall_width; x++) {
            const bool grass = y > 0.78 * h->wall_height;
            const double row = y / (brick / 2), shift = fmod(floor(row), 2) / 2;
            const double col = x / brick + shift;
            const bool joint = !grass && (row - floor(row) < 0.2 || col - floor(col) < 0.1);
            const double stone = sst_noise_hash((int)floor(col), (int)floor(row), 0, seed + 7) * 0x1p-32 - 0.5;
            const double fine =
                10 * hedge_cloud(x, y, 2.3 * h->scale, seed + 1) + 12 * hedge_cloud(x, y, 21 * h->scale, seed + 2);
            const double base[3] = { grass   ? 85
                                     : joint ? 170
                                             : 150 + 40 * stone,
                                     grass   ? 110
                                     : joint ? 165
                                             : 105 + 30 * stone,
                                     grass   ? 60
                                     : joint ? 155
                                             : 85 + 30 * stone };

            h->wall[(size_t)y * (size_t)h->wall_width + (size_t)x] =
                hedge_colour(c->light * (base[0] + fine), c->light * (base[1] + fine), c->light * (base[2] + fine));
        }
    }
    return h->wall ? 0 : -ENOMEM;
}

/* Ellipses in many directions. */
static void hedge_make_masks(struct hedge *h, uint64_t *seed)
{
    const double middle = (HEDGE_LEAF_SIDE - 1) / 2.0;

    for (int i = 0; i < HEDGE_LEAF_KINDS; i++) {
        const double turn = M_PI * i / HEDGE_LEAF_KINDS, a = h->scale * sst_random_in(seed, 3.2, 4.4),
                     b = a * sst_random_in(seed, 0.4, 0.7);

        for (int y = 0; y < HEDGE_LEAF_SIDE; y++) {
            h->mask[i].from[y] = HEDGE_LEAF_SIDE;
            h->mask[i].to[y] = 0;
            for (int x = 0; x < HEDGE_LEAF_SIDE; x++) {
                const double u = (x - middle) * cos(turn) + (y - middle) * sin(turn);
                const double v = (y - middle) * cos(turn) - (x - middle) * sin(turn);

                if (u * u / (a * a) + v * v / (b * b) > 1)
                    continue;
                h->mask[i].from[y] = (uint8_t)sst_min_int(h->mask[i].from[y], x);
                h->mask[i].to[y] = (uint8_t)(x + 1);
            }
            if (h->mask[i].from[y] < h->mask[i].to[y]) {
                h->mask[i].y0 = h->mask[i].y1 ? h->mask[i].y0 : y;
                h->mask[i].y1 = y + 1;
            }
        }
    }
}

static void hedge_make_twigs(struct hedge *h, uint64_t *seed)
{
    for (int i = 0; i < h->twigs; i++) {
        h->twig[i] = (struct hedge_twig){ .x = (i % h->twig_cols) * HEDGE_TWIG_PX,
                                          .swing = sst_random_in(seed, 0.5, 1.5),
                                          .phase = sst_random_in(seed, 0, 2 * M_PI),
                                          .rate = sst_random_in(seed, 2.0, 5.0) };
    }
}

static int hedge_by_disparity(const void *a, const void *b)
{
    const struct hedge_leaf *x = a, *y = b;

    return (x->disp > y->disp) - (x->disp < y->disp);
}

static struct hedge_leaf hedge_random_leaf(const struct hedge *h, uint64_t *seed, double left, double right)
{
    const struct hedge_config *c = &h->cfg;
    const double depth = sst_random(seed), shade = sst_random_in(seed, 0.55, 1.15) * (1 - 0.4 * depth);
    struct hedge_leaf l = { .x = (float)sst_random_in(seed, left, right),
                            .y = (float)sst_random_in(seed, HEDGE_TOP * c->height, c->height + 20),
                            .disp = (float)(c->near_px - depth * c->spread_px),
                            .swing = (float)sst_random_in(seed, 0.1, 0.7),
                            .phase = (float)sst_random_in(seed, 0, 2 * M_PI),
                            .rate = (float)sst_random_in(seed, 5, 11),
                            .kind = (uint8_t)(sst_random(seed) * HEDGE_LEAF_KINDS) };
    const double tint = sst_random_in(seed, -12, 25);

    l.twig = (uint16_t)(sst_clamp_int((int)(l.y / (HEDGE_TWIG_PX * h->scale)), 0, h->twigs / h->twig_cols - 1) *
                            h->twig_cols +
                        sst_clamp_int((int)((l.x - left) / (HEDGE_TWIG_PX * h->scale)), 0, h->twig_cols - 1));
    l.colour = hedge_colour(c->light * shade * (75 + tint), c->light * shade * 125, c->light * shade * 45);
    return l;
}

/* Where a leaf's mask begins in a view. */
static void hedge_place(const struct hedge_leaf *l, int bx, int by, int *x, int *y)
{
    *x = (l->at_x - l->disp_q4 * bx + (1024 * 16 + 8)) / 16 - 1024 - HEDGE_LEAF_SIDE / 2;
    *y = (l->at_y - l->disp_q4 * by + (1024 * 16 + 8)) / 16 - 1024 - HEDGE_LEAF_SIDE / 2;
}

/* Add leaves until they cover the part of the reference view that the hedge takes. */
static int hedge_make_leaves(struct hedge *h, uint64_t *seed)
{
    const struct hedge_config *c = &h->cfg;
    const double reach = c->near_px * ((c->cols + 1) / 2) + 8;
    const int top = (int)(HEDGE_TOP * c->height) + 4;
    const int64_t all = (int64_t)c->width * (c->height - top);
    uint8_t *covered = calloc((size_t)c->width * (size_t)c->height, 1);
    int64_t count = 0;

    while (covered && (double)count < c->cover * (double)all && h->leaves < HEDGE_LEAVES) {
        struct hedge_leaf *l = &h->leaf[h->leaves++];
        int x0, y0;

        *l = hedge_random_leaf(h, seed, -reach, c->width + reach);
        l->disp_q4 = (int)lround(16 * l->disp);
        l->at_x = (int)lround(16 * l->x);
        l->at_y = (int)lround(16 * l->y);
        hedge_place(l, 0, 0, &x0, &y0);
        for (int y = 0; y < HEDGE_LEAF_SIDE; y++) {
            for (int x = h->mask[l->kind].from[y]; x < h->mask[l->kind].to[y]; x++) {
                if (x0 + x < 0 || x0 + x >= c->width || y0 + y < top || y0 + y >= c->height)
                    continue;
                count += !covered[(size_t)(y0 + y) * (size_t)c->width + (size_t)(x0 + x)];
                covered[(size_t)(y0 + y) * (size_t)c->width + (size_t)(x0 + x)] = 1;
            }
        }
    }
    h->cover = (double)count / (double)all;
    qsort(h->leaf, (size_t)h->leaves, sizeof(*h->leaf), hedge_by_disparity);
    if (!covered)
        return -ENOMEM;
    free(covered);
    return 0;
}

static void hedge_make_noise(struct hedge *h, uint64_t *seed)
{
    for (int i = 0; i < HEDGE_NOISE; i++) {
        double sum = -6;

        for (int k = 0; k < 12; k++)
            sum += sst_random(seed);
        h->noise[i] = (int8_t)lround(sst_clamp_double(h->cfg.noise * sum, -127, 127));
    }
}

static inline void hedge_destroy(struct hedge *h)
{
    if (!h)
        return;
    free(h->wall);
    free(h->canvas);
    free(h->leaf);
    free(h->twig);
    free(h);
}

/** @return 0, -EINVAL (sizes, cover), -ENOMEM */
static inline int hedge_create(struct hedge **out, const struct hedge_config *cfg)
{
    struct hedge *h;
    uint64_t seed = cfg->seed * 977 + 5;
    int err = -ENOMEM;

    if (cfg->rows < 1 || cfg->cols < 1 || cfg->width < 32 || cfg->width > 640 || cfg->height < 24 ||
        !(cfg->cover >= 0 && cfg->cover <= 0.95))
        return -EINVAL;
    h = calloc(1, sizeof(*h));
    if (!h)
        return -ENOMEM;
    h->cfg = *cfg;
    h->scale = cfg->width / 320.0;
    h->twig_cols =
        (int)((cfg->width + 2 * (cfg->near_px * ((cfg->cols + 1) / 2) + 8)) / (HEDGE_TWIG_PX * h->scale)) + 1;
    h->twigs = h->twig_cols * ((int)(cfg->height / (HEDGE_TWIG_PX * h->scale)) + 2);
    h->leaf = calloc(HEDGE_LEAVES, sizeof(*h->leaf));
    h->twig = calloc((size_t)h->twigs, sizeof(*h->twig));
    h->canvas = malloc((size_t)cfg->width * (size_t)cfg->height * sizeof(*h->canvas));
    if (h->leaf && h->twig && h->canvas)
        err = hedge_make_wall(h);
    if (!err) {
        hedge_make_masks(h, &seed);
        hedge_make_twigs(h, &seed);
        hedge_make_noise(h, &seed);
        err = hedge_make_leaves(h, &seed);
    }
    if (err)
        hedge_destroy(h);
    else
        *out = h;
    return err;
}

/* --- what moves --------------------------------------------------------------------------------------------------- */

/* Strength of the wind at a place: calm and gusts of some seconds, which pass from left to right. */
static double hedge_gust(const struct hedge *h, double t_s, double x)
{
    const double u = t_s / HEDGE_GUST_S - x / 400;
    const int i = (int)floor(u);
    const double a = u - i, s = a * a * (3 - 2 * a);
    const double from = sst_noise_hash(i, 3, 0, (uint32_t)h->cfg.seed) * 0x1p-32;
    const double to = sst_noise_hash(i + 1, 3, 0, (uint32_t)h->cfg.seed) * 0x1p-32;
    const double now = from + (to - from) * s;

    return h->cfg.wind * (0.3 + 3.0 * now * now * now);
}

static void hedge_sway(struct hedge *h, double t_s)
{
    for (int i = 0; i < h->twigs; i++) {
        struct hedge_twig *w = &h->twig[i];
        const double g = hedge_gust(h, t_s, w->x) * w->swing * h->scale, p = w->phase + w->rate * t_s;

        w->dx = g * (sin(p) + 0.4 * sin(2.3 * p) + 0.5);
        w->dy = 0.4 * g * sin(p + 1);
    }
    for (int i = 0; i < h->leaves; i++) {
        struct hedge_leaf *l = &h->leaf[i];
        const struct hedge_twig *w = &h->twig[l->twig];
        const double own = l->swing * h->scale * fmin(h->cfg.wind, 2) * sin(l->phase + l->rate * t_s);

        l->at_x = (int)lround(16 * (l->x + w->dx + own));
        l->at_y = (int)lround(16 * (l->y + w->dy + own));
    }
}

/* --- drawing ------------------------------------------------------------------------------------------------------ */

static void hedge_draw_wall(const struct hedge *h, int bx, int by)
{
    const int dx = h->margin + (int)lround(h->cfg.wall_px * bx), dy = h->margin + (int)lround(h->cfg.wall_px * by);
    const size_t width = (size_t)h->cfg.width;

    for (int y = 0; y < h->cfg.height; y++)
        memcpy(h->canvas + (size_t)y * width, h->wall + (size_t)(y + dy) * (size_t)h->wall_width + dx,
               width * sizeof(*h->canvas));
}

/* The colour of a person at (u, v): u across, -0.5..0.5 of the height, v down, 0..1. @return false: nothing there */
static bool hedge_person_at(const struct hedge_person *p, double u, double v, double rgb[3])
{
    const uint32_t k = (uint32_t)p->clothes * 2654435761u;
    const double swing = 0.1 * sin(p->stride);
    const double head = hypot(u / 0.055, (v - 0.075) / 0.075), bent = (v - 0.5) * 2;
    const bool shirt = v > 0.15 && v < 0.53 && fabs(u) < 0.13 - 0.03 * (v - 0.15);
    const bool arm = v > 0.18 && v < 0.5 && fabs(fabs(u) - 0.145) < 0.03;
    const bool legs =
        v >= 0.5 && v <= 1 && (fabs(u - 0.06 + swing * bent) < 0.052 || fabs(u + 0.06 - swing * bent) < 0.052);

    if (head < 1) {
        for (int c = 0; c < 3; c++)
            rgb[c] = v < 0.05 ? 45 : (double[]){ 190, 150, 125 }[c];
        return true;
    }
    if (!shirt && !arm && !legs)
        return false;
    for (int c = 0; c < 3; c++)
        rgb[c] = (legs ? 30 : 25) + ((k >> (legs ? 8 * c + 3 : 8 * c)) & 255) * (legs ? 0.45 : 0.8);
    if (shirt && fmod(v * 40, 2) < 1)
        rgb[0] = rgb[0] * 0.85 + 10;
    return true;
}

static uint32_t hedge_person_colour(const struct hedge *h, const double rgb[3])
{
    return hedge_colour(h->cfg.light * rgb[0], h->cfg.light * rgb[1], h->cfg.light * rgb[2]);
}

static void hedge_draw_person(const struct hedge *h, const struct hedge_person *p, int bx, int by)
{
    const double x = p->x - p->disp_px * bx, y = p->foot - p->height - p->disp_px * by;
    const int x0 = sst_max_int((int)ceil(x - p->height / 4), 0);
    const int x1 = sst_min_int((int)floor(x + p->height / 4), h->cfg.width - 1);
    double rgb[3];

    for (int py = sst_max_int((int)ceil(y), 0); py < sst_min_int((int)floor(y + p->height), h->cfg.height); py++)
        for (int px = x0; px <= x1; px++)
            if (hedge_person_at(p, (px - x) / p->height, (py - y) / p->height, rgb))
                h->canvas[py * h->cfg.width + px] = hedge_person_colour(h, rgb);
}

static void hedge_draw_leaves(const struct hedge *h, int bx, int by)
{
    for (int i = 0; i < h->leaves; i++) {
        const struct hedge_leaf *l = &h->leaf[i];
        const struct hedge_mask *m = &h->mask[l->kind];
        int x0, y0;

        hedge_place(l, bx, by, &x0, &y0);
        if (x0 + HEDGE_LEAF_SIDE <= 0 || x0 >= h->cfg.width)
            continue;
        for (int y = sst_max_int(m->y0, -y0); y < m->y1 && y0 + y < h->cfg.height; y++) {
            const int to = sst_min_int(x0 + m->to[y], h->cfg.width);

            for (int x = sst_max_int(x0 + m->from[y], 0); x < to; x++)
                h->canvas[(y0 + y) * h->cfg.width + x] = l->colour;
        }
    }
}

static void hedge_expose(const struct hedge *h, uint64_t *seed, struct sst_image *image)
{
    for (int c = 0; c < 3; c++) {
        for (int y = 0; y < image->height; y++) {
            const uint32_t *from = h->canvas + (size_t)y * (size_t)h->cfg.width;
            const int8_t *n = h->noise + (size_t)(sst_random(seed) * (HEDGE_NOISE - image->width));
            uint8_t *row = sst_image_row(image, c, y);

            for (int x = 0; x < image->width; x++)
                row[x] = (uint8_t)sst_clamp_int((int)(from[x] >> 8 * c & 0xFF) + n[x], 0, 255);
        }
    }
}

/* The part of a person that is seen before noise. */
static double hedge_seen_share(const struct hedge *h, const struct hedge_person *p)
{
    int64_t all = 0, seen = 0;
    const double x = p->x, y = p->foot - p->height;
    double rgb[3];

    for (int py = 0; py < h->cfg.height; py++) {
        for (int px = 0; px < h->cfg.width; px++) {
            if (!hedge_person_at(p, (px - x) / p->height, (py - y) / p->height, rgb))
                continue;
            all++;
            seen += h->canvas[py * h->cfg.width + px] == hedge_person_colour(h, rgb);
        }
    }
    return all ? (double)seen / (double)all : 0;
}

/**
 * Draw all views. The same time, person and configuration give the same bytes.
 *
 * @param image    out [rows * cols], of the configured size
 * @param visible  out, fraction of the person that the reference view sees; may be NULL
 * @param person   NULL: nobody
 */
static inline void hedge_draw(struct hedge *h, double t_s, const struct hedge_person *person, struct sst_image *image,
                              double *visible)
{
    const int ref = (h->cfg.rows - 1) / 2 * h->cfg.cols + (h->cfg.cols - 1) / 2;
    uint64_t seed = h->cfg.seed * 31 + (uint64_t)llround(t_s * 1000);

    hedge_sway(h, t_s);
    for (int k = 0; k < h->cfg.rows * h->cfg.cols; k++) {
        double bx, by;

        hedge_offset(h, k, &bx, &by);
        hedge_draw_wall(h, (int)bx, (int)by);
        if (person)
            hedge_draw_person(h, person, (int)bx, (int)by);
        hedge_draw_leaves(h, (int)bx, (int)by);
        if (visible && k == ref)
            *visible = person ? hedge_seen_share(h, person) : 0;
        hedge_expose(h, &seed, &image[k]);
    }
}

#endif
