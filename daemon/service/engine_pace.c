/* Pace of the live picture: whether the machine is too slow for the sets that come. Visits and crossings are then
 * missed, so it is a notice, an event and a figure. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdio.h>
#include <string.h>

#include "base/clock.h"
#include "daemon/service/engine_internal.h"
#include "daemon/service/service_internal.h"

#define SPAN_S    5    /* seconds that are looked at, */
#define GRACE_S   15   /* after the first maps: they take long, and the background computation starts */
#define LEAST_HZ  2.0  /* sets a second that tracks need */
#define PASSED    0.5  /* of the sets that come */
#define ON_S      5    /* seconds in a row, until it is a notice, ... */
#define OFF_S     10   /* ... and until it is none, */
#define AGAIN     1.25 /* at this much more than the limits */

/* Rates of processed and of due sets in the last whole seconds; due sets are limited by live.rate_hz. */
static void measure_locked(const struct live_engine *v, int64_t now_s, double *done_hz, double *due_hz)
{
    const double limit_hz = v->config.live.rate_hz;
    uint64_t taken = 0, passed = 0;

    for (int i = 0; i < RATE_SLOTS; i++) {
        const struct second *s = &v->second[i];

        if (s->s < now_s - SPAN_S || s->s >= now_s)
            continue;
        taken += s->taken;
        passed += s->passed;
    }
    *done_hz = (double)taken / SPAN_S;
    *due_hz = (double)(taken + passed) / SPAN_S;
    if (limit_hz > 0 && *due_hz > limit_hz)
        *due_hz = limit_hz;
}

bool engine_pace_slow(double done_hz, double due_hz, bool slow)
{
    const double more = slow ? AGAIN : 1;

    return done_hz <= more * (1 - PASSED) * due_hz || (done_hz < more * LEAST_HZ && done_hz < 0.9 * due_hz);
}

/* @return the notice has begun or ended */
static bool turn_locked(struct live_engine *v, int64_t now_s)
{
    struct engine_state *s = &v->state;
    bool slow;

    if (!s->ready || !v->live) {
        v->pace_from_s = now_s + GRACE_S;
        v->pace_turn_s = 0;
    }
    if (!v->pace_from_s)
        v->pace_from_s = now_s + GRACE_S;
    measure_locked(v, now_s, &s->done_hz, &s->due_hz);
    slow = now_s >= v->pace_from_s && s->due_hz > 0 && engine_pace_slow(s->done_hz, s->due_hz, s->too_slow);
    v->pace_turn_s = slow == s->too_slow ? 0 : v->pace_turn_s ? v->pace_turn_s : now_s;
    if (slow)
        snprintf(s->slow_text, sizeof(s->slow_text),
                 "too slow: %.1f of %.1f sets a second are processed, so that visits and crossings are missed; lower "
                 "trigger: rate_hz, use smaller or fewer pictures, or give live: device a GPU",
                 s->done_hz, s->due_hz);
    if (!v->pace_turn_s || now_s - v->pace_turn_s < (slow ? ON_S : OFF_S))
        return false;
    s->too_slow = slow;
    v->pace_turn_s = 0;
    return true;
}

void engine_pace_follow(struct live_engine *v)
{
    const int64_t now_s = sst_clock_now_ns() / 1000000000;
    double done_hz, due_hz;
    bool turned, slow;

    if (now_s == v->pace_s)
        return;
    pthread_mutex_lock(&v->lock);
    v->pace_s = now_s;
    turned = turn_locked(v, now_s);
    slow = v->state.too_slow;
    done_hz = v->state.done_hz;
    due_hz = v->state.due_hz;
    pthread_mutex_unlock(&v->lock);
    if (turned && v->events)
        sst_events_emit(v->events, slow ? SST_EVENT_WARNING : SST_EVENT_INFO, "too-slow",
                        json_pack("{s:b, s:f, s:f}", "active", slow, "processed_hz", done_hz, "due_hz", due_hz),
                        slow ? "the machine is too slow: %.1f of %.1f sets a second are processed"
                             : "the machine is fast enough again: %.1f of %.1f sets a second are processed",
                        done_hz, due_hz);
}
