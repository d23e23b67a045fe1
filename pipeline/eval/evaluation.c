/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/eval/evaluation.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "base/clock.h"
#include "base/log.h"
#include "base/mem.h"
#include "base/stats.h"
#include "base/thread.h"
#include "pipeline/image/codec.h"

/* The kinds of label maps. */
enum stage { INITIAL, HCSM, REFINED, STAGES };

/* Truth of one view, and its measurements. */
struct view_truth {
    struct sst_map_f32 disp; /* empty: no truth */
    struct sst_map_u8 label; /* empty: no truth */
    struct sst_disparity_error all, nonocc;
    struct sst_confusion *confusion; /* [STAGES] */
    bool measured[STAGES];
};

struct job {
    const struct sst_lightfield *lf;
    const char *lf_dir, *truth_dir;
    const struct sst_truth *truth;
    struct view_truth *views; /* [rows * cols] */
    int ref;                  /* view of the pictures, and their renderer */
    struct sst_renderer *r;
};

static int check_size(const char *path, int width, int height, const struct sst_lightfield *lf)
{
    if (width == lf->width && height == lf->height)
        return 0;
    sst_log_error("%s: %dx%d pixels, but the light field has %dx%d; give maps of this light field", path, width, height,
                  lf->width, lf->height);
    return -EBADMSG;
}

/* Path of a view's map; empty if there is no such file. */
static int map_path(char path[SST_PATH_MAX], const struct job *job, const char *dir, int view, const char *suffix)
{
    char name[16];
    int n;

    sst_view_name(job->lf, view, name);
    n = snprintf(path, SST_PATH_MAX, "%s/%s%s", dir, name, suffix);
    if (n >= SST_PATH_MAX) {
        sst_log_error("%s: the path is too long; move the folder", dir);
        return -ENAMETOOLONG;
    }
    if (!sst_path_exists(path))
        path[0] = '\0';
    return 0;
}

static int read_labels(struct sst_map_u8 *map, const struct job *job, const char *dir, int view)
{
    char path[SST_PATH_MAX];
    int err = map_path(path, job, dir, view, ".png");

    if (err || !path[0])
        return err;
    err = sst_map_u8_read_png(map, path);
    return err ? err : check_size(path, map->width, map->height, job->lf);
}

static int load_view(void *arg, int index, int worker SST_UNUSED)
{
    struct job *job = arg;
    struct view_truth *t = &job->views[index];
    char path[SST_PATH_MAX];
    int err;

    if (!job->lf->views[index].present)
        return 0;
    err = map_path(path, job, job->truth_dir, index, ".pfm");
    if (!err && path[0]) {
        err = sst_map_f32_read_pfm(&t->disp, path);
        err = err ? err : check_size(path, t->disp.width, t->disp.height, job->lf);
    }
    return err ? err : read_labels(&t->label, job, job->truth_dir, index);
}

/* Mark the pixels with a true surface that is visible in at least one of the four neighbouring views. */
static int mark_visible(struct sst_map_u8 *mask, const struct job *job, int index)
{
    static const int step[4][2] = { { 0, -1 }, { 0, 1 }, { -1, 0 }, { 1, 0 } };
    const struct sst_lightfield *lf = job->lf;
    int err = 0;

    for (int i = 0; i < 4 && !err; i++) {
        const int row = index / lf->cols + step[i][0], col = index % lf->cols + step[i][1],
                  other = row * lf->cols + col;

        if (row < 0 || col < 0 || row >= lf->rows || col >= lf->cols || !job->views[other].disp.data)
            continue;
        err = sst_eval_visible(mask, &job->views[index].disp, &job->views[other].disp,
                               lf->views[other].bx - lf->views[index].bx, lf->views[other].by - lf->views[index].by);
    }
    return err;
}

