/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/mem.h"
#include "base/thread.h"
#include "pipeline/kernels/kernels.h"
#include "pipeline/lightfield/share.h"
#include "pipeline/lightfield/shift.h"
#include "pipeline/method/process/process_internal.h"

#define SOURCES PROCESS_SOURCES /* nearest labelled views that labels come from */

struct job {
    const struct process_carry *c;
    struct sst_map_f32 *entropy; /* or NULL */
    bool fill;
    int *view;                 /* those that labels are carried to */
    uint64_t **packed;         /* [views] of the sources; NULL: none is asked */
    struct sst_map_f32 *spare; /* [threads] entropies of a view that is done; NULL: they are kept */
};

/* The nearest labelled views other than the view itself, the nearest first. */
struct sources {
    struct process_source at[SOURCES];
    int n;
};

static struct sources sources_of(const struct process_carry *c, int view)
{
    bool labelled[SST_MAX_VIEWS];
    struct sources found;

    for (int k = 0; k < c->lf->rows * c->lf->cols; k++)
        labelled[k] = c->lf->views[k].present && !c->carried[k];
    found.n = process_nearest(c->lf, view, labelled, SOURCES, found.at);
    return found;
}

/* What is gathered of a view. */
struct gathered {
    struct sst_map_u8 *label;
    struct sst_map_f32 *own_entropy; /* infinite where there is no label; NULL: not wanted */
    struct sst_map_u8
        *source; /* index of each pixel's nearest source that shows its surface, their number: none; or NULL */
    bool known;  /* in; else out */
    uint64_t *const *packed; /* [views] of the sources, where nothing is known */
};

/* Rows of what is gathered. */
struct gathered_row {
    uint8_t *label, *source; /* source: NULL, not wanted */
    float *entropy;          /* likewise */
};

/* Labels of a row from the nearest sources that show each surface and have a label there. */
static void gather_row(const struct gathered_row *to, struct process_rays *rays, const struct process_carry *c,
                       const struct gathered *out, const struct sources *s)
{
    const int n = s->n;

    for (int i = 0; i < n && rays->count; i++) {
        const int view = s->at[i].view;
        const uint64_t *there = out->packed[view];
        const size_t width = (size_t)c->lf->views[view].disp.width;
        float spare;
        int left = 0;

        process_rays_find(rays, &c->lf->views[view], there, &s->at[i]);
        for (int k = 0; k < rays->count; k++) { /* the answers are hard to predict: no branches */
            const int32_t at = rays->at[k];
            const uint8_t label = rays->label[k];
            const int x = (int)(rays->own[k] >> SST_RAY_COLUMN);

            to->label[x] = label;
            if (to->source)
                to->source[x] = (at >= 0) & (to->source[x] == n) ? (uint8_t)i : to->source[x];
            if (to->entropy) {
                const size_t ray = at < 0 ? 0 : (size_t)(at >> 16) * width + (size_t)(at & 0xFFFF);
                float *own = label == SST_LABEL_NONE ? &spare : &to->entropy[x];

                *own = process_ray_entropy(there[ray]);
            }
            rays->own[left] = rays->own[k];
            left += label == SST_LABEL_NONE;
        }
        rays->count = left;
    }
}

/* Label of a pixel from the first of the sources from `first` on that shows its surface and has a label there. */
static uint8_t find_label(const struct process_carry *c, const struct sst_view *own, const struct sources *s, int first,
                          struct process_place pixel)
{
    const int d = sst_map_u16_row(&own->disp, pixel.y)[pixel.x];

    for (int i = first; i < s->n; i++) {
        const struct sst_view *there = &c->lf->views[s->at[i].view];
        const struct process_place at = process_place_in(&s->at[i], pixel.x, pixel.y, d);
        const uint8_t label = process_shows(there, own, pixel, d, at) ? sst_map_u8_row(&there->label, at.y)[at.x]
                                                                      : (uint8_t)SST_LABEL_NONE;

        if (label != SST_LABEL_NONE)
            return label;
    }
    return SST_LABEL_NONE;
}

