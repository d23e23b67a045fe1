/* Times the dot products of learned matching features: feature_cost ROUNDS. Every CPU level in turn, on rows that the
 * first cache holds (a neighbour beside the view) and on rows below each other (a neighbour below it). Prints CSV:
 * median CPU time over the rounds, and multiplications per nanosecond. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/mem.h"
#include "base/stats.h"
#include "pipeline/kernels/kernels.h"

#define WIDTH      128
#define PLACES     64
#define ROWS       (PLACES + 8)
#define STRIDE     (4 * 1024 + 64)
#define ROW_BYTES  (SST_FEATURE_CHANNELS / 4 * STRIDE)
#define REPEAT     200
#define ROUNDS_MAX 1000

/* Seconds of CPU time for REPEAT calls; call i takes row i % 8 of a. */
static double run(const struct sst_kernels *k, uint8_t *cost, const uint8_t *features, int below)
{
    const uint8_t *b[PLACES];
    const int64_t start_ns = sst_clock_cpu_ns();

    for (size_t i = 0; i < REPEAT; i++) {
        const uint8_t *row = features + i % 8 * ROW_BYTES;

        for (size_t j = 0; j < PLACES; j++)
            b[j] = row + (below ? j * ROW_BYTES : 4 * j);
        k->feature_cost_rows(cost, WIDTH, row, b, PLACES, STRIDE, WIDTH);
    }
    return (double)(sst_clock_cpu_ns() - start_ns) * 1e-9;
}

int main(int argc, char **argv)
{
    static double took[SST_CPU_LEVELS][2][ROUNDS_MAX];
    const int rounds = argc == 2 ? atoi(argv[1]) : 0;
    uint8_t *features = sst_mem_alloc(ROWS, ROW_BYTES), *cost = sst_mem_alloc(PLACES, WIDTH);
    const double products = (double)REPEAT * PLACES * WIDTH * SST_FEATURE_CHANNELS;

    if (rounds < 1 || rounds > ROUNDS_MAX || !features || !cost) {
        fprintf(stderr, "usage: feature_cost ROUNDS (1..%d)\n", ROUNDS_MAX);
        return 2;
    }
    for (size_t i = 0; i < (size_t)ROWS * ROW_BYTES; i++)
        features[i] = (uint8_t)(i * 2654435761u >> 13);
    for (int round = 0; round < rounds; round++) {
        for (int run_of = 0; run_of < 2 * SST_CPU_LEVELS; run_of++) {
            struct sst_kernels k;

            if (sst_kernels_at((enum sst_cpu_level)(run_of / 2), &k))
                took[run_of / 2][run_of % 2][round] = run(&k, cost, features, run_of % 2);
        }
    }
    printf("level,neighbour,ms,products_per_ns\n");
    for (int level = 0; level < SST_CPU_LEVELS; level++) {
        for (int below = 0; below < 2; below++) {
            double *t = took[level][below];

            sst_stats_sort_double(t, rounds);
            if (t[rounds / 2] > 0)
                printf("%s,%s,%.3f,%.1f\n", sst_cpu_level_name((enum sst_cpu_level)level), below ? "below" : "beside",
                       1e3 * t[rounds / 2], products / t[rounds / 2] * 1e-9);
        }
    }
    sst_mem_free(features);
    sst_mem_free(cost);
    return 0;
}
