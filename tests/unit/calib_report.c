/* pipeline/calibration/report: figures against hand-worked ones, verdicts, texts, and the JSON of ordinary, odd and
 * empty solutions. The page itself is tested in a browser by tests/system/calib_report.sh. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <jansson.h>

#include "base/clock.h"
#include "base/file.h"
#include "pipeline/calibration/report/report_internal.h"
#include "tests/calib_solution.h"
#include "tests/test.h"

static char dir[] = "/tmp/sst-calib-report-XXXXXX";

static struct sst_calibration_report report_of(const struct made *m)
{
    return (struct sst_calibration_report){ .detections = &m->all, .solution = &m->solution };
}

/* A small array: 2x3 cameras, 12 frames of 24 points. */
static struct made_config small(void)
{
    struct made_config cfg = made_defaults();

    cfg.rows = 2, cfg.cols = 3, cfg.frames = 12, cfg.across = 6, cfg.down = 4, cfg.outliers = 0;
    cfg.width = 640, cfg.height = 480;
    return cfg;
}

/* The page as text; to free. */
static char *page_of(const struct sst_calibration_report *report, size_t *size)
{
    char path[SST_PATH_MAX];
    uint8_t *data = NULL;
    size_t n = 0;

    assert_int_equal(sst_path_join(path, dir, "page.html"), 0);
    assert_int_equal(sst_calibration_report_write(path, report), 0);
    assert_int_equal(sst_file_read(path, 1 << 26, &data, &n), 0);
    assert_int_equal(strlen((char *)data), n);
    unlink(path);
    if (size)
        *size = n;
    return (char *)data;
}

/* The object in the page that its script draws; to release. */
static json_t *data_of(const char *page)
{
    static const char begin[] = "<script type=\"application/json\" id=\"data\">";
    const char *from = strstr(page, begin), *to = from ? strstr(from, "</script>") : NULL;
    json_t *o;

    assert_non_null(to);
    from += strlen(begin);
    assert_null(memchr(from, '<', (size_t)(to - from))); /* nothing in it can end the element */
    o = json_loadb(from, (size_t)(to - from), 0, NULL);
    assert_non_null(o);
    return o;
}

static void assert_has(const char *page, const char *text)
{
    if (!strstr(page, text))
        fail_msg("the page lacks '%s'", text);
}

static void assert_lacks(const char *page, const char *text)
{
    const char *at = strstr(page, text);

    if (at)
        fail_msg("the page has '%s': ...%.60s", text, at);
}

static void assert_near(double a, double b, double within)
{
    if (!(fabs(a - b) <= within))
        fail_msg("%.12g is not %.12g (within %g)", a, b, within);
}

static void numbers_have_sensible_digits(void **state)
{
    static const struct {
        double value;
        int digits;
        const char *text;
    } cases[] = {
        { 0.1415, 3, "0.141" },
        { 0.0999, 2, "0.10" },
        { 0.00996, 2, "0.010" },
        { 9.96, 2, "10" },
        { 12345.6, 3, "12346" },
        { -0.034, 2, "-0.034" },
        { 0, 3, "0" },
        { -0.0, 3, "0" },
        { 3.2e-9, 2, "3.2e-09" },
        { NAN, 3, "unknown" },
        { INFINITY, 3, "unknown" },
        { -INFINITY, 2, "unknown" },
        { 1e300, 3, "1.00e+300" },
    };

    (void)state;
    for (size_t i = 0; i < ARRAY_LEN(cases); i++)
        assert_string_equal(NUM(cases[i].value, cases[i].digits), cases[i].text);
    assert_string_equal(FIGURE(0.0614), "0.061");
    assert_string_equal(FIGURE(0.1414), "0.141");
    assert_string_equal(FIGURE(2.8e-17), "0");
    assert_string_equal(NUM0(0.0, 3), "unknown");
    assert_string_equal(COUNT(0), "0");
    assert_string_equal(COUNT(999), "999");
    assert_string_equal(COUNT(53214), "53,214");
    assert_string_equal(COUNT(-1234567), "-1,234,567");
    assert_string_equal(COUNT(-123), "-123");
    assert_string_equal(report_date(0).text, "unknown");
    assert_string_equal(report_date(1700000000000000000).text, "2023-11-14 22:13:20 UTC");
}

