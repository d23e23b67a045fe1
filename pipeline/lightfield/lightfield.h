/* pipeline/lightfield/lightfield.h - a rectified light field in memory; loading and storing its folder. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_LIGHTFIELD_LIGHTFIELD_H
#define SST_PIPELINE_LIGHTFIELD_LIGHTFIELD_H

#include "base/file.h"
#include "pipeline/image/classes.h"
#include "pipeline/image/image.h"

#define SST_MAX_VIEWS   256
#define SST_DISP_NONE   0xFFFFu /* disparity unknown */
#define SST_DISP_MAX_Q6 0xFFFEu /* largest stored value */
#define SST_DISP_SCALE  64.0    /* steps per pixel */

struct sst_calib;
struct sst_correction;
struct sst_deep; /* pipeline/image/deep.h */
struct sst_lightfield_files;
struct sst_rectified;

/**
 * One view. A scene point seen at x in the reference view appears here at x - d * b, b = (bx, by), d its disparity in
 * pixels per unit spacing.
 */
struct sst_view {
    bool present;            /* false: the grid has a hole here; everything below is empty */
    double bx, by;           /* offset from the reference view in nominal spacings, right and down positive */
    struct sst_image image;  /* empty until loaded */
    struct sst_image
        original;            /* source of `image` before its correction (SST_LOAD_ORIGINALS), or before its
                                rectification as well (SST_LOAD_SOURCES); empty: none */
    uint8_t *encoded;        /* the raw frame as a JPEG file that is decoded when it is needed, with an empty `image`
                                (SST_LOAD_ENCODED); NULL: none. Owned. */
    size_t encoded_bytes;
    struct sst_map_u8 valid; /* 0 where the rectified image is black because the pixel lies outside the raw frame, else
                                255; set with the image; empty: all pixels are valid */
    struct sst_map_u16 disp; /* 1/64 px above disp_min_px, or SST_DISP_NONE; empty: not computed */
    struct sst_map_u8 label; /* refined labels; empty: not computed */
    struct sst_map_u8 confidence; /* of the disparity; empty: not computed */
};

struct sst_lightfield {
    int rows, cols, width, height;
    int ref_view;                      /* row (rows-1)/2, column (cols-1)/2, or the nearest view that is present */
    double disp_min_px;                /* disparity of stored value 0; may be negative */
    double range_min_px, range_max_px; /* disparities expected in the scene; equal: unknown */
    struct sst_samples samples;        /* of 16-bit views; all are scaled alike */
    bool infinity_known;               /* infinity_px is known; false: it is 0 */
    double infinity_px; /* disparity of infinity: Z = f B / (d - infinity_px). 0: parallel views; below
                           0: they converge at Z = -f B / infinity_px, where d is 0 */
    double off_centre_px[2]; /* principal point of the reference view from the middle of the picture, right and down */
    bool disparity_tested;             /* the disparities were tested against the views around (design.md, 5.7) */
    double focal_px;                   /* 0: unknown */
    double spacing_mm;                 /* nominal spacing; 0: unknown */
    double skew_us;                    /* between the first and the last exposure of the views; 0: unknown, or none */
    struct sst_classes classes;
    /* With a calibration the views' files are raw frames, which are rectified on loading; everything else here (sizes,
     * maps, offsets) refers to the rectified views. NULL: the files are the views. Owned. */
    struct sst_calib *calibration;
    struct sst_rectified *rectified;    /* common geometry of the rectified views; NULL like calibration */
    int filter;                         /* sst_filter of the resampling */
    struct sst_correction *correction;  /* correction.h: [rows * cols], applied on loading; NULL: none. Owned. */
    bool images_raw;                    /* images are raw frames of the calibration's size (SST_LOAD_RAW) */
    bool keeps_sources;                 /* SST_LOAD_SOURCES */
    struct sst_view *views;             /* rows * cols */
    struct sst_lightfield_files *files; /* folder.h; NULL: made in memory, without a folder. Owned. */
};

