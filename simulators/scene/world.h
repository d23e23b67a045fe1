/* simulators/scene/world.h - what scenes are made of: textured patches and ellipsoids, and the seven that are built. */
#ifndef SST_SIMULATORS_SCENE_WORLD_H
#define SST_SIMULATORS_SCENE_WORLD_H

#include <math.h>
#include <stdbool.h>

#include "pipeline/image/font.h"
#include "simulators/scene/noise.h"
#include "simulators/scene/scene.h"

/* Positions are mm in the frame of the reference view: x right, y down, z forward. Design pixels are those of a picture
 * 1000 px wide, counted from the principal point; every other size is the same picture scaled. */

struct sst_rgb {
    float r, g, b;
};

/** Where a ray meets a surface. Only functions of the surface point: all views see the same. */
struct sst_hit {
    struct sst_vec3 t; /* mm along the surface's axes; z is 0 on a patch */
    struct sst_vec3 q; /* the same with the half-axes as units: -1..1 on a patch, length 1 on an ellipsoid */
    struct sst_vec3 n; /* unit normal */
};

struct sst_surface;

/** Colour before light, 0..1. @return opacity 0..1; only translucent surfaces heed it. */
typedef float sst_paint_fn(const struct sst_surface *s, const struct sst_hit *h, struct sst_rgb *out);

/** Is the point (x, y), -1..1 each, inside the outline? */
typedef bool sst_mask_fn(const struct sst_surface *s, double x, double y);

struct sst_material {
    sst_paint_fn *paint;
    struct sst_rgb a, b;
    double scale_mm;  /* size of the pattern */
    double k;         /* the paint's own parameter */
    const char *text; /* of paints that write */
};

struct sst_surface {
    bool ellipsoid;
    bool translucent; /* blended over what is behind; such surfaces are added from far to near */
    bool round;       /* patch lit like the cylinder with axis u */
    bool unlit;
    uint8_t label;
    unsigned hide; /* bit i: belongs to occluder i */
    uint32_t seed;
    float grain; /* strength of the fine texture that every surface carries */
    double grain_mm;
    struct sst_material mat;
    const void *own;                 /* of a paint from elsewhere */
    sst_mask_fn *mask;               /* NULL: the whole patch */
    double outline;                  /* the mask's own parameter */
    struct sst_vec3 origin, u, v, w; /* centre and half-axes; a patch has no w */
};

struct sst_world {
    double focal, spacing_mm; /* focal length in design pixels */
    double shift;             /* of the principal point below the picture's middle, design pixels */
    double time_s;
    uint64_t rng;
    /* what surfaces added next get */
    int label;
    unsigned hide;
    struct sst_rgb tint; /* factors of their colours */
    /* added so far */
    struct sst_surface *surfaces, scrap;
    int count, capacity;
    bool failed; /* out of memory */
    struct sst_scene_occluder occluders[SST_SCENE_MAX_OCCLUDERS];
    int occluder_count;
};

static inline struct sst_vec3 sst_v(double x, double y, double z)
{
    return (struct sst_vec3){ x, y, z };
}

static inline struct sst_vec3 sst_add(struct sst_vec3 a, struct sst_vec3 b)
{
    return sst_v(a.x + b.x, a.y + b.y, a.z + b.z);
}

static inline struct sst_vec3 sst_sub(struct sst_vec3 a, struct sst_vec3 b)
{
    return sst_v(a.x - b.x, a.y - b.y, a.z - b.z);
}

static inline struct sst_vec3 sst_mul(struct sst_vec3 a, double s)
{
    return sst_v(a.x * s, a.y * s, a.z * s);
}

static inline double sst_dot(struct sst_vec3 a, struct sst_vec3 b)
{
    return a.x * b.x + a.y * b.y + a.z * b.z;
}

static inline struct sst_vec3 sst_cross(struct sst_vec3 a, struct sst_vec3 b)
{
    return sst_v(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);
}

/** Length 1; a zero vector stays zero. */
static inline struct sst_vec3 sst_unit(struct sst_vec3 a)
{
    const double n = sqrt(sst_dot(a, a));

    return n > 0 ? sst_mul(a, 1 / n) : a;
}

/** 0xRRGGBB. */
static inline struct sst_rgb sst_hex(unsigned c)
{
    return (struct sst_rgb){ (float)(c >> 16 & 255) / 255, (float)(c >> 8 & 255) / 255, (float)(c & 255) / 255 };
}

static inline struct sst_rgb sst_blend(struct sst_rgb a, struct sst_rgb b, float t)
{
    return (struct sst_rgb){ a.r + (b.r - a.r) * t, a.g + (b.g - a.g) * t, a.b + (b.b - a.b) * t };
}

static inline struct sst_material sst_mat(sst_paint_fn *paint, unsigned a, unsigned b, double scale_mm)
{
    return (struct sst_material){ .paint = paint, .a = sst_hex(a), .b = sst_hex(b), .scale_mm = scale_mm };
}

