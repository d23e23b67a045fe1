/* Filled pixels of outlines, which nearer surfaces beside them have, and pixels that keep their filled disparity. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <string.h>

#include "pipeline/method/disparity/visible.h"
#include "tests/small.h"

enum { W = 48, H = 3, VIEWS = 5, FRONT = 8, LEFT = 20, RIGHT = 24, OUTLINE = RIGHT };

/* A dark front in x LEFT .. RIGHT - 1 of view 0, on light ground of disparity 0; its outline is filled as ground. */
struct field {
    struct sst_image image[VIEWS];
    struct sst_map_u16 filled[VIEWS];
    struct sst_map_u8 status[VIEWS], agreed[VIEWS];
    struct sst_visible_view view[VIEWS];
    struct sst_visible_views all;
};

static void paint(struct field *f, int k, int x, uint8_t level)
{
    for (int c = 0; c < 3; c++) {
        for (int y = 0; y < H; y++)
            sst_image_row(&f->image[k], c, y)[x] = level;
    }
}

static void field_init(struct field *f)
{
    *f = (struct field){ .all = { .view = f->view, .count = VIEWS, .scale = 1, .range = 16 } };
    for (int k = 0; k < VIEWS; k++) {
        assert_int_equal(sst_image_init(&f->image[k], W, H), 0);
        assert_int_equal(sst_map_u16_init(&f->filled[k], W, H), 0);
        assert_int_equal(sst_map_u8_init(&f->status[k], W, H), 0);
        assert_int_equal(sst_map_u8_init(&f->agreed[k], W, H), 0);
        f->view[k] = (struct sst_visible_view){
            .image = &f->image[k], .disp = &f->filled[k], .bx = k < 3 ? k : 2 - k, .agreed = &f->agreed[k]
        };
        for (int y = 0; y < H; y++) {
            memset(sst_map_u16_row(&f->filled[k], y), 0, W * sizeof(uint16_t));
            memset(sst_map_u8_row(&f->status[k], y), SST_DISPARITY_CORRECT, W);
            memset(sst_map_u8_row(&f->agreed[k], y), 255, W);
        }
        for (int x = 0; x < W; x++) {
            const int from = x + FRONT * (int)f->view[k].bx;
            const bool front = from >= LEFT && from < RIGHT;

            paint(f, k, x, front ? 20 : from == OUTLINE ? 70 : 220);
            for (int y = 0; y < H && front; y++)
                sst_map_u16_row(&f->filled[k], y)[x] = 64 * FRONT;
        }
    }
    for (int y = 0; y < H; y++)
        sst_map_u8_row(&f->status[0], y)[OUTLINE] = SST_DISPARITY_OCCLUSION;
}

static void field_fini(struct field *f)
{
    for (int k = 0; k < VIEWS; k++) {
        sst_image_fini(&f->image[k]);
        sst_map_u16_fini(&f->filled[k]);
        sst_map_u8_fini(&f->status[k]);
        sst_map_u8_fini(&f->agreed[k]);
    }
}

/* Disparity of view 0 beside the front, px. */
static int outline(struct field *f)
{
    assert_int_equal(sst_disparity_lift(&f->all, f->filled, f->status, 2), 0);
    assert_int_equal(sst_map_u16_row(&f->filled[0], 1)[OUTLINE + 1], 0);
    assert_int_equal(sst_map_u16_row(&f->filled[0], 1)[LEFT], 64 * FRONT);
    return sst_map_u16_row(&f->filled[0], 1)[OUTLINE] / 64;
}

static void filled_outlines_are_of_what_they_look_like(void **state SST_UNUSED)
{
    struct field f;

    field_init(&f);
    assert_int_equal(outline(&f), FRONT);
    field_fini(&f);
}

static void colours_of_the_ground_stay_there(void **state SST_UNUSED)
{
    struct field f;

    field_init(&f);
    paint(&f, 0, OUTLINE, 190); /* more like the ground than like the front */
    assert_int_equal(outline(&f), 0);
    for (int k = 1; k < VIEWS; k++) /* dark ground */
        paint(&f, k, OUTLINE, 70);
    paint(&f, 0, OUTLINE, 70);
    assert_int_equal(outline(&f), 0);
    field_fini(&f);
}

static void pixels_without_doubt_stay(void **state SST_UNUSED)
{
    struct field f;

    field_init(&f);
    for (int y = 0; y < H; y++)
        sst_map_u8_row(&f.status[0], y)[OUTLINE] = SST_DISPARITY_CORRECT;
    assert_int_equal(outline(&f), 0);
    for (int y = 0; y < H; y++) /* the sweep did not settle it */
        sst_map_u8_row(&f.agreed[0], y)[OUTLINE] = 0;
    assert_int_equal(outline(&f), FRONT);
    field_fini(&f);
}

/* No view shows the place: the filled disparity stays. Missing views and cancelling. */
static void what_no_view_shows_stays(void **state SST_UNUSED)
{
    SST_ATOMIC(bool) cancel = true;
    struct field f;

    field_init(&f);
    for (int k = 1; k < VIEWS; k++)
        f.view[k].image = NULL;
    assert_int_equal(outline(&f), 0);
    f.view[1].image = &f.image[1];
    f.all.cancel = &cancel;
    assert_int_equal(sst_disparity_lift(&f.all, f.filled, f.status, 1), -ECANCELED);
    assert_int_equal(sst_map_u16_row(&f.filled[0], 1)[OUTLINE], 0);
    f.all.cancel = NULL;
    assert_int_equal(outline(&f), FRONT);
    field_fini(&f);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(filled_outlines_are_of_what_they_look_like),
        cmocka_unit_test(colours_of_the_ground_stay_there),
        cmocka_unit_test(pixels_without_doubt_stay),
        cmocka_unit_test(what_no_view_shows_stays),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
