/* Small grey pictures of a few views, to compare them on surfaces. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "base/mem.h"
#include "base/thread.h"
#include "pipeline/posed/picture.h"
#include "pipeline/posed/surface_internal.h"

#define LEAST_SIDE 16 /* px: windows of 7 px have some places in it */

/* Sums of columns of `step` rows from y on, a row of a channel each. */
static void sum_columns(uint32_t *columns, const struct sst_deep *in, int y, int step)
{
    const size_t width = (size_t)in->width;

    memset(columns, 0, (size_t)in->channels * width * sizeof(*columns));
    for (int c = 0; c < in->channels; c++) {
        uint32_t *restrict sum = columns + (size_t)c * width;

        for (int i = 0; i < step; i++) {
            const uint16_t *restrict row = sst_map_u16_row(&in->plane[c], y + i);

            for (size_t x = 0; x < width; x++)
                sum[x] += row[x];
        }
    }
}

/* Luma means of blocks of step x step pixels. */
static void block_means(float *out, const uint32_t *columns, const struct sst_deep *in, int step)
{
    static const double luma[3] = { 0.299, 0.587, 0.114 };

    for (int x = 0; x < in->width / step; x++) {
        double block = 0;

        for (int c = 0; c < in->channels; c++) {
            const uint32_t *column = columns + (size_t)c * (size_t)in->width + (size_t)(x * step);
            uint64_t sum = 0;

            for (int i = 0; i < step; i++)
                sum += column[i];
            block += (in->channels == 1 ? 1 : luma[c]) * (double)sum;
        }
        out[x] = (float)(block / (step * step));
    }
}

/* Means of blocks; then mean 32768 and a spread of GREY_SPREAD levels, so that exposures are alike. */
static int make_grey(struct sst_deep *out, const struct sst_deep *in, int step)
{
    const int width = in->width / step, height = in->height / step;
    uint32_t *columns = sst_mem_alloc_raw((size_t)in->channels * (size_t)in->width, sizeof(*columns));
    double sum = 0, squares = 0, count = (double)width * height, scale;
    struct sst_map_f32 mean = { 0 };
    int err = columns ? sst_map_f32_init(&mean, width, height) : -ENOMEM;

    err = err ? err : sst_deep_init(out, width, height, 1, UINT16_MAX);
    for (int y = 0; y < height && !err; y++) {
        float *row = sst_map_f32_row(&mean, y);

        sum_columns(columns, in, y * step, step);
        block_means(row, columns, in, step);
        for (int x = 0; x < width; x++) {
            sum += (double)row[x];
            squares += (double)row[x] * (double)row[x];
        }
    }
    scale = GREY_SPREAD / sqrt(fmax(squares / count - sum / count * (sum / count), 1e-6));
    for (int y = 0; y < height && !err; y++) {
        const float *row = sst_map_f32_row(&mean, y);
        uint16_t *to = sst_map_u16_row(&out->plane[0], y);

        for (int x = 0; x < width; x++) {
            const double v = ((double)row[x] - sum / count) * scale + 32768.5;

            to[x] = (uint16_t)(v < 0 ? 0 : v > UINT16_MAX ? UINT16_MAX : v);
        }
    }
    sst_map_f32_fini(&mean);
    sst_mem_free(columns);
    return err;
}

struct grey_job {
    struct greys *greys;
    const struct sst_posed *posed;
    const char *dir;
    const int *view;
};

static int read_grey(void *arg, int index, int worker SST_UNUSED)
{
    const struct grey_job *job = arg;
    const struct sst_deep *picture;
    struct sst_deep own = { 0 };
    int err;

    if (job->greys->needed && !job->greys->needed[index])
        return 0;
    err = sst_posed_borrow(&picture, &own, job->posed, job->dir, job->view[index]);
    if (!err) {
        err = make_grey(&job->greys->picture[index], picture, job->greys->step);
        if (err)
            sst_log_error("no memory for a smaller picture of view %d", job->view[index]);
    }
    sst_deep_fini(&own);
    return err;
}

int greys_step(const struct sst_posed *posed, int step)
{
    return sst_clamp_int(step, 1, sst_max_int(1, sst_min_int(posed->width, posed->height) / LEAST_SIDE));
}

int greys_cameras(struct greys *out, const struct sst_posed *posed, const int view[])
{
    out->width = posed->width / out->step;
    out->height = posed->height / out->step;
    out->camera = calloc((size_t)out->count, sizeof(*out->camera));
    if (!out->camera) {
        sst_log_error("no memory for the cameras of %d smaller pictures", out->count);
        return -ENOMEM;
    }
    for (int k = 0; k < out->count; k++) {
        struct sst_calib_camera *cam = &out->camera[k];

        *cam = posed->view[view[k]].camera;
        cam->fx /= out->step;
        cam->fy /= out->step;
        cam->cx = (cam->cx + 0.5) / out->step - 0.5;
        cam->cy = (cam->cy + 0.5) / out->step - 0.5;
    }
    return 0;
}

int greys_read(struct greys *out, const struct sst_posed *posed, const char *dir, const int view[], int threads)
{
    struct grey_job job = { out, posed, dir, view };
    int err = warp_check_size(posed, dir);

    if (!err && !out->camera)
        err = greys_cameras(out, posed, view);
    if (err)
        return err;
    out->picture = calloc((size_t)out->count, sizeof(*out->picture));
    if (!out->picture) {
        sst_log_error("no memory for %d smaller pictures", out->count);
        err = -ENOMEM;
    }
    err = err ? err : sst_parallel_for(out->count, sst_thread_count(threads), read_grey, &job);
    if (err)
        greys_fini(out);
    return err;
}

void greys_fini(struct greys *greys)
{
    for (int k = 0; greys->picture && k < greys->count; k++)
        sst_deep_fini(&greys->picture[k]);
    free(greys->picture);
    free(greys->camera);
    greys->picture = NULL;
    greys->camera = NULL;
}

int greys_choose(int view[], int most, const struct sst_posed *posed, const struct sst_virtual *camera,
                 double distance_mm)
{
    const double reach_mm = 0.35 * sst_min_int(camera->width, camera->height) / camera->fx * distance_mm;
    double *far_mm = malloc((size_t)posed->count * sizeof(*far_mm));
    int *order = malloc((size_t)posed->count * sizeof(*order)), n = 0, count;

    for (int i = 0; i < posed->count && far_mm && order; i++) {
        const struct sst_calib_camera *cam = &posed->view[i].camera;
        double apart[3], mm;
        int at = n;

        for (int k = 0; k < 3; k++)
            apart[k] = cam->position_mm[k] - camera->centre_mm[k];
        mm = vector_length(apart);
        if (!cam->known)
            continue;
        for (; at > 0 && far_mm[at - 1] > mm; at--) {
            far_mm[at] = far_mm[at - 1];
            order[at] = order[at - 1];
        }
        far_mm[at] = mm;
        order[at] = i;
        n++;
    }
    while (n > most && far_mm[n - 1] > reach_mm)
        n--;
    count = sst_min_int(n, most);
    for (int k = 0; k < count; k++) /* evenly over the distances */
        view[k] = order[n > most ? k * n / most : k];
    count = far_mm && order ? count : -ENOMEM;
    free(far_mm);
    free(order);
    return count;
}
