#include "pipeline/method/process/process.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "base/thread.h"
#include "pipeline/image/codec.h"
#include "pipeline/lightfield/unsure.h"
#include "pipeline/method/labels/labels.h"

/* Maps that only explain the result; written beside the main ones. */
enum extra {
    EXTRA_INITIAL = 0,
    EXTRA_HCSM = 1,
    EXTRA_ENTROPY = 2,
    EXTRAS = 3,
};

static const char *const extra_names[EXTRAS] = { "labels_initial", "labels_hcsm", "entropy" };

struct run {
    struct sst_lightfield *lf;
    const char *dir;
    const struct sst_process_config *cfg;
    struct sst_process_report *report;
    struct sst_map_u8 *extra[EXTRAS];  /* [views] each */
    struct sst_map_f32 *entropy;       /* [views] */
    struct sst_segmenter **segmenters; /* [threads], while views are labelled */
    struct sst_outdir *out;            /* the folder being written */
    int kind;                          /* of the extra being written */
};

static int views_of(const struct run *run)
{
    return run->lf->rows * run->lf->cols;
}

static void show_progress(const struct run *run, const char *stage, double done)
{
    if (run->cfg->progress)
        run->cfg->progress(run->cfg->progress_arg, stage, done);
}

/* The stages tell of their own lack of memory; this does it for the maps that are made here. */
static int told(const struct run *run, int err)
{
    if (err)
        sst_log_error("not enough memory to process %s", run->dir);
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
    const struct sst_view *ref = &run->lf->views[run->lf->ref_view];
    struct sst_epsilon_result found;
    struct sst_map_u8 truth = { 0 };
    int err = sst_map_u8_read_png(&truth, run->cfg->hand_label);

    if (err)
        return err;
    err = sst_epsilon_search(&found, &ref->label, &run->entropy[run->lf->ref_view], &truth, run->cfg->accuracy_weight);
    sst_map_u8_fini(&truth);
    if (!err) {
        *eps_h = found.eps_h;
        sst_log_info("eps_H %.4f: accuracy %.1f %%, coverage %.1f %% on the hand-labelled view", found.eps_h,
                     100 * found.accuracy, 100 * found.coverage);
    }
    return err;
}

static double coverage(const struct run *run)
{
    int64_t labelled = 0, all = 0;

    for (int view = 0; view < views_of(run); view++) {
        const struct sst_map_u8 *map = &run->lf->views[view].label;

        for (int y = 0; y < map->height; y++) {
            const uint8_t *row = sst_map_u8_row(map, y);

            for (int x = 0; x < map->width; x++)
                labelled += row[x] != SST_LABEL_NONE;
        }
        all += (int64_t)map->width * map->height;
    }
    return all ? 100.0 * (double)labelled / (double)all : NAN;
}

/* What the network makes of the black beside a rectified picture is no label. */
static void unlabel_unseen(struct sst_view *v)
{
    for (int y = 0; v->valid.data && y < v->label.height; y++) {
        for (int x = 0; x < v->label.width; x++)
            sst_map_u8_row(&v->label, y)[x] &= sst_map_u8_row(&v->valid, y)[x];
    }
}

static int segment_view(void *arg, int view, int worker)
{
    struct run *run = arg;
    struct sst_segmenter *seg = run->segmenters[worker];
    struct sst_view *v = &run->lf->views[view];
    int err;

    if (worker == 0)
        show_progress(run, "labels", (double)view / views_of(run));
    if (!v->present)
        return 0;
    sst_map_u8_fini(&v->label);
    err = sst_segment(seg, &v->image, &v->label, &run->entropy[view], NULL);
    if (!err)
        unlabel_unseen(v);
    err = err ? err : told(run, copy_map(&run->extra[EXTRA_INITIAL][view], &v->label));
    return err ? err
               : told(run, pack_entropy(&run->extra[EXTRA_ENTROPY][view], &run->entropy[view],
                                        sst_segmenter_classes(seg)->count));
}

