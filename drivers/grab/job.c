/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "drivers/grab/grab_internal.h"

#include <errno.h>
#include <poll.h>
#include <pthread.h>
#include <signal.h>
#include <stdbool.h>
#include <stdlib.h>
#include <sys/eventfd.h>
#include <unistd.h>

struct jobs {
    /* fixed after create */
    int fd;
    /* owner's thread only */
    int running;
    /* under lock */
    pthread_mutex_t lock;
    struct grab_job *done;
    int users; /* the owner and every running job: the last one frees */
    bool abandoned;
};

int jobs_create(struct jobs **out)
{
    struct jobs *jobs = calloc(1, sizeof(*jobs));

    if (!jobs)
        return -ENOMEM;
    jobs->fd = eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
    if (jobs->fd < 0) {
        free(jobs);
        return -errno;
    }
    pthread_mutex_init(&jobs->lock, NULL);
    jobs->users = 1;
    *out = jobs;
    return 0;
}

int jobs_fd(const struct jobs *jobs)
{
    return jobs->fd;
}

static void unref(struct jobs *jobs)
{
    bool last;

    pthread_mutex_lock(&jobs->lock);
    last = --jobs->users == 0;
    pthread_mutex_unlock(&jobs->lock);
    if (!last)
        return;
    close(jobs->fd);
    pthread_mutex_destroy(&jobs->lock);
    free(jobs);
}

static void *thread_main(void *arg)
{
    struct grab_job *job = arg;
    struct jobs *jobs = job->jobs;
    const uint64_t one = 1;
    bool abandoned;

    job->run(job);
    pthread_mutex_lock(&jobs->lock);
    abandoned = jobs->abandoned;
    if (!abandoned) {
        job->next = jobs->done;
        jobs->done = job;
        /* The counter of an eventfd without readers does not overflow in practice. */
        (void)!write(jobs->fd, &one, sizeof(one));
    }
    pthread_mutex_unlock(&jobs->lock);
    if (abandoned)
        job->discard(job);
    unref(jobs);
    return NULL;
}

int jobs_start(struct jobs *jobs, struct grab_job *job)
{
    sigset_t all, before;
    pthread_t thread;
    int err;

    job->jobs = jobs;
    pthread_mutex_lock(&jobs->lock);
    jobs->users++;
    pthread_mutex_unlock(&jobs->lock);
    /* Jobs block signals: handlers run on the caller's threads. */
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before);
    err = pthread_create(&thread, NULL, thread_main, job);
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    if (err) {
        unref(jobs);
        return -err;
    }
    pthread_detach(thread);
    jobs->running++;
    return 0;
}

static struct grab_job *pop(struct jobs *jobs)
{
    struct grab_job *job;
    uint64_t count;

    pthread_mutex_lock(&jobs->lock);
    job = jobs->done;
    if (job)
        jobs->done = job->next;
    else
        (void)!read(jobs->fd, &count, sizeof(count));
    pthread_mutex_unlock(&jobs->lock);
    return job;
}

void jobs_collect(struct jobs *jobs, void *owner)
{
    struct grab_job *job;

    while ((job = pop(jobs))) {
        jobs->running--;
        job->ended(job, owner);
    }
}

int jobs_running(const struct jobs *jobs)
{
    return jobs->running;
}

void jobs_wait(struct jobs *jobs, int timeout_ms)
{
    struct pollfd p = { .fd = jobs->fd, .events = POLLIN };

    (void)poll(&p, 1, timeout_ms);
}

void jobs_destroy(struct jobs *jobs)
{
    struct grab_job *done, *next;

    if (!jobs)
        return;
    pthread_mutex_lock(&jobs->lock);
    jobs->abandoned = true;
    done = jobs->done;
    jobs->done = NULL;
    pthread_mutex_unlock(&jobs->lock);
    for (; done; done = next) {
        next = done->next;
        done->discard(done);
    }
    unref(jobs);
}
