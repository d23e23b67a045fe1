/* pipeline/method/disparity/disparity_internal.h - one run over the views of a light field: disparity.c orders the
 * steps, views.c is what is done to each view. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_METHOD_DISPARITY_DISPARITY_INTERNAL_H
#define SST_PIPELINE_METHOD_DISPARITY_DISPARITY_INTERNAL_H

#include <math.h>

#include "base/thread.h"
#include "pipeline/method/disparity/visible.h"
#include "pipeline/method/network/network.h"
#include "pipeline/step/run.h"

/* State of one run; descriptors exist only while a grid row or its neighbours are matched. */
struct disparity_run {
    struct sst_lightfield *lf;
    const struct sst_disparity_config *cfg;
    struct sst_disparity_config census; /* what cfg points to with census_suffices */
    struct sst_network **nets;          /* [networks], one a worker; NULL without features */
    int networks;
    bool fill;
    bool *carried;                 /* [views] not matched, or after the key views; NULL: all are matched */
    struct sst_map_u8 *settled;    /* [views] of maps of a sweep in scene space: 255 where no other disparity is tested;
                                      NULL: there was none */
    bool foliage;                  /* the sweep had its own first round */
    bool *matched;                 /* [views] by the first pass */
    bool others;                   /* the views that were to be carried are matched after all, with the others */
    int rounds;                    /* of the second pass */
    bool subpixel;                 /* refine between pixels */
    int scale, width, height;      /* of the images that are matched */
    int disp_min, range;           /* in pixels of those images; range + 1 whole disparities are searched */
    int divisor;                   /* steps per pixel */
    unsigned *need;                /* [views] phases of the census that matching needs next; 0: not the view */
    struct sst_descriptor *desc;   /* [views] */
    struct sst_map_u16 *disp;      /* [views], at matching size */
    struct sst_map_u8 *confidence; /* [views] */
    struct sst_map_u8 *status;     /* [views] */
    struct sst_map_u16 *filled;    /* [views] */
    struct sst_volume shape;       /* without memory: disparities, steps and phases of a whole view's volume */
    int workers;                   /* views that are matched at once */
    int inner;                     /* threads that match a view; more than 1: of whole views, without `coarse` */
    struct sst_volume *volumes;    /* [threads], [workers] in use: of whole views, or with `coarse` of tiles */
    struct sst_volume *parts;      /* [threads], [workers][inner] in use: volumes that share those */
    struct sst_tiles *tiles;       /* [threads], [workers] in use */
    struct sst_lightfield *coarse; /* disparities at SST_COARSER times fewer pixels per side; NULL: not skip_ranges */
    double *searched;              /* [views] part of the disparities in the windows of its tiles, 0..1 */
    struct census_cache *cache;    /* of descriptors; NULL: each has its own census */
    const int *later;              /* [laters] views that are matched from now on, if there is a cache */
    int laters;
    bool costs; /* descriptors need the census if it counts: some view is matched on the CPU */
};

/** @return 0, -ECANCELED */
int run_cancelled(const struct disparity_run *run);

/** View at (row + dr, col + dc), or -1. */
int run_view_at(const struct sst_lightfield *lf, int view, int dr, int dc);

/** True if there is a view to match with. */
bool run_has_neighbours(const struct disparity_run *run, int view);

/** Not matched with the first views, but carried over from them. */
bool run_is_carried(const struct disparity_run *run, int view);

void run_drop_phases(struct disparity_run *run);

/** The neighbours first .. last (of the order in views.c) of a view that are present. @return their number, or -errno
 */
SST_MUST_CHECK int run_gather_neighbours(struct disparity_run *run, int view, int first, int last,
                                         struct sst_neighbour *neighbours);

/** Views that a view is checked against and filled from: one and two steps away on all sides, the nearer ones first;
 * or, where others are carried, the matched views around it. */
void run_checked_views(const struct disparity_run *run, int view, struct sst_checked_views *out);

/** The answer at a coarser level for one view; disp is NULL without one. */
struct sst_coarse run_coarse_view(const struct disparity_run *run, int view);

/** Match a view tile by tile, each in its own range. @return 0 or -errno */
SST_MUST_CHECK int run_search_tiles(struct disparity_run *run, struct sst_tiles *tiles, struct sst_volume *v, int view,
                                    const struct sst_neighbour *neighbours, int count,
                                    const struct sst_support *support, struct sst_map_u16 *disp,
                                    struct sst_map_u8 *confidence);

/** Describe views and their neighbours, as far as matching these views needs it. @return 0 or -errno */
SST_MUST_CHECK int run_describe_for(struct disparity_run *run, const int *view, int count, int threads);

