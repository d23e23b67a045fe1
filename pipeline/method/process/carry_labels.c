#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/thread.h"
#include "pipeline/lightfield/share.h"
#include "pipeline/lightfield/shift.h"
#include "pipeline/method/process/process_internal.h"

#define SOURCES    4       /* nearest key views that labels come from */
#define SAME_Q6    64      /* 1/64 px: disparities of one surface differ by at most this */
#define SIMILAR    24      /* levels: a label stays with a colour whose channels all differ by at most this */
#define REACH_MOST 32768.0 /* px; sources that are farther away are left out */

struct carry {
    struct sst_lightfield *lf;
    const bool *carried;
    struct sst_map_f32 *entropy;
};

/* The nearest key views other than the view itself. @return their number */
static int sources_of(const struct carry *c, int view, int source[SOURCES])
{
    const struct sst_lightfield *lf = c->lf;
    double distance[SOURCES];
    int n = 0;

    for (int k = 0; k < lf->rows * lf->cols; k++) {
        const double far = hypot(lf->views[k].bx - lf->views[view].bx, lf->views[k].by - lf->views[view].by);
        int at;

        if (k == view || !lf->views[k].present || c->carried[k] || (n == SOURCES && far >= distance[n - 1]) ||
            far * (fabs(lf->disp_min_px) + SST_DISP_NONE / SST_DISP_SCALE) > REACH_MOST)
            continue;
        n += n < SOURCES;
        for (at = n - 1; at > 0 && distance[at - 1] > far; at--) {
            distance[at] = distance[at - 1];
            source[at] = source[at - 1];
        }
        distance[at] = far;
        source[at] = k;
    }
    return n;
}

struct source {
    const struct sst_view *view;
    const struct sst_map_f32 *entropy; /* or NULL */
    struct sst_shift across, down;     /* from the view's pixels to the source's */
};

static bool similar(const struct sst_image *a, int xa, int ya, const struct sst_image *b, int xb, int yb)
{
    for (int c = 0; c < 3; c++) {
        if (abs(sst_image_row(a, c, ya)[xa] - sst_image_row(b, c, yb)[xb]) > SIMILAR)
            return false;
    }
    return true;
}

/* The nearest source that shows the surface of pixel (x, y), and where; NULL: none does.
 * @param labelled  only sources that have a label there */
static const struct source *find_source(const struct source *source, int n, const struct sst_view *own, int x, int y,
                                        int d, bool labelled, int *xs, int *ys)
{
    for (const struct source *s = source; s < source + n; s++) {
        *xs = sst_shifted(x, s->across, d);
        *ys = sst_shifted(y, s->down, d);
        if ((unsigned)*xs < (unsigned)own->image.width && (unsigned)*ys < (unsigned)own->image.height &&
            (!labelled || sst_map_u8_row(&s->view->label, *ys)[*xs] != SST_LABEL_NONE) &&
            abs(sst_map_u16_row(&s->view->disp, *ys)[*xs] - d) <= SAME_Q6 &&
            similar(&own->image, x, y, &s->view->image, *xs, *ys))
            return s;
    }
    return NULL;
}

/* The sources of a view. @return their number */
static int open_sources(const struct carry *c, int view, struct source source[SOURCES])
{
    const struct sst_lightfield *lf = c->lf;
    const struct sst_view *own = &lf->views[view];
    int nearest[SOURCES];
    const int n = sources_of(c, view, nearest);

    for (int i = 0; i < n; i++) {
        const struct sst_view *from = &lf->views[nearest[i]];

        source[i] = (struct source){ from, c->entropy ? &c->entropy[nearest[i]] : NULL,
                                     sst_shift_by(own->bx - from->bx, lf->disp_min_px),
                                     sst_shift_by(own->by - from->by, lf->disp_min_px) };
    }
    return n;
}

static bool is_seen(const struct sst_view *v, int x, int y)
{
    return sst_map_u16_row(&v->disp, y)[x] != SST_DISP_NONE && (!v->valid.data || sst_map_u8_row(&v->valid, y)[x]);
}

/* Labels of a view from its sources. @param entropy  likewise, infinite where there is no label; NULL: not wanted */
static void gather_labels(const struct carry *c, int view, struct sst_map_u8 *label, struct sst_map_f32 *entropy)
{
    const struct sst_view *own = &c->lf->views[view];
    struct source source[SOURCES];
    const int n = open_sources(c, view, source);

    for (int y = 0; y < label->height; y++) {
        const uint16_t *d = sst_map_u16_row(&own->disp, y);
        float *e = entropy ? sst_map_f32_row(entropy, y) : NULL;
        uint8_t *to = sst_map_u8_row(label, y);

        for (int x = 0, xs, ys; x < label->width; x++) {
            const struct source *s =
                is_seen(own, x, y) ? find_source(source, n, own, x, y, d[x], true, &xs, &ys) : NULL;

            to[x] = s ? sst_map_u8_row(&s->view->label, ys)[xs] : (uint8_t)SST_LABEL_NONE;
            if (e)
                e[x] = s ? sst_map_f32_row(s->entropy, ys)[xs] : INFINITY;
        }
    }
}

