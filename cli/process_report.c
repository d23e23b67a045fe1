/* Reports about processed light fields, for people and programs. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/border.h"
#include "base/log.h"
#include "cli/process_internal.h"
#include "pipeline/lightfield/folder.h"
#include "pipeline/method/disparity/device.h"
#include "pipeline/method/render/focus.h"

/* --- report about the pictures themselves ------------------------------------------------------------------------- */

/* @param wanted  --align auto */
static json_t *align_json(const struct sst_lightfield *lf, const struct sst_align_report *a, bool wanted)
{
    json_t *views = json_array();

    for (int k = 0; lf->correction && k < lf->rows * lf->cols; k++) {
        const struct sst_correction *c = &lf->correction[k];

        if (!sst_correction_is_none(c))
            json_array_append_new(views, json_pack("{s:i, s:i, s:f, s:f, s:f, s:f, s:[f, f, f], s:f, s:f}", "row",
                                                   k / lf->cols, "col", k % lf->cols, "right_px", c->shift_x_px,
                                                   "down_px", c->shift_y_px, "roll_deg", c->roll_deg, "scale", c->scale,
                                                   "gain", c->gain[0], c->gain[1], c->gain[2], "falloff", c->falloff,
                                                   "exponent", c->exponent));
    }
    return json_pack("{s:s, s:i, s:b, s:i, s:i, s:i, s:f, s:o, s:b, s:o, s:o, s:i, s:o, s:o, s:o, s:o, s:o}", "mode",
                     wanted ? "auto" : "off", "moved", a->moved, "contradictory", (int)a->contradictory, "lit", a->lit,
                     "faded", a->faded, "bent", a->bent, "worst_exponent", a->worst_exponent, "exponent_sigma",
                     cli_real_json(a->exponent_sigma), "bent_kept", (int)a->bent_kept, "worst_falloff",
                     cli_real_json(a->worst_falloff), "falloff_sigma", cli_real_json(a->falloff_sigma), "unmeasured",
                     a->unmeasured, "worst_px", cli_real_json(a->worst_px), "worst_gain", cli_real_json(a->worst_gain),
                     "sigma_px", cli_real_json(a->sigma_px), "gain_sigma", cli_real_json(a->gain_sigma), "views",
                     views);
}

static void print_align(const struct sst_align_report *a)
{
    if (a->moved)
        printf("%d views moved by up to %.2f px (sigma %.3f), ", a->moved, a->worst_px, a->sigma_px);
    if (a->lit)
        printf("the gains of %d views corrected by up to %.0f %% (sigma %.1f), ", a->lit, 100 * a->worst_gain,
               100 * a->gain_sigma);
    if (a->bent)
        printf("the gammas of %d views corrected by up to %.0f %% (sigma %.1f), ", a->bent, 100 * a->worst_exponent,
               100 * a->exponent_sigma);
    if (a->faded)
        printf("the fall-off of %d views corrected, up to %.0f %% of the light in the corners (sigma %.1f), ", a->faded,
               100 * a->worst_falloff, 100 * a->falloff_sigma);
    if (a->contradictory)
        printf("displacements not corrected, as matches contradict each other (a fence or rows of windows), ");
}

/* {before, after} levels of 16-bit views, with a warning if some are lost; null: 8 bits. */
static json_t *levels_json(const struct sst_lightfield *lf, const char *dir)
{
    int before, after;

    if (sst_lightfield_levels(lf, dir, true, &before, &after) || !before)
        return json_null();
    return json_pack("{s:i, s:i, s:[i, i]}", "before", before, "after", after, "samples", lf->samples.black,
                     lf->samples.white ? lf->samples.white : 65535);
}

