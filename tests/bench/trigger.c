/* How well the trigger keeps time: run a train on a chip, or on a simulated one, and show how late beats were. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "drivers/trigger/trigger.h"

#include "base/stats.h"

#define BEATS_MAX 4000000

static struct sst_trigger_edge *edges;
static int edge_count;
static volatile sig_atomic_t stopped;

static void note(void *arg SST_UNUSED, const struct sst_trigger_edge *edge)
{
    if (edge_count < BEATS_MAX)
        edges[edge_count++] = *edge;
}

static void on_signal(int sig SST_UNUSED)
{
    stopped = 1;
}

static void print_row(const char *what, int64_t *t_ns, int n)
{
    if (!n)
        return;
    sst_stats_sort_int64(t_ns, n);
    printf("%-34s %9.1f %9.1f %9.1f %9.1f\n", what, (double)t_ns[0] / 1e3, (double)t_ns[n / 2] / 1e3,
           (double)t_ns[(int64_t)n * 99 / 100] / 1e3, (double)t_ns[n - 1] / 1e3);
}

static void report(struct sst_trigger *t)
{
    int64_t *late = calloc((size_t)edge_count + 1, 3 * sizeof(*late)), *call = late + edge_count,
            *stamp = call + edge_count;
    struct sst_trigger_counters n;
    int stamps = 0;

    for (int i = 0; late && i < edge_count; i++) {
        late[i] = edges[i].before_ns - edges[i].due_ns;
        call[i] = edges[i].after_ns - edges[i].before_ns;
        if (edges[i].kernel_ns)
            stamp[stamps++] = edges[i].kernel_ns - edges[i].due_ns;
    }
    sst_trigger_counters(t, &n);
    printf("%llu fired, %llu skipped, %llu edges missing, %llu lost, chip lost %llu times\n",
           (unsigned long long)n.fired, (unsigned long long)sst_trigger_skipped(t), (unsigned long long)n.edges_missing,
           (unsigned long long)n.edges_lost, (unsigned long long)n.chip_lost);
    printf("%-34s %9s %9s %9s %9s\n", "us", "least", "p50", "p99", "most");
    if (late) {
        print_row("call starts after its beat", late, edge_count);
        print_row("call takes", call, edge_count);
        print_row("edge is stamped after its beat", stamp, stamps);
    }
    free(late);
}

int main(int argc, char **argv)
{
    const double rate_hz = argc > 1 ? atof(argv[1]) : 10, seconds = argc > 2 ? atof(argv[2]) : 10;
    struct sst_trigger_config cfg;
    struct sst_trigger *t;
    int err;

    sst_trigger_config_defaults(&cfg);
    cfg.pulse_us = 200;
    cfg.lines = 1;
    snprintf(cfg.chip, sizeof(cfg.chip), "%s", argc > 3 ? argv[3] : "sst-trigger");
    snprintf(cfg.line[0], sizeof(cfg.line[0]), "%s", argc > 4 ? argv[4] : "TRIG0");
    snprintf(cfg.loopback, sizeof(cfg.loopback), "%s", argc > 5 ? argv[5] : "LOOP0");
    edges = calloc(BEATS_MAX, sizeof(*edges));
    if (!edges || sst_trigger_open(&t, &cfg, note, NULL)) {
        fprintf(stderr, "usage: trigger [RATE_HZ [SECONDS [CHIP LINE LOOPBACK]]], inside sst-sim or on a real chip\n");
        return 1;
    }
    signal(SIGINT, on_signal);
    err = sst_trigger_start(t, rate_hz, (uint64_t)(rate_hz * seconds));
    while (!err && !stopped && !sst_trigger_idle(t))
        usleep(10000);
    err = err ? err : sst_trigger_stop(t);
    report(t);
    sst_trigger_close(t);
    free(edges);
    return err ? 1 : 0;
}
