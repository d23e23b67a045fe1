/* pipeline/posed/import/import_internal.h - private declarations of this folder. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_POSED_IMPORT_IMPORT_INTERNAL_H
#define SST_PIPELINE_POSED_IMPORT_IMPORT_INTERNAL_H

#include <jansson.h>

#include "pipeline/posed/import/import.h"
#include "pipeline/posed/posed_internal.h"

#define MODEL_NAME  512               /* bytes of a picture's name in a source */
#define MODEL_BYTES ((size_t)1 << 30) /* of a source's file */
#define METRE_MM    1000.0

/** View as a source describes it. */
struct model_view {
    char name[MODEL_NAME];   /* of the picture, as the source writes it */
    char path[SST_PATH_MAX]; /* of the picture, once it is found */
    int file;                /* number of the source's file with its pose, where there are several */
    int width, height;       /* of the pictures that the lens is of; 0: unknown */
    double angle[2];         /* across width and height, rad, of a lens that waits for the pictures' size; 0: unknown */
    struct sst_calib_camera camera; /* known: placed; fx 0: the lens is unknown; position in the source's unit */
};

/** All that a source says; lengths in its unit. */
struct model {
    const struct sst_posed_import_config *cfg;
    const char *format; /* "COLMAP" */
    const char *path;   /* of the file being read, for messages */
    struct model_view *view;
    int count, capacity;
    int other; /* pictures without a pose that are left out */
    struct sst_posed_point *points;
    int point_count;
    int64_t ahead, behind; /* observations of points in front of and behind the camera that sees them */
    double unit_mm;        /* of lengths: 1000 where it is unknown */
    bool metric;
    double up[3];
    bool geographic;
    double latitude, longitude, altitude_m;
    double median_px; /* NAN: unknown */
};

/** Add a view that is not placed and has no lens. @return NULL: too many, or no memory (logged) */
struct model_view *model_add(struct model *m, const char *name);

/** Log a fault of a view or, with an empty name, of the file: "FILE: NAME: FAULT". @return -EBADMSG */
int model_fault(const struct model *m, const char *name, const char *fault);

/**
 * Place a view by P = R X + t.
 * @return NULL, or the fault as a clause: not finite, mirrored, scaled, or not a rotation by more than 1e-3. Smaller
 * errors are corrected.
 */
const char *model_place(struct model_view *v, const double R[9], const double t[3]);

/** Set a lens with pixel centres at halves. @param k  OpenCV's order @param n  0, 4, 5 or 8 @return NULL, or the fault
 */
const char *model_lens(struct model_view *v, const double focal_centre[4], const double *k, int n);

/** Reserve points; more than can be stored are thinned by model_keeps_point(). @return 0, -ENOMEM (logged) */
SST_MUST_CHECK int model_reserve_points(struct model *m, uint64_t count);

/** Is this one of the points that are stored, of `count`? */
bool model_keeps_point(uint64_t index, uint64_t count);

/** Count whether a camera sees a point of its own in front of it. */
void model_observe(struct model *m, const struct sst_calib_camera *camera, const double at[3]);

/** A number, also as a text. @return false: neither, or not finite */
bool model_number(const json_t *value, double *out);

/** Values of these keys are numbers, null or missing. @return NULL, or the fault */
const char *model_check_numbers(const json_t *object, const char *const *keys, size_t n);

/** A list of n numbers, or of rows of numbers. @return false: another count, or no numbers */
bool model_numbers(const json_t *list, double *out, int n);

/** Load any JSON of another program. @return as sst_json_load() */
SST_MUST_CHECK int model_json(json_t **root, const char *path);

/* --- readers: fill the model. @return 0, -EBADMSG, -ENOENT, -EIO, -ENOMEM; logged --- */

typedef int read_model_fn(struct model *m, const char *path);
read_model_fn read_colmap, read_aos, read_nerfstudio, read_opensfm, read_geo, read_llff, read_mrcal;

/** The parser of a source, by its content. @param path  out: its file or folder @return NULL: unknown (logged) */
read_model_fn *model_reader(char path[SST_PATH_MAX], const char *source);

/* --- lenses of MATLAB --- */

/** Is this file of MATLAB's? */
bool matlab_is(const uint8_t *data, size_t size);

/** The lens of cameraParameters; width and height of the view stay 0 where the file has none. @return 0, -EBADMSG;
 * logged
 */
SST_MUST_CHECK int matlab_lens(struct model_view *v, const uint8_t *data, size_t size, const char *path);

/* --- pictures --- */

/** Find every view's picture, and pictures without a pose beside them. @return 0, -ENOENT, -EBADMSG, -ENOMEM; logged */
SST_MUST_CHECK int pictures_find(struct model *m, const char *path);

/** Pictures of a folder and its subfolders, in the natural order of their names. @return as pictures_find() */
SST_MUST_CHECK int pictures_list(struct model *m, const char *dir);

/** Names in their natural order: numbers by their values. */
int natural_order(const char *a, const char *b);

/** Moments and cameras of the views by the pattern of their names. @return 0, -EINVAL, -EBADMSG; logged */
SST_MUST_CHECK int moments_set(struct sst_posed *posed, const char *pattern);

/** Times of the views, where all names have a date and time. */
void times_set(struct sst_posed *posed);

/** Make the light field's folder of a complete model. @return as sst_posed_import() */
SST_MUST_CHECK int model_write(struct model *m);

#endif
