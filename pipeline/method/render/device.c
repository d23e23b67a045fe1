/* Pictures on a device: opening it, what it is asked for, what ends on the CPU. Where the views lie: device_views.c;
 * the pictures themselves: device_picture.c, device_clear.c.
 *
 * A device that fails is closed. The picture in work and the next ones are then rendered on the CPU, one more after
 * each failure, twice as many each time; then the device is opened again, for a light field that changes on a thread of
 * its own. */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "base/text.h"
#include "pipeline/step/opener.h"
#include "pipeline/method/render/render_internal.h"

#define TEST_BYTES (1 << 20) /* more than the self-tests of clear pictures need */

/* --- opening and failing ------------------------------------------------------------------------------------------ */

/* Free what lies on the device. */
void device_drop(struct render_device *d)
{
    for (int i = 0; i < d->chunks; i++)
        device_destroy_chunk(d, &d->chunk[i]);
    sst_gpu_buffer_destroy(d->gpu, d->params);
    sst_gpu_buffer_destroy(d->gpu, d->table);
    sst_gpu_buffer_destroy(d->gpu, d->sums);
    sst_gpu_buffer_destroy(d->gpu, d->out);
    d->params = d->table = d->sums = d->out = NULL;
    device_drop_clear(d);
    device_drop_parts(d);
    device_drop_frames(d);
    device_drop_verify(d);
    d->chunks = d->slots = d->rows = 0;
    d->table_rows = 0;
    d->full = false;
}

static void close_gpu(struct render_device *d)
{
    if (!d->gpu)
        return;
    device_drop(d);
    sst_gpu_close(d->gpu);
    d->gpu = NULL;
    d->clear_tested = false;
    d->verify.small = d->verify.split = d->verify.cramped = false;
}

/* Of a device that was just opened. */
static void note_device(struct render_device *d)
{
    snprintf(d->report.name, sizeof(d->report.name), "%s", sst_gpu_get_info(d->gpu)->name);
    snprintf(d->report.driver, sizeof(d->report.driver), "%s", sst_gpu_get_info(d->gpu)->driver);
    d->limit_bytes = sst_gpu_free_bytes(d->gpu);
}

static int open_gpu(struct render_device *d)
{
    int err = sst_gpu_open(&d->gpu, d->name, &d->cfg);

    if (err) {
        d->gpu = NULL;
        return err;
    }
    err = sst_gpu_prepare(d->gpu, SST_GPU_BLEND);
    if (err) {
        sst_log_error("the device `%s` cannot render: %s; choose another %s", d->name, sst_gpu_error(err),
                      d->changes ? "one" : "--device");
        close_gpu(d);
        return err;
    }
    note_device(d);
    return 0;
}

/* Note that a picture is rendered on the CPU, and why. */
static void note_cpu(struct render_device *d, const char *why)
{
    d->report.on_cpu++;
    snprintf(d->report.why, sizeof(d->report.why), "%s", why);
}

/* After an error of the device: close it, and leave it alone for some pictures; for good where it computes something
 * else. @param why  "": the error's own */
static void fail(struct render_device *d, int err, const char *why)
{
    const int skipped = sst_runner_backoff_fail(&d->backoff);

    why = *why ? why : sst_gpu_error(err);
    if (!d->changes)
        sst_log_warning("%s: %s; the picture is rendered on the CPU, and the device is opened again after %d more",
                        d->report.name, why, skipped);
    else if (!d->report.failing)
        sst_log_warning("%s: %s; live pictures are rendered on the CPU%s", d->report.name, why,
                        err == -ENOTSUP ? "" : ", and the device is tried again now and then");
    snprintf(d->report.failure, sizeof(d->report.failure), "%s", why);
    d->report.failing = true;
    d->report.failures++;
    close_gpu(d);
    d->given_up = err == -ENOTSUP;
}

