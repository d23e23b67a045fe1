/* drivers/trigger/trigger.h - pulses on GPIO lines that expose all cameras together, or the edges that another host's
 * pulses make on an input. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_DRIVERS_TRIGGER_TRIGGER_H
#define SST_DRIVERS_TRIGGER_TRIGGER_H

#include <stdbool.h>

#include "base/base.h"

#define SST_TRIGGER_LINES_MAX 64
#define SST_TRIGGER_NAME_MAX  64
#define SST_TRIGGER_CHIP_MAX  256

struct sst_trigger; /* opaque; calls from one thread, edges come from the trigger's own */

enum sst_trigger_source {
    SST_TRIGGER_GPIO = 0,     /* pulses on lines of one chip */
    SST_TRIGGER_SOFTWARE = 1, /* no line: timer ticks only; cameras run on their own */
    SST_TRIGGER_FREE_RUN = 2, /* no edges at all */
    SST_TRIGGER_EXTERNAL = 3, /* rising edges of the input `loopback`, which another host or a generator drives */
};

struct sst_trigger_config {
    enum sst_trigger_source source;
    char chip[SST_TRIGGER_CHIP_MAX]; /* label, e.g. "sst-trigger", path in /dev, device in sysfs (its path, or the name
                                        of a part of it); "" if the line names are unique */
    int lines;
    char line[SST_TRIGGER_LINES_MAX][SST_TRIGGER_NAME_MAX]; /* line name, or an offset in digits (needs chip) */
    int delay_us[SST_TRIGGER_LINES_MAX]; /* of the line's pulse after the tick; lines of equal delay change in one
                                            ioctl */
    char loopback[SST_TRIGGER_NAME_MAX]; /* input line wired to an output: its kernel time stamps are the edges; "" */
    bool active_low;
    int pulse_us; /* width, 10..1000000 */
    bool quiet;   /* do not log when the chip vanishes or returns: the caller reports it from the counters */
};

/** One tick of the train. Times are ns on CLOCK_MONOTONIC. */
struct sst_trigger_edge {
    uint64_t index;    /* 0, 1, ... since open; skipped ticks are not counted, edges that the kernel dropped are */
    int64_t due_ns;    /* scheduled time of the tick; external: of the edge */
    int64_t before_ns; /* clock before and after the ioctl that raised the first lines: the edge is between */
    int64_t after_ns;
    int64_t kernel_ns; /* time stamp of the loop-back line's edge; 0 without */
};

typedef void sst_trigger_edge_fn(void *arg, const struct sst_trigger_edge *edge);

void sst_trigger_config_defaults(struct sst_trigger_config *cfg);

/**
 * Find the chip by label or line names (never by number), request all lines in one request, driven inactive.
 *
 * @param edge  called for every tick, on the trigger's thread; may be NULL
 * @return 0, -ENODEV (no such chip or line: the existing ones are listed), -ENOTUNIQ (two chips of one label), -EBUSY
 *         (line in use: with the consumer), -EACCES (with the group and rule), -EINVAL, -ENOSYS (built without
 * libgpiod); logged.
 */
SST_MUST_CHECK int sst_trigger_open(struct sst_trigger **out, const struct sst_trigger_config *cfg,
                                    sst_trigger_edge_fn *edge, void *arg);

/** Check whether open would work now. Requests and logs nothing; `why` is one sentence, also on success.
 *  @return as sst_trigger_open() */
SST_MUST_CHECK int sst_trigger_check(const struct sst_trigger_config *cfg, char *why, size_t size);

/** Fire once now and wait until the pulse has ended. @return 0, -EBUSY (a train runs), -EIO/-ENODEV (no chip). */
SST_MUST_CHECK int sst_trigger_fire(struct sst_trigger *trigger);

/**
 * Start a train of `count` pulses (0: until stopped) at rate_hz, 0.01..1000. Ticks are absolute: no drift. External:
 * report `count` edges from now on, at whatever rate they come.
 *
 * A chip that fails or vanishes ends the train (logged; sst_trigger_stop() returns the error). The trigger's thread
 * then searches for it with back-off up to 5 s; once it is back (logged), a train can be started again.
 * @return 0, -EBUSY (a train runs), -ENODEV (no chip, not logged again), -EINVAL (rate, or pulse too long)
 */
SST_MUST_CHECK int sst_trigger_start(struct sst_trigger *trigger, double rate_hz, uint64_t count);

/** End the train after the current pulse; lines are inactive afterwards. @return 0 or the error that ended it. */
int sst_trigger_stop(struct sst_trigger *trigger);

/** True if the train has ended (count reached or error). */
bool sst_trigger_idle(const struct sst_trigger *trigger);

/** Number of ticks too late to fire (the thread was delayed by more than half a period). */
uint64_t sst_trigger_skipped(const struct sst_trigger *trigger);

/** Since open. */
struct sst_trigger_counters {
    uint64_t fired;
    uint64_t edges_missing; /* ticks without an edge on the loop-back line; logged at the first of a row */
    uint64_t edges_lost;    /* edges that the kernel dropped, by its sequence numbers (libgpiod 2) */
    uint64_t chip_lost, chip_found;
};

void sst_trigger_counters(struct sst_trigger *trigger, struct sst_trigger_counters *out);

/** Ends a train after the current pulse. NULL is fine. */
void sst_trigger_close(struct sst_trigger *trigger);

#endif
