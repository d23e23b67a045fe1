/* Cells of views inside a virtual camera's picture: weights of other rays are not needed. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdlib.h>

#include "base/mem.h"
#include "base/thread.h"
#include "pipeline/posed/surface_internal.h"

#define MARGIN 2 /* px, and steps of the virtual camera's pixels, around places that it sees */
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

static void mark(struct layer_cells *out, const struct sst_warped_segment *s)
{
    const int64_t from[2] = { s->x_q16, s->y_q16 }, step[2] = { s->dx_q16, s->dy_q16 };
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
    bool any = false;

    camera.lens = 0;
    view = warp_view_of(&warp->camera, &camera, job->greys->width, job->greys->height);
    cells.cell = calloc((size_t)cells.across * (size_t)cells.bands, 1);
    if (!cells.cell)
        return -ENOMEM;
    for (int band = 0; band < warp->bands; band++) {
        warp_band(rows, warp, &view, band);
        for (int r = 0; r < WARP_CELL; r++) {
            for (int i = 0; i < rows->segments[r]; i++)
                mark(&cells, &rows->segment[r][i]);
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

int layer_cells_find(struct layer_cells out[], const struct greys *greys, const struct sst_virtual *camera,
                     const struct sst_surface *surface, int threads)
{
    const struct sst_virtual small = sst_virtual_scaled(camera, greys->step);
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
