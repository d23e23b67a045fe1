/* Refinement between pixels on a device.
 *
 * Numbers are floats, computed by the operations of subpixel_fit_row, subpixel_window_row and subpixel_plane_row of
 * pipeline/kernels/kernels.h in their order. Sums and products are rounded to the nearest number on every device that
 * passes the comparison with the CPU; quotients are found in whole numbers, as devices may round theirs in other
 * ways. So the results are the bytes of sst_disparity_subpixel(). */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/gpu/convert.h"
#include "pipeline/method/disparity/device_internal.h"
#include "pipeline/method/disparity/subpixel_internal.h"

/* Constants of the shaders, in their layout (std430): groups of 32 x 8 pixels. Disparities are uint32_t[height][width]:
 * the one of this step, SST_SUBPIXEL_NONE if it is not known, and the one that is refined << 16; 1/64 px. */

/* A view to compare with, as struct sst_subpixel_view has it. */
struct gpu_subpixel_view {
    int32_t x, y, dx, dy;
    float bx, by, gain, offset;
    uint32_t first; /* its pixel (0, 0) in the buffer of pixels */
};

/* Weight of a pixel's disparity, and their product, px. */
struct gpu_subpixel_weight {
    float weight, product;
};

/* `subpixel_fit` */
struct gpu_subpixel_fit {
    int32_t width, height, views;
    uint32_t own;        /* the view's pixel (0, 0) */
    int32_t tolerance;   /* struct sst_subpixel_fit */
    float inverse_limit; /* likewise */
    int32_t across;      /* struct sst_subpixel_fit */
};

/* `subpixel_window` */
struct gpu_subpixel_window {
    int32_t width, height;
    int32_t similar; /* struct sst_subpixel_window; nothing outside the view counts */
    float apart;
    float few;    /* weight of the pixel's own disparity */
    float enough; /* few + enough is the most that a weight is stored with */
};

/* `subpixel_plane`: the slopes, and a step's disparities. */
struct gpu_subpixel_planes {
    int32_t width, height;
    int32_t similar;     /* struct sst_subpixel_planes; nothing outside the view counts */
    int32_t start;       /* not 0: slopes become 0, disparities stay */
    int32_t reach, last; /* 1/64 px: from the disparity that is refined, at most; the largest one */
    float apart;
    float enough; /* weight from which on a window does not follow the large one around it */
};

/* Lumas, packed as the CPU does. */
void subpixel_derive(struct sst_run *r, void *job, int k, struct sst_gpu_range to)
{
    device_derive(r, ((const struct subpixel_pass *)job)->in, k, SST_GPU_TO_LUMA, to);
}

/* Lumas of a view and of its neighbours. @param views  out, places and offsets of the neighbours */
static struct sst_gpu_range load_lumas(struct sst_run *r, const struct subpixel_pass *p, int k,
                                       struct sst_subpixel_fit *f, struct sst_gpu_range *views)
{
    struct gpu_subpixel_view view[SST_SUBPIXEL_VIEWS] = { { 0 } };
    int index[1 + SST_SUBPIXEL_VIEWS] = { k };
    struct sst_gpu_range lumas;

    subpixel_set_fit(f, p, k, index + 1);
    lumas = sst_run_planes(r, SST_PLANE_DERIVED, index, 1 + f->views);
    for (int i = 0; i < f->views; i++) {
        const struct sst_subpixel_view *v = &f->view[i];

        view[i] = (struct gpu_subpixel_view){ v->x,    v->y,      v->dx,
                                              v->dy,   v->bx,     v->by,
                                              v->gain, v->offset, sst_run_first(r, SST_PLANE_DERIVED, index[1 + i]) };
    }
    *views = sst_run_upload(r, 0, view, (size_t)sst_max_int(f->views, 1) * sizeof(*view));
    return lumas;
}

void dispatch_subpixel(struct sst_run *r, void *job, int k)
{
    enum { VIEWS, FITS, WINDOWS, SLOPES, DISP };
    struct subpixel_pass *p = job;
    const int width = p->in->view[k].disp->width, height = p->in->view[k].disp->height, last = p->in->range * 64;
    const size_t n = (size_t)width * (size_t)height, pairs = n * sizeof(struct gpu_subpixel_weight);
    const struct gpu_subpixel_window window = { width,        height,         SUBPIXEL_SIMILAR, SUBPIXEL_APART / 64.0f,
                                                SUBPIXEL_FEW, SUBPIXEL_ENOUGH };
    struct gpu_subpixel_planes planes = {
        width, height, SUBPIXEL_SIMILAR, 1, SUBPIXEL_MOST, last, SUBPIXEL_WIDE_APART / 64.0f, SUBPIXEL_ENOUGH
    };
    const struct sst_gpu_convert start = { .width = width, .height = height, .conversion = SST_GPU_TO_STEPS };
    const struct sst_gpu_convert end = { .width = width, .height = height, .conversion = SST_GPU_FROM_PLAIN };
    struct sst_subpixel_fit f;
    struct sst_gpu_range views;
    const struct sst_gpu_range lumas = load_lumas(r, p, k, &f, &views);
    const struct sst_gpu_range colours = sst_run_plane(r, visible_colours(p->in), k);
    const struct sst_gpu_range map = sst_run_plane(r, SST_PLANE_MAP, k);
    const struct sst_gpu_range fits = sst_run_scratch(r, FITS, pairs), shared = sst_run_scratch(r, WINDOWS, pairs);
    const struct sst_gpu_range slopes = sst_run_scratch(r, SLOPES, pairs);
    const struct sst_gpu_range disp = sst_run_scratch(r, DISP, n * sizeof(uint32_t));
    struct gpu_subpixel_fit push = { width,       height,          f.views, sst_run_first(r, SST_PLANE_DERIVED, k),
                                     f.tolerance, f.inverse_limit, 0 };
    const uint32_t *words;

    SST_RUN_PIXELS(r, SST_GPU_CONVERT, &start, width, height, 1, map, map, map, disp);
    SST_RUN_PIXELS(r, SST_GPU_SUBPIXEL_PLANE, &planes, width, height, 1, colours, disp, shared, slopes);
    planes.start = 0;
    for (int i = 0; i < p->steps; i++) {
        push.across = i + 1 < p->steps;
        SST_RUN_PIXELS(r, SST_GPU_SUBPIXEL_FIT, &push, width, height, 1, views, lumas, disp, fits);
        SST_RUN_PIXELS(r, SST_GPU_SUBPIXEL_WINDOW, &window, width, height, 1, colours, disp, fits, slopes, shared);
        SST_RUN_PIXELS(r, SST_GPU_SUBPIXEL_PLANE, &planes, width, height, 1, colours, disp, shared, slopes);
    }
    SST_RUN_PIXELS(r, SST_GPU_CONVERT, &end, width, height, 1, map, map, disp, map);
    words = sst_run_fetch(r, map, n);
    sst_map_u16_fini(&p->out[k]);
    sst_run_fail(r, sst_map_u16_init(&p->out[k], width, height));
    if (words && !sst_run_failed(r))
        sst_step_map_unpack(words, &p->out[k], NULL, NULL, NULL);
}
