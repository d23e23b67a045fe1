/* One pair by one cost volume in tiles: paths go on across tiles and windows, threads change nothing, known disparities
 * are found at any range, small surfaces are dropped, margins continue planes, edges and holes follow the colours. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/method/disparity/pair_internal.h"
#include "simulators/scene/noise.h"
#include "tests/small.h"
#include "tests/test.h"

#define WIDTH    150
#define HEIGHT   110 /* more than two tiles and bands */
#define SHIFT_PX 6
#define STEPS    128

struct images {
    struct sst_image left, right;
};

/* Noise, shifted by SHIFT_PX. */
static struct images new_pair(int width, int height)
{
    struct images p;
    uint64_t seed = 7;

    assert_int_equal(sst_image_init(&p.left, width, height), 0);
    assert_int_equal(sst_image_init(&p.right, width, height), 0);
    for (int i = 0; i < 3 * width * height; i++) {
        const int x = i % width, y = i / width % height, c = i / width / height;
        const uint64_t r = sst_random_u64(&seed);

        sst_image_row(&p.left, c, y)[x] = (uint8_t)r;
        sst_image_row(&p.right, c, y)[x >= SHIFT_PX ? x - SHIFT_PX : width - 1 - x] = (uint8_t)r;
    }
    return p;
}

static void free_pair(struct images *p)
{
    sst_image_fini(&p->left);
    sst_image_fini(&p->right);
}

/* The path costs of a pixel of a tile, by definition; what one of both windows does not have is far. @param before NULL
 * outside the image; its tile: `from` */
static void step(int64_t *l, const struct sst_tile *t, const uint8_t *cost, const int64_t *before,
                 const struct sst_tile *from, int p1, int p2)
{
    const int64_t far = INT32_MAX;
    int64_t least = before ? far : 0;

    for (int d = 0; before && d < (int)from->steps_padded; d++)
        least = before[d] < least ? before[d] : least;
    for (int d = 0; d < (int)t->steps_padded; d++) {
        int64_t best = least + (before ? p2 : 0);

        for (int k = -1; before && k <= 1; k++) {
            const int at = d + t->first - from->first + k;
            const bool in = d + k >= 0 && d + k < (int)t->steps_padded && at >= 0 && at < (int)from->steps_padded;
            const int64_t there = in ? before[at] + (k ? p1 : 0) : far;

            best = there < best ? there : best;
        }
        l[d] = cost[d] + best - least;
    }
}

static const struct sst_tile *tile_at(const struct sst_tiles *all, int x, int y)
{
    return &all->tile[y / SST_TILE_HEIGHT * all->columns + x / SST_TILE_WIDTH];
}

static size_t cell(const struct sst_tile *t, int x, int y)
{
    return sst_tile_cells(t, y) + (size_t)(x - t->x0) * t->steps_padded;
}

/* Add one path over the whole image. */
static void add_path(uint32_t *sum, const struct sst_tiles *all, const struct sst_image *img,
                     const struct sst_disparity_sgm_penalties *p, int dx, int dy)
{
    int64_t *l = malloc(sizeof(*l) * WIDTH * HEIGHT * STEPS);

    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        const int x = dx > 0 || dy ? i % WIDTH : WIDTH - 1 - i % WIDTH, y = dy < 0 ? HEIGHT - 1 - i / WIDTH : i / WIDTH;
        const int xb = x - dx, yb = y - dy, in = xb >= 0 && xb < WIDTH && yb >= 0 && yb < HEIGHT;
        const struct sst_tile *t = tile_at(all, x, y);
        uint8_t edge = 0;

        if (in)
            sst_disparity_colour_step(&edge, img, (struct sst_pixel){ x, y }, (struct sst_pixel){ xb, yb }, 1);
        step(l + (size_t)(y * WIDTH + x) * STEPS, t, all->cost + cell(t, x, y),
             in ? l + (size_t)(yb * WIDTH + xb) * STEPS : NULL, in ? tile_at(all, xb, yb) : NULL, p->p1[edge],
             p->p2[edge]);
        for (size_t d = 0; d < t->steps_padded; d++)
            sum[cell(t, x, y) + d] += (uint32_t)l[(size_t)(y * WIDTH + x) * STEPS + d];
    }
    free(l);
}

