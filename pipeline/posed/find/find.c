/* Searches: an integral, its scores, blobs, and the views that show each blob. */
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

#define THRESHOLD_INTEGRAL 4.0
#define THRESHOLD_VIEWS    7.0
#define TAIL_FROM          1.5 /* spreads: peaks from here on, in two steps of TAIL_STEP, are the background's ... */
#define TAIL_STEP          1.0 /* ... and show how rare higher ones are */
#define TAIL_LEAST         20  /* peaks */
#define THRESHOLD_LEAST    3.0
#define PIXEL_M            0.025 /* finer ones show parts of a person apart from each other */
#define SMEARED_M          0.03  /* half of the width over which a view's scores are smoothed */
#define GROW               0.5
#define CLOSE_M            0.5       /* gaps between parts of a person */
#define SHOWN              2.0       /* spreads by which a view shows a find */
#define COVERED_MOST       0.95      /* quantile of the number of views that is their usual most */
#define EARTH_A            6378137.0 /* WGS 84 */
#define EARTH_E2           6.69437999014e-3
#define RANKS              4
#define KEPT_BYTES         ((size_t)1 << 30) /* of views' scores; the others are computed again where they are wanted */

struct search {
    const struct sst_posed *posed;
    const char *dir;
    const struct sst_virtual *camera;
    const struct sst_surface *surface;
    const struct sst_find_config *cfg;
    enum sst_find_by by;
    int threads, reach, close; /* px of the virtual picture */
    double pixel_m, threshold;
    struct sst_deep *scores;  /* [views], of placed ones that are kept: score levels in the view's pixels */
    struct sst_integral *one; /* of one view at a time */
    struct sst_finds *maps;
};

struct sst_find_config sst_find_defaults(void)
{
    return (struct sst_find_config){
        .sign = 1, .coverage = 0.5, .window_m = 4.2, .least_m = 0.15, .most_m = 3.5, .least_views = 3
    };
}

void sst_finds_fini(struct sst_finds *finds)
{
    for (int c = 0; c < 3; c++)
        sst_map_f32_fini(&finds->integral[c]);
    sst_map_f32_fini(&finds->score);
    sst_map_u16_fini(&finds->views);
    free(finds->found);
    *finds = (struct sst_finds){ 0 };
}

/* --- geometry ----------------------------------------------------------------------------------------------------- */

static bool place_of(const struct sst_virtual *camera, const struct sst_surface *surface, double x, double y,
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

        if (!place_of(camera, surface, x, y, a) || !place_of(camera, surface, x + step, y, b) ||
            !place_of(camera, surface, x, y + step, c))
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
static bool find_place(const struct search *s, struct sst_found *f)
{
    const struct sst_rect box = f->blob.box;
    double best = -INFINITY, at[3];

    if (place_of(s->camera, s->surface, f->blob.x, f->blob.y, f->at_mm))
        return true;
    for (int y = box.y0; y < box.y1; y++) {
        for (int x = box.x0; x < box.x1; x++) {
            const double score = (double)sst_map_f32_row(&s->maps->score, y)[x];

            if (isgreater(score, best) && place_of(s->camera, s->surface, x, y, at)) {
                memcpy(f->at_mm, at, sizeof(at));
                best = score;
            }
        }
    }
    return best > -INFINITY;
}

static void locate(const struct search *s, struct sst_found *f)
{
    const struct sst_posed *p = s->posed;
    const double to_rad = M_PI / 180, sine = sin(p->latitude * to_rad), w = 1 - EARTH_E2 * sine * sine;
    const double meridian = EARTH_A * (1 - EARTH_E2) / (w * sqrt(w));
    const double parallel = EARTH_A / sqrt(w) * cos(p->latitude * to_rad);
    const bool placed = find_place(s, f);

    f->latitude = f->longitude = (double)NAN;
    for (int i = 0; !placed && i < 3; i++)
        f->at_mm[i] = (double)NAN;
    if (placed && p->geographic) {
        f->latitude = p->latitude + f->at_mm[1] / 1000 / meridian / to_rad;
        f->longitude = p->longitude + f->at_mm[0] / 1000 / parallel / to_rad;
    }
    f->size_m = 2 * sqrt(f->blob.pixels / M_PI) * s->pixel_m;
}

/* --- integrals ---------------------------------------------------------------------------------------------------- */

/* Pixels of a view for one of the virtual picture, on the surface. */
static double view_scale(const struct search *s, int k)
{
    const struct sst_calib_camera *cam = &s->posed->view[k].camera;
    const double far_mm = sst_surface_meet(s->surface, cam->position_mm, cam->rotation + 6);

    return isfinite(far_mm) ? s->pixel_m * 1000 * cam->fx / far_mm : 1;
}

static int compute_scores(const struct search *s, struct sst_deep *out, int k)
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
    struct search *s = arg;
    const size_t each = 2 * (size_t)s->posed->width * (size_t)s->posed->height;

    return s->posed->view[k].camera.known && (size_t)k < KEPT_BYTES / each ? compute_scores(s, &s->scores[k], k) : 0;
}

