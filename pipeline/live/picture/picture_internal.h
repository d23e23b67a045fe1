/* pipeline/live/picture/picture_internal.h - plane sweep of a small patch: at which disparities do the views agree?
 *
 * At the disparity of a surface all rays that reach it have the same colour, for each pixel of the patch, however many
 * others end in front of it; at other disparities the rays of a pixel show different places. As for verified rays
 * (pipeline/method/render/verify.h), the measure is the fraction of votes for the most frequent colour; here the maps
 * are not used, and rare colours have more weight than common ones. */
#ifndef SST_PIPELINE_LIVE_PICTURE_PICTURE_INTERNAL_H
#define SST_PIPELINE_LIVE_PICTURE_PICTURE_INTERNAL_H

#include "pipeline/method/render/plan.h"

#define SST_SWEEP_SIDE  8 /* samples of a patch along each side ... */
#define SST_SWEEP_STEP  2 /* px between samples: 15x15 px around the requested pixel; */
#define SST_SWEEP_WIDE  6 /* px if that gives no label: 43x43 px */
#define SST_SWEEP_PATCH (SST_SWEEP_SIDE * SST_SWEEP_SIDE)

/** State of a sweep; 84 KiB, on the stack. */
struct patch_sweep {
    const struct sst_render_plan *plan; /* plan with the rectified views to sweep */
    const uint8_t *rarity;              /* [SST_AGREE_BINS] of the views' colours */
    int x, y, step;                     /* centre of the patch and distance of its samples, px of the picture */
    /* of the last disparity */
    uint8_t colour[SST_MAX_VIEWS][3][SST_SWEEP_PATCH], vote[SST_MAX_VIEWS][SST_SWEEP_PATCH];
    uint8_t mode[3][SST_SWEEP_PATCH]; /* the colour with most votes */
    uint16_t near[SST_SWEEP_PATCH];
};

/** The disparity in a range at which the rays agree most. */
struct sweep_peak {
    double disp_px; /* NaN: too few rays at any disparity */
    double agree;   /* at disp_px */
};

void sweep_init(struct patch_sweep *s, const struct sst_render_plan *plan, const uint8_t *rarity, int x, int y);

/**
 * Agreement of the rays: the fraction of votes for the most frequent colours, less its value by chance (every ray
 * agrees with itself): 0 (all disagree) to 1. NaN with fewer than 2 rays per pixel. Takes about 20 us for 36 views.
 */
double sweep_agree(struct patch_sweep *s, double disp_px);

/**
 * Find the best agreement from min_px to max_px, in steps that move the patch by 1.5 px in the outermost view (longer
 * steps if there were more than 256). If disparities more than 3 px apart agree equally, as without texture, returns
 * the one nearest to preferred_px.
 */
struct sweep_peak sweep_peak(struct patch_sweep *s, double min_px, double max_px, double preferred_px);

/** The most frequent label of the rays that agree at this disparity and also end there by the maps, within `reach_px`,
 *  in the patch or in one three times as large; 0: none. The sweep holds another patch afterwards. */
int sweep_label(struct patch_sweep *s, double disp_px, double reach_px);

#endif
