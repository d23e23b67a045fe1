/* Self-tests of the shaders verify_*: some rows of a small picture. */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/gpu/gpu_internal.h"
#include "pipeline/gpu/verify.h"
#include "pipeline/kernels/exp_neg.h"
#include "pipeline/kernels/kernels.h"
#include "pipeline/kernels/verify_ref.h"

#define WIDTH       77
#define HEIGHT      19
#define PITCH       80
#define VIEWS       5
#define VIEW_PX     (PITCH * HEIGHT)
#define LABELS      3
#define TOP         8  /* rows 8 .. 18 of the picture are rendered, ... */
#define ROWS        11 /* the last two not a whole cell, */
#define FROM        10 /* and rows 10 .. 17 of them verified */
#define TO          18
#define PLANE       (ROWS * WIDTH)
#define RAYS        ((TO - FROM + 2) * WIDTH)
#define CELLS       (2 * 3)
#define DISPARITIES 1000 /* stored ones are below, or unknown */
#define RAY_VIEWS   27   /* of the shaders that read rays: more than one pass of candidates, and no even number */
#define NEAR_WORDS  ((RAY_VIEWS + 1) / 2)

struct test {
    struct sst_gpu_verify push;
    struct params {
        struct sst_gpu_verify_params params;
        struct sst_gpu_blend_view view[VIEWS];
    } params;
    struct sst_gpu_verify_view view[VIEWS];
    uint32_t pixel[VIEWS * VIEW_PX];
    uint16_t disp[VIEWS * VIEW_PX];
    uint8_t valid[VIEWS * VIEW_PX], confidence[VIEWS * VIEW_PX];
    float table[LABELS * SST_BLEND_COLUMNS], disp_px[DISPARITIES];
    float sums[4 * PLANE], share[3 * PLANE], totals[2 * RAYS];
    uint32_t out[PLANE], cells[CELLS], rays[RAY_VIEWS * RAYS], near[NEAR_WORDS * RAYS];
};

/* Views in a row, between pixels; one partly invalid, one without labels, one with confidences. */
static void set_views(struct test *t)
{
    for (int i = 0; i < VIEWS; i++) {
        struct sst_gpu_blend_view *v = &t->params.view[i];
        const double fx = 0.25 * (i % 3), fy = i == 2 ? 0.5 : 0;
        int16_t tap[4];

        sst_blend_set_taps(tap, fx, fy);
        *v = (struct sst_gpu_blend_view){ .ix = i - 2,
                                          .iy = i % 2,
                                          .nx = i - 2 + (fx >= 0.5),
                                          .ny = i % 2 + (fy >= 0.5),
                                          .x0 = sst_max_int(2 - i, 0),
                                          .x1 = WIDTH - sst_max_int(i - 1, 0),
                                          .y0 = i == 3 ? 12 : 0,
                                          .y1 = HEIGHT - 1 - i % 2,
                                          .aperture = 1 - 0.125F * (float)i,
                                          .first = (uint32_t)(i * VIEW_PX),
                                          .index = (uint32_t)(VIEWS - 1 - i) };
        for (int k = 0; k < 4; k++)
            v->tap[k] = tap[k];
        v->flags = (fx > 0 ? SST_GPU_VIEW_RIGHT : 0U) | (fy > 0 ? SST_GPU_VIEW_BELOW : 0U) |
                   (i == 1 ? SST_GPU_VIEW_VALID : 0U) | (i != 3 ? SST_GPU_VIEW_LABELS : 0U) |
                   (i == 2 ? SST_GPU_VIEW_CONFIDENCE : 0U);
        t->view[i].at = *v;
        for (int k = 0; k < VIEWS; k++) {
            if (k != i && abs(k - i) < 3)
                t->view[i].near[t->view[i].around++] =
                    (struct sst_gpu_verify_near){ (float)(k - i), 0.125F * (float)(i - k), (uint32_t)k, 0 };
        }
        t->push.all += v->aperture;
    }
}

static void set_push(struct test *t)
{
    static const float power[SST_EXP2_POWERS] = SST_EXP2_POWER;

    t->push = (struct sst_gpu_verify){ .blend = { .width = WIDTH,
                                                  .pitch = PITCH,
                                                  .top = TOP,
                                                  .rows = ROWS,
                                                  .views = VIEWS,
                                                  .focus_whole_q6 = 700,
                                                  .focus_part_q6 = 0.25F,
                                                  .scale = 0.0002F,
                                                  .c1 = 0.005F,
                                                  .first = 300,
                                                  .count = 900 },
                                       .height = HEIGHT,
                                       .from = FROM,
                                       .to = TO,
                                       .nearest = 720,
                                       .levels = 30,
                                       .count = VIEWS,
                                       .rays = RAYS,
                                       .scale = 200.0F / (255 * 1.5F),
                                       .most = 200,
                                       .doubt_step = SST_VERIFY_DOUBT_STEP };
    for (int i = 0; i < SST_EXP2_POWERS; i++)
        t->push.blend.power[i] = (1 - t->push.blend.c1) * power[i];
}

