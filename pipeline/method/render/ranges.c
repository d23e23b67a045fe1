/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/method/render/plan.h"

#include <errno.h>
#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/mem.h"
#include "base/thread.h"
#include "pipeline/kernels/kernels.h"

/* Valleys between objects: counts below this share of the lower peak beside them. */
#define VALLEY_SHARE   0.2
#define SMOOTH_COLUMNS 2 /* to each side */
/* An interval with less than this fraction of its label is matching errors, not an object: it is merged. */
#define OBJECT_SHARE 0.005

struct job {
    const struct sst_lightfield *lf;
    /* by worker */
    struct extent {
        uint16_t first, last; /* first > last: none */
        bool present[256];
        char pad[SST_ALIGN];
    } * extent;
    uint16_t row[256]; /* of a label that occurs */
    uint64_t *count;   /* [workers][rows][bins] */
    size_t rows, bins;
};

static int scan_extent(void *arg, int index, int worker)
{
    struct job *j = arg;
    const struct sst_view *v = &j->lf->views[index];
    struct extent *e = &j->extent[worker];

    for (int y = 0; v->present && y < v->label.height; y++) {
        for (int x = 0; x < v->label.width; x++)
            e->present[sst_map_u8_row(&v->label, y)[x]] = true;
    }
    for (int y = 0; v->present && y < v->disp.height; y++) {
        const uint16_t *d = sst_map_u16_row(&v->disp, y);
        uint16_t first = e->first, last_plus_1 = (uint16_t)(e->last + 1);

        /* SST_DISP_NONE + 1 wraps to 0 and so never is the maximum. */
        for (int x = 0; x < v->disp.width; x++) {
            const uint16_t up = (uint16_t)(d[x] + 1);

            first = d[x] < first ? d[x] : first;
            last_plus_1 = up > last_plus_1 ? up : last_plus_1;
        }
        e->first = first;
        e->last = (uint16_t)(last_plus_1 - 1);
    }
    return 0;
}

/* Whether a row has the values of the one above, as every second one of maps matched at half size. */
static bool is_as_above(const struct sst_view *v, int y)
{
    const size_t width = (size_t)v->disp.width;

    return y < v->disp.height &&
           !memcmp(sst_map_u16_row(&v->disp, y), sst_map_u16_row(&v->disp, y - 1), width * sizeof(uint16_t)) &&
           (!v->label.data || !memcmp(sst_map_u8_row(&v->label, y), sst_map_u8_row(&v->label, y - 1), width));
}

static int count_view(void *arg, int index, int worker)
{
    const struct job *j = arg;
    const struct sst_view *v = &j->lf->views[index];
    uint64_t *count = j->count + (size_t)worker * j->rows * j->bins;

    if (!v->present || !v->disp.data)
        return 0;
    for (int y = 0, rows; y < v->disp.height; y += rows) {
        const uint16_t *d = sst_map_u16_row(&v->disp, y);
        const uint8_t *label = v->label.data ? sst_map_u8_row(&v->label, y) : NULL;

        rows = 1 + is_as_above(v, y + 1);
        for (int x = 0; x < v->disp.width; x++) {
            if (d[x] != SST_DISP_NONE)
                count[j->row[label ? label[x] : 0] * j->bins + d[x]] += (uint64_t)rows;
        }
    }
    return 0;
}

static void merge(struct sst_label_histogram *h, const struct job *j, int workers)
{
    const size_t size = j->rows * j->bins;

    for (size_t w = 1; w < (size_t)workers; w++) {
        for (size_t i = 0; i < size; i++)
            j->count[i] += j->count[w * size + i];
    }
    for (size_t label = 0; label < 256; label++) {
        uint64_t *const count = j->count + j->row[label] * j->bins;

        for (size_t i = 0; i < j->bins && (!label || h->present[label]) && !h->count[label]; i++) {
            if (count[i])
                h->count[label] = count;
        }
    }
}

/* Rows of counts: of labels that occur, and of label 0, which pixels without a label have. */
static void give_rows(struct job *j, const bool present[256])
{
    j->rows = 1;
    for (int label = 1; label < 256; label++) {
        if (present[label])
            j->row[label] = (uint16_t)j->rows++;
    }
}

