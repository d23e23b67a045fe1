/* Calls to the simulator: connections, descriptors, access to the program's memory. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE
#include "simulators/devices/preload/preload_internal.h"

#include <dlfcn.h>
#include <fcntl.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/un.h>
#include <unistd.h>

#define FDS  65536 /* size of the descriptor table */
#define IDLE 32

static struct sim_next next;
static char session[SIM_PATH_MAX];
static atomic_uchar maybe[FDS];
static atomic_uchar hidden[FDS]; /* connections: not the program's to close */
static atomic_int idle[IDLE];    /* idle connections, plus 1; 0: none */

static void resolve(void *pointer, const char *name)
{
    void *symbol = dlsym(RTLD_NEXT, name);

    memcpy(pointer, &symbol, sizeof(symbol));
}

static void resolve_all(void)
{
    resolve(&next.open_, "open");
    resolve(&next.openat_, "openat");
    resolve(&next.ioctl_, "ioctl");
    resolve(&next.mmap_, "mmap");
    resolve(&next.read_, "read");
    resolve(&next.write_, "write");
    resolve(&next.close_, "close");
    resolve(&next.fcntl_, "fcntl");
    resolve(&next.syscall_, "syscall");
}

const struct sim_next *sim_next(void)
{
    /* Other libraries' constructors may run before ours. */
    if (!next.syscall_)
        resolve_all();
    return &next;
}

const char *sim_dir(void)
{
    return session[0] ? session : NULL;
}

/* --- descriptors -------------------------------------------------------------------------------------------------- */

void sim_mark(int fd)
{
    if (fd >= 0 && fd < FDS)
        atomic_store_explicit(&maybe[fd], 1, memory_order_relaxed);
}

bool sim_maybe(int fd)
{
    return fd >= FDS || (fd >= 0 && atomic_load_explicit(&maybe[fd], memory_order_relaxed));
}

bool sim_hidden(int fd)
{
    return fd >= 0 && fd < FDS && atomic_load_explicit(&hidden[fd], memory_order_relaxed);
}

/* Close one of our own descriptors. */
static void close_connection(int fd)
{
    if (fd < FDS)
        atomic_store_explicit(&hidden[fd], 0, memory_order_relaxed);
    (void)sim_next()->close_(fd);
}

bool sim_identify(int fd, struct sim_id *id)
{
    struct sockaddr_un name;
    socklen_t bytes = sizeof(name);
    const int saved = errno;
    const size_t head = strlen(SST_SIM_NAME);
    char *text = name.sun_path + 1;
    bool ours = false;

    if (session[0] && fd >= 0 && getsockname(fd, (struct sockaddr *)&name, &bytes) == 0 && name.sun_family == AF_UNIX &&
        bytes > offsetof(struct sockaddr_un, sun_path) + head + 3 && bytes < sizeof(name) && !name.sun_path[0] &&
        memcmp(text, SST_SIM_NAME, head) == 0 && text[head + 1] == '/') {
        ((char *)&name)[bytes] = 0;
        *id = (struct sim_id){ .letter = text[head], .handle = (uint32_t)strtoul(text + head + 2, NULL, 10) };
        ours = true;
    }
    errno = saved;
    return ours;
}

static void drop_connections(void)
{
    for (int i = 0; i < IDLE; i++) {
        const int fd = atomic_exchange(&idle[i], 0) - 1;

        if (fd >= 0)
            close_connection(fd);
    }
}

__attribute__((constructor)) static void loaded(void)
{
    const char *dir = getenv(SST_SIM_DIR_ENV);
    struct sim_id id;

    (void)sim_next();
    if (!dir || dir[0] != '/' || strlen(dir) >= sizeof(session) - 64)
        return;
    memcpy(session, dir, strlen(dir) + 1);
    /* A child must not share connections with its parent. */
    (void)pthread_atfork(NULL, NULL, drop_connections);
    for (int fd = 0; fd < 64; fd++)
        if (sim_identify(fd, &id))
            sim_mark(fd);
}

/* --- connections -------------------------------------------------------------------------------------------------- */

/* Move a descriptor to a high number: programs rely on low numbers, and select() needs them. */
static int move_up(int fd)
{
    struct rlimit limit;
    int high = -1;

    if (getrlimit(RLIMIT_NOFILE, &limit) == 0)
        high = sim_next()->fcntl_(fd, F_DUPFD_CLOEXEC, (int)(limit.rlim_cur < FDS ? limit.rlim_cur : FDS) - 2 * IDLE);
    if (high >= 0) {
        (void)sim_next()->close_(fd);
        fd = high;
    }
    if (fd < FDS)
        atomic_store_explicit(&hidden[fd], 1, memory_order_relaxed);
    return fd;
}

