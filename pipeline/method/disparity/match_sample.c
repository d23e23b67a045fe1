/* Runs over small views of random images and features, on which matching is compared with the CPU. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>
#include <stdlib.h>

#include "base/mem.h"
#include "pipeline/method/disparity/disparity_internal.h"

#define GRID    3
#define NOTHING 5 /* view that is absent */
#define TEXTURE 64
#define NEAR    3 /* parts of the range in which surfaces lie */

/* Ways to match. */
static const struct way {
    int width, height, range, divisor, phase_step, paths;
    int support, neighbours, tau; /* rounds of aggregation; of the bilateral filter */
    enum sst_cost cost;
    double spacing; /* of views */
    bool windows, raw;
    int band;
} ways[MATCH_SAMPLES] = {
    /* quarter pixels, as presets have them; half pixels along 8 paths, in bands */
    { 53, 29, 7, 4, 1, 4, 1, 12, 8, SST_COST_CENSUS, 1, false, false, 0 },
    { 45, 37, 15, 2, 2, 8, 0, 4, 0, SST_COST_BOTH, 1, false, false, 16 },
    /* windows of disparities by tile; in bands of a row of tiles */
    { 60, 42, 55, 1, 2, 4, 2, 12, 8, SST_COST_CENSUS, 0.3, true, false, 0 },
    { 60, 42, 55, 1, 2, 4, 0, 12, 8, SST_COST_MCCNN, 0.3, true, false, SST_TILE_HEIGHT },
    { 53, 29, 15, 2, 1, 4, 1, 12, 8, SST_COST_BOTH, 1, false, true, 0 }, /* the costs alone */
    /* one neighbour, or two; more disparities than a group has at once, and as many as one of a variant has */
    { 29, 11, 280, 1, 1, 4, 0, 2, 0, SST_COST_CENSUS, 0.07, false, false, 0 },
    { 29, 19, 250, 1, 2, 8, 1, 4, 8, SST_COST_CENSUS, 0.07, false, false, 16 },
};

/* Disparity of the surface at a pixel of the view in the middle, px above the smallest one. */
static int surface_at(int range, int x, int y)
{
    return range * (x / 17 % NEAR + y / 13 % 2) / (NEAR + 1);
}

/* Where a pixel of a view lies in the texture. */
static size_t texel(const struct sst_view *v, int range, int x, int y)
{
    const int d = surface_at(range, x, y);

    return (size_t)((y + (int)lround(d * v->by)) & (TEXTURE - 1)) * TEXTURE +
           (size_t)((x + (int)lround(d * v->bx)) & (TEXTURE - 1));
}

/* Patches for support regions, with a texture and noise; some pixels of some views do not count. */
static int make_image(struct sst_view *v, const struct way *w, int k, const uint32_t *texture, uint32_t *state)
{
    int err = sst_image_init(&v->image, w->width, w->height);

    if (!err && (k == 1 || (w->divisor > 1 && k % 4 == 0)))
        err = sst_map_u8_init(&v->valid, w->width, w->height);
    for (int y = 0; y < w->height && !err; y++) {
        for (int x = 0; x < w->width; x++) {
            const uint32_t t = texture[texel(v, w->range, x, y)];

            for (int c = 0; c < 3; c++)
                sst_image_row(&v->image, c, y)[x] =
                    (uint8_t)((t >> 8 * c & 0x3F) + (uint32_t)(x / 9 + y / 5) % 7 * 25 + sst_step_random(state) % 4);
            if (v->valid.data)
                sst_map_u8_row(&v->valid, y)[x] = sst_step_random(state) % 9 ? 255 : 0;
        }
    }
    return err;
}

/* Vectors of length SST_FEATURE_ONE, more or less alike: of small components, or of a single one. */
static int make_features(struct sst_descriptor *desc, const struct sst_view *v, int range, const uint32_t *texture,
                         uint32_t *state)
{
    const int err = sst_descriptor_need_features(desc);

    for (int y = 0; y < desc->height && !err; y++) {
        for (int x = 0; x < desc->width; x++) {
            const uint32_t t = texture[texel(v, range, x, y)];

            for (uint32_t c = 0; c < SST_FEATURE_CHANNELS; c++) {
                const int one = t % 9 ? 15 : c == t % SST_FEATURE_CHANNELS ? SST_FEATURE_ONE : 0;
                const bool negative = (t >> c % 20 ^ (c * t) >> 9 ^ (uint32_t) !(sst_step_random(state) % 8)) & 1;
                uint8_t *row = desc->features + ((size_t)y * SST_FEATURE_CHANNELS / 4 + c / 4) * desc->feature_stride;

                row[4 * x + (int)(c % 4)] = (uint8_t)(SST_FEATURE_ZERO + (negative ? -one : one));
            }
        }
    }
    return err;
}