static int measure_disparity(struct job *job, int index)
{
    const struct sst_lightfield *lf = job->lf;
    const struct sst_view *v = &lf->views[index];
    struct view_truth *t = &job->views[index];
    struct sst_map_f32 estimate = { 0 };
    struct sst_map_u8 mask = { 0 };
    int err;

    if (!v->disp.data) {
        sst_log_error("%s: view %02d_%02d has truth but no disparities; run `sst process %s` first", job->lf_dir,
                      index / lf->cols, index % lf->cols, job->lf_dir);
        return -ENOENT;
    }
    err = sst_map_f32_init(&estimate, lf->width, lf->height);
    err = err ? err : sst_map_u8_init(&mask, lf->width, lf->height);
    for (int y = 0; y < lf->height && !err; y++) {
        const uint16_t *q = sst_map_u16_row(&v->disp, y);
        float *e = sst_map_f32_row(&estimate, y);

        for (int x = 0; x < lf->width; x++)
            e[x] = q[x] == SST_DISP_NONE ? INFINITY : (float)sst_disp_px(lf, q[x]);
    }
    err = err ? err : sst_eval_disparity(&t->all, &estimate, &t->disp, NULL);
    err = err ? err : mark_visible(&mask, job, index);
    err = err ? err : sst_eval_disparity(&t->nonocc, &estimate, &t->disp, &mask);
    sst_map_f32_fini(&estimate);
    sst_map_u8_fini(&mask);
    return err;
}

static int measure_labels(struct job *job, int index)
{
    static const char *const folders[] = { "labels_initial", "labels_hcsm" };
    struct view_truth *t = &job->views[index];
    int err = 0;

    t->confusion = sst_mem_alloc(STAGES, sizeof(*t->confusion));
    if (!t->confusion)
        return -ENOMEM;
    for (int stage = 0; stage < STAGES && !err; stage++) {
        struct sst_map_u8 read = { 0 };
        const struct sst_map_u8 *map = stage == REFINED ? &job->lf->views[index].label : &read;
        char dir[SST_PATH_MAX];

        if (stage != REFINED)
            err = sst_path_join(dir, job->lf_dir, folders[stage]);
        if (!err && stage != REFINED)
            err = read_labels(&read, job, dir, index);
        if (!err && map->data) {
            err = sst_confusion_add(&t->confusion[stage], map, &t->label);
            t->measured[stage] = true;
            if (err)
                sst_log_error("%s: view %02d_%02d has a label above 64, or its truth has; give label maps", job->lf_dir,
                              index / job->lf->cols, index % job->lf->cols);
        }
        sst_map_u8_fini(&read);
    }
    return err == -EINVAL ? -EBADMSG : err;
}

static int measure_view(void *arg, int index, int worker SST_UNUSED)
{
    struct job *job = arg;
    int err = job->views[index].disp.data ? measure_disparity(job, index) : 0;

    if (!err && job->views[index].label.data)
        err = measure_labels(job, index);
    return err;
}

static struct sst_label_error label_error(const struct job *job, int stage)
{
    struct sst_confusion *sum = sst_mem_alloc(1, sizeof(*sum));
    struct sst_label_error result = { NAN, NAN, NAN };

    for (int k = 0; k < job->lf->rows * job->lf->cols && sum; k++) {
        for (int i = 0; i < 65 * 65 && job->views[k].measured[stage]; i++)
            sum->count[i / 65][i % 65] += job->views[k].confusion[stage].count[i / 65][i % 65];
    }
    if (sum)
        result = (struct sst_label_error){ sst_confusion_miou(sum), sst_confusion_accuracy(sum),
                                           sst_confusion_coverage(sum) };
    sst_mem_free(sum);
    return result;
}

/* Sum over the views in order, so that the result is the same for any number of threads. */
static void sum_up(struct sst_evaluation *out, const struct job *job)
{
    for (int k = 0; k < job->lf->rows * job->lf->cols; k++) {
        const struct view_truth *t = &job->views[k];

        out->label_views += t->label.data != NULL;
        if (t->disp.data) {
            out->disparity_views++;
            sst_eval_disparity_merge(&out->disparity, &t->all);
            sst_eval_disparity_merge(&out->disparity_nonocc, &t->nonocc);
        }
    }
    out->initial = label_error(job, INITIAL);
    out->hcsm = label_error(job, HCSM);
    out->refined = label_error(job, REFINED);
}

