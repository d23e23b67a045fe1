/* simulators/scene/surfaces.h - building blocks of scenes: textured patches and ellipsoids; the renderer. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_SIMULATORS_SCENE_SURFACES_H
#define SST_SIMULATORS_SCENE_SURFACES_H

#include <math.h>
#include <stdbool.h>

#include "pipeline/image/font.h"
#include "simulators/scene/noise.h"
#include "simulators/scene/scene.h"

/* Positions are mm in the frame of the reference view: x right, y down, z forward. Design pixels belong to a picture
 * 1000 px wide, counted from the principal point; every other size is the same picture scaled. */

struct sst_scene_rgb {
    float r, g, b;
};

/** Intersection of a ray with a surface. Depends only on the surface point: all views see the same. */
struct sst_scene_hit {
    struct sst_vec3 t; /* mm along the surface's axes; z is 0 on a patch */
    struct sst_vec3 q; /* t with the half-axes as units: -1..1 on a patch, length 1 on an ellipsoid */
    struct sst_vec3 n; /* unit normal */
};

struct sst_scene_surface;

/** Colour before lighting, 0..1. @return opacity 0..1, used for translucent surfaces only */
typedef float sst_scene_paint_fn(const struct sst_scene_surface *s, const struct sst_scene_hit *h,
                                 struct sst_scene_rgb *out);

/** True if the point (x, y), -1..1 each, is inside the outline. */
typedef bool sst_scene_mask_fn(const struct sst_scene_surface *s, double x, double y);

struct sst_scene_material {
    sst_scene_paint_fn *paint;
    struct sst_scene_rgb a, b;
    double scale_mm;  /* size of the pattern */
    double k;         /* the paint's own parameter */
    const char *text; /* for paints with text */
};

struct sst_scene_surface {
    bool ellipsoid;
    bool translucent; /* blended with its background; such surfaces are added from far to near */
    bool round;       /* patch lit like the cylinder with axis u */
    bool unlit;
    uint8_t label;
    unsigned hide; /* bit i: belongs to occluder i */
    uint32_t seed;
    float grain; /* strength of the fine texture on every surface */
    double grain_mm;
    struct sst_scene_material mat;
    const void *own;                 /* data of an external paint */
    sst_scene_mask_fn *mask;         /* NULL: the whole patch */
    double outline;                  /* the mask's own parameter */
    struct sst_vec3 origin, u, v, w; /* centre and half-axes; a patch has no w */
};

struct sst_scene_world {
    double focal, spacing_mm; /* focal length in design pixels */
    double shift;             /* offset of the principal point below the picture's centre, design pixels */
    double time_s;
    uint64_t rng;
    /* properties of the surfaces added next */
    int label;
    unsigned hide;
    struct sst_scene_rgb tint; /* factors of their colours */
    /* surfaces added so far */
    struct sst_scene_surface *surfaces, scrap;
    int count, capacity;
    bool failed; /* out of memory */
    struct sst_scene_occluder occluders[SST_SCENE_MAX_OCCLUDERS];
    int occluder_count;
};

static inline struct sst_vec3 vec3(double x, double y, double z)
{
    return (struct sst_vec3){ x, y, z };
}

static inline struct sst_vec3 vec3_add(struct sst_vec3 a, struct sst_vec3 b)
{
    return vec3(a.x + b.x, a.y + b.y, a.z + b.z);
}

static inline struct sst_vec3 vec3_sub(struct sst_vec3 a, struct sst_vec3 b)
{
    return vec3(a.x - b.x, a.y - b.y, a.z - b.z);
}

static inline struct sst_vec3 vec3_mul(struct sst_vec3 a, double s)
{
    return vec3(a.x * s, a.y * s, a.z * s);
}

static inline double vec3_dot(struct sst_vec3 a, struct sst_vec3 b)
{
    return a.x * b.x + a.y * b.y + a.z * b.z;
}

static inline struct sst_vec3 vec3_cross(struct sst_vec3 a, struct sst_vec3 b)
{
    return vec3(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);
}

/** Length 1; a zero vector stays zero. */
static inline struct sst_vec3 vec3_unit(struct sst_vec3 a)
{
    const double n = sqrt(vec3_dot(a, a));

    return n > 0 ? vec3_mul(a, 1 / n) : a;
}

/** 0xRRGGBB. */
static inline struct sst_scene_rgb rgb_hex(unsigned c)
{
    return (struct sst_scene_rgb){ (float)(c >> 16 & 255) / 255, (float)(c >> 8 & 255) / 255, (float)(c & 255) / 255 };
}

static inline struct sst_scene_material material(sst_scene_paint_fn *paint, unsigned a, unsigned b, double scale_mm)
{
    return (struct sst_scene_material){ .paint = paint, .a = rgb_hex(a), .b = rgb_hex(b), .scale_mm = scale_mm };
}

