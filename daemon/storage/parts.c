/* Reduced sets: only the parts that differ from the last whole set are recorded (pipeline/image/jpeg_parts.h). */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdlib.h>
#include <string.h>

#include "daemon/storage/storage_internal.h"
#include "pipeline/image/jpeg_parts.h"

#define WHOLE_NS INT64_C(60000000000) /* after this another whole set is recorded */

static void drop_made(struct set_parts *p)
{
    for (int k = 0; k < SST_CAMERAS_MAX; k++) {
        free(p->made[k]);
        p->made[k] = NULL;
    }
}

void set_parts_forget(struct set_parts *p)
{
    drop_made(p);
    for (int k = 0; k < SST_CAMERAS_MAX; k++) {
        free(p->base[k]);
        p->base[k] = NULL;
    }
    p->base_t_ns = 0;
}

/* Frames that are as large as before, cannot be compared, or have no base, stay whole. */
static struct sst_frame *cut(struct set_parts *p, int k, struct sst_frame *frame)
{
    const struct sst_jpeg_bytes base = { p->base[k], p->base_bytes[k] }, whole = { frame->data, frame->bytes };
    size_t bytes;

    if (!base.data || frame->faults & SST_FRAME_BAD ||
        sst_jpeg_parts_cut(&(struct sst_jpeg_pair){ base, whole, frame->width, frame->height }, p->base_wall_ns,
                           &p->made[k], &bytes, NULL) ||
        bytes >= frame->bytes)
        return frame;
    p->frame[k] = *frame;
    p->frame[k].data = p->made[k];
    p->frame[k].bytes = bytes;
    p->frame[k].faults |= SST_FRAME_PARTS;
    return &p->frame[k];
}

const struct sst_frameset *set_parts_of(struct set_parts *p, const struct sst_frameset *set)
{
    if (!p->base_t_ns || set->t_ns - p->base_t_ns >= WHOLE_NS || set->t_ns < p->base_t_ns)
        return set;
    drop_made(p);
    p->set = *set;
    for (int k = 0; k < set->cameras; k++)
        p->set.frame[k] = set->frame[k] ? cut(p, k, set->frame[k]) : NULL;
    return &p->set;
}

void set_parts_written(struct set_parts *p, const struct sst_frameset *set)
{
    if (set == &p->set)
        return;
    set_parts_forget(p);
    for (int k = 0; k < set->cameras; k++) {
        const struct sst_frame *f = set->frame[k];

        if (!f || !f->bytes || f->faults & SST_FRAME_BAD)
            continue;
        p->base[k] = malloc(f->bytes);
        if (!p->base[k]) /* its next frames are whole */
            continue;
        memcpy(p->base[k], f->data, f->bytes);
        p->base_bytes[k] = f->bytes;
    }
    p->base_t_ns = set->t_ns;
    p->base_wall_ns = set->wall_ns;
}
