/* Live frames: kept tiles against the cameras' pictures, made here; compared with exact mode. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <linux/videodev2.h>

#include "base/log.h"
#include "pipeline/image/codec.h"
#include "pipeline/image/raw.h"
#include "pipeline/live/frames/frames.h"
#include "pipeline/live/frames/frames_internal.h"
#include "tests/random.h"
#include "tests/small.h"
#include "tests/test.h"

#ifdef __SANITIZE_THREAD__
#define WATCH_THREADS true
#else
#define WATCH_THREADS false
#endif

#define ROWS    3
#define COLS    3
#define VIEWS   (ROWS * COLS)
#define WIDTH   320
#define HEIGHT  208 /* the last row of tiles is half as high */
#define STEP_NS 100000000
#define SETS    4 /* any change is seen within this many */

static uint64_t seed = 1;

/* --- pictures of the cameras -------------------------------------------------------------------------------------- */

struct seen {
    double light;    /* 0: 1 */
    double noise;    /* levels */
    int x, y, side;  /* a square in the reference view, 3 px further left for each camera further right */
    double contrast; /* share by which it is brighter */
    int only;        /* 1 + the camera that sees it; 0: all */
    double leaves;   /* rad: leaves right of LEAVES swing by this much */
};

#define LEAVES 96 /* px: most tiles */

#define NORMALS 8191

static float across[VIEWS][WIDTH], down[3][HEIGHT], normals[NORMALS];

static void prepare(void)
{
    for (int k = 0; k < VIEWS; k++)
        for (int x = 0; x < WIDTH; x++)
            across[k][x] = (float)(110 + 40 * sin(0.045 * x + k));
    for (int c = 0; c < 3; c++)
        for (int y = 0; y < HEIGHT; y++)
            down[c][y] = (float)(30 * cos(0.06 * y + c));
    for (int i = 0; i < NORMALS; i++)
        normals[i] = (float)test_normal(&seed);
}

/* Only input, which takes half of the time otherwise: no sanitizer watches it. */
__attribute__((no_sanitize("address", "undefined"), optimize(2))) static void paint_row(uint8_t *row, const struct seen *s, int k, int y, int c)
{
    const int sx = s->x - 3 * (k % COLS), from = (int)(sst_random(&seed) * NORMALS);
    const bool here = y >= s->y && y < s->y + s->side && (!s->only || s->only == k + 1);
    const float light = s->light > 0 ? (float)s->light : 1, noise = (float)s->noise;

    for (int x = 0; x < WIDTH; x++) {
        const float v = across[k][x] + down[c][y] + ((x / 16 + y / 16) % 2 ? 12.0f : -12.0f);
        const float leaf = s->leaves > 0 && x >= LEAVES ? 30 * sinf(0.05f * (float)(x + y) + (float)s->leaves) : 0;
        const float lit = here && x >= sx && x < sx + s->side ? v * (1 + (float)s->contrast) : v;
        const float sum = lit * light + leaf + noise * normals[(from + x) % NORMALS] + 0.5f;

        row[x] = (uint8_t)(sum < 0 ? 0 : sum > 255 ? 255 : sum);
    }
}

static void paint(struct sst_image *img, const struct seen *s, int k)
{
    for (int c = 0; c < 3; c++)
        for (int y = 0; y < HEIGHT; y++)
            paint_row(sst_image_row(img, c, y), s, k, y, c);
}

/* A set, as the cameras of a format send it. */
static struct sst_live_input *make_set(int n, const struct seen *s, uint32_t fourcc)
{
    struct sst_live_input *in = calloc(1, sizeof(*in));
    struct sst_image img;

    assert_int_equal(sst_image_init(&img, WIDTH, HEIGHT), 0);
    in->set = (uint64_t)n;
    in->t_ns = (int64_t)(n + 1) * STEP_NS;
    for (int k = 0; k < VIEWS; k++) {
        uint8_t *data;
        const size_t each = fourcc == V4L2_PIX_FMT_RGB24 ? 3 : 2;
        size_t bytes = each * WIDTH * HEIGHT;

        paint(&img, s, k);
        if (fourcc == V4L2_PIX_FMT_MJPEG) {
            assert_int_equal(sst_image_encode_jpeg(&img, 85, &data, &bytes), 0);
        } else { /* any bytes are a picture; the bytes of green are one that the tests know */
            data = malloc(bytes);
            for (int y = 0; y < HEIGHT; y++)
                for (size_t i = 0; i < each * WIDTH; i++)
                    data[(size_t)y * each * WIDTH + i] = sst_image_row(&img, 1, y)[i / each];
            if (each == 2 && fourcc != V4L2_PIX_FMT_YUYV && fourcc != V4L2_PIX_FMT_Y16) {
                bytes = WIDTH * HEIGHT;
                for (size_t i = 0; i < bytes; i++)
                    data[i] = data[2 * i];
            }
        }
        in->frame[k].data = data;
        in->frame[k].bytes = bytes;
    }
    sst_image_fini(&img);
    return in;
}

