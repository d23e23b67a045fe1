/* pipeline/live/frames/frames_parts.h - what frames.c, frames_look.c and frames_take.c share. Inside pipeline/live only. */
#ifndef SST_PIPELINE_LIVE_FRAMES_FRAMES_PARTS_H
#define SST_PIPELINE_LIVE_FRAMES_FRAMES_PARTS_H

#include <stdatomic.h>

#include "pipeline/live/frames/change.h"
#include "pipeline/live/frames/frames.h"

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
    struct sst_watch watch;
    struct sst_sampler *sampler; /* the raw frame as it is kept */
    uint8_t *last;               /* [last_room] bytes of the frame looked at last, where they fit */
    size_t last_bytes;           /* 0: none */
    bool made;                   /* there is a picture */
    bool broken;                 /* the last frame was refused */
    int64_t seen_ns;             /* of the last good frame */
    /* of this set */
    uint8_t *dirty; /* [raw tiles] to be decoded */
    struct sst_verdict verdict;
    bool looked, refused, decoded;
    char fault[200];
};

struct sst_live_frames {
    /* fixed after open */
    const struct sst_live_config *cfg;
    struct sst_lightfield *lf;
    int threads, views, used, raw_cols, raw_rows, cols, rows; /* raw and rectified tiles */
    size_t last_room;
    struct sst_decoder **decoder; /* [threads] */
    struct live_view *view;
    bool all;         /* everything is to be taken over */
    int turn, sample; /* next of the views that take turns; sets until the error is sampled */
    /* of this set */
    const struct sst_live_input *in;
    struct sst_live_changes *changes;
    int list[SST_MAX_VIEWS]; /* what a step works on */
    SST_ATOMIC(bool) cancelled;
};

static inline struct sst_decoder_frame frame_of(const struct sst_live_frames *f, int k)
{
    const struct sst_decoder_frame frame = { f->in->frame[k].data, f->in->frame[k].bytes, f->in->frame[k].stride };

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
void sst_live_frames_refuse(struct live_view *v, const struct sst_decoder *d);

/** Step 1: verdicts and dirty tiles of all views. @return 0, -ECANCELED, -ENOMEM */
SST_MUST_CHECK int sst_live_frames_look(struct sst_live_frames *f);
/** Step 2: decode the dirty tiles. The same. */
SST_MUST_CHECK int sst_live_frames_decode(struct sst_live_frames *f);
/** Step 3: rectify what depends on them; maps of changes. The same. */
SST_MUST_CHECK int sst_live_frames_rectify(struct sst_live_frames *f);

/** Decode one of the views of which tiles were skipped. @return mean |difference| of those to what is kept; NaN: none
 */
double sst_live_frames_sample(struct sst_live_frames *f);

#endif
