/* simulators/devices/ptp/ptp_dng.c - raw files: DNG 1.4, one strip of Bayer samples and the tags that developing needs.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>

#include "simulators/devices/ptp/ptp_internal.h"

#define LEVELS 256
#define WHITE  65535

enum tiff_type {
    TIFF_BYTE = 1,
    TIFF_TEXT = 2,
    TIFF_SHORT = 3,
    TIFF_LONG = 4,
    TIFF_RATIONAL = 5,
    TIFF_SRATIONAL = 10,
};

/** A tag: its value, or where its values start in the data behind the directory. */
struct tag {
    uint16_t number, type;
    uint32_t count, value;
};

/** sRGB's curve to linear light (IEC 61966-2-1), as 16 bits. */
static void put_linearisation(struct ptp_bytes *b)
{
    for (int i = 0; i < LEVELS; i++) {
        const double v = i / 255.0;
        const double linear = v <= 0.04045 ? v / 12.92 : pow((v + 0.055) / 1.055, 2.4);

        ptp_put(b, (uint64_t)lround(linear * WHITE), 2);
    }
}

/** From XYZ to the camera's colours, which are sRGB's, in ten-thousandths. */
static void put_matrix(struct ptp_bytes *b)
{
    static const int matrix[9] = { 32405, -15371, -4985, -9693, 18760, 416, 556, -2040, 10572 };

    for (int i = 0; i < 9; i++) {
        ptp_put(b, (uint32_t)matrix[i], 4);
        ptp_put(b, 10000, 4);
    }
}

int sst_sim_ptp_dng(const uint8_t *bayer, int width, int height, uint8_t **out, size_t *bytes)
{
    enum {
        TAGS = 22,
        DIRECTORY = 8,
        DATA = DIRECTORY + 2 + 12 * TAGS + 4,
        MATRIX = DATA + 2 * LEVELS,
        NEUTRAL = MATRIX + 72,
        MODEL = NEUTRAL + 24,
        STRIP = MODEL + 20
    };
    const uint32_t samples = (uint32_t)width * (uint32_t)height;
    const struct tag tags[TAGS] = {
        { 254, TIFF_LONG, 1, 0 }, /* the main picture */
        { 256, TIFF_LONG, 1, (uint32_t)width },
        { 257, TIFF_LONG, 1, (uint32_t)height },
        { 258, TIFF_SHORT, 1, 8 },     /* bits of a sample */
        { 259, TIFF_SHORT, 1, 1 },     /* not compressed */
        { 262, TIFF_SHORT, 1, 32803 }, /* colour filter array */
        { 271, TIFF_TEXT, 4, 's' | 's' << 8 | 't' << 16 },
        { 272, TIFF_TEXT, 17, MODEL },
        { 273, TIFF_LONG, 1, STRIP },
        { 274, TIFF_SHORT, 1, 1 }, /* upright */
        { 277, TIFF_SHORT, 1, 1 }, /* samples of a pixel */
        { 278, TIFF_LONG, 1, (uint32_t)height },
        { 279, TIFF_LONG, 1, samples },
        { 284, TIFF_SHORT, 1, 1 },
        { 33421, TIFF_SHORT, 2, 2 | 2 << 16 }, /* the pattern repeats after 2x2: red, green, green, blue */
        { 33422, TIFF_BYTE, 4, 0 | 1 << 8 | 1 << 16 | 2 << 24 },
        { 50706, TIFF_BYTE, 4, 1 | 4 << 8 }, /* DNG 1.4 */
        { 50712, TIFF_SHORT, LEVELS, DATA },
        { 50717, TIFF_LONG, 1, WHITE },
        { 50721, TIFF_SRATIONAL, 9, MATRIX },
        { 50728, TIFF_RATIONAL, 3, NEUTRAL },
        { 50778, TIFF_SHORT, 1, 21 }, /* the matrix is for D65 */
    };
    struct ptp_bytes b = { .data = NULL };

    ptp_put(&b, 'I' | 'I' << 8 | 42 << 16, 4);
    ptp_put(&b, DIRECTORY, 4);
    ptp_put(&b, TAGS, 2);
    for (int i = 0; i < TAGS; i++) {
        ptp_put(&b, tags[i].number, 2);
        ptp_put(&b, tags[i].type, 2);
        ptp_put(&b, tags[i].count, 4);
        ptp_put(&b, tags[i].value, 4);
    }
    ptp_put(&b, 0, 4); /* no other directory */
    put_linearisation(&b);
    put_matrix(&b);
    for (int i = 0; i < 6; i++)
        ptp_put(&b, 1, 4); /* white is white: three times 1/1 */
    ptp_put_bytes(&b, (const uint8_t *)"SST Still Camera\0\0\0", 20);
    ptp_put_bytes(&b, bayer, samples);
    if (b.failed) {
        ptp_free(&b);
        return -ENOMEM;
    }
    *out = b.data;
    *bytes = b.size;
    return 0;
}
