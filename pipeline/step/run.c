/* Items of a step on a device, the rest on threads. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/step/run.h"

#include <assert.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "base/mem.h"
#include "pipeline/step/step_internal.h"

#define STEP_MOST   32000             /* a disparity of 16 bits times this fits 32 bits */
#define SHIFT_MOST  (1 << 30)         /* px */
#define STRIP_WORDS ((size_t)1 << 18) /* of a plane that are uploaded at once */

void sst_run_fail(struct sst_run *r, int err)
{
    r->err = r->err ? r->err : err;
}

void sst_run_leave(struct sst_run *r, const char *why)
{
    if (r->err && r->err != -ENOMEM)
        return;
    snprintf(r->why, sizeof(r->why), "%s", why);
    r->err = RUN_LEFT;
}

bool sst_run_failed(const struct sst_run *r)
{
    return r->err;
}

struct sst_gpu *sst_run_gpu(const struct sst_run *r)
{
    return r->gpu;
}

int sst_step_shift(struct sst_gpu_shift *out, struct sst_shift across, struct sst_shift down)
{
    if (llabs(across.step) > STEP_MOST || llabs(down.step) > STEP_MOST || llabs(across.at >> 16) > SHIFT_MOST ||
        llabs(down.at >> 16) > SHIFT_MOST)
        return -EOVERFLOW;
    *out = (struct sst_gpu_shift){ (int32_t)(across.at >> 16), (int32_t)(across.at & 0xFFFF), (int32_t)across.step,
                                   (int32_t)(down.at >> 16),   (int32_t)(down.at & 0xFFFF),   (int32_t)down.step };
    return 0;
}

/* --- memory ------------------------------------------------------------------------------------------------------- */

bool runner_drop_scratch(struct runner_memory *m, struct sst_gpu *g)
{
    bool any = false;

    for (int i = 0; i < SST_RUN_SCRATCH; i++) {
        struct runner_scratch *s = &m->scratch[i];

        if (!s->buffer || s->used == m->planes.turn)
            continue;
        sst_gpu_buffer_destroy(g, s->buffer);
        *s = (struct runner_scratch){ 0 };
        any = true;
    }
    return any;
}

/* Make room, the cheapest first. @param plane  that is not freed, or -1 @return false: there is no more */
static bool make_room(struct sst_run *r, int plane, int *attempt)
{
    for (; *attempt < 4; (*attempt)++) {
        if ((*attempt == 0 && runner_drop_scratch(r->memory, r->gpu)) ||
            (*attempt == 1 && sst_step_planes_trim(&r->memory->planes, r->gpu, plane)) ||
            (*attempt == 2 && r->user && sst_runner_make_room(r->user->runner, r->user))) {
            (*attempt)++;
            return true;
        }
        if (*attempt == 3 && r->user && r->user->drop) {
            r->user->drop(r->user->arg);
            (*attempt)++;
            return true;
        }
    }
    return false;
}

struct sst_gpu_buffer *sst_run_buffer(struct sst_run *r, size_t bytes)
{
    struct sst_gpu_buffer *b = NULL;
    int attempt = 0, err = -ENOMEM;

    if (r->err)
        return NULL;
    if (bytes <= sst_gpu_get_info(r->gpu)->buffer_bytes) { /* else there is none, whatever is freed */
        do
            err = sst_gpu_buffer_create(r->gpu, &b, bytes);
        while (err == -ENOMEM && make_room(r, -1, &attempt));
    }
    sst_run_fail(r, err);
    return err ? NULL : b;
}

struct sst_gpu_range sst_run_scratch(struct sst_run *r, int which, size_t bytes)
{
    struct runner_scratch *s = &r->memory->scratch[which];

    if (r->err)
        return (struct sst_gpu_range){ 0 };
    s->used = r->memory->planes.turn;
    if (s->bytes >= bytes && s->buffer)
        return (struct sst_gpu_range){ s->buffer, 0 };
    sst_gpu_buffer_destroy(r->gpu, s->buffer);
    s->buffer = NULL;
    s->buffer = sst_run_buffer(r, bytes);
    s->bytes = s->buffer ? bytes : 0;
    return (struct sst_gpu_range){ s->buffer, 0 };
}

