/* pipeline/live/picture/picture_internal.h - the clear picture of a view with its memory; removed objects; the plane
 * sweep behind a click. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_LIVE_PICTURE_PICTURE_INTERNAL_H
#define SST_PIPELINE_LIVE_PICTURE_PICTURE_INTERNAL_H

#include "pipeline/live/live_internal.h"

/* --- picture.c ---------------------------------------------------------------------------------------------------- */

/* Label ranges change with every pixel; everything is rendered again when the weights of this fraction of rays are off
 * by this much. */
#define PICTURE_NOTICEABLE       0.25
#define PICTURE_NOTICEABLE_SHARE 0.01

/** Resolve defaults, and clamp the focus to where there is something to render. */
void picture_resolve(struct sst_render_config *cfg, const struct sst_live *live);
bool picture_same_settings(const struct sst_render_config *a, const struct sst_render_config *b);

/** Mark the cells of a plan's picture with a ray that meets a tile which changed after a serial number.
 *  @param cells  in, out: [rows][cols] of SST_RENDER_CELL_WIDTH x SST_RENDER_CELL_HEIGHT pixels */
void picture_mark_changes(uint8_t *cells, const struct sst_live *live, const struct sst_render_plan *plan,
                          uint64_t serial);

#define PICTURE_SEEN_WEIGHT 64 /* from which a pixel is seen, as in pipeline/method/render/clear.c */

/* --- behind.c: colours on which rays agree where the maps show nothing ----------------------------------------------
 */

#define PICTURE_PLANES         6
#define PICTURE_BEHIND_COLOURS 512 /* eight levels of red, green and blue each */

struct picture_memory;

struct picture_cell {
    uint16_t holes; /* pixels */
    uint8_t plane;
    uint8_t stale; /* its rays have changed since it was rendered: 1, and the sets since then, up to a limit */
    uint8_t calm;  /* renderings in a row without news, up to a limit */
    float score;   /* mean agreement of its pixels on that plane, 0..255 */
};

/** A see-through picture of cells with holes, each on its best plane; only while the maps have low confidence. */
struct picture_behind {
    uint8_t least[PICTURE_BEHIND_COLOURS]; /* agreement from which a colour is seen */
    int planned;
    struct sst_render_plan plan[PICTURE_PLANES];
    double plane_px[PICTURE_PLANES];
    double focus_px, cut_px, disp_min_px; /* that the plans are made for */
    uint64_t counted, present_serial;
    int round, turns;         /* sets so far; in which all stale cells are rendered */
    int64_t t_ns, step_ns;    /* of the last set; mean time between sets */
    bool late;                /* the maps are of an earlier set, ... */
    struct sst_map_u8 seen;   /* ... with these weights before rays agreed */
    bool swaying;             /* the rays of most cells with holes have changed */
    uint64_t serial;          /* of the light field when stale cells were marked */
    struct sst_image image;   /* empty until the first picture */
    struct sst_map_u8 agreed; /* as of struct sst_render_plan; 0 in cells that are not shown */
    struct sst_image trial;   /* image of cells on another plane */
    struct sst_map_u8 trial_agreed;
    int cols, rows;
    struct picture_cell *cell; /* [rows][cols] */
    int moving;                /* cells of which the picture has changed in the last set */
    uint8_t *wanted;           /* behind cell: to render, ... */
    uint8_t *changed;          /* ... and with rays that changed */
};

void picture_behind_fini(struct picture_behind *b);

/** Which of the colours a pixel has. */
static inline int picture_behind_colour(int red, int green, int blue)
{
    return red >> 5 << 6 | green >> 5 << 3 | blue >> 5;
}

/**
 * Render the cells with holes from rays that agree.
 * @param image, weight  in, of the clear picture
 * @return true: image and agreed are valid where the weight is below PICTURE_SEEN_WEIGHT; false: nothing to do, or
 * failed (logged)
 */
bool picture_behind_render(struct picture_behind *b, const struct sst_live *live, const struct sst_image *image,
                           const struct sst_map_u8 *weight, double cut_px);
/** How many times as seldom as others a cell is rendered, since nothing changes behind leaves that move: 1 or more. */
int picture_behind_slowness(const struct picture_behind *b, int at);
/** After the merge: note the calm cells, and try some on other planes, for the next picture. */
void picture_behind_explore(struct picture_behind *b, const struct picture_memory *m);

/* --- memory.c: surfaces that the clear picture showed a moment ago ------------------------------------------------ */

/** Values of the validity plane (design.md, 5.6). */
enum picture_kind { PICTURE_UNKNOWN = 0, PICTURE_FILLED = 64, PICTURE_REMEMBERED = 128, PICTURE_SEEN = 255 };