/* Windows that jump from tile to tile: by a coarse map of noise; and none. */
static void paths_cross_tiles(void **state SST_UNUSED)
{
    struct images p = new_pair(WIDTH, HEIGHT);
    const struct sst_volume shape = { .steps = STEPS - 6, .divisor = 1, .disp_min = -3 };
    struct sst_disparity_sgm_penalties penalties;
    struct sst_disparity_config cfg;
    struct sst_map_u16 map;
    uint64_t seed = 3;

    assert_int_equal(sst_disparity_preset(&cfg, "balanced"), 0);
    sst_disparity_sgm_penalties_init(&penalties, &cfg);
    assert_int_equal(sst_map_u16_init(&map, (WIDTH + 3) / 4, (HEIGHT + 3) / 4), 0);
    for (int i = 0; i < map.width * map.height; i++)
        sst_map_u16_row(&map, i / map.width)[i % map.width] =
            (uint16_t)(i / map.width / 9 * 500 + (int)(sst_random_u64(&seed) % 200));
    for (int windows = 0; windows < 2; windows++) {
        const struct sst_coarse coarse = { &map, -1, 4 };
        struct sst_mem_kept scratch = { 0 };
        struct sst_tiles all = { 0 };
        size_t cells;
        uint32_t *want;

        assert_int_equal(sst_tiles_init(&all, WIDTH, 0, HEIGHT, &shape, windows ? &coarse : NULL), 0);
        cells = cell(&all.tile[all.columns * all.rows - 1], WIDTH - 1, HEIGHT - 1) +
                all.tile[all.columns * all.rows - 1].steps_padded;
        assert_int_equal(all.tile[0].first != all.tile[all.columns * (all.rows - 1)].first, windows);
        want = calloc(cells, sizeof(*want));
        for (size_t i = 0; i < cells; i++)
            all.cost[i] = (uint8_t)(sst_random_u64(&seed) % 256);
        for (int row = 0; row < all.rows; row++)
            assert_int_equal(sst_tiles_paths_along(&all, &p.left, &penalties, row, &scratch), 0);
        for (int column = 0; column < all.columns; column++)
            assert_int_equal(sst_tiles_paths_down(&all, &p.left, &penalties, column, &scratch), 0);
        add_path(want, &all, &p.left, &penalties, 1, 0);
        add_path(want, &all, &p.left, &penalties, -1, 0);
        add_path(want, &all, &p.left, &penalties, 0, 1);
        add_path(want, &all, &p.left, &penalties, 0, -1);
        for (size_t i = 0; i < cells; i++)
            assert_int_equal(all.sum[i], want[i]);
        free(want);
        sst_tiles_fini(&all);
        sst_mem_kept_fini(&scratch);
    }
    sst_map_u16_fini(&map);
    free_pair(&p);
}

/* A coarse map's disparities and the margin lie in every tile's window, and no window leaves the range. */
static void windows_hold_the_coarse_map(void **state SST_UNUSED)
{
    uint64_t seed = 5;

    for (int divisor = 1; divisor <= 4; divisor *= 2) {
        const struct sst_volume shape = { .steps = 90 * divisor + 1, .divisor = divisor, .disp_min = 10 };
        struct sst_coarse coarse = { NULL, 2, 4 };
        struct sst_map_u16 map;
        struct sst_tiles all = { 0 };

        assert_int_equal(sst_map_u16_init(&map, (WIDTH + 3) / 4, (HEIGHT + 3) / 4), 0);
        for (int i = 0; i < map.width * map.height; i++)
            sst_map_u16_row(&map, i / map.width)[i % map.width] =
                (uint16_t)(sst_random_u64(&seed) % 300 + (i % 38) * 34);
        coarse.disp_q6 = &map;
        assert_int_equal(sst_tiles_init(&all, WIDTH, 0, HEIGHT, &shape, &coarse), 0);
        for (int i = 0; i < map.width * map.height; i++) {
            const int x = i % map.width * 4, y = i / map.width * 4;
            const double px = 4 * (2 + sst_map_u16_row(&map, y / 4)[x / 4] / 64.0);
            const struct sst_tile *t = tile_at(&all, x, y);
            const double first = 10 + t->first, last = first + (double)(t->steps - 1) / divisor;

            assert_true(t->first >= 0 && t->first * divisor + t->steps <= shape.steps);
            assert_true(t->steps >= 1 && (size_t)t->steps <= t->steps_padded && t->steps_padded % 32 == 0);
            assert_true((first <= px || px < 10) && (px <= last || px > 100));
        }
        sst_tiles_fini(&all);
        sst_map_u16_fini(&map);
    }
}