/* Places of a plane for `least` views more than this item uses of it. */
static int create_plane(struct sst_run *r, enum sst_step_plane plane, int least)
{
    int attempt = 0, err;

    if (sst_step_plane_used(&r->memory->planes, plane)) /* they would be lost */
        return -ENOMEM;
    do
        err = sst_step_plane_create(&r->memory->planes, r->gpu, plane, least);
    while (err == -ENOMEM && make_room(r, plane, &attempt));
    return err;
}

void sst_run_write(struct sst_run *r, struct sst_gpu_range to, const void *data, size_t bytes)
{
    const int64_t start_ns = sst_clock_now_ns();

    if (r->err)
        return;
    sst_run_fail(r, sst_gpu_upload(r->gpu, to.buffer, to.offset, data, bytes));
    r->report->upload_bytes += (int64_t)bytes;
    r->report->upload_ns += sst_clock_now_ns() - start_ns;
}

struct sst_gpu_range sst_run_upload(struct sst_run *r, int which, const void *data, size_t bytes)
{
    const struct sst_gpu_range to = sst_run_scratch(r, which, bytes);

    sst_run_write(r, to, data, bytes);
    return to;
}

uint32_t *sst_run_words(struct sst_run *r, size_t words)
{
    uint32_t *to = sst_mem_keep(&r->memory->words, words, sizeof(*to));

    sst_run_fail(r, to ? 0 : -ENOMEM);
    return r->err ? NULL : to;
}

/* --- planes ------------------------------------------------------------------------------------------------------- */

struct sst_gpu_range sst_run_output(struct sst_run *r, enum sst_step_plane plane, int view)
{
    struct sst_gpu_range to = { 0 };

    if (r->err)
        return to;
    to = sst_step_plane_place(&r->memory->planes, plane, view);
    if (!to.buffer) {
        sst_run_fail(r, create_plane(r, plane, 1));
        if (!r->err)
            to = sst_step_plane_place(&r->memory->planes, plane, view);
    }
    if (!r->err)
        sst_step_plane_mark(&r->memory->planes, plane, view, true);
    return to;
}

/* Words of a plane on the host, some rows at a time. */
static void upload_plane(struct sst_run *r, enum sst_step_plane plane, const struct sst_plane_source *from,
                         struct sst_gpu_range to)
{
    uint32_t *words;
    int height, some;
    size_t width;

    sst_step_plane_shape(plane, from, &height, &width);
    some = sst_clamp_int((int)(STRIP_WORDS / (width + 1)), 1, height);
    words = sst_mem_keep(&r->memory->words, (size_t)some * width, sizeof(*words));
    sst_run_fail(r, words ? 0 : -ENOMEM);
    for (int y = 0; y < height && !r->err; y += some) {
        const int rows = sst_min_int(some, height - y);
        const struct sst_gpu_range at = { to.buffer, to.offset + (size_t)y * width * sizeof(*words) };

        sst_step_plane_pack(words, plane, from, y, rows);
        sst_run_write(r, at, words, (size_t)rows * width * sizeof(*words));
    }
    r->report->uploads++;
}

/* The same of a view. */
static void upload_view(struct sst_run *r, enum sst_step_plane plane, int view, struct sst_gpu_range to)
{
    struct sst_plane_source from = { 0 };
    struct sst_image half = { 0 };

    r->step->source(r->job, view, &from);
    if (plane == SST_PLANE_FEATURES && !from.features)
        sst_run_fail(r, -ENODATA);
    if (plane == SST_PLANE_REDUCED &&
        (size_t)from.image->width * (size_t)from.image->height != r->memory->planes.pixels[plane]) {
        sst_run_fail(r, sst_image_halve(&half, from.image));
        from.image = &half;
    }
    if (!r->err)
        upload_plane(r, plane, &from, to);
    sst_image_fini(&half);
}