/* Characters that browsers and parsers stumble over. */
static void text_is_valid_utf8(void **state)
{
    static const char *const pairs[][2] = {
        { "<a href=\"x\">&'</a>", "<a href=\"x\">&'</a>" },
        { "K\xC3\xBC"
          "che \xF0\x9F\x93\xB7",
          "K\xC3\xBC"
          "che \xF0\x9F\x93\xB7" },
        { "\x01\x7F\n", "\xEF\xBF\xBD\xEF\xBF\xBD\xEF\xBF\xBD" },                   /* control characters */
        { "\xC0\xBC", "\xEF\xBF\xBD\xEF\xBF\xBD" },                                 /* < in two bytes */
        { "\xED\xA0\x80x", "\xEF\xBF\xBD\xEF\xBF\xBD\xEF\xBF\xBDx" },               /* half of a surrogate pair */
        { "\xE2\x82", "\xEF\xBF\xBD\xEF\xBF\xBD" },                                 /* cut off */
        { "\xEF\xBF\xBF", "\xEF\xBF\xBD\xEF\xBF\xBD\xEF\xBF\xBD" },                 /* no character */
        { "\xF4\x90\x80\x80", "\xEF\xBF\xBD\xEF\xBF\xBD\xEF\xBF\xBD\xEF\xBF\xBD" }, /* beyond Unicode */
        { "<\xFF>\x1B[31m\xC3\xA9", "<\xEF\xBF\xBD>\xEF\xBF\xBD[31m\xC3\xA9" },
    };
    char clean[256];

    (void)state;
    for (size_t i = 0; i < ARRAY_LEN(pairs); i++) {
        report_utf8(clean, pairs[i][0]);
        assert_string_equal(clean, pairs[i][1]);
    }
}

/* Two cameras side by side, one frame, four corners each in one region; every number by hand. */
static void figures_are_those_worked_by_hand(void **state)
{
    static const double left[4][2] = { { 0.1, 0 }, { -0.1, 0 }, { 0, 0.3 }, { 8, 6 } };
    static const double right[4][2] = { { 0.1, 0.2 }, { -0.1, 0.2 }, { 0, 0.2 }, { 0, 0.2 } };
    struct made_config cfg = made_defaults();
    struct made m;
    struct report_figures f;

    (void)state;
    cfg.rows = 1, cfg.cols = 2, cfg.frames = 1, cfg.across = cfg.down = 1, cfg.width = 800, cfg.height = 600;
    made_open(&m, &cfg);
    for (int i = 0; i < 2; i++) {
        struct sst_detection *d = &m.all.detection[i];
        struct sst_solve_view *v = &m.solution.view[i];

        *d = (struct sst_detection){ .view = i, .corners = 4, .corner = made_array(4, sizeof(*d->corner)) };
        *v = (struct sst_solve_view){ .residual = made_array(4, sizeof(*v->residual)),
                                      .outlier = made_array(4, sizeof(*v->outlier)) };
        for (int j = 0; j < 4; j++)
            d->corner[j] = (struct sst_corner){ .id = j, .x = 210 + 10 * j, .y = 510, .weight = j == 2 ? 0.5 : 1 };
        memcpy(v->residual, i ? right : left, sizeof(left));
    }
    m.solution.view[0].outlier[3] = true;
    m.solution.view[0].outliers = 1;
    m.all.count = 2;
    m.solution.frame[0] = (struct sst_solve_frame){ .known = true, .rms_px = 0.25 };
    const struct sst_calibration_report report = report_of(&m);

    assert_int_equal(report_figures_init(&f, &report), 0);
    assert_int_equal(f.known, 2);
    /* Column 210.5 / 100 = 2, row 510.5 / 100 = 5; the outlier does not count. */
    assert_int_equal(f.camera[0].region[5][2].corners, 3);
    assert_near(f.camera[0].region[5][2].mean[0], 0, 1e-15);
    assert_near(f.camera[0].region[5][2].mean[1], 0.1, 1e-15);
    assert_near(f.camera[0].region[5][2].rms_px, sqrt((0.01 + 0.01 + 0.09) / 3), 1e-15);
    assert_true(isnan(f.camera[0].region[0][0].rms_px));
    assert_int_equal(f.camera[0].seen[10][4], 4); /* 210 .. 240 of 50 px each, 510 of 50: all in the column of 200 */
    assert_int_equal(f.camera[0].outliers, 1);
    /* Histogram: noise 0.1, the third corner's residuals halved: 1, 0, -1, 0, 0, 1.5; right: 1, 2, -1, 2, 0, 1, 0, 2 */
    assert_int_equal(f.samples, 14);
    assert_int_equal(f.within[0], 5 + 5);
    assert_int_equal(f.within[1], 14);
    assert_int_equal(f.below + f.above, 0);
    assert_int_equal(f.bin[26], 1); /* 1.5 */
    /* Median of all corners: left 0.1 0.1 0.3 10 -> the third; right hypot(0.1, 0.2) twice, 0.2 twice. */
    assert_int_equal(f.worst_count, 1);
    assert_int_equal(f.worst[0].detection, 0);
    assert_near(f.worst[0].px, 0.3, 1e-15);
    assert_int_equal(f.listed, 1);
    assert_near(f.outlier[0].px, 10, 1e-12);
    assert_int_equal(f.worst_frame, 0);
    assert_int_equal(f.pairs, 0); /* three shared corners are too few */
    assert_near(f.centre_mm[0][0], 0, 1e-12);
    assert_near(f.lattice_mm[1][0], 0, 1e-9); /* two places are always a lattice */
    report_figures_fini(&f);
    made_close(&m);
}

