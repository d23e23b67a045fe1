/* pipeline/calibration/report: figures against hand-worked ones, verdicts, words, and pages of ordinary, odd and empty
 * solutions. That the pages are well-formed is for tests/system/calib_report.sh to see. */
#include <errno.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>
#include <jansson.h>

#include "base/clock.h"
#include "base/file.h"
#include "pipeline/calibration/report/report_internal.h"
#include "tests/calib_solution.h"

static char dir[] = "/tmp/sst-calib-report-XXXXXX";

static struct sst_calib_report report_of(const struct made *m)
{
    return (struct sst_calib_report){ .detections = &m->all, .solution = &m->solution };
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
static char *page_of(const struct sst_calib_report *report, size_t *size)
{
    char path[SST_PATH_MAX];
    uint8_t *data = NULL;
    size_t n = 0;

    assert_int_equal(sst_path_join(path, dir, "page.html"), 0);
    assert_int_equal(sst_calib_report_write(path, report), 0);
    assert_int_equal(sst_file_read(path, 1 << 26, &data, &n), 0);
    assert_int_equal(strlen((char *)data), n);
    unlink(path);
    if (size)
        *size = n;
    return (char *)data;
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
        assert_string_equal(SST_NUM(cases[i].value, cases[i].digits), cases[i].text);
    assert_string_equal(SST_FIGURE(0.0614), "0.061");
    assert_string_equal(SST_FIGURE(0.1414), "0.141");
    assert_string_equal(SST_FIGURE(2.8e-17), "0");
    assert_string_equal(SST_NUM0(0.0, 3), "unknown");
    assert_string_equal(SST_COUNT(0), "0");
    assert_string_equal(SST_COUNT(999), "999");
    assert_string_equal(SST_COUNT(53214), "53,214");
    assert_string_equal(SST_COUNT(-1234567), "-1,234,567");
    assert_string_equal(SST_COUNT(-123), "-123");
    assert_string_equal(calib_date(0).text, "unknown");
    assert_string_equal(calib_date(1700000000000000000).text, "2023-11-14 22:13:20 UTC");
}

static char *written(void (*write)(FILE *, const char *), const char *text)
{
    char *out = NULL;
    size_t size;
    FILE *f = open_memstream(&out, &size);

    assert_non_null(f);
    write(f, text);
    fclose(f);
    return out;
}

static void base64_of(FILE *out, const char *text)
{
    encode_base64(out, (const uint8_t *)text, strlen(text));
}

/* RFC 4648, section 10, and what browsers and parsers stumble over. */
static void text_cannot_become_markup(void **state)
{
    static const char *const pairs[][2] = {
        { "<a href=\"x\">&'</a>", "&lt;a href=&quot;x&quot;&gt;&amp;&#39;&lt;/a&gt;" },
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
    };
    static const char *const base64[][2] = { { "", "" },
                                             { "f", "Zg==" },
                                             { "fo", "Zm8=" },
                                             { "foo", "Zm9v" },
                                             { "foob", "Zm9vYg==" },
                                             { "fooba", "Zm9vYmE=" },
                                             { "foobar", "Zm9vYmFy" } };
    char clean[256];

    (void)state;
    for (size_t i = 0; i < ARRAY_LEN(pairs); i++) {
        char *html = written(html_text, pairs[i][0]);

        assert_string_equal(html, pairs[i][1]);
        free(html);
    }
    for (size_t i = 0; i < ARRAY_LEN(base64); i++) {
        char *text = written(base64_of, base64[i][0]);

        assert_string_equal(text, base64[i][1]);
        free(text);
    }
    calib_utf8(clean, "<\xFF>\x1B[31m\xC3\xA9");
    assert_string_equal(clean, "<\xEF\xBF\xBD>\xEF\xBF\xBD[31m\xC3\xA9");
}

static void scales_are_round_and_robust(void **state)
{
    double values[200];
    struct calib_scale s;

    (void)state;
    for (int i = 0; i < 200; i++)
        values[i] = i < 195 ? 0.14 : 5; /* one part in forty far off does not stretch the colours */
    values[0] = NAN;
    s = calib_scale_fit(values, 200);
    assert_near(s.hi, 0.25, 1e-12); /* 1.7 * 0.14 = 0.238 */
    assert_int_equal(calib_level(s, 0), 0);
    assert_int_equal(calib_level(s, 0.14), 5);
    assert_int_equal(calib_level(s, 5), 9);
    assert_int_equal(calib_level(s, -1), 0);
    assert_int_equal(calib_level(s, NAN), -1);
    s = calib_scale_fit(values, 1); /* nothing known */
    assert_true(s.hi > s.lo);
    assert_near(calib_round_down(0.34), 0.2, 1e-15);
    assert_near(calib_round_down(1000), 1000, 1e-9);
    assert_near(calib_round_down(99), 50, 1e-12);
}

/* Two cameras side by side, one frame, four corners each in one region; every number by hand. */
static void figures_are_those_worked_by_hand(void **state)
{
    static const double left[4][2] = { { 0.1, 0 }, { -0.1, 0 }, { 0, 0.3 }, { 8, 6 } };
    static const double right[4][2] = { { 0.1, 0.2 }, { -0.1, 0.2 }, { 0, 0.2 }, { 0, 0.2 } };
    struct made_config cfg = made_defaults();
    struct made m;
    struct calib_figures f;

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
    const struct sst_calib_report report = report_of(&m);

    assert_int_equal(calib_figures_init(&f, &report), 0);
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
    calib_figures_fini(&f);
    made_close(&m);
}

/* Six cameras on a lattice, one of them off by (0.6, -0.3) mm: the best lattice takes its share. */
static void lattice_is_fitted(void **state)
{
    struct made_config cfg = small();
    struct made m;
    struct calib_figures f;
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
    const struct sst_calib_report report = report_of(&m);

    assert_int_equal(calib_figures_init(&f, &report), 0);
    for (int k = 0; k < 6; k++) {
        assert_near(f.lattice_mm[k][0], 0, 1e-12);
        assert_near(f.lattice_mm[k][1], 0, 1e-12);
        assert_near(f.centre_mm[k][2], k == 3 ? 0.5 : -0.1, 1e-12); /* against the mean */
    }
    calib_figures_fini(&f);
    m.solution.calib.camera[0].position_mm[0] += 0.6;
    m.solution.calib.camera[0].position_mm[1] -= 0.3;
    assert_int_equal(calib_figures_init(&f, &report), 0);
    /* Leverage of a corner of 2x3 with three parameters: 1/6 + 1/4 + 1/6 = 7/12 is fitted away. */
    assert_near(f.lattice_mm[0][0], 0.6 * 5 / 12, 1e-12);
    assert_near(f.lattice_mm[0][1], -0.3 * 5 / 12, 1e-12);
    for (int k = 0; k < 6; k++) {
        sum[0] += f.lattice_mm[k][0];
        sum[1] += f.lattice_mm[k][1];
    }
    assert_near(sum[0], 0, 1e-12);
    assert_near(sum[1], 0, 1e-12);
    calib_figures_fini(&f);
    made_close(&m);
}

/* The camera on the right sees all corners 0.2 px lower than predicted, and is turned by 90 degrees about its axis. */
static void pairs_are_compared_across_their_line(void **state)
{
    static const double quarter[9] = { 0, 1, 0, -1, 0, 0, 0, 0, 1 }; /* camera from rig */
    struct made_config cfg = small();
    struct made m;
    struct calib_figures f;

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
    const struct sst_calib_report report = report_of(&m);

    assert_int_equal(calib_figures_init(&f, &report), 0);
    assert_int_equal(f.pairs, 1);
    assert_near(f.pair_mean_px, 0.2, 0.005);
    assert_near(f.pair_max_px, 0.2, 0.005);
    assert_near(f.pair_p95_px, 0.2, 0.01);
    assert_near(f.camera[1].systematic_px, 0.2, 0.005);
    assert_true(f.camera[0].systematic_px < 0.003);
    assert_int_equal(f.systematic_camera, 1);
    assert_true(f.direction_z > 10);
    calib_figures_fini(&f);
    /* Its picture's down is the rig's left: along the line between them, so no longer across it. */
    memcpy(m.solution.calib.camera[1].rotation, quarter, sizeof(quarter));
    assert_int_equal(calib_figures_init(&f, &report), 0);
    assert_near(f.pair_mean_px, 0, 0.005);
    calib_figures_fini(&f);
    made_close(&m);
}

static void random_residuals_look_random(void **state)
{
    struct made_config cfg = small();
    struct made m;
    struct calib_figures f;

    (void)state;
    cfg.frames = 60;
    made_open(&m, &cfg);
    const struct sst_calib_report report = report_of(&m);

    assert_int_equal(calib_figures_init(&f, &report), 0);
    assert_true(f.regions > 100);
    assert_true(fabs(f.direction_z) < 3);
    assert_true(f.regions_off < 3);
    assert_near((double)f.within[0] / (double)f.samples, 0.6827, 0.01);
    assert_near((double)f.within[1] / (double)f.samples, 0.9545, 0.006);
    calib_figures_fini(&f);
    made_close(&m);
}

/* Verdict of the small array with one thing changed. */
static enum calib_verdict verdict_with(void (*change)(struct made *), const char *reason)
{
    struct made_config cfg = small();
    struct made m;
    struct calib_figures f;
    enum calib_verdict verdict;
    char text[640];
    bool found = false;

