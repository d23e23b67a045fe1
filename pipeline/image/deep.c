/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/image/deep.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "base/file.h"
#include "base/log.h"
#include "pipeline/image/codec_formats.h"
#include "pipeline/image/image_internal.h"

int sst_deep_init(struct sst_deep *deep, int width, int height, int channels, int white)
{
    struct sst_deep made = { width, height, channels, white };
    int err = (channels == 1 || channels == 3) && (white == 255 || white == 65535) ? 0 : -EINVAL;

    for (int c = 0; !err && c < channels; c++)
        err = sst_map_u16_init(&made.plane[c], width, height);
    if (err)
        sst_deep_fini(&made);
    else
        *deep = made;
    return err;
}

void sst_deep_fini(struct sst_deep *deep)
{
    for (int c = 0; c < 3; c++)
        sst_map_u16_fini(&deep->plane[c]);
}

/* --- JPEG --------------------------------------------------------------------------------------------------------- */

/* A start of a frame: SOF0 to SOF15 but for tables and arithmetic coding's conditions. */
static bool is_frame(uint8_t mark)
{
    return mark >= 0xC0 && mark <= 0xCF && mark != 0xC4 && mark != 0xC8 && mark != 0xCC;
}

static bool begins(const struct jpeg_segment *s, const char *word, size_t n)
{
    return s->bytes >= n && !memcmp(s->data, word, n);
}

/* Whether a segment of EXIF has the maker's name; tags are not parsed for it. */
static bool names_dji(const struct jpeg_segment *s)
{
    for (size_t i = 6; i + 4 <= s->bytes; i++) {
        if (!memcmp(s->data + i, "DJI", 4))
            return true;
    }
    return false;
}

/* Components of a JPEG; its segments are those that exiftool documents. */
static int check_jpeg(int *channels, const uint8_t *data, size_t size, const char *name)
{
    struct jpeg_segment s = { 0 };
    bool dji = false;

    *channels = 3;
    while (jpeg_next_segment(&s, data, size)) {
        if (is_frame(s.mark) && s.bytes > 5)
            *channels = s.data[5] == 1 ? 1 : 3;
        if (s.mark == 0xE1 && begins(&s, "FLIR", 5)) {
            sst_log_error(
                "%s is a radiometric JPEG of FLIR, whose colours are no temperatures; convert it: exiftool -b "
                "-RawThermalImage %s > OUT.tif",
                name, name);
            return -EBADMSG;
        }
        dji |= s.mark == 0xE1 && begins(&s, "Exif\0", 6) && names_dji(&s);
        if (s.mark == 0xE3 && dji && !begins(&s, "Meta\0", 6) && !begins(&s, "META\0", 6) && !begins(&s, "Stim", 5) &&
            !begins(&s, "_JPSJPS_", 8)) {
            sst_log_error("%s is a radiometric JPEG of DJI, whose colours are no temperatures; convert it by DJI's "
                          "Thermal SDK: dji_irp -a extract -s %s -o OUT.raw",
                          name, name);
            return -EBADMSG;
        }
    }
    return 0;
}

static int decode_jpeg(struct sst_deep *out, const uint8_t *data, size_t size, const char *name)
{
    struct sst_deep made = { 0 };
    struct sst_image img = { 0 };
    int channels, err = check_jpeg(&channels, data, size, name);

    err = err ? err : sst_jpeg_decode(&img, data, size, name, false);
    if (err)
        return err;
    err = sst_deep_init(&made, img.width, img.height, channels, 255);
    if (err)
        err = sst_image_size_error(err, name, img.width, img.height);
    for (int i = 0; !err && i < channels * img.height; i++) {
        const uint8_t *from = sst_image_row(&img, i % channels, i / channels);
        uint16_t *to = sst_map_u16_row(&made.plane[i % channels], i / channels);

        for (int x = 0; x < img.width; x++)
            to[x] = from[x];
    }
    sst_image_fini(&img);
    if (!err)
        *out = made;
    return err;
}

/* --- reading ------------------------------------------------------------------------------------------------------ */

int sst_deep_decode(struct sst_deep *out, const uint8_t *data, size_t size, const char *name)
{
    switch (sst_image_format_of(data, size, name)) {
    case SST_IMAGE_PNG:
        return sst_png_decode_deep(out, data, size, name);
    case SST_IMAGE_JPEG:
        return decode_jpeg(out, data, size, name);
    case SST_IMAGE_TIFF:
        return tiff_decode(out, data, size, name);
    case SST_IMAGE_OTHER:
        break;
    }
    return -EBADMSG;
}

int sst_deep_decode_size(struct sst_deep_size *out, const uint8_t *data, size_t size, const char *name)
{
    struct sst_deep_size made = { .bits = 8 };
    int err;

    switch (sst_image_format_of(data, size, name)) {
    case SST_IMAGE_PNG:
        return sst_png_size(out, data, size, name);
    case SST_IMAGE_JPEG:
        err = check_jpeg(&made.channels, data, size, name);
        err = err ? err : sst_jpeg_size(&made.width, &made.height, data, size, name);
        if (!err)
            *out = made;
        return err;
    case SST_IMAGE_TIFF:
        return tiff_size(out, data, size, name);
    case SST_IMAGE_OTHER:
        break;
    }
    return -EBADMSG;
}

