/* The default focus: behind the foreground.
 *
 * Surfaces hidden from one view are visible in others. Pixels of the corner views are warped to the lead view by their
 * disparity; where the lead view has a nearer surface, they are hidden by it, and of all hidden pixels at one position
 * the nearest counts: it is visible once the foreground is removed. The nearest surfaces are those of the histogram of
 * disparities from its near end to the first deep valley. Surfaces that they hide get votes for their disparity,
 * weighted by the gap, since a wider gap lets the array see more of the hidden surface. Surfaces that hide nothing (a
 * floor in front) are skipped; if nothing hides anything, the surface that fills most of the picture gets a small vote.
 *
 * Votes are summed over time and decay: a person who walks by for three seconds does not move the focus, and a surface
 * seen behind a person stays in focus after that person has left. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/method/render/focus.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/border.h"
#include "base/log.h"

#define SAMPLE_COLS   160   /* about this number of samples per row */
#define SMOOTH        4     /* bins to each side: windows of 2.25 px, since surfaces are rarely fronto-parallel */
#define VALLEY        0.5   /* depth of a valley, relative to the lower peak beside it; in windows of 0.75 px */
#define SURFACE_SHARE 0.005 /* of all samples: less is noise */
#define GAP_MIN_PX    1.0   /* between a surface and what it hides ... */
#define GAP_SHARE     0.05  /* ... and this fraction of the range: more than the error of the maps */
#define NEARNESS_MIN  0.1
#define DOMINANT_VOTE 1e-4
#define MEMORY_S      30.0
#define STEP_MAX_S    1.0
#define FIRST_S       2.0  /* time that the first votes count for, so that there is a focus at once */
#define SWITCH        1.3  /* another surface needs this multiple of the votes of the one in focus */
#define DRIFT_PX      0.25 /* the focus stays while its surface moves less */

/* Fraction of all samples that a surface must hide to count as foreground: large surfaces are tried first. */
static const double hiding_share[] = { 0.02, 0.003 };

void sst_render_focus_init(struct sst_render_focus *f)
{
    memset(f, 0, sizeof(*f));
    f->focus_px = NAN;
}

void sst_render_focus_fini(struct sst_render_focus *f)
{
    free(f->front);
    free(f->behind);
    sst_render_focus_init(f);
}

/* Sampling grid of a view: every step-th pixel of every step-th row. */
struct sampling {
    int step, cols, rows;
};

static struct sampling grid_of(const struct sst_lightfield *lf)
{
    const int step = sst_max_int(lf->width / SAMPLE_COLS, 1);

    return (struct sampling){ step, lf->width / step, sst_max_int(lf->height / step, 1) };
}

static uint16_t disp_at(const struct sst_view *v, const struct sampling *at, int col, int row)
{
    return sst_map_u16_row(&v->disp, row * at->step + at->step / 2)[col * at->step + at->step / 2];
}

static int reserve(struct sst_render_focus *f, int cells)
{
    uint16_t *front, *behind;

    if (f->cells == cells)
        return 0;
    front = malloc((size_t)cells * sizeof(*front));
    behind = malloc((size_t)cells * sizeof(*behind));
    if (!front || !behind) {
        free(front);
        free(behind);
        return -ENOMEM;
    }
    free(f->front);
    free(f->behind);
    f->front = front;
    f->behind = behind;
    f->cells = cells;
    return 0;
}

/* Warp the samples of view v to the lead view, and note what is hidden there. */
static void note_hidden(struct sst_render_focus *f, const struct sst_lightfield *lf, const struct sampling *at,
                        const struct sst_view *v, const struct sst_view *lead, int gap_q6)
{
    const double bx = v->bx - lead->bx, by = v->by - lead->by;

    for (int row = 0; row < at->rows; row++) {
        for (int col = 0; col < at->cols; col++) {
            const uint16_t q = disp_at(v, at, col, row);
            const double d = sst_disp_px(lf, q) / at->step;
            const double x = floor(col + d * bx + 0.5), y = floor(row + d * by + 0.5);
            int cell;

            if (q == SST_DISP_NONE || !(x >= 0 && x < at->cols && y >= 0 && y < at->rows))
                continue;
            cell = (int)y * at->cols + (int)x;
            if (f->front[cell] != SST_DISP_NONE && f->front[cell] > q + gap_q6 && q >= f->behind[cell])
                f->behind[cell] = (uint16_t)(q + 1);
        }
    }
}

static double window(const float *bin, int c, int side)
{
    const int end = sst_min_int(c + side, SST_BLEND_COLUMNS - 1);
    double sum = 0;

    for (int i = sst_max_int(c - side, 0); i <= end; i++)
        sum += (double)bin[i];
    return sum;
}

/* Centre of the window with the largest sum, with centres in bins first .. last; -1: all are empty. */
static int highest(const float *bin, int first, int last, int side)
{
    double best = 0;
    int at = -1;

    for (int c = sst_max_int(first, 0); c <= sst_min_int(last, SST_BLEND_COLUMNS - 1); c++) {
        const double sum = window(bin, c, side);

        if (sum > best) {
            best = sum;
            at = c;
        }
    }
    return at;
}

