/* The holes of clear pictures on a device: a pyramid of weighted means, as fill.c makes it, each level half the size of
 * the finer one, up to a single pixel. hole_pull makes a level from the finer one or from the picture, hole_push fills
 * a level or the picture from the coarser one. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "base/thread.h"
#include "pipeline/kernels/pyramid_ref.h"
#include "pipeline/method/render/device_internal.h"

/* Constants of both shaders (std430, pipeline/kernels/hole.glsl). */
struct hole {
    int32_t width, height; /* of the finer level, or of the picture; the coarser one has half of it, rounded up */
    uint32_t finer;        /* where the levels begin in their buffer; not read with from_picture */
    uint32_t coarser;
    uint32_t from_picture; /* not 0: the finer level is the picture */
};

/* Pixels of a group: of the coarser level for hole_pull, of the finer one for hole_push. */
#define GROUP_WIDTH  32
#define GROUP_HEIGHT 4
#define LEVELS_MOST  17 /* of sides up to 2^16 */

/* Pairs of a level and the next one, the picture and the first level first. @return their number */
static int plan_levels(struct hole pair[LEVELS_MOST], int width, int height)
{
    uint32_t at = 0;
    int n = 0;

    pair[n++] = (struct hole){ .width = width, .height = height, .from_picture = 1 };
    for (;;) {
        width = sst_pyramid_half(width);
        height = sst_pyramid_half(height);
        if (width == 1 && height == 1)
            return n;
        pair[n++] = (struct hole){
            .width = width, .height = height, .finer = at, .coarser = at + (uint32_t)width * (uint32_t)height
        };
        at = pair[n - 1].coarser;
    }
}

static uint32_t groups(int n, int of)
{
    return (uint32_t)((n + of - 1) / of);
}

void clear_fill_on_device(struct sst_run *r, const struct clear *c, struct sst_gpu_range picture,
                          struct sst_gpu_range levels)
{
    struct hole pair[LEVELS_MOST];
    const int n = plan_levels(pair, c->width, c->height);

    for (int i = 0; i < 2 * n; i++) {
        const bool pulls = i < n;
        const struct hole *p = &pair[pulls ? i : 2 * n - 1 - i];
        const int width = pulls ? sst_pyramid_half(p->width) : p->width;
        const int height = pulls ? sst_pyramid_half(p->height) : p->height;

        SST_RUN_GROUPS(r, pulls ? SST_GPU_HOLE_PULL : SST_GPU_HOLE_PUSH, p, groups(width, GROUP_WIDTH),
                       groups(height, GROUP_HEIGHT), 1, levels, picture);
    }
}

struct packing {
    const struct clear *c;
    uint32_t *word;
};

static int pack_row(void *arg, int y, int worker SST_UNUSED)
{
    const struct packing *p = arg;
    const struct clear_target *from = &p->c->to;
    const uint8_t *weight = sst_map_u8_row(from->weight, y);
    uint32_t *word = p->word + (size_t)y * (size_t)p->c->width;

    for (int x = 0; x < p->c->width; x++) {
        word[x] = (uint32_t)weight[x] << 24;
        for (int k = 0; k < 3; k++)
            word[x] |= (uint32_t)sst_image_row(from->image, k, y)[x] << (8 * k);
    }
    return 0;
}

void clear_holes_on_device(struct sst_run *r, void *job, int item)
{
    struct clear *c = (struct clear *)job + item;
    const size_t n = (size_t)c->width * (size_t)c->height;
    struct packing p = { c, sst_run_words(r, n) };
    struct sst_gpu_range picture;

    if (!p.word)
        return;
    sst_run_fail(r, sst_parallel_for(c->height, c->threads, pack_row, &p));
    picture = sst_run_upload(r, DEVICE_SCRATCH_PICTURE, p.word, 4 * n);
    clear_fill_on_device(r, c, picture,
                         sst_run_scratch(r, DEVICE_SCRATCH_LEVELS, clear_fill_bytes(c->width, c->height)));
    clear_unpack(r, c, picture, 0, c->height);
}