static void note_success(struct render_device *d)
{
    if (d->report.failing && d->changes)
        sst_log_info("%s: live pictures are rendered on the device again", d->report.name);
    d->report.failing = false;
    d->report.pictures++;
    sst_runner_backoff_succeed(&d->backoff);
}

/* Open the device; of a light field that changes, what errors say is kept, and the device is tried again later.
 * @return 0, -ENOENT ("auto" without a GPU), -ENOMEM; else only where the light field does not change */
static int open_first(struct render_device *d)
{
    char text[SST_LOG_MAX] = "", *before = NULL;
    int err;

    if (d->changes)
        before = sst_log_hold_errors(text);
    err = open_gpu(d);
    if (d->changes)
        sst_log_hold_errors(before);
    if (!err || !d->changes || (err == -ENOENT && !strcmp(d->name, "auto")))
        return err;
    fail(d, err, text);
    return 0;
}

/* The shaders that live pictures have needed so far. @return their number */
static size_t list_shaders(struct render_device *d)
{
    static const enum sst_gpu_shader clear[] = { SST_GPU_CLEAR_LAND, SST_GPU_CLEAR_BLEND, SST_GPU_HOLE_PULL,
                                                 SST_GPU_HOLE_PUSH },
                                     verify[] = { SST_GPU_VERIFY_SHARE, SST_GPU_VERIFY_RAYS, SST_GPU_VERIFY_MODE,
                                                  SST_GPU_VERIFY_BLEND };
    const struct {
        const enum sst_gpu_shader *shader;
        size_t count;
    } wanted[] = { { clear, d->clears ? ARRAY_LEN(clear) : 0 },
                   { verify, d->verify.wanted ? ARRAY_LEN(verify) : 0 } };
    size_t n = 0;

    d->shaders[n++] = SST_GPU_BLEND;
    for (size_t i = 0; i < ARRAY_LEN(wanted); i++) {
        for (size_t k = 0; k < wanted[i].count; k++)
            d->shaders[n++] = wanted[i].shader[k];
    }
    return n;
}

/* Open a device on a thread of its own: tests of shaders may take longer than pictures may wait.
 * @return 0, -EINPROGRESS, or an error */
static int open_beside(struct render_device *d, char why[SST_LOG_MAX])
{
    const struct sst_runner_opening what = { .name = d->name,
                                          .cfg = d->cfg,
                                          .shaders = d->shaders,
                                          .needed = 1,
                                          .count = d->opener ? 0 : list_shaders(d), /* read when it begins */
                                          .work = "render" };
    const int err = sst_runner_open_beside(&d->opener, &what, &d->gpu, why);

    if (!err)
        note_device(d);
    return err;
}

/* Open a device that failed. @return false: it fails again, or is being opened */
static bool open_again(struct render_device *d)
{
    char why[SST_LOG_MAX] = "";
    const int err = d->changes ? open_beside(d, why) : open_gpu(d);

    if (!err)
        return true;
    if (err != -EINPROGRESS)
        fail(d, err, why);
    note_cpu(d, err == -EINPROGRESS ? "the device is being opened" : sst_gpu_error(err));
    return false;
}

int render_device_create(struct render_device **out, const struct sst_lightfield *lf, const char *name,
                         const struct sst_gpu_config *cfg, const struct sst_render_live *live)
{
    const size_t views = (size_t)(lf->rows * lf->cols);
    struct render_device *d = calloc(1, sizeof(*d));
    int err = d ? 0 : -ENOMEM;

    if (!err) {
        pthread_mutex_init(&d->lock, NULL);
        d->lf = lf;
        d->cfg = *cfg;
        d->changes = live;
        d->live = live ? *live : (struct sst_render_live){ 0 };
        d->pitch = (lf->width + 3) / 4 * 4;
        snprintf(d->name, sizeof(d->name), "%s", name);
        snprintf(d->report.name, sizeof(d->report.name), "%s", name);
        d->chunk = calloc(views, sizeof(*d->chunk));
        d->slot = calloc(views, sizeof(*d->slot));
        d->frames.kept = calloc(views, sizeof(*d->frames.kept));
        err = d->chunk && d->slot && d->frames.kept ? 0 : -ENOMEM;
    }
    if (err)
        sst_log_error("not enough memory for a device");
    else
        err = open_first(d);
    if (err) {
        render_device_destroy(d);
        return err;
    }
    *out = d;
    return 0;
}

