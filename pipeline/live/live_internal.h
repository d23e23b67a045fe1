/* pipeline/live/live_internal.h - the state that pipeline/live and pipeline/live/picture share. Pictures depend only on
 * the light field and on the changes recorded by live_ingest(), not on how they were computed. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_LIVE_LIVE_INTERNAL_H
#define SST_PIPELINE_LIVE_LIVE_INTERNAL_H

#include "pipeline/live/hidden/hidden.h"
#include "pipeline/live/posed/posed.h"
#include "pipeline/live/scene/scene.h"
#include "pipeline/method/render/focus.h"
#include "pipeline/method/render/plan.h"

/** The automatic cut: it stays while its foreground does. */
struct live_cut {
    double cut_px;    /* NaN: unknown */
    double gap_px;    /* by the gap alone */
    double end_px;    /* farthest surfaces of the foreground */
    double front;     /* fraction of the rays in front of the gap, most ever */
    int64_t since_ns; /* another one has been found since then; 0: none */
    double guard_px;  /* before tracks that move behind the foreground; NaN: the gap is */
    int64_t guarded_ns;
    struct sst_live_track track[SST_LIVE_TRACKS]; /* of the last set */
    int tracks;
};

struct sst_live {
    /* fixed after open */
    struct sst_live_config cfg;
    char *model; /* copy of cfg.model */
    struct sst_liveframes *frames;
    struct sst_liveposed *posed; /* NULL: a lattice; else there are neither scene nor renderer */
    struct sst_livescene *scene;
    struct sst_renderer *renderer;
    struct live_watch *watch;  /* NULL: not wanted */
    SST_ATOMIC(bool) canceled; /* any thread */
    /* the caller's thread */
    struct sst_lightfield lf;
    struct sst_liveframes_changes changes;
    bool ready;
    double confirmed;               /* fraction of the disparities that another key view confirms; 1: unknown */
    bool low_confidence;            /* the maps have low confidence: rays are verified if the settings ask for it */
    bool late;                      /* disparities are from an earlier set than the pictures */
    bool left;                      /* sst_live_follow() has something to do, ... */
    int64_t t_ns;                   /* ... of this set */
    bool lost;                      /* changes got lost by an error: the next update computes everything */
    uint64_t serial;                /* of the last change ingested; 0: none */
    uint64_t *stamp[SST_MAX_VIEWS]; /* [tiles] serial of the tile's last change; NULL: absent view */
    uint64_t present_serial;        /* of the last change of the set of present views */
    bool present[SST_MAX_VIEWS];    /* at present_serial */
    uint64_t counted;               /* serial at which histograms and focus votes were counted */
    int sampled, sample[SST_RENDER_SAMPLED]; /* views that were counted; the first is the lead view */
    double min_px, max_px;                   /* range of the disparities in the scene; NaN: unknown */
    int64_t range_ns;                        /* when disparities last reached that far */
    struct sst_render_focus focus;
    struct live_cut cut;
    float zone_label[SST_LIVE_ZONES + 1][256]; /* of the report, as of `counted` */
    uint32_t *tile_zones;                      /* [tiles] bit i: zone i counts this tile */
};

/* --- init.c --- */

/** Set up all but frames and scene: geometry, renderer, counters. *live is all zero. @return as sst_live_open() */
SST_MUST_CHECK int live_init(struct sst_live *live, const struct sst_live_config *cfg);
void live_fini(struct sst_live *live);

/** Render pictures on a device from now on, as struct sst_live_config has it. @return 0, -ENOMEM (logged) */
SST_MUST_CHECK int live_use_device(struct sst_live *live, const char *name, uint64_t memory_bytes);

/* --- summary.c: facts about the scene for pictures and report --- */

/**
 * Record changes of pictures, disparities, labels and of the set of present views.
 * @param changes  NULL: none
 * @return 0, -ENOMEM (logged)
 */
SST_MUST_CHECK int live_ingest(struct sst_live *live, const struct sst_liveframes_changes *changes);

/** Recount histograms, zones and focus votes after changes, and step the focus. @return 0, -ENOMEM (logged) */
SST_MUST_CHECK int live_summarize(struct sst_live *live, int64_t t_ns);

/* --- zones.c --- */

/** Take the zones of the configuration. @return 0, -EINVAL (logged; nothing changed) */
SST_MUST_CHECK int live_zones_set(struct sst_live *live, const struct sst_live_zone *zone, int zones);

