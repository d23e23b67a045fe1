/* pipeline/method/render/device_internal.h - a light field on a device: views in chunks, frames, pictures that are made
 * there. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_METHOD_RENDER_DEVICE_INTERNAL_H
#define SST_PIPELINE_METHOD_RENDER_DEVICE_INTERNAL_H

#include "pipeline/gpu/blend.h"
#include "pipeline/gpu/clear.h"
#include "pipeline/gpu/verify.h"
#include "pipeline/image/jpeg_planes.h"
#include "pipeline/method/render/clear_internal.h"
#include "pipeline/method/render/device.h"

#define DEVICE_NO_VIEW (-1)

/** Room for one view. */
struct device_slot {
    int chunk, index; /* index-th view of the chunk */
    int view;         /* DEVICE_NO_VIEW: free */
    int64_t used;     /* turn in which it was used last */
    /* of a light field that changes: the state that was uploaded */
    uint64_t serial, since;
    double disp_min_px;
    unsigned maps;
    double part_x, part_y; /* of a view made from a frame: its pixels were sampled this far right of and below theirs */
};

#define DEVICE_PIXEL_BYTES 7U /* of a pixel of a view: colour and label, disparity, valid; one more with confidence */

enum device_plane { DEVICE_PIXELS, DEVICE_DISP, DEVICE_VALID, DEVICE_CONFIDENCE, DEVICE_PLANES };

/** Buffers of pixels, rows `pitch` pixels apart. */
struct device_chunk {
    struct sst_gpu_range plane[DEVICE_PLANES]; /* the last one without a buffer: not wanted */
};

/** Rows top .. end - 1 of a view in a chunk. */
struct device_place {
    const struct device_chunk *chunk;
    uint32_t first; /* pixel (0, 0) of the view, modulo 2^32 */
    int top, end;
};

/** Views of a picture, and whether their rays are sampled from frames, each between pixels. */
struct device_taps {
    const struct sst_render_tap *tap[SST_MAX_VIEWS];
    bool wanted[SST_MAX_VIEWS]; /* false: the picture, or the band in work, has no rays of the view */
    struct device_place place[SST_MAX_VIEWS];
    int count, threads;
    int slots; /* the first ones, which hold the views; 0: bands have rows of the views, or frames are enough */
    bool sampled;
    bool rays; /* each ray has a place of its own: frames are needed, no views */
};

#define DEVICE_SPANS 8

/** A frame in mapped memory, with the places of its pixels: to be copied from there. */
struct device_frame {
    const struct sst_render_tap *tap; /* NULL: none */
    struct sst_gpu_span *span;
    double part_x, part_y;
    bool loaded;  /* the frame is in the span */
    bool rays;    /* as of struct device_taps */
    bool encoded; /* the frame is the samples of a JPEG, as of layout */
    struct sst_jpeg_planes layout;
    struct sst_rectify_list list;
};

/** Frames that views are made from. */
struct device_frames {
    struct sst_gpu_range frame, samples, places, list, light, weights; /* scratch memory of the item in work */
    bool decodes;                                                      /* samples of JPEG files become colours there */
    struct sst_gpu_buffer **kept; /* [views] frames that stay on the device; owned, its elements of gpu */
    size_t frame_bytes, places_bytes, span_bytes; /* the parts of a span; room in a span */
    struct device_frame ready[DEVICE_SPANS];
    int spans;
    float *lit; /* [SST_GPU_RECTIFY_LIGHT_FLOATS] owned, NULL until needed */
};

/** Steps of pictures, in the order in which pictures need them: a device that is opened again is tested up to the last
 * step that was needed. */
enum render_step {
    RENDER_STEP_PICTURE = 0,       /* rays are blended */
    RENDER_STEP_VERIFY = 1,        /* and verified */
    RENDER_STEP_CLEAR = 2,         /* clear pictures of rectified views */
    RENDER_STEP_HOLES = 3,         /* holes of a clear picture with colours and weights */
    RENDER_STEP_CLEAR_SAMPLED = 4, /* clear pictures: rays are sampled from frames */
    RENDER_STEP_FRAMES = 5,        /* views are made from frames */
    RENDER_STEP_SAMPLED = 6,       /* rays are sampled from frames */
    RENDER_STEP_JPEG = 7,          /* frames are made from the samples of JPEG files */
};

