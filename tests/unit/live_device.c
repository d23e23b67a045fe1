/* Live pictures on the dummy device against those of the CPU, of a light field that changes: whole and in parts, all
 * methods; devices that fail, come back, or are not there. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "simulators/scene/noise.h"
#include "tests/live_shown.h"
#include "tests/render_tests.h"
#include "tests/small.h"

#define WIDTH  100 /* no side is a multiple of tiles, cells or groups */
#define HEIGHT 75
#define SIDE   3
#define VIEWS  (SIDE * SIDE)

/* The same light field twice. */
struct pair {
    struct shown cpu, gpu;
    struct sst_livepicture *on_cpu, *on_gpu;
};

static void open_pair(struct pair *p, const char *device, uint64_t memory_bytes)
{
    show(&p->cpu, "bush", WIDTH, HEIGHT, SIDE, false);
    show(&p->gpu, "bush", WIDTH, HEIGHT, SIDE, false);
    assert_int_equal(live_use_device(p->gpu.live, device, memory_bytes), 0);
    assert_int_equal(sst_livepicture_create(&p->on_cpu, p->cpu.live), 0);
    assert_int_equal(sst_livepicture_create(&p->on_gpu, p->gpu.live), 0);
    take(&p->cpu, 1000000);
    take(&p->gpu, 1000000);
}

static void close_pair(struct pair *p)
{
    sst_livepicture_destroy(p->on_cpu);
    sst_livepicture_destroy(p->on_gpu);
    hide(&p->cpu);
    hide(&p->gpu);
}

/* Other pixels and maps in some tiles of some views. */
static void change(struct shown *s, int set)
{
    struct sst_lightfield *lf = &s->live->lf;
    uint64_t seed = (uint64_t)set;

    for (int n = 0; n < 3; n++) {
        const int view = (int)(sst_random_u64(&seed) % VIEWS);
        const int tile = (int)(sst_random_u64(&seed) % (unsigned)(s->changes.cols * s->changes.rows));
        const int x0 = tile % s->changes.cols * SST_LIVE_TILE, y0 = tile / s->changes.cols * SST_LIVE_TILE;
        struct sst_view *v = &lf->views[view];

        s->changes.map[view][tile] = 1;
        for (int y = y0; y < sst_min_int(y0 + SST_LIVE_TILE, HEIGHT); y++) {
            for (int x = x0; x < sst_min_int(x0 + SST_LIVE_TILE, WIDTH); x++) {
                const uint64_t r = sst_random_u64(&seed);

                for (int c = 0; c < 3; c++)
                    sst_image_row(&v->image, c, y)[x] = (uint8_t)(r >> (8 * c));
                sst_map_u16_row(&v->disp, y)[x] = r % 17 ? (uint16_t)(r >> 8) % 700 : SST_DISP_NONE;
                if (v->label.data)
                    sst_map_u8_row(&v->label, y)[x] = (uint8_t)((r >> 28) % 12);
            }
        }
    }
    take(s, 1000000 + set * INT64_C(100000000));
}

static void compare(struct pair *p, const struct sst_render_config *cfg)
{
    const struct sst_image *want, *got;
    int64_t want_px, got_px;

    assert_int_equal(sst_livepicture_render(p->on_cpu, cfg, &want, &want_px), 0);
    assert_int_equal(sst_livepicture_render(p->on_gpu, cfg, &got, &got_px), 0);
    assert_true(same_image(want, got));
    assert_int_equal(want_px > 0, got_px > 0);
}

/* Settings that use all that a device renders. */
static struct sst_render_config settings(int i)
{
    struct sst_render_config cfg;

    sst_render_config_defaults(&cfg);
    cfg.focus_px = 8.43;
    cfg.method = i == 0 ? SST_RENDER_REFOCUS : i == 3 ? SST_RENDER_CLEAR : SST_RENDER_SST;
    if (i == 2) {
        cfg.verify = SST_VERIFY_ON;
        cfg.sigma_px = 0.3;
        cfg.c1 = cfg.c2 = 0.001;
    }
    if (i == 3)
        cfg.cut_px = 12;
    return cfg;
}

#define SETTINGS 4

static void all_sets_have_the_cpus_picture(void **state SST_UNUSED)
{
    static const uint64_t memory[] = { 0, 600000 }; /* all views; a few at a time */
    struct sst_render_device_report report;
    struct pair p;

    for (size_t m = 0; m < ARRAY_LEN(memory); m++) {
        int set = 1;

        open_pair(&p, m ? "dummy:known=1" : "dummy", memory[m]);
        p.cpu.live->low_confidence = p.gpu.live->low_confidence = true;
        for (int i = 0; i < SETTINGS; i++) {
            const struct sst_render_config cfg = settings(i);

            for (int k = 0; k < 5; k++) {
                compare(&p, &cfg);
                change(&p.cpu, ++set);
                change(&p.gpu, set);
            }
        }
        assert_true(sst_live_device(p.gpu.live, &report));
        assert_string_equal(report.name, "dummy");
        assert_false(report.failing);
        assert_int_equal(report.failures, 0);
        assert_int_equal(report.pictures, 20);
        assert_int_equal(report.in_parts, m ? 5 : 0); /* clear ones */
        assert_int_equal(report.on_cpu, 0);
        assert_int_equal(report.verified_on_cpu, 0);
        close_pair(&p);
    }
}

