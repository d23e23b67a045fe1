/* capture/array/ring.h - the sets of the last moments in fixed memory, for any number of slow readers.
 *
 * Frames are copied here and go back to their drivers at once: one copy, so that no reader, however slow or hung, can
 * keep a camera's buffers, and so that what came before an event can still be recorded. */
#ifndef SST_CAPTURE_ARRAY_RING_H
#define SST_CAPTURE_ARRAY_RING_H

#include "capture/array/sets.h"

struct sst_ring; /* opaque; any thread */

/** A set and its frames' bytes, read-only; lives until the last reference is dropped. */
struct sst_kept {
    uint64_t number;    /* of the ring: 1, 2, ... without gaps; set.index is the trigger's */
    int64_t kept_ns;    /* when it was put here */
    struct sst_set set; /* frame[] points to frame_data */
    size_t bytes;       /* of all frames */
};

struct sst_ring_counters {
    uint64_t kept, complete;
    uint64_t refused;  /* no memory for them: all that is there is being read */
    uint64_t bytes;    /* held now */
    int sets;          /* held now */
    int64_t oldest_ns; /* set.t_ns of the oldest; 0: none */
};

/** @param bytes  memory for frames, taken at once @return 0, -EINVAL, -ENOMEM */
SST_MUST_CHECK int sst_ring_create(struct sst_ring **out, size_t bytes);

/** Copy a set in; the oldest that nobody reads make room. @return 0, or -ENOBUFS (counted) */
SST_MUST_CHECK int sst_ring_put(struct sst_ring *ring, const struct sst_set *set);

/**
 * Take a reference.
 * @param number  of the set wanted: at least this; 0: the newest
 * @return the set with the lowest number >= `number` that is still held, or the newest; NULL: there is none (yet)
 */
const struct sst_kept *sst_ring_get(struct sst_ring *ring, uint64_t number);

/** Newest complete set with a number above `after`; with none, the newest one. NULL: nothing newer. References as
 *  above. @param dropped  out, sets between `after` and it */
const struct sst_kept *sst_ring_newest(struct sst_ring *ring, uint64_t after, uint64_t *dropped);

void sst_ring_unref(struct sst_ring *ring, const struct sst_kept *kept);

/** Wait for a set with a number above `after`. @return true: there is one; false: time is up or the ring was closed */
bool sst_ring_wait(struct sst_ring *ring, uint64_t after, int timeout_ms);

/** Wake all that wait; from then on waiting returns false at once. */
void sst_ring_shut(struct sst_ring *ring);

void sst_ring_counters(struct sst_ring *ring, struct sst_ring_counters *out);

/** All references must have been dropped. NULL is fine. */
void sst_ring_destroy(struct sst_ring *ring);

#endif
