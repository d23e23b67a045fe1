/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/method/refine/refine.h"

#include <errno.h>
#include <string.h>

#include "base/log.h"
#include "base/mem.h"
#include "base/thread.h"
#include "pipeline/lightfield/share.h"
#include "pipeline/method/refine/parts.h"

/* Nearest candidate so far of an unlabeled pixel with two or more: among the objects [0] and among the grounds [1]. */
struct choice {
    uint32_t nearest2[2], farthest2[2]; /* of E_d */
    uint8_t label[2];                   /* 0: none yet */
};

/* Grounds of a view that are planes there. */
struct grounds {
    uint64_t planar; /* bit i: label i + 1 is one */
    struct sst_ground ground[SST_MAX_CLASSES];
};

/* Scratch of one worker. */
struct worker {
    struct choice *choice; /* [height * width] */
    uint32_t *nearest2;    /* [height * width] */
    struct sst_planes planes;
    int64_t *plane_sums;
    struct sst_distance_scratch distance;
    uint32_t *extents; /* [height] */
    struct sst_hull hull;
    int64_t *misses; /* [SST_DISP_BINS] */
    /* of the view in work */
    struct grounds grounds;
    struct sst_region regions[SST_MAX_CLASSES]; /* by label - 1; zeroed: not needed */
};

/* Refinement of all views. */
struct job {
    struct sst_lightfield *lf; /* each view's labels are written by its own job */
    const struct sst_refine_config *cfg;
    struct sst_surface_frame frame;
    uint64_t ground;      /* bit i: label i + 1 is a ground */
    uint64_t *candidates; /* [SST_DISP_BINS] */
    int64_t *hist;        /* [n_workers][classes][SST_DISP_BINS] pixels, while the labels are fitted */
    struct sst_label_fit fits[SST_MAX_CLASSES];
    int *view; /* views that are refined */
    struct worker *workers;
    int n_workers;
};

/* True if a view is refined. */
static bool is_refined(const struct job *job, int view)
{
    return job->lf->views[view].present && !(job->cfg->skip && job->cfg->skip[view]);
}

static bool is_conflict(uint64_t candidates)
{
    return (candidates & (candidates - 1)) != 0;
}

void sst_refine_config_defaults(struct sst_refine_config *cfg)
{
    *cfg = (struct sst_refine_config){
        .eps_d = 1e-3,
        .matcher_sigma_px = 0.25,
        .min_pixels = 100,
        .p_normal = 1,
        .p_distance = 10,
        .tau = 1,
        .normal_window = SST_NORMAL_WINDOW_MIN,
        .ground_plane = true,
    };
}

static int check_config(const struct sst_refine_config *cfg)
{
    const struct {
        const char *name;
        double value, min, max;
    } fields[] = {
        { "eps_d", cfg->eps_d, 1e-12, 1e6 },
        { "matcher_sigma_px", cfg->matcher_sigma_px, 0, 512 },
        { "min_pixels", cfg->min_pixels, 1, INT32_MAX },
        { "p_normal", cfg->p_normal, 0, 1e6 },
        { "p_distance", cfg->p_distance, 0, 1e6 },
        { "tau", cfg->tau, 1e-9, 1e9 },
        { "normal_window", cfg->normal_window, SST_NORMAL_WINDOW_MIN, SST_NORMAL_WINDOW_MAX },
    };

    for (size_t i = 0; i < ARRAY_LEN(fields); i++) {
        if (!(fields[i].value >= fields[i].min && fields[i].value <= fields[i].max)) {
            sst_log_error("label refinement: %s %g is outside %.10g..%.10g", fields[i].name, fields[i].value,
                          fields[i].min, fields[i].max);
            return -EINVAL;
        }
    }
    if (cfg->normal_window % 2 == 0) {
        sst_log_error("label refinement: normal_window %d is even; take %d", cfg->normal_window,
                      cfg->normal_window + 1);
        return -EINVAL;
    }
    return 0;
}

