/* simulators/scene/photo.h - scenes of photographs in layers: their sources, sprites and renderer. */
#ifndef SST_SIMULATORS_SCENE_PHOTO_H
#define SST_SIMULATORS_SCENE_PHOTO_H

#include "simulators/scene/noise.h"
#include "simulators/scene/scene.h"

/* --- library: pictures, their labels, and the objects cut out of them. --- */

struct photo {
    struct sst_image image;
    struct sst_map_u8 label; /* default class list, 0 unknown; empty: none */
};

/** A connected region of one class. */
struct photo_object {
    const struct photo *photo;
    int label, x, y; /* upper left corner in the photo */
    struct sst_map_u8 mask;
};

struct photo_point {
    const struct photo *photo;
    int x, y;
};

struct photo_library {
    struct photo *photos;
    struct photo_object *objects; /* by area, the largest first */
    struct photo_point *leaves;   /* places with leaves; any places if no class is known */
    int count, object_count, leaf_count;
};

/** Read the pictures that the seed chooses of cfg->photos, or make procedural ones.
 *  @return 0, -ENOENT, -EBADMSG, -EINVAL, -ENOMEM, -EIO; logged except -ENOMEM */
SST_MUST_CHECK int photo_library_init(struct photo_library *lib, const struct sst_layers_config *cfg, uint64_t seed);
void photo_library_fini(struct photo_library *lib);

/* --- textures: places of photos from which a sprite gets its colours. --- */

struct photo_texture {
    const struct photo *photo;
    const struct photo_library *quilt; /* or NULL; patches of leaves from many photos instead of the one */
    double x, y, step_x, step_y;       /* photo position of (0, 0); photo pixels per texel, below 0: mirrored */
    double shade, contrast;            /* factor of the brightness; 1: the photo's contrast */
    double cell;                       /* of the quilt, texels */
    uint32_t seed;
};

/** Colour 0..255 at a texel; the photo goes on mirrored beyond its edges. */
void photo_texture_at(const struct photo_texture *t, double x, double y, float rgb[3]);

/* --- sprites --- */

/** Pixels on the plane of disparity d = d0 + gx x + gy y, (x, y) in the reference view. */
struct photo_sprite {
    double x, y; /* of texel (0, 0) in the reference view */
    double d0, gx, gy;
    double order; /* sprites are in front of those of a lower order */
    int width, height, label;
    bool front;      /* one of the occluder */
    uint8_t *rgba;   /* premultiplied, [height][width][4] */
    int (*spans)[2]; /* [height + 1]; of photo_sprite_index() */
};

struct photo_scene {
    int width, height;
    double scale; /* pixels per pixel of a picture 480 wide */
    double reach; /* largest offset of a view, spacings */
    uint64_t rng;
    struct photo_library library;
    struct photo_sprite *sprites; /* from front to back after photo_scene_create() */
    int count, capacity;
    double focus_px, cover_percent; /* cover: as it came out */
    double edge_px;                 /* standard deviation of the matte edges' blur */
    const char *kind;
    int target_label, front_label;
    double noise, gain_percent;
    int jpeg; /* quality; 0: PNG */
};

/** Compose the scene. @return as photo_library_init(); -EINVAL: unknown kind (logged) */
SST_MUST_CHECK int photo_scene_create(struct photo_scene **out, const struct sst_scene_config *cfg, int ref_row,
                                      int ref_col);
void photo_scene_destroy(struct photo_scene *scene);

/** Append a transparent sprite. NULL: out of memory */
struct photo_sprite *photo_sprite_add(struct photo_scene *s, int width, int height);
/** Share of a matte edge's pixel at `inside` px from the edge, blurred by sd px. */
double photo_edge(double inside, double sd);
/** Set one texel: opacity 0..1, colour from the texture at (tx, ty). */
void photo_sprite_set(struct photo_sprite *p, int x, int y, double alpha, const struct photo_texture *t, double tx,
                      double ty);
/** Add an object with the given scale, its foot's middle at (x, y), upright or mirrored. NULL: out of memory */
struct photo_sprite *photo_sprite_object(struct photo_scene *s, const struct photo_object *o, double x, double y,
                                         double scale);
/** A random texture of any photo. */
struct photo_texture photo_texture_random(struct photo_scene *s);
/** The same of a place with leaves. */
struct photo_texture photo_texture_leaf(struct photo_scene *s);
double photo_random(struct photo_scene *s, double lo, double hi);
int photo_pick(struct photo_scene *s, int n);

/** Add the occluder's sprites. @param near_px  lowest disparity  @param spread_px  above it
 *  @return 0, -EINVAL (unknown kind, logged), -ENOMEM */
SST_MUST_CHECK int photo_occluder_add(struct photo_scene *s, const char *kind, double cover, double near_px,
                                      double spread_px);

/* --- renderer --- */

/** Find the rows' transparent ends, after the last change of the texels. @return 0 or -ENOMEM */
SST_MUST_CHECK int photo_sprite_index(struct photo_sprite *p);

/**
 * Render one view; see sst_scene_render().
 * @param mask  out: 255 where the occluder's opacity is above one half; or NULL
 * @return 0 or -ENOMEM
 */
SST_MUST_CHECK int photo_render(const struct photo_scene *s, double bx, double by, bool hidden, struct sst_image *image,
                                struct sst_map_f32 *disp, struct sst_map_u8 *label, struct sst_map_u8 *mask);

/** Add the camera's gain and noise to the picture of a view. */
void photo_expose(const struct photo_scene *s, struct sst_image *image, int view, bool reference);

#endif