/* Six cameras on a lattice, one of them off by (0.6, -0.3) mm: the best lattice takes its share. */
static void lattice_is_fitted(void **state)
{
    struct made_config cfg = small();
    struct made m;
    struct report_figures f;
    double sum[2] = { 0 };

    (void)state;
    cfg.frames = 1;
    made_open(&m, &cfg);
    for (int k = 0; k < 6; k++) {
        double *at = m.solution.calib.camera[k].position_mm;

        at[0] = 50 * (k % 3 - 1) + 2 * (k / 3); /* rows are shifted: still a lattice */
        at[1] = 40 * (k / 3);
        at[2] = k == 3 ? 0.6 : 0;
    }
    const struct sst_calibration_report report = report_of(&m);

    assert_int_equal(report_figures_init(&f, &report), 0);
    for (int k = 0; k < 6; k++) {
        assert_near(f.lattice_mm[k][0], 0, 1e-12);
        assert_near(f.lattice_mm[k][1], 0, 1e-12);
        assert_near(f.centre_mm[k][2], k == 3 ? 0.5 : -0.1, 1e-12); /* against the mean */
    }
    report_figures_fini(&f);
    m.solution.calib.camera[0].position_mm[0] += 0.6;
    m.solution.calib.camera[0].position_mm[1] -= 0.3;
    assert_int_equal(report_figures_init(&f, &report), 0);
    /* Leverage of a corner of 2x3 with three parameters: 1/6 + 1/4 + 1/6 = 7/12 is fitted away. */
    assert_near(f.lattice_mm[0][0], 0.6 * 5 / 12, 1e-12);
    assert_near(f.lattice_mm[0][1], -0.3 * 5 / 12, 1e-12);
    for (int k = 0; k < 6; k++) {
        sum[0] += f.lattice_mm[k][0];
        sum[1] += f.lattice_mm[k][1];
    }
    assert_near(sum[0], 0, 1e-12);
    assert_near(sum[1], 0, 1e-12);
    report_figures_fini(&f);
    made_close(&m);
}

