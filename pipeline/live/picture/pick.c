/* The surface at a point of a picture.
 *
 * The maps give the surfaces that the rays of the pixel meet; the weights say which of them the picture shows. Where
 * the picture uses verified rays instead of the maps (pipeline/method/render/verify.h), the patch around the point is
 * swept (picture_internal.h) over all disparities from the focus on, since the picture suppresses nearer ones. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>
#include <stdlib.h>

#include "pipeline/live/live_internal.h"
#include "pipeline/live/picture/picture_internal.h"
#include "pipeline/method/render/verify.h"

#define PICK_PX      1.0    /* disparities within this are one surface */
#define FRONT_SHARE  0.0625 /* of the rays of a pixel, to count as something in front */
#define FRONT_SIGMAS 0.5    /* nearer than the focus by this number of sigma_d: in front of it, as in verify.c */
#define MOST         0.5    /* of a pixel */
#define AS_WELL      0.9    /* of the best agreement anywhere behind: the surface of the maps is accepted */

/* --- by the maps -------------------------------------------------------------------------------------------------- */

/** Rays of a pixel with known disparities, nearest first. */
struct met {
    struct sst_ray ray[SST_MAX_VIEWS];
    int count;   /* of all rays of the pixel */
    int known;   /* of the rays in ray[] */
    double open; /* fraction of the pixel that verified rays decide */
};

static int by_disparity(const void *a, const void *b)
{
    const struct sst_ray *p = a, *q = b;

    return (p->disp_px < q->disp_px) - (p->disp_px > q->disp_px); /* nearest first */
}

/* Label of most of these rays, by share, or by number if all shares are 0; 0 only if none has a label. */
static int label_of(const struct sst_ray *rays, int from, int to)
{
    double weight[256] = { 0 };

    for (int i = from; i < to; i++)
        weight[rays[i].label] += rays[i].share + 1e-9;
    return most_voted(weight);
}

/* One past the last ray with a disparity of the same surface as ray `from`. */
static int surface_end(const struct sst_ray *rays, int from, int n)
{
    int to = from + 1;

    while (to < n && rays[from].disp_px - rays[to].disp_px <= PICK_PX)
        to++;
    return to;
}

/* Mean by share of rays from .. to-1. */
static double disparity_of(const struct sst_ray *rays, int from, int to)
{
    double sum = 0, weight = 0;

    for (int i = from; i < to; i++) {
        sum += (rays[i].share + 1e-9) * rays[i].disp_px;
        weight += rays[i].share + 1e-9;
    }
    return sum / weight;
}

/* The surface that makes up most of the pixel, and the foreground. @return the surface's share of the pixel */
static double pick_by_maps(const struct met *met, struct sst_livepicture_pick *pick)
{
    double most = 0;
    int best = -1;

    for (int i = 0; i < met->known; i++) {
        const int to = surface_end(met->ray, i, met->known);
        double share = 0;

        for (int k = i; k < to; k++)
            share += met->ray[k].share;
        if (best < 0 || share > most) {
            best = i;
            most = share;
        }
        if (isnan(pick->front_px) && to - i >= FRONT_SHARE * met->count) {
            pick->front_px = disparity_of(met->ray, i, to);
            pick->front_label = label_of(met->ray, i, to);
        }
    }
    if (best >= 0) {
        const int to = surface_end(met->ray, best, met->known);

        pick->disp_px = disparity_of(met->ray, best, to);
        pick->label = label_of(met->ray, best, to);
    }
    return most;
}

static void meet(struct met *met, const struct sst_render_plan *plan, int x, int y)
{
    double rgb[3];

    met->known = 0;
    met->count = sst_render_pixel_exact(plan, x, y, rgb, met->ray);
    met->open = plan->verifier ? sst_verify_open(plan, met->ray, met->count) : 0;
    for (int i = 0; i < met->count; i++) {
        if (!isnan(met->ray[i].disp_px))
            met->ray[met->known++] = met->ray[i];
    }
    qsort(met->ray, (size_t)met->known, sizeof(met->ray[0]), by_disparity);
}

/* --- by the rays that agree --------------------------------------------------------------------------------------- */

/* True if the sweep confirms the surface of the maps: the rays agree there nearly as well as at the best disparity
 * behind. If it is in front of the focus, it must also be behind something and have most of the pixel's weight, since
 * the picture sees through the nearest surface. */
static bool borne_out(struct patch_sweep *s, const struct sst_livepicture_pick *by_maps, double share, double limit_px,
                      const struct sweep_peak *peak)
{
    const double px = by_maps->disp_px;

    if (isnan(px) || (px > limit_px && !(share > MOST && by_maps->front_px > px + PICK_PX)))
        return false;
    return isgreaterequal(sweep_agree(s, px), AS_WELL * peak->agree);
}

static void pick_by_rays(struct sst_livepicture_pick *pick, const struct sst_live *live,
                         const struct sst_render_plan *plan, double share, const int at[2])
{
    const double focus_px = plan->cfg.focus_px;
    const double limit_px = focus_px + fmax(FRONT_SIGMAS * plan->cfg.sigma_px, PICK_PX);
    struct sweep_peak peak;
    struct patch_sweep sweep;
    double min_px, max_px;

    if (!sst_renderer_disparities(live->renderer, &min_px, &max_px))
        return;
    sweep_init(&sweep, plan, live->renderer->rarity, at[0], at[1]);
    peak = sweep_peak(&sweep, fmin(min_px, focus_px), limit_px, focus_px);
    if (isnan(peak.disp_px) || borne_out(&sweep, pick, share, limit_px, &peak))
        return;
    pick->disp_px = peak.disp_px;
    pick->label = sweep_label(&sweep, peak.disp_px, PICK_PX);
}

struct sst_livepicture_pick pick_surface(const struct sst_live *live, const struct sst_render_plan *plan, int x, int y)
{
    struct sst_livepicture_pick pick = { .disp_px = NAN, .front_px = NAN };
    struct met met;
    double share;

    meet(&met, plan, x, y);
    share = pick_by_maps(&met, &pick);
    if (met.open > 0)
        pick_by_rays(&pick, live, plan, share, (const int[2]){ x, y });
    return pick;
}
