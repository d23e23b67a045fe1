/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/method/process/process.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "base/thread.h"
#include "pipeline/lightfield/share.h"
#include "pipeline/method/labels/labels.h"
#include "pipeline/method/process/process_internal.h"

#define LABELLED_LEAST    5    /* views, or all of fewer */
#define LABELLED_TESTED   6    /* views, or all of fewer, with maps that were tested (balanced, accurate) */
#define DIFFER_SOME       0.01 /* of the labels that two views see: more views are labelled, which vote */
#define JITTER_PX         6.0  /* pairs that are off by less are corrected, not judged */
#define INFINITY_SLACK_PX 1.0  /* of an estimated range around infinity: errors of positions and noise */

struct run {
    struct sst_lightfield *lf;
    const struct sst_process_config *cfg;
    struct sst_process_extras *extras;
    struct sst_process_report *report;
    struct sst_map_f32 *entropy;       /* [views]; NULL: the threshold is the model's and extras are not wanted */
    struct sst_segmenter **segmenters; /* [threads] */
    bool judge;                        /* the report is wanted */
    bool *carried;                     /* [views] labels are carried over; NULL: no view's are */
    bool *labelled;                    /* [views] the network has labelled it */
    struct sst_map_u8 *source;         /* [views] where from; with `carried` */
};

static int views_of(const struct run *run)
{
    return run->lf->rows * run->lf->cols;
}

static bool cancelled(const struct run *run)
{
    return run->cfg->cancel && *run->cfg->cancel;
}

static void show_progress(const struct run *run, const char *stage, double done)
{
    if (run->cfg->progress)
        run->cfg->progress(run->cfg->progress_arg, stage, done);
}

/* For the maps that are allocated here; the stages log their own lack of memory. */
static int log_oom(int err)
{
    if (err == -ENOMEM)
        sst_log_error("not enough memory for the maps of the light field");
    return err;
}

static int copy_map(struct sst_map_u8 *to, const struct sst_map_u8 *from)
{
    const int err = sst_map_u8_init(to, from->width, from->height);

    if (!err)
        memcpy(to->data, from->data, from->stride * (size_t)from->height);
    return err;
}

/* Entropy as 8 bits, 255 at its largest possible value. */
static int pack_entropy(struct sst_map_u8 *to, const struct sst_map_f32 *from, int classes)
{
    const float scale = classes > 1 ? 255.0f / logf((float)classes) : 0.0f;
    const int err = sst_map_u8_init(to, from->width, from->height);

    for (int y = 0; !err && y < from->height; y++) {
        const float *in = sst_map_f32_row(from, y);
        uint8_t *out = sst_map_u8_row(to, y);

        for (int x = 0; x < from->width; x++) {
            const float v = in[x] * scale + 0.5f;

            out[x] = (uint8_t)(v < 255.0f ? v : 255.0f);
        }
    }
    return err;
}

static int find_eps_h(const struct run *run, double *eps_h)
{
    const int ref = run->lf->ref_view;
    struct sst_epsilon_result found;
    const int err = sst_epsilon_search(&found, &run->lf->views[ref].label, &run->entropy[ref], run->cfg->hand_label,
                                       run->cfg->accuracy_weight);

    if (!err) {
        *eps_h = found.eps_h;
        sst_log_info("eps_H %.4f: accuracy %.1f %%, coverage %.1f %% on the hand-labelled view", found.eps_h,
                     100 * found.accuracy, 100 * found.coverage);
    }
    return err;
}

/* Labelled pixels and all of each view. */
struct covered {
    const struct sst_lightfield *lf;
    int64_t labelled[SST_MAX_VIEWS], all[SST_MAX_VIEWS];
};

static int count_labelled(void *arg, int view, int worker SST_UNUSED)
{
    struct covered *c = arg;
    const struct sst_map_u8 *map = &c->lf->views[view].label;

    for (int y = 0; y < map->height; y++) {
        const uint8_t *row = sst_map_u8_row(map, y);
        int labelled = 0;

        for (int x = 0; x < map->width; x++)
            labelled += row[x] != SST_LABEL_NONE;
        c->labelled[view] += labelled;
    }
    c->all[view] = (int64_t)map->width * map->height;
    return 0;
}

