/* The stages in memory: computed and kept maps, and the same labels by the short way. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "pipeline/method/labels/labels.h"
#include "pipeline/method/process/process.h"
#include "pipeline/method/process/process_internal.h"
#include "simulators/scene/scene.h"
#include "tests/onnx_writer.h"
#include "tests/test.h"

#define WIDTH  64
#define HEIGHT 48
#define SIDE   3
#define PIXELS (WIDTH * HEIGHT)

static char model[] = "/tmp/sst-process-XXXXXX";
static struct sst_lightfield views; /* images alone */

/* Three classes with the normalised R, G and B as logits. */
static void write_model(void)
{
    static const char *const entries[][2] = {
        { "sst.classes", "Sky,Road,Tree" }, { "sst.ground", "Road" }, { "sst.mean", "0.5,0.5,0.5" },
        { "sst.std", "0.1,0.1,0.1" },       { "sst.size", "64x48" },  { "sst.epsilon_h", "0.75" },
        { "sst.output", "logits" },
    };
    const float w[3 * 3] = { 1, 0, 0, 0, 1, 0, 0, 0, 1 };
    struct ow_buf graph = { 0 }, attrs = { 0 }, file;
    const int fd = mkstemp(model);

    ow_value(&graph, 11, "x", 3);
    ow_value(&graph, 12, "y", 3);
    ow_floats(&graph, "w", w, 3, 3, 1, 1);
    ow_attr_ints(&attrs, "kernel_shape", 2, 1, 1);
    ow_node(&graph, "Conv", "x w", "y", &attrs);
    file = ow_model(&graph, 11);
    for (size_t i = 0; i < ARRAY_LEN(entries); i++)
        ow_metadata(&file, entries[i][0], entries[i][1]);
    assert_true(fd >= 0);
    assert_int_equal(write(fd, file.p, file.n), (ssize_t)file.n);
    close(fd);
    free(file.p);
}

static int setup(void **state SST_UNUSED)
{
    struct sst_scene_config cfg;
    struct sst_scene *scene;

    write_model();
    sst_scene_config_defaults(&cfg);
    cfg.width = WIDTH;
    cfg.height = HEIGHT;
    cfg.rows = cfg.cols = SIDE;
    assert_int_equal(sst_scene_create(&scene, "bush", &cfg), 0);
    assert_int_equal(sst_lightfield_init(&views, SIDE, SIDE), 0);
    views.width = WIDTH;
    views.height = HEIGHT;
    for (int k = 0; k < SIDE * SIDE; k++) {
        struct sst_view *v = &views.views[k];

        v->present = k != 8; /* a hole */
        assert_int_equal(sst_image_init(&v->image, WIDTH, HEIGHT), 0);
        assert_int_equal(sst_scene_render(scene, v->bx, v->by, 0, &(struct sst_scene_maps){ .image = &v->image }), 0);
    }
    /* Part of one view is outside its raw frame. */
    assert_int_equal(sst_map_u8_init(&views.views[1].valid, WIDTH, HEIGHT), 0);
    for (int y = 0; y < HEIGHT; y++)
        memset(sst_map_u8_row(&views.views[1].valid, y) + 10, 255, WIDTH - 10);
    sst_scene_destroy(scene);
    return 0;
}

static int teardown(void **state SST_UNUSED)
{
    sst_lightfield_fini(&views);
    unlink(model);
    return 0;
}

static void copy_views(struct sst_lightfield *lf)
{
    assert_int_equal(sst_lightfield_init(lf, SIDE, SIDE), 0);
    lf->width = WIDTH;
    lf->height = HEIGHT;
    for (int k = 0; k < SIDE * SIDE; k++)
        assert_int_equal(sst_view_copy(&lf->views[k], &views.views[k]), 0);
}

static struct sst_process_config config(int threads)
{
    struct sst_process_config cfg = { .model = model, .eps_h = -1, .accuracy_weight = 4, .refine = true };

