/* sst calibrate: corners, solution, light, report; and the check of a calibration that is in use. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/file.h"
#include "base/log.h"
#include "base/text.h"
#include "base/thread.h"
#include "cli/cli_internal.h"
#include "cli/render_internal.h"
#include "pipeline/calibration/drift/drift.h"
#include "pipeline/calibration/report/report.h"
#include "pipeline/image/codec.h"

struct check {
    const char *dir;
    unsigned load;       /* SST_LOAD_UNVERIFIED, or 0 */
    int threads;         /* 0: all processors */
    const char *picture; /* PNG of the grid to write, or NULL */
    bool json;
};

/* --- check of a light field --------------------------------------------------------------------------------------- */

static const char *const state_names[] = { "measured", "blank", "lost" };

/* --- JSON --------------------------------------------------------------------------------------------------------- */

static json_t *camera_json(const struct sst_drift_camera *c, int view, int cols)
{
    return json_pack(
        "{s:i, s:i, s:b, s:b, s:b, s:o, s:o, s:o, s:o, s:o, s:o, s:o, s:o}", "row", view / cols, "col", view % cols,
        "known", c->known, "drifted", c->drifted, "lost", c->lost, "shift_x_px",
        cli_real_json(c->known ? c->shift_x_px : NAN), "shift_y_px", cli_real_json(c->known ? c->shift_y_px : NAN),
        "sigma_px", cli_real_json(c->known ? c->sigma_px : NAN), "roll_deg",
        cli_real_json(c->known ? c->roll_deg : NAN), "scale", cli_real_json(c->known ? c->scale : NAN), "off_px",
        cli_real_json(c->known ? c->off_px : NAN), "off_sigma_px", cli_real_json(c->known ? c->off_sigma_px : NAN),
        "residual_px", cli_real_json(c->known ? c->residual_px : NAN));
}

static json_t *pair_json(const struct sst_drift_pair *p, int cols)
{
    const bool any = p->state == SST_DRIFT_PAIR_MEASURED;

    return json_pack("{s:[i,i], s:[i,i], s:s, s:i, s:i, s:o, s:o, s:o}", "a", p->a / cols, p->a % cols, "b",
                     p->b / cols, p->b % cols, "state", state_names[p->state], "features", p->features, "matches",
                     p->matches, "mean_px", cli_real_json(any ? p->mean_px : NAN), "rms_px",
                     cli_real_json(any ? p->rms_px : NAN), "p95_px", cli_real_json(any ? p->p95_px : NAN));
}

static json_t *check_json(const struct sst_drift *c)
{
    json_t *cameras = json_array(), *pairs = json_array(), *swapped = json_null();

    for (int v = 0; v < c->rows * c->cols; v++)
        json_array_append_new(cameras, camera_json(&c->camera[v], v, c->cols));
    for (int i = 0; i < c->pairs; i++)
        json_array_append_new(pairs, pair_json(&c->pair[i], c->cols));
    if (c->swapped_a >= 0)
        swapped = json_pack("[[i,i],[i,i]]", c->swapped_a / c->cols, c->swapped_a % c->cols, c->swapped_b / c->cols,
                            c->swapped_b % c->cols);
    return json_pack("{s:s, s:s, s:i, s:i, s:f, s:f, s:i, s:i, s:i, s:o, s:o, s:o, s:o, s:i, s:o, s:[f,f], s:o, s:o, "
                     "s:o}",
                     "verdict", sst_drift_verdict_name(c->verdict), "sentence", c->sentence, "rows", c->rows, "cols",
                     c->cols, "ok_px", c->ok_px, "unusable_px", c->unusable_px, "pairs_checked", c->pairs,
                     "pairs_measured", c->measured, "matches", c->matches, "mean_px", cli_real_json(c->mean_px),
                     "p95_px", cli_real_json(c->p95_px), "max_px", cli_real_json(c->max_px), "axes_px",
                     cli_real_json(c->axes_px), "far_matches", c->far_matches, "far_p95_px",
                     cli_real_json(c->far_p95_px), "range_px", c->range_min_px, c->range_max_px, "swapped", swapped,
                     "cameras", cameras, "pairs", pairs);
}

