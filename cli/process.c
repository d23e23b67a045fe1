/* sst process: labels and disparity for all views of a light field. */
#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <unistd.h>

#include "base/border.h"
#include "base/claim.h"
#include "base/log.h"
#include "cli/cli_internal.h"
#include "cli/render_internal.h"
#include "cli/shard_internal.h"
#include "pipeline/image/codec.h"
#include "pipeline/kernels/sha256.h"
#include "pipeline/lightfield/external_maps.h"
#include "pipeline/lightfield/folder.h"
#include "pipeline/lightfield/parallax.h"
#include "pipeline/lightfield/share.h"
#include "pipeline/method/network/model_path.h"
#include "pipeline/method/process/process.h"
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

static json_t *device_json(const struct sst_disparity_device_report *d)
{
    json_t *root, *stages = json_array();

    if (!*d->step.name) {
        json_decref(stages);
        return json_string("cpu");
    }
    for (int i = 0; i < SST_DISPARITY_STAGES; i++) {
        if (d->step.stages_on_cpu >> i & 1)
            json_array_append_new(stages, json_string(sst_disparity_stage_name((enum sst_disparity_stage)i)));
    }
    root = json_pack("{s:o, s:o, s:I, s:I, s:I, s:I, s:I, s:o, s:o}", "name", cli_text_json(d->step.name), "driver",
                     cli_text_json(d->step.driver), "views", (json_int_t)d->views, "on_cpu", (json_int_t)d->on_cpu,
                     "tested", (json_int_t)d->tested, "tested_on_cpu", (json_int_t)d->tested_on_cpu, "failures",
                     (json_int_t)d->step.failures, "why_cpu", *d->step.why ? cli_text_json(d->step.why) : json_null(),
                     "stages_on_cpu", stages);
    if (root)
        json_object_update_new(
            root,
            json_pack("{s:I, s:I, s:I, s:I, s:f, s:f, s:f, s:f}", "in_bands", (json_int_t)d->in_bands, "dispatches",
                      (json_int_t)d->step.dispatches, "uploads", (json_int_t)d->step.uploads, "upload_bytes",
                      (json_int_t)d->step.upload_bytes, "seconds", (double)d->step.total_ns * 1e-9, "upload_seconds",
                      (double)d->step.upload_ns * 1e-9, "wait_seconds", (double)d->step.wait_ns * 1e-9,
                      "download_seconds", (double)d->step.download_ns * 1e-9));
    return root;
}

static void report_device(const struct sst_disparity_device_report *d)
{
    char stages[256] = "";

    if (!*d->step.name)
        return;
    for (int i = 0; i < SST_DISPARITY_STAGES; i++) {
        const size_t used = strlen(stages);

        if (d->step.stages_on_cpu >> i & 1)
            snprintf(stages + used, sizeof(stages) - used, "%s%s",
                     used ? ", " : "; on the CPU: ", sst_disparity_stage_name((enum sst_disparity_stage)i));
    }
    if (d->on_cpu)
        sst_log_warning("%lld of %lld views were matched on the CPU instead of %s: %s", (long long)d->on_cpu,
                        (long long)(d->on_cpu + d->views), d->step.name, d->step.why);
    else if (d->tested_on_cpu)
        sst_log_warning("the hypotheses of %lld of %lld views were tested on the CPU instead of %s: %s",
                        (long long)d->tested_on_cpu, (long long)(d->tested_on_cpu + d->tested), d->step.name,
                        d->step.why);
    else
        sst_log_info("%lld views matched on %s%s", (long long)d->views, d->step.name, stages);
}

/* --- work --------------------------------------------------------------------------------------------------------- */

/* Options of the command line beyond the matching. */
struct wanted {
    const char *model, *hand_label, *labels_dir, *disparity_dir, *skip, *device;
    int memory, device_memory; /* MiB; 0: not given */
    struct sst_network_device *networks;
    double range_min, range_max;
    bool no_labels, no_verify, json;
    int unaligned;         /* 1: `align` is off */
    bool correct, several; /* of `align`; more than one light field */
};

/* Work on each light field. */
struct job {
    struct sst_process_config cfg;
    struct wanted w;
    const char *preset;
    const struct cli_shard *shard;
    char *const *dir; /* of the light fields */
    char **state;     /* of their claims */
    const char *text; /* of the job */
    bool split;       /* workers share views, not light fields */
    struct sst_runner *device;
};

