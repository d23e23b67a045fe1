/* pipeline/step/step_internal.h - memory of a device that steps share. */
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

/** An item in work. */
struct sst_run {
    struct sst_runner_user *user;
    struct runner_memory *memory; /* of the device */
    struct sst_step_report *report;
    struct sst_gpu *gpu;
    const struct sst_step *step;
    void *job;
    int err;
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

#endif
