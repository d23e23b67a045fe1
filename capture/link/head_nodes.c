/* The head's side of connections: who may connect, and what comes. */
#define _GNU_SOURCE /* accept4() */
#include <arpa/inet.h>
#include <errno.h>
#include <netinet/in.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/log.h"
#include "base/thread.h"
#include "capture/link/link_internal.h"

#define CONNECTIONS (LINK_SOURCES + 16)
#define HELLO_NS    INT64_C(5000000000)
#define SILENCE_NS  INT64_C(2000000000)
#define HOLD_MS     20 /* sets whose names are not decided are looked at again */

struct link_connection {
    struct link_stream stream; /* fd -1: unused */
    int source;                /* -1: it has not said which node it is */
    char address[64];
    int64_t until_ns;
    bool refused; /* closed once the reason has been sent */
    /* of its node */
    int cameras;
    struct {
        uint8_t *data; /* what it sent last, for pictures that are unchanged */
        size_t bytes, room;
        uint32_t stride;
    } last[SST_CAMERAS_MAX];
};

/* --- the node as a whole ----------------------------------------------------------------------------------------- */

static bool lanes_connected_locked(const struct sst_link_head *h, int node, bool all)
{
    int connected = 0;

    for (int i = 0; i < LINK_LANES_MAX; i++)
        connected += h->source[node * LINK_LANES_MAX + i].peer.connected;
    return all ? connected && connected >= h->node[node].lanes : connected > 0;
}

/* A lane has begun or ended: has the node? */
static void note_node(struct sst_link_head *h, int source, const char *why)
{
    const int node = link_node_of(source);
    bool changed;

    pthread_mutex_lock(&h->lock);
    changed = h->node[node].connected != lanes_connected_locked(h, node, true);
    h->node[node].connected ^= changed;
    if (!lanes_connected_locked(h, node, false))
        sst_numbering_leave(h->numbering, node);
    pthread_mutex_unlock(&h->lock);
    if (changed && h->event)
        h->event(h->arg, h->array.hosts.node[node], h->node[node].connected, why);
}

/* --- ends --------------------------------------------------------------------------------------------------------- */

/* Another connection of the node brings the same cameras: its states count from now on. */
static void hand_over_locked(struct sst_link_head *h, int source)
{
    const int node = link_node_of(source);

    for (int o = node * LINK_LANES_MAX; o < (node + 1) * LINK_LANES_MAX; o++) {
        for (int i = 0; o != source && h->source[o].peer.connected && i < h->source[o].cameras; i++)
            if (h->slot[h->source[o].slot[i]].source == source)
                h->slot[h->source[o].slot[i]].source = o;
    }
}

static void end(struct sst_link_head *h, struct link_connection *c, const char *why)
{
    const int source = c->source;

    link_stream_close(&c->stream);
    for (int i = 0; i < c->cameras; i++)
        free(c->last[i].data);
    if (source >= 0) {
        struct head_source *s = &h->source[source];
        char text[256];

        snprintf(text, sizeof(text), "node %s is not connected: %.180s", s->peer.name, why);
        pthread_mutex_lock(&h->lock);
        s->peer.connected = false;
        snprintf(s->peer.reason, sizeof(s->peer.reason), "%.250s", why);
        head_forget_locked(h, source);
        hand_over_locked(h, source);
        for (int i = 0; i < s->cameras; i++)
            head_camera_locked(h, source, i, SST_GRAB_ABSENT, text, NULL);
        pthread_mutex_unlock(&h->lock);
        note_node(h, source, why);
    } else if (*why && !c->refused) {
        sst_log_warning("hosts: the connection of %s ended before it was accepted: %s", c->address, why);
    }
    *c = (struct link_connection){ .stream.fd = -1, .source = -1 };
}

/* --- HELLO -------------------------------------------------------------------------------------------------------- */

/* The lane of a node, as it says. @return its source; -1: not in the list */
static int find_node(const struct sst_link_head *h, const char *name, const json_t *hello)
{
    const int lane = (int)json_integer_value(json_object_get(hello, "lane"));

    for (int i = 0; i < h->array.hosts.nodes; i++)
        if (!strcmp(h->array.hosts.node[i], name))
            return i * LINK_LANES_MAX + sst_clamp_int(lane, 0, LINK_LANES_MAX - 1);
    return -1;
}

/* Who has a view now, and is connected? */
static const char *holder_locked(const struct sst_link_head *h, int view, int source)
{
    const int other = h->slot[view].source;

    if (other < 0 || link_node_of(other) == link_node_of(source) || !h->source[other].peer.connected)
        return NULL;
    return other == LINK_OWN ? "the head itself" : h->source[other].peer.name;
}