static int connect_new(void)
{
    struct sockaddr_un name = { .sun_family = AF_UNIX };
    int fd;

    if (snprintf(name.sun_path, sizeof(name.sun_path), "%s/" SST_SIM_SOCKET, session) >= (int)sizeof(name.sun_path))
        return -ENAMETOOLONG;
    fd = socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0);
    if (fd < 0)
        return -errno;
    fd = move_up(fd);
    while (connect(fd, (const struct sockaddr *)&name, sizeof(name)) < 0)
        if (errno != EINTR) {
            close_connection(fd);
            return -ENODEV; /* the simulator is gone, and with it all devices */
        }
    return fd;
}

static int get_connection(bool *used)
{
    for (int i = 0; i < IDLE; i++) {
        const int fd = atomic_exchange(&idle[i], 0) - 1;

        if (fd >= 0) {
            *used = true;
            return fd;
        }
    }
    *used = false;
    return connect_new();
}

static void release_connection(int fd)
{
    for (int i = 0; i < IDLE; i++) {
        int none = 0;

        if (atomic_compare_exchange_strong(&idle[i], &none, fd + 1))
            return;
    }
    close_connection(fd);
}

/* --- calls -------------------------------------------------------------------------------------------------------- */

/* A raw system call, which thread cancellation cannot interrupt. */
static ssize_t send_parts(int conn, const struct sst_sim_call *call, const struct iovec *parts, int send_fd)
{
    struct iovec iov[1 + SIM_PARTS] = { { (void *)call, sizeof(*call) } };
    _Alignas(struct cmsghdr) char room[CMSG_SPACE(sizeof(int))] = { 0 };
    struct msghdr msg = { .msg_iov = iov, .msg_iovlen = 1 };

    for (int i = 0; parts && i < SIM_PARTS; i++)
        if (parts[i].iov_len)
            iov[msg.msg_iovlen++] = parts[i];
    if (send_fd >= 0) {
        struct cmsghdr *c;

        msg.msg_control = room;
        msg.msg_controllen = sizeof(room);
        c = CMSG_FIRSTHDR(&msg);
        c->cmsg_level = SOL_SOCKET;
        c->cmsg_type = SCM_RIGHTS;
        c->cmsg_len = CMSG_LEN(sizeof(int));
        memcpy(CMSG_DATA(c), &send_fd, sizeof(send_fd));
    }
    return sim_next()->syscall_(SYS_sendmsg, conn, &msg, MSG_NOSIGNAL);
}

static ssize_t receive_parts(int conn, struct sim_exchange *x)
{
    struct iovec iov[1 + SIM_PARTS] = { { &x->answer, sizeof(x->answer) } };
    _Alignas(struct cmsghdr) char room[CMSG_SPACE(sizeof(int))];
    struct msghdr msg = { .msg_iov = iov, .msg_iovlen = 1, .msg_control = room, .msg_controllen = sizeof(room) };
    ssize_t n;

    for (int i = 0; i < SIM_PARTS; i++)
        if (x->out[i].iov_len)
            iov[msg.msg_iovlen++] = x->out[i];
    n = sim_next()->syscall_(SYS_recvmsg, conn, &msg, MSG_CMSG_CLOEXEC);
    if (n < 0)
        return -errno;
    for (struct cmsghdr *c = CMSG_FIRSTHDR(&msg); c; c = CMSG_NXTHDR(&msg, c))
        if (c->cmsg_level == SOL_SOCKET && c->cmsg_type == SCM_RIGHTS && c->cmsg_len == CMSG_LEN(sizeof(int)))
            memcpy(&x->fd, CMSG_DATA(c), sizeof(x->fd));
    return n;
}

/* Wait for the answer despite signals: the simulator answers -EINTR or, if it was faster, the result. */
static ssize_t wait_answer(int conn, struct sim_exchange *x)
{
    static const struct sst_sim_call cancel = { .op = SST_SIM_CANCEL };
    bool cancel_sent = false;
    ssize_t n;

    while ((n = receive_parts(conn, x)) == -EINTR) {
        if (!cancel_sent && send_parts(conn, &cancel, NULL, -1) < 0)
            return -ENODEV;
        cancel_sent = true;
    }
    return n;
}

