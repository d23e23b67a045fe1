/* What a device makes of a clear picture: its views and limits as it needs them, and the words that it gives back. */
#include <stdlib.h>

#include "base/thread.h"
#include "pipeline/method/render/render_internal.h"

/* Surfaces and support of row y, as clear.c notes them. */
static void unpack_seen(const struct clear *c, int y)
{
    const uint32_t *seen = c->seen + (size_t)y * (size_t)c->width;
    uint16_t *surface = sst_map_u16_row(c->to.surface, y);
    uint8_t *support = sst_map_u8_row(c->to.support, y);

    _Static_assert(SST_GPU_CLEAR_SUPPORT == SST_RENDER_SUPPORT, "devices note it in the same unit");
    for (int x = 0; x < c->width; x++) {
        surface[x] = (uint16_t)seen[x];
        support[x] = (uint8_t)(seen[x] >> 16);
    }
}

int clear_unpack_row(void *arg, int y, int worker SST_UNUSED)
{
    const struct clear *c = arg;
    const uint32_t *word = c->words + (size_t)y * (size_t)c->width;

    for (int x = 0; x < c->width; x++) {
        for (int k = 0; k < 3; k++)
            sst_image_row(c->to.image, k, y)[x] = (uint8_t)(word[x] >> (8 * k));
        sst_map_u8_row(c->to.weight, y)[x] = (uint8_t)(word[x] >> 24);
    }
    if (c->to.surface && !c->filled)
        unpack_seen(c, y);
    return 0;
}

int clear_pack_row(void *arg, int y, int worker SST_UNUSED)
{
    const struct clear *c = arg;
    const uint8_t *weight = sst_map_u8_row(c->to.weight, y);
    uint32_t *word = c->words + (size_t)y * (size_t)c->width;

    for (int x = 0; x < c->width; x++) {
        word[x] = (uint32_t)weight[x] << 24;
        for (int k = 0; k < 3; k++)
            word[x] |= (uint32_t)sst_image_row(c->to.image, k, y)[x] << (8 * k);
    }
    return 0;
}

bool clear_on_device(struct clear *c, struct sst_render_plan *p)
{
    struct device_clear *to = c->renderer->device ? malloc(sizeof(*to)) : NULL;
    const double disp_min_px = c->lf->disp_min_px;
    bool done;

    if (!to)
        return false;
    to->count = c->count;
    to->pending = p->pending && !p->sampled;
    to->remove = c->cfg->remove;
    to->threads = sst_thread_count(c->cfg->threads);
    to->push = (struct sst_gpu_clear){ .width = c->width,
                                       .height = c->height,
                                       .bins = c->bins,
                                       .cut_q6 = c->cut_q6,
                                       .remove_label = c->cfg->remove_label,
                                       .coarse = c->coarse,
                                       .rays = c->cfg->rays ? c->cfg->rays : CLEAR_ENOUGH,
                                       .as_others = c->as_others,
                                       .merged = c->cfg->merge != NULL,
                                       .disp_min_px = (float)disp_min_px,
                                       .disp_min_rest_px = (float)(disp_min_px - (double)(float)disp_min_px) };
    for (int k = 0; k < c->count; k++) {
        const struct sst_clear_view *at = &c->view[k].at;

        to->tap[k] = c->view[k].tap;
        to->push.sampled |= p->sampled && to->tap[k]->frame;
        to->view[k] = (struct sst_gpu_clear_view){ at->x_q6, at->x_0, at->y_q6, at->y_0, at->bx, at->by, 0, 0 };
    }
    done = render_device_begin_clear(c->renderer->device, to, &c->words, &c->seen);
    if (!done && to->pending && !render_need_frames(p, c->renderer)) {
        to->pending = false;
        done = render_device_begin_clear(c->renderer->device, to, &c->words, &c->seen);
    }
    c->filled = done && to->filled;
    free(to);
    return done;
}