/* Truth behind an occluder, the pixels that it covers, and the ones among them that show the target. */
struct hidden {
    struct sst_image behind;
    struct sst_map_u8 mask, target;
    double focus_px; /* of the target */
};

/* A picture to render; an empty `valid` is not wanted. */
struct rendered {
    struct sst_image picture;
    struct sst_map_u8 valid;
};

static int measure_picture(struct sst_picture_error *out, struct sst_renderer *r, const struct sst_render_config *cfg,
                           const struct hidden *h, struct rendered *to)
{
    const int64_t start_ns = sst_clock_now_ns();
    const struct sst_image *picture = &to->picture;
    int err = sst_render(r, cfg, &to->picture, to->valid.data ? &to->valid : NULL);

    out->seconds = (double)(sst_clock_now_ns() - start_ns) * 1e-9;
    out->psnr = sst_psnr(picture, &h->behind, NULL);
    out->psnr_occluded = sst_psnr(picture, &h->behind, &h->mask);
    out->psnr_target = sst_psnr(picture, &h->behind, &h->target);
    err = err ? err : sst_ssim(&out->ssim, picture, &h->behind, NULL);
    err = err ? err : sst_ssim(&out->ssim_occluded, picture, &h->behind, &h->mask);
    return err;
}

static double covered(const struct sst_map_u8 *mask)
{
    int64_t n = 0;

    for (int y = 0; y < mask->height; y++) {
        const uint8_t *row = sst_map_u8_row(mask, y);

        for (int x = 0; x < mask->width; x++)
            n += row[x] != 0;
    }
    return 100.0 * (double)n / ((double)mask->width * mask->height);
}

/* Rays of a see-through picture: rays that show the target or pass for it, and the count of wrong ones. */
struct ray_count {
    int64_t target, rejected, accepted, wrong;
    int64_t gap_target[SST_EVAL_GAPS], gap_rejected[SST_EVAL_GAPS];
    double median_error; /* squared, of the median's channels ... */
    int64_t medians;     /* ... at this many pixels */
};

static const int gap_most[SST_EVAL_GAPS - 1] = { 4, 12 };

/* Pixels of a row or column around (x, y) that show nothing nearer than the focus. */
static int open_pixels(const struct sst_map_f32 *truth, int x, int y, const int step[2], double focus_px)
{
    int n = 1;

    for (int side = -1; side <= 1; side += 2) {
        int at = side, most = gap_most[SST_EVAL_GAPS - 2];

        for (; most > 0; most--, at += side) {
            const int xa = x + at * step[0], ya = y + at * step[1];

            if (xa < 0 || ya < 0 || xa >= truth->width || ya >= truth->height)
                return gap_most[SST_EVAL_GAPS - 2] + 1; /* goes on outside */
            if (sst_map_f32_row(truth, ya)[xa] > focus_px + 1)
                break;
            n++;
        }
    }
    return n;
}

static int gap_class(const struct sst_map_f32 *truth, int x, int y, double focus_px)
{
    const int across = open_pixels(truth, x, y, (const int[2]){ 1, 0 }, focus_px);
    const int down = open_pixels(truth, x, y, (const int[2]){ 0, 1 }, focus_px);
    int class = 0;

    while (class < SST_EVAL_GAPS - 1 && sst_min_int(across, down) > gap_most[class])
        class ++;
    return class;
}

/* The ray of view k that passes a pixel of the reference view at the focus: where, and its disparities. */
struct eval_ray {
    int view, x, y;
    double truth, map; /* px per spacing; map NaN: unknown */
};

/* A pixel of the reference view at a focus. */
struct pixel {
    int x, y;
    double focus_px;
};

static bool ray_at(struct eval_ray *ray, const struct job *job, int k, struct pixel p)
{
    const struct sst_lightfield *lf = job->lf;
    const struct sst_view *v = &lf->views[k], *r = &lf->views[job->ref];
    const double vx = floor(p.x - p.focus_px * (v->bx - r->bx) + 0.5);
    const double vy = floor(p.y - p.focus_px * (v->by - r->by) + 0.5);

    if (!v->disp.data || !job->views[k].disp.data || vx < 0 || vy < 0 || vx >= lf->width || vy >= lf->height)
        return false;
    ray->view = k;
    ray->x = (int)vx;
    ray->y = (int)vy;
    ray->truth = sst_map_f32_row(&job->views[k].disp, ray->y)[ray->x];
    ray->map = sst_map_u16_row(&v->disp, ray->y)[ray->x] == SST_DISP_NONE
                   ? NAN
                   : sst_disp_px(lf, sst_map_u16_row(&v->disp, ray->y)[ray->x]);
    return true;
}

