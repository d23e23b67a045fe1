/* simulators/scene: geometry worked by hand, truth that holds between views, folders that are the same every time. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <dirent.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/file.h"
#include "pipeline/image/classes.h"
#include "pipeline/image/codec.h"
#include "pipeline/lightfield/folder.h"
#include "simulators/scene/scene_internal.h"
#include "tests/folder.h"
#include "tests/small.h"
#include "tests/test.h"

#define assert_near(a, b, within) assert_true(fabs((double)(a) - (double)(b)) <= (within))

/* A view's truth, and its picture where asked for. */
struct view {
    struct sst_image image;
    struct sst_map_f32 disp;
    struct sst_map_u8 label;
};

static void view_fini(struct view *v)
{
    sst_image_fini(&v->image);
    sst_map_f32_fini(&v->disp);
    sst_map_u8_fini(&v->label);
}

static struct view render(const struct sst_scene *s, int width, int height, double bx, double by, unsigned hidden,
                          bool image)
{
    struct view v = { 0 };

    assert_int_equal(sst_image_init(&v.image, width, height), 0);
    assert_int_equal(sst_map_f32_init(&v.disp, width, height), 0);
    assert_int_equal(sst_map_u8_init(&v.label, width, height), 0);
    assert_int_equal(sst_scene_render(s, bx, by, hidden,
                                      &(struct sst_scene_maps){
                                          .image = image ? &v.image : NULL, .disp = &v.disp, .label = &v.label }),
                     0);
    return v;
}

static struct sst_scene *create(const char *name, int width, int height, uint64_t seed, double time_s)
{
    struct sst_scene_config cfg;
    struct sst_scene *s = NULL;

    sst_scene_config_defaults(&cfg);
    cfg.width = width;
    cfg.height = height;
    cfg.seed = seed;
    cfg.time_s = time_s;
    assert_int_equal(sst_scene_create(&s, name, &cfg), 0);
    return s;
}

static int label_at(const struct view *v, int x, int y)
{
    return sst_map_u8_row(&v->label, y)[x];
}

static float disp_at(const struct view *v, int x, int y)
{
    return sst_map_f32_row(&v->disp, y)[x];
}

/* --- geometry ---------------------------------------------------------------------------------------------------- */

/* A picture of 101 x 101 pixels, f = 100 px, principal point (50, 50), B = 100 mm. */
static struct view raster(struct sst_scene_world *w, double bx, double by)
{
    struct view v = { 0 };
    struct sst_scene_raster r = { .world = w,
                                  .focal_px = 100,
                                  .cx = 50,
                                  .cy = 50,
                                  .width = 101,
                                  .height = 101,
                                  .step_x = 1,
                                  .step_y = 1,
                                  .bx = bx,
                                  .by = by,
                                  .disp = &v.disp,
                                  .label = &v.label };

    assert_int_equal(sst_map_f32_init(&v.disp, 101, 101), 0);
    assert_int_equal(sst_map_u8_init(&v.label, 101, 101), 0);
    assert_int_equal(sst_scene_raster_run(&r), 0);
    return v;
}

/* Z = 2000 mm: d = 100 * 100 / 2000 = 5 px; half size 50 mm is 2.5 px, so 5 x 5 pixel centres are covered. */
static void facing_square_lands_where_it_must(void **state SST_UNUSED)
{
    static const double offsets[][2] = { { 0, 0 }, { 1, 0 }, { -2, 3 }, { 0.4, -0.2 } };
    struct sst_scene_world w = { .focal = 100, .spacing_mm = 100, .label = 7 };

    sst_scene_add_patch(&w, vec3(0, 0, 2000), vec3(50, 0, 0), vec3(0, 50, 0), material(sst_scene_paint_fbm, 0, 0, 1));
    for (size_t i = 0; i < ARRAY_LEN(offsets); i++) {
        struct view v = raster(&w, offsets[i][0], offsets[i][1]);
        const int x0 = 48 - (int)lround(5 * offsets[i][0]), y0 = 48 - (int)lround(5 * offsets[i][1]);

        for (int y = 0; y < 101; y++) {
            for (int x = 0; x < 101; x++) {
                const bool in = x >= x0 && x < x0 + 5 && y >= y0 && y < y0 + 5;

                assert_int_equal(label_at(&v, x, y), in ? 7 : 0);
                assert_near(disp_at(&v, x, y), in ? 5 : 0, 1e-6);
            }
        }
        view_fini(&v);
    }
    free(w.surfaces);
}

