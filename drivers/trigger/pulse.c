/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "drivers/trigger/trigger_internal.h"

#include <math.h>
#include <stdlib.h>

int pulse_steps(struct pulse_step *step, const int *delay_us, int lines, int pulse_us)
{
    int64_t at_us = -1;
    int n = 0;

    for (;;) {
        int64_t next_us = INT64_MAX;
        uint64_t active = 0;

        for (int i = 0; i < lines; i++) {
            const int64_t rise = delay_us[i], fall = rise + pulse_us;

            if (rise > at_us && rise < next_us)
                next_us = rise;
            if (fall > at_us && fall < next_us)
                next_us = fall;
        }
        if (next_us == INT64_MAX)
            return n;
        at_us = next_us;
        for (int i = 0; i < lines; i++) {
            if (delay_us[i] <= at_us && at_us < (int64_t)delay_us[i] + pulse_us)
                active |= 1ull << i;
        }
        step[n++] = (struct pulse_step){ at_us * 1000, active };
    }
}

int64_t tick_due_ns(int64_t start_ns, double rate_hz, uint64_t n)
{
    return start_ns + llround((double)n * 1e9 / rate_hz);
}

uint64_t tick_next(int64_t start_ns, double rate_hz, uint64_t n, int64_t now_ns)
{
    const double ticks = (double)(now_ns - start_ns) * rate_hz * 1e-9;
    const double first = ceil(ticks - 0.5);

    return first > (double)n ? (uint64_t)first : n;
}

int64_t edge_monotonic(int64_t stamp_ns, int64_t monotonic_ns, int64_t realtime_ns)
{
    if (llabs(stamp_ns - monotonic_ns) <= llabs(stamp_ns - realtime_ns))
        return stamp_ns;
    return stamp_ns - (realtime_ns - monotonic_ns);
}
