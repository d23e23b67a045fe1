/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>

#include "base/border.h"
#include "base/log.h"
#include "base/mem.h"
#include "pipeline/method/render/plan.h"

#define COLUMN_Q6   16   /* 1/4 px: columns of the histogram */
#define REACH       2    /* smoothed over this many columns to each side */
#define SPARSE      0.3  /* of the mean density: columns of a gap have less */
#define LEAST_SHARE 0.05 /* of all rays on each side of a gap */

#define LEAST_WIDTH 0.1 /* of a gap, of all columns in use */

/* Densities of disparities, mean 1. */
struct density {
    int columns, first; /* the first in use */
    double *smooth;     /* [columns] */
    double *nearer;     /* [columns + 1] share of the rays in columns from here on */
};

static double column_count(const struct sst_label_histogram *h, int column)
{
    uint64_t n = 0;

    for (int label = 0; label < 256; label++) {
        for (int bin = column * COLUMN_Q6; h->count[label] && bin < sst_min_int((column + 1) * COLUMN_Q6, h->bins);
             bin++)
            n += h->count[label][bin];
    }
    return (double)n;
}

static int measure(struct density *d, const struct sst_label_histogram *h)
{
    const int first = h->first_bin / COLUMN_Q6, columns = (h->bins + COLUMN_Q6 - 1) / COLUMN_Q6;
    double *plain, total;

    d->columns = columns;
    d->first = first;
    d->smooth = sst_mem_alloc(3 * (size_t)columns + 1, sizeof(double));
    if (!d->smooth)
        return -ENOMEM;
    d->nearer = d->smooth + columns;
    plain = d->nearer + columns + 1;
    for (int i = columns - 1; i >= 0; i--) {
        plain[i] = column_count(h, i);
        d->nearer[i] = d->nearer[i + 1] + plain[i];
    }
    total = d->nearer[0];
    for (int i = 0; i < columns; i++) {
        for (int j = sst_max_int(i - REACH, 0); j <= sst_min_int(i + REACH, columns - 1); j++)
            d->smooth[i] += plain[j] * (columns - first) / (total * (2 * REACH + 1));
    }
    for (int i = 0; i < columns; i++)
        d->nearer[i] /= total;
    return 0;
}

static bool is_sparse(const struct density *d, int i)
{
    return d->smooth[i] < SPARSE && d->nearer[i] > LEAST_SHARE && d->nearer[i] < 1 - LEAST_SHARE;
}

/* Middle of the emptiest columns of from .. to-1. */
static double emptiest(const struct density *d, int from, int to)
{
    double least = INFINITY;
    int first = from, last = from;

    for (int i = from; i < to; i++) {
        if (d->smooth[i] < least) {
            least = d->smooth[i];
            first = i;
        }
        if (d->smooth[i] <= least)
            last = i;
    }
    return (first + last + 1) / 2.0;
}

/* Columns from .. to-1 as a gap: how wide and empty it is, times the root of the smaller share on one side. */
static double gap_score(const struct density *d, int from, int to)
{
    double emptiness = 0;

    if (to - from < LEAST_WIDTH * (d->columns - d->first))
        return 0;
    for (int i = from; i < to; i++)
        emptiness += 1 - d->smooth[i] / SPARSE;
    return emptiness * sqrt(fmin(d->nearer[to], 1 - d->nearer[from]));
}

struct gap {
    int from, to; /* columns from .. to-1 */
};

/* Of all gaps at least half as good as the best, the nearest; also a nearer one if at most the share of a visitor is
 * between the two. @return false: no gap */
static bool find_gap(const struct density *d, double visitor, struct gap *out)
{
    double best = 0;
    bool found = false;

    for (int end = d->columns, from; end > 0; end = from - 1) {
        double score;

        for (from = end; from > 0 && is_sparse(d, from - 1); from--)
            ;
        score = gap_score(d, from, end);
        if (score > best * (found ? 2 : 1)) {
            if (found && d->nearer[end] - d->nearer[out->from] <= visitor)
                continue;
            best = score;
            *out = (struct gap){ from, end };
            found = true;
        }
    }
    return found;
}

int sst_render_find_gap(struct sst_renderer *r, double visitor, struct sst_render_gap *gap)
{
    struct density d = { 0 };
    struct gap at = { 0, 0 };
    double column[3];
    bool found = false;
    int err = sst_renderer_count(r);

    if (err)
        return err;
    err = r->histogram.bins ? measure(&d, &r->histogram) : 0;
    if (err)
        sst_log_error("not enough memory for the histogram of disparities");
    else if (d.columns && find_gap(&d, visitor, &at)) {
        column[0] = at.from;
        column[1] = emptiest(&d, at.from, at.to);
        column[2] = at.to;
        found = true;
    }
    sst_mem_free(d.smooth);
    if (err || !found)
        return err ? err : -ENODATA;
    for (int i = 0; i < 3; i++)
        column[i] = r->lf->disp_min_px + column[i] * COLUMN_Q6 / SST_DISP_SCALE;
    sst_border_doubles("cut of a clear picture", column, 3);
    *gap = (struct sst_render_gap){ .far_px = column[0], .emptiest_px = column[1], .near_px = column[2] };
    return 0;
}

int sst_render_find_cut(struct sst_renderer *r, double *cut_px)
{
    struct sst_render_gap gap;
    const int err = sst_render_find_gap(r, 0, &gap);

    *cut_px = err ? *cut_px : gap.emptiest_px;
    return err;
}
