/* pipeline/live/frames/frames_internal.h - what the files of this folder share; code outside of it includes the public
 * headers. */
#ifndef SST_PIPELINE_LIVE_FRAMES_FRAMES_INTERNAL_H
#define SST_PIPELINE_LIVE_FRAMES_FRAMES_INTERNAL_H

#include <stdatomic.h>
#include <stdbool.h>

#include "base/base.h"
#include "pipeline/live/frames/frames.h"

/* --- decoder ---
 * what live views need of a camera's frame: a small picture to see change in, and parts of
 * the frame decoded. Inside pipeline/live only. */

/** Means over blocks of samples, in 1/8 levels (0 .. 2047). */
struct block_means {
    int planes; /* 1 or 3: brightness, then two of colour; 0: not read yet */
    struct {
        int cols, rows;
        int step_x, step_y; /* px of the frame in a cell */
        int zero;           /* value of no light (brightness, a colour's own) or of no colour */
        int16_t *mean;      /* [rows * cols] */
    } plane[3];
};

/** Room for frames of a size: block_means of 8x8 px at the smallest. @return 0, -ENOMEM */
SST_MUST_CHECK int block_means_init(struct block_means *c, int width, int height);
void block_means_fini(struct block_means *c);
/** The same planes of the same sizes? */
bool block_means_alike(const struct block_means *a, const struct block_means *b);
/** @param to  of the same size of frame */
void block_means_copy(struct block_means *to, const struct block_means *from);

struct decoder; /* one thread at a time */

/** @param fourcc  V4L2: MJPG, JPEG, or what pipeline/image/raw.h reads @return 0, -EINVAL (format, size), -ENOMEM */
SST_MUST_CHECK int decoder_create(struct decoder **out, uint32_t fourcc, int width, int height);
void decoder_destroy(struct decoder *d);

/** Is this format JPEG? */
bool decoder_is_jpeg(uint32_t fourcc);

/** A camera's bytes; stride 0: rows without padding, or JPEG. */
struct decoder_frame {
    const uint8_t *data;
    size_t bytes, stride;
};

/**
 * The small picture of a frame.
 *
 * @param block_means  of block_means_init() for this size; partly written when it fails
 * @return 0, -ENOTSUP (a kind of JPEG that is only read by decoding), -EBADMSG (damaged, or of another size: see
 *         decoder_fault())
 */
SST_MUST_CHECK int decoder_read_means(struct decoder *d, const struct decoder_frame *frame, struct block_means *means);

/**
 * Decode columns x0 .. x1-1 of rows y0 .. y1-1: the pixels that decoding the whole frame gives.
 *
 * @param pixels  out, borrowed until the next call: the frame's pixel (0, 0), R, G, B and a byte of no meaning each;
 * only the part is set
 * @param stride  out, bytes
 * @return 0, -EBADMSG (damaged, or of another size), -ENOMEM
 */
SST_MUST_CHECK int decoder_decode(struct decoder *d, const struct decoder_frame *frame, int x0, int y0, int x1, int y1,
                                  const uint8_t **pixels, size_t *stride);

/** What was wrong with the last frame that was refused. */
const char *decoder_fault(const struct decoder *d);

/* --- change ---
 * where a camera's small pictures differ from those of what is kept, beyond its own noise and
 * the light. Inside pipeline/live only. */

/*
 * Each tile is judged by three numbers of the differences e of its block_means, in each plane: |mean e| (something faint that
 * fills the tile), mean |e| (something that moves in it), max |e| (something small). A threshold is what is always let
 * pass, plus a multiple of the median over all tiles of the same number for two pictures in a row of this camera: the
 * noise, whatever its distribution. The light is followed by the median over the tiles of the ratio of brightness, and
 * taken out of the differences: a lamp that flickers changes no tile. What it adds up to is told apart.
 */
#define SST_DETECTOR_STATS 3

/** In levels (0..255). What is kept differs from what is seen by less, up to the camera's noise: */
#define SST_DETECTOR_MEAN   0.75 /* in a tile's mean ... */
#define SST_DETECTOR_ABS    0.75 /* ... in its block_means of 8x8 px, on average over the tile ... */
#define SST_DETECTOR_PEAK   5.0  /* ... and in any of them; */
#define SST_DETECTOR_LIGHT  2.5  /* and with all tiles of a view in common, at half of white */
#define SST_DETECTOR_BUDGET 4.0  /* in a tile's mean, light and all */

