/* Which views the network labels. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "base/thread.h"
#include "pipeline/method/process/process_internal.h"

#define SAMPLES_ALL   7000  /* of all views; a choice takes about 10 ms of 36 views */
#define SAMPLES_MOST  192   /* of a view */
#define SAMPLES_LEAST 48    /* of a view */
#define GAIN_LEAST    0.012 /* share of the samples that one more view must show */
#define VIEWS_SHARE   3     /* a third of the views is chosen at most */
#define SAMPLES_LABEL 768   /* of a view, whose labels are compared */
#define SHOWN_LEAST   0.5   /* of a view's samples; one of which less is shown is labelled as well */

/* Pixels of a view that stand for all. */
struct samples {
    int across, count;
    double step_x, step_y; /* px */
};

struct choice {
    const struct sst_lightfield *lf;
    int views, samples; /* of a view */
    int least;          /* views that are chosen, whatever they show */
    struct samples grid;
    uint8_t *shown; /* [candidate][view][samples] 1: the candidate shows that surface */
    uint8_t *left;  /* [view][samples] 1: no chosen view does */
    int labelled;   /* views that are chosen */
    bool *carried;
};

static struct samples samples_of(const struct sst_lightfield *lf, int wanted)
{
    const double step = fmax(sqrt((double)lf->width * lf->height / wanted), 1);
    const int across = sst_max_int((int)(lf->width / step), 1), down = sst_max_int((int)(lf->height / step), 1);

    return (struct samples){ across, across * down, (double)lf->width / across, (double)lf->height / down };
}

static struct process_place sample_at(const struct samples *s, int i)
{
    return (struct process_place){ (int)((i % s->across + 0.5) * s->step_x), (int)((i / s->across + 0.5) * s->step_y) };
}

static struct process_source seen_from(const struct sst_lightfield *lf, int view, int other)
{
    const struct sst_view *own = &lf->views[view], *there = &lf->views[other];

    return (struct process_source){ other, sst_shift_by(own->bx - there->bx, lf->disp_min_px),
                                    sst_shift_by(own->by - there->by, lf->disp_min_px) };
}

static uint8_t *shown_by(const struct choice *c, int candidate, int view)
{
    return c->shown + ((size_t)candidate * (size_t)c->views + (size_t)view) * (size_t)c->samples;
}

static int count_left(const uint8_t *shown, const uint8_t *left, int n)
{
    int sum = 0;

    for (int i = 0; i < n; i++)
        sum += shown[i] & left[i];
    return sum;
}

/* What a candidate shows of a view. Pixels outside the raw frame need no label. */
static void probe(struct choice *c, int candidate, int view)
{
    const struct sst_lightfield *lf = c->lf;
    const struct sst_view *own = &lf->views[view], *there = &lf->views[candidate];
    const struct process_source to = seen_from(lf, view, candidate);
    uint8_t *shown = shown_by(c, candidate, view);

    for (int i = 0; i < c->samples; i++) {
        const struct process_place at = sample_at(&c->grid, i);
        const int d = sst_map_u16_row(&own->disp, at.y)[at.x];

        if (candidate == view)
            shown[i] = !own->valid.data || sst_map_u8_row(&own->valid, at.y)[at.x];
        else
            shown[i] = process_is_seen(own, at.x, at.y) &&
                       process_shows(there, own, at, d, process_place_in(&to, at.x, at.y, d));
    }
}

static int probe_view(void *arg, int view, int worker SST_UNUSED)
{
    struct choice *c = arg;

    for (int k = 0; c->lf->views[view].present && k < c->views; k++) {
        if (c->lf->views[k].present)
            probe(c, k, view);
    }
    for (int i = 0; i < c->samples; i++)
        c->left[view * c->samples + i] = shown_by(c, view, view)[i];
    return 0;
}

static void choose(struct choice *c, int view)
{
    const uint8_t *shown = shown_by(c, view, 0);

    c->carried[view] = false;
    c->labelled++;
    for (int i = 0; i < c->views * c->samples; i++)
        c->left[i] &= !shown[i];
}

/* The view that shows most of what is left. @return its index, -1: none shows `least` samples, or any */
static int find_best(const struct choice *c, int least)
{
    int best = -1, most = sst_max_int(least - 1, 0);

    for (int k = 0; k < c->views; k++) {
        const int gain = c->carried[k] ? count_left(shown_by(c, k, 0), c->left, c->views * c->samples) : 0;

        if (gain > most) {
            most = gain;
            best = k;
        }
    }
    return best;
}

