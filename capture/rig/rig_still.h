/* capture/rig/rig_still.h - a still camera on a rig: one exposure a view, its files unchanged. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_CAPTURE_RIG_RIG_STILL_H
#define SST_CAPTURE_RIG_RIG_STILL_H

#include "capture/rig/rig.h"
#include "drivers/still/still.h"

struct sst_scan_still; /* opaque; one thread at a time */

/**
 * Open the camera and log its settings, its battery and its card.
 *
 * @param camera  out: valid until close
 * @return 0, or as sst_still_open(), -ENOPKG also where raw files cannot be developed; logged.
 */
SST_MUST_CHECK int sst_scan_still_open(struct sst_scan_still **out, const struct sst_still_config *cfg,
                                       struct sst_scan_camera *camera);

void sst_scan_still_counters(const struct sst_scan_still *still, struct sst_still_counters *out);
/** Battery and card before the last exposure, as in the manifest. @return a new reference; NULL: no memory */
json_t *sst_scan_still_state(const struct sst_scan_still *still);

/** NULL is fine. */
void sst_scan_still_close(struct sst_scan_still *still);

#endif