static int check_maps(const struct sst_lightfield *lf, const struct sst_refine_config *cfg)
{
    for (int view = 0; view < lf->rows * lf->cols; view++) {
        const struct sst_view *v = &lf->views[view];

        if (!v->present || (cfg->skip && cfg->skip[view]))
            continue;
        if (v->disp.width != lf->width || v->disp.height != lf->height || v->label.width != lf->width ||
            v->label.height != lf->height) {
            sst_log_error("label refinement: view %02d_%02d lacks %s of %dx%d pixels; compute or import them first",
                          view / lf->cols, view % lf->cols, v->disp.width == lf->width ? "labels" : "disparities",
                          lf->width, lf->height);
            return -EINVAL;
        }
    }
    return 0;
}

/* Normals of the regions of some labels, as whole numbers, at every second pixel of every second row: neighbours share
 * their planes. */
static void find_regions(const struct job *job, struct worker *w, const struct sst_view *v, uint64_t labels)
{
    for (int y = 0; y < v->label.height; y += 2) {
        const uint8_t *row = sst_map_u8_row(&v->label, y);

        for (int x = 0; x < v->label.width; x += 2) {
            struct sst_region *region;
            float n[3];

            if (row[x] == SST_LABEL_NONE || row[x] > SST_MAX_CLASSES || !(labels >> (row[x] - 1) & 1))
                continue;
            region = &w->regions[row[x] - 1];
            region->pixels++;
            if (sst_normal_at(n, &w->planes, &job->frame, x, y))
                sst_region_add(region, n);
        }
    }
    for (int i = 0; i < job->lf->classes.count; i++)
        sst_region_finish(&w->regions[i]);
}

/* Fit the planes of the grounds of a view. */
static void find_grounds(const struct job *job, struct worker *w, const struct sst_view *v)
{
    struct grounds *g = &w->grounds;

    g->planar = 0;
    for (int i = 0; i < job->lf->classes.count && job->cfg->ground_plane; i++) {
        if (job->ground >> i & 1 && sst_ground_fit(&g->ground[i], v, i + 1, job->cfg, w->misses))
            g->planar |= (uint64_t)1 << i;
    }
}

/* Candidates of an unlabeled pixel: by the label's distribution, and for a planar ground by its plane. */
static uint64_t candidates_at(const struct job *job, const struct grounds *g, uint16_t disp_q6, int x, int y)
{
    uint64_t mask = job->candidates[disp_q6];

    for (uint64_t left = mask & g->planar; left; left &= left - 1) {
        const int i = __builtin_ctzll(left);

        if (!sst_ground_has(&g->ground[i], x, y, disp_q6))
            mask &= ~((uint64_t)1 << i);
    }
    return mask;
}

/* Labels that compete for any pixel of the view; also clears the choices. @param mixed  out, labels of pixels for which
 * an object and a ground compete: only there normals count */
static uint64_t find_conflicts(const struct job *job, struct worker *w, const struct sst_view *v, uint64_t *mixed)
{
    uint64_t seen = 0;

    *mixed = 0;
    for (int y = 0; y < v->label.height; y++) {
        const uint8_t *label = sst_map_u8_row(&v->label, y);
        const uint16_t *disp = sst_map_u16_row(&v->disp, y);
        struct choice *choice = w->choice + (size_t)y * (size_t)v->label.width;

        for (int x = 0; x < v->label.width; x++) {
            const uint64_t mask = label[x] == SST_LABEL_NONE ? candidates_at(job, &w->grounds, disp[x], x, y) : 0;

            if (!is_conflict(mask))
                continue;
            choice[x] = (struct choice){ .label = { 0 } };
            seen |= mask;
            *mixed |= mask & job->ground && mask & ~job->ground ? mask : 0;
        }
    }
    return seen;
}

/* Choose a label for a pixel where it is nearer than the one so far. Labels come in ascending order, so ties are left
 * to the smaller. @param farthest2  0: a region of one pixel, at it */
