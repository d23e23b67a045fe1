/* pipeline/step/backoff.h - how long a device that failed is left alone: for 0, 1, 3, 7 ... 63 pieces of work. */
#ifndef SST_PIPELINE_STEP_BACKOFF_H
#define SST_PIPELINE_STEP_BACKOFF_H

#include <stdbool.h>

#define SST_RUNNER_BACKOFF_MOST 64

/** Zeroed at first; a plain value of its owner. */
struct sst_runner_backoff {
    int skip;     /* pieces of work until the device is opened again */
    int failures; /* in a row: 2^failures - 1 pieces are skipped after the next one */
};

/** True if this piece of work is not for the device; counts it. */
static inline bool sst_runner_backoff_skips(struct sst_runner_backoff *b)
{
    if (b->skip <= 0)
        return false;
    b->skip--;
    return true;
}

/** The device failed. @return pieces of work that will be skipped */
static inline int sst_runner_backoff_fail(struct sst_runner_backoff *b)
{
    b->skip = (1 << b->failures) - 1;
    if (1 << b->failures < SST_RUNNER_BACKOFF_MOST)
        b->failures++;
    return b->skip;
}

/** The device has done a piece of work. */
static inline void sst_runner_backoff_succeed(struct sst_runner_backoff *b)
{
    b->failures = 0;
}

#endif
