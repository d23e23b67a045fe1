/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "base/mem.h"

#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>

#define HUGE_PAGE ((size_t)2 << 20) /* of x86-64, and the usual one of arm64 */
#define HUGE_FROM (2 * HUGE_PAGE)   /* blocks with a last page that, used in part, costs little */

/* A large block in huge pages: a page fault for each 4 KiB of a cost volume is a fifth of the time to match a pair. */
static void *alloc_huge(size_t bytes)
{
    void *p = aligned_alloc(HUGE_PAGE, (bytes + HUGE_PAGE - 1) / HUGE_PAGE * HUGE_PAGE);

    if (p)
        madvise(p, bytes, MADV_HUGEPAGE); /* a wish: without it all is the same, only slower */
    return p;
}

void *sst_mem_alloc_raw(size_t count, size_t size)
{
    size_t bytes;

    if (__builtin_mul_overflow(count, size, &bytes) ||
        __builtin_add_overflow(bytes, (size_t)(2 * SST_ALIGN - 1), &bytes))
        return NULL;
    return bytes >= HUGE_FROM && bytes < SIZE_MAX - HUGE_PAGE ? alloc_huge(bytes)
                                                              : aligned_alloc(SST_ALIGN, bytes / SST_ALIGN * SST_ALIGN);
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

bool sst_mem_grow(void *list, int count, int *capacity, size_t size)
{
    const int more = sst_max_int(2 * count, 16);
    void *grown;

    if (count < *capacity)
        return true;
    memcpy(&grown, list, sizeof(grown)); /* pointers to all types look alike */
    grown = reallocarray(grown, (size_t)more, size);
    if (!grown)
        return false;
    memcpy(list, &grown, sizeof(grown));
    *capacity = more;
    return true;
}

void *sst_mem_keep(struct sst_mem_kept *kept, size_t count, size_t size)
{
    size_t bytes;
    void *p;

    if (__builtin_mul_overflow(count, size, &bytes))
        return NULL;
    if (kept->data && bytes <= kept->bytes)
        return kept->data;
    /* Grow by half at least, so that a slowly growing buffer is not reallocated each time. */
    if (bytes < kept->bytes + kept->bytes / 2)
        bytes = kept->bytes + kept->bytes / 2;
    p = sst_mem_alloc_raw(bytes, 1);
    if (!p)
        return NULL;
    sst_mem_free(kept->data);
    *kept = (struct sst_mem_kept){ p, bytes };
    return p;
}

void sst_mem_kept_fini(struct sst_mem_kept *kept)
{
    sst_mem_free(kept->data);
    *kept = (struct sst_mem_kept){ 0 };
}