/* One segmenter per thread, each on one core: whole views side by side need no waiting between layers. */
static int segment_views(struct run *run, double *eps_h)
{
    const int workers = sst_clamp_int(run->cfg->threads, 1, views_of(run));
    int err = 0, opened = 0;

    run->segmenters = calloc((size_t)workers, sizeof(*run->segmenters));
    if (!run->segmenters)
        return told(run, -ENOMEM);
    while (!err && opened < workers) {
        err = sst_segmenter_open(&run->segmenters[opened], run->cfg->model, run->cfg->precision, 1);
        opened += !err;
    }
    err = err ? err : sst_parallel_for(views_of(run), workers, segment_view, run);
    if (!err) {
        run->lf->classes = *sst_segmenter_classes(run->segmenters[0]);
        *eps_h = sst_segmenter_eps_h(run->segmenters[0]);
    }
    while (opened > 0)
        sst_segmenter_close(run->segmenters[--opened]);
    free(run->segmenters);
    return err;
}

static int label_views(struct run *run)
{
    double eps_h = 0;
    int err = segment_views(run, &eps_h);

    if (run->cfg->eps_h >= 0)
        eps_h = run->cfg->eps_h;
    if (!err && run->cfg->hand_label)
        err = find_eps_h(run, &eps_h);
    for (int view = 0; !err && view < views_of(run); view++) {
        struct sst_view *v = &run->lf->views[view];

        if (!v->present)
            continue;
        sst_hcsm(&v->label, &run->entropy[view], eps_h);
        sst_map_f32_fini(&run->entropy[view]);
        err = told(run, copy_map(&run->extra[EXTRA_HCSM][view], &v->label));
    }
    run->report->eps_h = eps_h;
    return err;
}

/* How much of the maps is no guess. */
static int judge(const struct run *run)
{
    struct sst_unsure u = { 0 };
    const int err = told(run, sst_unsure_init(&u, run->lf, run->cfg->threads));

    if (!err)
        run->report->confirmed = 100 * u.confirmed;
    sst_unsure_fini(&u);
    return err;
}

static void disparity_progress(void *arg, double done)
{
    show_progress(arg, "disparity", done);
}

static int match_views(struct run *run)
{
    struct sst_disparity_config cfg = run->cfg->disparity;
    struct sst_lightfield *lf = run->lf;
    int err = 0;

    if (!(cfg.disp_max_px > cfg.disp_min_px)) {
        cfg.disp_min_px = lf->range_min_px;
        cfg.disp_max_px = lf->range_max_px;
    }
    if (!(cfg.disp_max_px > cfg.disp_min_px)) {
        err = sst_disparity_range(lf, run->cfg->threads, &cfg.disp_min_px, &cfg.disp_max_px);
        if (!err)
            sst_log_info("disparities found between %.0f and %.0f px", cfg.disp_min_px, cfg.disp_max_px);
    }
    run->report->disp_min_px = cfg.disp_min_px;
    run->report->disp_max_px = cfg.disp_max_px;
    return err ? err : sst_disparity_lightfield(lf, &cfg, disparity_progress, run);
}

static int write_extra(void *arg, int view, int worker SST_UNUSED)
{
    const struct run *run = arg;
    const struct sst_map_u8 *map = &run->extra[run->kind][view];
    char name[16], file[32], path[SST_PATH_MAX];
    int err;

    if (!map->data)
        return 0;
    sst_view_name(run->lf, view, name);
    snprintf(file, sizeof(file), "%s.png", name);
    err = sst_path_join(path, run->out->temporary, file);
    return err ? err : sst_map_u8_write_png(map, path, run->kind == EXTRA_ENTROPY ? NULL : sst_classes_palette());
}

static void remove_folder(const struct run *run, const char *name)
{
    char path[SST_PATH_MAX];

    if (!sst_path_join(path, run->dir, name))
        sst_path_remove_tree(path);
}

static bool any_confidence(const struct sst_lightfield *lf)
{
    for (int view = 0; view < lf->rows * lf->cols; view++) {
        if (lf->views[view].confidence.data)
            return true;
    }
    return false;
}

