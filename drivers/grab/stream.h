/* drivers/grab/stream.h - one open camera: negotiated, its buffers mapped and lent out as frames. Only for
 * drivers/grab. */
#ifndef SST_DRIVERS_GRAB_STREAM_H
#define SST_DRIVERS_GRAB_STREAM_H

#include "drivers/grab/identity.h"

#define SST_STREAM_BUFFERS_MAX 32

/**
 * Opaque. One owner at a time (the polling thread, or the job that works on it) makes all calls but release, which any
 * thread may make at any time. Memory stays mapped until the owner has closed it and the last frame is back.
 */
struct sst_stream;

/** What a filled buffer told besides its frame. */
struct sst_stream_stamp {
    bool monotonic;    /* t_ns is the driver's, else the time of arrival */
    bool end_of_frame; /* t_ns was taken at the end of the frame, not at the start of exposure */
};

/**
 * Open, check, set format, rate and controls, map buffers. May block.
 *
 * @param device  its name and driver are completed
 * @param why     out [SST_WHY_MAX]: the sentence of a failure
 * @param note    out [SST_WHY_MAX]: what is odd although it works; ""
 * @return 0, -ENOTTY (no capture node), -ENODEV (gone), -EINVAL, -EBUSY, -EACCES (all three: refused), -errno
 */
SST_MUST_CHECK int sst_stream_open(struct sst_stream **out, struct sst_grab_device *device,
                                   const struct sst_grab_config *cfg, int cam, char *why, char *note);

/** Queue all buffers that are not lent out, and stream. May block. @return 0, -ENOSPC (USB bandwidth), -errno; `why`
 * set */
SST_MUST_CHECK int sst_stream_start(struct sst_stream *stream, char *why);

/** From now frames that are released are kept and not queued; never blocks. To be called before stop or close. */
void sst_stream_detach(struct sst_stream *stream);

/** Stop streaming; the stream is detached. May block. */
void sst_stream_stop(struct sst_stream *stream);

/** Stop, close, and free as soon as no frame is lent out. May block. NULL is fine. */
void sst_stream_close(struct sst_stream *stream);

int sst_stream_fd(const struct sst_stream *stream);

/** Take a filled buffer: all of the frame but lost_before and faults that need its history (FLAGGED is set).
 *  @return 0, -EAGAIN (none now), or the driver's -errno */
SST_MUST_CHECK int sst_stream_take(struct sst_stream *stream, struct sst_frame **frame, struct sst_stream_stamp *stamp);

/** Buffers that the camera can fill. */
int sst_stream_queued(struct sst_stream *stream);

/** Since when there have been such buffers without a break, CLOCK_MONOTONIC; 0: there are none. */
int64_t sst_stream_ready_ns(struct sst_stream *stream);

/** Frames that the receiver has not given back. */
int sst_stream_lent(struct sst_stream *stream);

/** Give a frame back.  Thread: any. */
void sst_stream_release(struct sst_frame *frame);

#endif
