/* Other hosts of the array, as reported: the nodes of a head, the head of a node (docs/use/hosts.md). */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/kernel_clock.h"
#include "base/text.h"
#include "daemon/service/service_internal.h"

static json_t *count(uint64_t n)
{
    return json_integer((json_int_t)n);
}

static json_t *clock_json(void)
{
    struct sst_kernel_clock clock;

    sst_kernel_clock(&clock);
    return json_pack("{s:b, s:f}", "synchronised", clock.synchronised, "error_ms", clock.error_us / 1e3);
}

static json_t *node_json(struct service_array *a, const struct sst_link_node_state *n)
{
    json_t *frames = json_object();

    for (int i = 0; i < SST_LINK_BUCKETS; i++)
        json_object_set_new(frames, sst_link_keys[i], count(n->bucket[i]));
    json_object_set_new(frames, "captured", count(n->frames));
    json_object_set_new(frames, "waiting", count(n->waiting));
    json_object_set_new(frames, "unexplained", count(n->unexplained));
    return json_pack("{s:s, s:{s:s, s:b, s:s, s:I, s:I, s:f}, s:{s:b, s:s, s:I, s:I}, s:o, s:o}", "role", "node",
                     "head", "address", array_head_address(a), "connected", n->connected, "reason", n->reason,
                     "connections", (json_int_t)n->connections, "sent_bytes", (json_int_t)n->sent_bytes, "reply_ms",
                     n->reply_ms, "datagrams", "used", n->datagrams, "reason", n->datagrams_reason, "sent",
                     (json_int_t)n->sent_datagrams, "repaired", (json_int_t)n->repaired, "frames", frames, "clock",
                     clock_json());
}

static json_t *peer_json(struct sst_link_peer *p, const uint64_t bucket[SST_BUCKETS])
{
    json_t *frames = json_object(), *o;

    for (int i = 0; i < SST_BUCKETS; i++)
        json_object_set_new(frames, sst_bucket_keys[i], count(bucket[i]));
    json_object_set_new(frames, "received", count(p->frames));
    json_object_set_new(frames, "unchanged", count(p->unchanged));
    json_object_set_new(frames, "passed", count(p->passed));
    json_object_set_new(frames, "missed", count(p->missed));
    json_object_set_new(frames, "no_room", count(p->dropped));
    json_object_set_new(frames, "unnamed", count(p->unnamed));
    json_object_set_new(frames, "waiting", count(p->waiting));
    json_object_set_new(frames, "unexplained", count(p->unexplained));
    o = json_pack("{s:s, s:b, s:s, s:s, s:i, s:I, s:I, s:I, s:o, s:b, s:I, s:I, s:I, s:f, s:f}", "name", p->name,
                  "connected", p->connected, "reason", p->reason, "address", p->address, "cameras", p->cameras,
                  "connections", (json_int_t)p->connections, "sets", (json_int_t)p->sets, "received_bytes",
                  (json_int_t)p->received_bytes, "frames", frames, "placed", p->numbering.placed, "slips",
                  (json_int_t)p->numbering.slips, "slipped_edges", (json_int_t)p->numbering.slipped, "renamed",
                  (json_int_t)p->numbering.renamed, "clock_ms", (double)p->numbering.clock_ns / 1e6, "edge_us",
                  (double)p->numbering.residual_ns / 1e3);
    json_object_set_new(o, "datagrams",
                        json_pack("{s:I, s:I, s:I, s:I, s:I, s:I}", "received", (json_int_t)p->datagrams, "spare",
                                  (json_int_t)p->spare, "refused", (json_int_t)p->refused, "asked",
                                  (json_int_t)p->asked, "repaired", (json_int_t)p->repaired, "missed_sets",
                                  (json_int_t)p->missed_sets));
    json_object_set_new(o, "reported", p->reported ? p->reported : json_null());
    p->reported = NULL;
    return o;
}

static json_t *head_json(struct service_array *a, struct hosts_now *now)
{
    json_t *nodes = json_array();

    for (int i = 0; i < now->peers; i++)
        json_array_append_new(nodes, peer_json(&now->peer[i], now->bucket[i]));
    return json_pack("{s:s, s:s, s:I, s:o, s:o}", "role", "head", "address", array_head_address(a), "datagrams_no_room",
                     (json_int_t)now->overflows, "nodes", nodes, "clock", clock_json());
}

json_t *service_hosts_json(struct service_array *a)
{
    struct hosts_now *now = calloc(1, sizeof(*now));
    json_t *o = NULL;

    if (now && array_hosts(a, now))
        o = now->role == SST_CONFIG_NODE ? node_json(a, &now->node) : head_json(a, now);
    array_hosts_free(now);
    return o ? o : json_null();
}

/* --- problems ----------------------------------------------------------------------------------------------------- */

/** A clock that is wrong by more than this part of a period may name a set wrongly when its node joins. */
#define CLOCK_PART 10

