/* From camera frames to see-through pictures: sets of simulated scenes, JPEG as cameras send it, go into the live
 * light field, and the viewers' pictures are compared with the truth behind the occluders. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include <linux/videodev2.h>

#include "base/clock.h"
#include "base/log.h"
#include "base/thread.h"
#include "pipeline/image/codec.h"
#include "pipeline/live/live.h"
#include "simulators/scene/scene.h"
#include "tests/live_zone.h"
#include "tests/quick.h"
#include "tests/small.h"
#include "tests/test.h"

#define SIDE   6
#define VIEWS  (SIDE * SIDE)
#define WIDTH  320
#define HEIGHT 240
#define SET_NS 200000000

struct array {
    struct sst_live_config cfg;
    struct sst_live *live;
    struct sst_livepicture *picture;
    struct sst_scene *scene;
    struct sst_live_input in;
    uint8_t *jpeg[VIEWS];
    size_t bytes[VIEWS];
    struct sst_map_f32 front[VIEWS]; /* true disparities */
    struct sst_live_report report;
    /* of the reference view: the scene behind the occluders, and where it can be seen at all */
    struct sst_image behind;
    struct sst_map_u8 hidden;
};

static int expose_view(void *arg, int k, int worker SST_UNUSED)
{
    struct array *a = arg;
    struct sst_image image = { 0 };
    int err = sst_image_init(&image, WIDTH, HEIGHT);

    free(a->jpeg[k]);
    a->jpeg[k] = NULL;
    err = err ? err
              : sst_scene_render(a->scene, k % SIDE - 2, k / SIDE - 2, 0,
                                 &(struct sst_scene_maps){ .image = &image, .disp = &a->front[k] });
    err = err ? err : sst_image_encode_jpeg(&image, 90, &a->jpeg[k], &a->bytes[k]);
    sst_image_fini(&image);
    return err;
}

/* Views that see the point at (x, y) of the reference view with disparity d. */
static int seen(const struct array *a, int x, int y, double d)
{
    int n = 0;

    for (int k = 0; k < VIEWS; k++) {
        const int u = (int)floor(x - d * (k % SIDE - 2) + 0.5), v = (int)floor(y - d * (k / SIDE - 2) + 0.5);

        n += u >= 0 && u < WIDTH && v >= 0 && v < HEIGHT && fabs((double)sst_map_f32_row(&a->front[k], v)[u] - d) < 0.5;
    }
    return n;
}

/* Frames of the cameras at this time of the scene's, and the truth. */
static void expose(struct array *a, const char *name, double time_s)
{
    struct sst_map_f32 back = { 0 };
    struct sst_scene_config cfg;

    sst_scene_config_defaults(&cfg);
    cfg.width = WIDTH;
    cfg.height = HEIGHT;
    cfg.time_s = time_s;
    cfg.threads = 1;
    sst_scene_destroy(a->scene);
    assert_int_equal(sst_scene_create(&a->scene, name, &cfg), 0);
    assert_int_equal(sst_parallel_for(VIEWS, 2, expose_view, a), 0);
    assert_int_equal(sst_map_f32_init(&back, WIDTH, HEIGHT), 0);
    assert_int_equal(
        sst_scene_render(a->scene, 0, 0, 1, &(struct sst_scene_maps){ .image = &a->behind, .disp = &back }), 0);
    for (int y = 0; y < HEIGHT; y++) {
        for (int x = 0; x < WIDTH; x++) {
            const double focus = sst_scene_occluder_at(a->scene, 0)->focus_px;
            const double f = (double)sst_map_f32_row(&a->front[14], y)[x], b = (double)sst_map_f32_row(&back, y)[x];

            /* In focus, and there to be seen: other surfaces are not meant to be sharp. */
            sst_map_u8_row(&a->hidden, y)[x] = f > b + 1 && fabs(b - focus) < 1 && seen(a, x, y, b) > 3;
        }
    }
    sst_map_f32_fini(&back);
}

