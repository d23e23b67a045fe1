/* Self-tests of the shaders of networks: the bytes of their references. */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/gpu/gpu_internal.h"
#include "pipeline/gpu/net.h"

#define FIXED_WORDS 36864
#define WORDS       16384 /* of what is read, and of what is written */

struct test {
    uint32_t fixed[FIXED_WORDS], from[WORDS], to[WORDS];
    uint32_t state;
};

static uint32_t next_random(struct test *t)
{
    t->state = t->state * 1664525U + 1013904223U;
    return t->state >> 8;
}

static void set_float(uint32_t *word, float v)
{
    memcpy(word, &v, sizeof(v));
}

/* Numbers of all sizes around 1, and zeros. */
static float any_float(struct test *t)
{
    const float v = (float)((int)next_random(t) - (1 << 23)) / (float)(1 << (20 + next_random(t) % 8));

    return next_random(t) % 16 ? v : 0;
}

static void fill_floats(struct test *t, uint32_t *words, size_t n)
{
    for (size_t i = 0; i < n; i++)
        set_float(words + i, any_float(t));
}

static void fill_bytes(struct test *t, uint32_t *words, size_t n)
{
    for (size_t i = 0; i < n; i++)
        words[i] = next_random(t) << 16 ^ next_random(t);
}

static struct test *test_create(void)
{
    struct test *t = calloc(1, sizeof(*t));

    if (t)
        t->state = 11;
    return t;
}

/* Run a layer on the device and by its reference. @return -ENOTSUP: results differ */
static int compare(struct sst_gpu *g, struct test *t, enum sst_gpu_shader shader, const void *push)
{
    const void *const initial[SST_GPU_BUFFERS] = { t->fixed, t->from, t->to };
    const size_t bytes[SST_GPU_BUFFERS] = { sizeof(t->fixed), sizeof(t->from), sizeof(t->to) };
    uint8_t *device[SST_GPU_BUFFERS], *host[SST_GPU_BUFFERS];
    struct sst_gpu_work work = { .shader = shader, .push = push };
    int err;

    sst_gpu_net_groups(&work);
    err = gpu_run_both(g, &work, initial, bytes, device, host);
    if (err)
        return err;
    err = memcmp(device[SST_GPU_NET_TO], host[SST_GPU_NET_TO], sizeof(t->to)) ? -ENOTSUP : 0;
    for (int i = 0; i < SST_GPU_NET_BUFFERS; i++) {
        free(device[i]);
        free(host[i]);
    }
    return err;
}

static int pair(int y, int x)
{
    return y << 16 | x;
}

/* --- convolutions ------------------------------------------------------------------------------------------------- */

#define RESIDUAL_AT 8192 /* in what is read */

/* One layer of each kind: what it reads, residual and result. */
struct kind {
    int inputs, outputs, width, height, kernel, stride, dilation;
    uint32_t from, to, residual, mode;
    uint32_t relu;
    bool extreme; /* only the largest bytes of either sign */
};

static const struct kind kinds8[] = {
    { 32, 64, 13, 9, 3, 2, 1, SST_GPU_NET_U8, SST_GPU_NET_U8, 0, SST_GPU_NET_NONE, 1 },
    { 128, 24, 7, 5, 3, 1, 2, SST_GPU_NET_U8, SST_GPU_NET_U8, SST_GPU_NET_U8, SST_GPU_NET_FUSED, 1 },
    { 20, 23, 11, 8, 1, 1, 1, SST_GPU_NET_U8, SST_GPU_NET_F32, 0, SST_GPU_NET_NONE, 0 },
    { 64, 40, 9, 9, 3, 1, 4, SST_GPU_NET_S8, SST_GPU_NET_S8, SST_GPU_NET_S8, SST_GPU_NET_FUSED, 0 },
    { 24, 33, 10, 6, 3, 1, 1, SST_GPU_NET_S8, SST_GPU_NET_F32, SST_GPU_NET_F32, SST_GPU_NET_UNFUSED, 1 },
    { 7, 5, 6, 6, 5, 2, 1, SST_GPU_NET_U8, SST_GPU_NET_F32, SST_GPU_NET_U8, SST_GPU_NET_UNFUSED, 0 },
    { 36, 72, 9, 8, 1, 1, 1, SST_GPU_NET_U8, SST_GPU_NET_F32, 0, SST_GPU_NET_NONE, 0 },
    { 100, 8, 6, 5, 3, 1, 1, SST_GPU_NET_U8, SST_GPU_NET_F32, 0, SST_GPU_NET_NONE, 0, true },
    { 100, 8, 6, 5, 3, 1, 1, SST_GPU_NET_S8, SST_GPU_NET_F32, 0, SST_GPU_NET_NONE, 0, true },
};