/* Of two surfaces, one of 100 and one of 121 pixels, on a third: the smaller one goes. A slope is one surface. */
static void specks_are_dropped(void **state SST_UNUSED)
{
    struct sst_map_u16 disp;
    struct sst_map_u8 status;
    int dropped = 0;

    assert_int_equal(sst_map_u16_init(&disp, 60, 40), 0);
    assert_int_equal(sst_map_u8_init(&status, 60, 40), 0);
    for (int y = 0; y < 40; y++) {
        for (int x = 0; x < 60; x++)
            sst_map_u16_row(&disp, y)[x] = (uint16_t)(x >= 5 && x < 15 && y >= 5 && y < 15     ? 2000
                                                      : x >= 30 && x < 41 && y >= 20 && y < 31 ? 3000
                                                                                               : 500 + 2 * x);
    }
    assert_int_equal(pair_drop_specks(&status, &disp, 121, 2), 0);
    for (int i = 0; i < 60 * 40; i++) {
        const bool gone = sst_map_u8_row(&status, i / 60)[i % 60] == SST_DISPARITY_OCCLUSION;

        assert_int_equal(gone, sst_map_u16_row(&disp, i / 60)[i % 60] == 2000);
        dropped += gone;
    }
    assert_int_equal(dropped, 100);
    sst_map_u16_fini(&disp);
    sst_map_u8_fini(&status);
}

/* Sloped to the left, stepped to the right: the plane goes on over the one margin, a constant over the other. */
static void margins_continue_planes(void **state SST_UNUSED)
{
    struct sst_map_u16 disp;
    struct sst_map_u8 status;

    assert_int_equal(sst_map_u16_init(&disp, 200, 30), 0);
    assert_int_equal(sst_map_u8_init(&status, 200, 30), 0);
    for (int i = 0; i < 200 * 30; i++) {
        const int x = i % 200, y = i / 200;

        sst_map_u8_row(&status, y)[x] = x < 20 || x >= 190 ? SST_DISPARITY_OCCLUSION : SST_DISPARITY_CORRECT;
        sst_map_u16_row(&disp, y)[x] = (uint16_t)(x < 20 || x >= 190 ? 9999
                                                  : x < 100          ? 640 + 6 * x + 3 * y
                                                                     : 640 + (x / 8 % 2) * 200);
    }
    assert_int_equal(pair_extend_margins(&disp, &status, -15, 60, 2), 0);
    for (int i = 0; i < 200 * 30; i++) {
        const int x = i % 200, y = i / 200, d = sst_map_u16_row(&disp, y)[x];

        assert_int_equal(sst_map_u8_row(&status, y)[x], SST_DISPARITY_CORRECT);
        if (x < 20)
            assert_true(abs(d - (640 + 6 * x + 3 * y)) <= 1);
        if (x >= 190)
            assert_int_equal(d, sst_map_u16_row(&disp, y)[189]);
    }
    sst_map_u16_fini(&disp);
    sst_map_u8_fini(&status);
}

/* A grey square of 640 before a background of 64, in colours; textured by up to 8 levels. */
static struct sst_image new_square(int width, int height)
{
    struct sst_image img;
    uint64_t seed = 5;

    assert_int_equal(sst_image_init(&img, width, height), 0);
    for (int i = 0; i < 3 * width * height; i++) {
        const int x = i % width, y = i / width % height, c = i / width / height;
        const bool front = x >= 40 && x < 60 && y >= 30 && y < 50;

        sst_image_row(&img, c, y)[x] = (uint8_t)((front ? 150 : 40 + 20 * c) + (int)(sst_random_u64(&seed) % 8));
    }
    return img;
}

static int square_at(int x, int y)
{
    return x >= 40 && x < 60 && y >= 30 && y < 50 ? 640 : 64;
}

