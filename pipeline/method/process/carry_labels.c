#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/thread.h"
#include "pipeline/lightfield/share.h"
#include "pipeline/lightfield/shift.h"
#include "pipeline/method/process/process_internal.h"

#define SOURCES    SST_REFINE_VOTERS /* nearest key views that labels come from */
#define SAME_Q6    64                /* 1/64 px: disparities of one surface differ by at most this */
#define SIMILAR    24                /* levels: a label stays with a colour whose channels all differ by at most this */
#define REACH_MOST 32768.0           /* px; sources that are farther away are left out */

struct job {
    const struct process_carry *c;
    struct sst_map_f32 *entropy; /* or NULL */
    bool fill;
    int *view;        /* those that labels are carried to */
    bool *done;       /* [views] on the device */
    const int *batch; /* of view: what is done at once */
};

/* The nearest key views other than the view itself, the nearest first. @return their number */
static int sources_of(const struct process_carry *c, int view, struct sst_refine_voter source[SOURCES])
{
    const struct sst_lightfield *lf = c->lf;
    const struct sst_view *own = &lf->views[view];
    double distance[SOURCES];
    int n = 0;

    for (int k = 0; k < lf->rows * lf->cols; k++) {
        const struct sst_view *from = &lf->views[k];
        const double far = hypot(from->bx - own->bx, from->by - own->by);
        int at;

        if (k == view || !from->present || c->carried[k] || (n == SOURCES && far >= distance[n - 1]) ||
            far * (fabs(lf->disp_min_px) + SST_DISP_NONE / SST_DISP_SCALE) > REACH_MOST)
            continue;
        n += n < SOURCES;
        for (at = n - 1; at > 0 && distance[at - 1] > far; at--) {
            distance[at] = distance[at - 1];
            source[at] = source[at - 1];
        }
        distance[at] = far;
        source[at] = (struct sst_refine_voter){ k, sst_shift_by(own->bx - from->bx, lf->disp_min_px),
                                                sst_shift_by(own->by - from->by, lf->disp_min_px) };
    }
    return n;
}

static bool similar(const struct sst_image *a, int xa, int ya, const struct sst_image *b, int xb, int yb)
{
    for (int c = 0; c < 3; c++) {
        if (abs(sst_image_row(a, c, ya)[xa] - sst_image_row(b, c, yb)[xb]) > SIMILAR)
            return false;
    }
    return true;
}

struct place {
    int x, y;
};

static inline struct place place_in(const struct sst_refine_voter *s, int x, int y, int d)
{
    return (struct place){ sst_shifted(x, s->across, d), sst_shifted(y, s->down, d) };
}

/* Does a source show the surface of pixel (x, y)? @param at  where it would */
static inline bool shows(const struct sst_view *there, const struct sst_view *own, int x, int y, int d, struct place at)
{
    return (unsigned)at.x < (unsigned)own->image.width && (unsigned)at.y < (unsigned)own->image.height &&
           abs(sst_map_u16_row(&there->disp, at.y)[at.x] - d) <= SAME_Q6 &&
           similar(&own->image, x, y, &there->image, at.x, at.y);
}

static bool is_seen(const struct sst_view *v, int x, int y)
{
    return sst_map_u16_row(&v->disp, y)[x] != SST_DISP_NONE && (!v->valid.data || sst_map_u8_row(&v->valid, y)[x]);
}

/* What is gathered of a view. */
struct gathered {
    struct sst_map_u8 *label;
    struct sst_map_f32 *own_entropy;   /* likewise, infinite where there is no label; NULL: not wanted */
    const struct sst_map_f32 *entropy; /* [views] of the sources */
    struct sst_map_u8
        *source; /* index of each pixel's nearest source that shows its surface, their number: none; or NULL */
    bool known;  /* in; else out */
};

/* The nearest source that shows the surface of pixel (x, y) and has a label there. @return its index, n: none does
 * @param nearest  the nearest one that shows the surface, n: none; known: in, else out
 * @param at       out: where */