/* Add plausible, implausible and views. */
static void add_judgement(json_t *root, const struct sst_lightfield *lf, const struct sst_judgement *j)
{
    json_t *views = json_array();

    for (int k = 0; j->judged && k < lf->rows * lf->cols; k++) {
        if (lf->views[k].present)
            json_array_append_new(views, json_pack("{s:i, s:i, s:b, s:s, s:o}", "row", k / lf->cols, "col",
                                                   k % lf->cols, "plausible", j->view[k].fault == SST_VIEW_FINE,
                                                   "fault", sst_judge_fault_name(j->view[k].fault), "confirmed_percent",
                                                   cli_real_json(j->view[k].confirmed)));
    }
    json_object_set_new(root, "plausible", j->judged ? json_boolean(j->plausible) : json_null());
    json_object_set_new(root, "implausible", json_string(j->sentence));
    json_object_set_new(root, "views", views);
}

static void add_notices(json_t *root, const struct sst_lightfield *lf, const struct sst_notices *n)
{
    json_t *list = json_array(), *soft = json_array();

    for (int i = 0; i < n->count; i++)
        json_array_append_new(list, json_pack("{s:s, s:s}", "what", n->notice[i].what, "text", n->notice[i].text));
    for (int k = 0; k < lf->rows * lf->cols; k++) {
        if (n->soft_view[k])
            json_array_append_new(soft, json_pack("{s:i, s:i}", "row", k / lf->cols, "col", k % lf->cols));
    }
    json_object_set_new(root, "noise_levels", json_real(n->noise_levels));
    json_object_set_new(root, "edge_px", cli_real_json(n->edge_px));
    json_object_set_new(root, "soft_views", soft);
    json_object_set_new(root, "soft_px", json_real(n->soft_px));
    json_object_set_new(root, "jpeg_quality", cli_real_json(n->jpeg_quality));
    json_object_set_new(root, "jpeg_views", json_integer(n->jpeg_views));
    json_object_set_new(root, "missing_views", json_integer(n->missing));
    json_object_set_new(root, "skew_us", json_real(n->skew_us));
    json_object_set_new(root, "noticed", list);
}

/* --- work of the device ------------------------------------------------------------------------------------------- */

static json_t *device_json(const struct sst_step_report *d)
{
    const struct sst_step_items *matched = &d->items[SST_DISPARITY_MATCHED], *tested = &d->items[SST_DISPARITY_TESTED];
    json_t *root, *stages = json_array();

    if (!*d->name) {
        json_decref(stages);
        return json_string("cpu");
    }
    for (int i = 0; i < SST_DISPARITY_STAGES; i++) {
        if (d->stages_on_cpu >> i & 1)
            json_array_append_new(stages, json_string(sst_disparity_stage_name((enum sst_disparity_stage)i)));
    }
    root = json_pack("{s:o, s:o, s:I, s:I, s:I, s:I, s:I, s:o, s:o}", "name", cli_text_json(d->name), "driver",
                     cli_text_json(d->driver), "views", (json_int_t)matched->device, "on_cpu",
                     (json_int_t)matched->on_cpu, "tested", (json_int_t)tested->device, "tested_on_cpu",
                     (json_int_t)tested->on_cpu, "failures", (json_int_t)d->failures, "why_cpu",
                     *d->why ? cli_text_json(d->why) : json_null(), "stages_on_cpu", stages);
    if (root)
        json_object_update_new(
            root, json_pack("{s:I, s:I, s:I, s:I, s:f, s:f, s:f, s:f}", "in_bands", (json_int_t)matched->in_bands,
                            "dispatches", (json_int_t)d->dispatches, "uploads", (json_int_t)d->uploads, "upload_bytes",
                            (json_int_t)d->upload_bytes, "seconds", (double)d->total_ns * 1e-9, "upload_seconds",
                            (double)d->upload_ns * 1e-9, "wait_seconds", (double)d->wait_ns * 1e-9, "download_seconds",
                            (double)d->download_ns * 1e-9));
    return root;
}

