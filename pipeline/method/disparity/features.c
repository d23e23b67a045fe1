/* Features of the learned matching cost: the network's result per pixel, in the order that the kernels read.
 *
 * The network is run over bands of rows. Between layers it holds 64 floats per pixel, twice: 384 MB for a view of 1000
 * x 750, whose pages the system would have to allocate and clear. A band costs the time of the rows around it that are
 * computed twice. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "base/mem.h"
#include "pipeline/method/disparity/stage.h"
#include "pipeline/method/network/network.h"

#define BAND_ROWS  256 /* about the useful rows of a band; measured: 128 need 4 % more time, a quarter less memory */
#define MAX_RADIUS 1024
#define RADIUS_KEY "sst.radius" /* metadata of the model */

static int round_up(int n)
{
    return (n + SST_FEATURE_TILE - 1) / SST_FEATURE_TILE * SST_FEATURE_TILE;
}

struct sst_disparity_feature_bands sst_disparity_feature_bands(int rows, int radius)
{
    const int above = round_up(sst_max_int(radius, 0)), beyond = above + sst_max_int(radius, 0);
    const int wanted = (rows + BAND_ROWS - 1) / BAND_ROWS;
    const int step = round_up(sst_max_int((rows - beyond + wanted - 1) / wanted, 1));
    const int least = step + beyond;
    /* All bands have the same height and share one plan; the last one ends with the view and starts on a tile. */
    const int height = least + (rows - least % SST_FEATURE_TILE) % SST_FEATURE_TILE;

    if (radius < 0 || height >= rows)
        return (struct sst_disparity_feature_bands){ 1, 0, rows };
    return (struct sst_disparity_feature_bands){ (rows - beyond + step - 1) / step, step, height };
}

struct sst_disparity_feature_band sst_disparity_feature_band(const struct sst_disparity_feature_bands *bands, int rows,
                                                             int radius, int i)
{
    const int above = round_up(sst_max_int(radius, 0)), start = i * bands->step;

    return (struct sst_disparity_feature_band){
        .start = sst_min_int(start, rows - bands->height),
        .first = i ? start + above : 0,
        .end = i + 1 < bands->count ? start + bands->step + above : rows,
    };
}

/* Mean and deviation of the luma over the whole view. */
struct moments {
    double mean, deviation;
};

static struct moments measure(const struct sst_map_u8 *luma)
{
    const int64_t n = (int64_t)luma->width * luma->height;
    int64_t s1 = 0, s2 = 0;

    for (int y = 0; y < luma->height; y++) {
        const uint8_t *row = sst_map_u8_row(luma, y);

        for (int x = 0; x < luma->width; x++) {
            s1 += row[x];
            s2 += row[x] * row[x];
        }
    }
    /* In double: n * s2 passes 2^63 from 12 million bright pixels on. Equal pixels still give exactly 0. */
    return (struct moments){ (double)s1 / (double)n,
                             sqrt(fmax((double)n * (double)s2 - (double)s1 * (double)s1, 0)) / (double)n };
}

/* Input by luma: mean 0 and deviation 1 over the view, as in training. Constant views become 0. @param level  out,
 * [256]
 */
static void find_levels(float *level, const struct sst_map_u8 *luma)
{
    const struct moments m = measure(luma);

    for (int i = 0; i < 256; i++)
        level[i] = m.deviation > 0 ? (float)((i - m.mean) / m.deviation) : 0.0f;
}

/* Bytes between groups of channels: rounded up to 64 pixels and an odd number of cache lines, so that the groups of a
 * pixel lie in different cache sets. */
static size_t feature_stride(int width)
{
    const size_t stride = 4 * (((size_t)width + 63) / 64 * 64);

    return stride + SST_ALIGN * (stride / SST_ALIGN % 2 == 0);
}

/* Gather four components of each pixel, which lie SST_FEATURE_CHANNELS apart, side by side. */
static void gather(uint8_t *restrict to, const int8_t *restrict from, size_t n)
{
    for (size_t x = 0; x < n; x++) {
        uint32_t four;

        memcpy(&four, from + SST_FEATURE_CHANNELS * x, sizeof(four));
        four ^= SST_FEATURE_ZERO * 0x01010101u; /* 128 more, in each byte */
        memcpy(to + 4 * x, &four, sizeof(four));
    }
}

/* The network's radius, or -1 if the model does not specify it. */
static int find_radius(const struct sst_network *net, int *radius)
{
    const char *text = sst_network_metadata(net, RADIUS_KEY);
    char *end;
    long value;

    *radius = -1;
    if (!text)
        return 0;
    errno = 0;
    value = strtol(text, &end, 10);
    if (errno || end == text || *end || value < 0 || value > MAX_RADIUS)
        return -EBADMSG;
    *radius = (int)value;
    return 0;
}

