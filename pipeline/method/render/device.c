/* Pictures on a device: opening it, what it is asked for, what ends on the CPU. Where the views lie: device_views.c;
 * the pictures themselves: device_picture.c, device_clear.c.
 *
 * A device that fails is closed. The picture in work and the next ones are then rendered on the CPU, one more after
 * each failure, twice as many each time; then the device is opened again, for a light field that changes on a thread of
 * its own. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "base/text.h"
#include "pipeline/method/render/device_internal.h"

#define TEST_BYTES (1 << 20) /* more than a test of a step needs */

/* --- opening and failing ------------------------------------------------------------------------------------------ */

void device_drop(struct render_runner *d)
{
    device_drop_views(d);
    device_drop_frames(d);
}

/* Free all buffers: the device is closed, or other work needs the memory. */
static void drop(void *arg)
{
    struct render_runner *d = arg;

    d->gpu = sst_runner_device(d->runner);
    if (!d->held)
        device_drop(d);
}

/* Of a device that was just opened. */
static void note_opening(struct render_runner *d)
{
    d->opening = d->user.opening;
    d->limit_bytes = sst_gpu_free_bytes(d->gpu);
    d->tested = d->refused = 0;
    memset(d->bands, 0, sizeof(d->bands));
    d->small = d->cramped = false;
}

void device_begin(struct render_runner *d, struct sst_run *r)
{
    d->run = r;
    d->gpu = sst_run_gpu(r);
    d->turn++;
    d->held = false;
}

/* Note that a picture is rendered on the CPU, and why. */
static void note_cpu(struct render_runner *d, const char *why)
{
    d->report.on_cpu++;
    snprintf(d->report.why, sizeof(d->report.why), "%s", why);
}

/* After an error of the device: close it, and leave it alone for some pictures. @param why  "": the error's own */
static void fail(struct render_runner *d, int err, const char *why)
{
    sst_runner_report_failure(&d->user, d->user.phrase, err, why);
    d->gpu = NULL;
}

static void note_success(struct render_runner *d)
{
    d->report.pictures++;
    sst_runner_succeed(&d->user, d->user.phrase);
}

/* @return 0 or an error, logged. A live device that fails is tried again later. */
static int join(struct render_runner *d, const struct sst_step_shaders *steps)
{
    int err;

    d->user = (struct sst_runner_user){ .steps = steps,
                                        .step_count = 1,
                                        .work = "render",
                                        .phrase = d->changes ? "live pictures are rendered" : "the picture is rendered",
                                        .drop = drop,
                                        .arg = d };
    err = sst_runner_join(d->runner, &d->user);
    if (err && !d->changes)
        return err;
    sst_runner_lock(d->runner);
    d->gpu = sst_runner_device(d->runner);
    if (err)
        fail(d, err, sst_runner_why(d->runner));
    else
        note_opening(d);
    sst_runner_unlock(d->runner);
    return 0;
}

int device_init(struct render_runner *d, const struct sst_lightfield *lf, const struct sst_render_live *live)
{
    const size_t views = (size_t)(lf->rows * lf->cols);

    d->lf = lf;
    d->changes = live;
    d->live = live ? *live : (struct sst_render_live){ 0 };
    d->pitch = (lf->width + 3) / 4 * 4;
    d->chunk = calloc(views, sizeof(*d->chunk));
    d->slot = calloc(views, sizeof(*d->slot));
    d->frames.kept = calloc(views, sizeof(*d->frames.kept));
    return d->chunk && d->slot && d->frames.kept ? 0 : -ENOMEM;
}

void device_fini(struct render_runner *d)
{
    sst_mem_kept_fini(&d->words);
    sst_mem_kept_fini(&d->weights);
    for (int i = 0; i < DEVICE_SPANS; i++)
        free(d->frames.ready[i].list.xy);
    free(d->frames.kept);
    free(d->frames.lit);
    free(d->chunk);
    free(d->slot);
}

void render_runner_destroy(struct render_runner *d)
{
    if (!d)
        return;
    sst_runner_leave(d->runner, &d->user);
    device_fini(d);
    free(d);
}

int device_create(struct render_runner **out, const struct sst_lightfield *lf, struct sst_runner *runner,
                  const struct sst_step_shaders *steps, const struct sst_render_live *live)
{
    struct render_runner *d = calloc(1, sizeof(*d));
    int err = d ? device_init(d, lf, live) : -ENOMEM;

    if (err)
        sst_log_error("not enough memory for a device");
    if (!err) {
        d->runner = runner;
        err = join(d, steps);
    }
    if (!err) {
        *out = d;
        return 0;
    }
    if (d)
        device_fini(d);
    free(d);
    return err;
}

