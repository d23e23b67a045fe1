/* The shaders `vote`, `label_carry` and `label_fill`: their references and self-tests. */
#include "pipeline/gpu/label.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/gpu/gpu_internal.h"

_Static_assert(sizeof(struct sst_gpu_label_carry) <= 128, "Vulkan guarantees 128 bytes of push constants");

#define NONE     65535
#define INFINITE 0x7F800000U
#define SAME     64 /* 1/64 px: disparities of one surface differ by at most this */
#define SIMILAR  24 /* levels: views vote where their colours differ by at most this in every channel */

/* Index of the pixel of another view, which has `rows` rows, that shows the surface of pixel i of n; -1: none does. */
static int place_of(const struct sst_gpu_shift *s, const uint32_t *there, const uint32_t *own, int n, int width,
                    int rows, int i)
{
    const int d = (int)(own[i] & 0xFFFF);
    const int x = i % width + s->across + ((s->across_part + d * s->across_step) >> 16);
    const int y = i / width + s->down + ((s->down_part + d * s->down_step) >> 16);
    int at;

    if (x < 0 || y < 0 || x >= width || y >= rows)
        return -1;
    at = y * width + x;
    if (abs((int)(there[at] & 0xFFFF) - d) > SAME || gpu_colour_step(there[width * rows + at], own[n + i]) > SIMILAR)
        return -1;
    return at;
}

static bool is_seen(const uint32_t *own, int n, int i)
{
    return (own[i] & 0xFFFF) != NONE && own[n + i] >> 24;
}

/* The label with most votes; the own one where it has as many as another, then that of the nearer voter. */
static uint32_t elect(uint32_t own, const uint32_t *vote, int n)
{
    uint32_t best = own;
    int most = own != 0;

    for (int i = 0; i < n; i++)
        most += own && vote[i] == own;
    for (int i = 0; i < n; i++) {
        int count = 0;

        for (int k = 0; k < n; k++)
            count += vote[k] == vote[i];
        if (vote[i] && vote[i] != own && count > most) {
            most = count;
            best = vote[i];
        }
    }
    return best;
}

void vote_reference(const void *push, void *const *buffer, const uint32_t groups[3] SST_UNUSED)
{
    const struct sst_gpu_vote *p = push;
    const uint32_t *own = buffer[SST_GPU_VOTE_OWN];
    uint32_t *out = buffer[SST_GPU_VOTE_OUT];
    const int n = p->width * p->height;

    for (int i = 0; i < n; i++) {
        uint32_t vote[SST_GPU_VOTERS] = { 0 };

        for (int k = 0; k < p->count; k++) {
            const uint32_t *there = buffer[SST_GPU_VOTE_VOTERS + k];
            const int at = place_of(&p->shift[k], there, own, n, p->width, p->rows[k], i);

            vote[k] = at < 0 ? 0 : there[at] >> 16 & 0xFF;
        }
        out[i] = is_seen(own, n, i) ? elect(own[i] >> 16 & 0xFF, vote, p->count) : own[i] >> 16 & 0xFF;
    }
}

void label_carry_reference(const void *push, void *const *buffer, const uint32_t groups[3] SST_UNUSED)
{
    const struct sst_gpu_label_carry *p = push;
    const uint32_t *own = buffer[SST_GPU_VOTE_OWN];
    uint32_t *out = buffer[SST_GPU_VOTE_OUT];
    const int n = p->width * p->height;

    for (int i = 0; i < n; i++) {
        uint32_t label = p->flags & SST_GPU_CARRY_MORE ? out[i] : 0, entropy = INFINITE;

        if (label)
            continue;
        for (int k = 0; k < p->count && !label && is_seen(own, n, i); k++) {
            const uint32_t *there = buffer[SST_GPU_VOTE_VOTERS + k];
            const int at = place_of(&p->shift[k], there, own, n, p->width, p->rows[k], i);

            if (at >= 0 && there[at] >> 16) {
                label = there[at] >> 16;
                entropy = p->flags & SST_GPU_CARRY_ENTROPIES ? there[2 * p->width * p->rows[k] + at] : INFINITE;
            }
        }
        out[i] = label;
        if (p->flags & SST_GPU_CARRY_ENTROPIES)
            out[n + i] = entropy;
    }
}

