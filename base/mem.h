/* base/mem.h - aligned memory for image rows and working buffers. */
#ifndef SST_BASE_MEM_H
#define SST_BASE_MEM_H

#include "base/base.h"

#define SST_ALIGN 64

/** Zeroed memory of count * size bytes, aligned to SST_ALIGN with SST_ALIGN readable bytes after it;
 *  NULL when that overflows or is not to be had. Free with sst_mem_free(). */
void *sst_mem_alloc(size_t count, size_t size) SST_MUST_CHECK;

/** The same without zeroing. */
void *sst_mem_alloc_raw(size_t count, size_t size) SST_MUST_CHECK;

/** NULL is fine. */
void sst_mem_free(void *p);

/** Memory that is kept from call to call and only ever grows. Zeroed: none yet. One thread at a time. */
struct sst_mem_kept {
    void *data;
    size_t bytes;
};

/** At least count * size bytes, aligned as above, of any content: what was there may be gone. NULL as above; then what
 *  there was stays. */
void *sst_mem_keep(struct sst_mem_kept *kept, size_t count, size_t size) SST_MUST_CHECK;
void sst_mem_kept_fini(struct sst_mem_kept *kept);

/** Bytes of a row of n elements, rounded up to SST_ALIGN. */
static inline size_t sst_mem_stride(size_t n, size_t size)
{
    return (n * size + SST_ALIGN - 1) / SST_ALIGN * SST_ALIGN;
}

#endif