int sim_exchange(struct sim_exchange *x)
{
    const int saved = errno;
    bool used = true;
    int conn = -1, result = -ENODEV;
    ssize_t n = -1;

    x->fd = -1;
    x->got = 0;
    x->answer = (struct sst_sim_answer){ .result = -ENODEV };
    /* A kept connection may belong to an earlier simulator: retry once with a new one. */
    while (n < 0 && used) {
        conn = get_connection(&used);
        if (conn < 0)
            break;
        n = send_parts(conn, &x->call, x->in, x->send_fd);
        if (n >= 0)
            break;
        result = errno == EFAULT || errno == EBADF || errno == EMSGSIZE ? -errno : -ENODEV;
        if (result != -ENODEV) {
            release_connection(conn); /* nothing was sent */
            errno = saved;
            return result == -EMSGSIZE ? -EINVAL : result;
        }
        close_connection(conn);
        conn = -1;
    }
    if (conn >= 0) {
        n = wait_answer(conn, x);
        if (n >= (ssize_t)sizeof(x->answer) || n == -EFAULT) {
            release_connection(conn); /* the message is consumed even if it could not be stored */
            result = n == -EFAULT ? -EFAULT : x->answer.result;
            x->got = n > 0 ? (size_t)n - sizeof(x->answer) : 0;
        } else {
            close_connection(conn);
        }
    }
    errno = saved;
    return result;
}

void sim_settle(int fd, const struct sim_id *id, const struct sst_sim_answer *answer)
{
    char gone[64];

    for (uint32_t left = answer->drain; left;) {
        const size_t want = left < sizeof(gone) ? left : sizeof(gone);
        const ssize_t n = recv(fd, gone, want, MSG_DONTWAIT);

        if (n <= 0)
            break;
        left -= (uint32_t)n;
    }
    if (answer->flags & SST_SIM_TAKE_URGENT) {
        const struct sst_sim_call ready = { .op = SST_SIM_READY, .handle = id->handle };
        bool used;
        int conn;

        (void)!recv(fd, gone, 1, MSG_OOB | MSG_DONTWAIT);
        conn = get_connection(&used);
        if (conn >= 0 && send_parts(conn, &ready, NULL, -1) >= 0)
            release_connection(conn);
        else if (conn >= 0)
            close_connection(conn);
    }
}

int sim_peek(void *out, const void *from, size_t bytes)
{
    const struct iovec local = { out, bytes }, remote = { (void *)from, bytes };
    const int saved = errno;
    ssize_t n;

    n = sim_next()->syscall_(SYS_process_vm_readv, (long)getpid(), &local, 1L, &remote, 1L, 0L);
    if (n < 0 && errno != EFAULT) {
        /* The call is forbidden in some containers: trust the pointer. */
        memcpy(out, from, bytes);
        n = (ssize_t)bytes;
    }
    errno = saved;
    return n == (ssize_t)bytes ? 0 : -EFAULT;
}

int sim_ioctl_areas(int device_fd, const struct sim_id *id, const struct sim_ioctl *call, int *fd)
{
    const unsigned long request = call->request;
    void *arg = call->arg;
    const int saved = errno;
    const size_t bytes = _IOC_DIR(request) == _IOC_NONE ? 0 : _IOC_SIZE(request);
    char in_pointer[sizeof(void *)];
    struct sim_exchange x = {
        .call = { .op = SST_SIM_IOCTL, .cmd = (uint32_t)request, .handle = id->handle, .arg = (uintptr_t)arg },
        .send_fd = fd ? *fd : -1,
    };
    int result;

    if ((sim_next()->fcntl_(device_fd, F_GETFL) & O_NONBLOCK))
        x.call.flags |= SST_SIM_NONBLOCK;
    if (bytes)
        x.in[0] = x.out[0] = (struct iovec){ arg, bytes };
    if (!(_IOC_DIR(request) & _IOC_READ))
        x.out[0].iov_len = 0;
    for (int i = 0; i < call->count && i + 1 < SIM_PARTS; i++) {
        if (sim_peek(in_pointer, (const char *)arg + call->areas[i].pointer_at, sizeof(in_pointer)))
            return -EFAULT;
        x.in[i + 1].iov_len = call->areas[i].bytes;
        memcpy(&x.in[i + 1].iov_base, in_pointer, sizeof(in_pointer));
        x.out[i + 1] = x.in[i + 1];
    }
    result = sim_exchange(&x);
    sim_settle(device_fd, id, &x.answer);
    if (fd)
        *fd = x.fd;
    else if (x.fd >= 0)
        (void)sim_next()->close_(x.fd);
    errno = saved;
    return result;
}

int sim_open_node(const char *node, int flags)
{
    struct sim_exchange x = {
        .call = { .op = SST_SIM_OPEN, .cmd = (uint32_t)flags },
        .in = { { (void *)node, strlen(node) } },
        .send_fd = -1,
    };
    const int result = sim_exchange(&x);

    if (result < 0) {
        if (x.fd >= 0)
            (void)sim_next()->close_(x.fd);
        return result;
    }
    if (x.fd < 0)
        return -EMFILE; /* the kernel found no free descriptor number here */
    if (!(flags & O_CLOEXEC))
        (void)sim_next()->fcntl_(x.fd, F_SETFD, 0);
    sim_mark(x.fd);
    return x.fd;
}