/* Scores of a view on the surface; NAN where it shows nothing of it. */
static int resample(struct search *s, struct sst_map_f32 *out, int k)
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
static int integrate(struct search *s)
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
static int least_coverage(const struct search *s)
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
static int64_t cover(const struct search *s, struct sst_map_f32 *value, int least)
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
static int ranked(struct search *s, struct sst_map_f32 *out, int rank)
{
    struct sst_map_f32 top[RANKS] = { { 0 } };
    int err = 0;

    for (int i = 0; i < rank && !err; i++)
        err = sst_map_f32_init(&top[i], s->camera->width, s->camera->height);
    for (int k = 0; k < s->posed->count && !err; k++) {
        struct sst_map_f32 map = { 0 };

        if (!s->posed->view[k].camera.known)
            continue;
        err = resample(s, &map, k);
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
static int find_tail(const struct search *s, struct tail *tail)
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

static int choose_threshold(struct search *s)
{
    struct tail tail;
    const int err = find_tail(s, &tail);
    const double wanted = s->cfg->alarms * s->maps->hectares;

    s->threshold = s->by == SST_FIND_VIEWS ? THRESHOLD_VIEWS : THRESHOLD_INTEGRAL;
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

/* How a view shows the blobs. */
static int show(struct search *s, struct sst_found *found, int count, int k, double *best)
{
    struct sst_map_f32 map = { 0 };
    int err = resample(s, &map, k);

    for (int i = 0; i < count && !err; i++) {
        const struct sst_rect box = found[i].blob.box;
        double sum = 0, n = 0, score;

        for (int y = box.y0; y < box.y1; y++) {
            for (int x = box.x0; x < box.x1; x++) {
                const double v = (double)sst_map_f32_row(&map, y)[x];

                if (!isnan(v) && isgreaterequal((double)sst_map_f32_row(&s->maps->score, y)[x], GROW * s->threshold)) {
                    sum += v;
                    n++;
                }
            }
        }
        if (2 * n < found[i].blob.pixels) /* it does not look there */
            continue;
        score = sum / n / SCORE_STEPS - SCORE_LOWEST;
        found[i].seen++;
        found[i].views += score >= SHOWN;
        if (score > best[i]) {
            best[i] = score;
            found[i].best = k;
        }
    }
    sst_map_f32_fini(&map);
    return err;
}

static void see_best(const struct search *s, struct sst_found *f)
{
    const struct sst_calib_camera *cam = f->best >= 0 ? &s->posed->view[f->best].camera : NULL;
    double p[3];

    if (!cam || isnan(f->at_mm[0])) {
        f->best = -1;
        return;
    }
    for (int i = 0; i < 3; i++)
        p[i] = cam->rotation[3 * i] * (f->at_mm[0] - cam->position_mm[0]) +
               cam->rotation[3 * i + 1] * (f->at_mm[1] - cam->position_mm[1]) +
               cam->rotation[3 * i + 2] * (f->at_mm[2] - cam->position_mm[2]);
    sst_camera_distort(cam, p[0] / p[2], p[1] / p[2], &f->best_x, &f->best_y);
    f->moment = s->posed->view[f->best].moment;
}

/* Blobs of the score become finds that enough views show. */
static int judge(struct search *s)
{
    const double area = s->pixel_m * s->pixel_m, quarter = M_PI / 4;
    const struct find_blob_config cfg = {
        .seed = s->threshold,
        .grow = GROW,
        .close_px = s->close,
        .least_px = sst_max_int((int)(quarter * s->cfg->least_m * s->cfg->least_m / area), 4),
        .most_px = (int)fmin(quarter * s->cfg->most_m * s->cfg->most_m / area, 1 << 30),
    };
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

        if (f.views < sst_min_int(s->cfg->least_views, sst_max_int((f.seen + 1) / 2, 2)))
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

static int search_init(struct search *s)
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
    s->close = sst_max_int((int)(CLOSE_M / per_px), 1) | 1;
    s->scores = calloc((size_t)s->posed->count, sizeof(*s->scores));
    return s->scores ? sst_integral_create(&s->one, s->camera, s->surface, 1, s->threads) : -ENOMEM;
}

static int rank_of(const struct search *s)
{
    return sst_clamp_int(sst_min_int(s->cfg->least_views, (sst_posed_placed(s->posed) + 1) / 2), 1, RANKS);
}

/* The map of values that are scored. */
static int search_values(struct search *s, struct sst_map_f32 *value)
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

int sst_posed_find(struct sst_finds *out, const struct sst_find_scene *scene, const struct sst_find_config *cfg)
{
    struct search s = { .posed = scene->posed,
                        .dir = scene->dir,
                        .camera = scene->camera,
                        .surface = scene->surface,
                        .cfg = cfg,
                        .maps = out };
    struct find_score_config score = find_score_defaults();
    struct sst_map_f32 value = { 0 };
    int64_t covered = 0;
    int err;

    *out = (struct sst_finds){ 0 };
    err = search_init(&s);
    err = err ? err : sst_parallel_for(s.posed->count, s.threads, score_view, &s);
    err = err ? err : integrate(&s);
    err = err ? err : search_values(&s, &value);
    if (!err)
        covered = cover(&s, &value, sst_max_int(least_coverage(&s), s.by == SST_FIND_VIEWS ? rank_of(&s) : 1));
    score.reach = s.reach;
    err = err ? err : find_score(&out->score, &value, &score, s.threads);
    out->hectares = (double)covered * s.pixel_m * s.pixel_m / 1e4;
    err = err ? err : choose_threshold(&s);
    err = err ? err : judge(&s);
    for (int k = 0; s.scores && k < s.posed->count; k++)
        sst_deep_fini(&s.scores[k]);
    free(s.scores);
    sst_map_f32_fini(&value);
    if (err == -ENOMEM)
        sst_log_error("not enough memory for a search of %dx%d pixels", scene->camera->width, scene->camera->height);
    if (err == -EINVAL && s.one) {
        sst_log_error("%s: its pictures, or the virtual one, have sizes that cannot be searched", scene->dir);
        err = -EBADMSG;
    }
    sst_integral_destroy(s.one);
    if (err)
        sst_finds_fini(out);
    return err;
}