/* --- tables ------------------------------------------------------------------------------------------------------- */

static void print_cameras(const struct sst_drift *c)
{
    puts("camera   right px    down px   sigma px  roll deg  scale %    off px  pairs RMS px");
    for (int v = 0; v < c->rows * c->cols; v++) {
        const struct sst_drift_camera *k = &c->camera[v];

        printf("%02d_%02d", v / c->cols, v % c->cols);
        cli_print_cell(k->known ? k->shift_x_px : NAN, 11, 3);
        cli_print_cell(k->known ? k->shift_y_px : NAN, 10, 3);
        cli_print_cell(k->known ? k->sigma_px : NAN, 10, 3);
        cli_print_cell(k->known ? k->roll_deg : NAN, 9, 4);
        cli_print_cell(k->known ? 100 * k->scale : NAN, 8, 3);
        cli_print_cell(k->known ? k->off_px : NAN, 9, 3);
        cli_print_cell(k->known ? k->residual_px : NAN, 13, 3);
        puts(k->lost ? "  lost" : k->drifted ? "  drifted" : "");
    }
}

static void print_pairs(const struct sst_drift *c)
{
    puts("pair          features  matches   mean px    RMS px    p95 px");
    for (int i = 0; i < c->pairs; i++) {
        const struct sst_drift_pair *p = &c->pair[i];
        const bool any = p->state == SST_DRIFT_PAIR_MEASURED;

        printf("%02d_%02d %02d_%02d %10d %8d", p->a / c->cols, p->a % c->cols, p->b / c->cols, p->b % c->cols,
               p->features, p->matches);
        cli_print_cell(any ? p->mean_px : NAN, 9, 3);
        cli_print_cell(any ? p->rms_px : NAN, 9, 3);
        cli_print_cell(any ? p->p95_px : NAN, 9, 3);
        puts(any ? "" : p->state == SST_DRIFT_PAIR_LOST ? "  does not match" : "  too little texture");
    }
}

static void print_tables(const struct sst_drift *c)
{
    print_cameras(c);
    putchar('\n');
    print_pairs(c);
    printf("\nepipolar error over %d of %d pairs: mean", c->measured, c->pairs);
    cli_print_cell(c->mean_px, 0, 3);
    printf(", p95");
    cli_print_cell(c->p95_px, 0, 3);
    printf(", largest pair");
    cli_print_cell(c->max_px, 0, 3);
    printf(" px\nopposite corners: p95");
    cli_print_cell(c->far_p95_px, 0, 3);
    printf(" px, %d matches\nrows against columns: disparities differ by", c->far_matches);
    cli_print_cell(c->axes_px, 0, 3);
    puts(" px per spacing");
}

/* --- verdict ------------------------------------------------------------------------------------------------------ */

static int write_picture(const struct sst_drift *c, const char *path)
{
    struct sst_image picture;
    int err = sst_drift_picture(&picture, c);

    if (err)
        return err;
    err = sst_image_write_png(&picture, path);
    sst_image_fini(&picture);
    return err;
}

static int run_check(const struct cli_command *cmd, const struct check *args)
{
    const struct sst_drift_config cfg = { .threads = args->threads };
    struct sst_lightfield lf;
    struct sst_drift check;
    int code, err = sst_lightfield_load(&lf, args->dir, SST_LOAD_IMAGES | args->load, sst_thread_count(args->threads));

    if (err)
        return cli_exit_code(err);
    err = sst_drift_check(&check, &lf, &cfg);
    sst_lightfield_fini(&lf);
    if (err)
        return cli_exit_code(err);
    code = cli_exit_code(args->picture ? write_picture(&check, args->picture) : 0);
    if (code == CLI_OK && args->json)
        code = cli_print_json(check_json(&check));
    else if (code == CLI_OK)
        print_tables(&check);
    if (code == CLI_OK && check.verdict == SST_DRIFT_OK && !args->json)
        puts(check.sentence);
    if (code == CLI_OK && check.verdict != SST_DRIFT_OK) {
        sst_log_error("%s: %s: %s", cmd->name, args->dir, check.sentence);
        code = CLI_INPUT;
    }
    sst_drift_fini(&check);
    return code;
}

