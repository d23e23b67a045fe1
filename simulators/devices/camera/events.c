/* V4L2 events: changes of controls, sent to the files that subscribed to them. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <string.h>
#include <time.h>

#include "simulators/devices/camera/camera_internal.h"

static int find_subscription(const struct sim_open *o, uint32_t id)
{
    for (int i = 0; i < o->subscriptions; i++)
        if (o->subscribed[i].id == id)
            return i;
    return -1;
}

static void forget_event(struct sim_open *o, int i)
{
    o->events--;
    memmove(&o->event[i], &o->event[i + 1], (size_t)(o->events - i) * sizeof(o->event[0]));
}

/* Dequeue the oldest event. */
static void dequeue(struct sim_open *o, struct sim_request *r)
{
    struct v4l2_event *out = (struct v4l2_event *)r->data;

    *out = o->event[0];
    forget_event(o, 0);
    out->pending = (uint32_t)o->events;
    r->out_bytes = sizeof(*out);
    if (!o->events && o->handle->urgent)
        r->out_flags |= SST_SIM_TAKE_URGENT;
}

static void put(struct sim_open *o, int control, uint32_t changes)
{
    struct v4l2_event e = { .sequence = o->event_sequence++ };
    struct sim_request *waiter = o->event_waiter;

    sim_cam_control_state(o->cam, control, changes, &e);
    (void)clock_gettime(CLOCK_MONOTONIC, &e.timestamp);
    /* One event per control is queued; a newer one merges the changes of an older one. */
    for (int i = 0; i < o->events; i++)
        if (o->event[i].id == e.id) {
            e.u.ctrl.changes |= o->event[i].u.ctrl.changes;
            forget_event(o, i);
            break;
        }
    o->event[o->events++] = e;
    if (waiter) {
        o->event_waiter = NULL;
        dequeue(o, waiter);
        sst_sim_answer(o->cam->server, waiter, 0);
    } else {
        sim_handle_urgent(o->handle);
    }
}

void sim_cam_control_event(struct sim_cam *cam, const struct sim_open *by, int control, uint32_t changes)
{
    struct v4l2_event e = { 0 };

    sim_cam_control_state(cam, control, changes, &e);
    for (struct sim_open *o = cam->opens; o; o = o->next) {
        const int i = find_subscription(o, e.id);

        if (i >= 0 && (o != by || (o->subscribed[i].flags & V4L2_EVENT_SUB_FL_ALLOW_FEEDBACK)))
            put(o, control, changes);
    }
}

int sim_cam_subscribe(struct sim_open *o, const struct v4l2_event_subscription *s)
{
    const int control = s->type == V4L2_EVENT_CTRL ? sim_cam_control_find(s->id) : -1;

    if (control < 0)
        return -EINVAL;
    if (find_subscription(o, s->id) >= 0)
        return 0;
    o->subscribed[o->subscriptions++] = *s; /* at most one per control: there is room */
    /* The heading of a class has no state to report. */
    if ((s->flags & V4L2_EVENT_SUB_FL_SEND_INITIAL) && sim_cam_control_find(V4L2_CTRL_ID2WHICH(s->id) | 1) != control)
        put(o, control, V4L2_EVENT_CTRL_CH_FLAGS | V4L2_EVENT_CTRL_CH_VALUE);
    return 0;
}

int sim_cam_unsubscribe(struct sim_open *o, const struct v4l2_event_subscription *s, struct sim_request *r)
{
    const bool all = s->type == V4L2_EVENT_ALL;

    for (int i = o->subscriptions - 1; i >= 0; i--)
        if (all || (s->type == V4L2_EVENT_CTRL && o->subscribed[i].id == s->id)) {
            for (int k = o->events - 1; k >= 0; k--)
                if (o->event[k].id == o->subscribed[i].id)
                    forget_event(o, k);
            o->subscribed[i] = o->subscribed[--o->subscriptions];
        }
    if (!o->events && o->handle->urgent)
        r->out_flags |= SST_SIM_TAKE_URGENT;
    return 0;
}

int sim_cam_dequeue_event(struct sim_open *o, struct sim_request *r)
{
    if (o->events) {
        dequeue(o, r);
        return 0;
    }
    if (r->call.flags & SST_SIM_NONBLOCK)
        return -ENOENT;
    if (o->event_waiter)
        return -EBUSY;
    o->event_waiter = r;
    return SST_SIM_LATER;
}