static void free_set(struct sst_live_input *in)
{
    for (int k = 0; k < VIEWS; k++)
        free((void *)(uintptr_t)in->frame[k].data);
    free(in);
}

/* --- speed -------------------------------------------------------------------------------------------------------- */

struct keeper {
    struct sst_live_config cfg;
    struct sst_lightfield lf;
    struct sst_liveframes *frames;
    struct sst_liveframes_changes changes;
    struct sst_live_report report;
};

static struct sst_use_calibration calibrated;

/* Cameras that are turned a little, with lenses. */
static void make_calibration(void)
{
    struct sst_calib *c = &calibrated.calib;

    sst_use_calibration_defaults(&calibrated);
    assert_int_equal(sst_calib_init(c, ROWS, COLS), 0);
    c->width = WIDTH;
    c->height = HEIGHT;
    for (int k = 0; k < VIEWS; k++) {
        struct sst_calib_camera *cam = &c->camera[k];

        cam->known = true;
        cam->fx = cam->fy = 300;
        cam->cx = (WIDTH - 1) / 2.0;
        cam->cy = (HEIGHT - 1) / 2.0;
        cam->lens = 5;
        cam->k[0] = 0.05;
        cam->position_mm[0] = 40 * (k % COLS - c->reference % COLS);
        cam->position_mm[1] = 40 * (k / COLS - c->reference / COLS);
        sst_rotation_from_vector((const double[3]){ 0.004 * (k % 3), -0.003 * (k % 5), 0.02 * (k % 2) }, cam->rotation);
    }
}

static void open_keeper(struct keeper *k, uint32_t fourcc, const struct sst_use_calibration *use, bool skip,
                        int threads)
{
    *k = (struct keeper){ .cfg = { .rows = ROWS,
                                   .cols = COLS,
                                   .fourcc = fourcc,
                                   .width = WIDTH,
                                   .height = HEIGHT,
                                   .calibration = use,
                                   .threads = threads,
                                   .skip_change = skip } };
    assert_int_equal(sst_lightfield_init(&k->lf, ROWS, COLS), 0);
    k->lf.width = WIDTH;
    k->lf.height = HEIGHT;
    for (int v = 0; v < VIEWS; v++)
        k->cfg.present[v] = k->lf.views[v].present = true;
    if (use)
        assert_int_equal(sst_lightfield_calibrate(&k->lf, use), 0);
    assert_int_equal(sst_liveframes_open(&k->frames, &k->cfg, &k->lf), 0);
    assert_int_equal(sst_liveframes_changes_init(&k->changes, &k->lf), 0);
}

static void close_keeper(struct keeper *k)
{
    sst_liveframes_close(k->frames);
    sst_liveframes_changes_fini(&k->changes);
    sst_lightfield_fini(&k->lf);
}

static void update(struct keeper *k, const struct sst_live_input *in)
{
    int64_t marked = 0;

    k->report = (struct sst_live_report){ 0 };
    assert_int_equal(sst_liveframes_update(k->frames, in, &k->changes, &k->report), 0);
    for (int v = 0; v < VIEWS; v++)
        for (int t = 0; t < k->changes.cols * k->changes.rows; t++)
            marked += k->changes.map[v][t];
    assert_int_equal(marked, k->changes.changed);
    assert_int_equal(k->report.tiles_changed, marked);
    assert_int_equal(k->report.decodes + k->report.decodes_skipped, k->report.views);
}

static void show(struct keeper *k, int n, const struct seen *s)
{
    struct sst_live_input *in = make_set(n, s, k->cfg.fourcc);

    update(k, in);
    free_set(in);
}

/* Mean |difference| of a tile. */
static double tile_difference(const struct keeper *a, const struct keeper *b, int view, int t)
{
    const int x0 = t % a->changes.cols * SST_LIVE_TILE, x1 = sst_min_int(x0 + SST_LIVE_TILE, a->lf.width);
    const int y0 = t / a->changes.cols * SST_LIVE_TILE, y1 = sst_min_int(y0 + SST_LIVE_TILE, a->lf.height);
    double sum = 0;

    for (int c = 0; c < 3; c++)
        for (int y = y0; y < y1; y++)
            for (int x = x0; x < x1; x++)
                sum += abs(sst_image_row(&a->lf.views[view].image, c, y)[x] -
                           sst_image_row(&b->lf.views[view].image, c, y)[x]);
    return sum / (3.0 * (x1 - x0) * (y1 - y0));
}