static inline int find_source(uint8_t *nearest, bool known, const struct sst_lightfield *lf,
                              const struct sst_refine_voter *source, int n, const struct sst_view *own, int x, int y,
                              struct place *at)
{
    const int d = sst_map_u16_row(&own->disp, y)[x];

    if (!known)
        *nearest = (uint8_t)n;
    for (int i = known ? *nearest : 0; i < n; i++) {
        const struct sst_view *there = &lf->views[source[i].view];

        *at = place_in(&source[i], x, y, d);
        if (!(known && i == *nearest) && !shows(there, own, x, y, d, *at))
            continue;
        *nearest = !known && *nearest == n ? (uint8_t)i : *nearest;
        if (sst_map_u8_row(&there->label, at->y)[at->x] != SST_LABEL_NONE)
            return i;
    }
    return n;
}

/* Labels of a view from its sources. */
static void gather_labels(const struct process_carry *c, int view, const struct gathered *out)
{
    const struct sst_view *own = &c->lf->views[view];
    struct sst_refine_voter source[SOURCES];
    const int n = sources_of(c, view, source);

    for (int y = 0; y < out->label->height; y++) {
        float *e = out->own_entropy ? sst_map_f32_row(out->own_entropy, y) : NULL;
        uint8_t *to = sst_map_u8_row(out->label, y), *nearest = out->source ? sst_map_u8_row(out->source, y) : NULL;

        for (int x = 0; x < out->label->width; x++) {
            uint8_t first = out->known ? nearest[x] : (uint8_t)n;
            struct place at = { 0, 0 };
            const int i = is_seen(own, x, y) ? find_source(&first, out->known, c->lf, source, n, own, x, y, &at) : n;
            const struct sst_view *there = i < n ? &c->lf->views[source[i].view] : NULL;

            to[x] = there ? sst_map_u8_row(&there->label, at.y)[at.x] : (uint8_t)SST_LABEL_NONE;
            if (e)
                e[x] = there ? sst_map_f32_row(&out->entropy[source[i].view], at.y)[at.x] : INFINITY;
            if (nearest)
                nearest[x] = first;
        }
    }
}

/* Columns from .. end - 1 have no label; those beside them have one, unless they are outside. */
static void fill_run(uint8_t *label, const uint16_t *d, int from, int end, int width)
{
    for (int x = from; x < end; x++) {
        const bool left = from > 0 && (end == width || abs(d[x] - d[from - 1]) <= abs(d[x] - d[end]));

        label[x] = left ? label[from - 1] : label[end];
    }
}