static void count_gap(struct ray_count *n, const struct job *job, const struct eval_ray *ray, double focus_px)
{
    const int class = gap_class(&job->views[ray->view].disp, ray->x, ray->y, focus_px);

    n->gap_target[class]++;
    n->gap_rejected[class] += ray->map > focus_px + 1;
}

static int by_value(const void *a, const void *b)
{
    return *(const uint8_t *)a - *(const uint8_t *)b;
}

/* Squared error of the median of the rays' colours, nearest pixels. */
static double median_error(const struct job *job, const struct eval_ray *rays, int count,
                           const struct sst_image *behind, struct pixel p)
{
    double sum = 0;

    for (int c = 0; c < 3; c++) {
        uint8_t value[SST_MAX_VIEWS];
        double error;

        for (int i = 0; i < count; i++)
            value[i] = sst_image_row(&job->lf->views[rays[i].view].image, c, rays[i].y)[rays[i].x];
        qsort(value, (size_t)count, 1, by_value);
        error = (value[(count - 1) / 2] + value[count / 2]) / 2.0 - sst_image_row(behind, c, p.y)[p.x];
        sum += error * error;
    }
    return sum / 3;
}

/* @return whether the pixel shows the target */
static bool count_pixel(struct ray_count *sum, const struct job *job, const struct sst_image *shown, struct pixel p)
{
    const double focus_px = p.focus_px;
    struct eval_ray ray[SST_MAX_VIEWS];
    int count = 0;
    int64_t target = 0, behind = 0;

    for (int k = 0; k < job->lf->rows * job->lf->cols; k++)
        count += ray_at(&ray[count], job, k, p);
    for (int i = 0; i < count; i++) {
        behind += ray[i].truth < focus_px - 0.5;
        target += fabs(ray[i].truth - focus_px) <= 0.5;
    }
    for (int i = 0; i < count && target; i++) {
        const bool shows = fabs(ray[i].truth - focus_px) <= 0.5, passes = fabs(ray[i].map - focus_px) <= 1;

        sum->target += shows;
        sum->rejected += shows && ray[i].map > focus_px + 1;
        sum->accepted += passes;
        sum->wrong += passes && ray[i].truth > focus_px + 1;
        if (shows)
            count_gap(sum, job, &ray[i], focus_px);
    }
    if (target < 3 || target <= behind)
        return false;
    sum->median_error += median_error(job, ray, count, shown, p);
    sum->medians++;
    return true;
}

static struct ray_count count_rays(struct hidden *h, const struct job *job)
{
    struct ray_count sum = { 0 };

    for (int y = 0; y < h->mask.height; y++) {
        for (int x = 0; x < h->mask.width; x++) {
            if (sst_map_u8_row(&h->mask, y)[x] &&
                count_pixel(&sum, job, &h->behind, (struct pixel){ x, y, h->focus_px }))
                sst_map_u8_row(&h->target, y)[x] = 255;
        }
    }
    return sum;
}

static double percent(int64_t part, int64_t whole)
{
    return whole ? 100.0 * (double)part / (double)whole : NAN;
}

/* --- the clear picture -------------------------------------------------------------------------------------------- */

/* Disparities of the reference view that the mask covers, or does not; by truth where there is one. */
static int disparities(float *d, const struct job *job, const struct sst_map_u8 *mask, bool covered_ones)
{
    const struct sst_map_f32 *truth = &job->views[job->ref].disp;
    int n = 0;

    for (int y = 0; y < mask->height; y++) {
        const uint16_t *map = sst_map_u16_row(&job->lf->views[job->ref].disp, y);

        for (int x = 0; x < mask->width; x++) {
            if ((sst_map_u8_row(mask, y)[x] != 0) != covered_ones)
                continue;
            if (truth->data)
                d[n++] = sst_map_f32_row(truth, y)[x];
            else if (map[x] != SST_DISP_NONE)
                d[n++] = (float)sst_disp_px(job->lf, map[x]);
        }
    }
    return n;
}