/* Words that this step derives of others. These give way for the next view. */
static void derive_plane(struct sst_run *r, int view, struct sst_gpu_range to)
{
    r->shaders->derive(r, r->job, view, to);
    for (int i = 0; i < SST_PLANE_DERIVED; i++)
        sst_step_plane_release(&r->memory->planes, (enum sst_step_plane)i, view);
}

/* A map that this step has not changed yet. @return false: the device does not have it */
static bool copy_before(struct sst_run *r, int view, struct sst_gpu_range to)
{
    const bool changed = r->step->changes >> SST_PLANE_MAP & 1 && r->done[view]; /* then items are views */
    const struct sst_gpu_range from =
        changed ? (struct sst_gpu_range){ 0 } : sst_step_plane_find(&r->memory->planes, SST_PLANE_MAP, view);

    if (!from.buffer)
        return false;
    sst_run_copy(r, to, from, r->memory->planes.pixels[SST_PLANE_MAP] * sizeof(uint32_t));
    sst_step_plane_release(&r->memory->planes, SST_PLANE_MAP, view);
    return true;
}

struct sst_gpu_range sst_run_plane(struct sst_run *r, enum sst_step_plane plane, int view)
{
    struct sst_gpu_range at = { 0 };

    if (r->err)
        return at;
    at = sst_step_plane_find(&r->memory->planes, plane, view);
    if (at.buffer)
        return at;
    at = sst_run_output(r, plane, view);
    if (r->err)
        return at;
    if (plane == SST_PLANE_DERIVED)
        derive_plane(r, view, at);
    else if (plane != SST_PLANE_BEFORE || !copy_before(r, view, at))
        upload_view(r, plane, view, at);
    if (r->err)
        sst_step_plane_mark(&r->memory->planes, plane, view, false);
    return at;
}

struct sst_gpu_range sst_run_planes(struct sst_run *r, enum sst_step_plane plane, const int *view, int views)
{
    if (!r->err && r->memory->planes.plane[plane].places < views)
        sst_run_fail(r, create_plane(r, plane, views));
    for (int i = 0; i < views; i++) /* current places must not make room for the others */
        (void)sst_step_plane_find(&r->memory->planes, plane, view[i]);
    for (int i = 0; i < views; i++)
        (void)sst_run_plane(r, plane, view[i]);
    return (struct sst_gpu_range){ r->err ? NULL : r->memory->planes.plane[plane].buffer, 0 };
}

void sst_run_release(struct sst_run *r, enum sst_step_plane plane, int view)
{
    if (!r->err)
        sst_step_plane_release(&r->memory->planes, plane, view);
}

uint32_t sst_run_first(struct sst_run *r, enum sst_step_plane plane, int view)
{
    return r->err ? 0 : (uint32_t)(sst_step_plane_find(&r->memory->planes, plane, view).offset / sizeof(uint32_t));
}

/* --- work --------------------------------------------------------------------------------------------------------- */

void sst_run_copy(struct sst_run *r, struct sst_gpu_range to, struct sst_gpu_range from, size_t bytes)
{
    if (!r->err)
        sst_run_fail(r, sst_gpu_copy(r->gpu, to.buffer, to.offset, from.buffer, from.offset, bytes));
}

void sst_run_fill(struct sst_run *r, struct sst_gpu_range to, size_t first, size_t words, uint32_t word)
{
    if (!r->err)
        sst_run_fail(r, sst_gpu_fill(r->gpu, to.buffer, to.offset + first * sizeof(word), words * sizeof(word), word));
}

enum sst_gpu_shader sst_run_fastest(struct sst_run *r, enum sst_gpu_shader shader)
{
    enum sst_gpu_shader fastest = shader;

    if (r->asked) {
        r->asked[shader] = true;
        return r->variant < SST_GPU_SHADERS && sst_gpu_wants_variant(r->gpu, shader, r->variant) ? r->variant : shader;
    }
    if (!r->err)
        sst_run_fail(r, sst_gpu_prepare_fastest(r->gpu, shader, &fastest));
    return fastest;
}