static void fill_view(struct sst_view *v)
{
    for (int y = 0; y < v->label.height; y++) {
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
}

/* Memory for what is carried to a view. */
static int open_view(const struct job *j, int view)
{
    const struct sst_lightfield *lf = j->c->lf;
    int err;

    sst_map_u8_fini(&lf->views[view].label);
    err = sst_map_u8_init(&lf->views[view].label, lf->width, lf->height);
    return err || !j->entropy ? err : sst_map_f32_init(&j->entropy[view], lf->width, lf->height);
}

static bool carry_on_device(const struct process_carry *c, int view, struct sst_map_u8 *label,
                            struct sst_map_f32 *own_entropy, struct sst_refine_carry *how)
{
    struct sst_refine_voter source[SOURCES];

    how->lf = c->lf;
    how->view = view;
    how->sources = source;
    how->count = sources_of(c, view, source);
    return sst_refine_device_carry(c->device, label, own_entropy, how);
}

static int carry_job(void *arg, int index, int worker SST_UNUSED)
{
    const struct job *j = arg;
    const int view = j->view[j->batch[index]];
    struct sst_view *own = &j->c->lf->views[view];
    struct sst_map_u8 *source = j->c->source ? &j->c->source[view] : NULL;
    struct gathered gathered;
    int err;

    if (j->done[view])
        return 0;
    gathered = (struct gathered){ .label = &own->label,
                                  .own_entropy = j->entropy ? &j->entropy[view] : NULL,
                                  .entropy = j->entropy,
                                  .source = source,
                                  .known = source && source->data };
    err = source && !source->data ? sst_map_u8_init(source, own->label.width, own->label.height) : 0;
    if (err)
        return err;
    gather_labels(j->c, view, &gathered);
    if (j->fill)
        fill_view(own);
    return 0;
}

static int carry_batch(void *arg, const int *index, int count)
{
    struct job *j = arg;
    int err = 0;

    j->batch = index;
    for (int i = 0; i < count && !err; i++) {
        const int view = j->view[index[i]];
        struct sst_refine_carry how = { .entropies = j->entropy, .fill = j->fill };

        err = open_view(j, view);
        if (!err && j->c->device)
            j->done[view] =
                carry_on_device(j->c, view, &j->c->lf->views[view].label, j->entropy ? &j->entropy[view] : NULL, &how);
    }
    return err ? err : sst_parallel_for(count, j->c->threads, carry_job, j);
}

static void carried_maps(void *arg, int index, struct sst_share_maps *out)
{
    const struct job *j = arg;

    sst_share_add_u8(out, &j->c->lf->views[j->view[index]].label);
    if (j->entropy)
        sst_share_add_f32(out, &j->entropy[j->view[index]]);
}

int process_carry_labels(const struct process_carry *c, struct sst_map_f32 *entropy, bool fill)
{
    const int views = c->lf->rows * c->lf->cols;
    struct job j = { c,   entropy, fill, calloc((size_t)views, sizeof(*j.view)), calloc((size_t)views, sizeof(*j.done)),
                     NULL };
    int count = 0, err = j.view && j.done ? 0 : -ENOMEM;

    sst_refine_device_labels_changed(c->device);
    for (int k = 0; !err && k < views; k++) {
        if (c->lf->views[k].present && c->carried[k])
            j.view[count++] = k;
    }
    err = err ? err : sst_share_batches(c->share, count, c->share ? c->threads : views, carry_batch, &j, carried_maps);
    free(j.view);
    free(j.done);
    return err;
}

int process_carry_error(const struct process_carry *c, int view, double *percent)
{
    const struct sst_lightfield *lf = c->lf;
    struct sst_refine_carry how = { 0 };
    struct sst_map_u8 gathered = { 0 };
    int64_t n = 0, off = 0;
    const int err = sst_map_u8_init(&gathered, lf->width, lf->height);

    if (!err && !(c->device && carry_on_device(c, view, &gathered, NULL, &how)))
        gather_labels(c, view, &(struct gathered){ .label = &gathered });
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

/* Write 1 where a source shows the surface, else 0. */
static void find_shown(const struct process_carry *c, int view, struct sst_map_u8 *shown)
{
    const struct sst_view *own = &c->lf->views[view];
    struct sst_refine_voter source[SOURCES];
    const int n = sources_of(c, view, source);

    for (int y = 0; y < shown->height; y++) {
        for (int x = 0; x < shown->width; x++) {
            const int d = sst_map_u16_row(&own->disp, y)[x];
            bool found = false;

            for (int i = 0; i < n && is_seen(own, x, y) && !found; i++)
                found = shows(&c->lf->views[source[i].view], own, x, y, d, place_in(&source[i], x, y, d));
            sst_map_u8_row(shown, y)[x] = found;
        }
    }
}

int process_carry_shown(const struct process_carry *c, int view, double *share)
{
    const struct sst_view *own = &c->lf->views[view];
    struct sst_refine_carry how = { .shown = true };
    struct sst_map_u8 shown = { 0 };
    int64_t seen = 0, all = 0;
    const int err = sst_map_u8_init(&shown, c->lf->width, c->lf->height);

    if (!err && !(c->device && carry_on_device(c, view, &shown, NULL, &how)))
        find_shown(c, view, &shown);
    for (int y = 0; !err && y < shown.height; y++) {
        for (int x = 0; x < shown.width; x++) {
            seen += is_seen(own, x, y);
            all += sst_map_u8_row(&shown, y)[x];
        }
    }
    *share = seen ? (double)all / (double)seen : 0;
    sst_map_u8_fini(&shown);
    return err;
}