/* The floor 100 mm below the camera: row 50 + r looks at Z = 100 * 100 / r mm, so d = r; a camera one spacing lower
 * sits on it, one half a spacing lower sees d = 2 r. */
static void floor_disparity_is_the_row_below_the_horizon(void **state SST_UNUSED)
{
    struct sst_scene_world w = { .focal = 100, .spacing_mm = 100, .label = 4 };
    struct view ref, low;

    sst_scene_add_floor(&w, 100, 100, 100000, material(sst_scene_paint_fbm, 0, 0, 1));
    ref = raster(&w, 0, 0);
    low = raster(&w, 0, 0.5);
    for (int r = 1; r <= 50; r++) {
        assert_near(disp_at(&ref, 13, 50 + r), r, 1e-4);
        assert_near(disp_at(&low, 77, 50 + r), 2 * r, 2e-4);
    }
    assert_int_equal(label_at(&ref, 50, 50), 0);
    view_fini(&ref);
    view_fini(&low);
    free(w.surfaces);
}

/* A ball of radius 100 mm at 2000 mm: nearest point 1900 mm; outline at 100 * 100 / sqrt(2000^2 - 100^2) = 5.006 px. */
static void ball_has_its_depth_and_outline(void **state SST_UNUSED)
{
    struct sst_scene_world w = { .focal = 100, .spacing_mm = 100, .label = 9 };
    struct view v;
    int across = 0;

    add_ball(&w, vec3(0, 0, 2000), vec3(100, 100, 100), material(sst_scene_paint_fbm, 0, 0, 1));
    v = raster(&w, 0, 0);
    assert_near(disp_at(&v, 50, 50), 10000.0 / 1900, 1e-6);
    for (int x = 0; x < 101; x++)
        across += label_at(&v, x, 50) == 9;
    assert_int_equal(across, 11);
    assert_int_equal(label_at(&v, 50, 45), 9);
    assert_int_equal(label_at(&v, 50, 44), 0);
    view_fini(&v);
    /* The nearer surface wins whatever the order. */
    sst_scene_begin(&w, 3, 0);
    sst_scene_add_patch(&w, vec3(0, 0, 1950), vec3(500, 0, 0), vec3(0, 500, 0), material(sst_scene_paint_fbm, 0, 0, 1));
    v = raster(&w, 0, 0);
    assert_int_equal(label_at(&v, 50, 50), 9);
    assert_int_equal(label_at(&v, 50, 45), 3);
    view_fini(&v);
    free(w.surfaces);
}

/* --- truth ------------------------------------------------------------------------------------------------------- */

/*
 * With bx = n / d a point of disparity d moves by exactly n pixels: there the other view sees the same point, or
 * something nearer, never something farther.
 */
static void truth_moves_points_between_views(void **state SST_UNUSED)
{
    const int width = 160, height = 120;

    for (const char *const *name = sst_scene_names(); *name; name++) {
        struct sst_scene *s = create(*name, width, height, 3, 0);
        struct view ref = render(s, width, height, 0, 0, 0, false);
        int same = 0, tried = 0;

        for (int i = 0; i < 12; i++) {
            const int x = 20 + 10 * i, y = 5 + (i * 37) % 110, n = i % 2 ? 7 : -5, m = i % 3 - 1;
            const double d = disp_at(&ref, x, y);
            struct view other = render(s, width, height, n / d, m / d, 0, false);
            const float got = disp_at(&other, x - n, sst_clamp_int(y - m, 0, height - 1));

            assert_true(got > d - 1e-4 * d);
            if (got < d + 1e-4 * d) {
                assert_int_equal(label_at(&other, x - n, y - m), label_at(&ref, x, y));
                same++;
            }
            tried++;
            view_fini(&other);
        }
        if (same < tried / 2)
            fail_msg("%s: only %d of %d points are seen again", *name, same, tried);
        view_fini(&ref);
        sst_scene_destroy(s);
    }
}

