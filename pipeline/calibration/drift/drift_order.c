/* Swapped views, mirrored or transposed grids: whether another order of the pictures makes bad pairs good. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/calibration/drift/drift_internal.h"

#define SUSPECTS 6    /* cameras tried as swapped */
#define SUSPECT  0.3  /* fraction of a camera's pairs that are bad */
#define MOSTLY   0.75 /* fraction of the tried pairs that must be good in the right order */

/* One order of the pictures, tried. */
struct trial {
    struct drift_work w; /* own view and link */
    bool *only;          /* [links] */
    int good, bad;       /* of these pairs */
};

static void count(struct trial *t)
{
    t->good = t->bad = 0;
    for (int i = 0; i < t->w.links; i++) {
        if (!t->only[i])
            continue;
        t->bad += drift_link_bad(&t->w.link[i], t->w.cfg.unusable_px);
        t->good +=
            t->w.link[i].state == SST_DRIFT_PAIR_MEASURED && !drift_link_bad(&t->w.link[i], t->w.cfg.unusable_px);
    }
}

static bool mostly_good(const struct trial *t)
{
    return t->good > 0 && t->good >= MOSTLY * (t->good + t->bad);
}

static void trial_end(struct trial *t)
{
    free(t->w.view);
    free(t->w.link);
    free(t->only);
}

static int trial_begin(struct trial *t, const struct drift_work *w)
{
    *t = (struct trial){ .w = *w };
    t->w.stage = DRIFT_WHOLE;
    t->w.view = malloc((size_t)w->views * sizeof(*t->w.view));
    t->w.link = malloc((size_t)w->links * sizeof(*t->w.link) + 1);
    t->only = calloc((size_t)w->links + 1, sizeof(*t->only));
    if (!t->w.view || !t->w.link || !t->only) {
        trial_end(t);
        return -ENOMEM;
    }
    memcpy(t->w.view, w->view, (size_t)w->views * sizeof(*t->w.view));
    memcpy(t->w.link, w->link, (size_t)w->links * sizeof(*t->w.link));
    return 0;
}

/* --- two views ---------------------------------------------------------------------------------------------------- */

/* Share of a camera's pairs that are bad. */
static double bad_share(const struct drift_work *w, int view)
{
    int bad = 0, all = 0;

    for (int i = 0; i < w->links; i++) {
        const struct drift_link *l = &w->link[i];

        if ((l->a != view && l->b != view) || l->state == SST_DRIFT_PAIR_BLANK)
            continue;
        all++;
        bad += drift_link_bad(l, w->cfg.unusable_px);
    }
    return all ? (double)bad / all : 0;
}

/* The most suspicious first, equal ones by index. */
static int find_suspects(int suspect[SUSPECTS], const struct drift_work *w)
{
    double share[SUSPECTS];
    int n = 0;

    for (int v = 0; v < w->views; v++) {
        const double s = bad_share(w, v);
        int i = n;

        if (s < SUSPECT)
            continue;
        for (; i > 0 && share[i - 1] < s; i--) {
            if (i < SUSPECTS) {
                share[i] = share[i - 1];
                suspect[i] = suspect[i - 1];
            }
        }
        if (i < SUSPECTS) {
            share[i] = s;
            suspect[i] = v;
            n = sst_min_int(n + 1, SUSPECTS);
        }
    }
    return n;
}

/* Swapped views are off by the distance between their positions, in opposite directions. */
static bool opposed(const struct sst_drift_camera *a, const struct sst_drift_camera *b, double unusable_px)
{
    const double x = isnan(a->shift_x_px) || isnan(b->shift_x_px) ? 0 : a->shift_x_px * b->shift_x_px;
    const double y = isnan(a->shift_y_px) || isnan(b->shift_y_px) ? 0 : a->shift_y_px * b->shift_y_px;

    if (!a->known || !b->known)
        return true;
    return a->off_px > unusable_px && b->off_px > unusable_px && x + y < 0;
}

