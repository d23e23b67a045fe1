/* Composition of layered scenes: a street far behind, objects, the target, and the occluder in front of it. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/mem.h"
#include "pipeline/image/classes.h"
#include "simulators/scene/scene_internal.h"

#define OBJECT_WIDTH_MAX 0.8 /* of the picture */

double photo_random(struct photo_scene *s, double lo, double hi)
{
    return sst_random_in(&s->rng, lo, hi);
}

int photo_pick(struct photo_scene *s, int n)
{
    return (int)(sst_random(&s->rng) * n);
}

/* --- textures ----------------------------------------------------------------------------------------------------- */

/* Position of a pixel in a row of n that goes on mirrored. */
static int mirrored(int i, int n)
{
    const int period = 2 * n, m = ((i % period) + period) % period;

    return m < n ? m : period - 1 - m;
}

static void bilinear(const struct sst_image *image, double x, double y, float rgb[3])
{
    const int ix = (int)floor(x), iy = (int)floor(y);
    const int x0 = mirrored(ix, image->width), x1 = mirrored(ix + 1, image->width);
    const int y0 = mirrored(iy, image->height), y1 = mirrored(iy + 1, image->height);
    const float fx = (float)(x - ix), fy = (float)(y - iy);

    for (int c = 0; c < 3; c++) {
        const uint8_t *top = sst_image_row(image, c, y0), *bottom = sst_image_row(image, c, y1);
        const float a = (float)top[x0] + fx * (float)(top[x1] - top[x0]);
        const float b = (float)bottom[x0] + fx * (float)(bottom[x1] - bottom[x0]);

        rgb[c] += a + fy * (b - a);
    }
}

/* Mean over the area of a texel. */
static void area(const struct sst_image *image, const struct photo_texture *t, double x, double y, float rgb[3])
{
    const double step_x = t->step_x, step_y = t->step_y;
    const int n = sst_clamp_int((int)ceil(fmax(fabs(step_x), fabs(step_y)) - 0.01), 1, 8);

    rgb[0] = rgb[1] = rgb[2] = 0;
    for (int j = 0; j < n; j++) {
        for (int i = 0; i < n; i++)
            bilinear(image, x + step_x * ((i + 0.5) / n - 0.5), y + step_y * ((j + 0.5) / n - 0.5), rgb);
    }
    for (int c = 0; c < 3; c++)
        rgb[c] /= (float)(n * n);
}

/* The patch of the quilt at (x, y), the one of the nearest jittered lattice point. */
static struct photo_point patch_at(const struct photo_texture *t, double x, double y)
{
    const int cx = (int)floor(x / t->cell), cy = (int)floor(y / t->cell);
    double best = HUGE_VAL;
    uint32_t hash = 0;
    struct photo_point p;

    for (int i = 0; i < 9; i++) {
        const int gx = cx - 1 + i % 3, gy = cy - 1 + i / 3;
        const uint32_t h = sst_noise_hash(gx, gy, 0, t->seed);
        const double px = (gx + (h & 255) / 256.0) * t->cell - x, py = (gy + (h >> 8 & 255) / 256.0) * t->cell - y;

        if (px * px + py * py < best) {
            best = px * px + py * py;
            hash = sst_noise_hash(gx, gy, 1, t->seed);
        }
    }
    p = t->quilt->leaves[hash % (uint32_t)t->quilt->leaf_count];
    return (struct photo_point){ p.photo, p.x - (int)(cx * t->cell * t->step_x),
                                 p.y - (int)(cy * t->cell * t->step_y) };
}

/* Colour 0..255 at a texel; the photo goes on mirrored beyond its edges. */
static void texture_at(const struct photo_texture *t, double x, double y, float rgb[3])
{
    if (t->quilt) {
        const struct photo_point p = patch_at(t, x, y);

        area(&p.photo->image, t, p.x + x * t->step_x, p.y + y * t->step_y, rgb);
    } else {
        area(&t->photo->image, t, t->x + x * t->step_x, t->y + y * t->step_y, rgb);
    }
    for (int c = 0; c < 3; c++)
        rgb[c] = (float)sst_clamp_double(t->shade * (100 + t->contrast * (rgb[c] - 100)), 0, 255);
}

struct photo_texture photo_texture_random(struct photo_scene *s)
{
    const struct photo *p = &s->library.photos[photo_pick(s, s->library.count)];
    const double step = 1 / fmax(s->scale, 1);
    struct photo_texture t = { .photo = p, .step_x = step, .step_y = step, .shade = 1, .contrast = 1 };

    t.x = photo_random(s, 0, p->image.width);
    t.y = photo_random(s, 0, p->image.height);
    return t;
}

