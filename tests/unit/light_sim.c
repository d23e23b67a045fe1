/* Photometric calibration of simulated cameras from pictures of each kind of board, compressed as cameras do, against
 * the light that the simulator took. `light_sim WORLD.yaml` does the same with a world file and prints the figures. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>

#include "tests/camera_project.h"
#include "tests/sim_test.h"

#include "pipeline/calibration/photometric/photometric.h"
#include "pipeline/image/codec.h"
#include "simulators/scene/world/world_internal.h"

struct shoot {
    const struct sst_sim_settings *settings;
    const struct sim_stage *stage;
    struct sst_board board;
    struct sst_calib calib;
    struct sst_photometric_samples all;
    int cam;
};

static struct sst_board board_of(const struct sst_sim_board *b)
{
    static const enum sst_board_kind kinds[] = { 0, SST_BOARD_CHESSBOARD, SST_BOARD_CHARUCO, SST_BOARD_APRILGRID };

    return (struct sst_board){
        .kind = kinds[b->kind], .cols = b->cols, .rows = b->rows, .square_mm = b->square_mm, .marker = b->marker
    };
}

/* A point of the board from its centre, mm. */
static void point_of(const struct sst_sim_board *b, int id, double out[2])
{
    double width, height;

    sim_board_size(b, &width, &height);
    if (b->kind == SST_SIM_APRILGRID) {
        const double pitch = (1 + b->marker) * b->square_mm, gap = b->marker * b->square_mm;

        out[0] = gap + id / 4 % b->cols * pitch + ((id & 3) == 1 || (id & 3) == 2 ? b->square_mm : 0);
        out[1] = gap + id / 4 / b->cols * pitch + ((id & 3) >= 2 ? b->square_mm : 0);
    } else {
        out[0] = (id % (b->cols - 1) + 1) * b->square_mm;
        out[1] = (id / (b->cols - 1) + 1) * b->square_mm;
    }
    out[0] -= width / 2;
    out[1] -= height / 2;
}

/* The corners, from the truth. */
static struct sst_detection detect(const struct shoot *s, int frame)
{
    const struct sst_sim_board *b = sim_stage_board(s->stage);
    const bool tags = b->kind == SST_SIM_APRILGRID;
    const int points = tags ? 4 * b->cols * b->rows : (b->cols - 1) * (b->rows - 1);
    struct sst_detection d = { .view = s->cam, .frame = frame, .corner = calloc((size_t)points, sizeof(*d.corner)) };
    double r[9];

    assert_non_null(d.corner);
    sim_rotation(b->pose[frame].rotation_deg, r);
    for (int id = 0; id < points; id++) {
        double at[2], p[3], x, y;

        point_of(b, id, at);
        for (int i = 0; i < 3; i++)
            p[i] = b->pose[frame].position_mm[i] + r[3 * i] * at[0] + r[3 * i + 1] * at[1];
        if (camera_project(&s->calib.camera[s->cam], p, &x, &y) && x >= 2 && y >= 2 && x <= s->calib.width - 3 &&
            y <= s->calib.height - 3)
            d.corner[d.corners++] = (struct sst_corner){ id, x, y, 1 };
    }
    return d;
}

static int take(void *arg, int frame, const struct sst_image *image)
{
    struct shoot *s = arg;
    struct sst_detection d = detect(s, frame);
    struct sim_jpeg jpeg;
    struct sst_image seen = { 0 };
    int err = sim_jpeg_encode(image, s->settings->quality, false, &jpeg);

    assert_int_equal(err, 0);
    assert_int_equal(sst_image_decode(&seen, jpeg.data, jpeg.bytes, "frame"), 0);
    err = sst_photometric_collect(&s->all, &s->board, &seen, &d);
    free(jpeg.data);
    free(d.corner);
    sst_image_fini(&seen);
    return err;
}

static void shoot_all(struct shoot *s)
{
    const struct sst_sim_settings *c = s->settings;

    assert_int_equal(sst_calib_init(&s->calib, c->rows, c->cols), 0);
    s->board = board_of(sim_stage_board(s->stage));
    s->calib.width = c->width;
    s->calib.height = c->height;
    for (s->cam = 0; s->cam < c->rows * c->cols; s->cam++) {
        const struct sim_camera *from = sim_stage_camera(s->stage, s->cam);
        struct sst_calib_camera *to = &s->calib.camera[s->cam];

        *to = (struct sst_calib_camera){ .known = true,
                                         .fx = from->fx,
                                         .fy = from->fy,
                                         .cx = from->cx,
                                         .cy = from->cy,
                                         .lens = 5,
                                         .gain = { 1, 1, 1 } };
        memcpy(to->k, from->distortion, sizeof(from->distortion));
        memcpy(to->rotation, from->rotation, sizeof(to->rotation));
        memcpy(to->position_mm, from->position_mm, sizeof(to->position_mm));
        assert_int_equal(sim_stage_loop(s->stage, s->cam, take, s), 0);
    }
}

/* Light that the camera takes at a place: the measured one, and the truth. */
static double found_at(const struct shoot *s, int cam, int colour, double x, double y)
{
    const struct sst_calib_camera *c = &s->calib.camera[cam];
    const double half2 = (s->calib.width * s->calib.width + s->calib.height * s->calib.height) / 4.0;
    const double r2 = ((x - c->cx) * (x - c->cx) + (y - c->cy) * (y - c->cy)) / half2;

    return c->gain[colour] * (1 + r2 * (c->falloff[0] + r2 * (c->falloff[1] + r2 * c->falloff[2])));
}

