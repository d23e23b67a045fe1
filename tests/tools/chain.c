/*
 * The whole chain on random small light fields: chain FIRST COUNT [hash]
 *
 * Each number from FIRST on is a seed that draws a grid, sizes, pictures (scenes, noise, constants, periodic ones ...),
 * faults of views, displaced and darkened pictures, labels, disparities, settings of processing (corrected or not) and
 * of rendering, many of them extreme. Each must end
 * with 0 or a documented error; without a NaN at a module's border; with the same bytes on one thread and on several;
 * pictures within the bound of design.md, 5.4, of the sums in double; no value of a report infinite; validity planes
 * with the values that they may have. The first failure is printed with its seed, which repeats it. With `hash` one
 * line per seed has a hash of all results, to compare CPU levels and rounding.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <fenv.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/border.h"
#include "base/log.h"
#include "pipeline/method/process/process.h"
#include "pipeline/method/render/plan.h"
#include "simulators/scene/noise.h"
#include "simulators/scene/scene.h"
#include "tests/traps.h"

#define PICTURE_BOUND (0.5 + 1.0 / 32) /* design.md, 5.4 */
#define LARGE         64               /* pictures that the drift check can use, drift_internal.h */
#define SAMPLES       48               /* pixels of a picture that are compared with the exact ones */

/* Work of all chains together. */
static struct {
    uint64_t processed, corrected, refused, pictures, pixels;
    double most; /* largest distance of a picture from the exact one, levels */
    uint64_t most_seed;
} done;

struct chain {
    uint64_t seed, random;
    uint64_t hash;
    struct sst_lightfield lf;
    bool external; /* disparities are given */
};

static unsigned below(struct chain *c, unsigned n)
{
    return (unsigned)(sst_random_u64(&c->random) % n);
}

static bool one_in(struct chain *c, unsigned n)
{
    return below(c, n) == 0;
}

/* One of the values that formulas are sensitive to, or a plain one. */
static double extreme(struct chain *c, double lo, double hi)
{
    const double values[] = { lo, hi, lo, hi, 0.5 * (lo + hi) };

    return one_in(c, 3) ? values[below(c, 5)] : sst_random_in(&c->random, lo, hi);
}