static double worst_difference(const struct keeper *a, const struct keeper *b)
{
    double worst = 0;

    for (int v = 0; v < VIEWS; v++)
        for (int t = 0; t < a->changes.cols * a->changes.rows; t++)
            worst = fmax(worst, tile_difference(a, b, v, t));
    return worst;
}

static bool same_pictures(const struct keeper *a, const struct keeper *b)
{
    return worst_difference(a, b) == 0;
}

/* --- tests -------------------------------------------------------------------------------------------------------- */

static void the_first_set_is_whole(void **state)
{
    struct keeper k, exact;
    struct sst_live_input *in = make_set(0, &(struct seen){ .noise = 2 }, V4L2_PIX_FMT_MJPEG);
    struct sst_image want;

    (void)state;
    open_keeper(&k, V4L2_PIX_FMT_MJPEG, NULL, true, 2);
    open_keeper(&exact, V4L2_PIX_FMT_MJPEG, NULL, false, 2);
    update(&k, in);
    update(&exact, in);
    assert_true(k.changes.whole && k.report.whole);
    assert_int_equal(k.report.views, VIEWS);
    assert_int_equal(k.report.decodes, VIEWS);
    assert_true(same_pictures(&k, &exact));
    assert_int_equal(sst_image_decode(&want, in->frame[5].data, in->frame[5].bytes, "frame"), 0);
    for (int c = 0; c < 3; c++)
        for (int y = 0; y < HEIGHT; y++)
            assert_memory_equal(sst_image_row(&want, c, y), sst_image_row(&k.lf.views[5].image, c, y), WIDTH);
    sst_image_fini(&want);
    free_set(in);
    close_keeper(&k);
    close_keeper(&exact);
}

/* Nothing moves: noise, however strong, and a lamp that flickers are no change. */
static void noise_is_no_change(void **state)
{
    static const struct seen still[] = { { .noise = 0.7 }, { .noise = 3 }, { .noise = 10 } };

    (void)state;
    seed = 1; /* whatever ran before */
    for (size_t i = 0; i < ARRAY_LEN(still); i++) {
        struct keeper k;
        int64_t changed = 0;

        open_keeper(&k, V4L2_PIX_FMT_MJPEG, NULL, true, 2);
        for (int n = 0; n < 30; n++) {
            struct seen s = still[i];

            s.light = n % 3 == 1 ? 1.01 : 1;
            show(&k, n, &s);
            changed += n ? k.changes.changed : 0;
            if (n && k.changes.changed)
                print_message("noise %g: set %d: %d tiles\n", s.noise, n, (int)k.changes.changed);
        }
        /* One tile in 20 000 looked at. */
        assert_true(changed <= 1);
        close_keeper(&k);
    }
}

/* A square of 1.5 % contrast, as large as a tile or two halves of four, is taken over by all views. */
static void faint_change_is_seen(void **state)
{
    static const struct seen changes[] = {
        { .noise = 0.7, .x = 128, .y = 64, .side = 40, .contrast = 0.03 },
        { .noise = 0.7, .x = 105, .y = 64, .side = 64, .contrast = -0.015 },
        { .noise = 0.7, .x = 200, .y = 100, .side = 9, .contrast = 0.3 },
        { .noise = 3, .x = 105, .y = 64, .side = 64, .contrast = 0.06 },
        { .noise = 0.7, .x = 128, .y = 32, .side = 64, .contrast = 0.03, .only = 7 },
    };

    (void)state;
    for (size_t i = 0; i < ARRAY_LEN(changes); i++) {
        const struct seen *after = &changes[i], before = { .noise = after->noise };
        bool seen[VIEWS] = { false };
        struct keeper k;

        open_keeper(&k, V4L2_PIX_FMT_MJPEG, NULL, true, 2);
        for (int n = 0; n < 12; n++)
            show(&k, n, &before);
        for (int n = 12; n < 12 + SETS; n++) {
            show(&k, n, after);
            for (int v = 0; v < VIEWS; v++)
                seen[v] |= memchr(k.changes.map[v], 1, (size_t)(k.changes.cols * k.changes.rows)) != NULL;
        }
        for (int v = 0; v < VIEWS; v++) {
            if (seen[v] != (!after->only || after->only == v + 1))
                fail_msg("change %zu: view %d %s", i, v, seen[v] ? "changed" : "did not");
        }
        close_keeper(&k);
    }
}

/* Leaves move in most tiles, which is no noise: who leaves another tile is gone from all views, after a while also who
 * differed little. */
