/* pipeline/method/render/clear.c, cut.c, object.c: known worlds, a plain reference in double, holes, faults. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/method/render/clear_internal.h"
#include "simulators/scene/noise.h"
#include "tests/small.h"
#include "tests/test.h"

#define WIDTH  64
#define HEIGHT 48
#define BACK   2.0 /* disparities of a textured wall ... */
#define FRONT  9.0 /* ... and of the object in front */
#define RED    250 /* of the object in front; the wall has less */

static int texture(int c, int x, int y)
{
    return 60 + 20 * c + ((x * 7 + y * 13 + c * 5) & 63);
}

/* The object in front, by its place in the reference view. */
typedef bool front_fn(int x, int y);

static bool nothing(int x SST_UNUSED, int y SST_UNUSED)
{
    return false;
}

static bool post(int x, int y SST_UNUSED)
{
    return x >= 30 && x < 34;
}

/* Hides 6 columns of the wall from all views: at most 4 spacings times 7 px of parallax uncover the rest. */
static bool slab(int x, int y SST_UNUSED)
{
    return x >= 16 && x < 50;
}

static bool box(int x, int y)
{
    return x >= 28 && x < 38 && y >= 20 && y < 30;
}

static void set_ray(struct sst_lightfield *lf, int view, int x, int y, front_fn *front)
{
    struct sst_view *v = &lf->views[view];
    const int wx = x + (int)(BACK * v->bx), wy = y + (int)(BACK * v->by);
    const bool near = front(x + (int)(FRONT * v->bx), y + (int)(FRONT * v->by));

    for (int c = 0; c < 3; c++)
        sst_image_row(&v->image, c, y)[x] = (uint8_t)(near ? (c ? 0 : RED) : texture(c, wx, wy));
    sst_map_u16_row(&v->disp, y)[x] = sst_disp_q6(lf, near ? FRONT : BACK);
    sst_map_u8_row(&v->label, y)[x] = near ? 2 : 1;
}

/* A wall and something in front of it, seen by size x size cameras. */
static void make_world(struct sst_lightfield *lf, int size, front_fn *front)
{
    assert_int_equal(sst_lightfield_init(lf, size, size), 0);
    lf->width = WIDTH;
    lf->height = HEIGHT;
    for (int i = 0; i < size * size; i++) {
        struct sst_view *v = &lf->views[i];

        v->present = true;
        assert_int_equal(sst_image_init(&v->image, WIDTH, HEIGHT), 0);
        assert_int_equal(sst_map_u16_init(&v->disp, WIDTH, HEIGHT), 0);
        assert_int_equal(sst_map_u8_init(&v->label, WIDTH, HEIGHT), 0);
        for (int y = 0; y < HEIGHT; y++) {
            for (int x = 0; x < WIDTH; x++)
                set_ray(lf, i, x, y, front);
        }
    }
}

struct clear_picture {
    struct sst_image image;
    struct sst_map_u8 valid;
};

static struct sst_render_config config(double cut_px)
{
    struct sst_render_config cfg;

    sst_render_config_defaults(&cfg);
    cfg.method = SST_RENDER_CLEAR;
    cfg.cut_px = cut_px;
    cfg.threads = 2;
    return cfg;
}

static int render(struct clear_picture *p, const struct sst_lightfield *lf, const struct sst_render_config *cfg)
{
    struct sst_renderer *r;
    int err;

    assert_int_equal(sst_image_init(&p->image, lf->width, lf->height), 0);
    assert_int_equal(sst_map_u8_init(&p->valid, lf->width, lf->height), 0);
    assert_int_equal(sst_renderer_create(&r, lf, 2), 0);
    err = sst_render(r, cfg, &p->image, &p->valid);
    sst_renderer_destroy(r);
    return err;
}

static void fini(struct clear_picture *p)
{
    sst_image_fini(&p->image);
    sst_map_u8_fini(&p->valid);
}

static void assert_wall(const struct clear_picture *p, int x0, int x1, int shift_x)
{
    for (int y = 8; y < HEIGHT - 8; y++) {
        for (int x = x0; x < x1; x++) {
            assert_int_equal(sst_map_u8_row(&p->valid, y)[x], CLEAR_SEEN);
            for (int c = 0; c < 3; c++)
                assert_int_equal(sst_image_row(&p->image, c, y)[x], texture(c, x + shift_x, y));
        }
    }
}

