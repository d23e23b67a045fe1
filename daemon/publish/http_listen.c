/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE /* struct ucred */
/* Sockets that are listened on: a UNIX socket under its name from one moment to the next, TCP where it may be. */
#include <arpa/inet.h>
#include <errno.h>
#include <netdb.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include "base/log.h"
#include "daemon/publish/publish_internal.h"

#define BACKLOG 128

/* The process that listens on a UNIX socket; 0: none. */
static pid_t listener_of(const struct sockaddr_un *at)
{
    const int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    struct ucred peer = { 0 };
    socklen_t size = sizeof(peer);
    pid_t pid = 0;

    /* A full queue (EAGAIN) has a listener. */
    if (fd >= 0 && (!connect(fd, (const struct sockaddr *)at, sizeof(*at)) || errno == EAGAIN))
        pid = !getsockopt(fd, SOL_SOCKET, SO_PEERCRED, &peer, &size) && peer.pid > 0 ? peer.pid : -1;
    if (fd >= 0)
        close(fd);
    return pid;
}

static int check_old(const struct sockaddr_un *at)
{
    struct stat st;
    pid_t pid;

    if (lstat(at->sun_path, &st))
        return 0;
    if (!S_ISSOCK(st.st_mode)) {
        sst_log_error("%s is in the way: it is not a socket; remove it or set control.socket", at->sun_path);
        return -EEXIST;
    }
    pid = listener_of(at);
    if (!pid)
        return 0;
    sst_log_error("%s is in use by process %d; stop that service or set control.socket", at->sun_path, (int)pid);
    return -EADDRINUSE;
}

/* Bound and listening under another name first, so that no client meets it half made. */
static int listen_beside(struct sockaddr_un *at, const char *path, mode_t mode, gid_t gid)
{
    const int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    int err;

    snprintf(at->sun_path, sizeof(at->sun_path), "%s.new", path);
    unlink(at->sun_path);
    if (fd < 0 || bind(fd, (const struct sockaddr *)at, sizeof(*at))) {
        err = -errno;
        sst_log_error("control socket %s: %s; make its folder, or set control.socket", path, strerror(-err));
        goto fail;
    }
    if (gid != (gid_t)-1 && chown(at->sun_path, (uid_t)-1, gid))
        sst_log_warning("control socket %s cannot be given to group %u: %s; its members cannot connect", path,
                        (unsigned)gid, strerror(errno));
    if (chmod(at->sun_path, mode) || listen(fd, BACKLOG)) {
        err = -errno;
        sst_log_error("control socket %s: %s", path, strerror(-err));
        goto fail;
    }
    return fd;

fail:
    if (fd >= 0)
        close(fd);
    unlink(at->sun_path);
    return err;
}

int http_listen_unix(struct http_unix *out, const char *path, mode_t mode, gid_t gid)
{
    struct sockaddr_un at = { .sun_family = AF_UNIX };
    struct http_unix made = { 0 };
    struct stat st;
    int fd, err;

    if (!path[0] || strlen(path) + sizeof(".new") > sizeof(at.sun_path)) {
        sst_log_error("control.socket %s: a socket's path has 1 to %zu characters", path,
                      sizeof(at.sun_path) - sizeof(".new"));
        return -EINVAL;
    }
    strcpy(at.sun_path, path);
    err = check_old(&at);
    if (err)
        return err;
    fd = listen_beside(&at, path, mode, gid);
    if (fd < 0)
        return fd;
    if (rename(at.sun_path, path) || lstat(path, &st)) {
        err = -errno;
        sst_log_error("control socket %s: %s", path, strerror(-err));
        unlink(at.sun_path);
        close(fd);
        return err;
    }
    strcpy(made.path, path);
    made.dev = st.st_dev;
    made.ino = st.st_ino;
    *out = made;
    return fd;
}

void http_unlink_unix(const struct http_unix *u)
{
    struct stat st;

    if (u->path[0] && !lstat(u->path, &st) && st.st_dev == u->dev && st.st_ino == u->ino)
        unlink(u->path);
}

static bool is_loopback(const struct sockaddr *at)
{
    const struct in6_addr *v6 = &((const struct sockaddr_in6 *)at)->sin6_addr;

    if (at->sa_family == AF_INET)
        return ntohl(((const struct sockaddr_in *)at)->sin_addr.s_addr) >> 24 == 127;
    return IN6_IS_ADDR_LOOPBACK(v6) || (IN6_IS_ADDR_V4MAPPED(v6) && v6->s6_addr[12] == 127);
}

int http_listen_tcp(const char *address, int port, bool open, bool quiet)
{
    const struct addrinfo hints = { .ai_flags = AI_NUMERICHOST | AI_NUMERICSERV | AI_PASSIVE,
                                    .ai_socktype = SOCK_STREAM };
    struct addrinfo *at = NULL;
    char service[16];
    const int one = 1;
    int fd = -1, err = -EINVAL;

    snprintf(service, sizeof(service), "%d", port);
    if (port < 0 || port > 65535 ||
        getaddrinfo(!strcmp(address, "localhost") ? "127.0.0.1" : address, service, &hints, &at)) {
        sst_log_error("web.address %s, web.port %d: not a numeric address, like 127.0.0.1, and a port up to 65535",
                      address, port);
        return -EINVAL;
    }
    if (!open && !is_loopback(at->ai_addr)) {
        sst_log_error("web.address %s can be reached from other machines: set web.tls_certificate and web.tls_key, or "
                      "web.insecure: true to send pictures and tokens in the clear",
                      address);
        goto out;
    }
    fd = socket(at->ai_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (fd < 0 || setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &one, sizeof(one)) ||
        bind(fd, at->ai_addr, at->ai_addrlen) || listen(fd, BACKLOG)) {
        err = -errno;
        if (!quiet)
            sst_log_error("web.address %s, port %d: %s; %s", address, port,
                          err == -EADDRINUSE ? "another program listens there" : strerror(-err),
                          err == -EADDRINUSE ? "`ss -ltnp` names it; stop it or set web.port"
                                             : "set web.address and web.port");
        if (fd >= 0)
            close(fd);
        goto out;
    }
    err = fd;
out:
    freeaddrinfo(at);
    return err;
}

int http_socket_port(int fd)
{
    struct sockaddr_in6 at;
    socklen_t size = sizeof(at);

    if (getsockname(fd, (struct sockaddr *)&at, &size))
        return 0;
    return at.sin6_family == AF_INET || at.sin6_family == AF_INET6 ? ntohs(at.sin6_port) : 0; /* at the same place */
}
