/* Sets of a node: from its queue to the head, and where their frames end. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "capture/link/link_internal.h"
#include "pipeline/live/frames/unchanged.h"

/* --- where frames end --------------------------------------------------------------------------------------------- */

static void end_frames_locked(struct sst_link_node *n, enum sst_link_bucket bucket, int frames)
{
    n->state.bucket[bucket] += (uint64_t)frames;
    n->state.waiting -= (uint64_t)frames;
}

void node_drop_oldest_locked(struct sst_link_node *n)
{
    end_frames_locked(n, n->state.connected ? SST_LINK_DROPPED : SST_LINK_AWAY, n->queue[n->first].frames);
    n->first = (n->first + 1) % NODE_QUEUE_MAX;
    n->count--;
}

/* Its bytes are not needed any more, sent or not. */
static void free_pieces(struct sst_link_node *n, const struct node_flight *f)
{
    if (f->pieces < 0)
        return;
    n->by.pieces[f->pieces].used = false;
    if (n->by.sending == f->pieces)
        n->by.sending = -1;
}

int64_t node_confirm_locked(struct sst_link_node *n, uint64_t seq, uint64_t missed, int64_t now_ns)
{
    int64_t took_ns = 0;
    int done = 0;

    while (done < n->flights && n->flight[done].seq <= seq) {
        const struct node_flight *f = &n->flight[done++];

        if (seq - f->seq < 64 && missed >> (seq - f->seq) & 1) {
            end_frames_locked(n, SST_LINK_MISSED, f->frames);
            n->renew = true; /* the head has not seen the base of the sets behind it */
        } else {
            end_frames_locked(n, SST_LINK_SENT, f->frames - f->unchanged);
            end_frames_locked(n, SST_LINK_UNCHANGED, f->unchanged);
            took_ns = now_ns - f->sent_ns;
        }
        free_pieces(n, f);
    }
    n->flights -= done;
    memmove(n->flight, n->flight + done, (size_t)n->flights * sizeof(n->flight[0]));
    return took_ns;
}

void node_lose_flights_locked(struct sst_link_node *n)
{
    for (int i = 0; i < n->flights; i++) {
        end_frames_locked(n, SST_LINK_LOST, n->flight[i].frames);
        free_pieces(n, &n->flight[i]);
    }
    n->flights = 0;
}

/* --- a set -------------------------------------------------------------------------------------------------------- */

void node_renew_unchanged(struct sst_link_node *n)
{
    sst_unchanged_destroy(n->unchanged);
    n->unchanged = NULL;
    n->renew = false;
    if (n->array.hosts.skip_unchanged &&
        sst_unchanged_create(&n->unchanged, n->sent.bound, n->sent.fourcc, n->sent.width, n->sent.height))
        sst_log_warning("hosts.skip_unchanged: no memory or no such format: every picture is sent");
}

/* Part of a camera's frame that is sent. */
static struct wire_frame describe(struct sst_link_node *n, const struct sst_kept *kept, int cam)
{
    const struct sst_frame *f = kept->set.frame[cam];
    const struct sst_config_camera *c = &n->sent.camera[cam];
    const int64_t delay_ns = n->sent.lines ? (int64_t)n->sent.delay_us[c->line] * 1000 : 0;
    bool same;

    if (!f)
        return (struct wire_frame){ .kind = WIRE_MISSING };
    same = n->unchanged && sst_unchanged_same(n->unchanged, cam, f->data, f->bytes, f->stride);
    return (struct wire_frame){ .kind = same ? WIRE_UNCHANGED : WIRE_FRAME,
                                .bytes = same ? 0 : (uint32_t)f->bytes,
                                .stride = (uint32_t)f->stride,
                                .sequence = f->sequence,
                                .lost_before = f->lost_before,
                                .faults = f->faults,
                                .from_set_ns = f->t_ns - delay_ns - kept->set.t_ns,
                                .since = same ? n->since[cam] : 0 };
}

