/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdio.h>
#include <stdlib.h>

#include "drivers/grab/grab_internal.h"

#define AHEAD_NS     SST_MS           /* granularity of clocks: a stamp is not later than the arrival */
#define SLACK_NS     (500 * SST_MS)   /* exposure, read-out and transfer take this and three frame periods at most */
#define PROOF_NS     (2000 * SST_MS)  /* least time of stamps that contradict a verdict until it is reversed */
#define PROOF_FRAMES 3                /* least number of such frames in a row, too */
#define TRIAL_NS     (10000 * SST_MS) /* a foreign clock must be right for so long, twice as long each time ... */
#define TRIAL_MAX_NS (3600000 * SST_MS)
#define WALL_NS      (5000 * SST_MS) /* this near to the wall clock stamps are of it */

void stamp_begin(struct stamp_clock *c, int64_t start_ns)
{
    c->any = false;
    c->row = 0;
    c->empty_ns = start_ns;
    c->arrival_ns = c->gap_ns = 0;
}

static enum stamp_fault fault_of(const struct stamp_clock *c, int64_t stamp_ns, int64_t arrival_ns)
{
    const int64_t gap_ns = c->arrival_ns ? arrival_ns - c->arrival_ns : 0;
    const int64_t late_ns = SLACK_NS + 3 * (gap_ns > c->gap_ns ? gap_ns : c->gap_ns);

    if (c->arrival_ns && stamp_ns == c->raw_ns)
        return STAMP_REPEATED;
    if (stamp_ns > arrival_ns + AHEAD_NS)
        return STAMP_AHEAD;
    if (c->empty_ns && stamp_ns < c->empty_ns - late_ns)
        return STAMP_BEHIND;
    return c->any && stamp_ns <= c->last_ns ? STAMP_REPEATED : STAMP_RIGHT;
}

enum stamp_fault stamp_judge(struct stamp_clock *c, int64_t stamp_ns, int64_t arrival_ns)
{
    const enum stamp_fault fault = fault_of(c, stamp_ns, arrival_ns);

    c->gap_ns = c->arrival_ns ? arrival_ns - c->arrival_ns : 0;
    c->arrival_ns = arrival_ns;
    c->raw_ns = stamp_ns;
    if (fault == STAMP_RIGHT || c->foreign) {
        c->any = true;
        c->last_ns = stamp_ns;
    }
    if ((fault != STAMP_RIGHT) == c->foreign) {
        c->row = 0;
        return fault;
    }
    if (!c->row++)
        c->since_ns = arrival_ns;
    if (c->row < PROOF_FRAMES || arrival_ns - c->since_ns < (c->foreign ? c->trial_ns : PROOF_NS))
        return fault;
    c->row = 0;
    c->foreign = !c->foreign;
    if (c->foreign) {
        c->trial_ns = c->trial_ns ? 2 * c->trial_ns : TRIAL_NS;
        if (c->trial_ns > TRIAL_MAX_NS)
            c->trial_ns = TRIAL_MAX_NS;
    }
    return fault;
}

void stamp_describe(char *out, size_t size, enum stamp_fault fault, const struct sst_frame *f, int64_t wall_ns)
{
    const double diff_s = ((double)f->t_ns - (double)f->arrival_ns) * 1e-9, off_s = diff_s < 0 ? -diff_s : diff_s;

    if (llabs(f->t_ns - wall_ns) < WALL_NS)
        snprintf(out, size, "its time stamps are of the wall clock");
    else if (fault == STAMP_REPEATED)
        snprintf(out, size, "its time stamps do not advance");
    else
        snprintf(out, size, "its time stamps are %.*f s %s", off_s < 1 ? 3 : 1, off_s, diff_s < 0 ? "behind" : "ahead");
}