static void motion_everywhere_hides_no_change(void **state)
{
    static const double contrast[] = { -0.3, 0.035 };

    (void)state;
    for (size_t i = 0; i < ARRAY_LEN(contrast); i++) {
        bool seen[VIEWS] = { false };
        struct keeper k;

        open_keeper(&k, V4L2_PIX_FMT_MJPEG, NULL, true, 2);
        for (int n = 0; n < 44; n++) {
            const struct seen s = { .noise = 1,
                                    .x = 40,
                                    .y = 64,
                                    .side = n < 30 ? 32 : 0,
                                    .contrast = contrast[i],
                                    .leaves = 1 + fabs(fmod(n, 8) - 4) };

            show(&k, n, &s);
            for (int v = 0; v < VIEWS && n >= 30; v++)
                seen[v] |= k.changes.map[v][2 * k.changes.cols + 1] != 0;
        }
        for (int v = 0; v < VIEWS; v++)
            if (!seen[v])
                fail_msg("contrast %g: view %d still shows who has left", contrast[i], v);
        close_keeper(&k);
    }
}

/* Moving objects are taken over in the set that shows them, and only tiles near them. */
static void motion_is_followed(void **state)
{
    struct keeper k, exact;
    int64_t changed = 0;

    (void)state;
    open_keeper(&k, V4L2_PIX_FMT_MJPEG, NULL, true, 2);
    open_keeper(&exact, V4L2_PIX_FMT_MJPEG, NULL, false, 1);
    for (int n = 0; n < 24; n++) {
        const struct seen s = { .x = 60 + 9 * n, .y = 70, .side = 48, .contrast = -0.5 };
        struct sst_live_input *in = make_set(n, &s, V4L2_PIX_FMT_MJPEG);

        update(&k, in);
        update(&exact, in);
        free_set(in);
        changed += n ? k.changes.changed : 0;
        assert_true(worst_difference(&k, &exact) < SST_DETECTOR_BUDGET);
        for (int v = 0; n && v < VIEWS; v++) {
            for (int t = 0; t < 2 * k.changes.cols; t++)
                assert_false(k.changes.map[v][t] && t < k.changes.cols);
        }
        /* Marked tiles equal the new frames to the byte. */
        for (int v = 0; v < VIEWS; v++)
            for (int t = 0; t < k.changes.cols * k.changes.rows; t++)
                assert_true(!k.changes.map[v][t] || tile_difference(&k, &exact, v, t) == 0);
    }
    assert_true(changed < 24 * VIEWS * 20);
    assert_true(changed > 23 * VIEWS * 3);
    close_keeper(&k);
    close_keeper(&exact);
}

/* One view is watched: what moves in it is marked from set to set, noise and the first set are not; an update then
 * takes all in that has changed since the last one. */
static void one_view_is_watched(void **state)
{
    const int view = 5;
    struct keeper k, exact;
    int64_t marked = 0;

    (void)state;
    open_keeper(&k, V4L2_PIX_FMT_MJPEG, &calibrated, true, 2);
    open_keeper(&exact, V4L2_PIX_FMT_MJPEG, &calibrated, false, 2);
    for (int n = 0; n < 24; n++) {
        const struct seen s = {
            .noise = 1, .x = n < 12 ? 60 : 60 + 9 * (n - 12), .y = 70, .side = 48, .contrast = -0.5
        };
        struct sst_live_input *in = make_set(n, &s, V4L2_PIX_FMT_MJPEG);
        int64_t now = 0;

        if (!n || n == 23) {
            update(&k, in);
            update(&exact, in);
            assert_true(!n || (!k.changes.whole && k.changes.changed > 0));
            assert_true(worst_difference(&k, &exact) < SST_DETECTOR_BUDGET);
        } else {
            assert_int_equal(sst_liveframes_watch(k.frames, in, view, &k.changes), 0);
            for (int t = 0; t < k.changes.cols * k.changes.rows; t++) {
                now += k.changes.map[view][t];
                assert_false(k.changes.map[view + 1][t]);
            }
            assert_false(k.changes.whole);
            assert_true(n > 12 ? now >= 2 && now < 40 : now == 0);
            marked += now;
        }
        free_set(in);
    }
    assert_true(marked >= 10 * 2);

    /* Frames that cannot be read change nothing; nor does the first one after a while. */
    {
        struct sst_live_input *in =
            make_set(24, &(struct seen){ .x = 10, .y = 10, .side = 90, .contrast = 1 }, V4L2_PIX_FMT_MJPEG);

        in->frame[view].bytes = 4;
        assert_int_equal(sst_liveframes_watch(k.frames, in, view, &k.changes), 0);
        assert_null(memchr(k.changes.map[view], 1, (size_t)(k.changes.cols * k.changes.rows)));
        free_set(in);
        in = make_set(60, &(struct seen){ .x = 10, .y = 10, .side = 90, .contrast = 1 }, V4L2_PIX_FMT_MJPEG);
        assert_int_equal(sst_liveframes_watch(k.frames, in, view, &k.changes), 0);
        assert_null(memchr(k.changes.map[view], 1, (size_t)(k.changes.cols * k.changes.rows)));
        free_set(in);
    }
    close_keeper(&k);
    close_keeper(&exact);
}

