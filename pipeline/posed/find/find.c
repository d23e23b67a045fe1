/* Searches: an integral, its scores, blobs, and the views that show each blob. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/posed/find/find.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "base/mem.h"
#include "base/thread.h"
#include "pipeline/posed/find/find_internal.h"
#include "pipeline/posed/picture.h"

#define THRESHOLD_INTEGRAL 4.5
#define THRESHOLD_VIEWS    7.0
#define THRESHOLD_PATHS    2.0 /* times these: the highest of many sums along paths */
#define TAIL_FROM          1.5 /* spreads: peaks from here on, in two steps of TAIL_STEP, are the background's ... */
#define TAIL_STEP          1.0 /* ... and show how rare higher ones are */
#define TAIL_LEAST         20  /* peaks */
#define THRESHOLD_LEAST    3.0
#define PIXEL_M            0.025 /* finer ones show parts of a person apart from each other */
#define SMEARED_M          0.03  /* half of the width over which a view's scores are smoothed */
#define COVERED_MOST       0.95      /* quantile of the number of views that is their usual most */
#define EARTH_A            6378137.0 /* WGS 84 */
#define EARTH_E2           6.69437999014e-3
#define RANKS              4
#define KEPT_BYTES         ((size_t)1 << 30) /* of views' scores; the others are computed again where they are wanted */

struct sst_find_config sst_find_defaults(void)
{
    return (struct sst_find_config){
        .sign = 1, .coverage = 0.5, .window_m = 4.2, .least_m = 0.15, .most_m = 3.5, .least_views = 3, .speed_m_s = 2.5
    };
}

void sst_finds_fini(struct sst_finds *finds)
{
    for (int m = 0; finds->each && m < finds->moments; m++)
        sst_finds_fini(&finds->each[m]);
    free(finds->each);
    free(finds->step);
    for (int c = 0; c < 3; c++)
        sst_map_f32_fini(&finds->integral[c]);
    sst_map_f32_fini(&finds->score);
    sst_map_u16_fini(&finds->views);
    free(finds->found);
    *finds = (struct sst_finds){ 0 };
}

/* --- geometry ----------------------------------------------------------------------------------------------------- */

bool find_place(const struct sst_virtual *camera, const struct sst_surface *surface, double x, double y,
                double at_mm[3])
{
    double ray[3], t;

    sst_virtual_ray(camera, x, y, ray);
    t = sst_surface_meet(surface, camera->centre_mm, ray);
    for (int i = 0; isfinite(t) && i < 3; i++)
        at_mm[i] = camera->centre_mm[i] + t * ray[i];
    return isfinite(t);
}

/* Size of a pixel on the surface, m: at the middle, or where a pixel meets it. */
static double pixel_size(const struct sst_virtual *camera, const struct sst_surface *surface)
{
    const double step = 8;

    for (int k = 0; k < 25; k++) {
        const double x = camera->width * (0.5 + 0.18 * (k % 5) - 0.36 * (k % 5 > 2)) - step / 2;
        const double y = camera->height * (0.5 + 0.18 * (k / 5) - 0.36 * (k / 5 > 2)) - step / 2;
        double a[3], b[3], c[3], across = 0, down = 0;

        if (!find_place(camera, surface, x, y, a) || !find_place(camera, surface, x + step, y, b) ||
            !find_place(camera, surface, x, y + step, c))
            continue;
        for (int i = 0; i < 3; i++) {
            across += (b[i] - a[i]) * (b[i] - a[i]);
            down += (c[i] - a[i]) * (c[i] - a[i]);
        }
        return sqrt(sqrt(across) * sqrt(down)) / step / 1000;
    }
    return 0;
}

struct sst_virtual sst_find_camera(const struct sst_virtual *camera, const struct sst_surface *surface)
{
    const double pixel_m = pixel_size(camera, surface);

    return pixel_m > 0 && pixel_m < PIXEL_M ? sst_virtual_scaled(camera, PIXEL_M / pixel_m) : *camera;
}

/* Place of a find: of its middle, or where the surface has none there, of its highest score that has one. */
static bool blob_place(const struct find_search *s, struct sst_found *f)
{
    const struct sst_rect box = f->blob.box;
    double best = -INFINITY, at[3];

    if (find_place(s->camera, s->surface, f->blob.x, f->blob.y, f->at_mm))
        return true;
    for (int y = box.y0; y < box.y1; y++) {
        for (int x = box.x0; x < box.x1; x++) {
            const double score = (double)sst_map_f32_row(&s->maps->score, y)[x];

            if (isgreater(score, best) && find_place(s->camera, s->surface, x, y, at)) {
                memcpy(f->at_mm, at, sizeof(at));
                best = score;
            }
        }
    }
    return best > -INFINITY;
}

