/* The cameras of this host as a source. They are started and report by events of their own: their frames have no index.
 */
#include "capture/array/array_internal.h"

static int grab_fd(const void *grab)
{
    return sst_grab_fd(grab);
}

static int grab_poll(void *grab)
{
    return sst_grab_poll(grab, 0);
}

static void grab_release(void *grab, struct sst_frame *frame)
{
    sst_grab_release(grab, frame);
}

static enum sst_grab_state grab_state(const void *grab, int cam)
{
    return sst_grab_camera_state(grab, cam);
}

static const struct sst_grab_device *grab_device(const void *grab, int cam)
{
    return sst_grab_camera_device(grab, cam);
}

static void grab_counters(const void *grab, int cam, struct sst_grab_counters *out)
{
    sst_grab_counters(grab, cam, out);
}

const struct sst_source_ops grab_source_ops = {
    .fd = grab_fd,
    .poll = grab_poll,
    .release = grab_release,
    .state = grab_state,
    .device = grab_device,
    .counters = grab_counters,
};
