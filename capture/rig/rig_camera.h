/* capture/rig/rig_camera.h - camera on a rig: it grabs on its own thread, so that its stream never waits for the
 * motors. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_CAPTURE_RIG_RIG_CAMERA_H
#define SST_CAPTURE_RIG_RIG_CAMERA_H

#include "capture/rig/rig.h"
#include "config/array.h"
#include "drivers/grab/grab.h"

struct sst_scan_grab; /* opaque; one thread at a time */

/**
 * Open the camera, start its stream and, with source gpio, the trigger that exposes it.
 *
 * @param array   cameras: size, format, rate, controls; trigger
 * @param which   serial or port; NULL: the only connected camera
 * @param cancel  ends waiting; may be NULL
 * @param camera  out: valid until close
 * @return 0, -ENODEV (no such camera, or several: they are listed), or an error of the drivers; logged.
 */
SST_MUST_CHECK int sst_scan_grab_open(struct sst_scan_grab **out, const struct sst_array_config *array,
                                      const char *which, const SST_ATOMIC(bool) * cancel,
                                      struct sst_scan_camera *camera);

void sst_scan_grab_counters(const struct sst_scan_grab *grab, struct sst_grab_counters *out);

/** NULL is fine. */
void sst_scan_grab_close(struct sst_scan_grab *grab);

#endif
