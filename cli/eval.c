/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "base/thread.h"
#include "cli/cli_internal.h"
#include "cli/render_internal.h"
#include "pipeline/eval/evaluation.h"

static json_t *disparity_json(const struct sst_disparity_error *d, int views)
{
    const bool any = d->pixels > 0;

    return json_pack("{s:i, s:I, s:o, s:o, s:o, s:o, s:o, s:o, s:o, s:o, s:o}", "views", views, "pixels",
                     (json_int_t)d->pixels, "bad003", cli_real_json(any ? d->bad003 : NAN), "bad007",
                     cli_real_json(any ? d->bad007 : NAN), "bad05", cli_real_json(any ? d->bad_half : NAN), "bad1",
                     cli_real_json(any ? d->bad1 : NAN), "bad2", cli_real_json(any ? d->bad2 : NAN), "bad4",
                     cli_real_json(any ? d->bad4 : NAN), "rmse", cli_real_json(any ? d->rmse : NAN), "mae",
                     cli_real_json(any ? d->mean_abs : NAN), "density", cli_real_json(any ? d->density : NAN));
}

static json_t *labels_json(const struct sst_evaluation *r)
{
    return json_pack("{s:i, s:o, s:o, s:o, s:o, s:o, s:o, s:o, s:o}", "views", r->label_views, "miou_initial",
                     cli_real_json(r->initial.miou), "accuracy_initial", cli_real_json(r->initial.accuracy),
                     "miou_hcsm", cli_real_json(r->hcsm.miou), "accuracy_hcsm", cli_real_json(r->hcsm.accuracy),
                     "coverage_hcsm", cli_real_json(r->hcsm.coverage), "miou_refined", cli_real_json(r->refined.miou),
                     "accuracy_refined", cli_real_json(r->refined.accuracy), "coverage_refined",
                     cli_real_json(r->refined.coverage));
}

static json_t *picture_json(const struct sst_picture_error *p)
{
    return json_pack("{s:o, s:o, s:o, s:o, s:o, s:o}", "psnr", cli_real_json(p->psnr), "ssim", cli_real_json(p->ssim),
                     "psnr_occluded", cli_real_json(p->psnr_occluded), "ssim_occluded", cli_real_json(p->ssim_occluded),
                     "psnr_target", cli_real_json(p->psnr_target), "seconds", cli_real_json(p->seconds));
}

/* Without an occluder (index -1) all is null. */
static json_t *clear_json(const struct sst_evaluation *r, int index)
{
    static const struct sst_picture_error none = { NAN, NAN, NAN, NAN, NAN, NAN };
    json_t *o = picture_json(index < 0 ? &none : &r->occluder[index].clear);

    json_object_set_new(o, "psnr_holes", cli_real_json(index < 0 ? NAN : r->occluder[index].psnr_holes));
    json_object_set_new(o, "ssim_holes", cli_real_json(index < 0 ? NAN : r->occluder[index].ssim_holes));
    json_object_set_new(o, "filled_percent", cli_real_json(index < 0 ? NAN : r->occluder[index].filled));
    json_object_set_new(o, "cut_px", cli_real_json(index < 0 ? NAN : r->occluder[index].cut_px));
    return o;
}

static json_t *gaps_json(const double *percent)
{
    json_t *list = json_array();

    for (int i = 0; i < SST_EVAL_GAPS; i++)
        json_array_append_new(list, cli_real_json(percent[i]));
    return list;
}

static json_t *report_json(const struct sst_evaluation *r, const struct sst_truth *truth)
{
    static const struct sst_picture_error none = { NAN, NAN, NAN, NAN, NAN, NAN };
    json_t *disparity = disparity_json(&r->disparity, r->disparity_views), *list = json_array();

    json_object_set_new(disparity, "nonocc", disparity_json(&r->disparity_nonocc, r->disparity_views));
    for (int i = 0; i < r->occluders; i++) {
        const struct sst_truth_occluder *o = &truth->occluders[i];

        json_array_append_new(list, json_pack("{s:s, s:s, s:s, s:f, s:o, s:o, s:o, s:o, s:o, s:o, s:o, s:o}", "name",
                                              o->name, "label", o->label, "target", o->target, "focus_px", o->focus_px,
                                              "covered", cli_real_json(r->occluder[i].covered), "rejected_percent",
                                              cli_real_json(r->occluder[i].rejected), "accepted_wrong_percent",
                                              cli_real_json(r->occluder[i].accepted_wrong), "rejected_by_gap",
                                              gaps_json(r->occluder[i].rejected_gap), "psnr_median",
                                              cli_real_json(r->occluder[i].psnr_median), "render",
                                              picture_json(&r->occluder[i].render), "refocus",
                                              picture_json(&r->occluder[i].refocus), "clear", clear_json(r, i)));
    }
    return json_pack("{s:o, s:o, s:o, s:o, s:o, s:o}", "disparity", disparity, "labels", labels_json(r), "render",
                     picture_json(r->occluders ? &r->occluder[0].render : &none), "refocus",
                     picture_json(r->occluders ? &r->occluder[0].refocus : &none), "clear",
                     clear_json(r, r->occluders ? 0 : -1), "occluders", list);
}

static void row(const char *name, const double *values, int n, int digits)
{
    printf("  %-24s", name);
    for (int i = 0; i < n; i++)
        cli_print_cell(values[i], 10, digits);
    putchar('\n');
}

