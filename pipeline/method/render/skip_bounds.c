#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/mem.h"
#include "base/thread.h"
#include "pipeline/method/render/render_internal.h"
#include "pipeline/method/render/verify.h"

/* A view's rays get one weight if their weights differ by at most this share of it, or of the mean weight, times the
 * budget in grey levels. Deviations of independent rays cancel: the pictures of all measured scenes are 10 dB and more
 * better than the budget. */
#define EVEN      0.3F
#define EVEN_MOST 0.25F
/* ... and the tile's common weight if theirs differs from it by at most this share. */
#define COMMON 0.4F
/* Share of the budget (amplitude) that views may make which are left out for their weights. */
#define DROP_SHARE 0.25

/* --- bounds of the maps ------------------------------------------------------------------------------------------- */

struct job {
    const struct sst_lightfield *lf;
    struct skip_bounds *bounds;
    int *most; /* [views] */
};

/* The labels of n pixels: most stretches have one. */
static uint64_t labels_of(const uint8_t *label, int n)
{
    uint64_t set = 0;

    if (n > 1 && !memcmp(label, label + 1, (size_t)n - 1))
        return 1ULL << (label[0] & 63);
    for (int i = 0; i < n; i++)
        set |= 1ULL << (label[i] & 63);
    return set;
}

/* Extend the bounds by n pixels of one row. SST_DISP_NONE + 1 wraps to 0 and so never is the maximum. */
static void extend(struct skip_bound *b, const uint16_t *disp, const uint8_t *label, int n)
{
    uint16_t least = SST_DISP_NONE, most_1 = 0, least_1 = UINT16_MAX;

    for (int i = 0; i < n; i++) {
        const uint16_t d = disp[i], up = (uint16_t)(d + 1);

        least = d < least ? d : least;
        most_1 = up > most_1 ? up : most_1;
        least_1 = up < least_1 ? up : least_1;
    }
    if (most_1) {
        b->least = least < b->least ? least : b->least;
        b->most = (uint16_t)(most_1 - 1) > b->most ? (uint16_t)(most_1 - 1) : b->most;
    }
    b->unknown |= !least_1;
    b->labels |= label ? labels_of(label, n) : 1;
}

static int bound_view(void *arg, int index, int worker SST_UNUSED)
{
    const struct job *j = arg;
    const struct sst_view *v = &j->lf->views[index];
    struct skip_bound *row = j->bounds->tile + (size_t)index * (size_t)j->bounds->rows * (size_t)j->bounds->cols;

    j->most[index] = -1;
    for (int y = 0; v->disp.data && y < v->disp.height; y++) {
        if (y && y % SKIP_BOUND_HEIGHT == 0)
            row += j->bounds->cols;
        for (int i = 0; i < j->bounds->cols && y % SKIP_BOUND_HEIGHT == 0; i++)
            row[i] = (struct skip_bound){ .least = SST_DISP_NONE };
        for (int i = 0, x = 0; x < v->disp.width; i++, x += SKIP_BOUND_WIDTH) {
            const int n = sst_min_int(SKIP_BOUND_WIDTH, v->disp.width - x);

            extend(&row[i], sst_map_u16_row(&v->disp, y) + x, v->label.data ? sst_map_u8_row(&v->label, y) + x : NULL,
                   n);
            if (row[i].least <= row[i].most)
                j->most[index] = sst_max_int(j->most[index], row[i].most);
        }
    }
    return 0;
}

static struct skip_bounds *make_bounds(const struct sst_lightfield *lf, int threads)
{
    const int views = lf->rows * lf->cols;
    struct skip_bounds *b = calloc(1, sizeof(*b));
    int most[SST_MAX_VIEWS];
    struct job job = { lf, b, most };

