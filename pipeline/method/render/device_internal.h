/* pipeline/method/render/device_internal.h - a light field on a device: views in chunks, frames, and pictures that are
 * made of them there. */
#ifndef SST_PIPELINE_METHOD_RENDER_DEVICE_INTERNAL_H
#define SST_PIPELINE_METHOD_RENDER_DEVICE_INTERNAL_H

#include "pipeline/gpu/blend.h"
#include "pipeline/gpu/clear.h"
#include "pipeline/image/jpeg_planes.h"
#include "pipeline/method/render/clear_internal.h"

#define DEVICE_NO_VIEW (-1)

/** Room for one view. */
struct device_slot {
    int chunk, index; /* index-th view of the chunk */
    int view;         /* DEVICE_NO_VIEW: free */
    int64_t used;     /* turn in which it was used last */
    bool pending;     /* the next dispatch reads it */
    /* of a light field that changes: what the view here is as of */
    uint64_t serial, since;
    double disp_min_px;
    unsigned maps;
    double part_x, part_y; /* of a view made from a frame: its pixels were sampled this far right of and below theirs */
    int confident;         /* likewise: the view whose confidences are here, and one more; 0: none */
};

#define DEVICE_PIXEL_BYTES 7U /* of a pixel of a view: colour and label, disparity, valid; one more with confidence */

struct device_chunk {
    struct sst_gpu_buffer *pixels, *disp, *valid;
    struct sst_gpu_buffer *confidence; /* NULL: not wanted */
};

#define DEVICE_SPANS 8

/** A frame in mapped memory, with what its view needs besides: to be copied from there. */
struct device_frame {
    const struct sst_render_tap *tap; /* NULL: none */
    struct sst_gpu_span *span;
    double part_x, part_y;
    bool loaded, with_maps; /* the frame is in the span; labels and disparities are */
    bool rays;              /* as of struct device_taps */
    bool encoded;           /* the frame is the samples of a JPEG, as of layout */
    struct sst_jpeg_planes layout;
    struct sst_rectify_list list;
};

/** What views are made from frames with; all NULL and 0 until there is one. */
struct device_frames {
    struct sst_gpu_buffer *frame, *samples, *places, *list, *light, *labels, *weights;
    bool decodes;                 /* samples of JPEG files become colours there */
    struct sst_gpu_buffer **kept; /* [views] frames that stay on the device; owned, its elements of gpu */
    size_t frame_bytes, places_bytes, light_bytes, list_bytes; /* room in the buffers */
    struct device_frame ready[DEVICE_SPANS];
    int spans;
};

/** Why rays of a picture are verified on the CPU. */
enum device_unverified {
    DEVICE_UNVERIFIED_NOT = 0,     /* they are verified on the device */
    DEVICE_UNVERIFIED_FRAMES = 1,  /* what the maps explain is tested in frames */
    DEVICE_UNVERIFIED_AGREED = 2,  /* how many rays agree is wanted */
    DEVICE_UNVERIFIED_WEIGHTS = 3, /* weights underflow in pixels that are left to votes */
    DEVICE_UNVERIFIED_REFUSED = 4, /* a shader is refused */
    DEVICE_UNVERIFIED_SMALL = 5,   /* no room for the rays */
    DEVICE_UNVERIFIED_CRAMPED = 6, /* no room for what the maps explain */
};

/** What rays are verified with; all NULL and 0 until there is a picture to verify. */
struct device_verify {
    struct sst_gpu_buffer *params, *cells, *share, *rays, *near, *totals, *views, *disp_px;
    int count, rows;    /* views and rows of the picture that `rays` holds */
    double disp_min_px; /* that disp_px is for; NAN: not uploaded */
    bool small, cramped; /* there is no room for the rays, or for what the maps explain: not tried again */
    bool split;          /* views do not lie in one buffer all together: what the maps explain is found in ... */
    struct device_chunk near_views; /* ... rows of them, in this many pixels */
    size_t near_pixels;
    uint32_t *cell;     /* host memory of `cells`; owned */
    enum device_unverified why; /* of the last picture */
    unsigned logged;            /* bits: reasons that were, live */
};

