/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "capture/array/array_internal.h"

#include <limits.h>
#include <stdio.h>

#include "base/log.h"

static const struct {
    const char *what, *remedy;
} texts[SST_TROUBLES] = {
    [SST_TROUBLE_FLAGGED] = { "the driver flags frames as damaged", "check its cable, hub or switch, and power" },
    [SST_TROUBLE_CUT] = { "frames end early", "check its cable, and the USB bandwidth by `sst plan`" },
    [SST_TROUBLE_DAMAGED] = { "frames are damaged", "check its cable, hub and USB power" },
    [SST_TROUBLE_UNFIT] = { "frames do not have the size or the form that was agreed",
                            "no frame is used until they do; the camera is refused with what it delivers" },
    [SST_TROUBLE_STAMP] = { "time stamps jump, or are later than the arrival of the frame",
                            "such frames are left out of sets; look for a newer firmware or driver of the camera" },
    [SST_TROUBLE_LOST] = { "the driver loses frames", "raise cameras: buffers, or see `sst plan`" },
    [SST_TROUBLE_FROZEN] = { "the picture is frozen, byte for byte", "restart the camera if the scene moves" },
    [SST_TROUBLE_LATE] = { "frames arrive after their set was closed", "raise sets: wait_ms or lower the rate" },
    [SST_TROUBLE_DUPLICATE] = { "triggers get more than one frame",
                                "check its trigger line for bouncing, and that the camera is in its triggered mode" },
    [SST_TROUBLE_STRAY] = { "frames belong to no trigger",
                            "check that the camera is in its triggered mode (cameras: controls), and sets: window_us" },
};

static void note(struct health *h, int cam, enum trouble trouble)
{
    if (!h->camera[cam][trouble].on) {
        const int need = h->camera[cam][trouble].need;
        const bool again = need && h->camera[cam][trouble].well < SST_HEALTH_AGAIN + need;

        h->camera[cam][trouble].on = h->camera[cam][trouble].began = true;
        h->camera[cam][trouble].events = 0;
        h->camera[cam][trouble].need = again ? sst_min_int(2 * need, SST_HEALTH_SETS_MAX) : SST_HEALTH_SETS;
    }
    h->camera[cam][trouble].events++;
    h->camera[cam][trouble].well = 0;
}

void health_frame(struct health *h, const struct sst_frame *frame)
{
    static const struct {
        unsigned bits;
        enum trouble trouble;
    } by_fault[] = {
        { SST_FRAME_FLAGGED, SST_TROUBLE_FLAGGED },
        { SST_FRAME_EMPTY | SST_FRAME_SHORT | SST_FRAME_NO_EOI, SST_TROUBLE_CUT },
        { SST_FRAME_UNFIT, SST_TROUBLE_UNFIT },
        { SST_FRAME_NO_SOI | SST_FRAME_MARKER, SST_TROUBLE_DAMAGED },
        { SST_FRAME_BACKWARDS, SST_TROUBLE_STAMP },
        { SST_FRAME_FROZEN, SST_TROUBLE_FROZEN },
    };

    if (frame->lost_before)
        note(h, frame->cam, SST_TROUBLE_LOST);
    for (size_t i = 0; i < ARRAY_LEN(by_fault); i++)
        if (frame->faults & by_fault[i].bits) {
            note(h, frame->cam, by_fault[i].trouble);
            return; /* only the first one: a truncated frame has broken markers as well */
        }
}

void health_bucket(struct health *h, const struct sst_frame *frame, enum sst_bucket bucket)
{
    const int cam = frame->cam;

    if (bucket == SST_BUCKET_CORRUPT && !(frame->faults & SST_FRAME_BAD))
        note(h, cam, SST_TROUBLE_STAMP);
    else if (bucket == SST_BUCKET_LATE)
        note(h, cam, SST_TROUBLE_LATE);
    else if (bucket == SST_BUCKET_DUPLICATE)
        note(h, cam, SST_TROUBLE_DUPLICATE);
    else if (bucket == SST_BUCKET_STRAY)
        note(h, cam, SST_TROUBLE_STRAY);
}

void health_set(struct health *h, int cam)
{
    for (int i = 0; i < SST_TROUBLES; i++) {
        if (!h->camera[cam][i].need || h->camera[cam][i].well == INT_MAX)
            continue;
        if (++h->camera[cam][i].well <= h->camera[cam][i].need || !h->camera[cam][i].on)
            continue;
        h->camera[cam][i].on = false;
        h->camera[cam][i].ended = true;
    }
}

/* Log cameras with a fault that started, or ended, since the last call. @return number of lines */
static int log_change(struct health *h, enum trouble trouble, bool ended, int cameras,
                      const char (*name)[SST_HEALTH_NAME])
{
    uint64_t frames = 0;
    int n = 0, first = 0;
    char who[SST_HEALTH_NAME + 64];

    for (int cam = cameras - 1; cam >= 0; cam--) {
        bool *changed = ended ? &h->camera[cam][trouble].ended : &h->camera[cam][trouble].began;

        if (!*changed)
            continue;
        *changed = false;
        frames += h->camera[cam][trouble].events;
        first = cam;
        n++;
    }
    if (!n)
        return 0;
    if (n == 1)
        snprintf(who, sizeof(who), "camera %s", name[first]);
    else
        snprintf(who, sizeof(who), "%d of %d cameras, first camera %s", n, cameras, name[first]);
    if (ended)
        sst_log_warning("%s: recovered; before: %s (%llu frames)", who, texts[trouble].what,
                        (unsigned long long)frames);
    else
        sst_log_warning("%s: %s; %s", who, texts[trouble].what, texts[trouble].remedy);
    return 1;
}

int health_log(struct health *h, int cameras, const char (*name)[SST_HEALTH_NAME])
{
    int lines = 0;

    for (int i = 0; i < SST_TROUBLES; i++) {
        lines += log_change(h, (enum trouble)i, false, cameras, name);
        lines += log_change(h, (enum trouble)i, true, cameras, name);
    }
    return lines;
}
