#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/thread.h"
#include "pipeline/lightfield/share.h"
#include "pipeline/lightfield/shift.h"
#include "pipeline/method/process/process_internal.h"

#define SOURCES    SST_REFINE_SOURCES /* nearest labelled views that labels come from */
#define REACH_MOST 32768.0            /* px; sources that are farther away are left out */

struct job {
    const struct process_carry *c;
    struct sst_map_f32 *entropy; /* or NULL */
    bool fill;
    int *view;        /* those that labels are carried to */
    bool *done;       /* [views] on the device */
    const int *batch; /* of view: what is done at once */
};

/* The nearest labelled views other than the view itself, the nearest first. @return their number */
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
                              struct process_place *at)
{
    const int d = sst_map_u16_row(&own->disp, y)[x];

    if (!known)
        *nearest = (uint8_t)n;
    for (int i = known ? *nearest : 0; i < n; i++) {
        const struct sst_view *there = &lf->views[source[i].view];

        *at = process_place_in(&source[i], x, y, d);
        if (!(known && i == *nearest) && !process_shows(there, own, x, y, d, *at))
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
            struct process_place at = { 0, 0 };
            const int i =
                process_is_seen(own, x, y) ? find_source(&first, out->known, c->lf, source, n, own, x, y, &at) : n;
            const struct sst_view *there = i < n ? &c->lf->views[source[i].view] : NULL;

            to[x] = there ? sst_map_u8_row(&there->label, at.y)[at.x] : (uint8_t)SST_LABEL_NONE;
            if (e)
                e[x] = there ? sst_map_f32_row(&out->entropy[source[i].view], at.y)[at.x] : INFINITY;
            if (nearest)
                nearest[x] = first;
        }
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
    return j->fill ? process_fill_labels(own) : 0;
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
