/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/step/step_internal.h"

#include <errno.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/thread.h"

/* A fast device is open within this time: nothing goes without it then. */
#define WAIT_NS INT64_C(50000000)

struct runner_opener {
    /* fixed after start */
    char name[SST_GPU_NAME];
    struct runner_opening what;
    pthread_t thread;
    pthread_mutex_t lock;
    pthread_cond_t ended; /* on CLOCK_MONOTONIC */
    /* under lock */
    bool done;
    /* the thread's, and the caller's once it is done */
    int err;
    struct sst_gpu *gpu; /* NULL: not open, or handed over */
    char why[SST_LOG_MAX];
};

static void *run(void *arg)
{
    struct runner_opener *o = arg;
    const struct runner_opening *w = &o->what;
    char *const before = sst_log_hold_errors(o->why);
    int err = sst_gpu_open(&o->gpu, w->name, &w->cfg);
    const bool opened = !err;

    for (size_t i = 0; i < w->step_count && !err; i++) {
        err = sst_step_check(NULL, o->gpu, &w->steps[i]);
        err = err == -ENOTSUP && i >= w->steps_needed ? 0 : err;
        if (err)
            sst_log_error("the device `%s` cannot %s: %s; choose another device", w->name, w->work, sst_gpu_error(err));
    }
    sst_log_hold_errors(before);
    if (err && opened)
        sst_gpu_close(o->gpu);
    if (err)
        o->gpu = NULL;
    pthread_mutex_lock(&o->lock);
    o->err = err;
    o->done = true;
    pthread_cond_signal(&o->ended);
    pthread_mutex_unlock(&o->lock);
    return NULL;
}

static int start(struct runner_opener **out, const struct runner_opening *what)
{
    struct runner_opener *o = calloc(1, sizeof(*o));
    int err;

    if (!o)
        return -ENOMEM;
    snprintf(o->name, sizeof(o->name), "%s", what->name);
    o->what = *what;
    o->what.name = o->name;
    pthread_mutex_init(&o->lock, NULL);
    sst_cond_init(&o->ended);
    err = -pthread_create(&o->thread, NULL, run, o);
    if (err) {
        pthread_cond_destroy(&o->ended);
        pthread_mutex_destroy(&o->lock);
        free(o);
        return err;
    }
    *out = o;
    return 0;
}

static bool is_done(struct runner_opener *o, int64_t until_ns)
{
    bool done;

    pthread_mutex_lock(&o->lock);
    while (!o->done && sst_cond_wait_until(&o->ended, &o->lock, until_ns))
        ;
    done = o->done;
    pthread_mutex_unlock(&o->lock);
    return done;
}

int runner_open_beside(struct runner_opener **opener, const struct runner_opening *what, struct sst_gpu **gpu,
                       char why[SST_LOG_MAX])
{
    int64_t until_ns = 0;
    int err = 0;

    why[0] = 0;
    if (!*opener) {
        until_ns = sst_clock_now_ns() + WAIT_NS;
        err = start(opener, what);
    }
    if (err)
        return err;
    if (!is_done(*opener, until_ns))
        return -EINPROGRESS;
    err = (*opener)->err;
    memcpy(why, (*opener)->why, SST_LOG_MAX);
    if (!err)
        *gpu = (*opener)->gpu;
    (*opener)->gpu = NULL;
    runner_opener_destroy(*opener);
    *opener = NULL;
    return err;
}

void runner_opener_destroy(struct runner_opener *o)
{
    if (!o)
        return;
    pthread_join(o->thread, NULL);
    sst_gpu_close(o->gpu);
    pthread_cond_destroy(&o->ended);
    pthread_mutex_destroy(&o->lock);
    free(o);
}
