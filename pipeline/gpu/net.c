/* The shaders of networks: their references, and how many groups they need. */
#include "pipeline/gpu/net.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/gpu/gpu_internal.h"

_Static_assert(sizeof(struct sst_gpu_net_conv) == 108 && sizeof(struct sst_gpu_net_layer) == 72,
               "the layout of net_*.comp; every device has 128 bytes of constants");

/* --- layout ------------------------------------------------------------------------------------------------------- */

static int above(int v)
{
    return v >> 16;
}

static int below(int v)
{
    return v & 0xFFFF;
}

static uint32_t divide_up(uint32_t a, uint32_t b)
{
    return (a + b - 1) / b;
}

/* Words of a kernel, in slabs. */
static uint32_t kernel_words(const struct sst_gpu_net_conv *c)
{
    const uint32_t words = (uint32_t)(above(c->kernel) * below(c->kernel)) * c->from.pitch;

    return divide_up(words, SST_GPU_NET_SLAB) * SST_GPU_NET_SLAB;
}

static uint32_t padded_channels(const struct sst_gpu_net_conv *c)
{
    return divide_up((uint32_t)c->channels, SST_GPU_NET_TILE_OUT) * SST_GPU_NET_TILE_OUT;
}

uint64_t sst_gpu_net_weights(const struct sst_gpu_net_conv *c)
{
    return (uint64_t)kernel_words(c) * padded_channels(c);
}

bool sst_gpu_net_is_conv(enum sst_gpu_shader shader)
{
    return shader == SST_GPU_NET_CONV || shader == SST_GPU_NET_CONV8 || shader == SST_GPU_NET_CONV8_DOT ||
           shader == SST_GPU_NET_CONV8_MATRIX;
}

void sst_gpu_net_groups(struct sst_gpu_work *work)
{
    if (sst_gpu_net_is_conv(work->shader)) {
        const bool matrix = work->shader == SST_GPU_NET_CONV8_MATRIX;
        const struct sst_gpu_net_conv *c = work->push;

        work->groups[0] =
            divide_up((uint32_t)c->to.width * (uint32_t)c->to.height, matrix ? SST_GPU_NET_MATRIX : SST_GPU_NET_TILE);
        work->groups[1] = divide_up((uint32_t)c->channels, matrix ? SST_GPU_NET_MATRIX_OUT : SST_GPU_NET_TILE_OUT);
    } else {
        const struct sst_gpu_net_layer *l = work->push;
        const uint32_t fours = divide_up((uint32_t)l->channels, 4);
        const uint32_t across = (uint32_t)l->to.width * (work->shader == SST_GPU_NET_UNIT ? 1 : fours);

        work->groups[0] = work->shader == SST_GPU_NET_POOL ? across : divide_up(across, SST_GPU_NET_GROUP);
        work->groups[1] = (uint32_t)l->to.height;
    }
    work->groups[2] = 1;
}

/* --- values ------------------------------------------------------------------------------------------------------- */

static float as_float(uint32_t word)
{
    float v;

    memcpy(&v, &word, sizeof(v));
    return v;
}

static bool is_bytes(uint32_t type)
{
    return type == SST_GPU_NET_U8 || type == SST_GPU_NET_S8;
}

/* What is stored for a channel of a pixel. */
static float stored(const uint32_t *from, uint32_t at, uint32_t pitch, uint32_t type, size_t pixel, size_t channel)
{
    const uint8_t *bytes = (const uint8_t *)(from + at + pixel * pitch);

    if (type == SST_GPU_NET_PLANES)
        return as_float(from[at + channel * pitch + pixel]);
    if (type == SST_GPU_NET_F32)
        return as_float(from[at + pixel * pitch + channel]);
    return (float)(type == SST_GPU_NET_U8 ? (int)bytes[channel] : (int)(int8_t)bytes[channel]);
}