int sst_descriptor_check_network(struct sst_network *net, const char *name, int width, int height)
{
    struct sst_shape out;
    int radius, err;

    if (sst_network_in_channels(net) != 1) {
        sst_log_error(
            "%s is not a matching network: its input has %d channels, not luma alone; choose another --mccnn-model",
            name, sst_network_in_channels(net));
        return -EBADMSG;
    }
    err = find_radius(net, &radius);
    if (err) {
        sst_log_error("%s is not a matching network: its metadata " RADIUS_KEY
                      " is not a number from 0 to %d; choose another --mccnn-model",
                      name, MAX_RADIUS);
        return err;
    }
    height = sst_disparity_feature_bands(height, radius).height;
    err = sst_network_out_shape(net, width, height, &out);
    if (err || (out.c == SST_FEATURE_CHANNELS && out.w == width && out.h == height))
        return err;
    sst_log_error("%s is not a matching network: it outputs %d channels of %dx%d for a view of %dx%d, not %d of the "
                  "same size; choose another --mccnn-model",
                  name, out.c, out.w, out.h, width, height, SST_FEATURE_CHANNELS);
    return -EBADMSG;
}

/* Features of a view, band by band. */
struct bands {
    struct sst_descriptor *desc;
    struct sst_network *net;
    struct sst_feature_keeper *keeper; /* or NULL */
    struct sst_disparity_feature_bands cut;
    struct sst_disparity_feature_band band; /* in work */
    int radius;
    float level[256];
    float *in;   /* [cut.height][width] */
    int8_t *out; /* [cut.height][width][channels] */
};

/* The network's input. */
static void fill(const struct bands *b)
{
    float *in = b->in;

    for (int y = b->band.start; y < b->band.start + b->cut.height; y++) {
        const uint8_t *row = sst_map_u8_row(&b->desc->luma, y);

        for (int x = 0; x < b->desc->width; x++)
            *in++ = b->level[row[x]];
    }
}

int sst_descriptor_need_features(struct sst_descriptor *desc)
{
    const size_t groups = SST_FEATURE_CHANNELS / 4 * (size_t)desc->height;

    if (desc->features)
        return 0;
    desc->feature_stride = feature_stride(desc->width);
    desc->feature_memory = sst_mem_alloc(groups + 2, desc->feature_stride);
    if (!desc->feature_memory)
        return -ENOMEM;
    desc->features = (uint8_t *)desc->feature_memory + desc->feature_stride;
    return 0;
}

void sst_descriptor_gather(struct sst_descriptor *desc, const int8_t *result,
                           const struct sst_disparity_feature_band *band)
{
    enum { GROUPS = SST_FEATURE_CHANNELS / 4 };
    const size_t w = (size_t)desc->width;

    for (int y = band->first; y < band->end; y++) {
        const int8_t *from = result + SST_FEATURE_CHANNELS * w * (size_t)(y - band->start);

        for (size_t g = 0; g < GROUPS; g++)
            gather(desc->features + ((size_t)y * GROUPS + g) * desc->feature_stride, from + 4 * g, w);
    }
}

/* @param kept  out: the keeper alone has them */
static int make_band(struct bands *b, int i, bool *kept)
{
    struct sst_descriptor *desc = b->desc;
    struct sst_feature_keeper *k = b->keeper;
    const struct sst_network_keeper keeper = { .keep = k ? k->keep : NULL, .arg = k };
    int err;

    b->band = sst_disparity_feature_band(&b->cut, desc->height, b->radius, i);
    if (k) {
        k->band = b->band;
        k->width = desc->width;
        k->height = desc->height;
        k->kept = false;
    }
    fill(b);
    err = sst_network_run_s8(b->net, &(struct sst_network_bytes){ b->in, desc->width, b->cut.height, SST_FEATURE_ONE,
                                                                  b->out, k ? &keeper : NULL });
    *kept = k && k->kept;
    if (err || *kept)
        return err;
    err = sst_descriptor_need_features(desc);
    if (!err)
        sst_descriptor_gather(desc, b->out, &b->band);
    return err;
}

/* @return the number of bands that the keeper alone has, or an error */
static int make_bands(struct bands *b)
{
    int count = 0, err = 0;

    for (int i = 0; !err && i < b->cut.count; i++) {
        bool kept = false;

        err = make_band(b, i, &kept);
        count += kept;
    }
    return err ? err : count;
}

int sst_descriptor_add_features(struct sst_descriptor *desc, struct sst_network *net, struct sst_feature_keeper *keeper)
{
    const size_t w = (size_t)desc->width;
    struct bands b = { .desc = desc, .net = net, .keeper = keeper };
    int err = find_radius(net, &b.radius);

    if (err)
        return err;
    find_levels(b.level, &desc->luma);
    b.cut = sst_disparity_feature_bands(desc->height, b.radius);
    b.in = sst_mem_alloc_raw(w * (size_t)b.cut.height, sizeof(float));
    b.out = sst_mem_alloc_raw(SST_FEATURE_CHANNELS * w * (size_t)b.cut.height, 1);
    err = b.in && b.out ? make_bands(&b) : -ENOMEM;
    if (err > 0 && err < b.cut.count) { /* the keeper failed, or ran out of memory, in between */
        b.keeper = NULL;
        err = make_bands(&b);
    }
    sst_mem_free(b.in);
    sst_mem_free(b.out);
    return sst_min_int(err, 0);
}
