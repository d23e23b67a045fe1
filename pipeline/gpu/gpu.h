/* pipeline/gpu/gpu.h - devices that run compute shaders: chosen by name, memory, work in the order of the calls.
 *
 * Two back ends: Vulkan 1.2, whose loader is opened at run time, and a dummy device that computes nothing and fails on
 * request. How they fit together: docs/design/gpu.md.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_GPU_GPU_H
#define SST_PIPELINE_GPU_GPU_H

#include <stdbool.h>

#include "base/base.h"
#include "shaders.h"

#define SST_GPU_NAME    256 /* bytes of a name, with its NUL */
#define SST_GPU_DEVICES 16  /* devices that are listed at most */
#define SST_GPU_BUFFERS 8   /* buffers that a shader reads and writes at most */
#define SST_GPU_PUSH    128 /* bytes of constants that a shader has at most: every device has them */
#define SST_GPU_ALIGN   256 /* bytes: where a shader's part of a buffer may begin, on every device */

/** Shaders, embedded at build: a file of pipeline/kernels each (scripts/shaders.sh); variants are the last, and the
 * fastest the last of these. */
enum sst_gpu_shader {
#define X(NAME, ...) SST_GPU_##NAME,
#define V(NAME, ...) SST_GPU_##NAME,
    SST_GPU_SHADER_LIST(X) SST_GPU_VARIANT_LIST(V)
#undef X
#undef V
        SST_GPU_SHADERS
};

const char *sst_gpu_shader_name(enum sst_gpu_shader shader);

enum sst_gpu_kind {
    SST_GPU_SOFTWARE = 0, /* runs on the CPU: never chosen except by its name */
    SST_GPU_OTHER = 1,
    SST_GPU_VIRTUAL = 2,
    SST_GPU_INTEGRATED = 3,
    SST_GPU_DISCRETE = 4,
};

const char *sst_gpu_kind_name(enum sst_gpu_kind kind);

/** What a device can do beyond Vulkan 1.2: bits. */
enum sst_gpu_ability {
    SST_GPU_DOT = 1,         /* dot products of four bytes (VK_KHR_shader_integer_dot_product) */
    SST_GPU_DOT_FAST = 2,    /* ... are faster there than products of floats */
    SST_GPU_MATRIX = 4,      /* products of matrices of bytes (VK_KHR_cooperative_matrix) in a shape that can be used */
    SST_GPU_MATRIX_FAST = 8, /* ... are faster there than both: not on software devices */
    SST_GPU_SUBGROUP = 16,   /* subgroups of 32 invocations and more, which read each other's registers */
    SST_GPU_SUBGROUP_FAST = SST_GPU_SUBGROUP,
};

/** Shapes of such products: rows x depth times depth x columns. */
struct sst_gpu_matrix {
    uint32_t rows, columns, depth;
    uint32_t group; /* invocations that compute one */
};

struct sst_gpu_info {
    char name[SST_GPU_NAME];   /* of the device */
    char driver[SST_GPU_NAME]; /* name and version */
    enum sst_gpu_kind kind;
    uint64_t memory_bytes;        /* largest heap of the device */
    uint64_t buffer_bytes;        /* largest buffer */
    uint32_t abilities;           /* enum sst_gpu_ability */
    struct sst_gpu_matrix matrix; /* with SST_GPU_MATRIX */
};

/**
 * List the devices of this machine, the fastest kind first, larger memory first within a kind.
 *
 * Starts the drivers, which takes from 20 ms to a second. Without a loader or a driver the list is empty.
 * @return devices in info, at most SST_GPU_DEVICES
 */
int sst_gpu_list(struct sst_gpu_info info[SST_GPU_DEVICES]);

/** True if a device has what a shader needs. Variants of a shader need more than the shader itself. */
bool sst_gpu_can(const struct sst_gpu_info *info, enum sst_gpu_shader shader);

/** True for a variant that a device can run and that is chosen there by itself. */
bool sst_gpu_is_fast(const struct sst_gpu_info *info, enum sst_gpu_shader shader);