/* First bin of the surface whose nearest bin is `top`: down to a valley that is deep relative to both its peaks. */
static int surface_start(const float *share, int top)
{
    double peak = 0, valley = 0;
    int at = top;

    for (int c = top; c >= 0; c--) {
        const double h = window(share, c, 1);

        if (h > peak && (peak < SURFACE_SHARE || valley >= VALLEY * peak)) {
            peak = valley = h;
            at = c;
        } else if (h < valley) {
            valley = h;
            at = c;
        } else if (peak >= SURFACE_SHARE && valley < VALLEY * peak && valley < VALLEY * h && h >= SURFACE_SHARE) {
            return at;
        }
    }
    return 0;
}

/* Count votes for what surfaces of bins start .. top hide. @return fraction of all samples that they hide */
static double vote(struct sst_render_focus *f, int start, int top)
{
    int hiding = 0;

    memset(f->vote, 0, sizeof(f->vote));
    for (int i = 0; i < f->cells; i++) {
        const int front = f->front[i] >> SST_BLEND_COLUMN_SHIFT;
        const int behind = (f->behind[i] - 1) >> SST_BLEND_COLUMN_SHIFT;

        if (f->front[i] == SST_DISP_NONE || !f->behind[i] || front < start || front > top || behind >= start)
            continue;
        f->vote[behind] += 1 / ((float)(front - behind) * (float)f->cells);
        hiding++;
    }
    return (double)hiding / f->cells;
}

static void scale_votes(struct sst_render_focus *f, double factor)
{
    for (int c = 0; c < SST_BLEND_COLUMNS; c++)
        f->vote[c] *= (float)factor;
}

/* Fraction of the samples per disparity, and the extreme bins above noise. @return false: no disparities */
static bool count_fronts(const struct sst_render_focus *f, float *share, int *first, int *last)
{
    double below = 0, above = 0;

    memset(share, 0, SST_BLEND_COLUMNS * sizeof(*share));
    for (int i = 0; i < f->cells; i++) {
        if (f->front[i] != SST_DISP_NONE)
            share[f->front[i] >> SST_BLEND_COLUMN_SHIFT] += 1.0f / (float)f->cells;
    }
    for (*first = 0; *first < SST_BLEND_COLUMNS && (below += (double)share[*first]) < SURFACE_SHARE;)
        ++*first;
    for (*last = SST_BLEND_COLUMNS - 1; *last >= 0 && (above += (double)share[*last]) < SURFACE_SHARE;)
        --*last;
    return *first <= *last;
}

/* Weight of votes behind a surface, by its position in the range of disparities: 0 far, 1 near. It is the third power
 * of it: a car that is the foreground only while no pedestrian passes must not outvote, with the wall that it always
 * hides, what the pedestrians hide now and then. */
static double nearness(const struct sst_lightfield *lf, int start, int top, int first, int last)
{
    const double bins_per_px = SST_DISP_SCALE / (1 << SST_BLEND_COLUMN_SHIFT);
    const bool known = lf->range_min_px < lf->range_max_px;
    const double lo = known ? (lf->range_min_px - lf->disp_min_px) * bins_per_px : first;
    const double hi = known ? (lf->range_max_px - lf->disp_min_px) * bins_per_px : last + 1;
    const double at = sst_clamp_double((0.5 * (start + top) - lo) / fmax(hi - lo, 1), NEARNESS_MIN, 1);

    return at * at * at;
}

int sst_render_focus_vote(struct sst_render_focus *f, const struct sst_lightfield *lf, const int *view, int views)
{
    const struct sampling at = grid_of(lf);
    const struct sst_view *lead = &lf->views[view[0]];
    float share[SST_BLEND_COLUMNS];
    int first, last, top, gap_q6;
    int err = reserve(f, at.cols * at.rows);

    if (err)
        return err;
    if (lf->disp_min_px < f->min_px || lf->disp_min_px > f->min_px) { /* the votes are for other disparities */
        memset(f->memory, 0, sizeof(f->memory));
        f->min_px = lf->disp_min_px;
    }
    for (int i = 0; i < f->cells; i++)
        f->front[i] = disp_at(lead, &at, i % at.cols, i / at.cols);
    memset(f->behind, 0, (size_t)f->cells * sizeof(*f->behind));
    memset(f->vote, 0, sizeof(f->vote));
    if (!count_fronts(f, share, &first, &last))
        return 0;
    gap_q6 = (int)(SST_DISP_SCALE * fmax(GAP_MIN_PX, GAP_SHARE * 0.25 * (last - first)));
    for (int i = 1; i < views; i++)
        note_hidden(f, lf, &at, &lf->views[view[i]], lead, gap_q6);
    for (size_t i = 0; i < ARRAY_LEN(hiding_share); i++) {
        for (top = last; top > first;) {
            const int start = surface_start(share, top);

            if (vote(f, start, top == last ? SST_BLEND_COLUMNS : top) >= hiding_share[i]) {
                scale_votes(f, nearness(lf, start, top, first, last));
                return 0;
            }
            top = start - 1;
        }
    }
    memset(f->vote, 0, sizeof(f->vote));
    top = highest(share, 0, SST_BLEND_COLUMNS, SMOOTH);
    for (int c = sst_max_int(top - SMOOTH, 0); c <= sst_min_int(top + SMOOTH, SST_BLEND_COLUMNS - 1); c++)
        f->vote[c] = (float)DOMINANT_VOTE * share[c];
    return 0;
}