/* --- options ------------------------------------------------------------------------------------------------------ */

struct options {
    const char *source, *out, *board, *config, *keep, *lenses, *report, *coverage, *corners, *picture;
    bool live, check, json, force, no_light, no_cross, flat;
    int lens;
    double max_blur_px, rate_hz, outliers_percent;
    struct sst_gather_selection pick;
    struct sst_gather_live_config limits; /* live */
    int threads;
    bool no_verify;
};

#define SCALE_OFF 0.05 /* relative tolerance of the spacing against the configuration */

/* One run, from the pictures to the files. */
struct job {
    const struct options *o;
    struct sst_gather_source source; /* pictures for the report; none: path NULL */
    double spacing_mm;               /* of the array by its configuration; 0: unknown */
    struct sst_gathered gathered;
    struct sst_calib lenses; /* kept intrinsics; camera NULL: none */
    struct sst_solution solution;
    bool solved, lit;
    int overridden; /* refusals that --force turned into warnings */
    struct sst_photometric_report light;
    struct sst_rectified *rectified; /* NULL: one camera */
};

static int picture(void *arg, int view, int frame, struct sst_image *out)
{
    const struct job *job = arg;

    return sst_gather_source_read(&job->source, view, frame, out);
}

/* --- corners ------------------------------------------------------------------------------------------------------ */

/* The grid of the command line; bound cameras have their positions already. */
static int set_grid(struct sst_array_config *array, const int grid[2])
{
    if (!grid[0])
        return 0;
    if (array->bound && (grid[0] != array->rows || grid[1] != array->cols)) {
        sst_log_error(
            "--grid %dx%d does not fit the configuration, which binds cameras to a grid of %dx%d; leave it out",
            grid[0], grid[1], array->rows, array->cols);
        return -EINVAL;
    }
    if (grid[0] * grid[1] > SST_CAMERAS_MAX) {
        sst_log_error("--grid %dx%d holds more than %d cameras", grid[0], grid[1], SST_CAMERAS_MAX);
        return -EINVAL;
    }
    array->rows = grid[0];
    array->cols = grid[1];
    return 0;
}

/* --- cameras now -------------------------------------------------------------------------------------------------- */

struct live {
    struct sst_recorder *recorder; /* NULL: not recorded */
    const char *coverage;          /* picture to update, or NULL */
    int drawn;                     /* frames in it */
};

static struct sst_gather_live *running;

static void on_signal(int sig)
{
    (void)sig;
    if (running)
        sst_gather_live_stop(running);
}

static int on_frameset(void *arg, const struct sst_frameset *set)
{
    struct live *l = arg;

    return l->recorder ? sst_recorder_write(l->recorder, set) : 0;
}

static int on_status(void *arg, const struct sst_gather_status *s)
{
    struct live *l = arg;

    if (!s->accepted) {
        fprintf(stderr, "%d sets, and no camera has seen the board yet\n", s->framesets);
        return 0;
    }
    fprintf(stderr, "%d of %d sets accepted, coverage %.0f %%; camera %d,%d (%s) lacks most: %s\n", s->accepted,
            s->framesets, 100 * s->coverage, s->row, s->col, s->camera, s->missing[0] ? s->missing : "nothing");
    if (!l->coverage || l->drawn == s->accepted)
        return 0;
    l->drawn = s->accepted;
    return sst_gather_write_coverage(s->all, l->coverage);
}

