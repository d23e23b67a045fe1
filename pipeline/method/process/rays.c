/* Where other views show the pixels of a row. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/mem.h"
#include "pipeline/kernels/kernels.h"
#include "pipeline/lightfield/shift.h"
#include "pipeline/method/process/process_internal.h"

int process_nearest(const struct sst_lightfield *lf, int view, const bool *of, int most, struct process_source *out)
{
    const struct sst_view *own = &lf->views[view];
    double distance[PROCESS_SOURCES];
    int n = 0;

    for (int k = 0; k < lf->rows * lf->cols; k++) {
        const struct sst_view *other = &lf->views[k];
        const double far = hypot(other->bx - own->bx, other->by - own->by);
        int at;

        if (k == view || !of[k] || (n == most && far >= distance[n - 1]) ||
            far * (fabs(lf->disp_min_px) + SST_DISP_NONE / SST_DISP_SCALE) > PROCESS_REACH_MOST)
            continue;
        n += n < most;
        for (at = n - 1; at > 0 && distance[at - 1] > far; at--) {
            distance[at] = distance[at - 1];
            out[at] = out[at - 1];
        }
        distance[at] = far;
        out[at] = (struct process_source){ k, sst_shift_by(own->bx - other->bx, lf->disp_min_px),
                                           sst_shift_by(own->by - other->by, lf->disp_min_px) };
    }
    return n;
}

int process_rays_init(struct process_rays *r, int width)
{
    const size_t n = (size_t)width;

    *r = (struct process_rays){ .own = malloc(n * sizeof(*r->own)),
                                .at = malloc(n * sizeof(*r->at)),
                                .label = malloc(n * sizeof(*r->label)) };
    if (r->own && r->at && r->label)
        return 0;
    process_rays_fini(r);
    return -ENOMEM;
}

void process_rays_fini(struct process_rays *r)
{
    free(r->own);
    free(r->at);
    free(r->label);
    *r = (struct process_rays){ 0 };
}

static inline uint64_t ray_of(const uint8_t *const colour[3], const uint16_t *d, int x)
{
    return (uint32_t)(colour[0][x] | colour[1][x] << 8 | colour[2][x] << 16) | (uint64_t)d[x] << SST_RAY_DISP;
}

void process_rays_take(struct process_rays *r, const struct sst_view *own, int y)
{
    const uint16_t *d = sst_map_u16_row(&own->disp, y);
    const uint8_t *valid = own->valid.data ? sst_map_u8_row(&own->valid, y) : NULL;
    const uint8_t *const colour[3] = { sst_image_row(&own->image, 0, y), sst_image_row(&own->image, 1, y),
                                       sst_image_row(&own->image, 2, y) };
    int n = 0;

    for (int x = 0; x < own->disp.width; x++) {
        r->own[n] = ray_of(colour, d, x) | (uint64_t)x << SST_RAY_COLUMN;
        n += d[x] != SST_DISP_NONE && (!valid || valid[x]);
    }
    r->count = n;
    r->y = y;
}

/* An entropy in 16 bits, as process_ray_entropy() has it. */
static inline uint64_t half_of(float entropy)
{
    uint32_t bits;

    memcpy(&bits, &entropy, sizeof(bits));
    return (bits + 0x8000) >> 16;
}

uint64_t *process_rays_pack(const struct sst_view *v, const struct sst_map_f32 *entropy)
{
    const size_t width = (size_t)v->disp.width, height = (size_t)v->disp.height;
    uint64_t *rays = sst_mem_alloc_raw(width * height, sizeof(*rays));

    for (int y = 0; rays && y < v->disp.height; y++) {
        const uint8_t *const colour[3] = { sst_image_row(&v->image, 0, y), sst_image_row(&v->image, 1, y),
                                           sst_image_row(&v->image, 2, y) };
        const uint16_t *d = sst_map_u16_row(&v->disp, y);
        const uint8_t *label = sst_map_u8_row(&v->label, y);
        const float *h = entropy ? sst_map_f32_row(entropy, y) : NULL;
        uint64_t *to = rays + (size_t)y * width;

        for (int x = 0; x < v->disp.width; x++)
            to[x] = ray_of(colour, d, x) | (uint64_t)label[x] << SST_RAY_LABEL;
        for (int x = 0; h && x < v->disp.width; x++)
            to[x] |= half_of(h[x]) << SST_RAY_COLUMN;
    }
    return rays;
}

void process_rays_find(struct process_rays *r, const struct sst_view *there, const uint64_t *packed,
                       const struct process_source *s)
{
    const struct sst_shift shift[2] = { s->across, s->down };
    struct sst_shown shown = { .rays = packed,
                               .width = there->disp.width,
                               .height = there->disp.height,
                               .y = r->y,
                               .same = PROCESS_SAME_Q6,
                               .similar = PROCESS_SIMILAR };

    for (int axis = 0; axis < 2; axis++)
        sst_shift_parts(shift[axis], &shown.whole[axis], &shown.part[axis], &shown.step[axis]);
    sst_kernels_get()->shown_row(r->at, r->label, &shown, r->own, (size_t)r->count);
}
