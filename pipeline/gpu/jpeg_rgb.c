/* The shader `jpeg_rgb`: its reference and self-test. */
#include "pipeline/gpu/jpeg_rgb.h"

#include <errno.h>
#include <stdlib.h>

#include "pipeline/gpu/gpu_internal.h"

/* --- reference ---------------------------------------------------------------------------------------------------- */

static int sample_at(const struct sst_gpu_jpeg *p, const uint8_t *planes, int plane, int x, int y)
{
    return planes[p->at[plane] + (uint32_t)y * p->stride[plane] + (uint32_t)x];
}

/* Three parts of the nearest sample and one of the next, across and down. */
static int chroma(const struct sst_gpu_jpeg *p, const uint8_t *planes, int plane, int x, int y)
{
    const int near_x = x / 2, far_x = sst_clamp_int(x % 2 ? near_x + 1 : near_x - 1, 0, p->chroma_width - 1);
    const int near_y = y / 2, far_y = sst_clamp_int(y % 2 ? near_y + 1 : near_y - 1, 0, p->chroma_height - 1);
    int near, far;

    if (p->across == 1)
        return sample_at(p, planes, plane, x, y);
    if (p->down == 1)
        return (3 * sample_at(p, planes, plane, near_x, y) + sample_at(p, planes, plane, far_x, y) + 1 + x % 2) / 4;
    near = 3 * sample_at(p, planes, plane, near_x, near_y) + sample_at(p, planes, plane, near_x, far_y);
    far = 3 * sample_at(p, planes, plane, far_x, near_y) + sample_at(p, planes, plane, far_x, far_y);
    return (3 * near + far + 8 - x % 2) / 16;
}

static uint32_t to_byte(int v)
{
    return (uint32_t)sst_clamp_int(v, 0, 255);
}

void jpeg_rgb_reference(const void *push, void *const *buffer, const uint32_t groups[3] SST_UNUSED)
{
    const struct sst_gpu_jpeg *p = push;
    const uint8_t *planes = buffer[SST_GPU_JPEG_PLANES];
    uint32_t *frame = buffer[SST_GPU_JPEG_FRAME];

    for (int y = 0; y < p->height; y++) {
        for (int x = 0; x < p->width; x++) {
            const int luma = sample_at(p, planes, 0, x, y);
            const int cb = p->count == 3 ? chroma(p, planes, 1, x, y) - 128 : 0;
            const int cr = p->count == 3 ? chroma(p, planes, 2, x, y) - 128 : 0;
            const uint32_t r = to_byte(luma + ((91881 * cr + 32768) >> 16));              /* 1.402 */
            const uint32_t g = to_byte(luma + ((32768 - 22554 * cb - 46802 * cr) >> 16)); /* 0.344136, 0.714136 */
            const uint32_t b = to_byte(luma + ((116130 * cb + 32768) >> 16));             /* 1.772 */

            frame[y * p->width + x] = r | g << 8 | b << 16 | 0xFF000000U;
        }
    }
}

/* --- self-test ---------------------------------------------------------------------------------------------------- */

#define TEST_WIDTH  43
#define TEST_HEIGHT 21
#define TEST_STRIDE 48
#define TEST_ROWS   32

struct test {
    uint8_t planes[3][TEST_STRIDE * TEST_ROWS];
    uint32_t frame[TEST_WIDTH * TEST_HEIGHT];
};

int jpeg_rgb_self_test(struct sst_gpu *g)
{
    static const int cases[][3] = { { 3, 2, 2 }, { 3, 2, 1 }, { 3, 1, 1 }, { 1, 1, 1 } }; /* planes, across, down */
    struct test *t = calloc(1, sizeof(*t));
    uint32_t state = 3;
    int err = t ? 0 : -ENOMEM;

    for (size_t i = 0; i < sizeof(t->planes) && !err; i++)
        (&t->planes[0][0])[i] = (uint8_t)gpu_random(&state);
    for (size_t i = 0; i < ARRAY_LEN(cases) && !err; i++) {
        const struct sst_gpu_jpeg push = { .width = TEST_WIDTH,
                                           .height = TEST_HEIGHT,
                                           .count = cases[i][0],
                                           .across = cases[i][1],
                                           .down = cases[i][2],
                                           .chroma_width = (TEST_WIDTH + cases[i][1] - 1) / cases[i][1],
                                           .chroma_height = (TEST_HEIGHT + cases[i][2] - 1) / cases[i][2],
                                           .at = { 0, sizeof(t->planes[0]), 2 * sizeof(t->planes[0]) },
                                           .stride = { TEST_STRIDE, TEST_STRIDE, TEST_STRIDE } };
        const struct sst_gpu_work work = {
            .shader = SST_GPU_JPEG_RGB,
            .push = &push,
            .groups = { gpu_groups(TEST_WIDTH, SST_GPU_JPEG_GROUP_WIDTH),
                        gpu_groups(TEST_HEIGHT, SST_GPU_JPEG_GROUP_HEIGHT), 1 },
        };
        const void *const initial[] = { t->planes, t->frame };
        const size_t bytes[] = { sizeof(t->planes), sizeof(t->frame) };

        err = gpu_compare(g, &work, initial, bytes, 0, NULL);
    }
    free(t);
    return err;
}