static void propose(struct choice *c, int kind, int label, uint32_t nearest2, uint32_t farthest2)
{
    if (!farthest2) {
        nearest2 = 0;
        farthest2 = 1;
    }
    if (c->label[kind] && !sst_energy_is_nearer(nearest2, farthest2, c->nearest2[kind], c->farthest2[kind]))
        return;
    c->nearest2[kind] = nearest2;
    c->farthest2[kind] = farthest2;
    c->label[kind] = (uint8_t)label;
}

/* Evaluate one label among objects or grounds. */
static void compete(const struct job *job, struct worker *w, const struct sst_view *v, int label)
{
    const uint64_t bit = (uint64_t)1 << (label - 1);
    const int kind = (job->ground & bit) != 0;
    const bool here = sst_distance_columns(w->nearest2, &v->label, label), weigh = job->cfg->p_distance > 0;

    sst_region_extents(w->extents, &v->label, label);
    sst_hull_build(&w->hull, w->extents, v->label.height);
    for (int y = 0; y < v->label.height; y++) {
        const uint8_t *row = sst_map_u8_row(&v->label, y);
        const uint16_t *disp = sst_map_u16_row(&v->disp, y);
        bool ready = !here;

        for (int x = 0; x < v->label.width; x++) {
            const uint64_t mask = row[x] == SST_LABEL_NONE ? candidates_at(job, &w->grounds, disp[x], x, y) : 0;
            const size_t i = (size_t)y * (size_t)v->label.width + (size_t)x;

            if (!(mask & bit) || !is_conflict(mask))
                continue;
            if (!ready)
                sst_distance_row(w->nearest2 + (size_t)y * (size_t)v->label.width, v->label.width, &w->distance);
            ready = true;
            if (!weigh)
                propose(&w->choice[i], kind, label, 0, 1);
            else if (here)
                propose(&w->choice[i], kind, label, w->nearest2[i], sst_hull_farthest(&w->hull, x, y));
            else
                propose(&w->choice[i], kind, label, 1, 1);
        }
    }
}

/* Compare the nearest object with the nearest ground; normals count only here, and only if both have some. */
static uint8_t decide(const struct job *job, const struct worker *w, int x, int y)
{
    const struct choice *c = &w->choice[(size_t)y * (size_t)w->planes.width + (size_t)x];
    const float p_distance = (float)job->cfg->p_distance, p_normal = (float)job->cfg->p_normal;
    const uint8_t object = c->label[0], ground = c->label[1];
    float e_object, e_ground, m[3];

    if (!object || !ground)
        return object ? object : ground;
    e_object = p_distance * sst_energy_distance(c->nearest2[0], c->farthest2[0]);
    e_ground = p_distance * sst_energy_distance(c->nearest2[1], c->farthest2[1]);
    if (sst_region_has_normal(&w->regions[object - 1]) && sst_region_has_normal(&w->regions[ground - 1]) &&
        sst_normal_at(m, &w->planes, &job->frame, x, y)) {
        e_object += p_normal * sst_energy_normal(m, &w->regions[object - 1], job->cfg->tau);
        e_ground += p_normal * sst_energy_normal(m, &w->regions[ground - 1], job->cfg->tau);
    }
    if (e_object == e_ground)
        return object < ground ? object : ground;
    return e_object < e_ground ? object : ground;
}

/* Write all labels at the end: until then the map is the HCSM, whose regions define distances and normals. */
static void assign(const struct job *job, const struct worker *w, struct sst_view *v)
{
    for (int y = 0; y < v->label.height; y++) {
        uint8_t *label = sst_map_u8_row(&v->label, y);
        const uint16_t *disp = sst_map_u16_row(&v->disp, y);

        for (int x = 0; x < v->label.width; x++) {
            const uint64_t mask = label[x] == SST_LABEL_NONE ? candidates_at(job, &w->grounds, disp[x], x, y) : 0;

            if (!mask)
                continue;
            label[x] = is_conflict(mask) ? decide(job, w, x, y) : (uint8_t)(__builtin_ctzll(mask) + 1);
        }
    }
}

