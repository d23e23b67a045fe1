/* The shaders of networks: how many groups they need, and variants against the shader itself. */
#include "pipeline/gpu/net.h"

#include <errno.h>
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

/* --- variants ----------------------------------------------------------------------------------------------------- */

#define FIXED_WORDS 36864
#define WORDS       16384 /* of what is read, and of what is written */
#define RESIDUAL_AT 8192  /* in what is read */

struct test {
    uint32_t fixed[FIXED_WORDS], from[WORDS], to[WORDS], want[WORDS], state;
    struct sst_gpu_buffer *buffer[SST_GPU_NET_BUFFERS];
};

/* One layer of each kind: what it reads, residual and result. */
struct kind {
    int inputs, outputs, width, height, kernel, stride, dilation;
    uint32_t from, to, residual, mode;
    uint32_t relu;
    bool extreme; /* only the largest bytes of either sign */
};

static const struct kind kinds[] = {
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

static int pair(int v)
{
    return v << 16 | v;
}

static struct sst_gpu_net_conv layer_of(const struct kind *k)
{
    const int reach = k->dilation * (k->kernel - 1), pad = reach / 2;
    const int width = (k->width + 2 * pad - reach - 1) / k->stride + 1;
    const int height = (k->height + 2 * pad - reach - 1) / k->stride + 1;

    return (struct sst_gpu_net_conv){
        .from = { 5, sst_gpu_net_words(k->inputs, k->from), k->from, k->width, k->height },
        .to = { 3, sst_gpu_net_words(k->outputs, k->to) + 1, k->to, width, height },
        .channels = k->outputs,
        .kernel = pair(k->kernel),
        .stride = pair(k->stride),
        .pad = pair(pad),
        .dilation = pair(k->dilation),
        .weights_at = 256,
        .scales_at = 0,
        .bias_at = 128,
        .residual_at = RESIDUAL_AT,
        .residual_pitch = sst_gpu_net_words(k->outputs, k->residual),
        .residual_type = k->residual,
        .residual_scale = 1.03635f,
        .residual_mode = k->mode,
        .relu = k->relu,
    };
}

static void set_float(struct test *t, uint32_t *word, float scale)
{
    const float v = (float)((int)gpu_random(&t->state) - (1 << 23)) / (float)(1 << 23) * scale;

    memcpy(word, &v, sizeof(v));
}

/* Random bytes; or those at the ends of their range, mostly at one end, so that sums are large. */
static void fill_bytes(struct test *t, uint32_t *words, size_t n, const struct kind *k, bool s8)
{
    const uint32_t mostly = s8 ? 0x80808080 : 0xFFFFFFFF, rarely = s8 ? 0x7F7F7F7F : 0;

    for (size_t i = 0; i < n; i++)
        words[i] = !k->extreme                      ? gpu_random(&t->state) << 16 ^ gpu_random(&t->state)
                   : gpu_random(&t->state) % 8 != 0 ? mostly
                                                    : rarely;
}

static void fill(struct test *t, const struct kind *k)
{
    for (size_t i = 0; i < 128; i++) {
        set_float(t, t->fixed + i, 1.0f / 4000);
        set_float(t, t->fixed + 128 + i, 8000);
    }
    fill_bytes(t, t->fixed + 256, FIXED_WORDS - 256, k, true);
    fill_bytes(t, t->from, WORDS, k, k->from == SST_GPU_NET_S8);
    for (size_t i = RESIDUAL_AT; i < WORDS && k->residual == SST_GPU_NET_F32; i++)
        set_float(t, t->from + i, 8);
}

/* @param to  out */
static int run(struct sst_gpu *g, struct test *t, enum sst_gpu_shader shader, const struct kind *k, uint32_t *to)
{
    const struct sst_gpu_net_conv c = layer_of(k);
    struct sst_gpu_work work = { .shader = shader, .push = &c };
    int err = sst_gpu_upload(g, t->buffer[SST_GPU_NET_FIXED], 0, t->fixed, sizeof(t->fixed));

    memcpy(work.buffer, t->buffer, sizeof(t->buffer));
    sst_gpu_net_groups(&work);
    err = err ? err : sst_gpu_upload(g, t->buffer[SST_GPU_NET_FROM], 0, t->from, sizeof(t->from));
    err = err ? err : sst_gpu_fill(g, t->buffer[SST_GPU_NET_TO], 0, sizeof(t->to), 0);
    err = err ? err : sst_gpu_dispatch(g, &work);
    return err ? err : sst_gpu_download(g, to, t->buffer[SST_GPU_NET_TO], 0, sizeof(t->to));
}

/* Compare the bytes of a variant of net_conv8 with those of the shader itself. */
static int test_variant(struct sst_gpu *g, enum sst_gpu_shader variant)
{
    struct test *t = calloc(1, sizeof(*t));
    const size_t bytes[] = { sizeof(t->fixed), sizeof(t->from), sizeof(t->to) };
    int err = t ? sst_gpu_prepare(g, SST_GPU_NET_CONV8) : -ENOMEM;

    for (int i = 0; i < SST_GPU_NET_BUFFERS && !err; i++)
        err = sst_gpu_buffer_create(g, &t->buffer[i], bytes[i]);
    for (size_t i = 0; i < ARRAY_LEN(kinds) && !err; i++) {
        fill(t, &kinds[i]);
        err = run(g, t, SST_GPU_NET_CONV8, &kinds[i], t->want);
        err = err ? err : run(g, t, variant, &kinds[i], t->to);
        if (!err && (sst_gpu_dummy_was_wrong(g) || memcmp(t->to, t->want, sizeof(t->to))))
            err = -ENOTSUP;
    }
    for (int i = 0; t && i < SST_GPU_NET_BUFFERS; i++)
        sst_gpu_buffer_destroy(g, t->buffer[i]);
    free(t);
    return err;
}

int net_conv8_dot_self_test(struct sst_gpu *g)
{
    return test_variant(g, SST_GPU_NET_CONV8_DOT);
}

int net_conv8_matrix_self_test(struct sst_gpu *g)
{
    return test_variant(g, SST_GPU_NET_CONV8_MATRIX);
}