    if (!b)
        return NULL;
    b->most = -1;
    b->cols = (lf->width + SKIP_BOUND_WIDTH - 1) / SKIP_BOUND_WIDTH;
    b->rows = (lf->height + SKIP_BOUND_HEIGHT - 1) / SKIP_BOUND_HEIGHT;
    b->tile = calloc((size_t)views * (size_t)b->cols * (size_t)b->rows, sizeof(*b->tile));
    if (!b->tile || sst_parallel_for(views, sst_thread_count(threads), bound_view, &job)) {
        skip_bounds_destroy(b);
        return NULL;
    }
    for (int view = 0; view < views; view++)
        b->most = sst_max_int(b->most, most[view]);
    return b;
}

const struct skip_bounds *skip_bounds_of(struct sst_renderer *r)
{
    pthread_mutex_lock(&r->lock);
    if (!r->bounds)
        r->bounds = make_bounds(r->lf, r->threads);
    pthread_mutex_unlock(&r->lock);
    return r->bounds;
}

void skip_bounds_destroy(struct skip_bounds *b)
{
    if (!b)
        return;
    free(b->tile);
    free(b);
}

/* --- bounds of the weights ---------------------------------------------------------------------------------------- */

int skip_weights_init(struct skip_weights *w, const struct skip_bounds *b, const struct sst_render_plan *p,
                      const struct sst_label_histogram *h)
{
    const struct sst_blend *s = &p->blend;
    int n = 0;

    *w = (struct skip_weights){ .bounds = b, .depth = malloc((size_t)sst_max_int(b->most + 1, 1) * sizeof(*w->depth)) };
    if (!w->depth)
        return -ENOMEM;
    for (int d = 0; d <= b->most; d++) {
        const float off = ((float)d - s->focus_whole_q6) - s->focus_part_q6;
        const bool near = (uint16_t)(d - s->first) < s->count;

        w->depth[d] = (near ? (1 - s->c1) * exp2f(-off * off * s->scale) : 0) + s->c1;
    }
    for (int i = 0; i < 64; i++) {
        w->at[i] = (uint16_t)n;
        for (int label = i; label < 256; label += 64) {
            if (h->present[label] || !label)
                w->label[n++] = (uint8_t)label;
        }
    }
    w->at[64] = (uint16_t)n;
    return 0;
}

void skip_weights_fini(struct skip_weights *w)
{
    free(w->depth);
    w->depth = NULL;
}

struct range {
    float lo, hi;
};

/* Without fminf() and most_of(), which are calls: there are no NaN. */
static float least_of(float a, float b)
{
    return a < b ? a : b;
}

static float most_of(float a, float b)
{
    return a > b ? a : b;
}

static void include(struct range *r, float v)
{
    r->lo = least_of(r->lo, v);
    r->hi = most_of(r->hi, v);
}

/* W_d falls with the distance from the focus: its extremes are at the ends, or at the focus between them. */
static struct range bound_depth(const struct skip_weights *w, const struct sst_render_plan *p,
                                const struct skip_bound *b)
{
    struct range r = { INFINITY, 0 };

    if (b->unknown)
        include(&r, p->blend.c1);
    if (b->least > b->most)
        return r;
    include(&r, w->depth[b->least]);
    include(&r, w->depth[b->most]);
    if (p->blend.focus_whole_q6 >= b->least && p->blend.focus_whole_q6 <= b->most)
        include(&r, 1);
    return r;
}

static void include_label(struct range *r, const struct sst_blend_range *of, const struct skip_bound *b)
{
    if (b->unknown)
        include(r, of->weight[SST_BLEND_COLUMNS - 1]);
    if (b->least > b->most)
        return;
    if (of->ranges > SST_BLEND_RANGES) {
        for (int c = b->least >> SST_BLEND_COLUMN_SHIFT; c <= b->most >> SST_BLEND_COLUMN_SHIFT; c++)
            include(r, of->weight[c]);
        return;
    }
    for (int i = 0; i < of->ranges; i++) {
        const int last = of->first[i] + of->count[i] - 1;

        if (b->least > last || b->most < of->first[i])
            continue;
        include(r, of->inside[i]);
        if (b->least >= of->first[i] && b->most <= last)
            return;
    }
    include(r, of->outside);
}

