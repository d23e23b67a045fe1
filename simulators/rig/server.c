/* Server of the drives on a TCP port and a pseudo-terminal, one thread, including the wire faults. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE
#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <termios.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/log.h"
#include "simulators/rig/drive.h"
#include "simulators/rig/rig_internal.h"

#define CLIENTS   8
#define ADU_MAX   600       /* a reply with noise around it */
#define REPLUG_NS 500000000 /* an unplugged serial adapter is plugged in again after this */
#define GAP_NS    20000000  /* silence on the serial line that ends a broken request */

/* One connection: TCP client or serial line. Server thread only. */
struct line {
    int fd; /* -1: none */
    bool serial;
    uint8_t in[512], out[ADU_MAX];
    size_t have, out_size;
    int64_t due_ns, last_ns; /* time of the pending reply; time of the last byte */
};

struct sst_sim_drive {
    pthread_t thread;
    pthread_mutex_t lock;
    struct sim_drives bus; /* under lock */

    int wake, listener, port; /* fixed after start */
    char rtu_link[108];
    struct line line[CLIENTS + 1]; /* server thread only; [CLIENTS] is the serial line */
    int serial_peer;               /* keeps the terminal alive while no client has it open */
    int64_t replug_ns;             /* 0: plugged */
};

static uint16_t crc16(const uint8_t *p, size_t n)
{
    unsigned crc = 0xFFFF;

    for (size_t i = 0; i < n; i++) {
        crc ^= p[i];
        for (int b = 0; b < 8; b++)
            crc = crc & 1 ? crc >> 1 ^ 0xA001 : crc >> 1;
    }
    return (uint16_t)crc;
}

/* --- opening ------------------------------------------------------------------------------------------------------ */

static int open_listener(struct sst_sim_drive *d, int port)
{
    struct sockaddr_in a = { .sin_family = AF_INET,
                             .sin_port = htons((uint16_t)port),
                             .sin_addr.s_addr = htonl(INADDR_LOOPBACK) };
    socklen_t n = sizeof(a);
    const int on = 1;

    d->listener = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (d->listener < 0)
        return -errno;
    (void)setsockopt(d->listener, SOL_SOCKET, SO_REUSEADDR, &on, sizeof(on));
    if (bind(d->listener, (const struct sockaddr *)&a, n) || listen(d->listener, CLIENTS) ||
        getsockname(d->listener, (struct sockaddr *)&a, &n)) {
        sst_log_error("simulated rig: cannot listen on 127.0.0.1:%d: %s; choose another port", port, strerror(errno));
        return -errno;
    }
    d->port = ntohs(a.sin_port);
    return 0;
}

static int open_serial(struct sst_sim_drive *d)
{
    struct line *l = &d->line[CLIENTS];
    char name[64], fresh[sizeof(d->rtu_link) + 8];
    struct termios t;
    int err;

    *l = (struct line){ .serial = true, .fd = posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC | O_NONBLOCK) };
    d->serial_peer = -1;
    if (l->fd < 0 || grantpt(l->fd) || unlockpt(l->fd) || ptsname_r(l->fd, name, sizeof(name)))
        goto fail;
    d->serial_peer = open(name, O_RDWR | O_NOCTTY | O_CLOEXEC);
    if (d->serial_peer < 0 || tcgetattr(d->serial_peer, &t))
        goto fail;
    cfmakeraw(&t);
    /* A link left by an earlier run is replaced atomically. */
    snprintf(fresh, sizeof(fresh), "%s.new", d->rtu_link);
    (void)unlink(fresh);
    if (tcsetattr(d->serial_peer, TCSANOW, &t) || symlink(name, fresh) || rename(fresh, d->rtu_link))
        goto fail;
    return 0;

fail:
    err = -errno;
    sst_log_error("simulated rig: cannot create the serial line %s: %s", d->rtu_link, strerror(errno));
    return err;
}

static void close_fd(int *fd)
{
    if (*fd >= 0)
        close(*fd);
    *fd = -1;
}