/* --- begin and end ------------------------------------------------------------------------------------------------ */

/* True if the device may be tried; else the picture is noted as one for the CPU. */
static bool may_try(struct render_runner *d)
{
    int err;

    d->gpu = sst_runner_take(d->runner, &d->user, &err);
    if (d->gpu && d->opening != d->user.opening)
        note_opening(d);
    if (d->gpu)
        return true;
    if (err && err != -EINPROGRESS)
        fail(d, err, sst_runner_why(d->runner));
    if (err)
        note_cpu(d, err == -EINPROGRESS ? "the device is being opened" : sst_gpu_error(err));
    else
        d->report.on_cpu++;
    return false;
}

/* Note that a picture is the CPU's after an error, which the device need not be to blame for. @param err  1: noted */
static void note_error(struct render_runner *d, int err)
{
    if (err == -EBADMSG || err == -ENOTSUP) {
        note_cpu(d, err == -EBADMSG ? "a frame cannot be decoded" : "the shader that rectifies is refused");
    } else if (err < 0) {
        fail(d, err, "");
        note_cpu(d, sst_gpu_error(err));
    }
}

/* Note that rays of a picture are verified on the CPU, and why; live each reason is logged once. */
static void note_unverified(struct render_runner *d)
{
    static const char *const whys[] = {
        [DEVICE_UNVERIFIED_NOT] = "",
        [DEVICE_UNVERIFIED_FRAMES] = "what the maps explain is tested in frames",
        [DEVICE_UNVERIFIED_AGREED] = "how many rays agree is wanted",
        [DEVICE_UNVERIFIED_WEIGHTS] = "weights underflow in pixels that are left to votes",
        [DEVICE_UNVERIFIED_REFUSED] = "a shader is refused",
        [DEVICE_UNVERIFIED_SMALL] = "a device needs room for the rays that it verifies",
        [DEVICE_UNVERIFIED_CRAMPED] = "what the maps explain needs room for some rows of all views, and its tables",
    };
    const enum device_unverified why = d->why;
    const unsigned bit = 1U << why;

    d->report.verified_on_cpu++;
    snprintf(d->report.why_verified, sizeof(d->report.why_verified), "%s", whys[why]);
    if (why == DEVICE_UNVERIFIED_SMALL || why == DEVICE_UNVERIFIED_CRAMPED)
        sst_text_add(d->report.why_verified, sizeof(d->report.why_verified),
                     ": raise %s, or use fewer or smaller views",
                     d->changes ? "live.device_memory_mb" : "--device-memory");
    if (d->changes && !(d->logged & bit))
        sst_log_warning("%s: %s; rays are verified on the CPU", d->user.report.name, d->report.why_verified);
    d->logged |= bit;
}

/* --- steps -------------------------------------------------------------------------------------------------------- */

/* Test a step at its first picture since the device was opened, after dropping views that leave too little memory.
 * @return 0, -ENOTSUP (refused), or an error of the device */
static int prepare(struct render_runner *d, enum render_step step)
{
    const unsigned bit = 1U << step;
    int err;

    /* Steps that pictures have needed are tested when a device is opened beside the work. */
    if (d->user.steps_tested < step)
        d->user.steps_tested = step;
    if (d->tested & bit)
        return d->refused & bit ? -ENOTSUP : 0;
    if (sst_gpu_free_bytes(d->gpu) < TEST_BYTES)
        device_drop(d);
    err = sst_step_check(&d->user, d->gpu, &d->user.steps[step]);
    d->tested |= !err || err == -ENOTSUP ? bit : 0;
    d->refused |= err == -ENOTSUP ? bit : 0;
    return err;
}

/* The steps of views that are made from frames, if any is. */
static int prepare_frames(struct render_runner *d, const struct sst_render_plan *p)
{
    bool any = false, encoded = false;
    int err;

    for (int k = 0; k < p->count; k++) {
        any |= p->tap[k].frame != NULL;
        encoded |= p->tap[k].frame && d->lf->views[p->tap[k].view].encoded;
    }
    if (!any)
        return 0;
    err = prepare(d, RENDER_STEP_FRAMES);
    err = err ? err : prepare(d, RENDER_STEP_SAMPLED);
    if (err || !encoded)
        return err;
    err = prepare(d, RENDER_STEP_JPEG);
    return err == -ENOTSUP ? 0 : err; /* the CPU makes the colours */
}

