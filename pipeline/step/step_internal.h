/* pipeline/step/step_internal.h - memory of a device that steps share, its pause after failures, its opening beside the
 * work. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_STEP_STEP_INTERNAL_H
#define SST_PIPELINE_STEP_STEP_INTERNAL_H

#include "base/mem.h"
#include "pipeline/step/run.h"

struct runner_scratch {
    struct sst_gpu_buffer *buffer; /* NULL: none */
    size_t bytes;
    int64_t used; /* turn of the planes */
};

/** Under the lock of the device; gone when it is closed. */
struct runner_memory {
    struct sst_step_planes planes;
    struct runner_scratch scratch[SST_RUN_SCRATCH];
    struct sst_mem_kept words; /* of the host */
};

#define RUN_LEFT (-ENOSYS) /* by sst_run_leave() */

/** An item in work. */
struct sst_run {
    struct sst_runner_user *user;
    struct runner_memory *memory; /* of the device */
    struct sst_step_report *report;
    struct sst_gpu *gpu;
    const struct sst_step *step;
    const struct sst_step_shaders *shaders; /* of it; NULL: none */
    void *job;
    bool *done; /* [items] on the device */
    bool begun; /* the device was asked for */
    int err;
    int halvings;   /* of the rows that are computed at once */
    bool divisible; /* they can be halved once more */
    bool in_bands;  /* not all rows at once */
    SST_ATOMIC(int) rest; /* items of the CPU */
    bool alone;     /* buffers of earlier items are gone */
    char why[128]; /* of sst_run_leave() */
    /* of sst_step_check(); NULL: none */
    bool *asked;                 /* [SST_GPU_SHADERS] the step asks for its fastest variant */
    enum sst_gpu_shader variant; /* the only one in use; SST_GPU_SHADERS: none */
};

/** A view on the device; r->err says whether it is done. */
void runner_run_view(struct sst_run *r, int view);

/** Free planes, scratch memory and memory of the host. */
void runner_memory_drop(struct runner_memory *m, struct sst_gpu *g);

struct runner_memory *runner_memory_of(struct sst_runner *s);

/** Free scratch memory that was not used in this turn. @return whether there was any */
bool runner_drop_scratch(struct runner_memory *m, struct sst_gpu *g);

/** Name and driver of the device, for the report of a kind of work. */
void runner_note(struct sst_runner_user *user);

/* --- pause of a device that failed: for 0, 1, 3, 7 ... 63 pieces of work ------------------------------------------ */

#define RUNNER_BACKOFF_MOST 64

/** Zeroed at first; a plain value of its owner. */
struct runner_backoff {
    int skip;     /* pieces of work until the device is opened again */
    int failures; /* in a row: 2^failures - 1 pieces are skipped after the next one */
};

/** True if this piece of work is not for the device; counts it. */
static inline bool runner_backoff_skips(struct runner_backoff *b)
{
    if (b->skip <= 0)
        return false;
    b->skip--;
    return true;
}

/** The device failed. @return pieces of work that will be skipped */
static inline int runner_backoff_fail(struct runner_backoff *b)
{
    b->skip = (1 << b->failures) - 1;
    if (1 << b->failures < RUNNER_BACKOFF_MOST)
        b->failures++;
    return b->skip;
}

/** The device has done a piece of work. */
static inline void runner_backoff_succeed(struct runner_backoff *b)
{
    b->failures = 0;
}

/* --- opener.c: a device that is opened and tested on a thread of its own, while its owner goes on without --------- */

struct runner_opener; /* opaque; one thread at a time */

/** A device and its work. */
struct runner_opening {
    const char *name; /* as of sst_gpu_open() */
    struct sst_gpu_config cfg;
    const struct sst_step_shaders *steps; /* to check; static */
    size_t steps_needed, step_count;     /* likewise */
    const char *work;                    /* static; verb, for messages */
};

/**
 * Open a device without waiting for it: the first call begins, and waits 50 ms at most, later ones look.
 *
 * @param opener  in and out: NULL, or the value after the call before; NULL after all but -EINPROGRESS
 * @param what  device; read by the first call
 * @param gpu  out, when 0
 * @param why  out, after an error: the message, which is not logged; "": nothing
 * @return -EINPROGRESS; else as sst_gpu_open() and sst_step_check(), or -ENOMEM or -EAGAIN (no thread)
 */
SST_MUST_CHECK int runner_open_beside(struct runner_opener **opener, const struct runner_opening *what,
                                      struct sst_gpu **gpu, char why[SST_LOG_MAX]);

/** Waits for the thread; its device is closed. NULL is fine. */
void runner_opener_destroy(struct runner_opener *o);

#endif
