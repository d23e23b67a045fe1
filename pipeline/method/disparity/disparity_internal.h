/* pipeline/method/disparity/disparity_internal.h - one run over the views of a light field: disparity.c orders the
 * steps, views.c is what is done to each view. */
#ifndef SST_PIPELINE_METHOD_DISPARITY_DISPARITY_INTERNAL_H
#define SST_PIPELINE_METHOD_DISPARITY_DISPARITY_INTERNAL_H

#include "base/thread.h"
#include "pipeline/method/disparity/stage.h"
#include "pipeline/method/network/network.h"

/* State of one run; descriptors exist only while a grid row or its neighbours are matched. */
struct disparity_run {
    struct sst_lightfield *lf;
    const struct sst_disparity_config *cfg;
    struct sst_disparity_config census; /* what cfg points to with census_suffices */
    struct sst_network **nets;          /* [workers]; NULL without features */
    bool fill;
    bool *carried;                 /* [views] not matched, or after the key views; NULL: all are matched */
    bool others;                   /* the views that were to be carried are matched after all */
    int rounds;                    /* of the second pass */
    bool subpixel;                 /* refine between pixels */
    int scale, width, height;      /* of the images that are matched */
    int disp_min, range;           /* in pixels of those images; range + 1 whole disparities are searched */
    int divisor;                   /* steps per pixel */
    unsigned phases;               /* of the census that some pair of neighbours needs */
    struct sst_descriptor *desc;   /* [views] */
    struct sst_map_u16 *disp;      /* [views], at matching size */
    struct sst_map_u8 *confidence; /* [views] */
    struct sst_map_u8 *status;     /* [views] */
    struct sst_map_u16 *filled;    /* [views] */
    struct sst_volume shape;       /* without memory: disparities, steps and phases of a whole view's volume */
    struct sst_volume *volumes;    /* [workers] of whole views, or with `coarse` of tiles */
    struct sst_tiles *tiles;       /* [workers] */
    struct sst_lightfield *coarse; /* disparities at SST_COARSER times fewer pixels per side; NULL: not skip_ranges */
    double *searched;              /* [views] part of the disparities in the windows of its tiles, 0..1 */
    int first_view;                /* of the current grid row */
    struct sst_disparity_device *device; /* that views are matched on; NULL: on the CPU */
    const char *refused;                 /* why it is not the one that was asked for; or NULL */
    bool *matched;                       /* [views] on the device */
    bool costs;                          /* descriptors need costs: some view is matched on the CPU */
};

/** @return 0, -ECANCELED */
int run_cancelled(const struct disparity_run *run);

/** View at (row + dr, col + dc), or -1. */
int run_view_at(const struct sst_lightfield *lf, int view, int dr, int dc);

/** Not matched with the first views, but carried over from them. */
bool run_is_carried(const struct disparity_run *run, int view);

/** Phases of the census that some pair of neighbours needs. */
unsigned run_phases(const struct disparity_run *run);
void run_drop_phases(struct disparity_run *run);

/** The neighbours first .. last (of the order in views.c) of a view that are present. @return their number, or -errno
 */
SST_MUST_CHECK int run_gather_neighbours(struct disparity_run *run, int view, int first, int last,
                                         struct sst_neighbour *neighbours);

/** The answer at a coarser level for one view; disp is NULL without one. */
struct sst_coarse run_coarse_view(const struct disparity_run *run, int view);

/** Match a view tile by tile, each in its own range. @return 0 or -errno */
SST_MUST_CHECK int run_search_tiles(struct disparity_run *run, struct sst_tiles *tiles, struct sst_volume *v, int view,
                                    const struct sst_neighbour *neighbours, int count,
                                    const struct sst_support *support, struct sst_map_u16 *disp,
                                    struct sst_map_u8 *confidence);

/** Describe the views of a row of the grid and of two rows around it. @return 0 or -errno */
SST_MUST_CHECK int run_describe_rows(struct disparity_run *run, int row, int threads);

/** Describe and match all views that are not carried, one row of the grid after the other. @return 0 or -errno */
SST_MUST_CHECK int run_match(struct disparity_run *run, int threads, sst_progress_fn *progress, void *progress_arg);

/* --- device.c: the first pass on a device --- */

/** A view to match, or rows of it. */
struct device_match {
    const struct disparity_run *run;
    const struct sst_descriptor *ref; /* of run->desc, like those of the neighbours; no costs are needed */
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

/* Jobs of sst_parallel_for(), index: a view; of run_describe(): counted from run->first_view. */
sst_work_fn run_describe, run_check, run_fill;

#endif