/** Start an object: sets label, occluders and a random tint of the surfaces added from now on. */
void sst_scene_begin(struct sst_scene_world *w, int label, unsigned hide);

/* Add surfaces with the current label and hide bits. The pointer is valid until the next addition. */
struct sst_scene_surface *sst_scene_add_patch(struct sst_scene_world *w, struct sst_vec3 centre, struct sst_vec3 u,
                                              struct sst_vec3 v, struct sst_scene_material mat);
/** Horizontal plane y mm below the reference view from depth z0 to z1. */
struct sst_scene_surface *sst_scene_add_floor(struct sst_scene_world *w, double y, double z0, double z1,
                                              struct sst_scene_material mat);
/* Paints; a and b are the two colours of a material. */
sst_scene_paint_fn sst_scene_paint_fbm;  /* clouds from a to b; k: stretch along y, 0 means 1 */
sst_scene_paint_fn sst_scene_paint_wood; /* boards along x; scale: width of a board */

/**
 * Build a scene's surfaces at cfg->time_s, without the ranges that sst_scene_create() measures.
 *
 * @return 0, -EINVAL (unknown name or absurd size, logged), -ENOMEM
 */
SST_MUST_CHECK int sst_scene_world_build(struct sst_scene_world *w, const char *name,
                                         const struct sst_scene_config *cfg);
void sst_scene_world_fini(struct sst_scene_world *w);

/* --- the renderer ------------------------------------------------------------------------------------------------- */

/** Mapping from pixels to positions of an ideal camera: lens distortion, a rotated camera. */
struct sst_scene_warp {
    int width, height, columns, rows;
    float *x, *y;      /* [height][width]: position of a pixel's centre in the ideal picture */
    float (*tiles)[4]; /* [rows][columns]: minimum and maximum of x - column and y - row in a tile of pixels */
    float all[4];      /* minima and maxima of the whole picture */
};

/** Allocate the positions, which the caller fills in. @return 0 or -ENOMEM */
SST_MUST_CHECK int sst_scene_warp_init(struct sst_scene_warp *warp, int width, int height);
void sst_scene_warp_fini(struct sst_scene_warp *warp);
/** Compute the bounds after x and y are filled in. */
void sst_scene_warp_index(struct sst_scene_warp *warp);

/** Bounding box of the pixels that map into a box of the ideal picture. */
void sst_scene_warp_box(const struct sst_scene_warp *warp, double *lo_x, double *hi_x, double *lo_y, double *hi_y);

static inline double warp_x(const struct sst_scene_warp *warp, int x, int y)
{
    return warp->x[(size_t)y * (size_t)warp->width + (size_t)x];
}

static inline double warp_y(const struct sst_scene_warp *warp, int x, int y)
{
    return warp->y[(size_t)y * (size_t)warp->width + (size_t)x];
}

/** Rendering of one view of a world. Pixel (i, j) of the outputs samples picture position (i * step_x, j * step_y), or
 *  the warp's. */
struct sst_scene_raster {
    const struct sst_scene_world *world;
    double focal_px, cx, cy;
    int width, height;     /* of the outputs */
    double step_x, step_y; /* 1: full resolution; required for image and warp */
    double bx, by, eye_z_mm;
    unsigned hidden;
    const struct sst_scene_warp *warp; /* of the outputs' size; or NULL */
    struct sst_image *image;           /* or NULL */
    struct sst_map_f32 *disp;          /* or NULL */
    struct sst_map_u8 *label;          /* or NULL */
    struct sst_map_u8 *owner;          /* hide bits of the visible surface; or NULL */
};

/** @return 0 or -ENOMEM. */
SST_MUST_CHECK int sst_scene_raster_run(const struct sst_scene_raster *r);

/* --- many pictures of a nearly static world ----------------------------------------------------------------------- */

/** Find the surfaces that differ between two states of a world. @param moving  in and out, [count]: set, never
 *  cleared */
void sst_scene_world_compare(const struct sst_scene_world *a, const struct sst_scene_world *b, bool *moving);

struct sst_scene_layers; /* opaque; one thread at a time */

/**
 * Render the fixed surfaces once.
 *
 * @param r        its world, which must outlive the layers, its warp and image; the image is only used by draw
 * @param moving   [count of surfaces]; must outlive the layers
 * @param threads  to share the work among; at least 1
 * @return 0 or -ENOMEM
 */
SST_MUST_CHECK int sst_scene_layers_create(struct sst_scene_layers **out, const struct sst_scene_raster *r,
                                           const bool *moving, int threads);
void sst_scene_layers_destroy(struct sst_scene_layers *layers);

/** Draw rows y0 .. y1-1 of the image for another state of the world: the same bytes as sst_scene_raster_run(). */
void sst_scene_layers_draw(struct sst_scene_layers *layers, const struct sst_scene_world *world, int y0, int y1);

#endif