static void post_vanishes_by_cut_label_and_object(void **state SST_UNUSED)
{
    struct sst_lightfield lf;
    struct sst_map_u8 mask[25] = { 0 };
    struct sst_render_config by_cut = config(5), by_label = config(INFINITY), by_object = config(INFINITY);
    struct clear_picture p;

    make_world(&lf, 5, post);
    assert_int_equal(render(&p, &lf, &by_cut), 0);
    assert_wall(&p, 8, WIDTH - 8, 0);
    fini(&p);
    by_label.remove_label = 2;
    assert_int_equal(render(&p, &lf, &by_label), 0);
    assert_wall(&p, 8, WIDTH - 8, 0);
    fini(&p);
    assert_int_equal(sst_render_grow_object(mask, &lf, 31, 20, 2), 0);
    by_object.remove = mask;
    assert_int_equal(render(&p, &lf, &by_object), 0);
    assert_wall(&p, 8, WIDTH - 8, 0);
    fini(&p);
    for (int i = 0; i < 25; i++)
        sst_map_u8_fini(&mask[i]);
    sst_lightfield_fini(&lf);
}

static void nothing_removed_shows_the_camera(void **state SST_UNUSED)
{
    struct sst_render_config cfg = config(INFINITY);
    struct sst_lightfield lf;
    struct clear_picture p;

    make_world(&lf, 5, post);
    assert_int_equal(render(&p, &lf, &cfg), 0);
    for (int c = 0; c < 3; c++) {
        for (int y = 0; y < HEIGHT; y++)
            assert_memory_equal(sst_image_row(&p.image, c, y), sst_image_row(&lf.views[lf.ref_view].image, c, y),
                                WIDTH);
    }
    fini(&p);
    sst_lightfield_fini(&lf);
}

static void viewpoints_move_the_wall(void **state SST_UNUSED)
{
    struct sst_render_config cfg = config(5);
    struct sst_lightfield lf;
    struct clear_picture p;

    make_world(&lf, 5, post);
    cfg.view_bx = 1;
    assert_int_equal(render(&p, &lf, &cfg), 0);
    assert_wall(&p, 8, WIDTH - 8, 2);
    fini(&p);
    cfg.view_bx = 0.5; /* between cameras: all rays fall on whole pixels, for the wall has disparity 2 */
    assert_int_equal(render(&p, &lf, &cfg), 0);
    assert_wall(&p, 8, WIDTH - 8, 1);
    fini(&p);
    sst_lightfield_fini(&lf);
}

/* Holes are flagged, and filled with colours of the wall, never of the removed object. */
static void holes_are_filled_from_behind(void **state SST_UNUSED)
{
    struct sst_render_config cfg = config(5);
    struct sst_lightfield lf;
    struct clear_picture p;
    int holes = 0;

    make_world(&lf, 3, slab);
    assert_int_equal(render(&p, &lf, &cfg), 0);
    for (int y = 0; y < HEIGHT; y++) {
        for (int x = 0; x < WIDTH; x++) {
            holes += sst_map_u8_row(&p.valid, y)[x] == CLEAR_FILLED;
            assert_true(sst_image_row(&p.image, 0, y)[x] < 150);
            assert_true(sst_image_row(&p.image, 2, y)[x] >= 90);
        }
    }
    assert_in_range(holes, 15 * HEIGHT, 30 * HEIGHT);
    fini(&p);
    sst_lightfield_fini(&lf);
}

/* A ray that no other view confirms is not a surface, though it is the nearest. */
static void single_rays_are_not_believed(void **state SST_UNUSED)
{
    struct sst_render_config cfg = config(INFINITY);
    struct sst_lightfield lf;
    struct clear_picture p;

    make_world(&lf, 3, nothing);
    sst_map_u16_row(&lf.views[lf.ref_view].disp, 24)[32] = sst_disp_q6(&lf, 30);
    sst_image_row(&lf.views[lf.ref_view].image, 0, 24)[32] = 255;
    assert_int_equal(render(&p, &lf, &cfg), 0);
    assert_wall(&p, 8, WIDTH - 8, 0);
    fini(&p);
    sst_lightfield_fini(&lf);
}

static void nothing_left_is_unknown(void **state SST_UNUSED)
{
    struct sst_render_config cfg = config(INFINITY);
    struct sst_lightfield lf;
    struct clear_picture p;

    make_world(&lf, 3, nothing);
    cfg.remove_label = 1;
    assert_int_equal(render(&p, &lf, &cfg), 0);
    for (int y = 0; y < HEIGHT; y++) {
        for (int x = 0; x < WIDTH; x++)
            assert_int_equal(sst_map_u8_row(&p.valid, y)[x] + sst_image_row(&p.image, 0, y)[x], CLEAR_UNKNOWN);
    }
    fini(&p);
    sst_lightfield_fini(&lf);
}