static void print_disparity(const struct sst_evaluation *r)
{
    const struct sst_disparity_error *const sets[] = { &r->disparity, &r->disparity_nonocc };
    static const char *const names[] = { "all pixels", "visible in a neighbour" };

    printf("disparity, %3d views       %11s%11s%11s%11s%11s%11s%11s%11s\n", r->disparity_views, "bad 0.03 %",
           "bad 0.07 %", "bad 0.5 %", "bad 1 %", "bad 2 %", "bad 4 %", "RMSE px", "density %");
    for (int i = 0; i < 2; i++) {
        const struct sst_disparity_error *d = sets[i];

        row(names[i], (double[]){ d->bad003, d->bad007, d->bad_half, d->bad1, d->bad2, d->bad4, d->rmse, d->density },
            8, 2);
    }
}

static void print_labels(const struct sst_evaluation *r)
{
    const struct sst_label_error *const stages[] = { &r->initial, &r->hcsm, &r->refined };
    static const char *const names[] = { "network", "confident (HCSM)", "refined" };

    printf("labels, %d views          mean IoU %%  right %%    covered %%\n", r->label_views);
    for (int i = 0; i < 3; i++)
        row(names[i], (double[]){ stages[i]->miou, stages[i]->accuracy, stages[i]->coverage }, 3, 2);
}

static void print_picture(const char *name, const struct sst_picture_error *p)
{
    row(name, (double[]){ p->psnr, p->ssim, p->psnr_occluded, p->ssim_occluded, p->psnr_target, p->seconds }, 6, 3);
}

static void print_table(const struct sst_evaluation *r, const struct sst_truth *truth)
{
    if (r->disparity_views)
        print_disparity(r);
    if (r->label_views)
        print_labels(r);
    for (int i = 0; i < r->occluders; i++) {
        const struct sst_truth_occluder *o = &truth->occluders[i];

        printf("behind %s, focus %.2f px, %.1f %% of the picture\n", o->name, o->focus_px, r->occluder[i].covered);
        printf("  %-24s    PSNR dB       SSIM   occluded   occluded     target    seconds\n", "");
        print_picture("see-through", &r->occluder[i].render);
        print_picture("plain refocus", &r->occluder[i].refocus);
        print_picture("clear", &r->occluder[i].clear);
        row("  its holes", (double[]){ r->occluder[i].psnr_holes, r->occluder[i].ssim_holes }, 2, 3);
        row("  filled %, cut px", (double[]){ r->occluder[i].filled, r->occluder[i].cut_px }, 2, 2);
        row("rays rejected falsely %", &r->occluder[i].rejected, 1, 2);
        row("  gaps of 1-4, 5-12, more", r->occluder[i].rejected_gap, SST_EVAL_GAPS, 2);
        row("rays accepted falsely %", &r->occluder[i].accepted_wrong, 1, 2);
    }
}

/* As written on the command line. */
struct args {
    const char *dir, *truth_dir;
    struct sst_render_config cfg;
    bool json, no_verify;
    int threads;
};

/* A folder without labels is no fault: the report holds null. */
static int measure(const struct args *a)
{
    struct sst_lightfield lf = { 0 };
    struct sst_truth truth;
    struct sst_evaluation report;
    unsigned what = SST_LOAD_DISPARITY | SST_LOAD_LABELS;
    int err = sst_truth_read(&truth, a->truth_dir), code;

    if (err)
        return cli_exit_code(err);
    if (truth.count)
        what |= SST_LOAD_IMAGES | SST_LOAD_ORIGINALS | (a->no_verify ? SST_LOAD_UNVERIFIED : 0) |
                (a->cfg.verify != SST_VERIFY_OFF ? SST_LOAD_CONFIDENCE : 0);
    err = sst_lightfield_load(&lf, a->dir, what, a->threads);
    if (!err) {
        err = sst_eval_lightfield(&report, &(struct sst_eval_input){ &lf, a->dir, &truth, a->truth_dir, &a->cfg },
                                  a->threads);
        sst_lightfield_fini(&lf);
    }
    code = cli_exit_code(err);
    if (err)
        return code == CLI_USAGE ? CLI_INPUT
                                 : code; /* options were checked before: a value out of range comes from a file */
    if (a->json)
        return cli_print_json(report_json(&report, &truth));
    print_table(&report, &truth);
    return CLI_OK;
}

static int run(const struct cli_command *cmd, int argc, char **argv)
{
    struct args a = { 0 };
    int r;

    sst_render_config_defaults(&a.cfg);
    {
        const struct cli_option options[] = {
            { "truth", 't', CLI_STRING, &a.truth_dir, "DIR", "folder with truth.json, rr_cc.pfm, rr_cc.png", 0, 0 },
            { "json", 0, CLI_FLAG, &a.json, NULL, "print one JSON object", 0, 0 },
            { "sigma", 0, CLI_DOUBLE, &a.cfg.sigma_px, "PX", "width of the depth weight, px; inf: depth ignored", 1e-6,
              INFINITY },
            { "c1", 0, CLI_DOUBLE, &a.cfg.c1, "C", "least depth weight", 0, 1 },
            { "c2", 0, CLI_DOUBLE, &a.cfg.c2, "C", "least label weight", 0, 1 },
            { "aperture", 0, CLI_DOUBLE, &a.cfg.aperture, "R", "aperture radius, spacings; inf: all", 0, INFINITY },
            CLI_VERIFY_OPTION(a.cfg.verify),
            CLI_NO_VERIFY_OPTION(a.no_verify),
            { "threads", 0, CLI_INT, &a.threads, "N", "threads to use (default: all processors)", 1, 256 },
        };

        r = cli_parse(cmd, options, ARRAY_LEN(options), argc, argv, &a.dir, 1, 1);
    }
    if (r != CLI_GO_ON)
        return r;
    if (!a.truth_dir)
        return cli_usage_error(cmd, "--truth DIR is missing");
    a.threads = sst_thread_count(a.threads);
    return measure(&a);
}

const struct cli_command cli_eval = { "eval", run };