struct photo_texture photo_texture_leaf(struct photo_scene *s)
{
    const struct photo_point p = s->library.leaves[photo_pick(s, s->library.leaf_count)];
    struct photo_texture t = photo_texture_random(s);

    t.photo = p.photo;
    t.x = p.x;
    t.y = p.y;
    return t;
}

/* --- sprites ------------------------------------------------------------------------------------------------------ */

struct photo_sprite *photo_sprite_add(struct photo_scene *s, int width, int height)
{
    struct photo_sprite *p;

    if (!sst_mem_grow(&s->sprites, s->count, &s->capacity, sizeof(*s->sprites)))
        return NULL;
    p = &s->sprites[s->count];
    *p = (struct photo_sprite){ .width = width, .height = height };
    p->rgba = calloc((size_t)width * (size_t)height, 4);
    if (!p->rgba)
        return NULL;
    s->count++;
    return p;
}

double photo_edge(double inside, double sd)
{
    return 0.5 * erfc(-inside / (sd * sqrt(2)));
}

void photo_sprite_set(struct photo_sprite *p, int i, double alpha, const struct photo_texture *t, const double at[2])
{
    uint8_t *texel = p->rgba + 4 * (size_t)i;
    float rgb[3];

    if (alpha < 1 / 510.0)
        return;
    texture_at(t, at[0], at[1], rgb);
    for (int c = 0; c < 3; c++)
        texel[c] = (uint8_t)(rgb[c] * alpha + 0.5);
    texel[3] = (uint8_t)(alpha * 255 + 0.5);
}

/* Blur of a float map along rows (step 1) or columns (step width). */
static void blur(float *map, float *copy, const int size[2], double sd, bool columns)
{
    const int width = size[0], height = size[1];
    const int n = columns ? height : width, reach = (int)ceil(3 * sd);
    const int step = columns ? width : 1, next = columns ? 1 : width;

    memcpy(copy, map, (size_t)width * (size_t)height * sizeof(*map));
    for (int line = 0; line < (columns ? width : height); line++) {
        for (int i = 0; i < n; i++) {
            double sum = 0, weight = 0;

            for (int k = -reach; k <= reach; k++) {
                const double w = exp(-k * k / (2 * sd * sd));

                weight += w;
                if (i + k >= 0 && i + k < n)
                    sum += w * copy[line * next + (i + k) * step];
            }
            map[line * next + i * step] = (float)(sum / weight);
        }
    }
}

/* Is the mask's pixel and are its four neighbours set? Label images are a pixel too wide. */
static bool inside(const struct sst_map_u8 *m, int x, int y)
{
    return x > 0 && y > 0 && x < m->width - 1 && y < m->height - 1 && sst_map_u8_row(m, y)[x] &&
           sst_map_u8_row(m, y - 1)[x] && sst_map_u8_row(m, y + 1)[x] && sst_map_u8_row(m, y)[x - 1] &&
           sst_map_u8_row(m, y)[x + 1];
}

/* Opacity of an object at each texel of a sprite with a margin of `edge` texels. */
static float *object_alpha(const struct photo_object *o, double scale, int edge, const int size[2], double sd)
{
    const int width = size[0], height = size[1];
    const size_t n = (size_t)width * (size_t)height;
    float *alpha = sst_mem_alloc(n, sizeof(float)), *copy = sst_mem_alloc(n, sizeof(float));

    for (int i = 0; alpha && copy && i < width * height * 16; i++) { /* 4x4 samples per texel */
        const double x = i / 16 % width - edge + (i % 4 + 0.5) / 4, y = i / 16 / width - edge + (i / 4 % 4 + 0.5) / 4;

        alpha[i / 16] += inside(&o->mask, (int)floor(x / scale), (int)floor(y / scale)) / 16.0F;
    }
    if (alpha && copy) {
        blur(alpha, copy, size, sd, false);
        blur(alpha, copy, size, sd, true);
    } else {
        sst_mem_free(alpha);
        alpha = NULL;
    }
    sst_mem_free(copy);
    return alpha;
}