/** Why rays of a picture are verified on the CPU. */
enum device_unverified {
    DEVICE_UNVERIFIED_NOT = 0,     /* they are verified on the device */
    DEVICE_UNVERIFIED_FRAMES = 1,  /* explanations by the maps are tested in frames */
    DEVICE_UNVERIFIED_AGREED = 2,  /* how many rays agree is wanted */
    DEVICE_UNVERIFIED_WEIGHTS = 3, /* weights underflow in pixels that are left to votes */
    DEVICE_UNVERIFIED_REFUSED = 4, /* a shader is refused */
    DEVICE_UNVERIFIED_SMALL = 5,   /* no room for the rays */
    DEVICE_UNVERIFIED_CRAMPED = 6, /* no room for explanations by the maps */
};

/** Bands that pictures of a step had memory for. */
struct device_bands {
    int views; /* of a picture of this many; 0: all had memory for the whole picture */
    struct render_bands bands;
};

struct render_runner {
    struct sst_runner *runner;
    struct sst_runner_user user;
    const struct sst_lightfield *lf;
    int pitch;    /* pixels of a row of a view on the device */
    bool changes; /* lf does, as `live` has it */
    struct sst_render_live live;
    /* under the lock of runner */
    struct sst_gpu *gpu;      /* NULL: it failed, or was not opened again yet */
    struct sst_run *run;      /* the item in work */
    int64_t opening;          /* that the fields below are noted of */
    uint64_t limit_bytes;     /* that its buffers may use */
    unsigned tested, refused; /* bits: steps since the device was opened */
    struct device_bands bands[SST_RENDER_STEPS];
    bool small, cramped;        /* there is no room for rays to verify, or for explanations: not tried again */
    enum device_unverified why; /* of the last picture */
    unsigned logged;            /* bits: reasons that were, live */
    bool clear_logged;          /* the fallback of clear pictures to the CPU was, live */
    struct sst_render_device_report report;
    /* of gpu */
    struct device_chunk *chunk;
    int chunks;
    struct device_slot *slot; /* chunk by chunk */
    int slots;
    bool full; /* no more chunks fit */
    bool held; /* the item in work reads the views: they are not freed to make room */
    int64_t turn;
    struct device_frames frames;
    bool doubts;     /* chunks have confidences */
    int chunk_views; /* of a chunk at most; 0: any number */
    /* host memory, reused */
    struct sst_mem_kept words, weights;
};

/** Scratch memory of the runner. */
enum device_scratch {
    /* frames */
    DEVICE_SCRATCH_FRAME,
    DEVICE_SCRATCH_SAMPLES,
    DEVICE_SCRATCH_PLACES,
    DEVICE_SCRATCH_LIST,
    DEVICE_SCRATCH_LIGHT,
    DEVICE_SCRATCH_WEIGHTS,
    DEVICE_SCRATCH_BAND,
    /* pictures of rays, and their verification */
    DEVICE_SCRATCH_PARAMS = DEVICE_SCRATCH_BAND + DEVICE_PLANES,
    DEVICE_SCRATCH_TABLE,
    DEVICE_SCRATCH_SUMS,
    DEVICE_SCRATCH_OUT,
    DEVICE_SCRATCH_CELLS,
    DEVICE_SCRATCH_SHARE,
    DEVICE_SCRATCH_RAYS,
    DEVICE_SCRATCH_NEAR,
    DEVICE_SCRATCH_TOTALS,
    DEVICE_SCRATCH_AROUND,
    DEVICE_SCRATCH_DISP_PX,
    /* clear pictures */
    DEVICE_SCRATCH_VIEWS,
    DEVICE_SCRATCH_MASKS,
    DEVICE_SCRATCH_LANDED,
    DEVICE_SCRATCH_STATE,
    DEVICE_SCRATCH_SEEN,
    DEVICE_SCRATCH_PICTURE,
    DEVICE_SCRATCH_LEVELS
};

/* The functions below need the lock, and an open device. */

/* --- device.c ----------------------------------------------------------------------------------------------------- */

/** Use a runner for pictures of lf. @param runner  lives longer @param steps  by enum render_step @param live  NULL: lf
 * does not change while it lives @return as sst_renderer_use_device(), or with `live` as sst_renderer_use_live_device()
 */
SST_MUST_CHECK int device_create(struct render_runner **out, const struct sst_lightfield *lf, struct sst_runner *runner,
                                 const struct sst_step_shaders *steps, const struct sst_render_live *live);

/** A device of a light field, without buffers. @return 0, -ENOMEM */
SST_MUST_CHECK int device_init(struct render_runner *d, const struct sst_lightfield *lf,
                               const struct sst_render_live *live);
/** The memory of the host. */
void device_fini(struct render_runner *d);

/** Free all buffers. */
void device_drop(struct render_runner *d);

/** Begin an item of a step; the functions of the files below note their errors with sst_run_fail(). */
void device_begin(struct render_runner *d, struct sst_run *r);