void sst_run_dispatch(struct sst_run *r, struct sst_gpu_work work, const struct sst_gpu_range *range, int ranges)
{
    assert(ranges <= SST_GPU_BUFFERS);
    if (r->err)
        return;
    for (int i = 0; i < ranges; i++) {
        work.buffer[i] = range[i].buffer;
        work.offset[i] = range[i].offset;
    }
    r->report->dispatches++;
    sst_run_fail(r, sst_gpu_dispatch(r->gpu, &work));
}

void sst_run_read(struct sst_run *r, void *data, struct sst_gpu_range from, size_t bytes)
{
    const int64_t start_ns = sst_clock_now_ns();
    int64_t done_ns;

    if (!r->err)
        sst_run_fail(r, sst_gpu_wait(r->gpu));
    done_ns = sst_clock_now_ns();
    if (!r->err)
        sst_run_fail(r, sst_gpu_download(r->gpu, data, from.buffer, from.offset, bytes));
    r->report->wait_ns += done_ns - start_ns;
    r->report->download_ns += sst_clock_now_ns() - done_ns;
}

const uint32_t *sst_run_fetch(struct sst_run *r, struct sst_gpu_range from, size_t words)
{
    uint32_t *to = sst_mem_keep(&r->memory->words, words, sizeof(*to));

    sst_run_fail(r, to ? 0 : -ENOMEM);
    sst_run_read(r, to, from, words * sizeof(*to));
    return r->err ? NULL : to;
}

/* --- a step ------------------------------------------------------------------------------------------------------- */

/* The shaders of a step. NULL: none */
static const struct sst_step_shaders *find_shaders(const struct sst_runner_user *user, const struct sst_step *step)
{
    const struct sst_step_shaders *s = user ? user->steps : NULL;

    while (s && s->step && s->step != step)
        s++;
    return s && s->step ? s : NULL;
}

void sst_run_changed(struct sst_runner_user *user, int view, unsigned planes)
{
    if (!user)
        return;
    sst_runner_lock(user->runner);
    for (int i = 0; i < SST_PLANES; i++) {
        if (planes >> i & 1)
            sst_step_plane_mark(&runner_memory_of(user->runner)->planes, (enum sst_step_plane)i, view, false);
    }
    sst_runner_unlock(user->runner);
}

void sst_run_note(struct sst_runner_user *user, unsigned stages, const char *why)
{
    if (!user)
        return;
    sst_runner_lock(user->runner);
    user->report.stages_on_cpu |= stages;
    user->report.items[0].on_cpu++;
    if (why)
        snprintf(user->report.why, sizeof(user->report.why), "%s", why);
    sst_runner_unlock(user->runner);
}

bool sst_run_places(const struct sst_runner_user *user, const struct sst_step *step, const void *job)
{
    const struct sst_step_shaders *shaders = find_shaders(user, step);

    return shaders && !(shaders->refuses && shaders->refuses(job));
}

int64_t sst_run_on_cpu(const struct sst_runner_user *user, int counter)
{
    return user ? user->report.items[counter].on_cpu : 0;
}

static void claim(struct sst_runner_user *user, const void *of, int views, const size_t *pixels)
{
    sst_runner_lock(user->runner);
    sst_step_planes_claim(sst_runner_planes(user->runner), sst_runner_device(user->runner), of, views, pixels);
    sst_runner_unlock(user->runner);
}

void sst_run_claim(struct sst_runner_user *user, const void *of, int views, const size_t *pixels)
{
    if (!user)
        return;
    claim(user, of, views, pixels);
    user->claimed = of;
}

void sst_run_adopt(struct sst_runner_user *user, const void *of, int views, size_t pixels)
{
    if (user && !user->claimed)
        claim(user, of, views, (const size_t[]){ pixels, pixels, pixels });
}

void sst_run_forget(struct sst_runner_user *user, const void *of)
{
    if (!user || user->claimed != of)
        return;
    claim(user, NULL, 0, (const size_t[]){ 0, 0, 0 });
    user->claimed = NULL;
}

/* Work on the CPU, for messages. */
static const char *phrase_of(const struct sst_run *r, char text[64])
{
    snprintf(text, 64, "%s is done", r->step->name);
    return r->user->phrase ? r->user->phrase : text;
}