static int refine_view(void *arg, int index, int worker)
{
    struct job *job = arg;
    const int view = job->view[index];
    struct worker *w = &job->workers[worker];
    struct sst_view *v = &job->lf->views[view];
    uint64_t seen, mixed;

    if (job->cfg->cancel && *job->cfg->cancel)
        return -ECANCELED;
    find_grounds(job, w, v);
    seen = find_conflicts(job, w, v, &mixed);
    memset(w->regions, 0, sizeof(w->regions));
    if (mixed && job->cfg->p_normal > 0) {
        sst_planes_fit(&w->planes, &v->disp, w->plane_sums);
        find_regions(job, w, v, mixed);
    }
    for (int label = 1; label <= job->lf->classes.count; label++) {
        if (seen >> (label - 1) & 1)
            compete(job, w, v, label);
    }
    assign(job, w, v);
    return 0;
}

static int count_view(void *arg, int index, int worker)
{
    struct job *job = arg;
    const struct sst_view *v = &job->lf->views[index];
    int64_t *hist = job->hist + (size_t)worker * (size_t)job->lf->classes.count * SST_DISP_BINS;

    if (!is_refined(job, index))
        return 0;
    for (int y = 0; y < v->label.height; y++) {
        const uint8_t *label = sst_map_u8_row(&v->label, y);
        const uint16_t *disp = sst_map_u16_row(&v->disp, y);

        for (int x = 0; x < v->label.width; x++) {
            if (label[x] != SST_LABEL_NONE && label[x] <= job->lf->classes.count && disp[x] != SST_DISP_NONE)
                hist[(size_t)(label[x] - 1) * SST_DISP_BINS + disp[x]]++;
        }
    }
    return 0;
}

/* Fit all labels and list the candidates of every disparity. */
static int fit_labels(void *arg, int index SST_UNUSED, int worker SST_UNUSED)
{
    struct job *job = arg;
    const struct sst_lightfield *lf = job->lf;
    const size_t size = (size_t)lf->classes.count * SST_DISP_BINS;
    int err;

    job->hist = sst_mem_alloc((size_t)job->n_workers, size * sizeof(*job->hist));
    if (!job->hist)
        return -ENOMEM;
    err = sst_parallel_for(lf->rows * lf->cols, job->n_workers, count_view, job);
    for (int k = 1; k < job->n_workers; k++) {
        for (size_t i = 0; i < size; i++)
            job->hist[i] += job->hist[(size_t)k * size + i];
    }
    for (int i = 0; i < lf->classes.count && !err; i++)
        job->fits[i] = sst_refine_fit_histogram(job->hist + (size_t)i * SST_DISP_BINS, lf->disp_min_px, job->cfg);
    sst_mem_free(job->hist);
    job->hist = NULL;
    if (!err)
        sst_candidate_masks(job->candidates, job->fits, lf->classes.count, lf->disp_min_px, job->cfg->eps_d);
    return err;
}

static void fitted_values(void *arg, int index SST_UNUSED, struct sst_share_maps *out)
{
    struct job *job = arg;

    sst_share_add_values(out, job->fits, sizeof(job->fits));
    sst_share_add_values(out, job->candidates, SST_DISP_BINS * sizeof(*job->candidates));
}

static void refined_map(void *arg, int index, struct sst_share_maps *out)
{
    struct job *job = arg;

    sst_share_add_u8(out, &job->lf->views[job->view[index]].label);
}

static void job_fini(struct job *job)
{
    for (int k = 0; job->workers && k < job->n_workers; k++) {
        struct worker *w = &job->workers[k];

        sst_mem_free(w->choice);
        sst_mem_free(w->nearest2);
        sst_mem_free(w->planes.at);
        sst_mem_free(w->plane_sums);
        sst_mem_free(w->distance.start);
        sst_mem_free(w->distance.vertex);
        sst_mem_free(w->distance.row);
        sst_mem_free(w->extents);
        sst_mem_free(w->hull.x);
        sst_mem_free(w->hull.y);
        sst_mem_free(w->misses);
    }
    sst_mem_free(job->workers);
    sst_mem_free(job->candidates);
    sst_mem_free(job->view);
}