/* Of the first labelled pixels in eight directions, the label of the most similar one; 0: all are out of reach. */
static uint32_t find_similar(const uint32_t *own, const uint32_t *from, int width, int height, int i)
{
    static const int step[8][2] = {
        { -1, 0 }, { 1, 0 }, { 0, -1 }, { 0, 1 }, { -1, -1 }, { 1, -1 }, { -1, 1 }, { 1, 1 }
    };
    const int n = width * height;
    uint32_t least = UINT32_MAX, label = 0;

    for (int k = 0; k < 8; k++) {
        for (int s = 1; s <= SST_GPU_FILL_REACH; s++) {
            const int x = i % width + s * step[k][0], y = i / width + s * step[k][1], at = y * width + x;
            uint32_t off = 0;

            if (x < 0 || y < 0 || x >= width || y >= height)
                break;
            if (!from[at])
                continue;
            for (int c = 0; c < 24; c += 8)
                off += (uint32_t)abs((int)(own[n + i] >> c & 0xFF) - (int)(own[n + at] >> c & 0xFF)) << 16;
            off |= (uint32_t)abs((int)(own[i] & 0xFFFF) - (int)(own[at] & 0xFFFF));
            if (off < least) {
                least = off;
                label = from[at];
            }
            break;
        }
    }
    return label;
}

/* Of the labelled pixels to the left and right, the label of that with the nearer disparity; 0: there is none. */
static uint32_t find_in_row(const uint32_t *own, const uint32_t *from, int width, int i)
{
    const int row = i - i % width, end = row + width, d = (int)(own[i] & 0xFFFF);
    int left = i, right = i;

    while (left >= row && !from[left])
        left--;
    while (right < end && !from[right])
        right++;
    if (left >= row && right < end)
        return abs(d - (int)(own[left] & 0xFFFF)) <= abs(d - (int)(own[right] & 0xFFFF)) ? from[left] : from[right];
    return left >= row ? from[left] : right < end ? from[right] : 0;
}

void label_fill_reference(const void *push, void *const *buffer, const uint32_t groups[3] SST_UNUSED)
{
    const struct sst_gpu_label_fill *p = push;
    const uint32_t *own = buffer[SST_GPU_LABEL_FILL_OWN], *from = buffer[SST_GPU_LABEL_FILL_FROM];
    uint32_t *out = buffer[SST_GPU_LABEL_FILL_OUT];
    const int n = p->width * p->height;

    for (int i = 0; i < n; i++) {
        out[i] = from[i] ? from[i] : find_similar(own, from, p->width, p->height, i);
        out[i] = out[i] ? out[i] : find_in_row(own, from, p->width, i);
        out[i] &= own[n + i] >> 24;
    }
}

#define TEST_WIDTH  43
#define TEST_HEIGHT 21
#define TEST_PIXELS (TEST_WIDTH * TEST_HEIGHT)

#define TEST_PLANES 3

struct test {
    uint32_t view[1 + SST_GPU_VOTERS][TEST_PLANES][TEST_PIXELS], out[2][TEST_PIXELS];
};

static const int32_t test_rows[SST_GPU_VOTERS] = { TEST_HEIGHT, 9, TEST_HEIGHT, 17 };
static const struct sst_gpu_shift test_shift[SST_GPU_VOTERS] = { { 0, 32768, 1030, 0, 30000, -20 },
                                                                 { -1, 40000, -1020, 0, 32768, 10 },
                                                                 { 0, 32000, 7, 1, 32768, 1024 },
                                                                 { 3, 30000, 1000, -2, 32768, -1100 } };

/* Views, and labels of some pixels. */
static struct test *make_test(void)
{
    struct test *t = calloc(1, sizeof(*t));
    uint32_t state = 4;

    for (int i = 0; t && i < (1 + SST_GPU_VOTERS) * TEST_PIXELS; i++) {
        uint32_t(*view)[TEST_PIXELS] = t->view[i / TEST_PIXELS];
        const uint32_t grey = 100 + gpu_random(&state) % 30, valid = gpu_random(&state) % 15 ? 255U << 24 : 0;
        const int at = i % TEST_PIXELS;

        view[SST_GPU_PLANE_COLOURS][at] = grey | (grey + gpu_random(&state) % 5) << 8 | 90U << 16 | valid;
        view[SST_GPU_PLANE_LABELS][at] =
            (gpu_random(&state) % 20 ? 150 + gpu_random(&state) % 90 : NONE) | (gpu_random(&state) % 4) << 16;
        view[SST_GPU_PLANE_ENTROPIES][at] = gpu_random(&state);
    }
    for (int i = 0; t && i < TEST_PIXELS; i++)
        t->out[0][i] = gpu_random(&state) % 5 || i / TEST_WIDTH == 3 ? 0 : 1 + gpu_random(&state) % 9;
    return t;
}