/* The nuclei lie on a facing plane of 30 px at 1000 px, 6 px at 200: the neighbour's picture is the same, 6 px to the
 * left. */
static void texture_agrees_between_views(void **state SST_UNUSED)
{
    struct sst_scene *s = create("cell", 200, 40, 1, 0);
    struct view a = render(s, 200, 40, 0, 0, 1, true), b = render(s, 200, 40, 1, 0, 1, true);

    for (int c = 0; c < 3; c++) {
        for (int y = 0; y < 40; y++) {
            for (int x = 6; x < 200; x++)
                assert_in_range(sst_image_row(&a.image, c, y)[x] - sst_image_row(&b.image, c, y)[x - 6] + 1, 0, 2);
        }
    }
    view_fini(&a);
    view_fini(&b);
    sst_scene_destroy(s);
}

static void hidden_occluders_leave_nothing(void **state SST_UNUSED)
{
    for (const char *const *name = sst_scene_names(); *name; name++) {
        struct sst_scene *s = create(*name, 120, 90, 2, 0);
        struct view all = render(s, 120, 90, 0, 0, 0, false);

        assert_true(sst_scene_occluder_count(s) >= 1);
        for (int i = 0; i < sst_scene_occluder_count(s); i++) {
            const struct sst_scene_occluder *o = sst_scene_occluder_at(s, i);
            struct view behind = render(s, 120, 90, 0, 0, 1u << i, false);
            int before = 0, after = 0, target = 0;

            for (int y = 0; y < 90; y++) {
                for (int x = 0; x < 120; x++) {
                    before += label_at(&all, x, y) == o->label;
                    after += label_at(&behind, x, y) == o->label;
                    target += label_at(&all, x, y) == o->label && label_at(&behind, x, y) == o->target_label;
                    assert_true(disp_at(&behind, x, y) <= disp_at(&all, x, y));
                }
            }
            if (!before || after || !target)
                fail_msg("%s/%s: %d px of the occluder, %d when hidden, %d before the target", *name, o->name, before,
                         after, target);
            view_fini(&behind);
        }
        assert_null(sst_scene_occluder_at(s, sst_scene_occluder_count(s)));
        view_fini(&all);
        sst_scene_destroy(s);
    }
}

static void every_disparity_is_within_the_range(void **state SST_UNUSED)
{
    for (const char *const *name = sst_scene_names(); *name; name++) {
        struct sst_scene *s = create(*name, 120, 90, 1, 0);
        double lo, hi;

        sst_scene_range(s, &lo, &hi);
        assert_true(lo >= 0 && lo < hi && hi <= 128 * 120 / 1000.0 + 1);
        for (int view = 0; view < 36; view += 5) { /* the corners are among them */
            struct view v = render(s, 120, 90, view % 6 - 2, view / 6 - 2, 0, false);

            for (int y = 0; y < 90; y++) {
                for (int x = 0; x < 120; x++) {
                    assert_true(disp_at(&v, x, y) >= lo && disp_at(&v, x, y) <= hi);
                    assert_int_not_equal(label_at(&v, x, y), SST_LABEL_NONE);
                }
            }
            view_fini(&v);
        }
        sst_scene_destroy(s);
    }
}

/* Boards were put at these disparities of a picture 1000 px wide. */
static void focus_is_the_disparity_of_the_target(void **state SST_UNUSED)
{
    static const struct {
        const char *scene;
        int occluder;
        double disp_px;
    } known[] = { { "cd-cases", 0, 27 }, { "pedestrian", 0, 27 }, { "pedestrian", 1, 13 }, { "cell", 0, 30 } };

    for (size_t i = 0; i < ARRAY_LEN(known); i++) {
        struct sst_scene *s = create(known[i].scene, 500, 300, 5, 0);

        assert_near(sst_scene_occluder_at(s, known[i].occluder)->focus_px, known[i].disp_px / 2, 1e-4);
        sst_scene_destroy(s);
    }
}