/* Bind the node's cameras to views. @return 0, or -EINVAL with why; then nothing has changed */
static int bind_cameras_locked(struct sst_link_head *h, int source, const json_t *cameras, char why[256])
{
    struct head_source *s = &h->source[source];
    const int n = (int)json_array_size(cameras);
    int view[SST_CAMERAS_MAX];

    if (n < 1 || n > h->array.bound) {
        snprintf(why, 256, "it has %d cameras, the array has %d views", n, h->array.bound);
        return -EINVAL;
    }
    for (int i = 0; i < n; i++) {
        const json_t *c = json_array_get(cameras, (size_t)i);
        const json_int_t row = json_integer_value(json_array_get(c, 0)), col = json_integer_value(json_array_get(c, 1));
        const char *holder;

        if (row < 0 || row >= h->array.rows || col < 0 || col >= h->array.cols) {
            snprintf(why, 256, "its camera at row %lld, col %lld is outside the grid of %dx%d; see cameras: bind",
                     (long long)row, (long long)col, h->array.rows, h->array.cols);
            return -EINVAL;
        }
        view[i] = (int)row * h->array.cols + (int)col;
        holder = holder_locked(h, view[i], source);
        if (holder) {
            snprintf(why, 256, "row %lld, col %lld has a camera of %.60s already; see cameras: bind of both",
                     (long long)row, (long long)col, holder);
            return -EINVAL;
        }
    }
    for (int i = 0; i < h->array.bound; i++)
        if (h->slot[i].source == source)
            h->slot[i].source = -1;
    s->cameras = n;
    for (int i = 0; i < n; i++) {
        const int other = h->slot[view[i]].source;

        s->slot[i] = view[i];
        if (other < 0 || !h->source[other].peer.connected || link_node_of(other) != link_node_of(source))
            h->slot[view[i]].source = source; /* else it is that of the first copy */
    }
    return 0;
}

static void copy_text(char *out, size_t size, const json_t *text)
{
    const char *from = json_string_value(text);

    snprintf(out, size, "%s", from ? from : "");
}

static void show_cameras_locked(struct sst_link_head *h, int source, const json_t *cameras)
{
    for (int i = 0; i < h->source[source].cameras; i++) {
        const json_t *c = json_array_get(cameras, (size_t)i);
        struct sst_grab_device device = { 0 };

        copy_text(device.serial, sizeof(device.serial), json_array_get(c, 2));
        copy_text(device.port, sizeof(device.port), json_array_get(c, 3));
        copy_text(device.name, sizeof(device.name), json_array_get(c, 4));
        head_camera_locked(h, source, i, SST_GRAB_ABSENT, "", &device);
    }
}

/* What must be the same on both hosts. */
static int compare(const struct sst_link_head *h, const json_t *hello, char why[256])
{
    const struct sst_array_config *a = &h->array;
    const char *format = json_string_value(json_object_get(hello, "format"));
    const json_int_t version = json_integer_value(json_object_get(hello, "version"));
    const json_int_t width = json_integer_value(json_object_get(hello, "width"));
    const json_int_t height = json_integer_value(json_object_get(hello, "height"));
    const double rate_hz = json_number_value(json_object_get(hello, "rate_hz"));

    if (version != LINK_VERSION)
        snprintf(why, 256, "it speaks version %lld of the hosts' protocol, the head %d: install the same version",
                 (long long)version, LINK_VERSION);
    else if (width != a->width || height != a->height || !format || sst_array_format(format) != a->fourcc)
        snprintf(why, 256, "its pictures are %lldx%lld %.10s, the head's configuration has %dx%d %s", (long long)width,
                 (long long)height, format ? format : "?", a->width, a->height, sst_array_format_name(a->fourcc));
    else if (rate_hz < 0.999 * a->trigger_hz || rate_hz > 1.001 * a->trigger_hz)
        snprintf(why, 256, "its trigger: rate_hz is %g, the head's %g", rate_hz, a->trigger_hz);
    return why[0] ? -EINVAL : 0;
}

static uint64_t run_of(const json_t *hello)
{
    const char *run = json_string_value(json_object_get(hello, "run"));

    return run ? strtoull(run, NULL, 16) : 0;
}

static uint64_t counting_of(const json_t *hello)
{
    const uint64_t opening = (uint64_t)json_integer_value(json_object_get(hello, "opening"));

    return run_of(hello) ^ (opening << 48 | opening);
}

