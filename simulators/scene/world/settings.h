/* simulators/scene/world/settings.h - world files: the scene, its loop, and the imperfections of the cameras. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_SIMULATORS_SCENE_WORLD_SETTINGS_H
#define SST_SIMULATORS_SCENE_WORLD_SETTINGS_H

#include <stdbool.h>

#include "base/frame.h"

#define SST_SIM_POSES_MAX 64
#define SST_SIM_SPLIT_MAX 16 /* cameras in one picture */

enum sst_sim_board_kind {
    SST_SIM_NO_BOARD = 0,
    SST_SIM_CHESSBOARD = 1,
    SST_SIM_CHARUCO = 2,
    SST_SIM_APRILGRID = 3,
};

/** Pose of a board's centre: mm from the reference camera, and rotations about x, then y, then z. */
struct sst_sim_pose {
    double position_mm[3], rotation_deg[3];
    double blur_px; /* movement along x during the exposure */
};

struct sst_sim_board {
    enum sst_sim_board_kind kind;
    int cols, rows;   /* squares of a chessboard or ChArUco, tags of an AprilGrid */
    double square_mm; /* side of a square; of a tag */
    double marker;    /* ChArUco: side of a marker in squares; AprilGrid: gap between tags in tags */
    int poses;        /* shown one after another, one per frame of the loop */
    bool seeded;      /* derived from the seed */
    bool fill;        /* of the seeded poses: all cameras see the board in every part of their pictures */
    struct sst_sim_pose pose[SST_SIM_POSES_MAX];
};

/** Keys of one camera in a world file; bits of `given`. */
enum sst_sim_given {
    SST_SIM_DISTORTION = 1 << 0,
    SST_SIM_ROTATION = 1 << 1,
    SST_SIM_POSITION = 1 << 2,
    SST_SIM_FOCAL = 1 << 3,
    SST_SIM_PRINCIPAL = 1 << 4,
    SST_SIM_GAIN = 1 << 5,
    SST_SIM_DELAY = 1 << 6,
    SST_SIM_JITTER = 1 << 7,
    SST_SIM_LATENCY = 1 << 8,
    SST_SIM_PHASE = 1 << 9,
    SST_SIM_OFFSET = 1 << 10,
    SST_SIM_DRIFT = 1 << 11,
    SST_SIM_MOVES = 1 << 12,
};

struct sst_sim_override {
    unsigned given;
    double distortion[5], rotation_deg[3], position_mm[3], focal_percent, principal_px[2], gain[3];
    double delay_us, jitter_us, latency_us, phase_us, clock_offset_us, clock_drift_ppm;
    /* From this frame of the loop on it is additionally rotated (in its own axes) and shifted. */
    int moves_at;
    double moves_deg[3], moves_mm[3];
};

#define SST_SIM_STILL_FAULTS_MAX 64

/** A still camera over PTP in the place of the rig's camera. */
struct sst_sim_still {
    bool present;
    char serial[32];
    int battery_percent, card_mb;
    int lag_ms, write_ms; /* from the release to the exposure; from its end to the file on the card */
    bool mirror_lockup;   /* the first release lifts the mirror, the second one exposes */
    bool buffer;          /* it releases while it writes earlier pictures */
    int faults;
    struct {
        int shot; /* before this exposure, from 1 */
        char name[24];
        double value;
    } fault[SST_SIM_STILL_FAULTS_MAX];
};

/** One of several hosts with one array. */
struct sst_sim_host {
    double generator_hz;                     /* pulses on all trigger lines from outside; 0: none */
    double clock_offset_ms, clock_drift_ppm; /* of the wall clock that programs see, against the machine's */
};

/** Spreads are standard deviations of a normal distribution over the cameras. Plain values only: the bytes are the
 *  cache's key. */
struct sst_sim_settings {
    char scene[32];
    uint64_t seed;
    int rows, cols, width, height;
    double loop_s, rate_hz;
    int quality, exposure_us;
    bool strip, rig, rolling;
    double line_us;       /* rolling shutter: delay from row to row */
    double light_percent; /* amplitude of the light's variation, once per loop */
    /* optics: */
    char optics_scene[32]; /* scene that gives focal length, principal point and spacing; "": its own */
    double distortion[5], distortion_spread[5]; /* k1 k2 p1 p2 k3 */
    double focal_spread_percent, principal_spread_px;
    double vignetting; /* light lost in the corners, 0..1 */
    /* mounting: */
    double rotation_spread_deg, position_spread_mm; /* of each axis */
    /* sensor: */
    double gain_spread_percent, balance_spread_percent;
    double full_well_e, read_noise_e; /* full_well_e 0: no noise */
    /* timing: */
    double delay_us, delay_spread_us, jitter_us, latency_us, latency_spread_us, phase_spread_us;
    double clock_offset_spread_us, clock_drift_spread_ppm;
    struct sst_sim_board board;
    struct sst_sim_override camera[SST_CAMERAS_MAX];
    double forest_high_m, forest_trees; /* scene forest: cameras above the ground; trees per 100 m^2 */
    /* At last, because pictures do not depend on them: no part of the cache's key. */
    struct sst_sim_host host;
    struct sst_sim_still still;
    int split_rows, split_cols; /* cameras in the picture of each device: boards with several sensors */
};

/** Ideal cameras for a scene, or for "board", an empty wall with a calibration board in front of it. */
void sst_sim_settings_defaults(struct sst_sim_settings *s, const char *scene);

/**
 * Read the settings of a world: the name of a scene, or a world file.
 *
 * @return 0, -EINVAL (neither), -ENOENT, -EBADMSG (all faults logged with file:line:column), -ENOMEM
 */
SST_MUST_CHECK int sst_sim_settings_read(struct sst_sim_settings *s, const char *world);

#endif