/** True if a shader is a variant: it gives the bytes of another one, by instructions that not every device has. */
bool sst_gpu_is_variant(enum sst_gpu_shader shader);
/* Shares of the device's memory, in percent, of two that use it side by side; their sum is that of one alone. */
#define SST_GPU_PICTURES_PERCENT 56
#define SST_GPU_LABELS_PERCENT   19

struct sst_gpu_config {
    uint64_t memory_bytes; /* that buffers use at most; 0: */
    int memory_percent;    /* of the device's memory; 0: 75 */
    int timeout_ms;        /* limit of one wait; 0: 20 s, on software devices 10 minutes */
    bool test_again;       /* also shaders and steps that have passed */
    bool prompt;           /* short limits of a wait, for live use: by default 2 s, on software devices 60 s */
};

struct sst_gpu; /* one thread at a time */

/**
 * Open a device.
 *
 * @param name  "gpu": the first of sst_gpu_list() that is no software device and can be opened;
 *              "auto": the same, and -ENOENT is not logged; "lavapipe": Mesa's software device; "dummy" or
 *              "dummy:FAULT=N[,FAULT=N...]" (docs/design/gpu.md); else a part of a device's or driver's name
 * @param cfg   NULL: the defaults
 * @return 0, -ENOENT (no such device), -EINVAL (unknown fault), -ENOMEM, -EIO (the driver refuses); logged.
 */
SST_MUST_CHECK int sst_gpu_open(struct sst_gpu **out, const char *name, const struct sst_gpu_config *cfg);

/** Free the device and its buffers. What a device that does not answer still uses is left to the end of the process. */
void sst_gpu_close(struct sst_gpu *g);

const struct sst_gpu_info *sst_gpu_get_info(const struct sst_gpu *g);

/** Bytes that buffers may still use by the configuration. */
uint64_t sst_gpu_free_bytes(const struct sst_gpu *g);

/**
 * Compile a shader; its first dispatch does so, too.
 * @return 0, -ENOTSUP (the device cannot run it, or refuses it), or an error of the device; a warning is logged of a
 *         variant that the driver does not compile
 */
SST_MUST_CHECK int sst_gpu_prepare(struct sst_gpu *g, enum sst_gpu_shader shader);

/**
 * Prepare the fastest variant of a shader that the device has and that was not refused, else the shader itself.
 *
 * SST_GPU_VARIANT=plain, dot, matrix or subgroup in the environment names the variant instead; without it on this
 * device, or if it is refused, the shader itself runs. A variant whose comparison a device did not survive is not used
 * again before the program ends.
 * @param out  the shader to dispatch: same constants and buffers
 * @return as sst_gpu_prepare() of the shader itself
 */
SST_MUST_CHECK int sst_gpu_prepare_fastest(struct sst_gpu *g, enum sst_gpu_shader shader, enum sst_gpu_shader *out);

/** True if sst_gpu_prepare_fastest() of a shader tries this variant: it has the ability, is named or fast, and was not
 * refused. */
bool sst_gpu_wants_variant(const struct sst_gpu *g, enum sst_gpu_shader shader, enum sst_gpu_shader variant);

/** Refuse a shader while g is open; logged. @param err  -ENOTSUP: its results differ; else an error of the device, and
 * a variant that has cost it is not tried again by the process */
void sst_gpu_refuse(struct sst_gpu *g, enum sst_gpu_shader shader, int err);

/** How many variants have cost a device in this process. */
int sst_gpu_deadly(void);

/** True if a comparison of this name was noted as passed, now or in another run of the same build with the same driver,
 * device and CPU. On the dummy device all are, or none (known=1). */
bool sst_gpu_has_passed(const struct sst_gpu *g, const char *test);

/** Note a comparison, for sst_gpu_has_passed(); kept when the device is closed. @param test  its name, one line */
void sst_gpu_note_verdict(struct sst_gpu *g, const char *test, bool passed);