/* A node that was cut off, or killed, comes back before its old connections have ended. */
static void end_older(struct sst_link_head *h, int source, const json_t *hello)
{
    const bool again = h->node[link_node_of(source)].run != counting_of(hello);

    for (int i = 0; i < CONNECTIONS; i++) {
        struct link_connection *c = &h->connection[i];

        if (c->stream.fd >= 0 && c->source >= 0 &&
            (c->source == source || (again && link_node_of(c->source) == link_node_of(source))))
            end(h, c, "it connected again");
    }
}

static int join_locked(struct sst_link_head *h, struct link_connection *c, int source, const json_t *hello,
                       char why[256])
{
    const uint64_t id = run_of(hello);
    const int node = link_node_of(source), lanes = (int)json_integer_value(json_object_get(hello, "lanes"));
    struct sst_link_peer *p = &h->source[source].peer;
    int err = bind_cameras_locked(h, source, json_object_get(hello, "cameras"), why);

    if (err)
        return err;
    if (p->run != id)
        p->seq = 0;
    p->run = id;
    p->connected = true;
    p->reason[0] = 0;
    p->connections++;
    memcpy(p->address, c->address, sizeof(p->address));
    c->source = source;
    c->cameras = h->source[source].cameras;
    show_cameras_locked(h, source, json_object_get(hello, "cameras"));
    h->node[node].lanes = sst_clamp_int(lanes, 1, LINK_LANES_MAX);
    head_join_locked(h, node, counting_of(hello));
    return 0;
}

static int welcome(struct sst_link_head *h, struct link_connection *c, const uint8_t *data, size_t bytes)
{
    json_t *hello = json_loadb((const char *)data, bytes, 0, NULL);
    const int source = find_node(h, c->stream.peer, hello);
    char why[256] = "";
    uint64_t seq = 0;
    int err = hello ? compare(h, hello, why) : -EBADMSG;

    if (!err && source < 0) {
        snprintf(why, sizeof(why), "\"%s\" is not among the head's hosts: nodes", c->stream.peer);
        err = -EACCES;
    }
    if (!err) {
        end_older(h, source, hello);
        pthread_mutex_lock(&h->lock);
        err = join_locked(h, c, source, hello, why);
        seq = h->source[source].peer.seq;
        if (err)
            snprintf(h->source[source].peer.reason, sizeof(h->source[source].peer.reason), "refused: %.240s", why);
        pthread_mutex_unlock(&h->lock);
    }
    json_decref(hello);
    if (err == -EBADMSG)
        return err;
    if (err) {
        sst_log_warning("hosts: node %s at %s is refused: %s", c->stream.peer, c->address, why);
        c->refused = true;
        c->until_ns = sst_clock_now_ns() + HELLO_NS / 5;
    } else {
        note_node(h, source, "");
    }
    return link_stream_add_json(&c->stream, MESSAGE_WELCOME,
                                json_pack("{s:s, s:I}", "refused", why, "seq", (json_int_t)seq));
}

/* --- STATE and SET ------------------------------------------------------------------------------------------------ */

static int confirm(struct link_connection *c, uint64_t seq)
{
    uint8_t *ack = link_stream_add(&c->stream, MESSAGE_ACK, 8);

    if (!ack)
        return -ENOMEM;
    wire_put_u64(ack, seq);
    return 0;
}

static int take_state(struct sst_link_head *h, struct link_connection *c, const uint8_t *data, size_t bytes)
{
    json_t *state = json_loadb((const char *)data, bytes, 0, NULL);
    const json_t *cameras = json_object_get(state, "cameras");

    if (!json_is_object(state) || json_array_size(cameras) != (size_t)c->cameras) {
        json_decref(state);
        return -EBADMSG;
    }
    pthread_mutex_lock(&h->lock);
    for (int i = 0; i < c->cameras; i++) {
        const json_t *one = json_array_get(cameras, (size_t)i);
        const char *why = json_string_value(json_array_get(one, 1));
        const int value = (int)json_integer_value(json_array_get(one, 0));

        head_camera_locked(h, c->source, i, (enum sst_grab_state)sst_clamp_int(value, SST_GRAB_ABSENT, SST_GRAB_READY),
                           why ? why : "", NULL);
    }
    json_decref(h->source[c->source].peer.reported);
    h->source[c->source].peer.reported = state;
    pthread_mutex_unlock(&h->lock);
    return confirm(c, h->source[c->source].peer.seq); /* also while the trigger rests: the head is there */
}