/** The view that zones refer to: the reference, or the present one that stands in for it. */
int live_zone_view(const struct sst_live *live);

/** Fraction of tiles that changed in every zone. @param changed  out, [SST_LIVE_ZONES + 1] */
void live_zones_changed(const struct sst_live *live, const struct sst_liveframes_changes *changes, double *changed);

/** Count the labels of a view in every zone. */
void live_zones_count(struct sst_live *live, const struct sst_view *view);

/* --- watch.c: things behind the foreground --- */

/** @return 0, -ENOMEM (logged) */
SST_MUST_CHECK int live_watch_open(struct sst_live *live);
void live_watch_close(struct sst_live *live);

/** Follow a set, after its changes and the cut are known. @return 0, -ENOMEM */
SST_MUST_CHECK int live_watch_update(struct sst_live *live, int64_t t_ns);

/** Tracks in the scene and behind the foreground, as of the last set. @return number */
int live_watch_tracks(const struct sst_live *live, struct sst_live_track track[SST_LIVE_TRACKS]);

/* --- identities.c: one identity for detections of one object by several searches --- */

enum live_part_kind {
    LIVE_PART_OPEN = 0,   /* a track of the scene */
    LIVE_PART_HIDDEN = 1, /* a thing behind the foreground */
};

/** A part of an identity, by its id or key. */
struct live_part {
    enum live_part_kind kind;
    uint32_t key, id; /* id: of the identity */
};

struct live_identity {
    struct sst_live_track track, seen; /* as reported; as it was seen, at ... */
    int64_t seen_ns;
    double width, height; /* px: of the largest part seen lately */
    double sure_px;       /* disparity when it was seen in the open, at ... */
    int64_t sure_ns;      /* ... 0: never */
    uint32_t beside;      /* another one that is at the same place; 0: none */
    double beside_x;      /* px: how far it was from that in the beginning, at ... */
    int64_t beside_ns;
    bool has[2], updated; /* in this set: parts, described */
};

#define LIVE_IDENTITIES SST_LIVE_TRACKS
#define LIVE_PARTS      (SST_LIVE_TRACKS + SST_HIDDEN_THINGS)

/** All zero: none. */
struct live_identities {
    struct live_identity who[LIVE_IDENTITIES];
    struct live_part part[LIVE_PARTS];
    int count, parts;
    uint32_t ids; /* their number, ever */
    int64_t t_ns;
};

/** Objects of a set. */
struct live_seen {
    const struct sst_live_track *open; /* [n] tracks of the scene */
    int n;
    const struct sst_hidden_thing *thing; /* [things] behind the foreground; only reported ones begin an identity */
    int things;
    int width, height; /* of the picture, px */
    int64_t t_ns;
};

/** Follow a set. */
void live_identities_update(struct live_identities *w, const struct live_seen *set);

/** As of the last set. @return number */
int live_identities_tracks(const struct live_identities *w, struct sst_live_track track[SST_LIVE_TRACKS]);

/* --- live.c --- */

/** A track that is not seen is reported where it was seen last: its predicted place is for finding it again alone. */
void live_track_hold(struct sst_live_track *t);

/* --- extent.c --- */

/** Refine a track behind leaves by its pixels in the reference view: disparity, and a box from head to foot. */
void live_track_grow(const struct sst_live *live, struct sst_live_track *t);

/* --- cut.c --- */

void live_cut_init(struct live_cut *c);

/** Find the gap in the renderer's new counts. @return 0, -ENOMEM (logged) */
SST_MUST_CHECK int live_cut_follow(struct sst_live *live, int64_t t_ns);

/** Keep the cut in front of the tracks of the set that move behind the foreground. @param track  in, [n] */
void live_cut_guard(struct sst_live *live, const struct sst_live_track *track, int n, int64_t t_ns);

/** Would the cut, as it is, remove one of these tracks, which moves behind the foreground? @param track  [n] */
bool live_cut_removes(const struct sst_live *live, const struct sst_live_track *track, int n);

/* --- pick.c --- */

/** The surface at pixel (x, y), inside the picture, as this plan rendered it from the current light field. */
struct sst_livepicture_pick pick_surface(const struct sst_live *live, const struct sst_render_plan *plan, int x, int y);

#endif
