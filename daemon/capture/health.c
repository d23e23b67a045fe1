#include "daemon/capture/health.h"

#include "base/log.h"

static const struct {
    const char *what, *remedy;
} texts[SST_TROUBLES] = {
    [SST_TROUBLE_FLAGGED] = { "the driver flags frames as damaged", "check its cable, hub and USB power" },
    [SST_TROUBLE_CUT] = { "frames end early", "check its cable, and the USB bandwidth by `sst plan`" },
    [SST_TROUBLE_DAMAGED] = { "frames are damaged", "check its cable, hub and USB power" },
    [SST_TROUBLE_STAMP] = { "time stamps jump", "its frames cannot be matched to triggers meanwhile" },
    [SST_TROUBLE_LOST] = { "the driver loses frames", "raise cameras: buffers, or see `sst plan`" },
    [SST_TROUBLE_FROZEN] = { "the picture stands still, byte for byte", "restart the camera if the scene moves" },
    [SST_TROUBLE_LATE] = { "frames come when their set is closed", "raise sets: wait_ms or lower the rate" },
    [SST_TROUBLE_DUPLICATE] = { "there is more than one frame for a trigger",
                                "check its trigger line for bouncing, and that the camera is in its triggered mode" },
    [SST_TROUBLE_STRAY] = { "frames belong to no trigger",
                            "check that the camera is in its triggered mode, and sets: window_us" },
};

static void tell(struct sst_health *h, int cam, enum sst_trouble trouble, const char *name)
{
    if (!h->camera[cam][trouble].on) {
        h->camera[cam][trouble].on = true;
        h->camera[cam][trouble].events = 0;
        sst_log_warning("camera %s: %s; %s", name, texts[trouble].what, texts[trouble].remedy);
    }
    h->camera[cam][trouble].events++;
    h->camera[cam][trouble].well = 0;
}

void sst_health_frame(struct sst_health *h, const struct sst_frame *frame, const char *name)
{
    static const struct {
        unsigned bits;
        enum sst_trouble trouble;
    } by_fault[] = {
        { SST_FRAME_FLAGGED, SST_TROUBLE_FLAGGED },
        { SST_FRAME_EMPTY | SST_FRAME_SHORT | SST_FRAME_NO_EOI, SST_TROUBLE_CUT },
        { SST_FRAME_NO_SOI | SST_FRAME_MARKER, SST_TROUBLE_DAMAGED },
        { SST_FRAME_BACKWARDS, SST_TROUBLE_STAMP },
        { SST_FRAME_FROZEN, SST_TROUBLE_FROZEN },
    };

    if (frame->lost_before)
        tell(h, frame->cam, SST_TROUBLE_LOST, name);
    for (size_t i = 0; i < ARRAY_LEN(by_fault); i++)
        if (frame->faults & by_fault[i].bits) {
            tell(h, frame->cam, by_fault[i].trouble, name);
            return; /* the flag says it all, a cut frame's markers are broken too */
        }
}

void sst_health_bucket(struct sst_health *h, const struct sst_frame *frame, enum sst_bucket bucket, const char *name)
{
    const int cam = frame->cam;

    if (bucket == SST_BUCKET_CORRUPT && !(frame->faults & SST_FRAME_BAD))
        tell(h, cam, SST_TROUBLE_STAMP, name);
    else if (bucket == SST_BUCKET_LATE)
        tell(h, cam, SST_TROUBLE_LATE, name);
    else if (bucket == SST_BUCKET_DUPLICATE)
        tell(h, cam, SST_TROUBLE_DUPLICATE, name);
    else if (bucket == SST_BUCKET_STRAY)
        tell(h, cam, SST_TROUBLE_STRAY, name);
}

void sst_health_set(struct sst_health *h, int cam, const char *name)
{
    for (int i = 0; i < SST_TROUBLES; i++) {
        if (!h->camera[cam][i].on || ++h->camera[cam][i].well <= SST_HEALTH_SETS)
            continue;
        h->camera[cam][i].on = false;
        sst_log_warning("camera %s: well again; that %s was so for %llu frames", name, texts[i].what,
                        (unsigned long long)h->camera[cam][i].events);
    }
}