struct photo_sprite *photo_sprite_object(struct photo_scene *s, const struct photo_object *o, double x, double y,
                                         double scale)
{
    const int edge = 4, w = (int)ceil(o->mask.width * scale) + 2 * edge,
              h = (int)ceil(o->mask.height * scale) + 2 * edge;
    const bool mirror = photo_pick(s, 2);
    const struct photo_texture t = { .photo = o->photo,
                                     .x = o->x - 0.5 + 0.5 / scale,
                                     .y = o->y - 0.5 + 0.5 / scale,
                                     .step_x = 1 / scale,
                                     .step_y = 1 / scale,
                                     .shade = photo_random(s, 0.8, 1.2),
                                     .contrast = 1 };
    float *alpha = object_alpha(o, scale, edge, (const int[2]){ w, h }, s->edge_px);
    struct photo_sprite *p = alpha ? photo_sprite_add(s, w, h) : NULL;

    for (int i = 0; p && i < w * h; i++) {
        const int column = i % w, row = i / w;

        photo_sprite_set(p, mirror ? row * w + w - 1 - column : i, alpha[i], &t,
                         (const double[2]){ column - edge, row - edge });
    }
    sst_mem_free(alpha);
    if (!p)
        return NULL;
    p->x = x - w / 2.0;
    p->y = y - h + edge;
    p->label = o->label;
    return p;
}

/* --- layers ------------------------------------------------------------------------------------------------------- */

/* An opaque sprite over the picture's rows from y0 with room for all views at disparity d. */
static struct photo_sprite *add_plane(struct photo_scene *s, const struct photo_texture *t, double y0, double d)
{
    const int margin = (int)ceil(s->reach * d) + 4, top = y0 > 0 ? 0 : margin;
    const int w = s->width + 2 * margin, h = (int)ceil(s->height - y0) + top + margin;
    struct photo_sprite *p = photo_sprite_add(s, w, h);

    for (int i = 0; p && i < w * h; i++)
        photo_sprite_set(p, i, 1, t, (const double[2]){ i % w - margin, i / w - top + y0 });
    if (p) {
        p->x = -margin;
        p->y = y0 - top;
        p->d0 = p->order = d;
        p->label = SST_LABEL_BUILDING;
    }
    return p;
}

/* A photo as a wall, and its lower part bent towards the cameras as a floor. */
static int add_background(struct photo_scene *s, double far_px, double floor_px)
{
    struct photo_texture t = photo_texture_random(s);
    const double horizon = floor(s->height * photo_random(s, 0.5, 0.65));
    struct photo_sprite *p;

    t.x = (t.photo->image.width - s->width * t.step_x) / 2 + photo_random(s, -0.5, 0.5);
    t.y = (t.photo->image.height - s->height * t.step_y) / 2 + photo_random(s, -0.5, 0.5);
    if (!add_plane(s, &t, 0, far_px))
        return -ENOMEM;
    p = add_plane(s, &t, horizon, floor_px);
    if (!p)
        return -ENOMEM;
    p->gy = (floor_px - far_px) / (s->height - horizon);
    p->d0 = far_px - p->gy * horizon;
    p->order = far_px + 1e-3;
    p->label = SST_LABEL_ROAD;
    return 0;
}

/* One of the larger objects, at most `share` of the picture's height. */
static struct photo_sprite *add_object(struct photo_scene *s, double d, double share, double x)
{
    const int n = s->library.object_count;
    const struct photo_object *o = &s->library.objects[photo_pick(s, sst_max_int(n * 2 / 3, 1))];
    const double fit = fmin(share * s->height / o->mask.height, OBJECT_WIDTH_MAX * s->width / o->mask.width);
    const double scale = fmin(fit, 2 * fmax(s->scale, 1));
    struct photo_sprite *p = photo_sprite_object(s, o, x, s->height * photo_random(s, 0.72, 1.0), fmax(scale, 0.2));

    if (p)
        p->d0 = p->order = d;
    return p;
}

/* A flat picture that covers most of the view. */
static int add_wall(struct photo_scene *s, double d)
{
    const double x0 = s->width * photo_random(s, -0.1, 0.12), x1 = s->width * photo_random(s, 0.88, 1.1);
    const double y0 = s->height * photo_random(s, -0.1, 0.15), y1 = s->height * photo_random(s, 0.85, 1.1);
    const int w = (int)(x1 - x0), h = (int)(y1 - y0);
    struct photo_texture t = photo_texture_random(s);
    struct photo_sprite *p = photo_sprite_add(s, w, h);

    if (!p)
        return -ENOMEM;
    t.x = (t.photo->image.width - w * t.step_x) / 2;
    t.y = (t.photo->image.height - h * t.step_y) / 2;
    for (int i = 0; i < w * h; i++) {
        const int x = i % w, y = i / w, in = sst_min_int(sst_min_int(x, w - 1 - x), sst_min_int(y, h - 1 - y));

        photo_sprite_set(p, i, photo_edge(in - 2.5, s->edge_px), &t, (const double[2]){ x, y });
    }
    p->x = x0;
    p->y = y0;
    p->gx = photo_random(s, -0.3, 0.3) / s->width;
    p->gy = photo_random(s, -0.3, 0.3) / s->height;
    p->d0 = d - p->gx * s->width / 2 - p->gy * s->height / 2;
    p->order = d;
    p->label = SST_LABEL_POSTER;
    s->target_label = SST_LABEL_POSTER;
    return 0;
}