static void leaves_cover_the_man_but_not_wholly(void **state SST_UNUSED)
{
    for (uint64_t seed = 1; seed <= 4; seed++) {
        struct sst_scene *s = create("bush", 400, 300, seed, 0);
        struct view all = render(s, 400, 300, 0, 0, 0, false), behind = render(s, 400, 300, 0, 0, 1, false);
        double man = 0, covered = 0;

        for (int y = 0; y < 300; y++) {
            for (int x = 0; x < 400; x++) {
                if (label_at(&behind, x, y) != SST_LABEL_PEDESTRIAN)
                    continue;
                man++;
                covered += label_at(&all, x, y) == SST_LABEL_TREE;
            }
        }
        if (man < 3000 || covered < 0.58 * man || covered > 0.8 * man)
            fail_msg("seed %d: %g px of the man, %g covered", (int)seed, man, covered);
        view_fini(&all);
        view_fini(&behind);
        sst_scene_destroy(s);
    }
}

static double middle_of(const struct view *v, int label)
{
    double sum = 0, n = 0;

    for (int y = 0; y < v->label.height; y++) {
        for (int x = 0; x < v->label.width; x++) {
            sum += label_at(v, x, y) == label ? x : 0;
            n += label_at(v, x, y) == label;
        }
    }
    assert_true(n > 0);
    return sum / n;
}

/* 1150 mm/s at 64 px disparity and 161 mm spacing: 91.4 px of a picture 1000 px wide in 0.2 s. */
static void time_moves_the_walker_and_the_leaves(void **state SST_UNUSED)
{
    struct sst_scene *a = create("pedestrian", 400, 300, 1, 0), *b = create("pedestrian", 400, 300, 1, 0.2);
    struct view first = render(a, 400, 300, 0, 0, 0, false), second = render(b, 400, 300, 0, 0, 0, false);
    int changed = 0;

    assert_near(middle_of(&second, SST_LABEL_PEDESTRIAN) - middle_of(&first, SST_LABEL_PEDESTRIAN), 91.4 * 0.4, 6);
    view_fini(&first);
    view_fini(&second);
    sst_scene_destroy(a);
    sst_scene_destroy(b);
    a = create("bush", 200, 150, 1, 0);
    b = create("bush", 200, 150, 1, 0.5);
    first = render(a, 200, 150, 0, 0, 0, false);
    second = render(b, 200, 150, 0, 0, 0, false);
    for (int y = 0; y < 150; y++)
        changed += memcmp(sst_map_f32_row(&first.disp, y), sst_map_f32_row(&second.disp, y), 200 * sizeof(float)) != 0;
    assert_true(changed > 100);
    view_fini(&first);
    view_fini(&second);
    sst_scene_destroy(a);
    sst_scene_destroy(b);
}

/* --- folders ----------------------------------------------------------------------------------------------------- */

static int compare_folders(const char *a, const char *b)
{
    DIR *dir = opendir(a);
    int files = 0;

    assert_non_null(dir);
    for (const struct dirent *e; (e = readdir(dir));) {
        char pa[SST_PATH_MAX], pb[SST_PATH_MAX];
        uint8_t *da = NULL, *db = NULL;
        size_t na = 0, nb = 0;

        if (e->d_name[0] == '.')
            continue;
        assert_int_equal(sst_path_join(pa, a, e->d_name), 0);
        assert_int_equal(sst_path_join(pb, b, e->d_name), 0);
        if (sst_path_is_dir(pa)) {
            files += compare_folders(pa, pb);
            continue;
        }
        assert_int_equal(sst_file_read(pa, 1 << 24, &da, &na), 0);
        assert_int_equal(sst_file_read(pb, 1 << 24, &db, &nb), 0);
        if (na != nb || memcmp(da, db, na))
            fail_msg("%s and %s differ", pa, pb);
        free(da);
        free(db);
        files++;
    }
    closedir(dir);
    return files;
}

static struct sst_scene_config small(int width, int height, int rows, int cols, int threads)
{
    return (struct sst_scene_config){
        .width = width, .height = height, .rows = rows, .cols = cols, .seed = 11, .threads = threads
    };
}

