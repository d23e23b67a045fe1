/* A device without a driver: memory of the host, and shaders that compute nothing, so that steps are computed on the CPU
 * instead. It fails when it is asked to: scheduling, fallback and errors are tested anywhere.
 *
 * Faults: lost=N the N-th dispatch finds the device lost; timeout=N it does not answer; memory=N MiB of it all there
 * is; buffer=N KiB is the largest buffer; wrong=N the results of the N-th dispatch are wrong.
 * dot=1, matrix=1, subgroup=1: it has what these variants need; 2: it is slow. known=1: it has passed all comparisons. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "base/mem.h"
#include "pipeline/gpu/gpu_internal.h"

enum fault {
    FAULT_LOST,
    FAULT_TIMEOUT,
    FAULT_MEMORY,
    FAULT_BUFFER,
    FAULT_WRONG,
    HAS_DOT,
    HAS_MATRIX,
    HAS_SUBGROUP,
    IS_KNOWN,
    FAULTS
};

static const char *const fault_names[FAULTS] = { "lost", "timeout", "memory",   "buffer", "wrong",
                                                 "dot",  "matrix",  "subgroup", "known" };

struct dummy {
    struct sst_gpu gpu; /* first */
    long fault[FAULTS]; /* 0: not asked for */
    long dispatches;
    bool wrong; /* since sst_gpu_dummy_was_wrong() */
};

static atomic_long closed; /* dispatches of the device that was closed last */

struct dummy_buffer {
    struct sst_gpu_buffer buffer; /* first */
    uint8_t *data;
};

static uint8_t *data_of(struct sst_gpu_buffer *b)
{
    return ((struct dummy_buffer *)b)->data;
}

static int create(struct sst_gpu *g, struct sst_gpu_buffer **out, size_t bytes)
{
    struct dummy_buffer *b = calloc(1, sizeof(*b));

    (void)g;
    if (!b)
        return -ENOMEM;
    b->data = sst_mem_alloc(bytes, 1);
    if (!b->data) {
        free(b);
        return -ENOMEM;
    }
    *out = &b->buffer;
    return 0;
}

static void destroy(struct sst_gpu *g, struct sst_gpu_buffer *b)
{
    (void)g;
    sst_mem_free(data_of(b));
    free(b);
}

static int compile(struct sst_gpu *g, enum sst_gpu_shader shader)
{
    (void)g;
    (void)shader;
    return 0;
}

static int upload(struct sst_gpu *g, struct sst_gpu_buffer *b, size_t offset, const void *data, size_t bytes)
{
    (void)g;
    memcpy(data_of(b) + offset, data, bytes);
    return 0;
}

static int download(struct sst_gpu *g, void *data, struct sst_gpu_buffer *b, size_t offset, size_t bytes)
{
    (void)g;
    memcpy(data, data_of(b) + offset, bytes);
    return 0;
}

static int dispatch(struct sst_gpu *g, const struct sst_gpu_work *work SST_UNUSED)
{
    struct dummy *d = (struct dummy *)g;

    d->dispatches++;
    if (d->dispatches == d->fault[FAULT_LOST])
        return -ENODEV;
    if (d->dispatches == d->fault[FAULT_TIMEOUT])
        return -ETIMEDOUT;
    d->wrong = d->wrong || d->dispatches == d->fault[FAULT_WRONG];
    return 0;
}

static int span_create(struct sst_gpu *g, struct sst_gpu_span **out, size_t bytes)
{
    struct sst_gpu_span *s = calloc(1, sizeof(*s));

    (void)g;
    if (!s)
        return -ENOMEM;
    *s = (struct sst_gpu_span){ sst_mem_alloc(bytes, 1), bytes };
    if (!s->data) {
        free(s);
        return -ENOMEM;
    }
    *out = s;
    return 0;
}

static void span_destroy(struct sst_gpu *g, struct sst_gpu_span *s)
{
    (void)g;
    sst_mem_free(s->data);
    free(s);
}

static int upload_span(struct sst_gpu *g, struct sst_gpu_buffer *b, size_t offset, const struct sst_gpu_span *s,
                       size_t from, size_t bytes)
{
    return upload(g, b, offset, (const uint8_t *)s->data + from, bytes);
}