static int compare_views(struct sst_gpu *g, enum sst_gpu_shader shader, const void *push, const struct test *t)
{
    const struct sst_gpu_work work = { .shader = shader,
                                       .push = push,
                                       .groups = { gpu_groups(TEST_WIDTH, 32), gpu_groups(TEST_HEIGHT, 8), 1 } };

    return gpu_compare(g, &work,
                       (const void *const[]){ t->view[0], t->view[1], t->view[2], t->view[3], t->view[4], t->out },
                       (const size_t[]){ sizeof(t->view[0]), sizeof(t->view[0]), sizeof(t->view[0]), sizeof(t->view[0]),
                                         sizeof(t->view[0]), sizeof(t->out) },
                       SST_GPU_VOTE_OUT, NULL);
}

int vote_self_test(struct sst_gpu *g)
{
    struct sst_gpu_vote push = { .width = TEST_WIDTH, .height = TEST_HEIGHT, .count = SST_GPU_VOTERS };
    struct test *t = make_test();
    int err;

    memcpy(push.shift, test_shift, sizeof(test_shift));
    memcpy(push.rows, test_rows, sizeof(test_rows));
    for (int i = 0; t && i < (1 + SST_GPU_VOTERS) * TEST_PIXELS; i++) /* some have been elected */
        t->view[i / TEST_PIXELS][SST_GPU_PLANE_LABELS][i % TEST_PIXELS] |= (uint32_t)(i % 3) << 24;
    err = t ? compare_views(g, SST_GPU_VOTE, &push, t) : -ENOMEM;
    free(t);
    return err;
}

int label_carry_self_test(struct sst_gpu *g)
{
    struct sst_gpu_label_carry push = { .width = TEST_WIDTH, .height = TEST_HEIGHT, .count = SST_GPU_VOTERS };
    struct test *t = make_test();
    int err = t ? 0 : -ENOMEM;

    memcpy(push.shift, test_shift, sizeof(test_shift));
    memcpy(push.rows, test_rows, sizeof(test_rows));
    for (push.flags = 0; push.flags < 4 && !err; push.flags++)
        err = compare_views(g, SST_GPU_LABEL_CARRY, &push, t);
    free(t);
    return err;
}

#define FILL_WIDTH  150 /* more than the reach */
#define FILL_HEIGHT 9
#define FILL_PIXELS (FILL_WIDTH * FILL_HEIGHT)

struct fill_test {
    uint32_t own[2][FILL_PIXELS], from[FILL_PIXELS], out[FILL_PIXELS];
};

/* Many labels on the left, one in the last column, a row without any. */
static void make_fill_test(struct fill_test *t)
{
    uint32_t state = 9;

    for (int i = 0; i < FILL_PIXELS; i++) {
        const int x = i % FILL_WIDTH, y = i / FILL_WIDTH;

        t->own[SST_GPU_PLANE_LABELS][i] = gpu_random(&state) % 20 ? 150 + gpu_random(&state) % 90 : NONE;
        t->own[SST_GPU_PLANE_COLOURS][i] = (gpu_random(&state) & 0x1F1F1F) | (gpu_random(&state) % 15 ? 255U << 24 : 0);
        t->from[i] = (x < 20 && y != 3 && !(gpu_random(&state) % 5)) || (x == FILL_WIDTH - 1 && y == 4)
                         ? 1 + gpu_random(&state) % 9
                         : 0;
    }
}

int label_fill_self_test(struct sst_gpu *g)
{
    const struct sst_gpu_label_fill push = { FILL_WIDTH, FILL_HEIGHT };
    const struct sst_gpu_work work = { .shader = SST_GPU_LABEL_FILL,
                                       .push = &push,
                                       .groups = { gpu_groups(FILL_WIDTH, 32), gpu_groups(FILL_HEIGHT, 8), 1 } };
    struct fill_test *t = calloc(1, sizeof(*t));
    int err = t ? 0 : -ENOMEM;

    if (t) {
        make_fill_test(t);
        err = gpu_compare(g, &work, (const void *const[]){ t->own, t->from, t->out },
                          (const size_t[]){ sizeof(t->own), sizeof(t->from), sizeof(t->out) }, SST_GPU_LABEL_FILL_OUT,
                          NULL);
    }
    free(t);
    return err;
}
