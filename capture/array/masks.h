/* capture/array/masks.h - privacy masks: blocks of the cameras' frames that are black before anything else reads them. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_CAPTURE_ARRAY_MASKS_H
#define SST_CAPTURE_ARRAY_MASKS_H

#include "capture/array/frame_sync.h"
#include "config/array.h"

struct sst_masks; /* opaque; one thread */

/**
 * Place the masks of a configuration in the frames of its cameras.
 *
 * A mask of one camera covers the blocks (pipeline/image/blank.h) that its region touches. A mask of the reference view
 * covers in every camera the blocks that any point of the region between its depths is seen in, and their
 * neighbours within SST_MASKS_MARGIN_PX: block at q of view k is black if q + d b_k is in the region for a disparity d between
 * far_px and near_px (docs/design/design.md, 4). Positions are rectified by the calibration; without one, b_k are the steps of
 * the lattice, and a warning is logged. Frames of a camera that the calibration lacks, or has no place (a negative row), are black as a whole.
 *
 * @param out  NULL where the configuration has no masks
 * @return 0, -ENOENT/-EBADMSG (calibration, also one of another grid or size), -EINVAL (a format that cannot be masked),
 * -ENOMEM; logged
 */
SST_MUST_CHECK int sst_masks_create(struct sst_masks **out, const struct sst_array_config *array);
void sst_masks_destroy(struct sst_masks *masks); /* NULL is fine */

/** Margin about masks of the reference view, for errors of the calibration. */
#define SST_MASKS_MARGIN_PX 4

/** Masked set: its frames have black blocks; `set` stays as it is. */
struct sst_masks_set {
    struct sst_frameset set; /* frame[] points to `frame`, or to frames without a mask */
    struct sst_frame frame[SST_CAMERAS_MAX];
    int withheld; /* frames left out of the set, since their masks could not be applied */
    int cam[SST_CAMERAS_MAX];
};

/**
 * The masked set. Its frames are valid until the next call.
 *
 * A frame that cannot be masked (a damaged JPEG) is left out, so that nothing of it is seen; logged once a minute for
 * each camera.
 */
void sst_masks_apply(struct sst_masks *masks, const struct sst_frameset *set, struct sst_masks_set *out);

/** Share of a camera's frames that is black, 0..1. */
double sst_masks_share(const struct sst_masks *masks, int cam);

#endif
