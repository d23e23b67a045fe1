/* Random views of a small light field, on which steps are compared with the CPU: surfaces on both sides of an edge, a
 * slanted one in front, noise, unknown pixels; pictures show a surface that no map has through gaps. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>
#include <stdlib.h>

#include "pipeline/method/disparity/disparity_internal.h"

#define GRID    3
#define NOTHING 5  /* view that is absent */
#define PARTLY  1  /* view of which a part must not be matched */
#define EDGE    25 /* column of the maps at which FAR ends and NEAR begins, 1/64 px */
#define FAR     200
#define NEAR    460
#define BETWEEN 330

static uint16_t disparity_at(int x, int y, uint32_t *state)
{
    const uint32_t slanted = (uint32_t)(900 - 12 * x),
                   edge = (x < EDGE ? FAR : NEAR) + sst_step_random(state) % (x < 10 ? 90 : 3);

    return sst_step_random(state) % 12 ? (uint16_t)(y > 20 ? slanted : edge) : (uint16_t)SST_DISP_NONE;
}

/* Every point of a surface has a colour of its own, above smooth ones. */
static uint8_t colour_at(int x, int y, int channel)
{
    uint32_t point = (uint32_t)(x * 8191 + y * 131 + channel * 7);

    return (uint8_t)(y < 12 ? 5 * x + 3 * y + 40 * channel : 60 + (int)(sst_step_random(&point) % 90));
}

static int column_of(int x, double px)
{
    return x + (int)floor(px + 0.5);
}

/* The surface that a view shows at a pixel: stripes of the one on the other side of the edge, at whose borders windows
 * just reach the edge; stripes that no map has. */
static double shown_at(int x, double bx, uint16_t disp)
{
    const int near = column_of(x, NEAR / 64.0 * bx), far = column_of(x, FAR / 64.0 * bx);
    const int between = column_of(x, BETWEEN / 64.0 * bx);

    if (near > 0 && near < EDGE && (near + 3) % 10 < 5)
        return NEAR / 64.0;
    if (far >= EDGE && (far + 1) % 10 < 5)
        return FAR / 64.0;
    return (disp == SST_DISP_NONE || (between + 64) % 8 < 4 ? BETWEEN : disp) / 64.0;
}

static void draw_row(const struct disparity_sample *s, int k, int y, uint32_t *state)
{
    const struct sst_view *v = &s->lf.views[k];

    for (int x = 0; x < SST_STEP_SAMPLE_WIDTH; x++) {
        const double px = shown_at(x, v->bx, sst_map_u16_row(&s->disp[k], y)[x]);

        for (int c = 0; c < 3; c++)
            sst_image_row(&v->image, c, y)[x] =
                (uint8_t)(colour_at(column_of(x, px * v->bx), column_of(y, px * v->by), c) +
                          sst_step_random(state) % 4);
        sst_map_u8_row(&v->valid, y)[x] = k == PARTLY && x > 44 ? 0 : 255;
    }
}

static int fill_view(struct disparity_sample *s, int k, bool checked, uint32_t *state)
{
    const int width = SST_STEP_SAMPLE_WIDTH, height = SST_STEP_SAMPLE_HEIGHT;
    int err = sst_map_u16_init(&s->disp[k], width, height);

    err = err ? err : sst_map_u8_init(&s->confidence[k], width, height);
    err = err ? err : sst_image_init(&s->lf.views[k].image, width, height);
    err = err ? err : sst_map_u8_init(&s->lf.views[k].valid, width, height);
    err = err || !checked ? err : sst_map_u8_init(&s->status[k], width, height);
    for (int y = 0; y < height && !err; y++) {
        for (int x = 0; x < width; x++) {
            sst_map_u16_row(&s->disp[k], y)[x] = disparity_at(x, y, state);
            sst_map_u8_row(&s->confidence[k], y)[x] = (uint8_t)sst_step_random(state);
            if (checked)
                sst_map_u8_row(&s->status[k], y)[x] =
                    (uint8_t)(sst_map_u16_row(&s->disp[k], y)[x] == SST_DISP_NONE ? SST_DISPARITY_OCCLUSION
                                                                                  : sst_step_random(state) % 3);
        }
        draw_row(s, k, y, state);
    }
    return err;
}

struct disparity_sample *disparity_sample(uint32_t seed, bool checked, bool carried)
{
    struct disparity_sample *s = calloc(1, sizeof(*s));
    uint32_t state = seed * 7919;
    int err = s ? sst_lightfield_init(&s->lf, GRID, GRID) : -1;

    for (int k = 0; k < SST_STEP_SAMPLES && !err; k++) {
        struct sst_view *v = &s->lf.views[k];

        v->present = k != NOTHING;
        v->bx = k % GRID - 1 + (int)(sst_step_random(&state) % 9 - 4) * 0.013;
        v->by = k / GRID - 1 + (int)(sst_step_random(&state) % 9 - 4) * 0.017;
        s->carried[k] = carried && k % 4;
        if (v->present)
            err = fill_view(s, k, checked, &state);
        s->view[k] = (struct sst_visible_view){ .image = v->present ? &v->image : NULL,
                                                .seen = k == PARTLY ? &v->valid : NULL,
                                                .disp = &s->disp[k],
                                                .confidence = &s->confidence[k],
                                                .agreed = seed % 2 ? &s->agreed[k] : NULL,
                                                .bx = v->bx,
                                                .by = v->by,
                                                .carried = s->carried[k] };
    }
    if (err) {
        disparity_sample_free(s);
        return NULL;
    }
    s->run = (struct disparity_run){ .lf = &s->lf,
                                     .cfg = &s->cfg,
                                     .carried = carried ? s->carried : NULL,
                                     .scale = 1,
                                     .width = SST_STEP_SAMPLE_WIDTH,
                                     .height = SST_STEP_SAMPLE_HEIGHT,
                                     .disp_min = (int)(seed % 3) - 1,
                                     .range = 15,
                                     .disp = s->disp,
                                     .confidence = s->confidence,
                                     .status = s->status,
                                     .filled = s->filled };
    s->in = (struct sst_visible_views){
        .view = s->view, .count = SST_STEP_SAMPLES, .scale = 1, .disp_min_px = s->run.disp_min, .range = s->run.range
    };
    return s;
}

void disparity_sample_free(struct disparity_sample *s)
{
    if (!s)
        return;
    for (int k = 0; k < SST_STEP_SAMPLES; k++) {
        sst_map_u16_fini(&s->disp[k]);
        sst_map_u16_fini(&s->filled[k]);
        sst_map_u8_fini(&s->confidence[k]);
        sst_map_u8_fini(&s->status[k]);
        sst_map_u8_fini(&s->agreed[k]);
    }
    sst_lightfield_fini(&s->lf);
    free(s);
}