static int run_live(struct job *job, int **frameset, const struct sst_gather_config *cfg,
                    struct sst_gather_live_config *config)
{
    struct live l = { .coverage = job->o->coverage };
    const struct sigaction act = { .sa_handler = on_signal };
    struct sst_gather_live *live = NULL;
    struct sst_recorder_config rec;
    struct sigaction old[2];
    int err, closed;

    config->frameset = on_frameset;
    config->status = on_status;
    config->arg = &l;
    err = sst_gather_live_open(&live, cfg, config);
    if (!err && job->o->keep) {
        sst_recorder_config_defaults(&rec);
        rec.dir = job->o->keep;
        err = cli_open_recorder(&l.recorder, config->array, &rec);
    }
    if (!err) {
        running = live;
        sigaction(SIGINT, &act, &old[0]);
        sigaction(SIGTERM, &act, &old[1]);
        err = sst_gather_live_run(live, &job->gathered, frameset);
        sigaction(SIGINT, &old[0], NULL);
        sigaction(SIGTERM, &old[1], NULL);
        running = NULL;
    }
    sst_gather_live_close(live);
    closed = sst_recorder_close(l.recorder);
    return err ? err : closed;
}

static int gather_live(struct job *job, const struct sst_gather_config *cfg)
{
    const struct options *o = job->o;
    struct sst_array_config *array = malloc(sizeof(*array));
    struct sst_gather_live_config live = o->limits;
    const struct sst_gather_selection all = { .max = 0 };
    int *frameset = NULL;
    int err = array ? 0 : -ENOMEM;

    err = err ? err : sst_array_config_read(array, o->config);
    err = err ? err : set_grid(array, o->pick.grid);
    if (!err) {
        array->trigger_hz = o->rate_hz;
        if (array->source == SST_CONFIG_FREE_RUN)
            array->rate_hz = o->rate_hz;
        live.array = array;
        fprintf(stderr, "hold the board before the cameras, near and far, tilted every way; Ctrl-C ends early%s%s\n",
                o->coverage ? "; coverage: " : "", o->coverage ? o->coverage : "");
        job->spacing_mm = array->spacing_mm;
        err = run_live(job, &frameset, cfg, &live);
    }
    if (!err && o->keep) { /* pictures for the report: of the accepted framesets */
        err = sst_gather_source_open(&job->source, o->keep, &all);
        if (!err) {
            free(job->source.frameset);
            job->source.frameset = frameset;
            frameset = NULL;
        }
    }
    free(frameset);
    free(array);
    return err;
}

/* A file of corners instead of pictures. */
static bool is_corners_file(const char *source)
{
    return source && sst_text_ends(source, ".json");
}

static int gather(struct job *job)
{
    const struct options *o = job->o;
    struct sst_gather_config cfg = { .light = !o->no_light, .threads = o->threads };
    int err;

    cfg.detect.max_blur_px = o->max_blur_px;
    cfg.detect.quick = o->live;
    if (is_corners_file(o->source))
        return sst_detections_read(&job->gathered.all, o->source);
    err = sst_board_parse(&cfg.board, o->board);
    if (!err && o->live)
        return gather_live(job, &cfg);
    err = err ? err : sst_gather_source_open(&job->source, o->source, &o->pick);
    if (!err) {
        job->spacing_mm = job->source.spacing_mm;
        cfg.progress = cli_progress;
        cfg.arg = (void *)(uintptr_t) "corners";
        err = sst_gather(&job->gathered, &job->source, &cfg);
        cli_progress_end();
    }
    return err;
}

/* --- solution ----------------------------------------------------------------------------------------------------- */

