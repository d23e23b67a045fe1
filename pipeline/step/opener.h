/* pipeline/step/opener.h - a device that is opened and tested on a thread of its own, while its owner goes on without.
 */
#ifndef SST_PIPELINE_STEP_OPENER_H
#define SST_PIPELINE_STEP_OPENER_H

#include "base/log.h"
#include "pipeline/gpu/gpu.h"

struct sst_runner_opener; /* opaque; one thread at a time */

/** A device and its work. */
struct sst_runner_opening {
    const char *name; /* as of sst_gpu_open() */
    struct sst_gpu_config cfg;
    const enum sst_gpu_shader *shaders; /* to prepare; static */
    size_t needed,
        count;        /* the device must run the first ones; the others may be refused, and are tested now, not later */
    const char *work; /* static; as of sst_gpu_open_for() */
};

/**
 * Open a device without waiting for it: the first call begins, and waits 50 ms at most, later ones look.
 *
 * @param opener  in and out: NULL, or the value after the call before; NULL after all but -EINPROGRESS
 * @param what  device; read by the first call
 * @param gpu  out, when 0
 * @param why  out, after an error: the message of sst_gpu_open_for(), which is not logged; "": nothing
 * @return -EINPROGRESS; else as sst_gpu_open_for(), or -ENOMEM or -EAGAIN (no thread)
 */
SST_MUST_CHECK int sst_runner_open_beside(struct sst_runner_opener **opener, const struct sst_runner_opening *what,
                                          struct sst_gpu **gpu, char why[SST_LOG_MAX]);

/** Waits for the thread; its device is closed. NULL is fine. */
void sst_runner_opener_destroy(struct sst_runner_opener *o);

#endif
