/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/image/font.h"

#include <ctype.h>
#include <string.h>

#define GLYPHS " 0123456789ABCDEFGHIKLMNOPRSTUVXYJQWZ-.:_+,/()"

/* Seven rows of five dots, the leftmost dot is bit 4. */
static const uint8_t glyphs[][7] = {
    { 0, 0, 0, 0, 0, 0, 0 },        { 14, 17, 19, 21, 25, 17, 14 }, { 4, 12, 4, 4, 4, 4, 14 },
    { 14, 17, 1, 6, 8, 16, 31 },    { 31, 2, 4, 2, 1, 17, 14 },     { 2, 6, 10, 18, 31, 2, 2 },
    { 31, 16, 30, 1, 1, 17, 14 },   { 6, 8, 16, 30, 17, 17, 14 },   { 31, 1, 2, 4, 8, 8, 8 },
    { 14, 17, 17, 14, 17, 17, 14 }, { 14, 17, 17, 15, 1, 2, 12 },   { 14, 17, 17, 31, 17, 17, 17 },
    { 30, 17, 17, 30, 17, 17, 30 }, { 14, 17, 16, 16, 16, 17, 14 }, { 30, 17, 17, 17, 17, 17, 30 },
    { 31, 16, 16, 30, 16, 16, 31 }, { 31, 16, 16, 30, 16, 16, 16 }, { 14, 17, 16, 23, 17, 17, 15 },
    { 17, 17, 17, 31, 17, 17, 17 }, { 14, 4, 4, 4, 4, 4, 14 },      { 17, 18, 20, 24, 20, 18, 17 },
    { 16, 16, 16, 16, 16, 16, 31 }, { 17, 27, 21, 21, 17, 17, 17 }, { 17, 25, 21, 19, 17, 17, 17 },
    { 14, 17, 17, 17, 17, 17, 14 }, { 30, 17, 17, 30, 16, 16, 16 }, { 30, 17, 17, 30, 20, 18, 17 },
    { 15, 16, 16, 14, 1, 1, 30 },   { 31, 4, 4, 4, 4, 4, 4 },       { 17, 17, 17, 17, 17, 17, 14 },
    { 17, 17, 17, 17, 17, 10, 4 },  { 17, 17, 10, 4, 10, 17, 17 },  { 17, 17, 10, 4, 4, 4, 4 },
    { 7, 2, 2, 2, 2, 18, 12 },      { 14, 17, 17, 17, 21, 18, 13 }, { 17, 17, 17, 21, 21, 21, 10 },
    { 31, 1, 2, 4, 8, 16, 31 },     { 0, 0, 0, 14, 0, 0, 0 },       { 0, 0, 0, 0, 0, 12, 12 },
    { 0, 12, 12, 0, 12, 12, 0 },    { 0, 0, 0, 0, 0, 0, 31 },
    { 0, 4, 4, 31, 4, 4, 0 },       { 0, 0, 0, 0, 12, 4, 8 },       { 1, 1, 2, 4, 8, 16, 16 },
    { 2, 4, 8, 8, 8, 4, 2 },        { 8, 4, 2, 2, 2, 4, 8 },
};

bool sst_font_dot(const char *text, int x, int y)
{
    const int n = (int)strlen(text);
    const char *c;

    if (x < 0 || y < 0 || y >= SST_FONT_HEIGHT || x >= SST_FONT_WIDTH * n || x % SST_FONT_WIDTH == 5)
        return false;
    c = strchr(GLYPHS, toupper((unsigned char)text[x / SST_FONT_WIDTH]));
    return c && *c && (glyphs[c - GLYPHS][y] >> (4 - x % SST_FONT_WIDTH) & 1);
}

void sst_pen_dot(const struct sst_pen *pen, int x, int y)
{
    if (x < 0 || y < 0 || x >= pen->image->width || y >= pen->image->height)
        return;
    for (int c = 0; c < 3; c++)
        sst_image_row(pen->image, c, y)[x] = (uint8_t)(pen->colour >> (16 - 8 * c));
}

void sst_pen_fill(const struct sst_pen *pen, struct sst_rect part)
{
    for (int y = part.y0; y < part.y1; y++) {
        for (int x = part.x0; x < part.x1; x++)
            sst_pen_dot(pen, x, y);
    }
}

void sst_pen_text(const struct sst_pen *pen, int x, int y, const char *text)
{
    const int n = (int)strlen(text) * SST_FONT_WIDTH * pen->zoom;

    for (int j = 0; j < SST_FONT_HEIGHT * pen->zoom; j++) {
        for (int i = 0; i < n; i++) {
            if (sst_font_dot(text, i / pen->zoom, j / pen->zoom))
                sst_pen_dot(pen, x + i, y + j);
        }
    }
}