/* Disparities at fewer pixels, of which windows are made. */
static int make_coarse(struct match_sample *s, int k, const struct way *w)
{
    struct sst_map_u16 *disp = &s->coarse.views[k].disp;
    const int err =
        sst_map_u16_init(disp, (w->width + SST_COARSER - 1) / SST_COARSER, (w->height + SST_COARSER - 1) / SST_COARSER);

    for (int y = 0; y < disp->height && !err; y++) {
        for (int x = 0; x < disp->width; x++) /* beside the first tiles nothing is known */
            sst_map_u16_row(disp, y)[x] =
                (uint16_t)(x > 10 ? (int)SST_DISP_NONE : 64 * w->range / SST_COARSER * (y / 9 + 3) / 6);
    }
    return err;
}

static int make_view(struct match_sample *s, int k, const struct way *w, const uint32_t *texture, uint32_t *state)
{
    struct sst_view *v = &s->lf.views[k];
    int err;

    v->present = k != NOTHING;
    v->bx = w->spacing * (k % GRID - 1) + (int)(sst_step_random(state) % 9 - 4) * 0.013;
    v->by = w->spacing * (k / GRID - 1) + (int)(sst_step_random(state) % 9 - 4) * 0.017;
    if (!v->present)
        return 0;
    err = make_image(v, w, k, texture, state);
    err = err ? err : sst_descriptor_init(&s->desc[k], &v->image, 1, s->cfg.cost & SST_COST_CENSUS, NULL);
    if (!err && v->valid.data)
        err = sst_disparity_mask_reduce(&s->desc[k].seen, &v->valid, 1);
    if (!err && w->cost & SST_COST_MCCNN)
        err = make_features(&s->desc[k], v, w->range, texture, state);
    if (!err && w->windows)
        err = make_coarse(s, k, w);
    err = err ? err : sst_map_u16_init(&s->disp[k], w->width, w->height);
    return err ? err : sst_map_u8_init(&s->confidence[k], w->width, w->height);
}

static void configure(struct match_sample *s, const struct way *w, int disp_min)
{
    s->cfg = (struct sst_disparity_config){ .cost = w->cost,
                                            .paths = w->paths,
                                            .p1 = 14,
                                            .p2 = 90,
                                            .edge_step = 24,
                                            .joint = true,
                                            .raw = w->raw,
                                            .neighbours = w->neighbours,
                                            .support_arm = w->support ? SST_SUPPORT_MAX_ARM : 0,
                                            .support_tau = 18,
                                            .support_before = w->support,
                                            .bilateral_tau = w->tau };
    s->run = (struct disparity_run){ .lf = &s->lf,
                                     .cfg = &s->cfg,
                                     .scale = 1,
                                     .width = w->width,
                                     .height = w->height,
                                     .disp_min = disp_min,
                                     .range = w->range,
                                     .divisor = w->divisor,
                                     .need = s->need,
                                     .desc = s->desc,
                                     .disp = s->disp,
                                     .confidence = s->confidence,
                                     .workers = 1,
                                     .inner = 1,
                                     .volumes = &s->volume,
                                     .tiles = &s->tiles,
                                     .coarse = w->windows ? &s->coarse : NULL,
                                     .searched = w->windows ? s->searched : NULL,
                                     .costs = true,
                                     .shape = { .width = w->width,
                                                .height = w->height,
                                                .disp_min = disp_min,
                                                .steps = w->range * w->divisor + 1,
                                                .divisor = w->divisor,
                                                .phase_step = w->phase_step } };
    s->coarse.disp_min_px = floor((double)disp_min / SST_COARSER);
    s->view[0] = GRID * GRID / 2;
    s->band = w->band;
}

struct match_sample *disparity_match_sample(uint32_t seed)
{
    const struct way *w = &ways[(seed - 1) % MATCH_SAMPLES];
    struct match_sample *s = calloc(1, sizeof(*s));
    uint32_t texture[TEXTURE * TEXTURE], state = seed * 7919;
    int err = s ? sst_lightfield_init(&s->lf, GRID, GRID) : -1;

    err = err ? err : sst_lightfield_init(&s->coarse, GRID, GRID);
    for (size_t i = 0; i < ARRAY_LEN(texture); i++)
        texture[i] = sst_step_random(&state);
    if (!err)
        configure(s, w, (int)(seed % 3) - 1);
    for (int k = 0; k < SST_STEP_SAMPLES && !err; k++)
        err = make_view(s, k, w, texture, &state);
    err = err ? err : run_make_volume(&s->run, &s->volume);
    err = err ? err : run_describe_for(&s->run, s->view, ARRAY_LEN(s->view), 1);
    if (err) {
        disparity_match_sample_free(s);
        return NULL;
    }
    return s;
}

void disparity_match_sample_free(struct match_sample *s)
{
    if (!s)
        return;
    for (int k = 0; k < SST_STEP_SAMPLES; k++) {
        sst_descriptor_fini(&s->desc[k]);
        sst_map_u16_fini(&s->disp[k]);
        sst_map_u8_fini(&s->confidence[k]);
    }
    sst_volume_fini(&s->volume);
    sst_tiles_fini(&s->tiles);
    sst_lightfield_fini(&s->lf);
    sst_lightfield_fini(&s->coarse);
    free(s);
}
