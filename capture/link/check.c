/* Checks of other hosts for `sst doctor`. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "base/log.h"
#include "capture/link/link_internal.h"

#define CONNECT_MS 1000

/* Does something listen there? The handshake of the service finds out its identity. */
static int reach(const char *address, int port)
{
    struct sockaddr_storage to;
    struct pollfd fds;
    unsigned bytes;
    int fd, err = link_address(address, port, &to, &bytes);
    socklen_t size = sizeof(err);

    if (err)
        return err;
    fd = socket(to.ss_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (fd < 0)
        return -errno;
    if (connect(fd, (const struct sockaddr *)&to, bytes) < 0)
        err = -errno;
    if (err == -EINPROGRESS) {
        fds = (struct pollfd){ .fd = fd, .events = POLLOUT };
        if (poll(&fds, 1, CONNECT_MS) != 1)
            err = -ETIMEDOUT;
        else
            err = getsockopt(fd, SOL_SOCKET, SO_ERROR, &err, &size) < 0 ? -errno : -err;
    }
    close(fd);
    return err;
}

int sst_link_check(const struct sst_array_config *array, char *why, size_t size)
{
    struct link_credentials *credentials;
    char text[SST_LOG_MAX] = "";
    int err;

    sst_log_hold_errors(text);
    err = link_credentials_create(&credentials, array);
    sst_log_hold_errors(NULL);
    if (err) {
        snprintf(why, size, "%s", text[0] ? text : strerror(-err));
        return err;
    }
    link_credentials_destroy(credentials);
    if (array->role == SST_CONFIG_HEAD) {
        snprintf(why, size, "certificates are there; %d node%s may connect to port %d", array->hosts.nodes,
                 array->hosts.nodes == 1 ? "" : "s", array->hosts.port);
        return 0;
    }
    err = reach(array->hosts.head, array->hosts.port);
    if (err)
        snprintf(
            why, size,
            "the head does not answer at %s port %d: %s: is its service running, and does a firewall, or the unit's "
            "IPAddressAllow, forbid it?",
            array->hosts.head, array->hosts.port, strerror(-err));
    else
        snprintf(why, size, "certificates are there, and the head answers at %s port %d", array->hosts.head,
                 array->hosts.port);
    return err;
}
