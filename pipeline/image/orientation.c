/* Orientation of a camera by EXIF, in the APP1 segment of a JPEG or the eXIf chunk of a PNG, or a tag of a TIFF. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/file.h"
#include "base/log.h"
#include "base/text.h"
#include "pipeline/image/codec_formats.h"
#include "pipeline/image/image_internal.h"

#define HEAD_BYTES (256 * 1024) /* of a file: tags stand before the pixels */
#define TAG        0x0112

static uint32_t number(const uint8_t *p, int bytes, bool little)
{
    uint32_t v = 0;

    for (int i = 0; i < bytes; i++)
        v |= (uint32_t)p[little ? i : bytes - 1 - i] << 8 * i;
    return v;
}

/* Of the first directory of a TIFF structure. */
static int in_tiff(const uint8_t *p, size_t size)
{
    const bool little = size >= 8 && p[0] == 'I';
    size_t at, count;

    if (size < 8 || (memcmp(p, "II*\0", 4) != 0 && memcmp(p, "MM\0*", 4) != 0))
        return 1;
    at = number(p + 4, 4, little);
    if (at > size - 2)
        return 1;
    count = number(p + at, 2, little);
    for (at += 2; count && size >= 12 && at <= size - 12; count--, at += 12) {
        const uint32_t type = number(p + at + 2, 2, little);

        if (number(p + at, 2, little) == TAG && (type == 3 || type == 4)) { /* a short, as it should be, or a long */
            const uint32_t v = number(p + at + 8, type == 3 ? 2 : 4, little);

            return v >= 1 && v <= 8 ? (int)v : 1;
        }
    }
    return 1;
}

static int in_jpeg(const uint8_t *p, size_t size)
{
    struct jpeg_segment s = { 0 };

    while (jpeg_next_segment(&s, p, size)) {
        if (s.mark == 0xE1 && s.bytes >= 6 && !memcmp(s.data, "Exif\0\0", 6))
            return in_tiff(s.data + 6, s.bytes - 6);
    }
    return 1;
}

static int in_png(const uint8_t *p, size_t size)
{
    for (size_t at = 8; at + 12 <= size;) {
        const size_t length = number(p + at, 4, false);

        if (length > size - at - 12)
            break;
        if (!memcmp(p + at + 4, "eXIf", 4))
            return in_tiff(p + at + 8, length);
        at += 12 + length;
    }
    return 1;
}

int sst_image_orientation(const uint8_t *data, size_t size)
{
    return sst_image_is_jpeg(data, size)   ? in_jpeg(data, size)
           : size && data[0] == 0x89 ? in_png(data, size)
                                     : in_tiff(data, size);
}

/* Tags of a TIFF may stand behind the pixels. */
static int in_whole_file(const char *path)
{
    uint8_t *data;
    size_t size;
    int found;

    if (sst_file_read(path, SST_IMAGE_MAX_BYTES, &data, &size))
        return 1;
    found = sst_image_orientation(data, size);
    free(data);
    return found;
}

int sst_image_read_orientation(const char *path)
{
    uint8_t *head = malloc(HEAD_BYTES);
    FILE *f = head ? fopen(path, "re") : NULL;
    const size_t n = f ? fread(head, 1, HEAD_BYTES, f) : 0;
    const int found = n == HEAD_BYTES && tiff_is(head, n) ? in_whole_file(path) : n ? sst_image_orientation(head, n) : 1;

    if (f)
        fclose(f);
    free(head);
    return found;
}

int sst_image_orient(struct sst_image *img, int orientation)
{
    const bool turned = orientation >= 5, left = orientation == 2 || orientation == 3 || orientation >= 7;
    const bool up = orientation == 3 || orientation == 4 || orientation == 6 || orientation == 7;
    const int width = turned ? img->height : img->width, height = turned ? img->width : img->height;
    struct sst_image made;
    int err;

    if (orientation <= 1 || orientation > 8)
        return 0;
    err = sst_image_init(&made, width, height);
    if (err)
        return err;
    for (int c = 0; c < 3; c++) {
        for (int y = 0; y < height; y++) {
            uint8_t *to = sst_image_row(&made, c, y);

            for (int x = 0; x < width; x++) {
                const int sx = turned ? y : x, sy = turned ? x : y;

                to[x] = sst_image_row(img, c, up ? img->height - 1 - sy : sy)[left ? img->width - 1 - sx : sx];
            }
        }
    }
    sst_image_fini(img);
    *img = made;
    return 0;
}

void sst_image_warn_orientations(const char *source, const char *const *names, const uint8_t *orientations, int count)
{
    int of[9] = { 0 }, most = 1, all = 0, others = 0, named = 0;
    char list[640] = "";

    for (int i = 0; i < count; i++) {
        of[orientations[i]] += names[i] != NULL;
        all += names[i] != NULL;
    }
    for (int o = 2; o <= 8; o++)
        most = of[o] > of[most] ? o : most;
    others = all - of[most];
    if (!others) {
        if (most != 1)
            sst_log_warning("%s: all pictures have the EXIF orientation %d, which is not applied: views keep the pixels"
                            " as they are stored",
                            source, most);
        return;
    }
    for (int i = 0; i < count; i++) {
        if (names[i] && orientations[i] != most && strlen(list) + strlen(names[i]) + 32 < sizeof(list)) {
            sst_text_add(list, sizeof(list), "%s%s: %d", named ? ", " : "", names[i], orientations[i]);
            named++;
        }
    }
    if (named < others)
        sst_text_add(list, sizeof(list), " and %d more", others - named);
    sst_log_warning("%s: pictures of one array have different EXIF orientations, %d and (%s); none is applied, views keep"
                    " the pixels as they are stored: check that no camera was turned",
                    source, most, list);
}