bool service_hosts_problem(struct service_array *a, char *why, size_t size)
{
    struct hosts_now *now = calloc(1, sizeof(*now));

    why[0] = 0;
    if (!now || !array_hosts(a, now)) {
        array_hosts_free(now);
        return false;
    }
    if (now->role == SST_CONFIG_NODE && !now->node.connected)
        snprintf(why, size, "the head is not connected: %s", now->node.reason[0] ? now->node.reason : "not tried yet");
    for (int i = 0; i < now->peers && !why[0]; i++) {
        const struct sst_link_peer *p = &now->peer[i];

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
    array_hosts_free(now);
    return why[0] != 0;
}

/* --- for Prometheus ----------------------------------------------------------------------------------------------- */

static void gauge(FILE *f, const char *name, const char *help)
{
    fprintf(f, "# HELP sst_%s %s\n# TYPE sst_%s gauge\n", name, help, name);
}

static void write_node(FILE *f, const struct sst_link_node_state *n)
{
    gauge(f, "head_connected", "1 if this node is connected to the head.");
    fprintf(f, "sst_head_connected %d\n", n->connected);
    gauge(f, "link_frames", "Frames of captured sets since the start, by where they ended on their way to the head.");
    for (int i = 0; i < SST_LINK_BUCKETS; i++)
        fprintf(f, "sst_link_frames{bucket=\"%s\"} %llu\n", sst_link_keys[i], (unsigned long long)n->bucket[i]);
    fprintf(f, "sst_link_frames{bucket=\"waiting\"} %llu\n", (unsigned long long)n->waiting);
    gauge(f, "link_frames_unexplained", "Frames that ended nowhere or twice: 0, or a bug.");
    fprintf(f, "sst_link_frames_unexplained %llu\n", (unsigned long long)n->unexplained);
    gauge(f, "link_sent_bytes", "Bytes sent to the head.");
    fprintf(f, "sst_link_sent_bytes %llu\n", (unsigned long long)n->sent_bytes);
    gauge(f, "link_datagrams", "1 if pictures go to the head by datagrams, 0 if over TLS.");
    fprintf(f, "sst_link_datagrams %d\n", n->datagrams);
    gauge(f, "link_repaired_pieces", "Pieces that the head asked for again, as too many datagrams were lost.");
    fprintf(f, "sst_link_repaired_pieces %llu\n", (unsigned long long)n->repaired);
}

static void write_peer_frames(FILE *f, const struct sst_link_peer *p, const uint64_t bucket[SST_BUCKETS])
{
    const struct {
        const char *bucket;
        uint64_t n;
    } link[] = {
        { "missed", p->missed }, { "no_room", p->dropped }, { "unnamed", p->unnamed }, { "waiting", p->waiting }
    };

    for (size_t i = 0; i < ARRAY_LEN(link); i++)
        fprintf(f, "sst_node_frames{node=\"%s\",bucket=\"%s\"} %llu\n", p->name, link[i].bucket,
                (unsigned long long)link[i].n);
    for (int i = 0; i < SST_BUCKETS; i++)
        fprintf(f, "sst_node_frames{node=\"%s\",bucket=\"%s\"} %llu\n", p->name, sst_bucket_keys[i],
                (unsigned long long)bucket[i]);
}

static void write_head(FILE *f, const struct hosts_now *now)
{
    const struct {
        const char *name, *help;
        size_t at;
    } counters[] = {
        { "node_received_frames", "Frames that came from the node, unchanged ones included.",
          offsetof(struct sst_link_peer, frames) },
        { "node_unchanged_frames", "Frames of them whose bytes were not sent, as nothing changed.",
          offsetof(struct sst_link_peer, unchanged) },
        { "node_received_bytes", "Bytes that came from the node.", offsetof(struct sst_link_peer, received_bytes) },
        { "node_datagrams", "Datagrams that came from the node.", offsetof(struct sst_link_peer, datagrams) },
        { "node_repaired_sets", "Sets of which pieces were asked for again.", offsetof(struct sst_link_peer, asked) },
        { "node_missed_sets", "Sets that stayed incomplete.", offsetof(struct sst_link_peer, missed_sets) },
        { "node_connections", "Times that the node connected.", offsetof(struct sst_link_peer, connections) },
        { "node_slips", "Corrections of the node's count of edges.",
          offsetof(struct sst_link_peer, numbering) + offsetof(struct sst_numbering_state, slips) },
        { "node_frames_unexplained", "Frames that ended nowhere or twice: 0, or a bug.",
          offsetof(struct sst_link_peer, unexplained) },
    };

    gauge(f, "datagrams_no_room", "Datagrams of nodes that the kernel had no room for.");
    fprintf(f, "sst_datagrams_no_room %llu\n", (unsigned long long)now->overflows);
    gauge(f, "node_up", "1 if the node is connected.");
    for (int i = 0; i < now->peers; i++)
        fprintf(f, "sst_node_up{node=\"%s\"} %d\n", now->peer[i].name, now->peer[i].connected);
    for (size_t k = 0; k < ARRAY_LEN(counters); k++) {
        gauge(f, counters[k].name, counters[k].help);
        for (int i = 0; i < now->peers; i++) {
            uint64_t n;

            memcpy(&n, (const char *)&now->peer[i] + counters[k].at, sizeof(n));
            fprintf(f, "sst_%s{node=\"%s\"} %llu\n", counters[k].name, now->peer[i].name, (unsigned long long)n);
        }
    }
    gauge(f, "node_frames", "Frames that came from the node, by where they ended.");
    for (int i = 0; i < now->peers; i++)
        write_peer_frames(f, &now->peer[i], now->bucket[i]);
    gauge(f, "node_clock_seconds", "The node's wall clock less the head's, by the edges that both stamped.");
    for (int i = 0; i < now->peers; i++)
        fprintf(f, "sst_node_clock_seconds{node=\"%s\"} %.9g\n", now->peer[i].name,
                (double)now->peer[i].numbering.clock_ns / 1e9);
}

void service_hosts_metrics(FILE *f, struct service_array *a)
{
    struct hosts_now *now = calloc(1, sizeof(*now));

    if (now && array_hosts(a, now)) {
        if (now->role == SST_CONFIG_NODE)
            write_node(f, &now->node);
        else
            write_head(f, now);
    }
    array_hosts_free(now);
}
