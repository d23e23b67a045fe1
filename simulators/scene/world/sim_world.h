/* simulators/scene/world/sim_world.h - the simulated world: the frame of each camera at any time and pose. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_SIMULATORS_SCENE_WORLD_SIM_WORLD_H
#define SST_SIMULATORS_SCENE_WORLD_SIM_WORLD_H


#include "base/base.h"
#include "base/file.h"
#include "simulators/scene/world/settings.h"

struct sst_sim_world; /* opaque; frames from one thread at a time */

/** Timing of a camera relative to the trigger. */
struct sst_sim_timing {
    int64_t delay_ns;        /* from the trigger's edge to start of exposure */
    int64_t jitter_ns;       /* standard deviation of the delay */
    int64_t latency_ns;      /* from the end of exposure to the finished buffer */
    int64_t clock_offset_ns; /* offset of its time stamps ... */
    double clock_drift_ppm;  /* ... and drift since the start of the world */
    int64_t phase_ns;        /* of its free run */
};

/** One exposure: the truth, also written into the frame's strip. */
struct sst_sim_exposure {
    int cam;
    uint64_t trigger; /* index of the edge, or of the frame in free run */
    int64_t t_ns;     /* true start of exposure, CLOCK_MONOTONIC */
    int exposure_us;
    double gain;        /* 1: nominal */
    int32_t pose_um[3]; /* of the rig; 0 on an array */
};

/**
 * Read a world and prepare it: render and encode its loop, or load it from the cache.
 *
 * @param world  name of a scene, or path of a world file (YAML); NULL: "pedestrian"
 * @param cache  folder for prepared loops; NULL: $XDG_CACHE_HOME/sst-sim or ~/.cache/sst-sim
 * @return 0, -EINVAL/-EBADMSG (world file), -ENOMEM, -EIO, -ENOSPC; logged.
 */
SST_MUST_CHECK int sst_sim_world_open(struct sst_sim_world **out, const char *world, const char *cache);
/** Line on standard error for each camera of a loop that is prepared in the background: world, done, all. */
#define SIM_LOOP_PROGRESS "preparing the world %s: %d of %d cameras"

/** The same, but a loop that is not in the cache is prepared in the background: until it is there, each camera delivers
 *  the first picture of the loop. */
SST_MUST_CHECK int sst_sim_world_open_at_once(struct sst_sim_world **out, const char *world, const char *cache);

/** Folder of prepared loops, which is created. @param cache  as for sst_sim_world_open() @return 0, -EINVAL, -EIO;
 * logged */
SST_MUST_CHECK int sst_sim_world_cache(char out[SST_PATH_MAX], const char *cache);

void sst_sim_world_close(struct sst_sim_world *world);

/** Devices: 36 for an array, 1 on a rig; with `split` each delivers the pictures of several cameras in one. */
int sst_sim_world_cameras(const struct sst_sim_world *world);
/** Width and height are those of native frames, exposure_us the result of automatic exposure at nominal light. */
const struct sst_sim_settings *sst_sim_world_settings(const struct sst_sim_world *world);
const struct sst_sim_timing *sst_sim_world_timing(const struct sst_sim_world *world, int cam);

/**
 * Hold the board in one of its poses, independent of time.
 *
 * @param pose  from 1; 0: by time again, on a rig the first
 * @return 0, -ERANGE (no such pose)
 */
SST_MUST_CHECK int sst_sim_world_hold(struct sst_sim_world *world, int pose);

/**
 * Write all true parameters of a world (cameras, loop, board) without preparing it: as JSON, which
 * docs/use/simulation.md explains, or to a name that ends in .yaml as a calibration (docs/integrate/formats.md) in the
 * reference camera's axes.
 *
 * @param world  as for sst_sim_world_open()
 * @return 0, -EINVAL/-EBADMSG (world file), -ENOMEM, or the error of the output; logged
 */
SST_MUST_CHECK int sst_sim_world_parameters(const char *world, const char *path);

/** Sizes that cameras offer, largest (native) first: count of {width, height}. */
int sst_sim_world_sizes(const struct sst_sim_world *world, const int (**sizes)[2]);

struct sst_sim_format {
    uint32_t fourcc; /* V4L2: MJPG, YUYV, GREY, Y16, BA81/GBRG/GRBG/RGGB */
    int width, height;
};

/** Memory for a frame. */
struct sst_sim_room {
    uint8_t *data;
    size_t bytes;
};

/**
 * Render the bytes that a camera delivers for an exposure. MJPEG at native size is copied from the prepared loop with
 * the strip drawn into it; other formats and sizes, and light other than nominal (exposure_us of the world at gain 1),
 * are decoded, scaled and converted from it, and cached. The loop's frame depends only on t_ns (with a rig the board
 * stays in its first pose, see sst_sim_world_hold()), except that cameras with the same trigger index and exposures
 * that begin within a quarter of the loop's step show the same one. A new pose of a rig is rendered on demand, which
 * takes most of a second.
 *
 * @param bytes  out: of the room that were written
 * @return 0, -EINVAL (unsupported format or size), -ENOSPC (the room is too small)
 */
SST_MUST_CHECK int sst_sim_world_frame(struct sst_sim_world *world, const struct sst_sim_exposure *exposure,
                                       struct sst_sim_format format, struct sst_sim_room out, size_t *bytes);

#endif
