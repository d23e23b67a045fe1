/* drivers/grab/parts_internal.h - cameras in the picture of a device: their frames, and events for each. Only for
 * drivers/grab. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_DRIVERS_GRAB_PARTS_INTERNAL_H
#define SST_DRIVERS_GRAB_PARTS_INTERNAL_H

#include "drivers/grab/grab_internal.h"

/* --- parts.c ------------------------------------------------------------------------------------------------------ */

/** Name the devices of the configured cameras: g->place, g->camera. @return 0, -EINVAL: a binding names no part; logged
 */
SST_MUST_CHECK int parts_assign(struct sst_grab *grab, const struct sst_grab_config *cfg);

/** Make the frames of the parts of a sound picture. A damaged one gets its fault, one that cannot be cut UNFIT and its
 *  reason in `uncut`. */
void parts_make(struct sst_grab *grab, struct grab_camera *cam, struct sst_frame *whole);

/** Report the frames of all parts in place of the picture, which is counted; without faults the ones made by
 * parts_make(). */
void parts_deliver(struct sst_grab *grab, struct grab_camera *cam, const struct sst_frame *whole);

/** Report a state of each camera of the device. */
void parts_report_state(struct sst_grab *grab, struct grab_camera *cam, enum sst_grab_state state, const char *why);

/* --- stream.c: frames of a buffer --------------------------------------------------------------------------------- */

/** Frames of the parts of a whole picture, [parts]; they share its buffer. */
struct sst_frame *stream_parts(const struct sst_frame *whole);

/** Memory for the bytes of a part, kept with the buffer. NULL: none */
uint8_t *stream_part_room(const struct sst_frame *whole, int part, size_t bytes);

/** Lend `count` parts in place of the whole. */
void stream_lend_parts(const struct sst_frame *whole, int count);

#endif
