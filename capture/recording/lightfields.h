/* capture/recording/lightfields.h - light fields from sets of a recording. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_CAPTURE_RECORDING_LIGHTFIELDS_H
#define SST_CAPTURE_RECORDING_LIGHTFIELDS_H

#include "capture/recording/recording.h"
#include "pipeline/lightfield/calibrated.h"
#include "pipeline/posed/array.h"

struct sst_lightfields_config {
    const char *out; /* name for messages, of sst_recording_to_memory() */
    const int *sets; /* [count] numbers in the recording */
    int count;
    bool each; /* one folder out/set-NNNNNN per set and out/sets.json, even of one set; else out is the light field */
    bool allow_partial;                            /* views may be missing or damaged; the light field then has holes */
    bool force;                                    /* replace an existing output */
    double range_min_px, range_max_px;             /* disparities in the scene; equal: unknown */
    const struct sst_use_calibration *calibration; /* of this array, or NULL: the views stay as captured */
    const struct sst_posed *poses;                 /* ... or of cameras that stand anywhere, by position: the light fields
                                                      are posed ones of the sets' views; not in memory */
    const char *source;                            /* recorded as the origin; NULL: the recording's folder */
    const char *picture;                           /* name of a further file in each light field, or NULL */
    const void *picture_data;
    size_t picture_bytes;
    int threads;
    void (*progress)(void *arg, double done); /* or NULL */
    void *progress_arg;
};

/**
 * Make light fields of sets. JPEG stays as the camera sent it; other formats become PNG (pipeline/image/raw.h). Each
 * light field also gets set.json, the set's line of the recording. A calibration of other cameras, or of the
 * same cameras at other positions in the grid, is refused if it has serials, ports or names to compare.
 *
 * A view is missing where its frame is missing, damaged, marked bad by the driver, or no picture of the recording's
 * size.
 * @return 0, -EINVAL (cfg; of poses the number of views and the size are the recording's), -EBADMSG (a set is damaged or, without allow_partial, has missing views; the calibration
 *         does not fit), -EEXIST, -ENOSPC, -EIO, -ENOMEM; logged. All light fields appear or none.
 */
SST_MUST_CHECK int sst_recording_to_lightfields(const struct sst_recording *recording,
                                                const struct sst_lightfields_config *cfg);

/**
 * The light field that sst_recording_to_lightfields() would make of one set, loaded with SST_LOAD_SOURCES, without a
 * file (pipeline/lightfield/folder.h, without_folder).
 * @param cfg  of one set; each, force and picture do not count @return as sst_recording_to_lightfields()
 */
SST_MUST_CHECK int sst_recording_to_memory(struct sst_lightfield *out, const struct sst_recording *recording,
                                           const struct sst_lightfields_config *cfg);

#endif