/** Data to load besides lightfield.json. */
enum sst_lightfield_load {
    SST_LOAD_IMAGES = 1,
    SST_LOAD_DISPARITY = 2,
    SST_LOAD_LABELS = 4,
    SST_LOAD_CONFIDENCE = 8,
    SST_LOAD_ALL = 15,
    SST_LOAD_RAW = 16,         /* with SST_LOAD_IMAGES: images as the files are, not rectified */
    SST_LOAD_UNVERIFIED = 32,  /* with SST_LOAD_IMAGES: accept files that differ from their SHA-256 */
    SST_LOAD_UNCORRECTED = 64, /* forget the correction of the folder */
    SST_LOAD_ORIGINALS = 128, /* with SST_LOAD_IMAGES: keep the sources of corrected pictures, for renderers */
    SST_LOAD_ENCODED = 256,   /* with SST_LOAD_RAW: raw frames that are JPEG files stay so, for renderers on a device */
    SST_LOAD_SOURCES = 512,   /* with SST_LOAD_IMAGES: keep the sources of rectified pictures, and of those that are
                                 corrected later, for sst_lightfield_borrow() */
};

struct sst_share;

/** Empty light field with the reference view of the grid chosen and unit offsets set; all views absent.
 *  @return 0, -EINVAL (rows or cols below 1, more than SST_MAX_VIEWS), -ENOMEM. */
SST_MUST_CHECK int sst_lightfield_init(struct sst_lightfield *lf, int rows, int cols);
void sst_lightfield_fini(struct sst_lightfield *lf);

/** True if the view, or any view, has maps of this kind (SST_LOAD_DISPARITY, SST_LOAD_LABELS or SST_LOAD_CONFIDENCE).
 */
bool sst_view_has(const struct sst_view *v, enum sst_lightfield_load kind);
bool sst_lightfield_has(const struct sst_lightfield *lf, enum sst_lightfield_load kind);

/** Valid pixels of a view's confidence map, and how many of them another view confirms: matching gives the others
 * confidence 0. */
struct sst_confirmed {
    int64_t pixels, confirmed;
};
struct sst_confirmed sst_view_confirmed(const struct sst_view *v);

/** Fraction of the disparities that another view confirms. NaN: no confidences. */
double sst_lightfield_confirmed(const struct sst_lightfield *lf, int threads);

/** Copy a view's image, validity mask and offset; buffers of `to` of the same size are reused.
 *  @return 0, -ENOMEM (`to` is still freed with its light field) */
SST_MUST_CHECK int sst_view_copy(struct sst_view *to, const struct sst_view *from);

/** True if the view has an image or an encoded one. */
bool sst_view_has_frame(const struct sst_view *v);

/** Decode the encoded frame of a view. @param out  initialised here @return as sst_image_decode() (logged) */
SST_MUST_CHECK int sst_lightfield_decode_frame(struct sst_image *out, const struct sst_lightfield *lf, int view);

/**
 * Write the view's raw frame, or the source of its corrected picture, as R, G, B and an unused byte a pixel.
 * @param rgbx  rows `stride` bytes apart, of the frame's size; may be memory that is slow to read
 * @return as sst_lightfield_decode_frame()
 */
SST_MUST_CHECK int sst_lightfield_put_frame(uint8_t *rgbx, size_t stride, const struct sst_lightfield *lf, int view);

/** Set ref_view: the middle of the grid, or the present view nearest to it (ties: the lower index).
 *  Offsets are not touched. @return 0, -EBADMSG (no view is present; not logged). */
SST_MUST_CHECK int sst_lightfield_choose_ref(struct sst_lightfield *lf);

/**
 * Read a light-field folder. With a calibration, images are rectified as they are loaded (SST_LOAD_RAW: not), the same
 * bytes for any number of threads. Maps in `what` that the folder lacks stay empty; missing images are an error. Checks
 * every size, and the hash of each image's file (SST_LOAD_UNVERIFIED: not); decodes on `threads` threads.
 *
 * @return 0, -ENOENT, -EBADMSG, -ENOMEM, -EIO; logged.
 */
SST_MUST_CHECK int sst_lightfield_load(struct sst_lightfield *lf, const char *dir, unsigned what, int threads);

/**
 * Add data of one view to a light field that was loaded without pictures (`what` 0), as sst_lightfield_load() with `what` would
 * load it; SST_LOAD_RAW is none of it. The caller frees it by sst_view_empty(). @return as sst_lightfield_load(); logged
 */
SST_MUST_CHECK int sst_lightfield_load_view(struct sst_lightfield *lf, const char *dir, unsigned what, int view);

/** Free pictures and maps of a view, which stays present. */
void sst_view_empty(struct sst_view *view);

/** Load a light field, the views shared with other processes that load it (share.h). @param share  or NULL */
SST_MUST_CHECK int sst_lightfield_shared_load(struct sst_share *share, struct sst_lightfield *lf, const char *dir,
                                              unsigned what, int threads);