static void open_array(struct array *a, bool labels)
{
    memset(a, 0, sizeof(*a));
    a->cfg = (struct sst_live_config){ .rows = SIDE,
                                       .cols = SIDE,
                                       .fourcc = V4L2_PIX_FMT_MJPEG,
                                       .width = WIDTH,
                                       .height = HEIGHT,
                                       .threads = 2,
                                       .skip_change = true,
                                       .skip_labels = true,
                                       .zones = 1 };
    for (int k = 0; k < VIEWS; k++)
        a->cfg.present[k] = true;
    a->cfg.zone[0] = live_rectangle(0, 0, 0.25, 0.25);
    if (labels && WITH_DNNL)
        a->cfg.model = "models/pspnet-small.onnx";
    a->in.t_ns = SET_NS;
    assert_int_equal(sst_image_init(&a->behind, WIDTH, HEIGHT), 0);
    assert_int_equal(sst_map_u8_init(&a->hidden, WIDTH, HEIGHT), 0);
    for (int k = 0; k < VIEWS; k++)
        assert_int_equal(sst_map_f32_init(&a->front[k], WIDTH, HEIGHT), 0);
    assert_int_equal(sst_live_open(&a->live, &a->cfg), 0);
    assert_int_equal(sst_livepicture_create(&a->picture, a->live), 0);
}

static void close_array(struct array *a)
{
    const int64_t start = sst_clock_now_ns();

    sst_livepicture_destroy(a->picture);
    sst_live_close(a->live);
    assert_quick(start, INT64_C(1000000000));
    sst_scene_destroy(a->scene);
    sst_image_fini(&a->behind);
    sst_map_u8_fini(&a->hidden);
    for (int k = 0; k < VIEWS; k++) {
        sst_map_f32_fini(&a->front[k]);
        free(a->jpeg[k]);
    }
}

/* One set of exposed frames; `missing` gives no frame. */
static int feed(struct array *a, int missing)
{
    a->in.set++;
    a->in.t_ns += SET_NS;
    for (int k = 0; k < VIEWS; k++) {
        a->in.frame[k].data = k == missing ? NULL : a->jpeg[k];
        a->in.frame[k].bytes = a->bytes[k];
    }
    return sst_live_update(a->live, &a->in, &a->report);
}

/* PSNR inside occluded pixels, dB. */
static double see_through(struct array *a, enum sst_render_method method, double focus_px, int64_t *anew)
{
    const struct sst_image *image;
    struct sst_render_config cfg;
    double sum = 0;
    int n = 0;

    sst_render_config_defaults(&cfg);
    cfg.method = method;
    cfg.focus_px = focus_px;
    assert_int_equal(sst_livepicture_render(a->picture, &cfg, &image, anew), 0);
    for (int y = 0; y < HEIGHT; y++) {
        for (int x = 0; x < WIDTH; x++) {
            for (int c = 0; c < 3 && sst_map_u8_row(&a->hidden, y)[x]; c++, n++)
                sum += pow(sst_image_row(image, c, y)[x] - sst_image_row(&a->behind, c, y)[x], 2);
        }
    }
    assert_true(n > 1000);
    return 10 * log10(255 * 255 / fmax(sum / n, 1e-9));
}

/* Seeing through beats refocusing by by_db, and by own_db at the focus that is found by itself. */
static void assert_sees_through(struct array *a, double by_db, double own_db)
{
    const double truth = sst_scene_occluder_at(a->scene, 0)->focus_px, found = sst_live_default_focus(a->live);
    int64_t anew;
    const double plain = see_through(a, SST_RENDER_REFOCUS, truth, &anew);
    const double sst = see_through(a, SST_RENDER_SST, truth, &anew), own = see_through(a, SST_RENDER_SST, NAN, &anew);

    if (getenv("SST_VERBOSE"))
        printf("focus %.2f, truth %.2f; refocus %.1f dB, see-through %.1f dB, at the found focus %.1f dB\n", found,
               truth, plain, sst, own);
    assert_true(fabs(found - truth) <= 1);
    assert_true(sst >= plain + by_db);
    assert_true(own >= plain + own_db);
}