/* The camera on the right sees all corners 0.2 px lower than predicted, and is turned by 90 degrees about its axis. */
static void pairs_are_compared_across_their_line(void **state)
{
    static const double quarter[9] = { 0, 1, 0, -1, 0, 0, 0, 0, 1 }; /* camera from rig */
    struct made_config cfg = small();
    struct made m;
    struct report_figures f;

    (void)state;
    cfg.rows = 1, cfg.cols = 2, cfg.noise_px = 0.01, cfg.frames = 40;
    made_open(&m, &cfg);
    for (int k = 0; k < 2; k++) {
        m.solution.calib.camera[k].fx = m.solution.calib.camera[k].fy = 1000;
        memset(m.solution.calib.camera[k].rotation, 0, sizeof(quarter));
        for (int i = 0; i < 9; i += 4)
            m.solution.calib.camera[k].rotation[i] = 1;
    }
    for (int i = 0; i < m.all.count; i++) {
        for (int j = 0; j < m.all.detection[i].corners && m.all.detection[i].view == 1; j++)
            m.solution.view[i].residual[j][1] += 0.2;
    }
    const struct sst_calibration_report report = report_of(&m);

    assert_int_equal(report_figures_init(&f, &report), 0);
    assert_int_equal(f.pairs, 1);
    assert_near(f.pair_mean_px, 0.2, 0.005);
    assert_near(f.pair_max_px, 0.2, 0.005);
    assert_near(f.pair_p95_px, 0.2, 0.01);
    assert_near(f.camera[1].systematic_px, 0.2, 0.005);
    assert_true(f.camera[0].systematic_px < 0.003);
    assert_int_equal(f.systematic_camera, 1);
    assert_true(f.direction_z > 10);
    report_figures_fini(&f);
    /* Its picture's down is the rig's left: along the line between them, so no longer across it. */
    memcpy(m.solution.calib.camera[1].rotation, quarter, sizeof(quarter));
    assert_int_equal(report_figures_init(&f, &report), 0);
    assert_near(f.pair_mean_px, 0, 0.005);
    report_figures_fini(&f);
    made_close(&m);
}

static void random_residuals_look_random(void **state)
{
    struct made_config cfg = small();
    struct made m;
    struct report_figures f;

    (void)state;
    cfg.frames = 60;
    made_open(&m, &cfg);
    const struct sst_calibration_report report = report_of(&m);

    assert_int_equal(report_figures_init(&f, &report), 0);
    assert_true(f.regions > 100);
    assert_true(fabs(f.direction_z) < 3);
    assert_true(f.regions_off < 3);
    assert_near((double)f.within[0] / (double)f.samples, 0.6827, 0.01);
    assert_near((double)f.within[1] / (double)f.samples, 0.9545, 0.006);
    report_figures_fini(&f);
    made_close(&m);
}

/* Verdict of the small array with one thing changed. */
static enum report_verdict verdict_with(void (*change)(struct made *), const char *reason)
{
    struct made_config cfg = small();
    struct made m;
    struct report_figures f;
    enum report_verdict verdict;
    char text[640];
    bool found = false;

    cfg.frames = 40;
    made_open(&m, &cfg);
    change(&m);
    const struct sst_calibration_report report = report_of(&m);

    assert_int_equal(report_figures_init(&f, &report), 0);
    for (int i = 0; i < f.criteria; i++) {
        if (report_criterion_reason(&f.criterion[i], text)) {
            if (!reason || !strstr(text, reason))
                fail_msg("not expected: %s", text);
            found = true;
        }
    }
    assert_true(found == (reason != NULL));
    verdict = f.verdict;
    report_figures_fini(&f);
    made_close(&m);
    return verdict;
}

static void nothing(struct made *m)
{
    (void)m;
}

static void no_cross(struct made *m)
{
    m->solution.cv_px = m->solution.cv_expected_px = NAN;
}

static void cross_large(struct made *m)
{
    m->solution.cv_px = 0.25;
    m->solution.cv_expected_px = 0.2;
    m->solution.cv_camera = 2;
}

static void cross_unexplained(struct made *m)
{
    m->solution.cv_px = 0.15;
    m->solution.cv_expected_px = 0.05;
}

static void cross_tiny(struct made *m)
{
    m->solution.cv_px = 0.03;
    m->solution.cv_expected_px = 0.01;
}

static void many_outliers(struct made *m)
{
    m->solution.outliers = m->solution.corners / 20;
}

static void camera_noisy(struct made *m)
{
    m->solution.calib.camera[4].rms_px = 0.7;
}

static void camera_gone(struct made *m)
{
    m->solution.calib.camera[5].known = false;
    m->solution.calib.camera[5].name[0] = '\0';
}

static void camera_loose(struct made *m)
{
    m->solution.calib.camera[1].sigma_px = 0.12;
}

static void not_solved(struct made *m)
{
    m->solution.rms_px = NAN;
}