static int carry_job(void *arg, int view, int worker SST_UNUSED)
{
    const struct carry *c = arg;
    struct sst_view *own = &c->lf->views[view];
    int err;

    if (!own->present || !c->carried[view])
        return 0;
    sst_map_u8_fini(&own->label);
    err = sst_map_u8_init(&own->label, c->lf->width, c->lf->height);
    if (!err && c->entropy)
        err = sst_map_f32_init(&c->entropy[view], c->lf->width, c->lf->height);
    if (!err)
        gather_labels(c, view, &own->label, c->entropy ? &c->entropy[view] : NULL);
    return err;
}

static void carried_maps(void *arg, int view, struct sst_share_maps *out)
{
    const struct carry *c = arg;

    if (!c->lf->views[view].present || !c->carried[view])
        return;
    sst_share_add_u8(out, &c->lf->views[view].label);
    if (c->entropy)
        sst_share_add_f32(out, &c->entropy[view]);
}

int process_carry_labels(struct sst_lightfield *lf, const bool *carried, struct sst_map_f32 *entropy,
                         struct sst_share *share, int threads)
{
    const int views = lf->rows * lf->cols;
    const int block = sst_share_block((size_t)lf->width * (size_t)lf->height);
    struct carry c = { lf, carried, entropy };

    return sst_share_blocks(share, views, block, threads, carry_job, &c, carried_maps);
}

/* Columns from .. end - 1 have no label; those beside them have one, unless they are outside. */
static void fill_run(uint8_t *label, const uint16_t *d, int from, int end, int width)
{
    for (int x = from; x < end; x++) {
        const bool left = from > 0 && (end == width || abs(d[x] - d[from - 1]) <= abs(d[x] - d[end]));

        label[x] = left ? label[from - 1] : label[end];
    }
}

static int fill_job(void *arg, int view, int worker SST_UNUSED)
{
    const struct carry *c = arg;
    struct sst_view *v = &c->lf->views[view];

    for (int y = 0; v->present && c->carried[view] && y < v->label.height; y++) {
        const uint16_t *d = sst_map_u16_row(&v->disp, y);
        uint8_t *label = sst_map_u8_row(&v->label, y);

        for (int x = 0, end; x < v->label.width; x = end + 1) {
            for (end = x; end < v->label.width && label[end] == SST_LABEL_NONE; end++)
                ;
            if (end > x && (x > 0 || end < v->label.width))
                fill_run(label, d, x, end, v->label.width);
        }
        for (int x = 0; v->valid.data && x < v->label.width; x++)
            label[x] &= sst_map_u8_row(&v->valid, y)[x];
    }
    return 0;
}

int process_fill_labels(struct sst_lightfield *lf, const bool *carried, int threads)
{
    struct carry c = { lf, carried, NULL };

    return sst_parallel_for(lf->rows * lf->cols, threads, fill_job, &c);
}

int process_carry_error(const struct sst_lightfield *lf, const bool *carried, int view, double *percent)
{
    struct sst_lightfield borrowed = *lf;
    const struct carry c = { &borrowed, carried, NULL };
    struct sst_map_u8 gathered = { 0 };
    int64_t n = 0, off = 0;
    const int err = sst_map_u8_init(&gathered, lf->width, lf->height);

    if (!err)
        gather_labels(&c, view, &gathered, NULL);
    for (int y = 0; !err && y < lf->height; y++) {
        const uint8_t *label = sst_map_u8_row(&lf->views[view].label, y), *there = sst_map_u8_row(&gathered, y);

        for (int x = 0; x < lf->width; x++) {
            n += label[x] && there[x];
            off += label[x] && there[x] && label[x] != there[x];
        }
    }
    *percent = n ? 100.0 * (double)off / (double)n : NAN;
    sst_map_u8_fini(&gathered);
    return err;
}

double process_carry_shown(const struct sst_lightfield *lf, const bool *carried, int view)
{
    struct sst_lightfield borrowed = *lf;
    const struct carry c = { &borrowed, carried, NULL };
    const struct sst_view *own = &lf->views[view];
    struct source source[SOURCES];
    const int n = open_sources(&c, view, source);
    int64_t seen = 0, shown = 0;

    for (int y = 0; y < lf->height; y++) {
        for (int x = 0, xs, ys; x < lf->width; x++) {
            const int d = sst_map_u16_row(&own->disp, y)[x];

            if (!is_seen(own, x, y))
                continue;
            seen++;
            shown += find_source(source, n, own, x, y, d, false, &xs, &ys) != NULL;
        }
    }
    return seen ? (double)shown / (double)seen : 0;
}
