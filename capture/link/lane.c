/* One lane of a node: some of its cameras go to the head, over a connection of their own. */
#include <errno.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/kernel_clock.h"
#include "base/log.h"
#include "base/thread.h"
#include "capture/link/link_internal.h"
#include "pipeline/live/frames/unchanged.h"

#define QUEUE_MAX 256
#define FLIGHT    8 /* sets that were sent and not confirmed: more would be too old to be dropped */
#define RETRY_NS   INT64_C(150000000)
#define REFUSED_NS INT64_C(2000000000) /* ... after a refusal, which another attempt does not change */
#define CONNECT_NS INT64_C(600000000)
#define SILENCE_NS INT64_C(2000000000)
#define STATE_NS   INT64_C(500000000)
#define SMOOTH     0.1

struct queued {
    uint64_t number; /* in the ring */
    unsigned opening;
    int frames;
};

struct flight {
    uint64_t seq;
    int frames, unchanged;
    int64_t sent_ns;
};

enum link_phase {
    LINK_OFF = 0, /* not connected, until retry_ns */
    LINK_CONNECTING = 1,
    LINK_SHAKING = 2,
    LINK_GREETING = 3, /* HELLO is sent */
    LINK_UP = 4,
};

struct link_lane {
    /* fixed after open */
    struct sst_array_config array;
    struct link_credentials *credentials; /* the node's */
    struct sst_ring *ring;
    struct sst_link_node *node;
    int number, shares, copies;
    int wake_fd;
    uint64_t run;
    pthread_t thread;
    bool threaded;
    /* link thread */
    struct link_stream stream;
    enum link_phase phase;
    int64_t retry_ns, until_ns, told_ns;
    unsigned opening_sent;
    uint64_t counted_bytes;       /* of the stream */
    struct sst_array_config sent; /* the array as the head knows it */
    int sent_cameras, sent_camera_of[SST_CAMERAS_MAX];
    uint64_t seq;
    struct sst_unchanged *unchanged; /* what was sent last of each camera; NULL: all is sent */
    char reason[256];
    /* under lock */
    pthread_mutex_t lock;
    bool stop, changed;
    unsigned opening; /* 0: the array was never open */
    bool open;
    struct sst_array_config layout;
    int cameras, camera_of[SST_CAMERAS_MAX]; /* its share of those of the node */
    struct {
        enum sst_grab_state state;
        char why[128];
        struct sst_grab_device device;
    } camera[SST_CAMERAS_MAX];
    struct queued queue[QUEUE_MAX];
    int first, count;
    struct flight flight[FLIGHT];
    int flights; /* also of a connection that ended: the head's next welcome says what it had received */
    struct sst_link_node_state state;
    struct sst_capture_report report;
};

static void wake(struct link_lane *n)
{
    const uint64_t one = 1;

    if (write(n->wake_fd, &one, sizeof(one)) < 0) {
        /* full: it is already readable */
    }
}

/* --- where frames end --------------------------------------------------------------------------------------------- */

static void end_frames_locked(struct link_lane *n, enum sst_link_bucket bucket, int frames)
{
    n->state.bucket[bucket] += (uint64_t)frames;
    n->state.waiting -= (uint64_t)frames;
}

static void drop_oldest_locked(struct link_lane *n)
{
    end_frames_locked(n, n->state.connected ? SST_LINK_DROPPED : SST_LINK_AWAY, n->queue[n->first].frames);
    n->first = (n->first + 1) % QUEUE_MAX;
    n->count--;
}

/* Sets up to `seq` have arrived. @return how long the last of them took, ns; 0: none */
static int64_t confirm_locked(struct link_lane *n, uint64_t seq, int64_t now_ns)
{
    int64_t took_ns = 0;
    int done = 0;

    while (done < n->flights && n->flight[done].seq <= seq) {
        const struct flight *f = &n->flight[done++];

        end_frames_locked(n, SST_LINK_SENT, f->frames - f->unchanged);
        end_frames_locked(n, SST_LINK_UNCHANGED, f->unchanged);
        took_ns = now_ns - f->sent_ns;
    }
    n->flights -= done;
    memmove(n->flight, n->flight + done, (size_t)n->flights * sizeof(n->flight[0]));
    return took_ns;
}

