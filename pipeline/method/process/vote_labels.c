/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdlib.h>

#include "pipeline/lightfield/share.h"
#include "pipeline/method/process/process_internal.h"

#define SOURCES 4 /* nearest views that vote beside the view itself */

struct vote {
    const struct sst_lightfield *lf;
    const bool *skip;       /* or NULL */
    struct sst_map_u8 *out; /* [views] */
    int *view;              /* of voters */
    bool votes[SST_MAX_VIEWS];
};

static bool votes(const struct vote *v, int view)
{
    const struct sst_view *at = &v->lf->views[view];

    return at->present && at->label.data && at->disp.data && !(v->skip && v->skip[view]);
}

/* A voter, and where pixels of the own view lie there. */
struct ballot {
    const struct sst_view *there;
    struct process_way way;
};

/* The label where a voter would show the surface of pixel (x, y), whether it does or not. @param at  out */
static inline uint8_t label_there(const struct ballot *b, int x, int y, int d, struct process_place *at)
{
    const struct sst_map_u8 *label = &b->there->label;

    *at = process_place_by(&b->way, x, y, d);
    return (unsigned)at->x < (unsigned)label->width && (unsigned)at->y < (unsigned)label->height
               ? sst_map_u8_row(label, at->y)[at->x]
               : (uint8_t)SST_LABEL_NONE;
}

/* The label with most votes of those that see the surface of pixel (x, y) and have a label there; the own one where it
 * has as many as another, then that of the nearer voter. */
static uint8_t elect(const struct ballot *ballot, int n, const struct sst_view *own, struct process_place pixel)
{
    const int x = pixel.x, y = pixel.y, d = sst_map_u16_row(&own->disp, y)[x];
    const uint8_t mine = sst_map_u8_row(&own->label, y)[x];
    uint8_t there[SOURCES], label[SOURCES + 1] = { mine };
    int count[SOURCES + 1] = { mine != SST_LABEL_NONE }, labels = 1, best = 0;
    struct process_place at[SOURCES];
    bool differ = false;

    for (int i = 0; i < n; i++) {
        there[i] = label_there(&ballot[i], x, y, d, &at[i]);
        differ |= there[i] != mine && there[i] != SST_LABEL_NONE;
    }
    if (!differ) /* whoever sees it */
        return mine;
    for (int i = 0; i < n; i++) {
        int k = 0;

        if (there[i] == SST_LABEL_NONE || !process_shows(ballot[i].there, own, pixel, d, at[i]))
            continue;
        while (k < labels && label[k] != there[i])
            k++;
        if (k == labels) {
            label[labels] = there[i];
            count[labels++] = 0;
        }
        count[k]++;
        if (k == 0 && 2 * count[0] > n + 1) /* the others cannot win any more */
            return mine;
    }
    for (int k = 1; k < labels; k++)
        best = count[k] > count[best] ? k : best;
    return label[best];
}

static int vote_job(void *arg, int index, int worker SST_UNUSED)
{
    const struct vote *v = arg;
    const int view = v->view[index];
    const struct sst_view *own = &v->lf->views[view];
    struct process_source voter[SOURCES];
    struct ballot ballot[SOURCES];
    int n, err;

    n = process_nearest(v->lf, view, v->votes, SOURCES, voter);
    for (int i = 0; i < n; i++)
        ballot[i] = (struct ballot){ &v->lf->views[voter[i].view], process_way_to(&voter[i]) };
    err = sst_map_u8_init(&v->out[view], own->label.width, own->label.height);
    for (int y = 0; !err && y < own->label.height; y++) {
        const uint16_t *d = sst_map_u16_row(&own->disp, y);
        const uint8_t *valid = own->valid.data ? sst_map_u8_row(&own->valid, y) : NULL;
        const uint8_t *from = sst_map_u8_row(&own->label, y);
        uint8_t *to = sst_map_u8_row(&v->out[view], y);

        for (int x = 0; x < own->label.width; x++)
            to[x] = d[x] == SST_DISP_NONE || (valid && !valid[x])
                        ? from[x]
                        : elect(ballot, n, own, (struct process_place){ x, y });
    }
    return err;
}

static void elected_map(void *arg, int index, struct sst_share_maps *out)
{
    const struct vote *v = arg;

    sst_share_add_u8(out, &v->out[v->view[index]]);
}

int process_vote_labels(struct sst_lightfield *lf, const bool *skip, struct sst_share *share, int threads)
{
    const int views = lf->rows * lf->cols;
    struct vote v = { lf, skip, calloc((size_t)views, sizeof(*v.out)), calloc((size_t)views, sizeof(*v.view)) };
    int count = 0, err = v.out && v.view ? 0 : -ENOMEM;

    for (int k = 0; !err && k < views; k++) {
        v.votes[k] = votes(&v, k);
        if (v.votes[k])
            v.view[count++] = k;
    }
    err = err ? err : sst_share_for(share, count, threads, vote_job, &v, elected_map);
    for (int k = 0; v.out && k < views; k++) {
        if (!err && v.out[k].data) {
            sst_map_u8_fini(&lf->views[k].label);
            lf->views[k].label = v.out[k];
        } else {
            sst_map_u8_fini(&v.out[k]);
        }
    }
    free(v.view);
    free(v.out);
    return err;
}
