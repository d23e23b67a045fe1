/* simulators/scene/scene_internal.h - private declarations of this folder; code outside of it includes the public
 * headers. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_SIMULATORS_SCENE_SCENE_INTERNAL_H
#define SST_SIMULATORS_SCENE_SCENE_INTERNAL_H

#include "simulators/scene/hedge.h"
#include "simulators/scene/surfaces.h"

/* --- internal: the scene object. --- */

#define SST_SCENE_MAX_VIEWS 256

struct sst_scene {
    struct sst_scene_config cfg;
    struct sst_scene_world world;
    double range_min_px, range_max_px;
    struct photo_scene *photo; /* the scene `layers`; NULL: the world's surfaces */
};

/** Mask of the reference view: 255 where the occluder stands. @return 0 or -ENOMEM */
SST_MUST_CHECK int scene_mask(const struct sst_scene *scene, int occluder, struct sst_map_u8 *mask);

/* --- surfaces: the parts that only scenes of this folder use. --- */

static inline struct sst_scene_rgb blend_rgb(struct sst_scene_rgb a, struct sst_scene_rgb b, float t)
{
    return (struct sst_scene_rgb){ a.r + (b.r - a.r) * t, a.g + (b.g - a.g) * t, a.b + (b.b - a.b) * t };
}

static inline struct sst_scene_rgb dimmed(struct sst_scene_rgb c, float gain)
{
    return (struct sst_scene_rgb){ c.r * gain, c.g * gain, c.b * gain };
}

/** The point at design pixel (x, y) with disparity d, and the mm per design pixel there. */
struct sst_vec3 world_at(const struct sst_scene_world *w, double x, double y, double disp_px);
double world_mm(const struct sst_scene_world *w, double disp_px);

/** Declare an occluder; its bit for `hide`. */
unsigned world_occluder(struct sst_scene_world *w, const char *name, int label, int target_label);

/** Half axes of an ellipsoid or a box. */
struct axes {
    struct sst_vec3 u, v, w;
};

/* Like sst_scene_add_patch(). */
struct sst_scene_surface *add_ellipsoid(struct sst_scene_world *w, struct sst_vec3 centre, struct axes axes,
                                        struct sst_scene_material mat);
/** @param r  radii */
struct sst_scene_surface *add_ball(struct sst_scene_world *w, struct sst_vec3 centre, struct sst_vec3 r,
                                   struct sst_scene_material mat);
/** Ellipsoid around the segment p-q, v along it. */
struct sst_scene_surface *add_limb(struct sst_scene_world *w, struct sst_vec3 p, struct sst_vec3 q, double radius,
                                   struct sst_scene_material mat);
/** Strip from p to q that faces the cameras and is lit like a cylinder. */
struct sst_scene_surface *add_bar(struct sst_scene_world *w, struct sst_vec3 p, struct sst_vec3 q, double half_width,
                                  struct sst_scene_material mat);
/** Six patches. */
void add_box(struct sst_scene_world *w, struct sst_vec3 centre, struct axes axes, struct sst_scene_material mat);
/** Plane facing the cameras, half size in design pixels. @param at  design pixel (x, y) of its centre, and disparity */
struct sst_scene_surface *add_board(struct sst_scene_world *w, struct sst_vec3 at, double half_x, double half_y,
                                    struct sst_scene_material mat);
/** Soft dark spot on the floor; belongs to no occluder, because a shadow stays when the occluder is
 *  hidden. */
void add_shadow(struct sst_scene_world *w, struct sst_vec3 at, double rx, double rz);
/** Box of design pixels and disparities, each from and to. */
struct room {
    const double *x, *y, *disp_px; /* [2] */
};

/** Leaves of half width `half_mm` in a room. */
void add_foliage(struct sst_scene_world *w, int count, struct room room, double half_mm);
/** One branch with twigs, from a to b. */
void add_branch(struct sst_scene_world *w, struct sst_vec3 a, struct sst_vec3 b, double half_mm);

/* Paints; a and b are the two colours of a material. */
sst_scene_paint_fn paint_cloth; /* plaid; k: 0 plaid, 1 stripes along y, 2 denim, 3 corduroy */
sst_scene_paint_fn paint_brick; /* bricks a, mortar b; scale: length of a brick */
sst_scene_paint_fn paint_slabs; /* square slabs with joints */
sst_scene_paint_fn paint_leaf;
sst_scene_paint_fn paint_face;   /* skin a, hair b, on a head with w forward and v down */
sst_scene_paint_fn paint_text;   /* the text in b on a, with a border; k: lines of the same text */
sst_scene_paint_fn paint_facade; /* bricks a with windows, joints and frames b; scale: length of a brick, k: bricks from
                                  window to window */
