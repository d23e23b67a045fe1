/* simulators/scene/raster.h - inside the renderer: what raster.c and layers.c share. */
#ifndef SST_SIMULATORS_SCENE_RASTER_H
#define SST_SIMULATORS_SCENE_RASTER_H

#include "simulators/scene/world.h"

#define SST_BAND_ROWS 16
#define SST_COLOURS   4 /* samples that make the colour; */
#define SST_CENTRE    4 /* and the one that makes the truth */
#define SST_SAMPLES   5
#define SST_NOTHING   UINT32_MAX

/* c + x * pixel x + y * pixel y */
struct sst_affine {
    double x, y, c;
};

/** A surface as one view sees it. */
struct sst_seen {
    struct sst_affine inv_z;   /* patch */
    struct sst_affine axis[3]; /* patch: s/Z, t/Z; ellipsoid: the ray in units of the half-axes */
    double eye[3];             /* ellipsoid: the camera in units of the half-axes */
    int x0, x1, y0, y1;        /* output pixels it may cover, ends excluded; empty: not seen */
};

/** Samples of rows y0 .. y0+rows-1; columns x0 .. x1-1 are worked on. */
struct sst_band {
    const struct sst_raster *r;
    const struct sst_seen *seen;
    int y0, rows, x0, x1;
    int top, capacity;      /* first row that the buffers hold, and how many */
    float *inv_z;           /* [SST_SAMPLES][capacity][width], 0: nothing */
    uint32_t *owner;        /* the same, surface index */
    struct sst_rgb *colour; /* [SST_COLOURS][capacity][width]; NULL: truth alone */
};

SST_MUST_CHECK int sst_band_init(struct sst_band *b, const struct sst_raster *r, int capacity);
void sst_band_fini(struct sst_band *b);

static inline size_t sst_band_cell(const struct sst_band *b, int sample, int y, int x)
{
    return ((size_t)sample * (size_t)b->capacity + (size_t)(y - b->top)) * (size_t)b->r->width + (size_t)x;
}

void sst_surface_see(const struct sst_raster *r, const struct sst_surface *s, struct sst_seen *out);

/** Nothing is seen yet. */
void sst_band_clear(struct sst_band *b);
void sst_band_opaque(struct sst_band *b, uint32_t index);
/** Colour what the samples see; with `only`, those whose surface it names. @param only [count of surfaces] or NULL */
void sst_band_colour(struct sst_band *b, const bool *only);
void sst_band_translucent(struct sst_band *b, uint32_t index);
/** Write the outputs of the raster. */
void sst_band_store(const struct sst_band *b);

#endif