static double coverage(const struct run *run)
{
    struct covered c = { .lf = run->lf };
    int64_t labelled = 0, all = 0;

    if (sst_parallel_for(views_of(run), run->cfg->threads, count_labelled, &c))
        return NAN;
    for (int view = 0; view < views_of(run); view++) {
        labelled += c.labelled[view];
        all += c.all[view];
    }
    return all ? 100.0 * (double)labelled / (double)all : NAN;
}

/* Rectified pixels that the camera did not see have no label, whatever the network says. */
static void unlabel_unseen(struct sst_view *v)
{
    for (int y = 0; v->valid.data && y < v->label.height; y++) {
        for (int x = 0; x < v->label.width; x++)
            sst_map_u8_row(&v->label, y)[x] &= sst_map_u8_row(&v->valid, y)[x];
    }
}

static bool is_to_label(const struct run *run, int view)
{
    return run->lf->views[view].present && !(run->carried && run->carried[view]) && !run->labelled[view];
}

static int segment_view(void *arg, int view, int worker)
{
    struct run *run = arg;
    struct sst_segmenter *seg = run->segmenters[worker];
    struct sst_view *v = &run->lf->views[view];
    int err;

    if (worker == 0)
        show_progress(run, "labels", (double)view / views_of(run));
    if (!is_to_label(run, view))
        return 0;
    if (cancelled(run))
        return -ECANCELED;
    sst_map_u8_fini(&v->label);
    err = run->entropy ? sst_segment(seg, &v->image, &v->label, &run->entropy[view], NULL)
                       : sst_segment_hcsm(seg, &v->image, &v->label);
    if (!err)
        unlabel_unseen(v);
    return err;
}

static void segmented_maps(void *arg, int view, struct sst_share_maps *out)
{
    const struct run *run = arg;

    if (!is_to_label(run, view))
        return;
    sst_share_add_u8(out, &run->lf->views[view].label);
    if (run->entropy)
        sst_share_add_f32(out, &run->entropy[view]);
}

/* Keep the labels and entropies before the threshold for the extras. */
static int copy_extras(void *arg, int view, int worker SST_UNUSED)
{
    struct run *run = arg;
    struct sst_process_extras *extras = run->extras;
    const struct sst_view *v = &run->lf->views[view];
    int err;

    if (!v->present || !run->entropy[view].data)
        return 0;
    err = copy_map(&extras->map[SST_EXTRA_INITIAL][view], &v->label);
    return log_oom(
        err ? err : pack_entropy(&extras->map[SST_EXTRA_ENTROPY][view], &run->entropy[view], run->lf->classes.count));
}

/* Labels that are complete, and the threshold of their entropies. */
struct threshold {
    struct run *run;
    double eps_h;
};

/* Drop the labels of high entropy. */
static int threshold_view(void *arg, int view, int worker SST_UNUSED)
{
    const struct threshold *t = arg;
    struct run *run = t->run;
    struct sst_view *v = &run->lf->views[view];

    if (!v->present || !run->entropy[view].data)
        return 0;
    sst_hcsm(&v->label, &run->entropy[view], t->eps_h);
    return run->extras ? log_oom(copy_map(&run->extras->map[SST_EXTRA_HCSM][view], &v->label)) : 0;
}

/* Both for a view that labels are carried to, while its maps are in the cache. */
static int finish_carried(void *arg, int view)
{
    const struct threshold *t = arg;
    const int err = t->run->extras ? copy_extras(t->run, view, 0) : 0;

    return err ? err : threshold_view(arg, view, 0);
}

static struct process_carry carry_of(const struct run *run)
{
    const struct sst_process_config *cfg = run->cfg;

    return (struct process_carry){
        .lf = run->lf, .carried = run->carried, .share = cfg->share, .threads = cfg->threads, .source = run->source
    };
}

/* What one process measures for all. */
struct measured {
    struct process_carry carry;
    double value;
};

