/* base/thread.h - parallel loops, thread names and priorities, condition variables on CLOCK_MONOTONIC. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_BASE_THREAD_H
#define SST_BASE_THREAD_H

#include <pthread.h>
#include <stdbool.h>

#include "base/base.h"

/**
 * Process one index. The result must depend on index only, never on worker, so that any number of threads gives the
 * same bytes; worker (0 .. threads-1) only selects a scratch buffer.
 *
 * @return 0 or a negative errno, which stops the assignment of further indices.
 */
typedef int sst_work_fn(void *arg, int index, int worker);

/** Threads to use: requested if positive, else the processors this process may run on (at most 256). */
int sst_thread_count(int requested);

/** Threads that write many files at once: they mostly wait for the disk, which takes their files together. */
#define SST_WRITE_THREADS 16

/**
 * Call fn for every index in 0 .. count-1, on `threads` threads (the caller's among them).
 *
 * @return 0, or the error of the lowest index that failed; of the errors logged by fn only that one is shown.
 *         Thread: any; calls may nest.
 */
SST_MUST_CHECK int sst_parallel_for(int count, int threads, sst_work_fn *fn, void *arg);

/** Name the calling thread, at most 15 characters: shown by ps, top and gdb. */
void sst_thread_name(const char *name);

/** Set the nice value of the calling thread and of threads that it starts from now on: 0..19. */
void sst_thread_nice(int nice);

/** Raise all threads of this process, also idle-class ones, to the highest permitted priority (nice -10 at most), else
 * to the caller's, so that low-priority threads do not delay the end of the process. */
void sst_thread_raise_all(void);

/** Initialise a condition variable that waits on CLOCK_MONOTONIC. */
void sst_cond_init(pthread_cond_t *cond);

/** Wait for `cond`, at most until sst_clock_now_ns() is `until_ns`. @return false: time-out */
bool sst_cond_wait_until(pthread_cond_t *cond, pthread_mutex_t *lock, int64_t until_ns);

#endif
