/* Features of the learned matching cost: the network's result for each pixel, in the order that the kernels read.
 *
 * The network is run over bands of rows. What it holds between its layers is 64 floats a pixel, twice: 384 MB for a view
 * of 1000 x 750, of which the system would have to find and clear every page. A band costs the time of the rows around it
 * that are computed twice. */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "base/mem.h"
#include "pipeline/disparity/stage.h"
#include "pipeline/network/network.h"

#define BAND_ROWS  128 /* that a band keeps, at most; measured: 64 cost 5 % more time, 256 nearly twice the memory */
#define MAX_RADIUS 1024
#define RADIUS_KEY "sst.radius" /* metadata of the model */

static int round_up(int n)
{
    return (n + SST_FEATURE_TILE - 1) / SST_FEATURE_TILE * SST_FEATURE_TILE;
}

struct sst_feature_bands sst_feature_bands(int rows, int radius)
{
    const int wanted = (rows + BAND_ROWS - 1) / BAND_ROWS;
    const int kept = round_up((rows + wanted - 1) / wanted);
    /* All bands are of one height, so that one plan serves; the last one ends with the view and starts on a tile. */
    const int least = kept + radius + round_up(radius), height = least + (rows - least % SST_FEATURE_TILE) % SST_FEATURE_TILE;

    if (radius < 0 || height >= rows)
        return (struct sst_feature_bands){ 1, rows, rows };
    return (struct sst_feature_bands){ (rows + kept - 1) / kept, kept, height };
}

int sst_feature_band_start(const struct sst_feature_bands *bands, int rows, int radius, int i)
{
    return sst_clamp_int(i * bands->kept - round_up(sst_max_int(radius, 0)), 0, rows - bands->height);
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

/* Rows of luma with mean 0 and deviation 1 over the view: what the network was trained on. Constant views become 0. */
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

/* Bytes between groups of channels: every 64 pixels begun, and an odd number of cache lines, so that the groups of a pixel
 * lie in different sets of the cache. */
static size_t feature_stride(int width)
{
    const size_t stride = 4 * (((size_t)width + 63) / 64 * 64);

    return stride + SST_ALIGN * (stride / SST_ALIGN % 2 == 0);
}

/* Four components of each pixel, from where they lie SST_FEATURE_CHANNELS apart to side by side. */
static void gather(uint8_t *restrict to, const int8_t *restrict from, size_t n)
{
    for (size_t x = 0; x < n; x++) {
        for (size_t c = 0; c < 4; c++)
            to[4 * x + c] = (uint8_t)(SST_FEATURE_ZERO + from[SST_FEATURE_CHANNELS * x + c]);
    }
}

/* The network's radius, or -1 where the model does not tell. */
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
    if (errno || end == text || *end || value < 0 || value > MAX_RADIUS) {
        sst_log_error("the matching network's metadata " RADIUS_KEY " is '%.40s', not a number from 0 to %d; "
                      "give --mccnn-model another one", text, MAX_RADIUS);
        return -EBADMSG;
    }
    *radius = (int)value;
    return 0;
}

static int check_shape(struct sst_network *net, int width, int height)
{
    int channels, out_w, out_h, err;

    if (sst_network_in_channels(net) != 1) {
        sst_log_error("the matching network reads %d channels, not 1; give --mccnn-model another one",
                      sst_network_in_channels(net));
        return -EBADMSG;
    }
    err = sst_network_out_shape(net, width, height, &channels, &out_w, &out_h);
    if (err || (channels == SST_FEATURE_CHANNELS && out_w == width && out_h == height))
        return err;
    sst_log_error("the matching network makes %d channels of %dx%d from a view of %dx%d, not %d of the same size; "
                  "give --mccnn-model another one", channels, out_w, out_h, width, height, SST_FEATURE_CHANNELS);
    return -EBADMSG;
}

/* Rows that the network reads, with memory for its input and result, and the rows first..end-1 of them that are kept. */
struct band {
    int start, height, first, end;
    float *in;
    int8_t *out;
};

static int make_band(struct sst_descriptor *desc, struct sst_network *net, const struct moments *moments,
                     const struct band *b)
{
    enum { GROUPS = SST_FEATURE_CHANNELS / 4 };
    const size_t w = (size_t)desc->width;
    int err;

    normalise(b->in, &desc->luma, moments, b->start, b->height);
    err = sst_network_run_s8(net, b->in, desc->width, b->height, SST_FEATURE_ONE, b->out);
    for (int y = b->first; !err && y < b->end; y++) {
        const int8_t *from = b->out + SST_FEATURE_CHANNELS * w * (size_t)(y - b->start);

        for (size_t g = 0; g < GROUPS; g++)
            gather(desc->features + ((size_t)y * GROUPS + g) * desc->feature_stride, from + 4 * g, w);
    }
    return err;
}

int sst_descriptor_add_features(struct sst_descriptor *desc, struct sst_network *net)
{
    const size_t w = (size_t)desc->width, groups = SST_FEATURE_CHANNELS / 4 * (size_t)desc->height;
    const struct moments moments = measure(&desc->luma);
    struct sst_feature_bands bands;
    struct band band = { 0 };
    int radius, err = find_radius(net, &radius);

    if (err)
        return err;
    bands = sst_feature_bands(desc->height, radius);
    err = check_shape(net, desc->width, bands.height);
    if (err)
        return err;
    band.height = bands.height;
    band.in = sst_mem_alloc_raw(w * (size_t)bands.height, sizeof(float));
    band.out = sst_mem_alloc_raw(SST_FEATURE_CHANNELS * w * (size_t)bands.height, 1);
    desc->feature_stride = feature_stride(desc->width);
    desc->feature_memory = sst_mem_alloc(groups + 2, desc->feature_stride);
    if (!band.in || !band.out || !desc->feature_memory)
        err = -ENOMEM;
    else
        desc->features = (uint8_t *)desc->feature_memory + desc->feature_stride;
    for (int i = 0; !err && i < bands.count; i++) {
        band.start = sst_feature_band_start(&bands, desc->height, radius, i);
        band.first = i * bands.kept;
        band.end = sst_min_int(band.first + bands.kept, desc->height);
        err = make_band(desc, net, &moments, &band);
    }
    sst_mem_free(band.in);
    sst_mem_free(band.out);
    return err;
}
