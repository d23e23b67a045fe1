/* pipeline/live/picture/picture_internal.h - a plane sweep of one small patch: at which disparities do the views agree
 * on what is there?
 *
 * At the disparity of a surface all rays that reach it have one colour, pixel by pixel of the patch, however many
 * others end in front of it; at other disparities rays of one pixel show many places. So it is asked, as for verified
 * rays (pipeline/method/render/verify.h), what share of the votes goes to the colour with most of them; here the maps
 * have no say, and rare colours tell more than common ones. */
#ifndef SST_PIPELINE_LIVE_PICTURE_PICTURE_INTERNAL_H
#define SST_PIPELINE_LIVE_PICTURE_PICTURE_INTERNAL_H

#include "pipeline/method/render/plan.h"

#define SST_SWEEP_SIDE  8 /* samples of a patch along each side ... */
#define SST_SWEEP_STEP  2 /* ... so many px apart: 15x15 px around the pixel asked for; where that has no label ... */
#define SST_SWEEP_WIDE  6 /* ... so many: 43x43 px */
#define SST_SWEEP_PATCH (SST_SWEEP_SIDE * SST_SWEEP_SIDE)

/** A patch at work; 84 KiB, for the stack. */
struct patch_sweep {
    const struct sst_plan *plan; /* whose views are swept; of rectified views */
    const uint8_t *rarity;       /* [SST_AGREE_BINS] of the views' colours */
    int x, y, step;              /* the patch's middle and between its samples, px of the picture */
    /* of the disparity asked for last */
    uint8_t colour[SST_MAX_VIEWS][3][SST_SWEEP_PATCH], vote[SST_MAX_VIEWS][SST_SWEEP_PATCH];
    uint8_t mode[3][SST_SWEEP_PATCH]; /* the colour that most votes go to */
    uint16_t near[SST_SWEEP_PATCH];
};

/** Where the rays agree most, of a stretch of disparities. */
struct sweep_peak {
    double disp_px; /* NaN: nowhere are there rays enough */
    double agree;   /* there */
};

void sweep_init(struct patch_sweep *s, const struct sst_plan *plan, const uint8_t *rarity, int x, int y);

/**
 * How well rays agree: the share of the votes for the colours that most go to, with what it is by chance taken off, for
 * every ray agrees with itself: 0, all disagree, to 1. NaN where less than 2 rays a pixel are there. Some 20 us for 36
 * views.
 */
double sweep_agree(struct patch_sweep *s, double disp_px);

/**
 * Where rays agree most from min_px to max_px, in steps that move the patch by 1.5 px in the outermost view (longer
 * ones where these would be more than 256). Where places more than 3 px apart are as good, as they are without texture,
 * it is the one of them that is nearest to preferred_px.
 */
struct sweep_peak sweep_peak(struct patch_sweep *s, double min_px, double max_px, double preferred_px);

/** The label of most rays that agree at this disparity and that the maps, too, say to end there, within `reach_px`: of
 *  the patch, or of one around it that is three times as large; 0: of none. The patch is another one afterwards. */
int sweep_label(struct patch_sweep *s, double disp_px, double reach_px);

#endif
