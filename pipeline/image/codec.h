/* pipeline/image/codec.h - reading and writing of images and maps. */
#ifndef SST_PIPELINE_IMAGE_CODEC_H
#define SST_PIPELINE_IMAGE_CODEC_H

#include "pipeline/image/image.h"

/* Every reader checks the whole file before it returns; on failure it logs one sentence (file, fault, remedy) and
 * leaves its output untouched. Readers return 0, -ENOENT, -EBADMSG (not an image, truncated, absurd size), -ENOMEM or
 * -EIO. Every writer goes through sst_outfile: whole file or none. Thread: any. */

/** Does the name of a file end as that of a PNG or JPEG? */
bool sst_image_is_picture(const char *name);

/** Read a PNG or JPEG, detected by content. Grey becomes three equal planes, 16 bits are rounded to 8, alpha is
 *  dropped. */
SST_MUST_CHECK int sst_image_read(struct sst_image *img, const char *path);

/** The same from memory; name is only used in messages. */
SST_MUST_CHECK int sst_image_decode(struct sst_image *img, const uint8_t *data, size_t size, const char *name);

/** Distinct samples of a 16-bit picture, and those that are left of them when it is read. */
struct sst_image_levels {
    int before, after; /* 0: the picture has 8 bits */
    int largest;       /* sample */
};

/** Count the levels of a PNG or JPEG in memory. The same errors. */
SST_MUST_CHECK int sst_image_count_levels(struct sst_image_levels *out, const uint8_t *data, size_t size,
                                          const char *name);

/** Log a warning if levels are lost. */
void sst_image_warn_levels(const struct sst_image_levels *levels, const char *name);

/** sst_image_read(), with that warning. */
SST_MUST_CHECK int sst_image_read_warned(struct sst_image *img, const char *path);

/** Size of a PNG or JPEG without decoding its pixels. */
SST_MUST_CHECK int sst_image_read_size(const char *path, int *width, int *height);

SST_MUST_CHECK int sst_image_write_png(const struct sst_image *img, const char *path);

/** @param quality 1..100; 4:2:0 */
SST_MUST_CHECK int sst_image_write_jpeg(const struct sst_image *img, const char *path, int quality);

struct sst_jpeg_encoder; /* reusable encoder state; one thread at a time */

/** @return 0, -ENOMEM (not logged) */
SST_MUST_CHECK int sst_jpeg_encoder_create(struct sst_jpeg_encoder **out);
void sst_jpeg_encoder_destroy(struct sst_jpeg_encoder *encoder);

/**
 * Encode to the same bytes as sst_image_write_jpeg(). @param data  out, borrowed until the next call
 * @return 0, -ENOMEM (not logged), -EIO
 */
SST_MUST_CHECK int sst_jpeg_encoder_run(struct sst_jpeg_encoder *encoder, const struct sst_image *img, int quality,
                                        const uint8_t **data, size_t *size);

/** Encode to memory; release with free(). @return 0, -ENOMEM (not logged), -EIO */
SST_MUST_CHECK int sst_image_encode_jpeg(const struct sst_image *img, int quality, uint8_t **data, size_t *size);

/** 8-bit PNG whose samples are the values: grey, or palette indices (the palette is ignored). */
SST_MUST_CHECK int sst_map_u8_read_png(struct sst_map_u8 *map, const char *path);

/** Grey 8-bit PNG, or an indexed one if palette (256 RGB triples) is not NULL; the samples are the values in both
 *  cases. */
SST_MUST_CHECK int sst_map_u8_write_png(const struct sst_map_u8 *map, const char *path, const uint8_t (*palette)[3]);

/** Grey 16-bit PNG. */
SST_MUST_CHECK int sst_map_u16_read_png(struct sst_map_u16 *map, const char *path);
SST_MUST_CHECK int sst_map_u16_write_png(const struct sst_map_u16 *map, const char *path);

/**
 * One-channel PFM ("Pf") of either byte order, rows stored bottom up. Infinite values are kept (the usual mark of
 * unknown disparity); NaN is rejected with its position.
 */
SST_MUST_CHECK int sst_map_f32_read_pfm(struct sst_map_f32 *map, const char *path);
SST_MUST_CHECK int sst_map_f32_write_pfm(const struct sst_map_f32 *map, const char *path);

/** NumPy .npy version 1.0, little-endian float32, C order, shape dims[0..n_dims). n_dims at most 4. */
SST_MUST_CHECK int sst_npy_write_f32(const float *data, const size_t *dims, int n_dims, const char *path);

#endif
