/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/live/picture/picture_internal.h"

#include <math.h>

#define STEP_PX   1.5 /* shift of the patch per disparity step, in the view farthest from the viewpoint */
#define STEPS_MAX 256
#define AS_WELL   0.9 /* of the best agreement: equal within noise */
#define FLAT_PX   3.0 /* equal agreement farther apart than this is ambiguous */
/* Votes for a colour are sums in 16 bits. */
#define ALL_VOTES  (65535 / (SST_AGREE_MODE / 2))
#define PARTS      256 /* sub-pixel steps of the interpolation */
#define CANDIDATES 36  /* about this number of views gives candidate colours; of few views all */

void sweep_init(struct patch_sweep *s, const struct sst_render_plan *plan, const uint8_t *rarity, int x, int y)
{
    s->plan = plan;
    s->rarity = rarity;
    s->step = SST_SWEEP_STEP;
    s->x = x;
    s->y = y;
}

/* --- rays --------------------------------------------------------------------------------------------------------- */

/* Position of the patch's first sample in a view: whole px and fraction. */
struct corner {
    int x, y, fx, fy;
};

static struct corner corner_of(const struct patch_sweep *s, const struct sst_render_tap *t, double disp_px)
{
    const double x = s->x - (SST_SWEEP_SIDE - 1) * 0.5 * s->step - disp_px * (t->v->bx - s->plan->cfg.view_bx);
    const double y = s->y - (SST_SWEEP_SIDE - 1) * 0.5 * s->step - disp_px * (t->v->by - s->plan->cfg.view_by);
    const double far = 2.0 * SST_IMAGE_MAX_SIDE;
    const double whole_x = floor(sst_clamp_double(x, -far, far)), whole_y = floor(sst_clamp_double(y, -far, far));

    return (struct corner){ (int)whole_x, (int)whole_y, (int)(sst_clamp_double(x - whole_x, 0, 1) * PARTS + 0.5),
                            (int)(sst_clamp_double(y - whole_y, 0, 1) * PARTS + 0.5) };
}

/* True if the four pixels from (x, y) on are valid in the view. */
static bool sees(const struct sst_view *v, int x, int y)
{
    const uint8_t *top, *bottom;

    if (x < 0 || y < 0 || x + 1 >= v->image.width || y + 1 >= v->image.height)
        return false;
    if (!v->valid.data)
        return true;
    top = sst_map_u8_row(&v->valid, y) + x;
    bottom = sst_map_u8_row(&v->valid, y + 1) + x;
    return top[0] && top[1] && bottom[0] && bottom[1];
}

/* The rays of one view. @param there  out, [SST_SWEEP_PATCH] 0, or -1: no ray @return their number */
static int gather_rays(uint8_t (*colour)[SST_SWEEP_PATCH], float *there, const struct sst_view *v, struct corner at,
                       int step)
{
    int n = 0;

    for (int i = 0; i < SST_SWEEP_PATCH; i++) {
        const int x = at.x + i % SST_SWEEP_SIDE * step, y = at.y + i / SST_SWEEP_SIDE * step;

        there[i] = -1;
        colour[0][i] = colour[1][i] = colour[2][i] = 0;
        if (!sees(v, x, y))
            continue;
        there[i] = 0;
        n++;
        for (int c = 0; c < 3; c++) {
            const uint8_t *top = sst_image_row(&v->image, c, y) + x, *bottom = sst_image_row(&v->image, c, y + 1) + x;
            const int above = (PARTS - at.fx) * top[0] + at.fx * top[1];
            const int below = (PARTS - at.fx) * bottom[0] + at.fx * bottom[1];

            colour[c][i] = (uint8_t)(((PARTS - at.fy) * above + at.fy * below + PARTS * PARTS / 2) / (PARTS * PARTS));
        }
    }
    return n;
}

/* --- agreement ---------------------------------------------------------------------------------------------------- */

/* Count near[] of one candidate view. */
static void count_near(struct patch_sweep *s, int k)
{
    const uint8_t *const colour[3] = { s->colour[k][0], s->colour[k][1], s->colour[k][2] };
    const uint8_t *const mode[3] = { s->mode[0], s->mode[1], s->mode[2] };

    sst_kernels_get()->agree_near(s->near, colour, mode, s->vote[k], SST_SWEEP_PATCH);
}

double sweep_agree(struct patch_sweep *s, double disp_px)
{
    const struct sst_kernels *kernels = sst_kernels_get();
    const struct sst_render_plan *p = s->plan;
    const float most = (float)sst_min_int(ALL_VOTES / p->count, 255);
    const struct sst_voting voting = { s->rarity, 1, most / 255, most };
    uint8_t *const mode[3] = { s->mode[0], s->mode[1], s->mode[2] };
    double agree = 0, all = 0, chance;
    int rays = 0;

    for (int k = 0; k < p->count; k++) {
        const uint8_t *const colour[3] = { s->colour[k][0], s->colour[k][1], s->colour[k][2] };
        float there[SST_SWEEP_PATCH];

        rays += gather_rays(s->colour[k], there, p->tap[k].v, corner_of(s, &p->tap[k], disp_px), s->step);
        kernels->agree_votes(s->vote[k], colour, there, &voting, SST_SWEEP_PATCH);
    }
    if (rays < 2 * SST_SWEEP_PATCH)
        return NAN;
    kernels->agree_mode(mode, s->colour[0][0], s->vote[0], (size_t)p->count,
                        (size_t)sst_max_int(p->count / CANDIDATES, 1), SST_SWEEP_PATCH);
    for (int k = 0; k < p->count; k++) {
        count_near(s, k);
        for (int i = 0; i < SST_SWEEP_PATCH; i++) {
            agree += s->near[i];
            all += s->vote[k][i];
        }
    }
    chance = (double)SST_SWEEP_PATCH / rays;
    return fmax((agree / (SST_AGREE_NEAR * all) - chance) / (1 - chance), 0);
}