/**
 * Make the pictures of a light field that keeps its sources those that its folder would be loaded with: pictures that
 * were rectified and then corrected are made of their raw frames in one step. Once, after sst_lightfield_correct().
 * @return 0, -EINVAL, -ENOMEM; logged
 */
SST_MUST_CHECK int sst_lightfield_settle(struct sst_lightfield *lf, int threads);

/**
 * Share the data of a settled light field as if its folder were loaded: of SST_LOAD_RAW, SST_LOAD_ORIGINALS and
 * SST_LOAD_CONFIDENCE what is asked for alone, and all else.
 * @param out  freed by sst_lightfield_return(), before lf @return 0, -ENOMEM (not logged)
 */
SST_MUST_CHECK int sst_lightfield_borrow(struct sst_lightfield *out, const struct sst_lightfield *lf, unsigned what);
void sst_lightfield_return(struct sst_lightfield *borrowed);

/**
 * Set lf->samples from the views' files in dir: the range that all views of 16 bits are scaled from when they are
 * loaded. Losses are logged. To be called before sst_lightfield_write() by code that makes a light field from files.
 * @param name  of the light field, for messages @return 0, -ENOENT, -EBADMSG, -EIO, -ENOMEM; logged
 */
SST_MUST_CHECK int sst_lightfield_choose_samples(struct sst_lightfield *lf, const char *dir, const char *name);

/** Distinct samples of the reference view's file, and the levels that they become; 0 and 0: it has 8 bits.
 *  @param report  log the loss. @return as sst_lightfield_choose_samples() */
SST_MUST_CHECK int sst_lightfield_levels(const struct sst_lightfield *lf, const char *dir, bool report, int *before,
                                         int *after);

/** Read the file of a view, levels as they are, neither rectified nor corrected. @param out  initialised here @return as
 *  sst_lightfield_load(), logged */
SST_MUST_CHECK int sst_lightfield_read_file(struct sst_deep *out, const struct sst_lightfield *lf, const char *dir, int view);

/** Samples of the views' files, which all have 16 bits: red, green and blue of each view. @param plane  out, [rows * cols][3],
 *  zeroed before; to be freed by the caller also after failures. @return as sst_lightfield_choose_samples(), -EBADMSG:
 * fewer bits,
 *  another size */
SST_MUST_CHECK int sst_lightfield_read_deep(struct sst_map_u16 (*plane)[3], const struct sst_lightfield *lf, const char *dir,
                                            int threads);

/** Qualities of the views' files (sst_jpeg_quality()). @param quality  out, [rows * cols]; NAN: no JPEG.
 *  @return as sst_lightfield_choose_samples() */
SST_MUST_CHECK int sst_lightfield_jpeg_quality(double *quality, const struct sst_lightfield *lf, const char *dir);

/**
 * Write lightfield.json plus every non-empty disparity, labels and confidence map into `dir`, an open sst_outdir's
 * temporary folder in which views/ is already filled, and calibration.yaml where there is a calibration. An empty
 * sha256 is computed from the view's file.
 * @return 0, -EINVAL (the light field is inconsistent), -ENOENT, -EIO, -ENOSPC, -ENOMEM; logged.
 */
SST_MUST_CHECK int sst_lightfield_write(const struct sst_lightfield *lf, const char *dir, int threads);

/**
 * Replace the derived maps (disparity/, labels/, confidence/) and lightfield.json of an existing folder. Every file is
 * written beside the old ones first, then swapped in; a failure leaves the old state. Folders of maps that no view has
 * in memory are kept; the others are replaced as a whole.
 * @return as sst_lightfield_write()
 */
SST_MUST_CHECK int sst_lightfield_save_maps(const struct sst_lightfield *lf, const char *dir, int threads);

/** "rr_cc" of a view. */
void sst_view_name(const struct sst_lightfield *lf, int view, char out[16]);

/** Stored value of a disparity: nearest 1/64 px, SST_DISP_NONE when not finite or outside the range that can be stored.
 */
static inline uint16_t sst_disp_q6(const struct sst_lightfield *lf, double disp_px)
{
    const double q = (disp_px - lf->disp_min_px) * SST_DISP_SCALE + 0.5;

    if (q >= 0.0 && q < SST_DISP_MAX_Q6 + 1.0)
        return (uint16_t)q;
    return SST_DISP_NONE;
}

static inline double sst_disp_px(const struct sst_lightfield *lf, uint16_t disp_q6)
{
    return lf->disp_min_px + disp_q6 / SST_DISP_SCALE;
}

#endif