/* --- requests and replies ----------------------------------------------------------------------------------------- */

static void drop_line(struct sst_sim_drive *d, struct line *l)
{
    close_fd(&l->fd);
    l->have = l->out_size = 0;
    if (!l->serial)
        return;
    close_fd(&d->serial_peer);
    (void)unlink(d->rtu_link);
    d->replug_ns = sst_clock_now_ns() + REPLUG_NS;
}

/* Frame a reply with the active faults. Under lock. */
static void frame_reply_locked(struct sst_sim_drive *d, struct line *l, const struct sim_query *q, const uint8_t *pdu,
                               size_t size)
{
    struct sim_wire_faults *f = &d->bus.faults;
    uint8_t *out = l->out;
    int unit = q->unit;
    size_t n = 0;

    if (sim_strikes(&f->wrong_unit))
        unit = unit % SST_SIM_AXES + 1;
    if (l->serial && sim_strikes(&f->noise)) {
        static const uint8_t noise[] = { 0x00, 0xFF, 0x5A, 0x01, 0x83, 0xC3 };

        memcpy(out, noise, sizeof(noise));
        n = sizeof(noise);
    }
    if (l->serial) {
        uint16_t crc;

        out[n] = (uint8_t)unit;
        memcpy(out + n + 1, pdu, size);
        crc = crc16(out + n, size + 1);
        if (sim_strikes(&f->bad_crc))
            crc ^= 0x0100;
        out[n + size + 1] = (uint8_t)crc;
        out[n + size + 2] = (uint8_t)(crc >> 8);
        n += size + 3;
    } else {
        memcpy(out, q->adu, 4); /* transaction, protocol */
        out[4] = 0;
        out[5] = (uint8_t)(size + 1);
        out[6] = (uint8_t)unit;
        memcpy(out + 7, pdu, size);
        n = size + 7;
    }
    if (sim_strikes(&f->drop_bytes))
        n -= 2;
    l->out_size = n;
    l->due_ns = sst_clock_now_ns() + (sim_strikes(&f->late) ? (int64_t)f->late_ms * 1000000 : 0);
}

static void serve(struct sst_sim_drive *d, struct line *l, const struct sim_query *q)
{
    uint8_t reply[SST_SIM_PDU_MAX];
    bool gone;
    size_t n = 0;

    pthread_mutex_lock(&d->lock);
    gone = sim_strikes(&d->bus.faults.disconnect);
    if (!gone)
        n = sim_drives_answer(&d->bus, sst_clock_now_ns(), q, reply);
    if (!gone && !n && !l->serial) { /* a gateway reports that the target does not respond */
        reply[0] = q->pdu[0] | 0x80;
        reply[1] = 11;
        n = 2;
    }
    if (n && !sim_strikes(&d->bus.faults.silence))
        frame_reply_locked(d, l, q, reply, n);
    pthread_mutex_unlock(&d->lock);
    if (gone)
        drop_line(d, l);
}

static void consume(struct line *l, size_t n)
{
    l->have -= n;
    memmove(l->in, l->in + n, l->have);
}

/* Handle the next complete request, if any; one at a time, like a drive. @return true: one was handled */
static bool handle_tcp(struct sst_sim_drive *d, struct line *l)
{
    uint8_t request[512];
    size_t n;

    if (l->have < 8)
        return false;
    n = 6 + ((size_t)l->in[4] << 8 | l->in[5]);
    if (n < 8 || n > 260) {
        drop_line(d, l);
        return false;
    }
    if (l->have < n)
        return false;
    memcpy(request, l->in, n);
    consume(l, n);
    serve(d, l, &(struct sim_query){ request[6], request, request + 7, n - 7 });
    return true;
}

static bool handle_serial(struct sst_sim_drive *d, struct line *l)
{
    uint8_t request[512];
    size_t n;

    /* An incomplete request is dropped when more data arrive: see receive(). */
    n = l->have < 2 ? 0 : sim_request_size(l->in + 1, l->have - 1);
    if (!n || l->have < n + 3)
        return false;
    n += 3;
    memcpy(request, l->in, n);
    if (crc16(request, n - 2) != (request[n - 2] | request[n - 1] << 8)) {
        l->have = 0;
        return false;
    }
    consume(l, n);
    serve(d, l, &(struct sim_query){ request[0], request, request + 1, n - 3 });
    return true;
}

