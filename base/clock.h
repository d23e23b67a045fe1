/* base/clock.h - monotonic time. */
#ifndef SST_BASE_CLOCK_H
#define SST_BASE_CLOCK_H

#include "base/base.h"

SST_EXTERN_C_BEGIN

/** CLOCK_MONOTONIC in nanoseconds. */
int64_t sst_clock_now_ns(void);

/** CPU time of the whole process in nanoseconds. */
int64_t sst_clock_cpu_ns(void);

SST_EXTERN_C_END

#endif