void find_geographic(const struct sst_posed *p, const double at_mm[3], double *latitude, double *longitude)
{
    const double to_rad = M_PI / 180, sine = sin(p->latitude * to_rad), w = 1 - EARTH_E2 * sine * sine;
    const double meridian = EARTH_A * (1 - EARTH_E2) / (w * sqrt(w));
    const double parallel = EARTH_A / sqrt(w) * cos(p->latitude * to_rad);

    *latitude = *longitude = (double)NAN;
    if (!isnan(at_mm[0]) && p->geographic) {
        *latitude = p->latitude + at_mm[1] / 1000 / meridian / to_rad;
        *longitude = p->longitude + at_mm[0] / 1000 / parallel / to_rad;
    }
}

static void locate(const struct find_search *s, struct sst_found *f)
{
    const bool placed = blob_place(s, f);

    for (int i = 0; !placed && i < 3; i++)
        f->at_mm[i] = (double)NAN;
    find_geographic(s->posed, f->at_mm, &f->latitude, &f->longitude);
    f->size_m = 2 * sqrt(f->blob.pixels / M_PI) * s->pixel_m;
}

/* --- integrals ---------------------------------------------------------------------------------------------------- */

/* Pixels of a view for one of the virtual picture, on the surface. */
static double view_scale(const struct find_search *s, int k)
{
    const struct sst_calib_camera *cam = &s->posed->view[k].camera;
    const double far_mm = sst_surface_meet(s->surface, cam->position_mm, cam->rotation + 6);

    return isfinite(far_mm) ? s->pixel_m * 1000 * cam->fx / far_mm : 1;
}

static int compute_scores(const struct find_search *s, struct sst_deep *out, int k)
{
    const double scale = view_scale(s, k);
    struct sst_deep picture = { 0 };
    int err = sst_posed_picture(&picture, s->posed, s->dir, k);

    if (!err && picture.channels == 3)
        err = find_colour_scores(out, &picture, (int)(SMEARED_M / s->pixel_m * scale));
    else if (!err)
        err = find_local_scores(out, &picture, s->cfg->sign, sst_max_int((int)(s->reach * scale), 2));
    sst_deep_fini(&picture);
    return err;
}

static int score_view(void *arg, int k, int worker SST_UNUSED)
{
    struct find_search *s = arg;
    const size_t each = 2 * (size_t)s->posed->width * (size_t)s->posed->height;

    return s->posed->view[k].camera.known && (size_t)k < s->kept_bytes / each ? compute_scores(s, &s->scores[k], k) : 0;
}

int find_resample(struct find_search *s, struct sst_map_f32 *out, int k)
{
    const struct sst_calib_camera *camera = &s->posed->view[k].camera;
    const struct sst_deep *scores = &s->scores[k];
    struct sst_deep own = { 0 };
    int err = 0;

    if (!scores->width) { /* not kept */
        err = compute_scores(s, &own, k);
        scores = &own;
    }
    sst_integral_restart(s->one, s->surface);
    err = err ? err : sst_integral_add(s->one, &camera, &scores, 1);
    err = err ? err : sst_integral_means(out, s->one, 0);
    sst_deep_fini(&own);
    return err;
}

/* The integral of all views, less each one's median where it has one channel. */
static int integrate(struct find_search *s)
{
    struct sst_integral *all = NULL;
    const int channels = s->posed->channels;
    int err = sst_integral_create(&all, s->camera, s->surface, channels, s->threads);

    for (int k = 0; k < s->posed->count && !err; k++) {
        struct sst_deep picture = { 0 }, centred = { 0 };
        const struct sst_calib_camera *camera = &s->posed->view[k].camera;
        const struct sst_deep *add = &picture;

        if (!camera->known)
            continue;
        err = sst_posed_picture(&picture, s->posed, s->dir, k);
        if (!err && channels == 1) {
            err = find_centred(&centred, &picture);
            add = &centred;
        }
        err = err ? err : sst_integral_add(all, &camera, &add, 1);
        sst_deep_fini(&picture);
        sst_deep_fini(&centred);
    }
    for (int c = 0; c < channels && !err; c++)
        err = sst_integral_means(&s->maps->integral[c], all, c);
    err = err ? err : sst_integral_views(&s->maps->views, all);
    s->maps->channels = channels;
    sst_integral_destroy(all);
    return err;
}