/* Light that drifts adds up to one change of everything, now and then. */
static void light_is_taken_over_as_a_whole(void **state)
{
    struct keeper k, exact;
    int whole = 0, parts = 0;
    double worst = 0;

    (void)state;
    open_keeper(&k, V4L2_PIX_FMT_MJPEG, NULL, true, 2);
    open_keeper(&exact, V4L2_PIX_FMT_MJPEG, NULL, false, 2);
    for (int n = 0; n < 60; n++) {
        const struct seen s = { .light = 1 + 0.06 * sin(0.1 * n) };
        struct sst_live_input *in = make_set(n, &s, V4L2_PIX_FMT_MJPEG);

        update(&k, in);
        update(&exact, in);
        free_set(in);
        whole += n && k.changes.whole;
        parts += k.changes.changed && !k.changes.whole;
        worst = fmax(worst, worst_difference(&k, &exact));
    }
    print_message("light: %d times everything, %d times a part, worst %.2f levels\n", whole, parts, worst);
    assert_in_range(whole, 4, 20);
    assert_true(parts <= 2);
    assert_true(worst < SST_DETECTOR_LIGHT * 1.7 + 1);
    close_keeper(&k);
    close_keeper(&exact);
}

/* The exposure of all cameras, then of one, changes in the middle of a run: reported once each. */
static void changes_of_exposure_are_reported(void **state)
{
    struct keeper k;

    (void)state;
    open_keeper(&k, V4L2_PIX_FMT_MJPEG, NULL, true, 2);
    for (int n = 0; n < 12; n++) {
        struct sst_live_input *in =
            make_set(n, &(struct seen){ .light = n < 4 ? 1 : 1.3, .noise = 1 }, V4L2_PIX_FMT_MJPEG);
        struct sst_live_input *dim = make_set(n, &(struct seen){ .light = 0.8, .noise = 1 }, V4L2_PIX_FMT_MJPEG);
        const uint8_t *data = in->frame[3].data;
        const size_t bytes = in->frame[3].bytes;

        if (n >= 8) {
            in->frame[3].data = dim->frame[3].data;
            in->frame[3].bytes = dim->frame[3].bytes;
            dim->frame[3].data = data;
            dim->frame[3].bytes = bytes;
        }
        update(&k, in);
        free_set(in);
        free_set(dim);
        if (n == 4)
            assert_int_equal(k.report.relit, k.report.views);
        else
            assert_int_equal(k.report.relit, n == 8 ? 1 : 0);
    }
    close_keeper(&k);
}

/* Rectified tiles that are kept come from raw tiles that are kept: marked ones are exact, the others within the budget.
 */
static void calibrated_views_follow(void **state)
{
    struct keeper k, exact;

    (void)state;
    open_keeper(&k, V4L2_PIX_FMT_MJPEG, &calibrated, true, 2);
    open_keeper(&exact, V4L2_PIX_FMT_MJPEG, &calibrated, false, 1);
    assert_non_null(k.lf.views[1].valid.data);
    for (int n = 0; n < 16; n++) {
        const struct seen s = { .x = 60 + 10 * n, .y = 70, .side = 48, .contrast = -0.5 };
        struct sst_live_input *in = make_set(n, &s, V4L2_PIX_FMT_MJPEG);

        update(&k, in);
        update(&exact, in);
        if (!n) { /* the whole view, as it is resampled elsewhere */
            struct sst_rectify_map *map;
            struct sst_image raw, want;
            struct sst_map_u8 valid;

            assert_true(same_pictures(&k, &exact));
            assert_int_equal(sst_rectify_map_create(&map, k.lf.rectified, k.lf.calibration, 6), 0);
            assert_int_equal(sst_image_decode(&raw, in->frame[6].data, in->frame[6].bytes, "frame"), 0);
            assert_int_equal(sst_image_init(&want, k.lf.width, k.lf.height), 0);
            assert_int_equal(sst_map_u8_init(&valid, k.lf.width, k.lf.height), 0);
            assert_int_equal(sst_rectify_view(&(struct sst_rectified_view){ &want, &valid }, map, SST_FILTER_BICUBIC, &raw), 0);
            for (int y = 0; y < k.lf.height; y++) {
                for (int c = 0; c < 3; c++)
                    assert_memory_equal(sst_image_row(&want, c, y), sst_image_row(&k.lf.views[6].image, c, y),
                                        (size_t)k.lf.width);
                assert_memory_equal(sst_map_u8_row(&valid, y), sst_map_u8_row(&k.lf.views[6].valid, y),
                                    (size_t)k.lf.width);
            }
            sst_map_u8_fini(&valid);
            sst_image_fini(&want);
            sst_image_fini(&raw);
            sst_rectify_map_destroy(map);
        }
        free_set(in);
        assert_true(worst_difference(&k, &exact) < SST_DETECTOR_BUDGET);
        assert_true(!n || (k.changes.changed && k.changes.changed < VIEWS * 40));
    }
    close_keeper(&k);
    close_keeper(&exact);
}

