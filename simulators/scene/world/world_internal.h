/* simulators/scene/world/world_internal.h - private declarations of this folder; code outside of it includes the
 * public headers. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_SIMULATORS_SCENE_WORLD_WORLD_INTERNAL_H
#define SST_SIMULATORS_SCENE_WORLD_WORLD_INTERNAL_H

#include <stdbool.h>

#include "pipeline/image/image.h"
#include "simulators/scene/hedge.h"
#include "simulators/scene/surfaces.h"
#include "simulators/scene/world/settings.h"
#include "simulators/scene/world/sim_world.h"

/* --- board: calibration boards as surfaces of a scene. --- */

/*
 * Boards as OpenCV and Kalibr draw them, cols x rows squares or tags. In a board's own axes, seen from the front, x is
 * right and y down, z away from the viewer, the origin its centre.
 *   chessboard  the upper left square is black
 *   ChArUco     the same; markers of DICT_4X4_50 with a border of one module in the white squares, numbered row by row
 *   AprilGrid   tags 36h11 with a border of two modules, numbered row by row from the upper left; small black squares
 *               between the corners of the tags
 * Around it is a white margin of half a square, on an AprilGrid of the gap between tags.
 */

/** Numbers of available markers. */
#define SST_SIM_CHARUCO_MARKERS 50
#define SST_SIM_APRIL_TAGS      36

#define SST_SIM_BOARD_WHITE 0xEC /* sRGB */
#define SST_SIM_BOARD_BLACK 0x14

/** Size of the board without its margin. */
void sim_board_size(const struct sst_sim_board *board, double *width_mm, double *height_mm);
/** Width of the white margin around the pattern. */
double sim_board_margin(const struct sst_sim_board *board);

/**
 * The pattern at a point of the board, mm from its centre; white beyond it.
 * @param clear_mm  out: distance in x and in y without an edge of the pattern
 */
bool sim_board_white(const struct sst_sim_board *board, double x_mm, double y_mm, double *clear_mm);

/** Fill in poses 0 .. board->poses-1 from the seed: in front of the array, in all orientations, a third to half of a
 *  picture. With board->fill at two depths, in a grid that reaches beyond the pictures, so that every camera gets all
 *  that a calibration needs (pipeline/calibration/board/coverage.h). */
void sim_board_seed_poses(struct sst_sim_board *board, const struct sst_sim_settings *settings,
                          const struct sst_scene_world *world);

/** Add the board, which must outlive the world, to it in one of its poses. */
void sim_board_add(struct sst_scene_world *w, const struct sst_sim_board *board, int pose);

/** Ideal cameras of "board", unless another scene's are configured. */
#define SST_SIM_BOARD_FOCAL      1200 /* design px */
#define SST_SIM_BOARD_SPACING_MM 60

#define SST_SIM_BOARD_FLOOR_MM 900 /* below the reference camera */

/** Depth of the wall behind boards: larger for longer focal lengths. */
double sim_board_wall_mm(double focal);

/** Add an empty room for boards to a world with a focal length. */
void sim_board_room(struct sst_scene_world *w);

/** A camera and a board in the empty room. */
struct sim_board_view {
    const struct sst_sim_board *board;
    int pose;
    double floor_mm, wall_mm; /* surfaces beyond them are hidden */
    double focal_px, cx, cy;  /* of the ideal picture */
    double eye_mm[3];
    const struct sst_scene_warp *warp; /* of the picture's size; or NULL */
};

/**
 * Draw the board into a picture of the room: 64 samples per pixel, weighted by a pixel's area and the blur of a lens,
 * about half a pixel. Unrealistically sharp edges would shift detected corners by up to a tenth of a pixel. A pose's
 * blur_px is a movement along x during the exposure.
 *
 * @return 0 or -ENOMEM
 */
SST_MUST_CHECK int sim_board_draw(const struct sim_board_view *view, struct sst_image *image);

/* --- camera: true parameters and geometry of each simulated camera. --- */

/** The ideal camera of a scene at a picture size. */
struct sim_optics {
    double focal_px, cx, cy; /* px, pixel centres on integers */
    double spacing_mm;
};

