/* pipeline/live/frames/frames_internal.h - private declarations of this folder; code outside of it includes the
 * public headers. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_LIVE_FRAMES_FRAMES_INTERNAL_H
#define SST_PIPELINE_LIVE_FRAMES_FRAMES_INTERNAL_H

#include <stdatomic.h>
#include <stdbool.h>

#include "base/base.h"
#include "pipeline/image/jpeg_means.h"
#include "pipeline/live/frames/frames.h"

/* --- decoder ---
 * reads block means of a camera's frame for change detection, and decodes parts of it. */

/** Means of blocks of samples ("cells"), in 1/8 levels (0 .. 2047). */
struct block_means {
    int planes; /* 1 or 3: luma, then chroma; 0: not read yet */
    struct mean_plane {
        int cols, rows;
        int step_x, step_y; /* px of the frame in a cell */
        int zero;           /* value of black (luma, RGB) or of no colour (chroma) */
        int16_t *mean;      /* [rows * cols] */
    } plane[3];
};

/** Allocate for frames of a size: cells are at least 8x8 px. @return 0, -ENOMEM */
SST_MUST_CHECK int block_means_init(struct block_means *c, int width, int height);
void block_means_fini(struct block_means *c);
/** True if both have the same planes of the same sizes. */
bool block_means_alike(const struct block_means *a, const struct block_means *b);
/** @param to  initialised for the same frame size */
void block_means_copy(struct block_means *to, const struct block_means *from);

struct decoder; /* one thread at a time */

/** @param fourcc  V4L2: MJPG, JPEG, or a format of pipeline/image/raw.h @return 0, -EINVAL (format, size), -ENOMEM */
SST_MUST_CHECK int decoder_create(struct decoder **out, uint32_t fourcc, int width, int height);
void decoder_destroy(struct decoder *d);

/** A camera's bytes; stride 0: rows without padding, or JPEG. */
struct decoder_frame {
    const uint8_t *data;
    size_t bytes, stride;
};

/**
 * Read the block means of a frame.
 *
 * @param block_means  of block_means_init() for this size; partly written on failure
 * @return 0, -ENOTSUP (a kind of JPEG that must be decoded for that), -EBADMSG (damaged, or of another size: see
 *         decoder_fault())
 */
SST_MUST_CHECK int decoder_read_means(struct decoder *d, const struct decoder_frame *frame, struct block_means *means,
                                      struct sst_jpeg_index *index);

/**
 * Decode a part of a frame; the pixels equal a decoding of the whole frame.
 *
 * @param pixels  out, borrowed until the next call: pixel (0, 0) of the frame, 4 bytes each (R, G, B, unused); only the
 *                requested part is set
 * @param stride  out, bytes
 * @return 0, -EBADMSG (damaged, or of another size), -ENOMEM
 */
SST_MUST_CHECK int decoder_decode(struct decoder *d, const struct decoder_frame *frame, struct sst_rect part,
                                  const uint8_t **pixels, size_t *stride);

/** Pixels of a part of a frame, borrowed until the next call for another frame. */
struct decoder_part {
    int box[4];            /* px of the frame: left, top, right, bottom */
    const uint8_t *pixels; /* of (left, top), in the layout of decoder_decode() */
    size_t stride;         /* bytes */
};

/**
 * Decode parts of a JPEG frame with a valid index: as decoder_decode(), without the rest of the frame.
 * @param part  in: boxes that lie apart; out: pixels
 * @return as decoder_decode(), or -ENOTSUP (also: they take more memory than a frame)
 */
SST_MUST_CHECK int decoder_decode_parts(struct decoder *d, const struct decoder_frame *frame,
                                        struct sst_jpeg_index *index, struct decoder_part *part, int parts);

/** Levels that samples of Y16 become. @param level  [65536], borrowed; NULL: their high byte */
void decoder_set_levels(struct decoder *d, const uint8_t *level);

/** Why the last frame was rejected. */
const char *decoder_fault(const struct decoder *d);

/* --- change ---
 * detects tiles whose block means differ from the stored picture's, beyond the camera's
 * noise and changes of light. */