sst_scene_paint_fn paint_poster; /* a picture of shapes of colours between a and b, the text below */
sst_scene_paint_fn paint_landscape; /* sky a, hills b */
sst_scene_paint_fn paint_van;       /* rear of a white van, a body, b bumper */
sst_scene_paint_fn paint_car;       /* rear of a car */
sst_scene_paint_fn paint_glass;     /* rear window with frame a */
sst_scene_paint_fn paint_fur;       /* hair a to b along y; k: strength of the stripes */
sst_scene_paint_fn paint_camouflage;
sst_scene_paint_fn paint_feather;
sst_scene_paint_fn paint_wheel;    /* tyre, rim and spokes; with mask_wheel */
sst_scene_paint_fn paint_membrane; /* translucent */
sst_scene_paint_fn paint_tissue;   /* nuclei and organelles */
sst_scene_paint_fn paint_shadow;   /* translucent, at most half opaque */

/* Outlines. */
sst_scene_mask_fn mask_leaf;
sst_scene_mask_fn mask_disc;
sst_scene_mask_fn mask_rounded;   /* outline: radius of the corners, of the half height */
sst_scene_mask_fn mask_trapezoid; /* outline: width of the top edge, of the bottom edge */
sst_scene_mask_fn mask_wheel;     /* outline: 0 open with spokes, else inner radius of a thick tyre round a disc */

struct figure {
    struct sst_vec3 base; /* on the ground between the feet */
    double scale;         /* 1: 1750 mm tall */
    double yaw;           /* rad; 0 faces the cameras, pi/2 walks to the right */
    double stride;        /* rad, swing of the legs; arms swing against it */
    bool seated;
    struct sst_scene_material skin, face, shirt, trousers, shoes;
};

void add_figure(struct sst_scene_world *w, const struct figure *f);

/* Build functions of the scenes. */
typedef void build_fn(struct sst_scene_world *w);
build_fn build_bush, build_pedestrian, build_transportation, build_cell, build_humvee, build_cd_cases, build_cat, build_bust,
    build_terrace;

/* --- hedge: the person behind it (hedge_person.c) --- */

struct hedge_figure; /* opaque; read-only after create */

/** A picture that is being drawn. */
struct hedge_canvas {
    uint32_t *px; /* [height][width] 0xBBGGRR */
    int width, height;
    double light;
    const struct hedge_figure *figure; /* NULL: flat shapes */
};

uint32_t hedge_colour(double r, double g, double b);

/** Render a figure in all phases of its stride; free() frees it. @return 0 or -ENOMEM */
SST_MUST_CHECK int hedge_figure_create(struct hedge_figure **out);

/** Draw a person as the view at (bx, by) spacings from the reference view sees it. */
void hedge_person_draw(const struct hedge_canvas *c, const struct sst_hedge_person *p, double bx, double by);

/** The part of a person that the reference view, which is drawn, sees. */
double hedge_person_seen(const struct hedge_canvas *c, const struct sst_hedge_person *p);

/* --- models: animals, vehicles, furniture. --- */

/** A model stands at `base` on the ground, its front rotated by `yaw` rad from the picture's right towards the
 *  cameras; `scale` is model size over real size. */
struct stand {
    struct sst_vec3 base;
    double scale, yaw;
};

/** Add a model of models.txt. */
void add_model(struct sst_scene_world *w, const char *name, struct stand stand);

/* --- raster: the renderer, shared by raster.c and layers.c. --- */

#define SST_BAND_ROWS 16
#define SST_COLOURS   4 /* samples for the colour */
#define SST_CENTRE    4 /* index of the sample for the truth */
#define SST_SAMPLES   5
#define SST_NOTHING   UINT32_MAX

/* c + x * pixel x + y * pixel y */
struct raster_affine {
    double x, y, c;
};

/** A surface as one view sees it. */
struct visible_surface {
    struct raster_affine inv_z;   /* patch */
    struct raster_affine axis[3]; /* patch: s/Z, t/Z; ellipsoid: the ray in units of the half-axes */
    double eye[3];                /* ellipsoid: the camera in units of the half-axes */
    int x0, x1, y0, y1;           /* output pixels it may cover, ends excluded; empty: not visible */
};

