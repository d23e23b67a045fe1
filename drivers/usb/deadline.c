/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "drivers/usb/usb_internal.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/thread.h"

struct job {
    /* fixed */
    deadline_fn *fn;
    /* under lock */
    pthread_mutex_t lock;
    pthread_cond_t ended;
    bool done;
    int result, users; /* the last user frees */
    /* the thread only */
    _Alignas(max_align_t) unsigned char arg[];
};

static void leave_locked(struct job *job)
{
    const bool last = --job->users == 0;

    pthread_mutex_unlock(&job->lock);
    if (!last)
        return;
    pthread_cond_destroy(&job->ended);
    pthread_mutex_destroy(&job->lock);
    free(job);
}

static void *work(void *arg)
{
    struct job *job = arg;
    const int result = job->fn(job->arg);

    pthread_mutex_lock(&job->lock);
    job->result = result;
    job->done = true;
    pthread_cond_signal(&job->ended);
    leave_locked(job);
    return NULL;
}

int deadline_call(deadline_fn *fn, const void *arg, size_t arg_size, int timeout_ms)
{
    const int64_t end_ns = sst_clock_now_ns() + (int64_t)timeout_ms * 1000000;
    struct job *job = calloc(1, sizeof(*job) + arg_size);
    pthread_t thread;
    int err;

    if (!job)
        return -ENOMEM;
    pthread_mutex_init(&job->lock, NULL);
    sst_cond_init(&job->ended);
    job->fn = fn;
    job->users = 2;
    memcpy(job->arg, arg, arg_size);
    err = pthread_create(&thread, NULL, work, job);
    pthread_mutex_lock(&job->lock);
    if (err) {
        job->users = 1;
        leave_locked(job);
        return -err;
    }
    pthread_detach(thread);
    while (!job->done && sst_cond_wait_until(&job->ended, &job->lock, end_ns))
        ;
    err = job->done ? job->result : -ETIMEDOUT;
    leave_locked(job);
    return err;
}
