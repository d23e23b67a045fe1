/* pipeline/live/posed/: ten simulated cameras over a forest, tilted and at unequal heights; the ground is found, and
 * pictures equal results of sst_posed_render(). */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <time.h>
#include <unistd.h>

#include <linux/videodev2.h>

#include "base/log.h"
#include "pipeline/live/live.h"
#include "pipeline/posed/array.h"
#include "pipeline/posed/render.h"
#include "simulators/flight/flight.h"
#include "tests/small.h"
#include "tests/test.h"

#define SIDE   (small_level() >= 2 ? 80 : 160) /* pixels; matching takes long under the thread sanitizer */
#define VIEWS  10
#define HIGH_M 40.0
#define NEAR   25000.0
#define FAR    60000.0

static struct sst_posed poses;
static struct sst_image picture[VIEWS];

static void place(int k)
{
    struct sst_calib_camera *cam = &poses.view[k].camera;
    const double tilt[3] = { 0.02 * sin(3.1 * k), 0.02 * sin(1.7 * k), 0.03 * cos(2.3 * k) };

    *cam = (struct sst_calib_camera){ .known = true,
                                      .fx = SST_FOREST_FOCAL * SIDE / 1000.0,
                                      .fy = SST_FOREST_FOCAL * SIDE / 1000.0,
                                      .cx = (SIDE - 1) / 2.0,
                                      .cy = (SIDE - 1) / 2.0,
                                      .position_mm = { 1000.0 * (k - 4), 80 * sin(k), 150 * cos(1.3 * k) } };
    sst_rotation_from_vector(tilt, cam->rotation);
}

static int draw_all(void **state SST_UNUSED)
{
    const struct sst_flight_forest_config cfg = {
        .seed = 3, .high_m = HIGH_M, .trees = 5, .half_m = { 5, 1 }, .aspect = 1
    };
    struct sst_flight_forest *forest;

    assert_int_equal(sst_posed_init(&poses, VIEWS), 0);
    poses.width = poses.height = SIDE;
    poses.channels = 1;
    poses.bits = 8;
    assert_int_equal(sst_flight_forest_open(&forest, &cfg), 0);
    for (int k = 0; k < VIEWS; k++) {
        place(k);
        assert_int_equal(sst_image_init(&picture[k], SIDE, SIDE), 0);
        assert_int_equal(sst_flight_forest_draw(forest, &poses.view[k].camera, 0, &picture[k]), 0);
    }
    sst_flight_forest_close(forest);
    return 0;
}

static int free_all(void **state SST_UNUSED)
{
    for (int k = 0; k < VIEWS; k++)
        sst_image_fini(&picture[k]);
    sst_posed_fini(&poses);
    return 0;
}

static struct sst_live_config config(double plane_mm)
{
    struct sst_live_config c = { .rows = 1,
                                 .cols = VIEWS,
                                 .fourcc = V4L2_PIX_FMT_GREY,
                                 .width = SIDE,
                                 .height = SIDE,
                                 .posed = { &poses, plane_mm, NEAR, FAR, 0, 160 },
                                 .threads = 2,
                                 .skip_change = true };

    for (int k = 0; k < VIEWS; k++)
        c.present[k] = true;
    return c;
}

/* A set of the red planes, without some views. */
static void feed(struct sst_live *live, int64_t t_ns, unsigned missing, struct sst_live_report *report)
{
    struct sst_live_input in = { .set = (uint64_t)t_ns, .t_ns = t_ns };

    for (int k = 0; k < VIEWS; k++) {
        if (missing >> k & 1)
            continue;
        in.frame[k].data = sst_image_row(&picture[k], 0, 0);
        in.frame[k].stride = (size_t)(sst_image_row(&picture[k], 0, 1) - sst_image_row(&picture[k], 0, 0));
        in.frame[k].bytes = in.frame[k].stride * SIDE;
    }
    assert_int_equal(sst_live_update(live, &in, report), 0);
}

