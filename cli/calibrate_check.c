#include "cli/cli_internal.h"

#include <math.h>
#include <stdio.h>

#include "base/log.h"
#include "base/thread.h"
#include "pipeline/calibration/drift/drift.h"
#include "pipeline/image/codec.h"

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

/* --- the command -------------------------------------------------------------------------------------------------- */

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

int cli_run_calibrate_check(const struct cli_command *cmd, const struct cli_check *args)
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