/**
 * One camera. A point X (mm, array axes: x right, y down, z forward, origin at the reference camera) is at
 * P = rotation (X - position_mm) in camera axes, a = P.x / P.z, b = P.y / P.z, r2 = a^2 + b^2, and is seen at
 *   x = fx a' + cx, y = fy b' + cy with a' = a (1 + k1 r2 + k2 r2^2 + k3 r2^3) + 2 p1 a b + p2 (r2 + 2 a^2),
 *   b' = b (...) + p1 (r2 + 2 b^2) + 2 p2 a b   (Brown 1966, as in OpenCV).
 */
struct sim_camera {
    double fx, fy, cx, cy;
    double distortion[5]; /* k1 k2 p1 p2 k3 */
    double rotation[9];
    double position_mm[3];
    double gain[3]; /* of linear red, green, blue */
    struct sst_sim_timing timing;
};

/** Parameters of camera cam, by the settings' seed: the same for any size of the grid. */
void sim_camera_make(struct sim_camera *out, const struct sst_sim_settings *s, const struct sim_optics *ideal, int cam);

/**
 * Remove the distortion (Newton's method).
 *
 * @param u,v  distorted: (x - cx) / fx, (y - cy) / fy
 * @return false: no point is seen there, the lens folds over before it
 */
SST_MUST_CHECK bool sim_camera_undistort(const struct sim_camera *camera, double u, double v, double *a, double *b);

/** Rotate a camera (in its own axes) and shift it according to the move of camera cam in the settings. */
void sim_camera_move(struct sim_camera *camera, const struct sst_sim_settings *s, int cam);

/** A standard normal random number. */
double sim_normal(uint64_t *rng);

/** Rotations about x, then y, then z, in degrees, as a matrix. */
void sim_rotation(const double deg[3], double matrix[9]);

/* --- convert: conversion of decoded frames to the sizes and pixel formats of cameras. --- */

/** Scale down: mean of the pixels covered by each pixel of the smaller picture. @param out  out, initialised by the
 *  caller */
void sim_shrink(const struct sst_image *in, struct sst_image *out);

/** Bytes of a frame of an uncompressed format; 0: unsupported format. */
size_t sim_format_bytes(uint32_t fourcc, int width, int height);

/** Pack a picture without padding; Bayer keeps one colour of each pixel. @param out [sim_format_bytes()] */
void sim_pack(const struct sst_image *img, uint32_t fourcc, uint8_t *out);

/** Set rows 0 .. height-1 of a packed picture to grey luma. @param luma [height][width] */
void sim_pack_luma(const uint8_t *luma, int width, int height, uint32_t fourcc, uint8_t *out);

/* --- strip: machine-readable strip along the upper edge of a simulated frame. --- */

/*
 * Cells of 8x8 px, black (luma 16) for 0 and white (240) for 1, in rows from the upper left; after the last bit black.
 * Each cell is one block of a JPEG. Numbers are unsigned, high bit first, and clamped to their bits:
 *   camera 8 | trigger 40 | start of exposure, ns 56 | exposure, us 20 | gain in 1/64 12 | pose x, y, z in um, two's
 *   complement 3 x 24 | CRC-32 (IEEE 802.3) of the 26 bytes before 32
 */
#define SST_STRIP_CELL  8
#define SST_STRIP_BITS  240
#define SST_STRIP_BYTES (SST_STRIP_BITS / 8)
#define SST_STRIP_BLACK 16
#define SST_STRIP_WHITE 240

/** Height of the strip in a frame of this width (a multiple of 8; 24 at 640). */
int strip_height(int width);

/** The strip's bits, high bit of the first byte first. */
void strip_pack(const struct sst_sim_exposure *exposure, uint8_t bits[SST_STRIP_BYTES]);

/** Colour of cell i: bit i, or 0 after the last. */
static inline bool strip_cell(const uint8_t bits[SST_STRIP_BYTES], int i)
{
    return i < SST_STRIP_BITS && (bits[i / 8] >> (7 - i % 8) & 1);
}

/** Draw the strip into luma. @param luma [strip_height(width)][stride] */
void strip_draw(uint8_t *luma, size_t stride, int width, const struct sst_sim_exposure *exposure);

/* --- jpeg: frames as JPEG 4:2:2 with a restart after each row of blocks, and the strip drawn into them. --- */

