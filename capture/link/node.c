/* A node: its cameras go to the head over several connections, its lanes.
 *
 * Packet loss limits the throughput of one TCP connection, and a lost packet delays all data behind it. Throughput grows with
 * the number of connections, and a loss delays only the cameras of its own connection. With copies, each share is sent over
 * several connections, and the first copy that arrives is used. */
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>

#include "capture/link/link_internal.h"

const char *const sst_link_keys[SST_LINK_BUCKETS] = { "sent", "unchanged", "dropped", "away", "lost" };

struct sst_link_node {
    /* fixed after open */
    struct sst_array_config array;
    struct link_credentials *credentials;
    struct sst_ring *ring;
    void *arg;
    void (*event)(void *arg, const char *node, bool connected, const char *why);
    int lanes;
    struct link_lane *lane[LINK_LANES_MAX];
    /* under lock */
    pthread_mutex_t lock;
    bool open, connected, reported; /* reported: an event has been sent */
};

static uint64_t unexplained(const struct sst_link_node_state *state)
{
    uint64_t known = state->waiting;

    for (int i = 0; i < SST_LINK_BUCKETS; i++)
        known += state->bucket[i];
    return known > state->frames ? known - state->frames : state->frames - known;
}

void sst_link_node_state(struct sst_link_node *n, struct sst_link_node_state *out)
{
    int used = 0, connected = 0;

    *out = (struct sst_link_node_state){ 0 };
    for (int i = 0; i < n->lanes; i++) {
        struct sst_link_node_state one;
        const bool uses = n->lane[i] && link_lane_state(n->lane[i], &one);

        if (!n->lane[i])
            continue;
        for (int k = 0; k < SST_LINK_BUCKETS; k++)
            out->bucket[k] += one.bucket[k];
        out->frames += one.frames;
        out->waiting += one.waiting;
        out->sent_bytes += one.sent_bytes;
        used += uses;
        connected += uses && one.connected;
        if (uses && !one.connected && !out->reason[0])
            memcpy(out->reason, one.reason, sizeof(out->reason));
        if (i == 0)
            out->connections = one.connections;
        out->reply_ms = one.reply_ms > out->reply_ms ? one.reply_ms : out->reply_ms;
    }
    out->connected = used && connected == used;
    out->unexplained = unexplained(out);
}

void link_node_changed(struct sst_link_node *n)
{
    struct sst_link_node_state s;
    bool report;

    pthread_mutex_lock(&n->lock);
    if (!n->open) { /* lanes start one after another */
        pthread_mutex_unlock(&n->lock);
        return;
    }
    sst_link_node_state(n, &s);
    report = (s.connected != n->connected || !n->reported) && (s.connected || s.reason[0]);
    n->connected = s.connected;
    n->reported = n->reported || report;
    pthread_mutex_unlock(&n->lock);
    if (report && n->event)
        n->event(n->arg, n->array.hosts.head_name, s.connected, s.reason);
}

int sst_link_node_open(struct sst_link_node **out, const struct sst_link_node_config *cfg)
{
    struct sst_link_node *n = calloc(1, sizeof(*n));
    uint64_t run;
    int err = n ? 0 : -ENOMEM;

    if (err)
        return err;
    n->array = *cfg->array;
    n->ring = cfg->ring;
    n->arg = cfg->arg;
    n->event = cfg->event;
    n->lanes = cfg->array->hosts.connections * cfg->array->hosts.copies;
    if (n->lanes > LINK_LANES_MAX)
        n->lanes = LINK_LANES_MAX; /* refused by the configuration */
    pthread_mutex_init(&n->lock, NULL);
    if (getrandom(&run, sizeof(run), 0) != sizeof(run))
        err = -errno;
    if (!err)
        err = link_credentials_create(&n->credentials, cfg->array);
    for (int i = 0; !err && i < n->lanes; i++)
        err = link_lane_open(&n->lane[i], n, i, run, cfg, n->credentials);
    if (err) {
        sst_link_node_close(n);
        return err;
    }
    pthread_mutex_lock(&n->lock);
    n->open = true;
    pthread_mutex_unlock(&n->lock);
    *out = n;
    return 0;
}

void sst_link_node_cameras(struct sst_link_node *n, const struct sst_array_config *layout)
{
    for (int i = 0; i < n->lanes; i++)
        link_lane_cameras(n->lane[i], layout);
}

void sst_link_node_camera(struct sst_link_node *n, int cam, enum sst_grab_state state, const char *why,
                          const struct sst_grab_device *device)
{
    for (int i = cam % n->array.hosts.connections; i < n->lanes; i += n->array.hosts.connections)
        link_lane_camera(n->lane[i], cam, state, why, device);
}

void sst_link_node_set(struct sst_link_node *n, const struct sst_frameset *set)
{
    struct sst_ring_counters ring;

    sst_ring_counters(n->ring, &ring);
    for (int i = 0; i < n->lanes; i++)
        link_lane_set(n->lane[i], ring.kept, set);
}

void sst_link_node_report(struct sst_link_node *n, const struct sst_capture_report *report)
{
    link_lane_report(n->lane[0], report); /* lane 0 reports for all lanes */
}

void sst_link_node_stop(struct sst_link_node *n)
{
    pthread_mutex_lock(&n->lock);
    n->open = false;
    pthread_mutex_unlock(&n->lock);
    for (int i = 0; i < n->lanes; i++)
        if (n->lane[i])
            link_lane_stop(n->lane[i]);
    for (int i = 0; i < n->lanes; i++)
        if (n->lane[i])
            link_lane_join(n->lane[i]);
}

void sst_link_node_close(struct sst_link_node *n)
{
    if (!n)
        return;
    sst_link_node_stop(n);
    for (int i = 0; i < n->lanes; i++)
        link_lane_close(n->lane[i]);
    link_credentials_destroy(n->credentials);
    pthread_mutex_destroy(&n->lock);
    free(n);
}
