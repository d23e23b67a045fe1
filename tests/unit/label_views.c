/* Which views are labelled, how far their labels differ, and what gaps between carried labels become. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>
#include <string.h>

#include "pipeline/method/process/process_internal.h"
#include "tests/test.h"

#define WIDTH  96
#define HEIGHT 64
#define GAPS   200  /* width of the view with gaps: more than twice the reach */
#define FAR    6400 /* 1/64 px: no view shows a surface of another one there */

/* Views of a grey wall of disparity 0. */
static void wall(struct sst_lightfield *lf, int side, int width, int height)
{
    assert_int_equal(sst_lightfield_init(lf, side, side), 0);
    lf->width = width;
    lf->height = height;
    for (int k = 0; k < side * side; k++) {
        struct sst_view *v = &lf->views[k];

        v->present = true;
        v->bx = k % side - lf->ref_view % side;
        v->by = k / side - lf->ref_view / side;
        assert_int_equal(sst_image_init(&v->image, width, height), 0);
        assert_int_equal(sst_map_u16_init(&v->disp, width, height), 0);
        assert_int_equal(sst_map_u8_init(&v->label, width, height), 0);
        for (int y = 0; y < height; y++) {
            for (int c = 0; c < 3; c++)
                memset(sst_image_row(&v->image, c, y), 100, (size_t)width);
            memset(sst_map_u16_row(&v->disp, y), 0, (size_t)width * sizeof(uint16_t));
            memset(sst_map_u8_row(&v->label, y), SST_LABEL_NONE, (size_t)width);
        }
    }
}

static void set_disparity(struct sst_view *v, int from_row, uint16_t d)
{
    for (int y = from_row; y < v->disp.height; y++) {
        for (int x = 0; x < v->disp.width; x++)
            sst_map_u16_row(&v->disp, y)[x] = d;
    }
}

static int choose(const struct sst_lightfield *lf, int least, bool *carried)
{
    int labelled, again;
    bool other[SST_MAX_VIEWS];

    assert_int_equal(process_choose_labelled(carried, &labelled, lf, least, 2), 0);
    assert_int_equal(process_choose_labelled(other, &again, lf, least, 1), 0);
    assert_memory_equal(carried, other, (size_t)(lf->rows * lf->cols) * sizeof(*carried));
    assert_int_equal(labelled, again);
    return labelled;
}

static void test_least(void **state SST_UNUSED)
{
    bool carried[SST_MAX_VIEWS];
    struct sst_lightfield lf;

    wall(&lf, 6, WIDTH, HEIGHT);
    assert_int_equal(choose(&lf, 1, carried), 1); /* shows all */
    assert_false(carried[lf.ref_view]);
    assert_int_equal(choose(&lf, 5, carried), 5); /* views far from each other */
    assert_false(carried[lf.ref_view] || carried[0] || carried[5] || carried[30] || carried[35]);
    assert_int_equal(choose(&lf, 36, carried), 12);
    lf.views[35].present = false;
    choose(&lf, 5, carried);
    assert_true(carried[35]);
    lf.views[35].present = true;
    sst_lightfield_fini(&lf);
}

static void test_shown(void **state SST_UNUSED)
{
    bool carried[SST_MAX_VIEWS];
    struct sst_lightfield lf;
    int right = 0;

    wall(&lf, 6, WIDTH, HEIGHT);
    for (int k = 0; k < 36; k++) {
        if (k % 6 >= 3) /* a surface that the left half does not show, below */
            set_disparity(&lf.views[k], HEIGHT / 2, FAR);
        if (k % 6 >= 3)
            lf.views[k].bx = lf.views[k].by = 0; /* where it is seen at the same place */
    }
    assert_int_equal(choose(&lf, 1, carried), 2);
    for (int k = 0; k < 36; k++)
        right += !carried[k] && k % 6 >= 3;
    assert_int_equal(right, 1);

    set_disparity(&lf.views[1], 0, FAR / 2); /* alone: 1/36 of all */
    assert_int_equal(choose(&lf, 1, carried), 3);
    assert_false(carried[1]);
    sst_lightfield_fini(&lf);
}

/* Views that have nothing in common are all labelled, though a third is as many as are chosen otherwise. */
static void test_apart(void **state SST_UNUSED)
{
    bool carried[SST_MAX_VIEWS];
    struct sst_lightfield lf;

    wall(&lf, 3, WIDTH, HEIGHT);
    for (int k = 0; k < 9; k++)
        set_disparity(&lf.views[k], 0, (uint16_t)(FAR + 100 * k));
    assert_int_equal(choose(&lf, 1, carried), 9);
    for (int k = 0; k < 9; k++) /* five sixths are shared: a third of the views is enough */
        set_disparity(&lf.views[k], 0, 0);
    for (int k = 0; k < 9; k++)
        set_disparity(&lf.views[k], HEIGHT - HEIGHT / 6, (uint16_t)(FAR + 100 * k));
    assert_int_equal(choose(&lf, 1, carried), 3);
    sst_lightfield_fini(&lf);
}