void render_device_destroy(struct render_device *d)
{
    if (!d)
        return;
    sst_runner_opener_destroy(d->opener);
    close_gpu(d);
    sst_mem_kept_fini(&d->packed);
    sst_mem_kept_fini(&d->words);
    sst_mem_kept_fini(&d->weights);
    for (int i = 0; i < DEVICE_SPANS; i++)
        free(d->frames.ready[i].list.xy);
    free(d->frames.kept);
    free(d->verify.cell);
    free(d->chunk);
    free(d->slot);
    pthread_mutex_destroy(&d->lock);
    free(d);
}

/* --- begin and end ------------------------------------------------------------------------------------------------ */

/* True if the device may be tried; else the picture is noted as one for the CPU. */
static bool may_try(struct render_device *d)
{
    if (d->given_up || sst_runner_backoff_skips(&d->backoff)) {
        d->report.on_cpu++;
        return false;
    }
    return d->gpu || open_again(d);
}

/* Note that a picture is the CPU's after an error, which the device need not be to blame for. @param err  1: noted */
static void note_error(struct render_device *d, int err)
{
    if (err == -EBADMSG || err == -ENOTSUP) {
        note_cpu(d, err == -EBADMSG ? "a frame cannot be decoded" : "the shader that rectifies is refused");
    } else if (err < 0) {
        fail(d, err, "");
        note_cpu(d, sst_gpu_error(err));
    }
}

/* Note that rays of a picture are verified on the CPU, and why; live each reason is logged once. */
static void note_unverified(struct render_device *d)
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
    const enum device_unverified why = d->verify.why;
    const unsigned bit = 1U << why;

    d->report.verified_on_cpu++;
    snprintf(d->report.why_verified, sizeof(d->report.why_verified), "%s", whys[why]);
    if (why == DEVICE_UNVERIFIED_SMALL || why == DEVICE_UNVERIFIED_CRAMPED)
        sst_text_add(d->report.why_verified, sizeof(d->report.why_verified),
                     ": raise %s, or use fewer or smaller views",
                     d->changes ? "live.device_memory_mb" : "--device-memory");
    if (d->changes && !(d->verify.logged & bit))
        sst_log_warning("%s: %s; rays are verified on the CPU", d->report.name, d->report.why_verified);
    d->verify.logged |= bit;
}

bool render_device_begin(struct render_device *d, const struct sst_render_plan *p, const uint8_t *cells, int top,
                         int end, const uint32_t **words, const float **weights)
{
    const int64_t start_ns = sst_clock_now_ns();
    bool verified = false;
    int err;

    pthread_mutex_lock(&d->lock);
    err = may_try(d) ? device_render_picture(d, p, cells, top, end, &verified) : 1;
    if (err) {
        note_error(d, err);
        pthread_mutex_unlock(&d->lock);
        return false;
    }
    note_success(d);
    if (p->verifier && !verified)
        note_unverified(d);
    d->report.total_ns += sst_clock_now_ns() - start_ns;
    *words = d->words.data;
    *weights = p->verifier && !verified ? d->weights.data : NULL;
    return true;
}

/* Note that a clear picture is the CPU's; live that is logged once. */
static void note_clear(struct render_device *d, int err)
{
    note_cpu(d, err == -EOVERFLOW ? "a clear picture of more views than a device takes"
                : err == -ENOMEM  ? "not enough memory on the device for a part of a clear picture"
                                  : sst_gpu_error(err));
    if (d->changes && !d->noted)
        sst_log_warning("%s: %s; clear pictures are rendered on the CPU", d->report.name, d->report.why);
    d->noted = true;
}

