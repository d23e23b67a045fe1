/* capture/calibration/calibration_internal.h - board search in one picture; callers use gather.h. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_CAPTURE_CALIBRATION_CALIBRATION_INTERNAL_H
#define SST_CAPTURE_CALIBRATION_CALIBRATION_INTERNAL_H

#include "capture/calibration/gather.h"

/** Number of frames selected out of `all`. */
static inline int gather_selection_count(const struct sst_gather_selection *selection, int all)
{
    const int some = selection->every > 1 ? (all + selection->every - 1) / selection->every : all;

    return selection->max && some > selection->max ? selection->max : some;
}

/** Index of the i-th selected frame out of `all`: spread evenly. */
static inline int gather_selection_at(const struct sst_gather_selection *selection, int all, int i)
{
    const int every = selection->every > 1 ? selection->every : 1, some = (all + every - 1) / every;

    return (int)((long long)i * some / gather_selection_count(selection, all)) * every;
}

/** The result of one picture; zeroed before use. */
struct gather_result {
    enum sst_detect_outcome outcome;
    bool present; /* there was a picture */
    bool damaged; /* there was a frame that cannot be decoded */
    struct sst_detection detection;
    struct sst_photometric_samples light;
};

/** Find the board in one picture; the picture is released. */
SST_MUST_CHECK int gather_detect(struct gather_result *out, const struct sst_gather_config *cfg,
                                 struct sst_image *image, int view, int frame);
/** Move a result into the gathered samples. */
SST_MUST_CHECK int gather_add(struct sst_gathered *to, struct gather_result *result);
void gather_result_fini(struct gather_result *result);

#endif