static void lose_flights_locked(struct link_lane *n)
{
    for (int i = 0; i < n->flights; i++)
        end_frames_locked(n, SST_LINK_LOST, n->flight[i].frames);
    n->flights = 0;
}

/* --- messages ----------------------------------------------------------------------------------------------------- */

static json_t *hello_locked(const struct link_lane *n)
{
    const struct sst_array_config *a = &n->layout;
    const char *format = sst_array_format_name(a->fourcc);
    json_t *cameras = json_array();
    char run[24];

    for (int i = 0; i < n->cameras; i++) {
        const struct sst_config_camera *c = &a->camera[n->camera_of[i]];
        const struct sst_grab_device *d = &n->camera[n->camera_of[i]].device;

        json_array_append_new(cameras, json_pack("[i, i, s, s, s]", c->row, c->col, d->port[0] ? d->serial : c->serial,
                                                 d->port[0] ? d->port : c->port, d->name));
    }
    snprintf(run, sizeof(run), "%016llx", (unsigned long long)n->run);
    return json_pack("{s:i, s:s, s:i, s:i, s:i, s:f, s:i, s:i, s:s, s:o}", "version", LINK_VERSION, "run", run,
                     "opening", (int)n->opening, "lane", n->number, "lanes",
                     n->copies * sst_min_int(n->shares, a->bound), "rate_hz", a->trigger_hz, "width", a->width,
                     "height", a->height, "format", format ? format : "", "cameras", cameras);
}

static json_t *counts(const char *const *keys, const uint64_t *n, int size)
{
    json_t *o = json_object();

    for (int i = 0; i < size; i++)
        json_object_set_new(o, keys[i], json_integer((json_int_t)n[i]));
    return o;
}

static json_t *state_locked(const struct link_lane *n, const struct sst_link_node_state *whole)
{
    const struct sst_framesync_counters *sets = &n->report.sets;
    struct sst_kernel_clock clock;
    json_t *cameras = json_array(), *captured = counts(sst_bucket_keys, sets->bucket, SST_BUCKETS);
    json_t *link = counts(sst_link_keys, whole->bucket, SST_LINK_BUCKETS);

    for (int i = 0; i < n->cameras; i++)
        json_array_append_new(
            cameras, json_pack("[i, s]", (int)n->camera[n->camera_of[i]].state, n->camera[n->camera_of[i]].why));
    sst_kernel_clock(&clock);
    json_object_set_new(captured, "delivered", json_integer((json_int_t)n->report.grab.frames));
    json_object_set_new(captured, "waiting", json_integer((json_int_t)sets->waiting));
    json_object_set_new(captured, "unexplained", json_integer((json_int_t)n->report.unexplained));
    json_object_set_new(link, "waiting", json_integer((json_int_t)whole->waiting));
    json_object_set_new(link, "unexplained", json_integer((json_int_t)whole->unexplained));
    return json_pack("{s:o, s:o, s:o, s:{s:b, s:f}}", "cameras", cameras, "captured", captured, "link", link, "clock",
                     "synchronised", clock.synchronised, "error_ms", clock.error_us / 1e3);
}

/* What of a camera's frame is sent. */
static struct wire_frame describe(struct link_lane *n, const struct sst_kept *kept, int cam)
{
    const struct sst_frame *f = kept->set.frame[n->sent_camera_of[cam]];
    const struct sst_config_camera *c = &n->sent.camera[n->sent_camera_of[cam]];
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
                                .from_set_ns = f->t_ns - delay_ns - kept->set.t_ns };
}

