/* Plausibility. A false verdict costs more than a missed one, so each test has a margin that chance does not cross:
 * pictures that are equal byte for byte; pairs whose features are not found in each other although both have enough
 * (unrelated pictures give at most 4 of some 150, see drift_link_judge()); disparities that no other view confirms. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/method/process/judge.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/stats.h"

#define SPREAD_PX    4.0  /* RMS about its mean: a pair that matches by chance, or shows another scene */
#define DISPLACED_PX 8.0  /* what correction leaves (align.h) */
#define BAD_SHARE    0.5  /* more of a view's pairs: it does not fit */
#define MANY         0.5  /* of the views at fault: the set is, not some views */
#define FAR_BELOW    0.65 /* of the median of all views' confirmed share */
#define PLAIN_LEVELS 1.0  /* RMS: a view below, in all colours, has no texture ... */
#define PLAIN_STEP   3    /* ... at every such pixel of every such row; ... */
#define PLAIN_SIDE   16   /* ... smaller pictures are not judged */

const char *sst_judge_fault_name(enum sst_judge_fault fault)
{
    static const char *const names[] = {
        "fine", "blank", "doubled", "swapped", "unrelated", "displaced", "unconfirmed"
    };

    return names[fault];
}

static void blame(struct sst_judgement *out, int view, enum sst_judge_fault fault, int other)
{
    if (out->view[view].fault != SST_VIEW_FINE)
        return;
    out->view[view].fault = fault;
    out->view[view].other = other;
    out->faulty++;
}

/* --- pictures ----------------------------------------------------------------------------------------------------- */

static bool same_picture(const struct sst_image *a, const struct sst_image *b)
{
    for (int y = 0; y < a->height; y++) {
        for (int c = 0; c < 3; c++) {
            if (memcmp(sst_image_row(a, c, y), sst_image_row(b, c, y), (size_t)a->width))
                return false;
        }
    }
    return true;
}

static bool pair_bad(const struct sst_drift_pair *p)
{
    return p->state == SST_DRIFT_PAIR_LOST || (p->state == SST_DRIFT_PAIR_MEASURED &&
                                               p->rms_px * p->rms_px - p->mean_px * p->mean_px > SPREAD_PX * SPREAD_PX);
}

static int bad_pairs(const struct sst_drift *check, int view)
{
    int n = 0;

    for (int i = 0; i < check->pairs; i++)
        n += (check->pair[i].a == view || check->pair[i].b == view) && pair_bad(&check->pair[i]);
    return n;
}

/* Features of a view that some pair looked for. */
static bool has_features(const struct sst_drift *check, int view)
{
    for (int i = 0; i < check->pairs; i++) {
        if ((check->pair[i].a == view || check->pair[i].b == view) && check->pair[i].state != SST_DRIFT_PAIR_BLANK)
            return true;
    }
    return false;
}

/* Of two equal views, the one that fits its neighbours less is the copy. */
static void find_doubles(struct sst_judgement *out, const struct sst_lightfield *lf, const struct sst_drift *check)
{
    const int views = lf->rows * lf->cols;

    for (int a = 0; a < views; a++) {
        for (int b = a + 1; b < views && lf->views[a].present && has_features(check, a); b++) {
            if (!lf->views[b].present || !same_picture(&lf->views[a].image, &lf->views[b].image))
                continue;
            if (bad_pairs(check, a) > bad_pairs(check, b))
                blame(out, a, SST_VIEW_DOUBLED, b);
            else
                blame(out, b, SST_VIEW_DOUBLED, a);
        }
    }
}

/* Share of a view's pairs with views that are fine which are bad; at least two must be. */
static double bad_share(const struct sst_judgement *out, const struct sst_drift *check, int view)
{
    int bad = 0, all = 0;

    for (int i = 0; i < check->pairs; i++) {
        const struct sst_drift_pair *p = &check->pair[i];
        const int other = p->a == view ? p->b : p->a;

        if ((p->a != view && p->b != view) || p->state == SST_DRIFT_PAIR_BLANK ||
            out->view[other].fault != SST_VIEW_FINE)
            continue;
        all++;
        bad += pair_bad(p);
    }
    return bad >= 2 ? (double)bad / all : 0;
}