static void report_device(const struct sst_step_report *d)
{
    const struct sst_step_items *matched = &d->items[SST_DISPARITY_MATCHED], *tested = &d->items[SST_DISPARITY_TESTED];
    char stages[256] = "";

    if (!*d->name)
        return;
    for (int i = 0; i < SST_DISPARITY_STAGES; i++) {
        const size_t used = strlen(stages);

        if (d->stages_on_cpu >> i & 1)
            snprintf(stages + used, sizeof(stages) - used, "%s%s",
                     used ? ", " : "; on the CPU: ", sst_disparity_stage_name((enum sst_disparity_stage)i));
    }
    if (matched->on_cpu)
        sst_log_warning("%lld of %lld views were matched on the CPU instead of %s: %s", (long long)matched->on_cpu,
                        (long long)(matched->on_cpu + matched->device), d->name, d->why);
    else if (tested->on_cpu)
        sst_log_warning("the hypotheses of %lld of %lld views were tested on the CPU instead of %s: %s",
                        (long long)tested->on_cpu, (long long)(tested->on_cpu + tested->device), d->name, d->why);
    else
        sst_log_info("%lld views matched on %s%s", (long long)matched->device, d->name, stages);
}

static json_t *seconds_json(double load, double labels, double disparity, double refinement, double saving)
{
    return json_pack("{s:f, s:f, s:f, s:f, s:f, s:f}", "load", load, "labels", labels, "disparity", disparity,
                     "refinement", refinement, "saving", saving, "total",
                     load + labels + disparity + refinement + saving);
}

static void print_skipped(const char *what, double percent, const char *error, double error_percent)
{
    if (isgreater(percent, 0))
        printf("%.0f %% of the %s skipped (%.1f %% %s), ", percent, what, error_percent, error);
}

static json_t *skipped_json(double percent, double error)
{
    return json_pack("{s:o, s:o}", "skipped_percent", cli_real_json(percent), "error_percent", cli_real_json(error));
}

/* Warnings, also beside JSON. @return the levels */
static json_t *log_warnings(const struct cli_processed *c, const struct sst_step_report *device)
{
    const struct sst_process_report *r = &c->report;
    json_t *levels;

    report_device(device);
    cli_network_report_device(c->process->w.networks);
    if (r->judgement.judged && !r->judgement.plausible)
        sst_log_warning("%s: not plausible: %s", c->name, r->judgement.sentence);
    levels = levels_json(&c->lf, c->name);
    if (r->parallax == SST_PARALLAX_NONE)
        sst_log_warning("%s: the views show no parallax: they are one picture from one place, and no disparity counts "
                        "as confirmed; check that the camera moved from view to view",
                        c->name);
    for (int i = 0; i < r->notices.count; i++)
        sst_log_warning("%s: %s", c->name, r->notices.notice[i].text);
    return levels;
}

static void print_text(const struct cli_processed *c, struct sst_process_time saving, double focus_px)
{
    const struct sst_lightfield *lf = &c->lf;
    const struct sst_process_report *r = &c->report;
    const struct sst_process_time load = c->load;
    const double total = load.wall_s + r->labels.wall_s + r->disparity.wall_s + r->refinement.wall_s + saving.wall_s;

    if (c->process->w.several)
        printf("%s: ", c->name);
    printf("%dx%d views of %dx%d: ", lf->rows, lf->cols, lf->width, lf->height);
    if (r->disp_max_px > r->disp_min_px)
        printf("disparity %g..%g px, ", r->disp_min_px, r->disp_max_px);
    if (!isnan(r->confirmed))
        printf("%.1f %% confirmed by other views, ", r->confirmed);
    if (!isnan(r->coverage_refined))
        printf("labels on %.1f %% of the rays (%.1f %% before refinement), ", r->coverage_refined, r->coverage_hcsm);
    print_align(&r->align);
    print_skipped("views to match", r->skipped.views_skipped, "disparities off by more than 1 px",
                  r->skipped.views_error);
    print_skipped("disparities to search", r->skipped.ranges_skipped, "found elsewhere", r->skipped.ranges_error);
    print_skipped("hypotheses", r->skipped.hypotheses_skipped, "other choices", r->skipped.hypotheses_error);
    print_skipped("views to label", r->labels_skipped, "other labels", r->labels_error);
    printf("%.1f s (load %.1f, labels %.1f, disparity %.1f, refinement %.1f, saving %.1f)\n", total, load.wall_s,
           r->labels.wall_s, r->disparity.wall_s, r->refinement.wall_s, saving.wall_s);
    if (!isnan(focus_px))
        printf("proposed focus: %.2f px per spacing, the default of `sst render %s -o out.png`\n", focus_px, c->name);
}

