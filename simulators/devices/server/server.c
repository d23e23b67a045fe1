/* The simulator's event loop: connections of programs and their calls. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE
#include "simulators/devices/server/server_internal.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <sys/timerfd.h>
#include <sys/un.h>
#include <unistd.h>

#include "base/log.h"

int sim_source_add(int epoll, int fd, uint32_t events, struct sim_source *source)
{
    struct epoll_event ev = { .events = events, .data.ptr = source };

    return epoll_ctl(epoll, EPOLL_CTL_ADD, fd, &ev) < 0 ? -errno : 0;
}

/*
 * Handle files that programs have closed. Also before each call: a program that closes something and calls at once must
 * find it free, but epoll may report the connection before the close.
 */
static void handle_hangups(struct sim_server *s)
{
    struct epoll_event ev[64];
    int n;

    do {
        n = epoll_wait(s->hangups, ev, ARRAY_LEN(ev), 0);
        for (int i = 0; i < n; i++) {
            struct sim_source *source = ev[i].data.ptr;

            source->ready(s, source, ev[i].events);
        }
    } while (n == ARRAY_LEN(ev));
}

/* --- answers ------------------------------------------------------------------------------------------------------ */

static struct sim_conn *conn_of(struct sim_request *r)
{
    return (struct sim_conn *)((char *)r - offsetof(struct sim_conn, request));
}

static void put_fd(struct msghdr *msg, char *room, int fd)
{
    struct cmsghdr *c;

    msg->msg_control = room;
    msg->msg_controllen = CMSG_SPACE(sizeof(int));
    c = CMSG_FIRSTHDR(msg);
    c->cmsg_level = SOL_SOCKET;
    c->cmsg_type = SCM_RIGHTS;
    c->cmsg_len = CMSG_LEN(sizeof(int));
    memcpy(CMSG_DATA(c), &fd, sizeof(fd));
}

static void request_end(struct sim_conn *c)
{
    struct sim_request *r = &c->request;

    if (r->out_fd >= 0 && r->out_fd_close)
        close(r->out_fd);
    if (r->fd >= 0)
        close(r->fd);
    r->fd = r->out_fd = -1;
    c->pending = false;
}

void sst_sim_answer(struct sim_server *s, struct sim_request *r, int result)
{
    struct sim_conn *c = conn_of(r);
    struct sst_sim_answer answer = { .result = result, .drain = r->drain, .flags = r->out_flags, .arg = r->out_arg };
    struct iovec iov[2] = { { &answer, sizeof(answer) }, { r->data, r->out_bytes } };
    struct msghdr msg = { .msg_iov = iov, .msg_iovlen = r->out_bytes ? 2 : 1 };
    _Alignas(struct cmsghdr) char room[CMSG_SPACE(sizeof(int))] = { 0 };

    sim_timer_stop(s, &c->delay);
    if (result >= 0 && r->out_fd >= 0)
        put_fd(&msg, room, r->out_fd);
    /* The program waits for this one message: a full socket means a protocol violation. */
    if (sendmsg(c->fd, &msg, MSG_DONTWAIT | MSG_NOSIGNAL) < 0)
        (void)shutdown(c->fd, SHUT_RDWR);
    request_end(c);
}

static void delay_over(void *arg)
{
    struct sim_conn *c = arg;

    sst_sim_answer(c->server, &c->request, c->delayed_result);
}

int sim_answer_at(struct sim_server *s, struct sim_request *r, int result, int64_t due_ns)
{
    struct sim_conn *c = conn_of(r);
    const int err = sim_timer_set(s, &c->delay, due_ns);

    c->delayed_result = result;
    return err ? err : SST_SIM_LATER;
}

/* Cancel a pending answer of a device. */
static void request_cancel(struct sim_server *s, struct sim_conn *c)
{
    struct sim_handle *h = c->request.handle;

    if (c->delay.slot)
        sim_timer_stop(s, &c->delay);
    else if (h && h->ops->cancel)
        h->ops->cancel(h, &c->request);
}