static void measured_values(void *arg, int index SST_UNUSED, struct sst_share_maps *out)
{
    struct measured *m = arg;

    sst_share_add_values(out, &m->value, sizeof(m->value));
}

static int measure_carried(void *arg, int index SST_UNUSED, int worker SST_UNUSED)
{
    struct measured *m = arg;

    return process_carry_error(&m->carry, m->carry.lf->ref_view, &m->value);
}

/* The choice of one process, for all. */
struct choice {
    struct run *run;
    int least, labelled; /* views */
};

static int find_choice(void *arg, int index SST_UNUSED, int worker SST_UNUSED)
{
    struct choice *c = arg;

    return process_choose_labelled(c->run->carried, &c->labelled, c->run->lf, c->least, c->run->cfg->threads);
}

static void choice_values(void *arg, int index SST_UNUSED, struct sst_share_maps *out)
{
    struct choice *c = arg;

    sst_share_add_values(out, c->run->carried, (size_t)views_of(c->run) * sizeof(*c->run->carried));
    sst_share_add_values(out, &c->labelled, sizeof(c->labelled));
}

static int count_present(const struct run *run)
{
    int present = 0;

    for (int k = 0; k < views_of(run); k++)
        present += run->lf->views[k].present;
    return present;
}

/* All views that have no labels yet are the network's. */
static void carry_nothing(struct run *run)
{
    free(run->carried);
    run->carried = NULL;
    run->report->labels_skipped = NAN;
}

/* Choose the views that the network labels, views that have its labels among them: all where most are shown too little
 * by others. @param least  views */
static int choose_labelled(struct run *run, int least)
{
    const int present = count_present(run);
    struct choice choice = { .run = run, .least = least };
    const int err = sst_share_for(run->cfg->share, 1, 1, find_choice, &choice, choice_values);

    for (int k = 0; !err && k < views_of(run); k++) {
        if (run->carried[k] && run->labelled[k]) {
            run->carried[k] = false;
            choice.labelled++;
        }
    }
    if (err || choice.labelled < 2 || choice.labelled >= present) {
        carry_nothing(run);
        return err;
    }
    run->report->labels_skipped = 100.0 * (present - choice.labelled) / present;
    return 0;
}

/* The first choice, by the maps. */
static int choose_first(struct run *run)
{
    const struct sst_lightfield *lf = run->lf;
    bool can = lf->views[lf->ref_view].present;

    for (int k = 0; k < views_of(run); k++)
        can &= !lf->views[k].present || lf->views[k].disp.data;
    if (!can)
        return 0;
    run->carried = calloc((size_t)views_of(run), sizeof(*run->carried));
    run->source = calloc((size_t)views_of(run), sizeof(*run->source));
    if (!run->carried || !run->source)
        return -ENOMEM;
    return choose_labelled(run, lf->disparity_tested ? LABELLED_TESTED : LABELLED_LEAST);
}

/* The carried views' labels, and what this changes. */
static int carry_views(struct run *run, double eps_h)
{
    struct measured error = { carry_of(run), NAN };
    struct threshold t = { run, eps_h };
    int err;

    if (!run->carried)
        return 0;
    if (run->entropy && !run->cfg->share && !run->cfg->hand_label) {
        error.carry.then = finish_carried;
        error.carry.arg = &t;
    }
    err = process_carry_labels(&error.carry, run->entropy, false);
    err = err ? err : sst_share_for(run->cfg->share, 1, 1, measure_carried, &error, measured_values);
    run->report->labels_error = error.value;
    return log_oom(err);
}

static int open_segmenter(void *arg, int index, int worker SST_UNUSED)
{
    struct run *run = arg;
    const struct sst_process_config *cfg = run->cfg;
    int err = 0;

    if (!run->segmenters[index])
        err = sst_segmenter_open(&run->segmenters[index], cfg->model, cfg->precision, 1);
    if (!err)
        sst_segmenter_use_runner(run->segmenters[index], cfg->networks);
    return err;
}

