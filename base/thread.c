/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE
#include "base/thread.h"

#include <dirent.h>
#include <errno.h>
#include <sched.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

#include "base/log.h"

#define MAX_THREADS 256
#define RAISED_NICE (-10)

struct pool {
    /* fixed after start */
    int count;
    sst_work_fn *fn;
    void *arg;
    /* atomic */
    _Atomic int next, failed_index;
    /* under lock */
    pthread_mutex_t lock;
    int error;
    char text[SST_LOG_MAX]; /* the message logged with it */
};

struct worker {
    struct pool *pool;
    int id;
    pthread_t thread;
};

int sst_thread_count(int requested)
{
    cpu_set_t set;

    if (requested > 0)
        return sst_min_int(requested, MAX_THREADS);
    if (sched_getaffinity(0, sizeof(set), &set))
        return 1;
    return sst_clamp_int(CPU_COUNT(&set), 1, MAX_THREADS);
}

static void *work(void *arg)
{
    struct worker *w = arg;
    struct pool *p = w->pool;
    char text[SST_LOG_MAX], *before = sst_log_hold_errors(text);
    int i;

    /* Indices below a failed one still run, so that the reported error is always the lowest index's. */
    while ((i = atomic_fetch_add(&p->next, 1)) < p->count && i < p->failed_index) {
        int err;

        text[0] = 0;
        err = p->fn(p->arg, i, w->id);
        if (!err)
            continue;
        pthread_mutex_lock(&p->lock);
        if (i < p->failed_index) {
            p->failed_index = i;
            p->error = err;
            memcpy(p->text, text, sizeof(text));
        }
        pthread_mutex_unlock(&p->lock);
    }
    (void)sst_log_hold_errors(before);
    return NULL;
}

int sst_parallel_for(int count, int threads, sst_work_fn *fn, void *arg)
{
    struct pool pool = { .count = count, .fn = fn, .arg = arg, .failed_index = count };
    struct worker workers[MAX_THREADS];
    int started = 1;

    threads = sst_clamp_int(sst_min_int(threads, count), 1, MAX_THREADS);
    pthread_mutex_init(&pool.lock, NULL);
    for (int i = 0; i < threads; i++)
        workers[i] = (struct worker){ .pool = &pool, .id = i };
    /* Without a thread it only runs slower. */
    while (started < threads && !pthread_create(&workers[started].thread, NULL, work, &workers[started]))
        started++;
    work(&workers[0]);
    while (--started > 0)
        pthread_join(workers[started].thread, NULL);
    pthread_mutex_destroy(&pool.lock);
    if (pool.text[0])
        sst_log_error("%s", pool.text);
    return pool.error;
}

void sst_thread_name(const char *name)
{
    pthread_setname_np(pthread_self(), name);
}

void sst_thread_nice(int nice)
{
    setpriority(PRIO_PROCESS, (id_t)syscall(SYS_gettid), nice); /* lowering cannot fail */
}

void sst_thread_raise_all(void)
{
    const int mine = getpriority(PRIO_PROCESS, 0);
    const struct sched_param none = { 0 };
    const struct dirent *e;
    DIR *d = opendir("/proc/self/task");

    while (d && (e = readdir(d))) {
        const pid_t thread = (pid_t)atoi(e->d_name);

        if (thread <= 0)
            continue;
        (void)sched_setscheduler(thread, SCHED_OTHER, &none); /* without the permission nothing changes */
        if (setpriority(PRIO_PROCESS, (id_t)thread, RAISED_NICE))
            (void)setpriority(PRIO_PROCESS, (id_t)thread, mine);
    }
    if (d)
        closedir(d);
}

void sst_cond_init(pthread_cond_t *cond)
{
    pthread_condattr_t attr;

    pthread_condattr_init(&attr);
    pthread_condattr_setclock(&attr, CLOCK_MONOTONIC);
    pthread_cond_init(cond, &attr);
    pthread_condattr_destroy(&attr);
}

bool sst_cond_wait_until(pthread_cond_t *cond, pthread_mutex_t *lock, int64_t until_ns)
{
    const struct timespec until = { .tv_sec = until_ns / 1000000000, .tv_nsec = until_ns % 1000000000 };

    return pthread_cond_timedwait(cond, lock, &until) != ETIMEDOUT;
}