static int solve(struct job *job)
{
    const struct options *o = job->o;
    struct sst_solve_config cfg = { .lens = o->lens, .force = o->force, .flat = o->flat, .threads = o->threads };
    struct sst_calib *calib = &job->solution.calib;
    int err = 0;

    cfg.overridden = &job->overridden;
    cfg.cross_validate = !o->no_cross;
    cfg.max_outliers = o->outliers_percent / 100;
    cfg.progress = cli_progress;
    cfg.progress_arg = (void *)(uintptr_t) "solve";
    if (o->lenses) {
        err = sst_calib_read(&job->lenses, o->lenses);
        cfg.lenses = &job->lenses;
    }
    err = err ? err : sst_solve(&job->solution, &job->gathered.all, &cfg);
    cli_progress_end();
    if (err)
        return err;
    job->solved = true;
    calib->created_wall_ns = sst_clock_wall_ns();
    snprintf(calib->source, sizeof(calib->source), "%s", o->source ? o->source : o->keep ? o->keep : "live cameras");
    sst_board_format(&job->gathered.all.board, calib->board);
    return 0;
}

static int known_cameras(const struct sst_calib *c)
{
    int known = 0;

    for (int k = 0; k < c->rows * c->cols; k++)
        known += c->camera[k].known;
    return known;
}

static int light(struct job *job)
{
    int err;

    if (job->o->no_light || !job->gathered.light.count || known_cameras(&job->solution.calib) < 2)
        return 0;
    err = sst_photometric_solve(&job->solution.calib, &job->gathered.light, &job->light);
    job->lit = !err;
    return err == -ENODATA ? 0 : err;
}

/* The lattice, for the report; a single camera has none. */
static int lattice(struct job *job)
{
    const struct sst_rectify_config cfg = { .plane_mm = -1 };
    const struct sst_calib *c = &job->solution.calib;
    char why[SST_LOG_MAX] = "", *before;
    int err;

    if (known_cameras(c) < 2)
        return 0;
    job->rectified = calloc(1, sizeof(*job->rectified));
    if (!job->rectified)
        return -ENOMEM;
    before = job->o->force ? sst_log_hold_errors(why) : NULL;
    err = sst_rectify_plan(job->rectified, c, &cfg);
    if (job->o->force)
        sst_log_hold_errors(before);
    if (err && job->o->force) {
        sst_log_warning("%s", why);
        job->overridden++;
        free(job->rectified);
        job->rectified = NULL;
        return 0;
    }
    return err;
}

/* The board alone gives the scale: a known spacing of the array reveals a wrong size of its squares. */
static int check_scale(struct job *job)
{
    const struct sst_rectified *r = job->rectified;
    const struct sst_board *board = &job->gathered.all.board;
    const double ratio = r && job->spacing_mm > 0 ? r->spacing_mm / job->spacing_mm : 1;

    if (fabs(ratio - 1) <= SCALE_OFF)
        return 0;
    if (job->o->force) {
        job->overridden++;
        sst_log_warning("the solved spacing of the cameras is %.4g mm, but the array's configuration has %.4g mm",
                        r->spacing_mm, job->spacing_mm);
        return 0;
    }
    sst_log_error(
        "the solved spacing of the cameras is %.4g mm, but the array's configuration has %.4g mm: is the board's %s "
        "%.4g mm instead of %.4g mm (--board), or array: spacing_mm wrong? --force keeps it as it is",
        r->spacing_mm, job->spacing_mm, board->kind == SST_BOARD_APRILGRID ? "tag" : "square", board->square_mm / ratio,
        board->square_mm);
    return -EBADMSG;
}

static int deliver(const struct job *job)
{
    const struct options *o = job->o;
    const struct sst_calibration_report report = { .detections = &job->gathered.all,
                                                   .solution = &job->solution,
                                                   .light = job->lit ? &job->light : NULL,
                                                   .rectified = job->rectified,
                                                   .overridden = job->overridden,
                                                   .picture = job->source.path ? picture : NULL,
                                                   .arg = (void *)(uintptr_t)job };
    int err = o->out ? sst_calib_write(&job->solution.calib, o->out) : 0;

    if (!err && o->report)
        err = sst_calibration_report_write(o->report, &report);
    if (!err && o->json) {
        char *text = sst_calibration_report_json(&report);

        if (!text)
            return -ENOMEM;
        puts(text);
        free(text);
    } else if (!err) {
        err = sst_calibration_report_text(stdout, &report);
    }
    return err;
}

