/* pipeline/posed/posed.h - a posed light field in memory: views with a lens, rotation and centre each; its folder. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_POSED_POSED_H
#define SST_PIPELINE_POSED_POSED_H

#include "pipeline/camera/calib.h"

#define SST_POSED_MAX_VIEWS 1024

struct sst_deep; /* pipeline/image/deep.h */

/**
 * One view. `camera.known` says whether it is placed: its lens, rotation and position are then in the axes of the light
 * field's world, P = rotation (X - position_mm); in a view that is not placed, the lens may be known alone (fx above 0).
 */
struct sst_posed_view {
    char name[256];                 /* the picture's name as it came, unique; with folders only where names alone are not */
    char file[256];                 /* in views/, untouched bytes of the picture */
    char sha256[65];                /* of the file */
    struct sst_calib_camera camera; /* gain and fall-off are not used */
    int moment;                     /* views of one moment were taken together; 0 where the source has no moments */
    double time_s;                  /* since the first view; NAN: unknown */
};

/** A point where cameras saw the scene, as structure from motion leaves it: for surfaces, and to judge poses. */
struct sst_posed_point {
    double at_mm[3];
    int views; /* that see it */
};

/** A point in a view's picture. */
struct sst_posed_sight {
    int view;
    float x, y; /* px */
};

struct sst_posed {
    int count;                   /* views, 1 to SST_POSED_MAX_VIEWS */
    int width, height;           /* of every view, px */
    int channels;                /* 1 or 3 */
    int bits;                    /* of the pictures' samples: 8 or 16 */
    struct sst_samples samples;  /* stretch of 16-bit levels for 8-bit pictures; white 0: 0..65535 */
    bool metric;                 /* position_mm is in millimetres; false: in a unit of the source, taken as metres */
    double up[3];                /* unit vector against gravity in the world's axes; 0, 0, 0: unknown */
    bool geographic;             /* the world's x is east, y north, z up, its origin here: */
    double latitude, longitude;  /* degrees, WGS 84 */
    double altitude_m;
    double kelvin_scale;         /* temperature in kelvin = level * kelvin_scale + kelvin_offset; 0: not thermal */
    double kelvin_offset;
    char source[1024];           /* provenance: format and origin */
    char history[1024];          /* origin of the poses, one line */
    double median_px;            /* of the reprojection of `points`; NAN: unknown */
    struct sst_posed_view *view; /* [count]. Owned. */
    struct sst_posed_point *points; /* [point_count], or NULL. Owned. */
    int point_count;
    struct sst_posed_sight *sights; /* points[0].views sights of the first point, then points[1].views of the next; NULL: unknown. Owned. */
    int sight_count;
    const struct sst_deep *picture; /* [count], of a light field without a folder; NULL: pictures are files. Borrowed. */
    struct sst_deep *kept;          /* [count] pictures that were read, of sst_posed_keep(); NULL: none is kept. Owned. */
};

/** True if the folder's lightfield.json describes a posed light field. @return false also where there is none */
bool sst_posed_is(const char *dir);

/** An empty one: views neither named nor placed. @return 0, -EINVAL (count), -ENOMEM; not logged */
SST_MUST_CHECK int sst_posed_init(struct sst_posed *posed, int count);
void sst_posed_fini(struct sst_posed *posed);

/**
 * Read lightfield.json and points of a folder; pictures stay on disk (picture.h).
 * @return 0, -ENOENT, -EBADMSG (one sentence: file, field), -ENOMEM, -EIO; logged
 */
SST_MUST_CHECK int sst_posed_load(struct sst_posed *posed, const char *dir);

/** Write lightfield.json into dir, an open sst_outdir's temporary folder with views/ filled; an empty sha256 is
 *  computed. @return 0, -EINVAL (inconsistent), or an output error; logged */
SST_MUST_CHECK int sst_posed_write(const struct sst_posed *posed, const char *dir);

/** Replace the lightfield.json of an existing folder, whole or not at all: new poses. @return as sst_posed_write() */
SST_MUST_CHECK int sst_posed_save(const struct sst_posed *posed, const char *dir);

/** Views that are placed. */
int sst_posed_placed(const struct sst_posed *posed);

/** Mean direction of view of the placed views, a unit vector. */
void sst_posed_forward(const struct sst_posed *posed, double forward[3]);

/** Placed view whose centre is nearest to the mean of all centres, and that looks forward. @return -1: none is placed */
int sst_posed_middle(const struct sst_posed *posed);

#endif
