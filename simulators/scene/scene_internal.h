/* simulators/scene/scene_internal.h - what the files of this folder share; code outside of it includes the public
 * headers. */
#ifndef SST_SIMULATORS_SCENE_SCENE_INTERNAL_H
#define SST_SIMULATORS_SCENE_SCENE_INTERNAL_H

#include "simulators/scene/world.h"

/* --- internal: the scene object, shared by scene.c and write.c. --- */

#define SST_SCENE_MAX_VIEWS 256

struct sst_scene {
    struct sst_scene_config cfg;
    struct sst_world world;
    double range_min_px, range_max_px;
};

/** A raster of one view with all outputs NULL. */
void scene_raster(const struct sst_scene *scene, double bx, double by, unsigned hidden, struct sst_raster *out);

/* --- models: toy-sized models: animals, vehicles. --- */

/** A model stands at `base` on the ground, its front turned by `yaw` rad from the picture's right towards the cameras;
 *  `scale` is that of the model to the real thing. */
struct stand {
    struct sst_vec3 base;
    double scale, yaw;
};

void add_horse(struct sst_world *w, struct stand at);
void add_bicycle(struct sst_world *w, struct stand at);
void add_motorcycle(struct sst_world *w, struct stand at);
void add_humvee(struct sst_world *w, struct stand at);
void add_cat(struct sst_world *w, struct stand at);
void add_hen(struct sst_world *w, struct stand at);

/* --- raster: inside the renderer: what raster.c and layers.c share. --- */

#define SST_BAND_ROWS 16
#define SST_COLOURS   4 /* samples that make the colour; */
#define SST_CENTRE    4 /* and the one that makes the truth */
#define SST_SAMPLES   5
#define SST_NOTHING   UINT32_MAX

/* c + x * pixel x + y * pixel y */
struct raster_affine {
    double x, y, c;
};

/** A surface as one view sees it. */
struct sst_seen {
    struct raster_affine inv_z;   /* patch */
    struct raster_affine axis[3]; /* patch: s/Z, t/Z; ellipsoid: the ray in units of the half-axes */
    double eye[3];                /* ellipsoid: the camera in units of the half-axes */
    int x0, x1, y0, y1;           /* output pixels it may cover, ends excluded; empty: not seen */
};

/** Samples of rows y0 .. y0+rows-1; columns x0 .. x1-1 are worked on. */
struct band {
    const struct sst_raster *r;
    const struct sst_seen *seen;
    int y0, rows, x0, x1;
    int top, capacity;      /* first row that the buffers hold, and how many */
    float *inv_z;           /* [SST_SAMPLES][capacity][width], 0: nothing */
    uint32_t *owner;        /* the same, surface index */
    struct sst_rgb *colour; /* [SST_COLOURS][capacity][width]; NULL: truth alone */
};

SST_MUST_CHECK int band_init(struct band *b, const struct sst_raster *r, int capacity);
void band_fini(struct band *b);

static inline size_t band_cell(const struct band *b, int sample, int y, int x)
{
    return ((size_t)sample * (size_t)b->capacity + (size_t)(y - b->top)) * (size_t)b->r->width + (size_t)x;
}

void surface_see(const struct sst_raster *r, const struct sst_surface *s, struct sst_seen *out);

/** Nothing is seen yet. */
void band_clear(struct band *b);
void band_opaque(struct band *b, uint32_t index);
/** Colour what the samples see; with `only`, those whose surface it names. @param only [count of surfaces] or NULL */
void band_colour(struct band *b, const bool *only);
void band_translucent(struct band *b, uint32_t index);
/** Write the outputs of the raster. */
void band_store(const struct band *b);

#endif
