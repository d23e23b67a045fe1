/* base/base.h - macros and small inline helpers that every file may use. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_BASE_BASE_H
#define SST_BASE_BASE_H

#include <stddef.h>
#include <stdint.h>

#define SST_MUST_CHECK         __attribute__((warn_unused_result))
#define SST_PRINTF(fmt, first) __attribute__((format(printf, fmt, first)))
#define SST_NOINLINE           __attribute__((noinline))
#define SST_UNUSED             __attribute__((unused))

#define ARRAY_LEN(a) (sizeof(a) / sizeof((a)[0]))

/** Unlink an element from the list, linked by `next`, that it is in. */
#define SST_LIST_REMOVE(first, element)                                                                                \
    do {                                                                                                               \
        __typeof__(element) *link_ = &(first);                                                                         \
                                                                                                                       \
        while (*link_ != (element))                                                                                    \
            link_ = &(*link_)->next;                                                                                   \
        *link_ = (element)->next;                                                                                      \
    } while (0)

#ifdef __cplusplus
#define SST_ATOMIC(type)   type /* C++ only reads the headers */
#define SST_EXTERN_C_BEGIN extern "C" {
#define SST_EXTERN_C_END   }
#else
#define SST_ATOMIC(type) _Atomic(type)
#define SST_EXTERN_C_BEGIN
#define SST_EXTERN_C_END
#endif

/** Pixels of columns x0 .. x1 - 1 and rows y0 .. y1 - 1. */
struct sst_rect {
    int x0, y0, x1, y1;
};

static inline int sst_min_int(int a, int b)
{
    return a < b ? a : b;
}

static inline int sst_max_int(int a, int b)
{
    return a > b ? a : b;
}

static inline int sst_clamp_int(int v, int lo, int hi)
{
    return v < lo ? lo : v > hi ? hi : v;
}

static inline double sst_clamp_double(double v, double lo, double hi)
{
    return v < lo ? lo : v > hi ? hi : v;
}

#endif
