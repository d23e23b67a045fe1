/* The shader `vote`: its reference and self-test. */
#include "pipeline/gpu/vote.h"

#include <errno.h>
#include <stdlib.h>

#include "pipeline/gpu/gpu_internal.h"

#define NONE    65535
#define SAME    64 /* 1/64 px: disparities of one surface differ by at most this */
#define SIMILAR 24 /* levels: views vote where their colours differ by at most this in every channel */

static uint32_t vote_of(const struct sst_gpu_vote *p, int voter, const uint32_t *there, const uint32_t own[2], int x,
                        int y)
{
    const struct sst_gpu_shift *s = &p->shift[voter];
    const int d = (int)(own[1] & 0xFFFF);

    x += s->across + ((s->across_part + d * s->across_step) >> 16);
    y += s->down + ((s->down_part + d * s->down_step) >> 16);
    if (x < 0 || y < 0 || x >= p->width || y >= p->height)
        return 0;
    there += 2 * (y * p->width + x);
    if (abs((int)(there[1] & 0xFFFF) - d) > SAME || gpu_colour_step(there[0], own[0]) > SIMILAR)
        return 0;
    return there[0] >> 24;
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
    const uint32_t(*own)[2] = buffer[SST_GPU_VOTE_OWN];
    uint32_t *out = buffer[SST_GPU_VOTE_OUT];

    for (int i = 0; i < p->width * p->height; i++) {
        uint32_t vote[SST_GPU_VOTERS] = { 0 };

        for (int k = 0; k < p->count; k++)
            vote[k] = vote_of(p, k, buffer[SST_GPU_VOTE_VOTERS + k], own[i], i % p->width, i / p->width);
        out[i] = (own[i][1] & 0xFFFF) == NONE || !(own[i][1] >> 16) ? own[i][0] >> 24
                                                                    : elect(own[i][0] >> 24, vote, p->count);
    }
}

#define TEST_WIDTH  43
#define TEST_HEIGHT 21
#define TEST_PIXELS (TEST_WIDTH * TEST_HEIGHT)

struct test {
    uint32_t view[1 + SST_GPU_VOTERS][TEST_PIXELS][2], out[TEST_PIXELS];
};

int vote_self_test(struct sst_gpu *g)
{
    const struct sst_gpu_vote push = { TEST_WIDTH,
                                       TEST_HEIGHT,
                                       SST_GPU_VOTERS,
                                       { { 0, 32768, 1030, 0, 30000, -20 },
                                         { -1, 40000, -1020, 0, 32768, 10 },
                                         { 0, 32000, 7, 1, 32768, 1024 },
                                         { 3, 30000, 1000, -2, 32768, -1100 } } };
    const struct sst_gpu_work work = { .shader = SST_GPU_VOTE,
                                       .push = &push,
                                       .groups = { gpu_groups(TEST_WIDTH, 32), gpu_groups(TEST_HEIGHT, 8), 1 } };
    struct test *t = calloc(1, sizeof(*t));
    uint32_t state = 4;
    int err = t ? 0 : -ENOMEM;

    for (int i = 0; t && i < (1 + SST_GPU_VOTERS) * TEST_PIXELS; i++) {
        uint32_t *at = t->view[i / TEST_PIXELS][i % TEST_PIXELS];
        const uint32_t grey = 100 + gpu_random(&state) % 30;

        at[0] = grey | (grey + gpu_random(&state) % 5) << 8 | 90U << 16 | (gpu_random(&state) % 4) << 24;
        at[1] = (gpu_random(&state) % 20 ? 150 + gpu_random(&state) % 90 : NONE) |
                (gpu_random(&state) % 15 ? 255U << 16 : 0);
    }
    if (!err)
        err = gpu_compare(g, &work,
                          (const void *const[]){ t->view[0], t->view[1], t->view[2], t->view[3], t->view[4], t->out },
                          (const size_t[]){ sizeof(t->view[0]), sizeof(t->view[0]), sizeof(t->view[0]),
                                            sizeof(t->view[0]), sizeof(t->view[0]), sizeof(t->out) },
                          SST_GPU_VOTE_OUT, NULL);
    free(t);
    return err;
}