void sim_requests_fail(struct sim_server *s, struct sim_handle *h, int err)
{
    for (struct sim_conn *c = s->conns; c; c = c->next)
        if (c->pending && c->request.handle == h) {
            request_cancel(s, c);
            c->request.handle = NULL;
            c->request.out_bytes = 0;
            sst_sim_answer(s, &c->request, err);
        }
}

/* --- calls -------------------------------------------------------------------------------------------------------- */

static int serve_file(struct sim_server *s, struct sim_request *r)
{
    struct sim_open_file *f = sim_file_find(s, r->call.handle);
    const struct sim_ops *ops = f ? f->handle.ops : NULL;

    if (!f)
        return -ENODEV;
    r->handle = &f->handle;
    switch (r->call.op) {
    case SST_SIM_IOCTL:
        return ops->ioctl ? ops->ioctl(&f->handle, r) : -ENOTTY;
    case SST_SIM_MAP:
        return ops->map ? ops->map(&f->handle, r) : -ENODEV;
    case SST_SIM_STAT:
        r->out_arg = sim_file_device(f);
        return 0;
    case SST_SIM_SEEK:
        return ops->seek ? ops->seek(&f->handle, r) : -ESPIPE;
    case SST_SIM_READ:
        return ops->read ? ops->read(&f->handle, r) : -EINVAL;
    default:
        return ops->write ? ops->write(&f->handle, r) : -EINVAL;
    }
}

static void serve_ready(struct sim_server *s, const struct sst_sim_call *call)
{
    struct sim_open_file *f = sim_file_find(s, call->handle);

    if (f) {
        f->handle.urgent = false;
        if (f->handle.ops->ready)
            f->handle.ops->ready(&f->handle);
    }
}

static void serve(struct sim_server *s, struct sim_conn *c)
{
    struct sim_request *r = &c->request;
    int result;

    c->pending = true;
    switch (r->call.op) {
    case SST_SIM_OPEN:
        result = sim_file_open(s, r);
        break;
    case SST_SIM_IOCTL:
    case SST_SIM_MAP:
    case SST_SIM_STAT:
    case SST_SIM_READ:
    case SST_SIM_SEEK:
    case SST_SIM_WRITE:
        result = serve_file(s, r);
        break;
    case SST_SIM_FAULT:
    case SST_SIM_FAULTS:
    case SST_SIM_STATUS:
    case SST_SIM_STOP:
        result = s->control.call(s->control.arg, r);
        break;
    default:
        result = -ENOSYS;
    }
    if (result != SST_SIM_LATER)
        sst_sim_answer(s, r, result);
}

static void conn_close(struct sim_server *s, struct sim_conn *c)
{
    if (c->pending) {
        request_cancel(s, c);
        request_end(c);
    }
    SST_LIST_REMOVE(s->conns, c);
    close(c->fd);
    free(c);
}

static int received_fd(struct msghdr *msg)
{
    int fd = -1;

    for (struct cmsghdr *c = CMSG_FIRSTHDR(msg); c; c = CMSG_NXTHDR(msg, c))
        if (c->cmsg_level == SOL_SOCKET && c->cmsg_type == SCM_RIGHTS && c->cmsg_len == CMSG_LEN(sizeof(int)))
            memcpy(&fd, CMSG_DATA(c), sizeof(fd));
    return fd;
}

