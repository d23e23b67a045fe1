/* sst poses: find or refine the poses of light fields from their pictures. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "cli/cli_internal.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/text.h"
#include "pipeline/posed/solve/solve.h"

#define METRE_MM   1000.0
#define MOST_LF    256 /* on one command line */
#define FOCAL_VAGUE 0.05 /* doubt of a focal length that was found, of which users are warned */
#define FOUND_FOCAL "focal length "
#define FOCAL_MISS 0.1 /* of the focal length: searches with narrow lenses are a few percent off */
#define WIDEST     110.0 /* degrees across the width of a plausible lens that is no fisheye */

struct poses_run {
    int count;
    const char *dir[MOST_LF + 1];
    struct sst_posed *posed;         /* [count] */
    struct sst_posed_solved *solved; /* [count] */
    bool *saved;                     /* [count] the result is in the folder */
    int *given;                      /* [count] poses that the views had */
    char (*origin)[1024];            /* [count] history of the given poses */
};

static json_t *names_json(const struct sst_posed *posed, const bool *doubtful)
{
    json_t *list = json_array();

    for (int k = 0; k < posed->count; k++) {
        if (doubtful ? doubtful[k] : !posed->view[k].camera.known)
            json_array_append_new(list, json_string(posed->view[k].name));
    }
    return list;
}

static json_t *centres_json(const struct sst_posed *posed)
{
    json_t *centres = json_object();

    for (int k = 0; k < posed->count; k++) {
        const struct sst_calib_camera *c = &posed->view[k].camera;

        if (c->known)
            json_object_set_new(centres, posed->view[k].name,
                                json_pack("[f, f, f]", c->position_mm[0] / METRE_MM, c->position_mm[1] / METRE_MM,
                                          c->position_mm[2] / METRE_MM));
    }
    return centres;
}

static json_t *result_json(const struct poses_run *run, int i)
{
    const struct sst_posed *posed = &run->posed[i];
    const struct sst_posed_solved *r = &run->solved[i];
    json_t *free_focal = r->free_focal_px > 0 ? json_real(r->free_focal_px) : json_null();
    json_t *json = json_pack("{s:s, s:i, s:i, s:o, s:o, s:f, s:o, s:i, s:b, s:f, s:o, s:o, s:o, s:s}", "lightfield",
                             run->dir[i], "placed", r->placed, "views", posed->count, "median_px",
                             cli_real_json(r->median_px), "p90_px", cli_real_json(r->p90_px), "focal_px", r->focal_px,
                             "free_focal_px", free_focal, "given", run->given[i], "metric", (int)posed->metric,
                             "spacing", r->spacing_mm / METRE_MM, "unplaced", names_json(posed, NULL), "doubtful",
                             names_json(posed, r->doubtful), "centres", centres_json(posed), "history", posed->history);

    if (r->focal_doubt > 0)
        json_object_set_new(json, "focal_doubt_percent", json_real(100 * r->focal_doubt));
    if (r->sharper > 0)
        json_object_update_new(json, json_pack("{s:f, s:f, s:f}", "sharper", r->sharper, "ground_m",
                                               r->ground_mm / METRE_MM, "ground_tilt_deg", r->ground_tilt_deg));
    if (r->lens_gain > 0)
        json_object_set_new(json, "lens", json_pack("{s:f, s:f, s:f}", "given_focal_px", r->lens_focal_px, "k1", r->lens_k1,
                                                    "sharper", r->lens_gain));
    return json;
}

/* Results that are saved; there is one. */
static int print_json(const struct poses_run *run)
{
    json_t *list;

    if (run->count == 1)
        return cli_print_json(result_json(run, 0));
    list = json_array();
    for (int i = 0; i < run->count; i++) {
        if (run->saved[i])
            json_array_append_new(list, result_json(run, i));
    }
    return cli_print_json(json_pack("{s:o}", "lightfields", list));
}

static void print_names(const char *title, const struct sst_posed *posed, const bool *doubtful)
{
    bool any = false;

    for (int k = 0; k < posed->count; k++) {
        if (doubtful ? doubtful[k] : !posed->view[k].camera.known) {
            printf("%s%s", any ? ", " : title, posed->view[k].name);
            any = true;
        }
    }
    if (any)
        printf("\n");
}