/* Views may use all the memory, of which the tests need some. */
static int prepare_clear(struct render_device *d, const struct device_clear *c)
{
    int err;

    if (!d->clear_tested && sst_gpu_free_bytes(d->gpu) < TEST_BYTES)
        device_drop(d);
    d->clear_tested = true;
    err = sst_gpu_prepare(d->gpu, SST_GPU_CLEAR_LAND);
    if (!err)
        err = sst_gpu_prepare(d->gpu, SST_GPU_CLEAR_BLEND);
    if (!err && c->push.sampled)
        err = sst_gpu_prepare(d->gpu, SST_GPU_CLEAR_SURFACE);
    if (!err && c->push.sampled)
        err = sst_gpu_prepare(d->gpu, SST_GPU_CLEAR_SAMPLE);
    return err ? err : device_prepare_holes(d);
}

/* The shaders of clear pictures are tested at the first one. What the device cannot hold, or computes differently, is
 * the CPU's; the device is not to blame. */
static int try_clear(struct render_device *d, struct device_clear *c)
{
    int err = c->count > SST_GPU_CLEAR_VIEWS ? -EOVERFLOW : prepare_clear(d, c);

    d->clears = true;
    if (!err)
        err = device_render_clear(d, c);
    if (err == -EOVERFLOW || err == -ENOTSUP || err == -ENOMEM)
        note_clear(d, err);
    else if (err != -EAGAIN)
        note_error(d, err);
    return err;
}

/* Note that holes of a picture are filled on the CPU, and why; live that is logged once. */
static void note_unfilled(struct render_device *d)
{
    const char *why = *d->why_holes ? d->why_holes : "not enough memory on the device to fill holes";

    d->report.filled_on_cpu++;
    if (d->changes && strcmp(d->report.why_filled, why))
        sst_log_warning("%s: %s; holes are filled on the CPU", d->report.name, why);
    snprintf(d->report.why_filled, sizeof(d->report.why_filled), "%s", why);
}

/* The picture is there but for its holes, which are the CPU's where the device fails at them. */
bool render_device_fill(struct render_device *d)
{
    const int64_t start_ns = sst_clock_now_ns();
    const int err = *d->why_holes ? -ENOMEM : device_fill_words(d);

    d->report.total_ns += sst_clock_now_ns() - start_ns;
    if (!err)
        return true;
    if (err != -ENOMEM) {
        fail(d, err, "");
        snprintf(d->why_holes, sizeof(d->why_holes), "%s", sst_gpu_error(err));
    }
    note_unfilled(d);
    return false;
}

bool render_device_begin_clear(struct render_device *d, struct device_clear *c, uint32_t **words, const uint32_t **seen)
{
    const int64_t start_ns = sst_clock_now_ns();
    int err = 1;

    pthread_mutex_lock(&d->lock);
    c->filled = false;
    if (may_try(d))
        err = try_clear(d, c);
    c->pending = err == -EAGAIN;
    if (err) {
        pthread_mutex_unlock(&d->lock);
        return false;
    }
    note_success(d);
    if (!c->filled && !c->push.merged)
        note_unfilled(d);
    d->report.total_ns += sst_clock_now_ns() - start_ns;
    *words = d->words.data;
    *seen = c->push.merged ? d->weights.data : NULL;
    return true;
}

void render_device_end(struct render_device *d)
{
    if (d->parts.all)
        device_drop_parts(d);
    pthread_mutex_unlock(&d->lock);
}

void render_device_report(struct render_device *d, struct sst_render_device_report *out)
{
    pthread_mutex_lock(&d->lock);
    *out = d->report;
    out->chunks = d->chunks;
    pthread_mutex_unlock(&d->lock);
}
