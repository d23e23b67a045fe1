/* Occluders of layered scenes: leaves, foliage, branches, slats, mesh and crowds in front of the target. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "base/stats.h"
#include "pipeline/image/classes.h"
#include "simulators/scene/scene_internal.h"

#define SPRITES_MAX 80000

/* State while an occluder is added piece by piece. */
struct cover {
    struct photo_scene *s;
    double near_px, spread_px, wanted; /* wanted: share of the picture */
    uint8_t *covered;                  /* [height][width] */
    int64_t count;
    uint32_t seed;
    double clump; /* size of the gaps between clumps, px */
};

/* Count the reference view's pixels that a new sprite covers. */
static void add_cover(struct cover *c, const struct photo_sprite *p)
{
    const int x0 = (int)lround(p->x), y0 = (int)lround(p->y);

    for (int y = 0; y < p->height; y++) {
        for (int x = 0; x < p->width; x++) {
            const int px = x0 + x, py = y0 + y;

            if (px < 0 || py < 0 || px >= c->s->width || py >= c->s->height ||
                p->rgba[4 * ((size_t)y * (size_t)p->width + (size_t)x) + 3] < 128)
                continue;
            c->count += !c->covered[(size_t)py * (size_t)c->s->width + (size_t)px];
            c->covered[(size_t)py * (size_t)c->s->width + (size_t)px] = 1;
        }
    }
}

static bool enough(const struct cover *c)
{
    return (double)c->count >= c->wanted * c->s->width * c->s->height || c->s->count >= SPRITES_MAX;
}

/* Front of the target: plane through (x, y) at disparity z with a random slant of `slant` px per px. */
static void set_plane(struct cover *c, struct photo_sprite *p, struct sst_vec3 at, double slant, int label)
{
    p->gx = photo_random(c->s, -slant, slant);
    p->gy = photo_random(c->s, -slant, slant);
    p->d0 = at.z - p->gx * at.x - p->gy * at.y;
    p->order = at.z;
    p->label = label;
    p->front = true;
}

/* A random place, in all views together; more places where the clumps are. */
static void place(struct cover *c, double d, double *x, double *y)
{
    const double margin = c->s->reach * d;

    for (int i = 0; i < 20; i++) {
        struct sst_vec3 at;

        *x = photo_random(c->s, -margin, c->s->width + margin);
        *y = photo_random(c->s, -margin, c->s->height + margin);
        at = (struct sst_vec3){ *x / c->clump, *y / c->clump, 0 };
        if (sst_noise_fbm(at, 2, c->seed) > photo_random(c->s, 0.2, 0.7))
            return;
    }
}

static double depth(struct cover *c)
{
    return c->near_px + photo_random(c->s, 0, c->spread_px);
}

/* --- leaves ------------------------------------------------------------------------------------------------------- */

/* Pointed ellipse of half length a and half width b, its axis at an angle. */
static int add_leaf(struct cover *c, double length)
{
    const double d = depth(c), a = length / 2, b = a * photo_random(c->s, 0.25, 0.55);
    const double angle = photo_random(c->s, 0, 6.2832), ca = cos(angle), sa = sin(angle);
    const double sd = fmin(c->s->edge_px, fmax(0.3, 0.5 * b));
    const int side = 2 * (int)ceil(a + 2 * sd) + 3;
    struct photo_texture t = photo_texture_leaf(c->s);
    struct photo_sprite *p;
    double x, y;

    place(c, d, &x, &y);
    t.shade = photo_random(c->s, 0.6, 1.4);
    p = photo_sprite_add(c->s, side, side);
    if (!p)
        return -ENOMEM;
    for (int i = 0; i < side * side; i++) {
        const double dx = i % side - side / 2, dy = i / side - side / 2;
        const double u = (ca * dx + sa * dy) / a, v = fabs(ca * dy - sa * dx), slope = 2 * b * u / a;
        const double in = (b * (1 - u * u) - v) / sqrt(1 + slope * slope);

        if (fabs(u) < 1.5)
            photo_sprite_set(p, i, photo_edge(in, sd) * (v < 0.5 ? 1 : 0.97), &t, (const double[2]){ dx, dy });
    }
    p->x = x - side / 2;
    p->y = y - side / 2;
    set_plane(c, p, (struct sst_vec3){ x, y, d }, fmin(0.06, 1.0 / length), SST_LABEL_TREE);
    add_cover(c, p);
    return 0;
}

