/* Live views that a device rectifies, on the dummy device: the bytes of the CPU in every set, also where views come and
 * go, where there is little room, and where the device fails. */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <linux/videodev2.h>

#include "pipeline/live/live.h"
#include "simulators/scene/noise.h"
#include "tests/small.h"

#define WIDTH  104 /* no multiple of tiles */
#define HEIGHT 74
#define SIDE   3
#define VIEWS  (SIDE * SIDE)

static struct sst_use_calibration calibrated;

/* Cameras that are turned a little, with lenses; some see less light at their edges. */
static void make_calibration(void)
{
    struct sst_calib *c = &calibrated.calib;

    sst_use_calibration_defaults(&calibrated);
    assert_int_equal(sst_calib_init(c, SIDE, SIDE), 0);
    c->width = WIDTH;
    c->height = HEIGHT;
    for (int k = 0; k < VIEWS; k++) {
        struct sst_calib_camera *cam = &c->camera[k];

        cam->known = true;
        cam->fx = cam->fy = 90;
        cam->cx = (WIDTH - 1) / 2.0;
        cam->cy = (HEIGHT - 1) / 2.0;
        cam->lens = 5;
        cam->k[0] = 0.05;
        cam->falloff[0] = k % 2 ? -0.2 : 0;
        cam->position_mm[0] = 40 * (k % SIDE - c->reference % SIDE);
        cam->position_mm[1] = 40 * (k / SIDE - c->reference / SIDE);
        sst_rotation_from_vector((const double[3]){ 0.01 * (k % 3), -0.01 * (k % 5), 0.02 * (k % 2) }, cam->rotation);
    }
}

struct input {
    struct sst_live_input in;
    uint8_t data[VIEWS][2 * WIDTH * HEIGHT]; /* YUYV */
};

/* A pattern that stays, with a rectangle of another one that moves. */
static void paint(struct input *s, int set)
{
    const int left = set * 17 % WIDTH, top = set * 11 % HEIGHT;

    memset(&s->in, 0, sizeof(s->in));
    s->in.set = (uint64_t)set;
    s->in.t_ns = (set + 1) * INT64_C(300000000);
    for (int k = 0; k < VIEWS; k++) {
        uint64_t still = (uint64_t)k + 5, moving = (uint64_t)(set * VIEWS + k) + 99;

        for (int i = 0; i < WIDTH * HEIGHT; i++) {
            const int x = i % WIDTH, y = i / WIDTH;
            const bool in = set && x >= left && x < left + 30 && y >= top && y < top + 22;
            const uint64_t a = sst_random_u64(&still), b = sst_random_u64(&moving), r = in ? b : a;

            s->data[k][2 * i] = (uint8_t)((x / 8 + y / 8) % 2 * 90 + (int)(r % 60) + 40);
            s->data[k][2 * i + 1] = (uint8_t)(110 + (r >> 8) % 40);
        }
        s->in.frame[k].data = s->data[k];
        s->in.frame[k].bytes = sizeof(s->data[k]);
    }
    if (set >= 6 && set < 16) /* long enough to leave */
        s->in.frame[7].data = NULL;
}

struct side {
    struct sst_live *live;
    struct sst_livepicture *picture;
    int64_t decodes;
};

static void open_side(struct side *s, const char *device, uint64_t memory_bytes)
{
    struct sst_live_config cfg = { .rows = SIDE,
                                   .cols = SIDE,
                                   .fourcc = V4L2_PIX_FMT_YUYV,
                                   .width = WIDTH,
                                   .height = HEIGHT,
                                   .calibration = &calibrated,
                                   .range_min_px = 0,
                                   .range_max_px = 12,
                                   .threads = 2,
                                   .skip_change = true,
                                   .device = device,
                                   .device_memory_bytes = memory_bytes };

    for (int k = 0; k < VIEWS; k++)
        cfg.present[k] = true;
    *s = (struct side){ NULL };
    assert_int_equal(sst_live_open(&s->live, &cfg), 0);
    assert_int_equal(sst_livepicture_create(&s->picture, s->live), 0);
}

static void close_side(struct side *s)
{
    sst_livepicture_destroy(s->picture);
    sst_live_close(s->live);
}

static const struct sst_image *show(struct side *s, const struct sst_live_input *in, int set)
{
    struct sst_live_report *report = calloc(1, sizeof(*report));
    const struct sst_image *image = NULL;
    struct sst_render_config cfg;
    int64_t rendered_px;

    assert_non_null(report);
    assert_int_equal(sst_live_update(s->live, in, report), 0);
    s->decodes += report->decodes;
    free(report);
    sst_render_config_defaults(&cfg);
    cfg.method = set % 3 == 0 ? SST_RENDER_REFOCUS : set % 3 == 1 ? SST_RENDER_CLEAR : SST_RENDER_SST;
    cfg.focus_px = 4.3;
    cfg.cut_px = 8;
    assert_int_equal(sst_livepicture_render(s->picture, &cfg, &image, &rendered_px), 0);
    return image;
}