/** Memory of one pixel: the surface last seen. */
struct picture_pixel {
    uint8_t rgb[3];
    uint8_t support;   /* as of struct sst_render_merge, of several sets */
    uint16_t disp;     /* stored disparity; SST_DISP_NONE: nothing is remembered */
    uint16_t doubt_ms; /* time in which it was not seen while views changed there */
    uint32_t seen_ms;  /* since the memory's start: last seen, ... */
    uint32_t since_ms; /* ... and this surface first */
};

/** Pixels of a cell that are seen now: numbers of pixels that confirm their memory, have changed it, and contradict it
 * with few rays; all but the last, with sums of their stored disparities and of the ages of their surfaces, ms; came:
 * changed to a nearer surface, with the sum of their stored disparities. */
struct picture_votes {
    uint16_t same, changed, weak, seen, came;
    uint32_t disp, age_ms, came_disp;
};

#define PICTURE_VOTE_LEVELS 6 /* cells of 4, 8 ... 128 px */

struct picture_memory {
    int width, height;
    bool started;
    int64_t start_ns, last_ns;
    struct picture_pixel *pixel; /* [height][width] */
    struct picture_votes *votes, *level[PICTURE_VOTE_LEVELS];
    int cols[PICTURE_VOTE_LEVELS], rows[PICTURE_VOTE_LEVELS];
};

/** A picture to merge. */
struct picture_merge {
    const struct sst_lightfield *lf;
    int64_t t_ns;
    int threads;
    struct sst_image *image;     /* in, out */
    struct sst_map_u8 *weight;   /* in, out; as of struct sst_render_merge */
    struct sst_map_u16 *surface; /* in, out; as of struct sst_render_merge */
    struct sst_map_u8 *support;
    struct sst_map_u8 *kind;             /* out, enum picture_kind */
    const struct picture_behind *behind; /* NULL: none */
    /* removal */
    int cut_q6, remove_label;         /* stored disparity; 0: none */
    const struct sst_view *lead;      /* at the viewpoint, or NULL */
    const struct sst_map_u8 *removed; /* pixels of the lead view, or NULL */
    /* changes: tiles of some views with a later serial number */
    int views;
    const int *view;
    uint64_t *const *stamp;
    uint64_t serial;
    int tile, tile_cols;
};

SST_MUST_CHECK int picture_memory_init(struct picture_memory *m, int width, int height); /* -ENOMEM */
void picture_memory_fini(struct picture_memory *m);
void picture_memory_forget(struct picture_memory *m);
/** @param from  of the same size */
void picture_memory_copy(struct picture_memory *m, const struct picture_memory *from);

/** Update the memory by pixels that are seen, and fill the others from it. @return 0, -ENOMEM */
SST_MUST_CHECK int picture_memory_merge(struct picture_memory *m, const struct picture_merge *in);

/** Seconds since a remembered pixel was last seen. */
double picture_memory_age_s(const struct picture_memory *m, int x, int y);

/* --- arrivals.c: surfaces that have come in front of the ones before -----------------------------------------------
 */

struct picture_arrivals {
    uint8_t *marked; /* [blocks] part of a region */
    int *stack;      /* [blocks] */
    int64_t rest_ns; /* there are none for a while from this time on; 0: there may be */
    int count;
    struct sst_livepicture_arrival at[SST_LIVEPICTURE_ARRIVALS];
};

SST_MUST_CHECK int picture_arrivals_init(struct picture_arrivals *a, const struct picture_memory *m); /* -ENOMEM */
void picture_arrivals_fini(struct picture_arrivals *a);

/** From now on the picture shows other surfaces of the same scene, as with another cut: there are no arrivals for a
 * second. */
void picture_arrivals_rest(struct picture_arrivals *a, int64_t t_ns);

/** Find the arrivals of the set that the memory was last merged with. */
void picture_arrivals_find(struct picture_arrivals *a, const struct picture_memory *m, const struct sst_lightfield *lf);

/* --- objects.c: objects that a user has removed ------------------------------------------------------------------- */

struct picture_object {
    struct sst_map_u8 region; /* of the reference view, not 0: object */
    double near_px, far_px;   /* its disparities */
    int area, x0, y0, x1, y1;
    int64_t seen_ns; /* when it was last found */
    /* when it was removed */
    int first_area;
    double first_px; /* width of its disparities */
    bool ground;     /* it is ground itself */
};

struct picture_objects {
    int width, height, count;
    struct picture_object object[SST_LIVEPICTURE_OBJECTS];
    struct sst_map_u8 mask[SST_MAX_VIEWS]; /* of all objects together; empty until the first one */
    struct sst_map_u8 next;                /* spare region */
    int32_t *stack;                        /* [width * height] pixels of the region that grows */
};

void picture_objects_init(struct picture_objects *o, int width, int height);
void picture_objects_fini(struct picture_objects *o);

/** Find the objects again after a change, and mark them in all views. @return 0, -ENOMEM */
SST_MUST_CHECK int picture_objects_follow(struct picture_objects *o, const struct sst_lightfield *lf, int64_t t_ns,
                                          int threads);

