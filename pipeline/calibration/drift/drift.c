/* The drift check: grey pyramids, matches of all pairs, the camera displacements that explain them, the verdict. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/border.h"
#include "base/log.h"
#include "base/stats.h"
#include "base/text.h"
#include "base/thread.h"
#include "pipeline/calibration/drift/drift_internal.h"
#include "pipeline/lightfield/share.h"

#define COARSEST_SIDE 160  /* px: pictures are halved until they are at most this large */
#define OK_PX         0.25 /* a camera off by less than this is fine */
#define SIGMAS        4.0  /* significance of an offset */
#define STATES        4    /* shifts, roll and scale of a camera */
#define NAMED         4    /* cameras named in the sentence */
#define ROUGH_PX      0.4  /* matches contradict each other: displaced foliage has up to 0.31, fences mostly 0.45 to 12 */
#define BLANK_SHARE   0.1  /* of the median contrast of all views */

const char *sst_drift_verdict_name(enum sst_drift_verdict verdict)
{
    static const char *const names[] = { "OK", "DRIFTED", "UNUSABLE", "UNKNOWN" };

    return names[verdict];
}

/* --- sentences ---------------------------------------------------------------------------------------------------- */

#define append(out, ...) sst_text_add((out)->sentence, sizeof((out)->sentence), __VA_ARGS__)

/* "camera 02_03 sits 0.8 px too low and 0.3 px too far right (rolled 0.05 degrees clockwise)" */
static void describe_camera(struct sst_drift *out, const struct drift_work *w, int view, double radius)
{
    const struct sst_drift_camera *c = &out->camera[view];
    const double least = fmax(0.05, 0.15 * c->off_px), roll = c->roll_deg * (M_PI / 180) * radius;
    const char *join = " sits";
    char name[16];

    sst_view_name(w->lf, view, name);
    append(out, "camera %s", name);
    if (c->blank) {
        append(out, " shows nothing at all (black, covered or over-exposed)");
        return;
    }
    if (c->lost) {
        append(out, " shows nothing that its neighbours see (covered, turned away or exchanged with another)");
        return;
    }
    if (isgreaterequal(fabs(c->shift_y_px), least)) { /* never so for NAN, which raises nothing here */
        append(out, "%s %.2f px too %s", join, fabs(c->shift_y_px), c->shift_y_px > 0 ? "low" : "high");
        join = " and";
    }
    if (isgreaterequal(fabs(c->shift_x_px), least)) {
        append(out, "%s %.2f px too far %s", join, fabs(c->shift_x_px), c->shift_x_px > 0 ? "right" : "left");
        join = " and";
    }
    if (isgreaterequal(fabs(roll), least)) {
        append(out, "%s rolled %.3f degrees %s", strcmp(join, " sits") ? " and" : " is", fabs(c->roll_deg),
               c->roll_deg > 0 ? "clockwise" : "counter-clockwise");
        join = " and";
    }
    if (isgreaterequal(fabs(c->scale) * radius, least))
        append(out, "%s %.3f %% too %s", strcmp(join, " sits") ? " and" : " is", fabs(c->scale) * 100,
               c->scale > 0 ? "large" : "small");
}

static double severity(const struct sst_drift_camera *c)
{
    return c->lost || c->blank ? INFINITY : c->off_px;
}

/* Cameras that are off, the worst first; then the largest displacement of the others. */
static void describe_drifted(struct sst_drift *out, const struct drift_work *w, int drifted)
{
    const double radius = hypot(w->lf->width, w->lf->height) / sqrt(12);
    bool named[SST_MAX_VIEWS] = { false };
    double others = 0;
    int remaining = 0;

    for (int n = 0; n < sst_min_int(drifted, NAMED); n++) {
        int worst = -1;

        for (int v = 0; v < w->views; v++) {
            if (out->camera[v].drifted && !named[v] &&
                (worst < 0 || severity(&out->camera[v]) > severity(&out->camera[worst])))
                worst = v;
        }
        append(out, "%s", n ? ", " : "");
        describe_camera(out, w, worst, radius);
        named[worst] = true;
    }
    if (drifted > NAMED)
        append(out, " and %d more", drifted - NAMED);
    for (int v = 0; v < w->views; v++) {
        if (!out->camera[v].known || out->camera[v].drifted)
            continue;
        remaining++;
        others = fmax(others, out->camera[v].off_px);
    }
    if (remaining)
        append(out, "; the other %d are within %.2f px", remaining, others);
}