/** Note in run->need the phases that matching a view needs of it and of its neighbours. */
void run_need_view(struct disparity_run *run, int view);

/* --- census_cache.c: census of views that are matched one by one, in bounded memory --- */

/** Bytes of the census of all views; run->need is undefined afterwards. */
size_t run_census_bytes(struct disparity_run *run);

/** Make run->cache for views that are matched in run->volumes[0]; more than `bytes` only where one view needs it.
 * @return 0, -ENOMEM; run_free_census_cache() frees all, also after a failure */
SST_MUST_CHECK int run_make_census_cache(struct disparity_run *run, size_t bytes);
void run_free_census_cache(struct disparity_run *run);

/** Choose the planes that stay, and places for missing planes. @param view  [count] that are matched, in this order;
 * the first one now: run->need is its @return 0, -ENOMEM */
SST_MUST_CHECK int run_place_census(struct disparity_run *run, const int *view, int count);

/** Compute the missing planes of a view. Thread: any, one for each view. @return 0, -ENOMEM */
SST_MUST_CHECK int run_compute_census(struct disparity_run *run, int view);

/* --- features.c --- */

/** Make the features of a view, unless there are any that serve: planes of the runner alone where that runs the network
 * and has room for the features of all views. @return 0 or an error of sst_descriptor_add_features() */
SST_MUST_CHECK int run_add_features(struct disparity_run *run, int view, struct sst_network *net);

/** A worker's volume: of a whole view, or of a tile. @return 0, -ENOMEM */
SST_MUST_CHECK int run_make_volume(const struct disparity_run *run, struct sst_volume *v);

/** The views as the steps after the first pass see them. @param seen  [views], zeroed; owned by the caller, as is
 * out->view @return 0, -ENOMEM */
SST_MUST_CHECK int run_visible_views(const struct disparity_run *run, struct sst_visible_views *out,
                                     struct sst_map_u8 *seen);

/* --- match.c: the first pass --- */

/** Views that are matched together: job of the step. */
struct match_batch {
    struct disparity_run *run;
    const int *view;
    int count, describing;       /* threads that describe them */
    struct match_sample *sample; /* that these are of; or NULL */
};

/** Invalid pixels have no disparity and take no part in checking or filling. */
void match_forget_unseen(struct sst_map_u16 *disp, const struct sst_map_u8 *seen);

/** Pixels and features of a view as they are matched. */
void run_match_source(const struct disparity_run *run, int view, struct sst_plane_source *out);

/** Describe and match all views that are not carried, or with `others` all, `threads` at a time; each once.
 * @return 0 or -errno */
SST_MUST_CHECK int run_match(struct disparity_run *run, int threads, sst_progress_fn *progress, void *progress_arg);

/* --- scene_sweep.c: the sweep in scene space instead of matching --- */

/** Is it for views with so little texture? */
bool run_may_sweep(const struct disparity_run *run);

/** Percent of the reference view's pixels of which another disparity than its map's explains the colours better. */
SST_MUST_CHECK int run_missed(const struct disparity_run *run, int threads, double *percent);

/** Maps of all views by the sweep, and run->settled where they are not tested again.
 * @param start  maps of half size, see struct sst_planesweep; NULL: none
 * @return 0, -E2BIG: nothing has changed but that no view is matched; -ENOMEM, -ECANCELED */
SST_MUST_CHECK int run_sweep(struct disparity_run *run, const struct sst_map_u16 *start, int threads);

/* --- windows.c: windows of disparities from a match of all views at fewer pixels --- */

#define WINDOWS_COMPARED 3 /* rows of tiles of the reference view */

/** Rows of tiles in the whole range and in windows: items 2 i and 2 i + 1 of the step that compares them. */
struct windows_compared {
    struct disparity_run *run;
    struct sst_neighbour neighbours[SST_MAX_NEIGHBOURS];
    int count, workers; /* the latter have a network each */
    int top[WINDOWS_COMPARED];
    struct sst_support support;
    struct sst_map_u16 disp[2 * WINDOWS_COMPARED];
};

/** Tiles of an item. @return 0, -ENOMEM */
SST_MUST_CHECK int windows_lay_out(const struct windows_compared *c, int item, struct sst_tiles *tiles);

/** Match the views so, where the configuration allows windows and they pay. @return 0 or -errno */
SST_MUST_CHECK int run_make_coarse(struct disparity_run *run, int threads);
void run_free_coarse(struct disparity_run *run);

/** Percent of the pixels in three rows of tiles of the reference view whose disparity the windows change. @param error
 *  out; NaN without neighbours @return 0 or -errno */
SST_MUST_CHECK int run_measure_ranges(struct disparity_run *run, int workers, double *error);

/** Report what was searched, a mean over the views that were matched. */
void run_report_ranges(const struct disparity_run *run);