int sst_render_histogram_init(struct sst_label_histogram *h, const struct sst_lightfield *lf, int threads)
{
    const int views = lf->rows * lf->cols, workers = sst_min_int(sst_thread_count(threads), views);
    struct sst_label_histogram made = { .disp_min_px = lf->disp_min_px };
    struct job j = { .lf = lf, .extent = calloc((size_t)workers, sizeof(*j.extent)) };
    int first = SST_DISP_NONE, err = -ENOMEM;

    if (!j.extent)
        return err;
    for (int w = 0; w < workers; w++)
        j.extent[w].first = j.extent[w].last = SST_DISP_NONE;
    err = sst_parallel_for(views, workers, scan_extent, &j);
    for (int w = 0; w < workers; w++) {
        const struct extent *e = &j.extent[w];

        first = sst_min_int(first, e->first);
        if (e->last != SST_DISP_NONE)
            made.bins = sst_max_int(made.bins, e->last + 1);
        for (int i = 0; i < 256; i++)
            made.present[i] |= e->present[i];
    }
    made.first_bin = made.bins ? first : 0;
    j.bins = (size_t)made.bins;
    give_rows(&j, made.present);
    if (!err && made.bins) {
        made.memory = j.count = calloc((size_t)workers * j.rows * j.bins, sizeof(*j.count));
        err = j.count ? sst_parallel_for(views, workers, count_view, &j) : -ENOMEM;
    }
    free(j.extent);
    if (err) {
        free(made.memory);
        return err;
    }
    merge(&made, &j, workers);
    *h = made;
    return 0;
}

void sst_render_histogram_fini(struct sst_label_histogram *h)
{
    free(h->memory);
    *h = (struct sst_label_histogram){ 0 };
}

/* Allocate `bins` in every row, all counts 0. */
static int clear_counts(struct sst_label_histogram *h, int bins)
{
    for (int i = 0; i < 256; i++) {
        if (h->count[i])
            memset(h->count[i], 0, (size_t)h->row * sizeof(*h->count[i]));
        h->count[i] = NULL;
        h->present[i] = false;
    }
    if (bins <= h->row)
        return 0;
    sst_render_histogram_fini(h);
    bins = sst_min_int(bins + (int)(2 * SST_DISP_SCALE),
                       SST_DISP_NONE); /* slack, so that slightly larger values need no reallocation */
    h->memory = calloc((size_t)256 * (size_t)bins, sizeof(*h->memory));
    if (!h->memory)
        return -ENOMEM;
    h->row = bins;
    return 0;
}

static void count_sampled(struct sst_label_histogram *h, const struct sst_view *v, int step)
{
    for (int y = step / 2; y < v->disp.height; y += step) {
        const uint16_t *d = sst_map_u16_row(&v->disp, y);
        const uint8_t *label = v->label.data ? sst_map_u8_row(&v->label, y) : NULL;

        for (int x = step / 2; x < v->disp.width; x += step) {
            const int i = label ? label[x] : 0;

            h->present[i] = true;
            if (d[x] == SST_DISP_NONE)
                continue;
            if (!h->count[i])
                h->count[i] = h->memory + (size_t)i * (size_t)h->row;
            h->count[i][d[x]]++;
        }
    }
}

int sst_render_histogram_recount(struct sst_label_histogram *h, const struct sst_lightfield *lf, const int *view,
                                 int views, int step)
{
    int first = SST_DISP_NONE, bins = 0, err;

    for (int k = 0; k < views; k++) {
        const struct sst_map_u16 *disp = &lf->views[view[k]].disp;

        for (int y = step / 2; disp->data && y < disp->height; y += step) {
            const uint16_t *d = sst_map_u16_row(disp, y);

            for (int x = step / 2; x < disp->width; x += step) {
                first = d[x] < first ? d[x] : first;
                bins = d[x] != SST_DISP_NONE && d[x] >= bins ? d[x] + 1 : bins;
            }
        }
    }
    err = clear_counts(h, bins);
    h->disp_min_px = lf->disp_min_px;
    h->bins = err ? 0 : bins;
    h->first_bin = h->bins ? first : 0;
    for (int k = 0; k < views && !err; k++) {
        if (lf->views[view[k]].disp.data)
            count_sampled(h, &lf->views[view[k]], step);
    }
    return err;
}