#define CHECK(c, condition, ...)                                                                                       \
    do {                                                                                                               \
        if (!(condition)) {                                                                                            \
            fprintf(stderr, "seed %llu: %s: ", (unsigned long long)(c)->seed, #condition);                             \
            fprintf(stderr, __VA_ARGS__);                                                                              \
            fputc('\n', stderr);                                                                                       \
            return false;                                                                                              \
        }                                                                                                              \
    } while (0)

static void add_hash(struct chain *c, const void *data, size_t size)
{
    const uint8_t *p = data;

    for (size_t i = 0; i < size; i++)
        c->hash = (c->hash ^ p[i]) * 0x100000001B3U;
}

/* --- light fields ----------------------------------------------------------------------------------------------- */

enum { NOISE = 0, CONSTANT = 1, BLACK = 2, SATURATED = 3, STRIPES = 4, POINT = 5, RAMP = 6, EQUAL = 7, KINDS = 8 };

static uint8_t drawn(struct chain *c, int kind, int period, double x, double y)
{
    switch (kind) {
    case CONSTANT:
        return 90;
    case BLACK:
        return 0;
    case SATURATED:
        return 255;
    case STRIPES:
        return (int)floor(x / period) % 2 ? 200 : 30;
    case POINT:
        return (int)floor(x) == 5 && (int)floor(y) == 5 ? 255 : 0;
    case RAMP:
        return (uint8_t)fmin(fmax(2 * x + y, 0), 255);
    default:
        return (uint8_t)sst_random_u64(&c->random);
    }
}

static bool draw(struct chain *c, struct sst_view *v, int kind, int period, double disparity)
{
    for (int channel = 0; channel < 3; channel++) {
        for (int y = 0; y < c->lf.height; y++) {
            for (int x = 0; x < c->lf.width; x++)
                sst_image_row(&v->image, channel, y)[x] =
                    drawn(c, kind, period, x + disparity * v->bx, y + disparity * v->by);
        }
    }
    return true;
}

/* Drawn more often as scenes that are displaced: others have nothing that could be aligned. */
static bool is_large(const struct chain *c)
{
    return c->lf.width >= LARGE && c->lf.height >= LARGE;
}

static bool make_pictures(struct chain *c)
{
    struct sst_lightfield *lf = &c->lf;
    const int kind = (int)below(c, KINDS + (is_large(c) ? 16 : 2)), period = 1 + (int)below(c, 9);
    const double disparity = sst_random_in(&c->random, -3, 12);
    const uint64_t same = c->random;
    struct sst_scene *scene = NULL;
    struct sst_scene_config cfg;

    sst_scene_config_defaults(&cfg);
    cfg.width = lf->width;
    cfg.height = lf->height;
    cfg.rows = lf->rows;
    cfg.cols = lf->cols;
    cfg.seed = c->seed;
    if (kind >= KINDS && sst_scene_create(&scene, sst_scene_names()[below(c, 7)], &cfg))
        scene = NULL;
    for (int k = 0; k < lf->rows * lf->cols; k++) {
        struct sst_view *v = &lf->views[k];

        v->present = k == lf->ref_view || !one_in(c, 9);
        v->bx += one_in(c, 2) ? 0 : sst_random_in(&c->random, -0.1, 0.1);
        v->by += one_in(c, 2) ? 0 : sst_random_in(&c->random, -0.1, 0.1);
        if (!v->present)
            continue;
        if (sst_image_init(&v->image, lf->width, lf->height))
            return false;
        if (kind == EQUAL)
            c->random = same;
        if (!scene)
            draw(c, v, kind, period, disparity);
        else if (sst_scene_render(scene, v->bx, v->by, 0, &(struct sst_scene_maps){ .image = &v->image }))
            return false;
    }
    sst_scene_destroy(scene);
    return true;
}

/* A view that is dead, the copy of another, or far from where it should be. */
static void damage(struct chain *c)
{
    struct sst_lightfield *lf = &c->lf;
    struct sst_view *v = &lf->views[below(c, (unsigned)(lf->rows * lf->cols))];
    const struct sst_view *ref = &lf->views[lf->ref_view];

    if (!v->present || !one_in(c, 3))
        return;
    switch (below(c, 4)) {
    case 0:
        draw(c, v, BLACK, 1, 0);
        break;
    case 1:
        draw(c, v, NOISE, 1, 0);
        break;
    case 2:
        v->bx += 1000;
        break;
    default:
        for (int channel = 0; channel < 3 && v != ref; channel++) {
            for (int y = 0; y < lf->height; y++)
                memcpy(sst_image_row(&v->image, channel, y), sst_image_row(&ref->image, channel, y), (size_t)lf->width);
        }
    }
}

/* Pictures that are displaced, rolled, scaled, darker or bent: mostly by what cameras do, some by all that a folder may
 * state. */
static bool misalign(struct chain *c)
{
    struct sst_lightfield *lf = &c->lf;
    struct sst_correction correction[SST_MAX_VIEWS];
    const double most = one_in(c, 6) ? 1 : sst_random_in(&c->random, 0, 0.05);
    const bool all = one_in(c, 2);

    if (!one_in(c, is_large(c) ? 2 : 3))
        return true;
    for (int k = 0; k < lf->rows * lf->cols; k++) {
        struct sst_correction *to = &correction[k];

        *to = sst_correction_none();
        if (!all && !one_in(c, 6))
            continue;
        to->shift_x_px = one_in(c, 2) ? 0 : extreme(c, -most, most) * SST_CORRECTION_SHIFT_MAX_PX;
        to->shift_y_px = extreme(c, -most, most) * SST_CORRECTION_SHIFT_MAX_PX;
        to->roll_deg = one_in(c, 2) ? 0 : extreme(c, -most, most) * SST_CORRECTION_ROLL_MAX_DEG;
        to->scale = one_in(c, 2) ? 0 : extreme(c, -most, most) * SST_CORRECTION_SCALE_MAX;
        for (int i = 0; i < 3; i++)
            to->gain[i] = exp(extreme(c, -most, most) * log(SST_CORRECTION_GAIN_MAX));
        to->falloff = one_in(c, 2) ? 0 : extreme(c, -most, most) * SST_CORRECTION_FALLOFF_MAX;
        to->exponent = one_in(c, 2) ? 1 : exp(extreme(c, -most, most) * log(SST_CORRECTION_EXPONENT_MAX));
        if (!sst_correction_valid(to)) /* the last bit of a limit */
            *to = sst_correction_none();
    }
    CHECK(c, !sst_lightfield_correct(NULL, lf, correction, 2), "pictures cannot be displaced");
    free(lf->correction);
    lf->correction = NULL;
    return true;
}

/* Labels of rectangles, some of none; with `external` disparities as well. */
static bool make_maps(struct chain *c)
{
    struct sst_lightfield *lf = &c->lf;
    const unsigned labels = 1 + below(c, 5), step = 1 + below(c, 17), span = 1 + below(c, 400);
    const bool labelled = one_in(c, 2);

    lf->disp_min_px = c->external ? floor(extreme(c, -60, 40)) : 0;
    for (int k = 0; k < lf->rows * lf->cols; k++) {
        struct sst_view *v = &lf->views[k];

        if (!v->present)
            continue;
        if (labelled && sst_map_u8_init(&v->label, lf->width, lf->height))
            return false;
        if (c->external && sst_map_u16_init(&v->disp, lf->width, lf->height))
            return false;
        for (int y = 0; y < lf->height; y++) {
            for (int x = 0; x < lf->width; x++) {
                const uint32_t cell = sst_noise_hash(x / (int)step, y / (int)step, k, (uint32_t)c->seed);

                if (labelled)
                    sst_map_u8_row(&v->label, y)[x] = (uint8_t)(cell % labels);
                if (c->external)
                    sst_map_u16_row(&v->disp, y)[x] = (uint16_t)(cell % 19 ? (cell >> 8) % span * 7 : SST_DISP_NONE);
            }
        }
    }
    return true;
}

static bool make(struct chain *c)
{
    const int rows = 1 + (int)below(c, 4), cols = 1 + (int)below(c, 5);

    if (sst_lightfield_init(&c->lf, rows, cols))
        return false;
    c->lf.width = one_in(c, 4) ? 1 + (int)below(c, 12) : 8 + (int)below(c, 64);
    c->lf.height = one_in(c, 4) ? 1 + (int)below(c, 12) : 8 + (int)below(c, 40);
    if (one_in(c, 12)) { /* large enough to be judged and aligned */
        c->lf.width = LARGE + (int)below(c, 32);
        c->lf.height = LARGE + (int)below(c, 16);
    }
    c->lf.classes = sst_classes_default;
    c->external = one_in(c, 3);
    if (!make_pictures(c))
        return false;
    damage(c);
    return misalign(c) && make_maps(c);
}

static bool copy(struct sst_lightfield *to, const struct sst_lightfield *from)
{
    if (sst_lightfield_init(to, from->rows, from->cols))
        return false;
    to->width = from->width;
    to->height = from->height;
    to->classes = from->classes;
    to->disp_min_px = from->disp_min_px;
    for (int k = 0; k < from->rows * from->cols; k++) {
        struct sst_view *t = &to->views[k];
        const struct sst_view *f = &from->views[k];

        if (sst_view_copy(t, f) || (f->label.data && sst_map_u8_init(&t->label, from->width, from->height)) ||
            (f->disp.data && sst_map_u16_init(&t->disp, from->width, from->height)))
            return false;
        t->present = f->present;
        for (int y = 0; y < from->height; y++) {
            if (f->label.data)
                memcpy(sst_map_u8_row(&t->label, y), sst_map_u8_row(&f->label, y), (size_t)from->width);
            if (f->disp.data)
                memcpy(sst_map_u16_row(&t->disp, y), sst_map_u16_row(&f->disp, y), 2 * (size_t)from->width);
        }
    }
    return true;
}

/* --- processing ------------------------------------------------------------------------------------------------- */

static void draw_process(struct chain *c, struct sst_process_config *cfg)
{
    static const char *const presets[] = { "preview", "balanced", "accurate" };
    const int most = c->lf.width < 40 ? c->lf.width : 40;

    *cfg = (struct sst_process_config){ .eps_h = -1, .accuracy_weight = 4, .refine = !one_in(c, 4) };
    if (sst_disparity_preset(&cfg->disparity, presets[below(c, 3)]))
        abort();
    cfg->disparity.cost = SST_COST_CENSUS;
    cfg->keep_disparity = c->external;
    cfg->align = one_in(c, 2);
    cfg->disparity.disp_min_px = one_in(c, 6) ? 0 : floor(sst_random_in(&c->random, -8, 8));
    cfg->disparity.disp_max_px =
        one_in(c, 6) ? cfg->disparity.disp_min_px : cfg->disparity.disp_min_px + 1 + below(c, (unsigned)most + 1);
    cfg->disparity.paths = one_in(c, 3) ? 8 : 4;
    cfg->disparity.p1 = 1 + (int)below(c, 60);
    cfg->disparity.p2 = one_in(c, 8) ? SST_DISPARITY_MAX_PENALTY : cfg->disparity.p1 + (int)below(c, 300);
    cfg->disparity.support_arm = (int)below(c, SST_SUPPORT_MAX_ARM + 1);
    cfg->disparity.support_tau = 1 + (int)below(c, 255);
    cfg->disparity.bilateral_tau = (int)below(c, 40);
    cfg->disparity.fill = !one_in(c, 5);
    cfg->disparity.rounds = (int)below(c, 4);
    cfg->disparity.key_spacing = (int[]){ 1, 3, 5 }[below(c, 3)];
    cfg->disparity.skip_ranges = one_in(c, 3);
    cfg->disparity.range_bytes = one_in(c, 2) ? 0 : cfg->disparity.range_bytes;
    cfg->disparity.memory = one_in(c, 3) ? 1 : 0; /* one volume for all threads, and no sweep */
    cfg->disparity.skip_hypotheses = one_in(c, 2);
    cfg->disparity.frugal = one_in(c, 6);
    sst_refine_config_defaults(&cfg->refinement);
    cfg->refinement.min_pixels = (int)below(c, 50);
    cfg->refinement.eps_d = extreme(c, 0, 2);
    cfg->refinement.matcher_sigma_px = extreme(c, 0, 1);
}

static bool same_maps(const struct chain *c, const struct sst_lightfield *a, const struct sst_lightfield *b)
{
    CHECK(c, a->disp_min_px == b->disp_min_px, "%g, %g", a->disp_min_px, b->disp_min_px);
    for (int k = 0; k < a->rows * a->cols; k++) {
        const struct sst_view *v = &a->views[k], *w = &b->views[k];
        const size_t n = (size_t)a->width;

        CHECK(c, !v->disp.data == !w->disp.data && !v->label.data == !w->label.data, "view %d", k);
        for (int y = 0; y < a->height && v->present; y++) {
            for (int channel = 0; channel < 3; channel++)
                CHECK(c, !memcmp(sst_image_row(&v->image, channel, y), sst_image_row(&w->image, channel, y), n),
                      "picture of view %d, row %d, by threads", k, y);
            CHECK(c, !v->disp.data || !memcmp(sst_map_u16_row(&v->disp, y), sst_map_u16_row(&w->disp, y), 2 * n),
                  "disparities of view %d, row %d, by threads", k, y);
            CHECK(c, !v->label.data || !memcmp(sst_map_u8_row(&v->label, y), sst_map_u8_row(&w->label, y), n),
                  "labels of view %d, row %d, by threads", k, y);
        }
    }
    return true;
}

static void hash_maps(struct chain *c)
{
    for (int k = 0; k < c->lf.rows * c->lf.cols; k++) {
        const struct sst_view *v = &c->lf.views[k];

        for (int y = 0; y < c->lf.height; y++) {
            for (int channel = 0; channel < 3 && v->present; channel++)
                add_hash(c, sst_image_row(&v->image, channel, y), (size_t)c->lf.width);
            if (v->disp.data)
                add_hash(c, sst_map_u16_row(&v->disp, y), 2 * (size_t)c->lf.width);
            if (v->label.data)
                add_hash(c, sst_map_u8_row(&v->label, y), (size_t)c->lf.width);
        }
    }
}

static bool documented(int err)
{
    return !err || err == -EINVAL || err == -ENODATA || err == -ERANGE;
}

/* What pictures were corrected from, as if it had been loaded with them: rays are sampled there. */
static void keep_originals(struct chain *c, struct sst_lightfield *before)
{
    for (int k = 0; k < c->lf.rows * c->lf.cols && c->lf.correction; k++) {
        if (!sst_correction_is_none(&c->lf.correction[k]) && c->lf.correction[k].exponent == 1 &&
            c->lf.views[k].present) {
            c->lf.views[k].original = before->views[k].image;
            before->views[k].image = (struct sst_image){ 0 };
        }
    }
}

static bool process(struct chain *c)
{
    struct sst_process_report report = { 0 };
    struct sst_process_config cfg;
    struct sst_lightfield other = { 0 }, before = { 0 };
    int err, again;

    draw_process(c, &cfg);
    if (!copy(&other, &c->lf) || !copy(&before, &c->lf))
        return false;
    cfg.threads = 1;
    err = sst_process(&c->lf, &cfg, NULL, &report);
    cfg.threads = 3;
    again = sst_process(&other, &cfg, NULL, NULL);
    CHECK(c, err == again && documented(err), "processing returns %d and %d", err, again);
    if (!err && !same_maps(c, &c->lf, &other))
        return false;
    sst_lightfield_fini(&other);
    if (one_in(c, 2))
        keep_originals(c, &before);
    sst_lightfield_fini(&before);
    CHECK(c, !isinf(report.confirmed) && !isinf(report.coverage_refined), "%g, %g", report.confirmed,
          report.coverage_refined);
    CHECK(c, isnan(report.confirmed) || (report.confirmed >= 0 && report.confirmed <= 100), "%g", report.confirmed);
    done.processed += !err;
    done.corrected += report.align.moved || report.align.lit || report.align.faded || report.align.bent;
    done.refused += err != 0;
    if (!err)
        hash_maps(c);
    return true;
}

/* --- rendering -------------------------------------------------------------------------------------------------- */

static void draw_render(struct chain *c, struct sst_renderer *r, struct sst_render_config *cfg)
{
    double lo = 0, hi = 1;

    sst_renderer_disparities(r, &lo, &hi);
    sst_render_config_defaults(cfg);
    cfg->method = (enum sst_render_method)below(c, 3);
    cfg->focus_px = extreme(c, lo, hi);
    if (one_in(c, 3))
        cfg->focus_px = floor(cfg->focus_px);
    if (one_in(c, 2))
        cfg->sigma_px = (double[]){ 1e-6, 1e-3, 0.3, 50, 1e6, INFINITY }[below(c, 6)];
    cfg->c1 = one_in(c, 2) ? cfg->c1 : extreme(c, 0, 1);
    cfg->c2 = one_in(c, 2) ? cfg->c2 : extreme(c, 0, 1);
    cfg->focus_label = (int)below(c, 6);
    cfg->label_factor = extreme(c, 1, 100);
    cfg->range = (enum sst_label_range)below(c, 3);
    cfg->range_percentile = extreme(c, 0, 0.5);
    cfg->range_margin_px = extreme(c, -1, 3);
    cfg->unsupported = (enum sst_render_unsupported)below(c, 2);
    cfg->aperture = one_in(c, 2) ? INFINITY : extreme(c, 0, 4);
    cfg->aperture_soft = one_in(c, 2);
    cfg->view_bx = one_in(c, 2) ? 0 : extreme(c, -1, 1);
    cfg->view_by = one_in(c, 2) ? 0 : extreme(c, -1, 1);
    cfg->verify = (enum sst_render_verify)below(c, 3);
    cfg->max_views = one_in(c, 3) ? 1 + (int)below(c, 5) : 0;
    cfg->cut_px = one_in(c, 4) ? INFINITY : extreme(c, lo - 1, hi + 1);
    cfg->remove_label = one_in(c, 3) ? (int)below(c, 6) : 0;
    cfg->rays = one_in(c, 3) ? 1 + (int)below(c, 20) : 0;
}

static double note_error(const struct chain *c, double error)
{
    done.pixels++;
    if (error > done.most) {
        done.most = error;
        done.most_seed = c->seed;
    }
    return error;
}

/* Pixels of a picture against the same sums in double. */
static bool compare_exact(struct chain *c, struct sst_renderer *r, const struct sst_render_config *cfg,
                          const struct sst_image *img, const struct sst_map_u8 *valid)
{
    struct sst_ray rays[SST_MAX_VIEWS];
    struct sst_render_plan plan;
    int count;

    if (cfg->method == SST_RENDER_CLEAR || (cfg->method == SST_RENDER_SST && cfg->verify != SST_VERIFY_OFF))
        return true;
    CHECK(c, !sst_render_plan_init(&plan, r, cfg), "rendered, but not planned");
    for (int i = 0; i < SAMPLES; i++) {
        const int x = (int)below(c, (unsigned)img->width), y = (int)below(c, (unsigned)img->height);
        double rgb[3];

        count = sst_render_pixel_exact(&plan, x, y, rgb, rays);
        for (int ch = 0; ch < 3; ch++) {
            const int got = sst_image_row(img, ch, y)[x];

            if (cfg->unsupported == SST_UNSUPPORTED_INVALID && !sst_map_u8_row(valid, y)[x])
                CHECK(c, got == 0, "invalid pixel %d %d is %d", x, y, got);
            else
                CHECK(c, note_error(c, fabs(got - rgb[ch])) <= PICTURE_BOUND,
                      "pixel %d %d is %d, exactly %.6f (method %d, focus %g, sigma %g, C1 %g, C2 %g, label %d / %g, "
                      "range %d, "
                      "aperture %g, soft %d, %d rays)",
                      x, y, got, rgb[ch], cfg->method, cfg->focus_px, cfg->sigma_px, cfg->c1, cfg->c2, cfg->focus_label,
                      cfg->label_factor, cfg->range, cfg->aperture, cfg->aperture_soft, count);
        }
    }
    sst_render_plan_fini(&plan);
    return true;
}

static bool same_picture(const struct chain *c, const struct sst_image *a, const struct sst_image *b)
{
    for (int ch = 0; ch < 3; ch++) {
        for (int y = 0; y < a->height; y++)
            CHECK(c, !memcmp(sst_image_row(a, ch, y), sst_image_row(b, ch, y), (size_t)a->width), "row %d by threads",
                  y);
    }
    return true;
}

static bool check_valid(const struct chain *c, const struct sst_render_config *cfg, const struct sst_map_u8 *valid)
{
    for (int y = 0; y < valid->height; y++) {
        for (int x = 0; x < valid->width; x++) {
            const int v = sst_map_u8_row(valid, y)[x];

            CHECK(c, v == 0 || v == 255 || (v == 64 && cfg->method == SST_RENDER_CLEAR), "validity %d", v);
        }
    }
    return true;
}

static bool render(struct chain *c)
{
    struct sst_image img[2] = { 0 };
    struct sst_map_u8 valid = { 0 };
    struct sst_render_config cfg;
    struct sst_renderer *r;
    bool good = true;
    int err[2] = { 0, 0 };

    if (sst_renderer_create(&r, &c->lf, 2) || sst_map_u8_init(&valid, c->lf.width, c->lf.height))
        return false;
    draw_render(c, r, &cfg);
    for (int i = 0; i < 2; i++) {
        if (sst_image_init(&img[i], c->lf.width, c->lf.height))
            return false;
        cfg.threads = 1 + 2 * i;
        err[i] = sst_render(r, &cfg, &img[i], &valid);
    }
    CHECK(c, err[0] == err[1] && documented(err[0]), "rendering returns %d and %d", err[0], err[1]);
    done.pictures += !err[0];
    if (!err[0]) {
        good = same_picture(c, &img[0], &img[1]) && check_valid(c, &cfg, &valid) &&
               compare_exact(c, r, &cfg, &img[0], &valid);
        for (int ch = 0; ch < 3; ch++) {
            for (int y = 0; y < img->height; y++)
                add_hash(c, sst_image_row(img, ch, y), (size_t)img->width);
        }
    }
    for (int i = 0; i < 2; i++)
        sst_image_fini(&img[i]);
    sst_map_u8_fini(&valid);
    sst_renderer_destroy(r);
    return good;
}

/* No value that is no number has crossed a module's border since `before`. */
static bool check_borders(const struct chain *c, uint64_t before)
{
    const uint64_t crossed = sst_border_count() - before;

    CHECK(c, !crossed, "%llu values", (unsigned long long)crossed);
    return true;
}

static bool run(uint64_t seed, bool show)
{
    const uint64_t borders = sst_border_count();
    struct chain c = { .seed = seed, .random = seed * 0x9E3779B97F4A7C15U + 1, .hash = 0xCBF29CE484222325U };
    char errors[SST_LOG_MAX]; /* refusals are expected */
    bool good;

    sst_log_hold_errors(errors);
    good = make(&c) && process(&c);
    for (int i = 0; good && i < 3; i++)
        good = render(&c);
    good = good && check_borders(&c, borders);
    sst_lightfield_fini(&c.lf);
    sst_log_hold_errors(NULL);
    if (show)
        printf("%llu %016llx\n", (unsigned long long)seed, (unsigned long long)c.hash);
    return good;
}

int main(int argc, char **argv)
{
    const uint64_t first = argc > 1 ? strtoull(argv[1], NULL, 10) : 1,
                   count = argc > 2 ? strtoull(argv[2], NULL, 10) : 100;
    uint64_t bad = 0;

    sst_log_set_level(SST_LOG_ERROR);
    for (uint64_t i = 0; i < count; i++) {
        bad += !run(first + i, argc > 3);
        if (i % 1000 == 999 && argc <= 3) {
            printf("%llu chains, %llu bad\n", (unsigned long long)i + 1, (unsigned long long)bad);
            fflush(stdout);
        }
    }
    if (argc <= 3)
        printf("%llu chains from seed %llu, %llu bad: %llu light fields processed, %llu refused, %llu pictures, %llu "
               "values within %.4f levels of the exact ones (worst: seed %llu), %llu light fields corrected\n",
               (unsigned long long)count, (unsigned long long)first, (unsigned long long)bad,
               (unsigned long long)done.processed, (unsigned long long)done.refused, (unsigned long long)done.pictures,
               (unsigned long long)done.pixels, done.most, (unsigned long long)done.most_seed,
               (unsigned long long)done.corrected);
    return bad != 0;
}