/* --- writing ------------------------------------------------------------------------------------------------------ */

static bool ends_in(const char *name, const char *ending)
{
    const char *dot = strrchr(name, '.');

    return dot && !strcasecmp(dot + 1, ending);
}

/* 8 bits to the same light in 16. */
static int widen(struct sst_deep *out, const struct sst_deep *deep)
{
    int err = sst_deep_init(out, deep->width, deep->height, deep->channels, 65535);

    for (int i = 0; !err && i < deep->channels * deep->height; i++) {
        const uint16_t *from = sst_map_u16_row(&deep->plane[i % deep->channels], i / deep->channels);
        uint16_t *to = sst_map_u16_row(&out->plane[i % deep->channels], i / deep->channels);

        for (int x = 0; x < deep->width; x++)
            to[x] = (uint16_t)(from[x] * 257);
    }
    return err;
}

int sst_deep_write(const struct sst_deep *deep, const char *path)
{
    const bool png = ends_in(path, "png");
    struct sst_deep wide = { 0 };
    int err;

    if (!png && !ends_in(path, "tif") && !ends_in(path, "tiff")) {
        sst_log_error("%s ends neither in .png nor in .tif, which have 16 bits", path);
        return -EINVAL;
    }
    if (deep->white == 255) {
        err = widen(&wide, deep);
        err = err ? sst_image_size_error(err, path, deep->width, deep->height) : sst_deep_write(&wide, path);
        sst_deep_fini(&wide);
        return err;
    }
    return !png                  ? tiff_write(deep, path)
           : deep->channels == 1 ? sst_map_u16_write_png(&deep->plane[0], path)
                                 : sst_image_write_deep(deep->plane, path);
}

/* --- 8 bits ------------------------------------------------------------------------------------------------------- */

int sst_deep_to_image(struct sst_image *out, const struct sst_deep *deep, struct sst_samples stretch)
{
    uint8_t *level = malloc((size_t)deep->white + 1);
    struct sst_image made = { 0 };
    int err = level ? sst_image_init(&made, deep->width, deep->height) : -ENOMEM;

    if (!stretch.white)
        stretch = (struct sst_samples){ 0, deep->white };
    for (int v = 0; !err && v <= deep->white; v++)
        level[v] = (uint8_t)sst_samples_scale(v, stretch);
    for (int i = 0; !err && i < 3 * deep->height; i++) {
        const uint16_t *from = sst_map_u16_row(&deep->plane[deep->channels == 3 ? i % 3 : 0], i / 3);
        uint8_t *to = sst_image_row(&made, i % 3, i / 3);

        for (int x = 0; x < deep->width; x++)
            to[x] = level[from[x]];
    }
    free(level);
    if (!err)
        *out = made;
    return err;
}

static uint64_t count(struct sst_sample_counts *counts, const struct sst_deep *deep)
{
    for (int c = 0; c < deep->channels; c++) {
        for (int y = 0; y < deep->height; y++) {
            const uint16_t *row = sst_map_u16_row(&deep->plane[c], y);

            for (int x = 0; x < deep->width; x++)
                counts->of[row[x]]++;
        }
    }
    return (uint64_t)deep->channels * (uint64_t)deep->width * (uint64_t)deep->height;
}

struct sst_samples sst_deep_stretch(const struct sst_deep *deep)
{
    struct sst_sample_counts *counts = calloc(1, sizeof(*counts));
    const uint64_t total = counts ? count(counts, deep) : 0;
    const struct sst_samples made =
        counts ? sst_samples_stretch(counts, total, deep->white) : (struct sst_samples){ 0, deep->white };

    free(counts);
    return made;
}

/* --- samples for 8 bits, in codec.h ------------------------------------------------------------------------------- */

int sst_image_count_samples(struct sst_sample_counts *counts, const uint8_t *data, size_t size, const char *name)
{
    struct sst_deep_size found;
    struct sst_deep deep;
    int err;

    if (sst_image_is_jpeg(data, size))
        return 0;
    err = sst_deep_decode_size(&found, data, size, name);
    if (err || found.bits == 8)
        return err;
    err = sst_deep_decode(&deep, data, size, name);
    if (err)
        return err;
    count(counts, &deep);
    sst_deep_fini(&deep);
    return 1;
}

int sst_image_decode_deep(struct sst_map_u16 plane[3], const uint8_t *data, size_t size, const char *name)
{
    struct sst_deep deep;
    int err = sst_deep_decode(&deep, data, size, name);

    if (err)
        return err;
    if (deep.white == 255) {
        sst_log_error("%s has fewer than 16 bits; it was replaced, import it again", name);
        err = -EBADMSG;
    }
    for (int c = deep.channels; !err && c < 3; c++) {
        err = sst_map_u16_init(&deep.plane[c], deep.width, deep.height);
        if (err)
            sst_image_size_error(err, name, deep.width, deep.height);
        else
            memcpy(deep.plane[c].data, deep.plane[0].data, deep.plane[0].stride * (size_t)deep.height);
    }
    if (err)
        sst_deep_fini(&deep);
    else
        memcpy(plane, deep.plane, sizeof(deep.plane));
    return err;
}
