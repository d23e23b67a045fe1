/* capture/array/ring.h - ring of the most recent framesets in fixed memory, for any number of slow readers.
 *
 * Frames are copied here and released to their drivers at once. This one copy ensures that a slow or hung reader cannot
 * hold camera buffers, and that the time before an event can still be recorded. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_CAPTURE_ARRAY_RING_H
#define SST_CAPTURE_ARRAY_RING_H

#include "capture/array/frame_sync.h"

struct sst_ring; /* opaque; any thread */

/** A frameset and the bytes of its frames, read-only; freed with the last reference. */
struct sst_kept {
    uint64_t number;         /* in the ring: 1, 2, ... without gaps; set.index is the trigger's */
    struct sst_frameset set; /* frame[] points to frame_data */
    size_t bytes;            /* of all frames */
};

struct sst_ring_counters {
    uint64_t kept, complete;
    uint64_t refused;  /* not stored: all memory is in use by readers */
    uint64_t bytes;    /* stored now */
    int sets;          /* stored now */
    int64_t oldest_ns; /* set.t_ns of the oldest; 0: none */
};

/** @param bytes  memory for frames, allocated at once @return 0, -EINVAL, -ENOMEM */
SST_MUST_CHECK int sst_ring_create(struct sst_ring **out, size_t bytes);

/** Copy a frameset into the ring; drops the oldest unreferenced ones to make room. @return 0, or -ENOBUFS (counted) */
SST_MUST_CHECK int sst_ring_put(struct sst_ring *ring, const struct sst_frameset *set);

/**
 * Get a reference.
 * @param number  lowest acceptable number; 0: the newest set
 * @return the set with the lowest number >= `number` in the ring, or the newest; NULL: there is none (yet)
 */
const struct sst_kept *sst_ring_get(struct sst_ring *ring, uint64_t number);

/** Get a reference to the newest complete set with a number above `after`; without one, to the newest. NULL: none
 * newer.
 *  @param dropped  out, number of sets between `after` and it */
const struct sst_kept *sst_ring_newest(struct sst_ring *ring, uint64_t after, uint64_t *dropped);

/** Hide all sets from now on; readers keep the ones that they have. */
void sst_ring_forget(struct sst_ring *ring);

void sst_ring_unref(struct sst_ring *ring, const struct sst_kept *kept); /* NULL is fine */

/** Wait for a set with a number above `after`. @return false: time-out, or the ring was shut */
bool sst_ring_wait(struct sst_ring *ring, uint64_t after, int timeout_ms);

/** Wake all waiting threads; from then on waiting returns false at once. */
void sst_ring_shut(struct sst_ring *ring);

void sst_ring_counters(struct sst_ring *ring, struct sst_ring_counters *out);

/** All references must have been dropped. NULL is fine. */
void sst_ring_destroy(struct sst_ring *ring);

#endif