static void any_number_of_threads_gives_the_same_bytes(void **state SST_UNUSED)
{
    struct sst_scene_config one = small(80, 60, 2, 3, 1), three = small(80, 60, 2, 3, 3);

    assert_int_equal(sst_scene_write("pedestrian", &one, test_path("one"), false), 0);
    assert_int_equal(sst_scene_write("pedestrian", &three, test_path("three"), false), 0);
    /* lightfield.json, 6 views, 6 disparities, 6 labels, truth.json, behind and occluder of the principal and of both
     */
    assert_int_equal(compare_folders(test_path("one"), test_path("three")), 1 + 6 + 6 + 6 + 1 + 6);
    assert_int_equal(sst_scene_write("pedestrian", &one, test_path("one"), false), -EEXIST);
    assert_int_equal(sst_scene_write("cat", &one, test_path("one"), true), 0);
}

static void folder_says_what_is_in_it(void **state SST_UNUSED)
{
    struct sst_scene_config cfg = small(120, 90, 3, 4, 2);
    struct sst_lightfield lf;
    struct sst_map_f32 disp = { 0 };
    struct sst_map_u8 label = { 0 }, mask = { 0 };
    struct sst_scene *s = NULL;
    struct view v;

    assert_int_equal(sst_scene_write("bush", &cfg, test_path("bush"), false), 0);
    assert_int_equal(sst_lightfield_load(&lf, test_path("bush"), SST_LOAD_IMAGES, 1), 0);
    assert_int_equal(lf.rows, 3);
    assert_int_equal(lf.cols, 4);
    assert_int_equal(lf.ref_view, 5);
    assert_near(lf.focal_px, 3200 * 0.12, 1e-9);
    assert_string_equal(lf.files->source, "scene bush seed 11");
    assert_near(lf.views[11].bx, 2, 0);
    assert_near(lf.views[11].by, 1, 0);

    assert_int_equal(sst_scene_create(&s, "bush", &cfg), 0);
    v = render(s, 120, 90, 2, 1, 0, true);
    assert_int_equal(sst_map_f32_read_pfm(&disp, test_path("bush/truth/02_03.pfm")), 0);
    assert_int_equal(sst_map_u8_read_png(&label, test_path("bush/truth/02_03.png")), 0);
    for (int y = 0; y < 90; y++) {
        assert_memory_equal(sst_map_f32_row(&disp, y), sst_map_f32_row(&v.disp, y), 120 * sizeof(float));
        assert_memory_equal(sst_map_u8_row(&label, y), sst_map_u8_row(&v.label, y), 120);
        assert_memory_equal(sst_image_row(&lf.views[11].image, 1, y), sst_image_row(&v.image, 1, y), 120);
    }
    view_fini(&v);
    v = render(s, 120, 90, 0, 0, 0, false);
    assert_int_equal(sst_map_u8_read_png(&mask, test_path("bush/truth/occluder.png")), 0);
    for (int y = 0; y < 90; y++) {
        for (int x = 0; x < 120; x++)
            assert_int_equal(sst_map_u8_row(&mask, y)[x], label_at(&v, x, y) == SST_LABEL_TREE ? 255 : 0);
    }
    view_fini(&v);
    sst_map_f32_fini(&disp);
    sst_map_u8_fini(&label);
    sst_map_u8_fini(&mask);
    sst_scene_destroy(s);
    sst_lightfield_fini(&lf);
}

static void odd_sizes_work(void **state SST_UNUSED)
{
    static const int sizes[][4] = { { 1, 1, 1, 1 }, { 5, 17, 2, 1 }, { 3, 2, 1, 16 } };
    struct sst_scene_config cfg = small(17, 5, 1, 1, 2);

    for (const char *const *name = sst_scene_names(); *name; name++) {
        assert_int_equal(sst_scene_write(*name, &cfg, test_path("odd"), true), 0);
        assert_true(sst_path_exists(test_path("odd/truth/behind.png")));
    }
    for (size_t i = 0; i < ARRAY_LEN(sizes); i++) {
        cfg = small(sizes[i][0], sizes[i][1], sizes[i][2], sizes[i][3], 2);
        assert_int_equal(sst_scene_write("pedestrian", &cfg, test_path("odd"), true), 0);
    }
}

