/* drivers/grab/job.h - calls that may block (open, stream off, USB reset) on threads of their own. Only for
 * drivers/grab. */
#ifndef SST_DRIVERS_GRAB_JOB_H
#define SST_DRIVERS_GRAB_JOB_H

#include "base/base.h"

struct sst_jobs; /* opaque; start, collect and destroy on one thread */

/** First member of the caller's object, which is on the heap and belongs to the job until it is done. */
struct sst_job {
    void (*run)(struct sst_job *job);                /* on a thread of its own */
    void (*ended)(struct sst_job *job, void *owner); /* by sst_jobs_collect(); frees the job */
    void (*discard)(struct sst_job *job);            /* frees what a job holds whose end nobody waited for */
    struct sst_jobs *jobs;                           /* set by start */
    struct sst_job *next;
};

/** @return 0, -ENOMEM, -EMFILE. */
SST_MUST_CHECK int sst_jobs_create(struct sst_jobs **out);

/** Readable while sst_jobs_collect() has something to do. */
int sst_jobs_fd(const struct sst_jobs *jobs);

/** Run a job. @return 0, or -EAGAIN (no thread to be had; the job stays the caller's). */
SST_MUST_CHECK int sst_jobs_start(struct sst_jobs *jobs, struct sst_job *job);

/** Call `ended` of every job that has run. */
void sst_jobs_collect(struct sst_jobs *jobs, void *owner);

/** Wait until something is done or timeout_ms is over. */
void sst_jobs_wait(struct sst_jobs *jobs, int timeout_ms);

/** Jobs started whose end was not collected. */
int sst_jobs_running(const struct sst_jobs *jobs);

/** Does not wait: what still runs is discarded when it ends, and what it hangs in is the kernel's. NULL is fine. */
void sst_jobs_destroy(struct sst_jobs *jobs);

#endif