/* --- plain reference ---------------------------------------------------------------------------------------------- */

/* Disparities around a few surfaces, unknown ones, colours at random, offsets that are not whole. */
static void make_random(struct sst_lightfield *lf)
{
    uint64_t seed = 11;

    make_world(lf, 3, nothing);
    lf->disp_min_px = -1;
    for (int i = 0; i < 9; i++) {
        struct sst_view *v = &lf->views[i];

        v->bx += 0.03 * (i % 4) - 0.05;
        v->by -= i == 4 ? 0 : 0.02 * (i % 3);
        for (int y = 0; y < HEIGHT; y++) {
            for (int x = 0; x < WIDTH; x++) {
                const uint64_t a = sst_random_u64(&seed);
                const double d = 2 + 3 * (double)(a % 3) + (double)(a >> 8 & 63) / 64;

                sst_map_u16_row(&v->disp, y)[x] = a % 17 ? sst_disp_q6(lf, d) : SST_DISP_NONE;
                for (int c = 0; c < 3; c++)
                    sst_image_row(&v->image, c, y)[x] = (uint8_t)(100 + (sst_random_u64(&seed) & 31));
            }
        }
    }
    lf->views[4].bx = 0;
    lf->views[4].by = 0;
}

/* 0: removed or unknown, else the weight of the place. */
static double place_weight(const struct sst_lightfield *lf, int view, int x, int y, double cut_px)
{
    const struct sst_map_u16 *disp = &lf->views[view].disp;
    double weight = 1;

    for (int ny = sst_max_int(y - 1, 0); ny <= sst_min_int(y + 1, lf->height - 1); ny++) {
        for (int nx = sst_max_int(x - 1, 0); nx <= sst_min_int(x + 1, lf->width - 1); nx++) {
            const uint16_t q = sst_map_u16_row(disp, ny)[nx];

            if (q != SST_DISP_NONE && sst_disp_px(lf, q) > cut_px)
                weight = 0.02;
        }
    }
    return sst_map_u16_row(disp, y)[x] == SST_DISP_NONE || sst_disp_px(lf, sst_map_u16_row(disp, y)[x]) > cut_px
               ? 0
               : weight;
}

static int compare_down(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;

    return x < y ? 1 : x > y ? -1 : 0;
}

/* Nearest disparity that a view sends to the pixel; -infinity: none. *weight: the largest of those at this disparity.
 */
static double landed(double *weight, const struct sst_lightfield *lf, int view, int px, int py, double cut_px)
{
    const struct sst_view *v = &lf->views[view];
    double nearest = -INFINITY;

    *weight = 0;
    for (int y = 0; y < HEIGHT; y++) {
        for (int x = 0; x < WIDTH; x++) {
            const double d = sst_disp_px(lf, sst_map_u16_row(&v->disp, y)[x]), w = place_weight(lf, view, x, y, cut_px);

            if (w > 0 && x + (int)floor(d * (double)(float)v->bx + 0.5) == px &&
                y + (int)floor(d * (double)(float)v->by + 0.5) == py && d >= nearest) {
                *weight = d > nearest ? w : fmax(w, *weight);
                nearest = d;
            }
        }
    }
    return nearest;
}

/* What all views send to the pixel; returns how many do, the nearest first. */
static int arriving(double *d, const struct sst_lightfield *lf, int px, int py, double cut_px)
{
    double weight;
    int n = 0;

    for (int k = 0; k < 9; k++) {
        d[n] = landed(&weight, lf, k, px, py, cut_px);
        n += d[n] > -INFINITY;
    }
    qsort(d, (size_t)n, sizeof(*d), compare_down);
    return n;
}

static double surface(const struct sst_lightfield *lf, int px, int py, double cut_px)
{
    double d[9];
    const int n = arriving(d, lf, px, py, cut_px);

    for (int i = 0; i < n; i++) {
        double sum = 0;
        int count = 0;

        for (int j = 0; j < n; j++) {
            if (d[j] <= d[i] && d[j] >= d[i] - 0.75) {
                sum += d[j];
                count++;
            }
        }
        if (count >= 2 && 4 * count >= n)
            return sum / count;
    }
    return NAN;
}