/* Views by which a place counts: a share of the number that most places have. */
static int least_coverage(const struct find_search *s)
{
    const struct sst_map_u16 *views = &s->maps->views;
    int64_t of[SST_POSED_MAX_VIEWS + 1] = { 0 }, seen = 0, above = 0;
    int most = SST_POSED_MAX_VIEWS;

    for (int y = 0; y < views->height; y++) {
        for (int x = 0; x < views->width; x++) {
            const int n = sst_min_int(sst_map_u16_row(views, y)[x], SST_POSED_MAX_VIEWS);

            of[n]++;
            seen += n > 0;
        }
    }
    for (; most > 1; most--) {
        above += of[most];
        if ((double)above > (1 - COVERED_MOST) * (double)seen)
            break;
    }
    return sst_max_int((int)ceil(s->cfg->coverage * most), 1);
}

/* Nothing counts where too few views look; `value` is NAN there. @return pixels that count */
static int64_t cover(const struct find_search *s, struct sst_map_f32 *value, int least)
{
    int64_t pixels = 0;

    for (int y = 0; y < value->height; y++) {
        float *row = sst_map_f32_row(value, y);

        for (int x = 0; x < value->width; x++) {
            if (sst_map_u16_row(&s->maps->views, y)[x] < least)
                row[x] = NAN;
            pixels += !isnan(row[x]);
        }
    }
    return pixels;
}

/* The score that `rank` views reach at each pixel: a leaf that one or two see is not on the surface. */
static int ranked(struct find_search *s, struct sst_map_f32 *out, int rank)
{
    struct sst_map_f32 top[RANKS] = { { 0 } };
    int err = 0;

    for (int i = 0; i < rank && !err; i++)
        err = sst_map_f32_init(&top[i], s->camera->width, s->camera->height);
    for (int k = 0; k < s->posed->count && !err; k++) {
        struct sst_map_f32 map = { 0 };

        if (!s->posed->view[k].camera.known)
            continue;
        err = find_resample(s, &map, k);
        for (int y = 0; !err && y < map.height; y++) {
            for (int x = 0; x < map.width; x++) {
                float v = sst_map_f32_row(&map, y)[x];

                for (int i = 0; i < rank && !isnan(v); i++) {
                    float *at = &sst_map_f32_row(&top[i], y)[x];
                    const float was = *at;

                    if (v > was) {
                        *at = v;
                        v = was;
                    }
                }
            }
        }
        sst_map_f32_fini(&map);
    }
    if (!err) {
        *out = top[rank - 1];
        top[rank - 1] = (struct sst_map_f32){ 0 };
    }
    for (int i = 0; i < rank; i++)
        sst_map_f32_fini(&top[i]);
    return err;
}

/* --- thresholds --------------------------------------------------------------------------------------------------- */

/* Peaks of the background: above TAIL_FROM their number falls exponentially. */
struct tail {
    double peaks, slope; /* at TAIL_FROM; a spread. 0: unknown */
};

/* Of two steps as long, the second one has exp(-slope * step) times the peaks of the first; higher ones may be
 * persons. */
static int find_tail(const struct find_search *s, struct tail *tail)
{
    const struct find_blob_config cfg = {
        .seed = TAIL_FROM, .grow = 1, .close_px = 1, .least_px = 1, .most_px = INT32_MAX
    };
    struct sst_blob *blob = NULL;
    int n = 0, low = 0, high = 0;
    const int err = find_blobs(&blob, &n, &s->maps->score, 1, &cfg);

    for (int i = 0; i < n; i++) {
        low += blob[i].score < TAIL_FROM + TAIL_STEP;
        high += blob[i].score >= TAIL_FROM + TAIL_STEP && blob[i].score < TAIL_FROM + 2 * TAIL_STEP;
    }
    free(blob);
    *tail = (struct tail){ 0 };
    if (!err && low + high >= TAIL_LEAST && low > high) {
        tail->slope = log(low / (high + 0.5)) / TAIL_STEP;
        tail->peaks = low / (1 - exp(-tail->slope * TAIL_STEP));
    }
    return err;
}

int find_choose_threshold(struct find_search *s)
{
    struct tail tail;
    const int err = find_tail(s, &tail);
    const double wanted = s->cfg->alarms * s->maps->hectares;

    s->threshold = s->by == SST_FIND_VIEWS ? THRESHOLD_VIEWS : THRESHOLD_INTEGRAL;
    s->threshold *= s->maps->moments ? THRESHOLD_PATHS : 1;
    if (s->cfg->threshold > 0)
        s->threshold = s->cfg->threshold;
    else if (wanted > 0 && tail.slope > 0)
        s->threshold = fmax(TAIL_FROM + log(fmax(tail.peaks / wanted, 1)) / tail.slope, THRESHOLD_LEAST);
    if (wanted > 0 && !(tail.slope > 0) && !err)
        sst_log_warning("%s: too few places to tell how many false finds the background makes; the threshold is %.3g",
                        s->dir, s->threshold);
    s->maps->threshold = s->threshold;
    s->maps->alarms = s->by == SST_FIND_INTEGRAL && tail.slope > 0 && s->maps->hectares > 0
                          ? tail.peaks * exp(-tail.slope * (s->threshold - TAIL_FROM)) / s->maps->hectares
                          : (double)NAN;
    return err;
}