/* Channels of planes that there are not are 0. */
static float load(const uint32_t *from, const struct sst_gpu_net_layer *l, size_t pixel, size_t channel)
{
    if (l->from.type == SST_GPU_NET_PLANES && channel >= (size_t)l->channels)
        return 0;
    return stored(from, l->from.at, l->from.pitch, l->from.type, pixel, channel) * l->scale;
}

static void store(uint32_t *to, const struct sst_gpu_net_tensor *t, int channels, size_t pixel, size_t channel,
                  float value)
{
    const float low = t->type == SST_GPU_NET_U8 ? 0 : -128, high = t->type == SST_GPU_NET_U8 ? 255 : 127;
    uint8_t *bytes = (uint8_t *)(to + t->at + pixel * t->pitch);

    if (t->type == SST_GPU_NET_F32)
        memcpy(to + t->at + pixel * t->pitch + channel, &value, sizeof(value));
    else if (is_bytes(t->type))
        bytes[channel] = (uint8_t)(int)rintf(fminf(fmaxf(value, low), high));
    else if (channel < (size_t)channels)
        memcpy(to + t->at + channel * t->pitch + pixel, &value, sizeof(value));
}

/* --- convolutions ------------------------------------------------------------------------------------------------- */

struct conv {
    const struct sst_gpu_net_conv *c;
    const uint32_t *fixed, *from;
};

/* Where a tap of a pixel of the result lies in the input; -1: outside. */
static ptrdiff_t tap_at(const struct sst_gpu_net_conv *c, size_t pixel, int ky, int kx)
{
    const int width = c->to.width;
    const int y = (int)pixel / width * above(c->stride) - above(c->pad) + ky * above(c->dilation);
    const int x = (int)pixel % width * below(c->stride) - below(c->pad) + kx * below(c->dilation);

    return y < 0 || x < 0 || y >= c->from.height || x >= c->from.width ? -1 : (ptrdiff_t)y * c->from.width + x;
}

/* Add the products of one input, which the words of its weights hold from bit `shift` on, to the sums of all channels.
 */
static void add_bytes(int32_t *restrict sum, const uint32_t *restrict weight, int shift, int x, size_t channels)
{
    for (size_t o = 0; o < channels; o++)
        sum[o] += x * (int8_t)(weight[o] >> shift);
}

/* Sums of all channels of a pixel. */
static void sum_bytes(const struct conv *v, size_t pixel, int32_t *sum, size_t channels)
{
    const struct sst_gpu_net_conv *c = v->c;
    const size_t outs = padded_channels(c), inputs = c->from.pitch;
    const uint32_t *weight = v->fixed + c->weights_at;

    memset(sum, 0, channels * sizeof(*sum));
    for (int i = 0; i < above(c->kernel) * below(c->kernel); i++, weight += inputs * outs) {
        const ptrdiff_t at = tap_at(c, pixel, i / below(c->kernel), i % below(c->kernel));
        const uint8_t *x = (const uint8_t *)(v->from + c->from.at + (size_t)(at < 0 ? 0 : at) * c->from.pitch);

        for (size_t k = 0; k < 4 * inputs && at >= 0; k++)
            add_bytes(sum, weight + k / 4 * outs, 8 * (int)(k % 4),
                      c->from.type == SST_GPU_NET_U8 ? (int)x[k] : (int)(int8_t)x[k], channels);
    }
}

static void sum_floats(const struct conv *v, size_t pixel, float *sum, size_t channels)
{
    const struct sst_gpu_net_conv *c = v->c;
    const size_t outs = padded_channels(c), inputs = c->from.pitch;
    const uint32_t *weight = v->fixed + c->weights_at;

    for (size_t o = 0; o < channels; o++)
        sum[o] = c->bias_first ? as_float(v->fixed[c->bias_at + o]) : 0;
    for (int i = 0; i < above(c->kernel) * below(c->kernel); i++) {
        const ptrdiff_t at = tap_at(c, pixel, i / below(c->kernel), i % below(c->kernel));

        for (size_t k = 0; k < inputs; k++, weight += outs) {
            const float x = at < 0 ? 0 : stored(v->from, c->from.at, c->from.pitch, SST_GPU_NET_F32, (size_t)at, k);

            for (size_t o = 0; o < channels; o++)
                sum[o] = fmaf(x, as_float(weight[o]), sum[o]);
        }
    }
}