static void any_number_of_threads_gives_the_same(void **state)
{
    struct keeper one, many;

    (void)state;
    open_keeper(&one, V4L2_PIX_FMT_MJPEG, &calibrated, true, 1);
    open_keeper(&many, V4L2_PIX_FMT_MJPEG, &calibrated, true, 5);
    for (int n = 0; n < 12; n++) {
        const struct seen s = { .noise = 1, .x = 60 + 10 * n, .y = 70, .side = n % 5 ? 48 : 0, .contrast = 0.4 };
        struct sst_live_input *in = make_set(n, &s, V4L2_PIX_FMT_MJPEG);

        update(&one, in);
        update(&many, in);
        free_set(in);
        assert_true(same_pictures(&one, &many));
        for (int v = 0; v < VIEWS; v++)
            assert_memory_equal(one.changes.map[v], many.changes.map[v], (size_t)(one.changes.cols * one.changes.rows));
    }
    close_keeper(&one);
    close_keeper(&many);
}

static void raw_formats_follow(void **state)
{
    static const uint32_t formats[] = { V4L2_PIX_FMT_GREY, V4L2_PIX_FMT_Y16, V4L2_PIX_FMT_YUYV, V4L2_PIX_FMT_SRGGB8,
                                        V4L2_PIX_FMT_SGBRG8, V4L2_PIX_FMT_RGB24 };

    (void)state;
    for (size_t i = 0; i < ARRAY_LEN(formats); i++) {
        struct keeper k, exact;

        open_keeper(&k, formats[i], NULL, true, 2);
        open_keeper(&exact, formats[i], NULL, false, 2);
        for (int n = 0; n < 6; n++) {
            const struct seen s = { .x = 60 + 30 * n, .y = 70, .side = 48, .contrast = -0.5 };
            struct sst_live_input *in = make_set(n, &s, formats[i]);

            update(&k, in);
            update(&exact, in);
            if (!n) {
                const struct sst_raw raw = { formats[i], WIDTH, HEIGHT, 0, in->frame[3].data, in->frame[3].bytes };
                struct sst_image want;

                assert_int_equal(sst_raw_to_image(&want, &raw), 0);
                for (int c = 0; c < 3; c++)
                    assert_memory_equal(sst_image_row(&want, c, 77), sst_image_row(&k.lf.views[3].image, c, 77), WIDTH);
                sst_image_fini(&want);
            }
            free_set(in);
            /* Demosaicing looks two samples over the edge of a tile. */
            assert_true(worst_difference(&k, &exact) < SST_DETECTOR_BUDGET);
            assert_true(n ? k.changes.changed && k.changes.changed < VIEWS * 30 : k.changes.whole);
        }
        close_keeper(&k);
        close_keeper(&exact);
    }
}

/* Thermal cameras: few of 16 bits' levels, some pixels dead. All views have one stretch, found or given. */
static void levels_of_sixteen_bits_are_stretched(void **state)
{
    const struct seen s = { .x = 60, .y = 70, .side = 48, .contrast = -0.5 };

    (void)state;
    for (int given = 0; given < 2; given++) {
        struct sst_live_input *in = make_set(0, &s, V4L2_PIX_FMT_Y16);
        struct keeper k;
        struct sst_image want;
        struct sst_raw raw;

        for (int v = 0; v < VIEWS; v++) {
            uint8_t *data = (uint8_t *)(uintptr_t)in->frame[v].data;

            for (int i = 0; i < WIDTH * HEIGHT; i++) {
                const int level = i % 997 ? 7000 + data[2 * i] * 2 : i % 2 ? 65535 : 0;

                data[2 * i] = (uint8_t)(level & 255);
                data[2 * i + 1] = (uint8_t)(level >> 8);
            }
        }
        open_keeper(&k, V4L2_PIX_FMT_Y16, NULL, true, 2);
        if (given)
            k.cfg.levels = (struct sst_samples){ 6900, 7700 };
        update(&k, in);
        if (given)
            assert_true(k.report.levels.black == 6900 && k.report.levels.white == 7700);
        else if (k.report.levels.black < 6900 || k.report.levels.white > 7600)
            fail_msg("levels %d to %d", k.report.levels.black, k.report.levels.white);
        raw = (struct sst_raw){ V4L2_PIX_FMT_Y16, WIDTH, HEIGHT, 0, in->frame[3].data, in->frame[3].bytes };
        assert_int_equal(sst_raw_to_image_samples(&want, &raw, k.report.levels), 0);
        for (int y = 0; y < HEIGHT; y += 13)
            assert_memory_equal(sst_image_row(&want, 1, y), sst_image_row(&k.lf.views[3].image, 1, y), WIDTH);
        sst_image_fini(&want);
        in->t_ns += STEP_NS;
        update(&k, in);
        assert_int_equal(k.changes.changed, 0);
        for (int i = 0; !given && i < WIDTH * HEIGHT / 2; i++) /* warmer than what is shown: no motion */
            for (int v = 0; v < VIEWS; v++)
                ((uint8_t *)(uintptr_t)in->frame[v].data)[2 * i + 1] = 40;
        for (int n = 0; !given && !k.changes.stretched; n++) {
            assert_true(n < 20);
            in->t_ns += STEP_NS;
            update(&k, in);
        }
        assert_true(given || k.changes.whole);
        in->t_ns += STEP_NS;
        update(&k, in);
        assert_true(!k.changes.stretched && !k.changes.changed);
        close_keeper(&k);
        free_set(in);
    }
}