/* --- finds -------------------------------------------------------------------------------------------------------- */

bool find_shown(const struct sst_find_config *cfg, int views, int seen)
{
    return views >= sst_min_int(cfg->least_views, sst_max_int((seen + 1) / 2, 2));
}

/* How a view shows the blobs. */
static int show(struct find_search *s, struct sst_found *found, int count, int k, double *best)
{
    struct sst_map_f32 map = { 0 };
    int err = find_resample(s, &map, k);

    for (int i = 0; i < count && !err; i++) {
        const struct sst_rect box = found[i].blob.box;
        double sum = 0, n = 0, score;

        for (int y = box.y0; y < box.y1; y++) {
            for (int x = box.x0; x < box.x1; x++) {
                const double v = (double)sst_map_f32_row(&map, y)[x];

                if (!isnan(v) && isgreaterequal((double)sst_map_f32_row(&s->maps->score, y)[x], FIND_GROW * s->threshold)) {
                    sum += v;
                    n++;
                }
            }
        }
        if (2 * n < found[i].blob.pixels) /* it does not look there */
            continue;
        score = sum / n / SCORE_STEPS - SCORE_LOWEST;
        found[i].seen++;
        found[i].views += score >= FIND_SHOWN;
        if (score > best[i]) {
            best[i] = score;
            found[i].best = k;
        }
    }
    sst_map_f32_fini(&map);
    return err;
}

bool find_in_view(const struct sst_posed *posed, int view, const double at_mm[3], double px[2])
{
    const struct sst_calib_camera *cam = view >= 0 ? &posed->view[view].camera : NULL;
    double p[3];

    if (!cam || isnan(at_mm[0]))
        return false;
    for (int i = 0; i < 3; i++)
        p[i] = cam->rotation[3 * i] * (at_mm[0] - cam->position_mm[0]) +
               cam->rotation[3 * i + 1] * (at_mm[1] - cam->position_mm[1]) +
               cam->rotation[3 * i + 2] * (at_mm[2] - cam->position_mm[2]);
    sst_camera_distort(cam, p[0] / p[2], p[1] / p[2], &px[0], &px[1]);
    return true;
}

static void see_best(const struct find_search *s, struct sst_found *f)
{
    double px[2];

    if (!find_in_view(s->posed, f->best, f->at_mm, px)) {
        f->best = -1;
        return;
    }
    f->best_x = px[0];
    f->best_y = px[1];
    f->moment = s->posed->view[f->best].moment;
}

struct find_blob_config find_blob_sizes(const struct sst_find_config *cfg, double threshold, double pixel_m)
{
    const double area = pixel_m * pixel_m, quarter = M_PI / 4;

    return (struct find_blob_config){
        .seed = threshold,
        .grow = FIND_GROW,
        .close_px = sst_max_int((int)(FIND_CLOSE_M / pixel_m), 1) | 1,
        .least_px = sst_max_int((int)(quarter * cfg->least_m * cfg->least_m / area), 4),
        .most_px = (int)fmin(quarter * cfg->most_m * cfg->most_m / area, 1 << 30),
    };
}

/* Blobs of the score become finds that enough views show. */
static int judge(struct find_search *s)
{
    const struct find_blob_config cfg = find_blob_sizes(s->cfg, s->threshold, s->pixel_m);
    struct sst_blob *blob = NULL;
    struct sst_found *found;
    double *best;
    int kept = 0, n = 0, err = find_blobs(&blob, &n, &s->maps->score, 1, &cfg);

    found = calloc((size_t)n + 1, sizeof(*found));
    best = calloc((size_t)n + 1, sizeof(*best));
    if (!err && (!found || !best))
        err = -ENOMEM;
    for (int i = 0; i < n && !err; i++) {
        found[i] = (struct sst_found){ .blob = blob[i], .best = -1 };
        best[i] = -INFINITY;
        locate(s, &found[i]);
    }
    for (int k = 0; k < s->posed->count && !err && n; k++) {
        if (s->posed->view[k].camera.known)
            err = show(s, found, n, k, best);
    }
    for (int i = 0; i < n && !err; i++) {
        struct sst_found f = found[i];

        if (!find_shown(s->cfg, f.views, f.seen))
            continue;
        see_best(s, &f);
        found[kept++] = f;
    }
    s->maps->found = found;
    s->maps->count = kept;
    free(blob);
    free(best);
    return err;
}