static void surfaces_equal_the_plain_reference(void **state SST_UNUSED)
{
    const double cut = 7;
    struct sst_render_config cfg = config(cut);
    struct sst_lightfield lf;
    struct sst_renderer *r;
    int with = 0;

    make_random(&lf);
    assert_int_equal(sst_renderer_create(&r, &lf, 1), 0);
    for (int y = 1; y < HEIGHT; y += 5) {
        for (int x = 1; x < WIDTH; x += 7) {
            const double want = surface(&lf, x, y, cut);
            struct sst_ray rays[SST_MAX_VIEWS];
            double share = 0;
            int n;

            assert_true((n = sst_render_rays(r, &cfg, x, y, rays)) >= 0);
            if (isnan(want))
                assert_int_equal(n, 0);
            for (int i = 0; i < n; i++) {
                const double bx = lf.views[rays[i].view].bx, by = lf.views[rays[i].view].by;
                double weight;

                assert_true(fabs(rays[i].x - (x - want * bx)) < 1e-4 && fabs(rays[i].y - (y - want * by)) < 1e-4);
                assert_true(fabs(rays[i].disp_px - landed(&weight, &lf, rays[i].view, x, y, cut)) < 1e-6);
                assert_true(fabs(rays[i].disp_px - want) <= 0.75 + 1e-6);
                assert_true(fabs(rays[i].w_depth - weight) < 1e-6);
                share += rays[i].share;
            }
            assert_true(n == 0 || fabs(share - 1) < 1e-5);
            with += n > 0;
        }
    }
    assert_true(with > 20);
    sst_renderer_destroy(r);
    sst_lightfield_fini(&lf);
}

/* The picture is the sum of the rays that it explains. */
static void pictures_are_the_sum_of_their_rays(void **state SST_UNUSED)
{
    struct sst_render_config cfg = config(INFINITY);
    struct sst_lightfield lf;
    struct sst_renderer *r;
    struct clear_picture p;
    int seen = 0;

    make_random(&lf);
    assert_int_equal(render(&p, &lf, &cfg), 0);
    assert_int_equal(sst_renderer_create(&r, &lf, 1), 0);
    for (int y = 0; y < HEIGHT; y += 7) {
        for (int x = 0; x < WIDTH; x += 5) {
            struct sst_ray rays[SST_MAX_VIEWS];
            double weight = 0, colour[3] = { 0 };
            int n;

            assert_true((n = sst_render_rays(r, &cfg, x, y, rays)) >= 0);
            for (int i = 0; i < n; i++) {
                weight += rays[i].w_depth;
                for (int c = 0; c < 3; c++)
                    colour[c] += rays[i].share * rays[i].colour[c];
            }
            assert_int_equal(sst_map_u8_row(&p.valid, y)[x], weight >= 0.5 ? CLEAR_SEEN : CLEAR_FILLED);
            for (int c = 0; c < 3 && weight >= 1; c++)
                assert_true(fabs(sst_image_row(&p.image, c, y)[x] - colour[c]) <= 0.51);
            seen += weight >= 1;
        }
    }
    assert_true(seen > 20);
    sst_renderer_destroy(r);
    fini(&p);
    sst_lightfield_fini(&lf);
}

static void threads_do_not_matter(void **state SST_UNUSED)
{
    struct sst_render_config cfg = config(7);
    struct clear_picture one, many;
    struct sst_lightfield lf;

    make_random(&lf);
    cfg.threads = 1;
    cfg.view_bx = 0.3;
    assert_int_equal(render(&one, &lf, &cfg), 0);
    cfg.threads = 5;
    assert_int_equal(render(&many, &lf, &cfg), 0);
    for (int y = 0; y < HEIGHT; y++) {
        for (int c = 0; c < 3; c++)
            assert_memory_equal(sst_image_row(&one.image, c, y), sst_image_row(&many.image, c, y), WIDTH);
        assert_memory_equal(sst_map_u8_row(&one.valid, y), sst_map_u8_row(&many.valid, y), WIDTH);
    }
    fini(&one);
    fini(&many);
    sst_lightfield_fini(&lf);
}

/* --- fill, cut, objects, faults ----------------------------------------------------------------------------------- */