struct change_detector {
    int width, height, cols, rows;    /* px; tiles. Fixed after init */
    struct block_means now;                 /* to be read into before judging */
    struct block_means before, kept;        /* the picture judged last, and of each tile that which was taken over */
    double *gain_kept;                /* [tiles] light when it was taken over */
    uint8_t *unsettled;               /* [tiles] judgements for which thresholds stay lower after a change */
    double gain;                      /* light now, against an arbitrary one */
    double noise[3][SST_DETECTOR_STATS]; /* 1/8 levels */
    int noise_phase;                  /* which of the tiles tell it next */
    int judged;                       /* pictures since everything was taken over, at most 2 */
    float *scratch;                   /* [3 SST_DETECTOR_STATS tiles] */
};

/** @return 0, -ENOMEM */
SST_MUST_CHECK int detector_init(struct change_detector *w, int width, int height);
void detector_fini(struct change_detector *w);

struct verdict {
    int changed;  /* tiles */
    bool whole;   /* they are all: nothing was kept, or the light is another */
    double light; /* levels that a half-bright tile has changed by since it was taken over */
};

/** Compare `now` with what is kept. @param changed  out, [tiles] 0 or 1 */
struct verdict detector_judge(struct change_detector *w, uint8_t *changed);

/** The marked tiles are taken over as `now` has them. */
void detector_accept(struct change_detector *w, const uint8_t *changed);

/** Forget what is kept: the next judgement is `whole`. */
void detector_reset(struct change_detector *w);

/* --- frames_parts: what frames.c, frames_look.c and frames_take.c share. Inside pipeline/live only. --- */

#define SST_LIVE_SAMPLE_SETS 32 /* the error of what was skipped is looked at once in so many sets */
#define SST_LIVE_KEY_VIEWS   5  /* looked at in every set: nearest to the corners and to the middle */

/* Raw tiles that a rectified one comes from: columns [0] .. [2]-1, rows [1] .. [3]-1. */
struct from {
    uint16_t tile[4];
};

struct live_view {
    /* fixed after open */
    bool used;
    bool key;
    struct sst_rectify_map *map; /* NULL: frames are views */
    struct from *from;           /* [rectified tiles] */
    /* kept */
    struct change_detector watch;
    struct sst_sampler *sampler; /* the raw frame as it is kept */
    uint8_t *last;               /* [last_room] bytes of the frame looked at last, where they fit */
    size_t last_bytes;           /* 0: none */
    bool made;                   /* there is a picture */
    bool broken;                 /* the last frame was refused */
    int64_t seen_ns;             /* of the last good frame */
    /* of this set */
    uint8_t *dirty; /* [raw tiles] to be decoded */
    struct verdict verdict;
    bool looked, refused, decoded;
    char fault[200];
};

struct sst_live_frames {
    /* fixed after open */
    const struct sst_live_config *cfg;
    struct sst_lightfield *lf;
    int threads, views, used, raw_cols, raw_rows, cols, rows; /* raw and rectified tiles */
    size_t last_room;
    struct decoder **decoder; /* [threads] */
    struct live_view *view;
    bool all;         /* everything is to be taken over */
    int turn, sample; /* next of the views that take turns; sets until the error is sampled */
    /* of this set */
    const struct sst_live_input *in;
    struct sst_live_changes *changes;
    int list[SST_MAX_VIEWS]; /* what a step works on */
    SST_ATOMIC(bool) cancelled;
};

static inline struct decoder_frame frame_of(const struct sst_live_frames *f, int k)
{
    const struct decoder_frame frame = { f->in->frame[k].data, f->in->frame[k].bytes, f->in->frame[k].stride };

    return frame;
}

static inline int raw_tiles(const struct sst_live_frames *f)
{
    return f->raw_cols * f->raw_rows;
}

static inline bool has_frame(const struct sst_live_frames *f, int k)
{
    return f->view[k].used && f->in->frame[k].data;
}

/** The frame of view k is no use: d says why. */
void frames_reject(struct live_view *v, const struct decoder *d);

/** Step 1: verdicts and dirty tiles of all views. @return 0, -ECANCELED, -ENOMEM */
SST_MUST_CHECK int frames_scan(struct sst_live_frames *f);
/** Step 2: decode the dirty tiles. The same. */
SST_MUST_CHECK int frames_decode(struct sst_live_frames *f);
/** Step 3: rectify what depends on them; maps of changes. The same. */
SST_MUST_CHECK int frames_rectify(struct sst_live_frames *f);

/** Decode one of the views of which tiles were skipped. @return mean |difference| of those to what is kept; NaN: none
 */
double frames_sample_error(struct sst_live_frames *f);

#endif
