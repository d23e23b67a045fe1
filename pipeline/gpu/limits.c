/* The shader `limits`: its reference and self-test. */
#include "pipeline/gpu/gpu_internal.h"

#define TEST_COUNT 700

void limits_reference(const void *push, void *const *buffer, const uint32_t groups[3] SST_UNUSED)
{
    const struct gpu_limits *p = push;
    const float *from = buffer[GPU_LIMITS_FROM];
    float *to = buffer[GPU_LIMITS_TO];

    for (size_t i = 0; i < 4 * (size_t)p->count; i++) {
        float total = 0;

        for (int j = 0; j < 4 && p->rounds; j++) {
            float sum = from[i];

            for (uint32_t k = 0; k < p->rounds; k++)
                sum = sum * from[i] + (float)(j + 1);
            total += sum;
        }
        to[i] = p->rounds ? total : from[i];
    }
}

/* Of small whole numbers every step is exact, however it is rounded. */
int limits_self_test(struct sst_gpu *g)
{
    static float from[4 * TEST_COUNT], to[4 * TEST_COUNT];
    uint32_t state = 5;
    int err = 0;

    for (int i = 0; i < 4 * TEST_COUNT; i++)
        from[i] = (float)(gpu_random(&state) % 7) - 3;
    for (uint32_t rounds = 0; rounds < 6 && !err; rounds += 5) {
        const struct gpu_limits push = { TEST_COUNT, rounds };
        const struct sst_gpu_work work = { .shader = SST_GPU_LIMITS, .push = &push, .groups = { 2, 1, 1 } };
        const void *const initial[] = { from, to };
        const size_t bytes[] = { sizeof(from), sizeof(to) };

        err = gpu_compare(g, &work, initial, bytes, GPU_LIMITS_TO, NULL);
    }
    return err;
}