/* --- device_views.c ----------------------------------------------------------------------------------------------- */

void device_drop_views(struct render_runner *d);

/** Pixels of a view's slot. */
size_t device_view_pixels(const struct render_runner *d);

/** Have the views that are wanted in slots as they are now, after all other memory was reserved: they may use all the
 * rest. Sets taps->place. @param one  into one chunk @return false: they do not fit together */
bool device_gather(struct render_runner *d, struct device_taps *taps, bool one);

/** True if a slot has the pixels of a tap's view, as they are sampled from its frame. */
bool device_holds(const struct render_runner *d, const struct device_taps *taps, int k);

/** Parts of the pixels of a view. */
enum device_part { DEVICE_COLOURS = 1, DEVICE_LABELS = 2 };

/** Upload rows of a view, with its disparities, valid pixels and confidences. @param parts  enum device_part */
void device_upload_rows(struct render_runner *d, const struct device_place *to, const struct sst_view *v,
                        unsigned parts, int threads);

/* Where the views do not fit together: rows of each, one view behind the other. */

/** Place rows taps->place[k].top .. end - 1; of views that are made from frames these become whole groups. @return
 * their pixels */
size_t device_place_rows(const struct render_runner *d, struct device_taps *taps, const struct device_chunk *c);

/** Memory for rows, by their pixels. */
void device_reserve_rows(struct render_runner *d, struct device_chunk *c, size_t pixels, bool confident);

/** Upload the rows that were placed. @param parts  enum device_part */
void device_upload_placed(struct render_runner *d, const struct device_taps *taps, unsigned parts);

/* --- device_frames.c ---------------------------------------------------------------------------------------------- */

void device_drop_frames(struct render_runner *d);
/** Free frames that stay, before views are uploaded. */
void device_drop_kept(struct render_runner *d);

/** Memory for views that are made from frames, if any is. */
void device_reserve_frames(struct render_runner *d, const struct device_taps *taps);

/** Have the frame of the tap k in mapped memory, if it is needed, and frames of the next taps with it, on all
 * threads. -EBADMSG: a frame cannot be decoded (not logged). */
void device_ready_frames(struct render_runner *d, const struct device_taps *taps, int k);

/** The frame of a tap in mapped memory, or NULL. */
struct device_frame *device_find_frame(struct render_runner *d, const struct sst_render_tap *t);

/** Constants for a frame. */
struct sst_gpu_rectify device_describe_frame(const struct render_runner *d, const struct sst_rectify_tables *t);

/** Copy a frame and its tables to the device, to sample rays from it. @return where the frame is */
struct sst_gpu_range device_upload_rays(struct render_runner *d, const struct device_frame *f,
                                        const struct sst_rectify_tables *t);

/** Make rows of a view from its frame, which is in mapped memory. Rows are a multiple of SST_GPU_RECTIFY_GROUP_HEIGHT,
 * or end with the view. @param mapped  disparities and labels are there */
void device_make_rows(struct render_runner *d, const struct device_taps *taps, int k, const struct device_place *to,
                      bool mapped);

/* --- device_picture.c --------------------------------------------------------------------------------------------- */

/** A picture in work. */
struct device_batch {
    struct render_runner *d;
    const struct sst_render_plan *p;
    const uint8_t *cells;       /* that are wanted; NULL: all */
    bool verify;                /* rays are verified, on the device */
    struct sst_gpu_verify push; /* of which `blend` has a part of its own */
    uint32_t flags;             /* of the plan: enum sst_gpu_blend_flag */
    struct device_taps taps;
    struct device_chunk band; /* rows of all views; views in slots: unused */
    int vote_rows;            /* that are verified at once, rows beside them included */
    struct sst_gpu_range params, table, sums, out, cells_at, share, rays, near, totals, around, disp_px;
};

/** Blend a picture, and verify as p->verify says: p->words and p->weights are set. */
void device_picture(struct sst_run *r, struct render_picture *p);

/** The k-th view of a picture as shaders have it. */
struct sst_gpu_blend_view device_describe_tap(const struct device_batch *b, int k);

/** Set b->push.blend to the next views that lie in one chunk; the first call is device_begin_runs().
 * @return the chunk; NULL: there are no more */
const struct device_chunk *device_next_run(struct device_batch *b);
void device_begin_runs(struct device_batch *b);