/* @return frames of it that are unchanged, or -ENOMEM */
static int write_set(struct link_lane *n, const struct sst_kept *kept)
{
    const int cameras = n->sent_cameras;
    struct wire_frame frame[SST_CAMERAS_MAX];
    size_t bytes = WIRE_SET_BYTES + (size_t)cameras * WIRE_FRAME_BYTES;
    int unchanged = 0;
    uint8_t *at;

    for (int i = 0; i < cameras; i++) {
        frame[i] = describe(n, kept, i);
        bytes += frame[i].bytes;
        unchanged += frame[i].kind == WIRE_UNCHANGED;
    }
    at = link_stream_add(&n->stream, MESSAGE_SET, bytes);
    if (!at)
        return -ENOMEM;
    wire_put_set(at, &(struct wire_set){ .seq = ++n->seq,
                                         .count = kept->set.index,
                                         .t_ns = kept->set.t_ns,
                                         .wall_ns = kept->set.wall_ns,
                                         .edge = kept->set.edge,
                                         .cameras = cameras });
    at += WIRE_SET_BYTES;
    for (int i = 0; i < cameras; i++, at += WIRE_FRAME_BYTES)
        wire_put_frame(at, &frame[i]);
    for (int i = 0; i < cameras; i++) {
        if (frame[i].kind == WIRE_FRAME)
            memcpy(at, kept->set.frame[n->sent_camera_of[i]]->data, frame[i].bytes);
        at += frame[i].bytes;
    }
    return unchanged;
}

/* Send the oldest set of the queue. */
static int send_one(struct link_lane *n)
{
    const struct sst_kept *kept;
    struct queued next;
    int unchanged = 0;

    pthread_mutex_lock(&n->lock);
    next = n->queue[n->first];
    n->first = (n->first + 1) % QUEUE_MAX;
    n->count--;
    pthread_mutex_unlock(&n->lock);
    kept = sst_ring_get(n->ring, next.number);
    if (kept && kept->number == next.number && next.opening == n->opening_sent)
        unchanged = write_set(n, kept);
    else /* the ring is too small for the queue, or the set is of an earlier opening */
        unchanged = -ENOENT;
    sst_ring_unref(n->ring, kept);
    pthread_mutex_lock(&n->lock);
    if (unchanged < 0)
        end_frames_locked(n, SST_LINK_DROPPED, next.frames);
    else
        n->flight[n->flights++] = (struct flight){ n->seq, next.frames, unchanged, sst_clock_now_ns() };
    pthread_mutex_unlock(&n->lock);
    return unchanged == -ENOMEM ? unchanged : 0;
}

/* One set at a time goes into the stream's buffer: what waits there cannot be dropped any more. */
static int send_sets(struct link_lane *n)
{
    int err = 0;

    while (!err && !link_stream_waiting(&n->stream)) {
        bool any;

        pthread_mutex_lock(&n->lock);
        any = n->count && n->flights < FLIGHT;
        pthread_mutex_unlock(&n->lock);
        if (!any)
            break;
        err = send_one(n);
        if (!err)
            err = link_stream_work(&n->stream, n->reason);
    }
    return err;
}

/* --- the connection ----------------------------------------------------------------------------------------------- */

static void announce(struct link_lane *n, bool connected)
{
    pthread_mutex_lock(&n->lock);
    n->state.connected = connected;
    snprintf(n->state.reason, sizeof(n->state.reason), "%s", connected ? "" : n->reason);
    n->state.connections += connected;
    pthread_mutex_unlock(&n->lock);
    link_node_changed(n->node);
}

static void count_bytes(struct link_lane *n)
{
    pthread_mutex_lock(&n->lock);
    n->state.sent_bytes += n->stream.sent_bytes - n->counted_bytes;
    pthread_mutex_unlock(&n->lock);
    n->counted_bytes = n->stream.sent_bytes;
}

static void disconnect(struct link_lane *n, int64_t pause_ns)
{
    count_bytes(n);
    n->counted_bytes = 0;
    link_stream_close(&n->stream);
    n->phase = LINK_OFF;
    n->retry_ns = sst_clock_now_ns() + pause_ns;
    announce(n, false);
}

