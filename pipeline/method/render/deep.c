/* Pictures of 16 bits, pixel by pixel: slow and plain. Weights are those of the 8-bit picture; only colours are finer.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>
#include <stdatomic.h>

#include "base/thread.h"
#include "pipeline/method/render/clear_internal.h"

struct deep {
    const struct sst_render_plan *plan;
    struct sst_map_u16 *out;
    const struct sst_image *image;
    const struct sst_map_u16 (*views)[3];
    double black, level; /* sample of level 0; samples of one level */
    atomic_llong coarse;
};

/* Bilinear; rays lie inside their views. */
static double sample(const struct sst_map_u16 *plane, double x, double y)
{
    const int x0 = sst_clamp_int((int)floor(x), 0, plane->width - 1),
              y0 = sst_clamp_int((int)floor(y), 0, plane->height - 1);
    const int x1 = sst_min_int(x0 + 1, plane->width - 1), y1 = sst_min_int(y0 + 1, plane->height - 1);
    const double fx = x - x0, fy = y - y0;
    const uint16_t *top = sst_map_u16_row(plane, y0), *bottom = sst_map_u16_row(plane, y1);

    return (1 - fy) * ((1 - fx) * top[x0] + fx * top[x1]) + fy * ((1 - fx) * bottom[x0] + fx * bottom[x1]);
}

static void deep_pixel(void *arg, int x, int y, const struct sst_ray *rays, int count)
{
    struct deep *d = arg;
    double value[3] = { 0, 0, 0 }, sum = 0, apart = 0;

    for (int i = 0; i < count; i++) {
        for (int c = 0; c < 3 && rays[i].share > 0; c++)
            value[c] += rays[i].share * sample(&d->views[rays[i].view][c], rays[i].x, rays[i].y);
        sum += rays[i].share;
    }
    for (int c = 0; c < 3; c++) { /* samples beyond black and white end there, as levels do */
        value[c] = sst_clamp_double(sum > 0 ? value[c] / sum : 0, d->black, d->black + 255 * d->level);
        apart = fmax(apart, fabs(value[c] - d->black - d->level * sst_image_row(d->image, c, y)[x]));
    }
    if (!(sum > 0) || apart > 1.5 * d->level) {
        atomic_fetch_add(&d->coarse, 1);
        for (int c = 0; c < 3; c++)
            value[c] = d->black + d->level * sst_image_row(d->image, c, y)[x];
    }
    for (int c = 0; c < 3; c++)
        sst_map_u16_row(&d->out[c], y)[x] = (uint16_t)(value[c] + 0.5);
}

static int deep_row(void *arg, int y, int worker SST_UNUSED)
{
    const struct deep *d = arg;
    struct sst_ray rays[SST_MAX_VIEWS];
    double rgb[3];

    for (int x = 0; x < d->plan->lf->width; x++)
        deep_pixel(arg, x, y, rays, sst_render_pixel_exact(d->plan, x, y, rgb, rays));
    return 0;
}

static int render(struct deep *d, struct sst_renderer *r, const struct sst_render_config *cfg)
{
    struct sst_render_plan plan;
    int err = sst_render_plan_init(&plan, r, cfg);

    if (err)
        return err;
    d->plan = &plan;
    err = sst_parallel_for(r->lf->height, sst_thread_count(cfg->threads), deep_row, d);
    sst_render_plan_fini(&plan);
    return err;
}

int sst_render_deep(struct sst_renderer *r, const struct sst_render_config *cfg, struct sst_map_u16 out[3],
                    const struct sst_image *image, const struct sst_map_u16 (*deep)[3], int64_t *coarse)
{
    const struct sst_samples s = r->lf->samples;
    struct deep d = { .out = out,
                      .image = image,
                      .views = deep,
                      .black = s.white ? s.black : 0,
                      .level = (s.white ? s.white - s.black : 65535) / 255.0 };
    const int err = cfg->method == SST_RENDER_CLEAR ? clear_each(r, cfg, deep_pixel, &d) : render(&d, r, cfg);

    *coarse = atomic_load(&d.coarse);
    return err;
}
