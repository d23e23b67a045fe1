/* capture/link/link.h - several hosts with one array: nodes send their sets to a head, which assembles them as one.
 *
 * All hosts count the edges of one trigger; docs/use/hosts.md explains wiring, clocks and certificates. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_CAPTURE_LINK_LINK_H
#define SST_CAPTURE_LINK_LINK_H

#include <jansson.h>

#include "capture/array/capture.h"
#include "capture/array/ring.h"
#include "capture/array/source.h"
#include "capture/link/numbering.h"
#include "config/array.h"

/* --- node --------------------------------------------------------------------------------------------------------- */

struct sst_link_node; /* opaque; any thread, but open and close */

/** Where frames of captured sets ended on their way to the head: exactly one place each. */
enum sst_link_bucket {
    SST_LINK_SENT = 0,      /* the head has confirmed them ... */
    SST_LINK_UNCHANGED = 1, /* confirmed, sent without their bytes, as they equal the ones before */
    SST_LINK_DROPPED = 2,   /* the queue was full: the oldest went */
    SST_LINK_AWAY = 3,      /* the queue was full while no head was connected: the oldest went */
    SST_LINK_LOST = 4,      /* sent, but the connection ended before the head had them */
    SST_LINK_MISSED = 5,    /* sent by datagrams, and their set was not complete in time */
    SST_LINK_BUCKETS = 6,
};

extern const char *const sst_link_keys[SST_LINK_BUCKETS]; /* their names in JSON and metrics */

struct sst_link_node_state {
    bool connected;
    char reason[256];                                                /* why not */
    uint64_t connections, frames, bucket[SST_LINK_BUCKETS], waiting; /* frames of sets since the start; waiting: in the
                                                                        queue, or sent and not confirmed */
    uint64_t unexplained;                                            /* frames in no place or in two: 0, or a bug */
    uint64_t sent_bytes;
    bool datagrams;                    /* sets go by datagrams; else over TLS, and */
    char datagrams_reason[256];        /* ... why */
    uint64_t sent_datagrams, repaired; /* since the start; pieces that were sent again over TLS */
    double reply_ms;                   /* from sending a set to its confirmation, smoothed; 0: none yet */
};

struct sst_link_node_config {
    const struct sst_array_config *array; /* copied */
    struct sst_ring *ring;                /* must outlive the node */
    void *arg;
    void (*event)(void *arg, const char *node, bool connected,
                  const char *why); /* on the link's thread; node: the head */
};

/** Start the thread that connects to the head. @return 0, -EINVAL (certificates), -ENOSYS, -ENOMEM, -EAGAIN; logged */
SST_MUST_CHECK int sst_link_node_open(struct sst_link_node **out, const struct sst_link_node_config *cfg);

/** The array was opened: its cameras, and a new counting of edges. NULL: it was closed. */
void sst_link_node_cameras(struct sst_link_node *node, const struct sst_array_config *layout);
void sst_link_node_camera(struct sst_link_node *node, int cam, enum sst_grab_state state, const char *why,
                          const struct sst_grab_device *device);

/** A set went into the ring as its newest: send it. */
void sst_link_node_set(struct sst_link_node *node, const struct sst_frameset *set);

/** The counters of capturing, for the head's status; about once a second. */
void sst_link_node_report(struct sst_link_node *node, const struct sst_capture_report *report);

void sst_link_node_state(struct sst_link_node *node, struct sst_link_node_state *out);
/** End the threads; sets that come afterwards are not sent. */
void sst_link_node_stop(struct sst_link_node *node);
/** NULL is fine. */
void sst_link_node_close(struct sst_link_node *node);

/** Would this host find its certificates and, as a node, the head? For `sst doctor`; takes a second at most.
 *  @param why  one sentence, also on success @return 0, or the error */
SST_MUST_CHECK int sst_link_check(const struct sst_array_config *array, char *why, size_t size);

/* --- head --------------------------------------------------------------------------------------------------------- */

struct sst_link_head; /* opaque; any thread, but open and close */

/** A node, as reported. */
struct sst_link_peer {
    char name[64]; /* "" for the head's own cameras */
    bool connected;
    char reason[256]; /* why not */
    char address[64];
    int cameras;
    uint64_t connections;
    uint64_t sets, frames, unchanged; /* received; frames include unchanged ones */
    /* Of the frames: passed to capture; unchanged from a picture that was missed; no room; of no trigger; on their way.
     */
    uint64_t passed, missed, dropped, unnamed, waiting;
    uint64_t unexplained; /* frames in no place or in two: 0, or a bug */
    uint64_t received_bytes;
    /* Datagrams: received; more than were needed; refused. Pieces that came over TLS instead; sets of which they were
     * asked for; sets that stayed incomplete. */
    uint64_t datagrams, spare, refused, repaired, asked, missed_sets;
    struct sst_numbering_state numbering;
    uint64_t run, seq;    /* of the last set */
    uint64_t missed_bits; /* bit i: set seq - i was missed */
    json_t *reported;     /* its last STATE; NULL: none */
};

struct sst_link_head_config {
    const struct sst_array_config *array; /* copied */
    void *arg;
    void (*event)(void *arg, const char *node, bool connected, const char *why); /* on the link's thread */
};

/**
 * Listen for the nodes, and capture with the cameras that array->camera[] lists, if any.
 *
 * @param layout  out, the array as capture sees it: camera[] are all views
 * @return 0, -EADDRINUSE, -EINVAL (certificates), -ENOSYS, -ENOMEM ...; logged
 */
SST_MUST_CHECK int sst_link_head_open(struct sst_link_head **out, const struct sst_link_head_config *cfg,
                                      struct sst_array_config *layout);

/** For sst_capture_open_source(). */
struct sst_source sst_link_head_source(struct sst_link_head *head);

/** @param out  [SST_NUMBERING_SOURCES]; their `reported` are the caller's @return count */
int sst_link_head_peers(struct sst_link_head *head, struct sst_link_peer *out);

/** Datagrams that the kernel had no room for: net.core.rmem_max is too small, or the machine too busy. */
uint64_t sst_link_head_overflows(struct sst_link_head *head);

/** Which peer has a view; -1: none. */
int sst_link_head_owner(struct sst_link_head *head, int view);

/** Make the thread that receives end; does not wait. */
void sst_link_head_stop(struct sst_link_head *head);

/** After its capture. NULL is fine. */
void sst_link_head_close(struct sst_link_head *head);

#endif
