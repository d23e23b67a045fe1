/* pipeline/step/run.h - steps of the method, described once: the work on an item on threads and on a device,
 * and its results. sst_run() does the rest: uploads, memory, fallback to the CPU, sharing with other processes,
 * times.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_STEP_RUN_H
#define SST_PIPELINE_STEP_RUN_H

#include "base/thread.h"
#include "pipeline/gpu/check.h"
#include "pipeline/lightfield/share.h"
#include "pipeline/lightfield/shift.h"
#include "pipeline/step/runner.h"

struct sst_run; /* an item of a step on a device; one thread */

/** Work on an item by the functions below. */
typedef void sst_step_dispatch_fn(struct sst_run *r, void *job, int item);
/** Write SST_PLANE_DERIVED of a view, of SST_PLANE_BEFORE and planes of colours of this view. */
typedef void sst_step_derive_fn(struct sst_run *r, void *job, int view, struct sst_gpu_range to);

/** A step over the views of a light field. Items are its views, or others if the step changes no planes. */
struct sst_step {
    const char *name; /* for messages: "carrying" */
    unsigned stages;  /* bits of struct sst_step_report, `stages_on_cpu` */
    /** False for views that the step leaves alone. */
    bool (*wants)(const void *job, int view);
    /** Maps of a view on the host as they were before the step, for planes that are not current. */
    void (*source)(const void *job, int view, struct sst_plane_source *out);
    /** Before the first item on the CPU: make what only the CPU reads. NULL: nothing. @return 0 or an error of `cpu` */
    int (*host)(void *job);
    /** The definition: a view on the CPU. @return 0, -ENOMEM, -ECANCELED */
    sst_work_fn *cpu;
    int counter; /* of struct sst_step_report that counts the items */
    /** Results of the work on a view, for other processes, and to be compared by sst_step_check(). */
    sst_share_maps_fn *writes;
    /** True if results of two jobs are as near as they must be; NULL: their bytes are equal. */
    bool (*same)(const void *device, const void *host, int view);
    unsigned changes; /* bits by enum sst_step_plane: planes of the view that the step changes */
    int levels;       /* by which pictures and maps of 8 bits may differ from those of the CPU; 0: the same bytes */
    /** A job of SST_STEP_SAMPLES small views of random maps, for sst_step_check(): both ways can begin, without `host`.
     * @param seed  from 1 on @return NULL: no memory */
    void *(*sample)(uint32_t seed);
    int seeds;         /* samples; 0: 2 */
    int sample_pixels; /* of a view; 0: SST_STEP_SAMPLE_WIDTH * SST_STEP_SAMPLE_HEIGHT */
    void (*sample_free)(void *job);
};

/** A step on a device: a user of a runner has a list of these, the last one empty. */
struct sst_step_shaders {
    const struct sst_step *step;
    sst_step_dispatch_fn *dispatch; /* the same as `cpu`; it writes the same maps */
    sst_step_derive_fn *derive;     /* NULL: no derived plane */
    /** Why no shader does this job, for the report; NULL, also as the function: they do. */
    const char *(*refuses)(const void *job);
};

#define SST_STEP_SAMPLES       9
#define SST_STEP_SAMPLE_WIDTH  53
#define SST_STEP_SAMPLE_HEIGHT 29

/** Random bits of a sample: 24. */
static inline uint32_t sst_step_random(uint32_t *state)
{
    *state = *state * 1664525U + 1013904223U;
    return *state >> 8;
}

/**
 * Compare the results of a step on a device with its results on the CPU, on samples of some seeds. Under the lock of
 * the device; its planes stay as they are.
 * @param user  whose buffers make room; or NULL
 * @return 0, -ENOTSUP (they differ; logged with the name of the step), or an error of the device
 */
SST_MUST_CHECK int sst_step_check(struct sst_runner_user *user, struct sst_gpu *g, const struct sst_step_shaders *s);

