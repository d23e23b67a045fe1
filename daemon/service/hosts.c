/* Other hosts of the array: nodes of a head, the head of a node (docs/use/hosts.md). */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdio.h>
#include <stdlib.h>

#include "daemon/service/service_internal.h"

#define ROW    SST_FIELD
#define GROUP  SST_FIELD_GROUP
#define NAMES  SST_FIELD_NAMES
#define COUNTS SST_FIELD_COUNTS

static const char *const role_names[] = { "node", "head" };

#define IN struct hosts_now
#define CLOCK                                                                                                          \
    GROUP("clock", "Of this host, by its kernel",                                                                      \
          ROW("synchronised", BOOL, synchronised, "A program keeps the wall clock right"),                             \
          ROW("error_ms", REAL, error_ms, "Largest error of it"))

const struct sst_field hosts_node_fields[] = {
    ROW("role", NAME, role_name, "Role of this host", NAMES(role_names)),
    GROUP("head", "Of a node: its head", ROW("address", NAME, address, "Address of the head"),
          ROW("connected", BOOL, node.connected, "This node is connected to the head", "head_connected"),
          ROW("reason", TEXT, node.reason, "Reason why it is not connected, or \"\""),
          ROW("connections", INTEGER, node.connections, "Times that it connected"),
          ROW("sent_bytes", INTEGER, node.sent_bytes, "Bytes sent to the head", "link_sent_bytes"),
          ROW("reply_ms", REAL, node.reply_ms, "From sending a set to its confirmation")),
    GROUP("datagrams", "Of a node: pictures that go by datagrams",
          ROW("used", BOOL, node.datagrams, "Pictures go to the head by datagrams; else over TLS", "link_datagrams"),
          ROW("reason", TEXT, node.datagrams_reason, "Reason why they go over TLS, or \"\""),
          ROW("sent", INTEGER, node.sent_datagrams, "Datagrams sent"),
          ROW("repaired", INTEGER, node.repaired,
              "Pieces that the head asked for again, as too many datagrams were lost", "link_repaired_pieces")),
    GROUP("frames", "Of a node: captured = sent + unchanged + dropped + away + lost + missed + waiting",
          ROW("captured", INTEGER, node.frames, "Frames of captured sets since the start"),
          ROW("", MAP, node.bucket,
              "Frames of captured sets since the start, by where they ended on their way to the head", "link_frames",
              .label = "bucket", COUNTS(sst_link_keys)),
          ROW("waiting", INTEGER, node.waiting, "Frames on their way", "link_frames", .label = "bucket"),
          ROW("unexplained", INTEGER, node.unexplained, "Frames that ended nowhere or twice: 0, or a bug",
              "link_frames_unexplained")),
    CLOCK,
    { 0 },
};
#undef IN

