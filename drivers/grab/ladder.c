/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "drivers/grab/grab_internal.h"

/* A device that was reset, re-authorised or switched off is enumerated and probed again. */
#define ENUMERATE_NS INT64_C(3000000000)

void ladder_init(struct ladder *l, int64_t patience_ns, bool usb, bool port_power)
{
    *l = (struct ladder){
        .patience_ns = patience_ns,
        .usb = usb,
        .port_power = port_power,
        .rung = -1,
        .back_off_ns = SST_LADDER_BACK_OFF_NS,
    };
}

static bool re_enumerates(int rung)
{
    return rung == SST_GRAB_RESET || rung == SST_GRAB_REAUTHORISE || rung == SST_GRAB_POWER;
}

static int rest(struct ladder *l, int64_t now_ns)
{
    l->phase = SST_LADDER_RESTING;
    l->rung = SST_GRAB_BACK_OFF;
    l->due_ns = now_ns + l->back_off_ns;
    l->back_off_ns *= 2;
    if (l->back_off_ns > SST_LADDER_BACK_OFF_MAX_NS)
        l->back_off_ns = SST_LADDER_BACK_OFF_MAX_NS;
    return SST_GRAB_BACK_OFF;
}

static int work(struct ladder *l, int rung)
{
    l->phase = SST_LADDER_WORKING;
    l->rung = rung;
    l->due_ns = 0;
    return rung;
}

static int climb(struct ladder *l, int64_t now_ns, bool streaming)
{
    int rung = l->rung + 1;

    if (rung == SST_GRAB_RESTREAM && !streaming)
        rung++;
    if ((rung == SST_GRAB_RESET || rung == SST_GRAB_REAUTHORISE) && !l->usb)
        rung = SST_GRAB_POWER;
    if (rung == SST_GRAB_POWER && !(l->usb && l->port_power))
        rung++;
    return rung >= SST_GRAB_BACK_OFF ? rest(l, now_ns) : work(l, rung);
}

static int wait_until(struct ladder *l, int64_t due_ns)
{
    l->phase = SST_LADDER_WAITING;
    l->due_ns = due_ns;
    return -1;
}

static int on_frame(struct ladder *l, int64_t now_ns)
{
    if (l->phase == SST_LADDER_WAITING) {
        l->phase = SST_LADDER_QUIET;
        l->due_ns = 0;
        l->well_ns = now_ns;
    } else if (l->phase == SST_LADDER_QUIET && l->rung >= 0 && now_ns - l->well_ns >= SST_LADDER_SETTLE_NS) {
        l->rung = -1;
        l->back_off_ns = SST_LADDER_BACK_OFF_NS;
    }
    return -1;
}

static int on_time(struct ladder *l, int64_t now_ns, bool streaming)
{
    if (!l->due_ns || now_ns < l->due_ns)
        return -1;
    if (l->phase == SST_LADDER_WAITING)
        return climb(l, now_ns, streaming);
    return l->phase == SST_LADDER_RESTING ? work(l, SST_GRAB_REOPEN) : -1;
}

static int on_lost(struct ladder *l)
{
    if (!ladder_expects_loss(l))
        ladder_init(l, l->patience_ns, l->usb, l->port_power);
    return -1;
}

bool ladder_expects_loss(const struct ladder *l)
{
    return re_enumerates(l->rung) && (l->phase == SST_LADDER_WORKING || l->phase == SST_LADDER_WAITING);
}

int ladder_step(struct ladder *l, enum ladder_event event, int64_t now_ns, bool streaming)
{
    switch (event) {
    case SST_LADDER_OPENED:
        return wait_until(l, now_ns + l->patience_ns);
    case SST_LADDER_FRAME:
        return on_frame(l, now_ns);
    case SST_LADDER_FAULT:
        return l->phase == SST_LADDER_QUIET || l->phase == SST_LADDER_WAITING ? climb(l, now_ns, streaming) : -1;
    case SST_LADDER_DONE:
        return l->phase != SST_LADDER_WORKING
                   ? -1
                   : wait_until(l, now_ns + l->patience_ns + (re_enumerates(l->rung) ? ENUMERATE_NS : 0));
    case SST_LADDER_FAILED:
        return wait_until(l, now_ns + SST_LADDER_RETRY_NS);
    case SST_LADDER_REFUSED:
        return rest(l, now_ns);
    case SST_LADDER_TIME:
        return on_time(l, now_ns, streaming);
    case SST_LADDER_LOST:
        return on_lost(l);
    }
    return -1;
}