/* Nothing in any raw frame: no view shows more than none, an absent one is not chosen. */
static void test_nothing_seen(void **state SST_UNUSED)
{
    bool carried[SST_MAX_VIEWS];
    struct sst_lightfield lf;

    wall(&lf, 3, WIDTH, HEIGHT);
    for (int k = 0; k < 9; k++)
        assert_int_equal(sst_map_u8_init(&lf.views[k].valid, WIDTH, HEIGHT), 0);
    lf.views[0].present = false;
    assert_int_equal(choose(&lf, 1, carried), 1);
    assert_true(carried[0] && !carried[lf.ref_view]);
    lf.views[0].present = true;
    sst_lightfield_fini(&lf);
}

static void test_differ(void **state SST_UNUSED)
{
    const bool carried[4] = { false, true, true, false };
    struct sst_map_f32 entropy[4] = { 0 };
    struct sst_lightfield lf;

    wall(&lf, 2, WIDTH, HEIGHT);
    assert_true(process_labels_differ(&lf, carried, NULL, 0) == 0); /* none */
    for (int k = 0; k < 4; k++) {
        assert_int_equal(sst_map_f32_init(&entropy[k], WIDTH, HEIGHT), 0);
        for (int y = 0; y < HEIGHT; y++) {
            memset(sst_map_u8_row(&lf.views[k].label, y), 1 + (k == 3 && y >= HEIGHT / 2), WIDTH);
            for (int x = 0; x < WIDTH; x++)
                sst_map_f32_row(&entropy[k], y)[x] = y < HEIGHT / 4 ? 1 : 0.1f;
        }
    }
    assert_true(fabs(process_labels_differ(&lf, carried, NULL, 0) - 0.5) < 0.05);
    assert_true(fabs(process_labels_differ(&lf, carried, entropy, 0.5) - 2 / 3.0) < 0.05);
    for (int k = 0; k < 4; k++)
        sst_map_f32_fini(&entropy[k]);
    sst_lightfield_fini(&lf);
}

static void set(struct sst_view *v, int x, int y, uint8_t label, uint8_t grey, uint16_t d)
{
    for (int c = 0; c < 3; c++)
        sst_image_row(&v->image, c, y)[x] = grey;
    sst_map_u8_row(&v->label, y)[x] = label;
    sst_map_u16_row(&v->disp, y)[x] = d;
}

static void test_gaps(void **state SST_UNUSED)
{
    struct sst_lightfield lf;
    struct sst_view *v;

    wall(&lf, 1, GAPS, 5);
    v = &lf.views[0];
    set(v, 0, 2, 1, 130, 0);   /* in the row, another colour, the disparity of the gap */
    set(v, 12, 1, 2, 101, 64); /* on the diagonal of (13, 2) */
    set(v, 8, 4, 3, 110, 0);   /* on the label of (10, 2) */
    set(v, 13, 0, 4, 101, 40); /* above it, by the same vote, at the nearer disparity */
    set(v, GAPS - 1, 2, 5, 130, 200);
    set(v, 30, 1, 6, 100, 51); /* the colour of the gap, but more than a quarter of 0..200 away */
    set(v, 32, 4, 7, 120, 50);
    assert_int_equal(sst_map_u8_init(&v->valid, GAPS, 5), 0);
    for (int y = 0; y < 5; y++)
        memset(sst_map_u8_row(&v->valid, y), 255, GAPS);
    sst_map_u8_row(&v->valid, 2)[11] = 0;
    sst_map_u8_row(&v->valid, 2)[3] = 0;
    assert_int_equal(process_fill_labels(v), 0);
    assert_int_equal(sst_map_u8_row(&v->label, 2)[0], 1);
    assert_int_equal(sst_map_u8_row(&v->label, 2)[3], 0); /* outside the raw frame */
    assert_int_equal(sst_map_u8_row(&v->label, 2)[10], 3);
    assert_int_equal(sst_map_u8_row(&v->label, 2)[11], 0);
    assert_int_equal(sst_map_u8_row(&v->label, 2)[13], 4);
    assert_int_equal(sst_map_u8_row(&v->label, 2)[30], 7);
    assert_int_equal(sst_map_u8_row(&v->label, 2)[64], 1);
    assert_int_equal(sst_map_u8_row(&v->label, 2)[100], 1); /* out of reach: the nearer disparity of the row */
    assert_int_equal(sst_map_u8_row(&v->label, 2)[GAPS - 2], 5);
    assert_int_equal(sst_map_u8_row(&v->label, 3)[100], 0); /* nothing in any direction */
    sst_lightfield_fini(&lf);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_least),        cmocka_unit_test(test_shown),  cmocka_unit_test(test_apart),
        cmocka_unit_test(test_nothing_seen), cmocka_unit_test(test_differ), cmocka_unit_test(test_gaps),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