/* --- best peak ---------------------------------------------------------------------------------------------------- */

/* Step between disparities of a range. */
static double step_of(const struct sst_render_plan *p, double stretch_px)
{
    double reach = 1;

    for (int k = 0; k < p->count; k++) {
        reach = fmax(reach, fabs(p->tap[k].v->bx - p->cfg.view_bx));
        reach = fmax(reach, fabs(p->tap[k].v->by - p->cfg.view_by));
    }
    return fmax(STEP_PX / reach, stretch_px / STEPS_MAX);
}

/* Vertex of the parabola through a value and its neighbours, -0.5..0.5 of a step; 0 if there is none. */
static double top_of(const double *at)
{
    const double bend = 2 * at[0] - at[-1] - at[1];

    return isgreater(bend, 0) ? sst_clamp_double(0.5 * (at[1] - at[-1]) / bend, -0.5, 0.5) : 0;
}

struct sweep_peak sweep_peak(struct patch_sweep *s, double min_px, double max_px, double preferred_px)
{
    const double step = step_of(s->plan, max_px - min_px);
    const int last = isgreater(max_px, min_px) ? sst_min_int((int)ceil((max_px - min_px) / step), STEPS_MAX) : 0;
    double agree[STEPS_MAX + 1], off_px = INFINITY, at_px;
    int best = -1, chosen = 0, from = last, to = 0;

    for (int i = 0; i <= last; i++) {
        agree[i] = sweep_agree(s, fmin(min_px + i * step, max_px));
        if (!isnan(agree[i]) && (best < 0 || agree[i] > agree[best]))
            best = i;
    }
    if (best < 0)
        return (struct sweep_peak){ .disp_px = NAN };
    for (int i = 0; i <= last; i++) {
        if (!isgreaterequal(agree[i], AS_WELL * agree[best]))
            continue;
        from = sst_min_int(from, i);
        to = i;
        if (fabs(min_px + i * step - preferred_px) < off_px) {
            off_px = fabs(min_px + i * step - preferred_px);
            chosen = i;
        }
    }
    if ((to - from) * step > FLAT_PX)
        at_px = sst_clamp_double(preferred_px, min_px + (chosen - 0.5) * step, min_px + (chosen + 0.5) * step);
    else
        at_px = min_px + step * (best + (best > 0 && best < last ? top_of(agree + best) : 0));
    return (struct sweep_peak){ sst_clamp_double(at_px, min_px, fmax(min_px, max_px)), agree[best] };
}

/* --- labels ------------------------------------------------------------------------------------------------------- */

/* Votes of rays of a surface. */
struct votes {
    double disp_px, reach_px;
    double weight[256]; /* by label */
};

int most_voted(const double weight[256])
{
    int best = 0;

    for (int i = 1; i < 256; i++) {
        if (weight[i] > weight[best] || (!best && weight[i] > 0))
            best = i;
    }
    return best;
}

/* Add the votes of the agreeing rays of a view to their labels. */
static void count_labels(struct votes *votes, const struct patch_sweep *s, const struct sst_view *v, struct corner at)
{
    const int x0 = at.x + (at.fx >= PARTS / 2), y0 = at.y + (at.fy >= PARTS / 2);

    for (int i = 0; i < SST_SWEEP_PATCH; i++) {
        const int x = x0 + i % SST_SWEEP_SIDE * s->step, y = y0 + i / SST_SWEEP_SIDE * s->step;
        uint16_t disp;

        if (!s->near[i])
            continue; /* nor is there any ray outside */
        disp = sst_map_u16_row(&v->disp, y)[x];
        if (disp != SST_DISP_NONE && fabs(sst_disp_px(s->plan->lf, disp) - votes->disp_px) <= votes->reach_px)
            votes->weight[sst_map_u8_row(&v->label, y)[x]] += s->near[i];
    }
}

static int label_of_patch(struct patch_sweep *s, double disp_px, double reach_px)
{
    struct votes votes = { disp_px, reach_px, { 0 } };

    if (isnan(sweep_agree(s, disp_px)))
        return 0;
    for (int k = 0; k < s->plan->count; k++) {
        const struct sst_render_tap *t = &s->plan->tap[k];

        if (!t->v->disp.data || !t->v->label.data)
            continue;
        count_near(s, k);
        count_labels(&votes, s, t->v, corner_of(s, t, disp_px));
    }
    return most_voted(votes.weight);
}

int sweep_label(struct patch_sweep *s, double disp_px, double reach_px)
{
    int label = label_of_patch(s, disp_px, reach_px);

    if (!label) {
        s->step = SST_SWEEP_WIDE;
        label = label_of_patch(s, disp_px, reach_px);
    }
    return label;
}
