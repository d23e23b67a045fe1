/* pipeline/image/font.h - a 5x7 bitmap font for captions and simulated objects, and pens that draw with it. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_IMAGE_FONT_H
#define SST_PIPELINE_IMAGE_FONT_H

#include <stdbool.h>

#include "pipeline/image/image.h"

#define SST_FONT_WIDTH  6 /* dots from one character to the next; the last is empty */
#define SST_FONT_HEIGHT 7

/**
 * True if the dot in column x, row y of the text is set. Capitals, digits, space and - . : _ + , / ( ) have glyphs; small
 * letters are drawn as capitals, anything else as space.
 */
bool sst_font_dot(const char *text, int x, int y);

/** Drawing on a picture, clipped to it. */
struct sst_pen {
    struct sst_image *image;
    uint32_t colour; /* 0xRRGGBB */
    int zoom;        /* pixels a dot of text */
};

void sst_pen_dot(const struct sst_pen *pen, int x, int y);
void sst_pen_fill(const struct sst_pen *pen, struct sst_rect part);
/** Write a line of text from its upper left corner on. */
void sst_pen_text(const struct sst_pen *pen, int x, int y, const char *text);

#endif