/* The worst first: then its neighbours have one bad pair less. */
static void find_unrelated(struct sst_judgement *out, const struct sst_lightfield *lf, const struct sst_drift *check)
{
    for (;;) {
        double most = BAD_SHARE;
        int worst = -1;

        for (int v = 0; v < lf->rows * lf->cols; v++) {
            const double share =
                out->view[v].fault == SST_VIEW_FINE && lf->views[v].present ? bad_share(out, check, v) : 0;

            if (share > most) {
                most = share;
                worst = v;
            }
        }
        if (worst < 0)
            return;
        blame(out, worst, SST_VIEW_UNRELATED, -1);
    }
}

static void describe_views(struct sst_judgement *out, const struct sst_lightfield *lf)
{
    static const char *const what[] = { [SST_VIEW_BLANK] = "is black, covered or over-exposed",
                                        [SST_VIEW_DOUBLED] = "shows the same picture as",
                                        [SST_VIEW_SWAPPED] = "is swapped with",
                                        [SST_VIEW_UNRELATED] = "shows nothing of what its neighbours show",
                                        [SST_VIEW_DISPLACED] = "is displaced by more than what is corrected",
                                        [SST_VIEW_UNCONFIRMED] = "is confirmed far less than the others" };
    int first = -1;
    size_t n;

    for (int v = 0; v < lf->rows * lf->cols && first < 0; v++)
        first = out->view[v].fault != SST_VIEW_FINE ? v : -1;
    if (first < 0)
        return;
    n = (size_t)snprintf(out->sentence, sizeof(out->sentence), "the view of row %d, column %d %s", first / lf->cols,
                         first % lf->cols, what[out->view[first].fault]);
    if (out->view[first].other >= 0)
        n += (size_t)snprintf(out->sentence + n, sizeof(out->sentence) - n, " that of row %d, column %d",
                              out->view[first].other / lf->cols, out->view[first].other % lf->cols);
    if (out->faulty > 1)
        n += (size_t)snprintf(out->sentence + n, sizeof(out->sentence) - n, ", and %d more %s at fault",
                              out->faulty - 1, out->faulty == 2 ? "is" : "are");
    snprintf(out->sentence + n, sizeof(out->sentence) - n, "; record or import %s again, or leave %s out",
             out->faulty > 1 ? "them" : "it", out->faulty > 1 ? "them" : "it");
}

static void conclude(struct sst_judgement *out, const struct sst_lightfield *lf)
{
    int present = 0, doubled = 0;

    for (int v = 0; v < lf->rows * lf->cols; v++) {
        present += lf->views[v].present;
        doubled += out->view[v].fault == SST_VIEW_DOUBLED;
    }
    if (out->sentence[0])
        return;
    if (doubled > MANY * present)
        snprintf(out->sentence, sizeof(out->sentence),
                 "%d of %d views are copies of others; check that the camera moved and that the files are the right "
                 "ones",
                 doubled, present);
    else if (out->faulty > MANY * present)
        snprintf(out->sentence, sizeof(out->sentence),
                 "%d of %d views do not fit their neighbours: they are not views of one scene in this order, or not "
                 "rectified; check the order of the files and `sst calibrate --check`",
                 out->faulty, present);
    else
        describe_views(out, lf);
    out->plausible = !out->sentence[0];
}

static void start(struct sst_judgement *out, int views)
{
    *out = (struct sst_judgement){ .judged = true, .plausible = true };
    for (int v = 0; v < views; v++) {
        out->view[v].other = -1;
        out->view[v].confirmed = NAN;
    }
}

