/* pipeline/method/disparity/disparity_internal.h - one run over the views of a light field: disparity.c orders the
 * steps, views.c is what is done to each view. */
#ifndef SST_PIPELINE_METHOD_DISPARITY_DISPARITY_INTERNAL_H
#define SST_PIPELINE_METHOD_DISPARITY_DISPARITY_INTERNAL_H

#include "base/thread.h"
#include "pipeline/gpu/check.h"
#include "pipeline/gpu/convert.h"
#include "pipeline/gpu/hypotheses.h"
#include "pipeline/method/disparity/stage.h"
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
    bool others;                   /* the views that were to be carried are matched after all */
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
    struct sst_disparity_device *device; /* that views are matched on; NULL: on the CPU */
    const char *refused;                 /* why it is not the one that was asked for; or NULL */
    bool *matched;                       /* [views] on the device */
    bool costs;                          /* descriptors need the census if it counts: some view is matched on the CPU */
};

/** @return 0, -ECANCELED */
int run_cancelled(const struct disparity_run *run);

/** View at (row + dr, col + dc), or -1. */
int run_view_at(const struct sst_lightfield *lf, int view, int dr, int dc);

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

/** Describe and match all views that are not carried, or with `others` those, `threads` at a time. @return 0 or -errno
 */
SST_MUST_CHECK int run_match(struct disparity_run *run, int threads, sst_progress_fn *progress, void *progress_arg);

/* --- windows.c: windows of disparities from a match of all views at fewer pixels --- */

/** Match the views so, where the configuration allows windows and they pay. @return 0 or -errno */
SST_MUST_CHECK int run_make_coarse(struct disparity_run *run, int threads);
void run_free_coarse(struct disparity_run *run);

/** Percent of the pixels in three rows of tiles of the reference view whose disparity the windows change. @param error
 *  out; NaN without neighbours @return 0 or -errno */
SST_MUST_CHECK int run_measure_ranges(struct disparity_run *run, int workers, double *error);

/** Report what was searched, a mean over the views that were matched. */
void run_report_ranges(const struct disparity_run *run);

/* --- shared.c: with other processes, if there are any --- */

/** run_check() and run_fill() of all views, on the device where it can. @return 0 or -errno */
SST_MUST_CHECK int run_check_views(struct disparity_run *run, int threads);
SST_MUST_CHECK int run_fill_views(struct disparity_run *run, int threads);

/** Continue the background into pixels that no view shows, as the last step of carrying; 0 where nothing is known. */
SST_MUST_CHECK int run_fill_background(struct disparity_run *run, int threads);

/** The same of a map on a device, into the plane of a view. @param scratch  of a map's size */
void run_dispatch_background(struct sst_run *r, struct sst_gpu_range map, struct sst_gpu_range scratch, int view,
                             const struct sst_gpu_background *push);

/* --- carry.c --- */

/** What carrying would do to the reference view (sst_disparity_carry_error()), if that is one of the matched ones; else
 *  NAN. @return 0 or -errno */
SST_MUST_CHECK int run_carrying_error(struct disparity_run *run, const struct sst_visible_views *in,
                                      struct sst_map_u8 *status, double *error);

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
};

/** @param checked  the maps have results of a check @param carried  of the views one in four is matched @return NULL:
 * no memory */
struct disparity_sample *disparity_sample(uint32_t seed, bool checked, bool carried);
void disparity_sample_free(struct disparity_sample *s); /* NULL is fine */

/** Steps of a run, for sst_step_check(). */
extern const struct sst_step disparity_check_step, disparity_fill_step, disparity_background_step, disparity_carry_step,
    disparity_sweep_step, disparity_surfaces_step, disparity_subpixel_step;

/* --- visible.c: views of a pass on a device --- */

/** Maps of view k, for planes. */
void visible_source(const struct sst_visible_views *in, int k, struct sst_plane_source *out);

/** The plane of colours of the size of the maps. */
enum sst_step_plane visible_colours(const struct sst_visible_views *in);

/* --- device.c, device_match.c: the first pass on a device --- */

