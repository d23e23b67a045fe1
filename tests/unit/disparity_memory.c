/* Memory of matching: views at fractional offsets, whose census has sixteen phases, stay within a limit, with the
 * same maps as without. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdint.h>
#include <string.h>
#include <sys/resource.h>

#include "pipeline/method/disparity/stage.h"
#include "tests/small.h"
#include "tests/test.h"

#define SIDE  5
#define WIDTH 320
#define STEPS (12 * 4 + 1) /* quarter pixels in a range of 12 px */

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define COUNTED false /* freed memory is not used again */
#define HEIGHT  48
#else
#define COUNTED true
#define HEIGHT  120
#endif

static size_t peak(void)
{
    struct rusage used;

    assert_int_equal(getrusage(RUSAGE_SELF, &used), 0);
    return (size_t)used.ru_maxrss * 1024;
}

static struct sst_lightfield field(void)
{
    struct sst_lightfield lf;
    uint32_t state = 1;

    assert_int_equal(sst_lightfield_init(&lf, SIDE, SIDE), 0);
    lf.width = WIDTH;
    lf.height = HEIGHT;
    for (int k = 0; k < SIDE * SIDE; k++) {
        struct sst_view *v = &lf.views[k];

        v->present = true;
        v->bx += 0.13 * (k % 4);
        v->by += 0.17 * (k % 3);
        assert_int_equal(sst_image_init(&v->image, WIDTH, HEIGHT), 0);
        for (int y = 0; y < 3 * HEIGHT; y++) {
            for (int x = 0; x < WIDTH; x++) {
                state = state * 1664525U + 1013904223U;
                sst_image_row(&v->image, y % 3, y / 3)[x] = (uint8_t)(state >> 24);
            }
        }
    }
    return lf;
}

static struct sst_lightfield matched(size_t memory)
{
    struct sst_disparity_config cfg;
    struct sst_lightfield lf = field();

    assert_int_equal(sst_disparity_preset(&cfg, "balanced"), 0);
    cfg.disp_min_px = -4;
    cfg.disp_max_px = 8;
    cfg.rounds = cfg.subpixel_steps = cfg.key_spacing = 0;
    cfg.threads = 2;
    cfg.memory = memory;
    assert_int_equal(sst_disparity_lightfield(&lf, &cfg, NULL, NULL), 0);
    return lf;
}

static void census_within_a_limit(void **state SST_UNUSED)
{
    const size_t plane = sst_mem_stride(WIDTH, 8) * HEIGHT, volume = sst_volume_bytes(WIDTH, HEIGHT, STEPS);
    /* A volume, all phases of twelve neighbours and the own census; maps of all views, 16 bytes a pixel. */
    const size_t bound = volume + (SST_PHASES * SST_MAX_NEIGHBOURS + 1) * plane + SIDE * SIDE * 16 * WIDTH * HEIGHT;
    const size_t census = SIDE * SIDE * SST_PHASES * plane, before = peak();
    struct sst_lightfield little = matched(1), much;
    const size_t least = peak() - before;

    much = matched(0);
    if (COUNTED) {
        print_message("peak %zu MB in %zu MB; without a limit %zu MB\n", least >> 20, bound >> 20,
                      (peak() - before) >> 20);
        assert_true(least < bound);
        assert_true(peak() - before > census + 2 * volume); /* a limit is worth it */
        assert_true(bound < census + 2 * volume);
    }
    for (int k = 0; k < SIDE * SIDE; k++) {
        for (int y = 0; y < HEIGHT; y++) {
            assert_memory_equal(sst_map_u16_row(&little.views[k].disp, y), sst_map_u16_row(&much.views[k].disp, y),
                                WIDTH * sizeof(uint16_t));
            assert_memory_equal(sst_map_u8_row(&little.views[k].confidence, y),
                                sst_map_u8_row(&much.views[k].confidence, y), WIDTH);
        }
    }
    sst_lightfield_fini(&little);
    sst_lightfield_fini(&much);
}

int main(void)
{
    const struct CMUnitTest tests[] = { cmocka_unit_test(census_within_a_limit) };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
