/* pipeline/lightfield/share.h - processes that compute the maps of one light field together, step by step.
 *
 * All processes run the same code. Each item of a shared step (a view, some views, a row of views) is computed by one
 * process, which leaves its results as a file in a common folder; the others read it there before the next step. Steps
 * that are not shared are computed by all. An item of a process that ended is computed by another one (base/claim.h).
 * An item that fails in one process is tried by each of the others that comes to it, until one succeeds or all have
 * failed.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_LIGHTFIELD_SHARE_H
#define SST_PIPELINE_LIGHTFIELD_SHARE_H

#include "base/thread.h"
#include "pipeline/image/image.h"

struct sst_share; /* one thread at a time */

struct sst_share_config {
    const char *dir;  /* folder of the steps, made here; its parent exists */
    const char *job;  /* the work, and its pictures; items of another job are computed again */
    int index, count; /* this process of `count`: where it begins */
    int lease_ms;
};

/** @return 0, -ENOMEM, or an error of the output; logged */
SST_MUST_CHECK int sst_share_open(struct sst_share **out, const struct sst_share_config *cfg);
void sst_share_close(struct sst_share *s); /* NULL is fine */

/** Results of the work on an item, in a fixed order. Empty maps (a view that is missing) stay empty. */
struct sst_share_maps {
    struct sst_share_map *map;
    int count, capacity;
    bool failed; /* no memory for the list */
};

void sst_share_add_u8(struct sst_share_maps *maps, struct sst_map_u8 *map);
void sst_share_add_u16(struct sst_share_maps *maps, struct sst_map_u16 *map);
void sst_share_add_f32(struct sst_share_maps *maps, struct sst_map_f32 *map);
void sst_share_add_image(struct sst_share_maps *maps, struct sst_image *image);

/** Values without pointers, always of this size. */
void sst_share_add_values(struct sst_share_maps *maps, void *values, size_t bytes);

/**
 * A list with a length that is a result as well.
 * @param list  address of the pointer to it: NULL, or memory of base/mem.h, which is replaced
 * @param each  bytes of an element, without pointers
 */
void sst_share_add_list(struct sst_share_maps *maps, void *list, size_t *count, size_t each);

/** True if two lists have the same maps, lists and values. Maps of other sizes, or of which one is empty, differ.
 * @param levels  by which one value in 16 of images and maps of 8 bits may differ */
bool sst_share_maps_equal(const struct sst_share_maps *a, const struct sst_share_maps *b, int levels);

/** Free a list; maps and lists that it names stay. */
void sst_share_maps_fini(struct sst_share_maps *maps);

/**
 * Add the results of an index. Maps and lists that other processes compute are initialised when their file is read;
 * their former content is freed. The work of an index without results is called by every process, and assumed to be
 * next to none.
 */
typedef void sst_share_maps_fn(void *arg, int index, struct sst_share_maps *out);

/**
 * sst_parallel_for() over the items 0 .. count-1 of a step, shared with the other processes. All call it in the same
 * order with the same counts.
 *
 * @param s     NULL: not shared
 * @param maps  results of fn, all that later steps read
 * @return as sst_parallel_for(), or -EIO: the file of an item is damaged; logged
 */
SST_MUST_CHECK int sst_share_for(struct sst_share *s, int count, int threads, sst_work_fn *fn, void *arg,
                                 sst_share_maps_fn *maps);

/** Share a loop in which each index is little work: at most `block` indices are an item, one thread's. */
SST_MUST_CHECK int sst_share_blocks(struct sst_share *s, int count, int block, int threads, sst_work_fn *fn, void *arg,
                                    sst_share_maps_fn *maps);

/** How many views of `pixels` make a block where a pixel is a few nanoseconds of work: small views cost less than
 *  exchanging them one by one. */
int sst_share_block(size_t pixels);

/** Work on some items at once, claimed together by this process. @return 0 or a negative errno */
typedef int sst_share_batch_fn(void *arg, const int *index, int count);

/**
 * sst_share_for() where the work itself uses the threads: fn gets up to `most` items at once.
 * @param s  NULL: not shared; neighbouring items then come together, `most` at a time
 */
SST_MUST_CHECK int sst_share_batches(struct sst_share *s, int count, int most, sst_share_batch_fn *fn, void *arg,
                                     sst_share_maps_fn *maps);

#endif
