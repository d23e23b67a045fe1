/* daemon/events/events.h - events of the service: journal, event stream, hooks, MQTT. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_DAEMON_EVENTS_EVENTS_H
#define SST_DAEMON_EVENTS_EVENTS_H

#include <stdbool.h>

#include <jansson.h>

#include "base/base.h"

/* Event types, spelt as in JSON, hooks and MQTT topics, with the members of `data`:
 *   state              the service's state changed            {state, reason}
 *   camera-lost        a camera fell silent or was unplugged  {row, col, serial, port, reason}
 *   camera-found       it delivers again                      {row, col, serial, port}
 *   trigger-lost, trigger-found                               {reason}
 *   skew               sets exceed the limit, or no longer    {over, spread_us, row, col}
 *   storage            OK, LOW, FULL, or cannot be written    {state, reason, free_bytes, used_bytes}
 *   record-start, record-stop                                 {recording, reason, zone, label, sets}
 *   motion             change in a zone began or ended        {zone, active, share}; zone "": the whole picture
 *   label              a label appeared in a zone or left it  {zone, label, active, share}
 *                      both also have, at the end             {peak, times, seconds}: largest share; number of
 *                                                             appearances; time from its begin until last seen
 *   visit              something that moves came, or has gone
 *                      {visit, page, active, label, from, to, seconds, direction, zones, crossed, distance_m, nearest_m,
 *                       nearest_px, box, path}:
 *                      the same visit in both; path: [seconds, x, y, metres] of where it stood
 *   line               a visit crossed a line of the zones    {zone, direction, visit, page, label, hidden, distance_m}
 *   snapshot, export   a light field was stored               {name}
 *   reload             a configuration was applied or refused {applied, reason, changes}
 *   calibration        the calibration was checked            {verdict, sentence}
 *   certificate        of HTTPS: renewed, refused, expiring, expired {state, until}
 *   clock              the wall clock was stepped             {step_ms}
 *   client             a flood or many wrong tokens           {reason}
 *   device-lost, device-found   the device of the live picture failed at its pictures or labels; it works again {device,
 *                               work, reason}
 *   host-lost, host-found   a node of this head, or the head of this node  {host, reason}
 *   start, stop        of the service                         {version, reason} */

enum sst_event_level {
    SST_EVENT_INFO = 0,
    SST_EVENT_WARNING = 1,
    SST_EVENT_ERROR = 2,
};

struct sst_events; /* opaque; any thread */

/** Keeps the last `capacity` events. @return 0, -EINVAL, -ENOMEM */
SST_MUST_CHECK int sst_events_create(struct sst_events **out, int capacity);

/**
 * Store an event, write it to the journal (fields SST_EVENT=, CAMERA=rRcC, SET=, MESSAGE_ID=, as far as
 * `data` has them) or, without one, to standard error, and wake the waiting threads.
 *
 * @param data  owned from then on; NULL: none. "row" and "col", "set" also become fields of the journal.
 */
void sst_events_emit(struct sst_events *events, enum sst_event_level level, const char *type, json_t *data,
                     const char *fmt, ...) SST_PRINTF(5, 6);

/** The first event with an id above `after`, as one line of JSON {id, time, level, type, message, data} to free with
 *  free(). @param id  out @return false: there is none */
SST_MUST_CHECK bool sst_events_next(struct sst_events *events, uint64_t after, uint64_t *id, char **json);

/** Wait for an event with an id above `after`. @return true: there is one; false: time-out, or shut */
bool sst_events_wait(struct sst_events *events, uint64_t after, int timeout_ms);

/** Id of the newest; 0: none. */
uint64_t sst_events_last(struct sst_events *events);

/** Called after each event, on the thread that emitted it; must neither block nor emit. At most 8 watchers. */
typedef void sst_events_fn(void *arg);
SST_MUST_CHECK int sst_events_watch(struct sst_events *events, sst_events_fn *fn, void *arg);
void sst_events_unwatch(struct sst_events *events, sst_events_fn *fn, void *arg);

/** Events of each level since the start. */
void sst_events_counts(struct sst_events *events, uint64_t count[3]);

void sst_events_shut(struct sst_events *events);
void sst_events_destroy(struct sst_events *events); /* NULL is fine */

#endif
