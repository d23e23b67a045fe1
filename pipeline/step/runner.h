/* pipeline/step/runner.h - one opening of a device for several kinds of work, which fails and is opened again for all.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_STEP_RUNNER_H
#define SST_PIPELINE_STEP_RUNNER_H

#include "base/log.h"
#include "pipeline/gpu/gpu.h"
#include "pipeline/step/planes.h"

struct sst_runner;       /* any thread, under its lock */
struct sst_step_shaders; /* run.h */

#define SST_STEP_COUNTERS 3

/** Work of steps on a device, and fallbacks to the CPU. */
struct sst_step_report {
    char name[SST_GPU_NAME], driver[SST_GPU_NAME]; /* of the device that was opened last */
    char why[128];                                 /* the last reason for the CPU */
    unsigned stages_on_cpu;                        /* bits by struct sst_step, `stages` */
    struct sst_step_items {
        int64_t device, in_bands, on_cpu; /* in_bands: of `device`, for lack of memory */
    } items[SST_STEP_COUNTERS];           /* by struct sst_step, `counter` */
    int64_t failures;                     /* of the device */
    bool failing;                         /* it failed at the last piece of work, or could not be opened */
    char failure[SST_LOG_MAX];            /* the last one's reason; "": none */
    int64_t dispatches, uploads, upload_bytes;
    int64_t total_ns, upload_ns, wait_ns, download_ns; /* wait_ns: until the device has computed */
};

/** A kind of work. Lives from sst_runner_join() to sst_runner_leave(). */
struct sst_runner_user {
    /* set before it joins */
    const struct sst_step_shaders *steps; /* that it runs, the last one empty */
    size_t step_count;       /* of these: a device that computes one of the first otherwise than the CPU is refused */
    size_t steps_tested;     /* that follow them, may be refused, and are tested by an opening beside the work */
    const char *work;        /* verb of the work, for messages: "match" */
    const char *phrase;      /* work on the CPU, for messages: "live labels are computed"; NULL: the step "is done" */
    void (*drop)(void *arg); /* free all buffers of its own, under the lock: the device is closed, or others need the
                                memory; NULL: it has none */
    void *arg;
    bool owns_runner; /* destroyed as the user leaves; may be set later */
    /* of the runner */
    struct sst_runner *runner;
    struct sst_step_report report; /* of sst_run(), under the lock */
    struct sst_runner_user *next;
    int64_t opening;     /* in which its steps were compared */
    const void *claimed; /* light field that sst_run_claim() was called for; NULL: none */
    bool given_up;       /* a live device, or `auto`, computes something else: the work is left to the CPU */
};

/**
 * Open a device.
 *
 * @param name          as of sst_gpu_open(), or "cpu": *out is NULL then; "auto" without a GPU as well
 * @param memory_bytes  that all users together may use of the device's memory; 0: three quarters
 * @return 0 or an error of sst_gpu_open(); logged
 */
SST_MUST_CHECK int sst_runner_create(struct sst_runner **out, const char *name, uint64_t memory_bytes);

/**
 * The same for the live picture: waits are short (struct sst_gpu_config, `prompt`), a device that cannot be opened now
 * is tried again, beside the work, and errors are not logged but kept for sst_runner_why(). One kind of
 * work.
 *
 * @param percent  of the device's memory, where memory_bytes is 0
 * @return 0, also where there is no such device: sst_runner_join() returns why; -ENOMEM (logged)
 */
SST_MUST_CHECK int sst_runner_create_live(struct sst_runner **out, const char *name, uint64_t memory_bytes,
                                          int percent);

/** The same, to test a device: comparisons that it has passed before are done again. */
SST_MUST_CHECK int sst_runner_create_to_test(struct sst_runner **out, const char *name);

/** After its last user has left. NULL is fine. */
void sst_runner_destroy(struct sst_runner *s);

/** Compare the steps of a kind of work. @return 0, also where the device is "auto" and refused: the work is left to the
 * CPU; -ENOTSUP (a step is refused), or an error of the device; logged, but of a live device, whose user joins all the
 * same: it is to be reported then */
SST_MUST_CHECK int sst_runner_join(struct sst_runner *s, struct sst_runner_user *user);

/** Drop the buffers of the user, and the runner if it owns that. */
void sst_runner_leave(struct sst_runner *s, struct sst_runner_user *user);

/* Buffers are created, used and freed under the lock. */
void sst_runner_lock(struct sst_runner *s);
void sst_runner_unlock(struct sst_runner *s);

/** As it was asked for. */
const char *sst_runner_name(const struct sst_runner *s);

/** The device that was opened last. */
const struct sst_gpu_info *sst_runner_info(const struct sst_runner *s);

/**
 * The device for a piece of work, opened again if it failed and was left alone long enough (struct runner_backoff).
 * @param err  out: why there is none; 0: it is left alone; -EINPROGRESS: a live device is being opened. Another error
 * is to be reported by sst_runner_fail().
 * @return NULL: there is none for this piece
 */
struct sst_gpu *sst_runner_take(struct sst_runner *s, struct sst_runner_user *user, int *err);

/** Message of the last error of a live device; "": none. */
const char *sst_runner_why(const struct sst_runner *s);

/** A piece of work was done; that a live device works again is logged. @param phrase  of the work, see struct
 * sst_runner_user */
void sst_runner_succeed(struct sst_runner_user *user, const char *phrase);

/** The device failed: all users drop their buffers, and it is closed. @return pieces of work until it is opened again
 */
int sst_runner_fail(struct sst_runner *s);

/** sst_runner_fail(), noted in the report of a kind of work and logged, of a live device only if it did not fail
 * before.
 * @param phrase  of the work, see struct sst_runner_user @param why  "": that of the error */
void sst_runner_report_failure(struct sst_runner_user *user, const char *phrase, int err, const char *why);

/** Errors are kept for sst_runner_why(), and a device is opened beside the work. */
bool sst_runner_is_live(const struct sst_runner *s);

/** Let the other users drop their buffers, and views that this piece of work does not use. @return true if this freed
 * memory */
bool sst_runner_make_room(struct sst_runner *s, const struct sst_runner_user *user);

/** Planes of views, which stay from one kind of work to the next. They are gone when the device is closed. */
struct sst_step_planes *sst_runner_planes(struct sst_runner *s);

/** The device that is open, for buffers that are left; NULL: it failed. */
struct sst_gpu *sst_runner_device(struct sst_runner *s);

#endif
