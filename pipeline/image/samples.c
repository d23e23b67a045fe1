/* Samples of 16-bit pictures: the range that becomes the 256 levels of all computations. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdlib.h>

#include "base/file.h"
#include "base/log.h"
#include "pipeline/image/codec.h"
#include "pipeline/image/codec_formats.h"

#define USUAL   32768 /* a wider span is scaled from all 16 bits, as other programs do */
#define OUTSIDE 200   /* one sample in this many is below a stretch, and one above */
#define APART   2     /* levels of a stretch at least */
#define OUTLIER 10000 /* one sample in this many is left out at either end */

struct sst_samples sst_samples_choose(const struct sst_sample_counts *counts)
{
    uint64_t total = 0, below = 0, above = 0;
    int black = 0, white = 65535;

    for (int v = 0; v < 65536; v++)
        total += counts->of[v];
    while (black < 65535 && !counts->of[black])
        black++;
    while (white > 0 && !counts->of[white])
        white--;
    if (white - black > 255) {
        while ((below += counts->of[black]) <= total / OUTLIER)
            black++;
        while ((above += counts->of[white]) <= total / OUTLIER)
            white--;
    }
    if (white - black >= USUAL || white <= black)
        return (struct sst_samples){ 0, 0 };
    return (struct sst_samples){ black, white };
}

/* At least APART, about where they were, within the type's range. */
static struct sst_samples part(int black, int white, int most)
{
    while (white - black < APART) {
        black -= black > 0;
        white += white < most && white - black < APART;
    }
    return (struct sst_samples){ black, white };
}

struct sst_samples sst_samples_stretch(const struct sst_sample_counts *counts, uint64_t total, int most)
{
    const uint64_t outside = total / OUTSIDE;
    uint64_t below = 0, above = 0;
    int black = 0, white = most;

    while (black < most && (below += counts->of[black]) <= outside)
        black++;
    while (white > 0 && (above += counts->of[white]) <= outside)
        white--;
    return part(black, white, most);
}

int sst_samples_scale(int v, struct sst_samples s)
{
    const int span = s.white ? s.white - s.black : 65535;

    return (sst_clamp_int(v - s.black, 0, span) * 255 + span / 2) / span;
}

void sst_samples_levels(int *before, int *after, const struct sst_sample_counts *counts, struct sst_samples samples)
{
    bool left[256] = { false };

    *before = *after = 0;
    for (int v = 0; v < 65536; v++) {
        *before += counts->of[v] > 0;
        left[sst_samples_scale(v, samples)] |= counts->of[v] > 0;
    }
    for (int v = 0; v < 256; v++)
        *after += left[v];
}

void sst_samples_report(const struct sst_sample_counts *counts, struct sst_samples samples, const char *name)
{
    const int black = samples.black, white = samples.white ? samples.white : 65535;
    int before, after;

    sst_samples_levels(&before, &after, counts, samples);
    if (after < before)
        sst_log_warning("%s: 16 bits become 8, so %d levels become %d: samples %d to %d become 0 to 255", name, before,
                        after, black, white);
    else if (samples.white)
        sst_log_info("%s: 16 bits become 8, none of %d levels lost: samples %d to %d become 0 to 255", name, before,
                     black, white);
}

static int read_alike(struct sst_image *const *img, const char *const *path, int count, bool upright)
{
    struct sst_sample_counts *counts = calloc(1, sizeof(*counts));
    struct sst_samples samples = { 0, 0 };
    struct sst_image made[2] = { 0 };
    uint8_t *data[2] = { NULL, NULL };
    size_t size[2];
    int err = counts ? 0 : sst_image_size_error(-ENOMEM, path[0], 0, 0), deep = 0;

    for (int i = 0; !err && i < count; i++) {
        int counted;

        err = sst_file_read(path[i], SST_IMAGE_MAX_BYTES, &data[i], &size[i]);
        counted = err ? err : sst_image_count_samples(counts, data[i], size[i], path[i]);
        err = counted < 0 ? counted : 0;
        deep += counted > 0;
    }
    if (!err && deep == count)
        samples = sst_samples_choose(counts);
    for (int i = 0; !err && i < count; i++)
        err = sst_image_decode_samples(&made[i], data[i], size[i], path[i], samples);
    for (int i = 0; !err && upright && i < count; i++) {
        err = sst_image_orient(&made[i], sst_image_orientation(data[i], size[i]));
        if (err)
            sst_image_size_error(err, path[i], made[i].width, made[i].height);
    }
    if (!err && deep)
        sst_samples_report(counts, samples, path[0]);
    for (int i = 0; i < count; i++) {
        if (err)
            sst_image_fini(&made[i]);
        else
            *img[i] = made[i];
        free(data[i]);
    }
    free(counts);
    return err;
}

int sst_image_read_alike(struct sst_image *const *img, const char *const *path, int count)
{
    return read_alike(img, path, count, false);
}

int sst_image_read_upright(struct sst_image *img, const char *path)
{
    return read_alike(&img, &path, 1, true);
}

void sst_image_report_depth(const char *path)
{
    struct sst_sample_counts *counts = calloc(1, sizeof(*counts));
    uint8_t *data = NULL;
    size_t size;

    if (counts && !sst_file_read(path, SST_IMAGE_MAX_BYTES, &data, &size) &&
        sst_image_count_samples(counts, data, size, path) > 0)
        sst_samples_report(counts, (struct sst_samples){ 0, 0 }, path);
    free(data);
    free(counts);
}