/* Receive one message: a call, or the cancellation of a pending one. @return false: the connection is closed. */
static bool receive(struct sim_server *s, struct sim_conn *c)
{
    struct sst_sim_call call;
    _Alignas(struct cmsghdr) char room[CMSG_SPACE(sizeof(int))];
    uint8_t *data = c->pending ? NULL : c->data;
    struct iovec iov[2] = { { &call, sizeof(call) }, { data, data ? sizeof(c->data) : 0 } };
    struct msghdr msg = { .msg_iov = iov, .msg_iovlen = 2, .msg_control = room, .msg_controllen = sizeof(room) };
    const ssize_t n = recvmsg(c->fd, &msg, MSG_DONTWAIT | MSG_CMSG_CLOEXEC);
    int fd;

    if (n < 0)
        return errno == EAGAIN || errno == EINTR;
    fd = received_fd(&msg);
    if (n < (ssize_t)sizeof(call) || (msg.msg_flags & MSG_TRUNC) || (c->pending && call.op != SST_SIM_CANCEL)) {
        if (fd >= 0)
            close(fd);
        return false;
    }
    handle_hangups(s);
    if (call.op == SST_SIM_CANCEL) {
        if (c->pending) {
            request_cancel(s, c);
            c->request.out_bytes = 0;
            sst_sim_answer(s, &c->request, -EINTR);
        }
        return true;
    }
    if (call.op == SST_SIM_READY) {
        serve_ready(s, &call);
        return true;
    }
    c->request = (struct sim_request){
        .call = call, .data = c->data, .fd = fd, .out_fd = -1, .bytes = (uint32_t)((size_t)n - sizeof(call))
    };
    serve(s, c);
    return true;
}

static void conn_ready(struct sim_server *s, struct sim_source *source, uint32_t events)
{
    struct sim_conn *c = (struct sim_conn *)source;

    if (!(events & EPOLLIN) || !receive(s, c))
        conn_close(s, c);
}

static void accept_one(struct sim_server *s, struct sim_source *source SST_UNUSED, uint32_t events SST_UNUSED)
{
    const int fd = accept4(s->listener, NULL, NULL, SOCK_CLOEXEC);
    struct sim_conn *c;

    if (fd < 0)
        return;
    c = calloc(1, sizeof(*c));
    if (!c) {
        close(fd);
        return;
    }
    c->source.ready = conn_ready;
    c->fd = fd;
    c->server = s;
    c->request.fd = c->request.out_fd = -1;
    c->delay = (struct sim_timer){ .fire = delay_over, .arg = c };
    if (sim_source_add(s->epoll, fd, EPOLLIN, &c->source)) {
        close(fd);
        free(c);
        return;
    }
    c->next = s->conns;
    s->conns = c;
}

/* --- the loop ----------------------------------------------------------------------------------------------------- */

static void timers_due(struct sim_server *s, struct sim_source *source SST_UNUSED, uint32_t events SST_UNUSED)
{
    uint64_t expirations;

    (void)!read(s->timerfd, &expirations, sizeof(expirations));
    sim_timers_fire(s);
}

static void hangups_ready(struct sim_server *s, struct sim_source *source SST_UNUSED, uint32_t events SST_UNUSED)
{
    handle_hangups(s);
}

static void watched_ready(struct sim_server *s SST_UNUSED, struct sim_source *source, uint32_t events SST_UNUSED)
{
    struct sim_watched *w = (struct sim_watched *)source;

    w->fn(w->arg);
}

int sim_watch(struct sim_server *s, int fd, void (*fn)(void *arg), void *arg)
{
    struct sim_watched *w = calloc(1, sizeof(*w));
    int err;

    if (!w)
        return -ENOMEM;
    *w = (struct sim_watched){ .source.ready = watched_ready, .fn = fn, .arg = arg, .next = s->watched };
    err = sim_source_add(s->epoll, fd, EPOLLIN, &w->source);
    if (err)
        free(w);
    else
        s->watched = w;
    return err;
}