    assert_int_equal(sst_disparity_preset(&cfg.disparity, "preview"), 0);
    cfg.disparity.disp_min_px = 0;
    cfg.disparity.disp_max_px = 8;
    sst_refine_config_defaults(&cfg.refinement);
    cfg.threads = threads;
    return cfg;
}

static void assert_same_maps(const struct sst_lightfield *a, const struct sst_lightfield *b)
{
    for (int k = 0; k < SIDE * SIDE; k++) {
        const struct sst_view *v = &a->views[k], *w = &b->views[k];

        assert_true(!v->label.data == !w->label.data && !v->disp.data == !w->disp.data);
        for (int y = 0; v->present && y < HEIGHT; y++) {
            assert_memory_equal(sst_map_u8_row(&v->label, y), sst_map_u8_row(&w->label, y), WIDTH);
            assert_memory_equal(sst_map_u16_row(&v->disp, y), sst_map_u16_row(&w->disp, y), 2 * WIDTH);
            assert_memory_equal(sst_map_u8_row(&v->confidence, y), sst_map_u8_row(&w->confidence, y), WIDTH);
        }
    }
}

static void labels_without_extras_are_the_same(void **state SST_UNUSED)
{
    struct sst_process_config cfg = config(3), lean = config(1);
    struct sst_lightfield full, plain;
    struct sst_process_extras extras = { 0 };
    struct sst_segmenter *kept = NULL, *first;
    struct sst_process_report report;

    copy_views(&full);
    copy_views(&plain);
    assert_int_equal(sst_process(&full, &cfg, &extras, &report), 0);
    lean.segmenters = &kept;
    assert_int_equal(sst_process(&plain, &lean, NULL, NULL), 0);
    assert_same_maps(&full, &plain);
    first = kept;
    assert_non_null(first);
    assert_int_equal(sst_process(&plain, &lean, NULL, NULL), 0);
    assert_ptr_equal(kept, first);
    assert_same_maps(&full, &plain);
    sst_segmenter_close(kept);

    assert_true(report.eps_h == 0.75 && report.disp_min_px == 0 && report.disp_max_px == 8);
    assert_true(report.coverage_hcsm > 0 && report.coverage_refined >= report.coverage_hcsm);
    assert_true(report.confirmed > 0 && report.confirmed <= 100);
    assert_int_equal(full.classes.count, 3);
    assert_false(full.views[8].label.data || full.views[8].disp.data || extras.map[SST_EXTRA_HCSM][8].data);
    for (int i = 0; i < PIXELS; i++) {
        const int x = i % WIDTH, y = i / WIDTH;
        const uint8_t hcsm = sst_map_u8_row(&extras.map[SST_EXTRA_HCSM][1], y)[x];

        assert_true(hcsm == SST_LABEL_NONE || hcsm == sst_map_u8_row(&extras.map[SST_EXTRA_INITIAL][1], y)[x]);
        assert_true(x >= 10 || hcsm == SST_LABEL_NONE); /* pixels outside the camera's picture */
    }
    sst_process_extras_fini(&extras);
    sst_lightfield_fini(&full);
    sst_lightfield_fini(&plain);
}

static void external_maps_are_kept(void **state SST_UNUSED)
{
    struct sst_process_config cfg = config(2);
    struct sst_process_extras extras = { 0 };
    struct sst_process_report report;
    struct sst_lightfield lf;

    copy_views(&lf);
    for (int k = 0; k < SIDE * SIDE - 1; k++) {
        assert_int_equal(sst_map_u8_init(&lf.views[k].label, WIDTH, HEIGHT), 0);
        assert_int_equal(sst_map_u16_init(&lf.views[k].disp, WIDTH, HEIGHT), 0);
        for (int y = 0; y < HEIGHT; y++) {
            memset(sst_map_u8_row(&lf.views[k].label, y), 5, WIDTH);
            memset(sst_map_u16_row(&lf.views[k].disp, y), 1, 2 * WIDTH);
        }
    }
    cfg.model = NULL;
    cfg.keep_disparity = true;
    assert_int_equal(sst_process(&lf, &cfg, &extras, &report), 0);
    assert_true(isnan(report.eps_h) && isnan(report.confirmed) && report.disp_min_px == report.disp_max_px);
    assert_true(report.coverage_hcsm == 100 && report.coverage_refined == 100);
    assert_null(extras.map[0]);
    assert_int_equal(sst_map_u8_row(&lf.views[0].label, 7)[9], 5);
    assert_int_equal(sst_map_u16_row(&lf.views[0].disp, 7)[9], 0x0101);
    assert_null(lf.views[0].confidence.data);
    sst_process_extras_fini(&extras);
    sst_lightfield_fini(&lf);
}