/* Render an item in bands as pictures of no more views had memory for. @param bands  of the item, which the step sets
 * @return as sst_run_item() */
static int run(struct render_runner *d, enum render_step step, void *job, const struct sst_render_plan *p,
               struct render_bands *bands)
{
    const int unit = step == RENDER_STEP_CLEAR || step == RENDER_STEP_CLEAR_SAMPLED ? 1 : SST_RENDER_CELL_HEIGHT;
    struct device_bands *known = &d->bands[step];
    int err;

    *bands = known->views && p->count >= known->views ? known->bands : (struct render_bands){ d->lf->height, false };
    err = sst_run_item(&d->user, d->user.steps[step].step, job, 0);
    if (err || (bands->rows == d->lf->height && !bands->split))
        return err;
    *known = (struct device_bands){ p->count, *bands };
    known->bands.rows = sst_max_int(bands->rows, 2 * unit); /* which can be halved, without buffers of larger ones */
    return 0;
}

/* --- pictures of rays --------------------------------------------------------------------------------------------- */

/* Note why rays are not verified on the device. @return false: it failed for another reason */
static bool note_reason(struct render_runner *d, const struct sst_render_plan *p, int err)
{
    d->small = d->small || (err == -ENOMEM && !p->explainer);
    d->cramped = d->cramped || (err == -ENOMEM && p->explainer);
    d->why = err == -EAGAIN    ? DEVICE_UNVERIFIED_WEIGHTS
             : err == -ENOTSUP ? DEVICE_UNVERIFIED_REFUSED
             : p->explainer    ? DEVICE_UNVERIFIED_CRAMPED
                               : DEVICE_UNVERIFIED_SMALL;
    return err == -EAGAIN || err == -ENOTSUP || err == -ENOMEM;
}

static int try_picture(struct render_runner *d, struct render_picture *p)
{
    int err = prepare_frames(d, p->plan);

    if (err)
        return err;
    p->verify = p->plan->verifier && device_can_verify(d, p->plan);
    err = p->verify ? prepare(d, RENDER_STEP_VERIFY) : 0;
    err = err || !p->verify ? err : run(d, RENDER_STEP_VERIFY, p, p->plan, &p->bands);
    if (err && !note_reason(d, p->plan, err))
        return err;
    p->verify = p->verify && !err;
    return p->verify ? 0 : run(d, RENDER_STEP_PICTURE, p, p->plan, &p->bands);
}

static bool place_picture(struct render_runner *d, struct render_picture *p)
{
    int err;

    sst_runner_lock(d->runner);
    err = may_try(d) ? try_picture(d, p) : 1;
    if (err)
        note_error(d, err);
    else
        note_success(d);
    if (!err && p->plan->verifier && !p->verify)
        note_unverified(d);
    sst_runner_unlock(d->runner);
    return !err;
}

/* The first and the last row of cells that are wanted, as rows of the picture. */
static void find_rows(const struct sst_render_plan *p, const uint8_t *cells, int *top, int *end)
{
    const size_t cols = (size_t)(p->lf->width + SST_RENDER_CELL_WIDTH - 1) / SST_RENDER_CELL_WIDTH;

    *top = p->lf->height;
    *end = 0;
    for (int y = 0; y < p->lf->height; y += SST_RENDER_CELL_HEIGHT) {
        if (!memchr(cells + (size_t)(y / SST_RENDER_CELL_HEIGHT) * cols, 1, cols))
            continue;
        *top = sst_min_int(*top, y);
        *end = sst_min_int(y + SST_RENDER_CELL_HEIGHT, p->lf->height);
    }
}

bool render_place(struct render_picture *p)
{
    struct render_runner *d = p->runner = p->renderer->runner;

    p->end = p->plan->lf->height;
    if (d && p->cells)
        find_rows(p->plan, p->cells, &p->top, &p->end);
    return d && p->top < p->end && place_picture(d, p);
}

/* --- clear pictures ----------------------------------------------------------------------------------------------- */

