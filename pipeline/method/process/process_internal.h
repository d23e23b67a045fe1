/* pipeline/method/process/process_internal.h - which views are labelled; labels carried from them to the others, and
 * voted on. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_METHOD_PROCESS_PROCESS_INTERNAL_H
#define SST_PIPELINE_METHOD_PROCESS_PROCESS_INTERNAL_H

#include <stdlib.h>
#include <string.h>

#include "pipeline/kernels/kernels.h"
#include "pipeline/lightfield/lightfield.h"
#include "pipeline/lightfield/shift.h"

struct sst_share;

#define PROCESS_SAME_Q6 64 /* 1/64 px: disparities of one surface differ by at most this */
#define PROCESS_SIMILAR 24 /* levels: colours of one surface differ by at most this in every channel */

/* px; views in which a pixel may be farther away are not asked: numbers of 32 bits hold their places (rays.c) */
#define PROCESS_REACH_MOST 32767.0

struct process_place {
    int x, y;
};

/** Another view: its labels are wanted. */
struct process_source {
    int view;
    struct sst_shift across, down; /* from a view's pixels to the other view's */
};

#define PROCESS_SOURCES 8

/** The nearest views other than the view itself, the nearest first, within PROCESS_REACH_MOST.
 * @param of  [views] false: not that view @param most  PROCESS_SOURCES at most @return their number */
int process_nearest(const struct sst_lightfield *lf, int view, const bool *of, int most, struct process_source *out);

/** Where another view would show the surface of pixel (x, y), whose stored disparity is d. */
static inline struct process_place process_place_in(const struct process_source *s, int x, int y, int d)
{
    return (struct process_place){ sst_shifted(x, s->across, d), sst_shifted(y, s->down, d) };
}

/** The same for many pixels. */
struct process_way {
    int32_t whole[2], part[2], step[2]; /* sst_shift_parts(), across and down */
};

static inline struct process_way process_way_to(const struct process_source *s)
{
    struct process_way w;

    sst_shift_parts(s->across, &w.whole[0], &w.part[0], &w.step[0]);
    sst_shift_parts(s->down, &w.whole[1], &w.part[1], &w.step[1]);
    return w;
}

static inline struct process_place process_place_by(const struct process_way *w, int x, int y, int d)
{
    return (struct process_place){ x + w->whole[0] + ((w->part[0] + d * w->step[0]) >> 16),
                                   y + w->whole[1] + ((w->part[1] + d * w->step[1]) >> 16) };
}

static inline bool process_similar(const struct sst_image *a, struct process_place at_a, const struct sst_image *b,
                                   struct process_place at_b)
{
    for (int c = 0; c < 3; c++) {
        if (abs(sst_image_row(a, c, at_a.y)[at_a.x] - sst_image_row(b, c, at_b.y)[at_b.x]) > PROCESS_SIMILAR)
            return false;
    }
    return true;
}

/** Does a view show the surface of a pixel, disparity d, of another one? @param at  process_place_in() */
static inline bool process_shows(const struct sst_view *there, const struct sst_view *own, struct process_place pixel,
                                 int d, struct process_place at)
{
    return (unsigned)at.x < (unsigned)own->image.width && (unsigned)at.y < (unsigned)own->image.height &&
           abs(sst_map_u16_row(&there->disp, at.y)[at.x] - d) <= PROCESS_SAME_Q6 &&
           process_similar(&own->image, pixel, &there->image, at);
}

/** A pixel that has a disparity and lies inside the raw frame. */
static inline bool process_is_seen(const struct sst_view *v, int x, int y)
{
    return sst_map_u16_row(&v->disp, y)[x] != SST_DISP_NONE && (!v->valid.data || sst_map_u8_row(&v->valid, y)[x]);
}

/** Pixels of a row of a view that are looked for in other views. Zeroed: empty. */
struct process_rays {
    uint64_t *own;  /* [count] SST_RAY_ */
    int32_t *at;    /* [count] where the last view shows them: row << 16 | column; -1: it does not */
    uint8_t *label; /* [count] that it has there, or SST_LABEL_NONE */
    int count, y;
};

/** Memory for rows of a width. @return 0, -ENOMEM */
SST_MUST_CHECK int process_rays_init(struct process_rays *r, int width);
void process_rays_fini(struct process_rays *r);

/** The pixels of row y for which process_is_seen(). */
void process_rays_take(struct process_rays *r, const struct sst_view *own, int y);

/** A view's colours, disparities and labels for process_rays_find(), and entropies for process_ray_entropy() in place
 * of the columns. @param entropy  or NULL @return sst_mem_free() it; NULL: no memory */