/** A frame's bytes and the position of the strip. */
struct sim_jpeg {
    uint8_t *data;
    uint32_t bytes;
    uint32_t scan;    /* first byte after the headers */
    uint32_t rest;    /* first byte after the strip's rows; scan where the frame has none */
    uint32_t dc_step; /* of luma: quantiser of the blocks' means */
};

/**
 * Encode a picture.
 *
 * @param strip  leave room for the strip: a picture at least as high as it
 * @param out    data to free with free()
 * @return 0, -EINVAL (no room for the strip), -ENOMEM, -EIO (the encoder refuses; logged).   Thread: any.
 */
SST_MUST_CHECK int sim_jpeg_encode(const struct sst_image *img, int quality, bool strip, struct sim_jpeg *out);

/**
 * Copy a frame and draw its strip: the rows of the strip are encoded, all others are copied.
 *
 * @param exposure  NULL: no strip, a plain copy
 * @return 0 or -ENOSPC
 */
SST_MUST_CHECK int sim_jpeg_copy(const struct sim_jpeg *in, int width, const struct sst_sim_exposure *exposure,
                                 struct sst_sim_room out, size_t *bytes);

/* --- mosaic: pictures of several cameras in one, as boards with several sensors deliver them. --- */

struct sim_mosaic {
    int rows, cols, width, height; /* cameras in a picture, and their size */
    size_t part_bytes;             /* of an uncompressed picture of one */
};

/** Put the uncompressed picture of camera `at`, row by row from 0, into the whole. */
void sim_mosaic_rows(uint8_t *whole, const uint8_t *part, const struct sim_mosaic *mosaic, int at);

/** Join JPEGs of sim_jpeg_copy() into one without coding them again. @param parts  [rows * cols]
 *  @return 0, -ENOSPC, -EINVAL (others) */
SST_MUST_CHECK int sim_mosaic_jpeg(const struct sim_mosaic *mosaic, const struct sst_sim_room *parts,
                                   struct sst_sim_room out, size_t *bytes);

/* --- loop: prepared frames of all cameras: rendered once, cached in a file, mapped into memory. At once: the first frame
 * of each camera is there after open, and the others are rendered in the background. --- */

#define SST_SIM_KEY_BYTES 32

/**
 * Render and encode all frames of one camera.
 *
 * @param frames  out, [number of frames]; data freed by the caller, also after a failure; zeroed before the call
 * @return 0 or a negative errno, logged.   Thread: several at a time, each with its own camera.
 */
typedef int sim_render_fn(void *arg, int cam, struct sim_jpeg *frames);

struct sim_loop; /* opaque; read-only after open */

struct sim_loop_config {
    const char *folder; /* of the cache, created if missing */
    const uint8_t *key; /* [SST_SIM_KEY_BYTES] */
    const char *name;   /* of the world, for progress on a terminal */
    int cams, frames;
    sim_render_fn *render;
    void *arg;
    sim_render_fn *render_first; /* of one frame; NULL: all frames are rendered before open returns */
};

/**
 * Map the loop of a key; renders it and writes its file first if it is not in the cache.
 *
 * @return 0, -ENOMEM, -EIO/-ENOSPC/-EROFS/-EACCES (cache), or the error of render; logged
 */
SST_MUST_CHECK int sim_loop_open(struct sim_loop **out, const struct sim_loop_config *cfg);
/** Wait for the render functions, which the caller makes return early. */
void sim_loop_close(struct sim_loop *loop);

/** Are all frames there? Until then only the first one of each camera is. Thread: any */
bool sim_loop_whole(const struct sim_loop *loop);

/** A frame; its data is borrowed and read-only. */
struct sim_jpeg sim_loop_frame(const struct sim_loop *loop, int cam, int frame);

/* --- photo: sensor model: exposure, gains, vignetting, noise. Bytes are sRGB, light is linear. --- */

/** Multiply the light of a picture. */
void sim_light(struct sst_image *img, double factor);

struct sim_photo; /* opaque; read-only after create */

SST_MUST_CHECK int sim_photo_create(struct sim_photo **out, const struct sst_sim_settings *settings);

struct sim_exposing {
    const struct sim_camera *camera;
    double light;  /* of the scene; 1: nominal */
    uint64_t seed; /* of the noise */
};

