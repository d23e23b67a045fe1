/* tests/kernels/guard.h - buffers that end at an unmapped page, so that accesses beyond the end fault. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_TESTS_KERNELS_GUARD_H
#define SST_TESTS_KERNELS_GUARD_H

#include <sys/mman.h>
#include <unistd.h>

#include "simulators/scene/noise.h"
#include "tests/test.h"

#define GUARDS_MAX 48

static struct {
    void *map;
    size_t size;
} guards[GUARDS_MAX];
static int guard_count;

/** Random bytes, until guard_free_all(). */
static inline void *guard_random(size_t bytes, uint64_t *seed)
{
    const size_t page = (size_t)sysconf(_SC_PAGESIZE), size = (bytes + page - 1) / page * page + page;
    uint8_t *map = mmap(NULL, size, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0), *data;

    assert_true(map != MAP_FAILED && guard_count < GUARDS_MAX);
    assert_int_equal(mprotect(map + size - page, page, PROT_NONE), 0);
    guards[guard_count].map = map;
    guards[guard_count++].size = size;
    data = map + size - page - bytes;
    for (size_t i = 0; i < bytes; i++)
        data[i] = (uint8_t)sst_random_u64(seed);
    return data;
}

static inline void guard_free_all(void)
{
    while (guard_count > 0) {
        guard_count--;
        munmap(guards[guard_count].map, guards[guard_count].size);
    }
}

#endif