static int calibrate(const struct options *o)
{
    struct job *job = calloc(1, sizeof(*job));
    int err;

    if (!job)
        return CLI_MEMORY;
    job->o = o;
    err = gather(job);
    if (!err && o->coverage)
        err = sst_gather_write_coverage(&job->gathered.all, o->coverage);
    if (!err && o->corners)
        err = sst_detections_write(&job->gathered.all, o->corners);
    err = err ? err : solve(job);
    err = err ? err : light(job);
    err = err ? err : lattice(job);
    err = err ? err : check_scale(job);
    err = err ? err : deliver(job);
    if (job->solved)
        sst_solution_fini(&job->solution);
    sst_gathered_fini(&job->gathered);
    sst_gather_source_close(&job->source);
    sst_calib_fini(&job->lenses);
    free(job->rectified);
    free(job);
    return cli_exit_code(err);
}

/* --- command line ------------------------------------------------------------------------------------------------- */

static int check_options(const struct cli_command *cmd, const struct options *o)
{
    if (o->live == (o->source != NULL))
        return cli_usage_error(cmd, "give either a source of pictures or --live");
    if (!o->out)
        return cli_usage_error(cmd, "-o calib.yaml is missing");
    if (!o->board && !is_corners_file(o->source))
        return cli_usage_error(cmd, "--board is missing, such as --board charuco:9x7:50mm:0.7");
    if (!o->live && (o->keep || o->config || o->limits.accepted || o->limits.seconds > 0))
        return cli_usage_error(cmd, "--config, --keep, --sets and --duration belong to --live");
    if (o->live && (o->pick.plain_names || o->pick.rig || o->pick.every || o->pick.max))
        return cli_usage_error(cmd,
                               "--plain-names, --rig, --every and --max-frames belong to pictures that exist already");
    if (is_corners_file(o->source) && (o->board || o->pick.grid[0] || o->pick.plain_names || o->pick.rig ||
                                       o->pick.every || o->pick.max || o->max_blur_px > 0))
        return cli_usage_error(cmd,
                               "%s has the corners, board and grid: it does not combine with --board, --grid, "
                               "--plain-names, --rig, --every, --max-frames and --max-blur",
                               o->source);
    if (o->picture)
        return cli_usage_error(cmd, "--picture belongs to --check");
    if (o->no_verify)
        return cli_usage_error(cmd, "--no-verify belongs to --check");
    if (o->lens && o->lens != 5 && o->lens != 8)
        return cli_usage_error(cmd, "--lens is 5 or 8 coefficients");
    return CLI_GO_ON;
}

static bool not_for_check(const struct options *o)
{
    return o->out || o->board || o->live || o->report || o->coverage || o->corners || o->config || o->keep ||
           o->lenses || o->lens || o->flat || o->force || o->no_light || o->no_cross || o->pick.grid[0] ||
           o->pick.plain_names || o->pick.rig || o->pick.every || o->pick.max || o->max_blur_px > 0 ||
           o->outliers_percent > 0 || o->limits.accepted || o->limits.seconds > 0;
}