/* The map's square is 2 px wider than the image's on all sides; a slope of less than the step stays as it is. */
static void edges_follow_the_colours(void **state SST_UNUSED)
{
    struct sst_image img = new_square(101, 97);
    struct sst_map_u16 in, out;
    struct sst_mem_kept scratch = { 0 };
    int off = 0;

    assert_int_equal(sst_map_u16_init(&in, 101, 97), 0);
    assert_int_equal(sst_map_u16_init(&out, 101, 97), 0);
    for (int i = 0; i < 101 * 97; i++) {
        const int x = i % 101, y = i / 101;
        const bool front = x >= 38 && x < 62 && y >= 28 && y < 52;

        sst_map_u16_row(&in, y)[x] = (uint16_t)(front ? 640 : 64 + x / 4);
    }
    sst_map_u16_row(&in, 3)[3] = SST_DISP_NONE;
    for (int y = 0; y < 97; y += 20)
        assert_int_equal(
            pair_guided_median(&out, &in, &img, (struct sst_rows){ y, y + 20 < 97 ? y + 20 : 97 }, &scratch), 0);
    for (int i = 0; i < 101 * 97; i++) {
        const int x = i % 101, y = i / 101, d = sst_map_u16_row(&out, y)[x];
        const int want = square_at(x, y) == 640 ? 640 : 64 + x / 4;

        if (x == 3 && y == 3)
            assert_int_equal(d, SST_DISP_NONE);
        else if (sst_map_u16_row(&in, y)[x] == want)
            assert_int_equal(d, want);
        else
            off += abs(d - want) > 16;
    }
    assert_true(off <= 4); /* of 176 pixels that were wrong; texture decides some */
    sst_mem_kept_fini(&scratch);
    sst_map_u16_fini(&in);
    sst_map_u16_fini(&out);
    sst_image_fini(&img);
}

/* Hidden pixels to the left of the square, filled with a surface far behind that is seen in their rows: they are of the
 * one that looks like them. A hole in one surface stays as it was filled, and so do confirmed pixels. */
static void holes_follow_the_colours(void **state SST_UNUSED)
{
    struct sst_image img = new_square(101, 97);
    struct sst_map_u16 disp;
    struct sst_map_u8 status;
    struct sst_mem_kept scratch = { 0 };

    assert_int_equal(sst_map_u16_init(&disp, 101, 97), 0);
    assert_int_equal(sst_map_u8_init(&status, 101, 97), 0);
    for (int i = 0; i < 101 * 97; i++) {
        const int x = i % 101, y = i / 101;
        const bool hole = x >= 34 && x < 40 && y >= 30 && y < 50, level = x >= 80 && x < 84;

        sst_map_u16_row(&disp, y)[x] = (uint16_t)(level ? 77 : hole ? 500 : square_at(x, y));
        sst_map_u8_row(&status, y)[x] = hole || level ? SST_DISPARITY_OCCLUSION : SST_DISPARITY_CORRECT;
    }
    assert_int_equal(pair_fill_alike(&disp, &status, &img, (struct sst_rows){ 0, 50 }, &scratch), 0);
    assert_int_equal(pair_fill_alike(&disp, &status, &img, (struct sst_rows){ 50, 97 }, &scratch), 0);
    for (int i = 0; i < 101 * 97; i++) {
        const int x = i % 101, y = i / 101, d = sst_map_u16_row(&disp, y)[x];
        const bool hole = x >= 34 && x < 40 && y >= 30 && y < 50;

        assert_true(hole ? abs(d - 64) <= 16 : d == (x >= 80 && x < 84 ? 77 : square_at(x, y)));
    }
    sst_mem_kept_fini(&scratch);
    sst_map_u16_fini(&disp);
    sst_map_u8_fini(&status);
    sst_image_fini(&img);
}

static struct sst_map_f32 match(const struct images *p, const struct sst_disparity_config *cfg)
{
    struct sst_map_f32 disp;

    assert_int_equal(sst_disparity_stereo(&disp, &p->left, &p->right, cfg), 0);
    return disp;
}

static void threads_change_nothing(void **state SST_UNUSED)
{
    struct images p = new_pair(WIDTH, HEIGHT);

    for (int paths = 4; paths <= 8; paths += 4) {
        struct sst_disparity_config cfg;
        struct sst_map_f32 one, three;

        assert_int_equal(sst_disparity_preset(&cfg, "balanced"), 0);
        cfg.disp_max_px = 63;
        cfg.paths = paths;
        cfg.threads = 1;
        one = match(&p, &cfg);
        cfg.threads = 3;
        three = match(&p, &cfg);
        for (int y = 0; y < HEIGHT; y++)
            assert_memory_equal(sst_map_f32_row(&one, y), sst_map_f32_row(&three, y), WIDTH * sizeof(float));
        sst_map_f32_fini(&one);
        sst_map_f32_fini(&three);
    }
    free_pair(&p);
}