static void a_pedestrian_vanishes(void **state SST_UNUSED)
{
    struct array a;
    int64_t anew, first_cpu_ns;

    open_array(&a, false);
    expose(&a, "pedestrian", 0.9);
    assert_int_equal(feed(&a, -1), 0);
    assert_true(a.report.ready && a.report.whole);
    assert_int_equal(a.report.decodes, VIEWS);
    first_cpu_ns = a.report.cpu_ns;
    assert_sees_through(&a, 3, 1);
    for (int i = 1; i < 3; i++) { /* walking on */
        expose(&a, "pedestrian", 0.9 + i * 0.1);
        assert_int_equal(feed(&a, -1), 0);
        assert_false(a.report.whole);
        assert_true(a.report.tiles_changed > 0 && a.report.tiles_changed < a.report.tiles / 2);
        assert_true(a.report.zone[SST_LIVE_ZONES].changed > 0 && a.report.zone[SST_LIVE_ZONES].changed < 0.5);
        assert_true(a.report.zone[0].changed <= 0); /* the sky above */
        assert_sees_through(&a, 3, 1);
    }
    /* The same frames again: kept tiles are taken over, and then nothing is computed any more. */
    for (int i = 0; i < 8; i++)
        assert_int_equal(feed(&a, -1), 0);
    see_through(&a, SST_RENDER_SST, 8.6, &anew);
    for (int i = 0; i < 5; i++) {
        assert_int_equal(feed(&a, -1), 0);
        assert_int_equal(a.report.decodes, 0);
        assert_int_equal(a.report.tiles_changed, 0);
        assert_true(a.report.cpu_ns < first_cpu_ns / 4);
        see_through(&a, SST_RENDER_SST, 8.6, &anew);
        assert_int_equal(anew, 0);
    }
    close_array(&a);
}

/* Leaves before a bench and a pedestrian, all of them in motion between two sets: the maps lose most of what is behind,
 * and a click finds it all the same where it is seen, by the rays. */
static void a_click_finds_what_is_between_leaves(void **state SST_UNUSED)
{
    struct sst_map_f32 back = { 0 };
    const struct sst_image *image;
    struct sst_render_config cfg;
    int all = 0, right = 0;
    struct array a;
    int64_t anew;

    open_array(&a, false);
    expose(&a, "bush", 0.4);
    assert_int_equal(feed(&a, -1), 0);
    expose(&a, "bush", 0.6);
    assert_int_equal(feed(&a, -1), 0);
    assert_int_equal(sst_map_f32_init(&back, WIDTH, HEIGHT), 0);
    assert_int_equal(sst_scene_render(a.scene, 0, 0, 1, &(struct sst_scene_maps){ .disp = &back }), 0);
    sst_render_config_defaults(&cfg);
    cfg.focus_px = sst_scene_occluder_at(a.scene, 0)->focus_px;
    cfg.verify = true;
    assert_int_equal(sst_livepicture_render(a.picture, &cfg, &image, &anew), 0);
    for (int y = 2; y < HEIGHT; y += 5) {
        for (int x = 2; x < WIDTH; x += 5) {
            struct sst_livepicture_pick pick;

            if (!sst_map_u8_row(&a.hidden, y)[x])
                continue;
            assert_int_equal(sst_livepicture_pick(a.picture, x, y, &pick), 0);
            right += fabs(pick.disp_px - (double)sst_map_f32_row(&back, y)[x]) <= 1;
            all++;
        }
    }
    if (getenv("SST_VERBOSE"))
        printf("%d of %d clicks found what is behind\n", right, all);
    assert_true(all > 300);
    assert_true(right >= 0.85 * all); /* by the maps alone 4 in 100 */
    sst_map_f32_fini(&back);
    close_array(&a);
}

static void a_hen_vanishes_with_labels(void **state SST_UNUSED)
{
    struct array a;
    double px;

    open_array(&a, true);
    expose(&a, "cat", 0);
    assert_int_equal(feed(&a, -1), 0);
    assert_sees_through(&a, 2, 0.1); /* the network takes some of the hen for the cat: 2.4 and 0.2 dB */
    if (a.cfg.model) {
        const int cat = sst_classes_find(&sst_live_lightfield(a.live)->classes, "Cat");

        assert_true(cat > 0);
        assert_true(a.report.zone[SST_LIVE_ZONES].label[cat] > 0.02f);
        assert_int_equal(sst_livepicture_label_disparity(a.live, cat, &px), 0);
        assert_true(fabs(px - sst_scene_occluder_at(a.scene, 0)->focus_px) < 1);
    }
    close_array(&a);
}

