/* Single pixels in double: where weights underflow in float, and to explain a pixel. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <string.h>

#include "base/log.h"
#include "pipeline/method/render/clear_internal.h"

/* log W_d, which cannot underflow; -inf where W_d is exactly 0. */
static double log_depth_weight(const struct sst_render_config *cfg, double disp_px)
{
    const double floor_log = cfg->c1 > 0 ? log(cfg->c1) : -INFINITY;
    double z;

    if (isinf(cfg->sigma_px))
        return 0;
    if (isnan(disp_px))
        return floor_log;
    z = (cfg->focus_px - disp_px) / cfg->sigma_px;
    if (-0.5 * z * z < -600)
        return fmax(-0.5 * z * z, floor_log);
    return log((1 - cfg->c1) * exp(-0.5 * z * z) + cfg->c1);
}

/* @return false: the view does not see it */
static bool ray_colour(double colour[3], const struct sst_render_tap *t, int x, int y)
{
    const int x0 = x + t->ix, y0 = y + t->iy, x1 = x0 + (t->fx > 0), y1 = y0 + (t->fy > 0);
    uint8_t rgb[3], seen;

    if (t->sampler) {
        sst_sampler_row(t->sampler, &(struct sst_rectified_row){ x0 + t->fx, y0 + t->fy, 1 },
                        (uint8_t *const[3]){ rgb, rgb + 1, rgb + 2 }, &seen);
        for (int c = 0; c < 3; c++)
            colour[c] = rgb[c];
        return seen;
    }
    if (!sst_render_tap_sees(t, x, y))
        return false;
    for (int c = 0; c < 3; c++) {
        const uint8_t *top = sst_image_row(&t->v->image, c, y0), *bottom = sst_image_row(&t->v->image, c, y1);

        colour[c] = (1 - t->fy) * ((1 - t->fx) * top[x0] + t->fx * top[x1]) +
                    t->fy * ((1 - t->fx) * bottom[x0] + t->fx * bottom[x1]);
    }
    return true;
}

/* The ray of one tap; returns log of its weight. */
static double trace(struct sst_ray *ray, const struct sst_render_plan *p, const struct sst_render_tap *t, int x, int y)
{
    const struct sst_render_config *cfg = &p->cfg;
    uint16_t disp = SST_DISP_NONE;

    *ray = (struct sst_ray){ .view = t->view,
                             .x = x + t->ix + t->fx,
                             .y = y + t->iy + t->fy,
                             .disp_px = NAN,
                             .aperture = t->aperture,
                             .w_depth = 1,
                             .w_label = 1 };
    if (t->v->label.data)
        ray->label = sst_map_u8_row(&t->v->label, y + t->ny)[x + t->nx];
    if (t->v->disp.data)
        disp = sst_map_u16_row(&t->v->disp, y + t->ny)[x + t->nx];
    if (disp != SST_DISP_NONE)
        ray->disp_px = sst_disp_px(p->lf, disp);
    if (!p->weighted)
        return log(t->aperture);
    ray->w_depth = sst_weight_depth(cfg->focus_px, ray->disp_px, cfg->sigma_px, cfg->c1);
    if (t->v->label.data)
        ray->w_label = sst_render_plan_label_weight(p, ray->label, disp);
    if (ray->w_label <= 0)
        return -INFINITY;
    return log(t->aperture) + log(ray->w_label) + log_depth_weight(cfg, ray->disp_px);
}

/* Convert the logs of the weights to shares. False: all weights are exactly 0. */
static bool share(struct sst_ray *rays, const double *log_weight, int n)
{
    double largest = -INFINITY, sum = 0;

    for (int i = 0; i < n; i++)
        largest = fmax(largest, log_weight[i]);
    if (isinf(largest))
        return false;
    for (int i = 0; i < n; i++) {
        const double l = log_weight[i] - largest;

        rays[i].share = l > -700 ? exp(l) : 0;
        sum += rays[i].share;
    }
    for (int i = 0; i < n; i++)
        rays[i].share /= sum;
    return true;
}

int sst_render_pixel_exact(const struct sst_render_plan *p, int x, int y, double rgb[3], struct sst_ray *rays)
{
    double log_weight[SST_MAX_VIEWS], plain = 0;
    bool any;
    int n = 0;

    for (int i = 0; i < p->count; i++) {
        const struct sst_render_tap *t = &p->tap[i];
        double colour[3];

        if (x < t->x0 || x >= t->x1 || y < t->y0 || y >= t->y1 || !ray_colour(colour, t, x, y))
            continue;
        log_weight[n] = trace(&rays[n], p, t, x, y);
        memcpy(rays[n].colour, colour, sizeof(colour));
        plain += t->aperture;
        n++;
    }
    any = share(rays, log_weight, n);
    memset(rgb, 0, 3 * sizeof(rgb[0]));
    for (int i = 0; i < n; i++) {
        const double w = any ? rays[i].share : rays[i].aperture / plain;

        for (int c = 0; c < 3; c++)
            rgb[c] += w * rays[i].colour[c];
    }
    return n;
}

int sst_render_rays(struct sst_renderer *r, const struct sst_render_config *cfg, int x, int y, struct sst_ray *rays)
{
    struct sst_render_plan plan;
    double rgb[3];
    int n;

    if (x < 0 || y < 0 || x >= r->lf->width || y >= r->lf->height) {
        sst_log_error("pixel %d,%d is outside the picture of %d x %d", x, y, r->lf->width, r->lf->height);
        return -ERANGE;
    }
    if (cfg->method == SST_RENDER_CLEAR)
        return clear_rays(r, cfg, x, y, rays);
    n = sst_render_plan_init(&plan, r, cfg);
    if (n)
        return n;
    n = sst_render_pixel_exact(&plan, x, y, rgb, rays);
    sst_render_plan_fini(&plan);
    return n;
}

int sst_render_weights(struct sst_renderer *r, const struct sst_render_config *cfg, int view,
                       struct sst_map_f32 *w_depth, struct sst_map_f32 *w_label)
{
    const struct sst_view *v = &r->lf->views[view];
    struct sst_render_plan p;
    int err = sst_render_plan_init(&p, r, cfg);

    if (err)
        return err;
    if (!v->disp.data || w_depth->width != v->disp.width || w_depth->height != v->disp.height ||
        w_label->width != v->disp.width || w_label->height != v->disp.height) {
        sst_render_plan_fini(&p);
        sst_log_error("render: view %d has no disparity map, or one of another size", view);
        return -EINVAL;
    }
    for (int y = 0; y < v->disp.height; y++) {
        const uint16_t *disp = sst_map_u16_row(&v->disp, y);

        for (int x = 0; x < v->disp.width; x++) {
            const double d = disp[x] == SST_DISP_NONE ? NAN : sst_disp_px(r->lf, disp[x]);
            const int label = v->label.data ? sst_map_u8_row(&v->label, y)[x] : 0;

            sst_map_f32_row(w_depth, y)[x] =
                p.weighted ? (float)sst_weight_depth(p.cfg.focus_px, d, p.cfg.sigma_px, p.cfg.c1) : 1;
            sst_map_f32_row(w_label, y)[x] =
                v->label.data ? (float)sst_render_plan_label_weight(&p, label, disp[x]) : 1;
        }
    }
    sst_render_plan_fini(&p);
    return 0;
}
