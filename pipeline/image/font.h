/* pipeline/image/font.h - a 5x7 bitmap font for captions and simulated objects. */
#ifndef SST_PIPELINE_IMAGE_FONT_H
#define SST_PIPELINE_IMAGE_FONT_H

#include <stdbool.h>

#include "base/base.h"

#define SST_FONT_WIDTH  6 /* dots from one character to the next; the last is empty */
#define SST_FONT_HEIGHT 7

/**
 * True if the dot in column x, row y of the text is set. Capitals, digits, space and - . : _ have glyphs; small letters
 * are drawn as capitals, anything else as space.
 */
bool sst_font_dot(const char *text, int x, int y);

#endif