/* Exchange a and b: *explains if their pairs are bad before and good after. */
static int try_exchange(bool *explains, const struct drift_work *w, int a, int b)
{
    struct trial t;
    struct drift_pyramid view;
    int before, err = trial_begin(&t, w);

    if (err)
        return err;
    for (int i = 0; i < w->links; i++)
        t.only[i] = w->link[i].a == a || w->link[i].b == a || w->link[i].a == b || w->link[i].b == b;
    count(&t);
    before = t.bad;
    view = t.w.view[a];
    t.w.view[a] = t.w.view[b];
    t.w.view[b] = view;
    err = drift_match_links(&t.w, t.only);
    count(&t);
    *explains = !err && before >= 2 && 2 * t.bad < before && mostly_good(&t);
    trial_end(&t);
    return err;
}

/* --- the whole grid ----------------------------------------------------------------------------------------------- */

struct reorder {
    bool transpose, flip_cols, flip_rows;
    const char *what;
};

static int reordered(const struct reorder *order, int rows, int cols, int view)
{
    int row = view / cols, col = view % cols;

    if (order->transpose) {
        const int r = row;

        row = col;
        col = r;
    }
    if (order->flip_cols)
        col = cols - 1 - col;
    if (order->flip_rows)
        row = rows - 1 - row;
    return row * cols + col;
}

static int try_reorder(bool *explains, const struct drift_work *w, const struct reorder *order)
{
    struct trial t;
    double axes = NAN;
    int err = trial_begin(&t, w);

    if (err)
        return err;
    for (int v = 0; v < w->views; v++)
        t.w.view[v] = w->view[reordered(order, w->lf->rows, w->lf->cols, v)];
    for (int i = 0; i < w->links; i++) {
        /* Holes of the grid move too. */
        t.only[i] = t.w.view[w->link[i].a].image && t.w.view[w->link[i].b].image;
        if (!t.only[i])
            t.w.link[i].state = SST_DRIFT_PAIR_BLANK;
    }
    err = drift_match_links(&t.w, t.only);
    count(&t);
    err = err ? err : drift_measure_axes(&t.w, &axes);
    *explains = !err && mostly_good(&t) && islessequal(axes, w->cfg.unusable_px);
    trial_end(&t);
    return err;
}

int drift_find_wrong_order(struct sst_drift *out, const struct drift_work *w, char order[128])
{
    static const struct reorder orders[] = {
        { false, true, false, "the columns run the other way (right to left)" },
        { false, false, true, "the rows run the other way (upwards)" },
        { false, true, true, "rows and columns both run the other way" },
        { true, false, false, "rows and columns are exchanged" },
    };
    int suspect[SUSPECTS], n = find_suspects(suspect, w), err = 0, bad = 0, usable = 0;
    bool explains = false;

    order[0] = 0;
    out->swapped_a = out->swapped_b = -1;
    for (int i = 0; i < w->links; i++) {
        bad += drift_link_bad(&w->link[i], w->cfg.unusable_px);
        usable += w->link[i].state != SST_DRIFT_PAIR_BLANK;
    }
    if (2 * bad > usable || isgreater(out->axes_px, w->cfg.unusable_px)) { /* NAN: nothing seen both ways */
        for (size_t i = 0; !err && i < ARRAY_LEN(orders); i++) {
            if (orders[i].transpose && w->lf->rows != w->lf->cols)
                continue;
            err = try_reorder(&explains, w, &orders[i]);
            if (err || !explains)
                continue;
            snprintf(order, 128, "%s", orders[i].what);
            return 0;
        }
    }
    for (int i = 0; !err && i < n; i++) {
        for (int j = i + 1; !err && !explains && j < n; j++) {
            if (!opposed(&out->camera[suspect[i]], &out->camera[suspect[j]], w->cfg.unusable_px))
                continue;
            err = try_exchange(&explains, w, suspect[i], suspect[j]);
            if (!explains)
                continue;
            out->swapped_a = sst_min_int(suspect[i], suspect[j]);
            out->swapped_b = sst_max_int(suspect[i], suspect[j]);
        }
    }
    return err;
}
