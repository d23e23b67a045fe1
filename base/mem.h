/* base/mem.h - aligned memory for image rows and working buffers; arrays that grow. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_BASE_MEM_H
#define SST_BASE_MEM_H

#include <stdbool.h>

#include "base/base.h"

#define SST_ALIGN 64

/** Zeroed memory of count * size bytes, aligned to SST_ALIGN with SST_ALIGN readable bytes after it;
 *  NULL on overflow or without memory. Free with sst_mem_free(). */
void *sst_mem_alloc(size_t count, size_t size) SST_MUST_CHECK;

/** Memory as of sst_mem_alloc(), not zeroed. */
void *sst_mem_alloc_raw(size_t count, size_t size) SST_MUST_CHECK;

/** NULL is fine. */
void sst_mem_free(void *p);

/** A buffer that is reused from call to call and only grows. Zeroed: empty. One thread at a time. */
struct sst_mem_kept {
    void *data;
    size_t bytes;
};

/** At least count * size bytes, aligned as by sst_mem_alloc(); the old content may be lost. NULL on overflow or without
 *  memory; then the buffer is unchanged. */
void *sst_mem_keep(struct sst_mem_kept *kept, size_t count, size_t size) SST_MUST_CHECK;
void sst_mem_kept_fini(struct sst_mem_kept *kept);

/**
 * Make room for one more element in an array of malloc().
 *
 * @param list      address of the pointer to the array, NULL at first
 * @param capacity  elements that fit; it doubles when `count` of them are in use
 * @return false: out of memory, nothing has changed
 */
bool sst_mem_grow(void *list, int count, int *capacity, size_t size) SST_MUST_CHECK;

/** Bytes of a row of n elements, rounded up to SST_ALIGN. */
static inline size_t sst_mem_stride(size_t n, size_t size)
{
    return (n * size + SST_ALIGN - 1) / SST_ALIGN * SST_ALIGN;
}

#endif