static int search_init(struct find_search *s)
{
    const int placed = sst_posed_placed(s->posed);
    const double per_px = pixel_size(s->camera, s->surface);

    if (placed < 2) {
        sst_log_error("%s has %s placed view, and a search needs two at least; `sst poses %s` places them", s->dir,
                      placed ? "one" : "no", s->dir);
        return -ENODATA;
    }
    if (!(per_px > 0)) {
        sst_log_error("the virtual picture does not meet the surface; choose another surface or view");
        return -EINVAL;
    }
    s->pixel_m = per_px;
    s->by = s->cfg->by != SST_FIND_CHOOSE ? s->cfg->by : s->posed->channels == 1 ? SST_FIND_INTEGRAL : SST_FIND_VIEWS;
    s->threads = sst_thread_count(s->cfg->threads);
    s->reach = sst_max_int((int)(s->cfg->window_m / 2 / per_px + 0.5), 2);
    s->scores = calloc((size_t)s->posed->count, sizeof(*s->scores));
    return s->scores ? sst_integral_create(&s->one, s->camera, s->surface, 1, s->threads) : -ENOMEM;
}

static int rank_of(const struct find_search *s)
{
    return sst_clamp_int(sst_min_int(s->cfg->least_views, (sst_posed_placed(s->posed) + 1) / 2), 1, RANKS);
}

/* The map of values that are scored. */
static int search_values(struct find_search *s, struct sst_map_f32 *value)
{
    const struct sst_map_f32 *from = &s->maps->integral[0];
    int err;

    if (s->by == SST_FIND_VIEWS)
        return ranked(s, value, rank_of(s));
    err = sst_map_f32_init(value, from->width, from->height);
    for (int y = 0; !err && y < from->height; y++) {
        for (int x = 0; x < from->width; x++) {
            float v = 0;

            for (int c = 0; c < s->maps->channels; c++)
                v += sst_map_f32_row(&s->maps->integral[c], y)[x];
            sst_map_f32_row(value, y)[x] = (float)s->cfg->sign * v;
        }
    }
    return err;
}

struct find_search find_search_of(struct sst_finds *out, const struct sst_find_scene *scene,
                                  const struct sst_find_config *cfg)
{
    *out = (struct sst_finds){ 0 };
    return (struct find_search){ .posed = scene->posed,
                                 .dir = scene->dir,
                                 .camera = scene->camera,
                                 .surface = scene->surface,
                                 .cfg = cfg,
                                 .kept_bytes = KEPT_BYTES,
                                 .maps = out };
}

int find_maps(struct find_search *s)
{
    struct find_score_config score = find_score_defaults();
    struct sst_map_f32 value = { 0 };
    int64_t covered = 0;
    int err = search_init(s);

    err = err ? err : sst_parallel_for(s->posed->count, s->threads, score_view, s);
    err = err ? err : integrate(s);
    err = err ? err : search_values(s, &value);
    if (!err)
        covered = cover(s, &value, sst_max_int(least_coverage(s), s->by == SST_FIND_VIEWS ? rank_of(s) : 1));
    score.reach = s->reach;
    err = err ? err : find_score(&s->maps->score, &value, &score, s->threads);
    s->maps->hectares = (double)covered * s->pixel_m * s->pixel_m / 1e4;
    sst_map_f32_fini(&value);
    return err;
}

int find_search_end(struct find_search *s, int err)
{
    for (int k = 0; s->scores && k < s->posed->count; k++)
        sst_deep_fini(&s->scores[k]);
    free(s->scores);
    if (err == -ENOMEM)
        sst_log_error("not enough memory for a search of %dx%d pixels", s->camera->width, s->camera->height);
    if (err == -EINVAL && s->one) {
        sst_log_error("%s: its pictures, or the virtual one, have sizes that cannot be searched", s->dir);
        err = -EBADMSG;
    }
    sst_integral_destroy(s->one);
    return err;
}

int sst_posed_find(struct sst_finds *out, const struct sst_find_scene *scene, const struct sst_find_config *cfg)
{
    struct find_search s = find_search_of(out, scene, cfg);
    int err = find_maps(&s);

    err = err ? err : find_choose_threshold(&s);
    err = err ? err : judge(&s);
    err = find_search_end(&s, err);
    if (err)
        sst_finds_fini(out);
    return err;
}