static void send_reply(struct sst_sim_drive *d, struct line *l)
{
    const ssize_t n = write(l->fd, l->out, l->out_size);

    /* A client that does not read a reply of a few bytes is disconnected. */
    if (n != (ssize_t)l->out_size && !l->serial)
        drop_line(d, l);
    l->out_size = 0;
}

/*
 * A terminal has no parity, and tcsetattr() with parity fails where it changes nothing else: after a killed client,
 * with its rate still set. Rates have no effect here, so set one that no client asks for.
 */
static void forget_rate(const struct sst_sim_drive *d)
{
    struct termios t;

    if (tcgetattr(d->serial_peer, &t) || cfgetospeed(&t) == B50 || cfsetspeed(&t, B50))
        return;
    (void)tcsetattr(d->serial_peer, TCSANOW, &t);
}

static void receive(struct sst_sim_drive *d, struct line *l)
{
    const ssize_t n = read(l->fd, l->in + l->have, sizeof(l->in) - l->have);

    if (n > 0) {
        if (l->serial && sst_clock_now_ns() - l->last_ns > GAP_NS && l->have) {
            memmove(l->in, l->in + l->have, (size_t)n);
            l->have = 0;
        }
        l->have += (size_t)n;
        l->last_ns = sst_clock_now_ns();
        if (l->serial)
            forget_rate(d);
        if (l->serial && l->have == sizeof(l->in))
            l->have = 0;
    } else if (n == 0 || (errno != EAGAIN && errno != EINTR)) {
        drop_line(d, l);
    }
}

static void work_on(struct sst_sim_drive *d, struct line *l)
{
    while (l->fd >= 0) {
        if (l->out_size) {
            if (sst_clock_now_ns() < l->due_ns)
                return;
            send_reply(d, l);
        } else if (!(l->serial ? handle_serial(d, l) : handle_tcp(d, l))) {
            return;
        }
    }
}

/* --- the thread --------------------------------------------------------------------------------------------------- */

static void accept_client(struct sst_sim_drive *d)
{
    const int fd = accept4(d->listener, NULL, NULL, SOCK_CLOEXEC | SOCK_NONBLOCK);

    if (fd < 0)
        return;
    for (int i = 0; i < CLIENTS; i++) {
        if (d->line[i].fd < 0) {
            d->line[i] = (struct line){ .fd = fd };
            return;
        }
    }
    close(fd);
}

static int wait_ms(const struct sst_sim_drive *d)
{
    const int64_t now = sst_clock_now_ns();
    int64_t first = d->replug_ns ? d->replug_ns : INT64_MAX;

    for (int i = 0; i <= CLIENTS; i++) {
        if (d->line[i].fd >= 0 && d->line[i].out_size && d->line[i].due_ns < first)
            first = d->line[i].due_ns;
    }
    return first == INT64_MAX ? -1 : first <= now ? 0 : (int)((first - now) / 1000000 + 1);
}

static void *serve_all(void *arg)
{
    struct sst_sim_drive *d = arg;

    for (;;) {
        struct pollfd p[CLIENTS + 3] = { { .fd = d->wake, .events = POLLIN }, { .fd = d->listener, .events = POLLIN } };

        for (int i = 0; i <= CLIENTS; i++)
            p[i + 2] = (struct pollfd){ .fd = d->line[i].fd, .events = d->line[i].out_size ? 0 : POLLIN };
        if (poll(p, ARRAY_LEN(p), wait_ms(d)) < 0 && errno != EINTR)
            return NULL;
        if (p[0].revents)
            return NULL;
        if (p[1].revents)
            accept_client(d);
        for (int i = 0; i <= CLIENTS; i++) {
            if (d->line[i].fd >= 0 && p[i + 2].fd == d->line[i].fd && p[i + 2].revents & (POLLIN | POLLHUP | POLLERR))
                receive(d, &d->line[i]);
            work_on(d, &d->line[i]);
        }
        if (d->replug_ns && sst_clock_now_ns() >= d->replug_ns) {
            d->replug_ns = 0;
            if (open_serial(d))
                drop_line(d, &d->line[CLIENTS]);
        }
    }
}

