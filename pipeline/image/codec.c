/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/image/codec.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "base/file.h"
#include "base/log.h"
#include "pipeline/image/codec_formats.h"
#include "pipeline/image/image_internal.h"

bool tiff_is(const uint8_t *data, size_t size)
{
    return size >= 4 && (!memcmp(data, "II*\0", 4) || !memcmp(data, "MM\0*", 4) || !memcmp(data, "II+\0", 4) ||
                         !memcmp(data, "MM\0+", 4));
}

enum sst_image_format sst_image_format_of(const uint8_t *data, size_t size, const char *name)
{
    if (size >= 4 && data[0] == 0x89 && data[1] == 'P' && data[2] == 'N' && data[3] == 'G')
        return SST_IMAGE_PNG;
    if (sst_image_is_jpeg(data, size))
        return SST_IMAGE_JPEG;
    if (tiff_is(data, size))
        return SST_IMAGE_TIFF;
    if (size)
        sst_log_error("%s is no PNG, JPEG or TIFF image; convert it to one of them", name);
    else
        sst_log_error("%s is empty; write the image again", name);
    return SST_IMAGE_OTHER;
}

bool sst_image_is_picture(const char *name)
{
    static const char *const endings[] = { ".png", ".jpg", ".jpeg", ".tif", ".tiff" };
    const char *dot = strrchr(name, '.');

    for (size_t i = 0; dot && dot != name && i < ARRAY_LEN(endings); i++) {
        if (!strcasecmp(dot, endings[i]))
            return true;
    }
    return false;
}

const char *sst_image_ending(const uint8_t *data, size_t size)
{
    return sst_image_is_jpeg(data, size) ? ".jpg" : tiff_is(data, size) ? ".tif" : ".png";
}

static int decode_tiff(struct sst_image *img, const uint8_t *data, size_t size, const char *name,
                       struct sst_samples samples)
{
    struct sst_deep deep;
    int err = tiff_decode(&deep, data, size, name);

    if (err)
        return err;
    err = sst_deep_to_image(img, &deep, deep.white == 255 ? (struct sst_samples){ 0, 0 } : samples);
    if (err)
        sst_image_size_error(err, name, deep.width, deep.height);
    sst_deep_fini(&deep);
    return err;
}

int sst_image_decode_samples(struct sst_image *img, const uint8_t *data, size_t size, const char *name,
                             struct sst_samples samples)
{
    switch (sst_image_format_of(data, size, name)) {
    case SST_IMAGE_PNG:
        return sst_png_decode(img, data, size, name, samples);
    case SST_IMAGE_JPEG:
        return sst_jpeg_decode(img, data, size, name, false);
    case SST_IMAGE_TIFF:
        return decode_tiff(img, data, size, name, samples);
    case SST_IMAGE_OTHER:
        break;
    }
    return -EBADMSG;
}

int sst_image_decode(struct sst_image *img, const uint8_t *data, size_t size, const char *name)
{
    return sst_image_decode_samples(img, data, size, name, (struct sst_samples){ 0, 0 });
}

int sst_image_read(struct sst_image *img, const char *path)
{
    uint8_t *data;
    size_t size;
    int err = sst_file_read(path, SST_IMAGE_MAX_BYTES, &data, &size);

    if (err)
        return err;
    err = sst_image_decode(img, data, size, path);
    free(data);
    return err;
}

int sst_image_decode_size(int *width, int *height, const uint8_t *data, size_t size, const char *name)
{
    const enum sst_image_format format = sst_image_format_of(data, size, name);
    struct sst_deep_size found;
    int err;

    if (format == SST_IMAGE_JPEG)
        return sst_jpeg_size(width, height, data, size, name);
    if (format == SST_IMAGE_OTHER)
        return -EBADMSG;
    err = format == SST_IMAGE_PNG ? sst_png_size(&found, data, size, name) : tiff_size(&found, data, size, name);
    if (err)
        return err;
    *width = found.width;
    *height = found.height;
    return 0;
}

int sst_image_read_size(const char *path, int *width, int *height)
{
    uint8_t *data;
    size_t size;
    int err = sst_file_read(path, SST_IMAGE_MAX_BYTES, &data, &size);

    if (err)
        return err;
    err = sst_image_decode_size(width, height, data, size, path);
    free(data);
    return err;
}