/** Fallback and bands of clear pictures. */
struct device_clear {
    bool noted;      /* the fallback to the CPU was logged */
    int views, rows; /* since the device was opened: struct clear, `band_rows`, of a picture of this many views; 0: all
                        had memory */
};

struct render_device {
    struct sst_runner *runner; /* owned */
    struct sst_runner_user user;
    const struct sst_lightfield *lf;
    int pitch;    /* pixels of a row of a view on the device */
    bool changes; /* lf does, as `live` has it */
    struct sst_render_live live;
    /* under the lock of runner */
    struct sst_gpu *gpu; /* NULL: it failed, or was not opened again yet */
    int64_t opening; /* that the fields below are noted of */
    uint64_t limit_bytes; /* that its buffers may use */
    unsigned tested, refused; /* bits: steps since the device was opened */
    struct device_clear clear;
    struct sst_render_device_report report;
    /* of gpu */
    struct device_chunk *chunk;
    int chunks;
    struct device_slot *slot;
    int slots;
    bool full; /* no more chunks fit */
    int64_t turn;
    struct sst_gpu_buffer *params, *table, *sums, *out;
    struct device_frames frames;
    struct device_verify verify;
    bool doubts;       /* chunks have confidences */
    int chunk_views;   /* of a chunk at most; 0: any number */
    int rows;          /* of the picture that sums and out hold: all, or whole cells where there is room for one */
    size_t table_rows; /* that table holds */
    /* host memory, reused */
    struct sst_mem_kept packed, words, weights;
};

/* The functions below need the lock, and an open device. Those that return an error return that of the device. */

/** Free what lies on the device. */
void device_drop(struct render_device *d);

/** Pixels of a view's slot. */
size_t device_view_pixels(const struct render_device *d);

/** Let scratch memory and other users make room. @return true if this freed memory */
bool device_make_room(struct render_device *d);

/** More room: a chunk of as many views as fit, or half of them, and so on. @return -ENOMEM: nothing fits */
SST_MUST_CHECK int device_grow(struct render_device *d);

/** The slot of a view, if it is on the device. */
struct device_slot *device_find_slot(struct render_device *d, int view);

/** A slot that may be overwritten: a free one, else the one that was used least recently. NULL: the next dispatch reads
 *  all of them */
struct device_slot *device_free_slot(struct render_device *d);

/** Have a tap's view in a slot as it is now. */
SST_MUST_CHECK int device_place_view(struct render_device *d, struct device_slot *s, const struct sst_render_tap *t,
                                     bool sampled, int threads);

/** Taps of a picture, and whether their rays are sampled from frames, each between pixels. */
struct device_taps {
    const struct sst_render_tap *tap[SST_MAX_VIEWS];
    int count, threads;
    bool sampled;
    bool rays; /* each ray has a place of its own: frames are needed, no views */
};

/** Buffers for views that are made from frames, if any is; before there are views. @return -ENOTSUP: the shader is
 * refused */
SST_MUST_CHECK int device_make_frames(struct render_device *d, const struct device_taps *taps);
void device_drop_frames(struct render_device *d);
/** Free frames that stay, before others are uploaded. */
void device_drop_kept(struct render_device *d);

/** Have the frame of the tap `from` in mapped memory, if it is needed, and those of the next ones with it, on all
 * threads.
 *  @return -EBADMSG (a frame cannot be decoded: not logged), -ENOMEM, or an error of the device */
SST_MUST_CHECK int device_ready_frames(struct render_device *d, const struct device_taps *taps, int from);

/** The frame of a tap in mapped memory, or NULL. */
struct device_frame *device_find_frame(struct render_device *d, const struct sst_render_tap *t);

/** Copy a frame and its tables to the device, to sample rays from it. @param source  out: where the frame is */
SST_MUST_CHECK int device_upload_rays(struct render_device *d, const struct device_frame *f,
                                      const struct sst_rectify_tables *t, struct sst_gpu_buffer **source);

/** Make the pixels of a tap's view in a slot from its frame, if they are not there. */
SST_MUST_CHECK int device_place_frame(struct render_device *d, struct device_slot *s, const struct sst_render_tap *t,
                                      bool sampled);