/** Result of a run on a device, that stays there. */
struct sst_run_result {
    struct sst_gpu *gpu;
    struct sst_gpu_buffer *buffer;
    size_t at; /* words */
};

struct sst_run_options {
    struct sst_share *share;         /* with other processes, each with the device that it has; or NULL */
    int threads, block;              /* block: as of sst_share_blocks() */
    const SST_ATOMIC(bool) * cancel; /* or NULL */
};

/**
 * Run a step over `items` views: on the device while it has memory and does not fail, the rest on threads.
 *
 * Every fallback to the CPU is noted in the report and logged with its reason. The results are the same bytes anywhere.
 * @param user  of a device; NULL, or without shaders of the step: on the CPU
 * @return 0, -ENOMEM, -ECANCELED, or an error of `cpu` or of sst_share_blocks()
 */
SST_MUST_CHECK int sst_run(struct sst_runner_user *user, const struct sst_step *step, void *job, int items,
                           const struct sst_run_options *o);

/**
 * Run one item of a step on the device, for users that go on from its errors in their own way: between
 * sst_runner_take() and sst_runner_succeed() or sst_runner_fail(), under the lock.
 * @return 0, -ENOMEM, -EOVERFLOW, an error of the device or another one that the step notes, or of `cpu` on the dummy
 * device
 */
SST_MUST_CHECK int sst_run_item(struct sst_runner_user *user, const struct sst_step *step, void *job, int item);

/* The functions below do nothing without a user. */

/** The CPU has changed planes of a view (bits). */
void sst_run_changed(struct sst_runner_user *user, int view, unsigned planes);

/** Note work without a step that the CPU has done. @param stages  as of struct sst_step @param why  or NULL */
void sst_run_note(struct sst_runner_user *user, unsigned stages, const char *why);

/** True if the runner may place a job of a step elsewhere than on threads. */
bool sst_run_places(const struct sst_runner_user *user, const struct sst_step *step, const void *job);

/** Items on the CPU, as the report counts them. */
int64_t sst_run_on_cpu(const struct sst_runner_user *user, int counter);

/** Keep planes of the views of a light field from step to step, none current but its colours; planes of
 * another one are freed. @param pixels  [SST_PLANE_MAP + 1] of a view */
void sst_run_claim(struct sst_runner_user *user, const void *of, int views, const size_t *pixels);

/** The same for views of which no light field has claimed planes: until the next call. */
void sst_run_adopt(struct sst_runner_user *user, const void *of, int views, size_t pixels);

/** Free planes that are claimed for a light field. */
void sst_run_forget(struct sst_runner_user *user, const void *of);

/* For the work on a device: after an error, the functions below do nothing, and the view is left to the CPU. */

/** Note an error: -ENOMEM, -EOVERFLOW (views too far apart for numbers of 32 bits), -ENODATA (a view's features are
 * lost), or one of the device. */
void sst_run_fail(struct sst_run *r, int err);

/** Leave the view to the CPU for a reason that is no fault of the device, in place of -ENOMEM as well: noted, and
 * logged of a live device only. */
void sst_run_leave(struct sst_run *r, const char *why);
bool sst_run_failed(const struct sst_run *r);

/** A plane of a view, current. */
struct sst_gpu_range sst_run_plane(struct sst_run *r, enum sst_step_plane plane, int view);

/** A plane of these views, current, as one buffer: sst_run_first() says where each begins. At most once for a plane,
 * before sst_run_plane() of it; SST_PLANE_DERIVED first. */
struct sst_gpu_range sst_run_planes(struct sst_run *r, enum sst_step_plane plane, const int *view, int views);

/** Words before the words of a view that is current. */
uint32_t sst_run_first(struct sst_run *r, enum sst_step_plane plane, int view);

/** The item does not use a plane of a view any more: others may have its place. */
void sst_run_release(struct sst_run *r, enum sst_step_plane plane, int view);

/** A plane of a view that the step writes as a whole. */
struct sst_gpu_range sst_run_output(struct sst_run *r, enum sst_step_plane plane, int view);

