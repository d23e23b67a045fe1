/* capture/array/source.h - source of an array's frames: cameras of this host, or a source that numbers its frames by
 * trigger. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_CAPTURE_ARRAY_SOURCE_H
#define SST_CAPTURE_ARRAY_SOURCE_H

#include "drivers/grab/grab.h"

/** Reports of a source while it is polled, on the capture thread. */
struct sst_source_events {
    void *arg;
    /** A trigger has been counted; in order of its index. Its frames follow. @param edge  t_ns is a stamp of the edge
     */
    void (*trigger)(void *arg, uint64_t index, int64_t t_ns, bool edge);
    /** Frame of a camera for the trigger, owned by the receiver until it is released; NULL: none will come. */
    void (*frame)(void *arg, int cam, uint64_t index, struct sst_frame *frame);
    /** A camera delivers, or no longer. Already logged. */
    void (*state)(void *arg, int cam, enum sst_grab_state state, const char *why);
};

/** Verbs of a source, with the contracts of struct sst_grab's (drivers/grab/grab.h). */
struct sst_source_ops {
    /** Begin to deliver, to these events. @return 0, or -errno, logged */
    int (*start)(void *source, const struct sst_source_events *events);
    int (*fd)(const void *source);
    int (*poll)(void *source);
    void (*release)(void *source, struct sst_frame *frame); /* any thread */
    enum sst_grab_state (*state)(const void *source, int cam);
    const struct sst_grab_device *(*device)(const void *source, int cam);
    void (*counters)(const void *source, int cam, struct sst_grab_counters *out);
};

/** Borrowed by the capture that uses it. */
struct sst_source {
    const struct sst_source_ops *ops; /* NULL: the cameras of this host */
    void *object;
};

#endif