/* Surfaces in smooth colours, so that some views agree; disparities around the focus, in front of it and unknown. */
static void set_maps(struct test *t, uint32_t *state)
{
    for (int i = 0; i < VIEWS * VIEW_PX; i++) {
        const uint32_t r = gpu_random(state), x = (uint32_t)(i % PITCH), noise = r & 0x0F070F;

        t->pixel[i] = (x * 2 << 16 | (x / 16 % 3 * 60) << 8 | 90) + noise + (gpu_random(state) % LABELS << 24);
        t->disp[i] = (uint16_t)(r % 11 == 0 ? 0xFFFF : r % 3 ? 730 + r % 200 : 500 + r % 220);
        t->valid[i] = gpu_random(state) % 8 ? 255 : 0;
        t->confidence[i] = (uint8_t)gpu_random(state);
    }
    for (int i = 0; i < DISPARITIES; i++)
        t->disp_px[i] = (float)i / 64 - 11.7F;
}

static struct test *make_test(void)
{
    struct test *t = calloc(1, sizeof(*t));
    uint32_t state = 5;

    if (!t)
        return NULL;
    set_push(t);
    set_views(t);
    set_maps(t, &state);
    for (uint32_t i = 0; i < 256; i++)
        t->params.params.label[i] = (struct sst_gpu_blend_label){ i % LABELS, 0 };
    for (int i = 0; i < 4096; i++)
        t->params.params.rarity[i] = (uint8_t)gpu_random(&state);
    for (int i = 0; i < LABELS * SST_BLEND_COLUMNS; i++)
        t->table[i] = 0.02F + (float)(gpu_random(&state) & 0xFF) / 256;
    for (int i = 0; i < CELLS; i++)
        t->cells[i] = i == 4 ? 0 : SST_GPU_CELL_WANTED;
    for (int i = 0; i < PLANE; i++) {
        t->sums[3 * PLANE + i] = (float)(gpu_random(&state) & 0xFFFF) / 65536;
        t->share[i] = gpu_random(&state) % 5 || i % WIDTH > 60 ? 0 : (float)(gpu_random(&state) & 0xFFF) / 4096;
        t->out[i] = gpu_random(&state) | gpu_random(&state) % 4 << 24;
    }
    for (int i = 0; i < 2 * RAYS; i++)
        t->totals[i] = (float)(gpu_random(&state) % 3000) / (i < RAYS ? 1 : 1024);
    for (int i = 0; i < RAY_VIEWS * RAYS; i++)
        t->rays[i] = (gpu_random(&state) & 0x1F3F1F) + (i / RAYS % 3 ? 0x203040U : 0x90A050U) +
                     (gpu_random(&state) % 4 ? gpu_random(&state) % 100 << 24 : 0);
    for (int i = 0; i < NEAR_WORDS * RAYS; i++)
        t->near[i] = gpu_random(&state) % 6400 | gpu_random(&state) % 6400 << 16;
    return t;
}

static struct sst_gpu_work work_of(enum sst_gpu_shader shader, const struct test *t)
{
    return (struct sst_gpu_work){ .shader = shader,
                                  .push = &t->push,
                                  .groups = { gpu_groups(WIDTH, 32), gpu_groups(TO - FROM + 2, 4), 1 } };
}

/* In two dispatches. */
int verify_share_self_test(struct sst_gpu *g)
{
    struct test *t = make_test();
    struct sst_gpu_work work = work_of(SST_GPU_VERIFY_SHARE, t);
    int err = t ? 0 : -ENOMEM;

    work.groups[1] = gpu_groups(ROWS, 4);
    for (uint32_t i = 0; i < 2 && !err; i++) {
        t->push.blend.first_view = 2 * i;
        t->push.blend.views = i ? VIEWS - 2 : 2;
        t->push.blend.flags = i ? SST_GPU_BLEND_LAST : SST_GPU_BLEND_FIRST;
        err = gpu_compare(g, &work, (const void *const[]){ &t->params, t->disp, t->sums, t->out, t->share, t->cells },
                          (const size_t[]){ sizeof(t->params), sizeof(t->disp), sizeof(t->sums), sizeof(t->out),
                                            sizeof(t->share), sizeof(t->cells) },
                          SST_GPU_SHARE_SHARE, t->share);
    }
    free(t);
    return err;
}

/* Views of which the buffers have only the rows from `rows` on. */
static void cut_rows(struct test *t, int rows)
{
    for (int i = 0; i < VIEWS; i++)
        t->view[i].at.first = (uint32_t)(i * VIEW_PX) - (uint32_t)(rows * PITCH);
}

