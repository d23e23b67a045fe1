/* pipeline/live/scene/scene_state.h - what a live scene keeps, and the steps of an update; for the files scene*.c. */
#ifndef SST_PIPELINE_LIVE_SCENE_SCENE_STATE_H
#define SST_PIPELINE_LIVE_SCENE_SCENE_STATE_H

#include <errno.h>

#include "pipeline/live/scene/scene_parts.h"

/* A tile that did not change, beside one that did, and changed in the set before: the maps that it got then were partly
 * of what was in that other tile. */
#define SST_SCENE_AGAIN 2

/** A piece of matching, or the network. */
struct sst_scene_job {
    int key; /* -1: the network */
    struct sst_scene_rect rect;
};

struct sst_live_scene {
    /* fixed after open */
    const struct sst_live_config *cfg;
    struct sst_lightfield *lf;
    int threads, views, width, height;    /* half size */
    int cols, rows, tiles;                /* of a view */
    uint8_t *all;                         /* [tiles] of 1 */
    struct sst_scene_composer *composers; /* [threads] */
    struct sst_segmenter **segmenters;    /* [threads], the first one from the start; NULL: no model */
    struct sst_scene_background *background;
    int64_t *hist; /* [SST_DISP_BINS] */
    struct sst_scene_candidates *candidates;
    struct sst_scene_things *things; /* of the first key; NULL: no model */
    /* as long as the same views are present */
    bool planned[SST_MAX_VIEWS]; /* present then */
    int keys;
    struct sst_scene_key key[SST_SCENE_KEYS];
    bool key_whole[SST_SCENE_KEYS]; /* newly a key: all of it is to be matched */
    struct sst_descriptor *desc;    /* [views]; empty where no key needs it */
    bool described[SST_MAX_VIEWS];
    /* as long as the range stays */
    struct sst_scene_matcher *matchers; /* [threads] */
    bool ranged;
    int64_t next_range_ns;
    bool told_alone, told_range;
    int look_in, look_every, rested; /* sets: until the range is estimated again, the pause, without a change */
    double nearer_px;                /* near end by the last estimate */
    double unsure_share;             /* of what changed in the reference in the last set; 0: too little did */
    /* from set to set */
    bool ready, whole_next;
    int runs;                           /* of the network since the labels were fitted */
    uint8_t *dirty[SST_MAX_VIEWS];      /* [tiles] to be computed in this set: 1, or SST_SCENE_AGAIN */
    uint8_t *before[SST_MAX_VIEWS];     /* [tiles] 1: changed in the last set that changed any; none after a whole one */
    int64_t *changed_ns[SST_MAX_VIEWS]; /* [tiles] when its picture last did */
    bool *settled[SST_MAX_VIEWS];       /* [tiles] maps are the background's */
    int64_t copied_ns, next_look_ns;    /* of the background */
    double error_labels;
    double sure; /* of the report */
    /* of this set */
    struct sst_scene_job *jobs; /* [1 + SST_SCENE_KEYS * SST_SCENE_RECTS] */
    bool whole;
    struct sst_map_u8 labels; /* the network's, of the reference key; empty: it did not run */
    int64_t label_ns;
    SST_ATOMIC(int) label_runs;
    /* atomic */
    SST_ATOMIC(bool) cancel;
};

static inline int sst_scene_cancelled(const struct sst_live_scene *s)
{
    return s->cancel ? -ECANCELED : 0;
}

/* --- scene_plan.c ------------------------------------------------------------------------------------------------- */

/** Follow the views that come and go: keys, and maps of new views. Marks tiles of new views dirty. @return 0, -ENOMEM
 */
SST_MUST_CHECK int sst_scene_plan(struct sst_live_scene *s);

/** Find the range of disparities unless it is known; s->ranged tells whether it is. @return 0, -ENOMEM */
SST_MUST_CHECK int sst_scene_find_range(struct sst_live_scene *s);

/**
 * In a set that changed something, or is still: has something come nearer than the range that was estimated?
 * @return 0, -ENOMEM; what was known stays
 */
SST_MUST_CHECK int sst_scene_follow_range(struct sst_live_scene *s, bool still);

/** After matching: how much of what changed no other key sees. */
void sst_scene_note_unsure(struct sst_live_scene *s);

/** Search this range from now on: matchers, and the light field's range and zero. @return 0, -ENOMEM */
SST_MUST_CHECK int sst_scene_set_range(struct sst_live_scene *s, double min_px, double max_px);
void sst_scene_free_matchers(struct sst_live_scene *s);

/* --- scene_work.c ------------------------------------------------------------------------------------------------- */

/** Disparities and labels of all dirty tiles. @return 0, -ECANCELED, -ENOMEM, -EBADMSG (network) */
SST_MUST_CHECK int sst_scene_compute(struct sst_live_scene *s, struct sst_live_report *report);

/** The segmenter of a worker. */
SST_MUST_CHECK int sst_scene_open_segmenter(struct sst_live_scene *s, int worker);

/* --- scene_settle.c ----------------------------------------------------------------------------------------------- */

/** Start the background where that is worth it. */
void sst_scene_look_for_rest(struct sst_live_scene *s);

#endif