/**
 * Apply the sensor model to a picture: light times the camera's gain times 1 - vignetting r^2 (r from the principal
 * point in half diagonals of the picture), then noise of standard deviation sqrt(e + read^2) electrons where white is
 * full_well_e, then sRGB. An ideal camera's picture is copied unchanged.
 *
 * @param out  of the size of in, initialised by the caller; may be equal to in
 */
void sim_photo_expose(const struct sim_photo *photo, const struct sim_exposing *e, const struct sst_image *in,
                      struct sst_image *out);

/* --- render: rendering of a world at any time by each camera. --- */

/** The scene without surfaces (simulators/scene/hedge.h): ideal cameras of an array, no rig, no board. */
#define SIM_HEDGE "hedge"

/** The forest (simulators/flight/flight.h): an array of tilted cameras without distortion that looks down. */
#define SIM_FOREST "forest"

struct sim_stage; /* opaque; read-only after open */

/**
 * @param settings  must outlive the stage
 * @return 0, -EINVAL (unknown scene, a lens that folds the picture over; logged), -ENOMEM
 */
SST_MUST_CHECK int sim_stage_open(struct sim_stage **out, const struct sst_sim_settings *settings);
void sim_stage_close(struct sim_stage *stage);

const struct sim_optics *sim_stage_optics(const struct sim_stage *stage);
const struct sim_camera *sim_stage_camera(const struct sim_stage *stage, int cam);
/** The camera's parameters from frame *at of the loop on; NULL: it does not move. */
const struct sim_camera *sim_stage_moved(const struct sim_stage *stage, int cam, int *at);
/** The board with all its poses; kind SST_SIM_NO_BOARD: none. */
const struct sst_sim_board *sim_stage_board(const struct sim_stage *stage);
/** Number of frames that are rendered, and that are shown in a loop: some are shown several times. */
int sim_stage_frames(const struct sim_stage *stage);
int sim_stage_steps(const struct sim_stage *stage);
/** The frame at a step of the loop. */
int sim_stage_frame_at(const struct sim_stage *stage, int step);

/** Called for each picture in order; the picture has native size and is borrowed. @return 0, or a negative errno to
 *  stop */
typedef int sim_picture_fn(void *arg, int frame, const struct sst_image *image);

/** Render the whole loop of a camera of an array. @return 0, -ENOMEM or the error of fn.   Thread: any. */
SST_MUST_CHECK int sim_stage_loop(const struct sim_stage *stage, int cam, sim_picture_fn *fn, void *arg);

/** Render one picture of the rig's camera. @return as sim_stage_loop().   Thread: any. */
SST_MUST_CHECK int sim_stage_pose(const struct sim_stage *stage, const int32_t pose_um[3], int frame,
                                  sim_picture_fn *fn, void *arg);

/**
 * Exact depth and labels along many rays from a viewpoint; boards are surfaces here. Not of a hedge or forest.
 *
 * @param rays   their positions in the ideal picture of that viewpoint, as set with sst_scene_warp_init(); indexed here
 * @param depth  out, mm from the viewpoint along z, 0: nothing; of the rays' size, like label; either may be NULL
 * @return 0, -EINVAL (a hedge or forest), -ENOMEM.   Thread: any.
 */
SST_MUST_CHECK int sim_stage_look(const struct sim_stage *stage, int frame, const double eye_mm[3],
                                  struct sst_scene_warp *rays, struct sst_map_f32 *depth, struct sst_map_u8 *label);

/* --- truth: true parameters of a world as JSON or as a calibration. --- */

/** @return 0, -ENOMEM, or the error of the output; logged */
SST_MUST_CHECK int sim_truth_write(const struct sst_sim_settings *settings, const struct sim_stage *stage,
                                   const char *path);

/**
 * Write the true parameters as a calibration in the reference camera's axes (pipeline/camera/calib.h): of an array's
 * cameras before they move; of a rig at the positions one spacing apart of its light field, pointing straight ahead. A
 * calibration's fall-off is about the principal point, the world's about the picture's centre: exact where both agree.
 * @return as sim_truth_write(), -EINVAL (not finite)
 */
SST_MUST_CHECK int sim_truth_calib(const struct sst_sim_settings *settings, const struct sim_stage *stage,
                                   const char *path);

#endif
