/* simulators/world/board.h - calibration boards as surfaces of a scene. */
#ifndef SST_SIMULATORS_WORLD_BOARD_H
#define SST_SIMULATORS_WORLD_BOARD_H

#include "simulators/scene/world.h"
#include "simulators/world/settings.h"

SST_EXTERN_C_BEGIN

/*
 * Boards as OpenCV and Kalibr draw them. In a board's own axes x is right and y down as one looks at it, z away from
 * the looker, the origin its centre; cols x rows squares or tags: chessboard   the upper left square is black ChArUco
 * the same, markers of DICT_4X4_50 with a border of one module in the white squares, numbered row by row AprilGrid tags
 * 36h11 with a border of two modules, numbered row by row from the upper left, small black squares between the corners
 * of the tags Around it is a white margin of half a square, on an AprilGrid of the gap between tags.
 */

/** Most squares or tags that there are markers for. */
#define SST_SIM_CHARUCO_MARKERS 50
#define SST_SIM_APRIL_TAGS      36

/** Size of the board without its margin. */
void sst_sim_board_size(const struct sst_sim_board *board, double *width_mm, double *height_mm);

/** Fill in poses 0 .. board->poses-1 from the seed: before the array, turned every way, a third to half of a picture.
 */
void sst_sim_board_seed_poses(struct sst_sim_board *board, const struct sst_sim_settings *settings,
                              const struct sst_world *world);

/** Add the board in one of its poses to a world. */
void sst_sim_board_add(struct sst_world *w, const struct sst_sim_board *board, int pose);

/** "board": an empty wall, for boards to be held before. */
sst_build_fn sst_sim_board_backdrop;

SST_EXTERN_C_END

#endif