static int copy(struct sst_gpu *g, struct sst_gpu_buffer *to, size_t to_offset, struct sst_gpu_buffer *from,
                size_t from_offset, size_t bytes)
{
    (void)g;
    memcpy(data_of(to) + to_offset, data_of(from) + from_offset, bytes);
    return 0;
}

static int fill(struct sst_gpu *g, struct sst_gpu_buffer *b, size_t offset, size_t bytes, uint32_t word)
{
    (void)g;
    for (size_t i = 0; i < bytes; i += sizeof(word))
        memcpy(data_of(b) + offset + i, &word, sizeof(word));
    return 0;
}

static int wait_done(struct sst_gpu *g)
{
    (void)g;
    return 0;
}

static void close_dummy(struct sst_gpu *g)
{
    closed = ((struct dummy *)g)->dispatches;
    free(g);
}

static const struct gpu_ops ops = { create,      destroy,     compile,      upload,      download, dispatch, wait_done,
                                    close_dummy, span_create, span_destroy, upload_span, copy,     fill };

bool sst_gpu_is_dummy(const struct sst_gpu *g)
{
    return g->ops == &ops;
}

bool gpu_dummy_is_known(const struct sst_gpu *g)
{
    return sst_gpu_is_dummy(g) && ((const struct dummy *)g)->fault[IS_KNOWN];
}

bool sst_gpu_dummy_was_wrong(struct sst_gpu *g)
{
    struct dummy *d = (struct dummy *)g;
    const bool wrong = sst_gpu_is_dummy(g) && d->wrong;

    if (wrong)
        d->wrong = false;
    return wrong;
}

long sst_gpu_dummy_dispatches(void)
{
    return closed;
}

static int read_faults(struct dummy *d, const char *text)
{
    for (const char *at = text; *at;) {
        char word[32];
        long value;
        int used = 0, i;

        if (sscanf(at, "%31[a-z]=%ld%n", word, &value, &used) != 2 || value < 1 || (at[used] && at[used] != ','))
            return -EINVAL;
        for (i = 0; i < FAULTS && strcmp(word, fault_names[i]); i++)
            ;
        if (i == FAULTS)
            return -EINVAL;
        d->fault[i] = value;
        at += used + (at[used] == ',');
    }
    return 0;
}

static void set_abilities(struct sst_gpu_info *info, long dot, long matrix, long subgroup)
{
    if (subgroup)
        info->abilities |= SST_GPU_SUBGROUP;
    if (dot)
        info->abilities |= SST_GPU_DOT;
    if (dot == 1)
        info->abilities |= SST_GPU_DOT_FAST;
    if (matrix == 1)
        info->abilities |= SST_GPU_MATRIX_FAST;
    if (matrix) {
        info->abilities |= SST_GPU_MATRIX;
        info->matrix = (struct sst_gpu_matrix){ 16, 16, 32, 32 };
    }
}

int gpu_dummy_open(struct sst_gpu **out, const char *faults)
{
    struct dummy *d = calloc(1, sizeof(*d));

    if (!d) {
        sst_log_error("not enough memory for a device");
        return -ENOMEM;
    }
    if (read_faults(d, faults)) {
        free(d);
        sst_log_error("dummy device: `%s` is not a list of lost=N, timeout=N, memory=MIB, buffer=KIB, wrong=N, dot=1, "
                      "matrix=1, subgroup=1, known=1",
                      faults);
        return -EINVAL;
    }
    d->gpu.ops = &ops;
    d->gpu.info =
        (struct sst_gpu_info){ "dummy", "C reference", SST_GPU_SOFTWARE, (uint64_t)1 << 34, (uint64_t)1 << 31 };
    if (d->fault[FAULT_MEMORY]) /* three quarters of it are used */
        d->gpu.info.memory_bytes = (uint64_t)d->fault[FAULT_MEMORY] << 20;
    if (d->fault[FAULT_BUFFER])
        d->gpu.info.buffer_bytes = (uint64_t)d->fault[FAULT_BUFFER] << 10;
    set_abilities(&d->gpu.info, d->fault[HAS_DOT], d->fault[HAS_MATRIX], d->fault[HAS_SUBGROUP]);
    *out = &d->gpu;
    return 0;
}