static double truth_at(const struct shoot *s, int cam, int colour, double x, double y)
{
    const struct sst_calib_camera *c = &s->calib.camera[cam];
    const double dx = x - c->cx, dy = y - c->cy;
    const double half2 = (s->calib.width * s->calib.width + s->calib.height * s->calib.height) / 4.0;

    return sim_stage_camera(s->stage, cam)->gain[colour] * (1 - s->settings->vignetting * (dx * dx + dy * dy) / half2);
}

/* Errors of the gains (light at the principal point, over the array's mean) and of the corners against it. */
static void judge(const struct shoot *s, double *gain, double *gain_rms, double *corner, double *corner_rms)
{
    const int cams = s->calib.rows * s->calib.cols;
    int n = 0;

    *gain = *gain_rms = *corner = *corner_rms = 0;
    for (int c = 0; c < 3; c++) {
        double mean = 0;

        for (int k = 0; k < cams; k++) {
            const struct sst_calib_camera *cam = &s->calib.camera[k];

            mean += log(found_at(s, k, c, cam->cx, cam->cy) / truth_at(s, k, c, cam->cx, cam->cy)) / cams;
        }
        for (int k = 0; k < cams; k++) {
            const struct sst_calib_camera *cam = &s->calib.camera[k];
            const double at = log(found_at(s, k, c, cam->cx, cam->cy) / truth_at(s, k, c, cam->cx, cam->cy));

            *gain = fmax(*gain, fabs(at - mean));
            *gain_rms += (at - mean) * (at - mean);
            for (int i = 0; i < 4; i++) {
                const double x = i & 1 ? s->calib.width - 1 : 0, y = i & 2 ? s->calib.height - 1 : 0;
                const double e = log(found_at(s, k, c, x, y) / truth_at(s, k, c, x, y)) - at;

                *corner = fmax(*corner, fabs(e));
                *corner_rms += e * e / 4;
            }
            n++;
        }
    }
    *gain_rms = sqrt(*gain_rms / n);
    *corner_rms = sqrt(*corner_rms / n);
}

struct result {
    struct sst_photometric_report report;
    double gain, gain_rms, corner, corner_rms;
};

static struct result calibrate(const char *world)
{
    struct sst_sim_settings settings;
    struct sim_stage *stage = NULL;
    struct shoot s = { .settings = &settings };
    struct result r;

    assert_int_equal(sst_sim_settings_read(&settings, world), 0);
    assert_int_equal(sim_stage_open(&stage, &settings), 0);
    s.stage = stage;
    shoot_all(&s);
    assert_int_equal(sst_photometric_solve(&s.calib, &s.all, &r.report), 0);
    judge(&s, &r.gain, &r.gain_rms, &r.corner, &r.corner_rms);
    print_message("%d samples of %d cameras: gains to %.2f %% (RMS %.2f), corners to %.2f %% (RMS %.2f), spread of a "
                  "patch %.2f %% before, %.2f %% after\n",
                  r.report.samples, r.report.cameras, 100 * r.gain, 100 * r.gain_rms, 100 * r.corner,
                  100 * r.corner_rms, 100 * r.report.before, 100 * r.report.after);
    assert_null(sst_calib_fault(&s.calib));
    sst_photometric_samples_fini(&s.all);
    sst_calib_fini(&s.calib);
    sim_stage_close(stage);
    return r;
}

static void check_board(const char *board, double gain, double corner)
{
    char text[640];
    struct result r;

    snprintf(text, sizeof(text),
             "scene: board\ngrid: [2, 2]\nsize: [640, 480]\nseed: 3\nstrip: false\n"
             "jpeg_quality: 95\noptics: {distortion: [-0.1, 0.02, 0, 0, 0], vignetting: 0.3}\n"
             "mounting: {rotation_spread_deg: 0.4}\nsensor: {gain_spread_percent: 4, "
             "balance_spread_percent: 3, full_well_e: 12000, read_noise_e: 6}\nboard: %s\n",
             board);
    assert_int_equal(sst_file_write(test_path("w.yaml"), text, strlen(text)), 0);
    r = calibrate(test_path("w.yaml"));
    assert_int_equal(r.report.cameras, 4);
    if (!(r.gain < gain) || !(r.corner < corner))
        fail_msg("%s: errors of the gains %g, of the corners %g", board, r.gain, r.corner);
}

static void light_of_a_chessboard(void **state SST_UNUSED)
{
    check_board("{kind: chessboard, squares: [9, 7], square_mm: 50, poses: 8}", 0.005, 0.02);
}

/* Rims are thin: 30 samples of each camera leave the corners to the usual fall-off. */
static void light_of_a_charuco_board(void **state SST_UNUSED)
{
    check_board("{kind: charuco, squares: [6, 5], square_mm: 85, poses: 8}", 0.005, 0.06);
}

static void light_of_an_aprilgrid(void **state SST_UNUSED)
{
    check_board("{kind: aprilgrid, squares: [6, 6], square_mm: 50, poses: 8}", 0.005, 0.02);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(light_of_a_chessboard),
        cmocka_unit_test(light_of_a_charuco_board),
        cmocka_unit_test(light_of_an_aprilgrid),
    };

    if (argc > 1) {
        calibrate(argv[1]);
        return 0;
    }
    return cmocka_run_group_tests(tests, test_folder_create, test_folder_remove);
}