int sim_server_run(struct sim_server *s)
{
    struct epoll_event ev[64];

    s->stop = false;
    while (!s->stop) {
        int n;

        sim_timers_arm(s);
        /* Serving an event frees nothing that another event points to: closed files wait in dead_files, a connection
         * is only freed by its own event. */
        n = epoll_wait(s->epoll, ev, ARRAY_LEN(ev), -1);
        if (n < 0 && errno != EINTR) {
            const int err = -errno;

            sst_log_error("simulator: cannot wait for events: %s", strerror(-err));
            return err;
        }
        for (int i = 0; i < n && !s->stop; i++) {
            struct sim_source *source = ev[i].data.ptr;

            source->ready(s, source, ev[i].events);
        }
        sim_files_free_dead(s);
    }
    return 0;
}

void sim_server_stop(struct sim_server *s)
{
    s->stop = true;
}

static int listen_at(struct sim_server *s)
{
    struct sockaddr_un name = { .sun_family = AF_UNIX };
    char path[sizeof(name.sun_path)];

    /* The socket gets its name only when it listens, so that every client that finds it can connect. */
    if (snprintf(path, sizeof(path), "%s/%s", s->dir, SST_SIM_SOCKET) >= (int)sizeof(path) ||
        snprintf(name.sun_path, sizeof(name.sun_path), "%s/new.sock", s->dir) >= (int)sizeof(name.sun_path))
        return -ENAMETOOLONG;
    s->listener = socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (s->listener < 0 || bind(s->listener, (const struct sockaddr *)&name, sizeof(name)) < 0 ||
        listen(s->listener, 1024) < 0 || rename(name.sun_path, path) < 0)
        return -errno;
    return 0;
}

int sim_server_open(struct sim_server **out, const char *dir, const struct session_control *control)
{
    struct sim_server *s = calloc(1, sizeof(*s));
    int err = -ENOMEM;

    if (!s)
        return err;
    s->control = *control;
    s->listener = s->epoll = s->hangups = s->timerfd = -1;
    s->listener_source.ready = accept_one;
    s->timer_source.ready = timers_due;
    s->hangups_source.ready = hangups_ready;
    err = sst_path_join(s->dir, dir, NULL);
    err = err ? err : sim_dev_open(s);
    if (err)
        goto fail;
    err = listen_at(s);
    if (err) {
        sst_log_error("cannot create a socket in session folder '%s': %s; is it in use, or its name too long?", dir,
                      strerror(-err));
        goto fail;
    }
    s->epoll = epoll_create1(EPOLL_CLOEXEC);
    s->hangups = epoll_create1(EPOLL_CLOEXEC);
    s->timerfd = timerfd_create(CLOCK_MONOTONIC, TFD_CLOEXEC | TFD_NONBLOCK);
    if (s->epoll < 0 || s->hangups < 0 || s->timerfd < 0)
        err = -errno;
    err = err ? err : sim_source_add(s->epoll, s->listener, EPOLLIN, &s->listener_source);
    err = err ? err : sim_source_add(s->epoll, s->timerfd, EPOLLIN, &s->timer_source);
    err = err ? err : sim_source_add(s->epoll, s->hangups, EPOLLIN, &s->hangups_source);
    if (err) {
        sst_log_error("simulator: cannot create the event loop: %s", strerror(-err));
        goto fail;
    }
    *out = s;
    return 0;

fail:
    sim_server_close(s);
    return err;
}

void sim_server_close(struct sim_server *s)
{
    if (!s)
        return;
    while (s->nodes)
        sim_node_remove(s, s->nodes);
    sim_files_drop(s, NULL);
    while (s->conns)
        conn_close(s, s->conns);
    sim_files_free_dead(s);
    while (s->watched) {
        struct sim_watched *w = s->watched;

        s->watched = w->next;
        free(w);
    }
    if (s->listener >= 0)
        close(s->listener);
    if (s->epoll >= 0)
        close(s->epoll);
    if (s->hangups >= 0)
        close(s->hangups);
    if (s->timerfd >= 0)
        close(s->timerfd);
    free(s->files);
    free(s->heap);
    free(s);
}

const char *sim_server_dir(const struct sim_server *s)
{
    return s->dir;
}