/**
 * Rows of an item that are computed at once: all at first. Where memory lacks, the item begins again with half as many.
 * @param rows  of the item @param unit  least rows; all bands but the last one are a multiple of it
 */
int sst_run_rows(struct sst_run *r, int rows, int unit);

#define SST_RUN_SCRATCH 28

/** Scratch memory, undefined at first. @param which  below SST_RUN_SCRATCH */
struct sst_gpu_range sst_run_scratch(struct sst_run *r, int which, size_t bytes);

/** The same with contents; bytes is a multiple of 4. */
struct sst_gpu_range sst_run_upload(struct sst_run *r, int which, const void *data, size_t bytes);

/** Memory for the user, who frees it in `drop`. @return NULL after an error */
struct sst_gpu_buffer *sst_run_buffer(struct sst_run *r, size_t bytes);

/** Set the contents of a range; bytes is a multiple of 4. */
void sst_run_write(struct sst_run *r, struct sst_gpu_range to, const void *data, size_t bytes);

/** Memory of the host for words to upload, until the next function below. @return NULL after an error */
uint32_t *sst_run_words(struct sst_run *r, size_t words);

/** Copy bytes from a range to another one, of another buffer. */
void sst_run_copy(struct sst_run *r, struct sst_gpu_range to, struct sst_gpu_range from, size_t bytes);

/** Set words of a range from its word `first` on. */
void sst_run_fill(struct sst_run *r, struct sst_gpu_range to, size_t first, size_t words, uint32_t word);

/** The fastest variant of a shader that the device has and that gives the results of the CPU. */
enum sst_gpu_shader sst_run_fastest(struct sst_run *r, enum sst_gpu_shader shader);

/** Dispatch a shader. @param work  without buffers @param range  [ranges] its buffers, by binding */
void sst_run_dispatch(struct sst_run *r, struct sst_gpu_work work, const struct sst_gpu_range *range, int ranges);

/** sst_run_dispatch() of x * y * z groups; ranges follow. @param constants  pointer to the structure of the shader */
#define SST_RUN_GROUPS(r, number, constants, x, y, z, ...)                                                             \
    sst_run_dispatch(                                                                                                  \
        r,                                                                                                             \
        (struct sst_gpu_work){ .shader = number,                                                                       \
                               .push = constants,                                                                      \
                               .push_bytes = sizeof(*(constants)) +                                                    \
                                             0 * sizeof(char[sizeof(*(constants)) <= SST_GPU_PUSH ? 1 : -1]),          \
                               .groups = { (uint32_t)(x), (uint32_t)(y), (uint32_t)(z) } },                            \
        (const struct sst_gpu_range[]){ __VA_ARGS__ },                                                                 \
        sizeof((const struct sst_gpu_range[]){ __VA_ARGS__ }) / sizeof(struct sst_gpu_range))

/** ... over the pixels of a view, by groups of 32 x 8. */
#define SST_RUN_PIXELS(r, shader, push, width, height, layers, ...)                                                    \
    SST_RUN_GROUPS(r, shader, push, ((width) + 31) / 32, ((height) + 7) / 8, layers, __VA_ARGS__)

/** Words of a range, once all that was dispatched is done; they stay until the next call. @return NULL after an error
 */
const uint32_t *sst_run_fetch(struct sst_run *r, struct sst_gpu_range from, size_t words);

/** The contents of a range, once all that was dispatched is done. @param data  out; as it was after an error */
void sst_run_read(struct sst_run *r, void *data, struct sst_gpu_range from, size_t bytes);

/** The device, for other work; its errors are to be noted by sst_run_fail(). */
struct sst_gpu *sst_run_gpu(const struct sst_run *r);

/** Where a disparity puts a pixel, for shaders. @return 0, -EOVERFLOW: it does not fit 32 bits */
SST_MUST_CHECK int sst_step_shift(struct sst_gpu_shift *out, struct sst_shift across, struct sst_shift down);

#endif
