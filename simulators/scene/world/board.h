/* simulators/scene/world/board.h - calibration boards as surfaces of a scene. */
#ifndef SST_SIMULATORS_SCENE_WORLD_BOARD_H
#define SST_SIMULATORS_SCENE_WORLD_BOARD_H

#include "simulators/scene/world.h"
#include "simulators/scene/world/settings.h"

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

#define SST_SIM_BOARD_WHITE 0xEC /* sRGB */
#define SST_SIM_BOARD_BLACK 0x14

/** Size of the board without its margin. */
void sst_sim_board_size(const struct sst_sim_board *board, double *width_mm, double *height_mm);
/** White beside the pattern. */
double sst_sim_board_margin(const struct sst_sim_board *board);

/**
 * The pattern at a point of the board, mm from its centre; white beyond it.
 * @param clear_mm  out: so far in x and in y there is no edge of the pattern
 */
bool sst_sim_board_white(const struct sst_sim_board *board, double x_mm, double y_mm, double *clear_mm);

/** Fill in poses 0 .. board->poses-1 from the seed: before the array, turned every way, a third to half of a picture.
 */
void sst_sim_board_seed_poses(struct sst_sim_board *board, const struct sst_sim_settings *settings,
                              const struct sst_world *world);

/** Add the board, which must stay, in one of its poses to a world. */
void sst_sim_board_add(struct sst_world *w, const struct sst_sim_board *board, int pose);

/** Ideal cameras of "board", unless they are those of another scene. */
#define SST_SIM_BOARD_FOCAL      1200 /* design px */
#define SST_SIM_BOARD_SPACING_MM 60

#define SST_SIM_BOARD_FLOOR_MM 900 /* below the reference camera */

/** Depth of the wall behind boards: narrow lenses stand further off. */
double sst_sim_board_wall_mm(double focal);

/** Add an empty room, for boards to be held in, to a world whose focal length is set. */
void sst_sim_board_room(struct sst_world *w);

/** A camera that looks at a board in the empty room. */
struct sst_sim_board_view {
    const struct sst_sim_board *board;
    int pose;
    double floor_mm, wall_mm; /* what is beyond them is not seen */
    double focal_px, cx, cy;  /* of the ideal picture */
    double eye_mm[3];
    const struct sst_warp *warp; /* of the picture's size; or NULL */
};

/**
 * Draw the board into a picture of the room: 64 samples of each pixel, weighted as a pixel's area and the blur of a
 * lens, about half a pixel. Edges sharper than any lens makes them would shift found corners by up to a tenth of a
 * pixel. A pose's blur_px is a movement along x during the exposure.
 *
 * @return 0 or -ENOMEM
 */
SST_MUST_CHECK int sst_sim_board_draw(const struct sst_sim_board_view *view, struct sst_image *image);

#endif