/* Mean of the surface around bin c, px. */
static double surface_px(const struct sst_render_focus *f, int c)
{
    const int end = sst_min_int(c + SMOOTH, SST_BLEND_COLUMNS - 1);
    double sum = 0, weight = 0;

    for (int i = sst_max_int(c - SMOOTH, 0); i <= end; i++) {
        sum += (double)f->memory[i] * (i + 0.5);
        weight += (double)f->memory[i];
    }
    return f->min_px + (weight > 0 ? sum / weight : c + 0.5) * (1 << SST_BLEND_COLUMN_SHIFT) / SST_DISP_SCALE;
}

/* Most votes of a window within 1 px of the focus. */
static double votes_in_focus(const struct sst_render_focus *f)
{
    const double at = (f->focus_px - f->min_px) * SST_DISP_SCALE / (1 << SST_BLEND_COLUMN_SHIFT);
    double best = 0;

    if (!(at > -SMOOTH && at < SST_BLEND_COLUMNS + SMOOTH))
        return 0;
    for (int c = sst_max_int((int)at - SMOOTH, 0); c <= sst_min_int((int)at + SMOOTH, SST_BLEND_COLUMNS - 1); c++)
        best = fmax(best, window(f->memory, c, SMOOTH));
    return best;
}

void sst_render_focus_step(struct sst_render_focus *f, int64_t t_ns)
{
    const double dt = f->t_ns ? sst_clamp_double((double)(t_ns - f->t_ns) * 1e-9, 0, STEP_MAX_S) : FIRST_S;
    const float keep = (float)exp(-dt / MEMORY_S);
    double px;
    int best;

    for (int c = 0; c < SST_BLEND_COLUMNS; c++)
        f->memory[c] = f->memory[c] * keep + f->vote[c] * (float)dt;
    f->t_ns = t_ns;
    best = highest(f->memory, 0, SST_BLEND_COLUMNS, SMOOTH);
    if (best < 0)
        return;
    px = surface_px(f, highest(f->memory, best - SMOOTH, best + SMOOTH, SMOOTH / 2));
    if (isnan(f->focus_px)) {
        f->focus_px = px;
    } else if (fabs(px - f->focus_px) <= 1) {
        if (fabs(px - f->focus_px) > DRIFT_PX)
            f->focus_px = px;
    } else if (window(f->memory, best, SMOOTH) > SWITCH * votes_in_focus(f)) {
        f->focus_px = px;
    }
}

int sst_render_lead_view(const struct sst_lightfield *lf)
{
    double best = INFINITY;
    int lead = -1;

    for (int k = 0; k < lf->rows * lf->cols; k++) {
        const struct sst_view *v = &lf->views[k];

        if (v->present && v->disp.data && hypot(v->bx, v->by) < best) {
            best = hypot(v->bx, v->by);
            lead = k;
        }
    }
    return lead;
}

int sst_render_sample_views(const struct sst_lightfield *lf, int view[SST_RENDER_SAMPLED])
{
    static const int corner[][2] = { { -1, -1 }, { 1, -1 }, { -1, 1 }, { 1, 1 } };
    int sampled = 1;

    view[0] = sst_render_lead_view(lf);
    if (view[0] < 0)
        return 0;
    for (size_t i = 0; i < ARRAY_LEN(corner); i++) {
        double best = -INFINITY;
        int at = -1;
        bool taken = false;

        for (int k = 0; k < lf->rows * lf->cols; k++) {
            const struct sst_view *v = &lf->views[k];
            const double out = corner[i][0] * v->bx + corner[i][1] * v->by;

            if (v->present && v->disp.data && out > best) {
                best = out;
                at = k;
            }
        }
        for (int s = 0; s < sampled; s++)
            taken |= view[s] == at;
        if (!taken)
            view[sampled++] = at;
    }
    return sampled;
}

int sst_render_find_focus(const struct sst_lightfield *lf, double *focus_px)
{
    int view[SST_RENDER_SAMPLED];
    const int views = sst_render_sample_views(lf, view);
    struct sst_render_focus *f = views ? malloc(sizeof(*f)) : NULL;
    int err = f ? 0 : -ENOMEM;

    if (!views)
        return -ENODATA;
    if (f) {
        sst_render_focus_init(f);
        err = sst_render_focus_vote(f, lf, view, views);
    }
    if (!err) {
        sst_render_focus_step(f, 1);
        if (isnan(f->focus_px))
            err = -ENODATA;
        else
            *focus_px = f->focus_px;
        if (!err)
            sst_border_doubles("focus that was found", focus_px, 1);
    }
    if (f)
        sst_render_focus_fini(f);
    free(f);
    if (err == -ENOMEM)
        sst_log_error("not enough memory to find the focus");
    return err;
}