/* Labels of a view whose nearest sources are known: mostly they have a label, and the others are not asked. */
static void gather_known(const struct process_carry *c, int view, const struct gathered *out, const struct sources *s)
{
    const struct sst_view *own = &c->lf->views[view];
    const int n = s->n;
    struct process_way way[SOURCES];

    for (int i = 0; i < n; i++)
        way[i] = process_way_to(&s->at[i]);
    for (int y = 0; y < out->label->height; y++) {
        const uint16_t *d = sst_map_u16_row(&own->disp, y);
        const uint8_t *nearest = sst_map_u8_row(out->source, y);
        uint8_t *to = sst_map_u8_row(out->label, y);

        memset(to, SST_LABEL_NONE, (size_t)out->label->width);
        for (int x = 0; x < out->label->width; x++) {
            const int i = nearest[x];
            struct process_place at;

            if (i < n) {
                at = process_place_by(&way[i], x, y, d[x]);
                to[x] = sst_map_u8_row(&c->lf->views[s->at[i].view].label, at.y)[at.x];
            }
            if (i < n && to[x] == SST_LABEL_NONE)
                to[x] = find_label(c, own, s, i + 1, (struct process_place){ x, y });
        }
    }
}

/* Labels of a view from its sources. @return 0, -ENOMEM */
static int gather_labels(const struct process_carry *c, int view, const struct gathered *out)
{
    const struct sst_view *own = &c->lf->views[view];
    const struct sources sources = sources_of(c, view);
    struct process_rays rays = { 0 };
    const int width = out->label->width;
    int err;

    if (out->known) {
        gather_known(c, view, out, &sources);
        return 0;
    }
    err = process_rays_init(&rays, width);
    for (int y = 0; !err && y < out->label->height; y++) {
        const struct gathered_row to = { sst_map_u8_row(out->label, y),
                                         out->source ? sst_map_u8_row(out->source, y) : NULL,
                                         out->own_entropy ? sst_map_f32_row(out->own_entropy, y) : NULL };

        memset(to.label, SST_LABEL_NONE, (size_t)width);
        if (to.source)
            memset(to.source, sources.n, (size_t)width);
        for (int x = 0; to.entropy && x < width; x++)
            to.entropy[x] = INFINITY;
        process_rays_take(&rays, own, y);
        gather_row(&to, &rays, c, out, &sources);
    }
    process_rays_fini(&rays);
    return err;
}

/* Memory for what is carried to a view. @param spare  or NULL */
static int open_view(const struct job *j, int view, struct sst_map_f32 *spare)
{
    const struct sst_lightfield *lf = j->c->lf;
    int err;

    sst_map_u8_fini(&lf->views[view].label);
    err = sst_map_u8_init(&lf->views[view].label, lf->width, lf->height);
    if (spare && spare->data) {
        j->entropy[view] = *spare;
        *spare = (struct sst_map_f32){ 0 };
        return err;
    }
    return err || !j->entropy ? err : sst_map_f32_init(&j->entropy[view], lf->width, lf->height);
}

static int carry_view(const struct job *j, int view, struct sst_map_f32 *spare)
{
    struct sst_view *own = &j->c->lf->views[view];
    struct sst_map_u8 *source = j->c->source ? &j->c->source[view] : NULL;
    struct gathered gathered;
    int err = open_view(j, view, spare);

    gathered = (struct gathered){ .label = &own->label,
                                  .own_entropy = j->entropy ? &j->entropy[view] : NULL,
                                  .source = source,
                                  .known = source && source->data,
                                  .packed = j->packed };
    if (!err && source && !source->data)
        err = sst_map_u8_init(source, own->label.width, own->label.height);
    err = err ? err : gather_labels(j->c, view, &gathered);
    return !err && j->fill ? process_fill_labels(own) : err;
}