/* --- shared.c: with other processes, if there are any --- */

/** Run a step over all views with the run as its job. @return 0 or -errno */
SST_MUST_CHECK int run_step(struct disparity_run *run, const struct sst_step *step, int threads);

bool run_is_present(const void *job, int view);
void run_source(const void *job, int view, struct sst_plane_source *out);
void run_free_sample(void *job);

/** Members of such a step that changes maps, with disparity_sample() as its sample. */
#define RUN_STEP                                                                                                       \
    .wants = run_is_present, .source = run_source, .changes = 1U << SST_PLANE_MAP, .sample_free = run_free_sample

/** Continue the background into pixels that no view shows, as the last step of carrying; 0 where nothing is known. */
SST_MUST_CHECK int run_fill_background(struct disparity_run *run, int threads);

/* --- carry.c --- */

/** What carrying would do to the reference view (sst_disparity_carry_error()), if that is one of the matched ones; else
 *  NAN. @return 0 or -errno */
SST_MUST_CHECK int run_carrying_error(struct disparity_run *run, const struct sst_visible_views *in,
                                      struct sst_map_u8 *status, double *error);

#define CARRY_SOURCES 4 /* nearest matched views that a map comes from */

/** Job of the step. */
struct carry {
    const struct sst_visible_views *in;
    struct sst_map_u8 *status;       /* or NULL */
    struct disparity_sample *sample; /* that these are of; or NULL */
};

/** Sources of view k. @return their number, -ENOMEM */
SST_MUST_CHECK int run_carry_sources(const struct sst_visible_views *in, int k, int source[CARRY_SOURCES]);

/* --- sample.c --- */

/** A run over a small light field of random maps. */
struct disparity_sample {
    struct disparity_run run; /* first */
    struct sst_lightfield lf;
    struct sst_disparity_config cfg;
    struct sst_disparity_report report;
    struct sst_map_u16 disp[SST_STEP_SAMPLES], filled[SST_STEP_SAMPLES];
    struct sst_map_u8 confidence[SST_STEP_SAMPLES], status[SST_STEP_SAMPLES], agreed[SST_STEP_SAMPLES];
    bool carried[SST_STEP_SAMPLES];
    struct sst_visible_views in; /* the same maps */
    struct sst_visible_view view[SST_STEP_SAMPLES];
    struct carry carry; /* of them */
};

/** @param checked  the maps have results of a check @param carried  of the views one in four is matched @return NULL:
 * no memory */
struct disparity_sample *disparity_sample(uint32_t seed, bool checked, bool carried);
void disparity_sample_free(struct disparity_sample *s); /* NULL is fine */

#define MATCH_SAMPLES       7
#define MATCH_SAMPLE_PIXELS (60 * 42)

/** A run in which two views of random images and features are matched. */
struct match_sample {
    struct disparity_run run;
    struct sst_lightfield lf, coarse;
    struct sst_disparity_config cfg;
    struct sst_descriptor desc[SST_STEP_SAMPLES];
    struct sst_map_u16 disp[SST_STEP_SAMPLES];
    struct sst_map_u8 confidence[SST_STEP_SAMPLES];
    struct sst_volume volume;
    struct sst_tiles tiles;
    double searched[SST_STEP_SAMPLES];
    unsigned need[SST_STEP_SAMPLES];
    int view[2]; /* that are matched */
    int band;    /* rows that are matched at once at most; 0: all */
    struct match_batch batch;
};

/** @param seed  1 .. MATCH_SAMPLES: each is another way to match @return NULL: no memory */
struct match_sample *disparity_match_sample(uint32_t seed);
void disparity_match_sample_free(struct match_sample *s); /* NULL is fine */

/** Steps of a run. */
extern const struct sst_step disparity_features_step, disparity_match_step, disparity_compare_step,
    disparity_sweep_step, disparity_surfaces_step, disparity_subpixel_step, disparity_carry_step, disparity_check_step,
    disparity_fill_step, disparity_background_step;

/* --- visible_pass.c, visible.c: planes of the views of a pass --- */

/** In 2^-16 px. */
static inline int32_t visible_q16(double px)
{
    return (int32_t)floor(px * 65536 + 0.5);
}

/** Maps of view k, for planes. */
void visible_source(const struct sst_visible_views *in, int k, struct sst_plane_source *out);

/** The plane of colours of the size of the maps. */
enum sst_step_plane visible_colours(const struct sst_visible_views *in);

/** Places for planes that no run has claimed, none current. */
void visible_adopt(const struct sst_visible_views *in);

/* Jobs of sst_parallel_for(), index: a view. */
sst_work_fn run_describe, run_check, run_fill;

#endif
