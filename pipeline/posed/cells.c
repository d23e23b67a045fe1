/* Cells of views inside a virtual camera's picture: weights of other rays are not needed. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "base/mem.h"
#include "base/thread.h"
#include "pipeline/posed/surface_internal.h"

#define MARGIN 2 /* px, and steps of the virtual camera's pixels, around places that it sees */
#define BORDER 1 /* of the virtual camera's pixels, around its picture */
#define BEYOND 2 /* px of a picture beside its grey one: its last columns and rows, and half a pixel */
#define LONE   4 /* px around a place without neighbours */

struct find_job {
    struct layer_cells *out;
    const struct greys *greys;
    struct warp *warp; /* [threads] of the virtual camera, with pixels about as large as the grey pictures' */
    struct warp_rows *rows;
};

static int cell_of(int64_t q16, int cells)
{
    return (int)(q16 < 0 ? 0 : sst_min_int((int)(q16 >> 16) / WARP_CELL, cells - 1));
}

/* px that a picture reaches beyond its grey one without distortion, where the border's weights go on. */
static int reach_of(const struct sst_calib_camera *cam, int width, int height)
{
    const double most = sst_max_int(width, height);
    double reach = BEYOND;

    for (int i = 0; i < 9 && cam->lens; i++) {
        const double x = i % 3 * (width - 1) / 2.0, y = i / 3 * (height - 1) / 2.0;
        double a, b;

        if (!sst_camera_undistort(cam, x, y, &a, &b))
            return (int)most;
        reach = fmax(reach, BEYOND + fmax(fabs(cam->fx * a + cam->cx - x), fabs(cam->fy * b + cam->cy - y)));
    }
    return (int)fmin(ceil(reach), most);
}

/* @param before  px that places are counted from, left of and above the grey picture */
static void mark(struct layer_cells *out, const struct sst_warped_segment *s, int before)
{
    const int64_t from[2] = { s->x_q16 - before * 65536LL, s->y_q16 - before * 65536LL }, step[2] = { s->dx_q16, s->dy_q16 };
    const int64_t pitch = llabs(step[0]) + llabs(step[1]);
    const int64_t margin = s->n > 1 ? MARGIN * (65536 + pitch) : LONE * 65536;
    const int count[2] = { out->across, out->bands };
    int lo[2], hi[2];

    for (int k = 0; k < 2; k++) {
        const int64_t end = from[k] + (s->n - 1) * step[k];

        lo[k] = cell_of((end < from[k] ? end : from[k]) - margin, count[k]);
        hi[k] = cell_of((end < from[k] ? from[k] : end) + margin, count[k]);
    }
    for (int band = lo[1]; band <= hi[1]; band++) {
        for (int cell = lo[0]; cell <= hi[0]; cell++)
            out->cell[band * out->across + cell] = 1;
    }
}

static int find_cells(void *arg, int index, int worker)
{
    const struct find_job *job = arg;
    struct sst_calib_camera camera = job->greys->camera[index];
    struct warp *warp = &job->warp[worker];
    struct warp_rows *rows = &job->rows[worker];
    struct layer_cells cells = { .across = (job->greys->width + WARP_CELL - 1) / WARP_CELL,
                                 .bands = (job->greys->height + WARP_CELL - 1) / WARP_CELL };
    struct warp_view view;
    const int reach = reach_of(&camera, job->greys->width, job->greys->height);
    bool any = false;

    camera.lens = 0;
    camera.cx += reach;
    camera.cy += reach;
    view = warp_view_of(&warp->camera, &camera, job->greys->width + 2 * reach, job->greys->height + 2 * reach);
    cells.cell = calloc((size_t)cells.across * (size_t)cells.bands, 1);
    if (!cells.cell)
        return -ENOMEM;
    for (int band = 0; band < warp->bands; band++) {
        warp_band(rows, warp, &view, band);
        for (int r = 0; r < WARP_CELL; r++) {
            for (int i = 0; i < rows->segments[r]; i++)
                mark(&cells, &rows->segment[r][i], reach);
            any |= rows->segments[r] > 0;
        }
    }
    if (!any) {
        free(cells.cell);
        cells.cell = NULL;
    }
    job->out[index] = cells;
    return 0;
}

/* The camera with larger pixels, that cover its picture and a border: of some views it sees less than such a pixel. */
static struct sst_virtual with_border(const struct sst_virtual *camera, int step)
{
    struct sst_virtual v = sst_virtual_scaled(camera, step);

    v.width = (camera->width + step - 1) / step + 2 * BORDER;
    v.height = (camera->height + step - 1) / step + 2 * BORDER;
    v.cx += BORDER;
    v.cy += BORDER;
    return v;
}

int layer_cells_find(struct layer_cells out[], const struct greys *greys, const struct sst_virtual *camera,
                     const struct sst_surface *surface, int threads)
{
    const struct sst_virtual small = with_border(camera, greys->step);
    struct find_job job = { .out = out, .greys = greys };
    int err = 0;

    job.warp = calloc((size_t)threads, sizeof(*job.warp));
    job.rows = calloc((size_t)threads, sizeof(*job.rows));
    if (!job.warp || !job.rows)
        err = -ENOMEM;
    for (int i = 0; i < threads && !err; i++) {
        err = warp_init(&job.warp[i], &small, surface);
        err = err ? err : warp_rows_init(&job.rows[i], &job.warp[i]);
    }
    err = err ? err : sst_parallel_for(greys->count, threads, find_cells, &job);
    for (int i = 0; i < threads && job.warp && job.rows; i++) {
        warp_fini(&job.warp[i]);
        warp_rows_fini(&job.rows[i]);
    }
    free(job.warp);
    free(job.rows);
    return err;
}
