/* Choice of a device, limits of its memory, its shaders and their variants; the rest is passed on to the back end. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE /* strcasestr */
#include "pipeline/gpu/gpu.h"

#include <assert.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "pipeline/gpu/gpu_internal.h"

#define TIMEOUT_MS          20000
#define SOFTWARE_TIMEOUT_MS 600000 /* it shares the CPU with everything else */

/* --- choice ------------------------------------------------------------------------------------------------------- */

static bool faster(const struct sst_gpu_info *a, const struct sst_gpu_info *b)
{
    return a->kind != b->kind ? a->kind > b->kind : a->memory_bytes > b->memory_bytes;
}

/* Indices of the devices, the fastest first. */
static int list_in_order(struct sst_gpu_info info[SST_GPU_DEVICES], int order[SST_GPU_DEVICES])
{
    const int n = gpu_vulkan_list(info);

    for (int i = 0; i < n; i++) {
        int at = i;

        for (; at > 0 && faster(&info[i], &info[order[at - 1]]); at--)
            order[at] = order[at - 1];
        order[at] = i;
    }
    return n;
}

int sst_gpu_list(struct sst_gpu_info info[SST_GPU_DEVICES])
{
    struct sst_gpu_info found[SST_GPU_DEVICES];
    int order[SST_GPU_DEVICES];
    const int n = list_in_order(found, order);

    for (int i = 0; i < n; i++)
        info[i] = found[order[i]];
    return n;
}

static void log_missing(const char *name, const struct sst_gpu_info *info, const int *order, int n)
{
    char list[512] = "";

    for (int i = 0; i < n && strlen(list) + SST_GPU_NAME < sizeof(list); i++)
        snprintf(list + strlen(list), sizeof(list) - strlen(list), "%s`%s`", i ? ", " : "", info[order[i]].name);
    if (!WITH_VULKAN)
        sst_log_error("no device `%s`: this build has no Vulkan; leave out --device, or build with libvulkan-dev and "
                      "glslang-tools",
                      name);
    else if (!n)
        sst_log_error("no device `%s`: no Vulkan driver answers; install the driver of the GPU, or leave out --device",
                      name);
    else if (!strcmp(name, "gpu"))
        sst_log_error("no GPU can be opened; software devices are used only by name: %s", list);
    else
        sst_log_error("no device `%s`; this machine has %s", name, list);
}

/* The configuration, and passes of earlier runs. */
static void set_up(struct sst_gpu *g, const struct sst_gpu_config *cfg)
{
    g->cfg = cfg ? *cfg : (struct sst_gpu_config){ 0 };
    if (!g->cfg.memory_bytes)
        g->cfg.memory_bytes = g->cfg.memory_percent ? g->info.memory_bytes / 100 * (uint64_t)g->cfg.memory_percent
                                                    : g->info.memory_bytes / 4 * 3;
    if (!g->cfg.timeout_ms)
        g->cfg.timeout_ms =
            (g->info.kind == SST_GPU_SOFTWARE ? SOFTWARE_TIMEOUT_MS : TIMEOUT_MS) / (g->cfg.prompt ? 10 : 1);
    gpu_verdicts_open(g);
}

/* Open the first device that matches. @param name  NULL: the first real one that can be opened */
static int open_vulkan(struct sst_gpu **out, const char *name, const struct sst_gpu_info *info, const int *order, int n)
{
    int err = -ENOENT;

    for (int i = 0; i < n && err && !(name && err != -ENOENT); i++) {
        const struct sst_gpu_info *is = &info[order[i]];

        if (name ? *name && (strcasestr(is->name, name) || strcasestr(is->driver, name)) : is->kind != SST_GPU_SOFTWARE)
            err = gpu_vulkan_open(out, order[i]);
    }
    return err && !name ? -ENOENT : err;
}

/* A name that there is not is one for plain shaders. */
static void check_variant(void)
{
    const char *named = getenv("SST_GPU_VARIANT");
    bool known = !named || !*named || !strcmp(named, "plain");

    for (int i = 0; i < SST_GPU_SHADERS && !known; i++)
        known = gpu_shaders[i].needs && !strcmp(named, gpu_shaders[i].variant);
    if (!known)
        sst_log_warning("unknown SST_GPU_VARIANT=%s; using plain shaders (plain, dot, matrix, subgroup)", named);
}

