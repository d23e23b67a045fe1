#include "base/mem.h"

#include <stdlib.h>
#include <string.h>

void *sst_mem_alloc_raw(size_t count, size_t size)
{
    size_t bytes;

    if (__builtin_mul_overflow(count, size, &bytes) ||
        __builtin_add_overflow(bytes, (size_t)(2 * SST_ALIGN - 1), &bytes))
        return NULL;
    return aligned_alloc(SST_ALIGN, bytes / SST_ALIGN * SST_ALIGN);
}

void *sst_mem_alloc(size_t count, size_t size)
{
    void *p = sst_mem_alloc_raw(count, size);

    if (p)
        memset(p, 0, (count * size + 2 * SST_ALIGN - 1) / SST_ALIGN * SST_ALIGN);
    return p;
}

void sst_mem_free(void *p)
{
    free(p);
}
