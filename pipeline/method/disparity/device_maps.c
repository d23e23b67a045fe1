/* Maps of views on a device: carried to other views, checked, filled. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/gpu/check.h"
#include "pipeline/method/disparity/device_internal.h"

/* Views that a view is checked against or filled from. */
struct neighbours {
    int count, near;
    struct sst_gpu_range maps;                            /* with the view's own */
    uint32_t first;                                       /* where that begins */
    struct sst_gpu_check_other other[SST_MAX_NEIGHBOURS]; /* where the others begin, and how far pixels move */
};

/* @param sign  1: disparities move pixels from the view to the others; -1: from them to it */
static void load_maps(struct neighbours *to, struct sst_run *r, const struct disparity_run *run, int view, int sign)
{
    int index[SST_MAX_NEIGHBOURS + 1] = { view };
    struct sst_checked_views from;

    run_checked_views(run, view, &from);
    for (int i = 0; i < from.count; i++)
        index[i + 1] = (int)(from.view[i].disp_q6 - run->disp);
    *to = (struct neighbours){ .count = from.count, .near = from.near };
    to->maps = sst_run_planes(r, SST_PLANE_MAP, index, from.count + 1);
    to->first = sst_run_first(r, SST_PLANE_MAP, view);
    for (int i = 0; i < from.count; i++) {
        to->other[i].first = sst_run_first(r, SST_PLANE_MAP, index[i + 1]);
        sst_run_fail(r, sst_step_shift(&to->other[i].shift, sst_shift_by(sign * from.view[i].bx, run->disp_min),
                                       sst_shift_by(sign * from.view[i].by, run->disp_min)));
    }
}

void dispatch_check(struct sst_run *r, void *job, int view)
{
    struct disparity_run *run = job;
    struct sst_gpu_check push = { .width = run->width,
                                  .height = run->height,
                                  .steps = run->carried ? 0 : run->range + 1 };
    struct neighbours from;
    const uint32_t *words;

    sst_map_u8_fini(&run->status[view]);
    sst_run_fail(r, sst_map_u8_init(&run->status[view], run->width, run->height));
    if (run_is_carried(run, view))
        return;
    load_maps(&from, r, run, view, -1);
    push.own = from.first;
    push.count = from.count;
    SST_RUN_PIXELS(r, SST_GPU_CHECK, &push, run->width, run->height, 1,
                   sst_run_upload(r, 0, from.other, (size_t)sst_max_int(from.count, 1) * sizeof(*from.other)),
                   from.maps);
    words = sst_run_fetch(r, sst_run_plane(r, SST_PLANE_MAP, view), (size_t)run->width * (size_t)run->height);
    if (words)
        sst_step_map_unpack(words, NULL, NULL, NULL, &run->status[view]);
}

/* Continue the background into pixels of a map that no view shows, into the plane of a view. @param scratch  of a
 * map's size */
static void fill_last(struct sst_run *r, struct sst_gpu_range map, struct sst_gpu_range scratch, int view,
                      const struct sst_gpu_background *push)
{
    SST_RUN_PIXELS(r, SST_GPU_FILL_ALONG, push, push->width, push->height, 1, map, scratch);
    SST_RUN_PIXELS(r, SST_GPU_FILL_DOWN, push, push->width, push->height, 1, scratch,
                   sst_run_output(r, SST_PLANE_MAP, view));
}

void dispatch_fill(struct sst_run *r, void *job, int view)
{
    enum { FILLED, ARRIVED };
    struct disparity_run *run = job;
    const int width = run->width, height = run->height;
    const size_t n = (size_t)width * (size_t)height;
    const struct sst_gpu_background background = { width, height, SST_DISP_NONE };
    struct sst_gpu_fill push = { width, height, 0 };
    struct sst_gpu_range filled, arrived;
    struct neighbours from;
    const uint32_t *words;

    load_maps(&from, r, run, view, 1);
    push.own = from.first;
    filled = sst_run_scratch(r, FILLED, n * sizeof(uint32_t));
    arrived = sst_run_scratch(r, ARRIVED, n * sizeof(uint32_t));
    SST_RUN_PIXELS(r, SST_GPU_FILL_START, &push, width, height, 1, from.maps, filled, arrived);
    for (int i = 0; i < from.count; i++) {
        const struct sst_gpu_project other = { width, height, from.other[i].first, from.other[i].shift };

        SST_RUN_PIXELS(r, SST_GPU_FILL_PROJECT, &other, width, height, 1, from.maps, arrived);
        if (i + 1 == from.near || i + 1 == from.count)
            SST_RUN_PIXELS(r, SST_GPU_FILL_TAKE, &push, width, height, 1, from.maps, arrived, filled);
    }
    fill_last(r, filled, arrived, view, &background);
    words = sst_run_fetch(r, sst_run_plane(r, SST_PLANE_MAP, view), n);
    sst_map_u16_fini(&run->filled[view]);
    sst_run_fail(r, sst_map_u16_init(&run->filled[view], width, height));
    if (words && !sst_run_failed(r))
        sst_step_map_unpack(words, &run->filled[view], NULL, NULL, NULL);
}