static json_t *report_json(const struct cli_processed *c, struct sst_process_time saving,
                           const struct sst_step_report *device, double focus_px, json_t *levels)
{
    const struct sst_lightfield *lf = &c->lf;
    const struct sst_process_report *r = &c->report;
    const struct sst_process_time load = c->load;
    const struct cli_process_wanted *w = &c->process->w;
    json_t *root = json_pack(
        "{s:i, s:i, s:i, s:i, s:[f, f], s:o, s:o, s:o, s:o, s:{s:o, s:o, s:o, s:o}, s:o, s:o}", "rows", lf->rows,
        "cols", lf->cols, "width", lf->width, "height", lf->height, "searched_px", r->disp_min_px, r->disp_max_px,
        "confirmed_percent", cli_real_json(r->confirmed), "eps_h", cli_real_json(r->eps_h), "coverage_hcsm",
        cli_real_json(r->coverage_hcsm), "coverage_refined", cli_real_json(r->coverage_refined), "skips", "keys",
        skipped_json(r->skipped.views_skipped, r->skipped.views_error), "ranges",
        skipped_json(r->skipped.ranges_skipped, r->skipped.ranges_error), "hypotheses",
        skipped_json(r->skipped.hypotheses_skipped, r->skipped.hypotheses_error), "labels",
        skipped_json(r->labels_skipped, r->labels_error), "seconds",
        seconds_json(load.wall_s, r->labels.wall_s, r->disparity.wall_s, r->refinement.wall_s, saving.wall_s),
        "cpu_seconds",
        seconds_json(load.cpu_s, r->labels.cpu_s, r->disparity.cpu_s, r->refinement.cpu_s, saving.cpu_s));

    if (!root) {
        json_decref(levels);
        return NULL;
    }
    json_object_set_new(root, "focus_px", cli_real_json(focus_px));
    add_notices(root, lf, &r->notices);
    add_judgement(root, lf, &r->judgement);
    json_object_set_new(root, "levels", levels);
    json_object_set_new(root, "device", device_json(device));
    json_object_set_new(root, "networks", cli_network_device_json(w->networks));
    json_object_set_new(root, "not_finite", json_integer((json_int_t)sst_border_count()));
    json_object_set_new(root, "align", align_json(lf, &r->align, w->correct));
    json_object_set_new(root, "parallax",
                        r->parallax == SST_PARALLAX_UNKNOWN ? json_null()
                                                            : json_boolean(r->parallax == SST_PARALLAX_SEEN));
    return root;
}

int cli_process_report(const struct cli_processed *c, struct sst_process_time saving, json_t **out)
{
    const struct cli_process *p = c->process;
    struct sst_step_report device = { 0 };
    double focus_px = NAN;
    json_t *levels;
    int err;

    if (p->device)
        sst_disparity_device_report(p->cfg.disparity.runner, &device);
    levels = log_warnings(c, &device);
    err = sst_render_find_focus(&c->lf, &focus_px) == -ENOMEM ? -ENOMEM : 0;
    if (!err && out) {
        *out = report_json(c, saving, &device, focus_px, levels);
        err = *out ? 0 : -ENOMEM;
    } else {
        json_decref(levels);
    }
    if (!err && !out)
        print_text(c, saving, focus_px);
    if (p->w.networks)
        sst_network_device_clear_report(p->w.networks);
    return err;
}