bool sst_render_histogram_range(const uint64_t *count, int first, int end, double cut, int *min_bin, int *max_bin)
{
    uint64_t total = 0, below = 0, above = 0;
    double out;
    int lo = first, hi = end - 1;

    for (int i = first; i < end; i++)
        total += count[i];
    if (!total)
        return false;
    out = cut * (double)total;
    while ((double)(below += count[lo]) <= out)
        lo++;
    while ((double)(above += count[hi]) <= out)
        hi--;
    /* If half of an even number is cut off at each end, the two stop on the far sides of the middle. */
    *min_bin = sst_min_int(lo, hi);
    *max_bin = sst_max_int(lo, hi);
    return true;
}

/* Counts by column, summed over the neighbours. */
static void smooth_columns(double *out, const uint64_t *count, int bins)
{
    double column[SST_BLEND_COLUMNS] = { 0 };

    for (int i = 0; i < bins; i++)
        column[i >> SST_BLEND_COLUMN_SHIFT] += (double)count[i];
    for (int c = 0; c < SST_BLEND_COLUMNS; c++) {
        const int end = sst_min_int(c + SMOOTH_COLUMNS, SST_BLEND_COLUMNS - 1);

        out[c] = 0;
        for (int i = sst_max_int(c - SMOOTH_COLUMNS, 0); i <= end; i++)
            out[c] += column[i];
    }
}

/* Merge intervals with too few pixels into the one below (the first into the one above); returns the number left. */
static int join_small(int *end, int n, const uint64_t *count, int bins)
{
    uint64_t total = 0, held = 0;
    int kept = 0, bin = 0;

    for (int i = 0; i < bins; i++)
        total += count[i];
    for (int i = 0; i < n; i++) {
        uint64_t mass = 0;

        for (; bin < sst_min_int(end[i] << SST_BLEND_COLUMN_SHIFT, bins); bin++)
            mass += count[bin];
        held += mass;
        if (kept && (double)mass < OBJECT_SHARE * (double)total) {
            end[kept - 1] = end[i];
        } else if ((double)held >= OBJECT_SHARE * (double)total || i == n - 1) {
            end[kept++] = end[i];
            held = 0;
        }
    }
    return kept;
}

int sst_render_histogram_objects(const uint64_t *count, int bins, int *end)
{
    double h[SST_BLEND_COLUMNS], peak = 0, valley = 0;
    int n = 0, valley_from = 0, valley_to = 0;

    smooth_columns(h, count, bins);
    for (int c = 0; c < SST_BLEND_COLUMNS; c++) {
        if (h[c] > peak && valley >= VALLEY_SHARE * peak) {
            peak = valley = h[c]; /* still climbing to this object's peak */
        } else if (h[c] < valley) {
            valley = h[c];
            valley_from = valley_to = c;
        } else if (h[c] == valley && c == valley_to + 1) {
            valley_to = c;
        } else if (valley < VALLEY_SHARE * peak && valley < VALLEY_SHARE * h[c]) {
            end[n++] = (valley_from + valley_to) / 2 + 1;
            peak = valley = h[c];
        }
    }
    end[n++] = SST_BLEND_COLUMNS;
    return join_small(end, n, count, bins);
}

/* W_s of the values in columns first..end-1. */
static double range_weight(const struct sst_label_histogram *h, const struct sst_render_config *cfg,
                           const uint64_t *count, int first, int end, double cut, double margin_px)
{
    int lo, hi;

    first = sst_min_int(first << SST_BLEND_COLUMN_SHIFT, h->bins);
    end = sst_min_int(end << SST_BLEND_COLUMN_SHIFT, h->bins);
    if (!count || !sst_render_histogram_range(count, first, end, cut, &lo, &hi))
        return 1;
    return sst_weight_label(cfg->focus_px, h->disp_min_px + lo / SST_DISP_SCALE - margin_px,
                            h->disp_min_px + hi / SST_DISP_SCALE + margin_px, 1 / SST_DISP_SCALE, cfg->c2);
}

/* A weight that is not zero must not underflow to zero as a float. */
static float narrow(double w)
{
    return w > 0 ? (float)fmax(w, FLT_MIN) : 0;
}