/** Dispatch a shader over rows of pixels. @param height  of a group @param ranges  by binding */
#define DEVICE_DISPATCH(b, shader, constants, rows, height, ...)                                                       \
    SST_RUN_GROUPS((b)->d->run, shader, constants,                                                                     \
                   ((b)->push.blend.width + SST_GPU_BLEND_GROUP_WIDTH - 1) / SST_GPU_BLEND_GROUP_WIDTH,                \
                   ((rows) + (height)-1) / (height), 1, __VA_ARGS__)

/* --- device_band.c: rows of the views --- */

/** Memory for the rows of the views that any `rows` rows between top and end need. */
void device_reserve_band(struct device_batch *b, int top, int end, int rows);

/** Upload the rows of the views that the rows top .. end - 1 need. */
void device_place_band(struct device_batch *b, int top, int end);

/* --- device_verify.c --- */

/** True if the rays of the picture can be verified; else d->why is set. */
bool device_can_verify(struct render_runner *d, const struct sst_render_plan *p);

/** Memory to verify a picture in bands of `rows` rows. */
void device_reserve_verify(struct device_batch *b, int rows);

/** Mark the cells of the picture that are wanted. */
void device_upload_cells(struct device_batch *b);

/** Verify the rays of a band that was blended. -EAGAIN: a pixel left to votes has no colour. */
void device_verify_band(struct device_batch *b);

/* --- device_sample.c, device_clear_sample.c: random pictures of a small light field, for sst_step_check() --- */

/** A random light field, and a device for it. */
struct sample_field {
    struct sst_lightfield lf;
    struct sst_renderer *renderer; /* NULL at first: it is created for the whole light field */
    struct render_runner device;
};

/** 3x3 views without pictures. @return 0 or an error; sample_field_fini() follows in either case */
SST_MUST_CHECK int sample_field_init(struct sample_field *f, int width, int height);
void sample_field_fini(struct sample_field *f);

/** A picture, a disparity map and, by chance of their number, labels and valid pixels of a view. @return 0 or an error
 */
SST_MUST_CHECK int sample_view_init(struct sst_view *v, const struct sst_lightfield *lf, int k);

/** A way to render, 0..8: each uses other parts of the shader, and of the CPU after it. */
struct sst_render_config sample_config(int i);

void *render_picture_sample(uint32_t seed);
void *render_verify_sample(uint32_t seed);
void *render_frames_sample(uint32_t seed);
void *render_sampled_sample(uint32_t seed);
void *render_jpeg_sample(uint32_t seed);
void render_sample_free(void *job);
void *clear_sample(uint32_t seed);
void *clear_sample_frames(uint32_t seed);
void *clear_sample_holes(uint32_t seed);
void clear_sample_free(void *job);

/* --- device_clear.c, device_rays.c, device_holes.c: steps on a device --------------------------------------------- */

/** A picture, or a band of its rows, on a device. */
struct clear_band {
    struct clear *c;
    struct render_runner *d;
    struct sst_gpu_clear push;
    struct sst_gpu_clear_view view[SST_GPU_CLEAR_VIEWS];
    int least[SST_GPU_CLEAR_VIEWS], most[SST_GPU_CLEAR_VIEWS]; /* rows that rays of a view move */
    struct device_taps taps;
    struct device_chunk views; /* all of them, or rows */
    struct sst_gpu_range masks, landed, state, seen, picture, levels;
};

/** Dispatch a shader over the pixels of a band. @param ranges  by binding */
#define CLEAR_DISPATCH(r, b, shader, constants, rows, layers, ...)                                                     \
    SST_RUN_GROUPS(r, shader, constants,                                                                               \
                   ((b)->push.width + SST_GPU_CLEAR_GROUP_WIDTH - 1) / SST_GPU_CLEAR_GROUP_WIDTH,                      \
                   ((rows) + SST_GPU_CLEAR_GROUP_HEIGHT - 1) / SST_GPU_CLEAR_GROUP_HEIGHT, layers, __VA_ARGS__)

/** Replace the landed rays of a band with their colours, sampled from frames. */
void clear_sample_rays(struct sst_run *r, const struct clear_band *b);

/** Fill the holes of a whole picture. @param picture  words as in kernels/hole.glsl: R, G, B, weight @param levels  of
 * clear_fill_bytes() bytes */
void clear_fill_on_device(struct sst_run *r, const struct clear *c, struct sst_gpu_range picture,
                          struct sst_gpu_range levels);

/** Work of the steps of clear pictures. */
void clear_on_device(struct sst_run *r, void *job, int item);
void clear_holes_on_device(struct sst_run *r, void *job, int item);

/** Fetch colours and weights of rows top .. top+rows-1. @param picture  words of these rows */
void clear_unpack(struct sst_run *r, const struct clear *c, struct sst_gpu_range picture, int top, int rows);

#endif