static const struct sst_image *render(struct sst_live *live, struct sst_livepicture *p, enum sst_render_method method,
                                      int64_t *rendered_px)
{
    struct sst_render_config cfg;
    const struct sst_image *image;

    sst_render_config_defaults(&cfg);
    cfg.method = method;
    cfg.focus_px = sst_live_default_focus(live);
    assert_int_equal(sst_livepicture_render(p, &cfg, &image, rendered_px), 0);
    return image;
}

/* The picture of sst_posed_render() of these views on a plane. */
static void assert_offline(const struct sst_image *got, enum sst_posed_method method, double plane_mm, unsigned missing)
{
    const int middle = sst_posed_middle(&poses);
    struct sst_posed_render_config cfg = { .method = method,
                                           .camera = sst_virtual_of_view(&poses, middle),
                                           .threads = 1,
                                           .compare_px = 160,
                                           .near_mm = NEAR };
    struct sst_posed_rendered want;
    struct sst_posed posed = poses;
    struct sst_posed_view view[VIEWS];
    struct sst_deep deep[VIEWS];
    double at[3], back[3];

    for (int i = 0; i < 3; i++) {
        back[i] = -cfg.camera.rotation[6 + i];
        at[i] = cfg.camera.centre_mm[i] + plane_mm * cfg.camera.rotation[6 + i];
    }
    cfg.surface = sst_surface_plane(back, at);
    memcpy(view, poses.view, sizeof(view));
    for (int k = 0; k < VIEWS; k++) {
        view[k].camera.known = !(missing >> k & 1);
        assert_int_equal(sst_deep_init(&deep[k], SIDE, SIDE, 1, 255), 0);
        for (int i = 0; i < SIDE * SIDE; i++)
            sst_map_u16_row(&deep[k].plane[0], i / SIDE)[i % SIDE] = sst_image_row(&picture[k], 0, i / SIDE)[i % SIDE];
    }
    posed.view = view;
    posed.picture = deep;
    assert_int_equal(sst_posed_render(&want, &posed, "memory", &cfg), 0);
    for (int i = 0; i < SIDE * SIDE; i++)
        assert_int_equal(sst_image_row(got, i % 3, i / SIDE)[i % SIDE],
                         sst_map_u16_row(&want.levels.plane[0], i / SIDE)[i % SIDE]);
    sst_posed_rendered_fini(&want);
    for (int k = 0; k < VIEWS; k++)
        sst_deep_fini(&deep[k]);
}

static void pictures_are_those_of_render(void **state SST_UNUSED)
{
    const struct sst_live_config cfg = config(40000);
    struct sst_livepicture *p[2];
    struct sst_live_report report;
    struct sst_live_surface surface;
    struct sst_livepicture_pick pick;
    struct sst_live *live;
    int64_t px;

    assert_int_equal(sst_live_open(&live, &cfg), 0);
    assert_true(sst_live_surface(live, &surface) && surface.known && !surface.fitted);
    assert_int_equal(sst_live_refit(live), -ENOTSUP);
    for (int i = 0; i < 2; i++)
        assert_int_equal(sst_livepicture_create(&p[i], live), 0);
    feed(live, 1, 0, &report);
    assert_true(report.ready);
    assert_offline(render(live, p[0], SST_RENDER_REFOCUS, &px), SST_POSED_REFOCUS, 40000, 0);
    assert_offline(render(live, p[1], SST_RENDER_CLEAR, &px), SST_POSED_CLEAR, 40000, 0);
    assert_int_equal(px, SIDE * SIDE);
    assert_int_equal(sst_livepicture_pick(p[0], SIDE / 2, SIDE / 2, &pick), 0);
    assert_true(fabs(pick.disp_px / sst_live_default_focus(live) - 1) < 1e-3);
    assert_int_equal(sst_livepicture_toggle(p[0], 1, 1, &(bool){ false }), -ENOTSUP);
    feed(live, 2, 0, &report); /* nothing has changed */
    (void)render(live, p[0], SST_RENDER_REFOCUS, &px);
    assert_int_equal(px, 0);
    feed(live, 2000000002, 1 << 7 | 1 << 2, &report); /* two cameras have fallen out for more than two seconds */
    feed(live, 2100000002, 1 << 7 | 1 << 2, &report);
    assert_int_equal(report.views, VIEWS - 2);
    assert_offline(render(live, p[0], SST_RENDER_REFOCUS, &px), SST_POSED_REFOCUS, 40000, 1 << 7 | 1 << 2);
    for (int i = 1; i >= 0; i--) /* the second client gets the picture of the first */
        assert_offline(render(live, p[i], SST_RENDER_SST, &px), SST_POSED_THROUGH, 40000, 1 << 7 | 1 << 2);
    assert_int_equal(px, SIDE * SIDE);
    for (int i = 0; i < 2; i++)
        sst_livepicture_destroy(p[i]);
    sst_live_close(live);
}

