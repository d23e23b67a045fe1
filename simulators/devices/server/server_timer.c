/* Timers of the simulator: a heap, the earliest one in a timerfd. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdlib.h>
#include <sys/timerfd.h>

#include "base/clock.h"
#include "base/mem.h"
#include "simulators/devices/server/server_internal.h"

static void place(struct sim_server *s, int i, struct sim_timer *timer)
{
    s->heap[i] = timer;
    timer->slot = i + 1;
}

static void sift(struct sim_server *s, int i)
{
    struct sim_timer *timer = s->heap[i];

    while (i > 0 && s->heap[(i - 1) / 2]->due_ns > timer->due_ns) {
        place(s, i, s->heap[(i - 1) / 2]);
        i = (i - 1) / 2;
    }
    for (int child; (child = 2 * i + 1) < s->timers; i = child) {
        if (child + 1 < s->timers && s->heap[child + 1]->due_ns < s->heap[child]->due_ns)
            child++;
        if (s->heap[child]->due_ns >= timer->due_ns)
            break;
        place(s, i, s->heap[child]);
    }
    place(s, i, timer);
}

void sim_timers_arm(struct sim_server *s)
{
    struct itimerspec when = { 0 };

    if (s->timers) {
        const int64_t due = s->heap[0]->due_ns > 0 ? s->heap[0]->due_ns : 1;

        when.it_value = (struct timespec){ .tv_sec = due / 1000000000, .tv_nsec = due % 1000000000 };
    }
    (void)timerfd_settime(s->timerfd, TFD_TIMER_ABSTIME, &when, NULL);
}

int sim_timer_set(struct sim_server *s, struct sim_timer *timer, int64_t due_ns)
{
    if (!timer->slot) {
        if (!sst_mem_grow(&s->heap, s->timers, &s->heap_room, sizeof(*s->heap)))
            return -ENOMEM;
        place(s, s->timers++, timer);
    }
    timer->due_ns = due_ns;
    sift(s, timer->slot - 1);
    return 0;
}

void sim_timer_stop(struct sim_server *s, struct sim_timer *timer)
{
    const int i = timer->slot - 1;

    if (i < 0)
        return;
    timer->slot = 0;
    s->timers--;
    if (i < s->timers) {
        place(s, i, s->heap[s->timers]);
        sift(s, i);
    }
}

void sim_timers_fire(struct sim_server *s)
{
    const int64_t now = sst_clock_now_ns();

    while (s->timers && s->heap[0]->due_ns <= now && !s->stop) {
        struct sim_timer *timer = s->heap[0];

        sim_timer_stop(s, timer);
        timer->fire(timer->arg);
    }
}