/* One segmenter per thread, each on one core: whole views side by side need no waiting between layers. */
static int open_segmenters(struct run *run, int workers)
{
    const struct sst_process_config *cfg = run->cfg;

    run->segmenters = cfg->segmenters ? cfg->segmenters : calloc((size_t)workers, sizeof(*run->segmenters));
    if (!run->segmenters)
        return log_oom(-ENOMEM);
    return sst_parallel_for(workers, cfg->networks ? 1 : workers, open_segmenter, run);
}

static void close_segmenters(struct run *run, int workers)
{
    if (run->cfg->segmenters)
        return;
    for (int i = 0; run->segmenters && i < workers; i++)
        sst_segmenter_close(run->segmenters[i]);
    free(run->segmenters);
}

/* The network's labels of the views that have none yet. */
static int segment_views(struct run *run, int workers)
{
    const int err = sst_share_for(run->cfg->share, views_of(run), workers, segment_view, run, segmented_maps);

    for (int k = 0; k < views_of(run); k++)
        run->labelled[k] = run->lf->views[k].present && !(run->carried && run->carried[k]);
    return err;
}

/* Where the labels of one surface differ between views, so they do between views that are not labelled: then more views
 * vote, or all keep their own. */
static int segment_more(struct run *run, int workers, double eps_h)
{
    const double differ = run->carried ? process_labels_differ(run->lf, run->carried, run->entropy, eps_h) : 0;
    int err = 0;

    if (differ < DIFFER_SOME)
        return 0;
    err = log_oom(choose_labelled(run, count_present(run)));
    return err ? err : segment_views(run, workers);
}

static int segment(struct run *run, double *eps_h)
{
    const int workers = sst_clamp_int(run->cfg->threads, 1, views_of(run));
    int err = open_segmenters(run, workers);

    err = err ? err : segment_views(run, workers);
    if (!err) {
        run->lf->classes = *sst_segmenter_classes(run->segmenters[0]);
        *eps_h = run->cfg->eps_h >= 0 ? run->cfg->eps_h : sst_segmenter_eps_h(run->segmenters[0]);
        err = segment_more(run, workers, *eps_h);
    }
    close_segmenters(run, workers);
    return err;
}

/* Drop the labels of high entropy. */
static int threshold_views(struct run *run, double eps_h)
{
    struct threshold t = { run, eps_h };

    return sst_parallel_for(views_of(run), run->cfg->threads, threshold_view, &t);
}

static int allocate(struct run *run)
{
    const size_t views = (size_t)views_of(run);

    for (int i = 0; run->extras && i < SST_EXTRAS; i++) {
        run->extras->map[i] = calloc(views, sizeof(*run->extras->map[i]));
        if (!run->extras->map[i])
            return -ENOMEM;
        run->extras->views = (int)views;
    }
    run->labelled = calloc(views, sizeof(*run->labelled));
    if (!run->labelled)
        return -ENOMEM;
    if (run->extras || run->cfg->hand_label || run->cfg->eps_h >= 0) {
        run->entropy = calloc(views, sizeof(*run->entropy));
        return run->entropy ? 0 : -ENOMEM;
    }
    return 0;
}

static int label_views(struct run *run)
{
    double eps_h = 0;
    int err = log_oom(allocate(run));

    if (run->cfg->skip_labels && run->report->parallax != SST_PARALLAX_NONE)
        err = err ? err : log_oom(choose_first(run));
    err = err ? err : segment(run, &eps_h);
    err = err ? err : carry_views(run, eps_h);
    if (run->extras)
        err = err ? err : sst_parallel_for(views_of(run), run->cfg->threads, copy_extras, run);
    if (!err && run->cfg->hand_label)
        err = find_eps_h(run, &eps_h);
    if (!err && run->entropy)
        err = threshold_views(run, eps_h);
    run->report->eps_h = eps_h;
    for (int view = 0; run->entropy && view < views_of(run); view++)
        sst_map_f32_fini(&run->entropy[view]);
    free(run->entropy);
    return err;
}

static void disparity_progress(void *arg, double done)
{
    show_progress(arg, "disparity", done);
}