static const char *why_of(const struct sst_run *r)
{
    return r->err == RUN_LEFT       ? r->why
           : r->err == -EOVERFLOW   ? "views are too far apart"
           : r->err == -ENODATA     ? "features of a view are no longer there"
           : r->err == -EINPROGRESS ? "the device is being opened"
                                    : sst_gpu_error(r->err);
}

/* Why the rest of a step is the CPU's. */
static void leave(struct sst_run *r)
{
    const bool live = sst_runner_is_live(r->user->runner),
               blameless = r->err == -ENOMEM || r->err == -EOVERFLOW || r->err == -ENODATA;
    const char *why = why_of(r);
    const bool known = !strcmp(why, r->report->why);
    char text[64];

    snprintf(r->report->why, sizeof(r->report->why), "%s", why);
    if (r->err == -EINPROGRESS)
        return;
    if (!known && (blameless || (live && r->err == RUN_LEFT)))
        sst_log_warning("%s: %s; %s on the CPU", r->report->name, why, phrase_of(r, text));
    if (!blameless && r->err != RUN_LEFT)
        sst_runner_report_failure(r->user, phrase_of(r, text), r->err, r->gpu ? "" : sst_runner_why(r->user->runner));
}

int sst_run_rows(struct sst_run *r, int rows, int unit)
{
    const int all = rows;

    for (int i = 0; i < r->halvings && rows > unit; i++)
        rows = ((rows + 1) / 2 + unit - 1) / unit * unit;
    r->divisible = rows > unit;
    r->in_bands = rows < all;
    return rows;
}

/* True if an item that lacked memory begins again: first without buffers of earlier items, which may be larger, then in
 * smaller bands. */
static bool halve(struct sst_run *r)
{
    if (r->err != -ENOMEM || !r->divisible)
        return false;
    r->err = 0;
    r->halvings += r->alone;
    r->alone = true;
    r->memory->planes.turn++;
    runner_drop_scratch(r->memory, r->gpu);
    return true;
}

void runner_run_view(struct sst_run *r, int view)
{
    r->alone = false;
    do {
        r->memory->planes.turn++;
        r->divisible = r->in_bands = false;
        r->shaders->dispatch(r, r->job, view);
    } while (halve(r));
    for (int i = 0; i < SST_PLANES && r->err; i++) {
        if (r->step->changes >> i & 1)
            sst_step_plane_mark(&r->memory->planes, (enum sst_step_plane)i, view, false);
    }
}

int sst_run_item(struct sst_runner_user *user, const struct sst_step *step, void *job, int item)
{
    struct sst_run r = { .user = user,
                         .memory = runner_memory_of(user->runner),
                         .report = &user->report,
                         .gpu = sst_runner_device(user->runner),
                         .step = step,
                         .shaders = find_shaders(user, step),
                         .job = job };

    runner_run_view(&r, item);
    if (!r.err && sst_gpu_is_dummy(r.gpu)) /* which computes nothing */
        r.err = step->cpu(job, item, 0);
    return r.err;
}

/* The device as the step begins. */
static void begin(struct sst_run *r)
{
    r->gpu = sst_runner_take(r->user->runner, r->user, &r->err);
    r->memory = runner_memory_of(r->user->runner);
    for (int plane = SST_PLANE_BEFORE; plane < SST_PLANES; plane++) {
        for (int i = 0; i < r->memory->planes.views; i++)
            sst_step_plane_mark(&r->memory->planes, (enum sst_step_plane)plane, i, false);
    }
    r->begun = true;
}