static int keep_last(struct link_connection *c, int cam, const uint8_t *data, const struct wire_frame *f)
{
    if (f->bytes > c->last[cam].room) {
        uint8_t *grown = realloc(c->last[cam].data, f->bytes + f->bytes / 4);

        if (!grown)
            return -ENOMEM;
        c->last[cam].data = grown;
        c->last[cam].room = f->bytes + f->bytes / 4;
    }
    memcpy(c->last[cam].data, data, f->bytes);
    c->last[cam].bytes = f->bytes;
    c->last[cam].stride = f->stride;
    return 0;
}

/* Remember the bytes of this set. @param frames, unchanged, bytes  out, of the frames that it has, with unchanged ones
 */
static int study(struct link_connection *c, const struct wire_frame *frame, const uint8_t *data, int *frames,
                 int *unchanged, size_t *bytes)
{
    int err = 0;

    *frames = *unchanged = 0;
    *bytes = 0;
    for (int i = 0; !err && i < c->cameras; i++) {
        if (frame[i].kind == WIRE_FRAME) {
            err = keep_last(c, i, data, &frame[i]);
            data += frame[i].bytes;
        } else if (frame[i].kind == WIRE_UNCHANGED && !c->last[i].bytes) {
            err = -EBADMSG;
        }
        *frames += frame[i].kind != WIRE_MISSING;
        *unchanged += frame[i].kind == WIRE_UNCHANGED;
        *bytes += frame[i].kind != WIRE_MISSING ? c->last[i].bytes : 0;
    }
    return err;
}

static void fill(const struct sst_link_head *h, struct link_connection *c, struct head_set *set,
                 const struct wire_set *from, const struct wire_frame *frame)
{
    uint8_t *at = set->data;

    set->edge = (struct sst_numbering_edge){ from->count, from->t_ns, from->wall_ns };
    set->stamped = from->edge;
    for (int i = 0; i < c->cameras; i++) {
        set->frame[i] = (struct sst_frame){ 0 };
        if (frame[i].kind == WIRE_MISSING)
            continue;
        set->frame[i] = (struct sst_frame){ .fourcc = h->array.fourcc,
                                            .width = h->array.width,
                                            .height = h->array.height,
                                            .stride = c->last[i].stride,
                                            .data = memcpy(at, c->last[i].data, c->last[i].bytes),
                                            .bytes = c->last[i].bytes,
                                            .sequence = frame[i].sequence,
                                            .lost_before = frame[i].lost_before,
                                            .faults = frame[i].faults & ~(unsigned)SST_FRAME_BAD,
                                            .t_ns = frame[i].from_set_ns };
        at += c->last[i].bytes;
    }
}

static int take_set(struct sst_link_head *h, struct link_connection *c, const uint8_t *data, size_t bytes)
{
    struct sst_link_peer *p = &h->source[c->source].peer;
    struct wire_frame frame[SST_CAMERAS_MAX];
    struct head_set *set;
    struct wire_set from;
    const uint8_t *pictures;
    size_t total;
    int frames, unchanged, err = wire_get_set(data, bytes, c->cameras, &from, frame, &pictures);

    if (!err && from.seq <= p->seq)
        err = -EBADMSG;
    if (!err)
        err = study(c, frame, pictures, &frames, &unchanged, &total);
    if (err)
        return err;
    set = head_set_acquire(h, c->source, frames, total);
    pthread_mutex_lock(&h->lock);
    p->seq = from.seq;
    p->unchanged += (uint64_t)unchanged;
    pthread_mutex_unlock(&h->lock);
    if (set) {
        fill(h, c, set, &from, frame);
        head_set_pass(h, set);
    }
    return confirm(c, from.seq);
}

/* --- the thread --------------------------------------------------------------------------------------------------- */

static int take(struct sst_link_head *h, struct link_connection *c, enum message_type type, const uint8_t *data,
                size_t bytes)
{
    c->until_ns = sst_clock_now_ns() + SILENCE_NS;
    if (type == MESSAGE_HELLO && c->source < 0 && !c->refused)
        return welcome(h, c, data, bytes);
    if (type == MESSAGE_STATE && c->source >= 0)
        return take_state(h, c, data, bytes);
    if (type == MESSAGE_SET && c->source >= 0)
        return take_set(h, c, data, bytes);
    return c->refused ? 0 : -EBADMSG;
}

