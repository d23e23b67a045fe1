/* simulators/devices/preload/uevent.c - kernel events: a netlink socket becomes a connection to the simulator. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <fcntl.h>
#include <linux/netlink.h>
#include <string.h>
#include <sys/socket.h>

#include "simulators/devices/preload/preload_internal.h"

HOOK int socket(int domain, int type, int protocol)
{
    NEXT(int, socket, int, int, int);
    const int flags = (type & SOCK_NONBLOCK ? O_NONBLOCK : 0) | (type & SOCK_CLOEXEC ? O_CLOEXEC : 0);
    int fd;

    if (domain != AF_NETLINK || protocol != NETLINK_KOBJECT_UEVENT || !sim_dir())
        return next(domain, type, protocol);
    fd = sim_open_node(SST_SIM_UEVENTS, flags);
    if (fd < 0) {
        errno = -fd;
        return -1;
    }
    return fd;
}

static bool is_ours(int fd, struct sim_id *id)
{
    return sim_maybe(fd) && sim_identify(fd, id) && id->letter == sim_class_uevent.letter;
}

/* The requested groups select the messages. */
HOOK int bind(int fd, const struct sockaddr *address, socklen_t bytes)
{
    NEXT(int, bind, int, const struct sockaddr *, socklen_t);
    struct sockaddr_nl netlink;
    struct sim_id id;
    struct sim_exchange x;
    int result;

    if (!is_ours(fd, &id))
        return next(fd, address, bytes);
    if (bytes < sizeof(netlink)) {
        errno = EINVAL;
        return -1;
    }
    memcpy(&netlink, address, sizeof(netlink));
    x = (struct sim_exchange){ .call = { .op = SST_SIM_IOCTL, .handle = id.handle, .arg = netlink.nl_groups },
                               .send_fd = -1 };
    result = sim_exchange(&x);
    if (result < 0)
        errno = -result;
    return result < 0 ? -1 : 0;
}

/* A kernel filter matches hashes computed by udev. libudev filters again in user space, so it is ignored. */
HOOK int setsockopt(int fd, int level, int name, const void *value, socklen_t bytes)
{
    NEXT(int, setsockopt, int, int, int, const void *, socklen_t);
    struct sim_id id;

    if (level == SOL_SOCKET && name == SO_ATTACH_FILTER && is_ours(fd, &id))
        return 0;
    return next(fd, level, name, value, bytes);
}

/* Sender: root, through netlink, to the group that matches the message's format. */
static void dress(struct msghdr *msg, ssize_t bytes)
{
    struct sockaddr_nl sender = { .nl_family = AF_NETLINK };
    const bool by_udev = msg->msg_iovlen > 0 && bytes >= 8 && msg->msg_iov[0].iov_len >= 8 &&
                         memcmp(msg->msg_iov[0].iov_base, "libudev", 8) == 0;

    sender.nl_groups = by_udev ? 2 : 1;
    sender.nl_pid = by_udev ? 1 : 0;
    if (msg->msg_name && msg->msg_namelen >= sizeof(sender))
        memcpy(msg->msg_name, &sender, sizeof(sender));
    msg->msg_namelen = sizeof(sender);
    for (struct cmsghdr *c = CMSG_FIRSTHDR(msg); c; c = CMSG_NXTHDR(msg, c))
        if (c->cmsg_level == SOL_SOCKET && c->cmsg_type == SCM_CREDENTIALS) {
            struct ucred root;

            memcpy(&root, CMSG_DATA(c), sizeof(root));
            root.uid = 0;
            root.gid = 0;
            memcpy(CMSG_DATA(c), &root, sizeof(root));
        }
}

HOOK ssize_t recvmsg(int fd, struct msghdr *msg, int flags)
{
    NEXT(ssize_t, recvmsg, int, struct msghdr *, int);
    const socklen_t room = msg ? msg->msg_namelen : 0;
    struct sim_id id;
    ssize_t n;

    if (!is_ours(fd, &id))
        return next(fd, msg, flags);
    n = next(fd, msg, flags);
    if (n > 0) {
        msg->msg_namelen = room;
        dress(msg, n);
    }
    return n;
}

const struct sim_class sim_class_uevent = { .letter = 'n' };