static void what_cannot_be_made_is_refused(void **state SST_UNUSED)
{
    struct sst_scene_config cfg = small(40, 30, 1, 1, 1);
    struct sst_scene *s = NULL;

    assert_int_equal(sst_scene_write("Bush", &cfg, test_path("no"), false), -EINVAL);
    assert_int_equal(sst_scene_create(&s, "", &cfg), -EINVAL);
    cfg.width = 0;
    assert_int_equal(sst_scene_write("bush", &cfg, test_path("no"), false), -EINVAL);
    cfg = small(SST_IMAGE_MAX_SIDE, SST_IMAGE_MAX_SIDE, 1, 1, 1);
    assert_int_equal(sst_scene_create(&s, "bush", &cfg), -EINVAL);
    cfg = small(40, 30, 1, 257, 1);
    assert_int_equal(sst_scene_create(&s, "bush", &cfg), -EINVAL);
    cfg = small(40, 30, 1, 1, 1);
    cfg.time_s = NAN;
    assert_int_equal(sst_scene_create(&s, "bush", &cfg), -EINVAL);
    assert_null(s);
    assert_false(sst_path_exists(test_path("no")));
}

/* --- small parts ------------------------------------------------------------------------------------------------- */

static void random_numbers_are_splitmix64(void **state SST_UNUSED)
{
    uint64_t rng = 1234567;

    assert_int_equal(sst_random_u64(&rng), 6457827717110365317u);
    assert_int_equal(sst_random_u64(&rng), 3203168211198807973u);
    for (int i = 0; i < 1000; i++) {
        const double r = sst_random_in(&rng, -2, 3);

        assert_true(r >= -2 && r < 3);
    }
}

static void noise_joins_its_lattice_values(void **state SST_UNUSED)
{
    const float a = sst_noise(vec3(3, -4, 0), 5), b = sst_noise(vec3(4, -4, 0), 5);

    assert_near(a, (sst_noise_hash(3, -4, 0, 5) >> 8) / 16777216.0, 1e-7);
    assert_near(sst_noise(vec3(3.5, -4, 0), 5), (a + b) / 2, 1e-6);
    assert_near(sst_noise(vec3(3.25, -4, 0), 5), a + (b - a) * (3 - 0.5) / 16, 1e-6);
    for (int i = 0; i < 1000; i++) {
        const float f = sst_noise_fbm(vec3(0.37 * i, 0.11 * i, i & 1 ? 0.2 * i : 0), 5, 1);

        assert_true(f >= 0 && f <= 1);
    }
}

static void letters_are_readable(void **state SST_UNUSED)
{
    for (int x = 0; x < 5; x++) {
        assert_true(sst_font_dot("ST", 6 + x, 0)); /* the bar of T */
        assert_int_equal(sst_font_dot("ST", 6 + x, 4), x == 2);
    }
    assert_false(sst_font_dot("ST", 5, 0)); /* between the letters */
    assert_false(sst_font_dot("ST", 12, 0));
    assert_false(sst_font_dot("ST", -1, 0));
    assert_false(sst_font_dot("S T", 8, 3));
}

/* --- layers of photographs ---------------------------------------------------------------------------------------- */

static const char *const kinds[] = { "leaves", "foliage", "branches", "slats", "mesh", "crowd" };

static struct sst_scene *create_layers(const char *kind, uint64_t seed)
{
    struct sst_scene_config cfg;
    struct sst_scene *s = NULL;

    sst_scene_config_defaults(&cfg);
    cfg.width = 240;
    cfg.height = 180;
    cfg.seed = seed;
    cfg.layers.kind = kind;
    assert_int_equal(sst_scene_create(&s, "layers", &cfg), 0);
    return s;
}

/* What a view shows at x lies at x + d b in the reference view: there is the same, or something nearer. Single pixels
 * at edges differ by rounding. */
static int misplaced(const struct view *v, const struct view *ref, int bx, int by, int *checked)
{
    int wrong = 0;

    for (int y = 0; y < v->disp.height; y++) {
        for (int x = 0; x < v->disp.width; x++) {
            const double d = sst_map_f32_row(&v->disp, y)[x], fx = x + d * bx + 0.5, fy = y + d * by + 0.5;
            const int rx = (int)floor(fx), ry = (int)floor(fy);
            bool found = false;

            if (rx < 1 || ry < 1 || rx >= v->disp.width - 1 || ry >= v->disp.height - 1)
                continue;
            for (int i = 0; i < 9; i++) {
                const float there = sst_map_f32_row(&ref->disp, ry - 1 + i / 3)[rx - 1 + i % 3];

                found |= there > d + 0.5 ||
                         (fabs(there - d) <= 0.5 && label_at(ref, rx - 1 + i % 3, ry - 1 + i / 3) == label_at(v, x, y));
            }
            (*checked)++;
            wrong += !found;
        }
    }
    return wrong;
}