/** The point seen at design pixel (x, y) with disparity d, and the mm that one design pixel spans there. */
struct sst_vec3 sst_world_at(const struct sst_world *w, double x, double y, double disp_px);
double sst_world_mm(const struct sst_world *w, double disp_px);

/** Declare an occluder; its bit for `hide`. */
unsigned sst_world_occluder(struct sst_world *w, const char *name, int label, int target_label);

/** Surfaces added from now on make one object: its label, the occluders it belongs to and a tint of its own. */
void sst_begin(struct sst_world *w, int label, unsigned hide);

/* Each adds surfaces of the current label and hide bits. The pointer is valid until the next addition. */
struct sst_surface *sst_add_patch(struct sst_world *w, struct sst_vec3 centre, struct sst_vec3 u, struct sst_vec3 v,
                                  struct sst_material mat);
struct sst_surface *sst_add_ellipsoid(struct sst_world *w, struct sst_vec3 centre, struct sst_vec3 u, struct sst_vec3 v,
                                      struct sst_vec3 axis_w, struct sst_material mat);
struct sst_surface *sst_add_ball(struct sst_world *w, struct sst_vec3 centre, double rx, double ry, double rz,
                                 struct sst_material mat);
/** Ellipsoid around the segment p-q, v along it. */
struct sst_surface *sst_add_limb(struct sst_world *w, struct sst_vec3 p, struct sst_vec3 q, double radius,
                                 struct sst_material mat);
/** Strip from p to q that faces the cameras and is lit like a rod. */
struct sst_surface *sst_add_bar(struct sst_world *w, struct sst_vec3 p, struct sst_vec3 q, double half_width,
                                struct sst_material mat);
/** Six patches. */
void sst_add_box(struct sst_world *w, struct sst_vec3 centre, struct sst_vec3 u, struct sst_vec3 v,
                 struct sst_vec3 axis_w, struct sst_material mat);
/** Facing plane of disparity d, centred on design pixel (x, y), half size in design pixels. */
struct sst_surface *sst_add_board(struct sst_world *w, double x, double y, double disp_px, double half_x, double half_y,
                                  struct sst_material mat);
/** Horizontal plane y mm below the reference view from depth z0 to z1. */
struct sst_surface *sst_add_floor(struct sst_world *w, double y, double z0, double z1, struct sst_material mat);
/** Soft dark spot on the floor at height y; belongs to no occluder, because a shadow stays where it fell. */
void sst_add_shadow(struct sst_world *w, double x, double y, double z, double rx, double rz);
/** Leaves of half width `half_mm` over a box of design pixels x0..x1, y0..y1 and disparities d0..d1. */
void sst_add_foliage(struct sst_world *w, int count, const double x[2], const double y[2], const double d[2],
                     double half_mm);
/** One branch with twigs, from a to b. */
void sst_add_branch(struct sst_world *w, struct sst_vec3 a, struct sst_vec3 b, double half_mm);

/* Paints; a and b are the two colours of a material. */
sst_paint_fn sst_paint_fbm;   /* clouds from a to b; k: how far they are drawn out along y, 0 as 1 */
sst_paint_fn sst_paint_cloth; /* plaid; k: 0 plaid, 1 stripes along y, 2 denim, 3 corduroy */
sst_paint_fn sst_paint_brick; /* bricks a, mortar b; scale: length of a brick */
sst_paint_fn sst_paint_wood;  /* boards along x; scale: width of a board */
sst_paint_fn sst_paint_slabs; /* square slabs with joints */
sst_paint_fn sst_paint_leaf;
sst_paint_fn sst_paint_face;   /* skin a, hair b, on a head whose w points forward and v down */
sst_paint_fn sst_paint_text;   /* the text in b on a, with a border; k: lines of the same text */
sst_paint_fn sst_paint_facade; /* bricks a with windows, joints and frames b; scale: length of a brick, k: bricks from
                                  window to window */
sst_paint_fn sst_paint_poster; /* a picture of shapes of colours between a and b, the text below */
sst_paint_fn sst_paint_landscape; /* sky a, hills b */
sst_paint_fn sst_paint_van;       /* rear of a white van, a body, b bumper */
sst_paint_fn sst_paint_car;       /* rear of a car */
sst_paint_fn sst_paint_glass;     /* rear window with frame a */
sst_paint_fn sst_paint_fur;       /* hair a to b along y; k: strength of the stripes */
sst_paint_fn sst_paint_camouflage;
sst_paint_fn sst_paint_feather;
sst_paint_fn sst_paint_wheel;    /* tyre, rim and spokes; with sst_mask_wheel */
sst_paint_fn sst_paint_membrane; /* translucent */
sst_paint_fn sst_paint_tissue;   /* nuclei and organelles */
sst_paint_fn sst_paint_shadow;   /* translucent, never more than half opaque */