static int add_leaves(struct cover *c)
{
    const double length = c->s->scale * 5 * pow(5, photo_random(c->s, 0, 1));
    int err = 0;

    while (!err && !enough(c))
        err = add_leaf(c, fmin(fmax(3, length * photo_random(c->s, 0.5, 1.5)), 40 * c->s->scale));
    return err;
}

/* --- branches ----------------------------------------------------------------------------------------------------- */

struct stroke {
    double x0, y0, x1, y1, w0, w1, d0, d1; /* ends, half widths and disparities there */
    struct photo_texture texture;
};

static int add_stroke(struct cover *c, const struct stroke *k)
{
    const double dx = k->x1 - k->x0, dy = k->y1 - k->y0, length = fmax(hypot(dx, dy), 1), w = fmax(k->w0, k->w1) + 4;
    const int x0 = (int)floor(fmin(k->x0, k->x1) - w), y0 = (int)floor(fmin(k->y0, k->y1) - w);
    const int width = (int)ceil(fabs(dx) + 2 * w) + 1, height = (int)ceil(fabs(dy) + 2 * w) + 1;
    const double slope = (k->d1 - k->d0) / (length * length);
    struct photo_sprite *p = photo_sprite_add(c->s, width, height);

    if (!p)
        return -ENOMEM;
    for (int i = 0; i < width * height; i++) {
        const double px = x0 + i % width - k->x0, py = y0 + i / width - k->y0;
        const double along = (px * dx + py * dy) / (length * length), t = sst_clamp_double(along, 0, 1);
        const double away = hypot(px - t * dx, py - t * dy), half = k->w0 + (k->w1 - k->w0) * t;
        const double sd = fmin(c->s->edge_px, fmax(0.3, 0.6 * half));
        const double alpha = photo_edge(half + away, sd) - photo_edge(away - half, sd);
        const double side = (px * dy - py * dx) / length / fmax(half, 0.5);

        if (alpha > 0) {
            struct photo_texture lit = k->texture;

            lit.shade *= 1 + 0.25 * sst_clamp_double(side, -1, 1);
            photo_sprite_set(p, i, alpha, &lit, (const double[2]){ px, py });
        }
    }
    p->x = x0;
    p->y = y0;
    set_plane(c, p, (struct sst_vec3){ 0, 0, (k->d0 + k->d1) / 2 }, 0, SST_LABEL_TREE);
    p->gx = slope * dx;
    p->gy = slope * dy;
    p->d0 = k->d0 - p->gx * k->x0 - p->gy * k->y0;
    add_cover(c, p);
    return 0;
}

/* A limb of bent pieces with twigs at both sides. */
static int grow(struct cover *c, struct stroke k, double angle, double length, int level)
{
    const double piece = fmax(8, 14 * c->s->scale), thin = k.w0;
    const int pieces = (int)ceil(length / piece);
    int err = 0;

    for (int i = 0; i < pieces && !err; i++) {
        angle += photo_random(c->s, -0.25, 0.25);
        k.w1 = fmax(0.5, thin * (1 - (i + 1.0) / (pieces + 1)));
        k.x1 = k.x0 + piece * cos(angle);
        k.y1 = k.y0 + piece * sin(angle);
        k.d1 =
            sst_clamp_double(k.d0 + photo_random(c->s, -0.5, 0.5) * c->s->scale, c->near_px, c->near_px + c->spread_px);
        err = add_stroke(c, &k);
        k.x0 = k.x1;
        k.y0 = k.y1;
        k.w0 = k.w1;
        k.d0 = k.d1;
        if (!err && level > 0 && photo_pick(c->s, 3) == 0)
            err = grow(c, k, angle + (photo_pick(c->s, 2) ? 0.8 : -0.8), length * photo_random(c->s, 0.3, 0.6),
                       level - 1);
    }
    return err;
}

static int add_branches(struct cover *c)
{
    int err = 0;

    while (!err && !enough(c)) {
        struct stroke k = { .texture = photo_texture_leaf(c->s) };

        k.texture.shade = photo_random(c->s, 0.4, 0.9);
        k.d0 = depth(c);
        place(c, k.d0, &k.x0, &k.y0);
        k.w0 = fmax(0.5, c->s->scale * photo_random(c->s, 0.7, 3));
        err = grow(c, k, photo_random(c->s, 0, 6.2832), c->s->width * photo_random(c->s, 0.15, 0.5), 2);
    }
    return err;
}