/* Residual, relu, result. @param factor  of what is stored as bytes */
static void finish(const struct conv *v, uint32_t *to, size_t pixel, size_t channel, float value, float factor)
{
    const struct sst_gpu_net_conv *c = v->c;

    if (c->residual_mode != SST_GPU_NET_NONE) {
        const float q = stored(v->from, c->residual_at, c->residual_pitch, c->residual_type, pixel, channel);

        value =
            c->residual_mode == SST_GPU_NET_FUSED ? fmaf(q, c->residual_scale, value) : value + q * c->residual_scale;
    }
    if (c->relu)
        value = value > 0 ? value : 0;
    store(to, &c->to, c->channels, pixel, channel, is_bytes(c->to.type) ? value * factor : value);
}

static float fixed_float(const struct conv *v, uint32_t at, size_t channel)
{
    return as_float(v->fixed[at + channel]);
}

void net_conv8_reference(const void *push, void *const *buffer, const uint32_t groups[3] SST_UNUSED)
{
    const struct sst_gpu_net_conv *c = push;
    const struct conv v = { c, buffer[SST_GPU_NET_FIXED], buffer[SST_GPU_NET_FROM] };
    const size_t channels = ((size_t)c->channels + 3) / 4 * 4;
    int32_t *sum = malloc(channels * sizeof(*sum));

    assert(sum);
    for (size_t i = 0; i < (size_t)c->to.width * (size_t)c->to.height; i++) {
        sum_bytes(&v, i, sum, channels);
        for (size_t k = 0; k < channels; k++) {
            const float value = (float)sum[k] + fixed_float(&v, c->bias_at, k);

            finish(&v, buffer[SST_GPU_NET_TO], i, k, value * fixed_float(&v, c->scales_at, k), 1);
        }
    }
    free(sum);
}

void net_conv_reference(const void *push, void *const *buffer, const uint32_t groups[3] SST_UNUSED)
{
    const struct sst_gpu_net_conv *c = push;
    const struct conv v = { c, buffer[SST_GPU_NET_FIXED], buffer[SST_GPU_NET_FROM] };
    const size_t channels = ((size_t)c->channels + 3) / 4 * 4;
    float *sum = malloc(channels * sizeof(*sum));

    assert(sum);
    for (size_t i = 0; i < (size_t)c->to.width * (size_t)c->to.height; i++) {
        sum_floats(&v, i, sum, channels);
        for (size_t k = 0; k < channels; k++)
            finish(&v, buffer[SST_GPU_NET_TO], i, k, c->bias_first ? sum[k] : sum[k] + fixed_float(&v, c->bias_at, k),
                   c->out_scale);
    }
    free(sum);
}

/* --- the other layers --------------------------------------------------------------------------------------------- */

void net_move_reference(const void *push, void *const *buffer, const uint32_t groups[3] SST_UNUSED)
{
    const struct sst_gpu_net_layer *l = push;

    for (size_t i = 0; i < (size_t)l->to.width * (size_t)l->to.height; i++) {
        for (size_t k = 0; k < ((size_t)l->channels + 3) / 4 * 4; k++)
            store(buffer[SST_GPU_NET_TO], &l->to, l->channels, i, k, load(buffer[SST_GPU_NET_FROM], l, i, k));
    }
}