/* All that has come of a connection. What GnuTLS holds back is not seen by poll(): hence until nothing more comes. */
static int serve_one(struct sst_link_head *h, struct link_connection *c, char why[256])
{
    bool any = true;
    int err = 0;

    while (any && !err) {
        const uint64_t before = c->stream.received_bytes;
        enum message_type type;
        const uint8_t *data;
        size_t bytes;
        int r;

        any = false;
        err = link_stream_work(&c->stream, why);
        while (!err && c->stream.ready && (r = link_stream_next(&c->stream, &type, &data, &bytes)) != 0) {
            any = true;
            err = r < 0 ? r : take(h, c, type, data, bytes);
        }
        if (c->source >= 0) {
            pthread_mutex_lock(&h->lock);
            h->source[c->source].peer.received_bytes += c->stream.received_bytes - before;
            pthread_mutex_unlock(&h->lock);
        }
    }
    if (err == -EBADMSG)
        snprintf(why, 256, "what it sent cannot be read; do both hosts have the same version?");
    else if (err && !why[0])
        snprintf(why, 256, "%s", strerror(-err));
    return err;
}

static void name_address(char out[64], const struct sockaddr_storage *from)
{
    const void *at = from->ss_family == AF_INET6 ? (const void *)&((const struct sockaddr_in6 *)from)->sin6_addr
                                                 : (const void *)&((const struct sockaddr_in *)from)->sin_addr;

    if (!inet_ntop(from->ss_family, at, out, 64))
        out[0] = 0;
}

static void accept_one(struct sst_link_head *h)
{
    struct sockaddr_storage from = { 0 };
    socklen_t size = sizeof(from);
    const int fd = accept4(h->listen_fd, (struct sockaddr *)&from, &size, SOCK_CLOEXEC | SOCK_NONBLOCK);
    struct link_connection *c = NULL;

    for (int i = 0; i < CONNECTIONS && !c; i++)
        if (h->connection[i].stream.fd < 0)
            c = &h->connection[i];
    if (fd < 0)
        return;
    if (!c) { /* those that say nothing go after HELLO_NS */
        close(fd);
        return;
    }
    link_socket_prepare(fd);
    name_address(c->address, &from);
    c->until_ns = sst_clock_now_ns() + HELLO_NS;
    if (link_stream_open(&c->stream, fd, h->credentials, true,
                         link_message_most(h->array.bound, h->array.width, h->array.height)))
        end(h, c, "no memory");
}

static int gather(const struct sst_link_head *h, struct pollfd *fds)
{
    fds[0] = (struct pollfd){ .fd = h->wake_fd, .events = POLLIN };
    fds[1] = (struct pollfd){ .fd = h->listen_fd, .events = POLLIN };
    for (int i = 0; i < CONNECTIONS; i++) {
        const struct link_stream *s = &h->connection[i].stream;

        fds[2 + i] = (struct pollfd){ .fd = s->fd, .events = s->fd >= 0 ? link_stream_events(s) : (short)0 };
    }
    return 2 + CONNECTIONS;
}

static void serve_all(struct sst_link_head *h, const struct pollfd *fds)
{
    const int64_t now_ns = sst_clock_now_ns();

    for (int i = 0; i < CONNECTIONS; i++) {
        struct link_connection *c = &h->connection[i];
        char why[256] = "";
        int err = 0;

        if (c->stream.fd < 0)
            continue;
        if (fds[2 + i].fd == c->stream.fd && fds[2 + i].revents)
            err = serve_one(h, c, why);
        if (!err && c->stream.fd >= 0 && now_ns >= c->until_ns) {
            snprintf(why, sizeof(why), "%s",
                     c->source < 0 ? "it does not say which node it is" : "it has fallen silent");
            err = -ETIMEDOUT;
        }
        if (err)
            end(h, c, why);
    }
    if (fds[1].revents)
        accept_one(h);
}

void *head_serve(void *arg)
{
    struct sst_link_head *h = arg;
    struct pollfd fds[2 + CONNECTIONS];
    bool stop = false, waits = false;

    sst_thread_name("sst-link");
    h->connection = calloc(CONNECTIONS, sizeof(*h->connection));
    if (!h->connection) {
        sst_log_error("hosts: no memory for connections of nodes");
        return NULL;
    }
    for (int i = 0; i < CONNECTIONS; i++)
        h->connection[i].stream.fd = h->connection[i].source = -1;
    while (!stop) {
        const int n = gather(h, fds);

        if (poll(fds, (nfds_t)n, waits ? HOLD_MS : 200) >= 0 || errno == EINTR)
            serve_all(h, fds);
        waits = head_settle(h, sst_clock_now_ns());
        pthread_mutex_lock(&h->lock);
        stop = h->stop;
        pthread_mutex_unlock(&h->lock);
    }
    h->event = NULL; /* what ends now is the head's own doing */
    for (int i = 0; i < CONNECTIONS; i++)
        if (h->connection[i].stream.fd >= 0)
            end(h, &h->connection[i], "the head ends");
    free(h->connection);
    return NULL;
}