int sst_gpu_open(struct sst_gpu **out, const char *name, const struct sst_gpu_config *cfg)
{
    const bool any = !strcmp(name, "auto") || !strcmp(name, "gpu");
    struct sst_gpu_info info[SST_GPU_DEVICES];
    int order[SST_GPU_DEVICES], n, err;

    check_variant();
    if (!strcmp(name, "dummy") || !strncmp(name, "dummy:", 6)) {
        err = gpu_dummy_open(out, name[5] ? name + 6 : "");
    } else {
        n = list_in_order(info, order);
        err = open_vulkan(out, any ? NULL : name, info, order, n);
        if (err == -ENOENT && strcmp(name, "auto"))
            log_missing(name, info, order, n);
    }
    if (!err)
        set_up(*out, cfg);
    return err;
}

void sst_gpu_close(struct sst_gpu *g)
{
    if (!g)
        return;
    gpu_verdicts_close(g);
    g->ops->close(g);
}

const struct sst_gpu_info *sst_gpu_get_info(const struct sst_gpu *g)
{
    return &g->info;
}

uint64_t sst_gpu_free_bytes(const struct sst_gpu *g)
{
    return g->cfg.memory_bytes > g->used_bytes ? g->cfg.memory_bytes - g->used_bytes : 0;
}

/* --- shaders ------------------------------------------------------------------------------------------------------ */

/* What a device that is lost is asked for again fails at once. */
static int note(struct sst_gpu *g, int err)
{
    if (err && err != -ENOMEM && !g->lost)
        g->lost = err;
    return err;
}

/* Variants that a device was lost with in their comparison. */
static SST_ATOMIC(bool) deadly[SST_GPU_SHADERS];

void sst_gpu_refuse(struct sst_gpu *g, enum sst_gpu_shader shader, int err)
{
    const char *name = gpu_shaders[shader].name;

    g->ready[shader] = GPU_REFUSED;
    if (err == -ENOTSUP)
        sst_log_warning("%s: the shader `%s` is refused: its results differ from the reference", g->info.name, name);
    else
        sst_log_warning("%s: the shader `%s` cannot be tested: %s", g->info.name, name, sst_gpu_error(err));
    if (sst_gpu_is_variant(shader) && err != -ENOTSUP && err != -ENOMEM)
        deadly[shader] = true;
}

int sst_gpu_deadly(void)
{
    int n = 0;

    for (int i = 0; i < SST_GPU_SHADERS; i++)
        n += deadly[i];
    return n;
}

int sst_gpu_prepare(struct sst_gpu *g, enum sst_gpu_shader shader)
{
    int err;

    if (g->lost || g->ready[shader] == GPU_READY)
        return g->lost;
    if (g->ready[shader] == GPU_REFUSED || !sst_gpu_can(&g->info, shader))
        return -ENOTSUP;
    err = g->ops->compile(g, shader);
    if (err == -EIO && sst_gpu_is_variant(shader)) {
        g->ready[shader] = GPU_REFUSED;
        sst_log_warning("%s: the shader `%s` is refused: the driver does not compile it", g->info.name,
                        gpu_shaders[shader].name);
        return -ENOTSUP;
    }
    if (!err)
        g->ready[shader] = GPU_READY;
    return note(g, err);
}

/* True if a variant is to be used: the one that the environment names, else what is fast on the device. */
static bool is_wanted(const struct sst_gpu *g, enum sst_gpu_shader shader)
{
    const char *named = getenv("SST_GPU_VARIANT");

    if (!sst_gpu_can(&g->info, shader) || deadly[shader])
        return false;
    return named && *named ? !strcmp(named, gpu_shaders[shader].variant) : sst_gpu_is_fast(&g->info, shader);
}

bool sst_gpu_wants_variant(const struct sst_gpu *g, enum sst_gpu_shader shader, enum sst_gpu_shader variant)
{
    return gpu_shaders[variant].needs && gpu_shaders[variant].of == shader && is_wanted(g, variant) &&
           g->ready[variant] != GPU_REFUSED;
}