static const struct kind kinds[] = {
    { 3, 32, 13, 9, 3, 2, 1, SST_GPU_NET_F32, SST_GPU_NET_F32, 0, SST_GPU_NET_NONE, 1 },
    { 1, 64, 10, 7, 3, 1, 1, SST_GPU_NET_F32, SST_GPU_NET_U8, 0, SST_GPU_NET_NONE, 1 },
    { 20, 23, 9, 7, 3, 1, 2, SST_GPU_NET_F32, SST_GPU_NET_S8, SST_GPU_NET_F32, SST_GPU_NET_UNFUSED, 0 },
    { 40, 36, 8, 7, 1, 1, 1, SST_GPU_NET_F32, SST_GPU_NET_F32, SST_GPU_NET_U8, SST_GPU_NET_UNFUSED, 1 },
};

static struct sst_gpu_net_conv layer_of(const struct kind *k)
{
    const int reach = k->dilation * (k->kernel - 1), pad = reach / 2;
    const int width = (k->width + 2 * pad - reach - 1) / k->stride + 1;
    const int height = (k->height + 2 * pad - reach - 1) / k->stride + 1;

    return (struct sst_gpu_net_conv){
        .from = { 5, sst_gpu_net_words(k->inputs, k->from), k->from, k->width, k->height },
        .to = { 3, sst_gpu_net_words(k->outputs, k->to) + 1, k->to, width, height },
        .channels = k->outputs,
        .kernel = pair(k->kernel, k->kernel),
        .stride = pair(k->stride, k->stride),
        .pad = pair(pad, pad),
        .dilation = pair(k->dilation, k->dilation),
        .weights_at = 256,
        .scales_at = 0,
        .bias_at = 128,
        .residual_at = RESIDUAL_AT,
        .residual_pitch = sst_gpu_net_words(k->outputs, k->residual),
        .residual_type = k->residual,
        .residual_scale = 1.03635f,
        .residual_mode = k->mode,
        .out_scale = 23.7f,
        .relu = k->relu,
    };
}

/* Bytes at the ends of their range, mostly at one end, so that sums are large. */
static void fill_extreme(struct test *t, uint32_t *words, size_t n, uint32_t mostly, uint32_t rarely)
{
    for (size_t i = 0; i < n; i++)
        words[i] = next_random(t) % 8 ? mostly : rarely;
}

static int test_conv(struct sst_gpu *g, struct test *t, const struct kind *k, enum sst_gpu_shader shader)
{
    const bool bytes = shader != SST_GPU_NET_CONV;
    struct sst_gpu_net_conv c = layer_of(k);

    c.by_parts = !g->fuses;
    c.bias_first = k->relu;
    for (uint32_t i = 0; i < 128; i++) {
        set_float(t->fixed + i, (1 + (float)(next_random(t) % 64) / 64) / 4000);
        set_float(t->fixed + 128 + i, any_float(t) * 1000);
    }
    if (k->extreme) {
        fill_extreme(t, t->fixed + 256, FIXED_WORDS - 256, 0x80808080, 0x7F7F7F7F);
        fill_extreme(t, t->from, RESIDUAL_AT, k->from == SST_GPU_NET_S8 ? 0x80808080 : 0xFFFFFFFF,
                     k->from == SST_GPU_NET_S8 ? 0x7F7F7F7F : 0);
    } else if (bytes) {
        fill_bytes(t, t->fixed + 256, FIXED_WORDS - 256);
        fill_bytes(t, t->from, RESIDUAL_AT);
    } else {
        fill_floats(t, t->fixed + 256, FIXED_WORDS - 256);
        fill_floats(t, t->from, RESIDUAL_AT);
    }
    if (k->residual == SST_GPU_NET_F32)
        fill_floats(t, t->from + RESIDUAL_AT, WORDS - RESIDUAL_AT);
    else
        fill_bytes(t, t->from + RESIDUAL_AT, WORDS - RESIDUAL_AT);
    return compare(g, t, shader, &c);
}

static int test_convs(struct sst_gpu *g, const struct kind *k, size_t n, enum sst_gpu_shader shader)
{
    struct test *t = test_create();
    int err = t ? 0 : -ENOMEM;

    for (size_t i = 0; i < n && !err; i++)
        err = test_conv(g, t, &k[i], shader);
    free(t);
    return err;
}

int net_conv8_self_test(struct sst_gpu *g)
{
    return test_convs(g, kinds8, ARRAY_LEN(kinds8), SST_GPU_NET_CONV8);
}

int net_conv8_dot_self_test(struct sst_gpu *g)
{
    return test_convs(g, kinds8, ARRAY_LEN(kinds8), SST_GPU_NET_CONV8_DOT);
}

int net_conv8_matrix_self_test(struct sst_gpu *g)
{
    return test_convs(g, kinds8, ARRAY_LEN(kinds8), SST_GPU_NET_CONV8_MATRIX);
}

/* With the device's own fma(), and where that rounds twice, without. */
int net_conv_self_test(struct sst_gpu *g)
{
    int err;

    g->fuses = true;
    err = test_convs(g, kinds, ARRAY_LEN(kinds), SST_GPU_NET_CONV);
    if (err != -ENOTSUP)
        return err;
    g->fuses = false;
    return test_convs(g, kinds, ARRAY_LEN(kinds), SST_GPU_NET_CONV);
}

/* --- the other layers --------------------------------------------------------------------------------------------- */