void dispatch_background(struct sst_run *r, void *job, int view)
{
    struct disparity_run *run = job;
    const size_t n = (size_t)run->width * (size_t)run->height;
    const struct sst_gpu_background push = { run->width, run->height, 0 };
    const struct sst_gpu_range map = sst_run_plane(r, SST_PLANE_MAP, view);
    const uint32_t *words;

    fill_last(r, map, sst_run_scratch(r, 0, n * sizeof(uint32_t)), view, &push);
    words = sst_run_fetch(r, map, n);
    if (words)
        sst_step_map_unpack(words, &run->disp[view], NULL, NULL, NULL);
}

/* Constants of carry_project, with a layer of groups per source, and carry_close (std430). Maps are SST_PLANE_MAP. */
struct carry_constants {
    int32_t width, height;
    int32_t agreed;  /* not 0: wanted; else only the first one of `arrived` is used */
    int32_t checked; /* not 0: pixels that the check calls correct come first, and their results are correct */
};

void dispatch_carry(struct sst_run *r, void *job, int k)
{
    enum { SOURCE, ARRIVED, CLOSED };
    const struct carry *c = job;
    const struct sst_visible_view *own = &c->in->view[k];
    const int width = own->disp->width, height = own->disp->height;
    const size_t n = (size_t)width * (size_t)height;
    const struct sst_gpu_background background = { width, height, SST_DISP_NONE };
    const struct carry_constants push = { width, height, own->agreed != NULL, c->status != NULL };
    struct sst_gpu_check_other source[CARRY_SOURCES];
    int from[CARRY_SOURCES];
    const int count = run_carry_sources(c->in, k, from);
    const struct sst_gpu_range maps = sst_run_planes(r, SST_PLANE_MAP, from, sst_max_int(count, 0));
    const struct sst_gpu_range arrived = sst_run_scratch(r, ARRIVED, (own->agreed ? 3 : 1) * n * sizeof(uint32_t));
    const struct sst_gpu_range closed = sst_run_scratch(r, CLOSED, n * sizeof(uint32_t));
    const uint32_t *words;

    sst_run_fail(r, sst_min_int(count, 0));
    for (int i = 0; i < count; i++) {
        const struct sst_visible_view *v = &c->in->view[from[i]];

        source[i].first = sst_run_first(r, SST_PLANE_MAP, from[i]);
        sst_run_fail(r, sst_step_shift(&source[i].shift, sst_shift_by(v->bx - own->bx, c->in->disp_min_px),
                                       sst_shift_by(v->by - own->by, c->in->disp_min_px)));
    }
    sst_run_fill(r, arrived, 0, n, 0);
    if (own->agreed) {
        sst_run_fill(r, arrived, n, n, SST_DISP_NONE);
        sst_run_fill(r, arrived, 2 * n, n, 0);
    }
    if (count > 0)
        SST_RUN_PIXELS(r, SST_GPU_CARRY_PROJECT, &push, width, height, (uint32_t)count,
                       sst_run_upload(r, SOURCE, source, (size_t)count * sizeof(*source)), maps, arrived);
    SST_RUN_PIXELS(r, SST_GPU_CARRY_CLOSE, &push, width, height, 1, arrived, closed);
    fill_last(r, closed, arrived, k, &background);
    words = sst_run_fetch(r, sst_run_plane(r, SST_PLANE_MAP, k), n);
    if (own->agreed && !own->agreed->data)
        sst_run_fail(r, sst_map_u8_init(own->agreed, width, height));
    if (words && !sst_run_failed(r))
        sst_step_map_unpack(words, own->disp, own->confidence, own->agreed, c->status ? &c->status[k] : NULL);
}
