/* GVCP action commands: one datagram exposes all cameras of a group. Layout: GigE Vision 2.0, 16.2 and 16.3.
 *
 *    0  0x42   1  flags   2  0x0100  4  bytes that follow   6  request id     (big-endian)
 *    8  device key       12  group key      16  group mask
 *   20  time of the action, 64 bits, if the highest flag is set
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <arpa/inet.h>
#include <errno.h>
#include <netinet/in.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "base/log.h"
#include "drivers/genicam/genicam_internal.h"

#define KEY            0x42
#define FLAG_SCHEDULED 0x80
#define FLAG_ACK       0x01
#define ACTION_CMD     0x0100
#define ACTION_ACK     0x0101
#define HEADER         8

static void put16(uint8_t *p, unsigned v)
{
    p[0] = (uint8_t)(v >> 8);
    p[1] = (uint8_t)v;
}

static void put32(uint8_t *p, uint32_t v)
{
    put16(p, v >> 16);
    put16(p + 2, v & 0xffff);
}

static unsigned get16(const uint8_t *p)
{
    return (unsigned)p[0] << 8 | p[1];
}

size_t genicam_action_write(uint8_t out[GENICAM_ACTION_MAX], const struct sst_genicam_action *a, uint64_t at_ns,
                            uint16_t id)
{
    const size_t bytes = HEADER + 12 + (at_ns ? 8 : 0);

    out[0] = KEY;
    out[1] = FLAG_ACK | (at_ns ? FLAG_SCHEDULED : 0);
    put16(out + 2, ACTION_CMD);
    put16(out + 4, (unsigned)(bytes - HEADER));
    put16(out + 6, id);
    put32(out + 8, a->device_key);
    put32(out + 12, a->group_key);
    put32(out + 16, a->group_mask);
    if (at_ns) {
        put32(out + 20, (uint32_t)(at_ns >> 32));
        put32(out + 24, (uint32_t)at_ns);
    }
    return bytes;
}

/* status, 0x0101, bytes that follow, id of the request */
int genicam_action_read(const uint8_t *data, size_t bytes, uint16_t *id)
{
    if (bytes < HEADER || get16(data + 2) != ACTION_ACK)
        return GENICAM_ACTION_NONE;
    *id = (uint16_t)get16(data + 6);
    return (int)get16(data);
}

int genicam_action_open(void)
{
    const int fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0), on = 1;

    if (fd < 0 || setsockopt(fd, SOL_SOCKET, SO_BROADCAST, &on, sizeof(on))) {
        const int err = -errno;

        sst_log_error("cannot open a socket for action commands: %s", strerror(-err));
        if (fd >= 0)
            close(fd);
        return err;
    }
    return fd;
}

/* Scheduled time by the clock of the first camera that is synchronised: all cameras have the master's time. */
static uint64_t scheduled_ns(struct sst_genicam *g, int64_t t_ns)
{
    int64_t at_ns = 0;

    for (int i = 0; i < g->cfg.cameras && !at_ns; i++) {
        struct genicam_camera *cam = &g->camera[i];

        pthread_mutex_lock(&cam->lock);
        if (!strcmp(cam->ptp.role, "Slave"))
            (void)genicam_clock_there(&cam->clock, t_ns + (int64_t)g->cfg.action.delay_us * 1000, &at_ns);
        pthread_mutex_unlock(&cam->lock);
    }
    return at_ns > 0 ? (uint64_t)at_ns : 0;
}

void genicam_action_send(struct sst_genicam *g, int64_t t_ns)
{
    struct sockaddr_in to = { .sin_family = AF_INET, .sin_port = htons(GENICAM_GVCP_PORT) };
    const uint64_t at_ns = g->cfg.action.delay_us > 0 ? scheduled_ns(g, t_ns) : 0;
    uint8_t data[GENICAM_ACTION_MAX];
    uint64_t failed;
    size_t bytes;
    int err = 0;

    (void)inet_pton(AF_INET, g->cfg.action.address, &to.sin_addr); /* checked by open */
    pthread_mutex_lock(&g->lock);
    if (!++g->action_id)
        g->action_id = 1;
    bytes = genicam_action_write(data, &g->cfg.action, at_ns, g->action_id);
    if (sendto(g->action_fd, data, bytes, 0, (const struct sockaddr *)&to, sizeof(to)) != (ssize_t)bytes)
        err = errno;
    g->actions.sent += !err;
    failed = g->actions.failed += err != 0;
    pthread_mutex_unlock(&g->lock);
    if (err && failed == 1)
        sst_log_error("action command to %s: %s; check genicam: action_address, the broadcast address of the cameras' "
                      "network",
                      g->cfg.action.address, strerror(err));
}

void genicam_action_receive(struct sst_genicam *g)
{
    uint8_t data[64];
    ssize_t n;

    while ((n = recv(g->action_fd, data, sizeof(data), 0)) >= 0) {
        uint16_t id;
        const int status = genicam_action_read(data, (size_t)n, &id);
        bool first;

        if (status == GENICAM_ACTION_NONE)
            continue;
        pthread_mutex_lock(&g->lock);
        g->actions.acknowledged += status == 0;
        g->actions.refused += status != 0;
        first = status != 0 && g->actions.refused == 1;
        pthread_mutex_unlock(&g->lock);
        if (first)
            sst_log_warning("action command %u: a camera refuses it, GVCP status 0x%04x: check genicam: device_key, "
                            "group_key and group_mask, and its PTP clock if genicam: action_delay_us is set",
                            id, (unsigned)status);
    }
}