uint64_t *process_rays_pack(const struct sst_view *v, const struct sst_map_f32 *entropy);

/** The entropy of a packed ray: the upper half of the float, rounded. */
static inline float process_ray_entropy(uint64_t ray)
{
    const uint32_t bits = (uint32_t)(ray >> SST_RAY_COLUMN) << 16;
    float v;

    memcpy(&v, &bits, sizeof(v));
    return v;
}

/** Set r->at and r->label: where a view shows the surfaces, as process_place_in() and process_shows().
 *  @param packed  of the view `there` @param s  of that view, nearer than PROCESS_REACH_MOST */
void process_rays_find(struct process_rays *r, const struct sst_view *there, const uint64_t *packed,
                       const struct process_source *s);

/**
 * Choose the views that the network labels: the reference view, then each time the one that shows most of what those
 * before it do not, until one more would show little, or a third of the views are labelled; then those farthest from
 * all chosen ones, up to `least`; then views of which hardly anything is shown. A surface is shown where disparity and
 * colour are those of the pixel.
 *
 * @param lf       images and disparities of all present views, the reference view among them
 * @param carried  out, [views] true: not labelled; absent views are
 * @param labelled  out, number of the others
 * @return 0, -ENOMEM. The same choice for any number of threads.
 */
SST_MUST_CHECK int process_choose_labelled(bool *carried, int *labelled, const struct sst_lightfield *lf, int least,
                                           int threads);

/**
 * Share of the samples that a labelled view and another one label differently, of those that both show and label with
 * certainty: network and maps agree where it is small.
 *
 * @param entropy  [views] of the labels, which are certain below eps_h; NULL: all that there are
 * @return 0..1; 0 where no surface is labelled twice
 */
double process_labels_differ(const struct sst_lightfield *lf, const bool *carried, const struct sst_map_f32 *entropy,
                             double eps_h);

/** What is done with a view's labels and entropies once they are carried, by the thread that carried them; the
 * entropies are gone afterwards. @return 0, -ENOMEM */
typedef int process_carried_fn(void *arg, int view);

/** Labels carried from labelled views to others. */
struct process_carry {
    struct sst_lightfield *lf; /* disparities of all present views, labels of the labelled views */
    const bool *carried;       /* [views] the others */
    struct sst_share *share;   /* with other processes, by views; or NULL */
    int threads;
    struct sst_map_u8 *source; /* [views], zeroed, the caller's: filled by the first process_carry_labels(), for later
                                  ones of the same disparities; it frees the maps. NULL: not kept */
    process_carried_fn *then;  /* or NULL; without `share` */
    void *arg;
};

/**
 * Give the carried views the labels of the labelled ones: each pixel gets that of the place where its disparity puts
 * it, in the nearest of eight labelled views that shows the same surface (disparity within a pixel, colours alike) and
 * has a label there; else none. views[].label of them is made here.
 *
 * @param entropy  [views] of the labels, made here for the carried views, infinite where they have none; or NULL
 * @param fill     then process_fill_labels() does the rest; entropy is NULL
 * @return 0, -ENOMEM
 */
SST_MUST_CHECK int process_carry_labels(const struct process_carry *c, struct sst_map_f32 *entropy, bool fill);

/**
 * Give the pixels of a view that have no label one of its labelled pixels: of the first ones that are met in the row,
 * the column and the two diagonals, up to PROCESS_FILL_REACH pixels away, the one of the most similar colour (sum of
 * the channels' differences), then of the nearest disparity, among those within a quarter of the view's span of
 * disparities, or among all if none is; where none is that near, the label of the labelled pixel to
 * the left or right in the row whose disparity is nearer. Pixels that are not valid get none.
 *
 * @param v  label, disp and image
 * @return 0, -ENOMEM
 */
SST_MUST_CHECK int process_fill_labels(struct sst_view *v);

#define PROCESS_FILL_REACH 64

/** Percent of a labelled view's labels that differ from those that the others carry to it, where there are both.
 *  NaN: none to compare. */
SST_MUST_CHECK int process_carry_error(const struct process_carry *c, int view, double *percent);

/**
 * Let the views vote about the label of every surface: each pixel gets the label that most of its own view and the
 * nearest four others see there (disparity within a pixel, colours alike). Its own counts where as many see it as
 * another; one without a label gets that of the others.
 *
 * @param skip    [views] these neither vote nor change; NULL: none
 * @param share   with other processes, by views; or NULL
 * @return 0, -ENOMEM; then nothing has changed. The same bytes for any number of threads.
 */
SST_MUST_CHECK int process_vote_labels(struct sst_lightfield *lf, const bool *skip, struct sst_share *share,
                                       int threads);

#endif