/* All signals are blocked here: they belong to the program that uses the drives. */
static int start_thread(struct sst_sim_drive *d)
{
    sigset_t all, before;
    int err;

    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before);
    err = -pthread_create(&d->thread, NULL, serve_all, d);
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    return err;
}

int sst_sim_drive_start(struct sst_sim_drive **out, const struct sst_sim_drive_config *cfg)
{
    struct sst_sim_drive *d = calloc(1, sizeof(*d));
    int err = 0;

    if (!d)
        return -ENOMEM;
    pthread_mutex_init(&d->lock, NULL);
    d->wake = d->listener = d->serial_peer = -1;
    for (int i = 0; i <= CLIENTS; i++)
        d->line[i].fd = -1;
    for (int i = 0; i < SST_SIM_AXES; i++)
        sim_axis_init(&d->bus.axis[i], i, cfg->seed, sst_clock_now_ns());
    d->wake = eventfd(0, EFD_CLOEXEC);
    if (d->wake < 0)
        err = -errno;
    if (!err && cfg->tcp_port >= 0)
        err = open_listener(d, cfg->tcp_port);
    if (!err && cfg->rtu_link) {
        if (snprintf(d->rtu_link, sizeof(d->rtu_link), "%s", cfg->rtu_link) >= (int)sizeof(d->rtu_link)) {
            sst_log_error("simulated rig: the name of the serial line %.60s... is too long", cfg->rtu_link);
            err = -ENAMETOOLONG;
        } else {
            err = open_serial(d);
        }
    }
    err = err ? err : start_thread(d);
    if (err) {
        d->thread = 0;
        sst_sim_drive_stop(d);
        return err;
    }
    pthread_setname_np(d->thread, "sim-rig");
    *out = d;
    return 0;
}

void sst_sim_drive_stop(struct sst_sim_drive *d)
{
    const uint64_t one = 1;

    if (!d)
        return;
    if (d->thread) {
        (void)!write(d->wake, &one, sizeof(one));
        pthread_join(d->thread, NULL);
    }
    for (int i = 0; i <= CLIENTS; i++)
        close_fd(&d->line[i].fd);
    if (d->rtu_link[0])
        (void)unlink(d->rtu_link);
    close_fd(&d->serial_peer);
    close_fd(&d->listener);
    close_fd(&d->wake);
    pthread_mutex_destroy(&d->lock);
    free(d);
}

int sst_sim_drive_tcp_port(const struct sst_sim_drive *d)
{
    return d->port;
}

void sst_sim_drive_pose(struct sst_sim_drive *d, int64_t t_ns, int32_t pose_um[3])
{
    const int64_t now = sst_clock_now_ns();

    pthread_mutex_lock(&d->lock);
    for (int i = 0; i < SST_SIM_AXES; i++) {
        /* Advance only to the present: future motion can still change by a command. */
        sim_axis_advance(&d->bus.axis[i], now);
        pose_um[i] = (int32_t)(sim_axis_position(&d->bus.axis[i], t_ns < now ? t_ns : now) + 100000.5) - 100000;
    }
    pthread_mutex_unlock(&d->lock);
}

int sst_sim_drive_fault(struct sst_sim_drive *d, const char *name, const char *value, char *error, size_t error_size)
{
    int err;

    pthread_mutex_lock(&d->lock);
    for (int i = 0; i < SST_SIM_AXES; i++)
        sim_axis_advance(&d->bus.axis[i], sst_clock_now_ns());
    err = sim_drives_fault(&d->bus, name, value, error, error_size);
    pthread_mutex_unlock(&d->lock);
    return err;
}
