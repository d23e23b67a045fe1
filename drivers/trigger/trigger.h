/* drivers/trigger/trigger.h - pulses on GPIO lines that expose all cameras together. */
#ifndef SST_DRIVERS_TRIGGER_TRIGGER_H
#define SST_DRIVERS_TRIGGER_TRIGGER_H

#include <stdbool.h>

#include "base/base.h"

#define SST_TRIGGER_LINES_MAX 64
#define SST_TRIGGER_NAME_MAX  64

struct sst_trigger; /* opaque; calls from one thread, edges come from the trigger's own */

enum sst_trigger_source {
    SST_TRIGGER_GPIO = 0,     /* pulses on lines of one chip */
    SST_TRIGGER_SOFTWARE = 1, /* no line: a time mark only; cameras are expected to run on their own */
    SST_TRIGGER_FREE_RUN = 2, /* no edges at all */
};

struct sst_trigger_config {
    enum sst_trigger_source source;
    char chip[SST_TRIGGER_NAME_MAX]; /* label, e.g. "sst-trigger"; "" if the line names alone are unique */
    int lines;
    char line[SST_TRIGGER_LINES_MAX][SST_TRIGGER_NAME_MAX]; /* line name, or an offset in digits (needs chip) */
    int delay_us[SST_TRIGGER_LINES_MAX]; /* of the line's pulse after the train's beat; lines of equal delay change in
                                            one ioctl */
    char loopback[SST_TRIGGER_NAME_MAX]; /* input line wired to an output: its kernel time stamps are the edges; "" */
    bool active_low;
    int pulse_us; /* width, 10..1000000 */
    bool quiet;   /* a chip that goes or comes back shows in the counters alone: the caller tells of it */
};

/** One beat of the train. Times are ns on CLOCK_MONOTONIC. */
struct sst_trigger_edge {
    uint64_t index;    /* 0, 1, ... since open; beats that came too late to fire are skipped, not counted */
    int64_t due_ns;    /* the beat */
    int64_t before_ns; /* read before and after the ioctl that raised the first lines: the edge lies between */
    int64_t after_ns;
    int64_t kernel_ns; /* time stamp of the loop-back line's edge; 0 without */
};

typedef void sst_trigger_edge_fn(void *arg, const struct sst_trigger_edge *edge);

void sst_trigger_config_defaults(struct sst_trigger_config *cfg);

/**
 * Find the chip by label or line names (never by number), request all lines in one request, driven inactive.
 *
 * @param edge  told of every beat, on the trigger's thread; may be NULL
 * @return 0, -ENODEV (no such chip or line: what exists is listed), -ENOTUNIQ (two chips of that label), -EBUSY (line
 *         in use: by whom), -EACCES (group and rule named), -EINVAL, -ENOSYS (built without libgpiod); logged.
 */
SST_MUST_CHECK int sst_trigger_open(struct sst_trigger **out, const struct sst_trigger_config *cfg,
                                    sst_trigger_edge_fn *edge, void *arg);

/** Would open work now? Nothing is requested, nothing logged; `why` is one sentence, also of success.
 *  @return as sst_trigger_open() */
SST_MUST_CHECK int sst_trigger_check(const struct sst_trigger_config *cfg, char *why, size_t size);

/** Fire once now and wait until the pulse has ended. @return 0, -EBUSY (a train runs), -EIO/-ENODEV (chip is away). */
SST_MUST_CHECK int sst_trigger_fire(struct sst_trigger *trigger);

/**
 * Start a train of `count` pulses (0: until stopped) at rate_hz, 0.01..1000. The beat is absolute: no drift.
 *
 * A chip that fails or vanishes ends the train (logged; sst_trigger_stop() returns the error). The trigger's thread
 * then looks for it with back-off up to 5 s, and once it is back (logged) a train can be started again.
 * @return 0, -EBUSY (a train runs), -ENODEV (chip is away, not logged again), -EINVAL (rate, or no room for the pulse)
 */
SST_MUST_CHECK int sst_trigger_start(struct sst_trigger *trigger, double rate_hz, uint64_t count);

/** End the train after the pulse in flight; lines are inactive afterwards. @return 0 or the error that ended it. */
int sst_trigger_stop(struct sst_trigger *trigger);

/** Has the train ended (count reached or error)? */
bool sst_trigger_idle(const struct sst_trigger *trigger);

/** Beats that came too late to fire (the thread was held up for over half a period). */
uint64_t sst_trigger_skipped(const struct sst_trigger *trigger);

/** Since open. */
struct sst_trigger_counters {
    uint64_t fired;
    uint64_t edges_missing; /* beats whose edge the loop-back line did not show; told at the first of a row */
    uint64_t edges_lost;    /* edges that the kernel dropped, by its sequence numbers (libgpiod 2) */
    uint64_t chip_lost, chip_found;
};

void sst_trigger_counters(struct sst_trigger *trigger, struct sst_trigger_counters *out);

/** Ends a train after the pulse in flight. NULL is fine. */
void sst_trigger_close(struct sst_trigger *trigger);

#endif
