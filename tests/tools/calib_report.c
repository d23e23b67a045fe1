/* Writes reports of made-up solutions, for tests/system/calib_report.sh and to view the page.
 *
 *   calib_report OUT.html [name=value ...]   prints the text, then the JSON object
 * rows=6 cols=6 frames=100 across=15 down=10 width=2000 height=1500 noise=0.1 outliers=0.003 hole=-1 unsolved=-1
 * bent=-1 moved=-1 rig=0 light=1 pictures=1 nasty=0 (names with markup) cross=0.061 (nan: not done) plain=0 (nothing
 * optional) forgotten=0 (all figures unknown) */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "base/clock.h"
#include "pipeline/calibration/report/report.h"
#include "tests/calib_solution.h"

static struct {
    const char *name;
    double value;
} options[] = {
    { "rows", 6 },      { "cols", 6 },      { "frames", 100 },  { "across", 15 },      { "down", 10 },
    { "width", 2000 },  { "height", 1500 }, { "noise", 0.1 },   { "outliers", 0.003 }, { "hole", -1 },
    { "unsolved", -1 }, { "bent", -1 },     { "moved", -1 },    { "rig", 0 },          { "light", 1 },
    { "pictures", 1 },  { "nasty", 0 },     { "cross", 0.061 }, { "plain", 0 },        { "forgotten", 0 },
};

static double option(const char *name)
{
    for (size_t i = 0; i < ARRAY_LEN(options); i++) {
        if (!strcmp(options[i].name, name))
            return options[i].value;
    }
    abort();
}

static void set_option(const char *text)
{
    const char *end = strchr(text, '=');

    for (size_t i = 0; end && i < ARRAY_LEN(options); i++) {
        if (strlen(options[i].name) == (size_t)(end - text) && !strncmp(options[i].name, text, (size_t)(end - text))) {
            options[i].value = strtod(end + 1, NULL);
            return;
        }
    }
    fprintf(stderr, "calib_report: no setting %s\n", text);
    exit(2);
}

/* Squares between the corners of a detection, roughly: enough to see whether marks sit where they belong. */
static int picture(void *arg, int view, int frame, struct sst_image *out)
{
    const struct made *m = arg;
    int err = sst_image_init(out, m->cfg.width, m->cfg.height);

    for (int c = 0; c < 3 && !err; c++) {
        for (int y = 0; y < out->height; y++)
            memset(sst_image_row(out, c, y), 90 + 20 * c + view, (size_t)out->width);
        for (int i = 0; i < m->all.count; i++) {
            const struct sst_detection *d = &m->all.detection[i];

            for (int j = 0; j < d->corners && d->view == view && d->frame == frame; j++) {
                const int x = (int)d->corner[j].x, y = (int)d->corner[j].y;

                for (int q = -12; q < 12; q++) {
                    if (y + q >= 0 && y + q < out->height && x >= 12 && x + 12 < out->width)
                        memset(sst_image_row(out, c, y + q) + x - 12 + (q < 0 ? 0 : 12), 235, 12);
                }
            }
        }
    }
    return err;
}

static void rectified(struct sst_rectified *r, const struct made *m)
{
    *r = (struct sst_rectified){ .rows = m->cfg.rows,
                                 .cols = m->cfg.cols,
                                 .width = m->cfg.width,
                                 .height = m->cfg.height,
                                 .focal_px = 2250,
                                 .rotation = { 1, 0, 0, 0, 1, 0, 0, 0, 1 },
                                 .spacing_mm = 60,
                                 .out_rms_mm = 0.66,
                                 .out_max_mm = 1.7,
                                 .lattice_rms_mm = 0.69,
                                 .lattice_max_mm = 1.4,
                                 .step_mm = { 60.02, 59.98 },
                                 .skew_deg = 0.04 };
}

static void nasty_names(struct made *m)
{
    const int last = m->cfg.rows * m->cfg.cols - 1;

    snprintf(m->solution.calib.camera[0].name, 64, "<script>alert(\"1\")</script>&'");
    snprintf(m->solution.calib.camera[last].name, 64,
             "K\xC3\xBC"
             "che \xE2\x82\xAC \xFF\xC3(\x01 ]]> %%s");
    snprintf(m->all.frame_name[0], 64, "</td><b title='x'>&amp;");
    snprintf(m->solution.calib.source, 64, "</style><script>\xED\xA0\x80");
    snprintf(m->solution.calib.board, 64, "<!-- -->");
}

int main(int argc, char **argv)
{
    struct made_config cfg = made_defaults();
    struct sst_photometric_report light = {
        .samples = 41872, .cameras = 36, .before = 0.062, .after = 0.007, .worst_falloff = 0.31, .worst_gain = 0.053
    };
    struct sst_rectified plan;
    struct made m;
    char *json = NULL;
    int64_t begun;

    for (int i = 2; i < argc; i++)
        set_option(argv[i]);
    if (argc < 2)
        return 2;
    cfg.rows = (int)option("rows"), cfg.cols = (int)option("cols"), cfg.frames = (int)option("frames");
    cfg.across = (int)option("across"), cfg.down = (int)option("down");
    cfg.width = (int)option("width"), cfg.height = (int)option("height");
    cfg.noise_px = option("noise"), cfg.outliers = option("outliers");
    cfg.hole = (int)option("hole"), cfg.unsolved = (int)option("unsolved");
    cfg.bent = (int)option("bent"), cfg.moved = (int)option("moved"), cfg.rig = option("rig") > 0;
    made_open(&m, &cfg);
    m.solution.cv_px = option("cross");
    rectified(&plan, &m);
    if (option("nasty") > 0)
        nasty_names(&m);
    struct sst_calibration_report report = { .detections = &m.all,
                                             .solution = &m.solution,
                                             .light = &light,
                                             .rectified = &plan,
                                             .picture = picture,
                                             .arg = &m };
    if (option("light") <= 0)
        report.light = NULL;
    if (option("pictures") <= 0)
        report.picture = NULL;
    if (option("plain") > 0) {
        report.rectified = NULL, report.light = NULL, report.picture = NULL;
        free(m.solution.lens_sigma);
        free(m.solution.transfer_sigma);
        m.solution.lens_sigma = NULL, m.solution.transfer_sigma = NULL;
    }
    if (option("forgotten") > 0)
        made_forget(&m);
    begun = sst_clock_now_ns();
    if (sst_calibration_report_write(argv[1], &report))
        return 1;
    fprintf(stderr, "written in %.0f ms\n", (double)(sst_clock_now_ns() - begun) / 1e6);
    json = sst_calibration_report_text(stdout, &report) ? NULL : sst_calibration_report_json(&report);
    if (json)
        puts(json);
    free(json);
    made_close(&m);
    return json == NULL;
}