static struct range bound_label(const struct skip_weights *w, const struct sst_render_plan *p,
                                const struct skip_bound *b)
{
    struct range r = { INFINITY, 0 };

    for (uint64_t left = b->labels; left; left &= left - 1) {
        const int i = __builtin_ctzll(left);

        for (int at = w->at[i]; at < w->at[i + 1]; at++)
            include_label(&r, &p->range[w->label[at]], b);
    }
    return r;
}

/* Bounds of the pixels x .. to-1, y .. end-1 of a view, inside it. */
static struct skip_bound bound_of(const struct skip_bounds *b, int view, int x, int to, int y, int end)
{
    const struct skip_bound *tile = b->tile + (size_t)view * (size_t)b->rows * (size_t)b->cols;
    struct skip_bound all = { .least = SST_DISP_NONE };

    for (int row = y / SKIP_BOUND_HEIGHT; row <= (end - 1) / SKIP_BOUND_HEIGHT; row++) {
        for (int col = x / SKIP_BOUND_WIDTH; col <= (to - 1) / SKIP_BOUND_WIDTH; col++) {
            const struct skip_bound *t = tile + row * b->cols + col;

            if (t->least <= t->most) {
                all.least = t->least < all.least ? t->least : all.least;
                all.most = t->most > all.most ? t->most : all.most;
            }
            all.unknown |= t->unknown;
            all.labels |= t->labels;
        }
    }
    return all;
}

/* --- decision of one tile ----------------------------------------------------------------------------------------- */

/* The rays of each view in one tile. */
struct rays {
    struct range weight[SST_MAX_VIEWS]; /* hi 0: none */
    float sure[SST_MAX_VIEWS];          /* least weight at every pixel; 0 where the view does not cover the tile */
    int count;
};

/* Whether pixels may be left to votes: see verify.h. `all` is the aperture of views that cover the tile. */
struct votes {
    float all, front;
};

static void bound_rays(struct rays *r, struct votes *votes, const struct skip_weights *w,
                       const struct sst_render_plan *p, int x, int to, int y, int end)
{
    const int nearest = p->verifier ? sst_verify_nearest(p) : 0;

    *votes = (struct votes){ 0, 0 };
    r->count = p->count;
    for (int k = 0; k < p->count; k++) {
        const struct sst_render_tap *t = &p->tap[k];
        const int x0 = sst_max_int(x, t->x0), x1 = sst_min_int(to, t->x1), y0 = sst_max_int(y, t->y0);
        const int y1 = sst_min_int(end, t->y1);
        const bool whole = x0 == x && x1 == to && y0 == y && y1 == end && !t->v->valid.data && !t->sampler;
        struct skip_bound b;
        struct range depth, label = { 1, 1 };

        r->weight[k] = (struct range){ 0, 0 };
        r->sure[k] = 0;
        if (x0 >= x1 || y0 >= y1)
            continue;
        b = bound_of(w->bounds, t->view, x0 + t->nx, x1 + t->nx, y0 + t->ny, y1 + t->ny);
        depth = bound_depth(w, p, &b);
        if (p->table && t->v->label.data)
            label = bound_label(w, p, &b);
        r->weight[k].lo = (float)t->aperture * depth.lo * label.lo;
        r->weight[k].hi = (float)t->aperture * depth.hi * label.hi;
        r->sure[k] = whole ? r->weight[k].lo : 0;
        votes->all += whole ? (float)t->aperture : 0;
        if (p->verifier && (b.unknown || (b.least <= b.most && b.most > nearest)))
            votes->front += (float)t->aperture;
    }
}

/* Octaves, by quarters, below the largest weight: views are left out together by the one that they are in. */
#define OCTAVES 96

static int octave_of(float w, float most)
{
    uint32_t a, b;

    memcpy(&a, &w, sizeof(a));
    memcpy(&b, &most, sizeof(b));
    return sst_min_int((int)((b - a) >> 21), OCTAVES - 1);
}