static void fill_by_hand(void **state SST_UNUSED)
{
    static const int sizes[][2] = { { 1, 1 }, { 2, 2 }, { 3, 5 }, { 17, 1 }, { 33, 20 } };

    for (size_t i = 0; i < ARRAY_LEN(sizes); i++) {
        const int w = sizes[i][0], h = sizes[i][1];
        struct sst_map_u8 weight;
        struct sst_image img;
        void *levels = malloc(clear_fill_bytes(w, h));

        assert_int_equal(sst_image_init(&img, w, h), 0);
        assert_int_equal(sst_map_u8_init(&weight, w, h), 0);
        for (int c = 0; c < 3; c++)
            sst_image_row(&img, c, h - 1)[w - 1] = (uint8_t)(50 * (c + 1));
        sst_map_u8_row(&weight, h - 1)[w - 1] = 255; /* the only pixel that is known: everywhere its colour */
        assert_int_equal(clear_fill(&img, &weight, levels, 2), 0);
        for (int c = 0; c < 3; c++) {
            for (int y = 0; y < h; y++) {
                for (int x = 0; x < w; x++)
                    assert_int_equal(sst_image_row(&img, c, y)[x], 50 * (c + 1));
            }
        }
        free(levels);
        sst_image_fini(&img);
        sst_map_u8_fini(&weight);
    }
}

static void cuts_lie_in_gaps(void **state SST_UNUSED)
{
    struct sst_lightfield lf;
    struct sst_renderer *r;
    double cut = -1;

    make_world(&lf, 3, slab);
    assert_int_equal(sst_renderer_create(&r, &lf, 1), 0);
    assert_int_equal(sst_render_find_cut(r, &cut), 0);
    assert_true(cut > BACK + 1 && cut < FRONT - 1);
    sst_renderer_destroy(r);
    sst_lightfield_fini(&lf);
    cut = -1;
    make_world(&lf, 3, nothing);
    assert_int_equal(sst_renderer_create(&r, &lf, 1), 0);
    assert_int_equal(sst_render_find_cut(r, &cut), -ENODATA);
    assert_true(cut == -1);
    sst_renderer_destroy(r);
    sst_lightfield_fini(&lf);
}

/* An object is marked in every view where it stands there, with one pixel around it. */
static void objects_go_through_all_views(void **state SST_UNUSED)
{
    struct sst_map_u8 mask[9] = { 0 };
    struct sst_lightfield lf;

    make_world(&lf, 3, box);
    assert_int_equal(sst_render_grow_object(mask, &lf, 30, 25, 2), 0);
    for (int k = 0; k < 9; k++) {
        const int dx = (int)(FRONT * lf.views[k].bx), dy = (int)(FRONT * lf.views[k].by);

        for (int y = 0; y < HEIGHT; y++) {
            for (int x = 0; x < WIDTH; x++) {
                const bool near = x + dx >= 27 && x + dx < 39 && y + dy >= 19 && y + dy < 31;

                assert_int_equal(sst_map_u8_row(&mask[k], y)[x], near ? 255 : 0);
            }
        }
        sst_map_u8_fini(&mask[k]);
    }
    assert_int_equal(sst_render_grow_object(mask, &lf, WIDTH, 0, 2), -ERANGE);
    sst_map_u16_row(&lf.views[lf.ref_view].disp, 3)[3] = SST_DISP_NONE;
    assert_int_equal(sst_render_grow_object(mask, &lf, 3, 3, 2), -ENODATA);
    sst_lightfield_fini(&lf);
}

static void impossible_wishes_are_refused(void **state SST_UNUSED)
{
    struct sst_render_config cfg = config(NAN);
    struct sst_lightfield lf;
    struct clear_picture p;

    make_world(&lf, 3, post);
    assert_int_equal(render(&p, &lf, &cfg), -EINVAL);
    fini(&p);
    cfg = config(-20);
    assert_int_equal(render(&p, &lf, &cfg), -ERANGE);
    fini(&p);
    cfg = config(5);
    cfg.view_by = 1.5;
    assert_int_equal(render(&p, &lf, &cfg), -ERANGE);
    fini(&p);
    cfg = config(5);
    sst_map_u16_fini(&lf.views[7].disp);
    assert_int_equal(render(&p, &lf, &cfg), -ENODATA);
    fini(&p);
    sst_lightfield_fini(&lf);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(post_vanishes_by_cut_label_and_object),
        cmocka_unit_test(nothing_removed_shows_the_camera),
        cmocka_unit_test(viewpoints_move_the_wall),
        cmocka_unit_test(holes_are_filled_from_behind),
        cmocka_unit_test(single_rays_are_not_believed),
        cmocka_unit_test(nothing_left_is_unknown),
        cmocka_unit_test(surfaces_equal_the_plain_reference),
        cmocka_unit_test(pictures_are_the_sum_of_their_rays),
        thread_test(threads_do_not_matter),
        cmocka_unit_test(fill_by_hand),
        cmocka_unit_test(cuts_lie_in_gaps),
        cmocka_unit_test(objects_go_through_all_views),
        cmocka_unit_test(impossible_wishes_are_refused),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