/* A cut between the masked pixels and the rest; NaN: the rest is not all farther. */
static int cut_between(double *cut_px, const struct job *job, const struct sst_map_u8 *mask)
{
    float *d = sst_mem_alloc_raw((size_t)mask->width * (size_t)mask->height, sizeof(*d));
    float nearest, farthest;
    int n;

    if (!d)
        return -ENOMEM;
    n = disparities(d, job, mask, false);
    nearest = n ? sst_stats_quantile_float(d, n, 0.99) : -INFINITY;
    n = disparities(d, job, mask, true);
    farthest = n ? sst_stats_quantile_float(d, n, 0.001) : -INFINITY;
    *cut_px = farthest > nearest ? (double)(farthest + fmaxf(nearest, farthest - 50)) / 2 : NAN;
    sst_mem_free(d);
    return 0;
}

/* Removes the occluder by a cut where there is one, else the object that the mask covers. */
static int render_clear(struct sst_occluder_error *out, const struct job *job, const struct sst_render_config *cfg,
                        const struct hidden *h)
{
    const struct sst_image *behind = &h->behind;
    struct rendered to = { 0 };
    int err = sst_image_init(&to.picture, behind->width, behind->height);

    err = err ? err : sst_map_u8_init(&to.valid, behind->width, behind->height);
    err = err ? err : measure_picture(&out->clear, job->r, cfg, h, &to);
    for (int y = 0; y < behind->height && !err; y++) {
        uint8_t *row = sst_map_u8_row(&to.valid, y);

        for (int x = 0; x < behind->width; x++)
            row[x] = row[x] == 255 ? 0 : 255;
    }
    if (!err) {
        out->filled = covered(&to.valid);
        out->psnr_holes = sst_psnr(&to.picture, behind, &to.valid);
        err = sst_ssim(&out->ssim_holes, &to.picture, behind, &to.valid);
    }
    sst_image_fini(&to.picture);
    sst_map_u8_fini(&to.valid);
    return err;
}

static int measure_clear(struct sst_occluder_error *out, const struct job *job, const struct sst_render_config *cfg,
                         const struct hidden *h)
{
    const int views = job->lf->rows * job->lf->cols;
    struct sst_map_u8 *object = sst_mem_alloc((size_t)views, sizeof(*object));
    struct sst_render_config c = *cfg;
    int err = object ? cut_between(&out->cut_px, job, &h->mask) : -ENOMEM;

    c.method = SST_RENDER_CLEAR;
    c.cut_px = isnan(out->cut_px) ? INFINITY : out->cut_px;
    if (!err && isinf(c.cut_px)) {
        err = sst_render_carry_object(object, job->lf, job->ref, &h->mask, c.threads);
        c.remove = object;
    }
    err = err ? err : render_clear(out, job, &c, h);
    for (int i = 0; i < views && object; i++)
        sst_map_u8_fini(&object[i]);
    sst_mem_free(object);
    return err;
}