/* What an earlier run computed from maps that given ones have replaced. */
static void remove_stale(const struct run *run)
{
    for (int i = 0; run->lf->labels_given && i < EXTRAS; i++)
        remove_folder(run, extra_names[i]);
    if (run->lf->disparity_given && !any_confidence(run->lf))
        remove_folder(run, "confidence");
}

/* The maps and the extra folders that this run made; everything is written before anything is replaced. */
static int save(struct run *run)
{
    struct sst_outdir out[EXTRAS];
    char path[SST_PATH_MAX];
    int err = 0, opened = 0;

    for (; !err && run->extra[0] && opened < EXTRAS; opened++) {
        err = sst_path_join(path, run->dir, extra_names[opened]);
        err = err ? err : sst_outdir_open(&out[opened], path, true);
        if (err)
            break;
        run->kind = opened;
        run->out = &out[opened];
        err = sst_parallel_for(views_of(run), run->cfg->threads, write_extra, run);
    }
    err = err ? err : sst_lightfield_save_maps(run->lf, run->dir, run->cfg->threads);
    for (int i = 0; i < opened; i++) {
        err = err ? err : sst_outdir_commit(&out[i]);
        sst_outdir_abort(&out[i]);
    }
    if (!err)
        remove_stale(run);
    return err;
}

static int allocate(struct run *run)
{
    const size_t views = (size_t)views_of(run);

    run->entropy = calloc(views, sizeof(*run->entropy));
    for (int i = 0; i < EXTRAS; i++) {
        run->extra[i] = calloc(views, sizeof(*run->extra[i]));
        if (!run->extra[i])
            return -ENOMEM;
    }
    return run->entropy ? 0 : -ENOMEM;
}

static void release(struct run *run)
{
    for (int view = 0; view < views_of(run); view++) {
        for (int i = 0; i < EXTRAS; i++) {
            if (run->extra[i])
                sst_map_u8_fini(&run->extra[i][view]);
        }
        if (run->entropy)
            sst_map_f32_fini(&run->entropy[view]);
    }
    for (int i = 0; i < EXTRAS; i++)
        free(run->extra[i]);
    free(run->entropy);
}

static bool any_label(const struct sst_lightfield *lf)
{
    for (int view = 0; view < lf->rows * lf->cols; view++) {
        if (lf->views[view].label.data)
            return true;
    }
    return false;
}

/* Time since `from`, which moves up to now. */
static struct sst_stage_time lap(struct sst_stage_time *from)
{
    const struct sst_stage_time now = { (double)sst_clock_now_ns() * 1e-9, (double)sst_clock_cpu_ns() * 1e-9 };
    const struct sst_stage_time took = { now.wall_s - from->wall_s, now.cpu_s - from->cpu_s };

    *from = now;
    return took;
}

static int run_stages(struct run *run, struct sst_stage_time *clock)
{
    struct sst_lightfield *lf = run->lf;
    const struct sst_process_config *cfg = run->cfg;
    int err = 0;

    if (!lf->labels_given && cfg->model) {
        err = told(run, allocate(run));
        err = err ? err : label_views(run);
    }
    run->report->labels = lap(clock);
    if (!err && !lf->disparity_given)
        err = match_views(run);
    err = err ? err : judge(run);
    run->report->disparity = lap(clock);
    if (!err && any_label(lf)) {
        run->report->coverage_hcsm = coverage(run);
        if (cfg->refine)
            err = sst_refine_labels(lf, &cfg->refinement, NULL);
        run->report->coverage_refined = coverage(run);
    }
    run->report->refinement = lap(clock);
    return err;
}

int sst_process(struct sst_lightfield *lf, const char *dir, const struct sst_process_config *cfg,
                struct sst_process_report *report)
{
    struct run run = { .lf = lf, .dir = dir, .cfg = cfg, .report = report };
    struct sst_stage_time clock = { 0 };
    int err;

    *report =
        (struct sst_process_report){ .eps_h = NAN, .coverage_hcsm = NAN, .coverage_refined = NAN, .confirmed = NAN };
    lap(&clock);
    err = run_stages(&run, &clock);
    if (!err)
        show_progress(&run, "saving", 0.99);
    err = err ? err : save(&run);
    report->saving = lap(&clock);
    release(&run);
    return err;
}
