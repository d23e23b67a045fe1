/* Weights of a view's rays: correlation with other views on a surface against that on surfaces in front of it. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/mem.h"
#include "pipeline/posed/surface_internal.h"

#define RADIUS    3
#define SIDE      LAYER_WINDOW
#define AREA      49
#define FLOOR     0.01f /* variance, of 1 over a picture */
#define SAME      1     /* steps from the surface that still are the surface */
#define CLEARANCE 3     /* steps in front of it that are something else */
#define BIAS      0.02f /* correlation: of the many surfaces in front one is better by chance */
#define ALIKE     1.0f  /* standard deviations of a picture: means of windows without texture that may be one place */
#define SOFT      0.06f
#define LEAST     0.35f /* correlation on the surface from which on a ray counts, ... */
#define FULL      0.55f /* and from which on it counts fully */

struct layer_scratch {
    const struct layers *in;
    struct warp_rows rows;
    size_t width, height;
    float *level[2];             /* own view, the other */
    uint8_t *seen;               /* of the last sampled view */
    float *mean[2], *inverse[2]; /* of windows: own view, the other */
    float *column[2];            /* [width] */
    float *best[2];              /* of a surface: two best correlations */
    float *on, *before;          /* largest correlations */
    uint32_t *sum;
    uint16_t *count;
};

static void scratch_fini(struct layer_scratch *s)
{
    warp_rows_fini(&s->rows);
    sst_mem_free(s->level[0]);
    sst_mem_free(s->seen);
    sst_mem_free(s->sum);
    sst_mem_free(s->count);
    *s = (struct layer_scratch){ 0 };
}

static int scratch_init(struct layer_scratch *s, const struct layers *in, const struct warp *warp)
{
    const size_t pixels = (size_t)warp->camera.width * (size_t)warp->camera.height;
    float *all = sst_mem_alloc(pixels * 10 + 2 * (size_t)warp->camera.width, sizeof(*all));

    *s = (struct layer_scratch){ .in = in };
    s->width = (size_t)warp->camera.width;
    s->height = (size_t)warp->camera.height;
    for (int i = 0; all && i < 2; i++, all += 4 * pixels) {
        s->level[i] = all;
        s->mean[i] = all + pixels;
        s->inverse[i] = all + 2 * pixels;
        s->best[i] = all + 3 * pixels;
    }
    if (all) {
        s->on = all;
        s->before = all + pixels;
        s->column[0] = all + 2 * pixels;
        s->column[1] = s->column[0] + s->width;
    }
    s->seen = sst_mem_alloc(pixels, sizeof(*s->seen));
    s->sum = sst_mem_alloc(s->width, sizeof(*s->sum));
    s->count = sst_mem_alloc(s->width, sizeof(*s->count));
    if (all && s->seen && s->sum && s->count && !warp_rows_init(&s->rows, warp))
        return 0;
    scratch_fini(s);
    return -ENOMEM;
}

/* Levels of a view on a surface, in standard deviations of its picture; 0 where it does not see it. */
static void sample(float *level, struct layer_scratch *s, struct warp *warp, int k)
{
    const struct sst_kernels *kernels = sst_kernels_get();
    const struct sst_deep *picture = &s->in->greys->picture[k];
    const struct sst_warped_source from = warp_source(picture);
    const struct warp_view view =
        warp_view_of(&warp->camera, &s->in->greys->camera[k], picture->width, picture->height);

    for (int band = 0; band < warp->bands; band++) {
        warp_band(&s->rows, warp, &view, band);
        for (int r = 0; r < WARP_CELL && (size_t)(band * WARP_CELL + r) < s->height; r++) {
            const size_t at = (size_t)(band * WARP_CELL + r) * s->width;

            memset(s->sum, 0, s->width * sizeof(*s->sum));
            memset(s->count, 0, s->width * sizeof(*s->count));
            kernels->warped_row((uint32_t *const[3]){ s->sum }, s->count, &from, s->rows.segment[r],
                                (size_t)s->rows.segments[r]);
            for (size_t x = 0; x < s->width; x++) {
                const float v = (float)(int32_t)(s->sum[x] - (32768u << SST_WARPED_SHIFT));

                level[at + x] = s->count[x] ? v * (1.0f / (GREY_SPREAD << SST_WARPED_SHIFT)) : 0;
                s->seen[at + x] = (uint8_t)s->count[x];
            }
        }
    }
}

/* Column sums of products p q of the rows y - RADIUS to y + RADIUS, moved on by a row. */
static void move(float *restrict column, const float *p, const float *q, size_t y, size_t width)
{
    const float *in[2] = { p + (y + RADIUS) * width, q + (y + RADIUS) * width };

    if (y == RADIUS) {
        memset(column, 0, width * sizeof(*column));
        for (size_t i = 0; i < (SIDE - 1) * width; i++)
            column[i % width] += p[i] * q[i];
        for (size_t x = 0; x < width; x++)
            column[x] += in[0][x] * in[1][x];
    } else {
        const float *old[2] = { p + (y - RADIUS - 1) * width, q + (y - RADIUS - 1) * width };

        for (size_t x = 0; x < width; x++)
            column[x] += in[0][x] * in[1][x] - old[0][x] * old[1][x];
    }
}

static inline float across(const float *c)
{
    return c[-3] + c[-2] + c[-1] + c[0] + c[1] + c[2] + c[3];
}