static int run(const struct cli_command *cmd, int argc, char **argv)
{
    struct options o = { .rate_hz = 1 };
    const struct cli_option options[] = {
        { "output", 'o', CLI_FILE, &o.out, "FILE", "calibration to write (calib.yaml)" },
        { "board", 'b', CLI_STRING, &o.board, "BOARD",
          "charuco:9x7:50mm:0.7, aprilgrid:6x6:50mm:0.3, chessboard:10x7:25mm or a Kalibr target file" },
        { "report", 0, CLI_FILE, &o.report, "FILE", "also write an acceptance report (one HTML file)" },
        { "coverage", 0, CLI_FILE, &o.coverage, "FILE", "picture of each camera's coverage and its gaps (PNG)" },
        { "corners", 0, CLI_FILE, &o.corners, "FILE", "write the corners (JSON); a later run can start from them" },
        { "grid", 0, CLI_GRID, o.pick.grid, "RxC", "rows and columns, where names do not give them", 1,
          SST_CAMERAS_MAX },
        { "plain-names", 0, CLI_FLAG, &o.pick.plain_names, NULL, "names of cameras such as 04_12 are no places" },
        { "rig", 0, CLI_FLAG, &o.pick.rig, NULL, "the views are poses of one camera: one lens for all" },
        { "lens", 0, CLI_INT, &o.lens, "N", "5 or 8 coefficients (default: by held-out frames)", 5, 8 },
        { "lenses", 0, CLI_STRING, &o.lenses, "FILE", "use the lenses of this calibration, solve the poses alone" },
        { "every", 0, CLI_INT, &o.pick.every, "N", "each n-th frame of the source", 1, 1000000 },
        { "max-frames", 0, CLI_INT, &o.pick.max, "N", "at most N frames, spread evenly", 1, 100000 },
        { "max-blur", 0, CLI_DOUBLE, &o.max_blur_px, "PX", "leave out pictures with wider edges; 3", 0.5, 100 },
        { "outliers", 0, CLI_DOUBLE, &o.outliers_percent, "PERCENT", "more outliers than this are a failure; 3", 0.01,
          50 },
        { "flat", 0, CLI_FLAG, &o.flat, NULL, "the board is a plane: do not solve its warp" },
        { "no-light", 0, CLI_FLAG, &o.no_light, NULL, "do not solve gain, colour and fall-off of the cameras" },
        { "no-cross", 0, CLI_FLAG, &o.no_cross, NULL, "no cross-validation (odd against even frames)" },
        { "force", 'f', CLI_FLAG, &o.force, NULL, "turn reasons to refuse the calibration into warnings" },
        { "live", 0, CLI_FLAG, &o.live, NULL, "capture from the cameras now" },
        { "config", 0, CLI_STRING, &o.config, "FILE", "live: configuration of the array; /etc/sst/sstd.yaml" },
        { "keep", 0, CLI_MADE, &o.keep, "DIR", "live: record the sets too" },
        { "rate", 0, CLI_DOUBLE, &o.rate_hz, "HZ", "live: sets per second; 1", 0.01, 30 },
        { "sets", 'n', CLI_INT, &o.limits.accepted, "N", "live: N sets with the board (default: until complete)", 1,
          100000 },
        { "duration", 0, CLI_DOUBLE, &o.limits.seconds, "S", "live: at most S seconds", 0.1, 1e6 },
        { "check", 0, CLI_FLAG, &o.check, NULL, "check the calibration of a light field, by its features alone" },
        { "picture", 0, CLI_FILE, &o.picture, "FILE", "check: picture of the cameras' displacements (PNG)" },
        CLI_NO_VERIFY_OPTION(o.no_verify),
        { "threads", 0, CLI_INT, &o.threads, "N", "threads (default: all processors)", 1, 256 },
        { "json", 0, CLI_FLAG, &o.json, NULL, "print all figures as JSON" },
    };
    const char *args[1];
    int r = cli_parse(cmd, options, ARRAY_LEN(options), argc, argv, args, 0, 1);

    if (r != CLI_GO_ON)
        return r;
    o.source = args[0];
    if (o.check) {
        if (!o.source)
            return cli_usage_error(cmd, "--check needs a light field");
        if (not_for_check(&o))
            return cli_usage_error(cmd, "--check needs a light field alone: it combines with --picture, --no-verify, "
                                        "--json and --threads only");
        return run_check(
            cmd, &(struct check){ o.source, o.no_verify ? SST_LOAD_UNVERIFIED : 0, o.threads, o.picture, o.json });
    }
    r = check_options(cmd, &o);
    return r == CLI_GO_ON ? calibrate(&o) : r;
}

const struct cli_command cli_calibrate = { "calibrate", run };
