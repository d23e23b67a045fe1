/* base/clock.h - monotonic time, CPU time, and wall-clock time as text. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_BASE_CLOCK_H
#define SST_BASE_CLOCK_H

#include <stdbool.h>

#include "base/base.h"

/** CLOCK_MONOTONIC in nanoseconds. */
int64_t sst_clock_now_ns(void);

/** Sleep until sst_clock_now_ns() is t_ns; signals do not end it. */
void sst_clock_sleep_until(int64_t t_ns);

/** CPU time of the whole process in nanoseconds. */
int64_t sst_clock_cpu_ns(void);

/** CLOCK_REALTIME in nanoseconds. */
int64_t sst_clock_wall_ns(void);

/** Watch for steps of the wall clock; zeroed: the first call begins it. */
struct sst_clock_watch {
    int64_t offset_ns, since_ns;
};
/**
 * Has the wall clock run for ten minutes without a step of more than 2 s between calls? Files are removed by their age
 * only then, so that a clock that is wrong for a moment costs none.
 */
bool sst_clock_is_steady(struct sst_clock_watch *w);

#define SST_CLOCK_TEXT 32
/** "2026-11-21T18:05:00.123Z". */
void sst_clock_text(char out[SST_CLOCK_TEXT], int64_t wall_ns);
/** Whether a text begins with a day of the calendar, as "2026-11-21" or "2026-11-21T18:05:00Z". */
bool sst_clock_begins_with_day(const char *text);
/** Read "2026-11-21T18:05:00Z", with a fraction if need be. @param text  NULL is none @return false: no such time */
bool sst_clock_read(const char *text, int64_t *wall_ns);

#endif