void sst_judge_pictures(struct sst_judgement *out, const struct sst_lightfield *lf, const struct sst_drift *check)
{
    const int views = lf->rows * lf->cols;

    start(out, views);
    if (check->wrong_order) {
        snprintf(out->sentence, sizeof(out->sentence), "%s", strchr(check->sentence, ':') + 2);
        out->plausible = false;
        return;
    }
    for (int v = 0; v < views; v++) {
        if (check->camera[v].blank)
            blame(out, v, SST_VIEW_BLANK, -1);
    }
    find_doubles(out, lf, check);
    if (check->swapped_a >= 0) {
        blame(out, check->swapped_a, SST_VIEW_SWAPPED, check->swapped_b);
        blame(out, check->swapped_b, SST_VIEW_SWAPPED, check->swapped_a);
    }
    find_unrelated(out, lf, check);
    for (int v = 0; v < views; v++) {
        const struct sst_drift_camera *c = &check->camera[v];

        if (check->contradiction_px <= SST_DRIFT_CONTRADICTION_PX && c->known && c->off_px > DISPLACED_PX &&
            c->off_px > 4 * c->off_sigma_px)
            blame(out, v, SST_VIEW_DISPLACED, -1);
    }
    conclude(out, lf);
}

/* --- maps --------------------------------------------------------------------------------------------------------- */

bool sst_judge_is_plain(const struct sst_image *img)
{
    bool plain = img->width >= PLAIN_SIDE && img->height >= PLAIN_SIDE;

    for (int plane = 0; plane < 3 && plain; plane++)
        plain = sst_image_channel_contrast(img, plane, PLAIN_STEP) < PLAIN_LEVELS;
    return plain;
}

void sst_judge_plain(struct sst_judgement *out, const struct sst_lightfield *lf, const bool *plain)
{
    const int views = lf->rows * lf->cols;
    int count = 0, first = 0, present = 0;

    for (int v = views - 1; v >= 0; v--) {
        present += lf->views[v].present;
        count += plain[v];
        first = plain[v] ? v : first;
    }
    if (!count)
        return;
    if (!out->judged)
        start(out, views);
    for (int v = 0; v < views; v++) {
        if (plain[v])
            blame(out, v, SST_VIEW_BLANK, -1);
    }
    if (!out->plausible)
        return;
    snprintf(
        out->sentence, sizeof(out->sentence),
        "%d of %d views, the first one of row %d, column %d, have no texture: black, covered or over-exposed, they "
        "agree on any disparity, and none of theirs counts as confirmed; record or import them again",
        count, present, first / lf->cols, first % lf->cols);
    out->plausible = false;
}

static double confirmed_of(const struct sst_view *v)
{
    const struct sst_confirmed n = sst_view_confirmed(v);

    return n.pixels ? 100.0 * (double)n.confirmed / (double)n.pixels : NAN;
}

void sst_judge_maps(struct sst_judgement *out, const struct sst_lightfield *lf, double confirmed)
{
    const int views = lf->rows * lf->cols;
    double sorted[SST_MAX_VIEWS], usual;
    int n = 0;

    if (isnan(confirmed) || !out->judged)
        return;
    for (int v = 0; v < views; v++) {
        out->view[v].confirmed = lf->views[v].present ? confirmed_of(&lf->views[v]) : NAN;
        if (!isnan(out->view[v].confirmed))
            sorted[n++] = out->view[v].confirmed;
    }
    usual = n ? sst_stats_median(sorted, n) : NAN;
    for (int v = 0; v < views; v++) {
        if (isless(out->view[v].confirmed, FAR_BELOW * usual) &&
            out->view[v].confirmed < SST_CONFIRMED_FLOOR) /* NAN: never */
            blame(out, v, SST_VIEW_UNCONFIRMED, -1);
    }
    if (out->plausible && confirmed < SST_CONFIRMED_FLOOR)
        snprintf(out->sentence, sizeof(out->sentence),
                 "only %.0f %% of the disparities are confirmed by other views, where noise reaches 50 to 75 %%: the "
                 "views do "
                 "not show one scene in this order, or it moved; check the order of the files and `sst calibrate "
                 "--check`",
                 confirmed);
    out->plausible = !out->sentence[0];
    conclude(out, lf);
}