/* Objects side by side at one disparity. */
static int add_group(struct photo_scene *s, double d)
{
    const int n = 3 + photo_pick(s, 4);

    for (int i = 0; i < n; i++) {
        const double x = s->width * (i + photo_random(s, 0.2, 0.8)) / n;
        struct photo_sprite *p = add_object(s, d, photo_random(s, 0.5, 0.95), x);

        if (!p)
            return -ENOMEM;
        p->order += 1e-3 * i;
        s->target_label = p->label;
    }
    return 0;
}

static double given_or(double given, double otherwise)
{
    return given >= 0 ? given : otherwise;
}

static int add_layers(struct photo_scene *s, const struct sst_layers_config *cfg)
{
    const double far_px = s->scale * photo_random(s, 4, 12), focus = far_px + s->scale * photo_random(s, 5, 16);
    const double near_px = focus + 6 + s->scale * photo_random(s, 0, 14), spread = s->scale * photo_random(s, 2, 14);
    const double random_cover = photo_random(s, 30, 80);
    const bool objects = s->library.object_count > 0, wall = photo_pick(s, 2) || !objects;
    const int middle = objects ? 1 + photo_pick(s, 3) : 0;
    int err = add_background(s, far_px, focus - s->scale);

    for (int i = 0; i < middle && !err; i++) {
        const double d = far_px + (focus - far_px) * (i + 1.0) / (middle + 1);

        err = add_object(s, d, 0.5, photo_random(s, 0, s->width)) ? 0 : -ENOMEM;
    }
    s->focus_px = focus;
    if (!err)
        err = wall ? add_wall(s, focus) : add_group(s, focus);
    return err ? err : photo_occluder_add(s, cfg->kind, given_or(cfg->cover_percent, random_cover), near_px, spread);
}

/* --- scene -------------------------------------------------------------------------------------------------------- */

static int front_first(const void *a, const void *b)
{
    const struct photo_sprite *p = a, *q = b;

    if (p->order != q->order)
        return p->order > q->order ? -1 : 1;
    return p->x != q->x ? (p->x < q->x ? -1 : 1) : (p->y > q->y) - (p->y < q->y);
}

int photo_scene_create(struct photo_scene **out, const struct sst_scene_config *cfg, int ref_row, int ref_col)
{
    const int far_view = sst_max_int(cfg->rows - 1 - ref_row, cfg->cols - 1 - ref_col);
    struct photo_scene *s = calloc(1, sizeof(*s));
    double noise, quality, gain;
    int err;

    if (!s)
        return -ENOMEM;
    s->width = cfg->width;
    s->height = cfg->height;
    s->scale = cfg->width / 480.0;
    s->reach = sst_max_int(far_view, sst_max_int(ref_row, ref_col));
    s->rng = cfg->seed * 0x2545F4914F6CDD1Du + 77;
    for (const char *c = cfg->layers.kind; c && *c; c++) /* kinds of one seed share nothing */
        s->rng = s->rng * 31 + (uint64_t)*c;
    s->edge_px = photo_random(s, 0.3, 1.2);
    noise = photo_random(s, 0, 4);
    gain = photo_random(s, 0, 3);
    quality = floor(photo_random(s, 80, 96));
    s->noise = given_or(cfg->layers.noise, noise);
    s->gain_percent = given_or(cfg->layers.gain_percent, gain);
    s->jpeg = (int)given_or(cfg->layers.jpeg, quality < 85 ? 0 : quality);
    err = photo_library_init(&s->library, &cfg->layers, sst_random_u64(&s->rng));
    err = err ? err : add_layers(s, &cfg->layers);
    for (int i = 0; i < s->count && !err; i++)
        err = photo_sprite_index(&s->sprites[i]);
    if (err) {
        photo_scene_destroy(s);
        return err;
    }
    photo_library_fini(&s->library);
    qsort(s->sprites, (size_t)s->count, sizeof(*s->sprites), front_first);
    *out = s;
    return 0;
}

void photo_scene_destroy(struct photo_scene *s)
{
    if (!s)
        return;
    for (int i = 0; i < s->count; i++) {
        free(s->sprites[i].spans);
        free(s->sprites[i].rgba);
    }
    free(s->sprites);
    photo_library_fini(&s->library);
    free(s);
}