static void check_truth_between_views(struct sst_scene *s)
{
    struct view ref = render(s, 240, 180, 0, 0, 0, false), v = render(s, 240, 180, 2, -1, 0, false);
    int checked = 0;
    const int wrong = misplaced(&v, &ref, 2, -1, &checked);
    double lo, hi;

    sst_scene_range(s, &lo, &hi);
    assert_true(lo > 0 && hi < 60 && sst_scene_occluder_at(s, 0)->focus_px > lo);
    assert_true(checked > 240 * 180 / 4 && wrong * 200 < checked);
    view_fini(&v);
    view_fini(&ref);
}

/* Hidden, nothing in front of the focus is left; shown, the mask marks nearer surfaces. */
static void check_occluder(struct sst_scene *s)
{
    const double focus = sst_scene_occluder_at(s, 0)->focus_px;
    struct view front = render(s, 240, 180, 0, 0, 0, false), behind = render(s, 240, 180, 0, 0, 1, false);
    struct sst_map_u8 mask = { 0 };
    int covered = 0;

    assert_int_equal(sst_map_u8_init(&mask, 240, 180), 0);
    assert_int_equal(scene_mask(s, 0, &mask), 0);
    for (int k = 0; k < 240 * 180; k++) {
        const int x = k % 240, y = k / 240;

        assert_true(sst_map_f32_row(&behind.disp, y)[x] < focus + 1);
        assert_int_equal(sst_map_f32_row(&front.disp, y)[x] > focus + 4, sst_map_u8_row(&mask, y)[x] != 0);
        covered += sst_map_u8_row(&mask, y)[x] != 0;
    }
    assert_true(covered > 240 * 180 / 10 && covered < 240 * 180 * 9 / 10);
    sst_map_u8_fini(&mask);
    view_fini(&behind);
    view_fini(&front);
}

static void layers_agree_between_views_and_hide_what_is_behind(void **state SST_UNUSED)
{
    for (size_t i = 0; i < ARRAY_LEN(kinds); i += small_level() ? 2 : 1) {
        struct sst_scene *s = create_layers(kinds[i], 21 + i);

        check_truth_between_views(s);
        check_occluder(s);
        sst_scene_destroy(s);
    }
}

/* The scene behind is one at all covers, and nothing stands in front of it at 0 %. */
static void cover_changes_the_front_alone(void **state SST_UNUSED)
{
    struct view behind[2];

    for (int i = 0; i < 2; i++) {
        struct sst_scene_config cfg = small(120, 90, 6, 6, 1);
        struct sst_scene *s;

        cfg.layers.kind = "foliage";
        cfg.layers.cover_percent = 60 * i;
        assert_int_equal(sst_scene_create(&s, "layers", &cfg), 0);
        behind[i] = render(s, 120, 90, 0, 0, i, false);
        sst_scene_destroy(s);
    }
    for (int y = 0; y < 90; y++) {
        assert_memory_equal(sst_map_f32_row(&behind[0].disp, y), sst_map_f32_row(&behind[1].disp, y),
                            120 * sizeof(float));
        assert_memory_equal(sst_image_row(&behind[0].image, 1, y), sst_image_row(&behind[1].image, 1, y), 120);
    }
    view_fini(&behind[0]);
    view_fini(&behind[1]);
}

static void layers_repeat_for_any_number_of_threads(void **state SST_UNUSED)
{
    struct sst_scene_config one = small(120, 90, 2, 3, 1), four = small(120, 90, 2, 3, 4);

    one.layers = four.layers =
        (struct sst_layers_config){ .kind = "mixed", .cover_percent = -1, .noise = 2, .gain_percent = 3, .jpeg = -1 };
    assert_int_equal(sst_scene_write("layers", &one, test_path("layers1"), false), 0);
    assert_int_equal(sst_scene_write("layers", &four, test_path("layers4"), false), 0);
    assert_int_equal(compare_folders(test_path("layers1"), test_path("layers4")), 1 + 6 + 6 + 6 + 1 + 4);
}