static struct sst_gpu_net_tensor tensor(uint32_t type, int channels, int width, int height)
{
    return (struct sst_gpu_net_tensor){ 6,
                                        type == SST_GPU_NET_PLANES ? (uint32_t)(width * height) + 1
                                                                   : sst_gpu_net_words(channels, type),
                                        type, width, height };
}

int net_move_self_test(struct sst_gpu *g)
{
    static const uint32_t types[][2] = {
        { SST_GPU_NET_PLANES, SST_GPU_NET_F32 }, { SST_GPU_NET_F32, SST_GPU_NET_PLANES },
        { SST_GPU_NET_F32, SST_GPU_NET_U8 },     { SST_GPU_NET_F32, SST_GPU_NET_S8 },
        { SST_GPU_NET_U8, SST_GPU_NET_F32 },     { SST_GPU_NET_S8, SST_GPU_NET_F32 },
        { SST_GPU_NET_U8, SST_GPU_NET_U8 },      { SST_GPU_NET_S8, SST_GPU_NET_S8 },
    };
    struct test *t = test_create();
    int err = t ? 0 : -ENOMEM;

    for (size_t i = 0; i < ARRAY_LEN(types) && !err; i++) {
        const bool floats = types[i][0] == SST_GPU_NET_PLANES || types[i][0] == SST_GPU_NET_F32;
        const struct sst_gpu_net_layer l = { .from = tensor(types[i][0], 23, 17, 9),
                                             .to = tensor(types[i][1], 23, 17, 9),
                                             .channels = 23,
                                             .scale = floats ? 18.05463f : 0.7713f };

        (floats ? fill_floats : fill_bytes)(t, t->from, WORDS);
        err = compare(g, t, SST_GPU_NET_MOVE, &l);
    }
    free(t);
    return err;
}

/* Larger, smaller, and from one pixel. */
int net_resize_self_test(struct sst_gpu *g)
{
    static const int sizes[][4] = { { 6, 5, 17, 9 }, { 17, 9, 6, 5 }, { 1, 1, 7, 7 } };
    struct test *t = test_create();
    int err = t ? 0 : -ENOMEM;

    for (size_t i = 0; i < 2 * ARRAY_LEN(sizes) && !err; i++) {
        const int *s = sizes[i / 2];
        const struct sst_gpu_net_layer l = { .from = tensor(i % 2 ? SST_GPU_NET_U8 : SST_GPU_NET_F32, 20, s[0], s[1]),
                                             .to = tensor(SST_GPU_NET_F32, 20, s[2], s[3]),
                                             .channels = 20,
                                             .scale = i % 2 ? 0.7713f : 1,
                                             .taps_at = 9 };
        struct sst_gpu_net_tap *tap = (void *)(t->fixed + 9);

        for (int k = 0; k < s[3] + s[2]; k++) {
            const int most = k < s[3] ? s[1] - 1 : s[0] - 1, lo = (int)next_random(t) % (most + 1);

            tap[k] =
                (struct sst_gpu_net_tap){ lo, lo < most ? lo + 1 : lo, (float)(next_random(t) % 65536) / 65536.0f };
        }
        (i % 2 ? fill_bytes : fill_floats)(t, t->from, WORDS);
        err = compare(g, t, SST_GPU_NET_RESIZE, &l);
    }
    free(t);
    return err;
}

int net_pool_self_test(struct sst_gpu *g)
{
    static const int bins[] = { 1, 2, 3, 6 };
    struct test *t = test_create();
    int err = t ? 0 : -ENOMEM;

    for (size_t i = 0; i < 2 * ARRAY_LEN(bins) && !err; i++) {
        const int n = bins[i / 2];
        const struct sst_gpu_net_layer l = { .from = tensor(i % 2 ? SST_GPU_NET_U8 : SST_GPU_NET_F32, 24, 29, 17),
                                             .to = tensor(SST_GPU_NET_F32, 24, n, n),
                                             .channels = 24,
                                             .scale = i % 2 ? 0.0560313f : 1 };

        (i % 2 ? fill_bytes : fill_floats)(t, t->from, WORDS);
        err = compare(g, t, SST_GPU_NET_POOL, &l);
    }
    free(t);
    return err;
}

int net_unit_self_test(struct sst_gpu *g)
{
    struct test *t = test_create();
    struct sst_gpu_net_layer l = { .from = tensor(SST_GPU_NET_F32, 64, 19, 11),
                                   .to = tensor(SST_GPU_NET_S8, 64, 19, 11),
                                   .channels = 64,
                                   .scale = 1,
                                   .factor = 127,
                                   .min = 1e-12f };
    int err = t ? 0 : -ENOMEM;

    if (!err) {
        fill_floats(t, t->from, WORDS);
        memset(t->from + l.from.at + l.from.pitch, 0, l.from.pitch * sizeof(*t->from)); /* no length */
        err = compare(g, t, SST_GPU_NET_UNIT, &l);
    }
    if (!err) {
        l.in_add = 0.25f;
        l.in_min = 300;
        l.add = 0.125f;
        err = compare(g, t, SST_GPU_NET_UNIT, &l);
    }
    free(t);
    return err;
}