/*
 * Three statistics of the differences e of a tile's cells decide, in each plane: |mean e| (faint change of the whole
 * tile), mean |e| (motion in it), max |e| (something small). A threshold is a constant plus a multiple of the noise:
 * the median over all tiles of the same statistic between consecutive pictures of this camera, whatever its
 * distribution. The gain of the light is the median over the tiles of the brightness ratio and is compensated: a
 * flickering lamp changes no tile. The accumulated change of light is reported separately.
 */
#define SST_DETECTOR_STATS 3

/** Error budget in levels (0..255): the stored picture differs from the camera's, beyond its noise, by less than */
#define SST_DETECTOR_MEAN   0.75 /* in the mean of a tile, */
#define SST_DETECTOR_ABS    0.75 /* in its cells of 8x8 px, averaged over the tile, */
#define SST_DETECTOR_PEAK   5.0  /* in any of its cells, */
#define SST_DETECTOR_LIGHT  2.5  /* in all tiles of a view together, at half of white, */
#define SST_DETECTOR_BUDGET 4.0  /* and in the mean of a tile including light. */

struct change_detector {
    int width, height, cols, rows;       /* px; tiles. Fixed after init */
    struct block_means now;              /* input of detector_judge() */
    struct block_means before, kept;     /* the last picture judged; of each tile, the accepted (stored) picture */
    double *gain_kept;                   /* [tiles] gain when it was accepted */
    uint8_t *unsettled;                  /* [tiles] number of judgements with lower thresholds after a change */
    uint8_t *lasting;                    /* [tiles] number of judgements above these in a row */
    double gain;                         /* current gain of the light, relative */
    double noise[3][SST_DETECTOR_STATS]; /* 1/8 levels */
    int noise_phase;                     /* which of the tiles measure the noise next */
    int judged;                          /* pictures since everything was accepted, at most 2 */
    float *scratch;                      /* [3 SST_DETECTOR_STATS tiles] */
};

/** @return 0, -ENOMEM */
SST_MUST_CHECK int detector_init(struct change_detector *w, int width, int height);
void detector_fini(struct change_detector *w);

struct verdict {
    int changed;  /* tiles */
    bool whole;   /* all tiles: nothing was stored, or the light changed too much */
    double light; /* levels by which a half-bright tile changed since it was accepted */
};

/** Compare `now` with the accepted picture. @param changed  out, [tiles] 0 or 1 */
struct verdict detector_judge(struct change_detector *w, uint8_t *changed);

/** Accept the marked tiles of `now`. */
void detector_accept(struct change_detector *w, const uint8_t *changed);

/** Forget the accepted picture: the next verdict is `whole`. */
void detector_reset(struct change_detector *w);

/* --- burnt.c: text that is written into the frames --- */

struct frames_burnt {
    int cols, rows;      /* raw tiles. Fixed after init */
    uint8_t *often;      /* [tiles] how often it changed in all views at once */
    uint8_t *reached;    /* [tiles] 1: working memory: something else has changed near it */
    unsigned sets, read; /* sets so far; at that time text was last read */
};

/** @return 0, -ENOMEM */
SST_MUST_CHECK int frames_burnt_init(struct frames_burnt *b, int cols, int rows);
void frames_burnt_fini(struct frames_burnt *b); /* all zero is fine */

/** Count a set. @return true: it is time to read text */
bool frames_burnt_read(struct frames_burnt *b);

/** All text is read in this set. */
void frames_burnt_accepted(struct frames_burnt *b);

/** Has nothing changed but text? @param changed  [tiles] */
bool frames_burnt_alone(const struct frames_burnt *b, const uint8_t *changed);

/** Learn the place of text from a set that did not change as a whole. @param changed  [views][tiles] of scanned views
 */
void frames_burnt_learn(struct frames_burnt *b, const uint8_t *const *changed, int views);

/** Unmark text near which nothing else has changed. @param changed  [tiles] of a view @return number unmarked */
int frames_burnt_leave(struct frames_burnt *b, uint8_t *changed);

/* --- shared by frames.c, frames_scan.c and frames_decode.c --- */

#define SST_LIVE_SAMPLE_SETS 32 /* the error of skipped tiles is sampled once in this number of sets */
#define SST_LIVE_KEY_VIEWS   5  /* scanned in every set: nearest to the corners and to the middle */

