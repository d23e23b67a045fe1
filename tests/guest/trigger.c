/* A train of pulses through drivers/trigger on whatever GPIO chips there are: one line per beat, then the sum.
   trigger [-l] RATE_HZ COUNT PULSE_US CHIP LOOPBACK LINE...   (-l: active low; "" for no chip or no loop-back) */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "base/clock.h"
#include "drivers/trigger/trigger.h"

static void tell(void *arg SST_UNUSED, const struct sst_trigger_edge *edge)
{
    printf("edge %" PRIu64 " due %" PRId64 " before %" PRId64 " after %" PRId64 " kernel %" PRId64 "\n", edge->index,
           edge->due_ns, edge->before_ns, edge->after_ns, edge->kernel_ns);
}

static int parse(struct sst_trigger_config *cfg, int argc, char **argv)
{
    if (argc < 6)
        return -1;
    cfg->source = SST_TRIGGER_GPIO;
    cfg->pulse_us = atoi(argv[2]);
    snprintf(cfg->chip, sizeof(cfg->chip), "%s", argv[3]);
    snprintf(cfg->loopback, sizeof(cfg->loopback), "%s", argv[4]);
    cfg->lines = argc - 5;
    for (int i = 0; i < cfg->lines && i < SST_TRIGGER_LINES_MAX; i++)
        snprintf(cfg->line[i], sizeof(cfg->line[i]), "%s", argv[5 + i]);
    return 0;
}

int main(int argc, char **argv)
{
    struct sst_trigger_config cfg;
    struct sst_trigger_counters sum;
    struct sst_trigger *trigger;
    int64_t deadline_ns;
    int err;

    sst_trigger_config_defaults(&cfg);
    if (argc > 1 && !strcmp(argv[1], "-l")) {
        cfg.active_low = true;
        argc--;
        argv++;
    }
    argc--;
    argv++;
    if (parse(&cfg, argc, argv))
        return 2;
    err = sst_trigger_open(&trigger, &cfg, tell, NULL);
    if (err) {
        printf("open %d\n", err);
        return 1;
    }
    puts("open");
    fflush(stdout);
    deadline_ns = sst_clock_now_ns() + 60000000000;
    err = sst_trigger_start(trigger, atof(argv[0]), strtoull(argv[1], NULL, 10));
    while (!err && !sst_trigger_idle(trigger) && sst_clock_now_ns() < deadline_ns)
        nanosleep(&(struct timespec){ .tv_nsec = 5000000 }, NULL);
    if (!err)
        err = sst_trigger_stop(trigger);
    sst_trigger_counters(trigger, &sum);
    printf("end %d fired %" PRIu64 " skipped %" PRIu64 " missing %" PRIu64 "\n", err, sum.fired,
           sst_trigger_skipped(trigger), sum.edges_missing);
    sst_trigger_close(trigger);
    return err ? 1 : 0;
}