/** Samples of rows y0 .. y0+rows-1; drawing is limited to columns x0 .. x1-1. */
struct band {
    const struct sst_scene_raster *r;
    const struct visible_surface *seen;
    int y0, rows, x0, x1;
    int top, capacity;            /* first row that the buffers hold, and how many */
    float *inv_z;                 /* [SST_SAMPLES][capacity][width], 0: nothing */
    uint32_t *owner;              /* the same, surface index */
    struct sst_scene_rgb *colour; /* [SST_COLOURS][capacity][width]; NULL: truth alone */
};

SST_MUST_CHECK int band_init(struct band *b, const struct sst_scene_raster *r, int capacity);
void band_fini(struct band *b);

static inline size_t band_cell(const struct band *b, int sample, int y, int x)
{
    return ((size_t)sample * (size_t)b->capacity + (size_t)(y - b->top)) * (size_t)b->r->width + (size_t)x;
}

void surface_see(const struct sst_scene_raster *r, const struct sst_scene_surface *s, struct visible_surface *out);

/** Reset all samples to nothing. */
void band_clear(struct band *b);
void band_opaque(struct band *b, uint32_t index);
/** Colour the samples; with `only`, just those of the selected surfaces. @param only  [count of surfaces] or NULL */
void band_colour(struct band *b, const bool *only);
void band_translucent(struct band *b, uint32_t index);
/** Write the outputs of the raster. */
void band_store(const struct band *b);

/* --- layers of photographs (photo_*.c) --- */

#define PHOTO_DISP_MAX 70 /* px per spacing in a picture 480 wide: above all disparities */

/* Library: pictures, their labels, and the objects cut out of them. */

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

/* Textures: places of photos from which a sprite gets its colours. */

struct photo_texture {
    const struct photo *photo;
    const struct photo_library *quilt; /* or NULL; patches of leaves from many photos instead of the one */
    double x, y, step_x, step_y;       /* photo position of (0, 0); photo pixels per texel, below 0: mirrored */
    double shade, contrast;            /* factor of the brightness; 1: the photo's contrast */
    double cell;                       /* of the quilt, texels */
    uint32_t seed;
};

/* Sprites. */

/** Pixels on the plane of disparity d = d0 + gx x + gy y, (x, y) in the reference view. */
struct photo_sprite {
    double x, y; /* of texel (0, 0) in the reference view */
    double d0, gx, gy;
    double order; /* sprites are in front of ones of a lower order */
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
/** Set texel i: opacity 0..1, colour from the texture at a place (x, y). */
void photo_sprite_set(struct photo_sprite *p, int i, double alpha, const struct photo_texture *t, const double at[2]);
/** Add an object with the given scale, its foot's middle at (x, y), upright or mirrored. NULL: out of memory */
struct photo_sprite *photo_sprite_object(struct photo_scene *s, const struct photo_object *o, double x, double y,
                                         double scale);
/** A random texture of any photo. */
struct photo_texture photo_texture_random(struct photo_scene *s);
/** A random texture of a place with leaves. */
struct photo_texture photo_texture_leaf(struct photo_scene *s);
double photo_random(struct photo_scene *s, double lo, double hi);
int photo_pick(struct photo_scene *s, int n);

/** Add the occluder's sprites. @param near_px  lowest disparity  @param spread_px  above it
 *  @return 0, -EINVAL (unknown kind, logged), -ENOMEM */
SST_MUST_CHECK int photo_occluder_add(struct photo_scene *s, const char *kind, double cover, double near_px,
                                      double spread_px);

/* Renderer. */

/** Find the rows' transparent ends, after the last change of the texels. @return 0 or -ENOMEM */
SST_MUST_CHECK int photo_sprite_index(struct photo_sprite *p);

/**
 * Render one view; see sst_scene_render().
 * @param mask  out: 255 where the occluder's opacity is above one half; or NULL
 * @return 0 or -ENOMEM
 */
SST_MUST_CHECK int photo_render(const struct photo_scene *s, const double b[2], bool hidden,
                                const struct sst_scene_maps *out, struct sst_map_u8 *mask);

/** Add the camera's gain and noise to the picture of a view. */
void photo_expose(const struct photo_scene *s, struct sst_image *image, int view, bool reference);

#endif