/* Means and 1 / standard deviations of windows; those that the view does not wholly see have 0. */
static void windows(struct layer_scratch *s, int which, const float *level)
{
    const size_t width = s->width;
    float *mean = s->mean[which], *inverse = s->inverse[which];

    memset(inverse, 0, width * s->height * sizeof(*inverse));
    memset(s->column[0], 0, width * sizeof(*s->column[0]));
    for (size_t i = 0; i < (SIDE - 1) * width; i++)
        s->column[0][i % width] += level[i];
    for (size_t y = RADIUS; y + RADIUS < s->height; y++) {
        const float *in = level + (y + RADIUS) * width, *old = level + (y > RADIUS ? y - RADIUS - 1 : 0) * width;

        for (size_t x = 0; x < width; x++)
            s->column[0][x] += in[x] - (y > RADIUS ? old[x] : 0);
        move(s->column[1], level, level, y, width);
        for (size_t x = RADIUS; x + RADIUS < width; x++) {
            const float m = across(s->column[0] + x) * (1.0f / AREA);
            const float v = across(s->column[1] + x) * (1.0f / AREA) - m * m;
            const uint8_t *a = s->seen + (y - RADIUS) * width + x, *b = s->seen + (y + RADIUS) * width + x;

            mean[y * width + x] = m;
            inverse[y * width + x] =
                a[-RADIUS] & a[RADIUS] & b[-RADIUS] & b[RADIUS] ? 1 / sqrtf((v > 0 ? v : 0) + FLOOR) : 0;
        }
    }
}

/* Correlations with one view, kept where they are among the two best. */
static void compare(struct layer_scratch *s, const float *level)
{
    for (size_t y = RADIUS; y + RADIUS < s->height; y++) {
        const size_t at = y * s->width;

        move(s->column[0], s->level[0], level, y, s->width);
        for (size_t x = RADIUS; x + RADIUS < s->width; x++) {
            const float means = s->mean[0][at + x] - s->mean[1][at + x];
            const float alike = 1 - fabsf(means) * (1 / ALIKE);
            const float both = across(s->column[0] + x) * (1.0f / AREA) - s->mean[0][at + x] * s->mean[1][at + x] +
                               FLOOR * (alike > 0 ? alike : 0);
            const float v = both * s->inverse[0][at + x] * s->inverse[1][at + x];
            const float least = s->best[0][at + x] < v ? s->best[0][at + x] : v;

            s->best[0][at + x] = s->best[0][at + x] > v ? s->best[0][at + x] : v;
            s->best[1][at + x] = s->best[1][at + x] > least ? s->best[1][at + x] : least;
        }
    }
}

static float ramp(float v, float lo, float hi)
{
    const float t = (v - lo) / (hi - lo);

    return t <= 0 ? 0 : t >= 1 ? 1 : t * t * (3 - 2 * t);
}

int layers_weigh(struct sst_map_u8 *out, const struct layers *in, int view)
{
    const struct sst_deep *picture = &in->greys->picture[view];
    const struct sst_calib_camera *cam = &in->greys->camera[view];
    struct sst_virtual camera = { picture->width, picture->height, cam->fx, cam->fy, cam->cx, cam->cy, { 0 }, { 0 } };
    struct layer_scratch s = { 0 };
    struct warp warp = { 0 };
    int err;

    memcpy(camera.rotation, cam->rotation, sizeof(camera.rotation));
    memcpy(camera.centre_mm, cam->position_mm, sizeof(camera.centre_mm));
    err = warp_init(&warp, &camera, &in->surface);
    err = err ? err : scratch_init(&s, in, &warp);
    err = err ? err : sst_map_u8_init(out, camera.width, camera.height);
    if (err)
        goto end;
    sample(s.level[0], &s, &warp, view);
    windows(&s, 0, s.level[0]);
    for (int step = -SAME; step < in->steps; step++) {
        const struct sst_surface surface = sst_surface_moved(&in->surface, layers_height(in, step));
        float *const largest = step <= SAME ? s.on : step >= CLEARANCE ? s.before : NULL;

        if (!largest)
            continue;
        warp_restart(&warp, &surface);
        memset(s.best[0], 0, s.width * s.height * sizeof(*s.best[0]));
        memset(s.best[1], 0, s.width * s.height * sizeof(*s.best[1]));
        for (int k = 0; k < LAYER_OTHERS && in->other[view][k] >= 0; k++) {
            sample(s.level[1], &s, &warp, in->other[view][k]);
            windows(&s, 1, s.level[1]);
            compare(&s, s.level[1]);
        }
        for (size_t i = 0; i < s.width * s.height; i++) {
            const float v = (s.best[0][i] + s.best[1][i]) / 2;

            largest[i] = largest[i] > v ? largest[i] : v;
        }
    }
    for (size_t y = 0; y < s.height; y++) {
        for (size_t x = 0; x < s.width; x++) {
            const float on = s.on[y * s.width + x], before = s.before[y * s.width + x];
            const float better = ramp(on - before + BIAS, -2 * SOFT, 2 * SOFT);

            sst_map_u8_row(out, (int)y)[x] = (uint8_t)(255 * better * ramp(on, LEAST, FULL) + 0.5f);
        }
    }
end:
    scratch_fini(&s);
    warp_fini(&warp);
    return err;
}
