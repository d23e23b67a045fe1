/* Frames as they come, on the thread that receives their packets: numbered, timed, unpacked, counted, queued. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <linux/videodev2.h>
#include <stdlib.h>
#include <sys/eventfd.h>

#include "base/clock.h"
#include "drivers/genicam/genicam_internal.h"

#define SETTLE_NS   INT64_C(1000000000)
#define BELIEVED_NS INT64_C(1000000000) /* a frame's stamp is never so far from its arrival */

/* Cameras that run on their own are compared by their stamps from the first frame on: it waits until the stamps are right. By a
 * clock that was read they are at once. */
static bool settles_locked(struct genicam_camera *cam, const struct genicam_slot *slot)
{
    if (cam->array->cfg.trigger != SST_GENICAM_FREE)
        return false;
    if (!cam->settle_ns)
        cam->settle_ns = slot->frame.arrival_ns + (cam->clock.count ? 0 : SETTLE_NS);
    if (slot->frame.arrival_ns >= cam->settle_ns)
        return false;
    if (slot->stamp_ns && slot->seen_ns)
        genicam_clock_add(&cam->clock, slot->stamp_ns, slot->seen_ns);
    return true;
}

/* Its time by the camera's clock; without one, and while that is being learnt again, of its arrival. */
static void set_time_locked(struct genicam_camera *cam, struct genicam_slot *slot)
{
    const int64_t seen_ns = slot->seen_ns ? slot->seen_ns : slot->frame.arrival_ns;
    struct sst_frame *f = &slot->frame;
    int64_t t_ns;

    if (slot->stamp_ns && slot->seen_ns)
        genicam_clock_add(&cam->clock, slot->stamp_ns, slot->seen_ns);
    if (slot->stamp_ns && genicam_clock_here(&cam->clock, slot->stamp_ns, &t_ns) &&
        llabs(t_ns - seen_ns) < BELIEVED_NS) {
        f->t_ns = t_ns < f->arrival_ns ? t_ns : f->arrival_ns;
    } else {
        f->t_ns = seen_ns;
        f->faults |= SST_FRAME_ARRIVAL;
    }
    if (!(f->faults & SST_FRAME_FLAGGED)) {
        if (f->t_ns <= cam->last_ns && !(f->faults & SST_FRAME_ARRIVAL))
            f->faults |= SST_FRAME_BACKWARDS;
        cam->last_ns = f->t_ns;
    }
}

static void queue_locked(struct genicam_camera *cam, struct genicam_slot *slot)
{
    slot->next = NULL;
    if (cam->first)
        cam->last->next = slot;
    else
        cam->first = slot;
    cam->last = slot;
}

void genicam_receive(void *arg, struct genicam_slot *slot)
{
    struct genicam_camera *cam = arg;
    struct sst_frame *f = &slot->frame;
    const bool check = cam->array->cfg.check_frozen && slot->whole && f->bytes;
    const uint64_t hash = check ? sst_grab_hash(f->data, f->bytes) : 0;

    f->cam = cam->index; /* the receiver may have numbered it otherwise */
    f->arrival_ns = sst_clock_now_ns();
    f->faults = slot->whole ? 0 : SST_FRAME_FLAGGED;
    pthread_mutex_lock(&cam->lock);
    if (cam->running && !slot->cancelled)
        cam->heard_ns = f->arrival_ns;
    if (slot->cancelled || !cam->running || settles_locked(cam, slot)) {
        pthread_mutex_unlock(&cam->lock);
        genicam_lib_release(slot);
        return;
    }
    f->lost_before = genicam_lost_before(&cam->ids, slot->id);
    cam->sequence += 1 + f->lost_before;
    f->sequence = cam->sequence;
    set_time_locked(cam, slot);
    if (check && cam->hashed && hash == cam->hash)
        f->faults |= SST_FRAME_FROZEN;
    if (check) {
        cam->hash = hash;
        cam->hashed = true;
    }
    cam->owed_ns = 0;
    queue_locked(cam, slot);
    pthread_mutex_unlock(&cam->lock);
    (void)eventfd_write(cam->array->wake_fd, 1);
}