static int find_parallax(void *arg, int index SST_UNUSED, int worker SST_UNUSED)
{
    struct run *run = arg;
    struct sst_process_report *report = run->report;

    report->parallax = run->lf->images_raw ? SST_PARALLAX_UNKNOWN : sst_lightfield_parallax(run->lf, NULL);
    for (int k = 0; !run->lf->images_raw && k < views_of(run); k++) {
        const struct sst_view *v = &run->lf->views[k];

        report->plain[k] = v->present && v->image.plane[0] && sst_judge_is_plain(&v->image);
    }
    return 0;
}

static void found_parallax(void *arg, int index SST_UNUSED, struct sst_share_maps *out)
{
    struct run *run = arg;

    sst_share_add_values(out, &run->report->parallax, sizeof(run->report->parallax));
    sst_share_add_values(out, run->report->plain, sizeof(run->report->plain));
}

/* Equal views, and views without texture, agree on whatever disparity they get, which confirms nothing. */
static int judge_parallax(struct run *run)
{
    const int err = sst_share_for(run->cfg->share, 1, 1, find_parallax, run, found_parallax);

    for (int k = 0; k < views_of(run); k++) {
        struct sst_map_u8 *map = &run->lf->views[k].confidence;

        if (map->data && (run->report->parallax == SST_PARALLAX_NONE || run->report->plain[k]))
            memset(map->data, 0, map->stride * (size_t)map->height);
    }
    return err;
}

/* Nothing is wrong with the pictures, and nothing would be corrected. */
static bool is_enough(void *arg, const struct sst_drift *first)
{
    struct run *run = arg;

    sst_judge_pictures(&run->report->judgement, run->lf, first);
    return run->report->judgement.plausible && sst_align_is_clean(run->lf, first);
}

/* Judge the pictures and correct them; those from which nothing can be measured stay as they are. */
static int align_views(struct run *run)
{
    const struct sst_drift_config cfg = { .threads = run->cfg->threads,
                                          .loose = true,
                                          .unusable_px = JITTER_PX,
                                          .enough = is_enough,
                                          .arg = run,
                                          .share = run->cfg->share };
    struct sst_process_report *report = run->report;
    struct sst_lightfield *lf = run->lf;
    struct sst_correction correction[SST_MAX_VIEWS];
    struct sst_drift check;
    int err;

    if ((!run->judge && !run->cfg->align) || lf->images_raw || !sst_drift_possible(lf))
        return 0;
    err = sst_drift_check(&check, lf, &cfg);
    if (err)
        return err;
    sst_judge_pictures(&report->judgement, lf, &check);
    if (run->cfg->align) {
        sst_align_plan(correction, &report->align, lf, &check);
        for (int k = 0; k < views_of(run); k++)
            correction[k] = report->judgement.view[k].fault == SST_VIEW_FINE ? correction[k] : sst_correction_none();
    }
    sst_drift_fini(&check);
    if (report->align.moved || report->align.lit || report->align.faded || report->align.bent)
        err = sst_lightfield_correct(run->cfg->share, lf, correction, run->cfg->threads);
    return err;
}

static int match_views(struct run *run)
{
    struct sst_disparity_config cfg = run->cfg->disparity;
    struct sst_lightfield *lf = run->lf;
    int err = 0;

    cfg.threads = run->cfg->threads;
    cfg.cancel = run->cfg->cancel;
    cfg.share = run->cfg->share;
    cfg.report = &run->report->skipped;
    if (!(cfg.disp_max_px > cfg.disp_min_px)) {
        cfg.disp_min_px = lf->range_min_px;
        cfg.disp_max_px = lf->range_max_px;
    }
    if (!(cfg.disp_max_px > cfg.disp_min_px)) {
        const struct sst_disparity_search search = {
            .scale = 1, .threads = run->cfg->threads, .runner = cfg.runner, .share = cfg.share
        };

        err = sst_disparity_range(lf, &search, &cfg.disp_min_px, &cfg.disp_max_px);
        if (!err && lf->infinity_known && !lf->calibration) { /* nothing is behind infinity; cameras may have drifted */
            cfg.disp_min_px = fmax(cfg.disp_min_px, lf->infinity_px - INFINITY_SLACK_PX);
            cfg.disp_max_px = fmax(cfg.disp_max_px, lf->infinity_px + INFINITY_SLACK_PX);
        }
        if (!err)
            sst_log_info("disparities found between %.0f and %.0f px", cfg.disp_min_px, cfg.disp_max_px);
    }
    run->report->disp_min_px = cfg.disp_min_px;
    run->report->disp_max_px = cfg.disp_max_px;
    err = err ? err : sst_process_check_range(cfg.disp_min_px, cfg.disp_max_px);
    err = err ? err : sst_disparity_lightfield(lf, &cfg, disparity_progress, run);
    return err ? err : judge_parallax(run);
}