static int measure_occluder(struct sst_occluder_error *out, const struct job *job, const struct sst_truth_occluder *o,
                            const struct sst_render_config *cfg)
{
    struct sst_render_config c = *cfg;
    struct hidden h = { .focus_px = o->focus_px };
    struct rendered to = { 0 };
    struct ray_count rays;
    char path[SST_PATH_MAX];
    int err = sst_path_join(path, job->truth_dir, o->behind);

    err = err ? err : sst_image_read(&h.behind, path);
    err = err ? err : check_size(path, h.behind.width, h.behind.height, job->lf);
    err = err ? err : sst_path_join(path, job->truth_dir, o->mask);
    err = err ? err : sst_map_u8_read_png(&h.mask, path);
    err = err ? err : check_size(path, h.mask.width, h.mask.height, job->lf);
    err = err ? err : sst_map_u8_init(&h.target, h.mask.width, h.mask.height);
    if (err)
        goto done;
    out->covered = covered(&h.mask);
    rays = count_rays(&h, job);
    for (int i = 0; i < SST_EVAL_GAPS; i++)
        out->rejected_gap[i] = percent(rays.gap_rejected[i], rays.gap_target[i]);
    out->psnr_median =
        rays.medians ? 10 * log10(255 * 255 * (double)rays.medians / fmax(rays.median_error, 1e-9)) : NAN;
    out->rejected = percent(rays.rejected, rays.target);
    out->accepted_wrong = percent(rays.wrong, rays.accepted);
    c.focus_px = o->focus_px;
    c.method = SST_RENDER_SST;
    err = sst_image_init(&to.picture, h.behind.width, h.behind.height);
    err = err ? err : measure_picture(&out->render, job->r, &c, &h, &to);
    c.method = SST_RENDER_REFOCUS;
    err = err ? err : measure_picture(&out->refocus, job->r, &c, &h, &to);
    err = err ? err : measure_clear(out, job, &c, &h);
done:
    sst_image_fini(&to.picture);
    sst_image_fini(&h.behind);
    sst_map_u8_fini(&h.mask);
    sst_map_u8_fini(&h.target);
    return err;
}

static int measure_pictures(struct sst_evaluation *out, struct job *job, const struct sst_render_config *cfg,
                            int threads)
{
    const struct sst_truth *truth = job->truth;
    const struct sst_lightfield *lf = job->lf;
    struct sst_render_config c = *cfg;
    int err;

    if (truth->count == 0)
        return 0;
    job->ref = truth->ref_row * lf->cols + truth->ref_col;
    if (truth->ref_row >= lf->rows || truth->ref_col >= lf->cols || !lf->views[job->ref].present) {
        sst_log_error("%s/truth.json: reference %02d_%02d is not a view of %s; give the truth of this light field",
                      job->truth_dir, truth->ref_row, truth->ref_col, job->lf_dir);
        return -EBADMSG;
    }
    c.view_bx = lf->views[job->ref].bx;
    c.view_by = lf->views[job->ref].by;
    c.threads = threads;
    err = sst_renderer_create(&job->r, lf, threads);
    for (int i = 0; i < truth->count && !err; i++)
        err = measure_occluder(&out->occluder[i], job, &truth->occluders[i], &c);
    sst_renderer_destroy(job->r);
    out->occluders = truth->count;
    return err;
}

static void job_fini(struct job *job)
{
    for (int k = 0; job->views && k < job->lf->rows * job->lf->cols; k++) {
        sst_map_f32_fini(&job->views[k].disp);
        sst_map_u8_fini(&job->views[k].label);
        sst_mem_free(job->views[k].confusion);
    }
    sst_mem_free(job->views);
}

int sst_eval_lightfield(struct sst_evaluation *out, const struct sst_eval_input *in, int threads)
{
    const struct sst_lightfield *lf = in->lf;
    const int views = lf->rows * lf->cols;
    struct job job = { .lf = lf, .lf_dir = in->lf_dir, .truth_dir = in->truth_dir, .truth = in->truth };
    struct sst_evaluation made = { 0 };
    int err = -ENOMEM;

    job.views = sst_mem_alloc((size_t)views, sizeof(*job.views));
    if (job.views)
        err = sst_parallel_for(views, threads, load_view, &job);
    err = err ? err : sst_parallel_for(views, threads, measure_view, &job);
    if (!err)
        sum_up(&made, &job);
    if (!err && !in->truth->described && made.disparity_views + made.label_views == 0) {
        sst_log_error(
            "%s holds no truth: neither truth.json nor rr_cc.pfm nor rr_cc.png of any view of %s; `sst scene` "
            "writes the truth of a light field to LF/truth",
            in->truth_dir, in->lf_dir);
        err = -ENOENT;
    }
    err = err ? err : measure_pictures(&made, &job, in->cfg, threads);
    job_fini(&job);
    if (err == -ENOMEM)
        sst_log_error("%s: out of memory measuring %d views of %dx%d", in->lf_dir, views, lf->width, lf->height);
    if (!err)
        *out = made;
    return err;
}