/* --- sheets: one sprite over all of the picture ------------------------------------------------------------------- */

/* Opacity at a pixel of the reference view. */
typedef double sheet_fn(const void *arg, double x, double y);

struct sheet {
    sheet_fn *fn;
    const void *arg;
    const struct photo_texture *t;
    double disp_px, slant;
    int label;
};

static int add_sheet(struct cover *c, const struct sheet *s)
{
    const int margin = (int)ceil(c->s->reach * (s->disp_px + s->slant * c->s->width)) + 4;
    const int w = c->s->width + 2 * margin, h = c->s->height + 2 * margin;
    struct photo_sprite *p = photo_sprite_add(c->s, w, h);

    if (!p)
        return -ENOMEM;
    for (int i = 0; i < w * h; i++)
        photo_sprite_set(p, i, s->fn(s->arg, i % w - margin, i / w - margin), s->t, (const double[2]){ i % w, i / w });
    p->x = p->y = -margin;
    set_plane(c, p, (struct sst_vec3){ c->s->width / 2.0, c->s->height / 2.0, s->disp_px }, s->slant, s->label);
    add_cover(c, p);
    return 0;
}

struct grating {
    double angle, period, half, phase, sd, bend;
    bool both; /* across too */
};

static double stripe(const struct grating *g, double t)
{
    const double away = fabs(remainder(t - g->phase, g->period));

    return photo_edge(g->half + away, g->sd) - photo_edge(away - g->half, g->sd);
}

static double grating_at(const void *arg, double x, double y)
{
    const struct grating *g = arg;
    const double bend = g->bend * sin((x + y) / 70), u = x * cos(g->angle) + y * sin(g->angle) + bend;
    const double v = y * cos(g->angle) - x * sin(g->angle) - bend;

    return g->both ? fmax(stripe(g, u), stripe(g, v)) : stripe(g, v);
}

static int add_slats(struct cover *c)
{
    const double width = c->s->scale * 4 * pow(7, photo_random(c->s, 0, 1));
    const struct photo_texture t = photo_texture_random(c->s);
    struct grating g = { .half = width / 2, .period = width / c->wanted, .sd = c->s->edge_px };

    g.angle = (photo_pick(c->s, 2) ? 1.5708 : 0) + photo_random(c->s, -0.15, 0.15);
    g.phase = photo_random(c->s, 0, g.period);
    return add_sheet(
        c, &(struct sheet){ grating_at, &g, &t, c->near_px, c->spread_px / 2 / c->s->width, SST_LABEL_FENCE });
}

static int add_mesh(struct cover *c)
{
    const double wire = fmax(1, photo_random(c->s, 1, 3) * fmin(c->s->scale, 1.5)),
                 period = wire / (1 - sqrt(1 - c->wanted));
    struct photo_texture t = photo_texture_random(c->s);
    struct grating g = { .half = wire / 2, .both = true, .bend = photo_random(c->s, 0, 2) };

    t.shade = photo_random(c->s, 0.3, 1.2);
    t.contrast = photo_random(c->s, 0.1, 1);
    g.sd = fmin(c->s->edge_px, 0.3 * wire);
    g.period = sst_clamp_double(period, 8, 30 * fmax(c->s->scale, 1));
    g.angle = (photo_pick(c->s, 2) ? 0.7854 : 0) + photo_random(c->s, -0.1, 0.1);
    g.phase = photo_random(c->s, 0, g.period);
    return add_sheet(
        c, &(struct sheet){ grating_at, &g, &t, c->near_px, c->spread_px / 2 / c->s->width, SST_LABEL_FENCE });
}

struct thicket {
    double size, threshold, sd;
    uint32_t seed;
};

static float thicket_noise(const struct thicket *f, double x, double y)
{
    return sst_noise_fbm((struct sst_vec3){ x / f->size, y / f->size, 0 }, 3, f->seed);
}

static double thicket_at(const void *arg, double x, double y)
{
    const struct thicket *f = arg;
    const double n = thicket_noise(f, x, y);
    const double gx = thicket_noise(f, x + 0.5, y) - thicket_noise(f, x - 0.5, y);
    const double gy = thicket_noise(f, x, y + 0.5) - thicket_noise(f, x, y - 0.5);

    return photo_edge((n - f->threshold) / fmax(hypot(gx, gy), 1e-3), f->sd);
}