static int worker_init(struct worker *w, const struct sst_lightfield *lf, const struct sst_refine_config *cfg)
{
    const size_t width = (size_t)lf->width, height = (size_t)lf->height, pixels = width * height;

    w->choice = sst_mem_alloc_raw(pixels, sizeof(*w->choice));
    w->nearest2 = sst_mem_alloc_raw(pixels, sizeof(*w->nearest2));
    w->planes = (struct sst_planes){ .width = lf->width, .height = lf->height, .window = cfg->normal_window };
    w->planes.at = sst_mem_alloc_raw(pixels, sizeof(*w->planes.at));
    w->plane_sums = sst_mem_alloc_raw(width, SST_PLANE_SUMS * sizeof(*w->plane_sums));
    w->distance.start = sst_mem_alloc_raw(width, sizeof(*w->distance.start));
    w->distance.vertex = sst_mem_alloc_raw(width, sizeof(*w->distance.vertex));
    w->distance.row = sst_mem_alloc_raw(width, sizeof(*w->distance.row));
    w->extents = sst_mem_alloc_raw(height, sizeof(*w->extents));
    w->hull.x = sst_mem_alloc_raw(2 * height + 2, sizeof(*w->hull.x));
    w->hull.y = sst_mem_alloc_raw(2 * height + 2, sizeof(*w->hull.y));
    w->misses = sst_mem_alloc_raw(SST_DISP_BINS, sizeof(*w->misses));
    if (!w->choice || !w->nearest2 || !w->planes.at || !w->plane_sums || !w->distance.start || !w->distance.vertex ||
        !w->distance.row || !w->extents || !w->hull.x || !w->hull.y || !w->misses)
        return -ENOMEM;
    return 0;
}

static int job_init(struct job *job, struct sst_lightfield *lf, const struct sst_refine_config *cfg)
{
    *job = (struct job){ .lf = lf, .cfg = cfg, .frame = sst_normal_frame_of(lf, cfg) };
    job->n_workers = sst_min_int(sst_thread_count(cfg->threads), lf->rows * lf->cols);
    for (int i = 0; i < lf->classes.count; i++)
        job->ground |= (uint64_t)lf->classes.ground[i] << i;
    job->workers = sst_mem_alloc((size_t)job->n_workers, sizeof(*job->workers));
    job->candidates = sst_mem_alloc_raw(SST_DISP_BINS, sizeof(*job->candidates));
    job->view = sst_mem_alloc((size_t)(lf->rows * lf->cols), sizeof(*job->view));
    if (!job->workers || !job->candidates || !job->view)
        return -ENOMEM;
    for (int k = 0; k < job->n_workers; k++) {
        if (worker_init(&job->workers[k], lf, cfg))
            return -ENOMEM;
    }
    return 0;
}

int sst_refine_labels(struct sst_lightfield *lf, const struct sst_refine_config *cfg, struct sst_label_fit *fits)
{
    struct job job;
    int count = 0;
    int err = check_config(cfg);

    err = err ? err : check_maps(lf, cfg);
    if (err)
        return err;
    if (!(lf->focal_px > 0))
        sst_log_info("label refinement: the focal length is unknown; the image width, %d px, is used instead",
                     lf->width);
    err = job_init(&job, lf, cfg);
    for (int view = 0; !err && view < lf->rows * lf->cols; view++) {
        if (is_refined(&job, view))
            job.view[count++] = view;
    }
    err = err ? err : sst_share_for(cfg->share, 1, 1, fit_labels, &job, fitted_values);
    err = err ? err : sst_share_for(cfg->share, count, job.n_workers, refine_view, &job, refined_map);
    job_fini(&job);
    if (err == -ENOMEM)
        sst_log_error("label refinement: no memory for %d threads at %dx%d; use fewer threads", job.n_workers,
                      lf->width, lf->height);
    if (!err && fits)
        memcpy(fits, job.fits, (size_t)lf->classes.count * sizeof(*fits));
    return err;
}