#define SST_LIVE_BLOCKS 4 /* across a rectified tile and down: only these are resampled where raw tiles changed */

/* Raw tiles that a rectified tile, or a block of it, is computed from: columns [0] .. [2]-1, rows [1] .. [3]-1. */
struct from {
    uint16_t tile[4];
};

struct live_view {
    /* fixed after open */
    bool used;
    bool key;
    struct sst_rectify_map *map; /* NULL: frames are views */
    struct from *from;           /* [rectified tiles] */
    struct from *block;          /* [rectified tiles][SST_LIVE_BLOCKS][SST_LIVE_BLOCKS] */
    /* kept */
    struct change_detector watch;
    struct sst_sampler *sampler; /* the stored raw frame */
    uint8_t *last;               /* [last_room] bytes of the last frame scanned, if they fit */
    size_t last_bytes;           /* 0: none */
    bool made;                   /* the view has a picture */
    bool broken;                 /* the last frame was rejected */
    int64_t seen_ns;             /* of the last good frame */
    /* of this set */
    uint8_t *dirty; /* [raw tiles] to decode */
    struct verdict verdict;
    struct sst_jpeg_index index; /* of the frame; room 0: frames are not JPEG */
    bool looked, refused, decoded;
    char fault[200];
};

/* One view between updates, compared from set to set. */
struct frames_watch {
    struct change_detector detector; /* empty until the first watch */
    uint8_t *dirty;                  /* [raw tiles] */
    int view;
    int64_t t_ns; /* of the last set watched */
};

struct sst_liveframes {
    /* fixed after open */
    const struct sst_live_config *cfg;
    struct sst_lightfield *lf;
    int threads, views, used, raw_cols, raw_rows, cols, rows; /* raw and rectified tiles */
    size_t last_room;
    struct decoder **decoder; /* [threads] */
    struct live_view *view;
    /* of Y16 */
    struct sst_samples stretch; /* white 0: all 16 bits, below 0: not known yet */
    uint8_t *level;             /* [65536] that samples become */
    int followed;               /* sets until it is measured again */
    bool all;                   /* the next update accepts everything */
    int turn, sample;           /* next of the views scanned in turn; sets until the error is sampled */
    int rested;                 /* sets since something changed, at most REST_SETS */
    int64_t t_ns, step_ns;      /* of the last set; mean time between sets */
    /* of this set */
    const struct sst_live_input *in;
    struct sst_liveframes_changes *changes;
    int list[SST_MAX_VIEWS]; /* views of the current step */
    struct frames_watch watch;
    struct frames_burnt burnt;
    SST_ATOMIC(bool) cancelled;
};

static inline struct decoder_frame frame_of(const struct sst_liveframes *f, int k)
{
    return (struct decoder_frame){ f->in->frame[k].data, f->in->frame[k].bytes, f->in->frame[k].stride };
}

static inline int raw_tiles(const struct sst_liveframes *f)
{
    return f->raw_cols * f->raw_rows;
}

static inline bool has_frame(const struct sst_liveframes *f, int k)
{
    return f->view[k].used && f->in->frame[k].data;
}

/** Mark the frame of a view as unusable, with the fault of d. */
void frames_reject(struct live_view *v, const struct decoder *d);

/** Step 1: detect changed tiles of all views. @return 0, -ECANCELED, -ENOMEM */
SST_MUST_CHECK int frames_scan(struct sst_liveframes *f);
/** Step 2: decode the changed tiles. @return as frames_scan() */
SST_MUST_CHECK int frames_decode(struct sst_liveframes *f);
/** Step 3: rectify the tiles that depend on them and fill the maps of changes. @return as frames_scan() */
SST_MUST_CHECK int frames_rectify(struct sst_liveframes *f);

/** Mark the rectified tiles of view k that depend on dirty raw tiles. @param dirty  [raw tiles] @param map  out,
 * [tiles] */
void frames_mark(const struct sst_liveframes *f, int k, const uint8_t *dirty, uint8_t *map);

/** Decode one view with skipped tiles. @return mean |difference| of skipped tiles to the stored picture; NaN: none */
double frames_sample_error(struct sst_liveframes *f);

#endif