static void a_cancelled_run_stops(void **state SST_UNUSED)
{
    const _Atomic bool cancel = true;
    struct sst_process_config cfg = config(2);
    struct sst_lightfield lf;

    copy_views(&lf);
    cfg.cancel = &cancel;
    assert_int_equal(sst_process(&lf, &cfg, NULL, NULL), -ECANCELED);
    cfg.model = NULL;
    assert_int_equal(sst_process(&lf, &cfg, NULL, NULL), -ECANCELED);
    sst_lightfield_fini(&lf);
}

/* Labels are carried if the maps find most surfaces in other views. */
static void labels_are_carried_by_good_maps_only(void **state SST_UNUSED)
{
    struct sst_process_config cfg = config(2);
    struct sst_process_report report;
    struct sst_lightfield lf;

    cfg.skip_labels = true;
    cfg.disparity.key_spacing = 1;
    copy_views(&lf);
    for (int k = 0; k < SIDE * SIDE; k++) { /* a flat picture at disparity 0: all views are the same one */
        struct sst_view *v = &lf.views[k];

        for (int c = 0; c < 3 && v->present; c++)
            memcpy(v->image.plane[c], views.views[0].image.plane[c], v->image.stride * HEIGHT);
        if (v->present)
            assert_int_equal(sst_map_u16_init(&v->disp, WIDTH, HEIGHT), 0);
    }
    cfg.keep_disparity = true;
    assert_int_equal(sst_process(&lf, &cfg, NULL, &report), 0);
    assert_true(report.labels_skipped > 50 && report.labels_error < 1);

    for (int k = 0; k < SIDE * SIDE; k++) { /* disparities that no other view has */
        for (int i = 0; i < PIXELS && lf.views[k].present; i++)
            sst_map_u16_row(&lf.views[k].disp, i / WIDTH)[i % WIDTH] = (uint16_t)(i / 3 % 3 ? 400 + 100 * k : 0);
    }
    assert_int_equal(sst_process(&lf, &cfg, NULL, &report), 0);
    assert_true(isnan(report.labels_skipped) && isnan(report.labels_error));
    sst_lightfield_fini(&lf);
}

/* Carried labels mostly equal the network's, and no pixel outside a view has one. */
static void labels_of_some_views_are_carried(void **state SST_UNUSED)
{
    struct sst_process_config all = config(2), some = config(3), one = config(1);
    struct sst_process_report report, exact;
    struct sst_lightfield whole, carried, again;
    int same = 0, n = 0, unlabelled = 0;

    some.skip_labels = one.skip_labels = true;
    copy_views(&whole);
    copy_views(&carried);
    copy_views(&again);
    assert_int_equal(sst_process(&whole, &all, NULL, &exact), 0);
    assert_int_equal(sst_process(&carried, &some, NULL, &report), 0);
    assert_int_equal(sst_process(&again, &one, NULL, NULL), 0);
    assert_same_maps(&carried, &again);
    assert_true(isnan(exact.labels_skipped) && isnan(exact.labels_error));
    assert_true(report.labels_skipped > 0 && report.labels_skipped < 100);
    for (int k = 0; k < SIDE * SIDE - 1; k++) {
        for (int i = 0; i < PIXELS; i++) {
            const uint8_t want = sst_map_u8_row(&whole.views[k].label, i / WIDTH)[i % WIDTH];
            const uint8_t got = sst_map_u8_row(&carried.views[k].label, i / WIDTH)[i % WIDTH];

            n += want != 0;
            same += want && got == want;
            unlabelled += want && !got;
        }
    }
    assert_true(5 * same > 4 * n);
    assert_true(20 * unlabelled < n);
    for (int y = 0; y < HEIGHT; y++)
        assert_int_equal(sst_map_u8_row(&carried.views[1].label, y)[9], 0);
    sst_lightfield_fini(&whole);
    sst_lightfield_fini(&carried);
    sst_lightfield_fini(&again);
}