/* Memory of the device that lasts from view to view. */
enum device_kept {
    KEPT_TILES = 0,
    KEPT_STEPS = 1,
    KEPT_TABLE = 2,
    KEPT_CENSUS = 3, /* of the view */
    KEPT_OTHER = 4,  /* of a neighbour, in all phases that it needs */
    KEPT_ARMS = 5,
    KEPT_COST = 6,
    KEPT_SUM = 7,
    KEPT_MAP = 8,
    KEPT_FILTERED = 9,
    KEPT_PIXELS = 10, /* of all views: with depth codes in the second pass, lumas, then their maps */
    KEPT_VIEWS = 11,
    KEPT_LIST = 12,
    KEPT_COUNTS = 13,
    KEPT_COSTS = 14,
    KEPT_SUMS = 15,
    KEPT_CHOSEN = 16,
    KEPT_STATE = 17, /* of paths between bands */
    KEPT_MAPS = 18,  /* of all views, with flags, in the second pass; of those that are carried */
    KEPT_ROWS = 19,
    KEPT_PROJECTED = 20, /* what arrives from other views */
    KEPT_OTHERS = 21,
    KEPT_POINTS = 22, /* of all sweeps */
    KEPT_SHIFTS = 23,
    KEPT_WEIGHTS = 24,
    KEPT_PEAKS = 25,
    KEPT_COLOURS = 26, /* of the view in work, if there is no room for them to stay; and its map */
    KEPT_VIEW_MAP = 27,
    KEPT_LEVELS = 28, /* inputs of a network, by luma */
    KEPT
};

struct device_pixels {
    struct sst_gpu_buffer *features; /* NULL: not on the device; given up where memory is needed, also in the turn that
                                        uses them */
    int rows;                        /* of them that are there */
    bool only;                       /* the CPU has none */
};

struct sst_disparity_device {
    struct sst_runner *shared;
    struct sst_runner_user user;
    struct sst_disparity_device_report report;
    /* under the lock of shared */
    struct sst_gpu *gpu; /* from disparity_device_begin() or disparity_device_resume() to disparity_device_end() */
    struct sst_gpu_buffer *kept[KEPT];
    size_t bytes[KEPT];
    const struct sst_lightfield *lf; /* whose views stay; NULL: none */
    bool borrowed;                   /* from a network that runs: no other buffer is freed to make room */
    const struct disparity_run *run; /* whose views these are: */
    struct device_pixels view[SST_MAX_VIEWS];
    uint32_t points;           /* of the second pass, in KEPT_POINTS */
    bool loaded;               /* views lie there: of a round of the second pass, to be refined or carried */
    struct sst_mem_kept words; /* of the host */
};

/** For sst_run(). @param d  or NULL */
struct sst_runner_user *disparity_device_user(struct sst_disparity_device *d);

/** Begin a piece of work. @return false: the device failed, or is left alone for now; logged and counted */
bool disparity_device_begin(struct sst_disparity_device *d);

/** Go on with what an earlier piece left on the device: `loaded` says whether it is still there. */
void disparity_device_resume(struct sst_disparity_device *d);

void disparity_device_end(struct sst_disparity_device *d);

/** After an error of the device: close it, and leave it alone for some views. */
void disparity_device_fail(struct sst_disparity_device *d, int err);

/** Memory for `count` elements. What it held is lost if it grows. @return 0 or an error of the device */
SST_MUST_CHECK int disparity_device_keep(struct sst_disparity_device *d, enum device_kept which, size_t count,
                                         size_t each);

/** A buffer, if necessary in the place of views that are not in use, or of what other kinds of work have on the device.
 * @param stays  its features are in use; or NULL @return 0 or an error of the device */
SST_MUST_CHECK int disparity_device_create_buffer(struct sst_disparity_device *d, struct sst_gpu_buffer **out,
                                                  size_t bytes, const struct device_pixels *stays);

/** Free the features of views. */
void disparity_device_drop_views(struct sst_disparity_device *d);

/** Upload to a byte of the buffer; counted in the report. @return 0 or an error of the device */
SST_MUST_CHECK int disparity_device_upload_at(struct sst_disparity_device *d, struct sst_gpu_buffer *b, size_t offset,
                                              const void *data, size_t bytes);

SST_MUST_CHECK int disparity_device_upload(struct sst_disparity_device *d, struct sst_gpu_buffer *b, const void *data,
                                           size_t bytes);

/* --- device_resident.c: what stays of views --- */

/** A view, at the size that is matched. */
struct device_view {
    int view, width, height;
    const struct sst_image *image; /* or at twice the size */
    const struct sst_map_u8 *seen; /* NULL or without memory: all of it */
    bool stays; /* its colours do, while others of this piece of work are needed as well: views in no use make room */
    const struct sst_map_u16 *disp;
    const struct sst_map_u8 *confidence, *agreed; /* agreed: as `seen`, none of it */
};

/** Views of this run stay from now on, those of another light field no more, and no maps yet. @param d  or NULL */
void disparity_device_claim(struct sst_disparity_device *d, const struct disparity_run *run);

/** Places for views that no run has claimed, none current. @param d  or NULL */
void disparity_device_adopt(struct sst_disparity_device *d, const struct sst_visible_views *in);

/** The run of struct sst_feature_keeper's `arg`. */
struct disparity_feature_run {
    struct sst_disparity_device *device;
    const struct disparity_run *run;
};

/** Keep the features of a band where the matching reads them, if there is plenty of room and the network's device is
 * this one; without a copy on the host, if there is room for those of all views beside a volume. */
