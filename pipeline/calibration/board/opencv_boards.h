/* pipeline/calibration/board/opencv_boards.h - boards and markers as OpenCV finds and draws them, as plain C. */
#ifndef SST_PIPELINE_CALIBRATION_BOARD_OPENCV_BOARDS_H
#define SST_PIPELINE_CALIBRATION_BOARD_OPENCV_BOARDS_H

#include <errno.h>

#include "pipeline/image/image.h"

SST_EXTERN_C_BEGIN

/* All return 0 or more, -ENOTSUP (a build without OpenCV), -ENOMEM or -EINVAL (OpenCV refused). Not logged. Thread:
 * any. Corners are in px, pixel centres on integers. */

/** A marker: its corners clockwise from the one that is its upper left when it is upright. */
struct cv_marker {
    int id;
    float corner[4][2];
};

#if !WITH_OPENCV
/* Without OpenCV nothing is there to link to. */
static inline int cv_chessboard(float (*corner)[2] SST_UNUSED, const struct sst_map_u8 *luma SST_UNUSED,
                                int cols SST_UNUSED, int rows SST_UNUSED, int thorough SST_UNUSED)
{
    return -ENOTSUP;
}
static inline int cv_any_chessboard(const struct sst_map_u8 *luma SST_UNUSED, int *cols SST_UNUSED,
                                    int *rows SST_UNUSED)
{
    return -ENOTSUP;
}
static inline int cv_markers(struct cv_marker *out SST_UNUSED, int max SST_UNUSED,
                             const struct sst_map_u8 *luma SST_UNUSED, int dictionary SST_UNUSED, int border SST_UNUSED)
{
    return -ENOTSUP;
}
static inline int cv_touching_tags(struct cv_marker *out SST_UNUSED, int max SST_UNUSED,
                                   const struct sst_map_u8 *luma SST_UNUSED, int dictionary SST_UNUSED,
                                   int border SST_UNUSED)
{
    return -ENOTSUP;
}
static inline int cv_dictionary(int dictionary SST_UNUSED, int *modules SST_UNUSED)
{
    return -ENOTSUP;
}
static inline int cv_marker_bits(uint8_t *bits SST_UNUSED, int dictionary SST_UNUSED, int id SST_UNUSED)
{
    return -ENOTSUP;
}
#else

/** Chessboard of cols x rows inner corners, row by row. @param thorough  another, slower finder: smaller and more
 *  blurred boards. @return 1 found, 0 not */
SST_MUST_CHECK int cv_chessboard(float (*corner)[2], const struct sst_map_u8 *luma, int cols, int rows, int thorough);

/** Size of the largest chessboard of at least 3 x 3 inner corners. Slow. @return 1 found, 0 not */
SST_MUST_CHECK int cv_any_chessboard(const struct sst_map_u8 *luma, int *cols, int *rows);

/** @param dictionary  OpenCV's number. @param border  modules. @param max  at most so many. @return how many */
SST_MUST_CHECK int cv_markers(struct cv_marker *out, int max, const struct sst_map_u8 *luma, int dictionary,
                              int border);

/** The same for tags whose corners touch black squares, as on an AprilGrid. A tag may come twice. */
SST_MUST_CHECK int cv_touching_tags(struct cv_marker *out, int max, const struct sst_map_u8 *luma, int dictionary,
                                    int border);

/** How many markers a dictionary has, and modules along a marker's inner side; 0: no such dictionary. */
SST_MUST_CHECK int cv_dictionary(int dictionary, int *modules);

/** Modules of marker id, row by row, 1 is white. @param bits  [modules * modules] @return 0 */
SST_MUST_CHECK int cv_marker_bits(uint8_t *bits, int dictionary, int id);

#endif

SST_EXTERN_C_END

#endif
