#include "pipeline/image/codec.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "base/file.h"
#include "base/log.h"
#include "pipeline/image/codec_formats.h"

enum kind {
    KIND_NONE = 0,
    KIND_PNG = 1,
    KIND_JPEG = 2,
};

static enum kind kind_of(const uint8_t *data, size_t size, const char *name)
{
    if (size >= 4 && data[0] == 0x89 && data[1] == 'P' && data[2] == 'N' && data[3] == 'G')
        return KIND_PNG;
    if (sst_image_is_jpeg(data, size))
        return KIND_JPEG;
    if (size)
        sst_log_error("%s is neither a PNG nor a JPEG image; convert it to one of them", name);
    else
        sst_log_error("%s is empty; write the image again", name);
    return KIND_NONE;
}

bool sst_image_is_picture(const char *name)
{
    const char *dot = strrchr(name, '.');

    return dot && dot != name && (!strcasecmp(dot, ".jpg") || !strcasecmp(dot, ".jpeg") || !strcasecmp(dot, ".png"));
}

int sst_image_decode_samples(struct sst_image *img, const uint8_t *data, size_t size, const char *name,
                             struct sst_samples samples)
{
    switch (kind_of(data, size, name)) {
    case KIND_PNG:
        return sst_png_decode(img, data, size, name, samples);
    case KIND_JPEG:
        return sst_jpeg_decode(img, data, size, name, false);
    case KIND_NONE:
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

int sst_image_count_samples(struct sst_sample_counts *counts, const uint8_t *data, size_t size, const char *name)
{
    const enum kind kind = kind_of(data, size, name);

    return kind == KIND_PNG ? sst_png_count_samples(counts, data, size, name) : kind == KIND_JPEG ? 0 : -EBADMSG;
}

int sst_image_decode_size(int *width, int *height, const uint8_t *data, size_t size, const char *name)
{
    switch (kind_of(data, size, name)) {
    case KIND_PNG:
        return sst_png_size(width, height, data, size, name);
    case KIND_JPEG:
        return sst_jpeg_size(width, height, data, size, name);
    case KIND_NONE:
        break;
    }
    return -EBADMSG;
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
