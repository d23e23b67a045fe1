/* pipeline/live/live_state.h - inside pipeline/live: the object that live.c, state.c, watch.c, focus.c, picture.c,
 * pick.c and overlay.c share. What viewers see hangs on the light field and on what is told to have changed in it
 * (live_ingest()), not on how either came about. */
#ifndef SST_PIPELINE_LIVE_LIVE_STATE_H
#define SST_PIPELINE_LIVE_LIVE_STATE_H

#include "pipeline/live/scene/scene.h"
#include "pipeline/method/render/plan.h"

#define SST_LIVE_SAMPLED 5 /* views that histograms are counted from at most: the reference and the corners */

/** Where to focus: what lies behind the nearest surfaces, remembered over half a minute. */
struct live_focus {
    double min_px;                   /* of bin 0; a bin is SST_BLEND_COLUMNS' 1/4 px */
    float vote[SST_BLEND_COLUMNS];   /* of the last look */
    float memory[SST_BLEND_COLUMNS]; /* decaying sum of votes */
    uint16_t *front, *behind;        /* [cells] of the view looked through: stored disparity; what it hides, + 1 */
    int cells;
    int64_t t_ns;    /* of the last step; 0: none */
    double focus_px; /* NaN: not known */
};

struct sst_live {
    /* fixed after open */
    struct sst_live_config cfg;
    char *model; /* cfg's, kept */
    struct sst_live_frames *frames;
    struct sst_live_scene *scene;
    struct sst_renderer *renderer;
    SST_ATOMIC(bool) canceled; /* any thread */
    /* the caller's thread */
    struct sst_lightfield lf;
    struct sst_live_changes changes;
    bool ready;
    bool poor;                             /* maps are: rays are verified where that is asked for */
    bool lost;                             /* changes were, by an error: the next update is to compute everything */
    uint64_t serial;                       /* of the last change that was taken in; 0: none */
    uint64_t *stamp[SST_MAX_VIEWS];        /* [tiles] serial of the tile's last change; NULL: absent view */
    uint64_t present_serial;               /* of the last change of which views there are */
    bool present[SST_MAX_VIEWS];           /* as of then */
    uint64_t counted;                      /* serial that the renderer's counts and the focus' votes are of */
    int sampled, sample[SST_LIVE_SAMPLED]; /* views they are from; the first is the view looked through */
    double min_px, max_px;                 /* disparities that are there; NaN: not known */
    int64_t range_ns;                      /* when they were last seen to reach so far */
    struct live_focus focus;
    float zone_label[SST_LIVE_ZONES + 1][256]; /* of the report, as of `counted` */
};

/* --- state.c --- */

/** All but frames and scene: geometry, renderer, counters. *live all zero. @return as sst_live_open() */
SST_MUST_CHECK int live_init(struct sst_live *live, const struct sst_live_config *cfg);
void live_fini(struct sst_live *live);

/* --- watch.c --- */

/**
 * Take in what has changed in pictures, disparities, labels, and in which views are there.
 * @param changes  NULL: nothing
 * @return 0, -ENOMEM (logged)
 */
SST_MUST_CHECK int live_ingest(struct sst_live *live, const struct sst_live_changes *changes);

/** Count and look anew where something has changed since, and step the focus. @return 0, -ENOMEM (logged) */
SST_MUST_CHECK int live_summarize(struct sst_live *live, int64_t t_ns);

/** Share of its tiles that changed, of every zone. @param changed  out, [SST_LIVE_ZONES + 1] */
void live_zones_changed(const struct sst_live *live, const struct sst_live_changes *changes, double *changed);

/** The view whose maps stand for what is looked at: the reference, or the nearest to it that is there; -1: none. */
int live_lead_view(const struct sst_live *live);

/* --- pick.c --- */

/** What is under pixel (x, y), inside the picture, of what this plan has rendered of the light field as it is now. */
struct sst_live_pick pick_surface(const struct sst_live *live, const struct sst_plan *plan, int x, int y);

/* --- focus.c --- */

void live_focus_init(struct live_focus *f); /* all zero but for NaN */
void live_focus_fini(struct live_focus *f);

/**
 * Look at the scene: votes for the disparities of what the nearest surfaces hide.
 * @param view  in, [views] the view looked through first; with maps
 * @return 0, -ENOMEM (not logged; the votes stay)
 */
SST_MUST_CHECK int live_focus_vote(struct live_focus *f, const struct sst_lightfield *lf, const int *view,
                                       int views);

/** Let the votes count for the time since the last step. */
void live_focus_step(struct live_focus *f, int64_t t_ns);

#endif
