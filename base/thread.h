/* base/thread.h - run independent pieces of work on several threads. */
#ifndef SST_BASE_THREAD_H
#define SST_BASE_THREAD_H

#include <pthread.h>
#include <stdbool.h>

#include "base/base.h"

/**
 * Work on one piece. The result must depend on index alone, never on worker, so that any number of threads
 * gives the same bytes; worker (0 .. threads-1) only picks a scratch buffer.
 *
 * @return 0 or a negative errno, which stops the hand-out of further pieces.
 */
typedef int sst_work_fn(void *arg, int index, int worker);

/** Threads to use: requested if positive, else the processors this process may run on (at most 256). */
int sst_thread_count(int requested);

/**
 * Call fn for every index in 0 .. count-1, on `threads` threads (the caller's among them).
 *
 * @return 0, or the error of the lowest index that failed; of the errors logged by fn only that one's is shown.
 *         Thread: any; calls may nest.
 */
SST_MUST_CHECK int sst_parallel_for(int count, int threads, sst_work_fn *fn, void *arg);

/** Name the calling thread, at most 15 characters: what ps, top and gdb show. */
void sst_thread_name(const char *name);

/** Let the calling thread, and those that it starts from now on, give way to others: 0..19. */
void sst_thread_nice(int nice);

/** Give all threads of this process, however idle they were to be, the highest priority that is allowed, down to nice
 *  -10, or the caller's: a process ends only when the last of them got its turn. */
void sst_thread_raise_all(void);

/** A condition whose waits go by CLOCK_MONOTONIC. */
void sst_cond_init(pthread_cond_t *cond);

/** Wait for `cond`, at most until sst_clock_now_ns() is `until_ns`. @return false: it is that late */
bool sst_cond_wait_until(pthread_cond_t *cond, pthread_mutex_t *lock, int64_t until_ns);

#endif