/* A camera falls silent, another one sends rubbish: the picture goes on; it comes back. */
static void a_camera_goes_and_comes(void **state SST_UNUSED)
{
    const struct sst_lightfield *lf;
    struct array a;
    int ref;

    open_array(&a, false);
    lf = sst_live_lightfield(a.live);
    ref = lf->ref_view;
    expose(&a, "pedestrian", 0.9);
    assert_int_equal(feed(&a, ref), 0); /* not even there at first */
    assert_sees_through(&a, 3, 1);
    assert_int_equal(feed(&a, -1), 0);
    assert_true(lf->views[ref].present);
    assert_sees_through(&a, 3, 1);
    for (int i = 0; i < 12; i++) {
        assert_int_equal(feed(&a, ref), 0);
        if (i == 5) {
            expose(&a, "pedestrian", 1.0);
            sst_log_set_level((enum sst_log_level) - 1);
            memset(a.jpeg[3] + a.bytes[3] / 8, 0, a.bytes[3] / 2);
        }
    }
    sst_log_set_level(SST_LOG_WARNING);
    assert_false(lf->views[ref].present);
    assert_sees_through(&a, 3, 1);
    expose(&a, "pedestrian", 1.1);
    assert_int_equal(feed(&a, -1), 0);
    assert_true(lf->views[ref].present && lf->views[3].present);
    assert_sees_through(&a, 3, 1);
    close_array(&a);
}

static void *cancel_soon(void *live)
{
    nanosleep(&(struct timespec){ 0, 50000000 }, NULL);
    sst_live_cancel(live);
    return NULL;
}

static void work_ends_when_it_is_to(void **state SST_UNUSED)
{
    const struct sst_image *image;
    struct sst_render_config cfg;
    struct array a;
    pthread_t thread;
    int64_t start, anew;
    int err = 0;

    open_array(&a, true);
    a.cfg.skip_change = false;
    expose(&a, "pedestrian", 0.9);
    start = sst_clock_now_ns();
    assert_int_equal(pthread_create(&thread, NULL, cancel_soon, a.live), 0);
    while (!err && sst_clock_now_ns() - start < INT64_C(10000000000)) {
        a.bytes[0] -= 1; /* another frame each time */
        err = feed(&a, -1);
    }
    pthread_join(thread, NULL);
    assert_int_equal(err, -ECANCELED);
    assert_quick(start, INT64_C(3000000000));
    sst_render_config_defaults(&cfg);
    assert_int_equal(sst_livepicture_render(a.picture, &cfg, &image, &anew), -ECANCELED);
    close_array(&a);
}

static void what_cannot_be_opened_is_refused(void **state SST_UNUSED)
{
    struct sst_live_config cfg = { .rows = 2, .cols = 2, .fourcc = V4L2_PIX_FMT_MJPEG, .width = 64, .height = 64 };
    struct sst_live *live;

    sst_log_set_level((enum sst_log_level) - 1);
    assert_int_equal(sst_live_open(&live, &cfg), -EINVAL); /* no camera */
    cfg.present[1] = true;
    cfg.zones = 1;
    assert_int_equal(sst_live_open(&live, &cfg), -EINVAL); /* an empty zone */
    cfg.zone[0] = live_rectangle(0, 0, NAN, NAN);
    assert_int_equal(sst_live_open(&live, &cfg), -EINVAL);
    cfg.zones = 0;
    cfg.model = "/nonexistent.onnx";
    assert_int_equal(sst_live_open(&live, &cfg), -ENOENT);
    sst_log_set_level(SST_LOG_WARNING);
    cfg.model = NULL;
    assert_int_equal(sst_live_open(&live, &cfg), 0);
    assert_int_equal(sst_live_lightfield(live)->ref_view, 1);
    assert_true(fabs(sst_live_lightfield(live)->views[1].bx) <= 0);
    sst_live_close(live);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        plain_test(a_pedestrian_vanishes),
        plain_test(a_click_finds_what_is_between_leaves),
        cmocka_unit_test(a_hen_vanishes_with_labels),
        serial_test(a_camera_goes_and_comes),
        cmocka_unit_test(work_ends_when_it_is_to),
        cmocka_unit_test(what_cannot_be_opened_is_refused),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