static int write_with_photos(const char *photos, const char *masks, const char *kind)
{
    struct sst_scene_config cfg = small(64, 48, 2, 2, 1);

    cfg.layers = (struct sst_layers_config){ .photos = photos, .masks = masks, .kind = kind, .cover_percent = -1 };
    return sst_scene_write("layers", &cfg, test_path("layers.lf"), true);
}

static void hostile_photos_are_refused(void **state SST_UNUSED)
{
    char photos[SST_PATH_MAX], masks[SST_PATH_MAX], path[SST_PATH_MAX];
    struct sst_image image = { 0 };
    struct sst_map_u8 map = { 0 };

    snprintf(photos, sizeof(photos), "%s", test_path("photos"));
    snprintf(masks, sizeof(masks), "%s", test_path("masks"));
    assert_int_equal(write_with_photos(photos, NULL, NULL), -ENOENT);
    assert_int_equal(sst_path_make_dir(photos) | sst_path_make_dir(masks), 0);
    assert_int_equal(write_with_photos(photos, NULL, NULL), -ENOENT); /* empty */
    assert_int_equal(sst_path_join(path, photos, "a.png"), 0);
    assert_int_equal(sst_file_write(path, "no picture", 10), 0);
    assert_int_equal(write_with_photos(photos, NULL, NULL), -EBADMSG);
    assert_int_equal(sst_image_init(&image, 8, 8) | sst_image_write_png(&image, path), 0);
    assert_int_equal(write_with_photos(photos, NULL, NULL), -EBADMSG); /* too small */
    sst_image_fini(&image);
    assert_int_equal(sst_image_init(&image, 64, 40) | sst_image_write_png(&image, path), 0);
    assert_int_equal(write_with_photos(photos, NULL, "curtain"), -EINVAL);
    assert_int_equal(write_with_photos(photos, masks, NULL), -ENOENT);
    assert_int_equal(sst_path_join(path, masks, "a.png"), 0);
    assert_int_equal(sst_map_u8_init(&map, 64, 41) | sst_map_u8_write_png(&map, path, NULL), 0);
    assert_int_equal(write_with_photos(photos, masks, NULL), -EBADMSG); /* another size */
    sst_map_u8_fini(&map);
    assert_int_equal(sst_map_u8_init(&map, 64, 40) | sst_map_u8_write_png(&map, path, NULL), 0);
    assert_int_equal(write_with_photos(photos, masks, "crowd"), 0); /* nothing to cut out */
    sst_map_u8_fini(&map);
    sst_image_fini(&image);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(facing_square_lands_where_it_must),
        serial_test(floor_disparity_is_the_row_below_the_horizon),
        serial_test(ball_has_its_depth_and_outline),
        serial_test(truth_moves_points_between_views),
        plain_test(texture_agrees_between_views),
        serial_test(hidden_occluders_leave_nothing),
        serial_test(every_disparity_is_within_the_range),
        serial_test(focus_is_the_disparity_of_the_target),
        serial_test(leaves_cover_the_man_but_not_wholly),
        serial_test(time_moves_the_walker_and_the_leaves),
        plain_test(any_number_of_threads_gives_the_same_bytes),
        cmocka_unit_test(folder_says_what_is_in_it),
        serial_test(layers_agree_between_views_and_hide_what_is_behind),
        cmocka_unit_test(cover_changes_the_front_alone),
        plain_test(layers_repeat_for_any_number_of_threads),
        cmocka_unit_test(hostile_photos_are_refused),
        cmocka_unit_test(odd_sizes_work),
        cmocka_unit_test(what_cannot_be_made_is_refused),
        cmocka_unit_test(random_numbers_are_splitmix64),
        cmocka_unit_test(noise_joins_its_lattice_values),
        cmocka_unit_test(letters_are_readable),
    };

    return cmocka_run_group_tests(tests, test_folder_create, test_folder_remove);
}