static void ground_is_found_and_kept(void **state SST_UNUSED)
{
    const struct sst_live_config cfg = config(0);
    struct sst_livepicture *p;
    struct sst_live_report report;
    struct sst_live_surface surface;
    struct sst_live *live;
    double min_px, max_px;
    int64_t px;

    assert_int_equal(sst_live_open(&live, &cfg), 0);
    assert_int_equal(sst_livepicture_create(&p, live), 0);
    feed(live, 1, 0, &report);
    assert_false(report.ready);
    (void)render(live, p, SST_RENDER_REFOCUS, &px); /* on a plane between the limits until then */
    while (!sst_live_unsettled(live))
        nanosleep(&(struct timespec){ .tv_nsec = 10000000 }, NULL);
    assert_true(sst_live_settle(live));
    assert_true(sst_live_surface(live, &surface) && surface.known && surface.fitted && !surface.fitting);
    assert_true(fabs(surface.distance_mm - 1000 * HIGH_M) < 1000);
    assert_true(sst_live_range(live, &min_px, &max_px));
    assert_true(min_px < sst_live_default_focus(live) && sst_live_default_focus(live) < max_px);
    (void)render(live, p, SST_RENDER_SST, &px);
    assert_int_equal(px, SIDE * SIDE);
    feed(live, 2, 0, &report);
    assert_true(report.ready);
    assert_int_equal(sst_live_refit(live), 0);
    feed(live, 3, 0, &report);
    assert_int_equal(sst_live_refit(live), 0); /* while the ground is fitted: it is fitted once more */
    while (small_level() < 2 && !sst_live_unsettled(live))
        nanosleep(&(struct timespec){ .tv_nsec = 10000000 }, NULL);
    assert_true(small_level() >= 2 || sst_live_settle(live));
    feed(live, 4, 0, &report);
    assert_true(sst_live_surface(live, &surface) && surface.fitting); /* closing ends it */
    sst_livepicture_destroy(p);
    sst_live_close(live);
}

/* Depth of the eleventh of the points, which lie in this order along the middle view's axis. */
static double start_mm(const struct sst_posed_point points[20])
{
    const struct sst_virtual v = sst_virtual_of_view(&poses, sst_posed_middle(&poses));
    double mm = 0;

    for (int k = 0; k < 3; k++)
        mm += v.rotation[6 + k] * (points[10].at_mm[k] - v.centre_mm[k]);
    return mm;
}

/* Limits by the points of the scene, as sst poses leaves them. */
static void points_are_limits(void **state SST_UNUSED)
{
    struct sst_live_config cfg = config(0);
    struct sst_posed_point points[20] = { 0 };
    struct sst_posed_sight sights[20] = { 0 }; /* stay the caller's */
    struct sst_livepicture *p;
    struct sst_live_report report;
    struct sst_live_surface surface;
    struct sst_live *live;
    int64_t px;

    for (int i = 0; i < 20; i++) { /* from the crowns to the ground */
        points[i].at_mm[0] = 200 * i;
        points[i].at_mm[2] = 30000 + 500 * i;
        points[i].views = 1;
    }
    cfg.posed.near_mm = cfg.posed.far_mm = 0;
    poses.points = points;
    poses.point_count = poses.sight_count = 20;
    poses.sights = sights;
    assert_int_equal(sst_live_open(&live, &cfg), 0);
    assert_int_equal(sst_livepicture_create(&p, live), 0);
    feed(live, 1, 0, &report);
    assert_offline(render(live, p, SST_RENDER_REFOCUS, &px), SST_POSED_REFOCUS, start_mm(points), 0);
    while (!sst_live_unsettled(live))
        nanosleep(&(struct timespec){ .tv_nsec = 10000000 }, NULL);
    assert_true(sst_live_settle(live) && sst_live_surface(live, &surface));
    assert_true(fabs(surface.distance_mm - 1000 * HIGH_M) < 1000);
    poses.points = NULL;
    poses.sights = NULL;
    poses.point_count = poses.sight_count = 0;
    sst_livepicture_destroy(p);
    sst_live_close(live);
}

