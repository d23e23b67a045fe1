/* Labels carried to other views on a device, and filled there. */
#include <errno.h>
#include <string.h>

#include "base/clock.h"
#include "pipeline/method/refine/refine_internal.h"

int refine_device_entropies(struct sst_refine_device *d, struct sst_map_u8 *label, struct sst_map_f32 *entropy)
{
    const size_t width = (size_t)label->width, n = width * (size_t)label->height;
    uint32_t *words = sst_mem_keep(&d->words, 2 * n, sizeof(*words));
    const int err = words ? refine_device_download(d, REFINE_KEPT_OUT, words, 2 * n * sizeof(*words)) : -ENOMEM;

    for (int y = 0; y < label->height && !err; y++, words += width) {
        uint8_t *to = sst_map_u8_row(label, y);

        for (size_t x = 0; x < width; x++)
            to[x] = (uint8_t)words[x];
        memcpy(sst_map_f32_row(entropy, y), words + n, width * sizeof(*words));
    }
    return err;
}

static int fill(struct sst_refine_device *d, const struct sst_refine_carry *c)
{
    const struct sst_gpu_label_fill push = { c->lf->width, c->lf->height };
    struct sst_gpu_work work = { .shader = SST_GPU_LABEL_FILL,
                                 .push = &push,
                                 .buffer = { d->view[c->view].buffer, d->kept[REFINE_KEPT_OUT],
                                             d->kept[REFINE_KEPT_FILLED] } };

    return refine_device_dispatch(d, &work, c->lf->width, c->lf->height);
}

/* From up to SST_GPU_VOTERS sources at once: later ones give labels to pixels that have none yet. */
static int gather(struct sst_refine_device *d, const struct sst_refine_carry *c)
{
    int err = 0;

    for (int first = 0; !err && (first < c->count || first == 0); first += SST_GPU_VOTERS) {
        struct sst_refine_carry part = *c;
        struct sst_gpu_label_carry push = { .width = c->lf->width,
                                            .height = c->lf->height,
                                            .count = sst_min_int(c->count - first, SST_GPU_VOTERS),
                                            .flags = (c->entropies ? SST_GPU_CARRY_ENTROPIES : 0U) |
                                                     (first ? SST_GPU_CARRY_MORE : 0U) };
        struct sst_gpu_work work = { .shader = SST_GPU_LABEL_CARRY, .push = &push };

        for (int i = 0; i < SST_GPU_VOTERS; i++)
            push.rows[i] = c->lf->height;
        part.sources = c->sources + first;
        part.count = push.count;
        err = refine_device_voters(d, &work, push.shift, &part);
        err = err ? err : refine_device_dispatch(d, &work, c->lf->width, c->lf->height);
    }
    return err;
}

static int carry_whole(struct sst_refine_device *d, struct sst_map_u8 *label, struct sst_map_f32 *entropy,
                       const struct sst_refine_carry *c)
{
    const size_t bytes = (size_t)c->lf->width * (size_t)c->lf->height * sizeof(uint32_t);
    int err = refine_device_keep(d, REFINE_KEPT_OUT, (entropy ? 2 : 1) * bytes);

    err = err ? err : gather(d, c);
    if (c->fill)
        err = err ? err : refine_device_keep(d, REFINE_KEPT_FILLED, bytes);
    if (c->fill)
        err = err ? err : fill(d, c);
    if (entropy)
        return err ? err : refine_device_entropies(d, label, entropy);
    return err ? err : refine_device_labels(d, c->fill ? REFINE_KEPT_FILLED : REFINE_KEPT_OUT, label);
}

static int carry(struct sst_refine_device *d, struct sst_map_u8 *label, struct sst_map_f32 *entropy,
                 const struct sst_refine_carry *c)
{
    int err = d->band_rows ? -ENOMEM : carry_whole(d, label, entropy, c);

    if (err != -ENOMEM)
        return err;
    err = refine_device_exchange(d, label, entropy, c, false);
    d->report.carried_in_parts += !err;
    return err;
}

bool sst_refine_device_carry(struct sst_refine_device *d, struct sst_map_u8 *label, struct sst_map_f32 *entropy,
                             const struct sst_refine_carry *c)
{
    const int64_t start_ns = sst_clock_now_ns();
    bool done;
    int err;

    if (refine_device_begin(d, &err))
        err = carry(d, label, entropy, c);
    done = refine_device_end(d, err, "labels are carried");
    d->report.carried += done;
    d->report.carried_on_cpu += !done;
    if (!done)
        sst_refine_device_note_stage(d, SST_REFINE_STAGE_CARRY);
    d->report.total_ns += sst_clock_now_ns() - start_ns;
    return done;
}