/** Buffers for this many pixels. @param confident  with confidences @return 0, or an error, and there are none */
SST_MUST_CHECK int device_create_chunk(struct render_device *d, struct device_chunk *c, size_t pixels, bool confident);
void device_destroy_chunk(struct render_device *d, struct device_chunk *c);

/** Rows of a view to upload: top .. end-1, with its disparities and valid pixels. */
struct device_rows {
    const struct sst_view *v;
    int top, end;
    bool colours; /* of its picture; false: that is a raw frame */
    bool labels;
};

/** Upload rows of a view, of which the first one begins at pixel `at` of the chunk. */
SST_MUST_CHECK int device_upload_rows(struct render_device *d, const struct device_chunk *c, size_t at,
                                      const struct device_rows *rows, int threads);

/** Views whose rays the next dispatch of `send` reads. */
struct device_batch {
    const struct sst_render_plan *p;
    const uint8_t *cells; /* of the picture that are wanted; NULL: all */
    int (*send)(struct render_device *d, struct device_batch *b, bool last);
    struct sst_gpu_verify push; /* of which `blend` has a part of its own */
    int chunk;                  /* that the views lie in, or the last ones did */
    bool begun;                 /* a dispatch of these rows was sent before */
    bool verify;                /* rays are verified, on the device */
    struct device_taps taps;
    struct sst_gpu_blend_view view[SST_MAX_VIEWS];
};

/** Blend a picture, and verify as p->verify says: p->words and p->weights are set. */
void device_picture(struct sst_run *r, struct render_picture *p);

/** Render a picture. p->verify: rays were verified there; else d->verify.why has the reason, if any were to be. */
SST_MUST_CHECK int device_render_picture(struct render_device *d, struct render_picture *p);

/** Test a step at its first picture since the device was opened, after dropping views that leave too little memory.
 * @return 0, -ENOTSUP (refused), or an error of the device */
SST_MUST_CHECK int device_prepare(struct render_device *d, enum render_step step);

/** A device of a light field, without buffers. @return 0, -ENOMEM */
SST_MUST_CHECK int device_init(struct render_device *d, const struct sst_lightfield *lf,
                               const struct sst_render_live *live);
/** The memory of the host. */
void device_fini(struct render_device *d);

/** Put a view on the device, where it is not there yet, and its rays into the batch, which is sent if it has no room.
 */
SST_MUST_CHECK int device_add_tap(struct render_device *d, struct device_batch *b, int k);

/** The batch was sent: begin the next one. */
void device_batch_sent(struct render_device *d, struct device_batch *b);

/** True if the rays of the picture can be verified; else d->verify.why is set. */
bool device_can_verify(struct render_device *d, const struct sst_render_plan *p);

/** Buffers and tables to verify the picture, before there are views. @return -ENOTSUP: a shader is refused */
SST_MUST_CHECK int device_make_verify(struct render_device *d, const struct device_batch *b);
void device_drop_verify(struct render_device *d);

/** Verify the rays of a band that was blended. @return -EAGAIN: a pixel left to votes has no colour; -EXDEV: the views
 *  lie in several buffers, and the picture has to be begun again; -EOVERFLOW: there is no room for what the maps
 * explain */
SST_MUST_CHECK int device_verify_band(struct render_device *d, struct device_batch *b);

/** @param rows  of pixels, by groups of 4 */
SST_MUST_CHECK int device_dispatch_verify(struct render_device *d, enum sst_gpu_shader shader,
                                          const struct sst_gpu_verify *push, struct sst_gpu_buffer *const *buffer,
                                          int buffers, int rows);

/** Pixel (0, 0) of the view in a slot. */
uint32_t device_slot_first(const struct render_device *d, const struct device_slot *s);

/** The k-th view of a picture as shaders have it. @param first  its pixel (0, 0) */
struct sst_gpu_blend_view device_describe_tap(const struct render_device *d, const struct device_batch *b, int k,
                                              uint32_t first);

/** Buffers for what the maps explain. @return -EOVERFLOW: there is no room */
SST_MUST_CHECK int device_make_explained(struct render_device *d, const struct device_batch *b);