/* Two cameras: it is not observable which one moved. */
static bool describe_two(struct sst_drift *out, const struct drift_work *w)
{
    int seen[2] = { 0 }, n = 0;
    char a[16], b[16];

    for (int v = 0; v < w->views; v++) {
        if (out->camera[v].known && n < 3) {
            if (n < 2)
                seen[n] = v;
            n++;
        }
    }
    if (n != 2)
        return false;
    sst_view_name(w->lf, seen[0], a);
    sst_view_name(w->lf, seen[1], b);
    append(out,
           "cameras %s and %s sit %.2f px apart across the line between them; which of the two moved is not observable",
           a, b, out->max_px);
    return true;
}

static void describe_unchecked(struct sst_drift *out, const struct drift_work *w)
{
    int n = 0, first = -1;
    char name[16];

    for (int v = 0; v < w->views; v++) {
        if (!w->view[v].image || out->camera[v].known || out->camera[v].lost || out->camera[v].blank)
            continue;
        n++;
        first = first < 0 ? v : first;
    }
    if (!n)
        return;
    sst_view_name(w->lf, first, name);
    append(out, "; %d not tied to the rest by enough matches (%s%s)", n, name, n > 1 ? ", ..." : "");
}

/* --- figures ------------------------------------------------------------------------------------------------------ */

/* Over measured pairs. @param out  with room for all pairs */
static int fill_pairs(struct sst_drift *out, const struct drift_work *w)
{
    double *v = malloc(((size_t)w->links * DRIFT_CELLS + 1) * sizeof(*v)), sum = 0;
    int n = 0;

    if (!v)
        return -ENOMEM;
    out->pairs = w->links;
    out->mean_px = out->p95_px = out->max_px = NAN;
    for (int i = 0; i < w->links; i++) {
        const struct drift_link *l = &w->link[i];

        out->pair[i] = (struct sst_drift_pair){ l->a, l->b, l->state, l->features, l->matches, 0, 0, 0 };
        if (l->state != SST_DRIFT_PAIR_MEASURED)
            continue;
        out->pair[i].mean_px = l->mean_px;
        out->pair[i].rms_px = l->rms_px;
        out->pair[i].p95_px = l->p95_px;
        out->max_px = fmax(out->measured ? out->max_px : 0, fabs(l->mean_px));
        out->measured++;
        sum += fabs(l->mean_px);
        for (int k = 0; k < DRIFT_CELLS; k++) {
            if (l->used[k])
                v[n++] = fabs(l->m[k].across);
        }
    }
    out->matches = n;
    if (n) {
        out->mean_px = sum / out->measured;
        out->p95_px = sst_stats_quantile(v, n, 0.95);
    }
    free(v);
    return 0;
}

/* Sigmas that are as significant as SIGMAS where the sigma itself comes of few matches, as in small pictures:
 * the quantile of Student's t (Abramowitz and Stegun 1964, 26.7.5). */
static double significant_sigmas(int matches)
{
    const double z = SIGMAS, free = sst_max_int(matches - STATES, 1);

    return z + z * (z * z + 1) / (4 * free) + z * (5 * z * z * z * z + 16 * z * z + 3) / (96 * free * free);
}

/* RMS of its pairs, and whether it is off or lost. @return cameras that are */
static int judge_camera(struct sst_drift *out, const struct drift_work *w, int view)
{
    struct sst_drift_camera *c = &out->camera[view];
    double squares = 0;
    int n = 0, tied = 0, lost = 0, all = 0;

    for (int i = 0; i < w->links; i++) {
        const struct drift_link *l = &w->link[i];

        if (l->a != view && l->b != view)
            continue;
        all++;
        lost += l->state == SST_DRIFT_PAIR_LOST;
        tied += drift_link_useful(l) ? l->matches : 0;
        if (l->state != SST_DRIFT_PAIR_MEASURED)
            continue;
        n += l->matches;
        squares += l->rms_px * l->rms_px * l->matches;
    }
    c->known = c->known && c->sigma_px <= OK_PX;
    c->residual_px = n ? sqrt(squares / n) : 0;
    c->lost = all && lost == all;
    c->known = c->known && !c->blank;
    c->drifted = c->lost || c->blank || (c->known && c->off_px > OK_PX &&
                                               c->off_px > significant_sigmas(tied) * c->off_sigma_px);
    return c->drifted;
}