/* Ranges of quarter, half and whole steps, of both signs, and some that leave the image; images smaller than a block.
 */
static void finds_the_shift(void **state SST_UNUSED)
{
    static const struct {
        int width, height;
        double min_px, max_px;
        bool found;
    } cases[] = {
        { WIDTH, HEIGHT, 0, 63, true },   { WIDTH, HEIGHT, 0, 40, true },       { WIDTH, HEIGHT, -5, 12, true },
        { WIDTH, HEIGHT, -60, 20, true }, { WIDTH, HEIGHT, 0, 400, true },      { WIDTH, HEIGHT, 200, 300, false },
        { 40, 7, 0, 63, true },           { WIDTH, HEIGHT, -300, -200, false },
    };

    for (size_t i = 0; i < 2 * ARRAY_LEN(cases); i++) {
        struct images p = new_pair(cases[i / 2].width, cases[i / 2].height);
        struct sst_disparity_config cfg;
        struct sst_map_f32 disp;
        int good = 0;

        assert_int_equal(sst_disparity_preset(&cfg, i % 2 ? "preview" : "balanced"), 0);
        cfg.disp_min_px = cases[i / 2].min_px;
        cfg.disp_max_px = cases[i / 2].max_px;
        disp = match(&p, &cfg);
        for (int k = 0; k < disp.width * disp.height; k++)
            good += fabsf(sst_map_f32_row(&disp, k / disp.width)[k % disp.width] - SHIFT_PX) < 1.0f;
        if (cases[i / 2].found)
            assert_true(good > disp.width * disp.height * 8 / 10);
        sst_map_f32_fini(&disp);
        free_pair(&p);
    }
}

/* A window costs as that part of the whole volume does, also where the other image is half a pixel lower. */
static void a_window_costs_as_the_whole(void **state SST_UNUSED)
{
    enum { LEFT = 90, MIN = 45, SOME = 6 };
    static const double by[] = { 0, -0.012, 0.012 };
    struct images p = new_pair(WIDTH, HEIGHT);
    struct sst_descriptor a, b;
    struct sst_volume whole, window;

    assert_int_equal(sst_descriptor_init(&a, &p.left, 1, SST_COST_CENSUS, NULL), 0);
    assert_int_equal(sst_descriptor_init(&b, &p.right, 1, SST_COST_CENSUS, NULL), 0);
    assert_int_equal(sst_volume_init(&whole, WIDTH, HEIGHT, MIN, SOME), 0);
    assert_int_equal(sst_volume_init(&window, WIDTH, HEIGHT, MIN, SOME), 0);
    whole.phase_step = window.phase_step = 1;
    for (size_t i = 0; i < ARRAY_LEN(by); i++) {
        const struct sst_neighbour n = { &b, 1, by[i] };

        assert_int_equal(sst_descriptor_add_phases(&b, sst_volume_phases(&whole, n.bx, n.by)), 0);
        sst_volume_fill(&whole, &a, &n, 1);
        sst_volume_window(&window, LEFT, 0, WIDTH - LEFT, HEIGHT);
        sst_volume_fill(&window, &a, &n, 1);
        for (int y = 0; y < HEIGHT; y++) {
            const uint8_t *want = whole.cost + ((size_t)y * whole.width_padded + LEFT) * whole.steps_padded;
            const uint8_t *got = window.cost + (size_t)y * window.width_padded * window.steps_padded;

            for (size_t k = 0; k < (WIDTH - LEFT) * whole.steps_padded; k++)
                if (want[k] != got[k])
                    fail_msg("%g, row %d: %d, not %d", by[i], y, got[k], want[k]);
        }
    }
    sst_volume_fini(&whole);
    sst_volume_fini(&window);
    sst_descriptor_fini(&a);
    sst_descriptor_fini(&b);
    free_pair(&p);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(paths_cross_tiles),
        cmocka_unit_test(windows_hold_the_coarse_map),
        cmocka_unit_test(specks_are_dropped),
        cmocka_unit_test(margins_continue_planes),
        cmocka_unit_test(edges_follow_the_colours),
        cmocka_unit_test(holes_follow_the_colours),
        thread_test(threads_change_nothing),
        cmocka_unit_test(a_window_costs_as_the_whole),
        serial_test(finds_the_shift),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
