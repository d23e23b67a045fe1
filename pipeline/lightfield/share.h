/* pipeline/lightfield/share.h - processes that compute the maps of one light field together, step by step.
 *
 * All of them run the same code. Of a step that is shared, each item (a view, a row of views) is computed by one
 * process, which leaves its maps as a file in a folder that all see; the others read them there, so that all have the
 * maps of all items before the next step. What is not shared, all compute. An item of a process that ended is computed
 * by another one (base/claim.h).
 */
#ifndef SST_PIPELINE_LIGHTFIELD_SHARE_H
#define SST_PIPELINE_LIGHTFIELD_SHARE_H

#include "base/thread.h"
#include "pipeline/image/image.h"

struct sst_share; /* one thread at a time */

/**
 * @param dir   folder of the steps, made here; its parent exists
 * @param job   what is computed; items of another job are computed again
 * @param index this process of `count`: where it begins
 * @return 0, -ENOMEM, or an error of the output; logged
 */
SST_MUST_CHECK int sst_share_open(struct sst_share **out, const char *dir, const char *job, int index, int count,
                                  int lease_ms);
void sst_share_close(struct sst_share *s); /* NULL is fine */

/** Maps that the work on an item writes, in a fixed order. Empty ones (a view that is missing) stay empty. */
struct sst_share_maps {
    struct sst_share_map {
        void *map;          /* struct sst_map_u8, sst_map_u16 or sst_map_f32 */
        size_t pixel_bytes; /* 1, 2 or 4 */
    } * map;
    int count, capacity;
    bool failed; /* no memory for the list */
};

void sst_share_add_u8(struct sst_share_maps *maps, struct sst_map_u8 *map);
void sst_share_add_u16(struct sst_share_maps *maps, struct sst_map_u16 *map);
void sst_share_add_f32(struct sst_share_maps *maps, struct sst_map_f32 *map);

/** Add the maps of an item. Those of items that other processes compute are initialised when their file
 *  is read; what they had is freed. */
typedef void sst_share_maps_fn(void *arg, int index, struct sst_share_maps *out);

/**
 * sst_parallel_for() over the items 0 .. count-1 of a step, shared with the other processes. All call it in the same
 * order with the same counts.
 *
 * @param s     NULL: not shared
 * @param maps  what fn writes, and all that later steps read of it
 * @return as sst_parallel_for(), or -EIO: an item failed in another process, or its file is damaged; logged
 */
SST_MUST_CHECK int sst_share_for(struct sst_share *s, int count, int threads, sst_work_fn *fn, void *arg,
                                 sst_share_maps_fn *maps);

#endif