/* One row of three views of a wall of disparity 2: (x, y) of the middle view is (x + 2, y) of the left one. */
static void wall(struct sst_lightfield *lf)
{
    assert_int_equal(sst_lightfield_init(lf, 1, SIDE), 0);
    lf->width = WIDTH;
    lf->height = 1;
    lf->disp_min_px = 2;
    for (int k = 0; k < SIDE; k++) {
        struct sst_view *v = &lf->views[k];

        v->present = true;
        v->bx = k - 1;
        assert_int_equal(sst_image_init(&v->image, WIDTH, 1), 0);
        assert_int_equal(sst_map_u8_init(&v->label, WIDTH, 1), 0);
        assert_int_equal(sst_map_u16_init(&v->disp, WIDTH, 1), 0);
        for (int c = 0; c < 3; c++)
            memset(sst_image_row(&v->image, c, 0), 100, WIDTH);
        memset(sst_map_u8_row(&v->label, 0), 1, WIDTH);
        memset(sst_map_u16_row(&v->disp, 0), 0, 2 * WIDTH);
    }
}

static void most_views_decide_on_a_label(void **state SST_UNUSED)
{
    static const bool skip[SIDE] = { true, false, false };
    struct sst_lightfield lf;
    uint8_t *label[SIDE];

    wall(&lf);
    for (int k = 0; k < SIDE; k++)
        label[k] = sst_map_u8_row(&lf.views[k].label, 0);
    label[1][20] = 2;                /* alone */
    label[1][25] = 0;                /* none here */
    label[1][30] = label[0][32] = 3; /* two of three */
    label[0][42] = label[2][38] = 4; /* both others, on the same surface as 40 ... */
    label[0][52] = label[2][48] = 4; /* ... on another colour than 50 ... */
    label[0][62] = label[2][58] = 4; /* ... at another distance than 60 */
    sst_image_row(&lf.views[0].image, 1, 0)[52] = sst_image_row(&lf.views[2].image, 1, 0)[48] = 125;
    sst_map_u16_row(&lf.views[0].disp, 0)[62] = sst_map_u16_row(&lf.views[2].disp, 0)[58] = 65;
    assert_int_equal(process_vote_labels(&lf, NULL, NULL, 2), 0);
    for (int x = 0; x < WIDTH; x++)
        assert_int_equal(sst_map_u8_row(&lf.views[1].label, 0)[x], x == 30 ? 3 : x == 40 ? 4 : 1);
    assert_int_equal(sst_map_u8_row(&lf.views[2].label, 0)[28], 3);
    sst_map_u8_row(&lf.views[1].label, 0)[20] = 5;
    assert_int_equal(process_vote_labels(&lf, skip, NULL, 1), 0);
    assert_int_equal(sst_map_u8_row(&lf.views[1].label, 0)[20], 5); /* one against one: the own label stays */
    assert_int_equal(sst_map_u8_row(&lf.views[0].label, 0)[32], 3); /* skipped */
    sst_lightfield_fini(&lf);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(labels_without_extras_are_the_same),
        cmocka_unit_test(labels_are_carried_by_good_maps_only),
        cmocka_unit_test(labels_of_some_views_are_carried),
        cmocka_unit_test(most_views_decide_on_a_label),
        cmocka_unit_test(external_maps_are_kept),
        cmocka_unit_test(a_cancelled_run_stops),
    };

    return cmocka_run_group_tests(tests, setup, teardown);
}
