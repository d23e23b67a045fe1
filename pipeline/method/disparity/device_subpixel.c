/* Refinement between pixels on a device. */
#include "pipeline/gpu/convert.h"
#include "pipeline/gpu/subpixel.h"
#include "pipeline/method/disparity/device_internal.h"
#include "pipeline/method/disparity/subpixel_internal.h"

/* Lumas, packed as the CPU does. */
void subpixel_derive(struct sst_run *r, void *job, int k, struct sst_gpu_range to)
{
    device_derive(r, ((const struct subpixel_pass *)job)->in, k, SST_GPU_TO_LUMA, to);
}

/* Lumas of a view and of its neighbours. @param views  out, places and offsets of the neighbours */
static struct sst_gpu_range load_lumas(struct sst_run *r, const struct subpixel_pass *p, int k,
                                       struct sst_subpixel_fit *f, struct sst_gpu_range *views)
{
    struct sst_gpu_subpixel_view view[SST_SUBPIXEL_VIEWS] = { { 0 } };
    int index[1 + SST_SUBPIXEL_VIEWS] = { k };
    struct sst_gpu_range lumas;

    subpixel_set_fit(f, p, k, index + 1);
    lumas = sst_run_planes(r, SST_PLANE_DERIVED, index, 1 + f->views);
    for (int i = 0; i < f->views; i++) {
        const struct sst_subpixel_view *v = &f->view[i];

        view[i] =
            (struct sst_gpu_subpixel_view){ v->x,    v->y,      v->dx,
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
    const size_t n = (size_t)width * (size_t)height, pairs = n * sizeof(struct sst_gpu_subpixel_weight);
    const struct sst_gpu_subpixel_window window = {
        width, height, SUBPIXEL_SIMILAR, SUBPIXEL_APART / 64.0f, SUBPIXEL_FEW, SUBPIXEL_ENOUGH
    };
    struct sst_gpu_subpixel_planes planes = {
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
    struct sst_gpu_subpixel_fit push = { width,       height,          f.views, sst_run_first(r, SST_PLANE_DERIVED, k),
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