/* Items first .. end - 1, unless the device fails, or has failed. @return 0, -ECANCELED */
static int run_on_device(struct sst_run *r, int first, int end, const struct sst_run_options *o)
{
    struct sst_step_items *items = &r->report->items[r->step->counter];
    bool cancelled = false;
    char text[64];
    int64_t start_ns;

    sst_runner_lock(r->user->runner);
    start_ns = sst_clock_now_ns();
    if (r->err) {
        sst_runner_unlock(r->user->runner);
        return 0;
    }
    if (r->begun)
        r->gpu = r->gpu ? sst_runner_device(r->user->runner) : NULL;
    else
        begin(r);
    for (int i = first; r->gpu && i < end && !r->err && !cancelled; i++) {
        if (!r->step->wants(r->job, i))
            continue;
        cancelled = o->cancel && *o->cancel;
        if (cancelled)
            break;
        runner_run_view(r, i);
        r->done[i] = !r->err && !sst_gpu_is_dummy(r->gpu); /* which computes nothing */
        items->device += !r->err;
        items->in_bands += !r->err && r->in_bands;
        r->rest -= !r->err && !r->done[i]; /* the CPU computes it, which does not count */
    }
    if (r->gpu)
        runner_note(r->user);
    if (r->err)
        leave(r);
    else if (r->gpu)
        sst_runner_succeed(r->user, phrase_of(r, text));
    if (r->err || !r->gpu)
        r->report->stages_on_cpu |= r->step->stages;
    r->report->total_ns += sst_clock_now_ns() - start_ns;
    sst_runner_unlock(r->user->runner);
    return cancelled ? -ECANCELED : 0;
}

/* Items that the device has not done. */
struct rest {
    struct sst_run *run;
    const struct sst_run_options *shared; /* items are done on the device one by one; NULL: on the CPU */
};

static bool is_left(const struct sst_run *r, int view)
{
    return r->step->wants(r->job, view) && !(r->done && r->done[view]);
}

/* Maps that items on the CPU need. */
static int make_host(const struct sst_run *r, int items)
{
    for (int i = 0; i < items && r->step->host; i++) {
        if (is_left(r, i))
            return r->step->host(r->job);
    }
    return 0;
}

static int run_rest(void *arg, int view, int worker)
{
    const struct rest *rest = arg;
    struct sst_run *r = rest->run;
    int err = 0;

    if (rest->shared && r->step->wants(r->job, view))
        err = run_on_device(r, view, view + 1, rest->shared);
    if (err || !is_left(r, view))
        return err;
    r->rest++;
    return r->step->cpu(r->job, view, worker);
}

static void rest_writes(void *arg, int view, struct sst_share_maps *out)
{
    const struct sst_run *r = ((const struct rest *)arg)->run;

    if (r->step->wants(r->job, view))
        r->step->writes(r->job, view, out);
}

/* Leave all items of a job that no shader does to the CPU. */
static void refuse(struct sst_run *r)
{
    const char *why = r->user && r->shaders->refuses ? r->shaders->refuses(r->job) : NULL;

    if (!why)
        return;
    r->err = RUN_LEFT;
    sst_runner_lock(r->user->runner);
    snprintf(r->report->why, sizeof(r->report->why), "%s", why);
    r->report->stages_on_cpu |= r->step->stages;
    sst_runner_unlock(r->user->runner);
}

/* Count items of the CPU, and drop planes that it has changed. */
static void end(const struct sst_run *r, int items)
{
    sst_runner_lock(r->user->runner);
    r->report->items[r->step->counter].on_cpu += r->rest;
    sst_runner_unlock(r->user->runner);
    for (int i = 0; r->step->changes && i < items; i++) {
        if (is_left(r, i))
            sst_run_changed(r->user, i, r->step->changes);
    }
}

int sst_run(struct sst_runner_user *user, const struct sst_step *step, void *job, int items,
            const struct sst_run_options *o)
{
    const struct sst_step_shaders *shaders = find_shaders(user, step);
    bool *done = shaders ? calloc((size_t)items + 1, sizeof(*done)) : NULL;
    struct sst_run r = { .user = shaders ? user : NULL, .step = step, .shaders = shaders, .job = job, .done = done };
    struct rest rest = { &r, shaders && o->share ? o : NULL };
    int err = shaders && !done ? -ENOMEM : 0;

    r.report = shaders ? &user->report : NULL;
    refuse(&r);
    if (!err && shaders && !o->share)
        err = run_on_device(&r, 0, items, o);
    err = err ? err : make_host(&r, items);
    err = err ? err : sst_share_blocks(o->share, items, o->block, o->threads, run_rest, &rest, rest_writes);
    if (done)
        end(&r, items);
    free(done);
    return err;
}