static void verdicts_have_their_reason(void **state)
{
    (void)state;
    assert_int_equal(verdict_with(nothing, NULL), VERDICT_GOOD);
    assert_int_equal(verdict_with(no_cross, "nothing confirms"), VERDICT_USABLE);
    assert_int_equal(verdict_with(cross_large, "0.250 px (camera 0,2 (SIM0002)), above 0.2;"), VERDICT_USABLE);
    assert_int_equal(verdict_with(cross_unexplained, "3.00 times, above 2;"), VERDICT_USABLE);
    assert_int_equal(verdict_with(cross_tiny, NULL), VERDICT_GOOD);
    assert_int_equal(verdict_with(many_outliers, "contradict each other"), VERDICT_BAD);
    assert_int_equal(verdict_with(camera_noisy, "0.700 px (camera 1,1 (SIM0004)), above 0.6;"), VERDICT_BAD);
    assert_int_equal(verdict_with(camera_gone, "1 (1,2 (SIM0005)), above 0;"), VERDICT_USABLE);
    assert_int_equal(verdict_with(camera_loose, "0.120 px (camera 0,1 (SIM0001)), above 0.1;"), VERDICT_USABLE);
    assert_int_equal(verdict_with(not_solved, NULL), VERDICT_BAD);
}

/* The page has the figures of --json. */
static void assert_same_figures(const json_t *page, const char *json)
{
    json_t *o = json_loads(json, 0, NULL);

    assert_non_null(o);
    assert_true(json_equal(json_object_get(page, "figures"), o));
    json_decref(o);
}

static void assert_figures(const json_t *o, const struct made *m)
{
    assert_near(json_number_value(json_object_get(o, "rms_px")), m->solution.rms_px, 1e-11);
    assert_int_equal(json_integer_value(json_object_get(o, "corners")), m->solution.corners);
    assert_int_equal(json_array_size(json_object_get(o, "cameras")), 6);
    assert_int_equal(json_array_size(json_object_get(o, "frames")), 12);
    assert_string_equal(json_string_value(json_object_get(o, "worst_frame")), "frame0003");
    assert_true(json_is_null(json_object_get(o, "rig")));
    for (size_t i = 0; i < 12; i++)
        assert_near(json_number_value(json_object_get(json_array_get(json_object_get(o, "frames"), i), "rms_px")),
                    m->solution.frame[i].rms_px, 1e-11);
    for (size_t k = 0; k < 6; k++) {
        const json_t *c = json_array_get(json_object_get(o, "cameras"), k);

        assert_near(json_number_value(json_object_get(c, "rms_px")), m->solution.calib.camera[k].rms_px, 1e-11);
        assert_int_equal(json_is_true(json_object_get(c, "reference")), (int)k == m->solution.calib.reference);
        assert_non_null(json_string_value(json_object_get(c, "coverage_lacks")));
    }
}

/* Sizes of the page's drawings: every cell and region of each camera, and x, y, dx, dy of each vector. */
static void assert_drawing(const json_t *o, const struct made *m)
{
    const json_t *pictures = json_object_get(o, "pictures");

    assert_int_equal(json_array_size(json_object_get(o, "cameras")), 6);
    for (size_t k = 0; k < 6; k++) {
        const json_t *c = json_array_get(json_object_get(o, "cameras"), k);
        const size_t used = json_array_size(json_object_get(c, "used"));

        assert_int_equal(json_array_size(json_object_get(c, "seen")), SST_UNCERTAINTY_ROWS * SST_UNCERTAINTY_COLS);
        assert_int_equal(json_array_size(json_object_get(c, "rms")), REPORT_ROWS * REPORT_COLS);
        assert_int_equal(json_array_size(json_object_get(c, "mean")), 2 * REPORT_ROWS * REPORT_COLS);
        assert_int_equal(json_array_size(json_object_get(c, "frames")), m->all.frames);
        assert_true(used > 0 && used % 4 == 0 && used <= 4 * 300);
    }
    assert_int_equal(json_array_size(pictures), REPORT_WORST);
    assert_true(json_is_null(json_object_get(json_array_get(pictures, 0), "jpeg")));
}

