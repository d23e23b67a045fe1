/* Features of the learned matching cost: the network's result per pixel, in the order that the kernels read.
 *
 * The network is run over bands of rows. Between layers it holds 64 floats per pixel, twice: 384 MB for a view of 1000
 * x 750, whose pages the system would have to allocate and clear. A band costs the time of the rows around it that are
 * computed twice. */
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

/* Rows of luma with mean 0 and deviation 1 over the view, as in training. Constant views become 0. */
static void normalise(float *out, const struct sst_map_u8 *luma, const struct moments *m, int first, int count)
{
    float level[256];

    for (int i = 0; i < 256; i++)
        level[i] = m->deviation > 0 ? (float)((i - m->mean) / m->deviation) : 0.0f;
    for (int y = first; y < first + count; y++) {
        const uint8_t *row = sst_map_u8_row(luma, y);

        for (int x = 0; x < luma->width; x++)
            *out++ = level[row[x]];
    }
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
    int channels, out_w, out_h, radius, err;

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
    err = sst_network_out_shape(net, width, height, &channels, &out_w, &out_h);
    if (err || (channels == SST_FEATURE_CHANNELS && out_w == width && out_h == height))
        return err;
    sst_log_error("%s is not a matching network: it outputs %d channels of %dx%d for a view of %dx%d, not %d of the "
                  "same size; choose another --mccnn-model",
                  name, channels, out_w, out_h, width, height, SST_FEATURE_CHANNELS);
    return -EBADMSG;
}

/* Allocate the network's input and result. */
struct buffers {
    float *in;
    int8_t *out;
};

static int make_band(struct sst_descriptor *desc, struct sst_network *net, const struct moments *moments,
                     const struct buffers *buf, const struct sst_disparity_feature_band *band, int height,
                     struct sst_feature_keeper *keeper)
{
    const struct sst_network_keeper asked = { .keep = keeper ? keeper->keep : NULL, .arg = keeper };

    enum { GROUPS = SST_FEATURE_CHANNELS / 4 };
    const size_t w = (size_t)desc->width;
    int err;

    normalise(buf->in, &desc->luma, moments, band->start, height);
    if (keeper) {
        keeper->band = *band;
        keeper->width = desc->width;
        keeper->height = desc->height;
    }
    err = sst_network_run_s8_kept(net, buf->in, desc->width, height, SST_FEATURE_ONE, buf->out, keeper ? &asked : NULL);
    for (int y = band->first; !err && y < band->end; y++) {
        const int8_t *from = buf->out + SST_FEATURE_CHANNELS * w * (size_t)(y - band->start);

        for (size_t g = 0; g < GROUPS; g++)
            gather(desc->features + ((size_t)y * GROUPS + g) * desc->feature_stride, from + 4 * g, w);
    }
    return err;
}

int sst_descriptor_add_features(struct sst_descriptor *desc, struct sst_network *net, struct sst_feature_keeper *keeper)
{
    const size_t w = (size_t)desc->width, groups = SST_FEATURE_CHANNELS / 4 * (size_t)desc->height;
    const struct moments moments = measure(&desc->luma);
    struct sst_disparity_feature_bands bands;
    struct buffers buf;
    int radius, err = find_radius(net, &radius);

    if (err)
        return err;
    bands = sst_disparity_feature_bands(desc->height, radius);
    buf.in = sst_mem_alloc_raw(w * (size_t)bands.height, sizeof(float));
    buf.out = sst_mem_alloc_raw(SST_FEATURE_CHANNELS * w * (size_t)bands.height, 1);
    desc->feature_stride = feature_stride(desc->width);
    desc->feature_memory = sst_mem_alloc(groups + 2, desc->feature_stride);
    if (!buf.in || !buf.out || !desc->feature_memory)
        err = -ENOMEM;
    else
        desc->features = (uint8_t *)desc->feature_memory + desc->feature_stride;
    for (int i = 0; !err && i < bands.count; i++) {
        const struct sst_disparity_feature_band band = sst_disparity_feature_band(&bands, desc->height, radius, i);

        err = make_band(desc, net, &moments, &buf, &band, bands.height, keeper);
    }
    sst_mem_free(buf.in);
    sst_mem_free(buf.out);
    return err;
}