/* Note a clear picture that is rendered on the CPU; live that is logged once. */
static void note_clear(struct render_runner *d, int err)
{
    note_cpu(d, err == -EOVERFLOW ? "a clear picture of more views than a device takes"
                : err == -ENOMEM  ? "not enough memory on the device for a part of a clear picture"
                                  : sst_gpu_error(err));
    if (d->changes && !d->clear_logged)
        sst_log_warning("%s: %s; clear pictures are rendered on the CPU", d->user.report.name, d->report.why);
    d->clear_logged = true;
}

/* A device that cannot hold the picture, or computes it otherwise, is not to blame. */
static int try_clear(struct render_runner *d, struct clear *c)
{
    const enum render_step step = c->sampled ? RENDER_STEP_CLEAR_SAMPLED : RENDER_STEP_CLEAR;
    int err = c->count > SST_GPU_CLEAR_VIEWS ? -EOVERFLOW : prepare(d, step), holes = 0;

    if (!err && !c->cfg->merge)
        holes = prepare(d, RENDER_STEP_HOLES);
    c->runner = d;
    c->fills = !holes && !c->cfg->merge;
    err = err || holes == -ENOTSUP || holes == -ENOMEM ? err : holes;
    err = err ? err : prepare_frames(d, &c->plan);
    err = err ? err : run(d, step, c, &c->plan, &c->bands);
    if (!err) {
        d->report.in_parts += c->bands.rows < c->height;
        return 0;
    }
    if (err == -EOVERFLOW || err == -ENOTSUP || err == -ENOMEM)
        note_clear(d, err);
    else
        note_error(d, err);
    return err;
}

static bool place_clear(struct render_runner *d, struct clear *c)
{
    const int64_t start_ns = sst_clock_now_ns();
    int err = 1;

    sst_runner_lock(d->runner);
    if (may_try(d))
        err = try_clear(d, c);
    if (!err) {
        note_success(d);
        d->report.total_ns += sst_clock_now_ns() - start_ns;
    }
    sst_runner_unlock(d->runner);
    return !err;
}

/* Note holes that are filled on the CPU; live each reason is logged once. */
static void note_unfilled(struct render_runner *d, int err)
{
    const char *why = err == -ENOMEM ? "not enough memory on the device to fill holes" : sst_gpu_error(err);

    d->report.filled_on_cpu++;
    if (d->changes && strcmp(d->report.why_filled, why))
        sst_log_warning("%s: %s; holes are filled on the CPU", d->user.report.name, why);
    snprintf(d->report.why_filled, sizeof(d->report.why_filled), "%s", why);
}

static bool place_fill(struct render_runner *d, struct clear *c)
{
    const int64_t start_ns = sst_clock_now_ns();
    int err = -ENODEV; /* it has failed since */

    sst_runner_lock(d->runner);
    d->gpu = sst_runner_device(d->runner);
    if (d->gpu) {
        err = prepare(d, RENDER_STEP_HOLES);
        err = err ? err : sst_run_item(&d->user, d->user.steps[RENDER_STEP_HOLES].step, c, 0);
        if (err && err != -ENOMEM && err != -ENOTSUP)
            fail(d, err, "");
    }
    if (err)
        note_unfilled(d, err);
    d->report.total_ns += sst_clock_now_ns() - start_ns;
    sst_runner_unlock(d->runner);
    return !err;
}

bool clear_place(struct clear *c)
{
    c->placed = c->renderer->runner && place_clear(c->renderer->runner, c);
    return c->placed;
}

bool clear_place_fill(struct clear *c)
{
    return c->placed && place_fill(c->renderer->runner, c);
}

/* --- report ------------------------------------------------------------------------------------------------------- */

bool sst_renderer_device(struct sst_renderer *r, struct sst_render_device_report *out)
{
    struct render_runner *d = r->runner;

    if (!d)
        return false;
    sst_runner_lock(d->runner);
    *out = d->report;
    snprintf(out->name, sizeof(out->name), "%s", d->user.report.name);
    snprintf(out->driver, sizeof(out->driver), "%s", d->user.report.driver);
    snprintf(out->failure, sizeof(out->failure), "%s", d->user.report.failure);
    out->failing = d->user.report.failing;
    out->failures = d->user.report.failures;
    out->dispatches += d->user.report.dispatches;
    out->upload_bytes += d->user.report.upload_bytes;
    out->upload_ns += d->user.report.upload_ns;
    out->download_ns += d->user.report.download_ns;
    out->chunks = d->chunks;
    sst_runner_unlock(d->runner);
    return true;
}