static void page_text_and_json_agree_with_the_solution(void **state)
{
    struct made_config cfg = small();
    struct made m;
    char want[160], *page, *again, *json, *text = NULL;
    size_t size;
    json_t *o;
    FILE *f;

    (void)state;
    cfg.outliers = 0.01;
    cfg.moved = 3;
    made_open(&m, &cfg);
    const struct sst_calibration_report report = report_of(&m);

    page = page_of(&report, NULL);
    again = page_of(&report, NULL);
    assert_string_equal(page, again);
    f = open_memstream(&text, &size);
    assert_int_equal(sst_calibration_report_text(f, &report), 0);
    fclose(f);
    snprintf(want, sizeof(want), "RMS per point over %s corners of 6 cameras in 12 frames", COUNT(m.solution.corners));
    assert_has(text, want);
    snprintf(want, sizeof(want), "%9.3f px  RMS per point", m.solution.rms_px);
    assert_has(text, want);
    assert_has(text, "worst frame   frame0003: ");
    json = sst_calibration_report_json(&report);
    assert_non_null(json);
    o = data_of(page);
    assert_same_figures(o, json);
    assert_figures(json_object_get(o, "figures"), &m);
    assert_drawing(json_object_get(o, "drawing"), &m);
    json_decref(o);
    free(json);
    free(text);
    free(again);
    free(page);
    made_close(&m);
}

static int plain_picture(void *arg, int view, int frame, struct sst_image *out)
{
    const struct made *m = arg;
    const int err = sst_image_init(out, m->cfg.width, m->cfg.height);

    (void)view;
    (void)frame;
    for (int c = 0; c < 3 && !err; c++) {
        for (int y = 0; y < out->height; y++)
            memset(sst_image_row(out, c, y), 40 * (c + 1), (size_t)out->width);
    }
    return err;
}