/* @param within  out: the columns of known disparity whose object's range contains the focus */
static void weight_row(float *row, struct sst_columns *within, const struct sst_label_histogram *h,
                       const struct sst_render_config *cfg, int label)
{
    const double factor = cfg->focus_label && label && label != cfg->focus_label ? 1 / cfg->label_factor : 1;
    const double cut = cfg->range == SST_RANGE_MINMAX ? 0 : cfg->range_percentile;
    const double margin_px = cfg->range == SST_RANGE_OBJECT ? cfg->range_margin_px : 0;
    const uint64_t *count = label ? h->count[label] : NULL;
    int end[SST_BLEND_COLUMNS] = { SST_BLEND_COLUMNS }, n = 1, column = 0;

    if (cfg->range == SST_RANGE_OBJECT && count)
        n = sst_render_histogram_objects(count, h->bins, end);
    *within = (struct sst_columns){ SST_BLEND_COLUMNS, -1 };
    for (int i = 0; i < n; i++) {
        const double w = range_weight(h, cfg, count, column, end[i], cut, margin_px);

        if (w > cfg->c2 || cfg->c2 >= 1)
            *within = (struct sst_columns){ sst_min_int(within->first, column), end[i] - 1 };
        for (; column < end[i]; column++)
            row[column] = narrow(w * factor);
    }
    row[SST_BLEND_COLUMNS - 1] = narrow(range_weight(h, cfg, count, 0, SST_BLEND_COLUMNS, cut, 0) * factor);
}

/* The row in short: ranges of equal weights but for those of the first column's, which is `outside`. */
static struct sst_blend_range shorten_row(const float *row)
{
    struct sst_blend_range r = { .weight = row, .outside = row[0] };

    for (int c = 0, end; c < SST_BLEND_COLUMNS - 1; c = end) {
        for (end = c + 1; end < SST_BLEND_COLUMNS - 1 && row[end] == row[c]; end++)
            ;
        if (row[c] == r.outside)
            continue;
        if (r.ranges < SST_BLEND_RANGES) {
            r.first[r.ranges] = (uint16_t)(c << SST_BLEND_COLUMN_SHIFT);
            r.count[r.ranges] = (uint16_t)((end - c) << SST_BLEND_COLUMN_SHIFT);
            r.inside[r.ranges] = row[c];
        }
        r.ranges++;
    }
    return r;
}

void sst_render_label_weights(float *table, struct sst_blend_labels *labels, struct sst_columns *within,
                              const struct sst_label_histogram *h, const struct sst_render_config *cfg)
{
    int plain[2] = { -1, -1 }; /* a label without a range, by whether its weight is divided */

    for (int label = 0; label < 256; label++) {
        const bool counted = label && h->count[label], divided = cfg->focus_label && label && label != cfg->focus_label;

        if (!counted && plain[divided] >= 0) {
            labels->range[label] = labels->range[plain[divided]];
            within[label] = within[plain[divided]];
            continue;
        }
        weight_row(table, &within[label], h, cfg, label);
        labels->range[label] = shorten_row(table);
        table += SST_BLEND_COLUMNS;
        if (!counted)
            plain[divided] = label;
    }
    sst_blend_labels_few(labels, h->present);
}

static bool differs(float a, float b, double tolerance)
{
    return fabs((double)a - (double)b) > tolerance * fmax((double)a, (double)b);
}

bool sst_render_label_weights_differ(const struct sst_blend_range *range, const struct sst_label_histogram *h,
                                     const struct sst_render_config *cfg, double tolerance, double share)
{
    uint64_t total = 0, off = 0;

    for (int label = 0; label < 256; label++) {
        float row[SST_BLEND_COLUMNS];
        struct sst_columns within;

        if (!h->count[label])
            continue;
        weight_row(row, &within, h, cfg, label);
        for (int bin = 0; bin < h->bins; bin++) {
            const int column = bin >> SST_BLEND_COLUMN_SHIFT;

            total += h->count[label][bin];
            if (h->count[label][bin] && differs(row[column], range[label].weight[column], tolerance))
                off += h->count[label][bin];
        }
    }
    return (double)off > share * (double)total;
}