static void print_text(const struct poses_run *run, int i, bool refine)
{
    const struct sst_posed *posed = &run->posed[i];
    const struct sst_posed_solved *r = &run->solved[i];
    const double across = 2 * atan(posed->width / (2 * r->focal_px)) * 180 / M_PI;

    printf("%s: %d of %d views placed", run->dir[i], r->placed, posed->count);
    if (isfinite(r->median_px))
        printf(", residuals %.2f px (median)", r->median_px);
    if (isfinite(r->p90_px))
        printf(", %.2f px (90 %%)", r->p90_px);
    printf(", focal length %.1f px", r->focal_px);
    if (r->focal_doubt > 0)
        printf(" +- %.2g %%", 100 * fmin(r->focal_doubt, 1));
    printf("\n");
    printf("  mean distance of neighbours %.3f %s, %d points\n", r->spacing_mm / METRE_MM,
           posed->metric ? "m" : "(unit unknown)", posed->point_count);
    if (run->given[i] && !refine)
        printf(
            "  these replace %d given poses (%.*s); --refine starts from given poses and keeps their axes and unit\n",
            run->given[i], (int)strcspn(run->origin[i], ";"), run->origin[i][0] ? run->origin[i] : "of unknown origin");
    if (r->focal_doubt > FOCAL_VAGUE)
        printf("  these views hardly fix the focal length, and heights of the scene are as uncertain: if it is known, give it by "
               "--focal PX\n");
    if (across > WIDEST)
        printf("  the focal length may be wrong: the picture would be %.0f degrees wide; it is in pixels, not mm: try "
               "--focal 0, which searches it\n", across);
    else if (r->free_focal_px > 0 && fabs(r->free_focal_px / r->focal_px - 1) > FOCAL_MISS)
        printf("  the focal length may be wrong: the matches ask for %.1f px, %.0f %% %s; try --focal 0, which searches "
               "it, or --lens\n",
               r->free_focal_px, 100 * fabs(r->free_focal_px / r->focal_px - 1),
               r->free_focal_px > r->focal_px ? "more" : "less");
    if (r->lens_gain > 0)
        printf("  one lens for all views by warm places: focal length %.1f px in place of %.1f px, k1 %+.3f before the views' own; "
               "%.2f times as sharp as without; --keep-lens leaves it\n", r->focal_px, r->lens_focal_px, r->lens_k1, r->lens_gain);
    if (r->sharper > 0)
        printf("  %.2f times as sharp as with the given poses, on a ground %.2f %s in front of the middle view, tilted "
               "by %.1f degrees\n",
               r->sharper, r->ground_mm / METRE_MM, posed->metric ? "m" : "(unit unknown)", r->ground_tilt_deg);
    print_names("  not placed, too few matches: ", posed, NULL);
    print_names("  doubtful, away from where its neighbours suggest: ", posed, r->doubtful);
}

static int load(struct poses_run *run)
{
    run->posed = calloc((size_t)run->count, sizeof(*run->posed));
    run->solved = calloc((size_t)run->count, sizeof(*run->solved));
    run->saved = calloc((size_t)run->count, sizeof(*run->saved));
    run->given = calloc((size_t)run->count, sizeof(*run->given));
    run->origin = calloc((size_t)run->count, sizeof(*run->origin));
    if (!run->posed || !run->solved || !run->saved || !run->given || !run->origin)
        return -ENOMEM;
    for (int i = 0; i < run->count; i++) {
        const int err = sst_posed_load(&run->posed[i], run->dir[i]);

        if (err)
            return err;
        run->given[i] = sst_posed_placed(&run->posed[i]);
        memcpy(run->origin[i], run->posed[i].history, sizeof(run->origin[i]));
    }
    return 0;
}

static void run_fini(struct poses_run *run)
{
    for (int i = 0; i < run->count; i++) {
        if (run->posed)
            sst_posed_fini(&run->posed[i]);
        if (run->solved)
            sst_posed_solved_fini(&run->solved[i]);
    }
    free(run->posed);
    free(run->solved);
    free(run->saved);
    free(run->given);
    free(run->origin);
}

/* Doubt of a focal length that an earlier run has searched, which the views have kept: it stands in the history. */
static void recall_doubt(struct poses_run *run, int i)
{
    struct sst_posed_solved *r = &run->solved[i];
    const char *at = run->origin[i];

    while (!(r->focal_doubt > 0) && (at = strstr(at, FOUND_FOCAL))) {
        double focal_px = 0, percent = 0;

        at += strlen(FOUND_FOCAL);
        if (sscanf(at, "%lf px found +- %lf", &focal_px, &percent) == 2 && fabs(focal_px - r->focal_px) < 0.1)
            r->focal_doubt = percent / 100;
    }
}

static int save(struct poses_run *run, int i)
{
    char *history = run->posed[i].history;
    int err;

    recall_doubt(run, i);
    if (run->given[i] && run->origin[i][0]) { /* the older the origin, the sooner it is cut */
        sst_text_add(history, sizeof(run->posed[i].history), "; before: %s", run->origin[i]);
        sst_text_make_utf8(history);
    }
    err = sst_posed_save(&run->posed[i], run->dir[i]);
    run->saved[i] = !err;
    return err;
}

static int solve_rig(struct poses_run *run, const struct sst_posed_solve_config *cfg)
{
    int err = sst_posed_solve(run->posed, run->dir, run->count, cfg, run->solved);

    for (int i = 0; !err && i < run->count; i++)
        err = save(run, i);
    return err;
}

static int solve_with_colmap(struct poses_run *run, int i, const struct sst_posed_solve_config *cfg)
{
    const int err = cli_poses_colmap(&run->posed[i], run->dir[i], cfg);

    return err ? err : sst_posed_judge(&run->posed[i], &run->solved[i]);
}

/* Light fields apart are solved and saved one by one, so that the fault of one leaves the others' results.
 * @return the first error */
