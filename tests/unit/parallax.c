/* pipeline/lightfield/parallax: views that differ by noise, gain or overlaid text only have no parallax. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/lightfield/parallax.h"
#include "tests/random.h"
#include "tests/test.h"

#define W 240
#define H 180

/* Texture of a few waves and cells at a place of the scene. */
static double texture(double x, double y)
{
    return 120 + 30 * sin(x / 5 + 2 * sin(y / 9)) + 30 * sin(y / 4 + 2 * sin(x / 11)) + 15 * sin((x + y) / 2.5);
}

struct field {
    double far_px, near_px; /* disparities; near: in a disc of this radius in the middle */
    double near_radius, noise, gain_step, contrast;
    bool text; /* each view has other cells in its upper rows */
};

static void make(struct sst_lightfield *lf, const struct field *f)
{
    uint64_t seed = 7;

    assert_int_equal(sst_lightfield_init(lf, 3, 3), 0);
    lf->width = W;
    lf->height = H;
    for (int k = 0; k < 9; k++) {
        struct sst_view *v = &lf->views[k];

        v->present = true;
        assert_int_equal(sst_image_init(&v->image, W, H), 0);
        for (int i = 0; i < W * H; i++) {
            const int x = i % W, y = i / W;
            const double nx = x + f->near_px * v->bx, ny = y + f->near_px * v->by;
            const bool near = hypot(nx - W / 2, ny - H / 2) < f->near_radius;
            const double d = near ? f->near_px : f->far_px;
            double g = 120 + f->contrast * (texture(x + d * v->bx + 500 * near, y + d * v->by) - 120);

            if (f->text && y < 24)
                g = ((k + 1) * 2654435761u >> (x / 8 + y / 8) % 29) & 1 ? 240 : 16;
            g = g * (1 + f->gain_step * (k - 4)) + f->noise * test_normal(&seed);
            for (int c = 0; c < 3; c++)
                sst_image_row(&v->image, c, y)[x] = (uint8_t)lround(fmin(fmax(g, 0), 255));
        }
    }
}

static enum sst_parallax parallax(struct field f)
{
    struct sst_lightfield lf;
    enum sst_parallax result;

    if (!(f.contrast > 0))
        f.contrast = 1;
    make(&lf, &f);
    result = sst_lightfield_parallax(&lf, NULL);
    sst_lightfield_fini(&lf);
    return result;
}

static void one_picture_has_none(void **state SST_UNUSED)
{
    assert_int_equal(parallax((struct field){ 0 }), SST_PARALLAX_NONE);
    assert_int_equal(parallax((struct field){ .noise = 3 }), SST_PARALLAX_NONE);
    assert_int_equal(parallax((struct field){ .noise = 12 }), SST_PARALLAX_NONE);
    assert_int_equal(parallax((struct field){ .noise = 3, .gain_step = 0.02 }), SST_PARALLAX_NONE);
    assert_int_equal(parallax((struct field){ .noise = 2, .text = true }), SST_PARALLAX_NONE);
    assert_int_equal(parallax((struct field){ .noise = 2, .far_px = 0.04 }), SST_PARALLAX_NONE);
}

static void small_and_partial_parallax_is_seen(void **state SST_UNUSED)
{
    assert_int_equal(parallax((struct field){ .noise = 3, .far_px = 0.3 }), SST_PARALLAX_SEEN);
    assert_int_equal(parallax((struct field){ .noise = 3, .far_px = -0.3 }), SST_PARALLAX_SEEN);
    assert_int_equal(parallax((struct field){ .noise = 3, .far_px = 3, .near_px = 9, .near_radius = 40 }),
                     SST_PARALLAX_SEEN);
    assert_int_equal(parallax((struct field){ .noise = 8, .far_px = 20 }), SST_PARALLAX_SEEN);
    /* Converged on the wall: a twentieth of the picture moves. */
    assert_int_equal(parallax((struct field){ .noise = 3, .near_px = 6, .near_radius = 27 }), SST_PARALLAX_SEEN);
    assert_int_equal(parallax((struct field){ .noise = 3, .near_px = -6, .near_radius = 27 }), SST_PARALLAX_SEEN);
}

static void without_texture_nothing_is_known(void **state SST_UNUSED)
{
    struct sst_lightfield lf;

    assert_int_equal(parallax((struct field){ .contrast = 1e-3 }), SST_PARALLAX_UNKNOWN);
    assert_int_equal(parallax((struct field){ .contrast = 1e-3, .noise = 20 }), SST_PARALLAX_UNKNOWN);
    make(&lf, &(struct field){ .contrast = 1 });
    for (int k = 0; k < 9; k++)
        lf.views[k].present = k == lf.ref_view;
    assert_int_equal(sst_lightfield_parallax(&lf, NULL), SST_PARALLAX_UNKNOWN);
    sst_lightfield_fini(&lf);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(one_picture_has_none),
        cmocka_unit_test(small_and_partial_parallax_is_seen),
        cmocka_unit_test(without_texture_nothing_is_known),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