/* Of cells of which all, or hardly any rays are explained. */
int verify_screen_self_test(struct sst_gpu *g)
{
    struct test *t = make_test();
    struct sst_gpu_work work = work_of(SST_GPU_VERIFY_SCREEN, t);
    int err = t ? 0 : -ENOMEM;

    work.groups[0] = gpu_groups(WIDTH, SST_VERIFY_CELL_WIDTH);
    work.groups[1] = gpu_groups(ROWS, SST_VERIFY_CELL_HEIGHT);
    if (t) {
        t->push.from = TOP;
        t->push.to = TOP + ROWS;
    }
    for (int i = 0; i < 2 && !err; i++) {
        for (int k = 0; k < CELLS; k++)
            t->cells[k] |= k == 3 ? 0 : SST_GPU_CELL_OPEN;
        t->push.levels = i ? 400 : 30;
        cut_rows(t, 4 * i);
        err = gpu_compare(g, &work,
                          (const void *const[]){ t->view, t->pixel, t->disp, t->valid, t->disp_px, t->share, t->cells },
                          (const size_t[]){ sizeof(t->view), sizeof(t->pixel), sizeof(t->disp), sizeof(t->valid),
                                            sizeof(t->disp_px), sizeof(t->share), sizeof(t->cells) },
                          SST_GPU_SCREEN_CELLS, NULL);
        for (int k = 0; k < VIEWS * VIEW_PX; k++)
            t->disp[k] = t->disp[k] == 0xFFFF ? DISPARITIES - 1 : t->disp[k];
    }
    free(t);
    return err;
}

int verify_unexplained_self_test(struct sst_gpu *g)
{
    struct test *t = make_test();
    const struct sst_gpu_work work = work_of(SST_GPU_VERIFY_UNEXPLAINED, t);
    int err = t ? 0 : -ENOMEM;

    for (int i = 0; i < 2 && !err; i++) {
        cut_rows(t, 4 * i);
        err = gpu_compare(
            g, &work, (const void *const[]){ t->view, t->pixel, t->disp, t->valid, t->disp_px, t->share, t->totals },
            (const size_t[]){ sizeof(t->view), sizeof(t->pixel), sizeof(t->disp), sizeof(t->valid), sizeof(t->disp_px),
                              sizeof(t->share), sizeof(t->totals) },
            SST_GPU_UNEXPLAINED_TOTALS, NULL);
    }
    free(t);
    return err;
}

int verify_rays_self_test(struct sst_gpu *g)
{
    struct test *t = make_test();
    const struct sst_gpu_work work = work_of(SST_GPU_VERIFY_RAYS, t);
    int err = t ? 0 : -ENOMEM;

    for (uint32_t i = 0; i < 2 && !err; i++) {
        t->push.blend.flags = i ? SST_GPU_BLEND_BY_LABEL : 0;
        err =
            gpu_compare(g, &work,
                        (const void *const[]){ &t->params, t->pixel, t->disp, t->valid, t->table, t->confidence,
                                               t->share, t->rays },
                        (const size_t[]){ sizeof(t->params), sizeof(t->pixel), sizeof(t->disp), sizeof(t->valid),
                                          sizeof(t->table), sizeof(t->confidence), sizeof(t->share), sizeof(t->rays) },
                        SST_GPU_RAYS_RAYS, NULL);
    }
    free(t);
    return err;
}

int verify_mode_self_test(struct sst_gpu *g)
{
    struct test *t = make_test();
    const struct sst_gpu_work work = work_of(SST_GPU_VERIFY_MODE, t);
    int err = t ? 0 : -ENOMEM;

    if (!err) {
        t->push.count = RAY_VIEWS;
        err = gpu_compare(g, &work, (const void *const[]){ t->share, t->rays, t->near, t->totals },
                          (const size_t[]){ sizeof(t->share), sizeof(t->rays), sizeof(t->near), sizeof(t->totals) },
                          SST_GPU_MODE_TOTALS, NULL);
    }
    free(t);
    return err;
}

/* Without and with what the maps explain; at the upper edge of the picture, too. */
int verify_blend_self_test(struct sst_gpu *g)
{
    struct test *t = make_test();
    const struct sst_gpu_work work = work_of(SST_GPU_VERIFY_BLEND, t);
    int err = t ? 0 : -ENOMEM;

    for (uint32_t i = 0; i < 2 && !err; i++) {
        t->push.count = RAY_VIEWS;
        t->push.explained = i;
        t->push.blend.top = i ? 0 : TOP;
        t->push.from = i ? 0 : FROM;
        t->push.to = i ? TO - FROM : TO;
        t->push.rays = i ? RAYS - WIDTH : RAYS;
        err = gpu_compare(
            g, &work, (const void *const[]){ t->share, t->rays, t->near, t->totals, t->out },
            (const size_t[]){ sizeof(t->share), sizeof(t->rays), sizeof(t->near), sizeof(t->totals), sizeof(t->out) },
            SST_GPU_MIX_OUT, NULL);
    }
    free(t);
    return err;
}
