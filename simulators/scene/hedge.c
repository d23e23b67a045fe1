/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "simulators/scene/hedge.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "simulators/scene/scene_internal.h"

#define TOP        0.15 /* of the picture, above the hedge */
#define TWIG_PX    18.0 /* of a picture 320 wide: leaves of one twig lie in cells of this size */
#define TUFT_PX    17.0
#define LEAF_KINDS 24
#define NOISE      65536
#define GUST_S     11.0
#define GUSTS      2 /* of wind that repeats, in a period: a power of 2 */
#define LEAVES     60000

struct leaf {
    float x, y, disp; /* at rest */
    float swing, phase, rate;
    uint32_t colour; /* 0xBBGGRR */
    uint8_t kind;
    uint16_t twig;
    int at_x, at_y, disp_q4; /* in the picture that is drawn, 1/16 px */
};

struct twig {
    double x, swing, phase, rate, dx, dy;
};

#define LEAF_SIDE 19 /* of a leaf's mask */

struct leaf_mask {
    int y0, y1;
    uint8_t from[LEAF_SIDE], to[LEAF_SIDE]; /* columns of each row */
    int8_t shade[LEAF_SIDE][LEAF_SIDE];     /* fine: levels added to its colour */
};

struct sst_hedge {
    struct sst_hedge_config cfg;
    double scale;   /* of a picture 320 wide */
    uint32_t *wall; /* [wall_height][wall_width] */
    int wall_width, wall_height;
    int margin;
    struct leaf_mask mask[LEAF_KINDS];
    struct leaf *leaf;
    struct twig *twig;
    int leaves, twigs, twig_cols;
    int8_t noise[NOISE];
    uint32_t *canvas; /* [height][width] */
    double cover;
    struct hedge_figure *figure; /* fine */
    bool shares; /* wall and figure are another one's */
};

