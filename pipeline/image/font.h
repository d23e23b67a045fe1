/* pipeline/image/font.h - small letters for captions and for what simulated things wear. */
#ifndef SST_PIPELINE_IMAGE_FONT_H
#define SST_PIPELINE_IMAGE_FONT_H

#include <stdbool.h>

#include "base/base.h"

#define SST_FONT_WIDTH  6 /* dots from one character to the next; the last is empty */
#define SST_FONT_HEIGHT 7

/**
 * 5x7 dots: is the dot in column x, row y of the text set?
 * Capitals, digits, space and - . : _ are drawn; small letters as capitals, anything else as space.
 */
bool sst_font_dot(const char *text, int x, int y);

#endif