static void decide(struct sst_drift *out, const struct drift_work *w, const char *order)
{
    int bad = 0, lost = 0, usable = 0, drifted = 0, known = 0, present = 0;
    double worst = 0;

    for (int i = 0; i < w->links; i++) {
        usable += w->link[i].state != SST_DRIFT_PAIR_BLANK;
        bad += drift_link_bad(&w->link[i], w->cfg.unusable_px);
        lost += w->link[i].state == SST_DRIFT_PAIR_LOST;
    }
    for (int v = 0; v < w->views; v++) {
        drifted += judge_camera(out, w, v);
        present += w->view[v].image != NULL;
        known += out->camera[v].known || out->camera[v].lost;
        if (out->camera[v].known)
            worst = fmax(worst, out->camera[v].off_px);
    }
    out->sentence[0] = 0;
    out->wrong_order = order[0] != 0;
    if (order[0]) {
        out->verdict = SST_DRIFT_UNUSABLE;
        append(out, "UNUSABLE: %s; correct the order of the views", order);
    } else if (out->swapped_a >= 0) {
        char a[16], b[16];

        out->verdict = SST_DRIFT_UNUSABLE;
        sst_view_name(w->lf, out->swapped_a, a);
        sst_view_name(w->lf, out->swapped_b, b);
        append(out, "UNUSABLE: views %s and %s are swapped: exchanged, their pairs fit", a, b);
    } else if (2 * usable < w->links || !usable || (2 * bad <= usable && 2 * known < present)) {
        out->verdict = SST_DRIFT_UNKNOWN;
        append(out,
               "UNKNOWN: too little texture: %d of %d pairs have the %d distinct features that are needed; point the "
               "array at something with structure",
               usable, w->links, SST_DRIFT_LEAST_MATCHES);
    } else if (2 * bad > usable && out->measured && 8 * (bad - lost) <= out->measured) {
        out->verdict = SST_DRIFT_UNKNOWN;
        append(out,
               "UNKNOWN: %d of %d pairs do not match, but %d of the %d that do fit within %.2g px: twigs or leaves "
               "hide what the views share; check when something else is before the array",
               lost, usable, out->measured - (bad - lost), out->measured, w->cfg.unusable_px);
    } else if (out->rough_px > ROUGH_PX && 2 * lost < usable) {
        out->verdict = SST_DRIFT_UNKNOWN;
        append(out,
               "UNKNOWN: neighbouring matches of a pair contradict each other by %.2f px: a fence or rows of windows "
               "fill the pictures; check when something else is before the array",
               out->rough_px);
    } else if (2 * bad > usable) {
        out->verdict = SST_DRIFT_UNUSABLE;
        append(out,
               "UNUSABLE: %d of %d pairs are off by more than %.2g px or do not match at all: the views were "
               "not rectified, or with another calibration",
               bad, usable, w->cfg.unusable_px);
    } else if (isgreater(out->axes_px, w->cfg.unusable_px)) { /* never so for NAN */
        out->verdict = SST_DRIFT_UNUSABLE;
        append(out,
               "UNUSABLE: disparities along rows and along columns differ by %.2f px per spacing; the offsets of the "
               "views are not those of the cameras",
               out->axes_px);
    } else if (drifted) {
        out->verdict = SST_DRIFT_DRIFTED;
        append(out, "DRIFTED: ");
        if (!describe_two(out, w))
            describe_drifted(out, w, drifted);
        describe_unchecked(out, w);
    } else {
        out->verdict = SST_DRIFT_OK;
        append(out,
               "OK: no camera is off by more than %.2f px; %d matches in %d pairs, epipolar error mean %.3f, p95 "
               "%.3f px",
               worst, out->matches, out->measured, out->mean_px, out->p95_px);
        describe_unchecked(out, w);
    }
}

/* --- the check ---------------------------------------------------------------------------------------------------- */

static int view_job(void *arg, int index, int worker SST_UNUSED)
{
    struct drift_work *w = arg;
    const struct sst_view *v = &w->lf->views[index];
    int err;

    if (!v->present || !v->image.plane[0])
        return 0;
    err = drift_pyramid_init(&w->view[index], &v->image, &v->valid, COARSEST_SIDE);
    if (err == -EBADMSG)
        sst_log_error("view %d has %d x %d pixels, too few to check the calibration; give the full pictures", index,
                      v->image.width, v->image.height);
    return err;
}

