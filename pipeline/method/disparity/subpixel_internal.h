/* pipeline/method/disparity/subpixel_internal.h - the refinement between pixels: its constants, its job. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_METHOD_DISPARITY_SUBPIXEL_INTERNAL_H
#define SST_PIPELINE_METHOD_DISPARITY_SUBPIXEL_INTERNAL_H

#include "pipeline/method/disparity/disparity_internal.h"

#define SUBPIXEL_MOST       20   /* 1/64 px: farthest from the first pass's answer */
#define SUBPIXEL_SIMILAR    24   /* levels: pixels of a window that count ... */
#define SUBPIXEL_APART      14   /* ... and 1/64 px from the middle's plane */
#define SUBPIXEL_WIDE_APART 12   /* the same for the large windows */
#define SUBPIXEL_FEW        10.f /* weight of the pixel's own answer: noise where there is no texture */
#define SUBPIXEL_ENOUGH     1e5f /* weight from which on a window does not follow the large one around it */

struct subpixel_packed {
    uint32_t *memory, *pixels; /* pixels: (0, 0) */
    ptrdiff_t stride;
};

struct subpixel_planes;

struct subpixel_pass {
    const struct sst_visible_views *in;
    int steps, views;
    int gain_step;                  /* pixels between the places at which gains are measured */
    struct subpixel_packed *view;   /* [in->count] */
    struct sst_map_u16 *out;        /* [in->count]; without memory: not refined */
    struct subpixel_planes *planes; /* [threads] made by the first view of a thread */
    int threads;
    struct disparity_sample *sample; /* that these are of; or NULL */
};

/** Views that view k is compared with. @param nearest  out [SST_SUBPIXEL_VIEWS]: their numbers */
void subpixel_set_fit(struct sst_subpixel_fit *f, const struct subpixel_pass *p, int k, int *nearest);

#endif
