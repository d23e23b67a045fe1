/* pipeline/posed/import/colmap_internal.h - parts of the readers of COLMAP's models, text and binary. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_POSED_IMPORT_COLMAP_INTERNAL_H
#define SST_PIPELINE_POSED_IMPORT_COLMAP_INTERNAL_H

#include "pipeline/posed/import/import_internal.h"

#define COLMAP_PARAMETERS 16
#define COLMAP_IDS        65536

struct colmap_camera {
    int64_t id, width, height;
    int lens; /* of the table of lenses */
    double p[COLMAP_PARAMETERS];
};

struct colmap_image {
    int64_t id, camera;
    double q[4], t[3]; /* world to camera; w first */
    char name[MODEL_NAME];
};

struct colmap_point {
    double at[3], error;
    int views;
};

struct colmap {
    struct model *m;
    struct colmap_camera *camera;
    int cameras, capacity;
    int64_t *id;   /* of the views' images */
    int *view_of;  /* [COLMAP_IDS]: view + 1 of small numbers of images; 0: none */
    double *error; /* of the points, px */
    int errors;
};

/** @return 0, -ENOMEM; to be freed in both cases */
SST_MUST_CHECK int colmap_init(struct colmap *c, struct model *m);
void colmap_fini(struct colmap *c);

/** Number of a camera model. @return -1: unknown */
int colmap_lens(const char *name);

/** Parameters of a camera model. @return -1: unknown */
int colmap_parameters(int64_t lens);

/** @return NULL: no memory (logged) */
struct colmap_camera *colmap_add_camera(struct colmap *c);

/** @return 0, -EBADMSG; logged */
SST_MUST_CHECK int colmap_add_image(struct colmap *c, const struct colmap_image *image);

/** View of an image. @return -1: none */
int colmap_view(const struct colmap *c, int64_t id);

/** Count a point in the track of an image. */
void colmap_observe(struct colmap *c, int64_t image, const double at[3]);

/** Memory for the points to keep of so many. @return 0, -ENOMEM; logged */
SST_MUST_CHECK int colmap_reserve(struct colmap *c, uint64_t count);

/** Keep a point. @return 0, -EBADMSG; logged */
SST_MUST_CHECK int colmap_add_point(struct colmap *c, const struct colmap_point *p);

/* Readers of files. @return 0, -ENOENT, -EBADMSG, -EIO, -ENOMEM; logged */
int colmap_text_cameras(struct colmap *c, const char *path);
int colmap_text_images(struct colmap *c, const char *path);
int colmap_text_points(struct colmap *c, const char *path);
int colmap_binary_cameras(struct colmap *c, const char *path);
int colmap_binary_images(struct colmap *c, const char *path);
int colmap_binary_points(struct colmap *c, const char *path);

#endif
