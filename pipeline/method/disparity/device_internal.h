/* pipeline/method/disparity/device_internal.h - shaders of the steps of matching, and why they cannot do a job. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_METHOD_DISPARITY_DEVICE_INTERNAL_H
#define SST_PIPELINE_METHOD_DISPARITY_DEVICE_INTERNAL_H

#include "pipeline/method/disparity/disparity_internal.h"

sst_step_dispatch_fn dispatch_features, dispatch_match, dispatch_compare, dispatch_check, dispatch_fill,
    dispatch_background, dispatch_carry, dispatch_sweep, dispatch_surfaces, dispatch_subpixel;
sst_step_derive_fn visible_derive, subpixel_derive;
/** Write a plane of a view that a conversion derives of its colours and map. */
void device_derive(struct sst_run *r, const struct sst_visible_views *in, int k, uint32_t conversion,
                   struct sst_gpu_range to);
const char *match_refuses(const void *batch);
const char *compare_refuses(const void *compared);

#endif