static void assert_same(const struct sst_image *a, const struct sst_image *b, int set)
{
    for (int c = 0; c < 3; c++) {
        for (int y = 0; y < a->height; y++) {
            if (memcmp(sst_image_row(a, c, y), sst_image_row(b, c, y), (size_t)a->width))
                fail_msg("set %d: row %d differs", set, y);
        }
    }
}

/* Compare all views and pictures of some sets. */
static void follow(const char *device, uint64_t memory_bytes, int sets, struct sst_render_device_report *report)
{
    struct input *input = calloc(1, sizeof(*input));
    struct side cpu, gpu;

    assert_non_null(input);
    open_side(&cpu, NULL, 0);
    open_side(&gpu, device, memory_bytes);
    for (int set = 0; set < sets; set++) {
        const struct sst_lightfield *a = sst_live_lightfield(cpu.live), *b = sst_live_lightfield(gpu.live);
        const struct sst_image *want, *got;

        paint(input, set);
        want = show(&cpu, &input->in, set);
        got = show(&gpu, &input->in, set);
        for (int k = 0; k < VIEWS; k++)
            assert_same(&a->views[k].image, &b->views[k].image, set);
        assert_same(want, got, set);
    }
    assert_true(sst_live_device(gpu.live, report));
    assert_true(gpu.decodes > sets);
    assert_int_equal(report->rectified + report->rectified_on_cpu, gpu.decodes);
    print_message("%s: %d views rectified, %d on the CPU; %d pictures, %d on the CPU; %d failures; %.1f MB\n", device,
                  (int)report->rectified, (int)report->rectified_on_cpu, (int)report->pictures, (int)report->on_cpu,
                  (int)report->failures, 1e-6 * (double)report->upload_bytes);
    close_side(&cpu);
    close_side(&gpu);
    free(input);
}

#define SETS 20

/* All views there, or a few at a time. */
static void views_are_those_of_the_cpu(void **state SST_UNUSED)
{
    static const uint64_t memory[] = { 0, 1600000, 2000000 };
    struct sst_render_device_report report;

    for (size_t i = 0; i < ARRAY_LEN(memory); i++) {
        follow("dummy", memory[i], SETS, &report);
        assert_int_equal(report.rectified_on_cpu, 0);
        assert_int_equal(report.on_cpu, 0);
        assert_int_equal(report.failures, 0);
        assert_int_equal(report.pictures, SETS);
    }
}

/* Where frames do not fit, or a shader is refused, the CPU rectifies; pictures are made there. */
static void what_a_device_cannot_do_is_the_cpus(void **state SST_UNUSED)
{
    static const struct {
        const char *name;
        uint64_t memory;
        const char *why;
    } devices[] = { { "dummy", 700000, "a device needs room for the raw frames" },
                    { "dummy:wrong=14", 0, "the shader that rectifies is refused" },
                    { "dummy:wrong=17", 0, "the shader that rectifies is refused" } };
    struct sst_render_device_report report;

    for (size_t i = 0; i < ARRAY_LEN(devices); i++) {
        follow(devices[i].name, devices[i].memory, 5, &report);
        assert_int_equal(report.rectified, 0);
        assert_string_equal(report.why_rectified, devices[i].why);
        assert_int_equal(report.failures, 0);
        assert_int_equal(report.pictures, 5);
    }
}

/* Lost or silent again and again, while it rectifies or renders: no set is lost. */
static void a_device_that_fails_costs_no_set(void **state SST_UNUSED)
{
    static const char *const devices[] = { "dummy:lost=19", "dummy:lost=60", "dummy:timeout=75", "dummy:lost=100" };
    struct sst_render_device_report report;

    for (size_t i = 0; i < ARRAY_LEN(devices); i++) {
        follow(devices[i], 0, SETS, &report);
        assert_true(report.failures > 0);
        assert_true(report.rectified_on_cpu > 0);
        assert_int_equal(report.pictures + report.on_cpu, SETS);
        assert_true(*report.why_rectified);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(views_are_those_of_the_cpu),
        cmocka_unit_test(what_a_device_cannot_do_is_the_cpus),
        serial_test(a_device_that_fails_costs_no_set),
    };

    setenv("VK_DRIVER_FILES", "/dev/null", 1);
    make_calibration();
    return cmocka_run_group_tests(tests, NULL, NULL);
}