void net_resize_reference(const void *push, void *const *buffer, const uint32_t groups[3] SST_UNUSED)
{
    const struct sst_gpu_net_layer *l = push;
    const uint32_t *from = buffer[SST_GPU_NET_FROM];
    const struct sst_gpu_net_tap *down = (const void *)((uint32_t *)buffer[SST_GPU_NET_FIXED] + l->taps_at);
    const struct sst_gpu_net_tap *across = down + l->to.height;
    const size_t width = (size_t)l->to.width;

    for (size_t i = 0; i < width * (size_t)l->to.height; i++) {
        const struct sst_gpu_net_tap y = down[i / width], x = across[i % width];
        const size_t top = (size_t)y.lo * (size_t)l->from.width, bottom = (size_t)y.hi * (size_t)l->from.width;

        for (size_t k = 0; k < ((size_t)l->channels + 3) / 4 * 4; k++) {
            const float tl = load(from, l, top + (size_t)x.lo, k), tr = load(from, l, top + (size_t)x.hi, k);
            const float bl = load(from, l, bottom + (size_t)x.lo, k), br = load(from, l, bottom + (size_t)x.hi, k);
            const float t = tl + x.part * (tr - tl), u = bl + x.part * (br - bl);

            store(buffer[SST_GPU_NET_TO], &l->to, l->channels, i, k, t + y.part * (u - t));
        }
    }
}

void net_pool_reference(const void *push, void *const *buffer, const uint32_t groups[3] SST_UNUSED)
{
    const struct sst_gpu_net_layer *l = push;
    const int width = l->to.width, height = l->to.height;

    for (int i = 0; i < width * height; i++) {
        const int y0 = i / width * l->from.height / height, x0 = i % width * l->from.width / width;
        const int y1 = ((i / width + 1) * l->from.height + height - 1) / height;
        const int x1 = ((i % width + 1) * l->from.width + width - 1) / width;

        for (size_t k = 0; k < ((size_t)l->channels + 3) / 4 * 4; k++) {
            double sum = 0;

            for (int y = y0; y < y1; y++) {
                for (int x = x0; x < x1; x++)
                    sum += (double)load(buffer[SST_GPU_NET_FROM], l, (size_t)y * (size_t)l->from.width + (size_t)x, k);
            }
            store(buffer[SST_GPU_NET_TO], &l->to, l->channels, (size_t)i, k,
                  (float)(sum / ((double)(y1 - y0) * (x1 - x0))));
        }
    }
}

/* Sum of the squares of n numbers, in eight lanes. */
static double sum_of_squares(const uint32_t *x, size_t n)
{
    float lane[8] = { 0 };
    double sum = 0;

    for (size_t k = 0; k < n; k++)
        lane[k % 8] += as_float(x[k]) * as_float(x[k]);
    for (int i = 0; i < 8; i++)
        sum += (double)lane[i];
    return sum;
}

void net_unit_reference(const void *push, void *const *buffer, const uint32_t groups[3] SST_UNUSED)
{
    const struct sst_gpu_net_layer *l = push;
    const size_t n = (size_t)l->channels;

    for (size_t i = 0; i < (size_t)l->to.width * (size_t)l->to.height; i++) {
        const uint32_t *x = (const uint32_t *)buffer[SST_GPU_NET_FROM] + l->from.at + i * l->from.pitch;
        uint8_t *to = (uint8_t *)((uint32_t *)buffer[SST_GPU_NET_TO] + l->to.at + i * l->to.pitch);
        const double inside = fmax(sum_of_squares(x, n) + (double)l->in_add, (double)l->in_min);
        const double length = fmax(sqrt(inside) + (double)l->add, (double)l->min);
        const float by = length > 0 ? (float)((double)l->factor / length) : 0;

        for (size_t k = 0; k < n; k++) {
            const float v = fminf(fmaxf(as_float(x[k]) * by, -127), 127);

            to[k] = (uint8_t)(int)(v + (v < 0 ? -0.5f : 0.5f));
        }
    }
}