static void pyramid_maps(void *arg, int index, struct sst_share_maps *out)
{
    struct drift_work *w = arg;
    struct drift_pyramid *view = &w->view[index];

    if (!w->lf->views[index].present)
        return;
    sst_share_add_values(out, &view->levels, sizeof(view->levels));
    sst_share_add_values(out, &view->noise, sizeof(view->noise));
    sst_share_add_values(out, view->first, sizeof(view->first));
    sst_share_add_values(out, view->feature, sizeof(view->feature));
    for (int i = 0; i < DRIFT_LEVELS; i++)
        sst_share_add_u8(out, &view->level[i]);
}

static int describe_views(struct drift_work *w)
{
    const int block = sst_share_block((size_t)w->lf->width * (size_t)w->lf->height);
    const int err = sst_share_blocks(w->cfg.share, w->views, block, w->cfg.threads, view_job, w, pyramid_maps);

    for (int v = 0; !err && v < w->views; v++) {
        const struct sst_view *view = &w->lf->views[v];

        w->view[v].image = view->present && view->image.plane[0] ? &view->image : NULL;
    }
    return err;
}

static int begin(struct drift_work *w, const struct sst_lightfield *lf, const struct sst_drift_config *cfg)
{
    int present = 0;

    *w = (struct drift_work){ .lf = lf, .cfg = *cfg, .views = lf->rows * lf->cols };
    w->cfg.unusable_px = cfg->unusable_px > 0 ? cfg->unusable_px : 1.0;
    w->cfg.threads = sst_thread_count(cfg->threads);
    for (int v = 0; v < w->views; v++)
        present += lf->views[v].present && lf->views[v].image.plane[0];
    if (present < 2) {
        sst_log_error("cannot check the calibration: %d view%s loaded, 2 are needed", present, present == 1 ? "" : "s");
        return -EBADMSG;
    }
    w->view = calloc((size_t)w->views, sizeof(*w->view));
    w->offset = calloc((size_t)w->views, sizeof(*w->offset));
    if (!w->view || !w->offset)
        return -ENOMEM;
    for (int v = 0; v < w->views; v++) {
        w->offset[v][0] = lf->views[v].bx;
        w->offset[v][1] = lf->views[v].by;
    }
    return describe_views(w);
}

static void end(struct drift_work *w)
{
    for (int v = 0; w->view && v < w->views; v++)
        drift_pyramid_fini(&w->view[v]);
    free(w->view);
    free(w->offset);
    free(w->link);
}

/* Views without contrast among others that have some. */
static void mark_blank(struct sst_drift_camera *camera, const struct drift_work *w)
{
    double contrast[SST_MAX_VIEWS], sorted[SST_MAX_VIEWS], usual;
    int n = 0;

    for (int v = 0; v < w->views; v++) {
        if (!w->view[v].image)
            continue;
        contrast[v] = sst_image_contrast(w->view[v].image);
        sorted[n++] = contrast[v];
    }
    usual = sst_stats_median(sorted, n);
    for (int v = 0; v < w->views; v++)
        camera[v].blank = w->view[v].image && contrast[v] < BLANK_SHARE * usual;
}

/* Conclusions from the matches, by one process for all. */
struct conclusion {
    struct drift_work *w;
    struct sst_drift out; /* without its lists: */
    struct sst_drift_pair *pair;
    struct sst_drift_camera *camera;
};

static int conclude(void *arg, int index SST_UNUSED, int worker SST_UNUSED)
{
    struct conclusion *c = arg;
    struct drift_work *w = c->w;
    struct sst_drift out = { .pair = c->pair, .camera = c->camera };
    char order[128] = "";
    int err = 0;

    mark_blank(out.camera, w);
    err = fill_pairs(&out, w);
    err = err ? err : drift_measure_axes(w, &out.axes_px);
    err = err ? err : drift_solve_cameras(&out, w);
    err = err ? err : drift_solve_gains(&out, w);
    out.far_p95_px = NAN;
    out.swapped_a = out.swapped_b = -1;
    if (w->stage == DRIFT_WHOLE) {
        err = err ? err : drift_measure_corner_pairs(&out, w);
        err = err ? err : drift_find_wrong_order(&out, w, order);
    }
    if (err)
        return err;
    out.narrow = w->stage == DRIFT_CLOSER;
    out.rows = w->lf->rows;
    out.cols = w->lf->cols;
    out.ok_px = OK_PX;
    out.unusable_px = w->cfg.unusable_px;
    out.range_min_px = w->range[0];
    out.range_max_px = w->range[1];
    decide(&out, w, order);
    c->out = out;
    c->out.pair = NULL;
    c->out.camera = NULL;
    return 0;
}