    cfg.frames = 40;
    made_open(&m, &cfg);
    change(&m);
    const struct sst_calib_report report = report_of(&m);

    assert_int_equal(calib_figures_init(&f, &report), 0);
    for (int i = 0; i < f.bars; i++) {
        if (calib_bar_reason(&f.bar[i], text)) {
            if (!reason || !strstr(text, reason))
                fail_msg("not expected: %s", text);
            found = true;
        }
    }
    assert_true(found == (reason != NULL));
    verdict = f.verdict;
    calib_figures_fini(&f);
    made_close(&m);
    return verdict;
}

static void nothing(struct made *m)
{
    (void)m;
}

static void no_cross(struct made *m)
{
    m->solution.cross_px = m->solution.cross_expected_px = NAN;
}

static void cross_large(struct made *m)
{
    m->solution.cross_px = 0.25;
    m->solution.cross_expected_px = 0.2;
    m->solution.cross_camera = 2;
}

static void cross_unexplained(struct made *m)
{
    m->solution.cross_px = 0.15;
    m->solution.cross_expected_px = 0.05;
}

static void cross_tiny(struct made *m)
{
    m->solution.cross_px = 0.03;
    m->solution.cross_expected_px = 0.01;
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
    assert_int_equal(verdict_with(nothing, NULL), SST_CALIB_GOOD);
    assert_int_equal(verdict_with(no_cross, "nothing confirms"), SST_CALIB_USABLE);
    assert_int_equal(verdict_with(cross_large, "0.250 px (camera SIM0002), above 0.2;"), SST_CALIB_USABLE);
    assert_int_equal(verdict_with(cross_unexplained, "3.00 times, above 2;"), SST_CALIB_USABLE);
    assert_int_equal(verdict_with(cross_tiny, NULL), SST_CALIB_GOOD);
    assert_int_equal(verdict_with(many_outliers, "contradict each other"), SST_CALIB_BAD);
    assert_int_equal(verdict_with(camera_noisy, "0.700 px (camera SIM0004), above 0.6;"), SST_CALIB_BAD);
    assert_int_equal(verdict_with(camera_gone, "1 (SIM0005), above 0;"), SST_CALIB_USABLE);
    assert_int_equal(verdict_with(camera_loose, "0.120 px (camera SIM0001), above 0.1;"), SST_CALIB_USABLE);
    assert_int_equal(verdict_with(not_solved, NULL), SST_CALIB_BAD);
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
    const struct sst_calib_report report = report_of(&m);

    page = page_of(&report, NULL);
    again = page_of(&report, NULL);
    assert_string_equal(page, again);
    f = open_memstream(&text, &size);
    assert_int_equal(sst_calib_report_text(f, &report), 0);
    fclose(f);
    snprintf(want, sizeof(want), "RMS per point over %s corners of 6 cameras in 12 frames",
             SST_COUNT(m.solution.corners));
    assert_has(page, want);
    assert_has(text, want);
    snprintf(want, sizeof(want), "<b>%.3f px</b>", m.solution.rms_px);
    assert_has(page, want);
    snprintf(want, sizeof(want), "%9.3f px  RMS per point", m.solution.rms_px);
    assert_has(text, want);
    assert_has(page, "<b>frame0003</b>");
    assert_has(text, "worst frame   frame0003: ");
    assert_has(page, "RMS of each frame");
    assert_has(page, "<p>Its coverage lacks: ");
    for (int i = 0; i < 12; i++) {
        snprintf(want, sizeof(want), "<title>frame%04d: %s px</title>", i, SST_NUM(m.solution.frame[i].rms_px, 3));
        assert_has(page, want);
    }
    for (int k = 0; k < 6; k++) {
        snprintf(want, sizeof(want), "SIM%04d</b><span>%s px RMS</span>", k,
                 SST_FIGURE(m.solution.calib.camera[k].rms_px));
        assert_has(page, want);
    }
    json = sst_calib_report_json(&report);
    assert_non_null(json);
    o = json_loads(json, 0, NULL);
    assert_non_null(o);
    assert_near(json_number_value(json_object_get(o, "rms_px")), m.solution.rms_px, 1e-11);
    assert_int_equal(json_integer_value(json_object_get(o, "corners")), m.solution.corners);
    assert_int_equal(json_array_size(json_object_get(o, "cameras")), 6);
    assert_int_equal(json_array_size(json_object_get(o, "frames")), 12);
    assert_string_equal(json_string_value(json_object_get(o, "worst_frame")), "frame0003");
    assert_true(json_is_null(json_object_get(o, "rig")));
    json_decref(o);
    free(json);
    free(text);
    free(again);
    free(page);
    made_close(&m);
}

static void names_stay_text(void **state)
{
    struct made_config cfg = small();
    struct made m;
    char *page, *json;

    (void)state;
    cfg.outliers = 0.02;
    made_open(&m, &cfg);
    snprintf(m.solution.calib.camera[0].name, 64, "<script>alert(\"1\")</script>&'");
    memset(m.solution.calib.camera[1].name, 0xC3, 63); /* no character at all */
    for (int i = 0; i < 12; i++)
        snprintf(m.all.frame_name[i], 64, "</td>\x02<b title='%d'>", i);
    snprintf(m.solution.calib.source, 64, "</style><script>");
    snprintf(m.solution.calib.board, 64, "-->\"");
    const struct sst_calib_report report = report_of(&m);

    page = page_of(&report, NULL);
    assert_lacks(page, "<script");
    assert_lacks(page, "</td>\x02");
    assert_lacks(page, "title='");
    assert_has(page, "&lt;script&gt;alert(&quot;1&quot;)&lt;/script&gt;&amp;&#39;");
    assert_has(page, "--&gt;&quot;");
    free(page);
    json = sst_calib_report_json(&report);
    assert_non_null(json);
    assert_has(json, "\"<script>alert(\\\"1\\\")</script>&'\"");
    free(json);
    made_close(&m);
}

/* Everything that can be unknown is. */
static void forget(struct made *m)
{
    struct sst_solution *s = &m->solution;

    s->rms_px = s->predicted_rms_px = s->rcond = s->seconds = NAN;
    s->noise_px = s->calib.noise_px = s->calib.range_mm = 0;
    s->cross_px = s->cross_expected_px = NAN;
    s->warp_mm[0] = s->warp_mm[1] = NAN;
    s->weakest = -1;
    s->links = s->corners = s->outliers = 0;
    s->calib.created_wall_ns = 0;
    s->calib.source[0] = s->calib.board[0] = '\0';
    for (int k = 0; k < m->cfg.rows * m->cfg.cols; k++)
        s->calib.camera[k].rms_px = s->calib.camera[k].sigma_px = 0;
    for (int i = 0; i < m->all.frames; i++)
        s->frame[i].rms_px = NAN;
    for (int i = 0; i < m->all.count; i++) {
        s->view[i].rms_px = NAN;
        for (int j = 0; j < m->all.detection[i].corners; j++)
            s->view[i].residual[j][0] = s->view[i].residual[j][1] = NAN;
    }
}

static void assert_page_is_sane(const struct made *m)
{
    const struct sst_calib_report report = report_of(m);
    char *page = page_of(&report, NULL), *json = sst_calib_report_json(&report), *text = NULL;
    size_t size;
    FILE *f = open_memstream(&text, &size);

    assert_int_equal(sst_calib_report_text(f, &report), 0);
    fclose(f);
    assert_non_null(json);
    for (int i = 0; i < 3; i++) {
        const char *all[] = { page, text, json };

        assert_lacks(all[i], "nan");
        assert_lacks(all[i], "-0.000<");
        assert_lacks(all[i], "inf "); /* a number; "infinity" may be there */
        assert_lacks(all[i], "inf<");
        assert_lacks(all[i], "inf\"");
        assert_lacks(all[i], "inf,");
    }
    free(page);
    free(json);
    free(text);
}

static void unknown_is_told(void **state)
{
    struct made_config cfg = small();
    struct made m;

    (void)state;
    cfg.hole = 1;
    cfg.unsolved = 2;
    cfg.rig = true;
    made_open(&m, &cfg);
    forget(&m);
    assert_page_is_sane(&m);
    m.all.count = 0; /* what made_open() has made is not freed through it below */
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
    const struct sst_calib_report report = report_of(&m);

    begun = sst_clock_cpu_ns();
    free(page_of(&report, &size));
    print_message("[     INFO ] %d corners: %zu bytes in %.0f ms of CPU\n", m.solution.corners, size,
                  (double)(sst_clock_cpu_ns() - begun) / 1e6);
    assert_true(size < 2000000);
    assert_true(sst_clock_cpu_ns() - begun < limit_ns);
    made_close(&m);
}

static void a_page_that_cannot_be_written_is_told(void **state)
{
    const struct made_config cfg = small();
    struct made m;
    char path[SST_PATH_MAX];

    (void)state;
    made_open(&m, &cfg);
    const struct sst_calib_report report = report_of(&m);

    assert_int_equal(sst_path_join(path, dir, "nowhere/page.html"), 0);
    assert_true(sst_calib_report_write(path, &report) < 0);
    assert_false(sst_path_exists(path));
    made_close(&m);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(numbers_have_sensible_digits),
        cmocka_unit_test(text_cannot_become_markup),
        cmocka_unit_test(scales_are_round_and_robust),
        cmocka_unit_test(figures_are_those_worked_by_hand),
        cmocka_unit_test(lattice_is_fitted),
        cmocka_unit_test(pairs_are_compared_across_their_line),
        cmocka_unit_test(random_residuals_look_random),
        cmocka_unit_test(verdicts_have_their_reason),
        cmocka_unit_test(page_text_and_json_agree_with_the_solution),
        cmocka_unit_test(names_stay_text),
        cmocka_unit_test(unknown_is_told),
        cmocka_unit_test(every_shape_of_array_has_a_page),
        cmocka_unit_test(a_large_array_is_quick_and_small),
        cmocka_unit_test(a_page_that_cannot_be_written_is_told),
    };
    int failed;

    assert(mkdtemp(dir));
    failed = cmocka_run_group_tests(tests, NULL, NULL);
    sst_path_remove_tree(dir);
    return failed;
}