static void fill(const struct sst_link_node *n, const struct sst_kept *kept, uint8_t *at)
{
    const int cameras = n->sent.bound;

    wire_put_set(at, &(struct wire_set){ .seq = n->seq,
                                         .count = kept->set.index,
                                         .t_ns = kept->set.t_ns,
                                         .wall_ns = kept->set.wall_ns,
                                         .edge = kept->set.edge,
                                         .cameras = cameras });
    at += WIRE_SET_BYTES;
    for (int i = 0; i < cameras; i++, at += WIRE_FRAME_BYTES)
        wire_put_frame(at, &n->frame[i]);
    for (int i = 0; i < cameras; i++) {
        if (n->frame[i].kind == WIRE_FRAME)
            memcpy(at, kept->set.frame[i]->data, n->frame[i].bytes);
        at += n->frame[i].bytes;
    }
}

/* @param flight  out, but frames @return 0, -ENOMEM */
static int write_set(struct sst_link_node *n, const struct sst_kept *kept, struct node_flight *flight)
{
    const int cameras = n->sent.bound;
    size_t bytes = WIRE_SET_BYTES + (size_t)cameras * WIRE_FRAME_BYTES;
    uint8_t *at;

    if (n->renew)
        node_renew_unchanged(n);
    *flight = (struct node_flight){ .seq = n->seq + 1 };
    for (int i = 0; i < cameras; i++) {
        n->frame[i] = describe(n, kept, i);
        bytes += n->frame[i].bytes;
        flight->unchanged += n->frame[i].kind == WIRE_UNCHANGED;
        if (n->frame[i].kind == WIRE_FRAME)
            n->since[i] = flight->seq;
    }
    flight->pieces = node_datagrams_ready(n) ? node_datagrams_room(n, bytes) : -1;
    at = flight->pieces >= 0 ? n->by.pieces[flight->pieces].data : link_stream_add(&n->stream, MESSAGE_SET, bytes);
    if (!at)
        return -ENOMEM;
    n->seq = flight->seq;
    fill(n, kept, at);
    if (flight->pieces >= 0)
        node_datagrams_send(n, flight->pieces, flight->seq);
    return 0;
}

/* Send the oldest set of the queue. */
static int send_one(struct sst_link_node *n)
{
    const struct sst_kept *kept;
    struct node_flight flight;
    struct node_queued next;
    int err;

    pthread_mutex_lock(&n->lock);
    next = n->queue[n->first];
    n->first = (n->first + 1) % NODE_QUEUE_MAX;
    n->count--;
    pthread_mutex_unlock(&n->lock);
    kept = sst_ring_get(n->ring, next.number);
    if (kept && kept->number == next.number && next.opening == n->opening_sent)
        err = write_set(n, kept, &flight);
    else /* the ring is too small for the queue, or the set is of an earlier opening */
        err = -ENOENT;
    sst_ring_unref(n->ring, kept);
    pthread_mutex_lock(&n->lock);
    if (err) {
        end_frames_locked(n, SST_LINK_DROPPED, next.frames);
    } else {
        flight.frames = next.frames;
        flight.sent_ns = sst_clock_now_ns();
        n->flight[n->flights++] = flight;
    }
    pthread_mutex_unlock(&n->lock);
    return err == -ENOMEM ? err : 0;
}

/* One set at a time goes into the stream's buffer, or out by datagrams: from there it cannot be dropped any more. */
static bool may_send(struct sst_link_node *n)
{
    const bool datagrams = node_datagrams_ready(n);
    bool may;

    if (node_datagrams_busy(n) || node_datagrams_soon(n) || (!datagrams && link_stream_waiting(&n->stream)))
        return false;
    pthread_mutex_lock(&n->lock);
    may = n->count && n->flights < (datagrams ? NODE_FLIGHT_MAX : NODE_FLIGHT);
    pthread_mutex_unlock(&n->lock);
    return may;
}

int node_send_sets(struct sst_link_node *n)
{
    int err = 0;

    while (!err && may_send(n)) {
        err = send_one(n);
        err = err ? err : node_datagrams_work(n, sst_clock_now_ns());
        err = err ? err : link_stream_work(&n->stream, n->reason);
    }
    return err;
}