static void concluded_values(void *arg, int index SST_UNUSED, struct sst_share_maps *out)
{
    struct conclusion *c = arg;

    sst_share_add_values(out, &c->out, sizeof(c->out));
    sst_share_add_values(out, c->pair, (size_t)c->w->links * sizeof(*c->pair));
    sst_share_add_values(out, c->camera, (size_t)c->w->views * sizeof(*c->camera));
}

/* Match and conclude. @param out  also after failures to be freed */
static int run_stage(struct sst_drift *out, struct drift_work *w)
{
    struct conclusion c = { .w = w };
    int err = drift_match_links(w, NULL);

    c.pair = calloc((size_t)w->links + 1, sizeof(*c.pair));
    c.camera = calloc((size_t)w->views, sizeof(*c.camera));
    if (!err && (!c.pair || !c.camera))
        err = -ENOMEM;
    err = err ? err : sst_share_for(w->cfg.share, 1, 1, conclude, &c, concluded_values);
    *out = c.out;
    out->pair = c.pair;
    out->camera = c.camera;
    return err;
}

static int run(struct sst_drift *out, struct drift_work *w)
{
    static const enum drift_stage looks[] = { DRIFT_FIRST, DRIFT_CLOSER };
    int err = drift_make_links(w);

    for (size_t i = 0; i < ARRAY_LEN(looks) && !err && w->cfg.enough; i++) {
        w->stage = looks[i];
        err = run_stage(out, w);
        if (err || w->cfg.enough(w->cfg.arg, out))
            return err;
        sst_drift_fini(out);
    }
    w->stage = DRIFT_WHOLE;
    return err ? err : run_stage(out, w);
}

bool sst_drift_possible(const struct sst_lightfield *lf)
{
    int present = 0;

    for (int v = 0; v < lf->rows * lf->cols; v++) {
        const struct sst_image *image = &lf->views[v].image;

        if (!lf->views[v].present || !image->plane[0])
            continue;
        if (image->width < DRIFT_SMALLEST || image->height < DRIFT_SMALLEST)
            return false;
        present++;
    }
    return present >= 2;
}

static void check_border(const struct sst_drift *d)
{
    for (int v = 0; v < d->rows * d->cols; v++) {
        const struct sst_drift_camera *c = &d->camera[v];
        const double place[] = { c->sigma_px, c->off_px, c->off_sigma_px, c->roll_sigma_deg, c->scale_sigma };

        if (c->known) /* of which any but one may be unobserved: NAN by contract */
            sst_border_doubles("displacements of the drift check", place, ARRAY_LEN(place));
        sst_border_doubles("gains of the drift check", c->gain, 3);
        sst_border_doubles("gains of the drift check", c->even_gain, 3);
        sst_border_doubles("gains of the drift check", c->bent_gain, 3);
        sst_border_doubles("exponents of the drift check", &c->exponent, 1);
        sst_border_doubles("fall-off of the drift check", &c->falloff, 1);
    }
}

int sst_drift_check(struct sst_drift *out, const struct sst_lightfield *lf, const struct sst_drift_config *cfg)
{
    struct sst_drift made = { 0 };
    struct drift_work w;
    int err = begin(&w, lf, cfg);

    err = err ? err : run(&made, &w);
    end(&w);
    if (err == -ENOMEM)
        sst_log_error("no memory to check the calibration of %d views; close other programs", lf->rows * lf->cols);
    if (err) {
        sst_drift_fini(&made);
        return err;
    }
    check_border(&made);
    *out = made;
    return 0;
}

void sst_drift_fini(struct sst_drift *check)
{
    free(check->pair);
    free(check->camera);
    *check = (struct sst_drift){ 0 };
}