static int solve_each(struct poses_run *run, const struct sst_posed_solve_config *cfg, int with)
{
    int first = 0;

    for (int i = 0; i < run->count; i++) {
        int err = with           ? solve_with_colmap(run, i, cfg)
                  : cfg->one_rig ? cli_poses_moments(&run->posed[i], run->dir[i], cfg, &run->solved[i])
                                 : sst_posed_solve(&run->posed[i], &run->dir[i], 1, cfg, &run->solved[i]);

        if (!err)
            err = save(run, i);
        first = first ? first : err;
    }
    return first;
}

static int check(const struct cli_command *cmd, const struct poses_run *run, const struct sst_posed_solve_config *cfg,
                 int with)
{
    for (int i = 0; i < run->count; i++) {
        for (int k = 0; k < i; k++) {
            if (cli_is_one_file(run->dir[i], run->dir[k]))
                return cli_usage_error(cmd, "%s is named twice", run->dir[i]);
        }
    }
    if (cfg->one_rig && (cfg->refine || with))
        return cli_usage_error(cmd, "--one-rig does not go with --refine or --with");
    if (cfg->refine && (with || cfg->spacing_mm > 0))
        return cli_usage_error(cmd, "--refine keeps the unit of given poses; it does not go with --spacing or --with");
    if (cfg->search_focal && (cfg->refine || with))
        return cli_usage_error(cmd, "--focal 0 searches the focal length; it does not go with --refine or --with");
    if (cfg->keep_lens && (cfg->free_lens || !cfg->refine))
        return cli_usage_error(cmd, "--keep-lens is for --refine and does not go with --lens");
    if (!cfg->refine && (cfg->sigma_position_mm > 0 || cfg->sigma_angle_deg > 0))
        return cli_usage_error(cmd, "--sigma-position and --sigma-angle are of given poses, with --refine");
    return CLI_GO_ON;
}

static int run_poses(const struct cli_command *cmd, struct poses_run *run, const struct sst_posed_solve_config *cfg,
                     int with, bool json)
{
    int r = check(cmd, run, cfg, with), err, saved = 0;

    if (r != CLI_GO_ON)
        return r;
    err = load(run);
    if (!err)
        err = cfg->one_rig && run->count > 1 ? solve_rig(run, cfg) : solve_each(run, cfg, with);
    cli_progress_end();
    for (int i = 0; run->saved && i < run->count; i++) {
        saved += run->saved[i];
        if (run->saved[i] && !json)
            print_text(run, i, cfg->refine);
    }
    r = saved && json ? print_json(run) : CLI_OK;
    return err ? cli_exit_code(err) : r;
}

static int run(const struct cli_command *cmd, int argc, char **argv)
{
    struct sst_posed_solve_config cfg = { .progress = cli_progress, .progress_arg = (char[]){ "poses" } };
    struct poses_run poses = { 0 };
    double focal_px = -1;
    bool json = false;
    int with = 0, r;
    const struct cli_option options[] = {
        { "focal", 0, CLI_DOUBLE, &focal_px, "PX",
          "focal length of all views; 0: searched; default: the views' own, else searched", 0, 1e7 },
        { "lens", 0, CLI_FLAG, &cfg.free_lens, NULL,
          "adjust focal length and k1; views' own lenses are the start, and keep their other coefficients" },
        { "keep-lens", 0, CLI_FLAG, &cfg.keep_lens, NULL,
          "with --refine: leave lenses as they are, where warm places of a flight show another one" },
        { "spacing", 0, CLI_DOUBLE, &cfg.spacing_mm, "MM",
          "mean distance of neighbours on a line, else in the order of names", 1e-3, 1e9 },
        { "one-rig", 0, CLI_FLAG, &cfg.one_rig, NULL, "the light fields, or the moments of one, are of one array" },
        { "refine", 0, CLI_FLAG, &cfg.refine, NULL, "improve given poses" },
        { "sigma-position", 0, CLI_DOUBLE, &cfg.sigma_position_mm, "MM",
          "error of given positions (a tenth of the mean distance of neighbours)", 1e-3, 1e9 },
        { "sigma-angle", 0, CLI_DOUBLE, &cfg.sigma_angle_deg, "DEG", "error of given rotations (2)", 1e-3, 180 },
        { "with", 0, CLI_WORD, &with, "PROGRAM", "program that finds the poses instead: colmap", 1, 0, "colmap" },
        { "threads", 't', CLI_INT, &cfg.threads, "N", "threads (all processors)", 1, 256 },
        { "json", 0, CLI_FLAG, &json, NULL, "print one JSON object" },
    };

    r = cli_parse(cmd, options, ARRAY_LEN(options), argc, argv, poses.dir, 1, MOST_LF);
    if (r != CLI_GO_ON)
        return r;
    cfg.focal_px = fmax(focal_px, 0);
    cfg.search_focal = focal_px == 0;
    while (poses.dir[poses.count])
        poses.count++;
    r = run_poses(cmd, &poses, &cfg, with, json);
    run_fini(&poses);
    return r;
}

const struct cli_command cli_poses = { "poses", run };