/* Frames that are damaged, of another size or missing leave their views as they were. */
static void bad_frames_leave_the_view(void **state)
{
    const struct seen a = { .noise = 1 }, b = { .noise = 1, .x = 100, .y = 60, .side = 90, .contrast = 0.5 };
    struct sst_live_input *in = make_set(1, &b, V4L2_PIX_FMT_MJPEG), *last = make_set(2, &b, V4L2_PIX_FMT_MJPEG);
    struct sst_image small, before[3];
    struct keeper k;
    uint8_t *jpeg;
    size_t bytes;

    (void)state;
    open_keeper(&k, V4L2_PIX_FMT_MJPEG, NULL, true, 2);
    show(&k, 0, &a);
    for (int v = 0; v < 3; v++) {
        assert_int_equal(sst_image_init(&before[v], WIDTH, HEIGHT), 0);
        memcpy(before[v].plane[0], k.lf.views[v].image.plane[0], 3 * before[v].stride * HEIGHT);
    }
    in->frame[0].bytes = in->frame[0].bytes * 2 / 3;
    assert_int_equal(sst_image_init(&small, 64, 64), 0);
    assert_int_equal(sst_image_encode_jpeg(&small, 85, &jpeg, &bytes), 0);
    sst_image_fini(&small);
    free((void *)(uintptr_t)in->frame[1].data);
    in->frame[1].data = jpeg;
    in->frame[1].bytes = bytes;
    free((void *)(uintptr_t)in->frame[2].data);
    in->frame[2].data = NULL;
    update(&k, in);
    assert_int_equal(k.report.views, VIEWS - 3);
    assert_true(k.changes.changed > 0);
    for (int v = 0; v < 3; v++) {
        assert_memory_equal(before[v].plane[0], k.lf.views[v].image.plane[0], 3 * before[v].stride * HEIGHT);
        assert_null(memchr(k.changes.map[v], 1, (size_t)(k.changes.cols * k.changes.rows)));
        assert_true(k.lf.views[v].present);
        sst_image_fini(&before[v]);
    }
    update(&k, last);
    assert_int_equal(k.report.views, VIEWS);
    for (int v = 0; v < 3; v++)
        assert_non_null(memchr(k.changes.map[v], 1, (size_t)(k.changes.cols * k.changes.rows)));
    free_set(in);
    free_set(last);
    close_keeper(&k);
}

static void silent_cameras_are_absent(void **state)
{
    const struct seen s = { .noise = 1 };
    struct sst_live_input *in = make_set(0, &s, V4L2_PIX_FMT_MJPEG);
    const uint8_t *late = in->frame[2].data, *never = in->frame[3].data;
    struct keeper k;

    (void)state;
    open_keeper(&k, V4L2_PIX_FMT_MJPEG, NULL, true, 2);
    in->frame[3].data = NULL;
    for (int n = 0; n < 30; n++) {
        in->set = (uint64_t)n;
        in->t_ns = (n + 1) * (int64_t)STEP_NS;
        in->frame[2].data = n < 5 || n > 27 ? late : NULL;
        update(&k, in);
        assert_false(k.lf.views[3].present);
        assert_int_equal(k.lf.views[2].present, n < 24 || n > 27);
        assert_int_equal(k.changes.map[2][0], n == 0 || n == 24 || n == 28);
    }
    in->frame[3].data = never;
    update(&k, in);
    assert_true(k.lf.views[3].present && k.changes.map[3][0] && !k.changes.map[4][0]);
    free_set(in);
    close_keeper(&k);
}

