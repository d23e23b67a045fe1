/* Time of a camera as time of this host. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdlib.h>

#include "drivers/genicam/genicam_internal.h"

#define SECOND_NS  INT64_C(1000000000)
#define JUMP_NS    (SECOND_NS / 2) /* more than an event can be late, or clocks drift apart in half a minute */
#define JUMP_ROW   3
#define STAMP_MAX  (INT64_MAX / 2) /* 146 years: a stamp beyond is none of a clock */
#define DRIFT_MAX  500e-6 /* crystals are better by far */
#define DRIFT_SPAN 8      /* seconds of events from which on the drift is estimated */

static int64_t stamp_at(const struct genicam_clock *c, int i)
{
    return c->point[(c->first + i) % GENICAM_CLOCK_POINTS].stamp_ns;
}

static int64_t offset_at(const struct genicam_clock *c, int i)
{
    return c->point[(c->first + i) % GENICAM_CLOCK_POINTS].offset_ns;
}

static bool is_stamp(int64_t stamp_ns)
{
    return stamp_ns >= 0 && stamp_ns <= STAMP_MAX;
}

static int least(const struct genicam_clock *c, int from, int to)
{
    int best = from;

    for (int i = from + 1; i < to; i++)
        if (offset_at(c, i) < offset_at(c, best))
            best = i;
    return best;
}

static double drift(const struct genicam_clock *c)
{
    if (c->count < DRIFT_SPAN)
        return 0;

    const int a = least(c, 0, c->count / 2), b = least(c, c->count / 2, c->count);
    const double span_ns = (double)(stamp_at(c, b) - stamp_at(c, a));

    /* Neighbours say little of the slope. */
    if (span_ns < 0.25 * (double)(stamp_at(c, c->count - 1) - stamp_at(c, 0)))
        return 0;
    return sst_clamp_double((double)(offset_at(c, b) - offset_at(c, a)) / span_ns, -DRIFT_MAX, DRIFT_MAX);
}

/* The line through the lower bound: no event lies below it. */
static int64_t offset_of(const struct genicam_clock *c, int64_t stamp_ns)
{
    const double slope = drift(c);
    int64_t best = INT64_MAX;

    for (int i = 0; i < c->count; i++) {
        const int64_t o = offset_at(c, i) + (int64_t)(slope * (double)(stamp_ns - stamp_at(c, i)));

        if (o < best)
            best = o;
    }
    return best;
}

void genicam_clock_add(struct genicam_clock *c, int64_t stamp_ns, int64_t seen_ns)
{
    const int last = (c->first + c->count - 1) % GENICAM_CLOCK_POINTS;
    int64_t offset_ns;

    if (!is_stamp(stamp_ns))
        return;
    offset_ns = seen_ns - stamp_ns;
    if (c->count && llabs(offset_ns - offset_of(c, stamp_ns)) > JUMP_NS) {
        if (++c->strays < JUMP_ROW)
            return;
        *c = (struct genicam_clock){ 0 }; /* its clock was set */
    }
    c->strays = 0;
    if (c->count && stamp_ns - c->begin_ns < SECOND_NS) {
        if (offset_ns < c->point[last].offset_ns) {
            c->point[last].stamp_ns = stamp_ns;
            c->point[last].offset_ns = offset_ns;
        }
        return;
    }
    if (c->count == GENICAM_CLOCK_POINTS) {
        c->first = (c->first + 1) % GENICAM_CLOCK_POINTS;
        c->count--;
    }
    c->begin_ns = stamp_ns;
    c->point[(c->first + c->count) % GENICAM_CLOCK_POINTS].stamp_ns = stamp_ns;
    c->point[(c->first + c->count++) % GENICAM_CLOCK_POINTS].offset_ns = offset_ns;
}

bool genicam_clock_here(const struct genicam_clock *c, int64_t stamp_ns, int64_t *t_ns)
{
    if (!c->count || c->strays || !is_stamp(stamp_ns))
        return false;
    *t_ns = stamp_ns + offset_of(c, stamp_ns);
    return true;
}

bool genicam_clock_there(const struct genicam_clock *c, int64_t t_ns, int64_t *stamp_ns)
{
    if (!c->count || c->strays)
        return false;
    *stamp_ns = t_ns - offset_of(c, t_ns - offset_at(c, c->count - 1));
    return true;
}
