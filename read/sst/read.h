/* sst/read.h - reader of light fields of sst for other programs: views as pixels, cameras, maps. Link with -lsst-read.
 *
 * A light field is a folder with lightfield.json: a lattice (views in rows and columns, rectified) or posed (a lens and a pose for
 * every view). Functions that return int return 0 or a negative errno; sst_read_error() then has one sentence: file, fault, remedy.
 * Outputs are untouched on failure. Each file is compared with its SHA-256; one view at a time is in memory. Different light fields
 * may be read by different threads, one light field by one thread at a time. Nothing is written, neither files nor messages.
 *
 * Structures begin with `size`, which the caller sets to their sizeof: later versions add members at the end.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_READ_H
#define SST_READ_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

struct sst_read; /* an open light field */

struct sst_read_info {
    size_t size;       /* in: sizeof(struct sst_read_info) */
    int posed;         /* 1: a lens and a pose for every view; 0: a lattice */
    int views;         /* numbered from 0; of a lattice row by row, absent ones included */
    int rows, cols;    /* posed: 0 */
    int reference;     /* view; posed: the placed one in the middle, -1: none is placed */
    int width, height; /* of every view, px */
    int channels, bits; /* posed: of the pictures, 1 (grey, thermal) or 3 and 8 or 16; of a lattice 3 and 8, with which sst computes */
    int labels;        /* names of labels; 0: a posed light field, which has no maps */
    int metric;        /* position_mm is in millimetres; 0: in a unit of the source */
    double focal_px, spacing_mm, infinity_px; /* of a lattice: depth in mm = focal_px spacing_mm / (disparity - infinity_px); NaN: not known */
    double kelvin_scale, kelvin_offset;       /* temperature = level kelvin_scale + kelvin_offset; 0: not thermal */
};

/** The camera that took the pixels of a view. A point X of the world is at P = rotation (X - position_mm) in its axes, x right, y down,
 *  z forward, and at x = fx a + cx, y = fy b + cy of (a, b) = (P.x, P.y) / P.z bent by k (k1 k2 p1 p2 k3 k4 k5 k6, OpenCV's model);
 *  the centre of the upper left pixel is (0, 0). The world of a lattice has the axes and the place of the reference view. */
struct sst_read_view {
    size_t size;      /* in: sizeof(struct sst_read_view) */
    int present;      /* 0: the lattice has a hole here */
    int placed;       /* the members from fx to position_mm are known; else NaN */
    int row, col;     /* of a lattice */
    double bx, by;    /* of a lattice: offset from the reference view in spacings, right and down; a point at x there is at x - disparity bx */
    double fx, fy, cx, cy, k[8];
    double rotation[9]; /* row-major */
    double position_mm[3];
    int moment;       /* posed: views of one moment were taken together; 0: not known */
    double time_s;    /* posed: since the first view; NaN: not known */
    const char *name; /* of the file in views/; posed: of the picture as it came; valid until the light field is closed */
};

/** Open the light field in a folder. @return 0, -ENOENT, -EBADMSG (damaged, or newer than this library), -EIO, -ENOMEM */
int sst_read_open(struct sst_read **out, const char *dir);
void sst_read_close(struct sst_read *lf); /* NULL is fine */

/** The sentence of this thread's last failure; "" if there was none. Valid until the thread's next call. */
const char *sst_read_error(void);

/** @return 0, -EINVAL (info->size) */
int sst_read_get_info(const struct sst_read *lf, struct sst_read_info *info);

/** @return 0, -EINVAL (out->size, view) */
int sst_read_get_view(const struct sst_read *lf, int view, struct sst_read_view *out);

/** Name of a label from 1 to info.labels, "unlabeled" for 0; NULL: there is no such label. Valid until the light field is closed. */
const char *sst_read_label_name(const struct sst_read *lf, int label);

/**
 * Pixels of a view as red, green, blue with 8 bits; grey three times. Of a lattice as sst computes with them: rectified, corrected,
 * levels of 16 bits scaled alike in all views; of posed light fields as in the file, levels of 16 bits by the light field's `samples`.
 * @param rgb     out, [height][width][3], rows `stride` bytes apart (0: without gaps)
 * @return 0, -EINVAL (view, stride), -ENODATA (no such view), -ENOENT, -EBADMSG (damaged or changed file), -EIO, -ENOMEM
 */
int sst_read_rgb8(struct sst_read *lf, int view, uint8_t *rgb, size_t stride);

/** The same with 16 bits: levels as in the file; levels of 8 bits, and of lattice views that are rectified or corrected, times 257. */
int sst_read_rgb16(struct sst_read *lf, int view, uint16_t *rgb, size_t stride);

/** Disparity of a lattice's view in px per spacing, NaN where there is none. @param px  out, [height][width], rows `stride` bytes
 *  apart (0: without gaps) @return as sst_read_rgb8(), -ENODATA also: the view has no map */
int sst_read_disparity(struct sst_read *lf, int view, float *px, size_t stride);

/** Labels, 0: unlabeled; confidence of the disparity, 0 to 255. @return as sst_read_disparity() */
int sst_read_labels(struct sst_read *lf, int view, uint8_t *label, size_t stride);
int sst_read_confidence(struct sst_read *lf, int view, uint8_t *confidence, size_t stride);

#ifdef __cplusplus
}
#endif

#endif