/* A light field during the computation of its maps. */
struct computed {
    const struct job *job;
    const char *dir;
    struct sst_lightfield lf;
    struct sst_process_extras extras;
    struct sst_process_report report;
    struct sst_process_time load;
};

#define STEPS     ".process-views"   /* folder of a light field: maps that workers exchange */
#define STATE     ".process"         /* folder of a light field: its claim by workers */
#define JSON_MOST ((size_t)64 << 20) /* bytes of a lightfield.json */

static void progress(void *arg SST_UNUSED, const char *stage, double done)
{
    cli_progress((void *)(uintptr_t)stage, done);
    if (done >= 1)
        cli_progress_end();
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

static int print_report(const struct computed *c, struct sst_process_time saving,
                        const struct sst_disparity_device_report *device)
{
    const struct sst_lightfield *lf = &c->lf;
    const struct sst_process_report *r = &c->report;
    const struct sst_process_time load = c->load;
    const struct wanted *w = &c->job->w;
    const char *dir = c->dir;
    const double total = load.wall_s + r->labels.wall_s + r->disparity.wall_s + r->refinement.wall_s + saving.wall_s;
    double focus_px = NAN;
    json_t *root, *levels;

    report_device(device);
    cli_network_report_device(w->networks);
    if (r->judgement.judged && !r->judgement.plausible)
        sst_log_warning("%s: not plausible: %s", dir, r->judgement.sentence);
    levels = levels_json(lf, dir);
    if (r->parallax == SST_PARALLAX_NONE)
        sst_log_warning("%s: the views show no parallax: they are one picture from one place, and no disparity counts "
                        "as confirmed; check that the camera moved from view to view",
                        dir);
    for (int i = 0; i < r->notices.count; i++)
        sst_log_warning("%s: %s", dir, r->notices.notice[i].text);
    if (sst_render_find_focus(lf, &focus_px) == -ENOMEM) {
        json_decref(levels);
        return -ENOMEM;
    }
    if (!w->json) {
        json_decref(levels);
        if (w->several)
            printf("%s: ", dir);
        printf("%dx%d views of %dx%d: ", lf->rows, lf->cols, lf->width, lf->height);
        if (r->disp_max_px > r->disp_min_px)
            printf("disparity %g..%g px, ", r->disp_min_px, r->disp_max_px);
        if (!isnan(r->confirmed))
            printf("%.1f %% confirmed by other views, ", r->confirmed);
        if (!isnan(r->coverage_refined))
            printf("labels on %.1f %% of the rays (%.1f %% before refinement), ", r->coverage_refined,
                   r->coverage_hcsm);
        print_align(&r->align);
        print_skipped("views to match", r->skipped.views_skipped, "disparities off by more than 1 px",
                      r->skipped.views_error);
        print_skipped("disparities to search", r->skipped.ranges_skipped, "found elsewhere", r->skipped.ranges_error);
        print_skipped("hypotheses", r->skipped.hypotheses_skipped, "other choices", r->skipped.hypotheses_error);
        print_skipped("views to label", r->labels_skipped, "other labels", r->labels_error);
        printf("%.1f s (load %.1f, labels %.1f, disparity %.1f, refinement %.1f, saving %.1f)\n", total, load.wall_s,
               r->labels.wall_s, r->disparity.wall_s, r->refinement.wall_s, saving.wall_s);
        if (!isnan(focus_px))
            printf("proposed focus: %.2f px per spacing, the default of `sst render %s -o out.png`\n", focus_px, dir);
        return 0;
    }
    root = json_pack(
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
    if (root) {
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
    }
    if (root && w->several)
        json_object_set_new(root, "lightfield", cli_text_json(dir));
    return cli_dump_json(root, (w->several ? JSON_COMPACT : JSON_INDENT(2)) | JSON_REAL_PRECISION(6)) ? -ENOMEM : 0;
}

/* Load the light field with its external maps or the options'. */
static int load(struct sst_lightfield *lf, const char *dir, const struct wanted *w, struct sst_share *share,
                int threads)
{
    struct sst_lightfield json = { 0 };
    unsigned what = SST_LOAD_IMAGES | SST_LOAD_UNCORRECTED | (w->no_verify ? SST_LOAD_UNVERIFIED : 0);
    int err = sst_lightfield_load(&json, dir, 0, threads);

    if (err)
        return err;
    what |= json.files->external_labels && !w->labels_dir ? SST_LOAD_LABELS : 0;
    what |= json.files->external_disparity && !w->disparity_dir ? SST_LOAD_DISPARITY | SST_LOAD_CONFIDENCE : 0;
    sst_lightfield_fini(&json);
    err = sst_lightfield_shared_load(share, lf, dir, what, threads);
    if (!err && w->disparity_dir)
        err = sst_lightfield_read_disparity(lf, w->disparity_dir, threads);
    if (!err && w->labels_dir)
        err = sst_lightfield_read_labels(lf, w->labels_dir, threads);
    return err;
}

/* Compute the maps. */
static int compute(struct sst_lightfield *lf, struct sst_process_config *cfg, const char *hand_label,
                   struct sst_process_extras *extras, struct sst_process_report *report)
{
    struct sst_map_u8 truth = { 0 };
    int err = hand_label && cfg->model ? sst_map_u8_read_png(&truth, hand_label) : 0;

    cfg->hand_label = truth.data ? &truth : NULL;
    err = err ? err : sst_process(lf, cfg, extras, report);
    sst_map_u8_fini(&truth);
    return err;
}

/* Properties of the files for the report, and of the report for the folder. */
static int describe(struct sst_lightfield *lf, const char *dir, struct sst_process_report *report)
{
    double quality[SST_MAX_VIEWS];
    const int err = sst_lightfield_jpeg_quality(quality, lf, dir);

    if (err)
        return err;
    sst_notice_jpeg_files(&report->notices, quality, lf->rows * lf->cols);
    sst_notice_describe(&report->notices, lf->rows, lf->cols);
    lf->files->judged = report->judgement.judged;
    lf->files->plausible = report->judgement.plausible;
    snprintf(lf->files->implausible, sizeof(lf->files->implausible), "%s", report->judgement.sentence);
    return 0;
}

/* Skips of the preset, unless the list says otherwise. */
static int read_skips(const struct cli_command *cmd, const char *list, struct sst_process_config *cfg)
{
    bool keys = cfg->disparity.key_spacing > 1;
    const struct cli_skip skips[] = { { "keys", &keys },
                                      { "ranges", &cfg->disparity.skip_ranges },
                                      { "hypotheses", &cfg->disparity.skip_hypotheses },
                                      { "labels", &cfg->skip_labels } };
    const int r = cli_read_skips(cmd, list, skips, ARRAY_LEN(skips));

    if (list) /* asked for, whatever the size */
        cfg->disparity.range_bytes = 0;
    if (!keys)
        cfg->disparity.key_spacing = 1;
    else if (cfg->disparity.key_spacing <= 1)
        cfg->disparity.key_spacing = 3;
    return r;
}

/* One opening of the device, for matching, and for networks where there are any. */
static int open_devices(struct job *job)
{
    int err = sst_runner_create(&job->device, job->w.device, (uint64_t)job->w.device_memory << 20);

    err = err ? err : sst_disparity_device_create(&job->cfg.disparity.device, job->device);
    if (!err && ((!job->w.no_labels && !job->w.labels_dir) || job->cfg.disparity.cost & SST_COST_MCCNN))
        err = sst_network_device_open_on(&job->w.networks, job->device);
    job->cfg.networks = job->cfg.disparity.networks = job->w.networks;
    return err;
}

static void close_devices(struct job *job)
{
    sst_network_device_close(job->w.networks);
    sst_disparity_device_destroy(job->cfg.disparity.device);
    sst_runner_destroy(job->device);
}

/* Store the maps and report. */
static int save(void *arg, int i SST_UNUSED, bool again)
{
    struct computed *c = arg;
    struct sst_process_time clock = { 0, 0 }, saving;
    struct sst_disparity_device_report device = { 0 };
    int err;

    if (again)
        sst_path_remove_temporaries(c->dir);
    sst_process_lap(&clock);
    progress(NULL, "saving", 0.99);
    err = describe(&c->lf, c->dir, &c->report);
    err = err ? err : sst_process_save(&c->lf, &c->extras, c->dir, c->job->cfg.threads);
    saving = sst_process_lap(&clock);
    cli_progress_end();
    if (c->job->device)
        sst_disparity_device_report(c->job->cfg.disparity.device, &device);
    if (!err)
        err = print_report(c, saving, &device);
    if (c->job->w.networks)
        sst_network_device_clear_report(c->job->w.networks);
    return cli_exit_code(err);
}

/* Of the workers that share the views, one saves. */
static int save_once(struct computed *c, int i)
{
    char *const *state = &c->job->state[i];
    const struct cli_pieces piece = { 1, &c->job->dir[i], state, c->job->text, save, c };

    return cli_shard_run(c->job->shard, &piece);
}

static int process_one(void *arg, int i, bool again)
{
    const struct job *job = arg;
    struct sst_process_config cfg = job->cfg;
    const struct wanted *w = &job->w;
    struct computed c = { .job = job, .dir = job->dir[i] };
    struct sst_process_time clock = { 0, 0 };
    char pspnet[SST_PATH_MAX];
    int err, code;

    if (again)
        sst_path_remove_temporaries(c.dir);
    sst_process_lap(&clock);
    err = load(&c.lf, c.dir, w, cfg.share, cfg.threads);
    c.load = sst_process_lap(&clock);
    if (!err && (w->model || (!w->no_labels && !c.lf.files->external_labels))) {
        err = w->model ? sst_model_resolve(pspnet, w->model) : sst_model_path(pspnet, "pspnet-small.onnx");
        if (!c.lf.files->external_labels)
            cfg.model = pspnet;
    }
    if (!err) {
        snprintf(c.lf.files->history, sizeof(c.lf.files->history), "preset %s, labels %s, disparity %s", job->preset,
                 c.lf.files->external_labels ? "given"
                 : w->no_labels              ? "none"
                                             : sst_path_base(cfg.model),
                 c.lf.files->external_disparity ? "given" : "matched");
        cfg.keep_disparity = c.lf.files->external_disparity;
        err = compute(&c.lf, &cfg, w->hand_label, &c.extras, &c.report);
    }
    cli_progress_end();
    code = err ? cli_exit_code(err) : job->split ? save_once(&c, i) : save(&c, i, false);
    sst_process_extras_fini(&c.extras);
    sst_lightfield_fini(&c.lf);
    return code;
}

static bool is_done(const struct job *job, int i)
{
    struct sst_claim_info info;

    return !sst_claim_look(&info, job->state[i]) && info.state == SST_CLAIM_DONE && !strcmp(info.job, job->text);
}

/* Meet the other workers in a folder. They share the work on these pictures: results left for other pictures are
 * computed again. @param steps  out, the folder */
static int meet(struct job *job, int i, char steps[SST_PATH_MAX])
{
    const struct cli_shard *shard = job->shard;
    char path[SST_PATH_MAX], text[SST_CLAIM_JOB], sha256[65];
    struct sst_lightfield json;
    uint8_t *data = NULL;
    size_t size;
    int err = sst_lightfield_load(&json, job->dir[i], 0, 1);

    if (err)
        return err;
    sst_lightfield_fini(&json);
    err = sst_path_join(path, job->dir[i], "lightfield.json");
    err = err ? err : sst_file_read(path, JSON_MOST, &data, &size);
    if (err)
        return err;
    sst_sha256_hex(sha256, data, size);
    free(data);
    snprintf(text, sizeof(text), "%.16s %.*s", sha256, (int)sizeof(text) - 18, job->text);
    err = sst_path_join(steps, job->dir[i], STEPS);
    return err ? err
               : sst_share_open(&job->cfg.share,
                                &(struct sst_share_config){ .dir = steps,
                                                            .job = text,
                                                            .index = shard->index,
                                                            .count = shard->count,
                                                            .lease_ms = (int)(shard->lease_s * 1000) });
}

/* Take the folder for this process alone; workers that share it wait. The lock goes with the process, whatever ends it.
 * Where folders cannot be locked, as on network file systems, nothing is kept apart.
 * @param fd  out, to be closed by the caller; -1: none @return 0, -EBUSY (logged) */
static int lock_folder(int *fd, const char *dir, bool shared)
{
    *fd = open(dir, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (*fd < 0 || !flock(*fd, shared ? LOCK_SH : LOCK_EX | LOCK_NB) || errno != EWOULDBLOCK)
        return 0;
    close(*fd);
    *fd = -1;
    sst_log_error("%s: another process works on it; wait for its end, or share the work with --shard", dir);
    return -EBUSY;
}

static int process_locked(void *arg, int i, bool again)
{
    const struct job *job = arg;
    int fd, code = cli_exit_code(lock_folder(&fd, job->dir[i], job->shard->count));

    if (code)
        return code;
    if (!job->shard->count)
        sst_path_remove_tree(job->state[i]); /* of shared work, which this replaces */
    code = process_one(arg, i, again);
    if (fd >= 0)
        close(fd);
    return code;
}

/* With the other workers, view by view. Exchanged files are removed at the end. */
static int process_together(struct job *job, int i)
{
    char steps[SST_PATH_MAX], said[SST_LOG_MAX];
    int code;

    if (is_done(job, i))
        return CLI_OK;
    code = cli_exit_code(meet(job, i, steps));
    if (code)
        return code;
    sst_log_hold_errors(said);
    said[0] = 0;
    code = process_locked(job, i, false);
    sst_log_hold_errors(NULL);
    if (code && is_done(job, i)) /* the others have ended, and removed the files to read */
        code = CLI_OK;
    if (code && said[0])
        sst_log_error("%s", said);
    if (!code)
        sst_path_remove_tree(steps);
    sst_share_close(job->cfg.share);
    job->cfg.share = NULL;
    return code;
}

/* One after the other; one that fails does not keep the others from being processed. @return the first exit code */
static int process_all(struct job *job, int count)
{
    int code = CLI_OK;

    for (int i = 0; i < count; i++) {
        const int r = job->split ? process_together(job, i) : process_locked(job, i, false);

        code = code ? code : r;
    }
    return code;
}

static void free_names(char **name, int count)
{
    for (int i = 0; name && i < count; i++)
        free(name[i]);
    free(name);
}

/* Process the light fields of the command line, shared with other processes or alone. */
static int process_listed(struct job *job, int count)
{
    const struct cli_shard *shard = job->shard;
    char path[SST_PATH_MAX];
    int r;

    job->state = calloc((size_t)count, sizeof(*job->state));
    r = job->state ? CLI_OK : CLI_MEMORY;
    for (int i = 0; !r && i < count; i++) {
        r = cli_exit_code(sst_path_join(path, job->dir[i], STATE));
        job->state[i] = r ? NULL : strdup(path);
        r = r || job->state[i] ? r : CLI_MEMORY;
    }
    job->w.several = count > 1;
    if (!r) {
        const struct cli_pieces pieces = { count, job->dir, job->state, job->text, process_locked, job };

        r = shard->status                 ? cli_shard_status(&pieces, job->w.json)
            : shard->count && !job->split ? cli_shard_run(shard, &pieces)
                                          : process_all(job, count);
    }
    free_names(job->state, count);
    return r;
}

/* Read the options together. */
static int read_options(const struct cli_command *cmd, struct job *job, const struct cli_matching *m, char *mccnn)
{
    struct sst_process_config *cfg = &job->cfg;
    struct wanted *w = &job->w;
    int r;

    if (isnan(w->range_min) != isnan(w->range_max) || isgreaterequal(w->range_min, w->range_max))
        return cli_usage_error(cmd, "--range-min and --range-max must be given together, --range-min smaller");
    if (w->no_labels && (w->model || w->labels_dir || w->hand_label))
        return cli_usage_error(cmd, "--no-labels and --%s contradict each other",
                               w->model        ? "model"
                               : w->labels_dir ? "labels"
                                               : "hand-label");
    if (job->split && !job->shard->count)
        return cli_usage_error(cmd, "--split-views belongs to --shard");
    w->correct = cfg->align = !w->unaligned;
    r = cli_exit_code(cli_matching_config(&cfg->disparity, m, mccnn));
    if (r)
        return r;
    r = read_skips(cmd, w->skip, cfg);
    if (r != CLI_GO_ON)
        return r;
    cfg->threads = cfg->disparity.threads;
    cfg->precision = cfg->disparity.precision;
    cfg->disparity.memory = (size_t)w->memory << 20;
    cfg->disparity.disp_min_px = isnan(w->range_min) ? 0 : w->range_min;
    cfg->disparity.disp_max_px = isnan(w->range_max) ? 0 : w->range_max;
    job->preset = m->preset;
    return CLI_GO_ON;
}

static int run(const struct cli_command *cmd, int argc, char **argv)
{
    struct cli_shard shard = CLI_SHARD_DEFAULTS;
    struct job job = {
        .cfg = { .eps_h = -1, .accuracy_weight = 4, .refine = true, .skip_labels = true, .progress = progress },
        .w = { .device = "cpu", .range_min = NAN, .range_max = NAN },
        .shard = &shard,
    };
    struct cli_matching m = CLI_MATCHING_DEFAULTS;
    bool no_refine = false;
    const struct cli_option options[] = {
        CLI_MATCHING_OPTIONS(m),
        { "range-min", 0, CLI_DOUBLE, &job.w.range_min, "PX",
          "smallest disparity searched; default: the light field's, else estimated", -9999, 9999 },
        { "range-max", 0, CLI_DOUBLE, &job.w.range_max, "PX", "largest disparity searched", -9999, 9999 },
        { "labels", 0, CLI_STRING, &job.w.labels_dir, "DIR", "external label maps rr_cc.png, never recomputed" },
        { "disparity", 0, CLI_STRING, &job.w.disparity_dir, "DIR", "external disparities rr_cc.pfm, never recomputed" },
        { "model", 0, CLI_STRING, &job.w.model, "NAME", "segmentation network: an installed one or an ONNX file" },
        CLI_NO_VERIFY_OPTION(job.w.no_verify),
        { "no-labels", 0, CLI_FLAG, &job.w.no_labels, NULL, "disparity only" },
        { "epsilon-h", 0, CLI_DOUBLE, &job.cfg.eps_h, "V", "entropy threshold; default: the model's", 0, 1e9 },
        { "hand-label", 0, CLI_STRING, &job.w.hand_label, "FILE",
          "hand labels of the reference view, to optimise the threshold" },
        { "no-refine", 0, CLI_FLAG, &no_refine, NULL, "leave unlabeled rays unlabeled" },
        { "skip", 0, CLI_STRING, &job.w.skip, "LIST",
          "computations to do in part only: keys, ranges, hypotheses, labels, all or none" },
        { "align", 0, CLI_WORD, &job.w.unaligned, "WHEN",
          "auto: pictures that are displaced or have other gains are corrected; off: not", 0, 0, "auto off" },
        { "device", 0, CLI_STRING, &job.w.device, "D",
          "where views are labelled and matched: cpu (default), gpu, auto (gpu if there is one) or a part of "
          "a name" },
        { "device-memory", 0, CLI_INT, &job.w.device_memory, "MIB", CLI_DEVICE_MEMORY_HELP, 1, 1 << 24 },
        { "memory", 0, CLI_INT, &job.w.memory, "MIB",
          "memory of cost volumes: more views wait, one is matched always (default: 1536; 6144 where threads share "
          "none), "
          "and of a sweep's planes: foliage that needs more is matched view by view (3072)",
          1, 1 << 24 },
        { "json", 0, CLI_FLAG, &job.w.json, NULL, "print one JSON object; of several light fields a line each" },
        CLI_SHARD_OPTIONS(shard),
        { "split-views", 0, CLI_FLAG, &job.split, NULL,
          "with --shard: workers share the views of each light field: for few large ones" },
    };
    static const char *const same[] = { CLI_SHARD_NAMES, "split-views",   "threads", "json",
                                        "device",        "device-memory", NULL };
    const char **dirs = calloc((size_t)argc, sizeof(*dirs));
    char mccnn[SST_PATH_MAX], text[SST_CLAIM_JOB];
    int count = 0, r = dirs ? cli_parse(cmd, options, ARRAY_LEN(options), argc, argv, dirs, 1, argc) : CLI_MEMORY;

    if (r == CLI_GO_ON)
        r = cli_shard_read(cmd, &shard);
    if (r == CLI_GO_ON)
        r = read_options(cmd, &job, &m, mccnn);
    if (r == CLI_GO_ON) {
        cli_shard_job(text, sizeof(text), cmd, options, ARRAY_LEN(options), same);
        sst_refine_config_defaults(&job.cfg.refinement);
        job.cfg.refine = !no_refine;
        while (count < argc && dirs[count])
            count++;
        job.dir = (char *const *)(uintptr_t)dirs;
        job.text = text;
        if (!shard.status)
            r = cli_exit_code(open_devices(&job));
        r = r == CLI_GO_ON || r == CLI_OK ? process_listed(&job, count) : r;
        close_devices(&job);
    }
    free(dirs);
    return r;
}

const struct cli_command cli_process = { "process", run };