/** True for the dummy device, which computes nothing: its user does. */
bool sst_gpu_is_dummy(const struct sst_gpu *g);

/** True if the dummy device has had the dispatch since the last call that it was asked to be wrong at (wrong=N). */
bool sst_gpu_dummy_was_wrong(struct sst_gpu *g);

/** Dispatches of the dummy device that was closed last, by which its faults count. */
long sst_gpu_dummy_dispatches(void);

struct sst_gpu_buffer; /* memory of the device, undefined at first */

/**
 * The functions below return 0 or
 *   -ENOMEM     no memory on the device, or more than the configuration allows
 *   -ENODEV     the device is lost: close it
 *   -ETIMEDOUT  it did not answer in time, and is lost
 *   -EIO        any other error of the driver, and it is lost
 * and log none of them: callers have a way to go on. Work runs in the order of the calls, at the latest in
 * sst_gpu_wait() or sst_gpu_download().
 */
SST_MUST_CHECK int sst_gpu_buffer_create(struct sst_gpu *g, struct sst_gpu_buffer **out, size_t bytes);
void sst_gpu_buffer_destroy(struct sst_gpu *g, struct sst_gpu_buffer *b);
SST_MUST_CHECK int sst_gpu_upload(struct sst_gpu *g, struct sst_gpu_buffer *b, size_t offset, const void *data,
                                  size_t bytes);
SST_MUST_CHECK int sst_gpu_download(struct sst_gpu *g, void *data, struct sst_gpu_buffer *b, size_t offset,
                                    size_t bytes);

struct sst_gpu_span; /* mapped memory of the host that the device copies from: what is uploaded is written there
                        directly */

/** Not counted as memory of the device; undefined at first. @return 0, -ENOMEM or as above */
SST_MUST_CHECK int sst_gpu_span_create(struct sst_gpu *g, struct sst_gpu_span **out, size_t bytes);
/** NULL is fine. */
void sst_gpu_span_destroy(struct sst_gpu *g, struct sst_gpu_span *s);

/** Its first byte, aligned to SST_ALIGN. Any number of threads may write; reads may be slow. */
void *sst_gpu_span_data(const struct sst_gpu_span *s);

/** Copy `bytes` bytes of a span from `from` on to a buffer from `offset` on, both multiples of 4. They must not be
 * written again before sst_gpu_wait(). */
SST_MUST_CHECK int sst_gpu_upload_span(struct sst_gpu *g, struct sst_gpu_buffer *b, size_t offset,
                                       const struct sst_gpu_span *s, size_t from, size_t bytes);

/** Copy `bytes` bytes between two buffers, or ranges of one that do not overlap; offsets and bytes are multiples of 4.
 */
SST_MUST_CHECK int sst_gpu_copy(struct sst_gpu *g, struct sst_gpu_buffer *to, size_t to_offset,
                                struct sst_gpu_buffer *from, size_t from_offset, size_t bytes);

/** Set `bytes` bytes of a buffer from `offset` on to a word; both are multiples of 4. */
SST_MUST_CHECK int sst_gpu_fill(struct sst_gpu *g, struct sst_gpu_buffer *b, size_t offset, size_t bytes,
                                uint32_t word);

struct sst_gpu_work {
    enum sst_gpu_shader shader;                     /* prepared */
    const void *push;                               /* constants of the shader's own structure; copied */
    size_t push_bytes;                              /* SST_GPU_PUSH at most */
    struct sst_gpu_buffer *buffer[SST_GPU_BUFFERS]; /* by binding; NULL: the shader has none there */
    size_t offset[SST_GPU_BUFFERS];                 /* bytes before its part of each, multiples of SST_GPU_ALIGN */
    uint32_t groups[3];
};
SST_MUST_CHECK int sst_gpu_dispatch(struct sst_gpu *g, const struct sst_gpu_work *work);
SST_MUST_CHECK int sst_gpu_wait(struct sst_gpu *g);

/** "the device is lost" and the like, for messages. */
const char *sst_gpu_error(int err);

#endif
