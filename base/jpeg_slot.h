/* base/jpeg_slot.h - the newest JPEG of one picture stream, for any number of clients that never wait for one
 * another. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_BASE_JPEG_SLOT_H
#define SST_BASE_JPEG_SLOT_H

#include <stdbool.h>

#include "base/base.h"

struct sst_slot; /* opaque, counted; any thread */

/** One encoded picture; counted, read-only. */
struct sst_jpeg {
    uint64_t number;       /* 1, 2, ... in its slot */
    uint64_t set;          /* index of the trigger that it shows */
    int64_t t_ns, wall_ns; /* of the set: time zero */
    size_t bytes;
    const uint8_t *data;
};

/** @return 0, -ENOMEM */
SST_MUST_CHECK int sst_slot_create(struct sst_slot **out);
struct sst_slot *sst_slot_ref(struct sst_slot *slot);
void sst_slot_unref(struct sst_slot *slot); /* NULL is fine */

/** Store a new picture and wake the waiting clients. @param data  malloc'ed, owned from then on @return 0, -ENOMEM
 * (data is freed) */
SST_MUST_CHECK int sst_slot_put(struct sst_slot *slot, uint8_t *data, size_t bytes, uint64_t set, int64_t t_ns,
                                int64_t wall_ns);

/** Drop the newest picture; sst_slot_get() has none until the next one. */
void sst_slot_forget(struct sst_slot *slot);

/** Get a reference to the newest picture if its number is above `after`, else NULL; release it with
 *  sst_slot_jpeg_unref(). */
const struct sst_jpeg *sst_slot_get(struct sst_slot *slot, uint64_t after);
const struct sst_jpeg *sst_slot_jpeg_ref(const struct sst_jpeg *jpeg);
void sst_slot_jpeg_unref(const struct sst_jpeg *jpeg); /* NULL is fine */

/** Wait for a picture with a number above `after`. @return false: time-out, or shut */
bool sst_slot_wait(struct sst_slot *slot, uint64_t after, int timeout_ms);

/** Register and unregister a client: without clients the picture is not rendered. */
void sst_slot_join(struct sst_slot *slot);
void sst_slot_leave(struct sst_slot *slot);
int sst_slot_clients(struct sst_slot *slot);

/** Mark the end of the stream: waiting clients wake up and leave. */
void sst_slot_shut(struct sst_slot *slot);
bool sst_slot_is_shut(struct sst_slot *slot);

#endif