/** Close the cells of the rows b->push.from .. b->push.to - 1 of which the maps explain most rays. @return as
 *  device_verify_band() */
SST_MUST_CHECK int device_screen(struct render_device *d, struct device_batch *b);

/** Have there what rays of the rows b->push.from .. b->push.to - 1 and those beside them are compared with; of fewer
 *  rows if there is no more room, and b->push.to is lowered. @return -EOVERFLOW: there is no room for one */
SST_MUST_CHECK int device_place_explained(struct render_device *d, struct device_batch *b);

/** Sum up their unexplained rays. @param rows  with those beside them */
SST_MUST_CHECK int device_find_unexplained(struct render_device *d, const struct device_batch *b, int rows);

/* --- sample.c: random pictures of a small light field, for sst_step_check() --- */

void *render_picture_sample(uint32_t seed);
void *render_verify_sample(uint32_t seed);
void *render_frames_sample(uint32_t seed);
void *render_sampled_sample(uint32_t seed);
void *render_jpeg_sample(uint32_t seed);
void render_sample_free(void *job);

/* --- device_clear.c, device_rays.c, device_holes.c: steps on a device --------------------------------------------- */

/** Scratch memory of the runner. */
enum clear_scratch {
    CLEAR_SCRATCH_VIEWS,
    CLEAR_SCRATCH_COLOUR,
    CLEAR_SCRATCH_DISP,
    CLEAR_SCRATCH_VALID,
    CLEAR_SCRATCH_MASKS,
    CLEAR_SCRATCH_LANDED,
    CLEAR_SCRATCH_STATE,
    CLEAR_SCRATCH_SEEN,
    CLEAR_SCRATCH_PICTURE,
    CLEAR_SCRATCH_LEVELS
};

/** A picture, or a band of its rows, on a device. */
struct clear_band {
    struct clear *c;
    struct render_device *d;
    struct sst_gpu_clear push;
    struct sst_gpu_clear_view view[SST_GPU_CLEAR_VIEWS];
    int least[SST_GPU_CLEAR_VIEWS], most[SST_GPU_CLEAR_VIEWS]; /* rows that rays of a view move */
    struct device_taps taps;
    struct sst_gpu_range colour, disp, valid, masks, landed, state, seen, picture, levels;
};

/** Dispatch a shader over the pixels of a band. @param ranges  by binding */
#define CLEAR_DISPATCH(r, b, shader, constants, rows, layers, ...)                                                     \
    sst_run_dispatch(r, shader, constants,                                                                             \
                     (const uint32_t[]){ (uint32_t)((b)->push.width + SST_GPU_CLEAR_GROUP_WIDTH - 1) /                 \
                                             SST_GPU_CLEAR_GROUP_WIDTH,                                                \
                                         (uint32_t)((rows) + SST_GPU_CLEAR_GROUP_HEIGHT - 1) /                         \
                                             SST_GPU_CLEAR_GROUP_HEIGHT,                                               \
                                         (uint32_t)(layers) },                                                         \
                     (const struct sst_gpu_range[]){ __VA_ARGS__ },                                                    \
                     sizeof((const struct sst_gpu_range[]){ __VA_ARGS__ }) / sizeof(struct sst_gpu_range))

/** Replace the landed rays of a band with their colours, sampled from frames. */
void clear_sample_rays(struct sst_run *r, const struct clear_band *b);

/** Fill the holes of a whole picture. @param picture  words as of enum sst_gpu_hole_buffer @param levels  of
 * clear_fill_bytes() bytes */
void clear_fill_on_device(struct sst_run *r, const struct clear *c, struct sst_gpu_range picture,
                          struct sst_gpu_range levels);

/** Work of the steps of clear pictures. */
void clear_on_device(struct sst_run *r, void *job, int item);
void clear_holes_on_device(struct sst_run *r, void *job, int item);

/** Fetch colours and weights of rows top .. top+rows-1. @param picture  words of these rows */
void clear_unpack(struct sst_run *r, const struct clear *c, struct sst_gpu_range picture, int top, int rows);

#endif