/* Outlines. */
sst_mask_fn sst_mask_leaf;
sst_mask_fn sst_mask_disc;
sst_mask_fn sst_mask_rounded;   /* outline: radius of the corners, of the half height */
sst_mask_fn sst_mask_trapezoid; /* outline: width of the top edge, of the bottom edge */
sst_mask_fn sst_mask_wheel;     /* outline: 0 open with spokes, else inner radius of a thick tyre round a disc */

struct sst_figure {
    struct sst_vec3 base; /* on the ground between the feet */
    double scale;         /* 1: 1750 mm tall */
    double yaw;           /* rad; 0 faces the cameras, pi/2 walks to the right */
    double stride;        /* rad, swing of the legs; arms swing against it */
    bool seated;
    struct sst_material skin, face, shirt, trousers, shoes;
};

void sst_add_figure(struct sst_world *w, const struct sst_figure *f);

/* Build functions of the scenes. */
typedef void sst_build_fn(struct sst_world *w);
sst_build_fn sst_build_bush, sst_build_pedestrian, sst_build_transportation, sst_build_cell, sst_build_humvee,
    sst_build_cd_cases, sst_build_cat;

/**
 * Build a scene's surfaces at cfg->time_s, without what sst_scene_create() learns by looking at them.
 *
 * @return 0, -EINVAL (unknown name or absurd size, logged), -ENOMEM
 */
SST_MUST_CHECK int sst_world_build(struct sst_world *w, const char *name, const struct sst_scene_config *cfg);
void sst_world_fini(struct sst_world *w);

/* --- the renderer ------------------------------------------------------------------------------------------------ */

/** A picture whose pixels look elsewhere than an ideal camera's: a lens with distortion, a turned camera. */
struct sst_warp {
    int width, height, columns, rows;
    float *x, *y;      /* [height][width]: position in the ideal picture that a pixel's centre looks at */
    float (*tiles)[4]; /* [rows][columns]: least and greatest of x - column, and of y - row, in a tile of pixels */
    float all[4];      /* the same of the whole picture */
};

/** Room for the positions, which the caller fills in. @return 0 or -ENOMEM */
SST_MUST_CHECK int sst_warp_init(struct sst_warp *warp, int width, int height);
void sst_warp_fini(struct sst_warp *warp);
/** To be called once x and y are filled in; they are bounds, no holes are looked for. */
void sst_warp_index(struct sst_warp *warp);

/** From a box in the ideal picture to one that holds all pixels that look into it, as far as there are any. */
void sst_warp_box(const struct sst_warp *warp, double *lo_x, double *hi_x, double *lo_y, double *hi_y);

static inline double sst_warp_x(const struct sst_warp *warp, int x, int y)
{
    return warp->x[(size_t)y * (size_t)warp->width + (size_t)x];
}

static inline double sst_warp_y(const struct sst_warp *warp, int x, int y)
{
    return warp->y[(size_t)y * (size_t)warp->width + (size_t)x];
}

/** One view of a world. Pixel (i, j) of the outputs looks at picture position (i * step_x, j * step_y), or where the
 *  warp says. */
struct sst_raster {
    const struct sst_world *world;
    double focal_px, cx, cy;
    int width, height;     /* of the outputs */
    double step_x, step_y; /* 1: the picture itself; image and warp need 1 */
    double bx, by, eye_z_mm;
    unsigned hidden;
    const struct sst_warp *warp; /* of the outputs' size; or NULL */
    struct sst_image *image;     /* or NULL */
    struct sst_map_f32 *disp;    /* or NULL */
    struct sst_map_u8 *label;    /* or NULL */
    struct sst_map_u8 *owner;    /* hide bits of what is seen; or NULL */
};

/** @return 0 or -ENOMEM. */
SST_MUST_CHECK int sst_raster_run(const struct sst_raster *r);

/* --- many pictures of a world in which little moves -------------------------------------------------------------- */

/** Names the surfaces that differ between two states of a world. @param moving in and out, [count]: set, never cleared
 */
void sst_world_compare(const struct sst_world *a, const struct sst_world *b, bool *moving);

struct sst_layers; /* opaque; one thread at a time */

/**
 * Render all that does not move, once.
 *
 * @param r       its world, which must stay, and its warp and image; the image is used by draw alone
 * @param moving  [count of surfaces]; must stay
 * @param threads  to share the work among; at least 1
 * @return 0 or -ENOMEM
 */
SST_MUST_CHECK int sst_layers_create(struct sst_layers **out, const struct sst_raster *r, const bool *moving,
                                     int threads);
void sst_layers_destroy(struct sst_layers *layers);

/** Draw rows y0 .. y1-1 of the image as they are in another state of the world: the same bytes as by sst_raster_run().
 */
void sst_layers_draw(struct sst_layers *layers, const struct sst_world *world, int y0, int y1);

#endif