static void refuses_what_has_no_surface(void **state SST_UNUSED)
{
    struct sst_live_config cfg = config(0);
    char why[SST_LOG_MAX] = "", *before = sst_log_hold_errors(why);
    struct sst_live *live;

    cfg.posed.far_mm = 0;
    assert_int_equal(sst_live_open(&live, &cfg), -EINVAL);
    assert_contains(why, "give both near_m and far_m");
    cfg = config(40000);
    for (int k = 2; k < VIEWS; k++)
        cfg.present[k] = false;
    assert_int_equal(sst_live_open(&live, &cfg), -EINVAL);
    sst_log_hold_errors(before);
}

static void poses_come_from_calibrations(void **state SST_UNUSED)
{
    const struct sst_posed_array half = { 1, VIEWS, SIDE / 2, SIDE / 2, 1 }, other = { 2, VIEWS / 2, SIDE, SIDE, 3 },
                                 wide = { 1, VIEWS, SIDE, SIDE / 2, 3 };
    char path[] = "/tmp/live-posed-XXXXXX", why[SST_LOG_MAX] = "", *before;
    struct sst_calib calib;
    struct sst_posed posed;
    const int fd = mkstemp(path);

    assert_true(fd >= 0);
    close(fd);
    assert_int_equal(sst_calib_init(&calib, 1, VIEWS), 0);
    calib.width = calib.height = SIDE;
    for (int k = 0; k < VIEWS; k++) { /* in the axes of the reference camera */
        const struct sst_calib_camera *ref = &poses.view[calib.reference].camera, *cam = &poses.view[k].camera;

        calib.camera[k] = *cam;
        for (int i = 0; i < 3; i++) {
            calib.camera[k].position_mm[i] = 0;
            calib.camera[k].gain[i] = 1;
            for (int j = 0; j < 3; j++)
                calib.camera[k].position_mm[i] +=
                    ref->rotation[3 * i + j] * (cam->position_mm[j] - ref->position_mm[j]);
        }
        sst_rotation_between(cam->rotation, ref->rotation, calib.camera[k].rotation);
    }
    assert_int_equal(sst_calib_write(&calib, path), 0);
    assert_int_equal(sst_posed_array_read(&posed, path, &half), 0);
    assert_int_equal(posed.count, VIEWS);
    assert_string_equal(posed.view[7].name, "00_07");
    assert_true(fabs(posed.view[7].camera.fx - poses.view[7].camera.fx / 2) < 1e-9);
    assert_true(fabs(posed.view[7].camera.cx - (SIDE / 2 - 1) / 2.0) < 1e-9);
    sst_posed_fini(&posed);
    before = sst_log_hold_errors(why);
    assert_int_equal(sst_posed_array_read(&posed, path, &other), -EBADMSG);
    assert_int_equal(sst_posed_array_read(&posed, path, &wide), -EBADMSG);
    assert_contains(why, "other proportions");
    sst_log_hold_errors(before);
    sst_calib_fini(&calib);
    unlink(path);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        plain_test(pictures_are_those_of_render),
        cmocka_unit_test(ground_is_found_and_kept),
        serial_test(points_are_limits),
        cmocka_unit_test(refuses_what_has_no_surface),
        cmocka_unit_test(poses_come_from_calibrations),
    };

    return cmocka_run_group_tests(tests, draw_all, free_all);
}
