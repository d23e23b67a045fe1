/* JPEG through the TurboJPEG API. */
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <turbojpeg.h>

#include "base/file.h"
#include "base/log.h"
#include "base/mem.h"
#include "pipeline/image/codec.h"
#include "pipeline/image/codec_formats.h"

/* A block of 8x8 samples takes at least one bit of each component in a Huffman-coded file: one byte for about 340
 * pixels at 4:2:0. A large image that claims far more is truncated, and is rejected before memory is allocated for
 * it. */
#define LARGE_PIXELS        ((size_t)1 << 24)
#define MAX_PIXELS_PER_BYTE 2048

static int damaged(tjhandle tj, const char *name)
{
    sst_log_error("%s is a damaged or truncated JPEG image (%s); write it again", name, tjGetErrorStr2(tj));
    return -EBADMSG;
}

static int read_header(tjhandle tj, const uint8_t *data, size_t size, const char *name, int *width, int *height,
                       int *colorspace)
{
    int subsampling;

    if (tjDecompressHeader3(tj, data, size, width, height, &subsampling, colorspace))
        return damaged(tj, name);
    if (*width > SST_IMAGE_MAX_SIDE || *height > SST_IMAGE_MAX_SIDE ||
        (size_t)*width * (size_t)*height > SST_IMAGE_MAX_PIXELS)
        return sst_image_size_error(-EINVAL, name, *width, *height);
    if ((size_t)*width * (size_t)*height > LARGE_PIXELS &&
        (size_t)*width * (size_t)*height / MAX_PIXELS_PER_BYTE > size) {
        sst_log_error("%s is a truncated JPEG image (%zu bytes for %dx%d pixels); write it again", name, size, *width,
                      *height);
        return -EBADMSG;
    }
    return 0;
}

int sst_jpeg_size(int *width, int *height, const uint8_t *data, size_t size, const char *name)
{
    tjhandle tj = tjInitDecompress();
    int w, h, colorspace, err;

    if (!tj)
        return sst_image_size_error(-ENOMEM, name, 0, 0);
    err = read_header(tj, data, size, name, &w, &h, &colorspace);
    tjDestroy(tj);
    if (err)
        return err;
    *width = w;
    *height = h;
    return 0;
}

/* CMYK in JPEG files is inverted: 255 is no ink, so R = C * K / 255. */
static void cmyk_to_rgb(uint8_t *px, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        const unsigned k = px[4 * i + 3];

        for (size_t c = 0; c < 3; c++)
            px[3 * i + c] = (uint8_t)((px[4 * i + c] * k + 127) / 255);
    }
}

int sst_jpeg_decode(struct sst_image *img, const uint8_t *data, size_t size, const char *name)
{
    tjhandle tj = tjInitDecompress();
    struct sst_image made = { 0 };
    uint8_t *packed = NULL;
    int width = 0, height = 0, colorspace = 0, err, channels;

    if (!tj)
        return sst_image_size_error(-ENOMEM, name, 0, 0);
    err = read_header(tj, data, size, name, &width, &height, &colorspace);
    if (err)
        goto out;
    channels = colorspace == TJCS_CMYK || colorspace == TJCS_YCCK ? 4 : 3;
    packed = sst_mem_alloc_raw((size_t)width * (size_t)height, (size_t)channels);
    err = packed ? sst_image_init(&made, width, height) : -ENOMEM;
    if (err) {
        err = sst_image_size_error(err, name, width, height);
        goto out;
    }
    /* A warning means that samples are missing or interpolated: treated as damage. */
    if (tjDecompress2(tj, data, size, packed, width, 0, height, channels == 4 ? TJPF_CMYK : TJPF_RGB,
                      TJFLAG_ACCURATEDCT | TJFLAG_STOPONWARNING | TJFLAG_LIMITSCANS)) {
        err = damaged(tj, name);
        goto out;
    }
    if (channels == 4)
        cmyk_to_rgb(packed, (size_t)width * (size_t)height);
    for (int y = 0; y < height; y++)
        sst_rgb_unpack_row(&made, y, packed + (size_t)y * (size_t)width * 3);
    *img = made;
    made = (struct sst_image){ 0 };

out:
    sst_image_fini(&made);
    sst_mem_free(packed);
    tjDestroy(tj);
    return err;
}

struct sst_jpeg_encoder {
    tjhandle tj;
    struct sst_mem_kept packed, jpeg;
};

int sst_jpeg_encoder_create(struct sst_jpeg_encoder **out)
{
    struct sst_jpeg_encoder *e = calloc(1, sizeof(*e));

    if (e)
        e->tj = tjInitCompress();
    if (!e || !e->tj) {
        free(e);
        return -ENOMEM;
    }
    *out = e;
    return 0;
}

void sst_jpeg_encoder_destroy(struct sst_jpeg_encoder *e)
{
    if (!e)
        return;
    tjDestroy(e->tj);
    sst_mem_kept_fini(&e->packed);
    sst_mem_kept_fini(&e->jpeg);
    free(e);
}

int sst_jpeg_encoder_run(struct sst_jpeg_encoder *e, const struct sst_image *img, int quality, const uint8_t **data,
                         size_t *size)
{
    const size_t row_bytes = (size_t)img->width * 3;
    unsigned long bytes = tjBufSize(img->width, img->height, TJSAMP_420);
    uint8_t *packed = sst_mem_keep(&e->packed, (size_t)img->height, row_bytes);
    unsigned char *jpeg = sst_mem_keep(&e->jpeg, bytes, 1);

    if (!packed || !jpeg)
        return -ENOMEM;
    for (int y = 0; y < img->height; y++)
        sst_rgb_pack_row(packed + (size_t)y * row_bytes, img, y);
    if (tjCompress2(e->tj, packed, img->width, 0, img->height, TJPF_RGB, &jpeg, &bytes, TJSAMP_420, quality,
                    TJFLAG_ACCURATEDCT | TJFLAG_NOREALLOC)) {
        sst_log_error("cannot encode an image of %dx%d as JPEG: %s", img->width, img->height, tjGetErrorStr2(e->tj));
        return -EIO;
    }
    *data = jpeg;
    *size = bytes;
    return 0;
}

int sst_image_encode_jpeg(const struct sst_image *img, int quality, uint8_t **data, size_t *size)
{
    struct sst_jpeg_encoder *e = NULL;
    const uint8_t *jpeg;
    uint8_t *copy = NULL;
    size_t bytes;
    int err = sst_jpeg_encoder_create(&e);

    err = err ? err : sst_jpeg_encoder_run(e, img, quality, &jpeg, &bytes);
    if (!err)
        copy = malloc(bytes);
    if (!err && !copy)
        err = -ENOMEM;
    if (!err) {
        memcpy(copy, jpeg, bytes);
        *data = copy;
        *size = bytes;
    }
    sst_jpeg_encoder_destroy(e);
    return err;
}

int sst_image_write_jpeg(const struct sst_image *img, const char *path, int quality)
{
    uint8_t *jpeg = NULL;
    size_t size = 0;
    int err = sst_image_encode_jpeg(img, quality, &jpeg, &size);

    if (err == -ENOMEM)
        return sst_image_size_error(err, path, img->width, img->height);
    if (!err)
        err = sst_file_write(path, jpeg, size);
    free(jpeg);
    return err;
}
