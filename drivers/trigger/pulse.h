/* drivers/trigger/pulse.h - the timing of a pulse train, without I/O: beats, steps of a pulse, clocks of edge stamps.
 */
#ifndef SST_DRIVERS_TRIGGER_PULSE_H
#define SST_DRIVERS_TRIGGER_PULSE_H

#include "base/base.h"

/** One change of lines. */
struct sst_pulse_step {
    int64_t at_ns;   /* after the beat */
    uint64_t active; /* bit i: line i is active from then on */
};

/**
 * The changes that one beat makes, in order of time: lines of equal delay change together, and what rises while
 * something else falls does so in one step.
 *
 * @param step      out [2 * lines], the first one raises, the last one leaves all lines inactive
 * @param delay_us  [lines], 0..; lines 1..64, pulse_us > 0
 * @return number of steps
 */
int sst_pulse_steps(struct sst_pulse_step *step, const int *delay_us, int lines, int pulse_us);

/** Beat n of a train, from its start and not from the beat before: rounding never adds up. */
int64_t sst_beat_due_ns(int64_t start_ns, double rate_hz, uint64_t n);

/** The first beat from n on that is not yet over half a period ago at now_ns. */
uint64_t sst_beat_next(int64_t start_ns, double rate_hz, uint64_t n, int64_t now_ns);

/** An edge stamp on CLOCK_MONOTONIC. Kernels before 5.7 stamp on CLOCK_REALTIME; whichever of the clocks, both just
 *  read, is nearer to the stamp is the stamp's. */
int64_t sst_edge_monotonic(int64_t stamp_ns, int64_t monotonic_ns, int64_t realtime_ns);

static inline int64_t sst_ns(int64_t s, int64_t ns)
{
    return s * 1000000000 + ns;
}

#endif