#define IN struct hosts_peer
static const struct sst_field peer_fields[] = {
    ROW("name", TEXT, link.name, "Name of the node; \"\": cameras of the head"),
    ROW("connected", BOOL, link.connected, "The node is connected", "node_up"),
    ROW("reason", TEXT, link.reason, "Reason why it is not connected, or \"\""),
    ROW("address", TEXT, link.address, "Its address"),
    ROW("cameras", INTEGER, link.cameras, "Its cameras"),
    ROW("connections", INTEGER, link.connections, "Times that the node connected", "node_connections"),
    ROW("sets", INTEGER, link.sets, "Sets received"),
    ROW("received_bytes", INTEGER, link.received_bytes, "Bytes that came from the node", "node_received_bytes"),
    GROUP(
        "frames", "Frames by where they ended",
        ROW("received", INTEGER, link.frames, "Frames that came from the node, unchanged ones included",
            "node_received_frames"),
        ROW("unchanged", INTEGER, link.unchanged, "Frames of them whose bytes were not sent, as nothing changed",
            "node_unchanged_frames"),
        ROW("passed", INTEGER, link.passed, "Frames of them passed to capture"),
        ROW("missed", INTEGER, link.missed, "Frames that came from the node, by where they ended", "node_frames",
            .label = "bucket"),
        ROW("no_room", INTEGER, link.dropped, "Frames for which there was no memory", "node_frames", .label = "bucket"),
        ROW("unnamed", INTEGER, link.unnamed, "Frames of no known trigger", "node_frames", .label = "bucket"),
        ROW("waiting", INTEGER, link.waiting, "Frames on their way", "node_frames", .label = "bucket"),
        ROW("", MAP, bucket, "Frames passed to capture, by where they ended", "node_frames", .label = "bucket",
            COUNTS(sst_bucket_keys)),
        ROW("unexplained", INTEGER, link.unexplained, "Frames that ended nowhere or twice: 0, or a bug",
            "node_frames_unexplained")),
    ROW("placed", BOOL, link.numbering.placed, "Its edges have been named"),
    ROW("slips", INTEGER, link.numbering.slips, "Corrections of the node's count of edges", "node_slips"),
    ROW("slipped_edges", INTEGER, link.numbering.slipped, "Edges that these amount to"),
    ROW("renamed", INTEGER, link.numbering.renamed, "Times that its edges were named by the clock again"),
    ROW("clock_ms", REAL, clock_ms, "The node's wall clock less the head's, by the edges that both stamped",
        "node_clock_seconds", .per = 1e3),
    ROW("edge_us", REAL, edge_us, "Stamp of its last edge less that of the others, without the difference of clocks"),
    GROUP("datagrams", "Datagrams of the node",
          ROW("received", INTEGER, link.datagrams, "Datagrams that came from the node", "node_datagrams"),
          ROW("spare", INTEGER, link.spare, "Datagrams that were not needed"),
          ROW("refused", INTEGER, link.refused, "Datagrams that were refused"),
          ROW("asked", INTEGER, link.asked, "Sets of which pieces were asked for again", "node_repaired_sets"),
          ROW("repaired", INTEGER, link.repaired, "Pieces that came over TLS instead"),
          ROW("missed_sets", INTEGER, link.missed_sets, "Sets that stayed incomplete", "node_missed_sets")),
    ROW("reported", JSON, link.reported, "Last report of the node about itself", .nullable = true),
    { 0 },
};
#undef IN

#define IN struct hosts_now
const struct sst_field hosts_head_fields[] = {
    ROW("role", NAME, role_name, "Role of this host", NAMES(role_names)),
    ROW("address", NAME, address, "Of a head: where it listens"),
    ROW("datagrams_no_room", INTEGER, overflows, "Datagrams of nodes that the kernel had no room for",
        "datagrams_no_room"),
    ROW("nodes", LIST, peer, "Of a head: its nodes", .label = "node", .of = peer_fields,
        .stride = sizeof(struct hosts_peer), .count_at = offsetof(struct hosts_now, peers)),
    CLOCK,
    { 0 },
};
#undef IN

/* --- problems ----------------------------------------------------------------------------------------------------- */

/** A clock that is wrong by more than this part of a period may name a set wrongly when its node joins. */
#define CLOCK_PART 10

bool service_hosts_problem(struct service_array *a, char *why, size_t size)
{
    struct hosts_now *now = calloc(1, sizeof(*now));
    const bool several = now && array_hosts(a, now);

    why[0] = 0;
    if (several && now->role == SST_CONFIG_NODE && !now->node.connected)
        snprintf(why, size, "the head is not connected: %s", now->node.reason[0] ? now->node.reason : "not tried yet");
    for (int i = 0; several && i < now->peers && !why[0]; i++) {
        const struct sst_link_peer *p = &now->peer[i].link;

        if (!p->connected)
            snprintf(why, size, "node %s is not connected: %s", p->name, p->reason);
        else if (p->sets > 10 && !p->numbering.placed)
            snprintf(why, size,
                     "the clock of node %s differs by about %.0f ms, too much to name its sets: see to chrony or PTP "
                     "on both",
                     p->name, (double)p->numbering.clock_ns / 1e6);
        else if (p->numbering.placed && llabs(p->numbering.clock_ns) > now->period_ns / CLOCK_PART)
            snprintf(why, size,
                     "the clock of node %s differs by %.0f ms, more than a tenth of the trigger's period: after a "
                     "restart its "
                     "sets could be named wrongly; see to chrony or PTP",
                     p->name, (double)p->numbering.clock_ns / 1e6);
    }
    if (now)
        array_hosts_forget(now);
    free(now);
    return why[0] != 0;
}