/* Leave out the views with the smallest weights, as long as these are a share of at most `share` of all. */
static void drop(struct skip_tile *out, const struct rays *r, float share)
{
    float hi[OCTAVES] = { 0 }, sure[OCTAVES] = { 0 }, most = 0, kept = 0, dropped = 0;
    int at = OCTAVES - 1;

    for (int k = 0; k < r->count; k++) {
        most = most_of(most, r->weight[k].hi);
        kept += r->sure[k];
    }
    for (int k = 0; k < r->count; k++) {
        hi[octave_of(r->weight[k].hi, most)] += r->weight[k].hi;
        sure[octave_of(r->weight[k].hi, most)] += r->sure[k];
    }
    for (; at > 0 && dropped + hi[at] <= share * (kept - sure[at] + dropped + hi[at]); at--) {
        kept -= sure[at];
        dropped += hi[at];
    }
    for (int k = 0; k < r->count; k++) {
        if (octave_of(r->weight[k].hi, most) > at)
            out->mode[k] = SKIP_NONE;
    }
}

/*
 * Weights w are replaced by w', which are 0 for views that are left out. With M' = sum w' C / sum w',
 *
 *     M - M' = sum w C / sum w - M' = sum w (C - M') / sum w = sum (w - w') (C - M') / sum w,
 *
 * since sum w' (C - M') = 0. Colours are 0..255, so |M - M'| <= 255 sum |w - w'| / sum w: the sum above is at most that
 * of the bounds of each view, the one below at least that of the least weights of the views that have a ray at every
 * pixel of the tile. (Weights of the kernels are rounded to 24 bits, the bounds as well.)
 */
static float worst_levels(const struct skip_tile *tile, const struct rays *r)
{
    float off = 0, sure = 0;

    for (int k = 0; k < r->count; k++) {
        const float w = tile->mode[k] == SKIP_NONE ? 0 : tile->mode[k] == SKIP_PLAIN ? tile->common : tile->constant[k];

        sure += r->sure[k];
        if (tile->mode[k] != SKIP_EXACT && r->weight[k].hi > 0)
            off += most_of(r->weight[k].hi - w, w - r->weight[k].lo);
    }
    return sure > 0 ? least_of(255 * off / sure, 255) : off > 0 ? 255 : 0;
}

void skip_bound_tile(struct skip_tile *out, const struct skip_weights *w, const struct sst_render_plan *p, int x,
                     int to, int y, int end, double levels)
{
    const float even = least_of(EVEN * (float)levels, EVEN_MOST);
    struct rays r;
    struct votes votes;
    float mean = 0;
    int n = 0;

    bound_rays(&r, &votes, w, p, x, to, y, end);
    out->verified = p->verifier && sst_verify_may_open(votes.front, votes.all);
    out->common = 0;
    for (int k = 0; k < r.count; k++)
        out->mode[k] = r.weight[k].hi > 0 ? SKIP_EXACT : SKIP_NONE;
    drop(out, &r, (float)(DROP_SHARE * levels / 255));
    for (int k = 0; k < r.count; k++) {
        out->constant[k] = 0.5F * (r.weight[k].lo + r.weight[k].hi);
        mean += out->mode[k] != SKIP_NONE ? r.sure[k] : 0;
        n += out->mode[k] != SKIP_NONE;
    }
    mean /= (float)sst_max_int(n, 1);
    for (int k = 0; k < r.count; k++) {
        const float off = r.weight[k].hi - r.weight[k].lo;

        if (out->mode[k] == SKIP_NONE || !(out->constant[k] > 0) || off > even * most_of(out->constant[k], mean))
            continue;
        out->mode[k] = SKIP_EVEN;
        out->common = most_of(out->common, out->constant[k]);
    }
    mean = 0;
    n = 0;
    for (int k = 0; k < r.count; k++) {
        if (out->mode[k] != SKIP_EVEN || !(out->constant[k] >= (1 - COMMON * even) * out->common))
            continue;
        out->mode[k] = SKIP_PLAIN;
        mean += out->constant[k];
        n++;
    }
    out->common = mean / (float)sst_max_int(n, 1);
    out->worst = worst_levels(out, &r);
}
