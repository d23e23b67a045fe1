/* The cameras' own pictures, as they come. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "base/thread.h"
#include "daemon/service/engine_internal.h"
#include "daemon/service/service_internal.h"
#include "pipeline/image/codec.h"
#include "pipeline/image/jpeg_tables.h"
#include "pipeline/image/raw.h"

#define IDLE_MS 200

#define V4L2_MJPG ((uint32_t)'M' | (uint32_t)'J' << 8 | (uint32_t)'P' << 16 | (uint32_t)'G' << 24)

static struct sst_raw raw_of(const struct sst_frame *f)
{
    return (struct sst_raw){ .fourcc = f->fourcc,
                             .width = f->width,
                             .height = f->height,
                             .stride = f->stride,
                             .data = f->data,
                             .bytes = f->bytes };
}

/* One stretch of a set's 16-bit frames: the live picture's, else one that is followed here. */
static void follow_levels(struct live_engine *v, const struct sst_frameset *set, struct sst_samples *stretch)
{
    struct sst_raw raw[SST_CAMERAS_MAX];
    struct sst_samples live;
    int n = 0;

    pthread_mutex_lock(&v->lock);
    live = v->config.live.white_level ? (struct sst_samples){ v->config.live.black_level, v->config.live.white_level }
                                      : v->state.levels;
    pthread_mutex_unlock(&v->lock);
    for (int i = 0; i < set->cameras; i++) {
        if (set->frame[i] && set->frame[i]->bytes)
            raw[n++] = raw_of(set->frame[i]);
    }
    if (live.white)
        *stretch = live;
    else
        (void)sst_raw_follow(stretch, raw, n);
}

/** A frame as JPEG: its own bytes, with Huffman tables, or encoded. @return NULL: no memory, or no picture */
static uint8_t *as_jpeg(const struct sst_frame *f, struct sst_samples stretch, int quality, size_t *bytes)
{
    const struct sst_raw raw = raw_of(f);
    struct sst_image image = { 0 };
    uint8_t *data = NULL;

    if (f->fourcc == V4L2_MJPG) {
        data = sst_jpeg_complete(f->data, f->bytes, bytes);
    } else if (!(stretch.white > 0 ? sst_raw_to_image_samples(&image, &raw, stretch) : sst_raw_to_image(&image, &raw))) {
        if (sst_image_encode_jpeg(&image, quality, &data, bytes))
            data = NULL;
        sst_image_fini(&image);
    }
    return data;
}

static void show(struct live_engine *v, const struct sst_kept *kept, struct sst_samples *stretch)
{
    follow_levels(v, &kept->set, stretch);
    for (int i = 0; i < kept->set.cameras; i++) {
        const struct sst_frame *f = kept->set.frame[i];
        struct shared *s = &v->camera[i];
        struct sst_slot *slot = NULL;
        uint8_t *data;
        size_t bytes;
        int quality;

        pthread_mutex_lock(&v->lock);
        if (f && f->bytes && s->slot && s->shown < kept->number && !v->unmasked && engine_wanted(s->slot, s->used_ns)) {
            slot = sst_slot_ref(s->slot);
            s->shown = kept->number;
        }
        quality = v->config.live.jpeg_quality;
        pthread_mutex_unlock(&v->lock);
        data = slot ? as_jpeg(f, *stretch, quality, &bytes) : NULL;
        if (data && sst_slot_put(slot, data, bytes, kept->set.index, kept->set.t_ns, kept->set.wall_ns))
            sst_log_warning("no memory for a picture of camera %d", i);
        pthread_mutex_lock(&v->lock);
        if (slot && v->unmasked) /* masks were set meanwhile */
            sst_slot_forget(slot);
        pthread_mutex_unlock(&v->lock);
        sst_slot_unref(slot);
    }
}

static bool any_wanted(struct live_engine *v, bool *stop)
{
    bool any = false;

    pthread_mutex_lock(&v->lock);
    for (int i = 0; i < SST_CAMERAS_MAX && !any; i++)
        any = v->camera[i].slot && engine_wanted(v->camera[i].slot, v->camera[i].used_ns);
    *stop = v->stop;
    pthread_mutex_unlock(&v->lock);
    return any;
}

void *engine_run_cameras(void *arg)
{
    struct live_engine *v = arg;
    struct sst_samples stretch = { 0, -1 };
    uint64_t last = 0;
    bool stop = false, wanted;

    sst_thread_name("sst-cameras");
    while (!stop) {
        wanted = any_wanted(v, &stop);
        /* A picture that is wanted all of a sudden is there at once: the newest set is shown, however old. */
        if (sst_ring_wait(v->ring, wanted ? last : UINT64_MAX - 1, wanted ? IDLE_MS : IDLE_MS / 4) || wanted) {
            const struct sst_kept *kept = sst_ring_get(v->ring, 0);

            if (kept) {
                show(v, kept, &stretch);
                last = kept->number;
                sst_ring_unref(v->ring, kept);
            }
        }
    }
    pthread_mutex_lock(&v->lock);
    v->camera_ended = true;
    pthread_cond_broadcast(&v->changed);
    pthread_mutex_unlock(&v->lock);
    return NULL;
}