static void the_error_is_sampled(void **state)
{
    const struct seen s = { .noise = 1 };
    struct sst_live_input *sets[2] = { make_set(0, &s, V4L2_PIX_FMT_MJPEG), make_set(1, &s, V4L2_PIX_FMT_MJPEG) };
    struct keeper k;
    double most = 0;
    int samples = 0;

    (void)state;
    open_keeper(&k, V4L2_PIX_FMT_MJPEG, NULL, true, 2);
    for (int n = 0; n < 70; n++) {
        sets[n % 2]->set = (uint64_t)n;
        sets[n % 2]->t_ns = (n + 1) * (int64_t)STEP_NS;
        update(&k, sets[n % 2]);
        if (isnan(k.report.error_change))
            continue;
        samples++;
        assert_true(k.report.error_change >= 0 && k.report.error_change < 2); /* two times noise */
        most = fmax(most, k.report.error_change);
    }
    assert_true(most > 0.1);
    free_set(sets[0]);
    free_set(sets[1]);
    assert_int_equal(samples, 2);
    close_keeper(&k);
}

static void repeated_bytes_cost_nothing(void **state)
{
    struct sst_live_input *in = make_set(0, &(struct seen){ .noise = 1 }, V4L2_PIX_FMT_MJPEG);
    struct keeper k;

    (void)state;
    open_keeper(&k, V4L2_PIX_FMT_MJPEG, NULL, true, 1);
    for (int n = 0; n < 10; n++) {
        update(&k, in);
        assert_int_equal(k.report.decodes, n ? 0 : VIEWS);
        assert_int_equal(k.changes.changed, n ? 0 : k.report.tiles);
    }
    free_set(in);
    close_keeper(&k);
}

static void cancelled_work_is_done_anew(void **state)
{
    struct sst_live_input *in = make_set(0, &(struct seen){ 0 }, V4L2_PIX_FMT_MJPEG);
    struct keeper k;

    (void)state;
    open_keeper(&k, V4L2_PIX_FMT_MJPEG, NULL, true, 2);
    update(&k, in);
    sst_liveframes_cancel(k.frames);
    assert_int_equal(sst_liveframes_update(k.frames, in, &k.changes, &k.report), -ECANCELED);
    free_set(in);
    close_keeper(&k);
}

static void wrong_configurations_are_refused(void **state)
{
    struct sst_liveframes *frames = NULL;
    struct sst_lightfield lf;
    struct sst_live_config cfg = { .rows = ROWS,
                                   .cols = COLS,
                                   .fourcc = v4l2_fourcc('H', '2', '6', '4'),
                                   .width = WIDTH,
                                   .height = HEIGHT,
                                   .present = { true } };
    char text[SST_LOG_MAX];

    (void)state;
    assert_int_equal(sst_lightfield_init(&lf, ROWS, COLS), 0);
    lf.width = WIDTH;
    lf.height = HEIGHT;
    lf.views[0].present = true;
    (void)sst_log_hold_errors(text);
    assert_int_equal(sst_liveframes_open(&frames, &cfg, &lf), -EINVAL);
    assert_non_null(strstr(text, "H264"));
    cfg.fourcc = V4L2_PIX_FMT_MJPEG;
    lf.width = 100;
    assert_int_equal(sst_liveframes_open(&frames, &cfg, &lf), -EINVAL);
    (void)sst_log_hold_errors(NULL);
    assert_null(frames);
    sst_lightfield_fini(&lf);
}

int main(void)
{
    /* The thread sanitizer is many times slower, and these show it all there is to see. */
    const struct CMUnitTest few[] = {
        thread_test(any_number_of_threads_gives_the_same),
        cmocka_unit_test(cancelled_work_is_done_anew),
    };
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_first_set_is_whole),
        thread_test(any_number_of_threads_gives_the_same),
        cmocka_unit_test(cancelled_work_is_done_anew),
        cmocka_unit_test(noise_is_no_change),
        cmocka_unit_test(motion_everywhere_hides_no_change),
        cmocka_unit_test(faint_change_is_seen),
        cmocka_unit_test(motion_is_followed),
        cmocka_unit_test(one_view_is_watched),
        cmocka_unit_test(light_is_taken_over_as_a_whole),
        cmocka_unit_test(changes_of_exposure_are_reported),
        cmocka_unit_test(calibrated_views_follow),
        cmocka_unit_test(raw_formats_follow),
        cmocka_unit_test(levels_of_sixteen_bits_are_stretched),
        cmocka_unit_test(bad_frames_leave_the_view),
        cmocka_unit_test(silent_cameras_are_absent),
        cmocka_unit_test(the_error_is_sampled),
        cmocka_unit_test(repeated_bytes_cost_nothing),
        cmocka_unit_test(wrong_configurations_are_refused),
    };

    prepare();
    make_calibration();
    sst_log_set_level(SST_LOG_ERROR);
    return WATCH_THREADS ? cmocka_run_group_tests(few, NULL, NULL) : cmocka_run_group_tests(tests, NULL, NULL);
}
