/* pipeline/live/hidden/hidden.h - occluded objects behind leaves: people and vehicles that a single view shows only in
 * pieces.
 *
 * Each view is compared with its background model (leaves swing to and fro, so every pixel has several colours). The
 * differences, not the pictures, are then integrated over all views on planes behind the leaves. An object on a plane
 * adds up there; leaves that differ have another parallax and do not. An object is reported when it stays above the
 * level that the leaves of this scene reach by themselves: see alarms_per_hour. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_LIVE_HIDDEN_HIDDEN_H
#define SST_PIPELINE_LIVE_HIDDEN_HIDDEN_H

#include "pipeline/lightfield/lightfield.h"

#define SST_HIDDEN_THINGS 8

struct sst_hidden; /* opaque; one thread at a time */

struct sst_hidden_config {
    int views, width, height;                    /* px */
    double bx[SST_MAX_VIEWS], by[SST_MAX_VIEWS]; /* offsets from the reference view, spacings */
    bool used[SST_MAX_VIEWS];
    double alarms_per_hour; /* false alarms that are accepted */
    int threads;
};

struct sst_hidden_input {
    int64_t t_ns;
    const struct sst_image *image[SST_MAX_VIEWS]; /* NULL: missing; its differences stay */
    const uint8_t *changed[SST_MAX_VIEWS];        /* [tiles of 32 px] 0: as in the set before; NULL: all changed */
    /* Disparities of the scene. The search covers the depths behind the leaves: behind front_px, or, with the
     * disparities of the reference view, behind a good part of its surfaces at the place. */
    double far_px, near_px, front_px;
    const struct sst_map_u16 *disp; /* NULL: front_px */
    double disp_min_px;             /* of stored value 0 */
};

/** Something that is there now. */
struct sst_hidden_thing {
    uint32_t key;          /* the same from set to set */
    bool reported;         /* false: it may still be chance */
    bool seen;             /* in the last set that was searched, or since then nothing has changed */
    double x0, y0, x1, y1; /* in the reference view, px */
    double vx_px_s, vy_px_s;
    double disp_px;
    double evidence; /* sum over its sets of its excess over the background there, in standard deviations */
    int64_t first_ns, seen_ns;
};

/** @return 0, -EINVAL (no view is used, sizes), -ENOMEM; not logged */
SST_MUST_CHECK int sst_hidden_open(struct sst_hidden **out, const struct sst_hidden_config *cfg);
void sst_hidden_close(struct sst_hidden *h); /* NULL is fine */

/**
 * Follow one set. In the first 30 s, and when wind begins after a calm, an object is reported if it has moved by
 * half of its size and has half as much evidence again. Sets less than 0.15 s after the last searched one are not
 * searched: objects stay as they are, and changes are searched with a later set. The same sets give the same objects
 * for any number of threads.
 *
 * @return 0, -ENOMEM
 */
SST_MUST_CHECK int sst_hidden_update(struct sst_hidden *h, const struct sst_hidden_input *in);

/** Objects as of the last update, including possible chance. @return number */
int sst_hidden_things(const struct sst_hidden *h, struct sst_hidden_thing out[SST_HIDDEN_THINGS]);

/** Evidence that a thing needs to be reported. */
double sst_hidden_threshold(const struct sst_hidden *h);

#endif
