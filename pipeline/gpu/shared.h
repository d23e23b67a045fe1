/* pipeline/gpu/shared.h - one opening of a device for several kinds of work, which fails and is opened again for all.
 */
#ifndef SST_PIPELINE_GPU_SHARED_H
#define SST_PIPELINE_GPU_SHARED_H

#include "base/log.h"
#include "pipeline/gpu/gpu.h"
#include "pipeline/gpu/resident.h"

struct sst_gpu_shared; /* any thread, under its lock */

/** A kind of work. Lives from sst_gpu_shared_join() to sst_gpu_shared_leave(). */
struct sst_gpu_user {
    /* set before it joins */
    const enum sst_gpu_shader *shaders; /* that it needs */
    size_t count;
    size_t tested;           /* that follow them, may be refused, and are tested by an opening beside the work */
    const char *work;        /* what the device is to do, for messages: "match" */
    void (*drop)(void *arg); /* free all buffers, under the lock: the device is closed, or others need the memory */
    void *arg;
    /* of the shared device */
    struct sst_gpu_user *next;
    int64_t opening; /* in which its shaders were prepared */
};

/**
 * Open a device.
 *
 * @param name          as of sst_gpu_open(), or "cpu": *out is NULL then; "auto" without a GPU as well
 * @param memory_bytes  that all users together may use of the device's memory; 0: three quarters
 * @return 0 or an error of sst_gpu_open(); logged
 */
SST_MUST_CHECK int sst_gpu_shared_create(struct sst_gpu_shared **out, const char *name, uint64_t memory_bytes);

/**
 * The same for the live picture: waits are short (struct sst_gpu_config, `prompt`), a device that cannot be opened now
 * is tried again, beside the work (opener.h), and errors are not logged but kept for sst_gpu_shared_why(). One kind of
 * work.
 *
 * @param percent  of the device's memory, where memory_bytes is 0
 * @return 0, also where there is no such device: sst_gpu_shared_join() returns why; -ENOMEM (logged)
 */
SST_MUST_CHECK int sst_gpu_shared_create_live(struct sst_gpu_shared **out, const char *name, uint64_t memory_bytes,
                                              int percent);

/** After its last user has left. NULL is fine. */
void sst_gpu_shared_destroy(struct sst_gpu_shared *s);

/** Prepare the shaders of a kind of work. @return 0, -ENOTSUP (one is refused), or an error of the device; logged, but
 * of a live device, whose user joins all the same */
SST_MUST_CHECK int sst_gpu_shared_join(struct sst_gpu_shared *s, struct sst_gpu_user *user);

/** Drop what the user has on the device. */
void sst_gpu_shared_leave(struct sst_gpu_shared *s, struct sst_gpu_user *user);

/* Buffers are created, used and freed under the lock. */
void sst_gpu_shared_lock(struct sst_gpu_shared *s);
void sst_gpu_shared_unlock(struct sst_gpu_shared *s);

/** As it was asked for. */
const char *sst_gpu_shared_name(const struct sst_gpu_shared *s);

/** The device that was opened last. */
const struct sst_gpu_info *sst_gpu_shared_info(const struct sst_gpu_shared *s);

/**
 * The device for a piece of work, opened again if it failed and was left alone long enough (pipeline/gpu/backoff.h).
 * @param err  out: why there is none; 0: it is left alone; -EINPROGRESS: a live device is being opened. Another error
 * is to be reported by sst_gpu_shared_fail().
 * @return NULL: there is none for this piece
 */
struct sst_gpu *sst_gpu_shared_take(struct sst_gpu_shared *s, struct sst_gpu_user *user, int *err);

/** What the last error of a live device said; "": nothing. */
const char *sst_gpu_shared_why(const struct sst_gpu_shared *s);

/** A piece of work was done. */
void sst_gpu_shared_succeed(struct sst_gpu_shared *s);

/** The device failed: all users drop their buffers, and it is closed. @return pieces of work until it is opened again
 */
int sst_gpu_shared_fail(struct sst_gpu_shared *s);

/** Let the other users drop their buffers, and views that this piece of work does not use. @return true if this freed
 * memory */
bool sst_gpu_shared_make_room(struct sst_gpu_shared *s, const struct sst_gpu_user *user);

/** Views that stay from one kind of work to the next. They are gone when the device is closed. */
struct sst_gpu_residents *sst_gpu_shared_residents(struct sst_gpu_shared *s);

/** The device that is open, for buffers that are left; NULL: it failed. */
struct sst_gpu *sst_gpu_shared_device(struct sst_gpu_shared *s);

#endif