/* Only changed tiles are uploaded. */
static void rows_that_changed_are_uploaded(void **state SST_UNUSED)
{
    const struct sst_render_config cfg = settings(0); /* a larger table of labels would come first again */
    struct sst_render_device_report all, some;
    struct pair p;

    open_pair(&p, "dummy:known=1", 0);
    compare(&p, &cfg);
    assert_true(sst_live_device(p.gpu.live, &all));
    assert_int_equal(all.uploads, VIEWS);
    compare(&p, &cfg); /* nothing changed: no picture */
    change(&p.cpu, 7);
    change(&p.gpu, 7);
    compare(&p, &cfg);
    assert_true(sst_live_device(p.gpu.live, &some));
    assert_int_equal(some.pictures, 2);
    assert_in_range(some.uploads - all.uploads, 1, 3);
    assert_in_range(some.upload_bytes - all.upload_bytes, 1, all.upload_bytes / VIEWS * 2);
    close_pair(&p);
}

/* Views leave and come back, other disparities are stored. */
static void what_is_on_the_device_follows_the_views(void **state SST_UNUSED)
{
    struct pair p;

    for (int i = 0; i < SETTINGS; i++) {
        const struct sst_render_config cfg = settings(i);

        open_pair(&p, "dummy:known=1", 0);
        compare(&p, &cfg);
        for (int step = 0; step < 4; step++) {
            struct shown *const of[] = { &p.cpu, &p.gpu };

            for (int j = 0; j < 2; j++) {
                struct sst_lightfield *lf = &of[j]->live->lf;

                if (step < 2)
                    lf->views[8].present = step == 1;
                if (step == 1) /* back without maps */
                    sst_map_u16_fini(&lf->views[8].disp);
                if (step == 1)
                    sst_map_u8_fini(&lf->views[8].label);
                if (step == 2)
                    lf->disp_min_px -= 1;
                if (step == 3)
                    set_scene(of[j], "bush", 1);
                take(of[j], step + 2);
            }
            compare(&p, &cfg);
        }
        close_pair(&p);
    }
}

/* Lost again and again: every set has its picture, that of the CPU. */
static void a_device_that_fails_costs_no_set(void **state SST_UNUSED)
{
    static const struct {
        const char *fault;
        int at; /* dispatch */
        const char *why;
    } devices[] = {
        { "lost", 4, "the device is lost" },
        { "timeout", 5, "the device does not answer" },
        { "lost", 1, "the device is lost" }, /* at every opening's first picture */
        { "buffer", 0, "not enough memory on the device" },
    };
    struct sst_render_device_report report;
    struct pair p;

    for (size_t d = 0; d < ARRAY_LEN(devices); d += small_level() >= 2 ? 2 : 1) { /* two fail in the same threads */
        const struct sst_render_config cfg = settings(1);
        int lost = 0, found = 0;
        bool failing = false;

        const char *name = devices[d].at ? render_fault(devices[d].fault, devices[d].at) : "dummy:known=1,buffer=25";

        open_pair(&p, name, 0);
        /* More sets where openings, on a thread of their own, take longer. */
        for (int set = 1; set < 40 || (d < 2 && found < 3 && set < 400); set++) {
            compare(&p, &cfg);
            assert_true(sst_live_device(p.gpu.live, &report));
            assert_int_equal(report.pictures + report.on_cpu, set);
            lost += report.failing && !failing;
            found += !report.failing && failing;
            failing = report.failing;
            change(&p.cpu, set);
            change(&p.gpu, set);
        }
        print_message("%s: %d pictures, %d on the CPU, %d failures; lost %d, found %d times\n", name,
                      (int)report.pictures, (int)report.on_cpu, (int)report.failures, lost, found);
        assert_non_null(strstr(report.failure, devices[d].why));
        /* Six where openings, on a thread of their own, take no longer than a picture. */
        assert_true(d < 2 ? report.failures >= 3 && found >= 3 && report.pictures >= 3 * found
                          : lost == 1 && !found && !report.pictures && report.failures >= 3 && report.failures <= 6);
        close_pair(&p);
    }
}

/* A device that is not there, computes something else, or is not wanted. */
static void without_a_device_pictures_are_the_cpus(void **state SST_UNUSED)
{
    static const char *const names[] = { "no such device", "dummy:late=1", "dummy:wrong=5" }, *const none[] = {
        "cpu", "auto"
    };
    const struct sst_render_config cfg = settings(1);
    struct sst_render_device_report report;
    struct pair p;

    for (size_t i = 0; i < ARRAY_LEN(names); i++) {
        open_pair(&p, names[i], 0);
        for (int set = 1; set < 5; set++) {
            compare(&p, &cfg);
            change(&p.cpu, set);
            change(&p.gpu, set);
        }
        assert_true(sst_live_device(p.gpu.live, &report));
        assert_string_equal(report.name, i == 2 ? "dummy:wrong=5" : names[i]);
        assert_true(report.failing && *report.failure);
        assert_int_equal(report.pictures, 0);
        assert_int_equal(report.on_cpu, 4);
        assert_in_range(report.failures, i == 2 ? 1 : 2,
                        i == 2 ? 1 : 3); /* one that computes something else is not tried again */
        close_pair(&p);
    }
    for (size_t i = 0; i < ARRAY_LEN(none); i++) {
        open_pair(&p, none[i], 0);
        compare(&p, &cfg);
        assert_false(sst_live_device(p.gpu.live, &report));
        close_pair(&p);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        serial_test(all_sets_have_the_cpus_picture),          serial_test(rows_that_changed_are_uploaded),
        serial_test(what_is_on_the_device_follows_the_views), cmocka_unit_test(a_device_that_fails_costs_no_set),
        serial_test(without_a_device_pictures_are_the_cpus),
    };

    setenv("VK_DRIVER_FILES", "/dev/null", 1);
    return cmocka_run_group_tests(tests, NULL, NULL);
}