static int refine_views(struct run *run)
{
    struct sst_refine_config cfg = run->cfg->refinement;
    int err = 0;

    if (!sst_lightfield_has(run->lf, SST_LOAD_LABELS))
        return 0;
    cfg.threads = run->cfg->threads;
    cfg.cancel = run->cfg->cancel;
    cfg.skip = run->carried;
    cfg.share = run->cfg->share;
    run->report->coverage_hcsm = coverage(run);
    if (run->cfg->refine)
        err = sst_refine_labels(run->lf, &cfg, NULL);
    if (run->cfg->refine && run->cfg->model) /* external labels stay as they are */
        err = err ? err : log_oom(process_vote_labels(run->lf, run->carried, cfg.share, cfg.threads));
    if (run->cfg->refine && run->carried) {
        const struct process_carry carry = carry_of(run);

        err = err ? err : log_oom(process_carry_labels(&carry, NULL, true));
    }
    run->report->coverage_refined = coverage(run);
    return err;
}

struct sst_process_time sst_process_lap(struct sst_process_time *from)
{
    const struct sst_process_time now = { (double)sst_clock_now_ns() * 1e-9, (double)sst_clock_cpu_ns() * 1e-9 };
    const struct sst_process_time took = { now.wall_s - from->wall_s, now.cpu_s - from->cpu_s };

    *from = now;
    return took;
}

int sst_process(struct sst_lightfield *lf, const struct sst_process_config *cfg, struct sst_process_extras *extras,
                struct sst_process_report *report)
{
    struct sst_process_report unwanted;
    struct run run = { .lf = lf, .cfg = cfg, .extras = extras, .report = report ? report : &unwanted, .judge = report };
    struct sst_process_time clock = { 0 };
    int err = 0;

    *run.report = (struct sst_process_report){ .eps_h = NAN,
                                               .coverage_hcsm = NAN,
                                               .coverage_refined = NAN,
                                               .confirmed = NAN,
                                               .skipped = { NAN, NAN, NAN, NAN },
                                               .labels_skipped = NAN,
                                               .labels_error = NAN };
    sst_process_lap(&clock);
    if (report)
        err = log_oom(sst_notice_measure(&report->notices, lf, cfg->share, cfg->threads));
    if (!err && !cfg->keep_disparity)
        err = align_views(&run);
    if (!err && !cfg->keep_disparity)
        err = match_views(&run);
    if (!err && report) {
        run.report->confirmed = 100 * sst_lightfield_confirmed(lf, cfg->threads);
        if (!cfg->keep_disparity)
            sst_judge_plain(&run.report->judgement, lf, run.report->plain);
        if (!cfg->keep_disparity)
            sst_judge_maps(&run.report->judgement, lf, run.report->confirmed);
    }
    run.report->disparity = sst_process_lap(&clock);
    if (!err && cfg->model)
        err = label_views(&run);
    run.report->labels = sst_process_lap(&clock);
    err = err ? err : refine_views(&run);
    run.report->refinement = sst_process_lap(&clock);
    for (int view = 0; run.source && view < views_of(&run); view++)
        sst_map_u8_fini(&run.source[view]);
    free(run.source);
    free(run.carried);
    free(run.labelled);
    return err;
}

void sst_process_extras_fini(struct sst_process_extras *extras)
{
    for (int i = 0; i < SST_EXTRAS; i++) {
        for (int view = 0; extras->map[i] && view < extras->views; view++)
            sst_map_u8_fini(&extras->map[i][view]);
        free(extras->map[i]);
    }
    *extras = (struct sst_process_extras){ 0 };
}