static void pictures_are_jpegs_in_base64(void **state)
{
    static const char sign[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/=";
    const struct made_config cfg = small();
    struct made m;
    char *page;
    json_t *o;

    (void)state;
    made_open(&m, &cfg);
    struct sst_calibration_report report = report_of(&m);

    report.picture = plain_picture;
    report.arg = &m;
    page = page_of(&report, NULL);
    o = data_of(page);
    for (size_t i = 0; i < REPORT_WORST; i++) {
        const json_t *picture = json_array_get(json_object_get(json_object_get(o, "drawing"), "pictures"), i);
        const char *jpeg = json_string_value(json_object_get(picture, "jpeg"));

        assert_non_null(jpeg);
        assert_true(strlen(jpeg) > 100 && strlen(jpeg) % 4 == 0 && strspn(jpeg, sign) == strlen(jpeg));
        assert_memory_equal(jpeg, "/9j/", 4); /* FF D8 FF */
    }
    json_decref(o);
    free(page);
    made_close(&m);
}

static void names_stay_text(void **state)
{
    struct made_config cfg = small();
    struct made m;
    char *page, *json;
    json_t *o;

    (void)state;
    cfg.outliers = 0.02;
    made_open(&m, &cfg);
    snprintf(m.solution.calib.camera[0].name, 64, "<script>alert(\"1\")</script>&'");
    memset(m.solution.calib.camera[1].name, 0xC3, 63); /* no character at all */
    for (int i = 0; i < 12; i++)
        snprintf(m.all.frame_name[i], 64, "</td>\x02<b title='%d'>", i);
    snprintf(m.solution.calib.source, 64, "</style><!--<script>");
    snprintf(m.solution.calib.board, 64, "-->\"@DATA@");
    const struct sst_calibration_report report = report_of(&m);

    page = page_of(&report, NULL);
    assert_lacks(page, "<script>alert");
    assert_lacks(page, "<!--<script");
    assert_lacks(page, "</td>");
    json = sst_calibration_report_json(&report);
    assert_non_null(json);
    assert_has(json, "\"<script>alert(\\\"1\\\")</script>&'\"");
    o = data_of(page);
    assert_same_figures(o, json);
    json_decref(o);
    free(page);
    free(json);
    made_close(&m);
}

static void assert_page_is_sane(const struct made *m)
{
    const struct sst_calibration_report report = report_of(m);
    char *page = page_of(&report, NULL), *json = sst_calibration_report_json(&report), *text = NULL;
    size_t size;
    FILE *f = open_memstream(&text, &size);

    assert_int_equal(sst_calibration_report_text(f, &report), 0);
    fclose(f);
    assert_non_null(json);
    json_decref(data_of(page));
    for (int i = 0; i < 2; i++) {
        const char *all[] = { text, json };

        assert_lacks(all[i], "nan");
        assert_lacks(all[i], "inf "); /* a number; "infinity" may be there */
        assert_lacks(all[i], "inf\"");
        assert_lacks(all[i], "inf,");
    }
    free(page);
    free(json);
    free(text);
}

static void unknown_is_reported(void **state)
{
    struct made_config cfg = small();
    struct made m;

    (void)state;
    cfg.hole = 1;
    cfg.unsolved = 2;
    cfg.rig = true;
    made_open(&m, &cfg);
    made_forget(&m);
    assert_page_is_sane(&m);
    m.all.count = 0; /* the files of made_open() are not freed through it below */
    struct made kept = m;

    kept.all.frames = 0;
    assert_page_is_sane(&kept);
    for (int k = 0; k < 6; k++)
        kept.solution.calib.camera[k].known = false;
    assert_page_is_sane(&kept);
    m.all.count = 0;
    while (m.all.detection[m.all.count].corner)
        m.all.count++;
    made_close(&m);
}

static void every_shape_of_array_has_a_page(void **state)
{
    static const int shapes[][3] = { { 1, 1, 8 }, { 1, 2, 8 }, { 2, 1, 8 }, { 1, 9, 3 }, { 9, 1, 3 }, { 16, 16, 2 } };

    (void)state;
    for (size_t i = 0; i < ARRAY_LEN(shapes); i++) {
        struct made_config cfg = small();
        struct made m;

        cfg.rows = shapes[i][0], cfg.cols = shapes[i][1], cfg.frames = shapes[i][2];
        made_open(&m, &cfg);
        assert_page_is_sane(&m);
        made_close(&m);
    }
}

static void a_large_array_is_quick_and_small(void **state)
{
    const struct made_config cfg = made_defaults();
    struct made m;
    size_t size;
    int64_t begun, limit_ns = 3000000000;

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    limit_ns *= 4; /* six times as slow */
#endif
    (void)state;
    made_open(&m, &cfg);
    const struct sst_calibration_report report = report_of(&m);

    begun = sst_clock_cpu_ns();
    free(page_of(&report, &size));
    print_message("[     INFO ] %d corners: %zu bytes in %.0f ms of CPU\n", m.solution.corners, size,
                  (double)(sst_clock_cpu_ns() - begun) / 1e6);
    assert_true(size < 2000000);
    assert_true(sst_clock_cpu_ns() - begun < limit_ns);
    made_close(&m);
}

static void a_page_that_cannot_be_written_is_reported(void **state)
{
    const struct made_config cfg = small();
    struct made m;
    char path[SST_PATH_MAX];

    (void)state;
    made_open(&m, &cfg);
    const struct sst_calibration_report report = report_of(&m);

    assert_int_equal(sst_path_join(path, dir, "nowhere/page.html"), 0);
    assert_true(sst_calibration_report_write(path, &report) < 0);
    assert_false(sst_path_exists(path));
    made_close(&m);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(numbers_have_sensible_digits),
        cmocka_unit_test(text_is_valid_utf8),
        cmocka_unit_test(figures_are_those_worked_by_hand),
        cmocka_unit_test(lattice_is_fitted),
        cmocka_unit_test(pairs_are_compared_across_their_line),
        cmocka_unit_test(random_residuals_look_random),
        cmocka_unit_test(verdicts_have_their_reason),
        cmocka_unit_test(page_text_and_json_agree_with_the_solution),
        cmocka_unit_test(pictures_are_jpegs_in_base64),
        cmocka_unit_test(names_stay_text),
        cmocka_unit_test(unknown_is_reported),
        cmocka_unit_test(every_shape_of_array_has_a_page),
        cmocka_unit_test(a_large_array_is_quick_and_small),
        cmocka_unit_test(a_page_that_cannot_be_written_is_reported),
    };
    int failed;

    assert(mkdtemp(dir));
    failed = cmocka_run_group_tests(tests, NULL, NULL);
    sst_path_remove_tree(dir);
    return failed;
}