/* The view that is farthest from all that are chosen: what is wrong there is least likely to be what is wrong here. */
static int find_farthest(const struct choice *c)
{
    double most = -1;
    int best = -1;

    for (int k = 0; k < c->views; k++) {
        const struct sst_view *v = &c->lf->views[k];
        double nearest = INFINITY;

        for (int i = 0; c->carried[k] && v->present && i < c->views; i++) {
            const struct sst_view *other = &c->lf->views[i];

            nearest = c->carried[i] ? nearest : fmin(nearest, hypot(other->bx - v->bx, other->by - v->by));
        }
        if (c->carried[k] && v->present && nearest > most) {
            most = nearest;
            best = k;
        }
    }
    return best;
}

static void choose_all(struct choice *c)
{
    int all = 0, present = 0;

    for (int k = 0; k < c->views; k++) {
        c->carried[k] = true;
        present += c->lf->views[k].present;
        all += count_left(shown_by(c, k, k), shown_by(c, k, k), c->samples);
    }
    choose(c, c->lf->ref_view);
    for (int best = 0; best >= 0 && c->labelled * VIEWS_SHARE < present;) {
        best = find_best(c, (int)ceil(GAIN_LEAST * all));
        if (best < 0 && c->labelled < c->least)
            best = find_farthest(c);
        if (best >= 0)
            choose(c, best);
    }
    for (int k = 0; k < c->views; k++) {
        const uint8_t *own = shown_by(c, k, k);
        const int own_left = count_left(own, c->left + k * c->samples, c->samples);

        if (c->carried[k] && own_left > (1 - SHOWN_LEAST) * count_left(own, own, c->samples))
            choose(c, k);
    }
}

int process_choose_labelled(bool *carried, int *labelled, const struct sst_lightfield *lf, int least, int threads)
{
    const int views = lf->rows * lf->cols;
    struct choice c = { .lf = lf, .views = views, .least = least, .carried = carried };
    int err;

    c.grid = samples_of(lf, sst_clamp_int(SAMPLES_ALL / views, SAMPLES_LEAST, SAMPLES_MOST));
    c.samples = c.grid.count;
    c.shown = calloc((size_t)views * (size_t)views, (size_t)c.samples);
    c.left = calloc((size_t)views, (size_t)c.samples);
    err = c.shown && c.left ? sst_parallel_for(views, threads, probe_view, &c) : -ENOMEM;
    if (!err) {
        choose_all(&c);
        *labelled = c.labelled;
    }
    free(c.shown);
    free(c.left);
    return err;
}

/* The label of a pixel, if it is certain. */
static uint8_t label_of(const struct sst_lightfield *lf, const struct sst_map_f32 *entropy, double eps_h, int view,
                        struct process_place at)
{
    const bool sure = !entropy || (double)sst_map_f32_row(&entropy[view], at.y)[at.x] < eps_h;

    return sure ? sst_map_u8_row(&lf->views[view].label, at.y)[at.x] : SST_LABEL_NONE;
}

double process_labels_differ(const struct sst_lightfield *lf, const bool *carried, const struct sst_map_f32 *entropy,
                             double eps_h)
{
    const struct samples grid = samples_of(lf, SAMPLES_LABEL);
    const int views = lf->rows * lf->cols;
    int64_t n = 0, off = 0;

    for (int pair = 0; pair < views * views; pair++) {
        const int view = pair / views, other = pair % views;
        const struct process_source to = seen_from(lf, view, other);
        const struct sst_view *own = &lf->views[view];

        for (int i = 0; i < grid.count && view != other && !carried[view] && !carried[other]; i++) {
            const struct process_place at = sample_at(&grid, i);
            const int d = sst_map_u16_row(&own->disp, at.y)[at.x];
            const struct process_place there = process_place_in(&to, at.x, at.y, d);
            const uint8_t label = label_of(lf, entropy, eps_h, view, at);
            uint8_t second;

            if (label == SST_LABEL_NONE || d == SST_DISP_NONE || !process_shows(&lf->views[other], own, at, d, there))
                continue;
            second = label_of(lf, entropy, eps_h, other, there);
            n += second != SST_LABEL_NONE;
            off += second != SST_LABEL_NONE && second != label;
        }
    }
    return n ? (double)off / (double)n : 0;
}