/** A click on a pixel of the light field. */
struct picture_click {
    const struct sst_lightfield *lf;
    int x, y;
    int64_t t_ns;
    int threads;
};

/** As sst_livepicture_toggle(). */
SST_MUST_CHECK int picture_objects_toggle(struct picture_objects *o, const struct picture_click *at, bool *removed);

/** Add the surface at a pixel to the object that was removed last, from which an occluder divides it; nothing where it
 *  cannot be found or no object more fits. @return 0, -ENOMEM */
SST_MUST_CHECK int picture_objects_extend(struct picture_objects *o, const struct picture_click *at);
void picture_objects_restore(struct picture_objects *o);

/* --- clear.c ------------------------------------------------------------------------------------------------------ */

struct picture_clear; /* of one picture */

SST_MUST_CHECK int picture_clear_create(struct picture_clear **out, struct sst_live *live); /* -ENOMEM, logged */
void picture_clear_destroy(struct picture_clear *c);
/** Take over the memory of another clear picture, for the next one that is rendered. */
void picture_clear_remember(struct picture_clear *c, const struct picture_clear *from);

/** As sst_livepicture_render(). @param whole  the image shows something else @param image  out, of the light field's
 * size */
SST_MUST_CHECK int picture_clear_render(struct picture_clear *c, const struct sst_render_config *cfg, bool whole,
                                        struct sst_image *image, int64_t *rendered_px);
/** Draw outlines and tint of the last picture. @param image  in, out, a copy of it */
SST_MUST_CHECK int picture_clear_decorate(struct picture_clear *c, enum sst_livepicture_outline outline, bool tint,
                                          struct sst_image *image);
void picture_clear_state(const struct picture_clear *c, struct sst_livepicture_clear *out);
SST_MUST_CHECK int picture_clear_pick(const struct picture_clear *c, int x, int y, struct sst_livepicture_pick *out);
SST_MUST_CHECK int picture_clear_toggle(struct picture_clear *c, int x, int y, bool *removed);
void picture_clear_restore(struct picture_clear *c);

/* --- sweep.c: plane sweep of a small patch: at which disparities do the views agree? ------------------------------
 *
 * At the disparity of a surface all rays that reach it have the same colour, for each pixel of the patch, however many
 * others end in front of it; at other disparities the rays of a pixel show different places. As for verified rays
 * (pipeline/method/render/verify.h), the measure is the fraction of votes for the most frequent colour; here the maps
 * are not used, and rare colours have more weight than common ones. */
#define SST_SWEEP_SIDE  8 /* samples of a patch along each side ... */
#define SST_SWEEP_STEP  2 /* px between samples: 15x15 px around the requested pixel; */
#define SST_SWEEP_WIDE  6 /* px if that gives no label: 43x43 px */
#define SST_SWEEP_PATCH (SST_SWEEP_SIDE * SST_SWEEP_SIDE)

/** State of a sweep; 84 KiB, on the stack. */
struct patch_sweep {
    const struct sst_render_plan *plan; /* plan with the rectified views to sweep */
    const uint8_t *rarity;              /* [SST_AGREE_BINS] of the views' colours */
    int x, y, step;                     /* centre of the patch and distance of its samples, px of the picture */
    /* of the last disparity */
    uint8_t colour[SST_MAX_VIEWS][3][SST_SWEEP_PATCH], vote[SST_MAX_VIEWS][SST_SWEEP_PATCH];
    uint8_t mode[3][SST_SWEEP_PATCH]; /* the colour with most votes */
    uint16_t near[SST_SWEEP_PATCH];
};

/** The disparity in a range at which the rays agree most. */
struct sweep_peak {
    double disp_px; /* NaN: too few rays at any disparity */
    double agree;   /* at disp_px */
};

void sweep_init(struct patch_sweep *s, const struct sst_render_plan *plan, const uint8_t *rarity, int x, int y);

/**
 * Agreement of the rays: the fraction of votes for the most frequent colours, less its value by chance (every ray
 * agrees with itself): 0 (all disagree) to 1. NaN with fewer than 2 rays per pixel. Takes about 20 us for 36 views.
 */
double sweep_agree(struct patch_sweep *s, double disp_px);

/**
 * Find the best agreement from min_px to max_px, in steps that move the patch by 1.5 px in the outermost view (longer
 * steps if there were more than 256). If disparities more than 3 px apart agree equally, as without texture, returns
 * the one nearest to preferred_px.
 */
struct sweep_peak sweep_peak(struct patch_sweep *s, double min_px, double max_px, double preferred_px);

/** The most frequent label of the rays that agree at this disparity and also end there by the maps, within `reach_px`,
 *  in the patch or in one three times as large; 0: none. The sweep holds another patch afterwards. */
int sweep_label(struct patch_sweep *s, double disp_px, double reach_px);

static inline bool same(double a, double b)
{
    return a <= b && a >= b;
}

/** The label with the most votes; 0 only if no other has any. */
int most_voted(const double weight[256]);

#endif