/* Level that a share of the noise exceeds. */
static double noise_level(const struct thicket *f, double share)
{
    float v[4096];

    for (int i = 0; i < 4096; i++)
        v[i] = thicket_noise(f, (i % 64) * 1.7 * f->size, (i / 64) * 1.7 * f->size);
    return sst_stats_quantile_float(v, 4096, 1 - share);
}

static int add_foliage_sheets(struct cover *c)
{
    const int n = 3 + photo_pick(c->s, 6);
    const double share = 1 - pow(1 - c->wanted, 1.0 / n), size = c->s->scale * 3 * pow(12, photo_random(c->s, 0, 1));
    int err = 0;

    for (int i = 0; i < n && !err; i++) {
        struct photo_texture t = photo_texture_leaf(c->s);
        struct thicket f = { .size = size * photo_random(c->s, 0.7, 1.4), .sd = c->s->edge_px };

        t.quilt = &c->s->library;
        t.cell = c->s->scale * photo_random(c->s, 20, 50);
        t.seed = f.seed = (uint32_t)sst_random_u64(&c->s->rng);
        t.shade = photo_random(c->s, 0.7, 1.3);
        f.threshold = noise_level(&f, share);
        err = add_sheet(c, &(struct sheet){ thicket_at, &f, &t,
                                            c->near_px + c->spread_px * (i + photo_random(c->s, 0, 0.9)) / n, 0.005,
                                            SST_LABEL_TREE });
    }
    return err;
}

/* --- crowd -------------------------------------------------------------------------------------------------------- */

static int add_crowd(struct cover *c)
{
    const int n = c->s->library.object_count;

    if (!n)
        return add_foliage_sheets(c);
    while (!enough(c)) {
        const struct photo_object *o = &c->s->library.objects[photo_pick(c->s, n)];
        const double scale = fmin(c->s->scale * photo_random(c->s, 0.8, 2), 0.7 * c->s->height / o->mask.height);
        const double d = depth(c), margin = c->s->reach * d;
        const double x = photo_random(c->s, -margin, c->s->width + margin);
        const double y = photo_random(c->s, 0.25 * c->s->height, c->s->height + margin);
        struct photo_sprite *p = photo_sprite_object(c->s, o, x, y, scale);

        if (!p)
            return -ENOMEM;
        set_plane(c, p, (struct sst_vec3){ x, y, d }, 0.003, o->label);
        add_cover(c, p);
    }
    c->s->front_label = SST_LABEL_PEDESTRIAN;
    return 0;
}

/* --- public ------------------------------------------------------------------------------------------------------- */

static const struct kind {
    const char *name;
    int (*add)(struct cover *c);
    int label;
} kinds[] = {
    { "leaves", add_leaves, SST_LABEL_TREE },     { "foliage", add_foliage_sheets, SST_LABEL_TREE },
    { "branches", add_branches, SST_LABEL_TREE }, { "slats", add_slats, SST_LABEL_FENCE },
    { "mesh", add_mesh, SST_LABEL_FENCE },        { "crowd", add_crowd, SST_LABEL_PEDESTRIAN },
};

static int find_kind(struct photo_scene *s, const char *name)
{
    const int random = photo_pick(s, (int)ARRAY_LEN(kinds));

    if (!name || !strcmp(name, "mixed"))
        return random;
    for (int i = 0; i < (int)ARRAY_LEN(kinds); i++) {
        if (!strcmp(kinds[i].name, name))
            return i;
    }
    sst_log_error("unknown kind `%s`; choose leaves, foliage, branches, slats, mesh, crowd or mixed", name);
    return -EINVAL;
}

int photo_occluder_add(struct photo_scene *s, const char *kind, double cover, double near_px, double spread_px)
{
    struct cover c = { .s = s, .near_px = near_px, .spread_px = spread_px, .wanted = cover / 100 };
    const int which = find_kind(s, kind);
    int err;

    if (which < 0)
        return which;
    c.covered = calloc((size_t)s->width * (size_t)s->height, 1);
    if (!c.covered)
        return -ENOMEM;
    c.seed = (uint32_t)sst_random_u64(&s->rng);
    c.clump = s->scale * photo_random(s, 40, 160);
    s->kind = kinds[which].name;
    s->front_label = kinds[which].label;
    err = cover > 0 ? kinds[which].add(&c) : 0;
    s->cover_percent = 100.0 * (double)c.count / ((double)s->width * s->height);
    free(c.covered);
    return err;
}