int sst_gpu_prepare_fastest(struct sst_gpu *g, enum sst_gpu_shader shader, enum sst_gpu_shader *out)
{
    for (int i = SST_GPU_SHADERS - 1; i >= 0; i--) { /* the fastest last */
        int err;

        if (!sst_gpu_wants_variant(g, shader, (enum sst_gpu_shader)i))
            continue;
        err = sst_gpu_prepare(g, (enum sst_gpu_shader)i);
        if (!err)
            *out = (enum sst_gpu_shader)i;
        if (err != -ENOTSUP && err != -ENOMEM)
            return err;
    }
    *out = shader;
    return sst_gpu_prepare(g, shader);
}

/* --- passed on ---------------------------------------------------------------------------------------------------- */

int sst_gpu_buffer_create(struct sst_gpu *g, struct sst_gpu_buffer **out, size_t bytes)
{
    int err = g->lost;

    bytes = bytes ? bytes : 4;
    if (!err && (bytes > sst_gpu_free_bytes(g) || bytes > g->info.buffer_bytes))
        err = -ENOMEM;
    err = err ? err : note(g, g->ops->create(g, out, bytes));
    if (err)
        return err;
    (*out)->bytes = bytes;
    g->used_bytes += bytes;
    return 0;
}

void sst_gpu_buffer_destroy(struct sst_gpu *g, struct sst_gpu_buffer *b)
{
    if (!b)
        return;
    g->used_bytes -= b->bytes;
    g->ops->destroy(g, b);
}

int sst_gpu_upload(struct sst_gpu *g, struct sst_gpu_buffer *b, size_t offset, const void *data, size_t bytes)
{
    return g->lost ? g->lost : note(g, g->ops->upload(g, b, offset, data, bytes));
}

int sst_gpu_download(struct sst_gpu *g, void *data, struct sst_gpu_buffer *b, size_t offset, size_t bytes)
{
    return g->lost ? g->lost : note(g, g->ops->download(g, data, b, offset, bytes));
}

int sst_gpu_span_create(struct sst_gpu *g, struct sst_gpu_span **out, size_t bytes)
{
    return g->lost ? g->lost : note(g, g->ops->span_create(g, out, bytes ? bytes : 4));
}

void sst_gpu_span_destroy(struct sst_gpu *g, struct sst_gpu_span *s)
{
    if (s)
        g->ops->span_destroy(g, s);
}

void *sst_gpu_span_data(const struct sst_gpu_span *s)
{
    return s->data;
}

int sst_gpu_upload_span(struct sst_gpu *g, struct sst_gpu_buffer *b, size_t offset, const struct sst_gpu_span *s,
                        size_t from, size_t bytes)
{
    assert(from <= s->bytes && bytes <= s->bytes - from && offset <= b->bytes && bytes <= b->bytes - offset);
    return g->lost ? g->lost : note(g, g->ops->upload_span(g, b, offset, s, from, bytes));
}

int sst_gpu_copy(struct sst_gpu *g, struct sst_gpu_buffer *to, size_t to_offset, struct sst_gpu_buffer *from,
                 size_t from_offset, size_t bytes)
{
    assert(from_offset <= from->bytes && bytes <= from->bytes - from_offset && to_offset <= to->bytes &&
           bytes <= to->bytes - to_offset);
    return g->lost ? g->lost : note(g, g->ops->copy(g, to, to_offset, from, from_offset, bytes));
}

int sst_gpu_fill(struct sst_gpu *g, struct sst_gpu_buffer *b, size_t offset, size_t bytes, uint32_t word)
{
    assert(offset <= b->bytes && bytes <= b->bytes - offset);
    return g->lost ? g->lost : note(g, g->ops->fill(g, b, offset, bytes, word));
}

int sst_gpu_dispatch(struct sst_gpu *g, const struct sst_gpu_work *work)
{
    assert(work->push_bytes <= SST_GPU_PUSH);
    if (g->lost)
        return g->lost;
    if (g->ready[work->shader] != GPU_READY) {
        const int err = sst_gpu_prepare(g, work->shader);

        if (err)
            return err;
    }
    return note(g, g->ops->dispatch(g, work));
}

int sst_gpu_wait(struct sst_gpu *g)
{
    return g->lost ? g->lost : note(g, g->ops->wait(g));
}