static int carry_job(void *arg, int index, int worker)
{
    const struct job *j = arg;
    const int view = j->view[index];
    struct sst_map_f32 *spare = j->spare ? &j->spare[worker] : NULL;
    int err = carry_view(j, view, spare);

    if (j->c->then)
        err = err ? err : j->c->then(j->c->arg, view);
    if (spare) {
        sst_map_f32_fini(spare);
        *spare = j->entropy[view];
        j->entropy[view] = (struct sst_map_f32){ 0 };
    }
    return err;
}

static int pack_job(void *arg, int view, int worker SST_UNUSED)
{
    const struct job *j = arg;

    if (!j->c->lf->views[view].present || j->c->carried[view])
        return 0;
    j->packed[view] = process_rays_pack(&j->c->lf->views[view], j->entropy ? &j->entropy[view] : NULL);
    return j->packed[view] ? 0 : -ENOMEM;
}

/* Pack all sources, if one of the `count` views needs them. */
static int pack_sources(struct job *j, int count)
{
    const int views = j->c->lf->rows * j->c->lf->cols;
    bool needed = false;

    for (int i = 0; i < count; i++)
        needed |= !(j->c->source && j->c->source[j->view[i]].data);
    if (!needed)
        return 0;
    j->packed = calloc((size_t)views, sizeof(*j->packed));
    return j->packed ? sst_parallel_for(views, j->c->threads, pack_job, j) : -ENOMEM;
}

static void unpack_sources(struct job *j)
{
    for (int k = 0; j->packed && k < j->c->lf->rows * j->c->lf->cols; k++)
        sst_mem_free(j->packed[k]);
    free(j->packed);
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
    struct job j = { .c = c, .entropy = entropy, .fill = fill, .view = calloc((size_t)views, sizeof(*j.view)) };
    const int spares = c->then && entropy ? sst_max_int(c->threads, 1) : 0;
    int count = 0, err = j.view ? 0 : -ENOMEM;

    if (spares) {
        j.spare = calloc((size_t)spares, sizeof(*j.spare));
        err = j.spare ? err : -ENOMEM;
    }
    for (int k = 0; !err && k < views; k++) {
        if (c->lf->views[k].present && c->carried[k])
            j.view[count++] = k;
    }
    err = err ? err : pack_sources(&j, count);
    err = err ? err : sst_share_for(c->share, count, c->threads, carry_job, &j, carried_maps);
    unpack_sources(&j);
    for (int i = 0; j.spare && i < spares; i++)
        sst_map_f32_fini(&j.spare[i]);
    free(j.spare);
    free(j.view);
    return err;
}

/* Labels of a view from its sources, which are packed for it alone. */
static int gather_one(const struct process_carry *c, int view, struct sst_map_u8 *label)
{
    const int views = c->lf->rows * c->lf->cols;
    const struct sources sources = sources_of(c, view);
    uint64_t **packed = calloc((size_t)views, sizeof(*packed));
    int err = packed ? 0 : -ENOMEM;

    for (int i = 0; i < sources.n && !err; i++) {
        const int of = sources.at[i].view;

        packed[of] = process_rays_pack(&c->lf->views[of], NULL);
        err = packed[of] ? 0 : -ENOMEM;
    }
    err = err ? err : gather_labels(c, view, &(struct gathered){ .label = label, .packed = packed });
    for (int i = 0; packed && i < sources.n; i++)
        sst_mem_free(packed[sources.at[i].view]);
    free(packed);
    return err;
}

int process_carry_error(const struct process_carry *c, int view, double *percent)
{
    const struct sst_lightfield *lf = c->lf;
    struct sst_map_u8 gathered = { 0 };
    int64_t n = 0, off = 0;
    int err = sst_map_u8_init(&gathered, lf->width, lf->height);

    err = err ? err : gather_one(c, view, &gathered);
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
