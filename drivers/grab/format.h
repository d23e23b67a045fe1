/* drivers/grab/format.h - what picture a camera is asked for, and what it offers instead. Only for drivers/grab. */
#ifndef SST_DRIVERS_GRAB_FORMAT_H
#define SST_DRIVERS_GRAB_FORMAT_H

#include "drivers/grab/grab.h"

/**
 * Set format, size and rate, and read them back.
 *
 * @param stride  out: bytes of a row, 0 for compressed formats
 * @param why     out [size]: on -EINVAL what was refused and what the camera offers; with 0 "" or what is odd (a rate
 *                that the camera does not let choose, or another rate where frames are triggered)
 * @return 0, -EINVAL (it cannot do that), -EBUSY (another program has it), or the driver's -errno
 */
SST_MUST_CHECK int sst_format_set(int fd, const struct sst_grab_config *cfg, size_t *stride, char *why, size_t size);

/** One line of what a camera offers: "MJPG 1920x1080 1280x720, YUYV 640x480". */
void sst_format_summary(int fd, char *out, size_t size);

#endif