static int dial(struct link_lane *n)
{
    struct sockaddr_storage to;
    unsigned bytes;
    int fd, err = link_address(n->array.hosts.head, n->array.hosts.port, &to, &bytes);

    if (err)
        return err;
    fd = socket(to.ss_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (fd < 0)
        return -errno;
    link_socket_prepare(fd);
    if (connect(fd, (const struct sockaddr *)&to, bytes) < 0 && errno != EINPROGRESS) {
        err = -errno;
        close(fd);
        return err;
    }
    n->stream = (struct link_stream){ .fd = fd };
    n->phase = LINK_CONNECTING;
    n->until_ns = sst_clock_now_ns() + CONNECT_NS;
    return 0;
}

static int connected(struct link_lane *n)
{
    const int fd = n->stream.fd;
    int err = 0;
    socklen_t size = sizeof(err);

    if (getsockopt(fd, SOL_SOCKET, SO_ERROR, &err, &size) < 0 || err) {
        snprintf(n->reason, sizeof(n->reason), "%s port %d: %s", n->array.hosts.head, n->array.hosts.port,
                 strerror(err));
        return -ECONNREFUSED;
    }
    n->phase = LINK_SHAKING;
    n->until_ns = sst_clock_now_ns() + SILENCE_NS;
    return link_stream_open(&n->stream, fd, n->credentials, false, MESSAGE_TEXT_MAX);
}

/* A detector for the cameras of this opening. */
static void renew_unchanged(struct link_lane *n)
{
    sst_unchanged_destroy(n->unchanged);
    n->unchanged = NULL;
    if (n->array.hosts.skip_unchanged &&
        sst_unchanged_create(&n->unchanged, n->sent_cameras, n->sent.fourcc, n->sent.width, n->sent.height))
        sst_log_warning("hosts.skip_unchanged: no memory or no such format: every picture is sent");
}

/* The head has shown its certificate: it must be the head's. */
static int greet(struct link_lane *n)
{
    json_t *hello;

    if (strcmp(n->stream.peer, n->array.hosts.head_name) != 0) {
        snprintf(n->reason, sizeof(n->reason), "its certificate is of \"%s\", not of \"%s\"; see hosts: head_name",
                 n->stream.peer, n->array.hosts.head_name);
        return -EACCES;
    }
    pthread_mutex_lock(&n->lock);
    n->opening_sent = n->opening;
    n->sent = n->layout;
    n->sent_cameras = n->cameras;
    memcpy(n->sent_camera_of, n->camera_of, sizeof(n->camera_of));
    hello = hello_locked(n);
    pthread_mutex_unlock(&n->lock);
    renew_unchanged(n);
    n->phase = LINK_GREETING;
    return link_stream_add_json(&n->stream, MESSAGE_HELLO, hello);
}

static int welcomed(struct link_lane *n, const uint8_t *data, size_t bytes)
{
    json_t *o = json_loadb((const char *)data, bytes, 0, NULL);
    const char *refused = json_string_value(json_object_get(o, "refused"));
    const json_t *seq = json_object_get(o, "seq");
    int err = 0;

    if (!refused || !json_is_integer(seq)) {
        snprintf(n->reason, sizeof(n->reason), "its answer cannot be read; do both hosts have the same version?");
        err = -EBADMSG;
    } else if (*refused) {
        snprintf(n->reason, sizeof(n->reason), "%.250s", refused);
        err = -EACCES;
    } else {
        pthread_mutex_lock(&n->lock);
        (void)confirm_locked(n, (uint64_t)json_integer_value(seq), sst_clock_now_ns());
        lose_flights_locked(n);
        while (n->count > 1) /* what waited for the connection is old */
            drop_oldest_locked(n);
        n->changed = true;
        pthread_mutex_unlock(&n->lock);
        n->reason[0] = 0;
        n->phase = LINK_UP;
        announce(n, true);
    }
    json_decref(o);
    return err;
}

static int receive(struct link_lane *n)
{
    enum message_type type;
    const uint8_t *data;
    size_t bytes;
    int r, err = 0;

    while (!err && (r = link_stream_next(&n->stream, &type, &data, &bytes)) != 0) {
        if (r < 0)
            return r;
        n->until_ns = sst_clock_now_ns() + SILENCE_NS;
        if (type == MESSAGE_WELCOME && n->phase == LINK_GREETING) {
            err = welcomed(n, data, bytes);
        } else if (type == MESSAGE_ACK && bytes == 8 && n->phase == LINK_UP) {
            int64_t took_ns;

            pthread_mutex_lock(&n->lock);
            took_ns = confirm_locked(n, wire_get_u64(data), sst_clock_now_ns());
            if (took_ns)
                n->state.reply_ms += (n->state.reply_ms > 0 ? SMOOTH : 1) * ((double)took_ns / 1e6 - n->state.reply_ms);
            pthread_mutex_unlock(&n->lock);
        }
    }
    return err;
}

static int tell_state(struct link_lane *n, int64_t now_ns)
{
    struct sst_link_node_state whole;
    json_t *state = NULL;

    sst_link_node_state(n->node, &whole);
    pthread_mutex_lock(&n->lock);
    if (n->changed || now_ns - n->told_ns >= STATE_NS) {
        state = state_locked(n, &whole);
        n->changed = false;
    }
    pthread_mutex_unlock(&n->lock);
    if (!state)
        return 0;
    n->told_ns = now_ns;
    return link_stream_add_json(&n->stream, MESSAGE_STATE, state);
}

/* @return 0, or what ends the connection, with n->reason */
static int advance(struct link_lane *n, short ready)
{
    const int64_t now_ns = sst_clock_now_ns();
    int err = 0;

    if (n->phase == LINK_CONNECTING && ready)
        err = connected(n);
    if (!err && n->phase >= LINK_SHAKING)
        err = link_stream_work(&n->stream, n->reason);
    if (!err && n->phase == LINK_SHAKING && n->stream.ready)
        err = greet(n);
    if (!err && n->phase >= LINK_GREETING)
        err = receive(n);
    if (!err && n->phase == LINK_UP)
        err = tell_state(n, now_ns);
    if (!err && n->phase == LINK_UP)
        err = send_sets(n);
    if (!err && n->phase >= LINK_SHAKING)
        err = link_stream_work(&n->stream, n->reason);
    if (!err && n->phase != LINK_OFF && now_ns >= n->until_ns) {
        snprintf(n->reason, sizeof(n->reason), "%s port %d does not answer", n->array.hosts.head, n->array.hosts.port);
        err = -ETIMEDOUT;
    }
    return err;
}

/* The connection may go on: the array is open, with the cameras that the head knows. */
static bool still_right(struct link_lane *n, bool *stop, bool *open)
{
    bool right;

    pthread_mutex_lock(&n->lock);
    *stop = n->stop;
    *open = n->open;
    right = n->open && (n->phase < LINK_GREETING || n->opening == n->opening_sent);
    pthread_mutex_unlock(&n->lock);
    return right;
}

static void work(struct link_lane *n, bool open)
{
    struct pollfd fds[2] = { { .fd = n->wake_fd, .events = POLLIN }, { .fd = -1 } };
    int timeout_ms = 100, err = 0;
    uint64_t woken;

    if (n->phase == LINK_OFF && open && sst_clock_now_ns() >= n->retry_ns) {
        err = dial(n);
        if (err)
            snprintf(n->reason, sizeof(n->reason), "%s port %d: %s", n->array.hosts.head, n->array.hosts.port,
                     strerror(-err));
    }
    if (n->phase == LINK_CONNECTING)
        fds[1] = (struct pollfd){ .fd = n->stream.fd, .events = POLLOUT };
    else if (n->phase > LINK_CONNECTING)
        fds[1] = (struct pollfd){ .fd = n->stream.fd, .events = link_stream_events(&n->stream) };
    if (!err && poll(fds, 2, timeout_ms) < 0 && errno != EINTR)
        err = -errno;
    if (read(n->wake_fd, &woken, sizeof(woken)) < 0) {
        /* woken by the socket, or by time */
    }
    if (!err && n->phase != LINK_OFF)
        err = advance(n, fds[1].revents);
    count_bytes(n);
    if (err)
        disconnect(n, err == -EACCES || err == -EBADMSG ? REFUSED_NS : RETRY_NS);
}

static void *serve(void *arg)
{
    struct link_lane *n = arg;
    bool stop = false, open = false;

    sst_thread_name("sst-link");
    while (!stop) {
        if (!still_right(n, &stop, &open) && n->phase != LINK_OFF && !stop) {
            snprintf(n->reason, sizeof(n->reason), "the cameras are opened again");
            disconnect(n, 0);
        }
        if (!stop)
            work(n, open);
    }
    link_stream_close(&n->stream);
    return NULL;
}

/* --- calls -------------------------------------------------------------------------------------------------------- */

int link_lane_open(struct link_lane **out, struct sst_link_node *node, int number, uint64_t run,
                   const struct sst_link_node_config *cfg, struct link_credentials *credentials)
{
    struct link_lane *n = calloc(1, sizeof(*n));
    int err = n ? 0 : -ENOMEM;

    if (err)
        return err;
    n->node = node;
    n->number = number;
    n->shares = cfg->array->hosts.connections;
    n->copies = cfg->array->hosts.copies;
    n->run = run;
    n->array = *cfg->array;
    n->ring = cfg->ring;
    n->credentials = credentials;
    n->stream.fd = -1;
    pthread_mutex_init(&n->lock, NULL);
    n->wake_fd = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    if (n->wake_fd < 0)
        err = -errno;
    if (!err) {
        err = -pthread_create(&n->thread, NULL, serve, n);
        n->threaded = !err;
    }
    if (err) {
        link_lane_close(n);
        return err;
    }
    *out = n;
    return 0;
}

void link_lane_cameras(struct link_lane *n, const struct sst_array_config *layout)
{
    pthread_mutex_lock(&n->lock);
    while (n->count) /* of another opening */
        drop_oldest_locked(n);
    n->cameras = 0;
    if (layout) {
        n->layout = *layout;
        n->opening++;
        memset(n->camera, 0, sizeof(n->camera));
        for (int i = n->number % n->shares; i < layout->bound; i += n->shares)
            n->camera_of[n->cameras++] = i;
    }
    n->open = n->cameras > 0;
    pthread_mutex_unlock(&n->lock);
    wake(n);
}

void link_lane_camera(struct link_lane *n, int cam, enum sst_grab_state state, const char *why,
                      const struct sst_grab_device *device)
{
    pthread_mutex_lock(&n->lock);
    n->camera[cam].state = state;
    snprintf(n->camera[cam].why, sizeof(n->camera[cam].why), "%.120s", state == SST_GRAB_STREAMING || !why ? "" : why);
    if (device)
        n->camera[cam].device = *device;
    n->changed = true;
    pthread_mutex_unlock(&n->lock);
    wake(n);
}

void link_lane_set(struct link_lane *n, uint64_t number, const struct sst_frameset *set)
{
    int frames = 0;

    pthread_mutex_lock(&n->lock);
    for (int i = 0; i < n->cameras; i++)
        frames += set->frame[n->camera_of[i]] != NULL;
    if (n->cameras) {
        n->state.frames += (uint64_t)frames;
        n->state.waiting += (uint64_t)frames;
        if (n->count == n->array.hosts.queue)
            drop_oldest_locked(n);
        n->queue[(n->first + n->count++) % QUEUE_MAX] = (struct queued){ number, n->opening, frames };
    }
    pthread_mutex_unlock(&n->lock);
    wake(n);
}

void link_lane_report(struct link_lane *n, const struct sst_capture_report *report)
{
    pthread_mutex_lock(&n->lock);
    n->report = *report;
    pthread_mutex_unlock(&n->lock);
}

bool link_lane_state(struct link_lane *n, struct sst_link_node_state *out)
{
    bool used;

    pthread_mutex_lock(&n->lock);
    *out = n->state;
    used = n->cameras > 0;
    pthread_mutex_unlock(&n->lock);
    return used;
}

void link_lane_stop(struct link_lane *n)
{
    pthread_mutex_lock(&n->lock);
    n->stop = true;
    pthread_mutex_unlock(&n->lock);
    wake(n);
}

void link_lane_join(struct link_lane *n)
{
    if (n->threaded)
        pthread_join(n->thread, NULL);
    n->threaded = false;
}

void link_lane_close(struct link_lane *n)
{
    if (!n)
        return;
    link_lane_stop(n);
    link_lane_join(n);
    sst_unchanged_destroy(n->unchanged);
    if (n->wake_fd >= 0)
        close(n->wake_fd);
    pthread_mutex_destroy(&n->lock);
    free(n);
}