void sst_hedge_config_defaults(struct sst_hedge_config *cfg)
{
    *cfg = (struct sst_hedge_config){ .rows = 6,
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

void sst_hedge_offset(const struct sst_hedge *h, int view, double *bx, double *by)
{
    *bx = view % h->cfg.cols - (h->cfg.cols - 1) / 2;
    *by = view / h->cfg.cols - (h->cfg.rows - 1) / 2;
}

double sst_hedge_cover(const struct sst_hedge *h)
{
    return h->cover;
}

static uint8_t level(double v)
{
    return (uint8_t)sst_clamp_double(v + 0.5, 0, 255);
}

uint32_t hedge_colour(double r, double g, double b)
{
    return level(r) | (uint32_t)level(g) << 8 | (uint32_t)level(b) << 16;
}

/* --- wall and ground ---------------------------------------------------------------------------------------------- */

/* Smooth in cells of `cell` px, -1..1. */
static double cloud(int x, int y, double cell, uint32_t seed)
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
static int make_wall(struct sst_hedge *h)
{
    const struct sst_hedge_config *c = &h->cfg;
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
            const double fine = 10 * cloud(x, y, 2.3 * h->scale, seed + 1) + 12 * cloud(x, y, 21 * h->scale, seed + 2);
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
static void make_masks(struct sst_hedge *h, uint64_t *seed)
{
    const double middle = (LEAF_SIDE - 1) / 2.0;

    for (int i = 0; i < LEAF_KINDS; i++) {
        const double turn = M_PI * i / LEAF_KINDS, a = h->scale * sst_random_in(seed, 3.2, 4.4),
                     b = a * sst_random_in(seed, 0.4, 0.7);

        for (int y = 0; y < LEAF_SIDE; y++) {
            h->mask[i].from[y] = LEAF_SIDE;
            h->mask[i].to[y] = 0;
            for (int x = 0; x < LEAF_SIDE; x++) {
                const double u = (x - middle) * cos(turn) + (y - middle) * sin(turn);
                const double v = (y - middle) * cos(turn) - (x - middle) * sin(turn);

                if (u * u / (a * a) + v * v / (b * b) > 1)
                    continue;
                h->mask[i].from[y] = (uint8_t)sst_min_int(h->mask[i].from[y], x);
                h->mask[i].to[y] = (uint8_t)(x + 1);
                h->mask[i].shade[y][x] = (int8_t)(fabs(v) < 0.07 * b + 0.3 ? 22 : v < 0 ? 7 : -9);
            }
            if (h->mask[i].from[y] < h->mask[i].to[y]) {
                h->mask[i].y0 = h->mask[i].y1 ? h->mask[i].y0 : y;
                h->mask[i].y1 = y + 1;
            }
        }
    }
}

/* The nearest rate that fits the period of the wind. */
static double repeating(const struct sst_hedge *h, double rate)
{
    const double one = h->cfg.period_s > 0 ? 2 * M_PI / h->cfg.period_s : 0;

    return one > 0 ? one * fmax(1, round(rate / one)) : rate;
}

static void make_twigs(struct sst_hedge *h, uint64_t *seed)
{
    for (int i = 0; i < h->twigs; i++) {
        h->twig[i] = (struct twig){ .x = (i % h->twig_cols) * TWIG_PX,
                                    .swing = sst_random_in(seed, 0.5, 1.5),
                                    .phase = sst_random_in(seed, 0, 2 * M_PI),
                                    .rate = repeating(h, sst_random_in(seed, 2.0, 5.0)) };
    }
}

static int by_disparity(const void *a, const void *b)
{
    const struct leaf *x = a, *y = b;

    return (x->disp > y->disp) - (x->disp < y->disp);
}

static struct leaf random_leaf(const struct sst_hedge *h, uint64_t *seed, double left, double right)
{
    const struct sst_hedge_config *c = &h->cfg;
    const double depth = sst_random(seed), shade = sst_random_in(seed, 0.55, 1.15) * (1 - 0.4 * depth);
    struct leaf l = { .x = (float)sst_random_in(seed, left, right),
                      .y = (float)sst_random_in(seed, TOP * c->height, c->height + 20),
                      .disp = (float)(c->near_px - depth * c->spread_px),
                      .swing = (float)sst_random_in(seed, 0.1, 0.7),
                      .phase = (float)sst_random_in(seed, 0, 2 * M_PI),
                      .rate = (float)repeating(h, sst_random_in(seed, 5, 11)),
                      .kind = (uint8_t)(sst_random(seed) * LEAF_KINDS) };
    const double tint = sst_random_in(seed, -12, 25);

    l.twig =
        (uint16_t)(sst_clamp_int((int)(l.y / (TWIG_PX * h->scale)), 0, h->twigs / h->twig_cols - 1) * h->twig_cols +
                   sst_clamp_int((int)((l.x - left) / (TWIG_PX * h->scale)), 0, h->twig_cols - 1));
    l.colour = hedge_colour(c->light * shade * (75 + tint), c->light * shade * 125, c->light * shade * 45);
    return l;
}

/* Twigs of a fine hedge bear their leaves in tufts, with windows between them. */
static bool in_tuft(const struct sst_hedge *h, uint64_t *seed, const struct leaf *l)
{
    return cloud((int)l->x + 4096, (int)l->y, TUFT_PX * h->scale, (uint32_t)h->cfg.seed + 3) >
           sst_random_in(seed, -0.1, 0.1);
}

/* Where a leaf's mask begins in a view. */
static void place(const struct leaf *l, int bx, int by, int *x, int *y)
{
    *x = (l->at_x - l->disp_q4 * bx + (1024 * 16 + 8)) / 16 - 1024 - LEAF_SIDE / 2;
    *y = (l->at_y - l->disp_q4 * by + (1024 * 16 + 8)) / 16 - 1024 - LEAF_SIDE / 2;
}

/* Add leaves until they cover the part of the reference view that the hedge takes. */
static int make_leaves(struct sst_hedge *h, uint64_t *seed)
{
    const struct sst_hedge_config *c = &h->cfg;
    const double reach = c->near_px * ((c->cols + 1) / 2) + 8;
    const int top = (int)(TOP * c->height) + 4;
    const int64_t all = (int64_t)c->width * (c->height - top);
    uint8_t *covered = calloc((size_t)c->width * (size_t)c->height, 1);
    int64_t count = 0;

    while (covered && (double)count < c->cover * (double)all && h->leaves < LEAVES) {
        struct leaf *l = &h->leaf[h->leaves++];
        int x0, y0;

        *l = random_leaf(h, seed, -reach, c->width + reach);
        while (c->fine && !in_tuft(h, seed, l))
            *l = random_leaf(h, seed, -reach, c->width + reach);
        l->disp_q4 = (int)lround(16 * l->disp);
        l->at_x = (int)lround(16 * l->x);
        l->at_y = (int)lround(16 * l->y);
        place(l, 0, 0, &x0, &y0);
        for (int y = 0; y < LEAF_SIDE; y++) {
            for (int x = h->mask[l->kind].from[y]; x < h->mask[l->kind].to[y]; x++) {
                if (x0 + x < 0 || x0 + x >= c->width || y0 + y < top || y0 + y >= c->height)
                    continue;
                count += !covered[(size_t)(y0 + y) * (size_t)c->width + (size_t)(x0 + x)];
                covered[(size_t)(y0 + y) * (size_t)c->width + (size_t)(x0 + x)] = 1;
            }
        }
    }
    h->cover = (double)count / (double)all;
    qsort(h->leaf, (size_t)h->leaves, sizeof(*h->leaf), by_disparity);
    if (!covered)
        return -ENOMEM;
    free(covered);
    return 0;
}

static void make_noise(struct sst_hedge *h, uint64_t *seed)
{
    for (int i = 0; i < NOISE; i++) {
        double sum = -6;

        for (int k = 0; k < 12; k++)
            sum += sst_random(seed);
        h->noise[i] = (int8_t)lround(sst_clamp_double(h->cfg.noise * sum, -127, 127));
    }
}

void sst_hedge_destroy(struct sst_hedge *h)
{
    if (!h)
        return;
    if (!h->shares) {
        free(h->wall);
        free(h->figure);
    }
    free(h->canvas);
    free(h->leaf);
    free(h->twig);
    free(h);
}

static int allocate(struct sst_hedge *h)
{
    h->leaf = calloc(LEAVES, sizeof(*h->leaf));
    h->twig = calloc((size_t)h->twigs, sizeof(*h->twig));
    h->canvas = malloc((size_t)h->cfg.width * (size_t)h->cfg.height * sizeof(*h->canvas));
    return h->leaf && h->twig && h->canvas ? 0 : -ENOMEM;
}

int sst_hedge_share(struct sst_hedge **out, const struct sst_hedge *from)
{
    struct sst_hedge *h = malloc(sizeof(*h));

    if (!h)
        return -ENOMEM;
    *h = *from;
    h->shares = true;
    if (allocate(h)) {
        sst_hedge_destroy(h);
        return -ENOMEM;
    }
    memcpy(h->leaf, from->leaf, (size_t)h->leaves * sizeof(*h->leaf));
    memcpy(h->twig, from->twig, (size_t)h->twigs * sizeof(*h->twig));
    *out = h;
    return 0;
}

int sst_hedge_create(struct sst_hedge **out, const struct sst_hedge_config *cfg)
{
    struct sst_hedge *h;
    uint64_t seed = cfg->seed * 977 + 5;
    int err;

    if (cfg->rows < 1 || cfg->cols < 1 || cfg->width < 32 || cfg->width > SST_HEDGE_WIDTH_MAX || cfg->height < 24 ||
        !(cfg->cover >= 0 && cfg->cover <= 0.95))
        return -EINVAL;
    h = calloc(1, sizeof(*h));
    if (!h)
        return -ENOMEM;
    h->cfg = *cfg;
    h->scale = cfg->width / 320.0;
    h->twig_cols = (int)((cfg->width + 2 * (cfg->near_px * ((cfg->cols + 1) / 2) + 8)) / (TWIG_PX * h->scale)) + 1;
    h->twigs = h->twig_cols * ((int)(cfg->height / (TWIG_PX * h->scale)) + 2);
    err = allocate(h);
    err = err ? err : make_wall(h);
    if (!err && cfg->fine)
        err = hedge_figure_create(&h->figure);
    if (!err) {
        make_masks(h, &seed);
        make_twigs(h, &seed);
        make_noise(h, &seed);
        err = make_leaves(h, &seed);
    }
    if (err)
        sst_hedge_destroy(h);
    else
        *out = h;
    return err;
}

/* --- leaves and person -------------------------------------------------------------------------------------------- */

/* Strength of the wind at a place: calm and gusts of some seconds, which pass from left to right. */
static double gust(const struct sst_hedge *h, double t_s, double x)
{
    const bool repeats = h->cfg.period_s > 0;
    const double u = t_s / (repeats ? h->cfg.period_s / GUSTS : GUST_S) - x / 400;
    const int i = (int)floor(u), now_i = repeats ? i & (GUSTS - 1) : i,
              next_i = repeats ? (i + 1) & (GUSTS - 1) : i + 1;
    const double a = u - i, s = a * a * (3 - 2 * a);
    const double from = sst_noise_hash(now_i, 3, 0, (uint32_t)h->cfg.seed) * 0x1p-32;
    const double to = sst_noise_hash(next_i, 3, 0, (uint32_t)h->cfg.seed) * 0x1p-32;
    const double now = from + (to - from) * s;

    return h->cfg.wind * (0.3 + 3.0 * now * now * now);
}

static void sway(struct sst_hedge *h, double t_s)
{
    const double shake = h->cfg.period_s > 0 ? 2 : 2.3;

    for (int i = 0; i < h->twigs; i++) {
        struct twig *w = &h->twig[i];
        const double g = gust(h, t_s, w->x) * w->swing * h->scale, p = w->phase + w->rate * t_s;

        w->dx = g * (sin(p) + 0.4 * sin(shake * p) + 0.5);
        w->dy = 0.4 * g * sin(p + 1);
    }
    for (int i = 0; i < h->leaves; i++) {
        struct leaf *l = &h->leaf[i];
        const struct twig *w = &h->twig[l->twig];
        const double own = l->swing * h->scale * fmin(h->cfg.wind, 2) * sin(l->phase + l->rate * t_s);

        l->at_x = (int)lround(16 * (l->x + w->dx + own));
        l->at_y = (int)lround(16 * (l->y + w->dy + own));
    }
}

/* --- drawing ------------------------------------------------------------------------------------------------------ */

static void draw_wall(const struct sst_hedge *h, int bx, int by)
{
    const int dx = h->margin + (int)lround(h->cfg.wall_px * bx), dy = h->margin + (int)lround(h->cfg.wall_px * by);
    const size_t width = (size_t)h->cfg.width;

    for (int y = 0; y < h->cfg.height; y++)
        memcpy(h->canvas + (size_t)y * width, h->wall + (size_t)(y + dy) * (size_t)h->wall_width + dx,
               width * sizeof(*h->canvas));
}

/* A leaf's colour with the shade of a place of it. */
static uint32_t shaded(uint32_t colour, int shade)
{
    uint32_t out = 0;

    for (int c = 0; c < 3; c++) {
        const int level = (int)(colour >> 8 * c & 255);

        out |= (uint32_t)sst_clamp_int(level + level * shade / 64, 0, 255) << 8 * c;
    }
    return out;
}

static void draw_leaves(const struct sst_hedge *h, int bx, int by)
{
    for (int i = 0; i < h->leaves; i++) {
        const struct leaf *l = &h->leaf[i];
        const struct leaf_mask *m = &h->mask[l->kind];
        int x0, y0;

        place(l, bx, by, &x0, &y0);
        if (x0 + LEAF_SIDE <= 0 || x0 >= h->cfg.width)
            continue;
        for (int y = sst_max_int(m->y0, -y0); y < m->y1 && y0 + y < h->cfg.height; y++) {
            const int to = sst_min_int(x0 + m->to[y], h->cfg.width);
            uint32_t *row = h->canvas + (y0 + y) * h->cfg.width;

            for (int x = sst_max_int(x0 + m->from[y], 0); x < to; x++)
                row[x] = h->cfg.fine ? shaded(l->colour, m->shade[y][x - x0]) : l->colour;
        }
    }
}

static void draw_view(struct sst_hedge *h, const struct sst_hedge_person *person, int view, double *visible)
{
    const struct hedge_canvas canvas = {
        .px = h->canvas, .width = h->cfg.width, .height = h->cfg.height, .light = h->cfg.light, .figure = h->figure
    };
    double bx, by;

    sst_hedge_offset(h, view, &bx, &by);
    draw_wall(h, (int)bx, (int)by);
    if (person)
        hedge_person_draw(&canvas, person, bx, by);
    draw_leaves(h, (int)bx, (int)by);
    if (visible)
        *visible = person ? hedge_person_seen(&canvas, person) : 0;
}

static void add_noise(const struct sst_hedge *h, uint64_t *seed, struct sst_image *image)
{
    for (int c = 0; c < 3; c++) {
        for (int y = 0; y < image->height; y++) {
            const uint32_t *from = h->canvas + (size_t)y * (size_t)h->cfg.width;
            const int8_t *n = h->noise + (size_t)(sst_random(seed) * (NOISE - image->width));
            uint8_t *row = sst_image_row(image, c, y);

            for (int x = 0; x < image->width; x++)
                row[x] = (uint8_t)sst_clamp_int((int)(from[x] >> 8 * c & 0xFF) + n[x], 0, 255);
        }
    }
}

void sst_hedge_draw(struct sst_hedge *h, double t_s, const struct sst_hedge_person *person, struct sst_image *image,
                    double *visible)
{
    const int ref = (h->cfg.rows - 1) / 2 * h->cfg.cols + (h->cfg.cols - 1) / 2;
    uint64_t seed = h->cfg.seed * 31 + (uint64_t)llround(t_s * 1000);

    sway(h, t_s);
    for (int k = 0; k < h->cfg.rows * h->cfg.cols; k++) {
        draw_view(h, person, k, k == ref ? visible : NULL);
        add_noise(h, &seed, &image[k]);
    }
}

void sst_hedge_draw_view(struct sst_hedge *h, double t_s, const struct sst_hedge_person *person, int view,
                         struct sst_image *image)
{
    sway(h, t_s);
    draw_view(h, person, view, NULL);
    for (int c = 0; c < 3; c++) {
        for (int y = 0; y < image->height; y++) {
            const uint32_t *from = h->canvas + (size_t)y * (size_t)h->cfg.width;
            uint8_t *row = sst_image_row(image, c, y);

            for (int x = 0; x < image->width; x++)
                row[x] = (uint8_t)(from[x] >> 8 * c);
        }
    }
}

/* --- the scene of worlds ------------------------------------------------------------------------------------------ */

#define STRIDES 5 /* in a pass */

void sst_hedge_scene_config(struct sst_hedge_config *cfg)
{
    const struct sst_hedge_config given = *cfg;
    const double scale = given.width / 640.0;

    sst_hedge_config_defaults(cfg);
    cfg->rows = given.rows;
    cfg->cols = given.cols;
    cfg->width = given.width;
    cfg->height = given.height;
    cfg->seed = given.seed;
    cfg->cover = 0.55;
    cfg->noise = 0;
    cfg->near_px = 24 * scale;
    cfg->spread_px = 6 * scale;
    cfg->wall_px = 4 * scale;
    cfg->period_s = SST_HEDGE_PERIOD_S;
    cfg->fine = true;
}

struct sst_hedge_person sst_hedge_passer_by(const struct sst_hedge_config *cfg, double t_s)
{
    const double done = t_s / SST_HEDGE_PASS_S, height = 0.27 * cfg->width;

    return (struct sst_hedge_person){ .x = (cfg->width + height) * done - height / 2,
                                      .foot = 0.93 * cfg->height,
                                      .height = height,
                                      .disp_px = cfg->width / 64.0,
                                      .stride = 2 * M_PI * STRIDES * done };
}