bool disparity_device_keep_features(void *keeper, struct sst_gpu *g, struct sst_gpu_buffer *result, size_t at);

/** Make the network's input from the colours of the view, likewise. */
bool disparity_device_feed(void *keeper, struct sst_gpu *g, struct sst_gpu_buffer *input, size_t at);

/** True if the features of a view are there. @param d  or NULL */
bool disparity_device_has_features(struct sst_disparity_device *d, const struct disparity_run *run, int view);

/** The CPU changes the map of a view. @param d  or NULL */
void disparity_device_map_changed(struct sst_disparity_device *d, int view);

/* Between begin and end: */

/** Free planes that are not of the view in work; then features, and buffers of other kinds of work. @param plane  that
 * stays @return whether there was any */
bool disparity_device_make_room(struct sst_disparity_device *d, enum sst_step_plane plane);

/** Free the planes of all views: the light field is matched. */
void disparity_device_unclaim(struct sst_disparity_device *d);

/** Free what stays and is not of the view in work. @return whether there was any */
bool disparity_device_drop_unused(struct sst_disparity_device *d);

/** The last view is not in use any more. */
void disparity_device_next_view(struct sst_disparity_device *d);

/** @return without a buffer: it does not stay */
struct sst_gpu_range disparity_device_find(struct sst_disparity_device *d, enum sst_step_plane plane, int view);

/** Colours of a view, or its map, for this piece of work until the next view; uploaded if they did not stay. @return 0
 * or an error of the device */
SST_MUST_CHECK int disparity_device_colours(struct sst_disparity_device *d, const struct device_view *v,
                                            struct sst_gpu_range *out);
SST_MUST_CHECK int disparity_device_map(struct sst_disparity_device *d, const struct device_view *v,
                                        struct sst_gpu_range *out);

/* A buffer as a range, and none. */
#define W(b)     ((struct sst_gpu_range){ b, 0 })
#define NO_RANGE W(NULL)

/** Dispatch `convert`. @param colours, map, from  one of them at least; without a buffer: not read */
SST_MUST_CHECK int disparity_device_convert(struct sst_disparity_device *d, struct sst_gpu_convert push,
                                            struct sst_gpu_range colours, struct sst_gpu_range map,
                                            struct sst_gpu_range from, struct sst_gpu_range to);

/** Store what a step left as the map that stays, or nothing if there is no room. @param push  conversion to a map */
SST_MUST_CHECK int disparity_device_store(struct sst_disparity_device *d, int view, struct sst_gpu_convert push,
                                          struct sst_gpu_range colours, struct sst_gpu_buffer *from);

/** Words first .. first + n - 1 of a buffer, once all that was dispatched is done. @return 0 or an error of the device
 */
SST_MUST_CHECK int disparity_device_fetch(struct sst_disparity_device *d, struct sst_gpu_buffer *from, size_t first,
                                          size_t n, uint32_t *words);

/** Note that the CPU does a step, or the rest of it, and why. @param err  of the device, which is closed unless it had
 * no room, or -EOVERFLOW (views too far apart) */
void disparity_device_leave(struct sst_disparity_device *d, enum sst_disparity_stage stage, int err);

/** Free what the first pass needs and the second one does not. */
void disparity_device_drop(struct sst_disparity_device *d);

/** A view to match, or rows of it. */
struct device_match {
    const struct disparity_run *run;
    const struct sst_descriptor *ref; /* of run->desc, like those of the neighbours; no census is needed */
    const struct sst_neighbour *neighbours;
    int count;
    const struct sst_tiles *tiles; /* windows of disparities by tile, laid out over these rows; NULL: the whole range */
    int top, height;               /* rows */
    bool filter;                   /* whole views: winners are filtered; the view is counted */
    struct sst_map_u16 *disp;      /* out: these rows */
    struct sst_map_u8 *confidence; /* likewise, or NULL */
};

/** Why a run cannot be on a device, or NULL. */
const char *disparity_device_refuses(const struct disparity_run *run);

/** @return false: the device failed, or is left alone for now; logged and counted, nothing is written */
bool disparity_device_match(struct sst_disparity_device *d, const struct device_match *in);

/** Count a view that is matched on the CPU. @param why  or NULL: as the last one */
void disparity_device_note_cpu(struct sst_disparity_device *d, const char *why);

/** Free the views of a run that ends. @param d  or NULL */
void disparity_device_forget(struct sst_disparity_device *d, const struct disparity_run *run);

/** Count views of the second pass. @param d  or NULL @param tested  there @param on_cpu  on the CPU instead */
void disparity_device_note_tested(struct sst_disparity_device *d, int tested, int on_cpu);

/* Jobs of sst_parallel_for(), index: a view. */
sst_work_fn run_describe, run_check, run_fill;

#endif
