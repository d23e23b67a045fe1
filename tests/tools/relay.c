/* A network of one port between hosts on this machine, for tests without the rights that build/tests/tools/wire needs.
 *
 *   relay FROM_ADDRESS TO_ADDRESS PORT
 * hands on what comes to FROM_ADDRESS to TO_ADDRESS, TCP and UDP. Standard input says how, a line each: `udp 0` drops
 * all datagrams, `udp 1` none, `loss 0.05` that share of them, each on its own. It ends with its input, and prints how
 * many it has carried and lost. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE /* accept4() */
#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#define PAIRS 32
#define BYTES 65536

static struct {
    struct sockaddr_in from, to;
    int listen_fd, udp_fd;
    int tcp[PAIRS][2]; /* both ends of a connection; -1: unused */
    struct {
        struct sockaddr_in at;
        int fd; /* to TO_ADDRESS; -1: unused */
    } udp[PAIRS];
    double loss;
    unsigned long long carried, lost;
    char buffer[BYTES];
} r;

static void fail(const char *what)
{
    perror(what);
    exit(1);
}

static struct sockaddr_in address(const char *text, int port)
{
    struct sockaddr_in a = { .sin_family = AF_INET, .sin_port = htons((uint16_t)port) };

    if (inet_pton(AF_INET, text, &a.sin_addr) != 1)
        fail(text);
    return a;
}

static int open_socket(int type, const struct sockaddr_in *at, const struct sockaddr_in *peer)
{
    const int fd = socket(AF_INET, type | SOCK_CLOEXEC, 0), on = 1;

    if (fd < 0 || setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &on, sizeof(on)))
        fail("socket");
    if (at && bind(fd, (const struct sockaddr *)at, sizeof(*at)))
        fail("bind");
    if (peer && connect(fd, (const struct sockaddr *)peer, sizeof(*peer))) {
        close(fd);
        return -1;
    }
    return fd;
}

static void accept_one(void)
{
    const int fd = accept4(r.listen_fd, NULL, NULL, SOCK_CLOEXEC);

    for (int i = 0; fd >= 0 && i < PAIRS; i++)
        if (r.tcp[i][0] < 0) {
            r.tcp[i][1] = open_socket(SOCK_STREAM, NULL, &r.to);
            r.tcp[i][0] = r.tcp[i][1] < 0 ? -1 : fd;
            if (r.tcp[i][1] < 0)
                close(fd); /* no process has the port open */
            return;
        }
    if (fd >= 0)
        close(fd);
}

static void hand_on(int pair, int end)
{
    const ssize_t n = recv(r.tcp[pair][end], r.buffer, BYTES, 0);
    ssize_t sent = 0;

    while (n > 0 && sent < n) {
        const ssize_t s = send(r.tcp[pair][!end], r.buffer + sent, (size_t)(n - sent), MSG_NOSIGNAL);

        if (s <= 0)
            break;
        sent += s;
    }
    if (n > 0 && sent == n)
        return;
    for (int e = 0; e < 2; e++) {
        close(r.tcp[pair][e]);
        r.tcp[pair][e] = -1;
    }
}

static bool is_lost(void)
{
    const bool lost = drand48() < r.loss;

    r.lost += lost;
    r.carried += !lost;
    return lost;
}

/* From a host, whose answers come to a socket of its own. */
static void hand_on_datagram(void)
{
    struct sockaddr_in at = { 0 };
    socklen_t size = sizeof(at);
    const ssize_t n = recvfrom(r.udp_fd, r.buffer, BYTES, 0, (struct sockaddr *)&at, &size);
    int place = 0;

    while (place < PAIRS && r.udp[place].fd >= 0 && memcmp(&r.udp[place].at, &at, sizeof(at)) != 0)
        place++;
    if (n < 0 || is_lost())
        return;
    if (place == PAIRS) { /* the first one is long gone */
        place = 0;
        close(r.udp[0].fd);
        r.udp[0].fd = -1;
    }
    if (r.udp[place].fd < 0) {
        r.udp[place].fd = open_socket(SOCK_DGRAM, NULL, &r.to);
        r.udp[place].at = at;
    }
    (void)send(r.udp[place].fd, r.buffer, (size_t)n, MSG_NOSIGNAL);
}

static void hand_back_datagram(int place)
{
    const ssize_t n = recv(r.udp[place].fd, r.buffer, BYTES, 0);

    if (n >= 0 && !is_lost())
        (void)sendto(r.udp_fd, r.buffer, (size_t)n, 0, (const struct sockaddr *)&r.udp[place].at,
                     sizeof(r.udp[place].at));
}

static bool obey(void)
{
    char line[128];
    int udp;

    if (!fgets(line, sizeof(line), stdin))
        return false;
    (void)sscanf(line, "loss %lf", &r.loss);
    if (sscanf(line, "udp %d", &udp) == 1)
        r.loss = !udp;
    return true;
}

int main(int argc, char **argv)
{
    bool on = true;

    if (argc != 4) {
        fprintf(stderr, "usage: relay FROM_ADDRESS TO_ADDRESS PORT\n");
        return 2;
    }
    setvbuf(stdin, NULL, _IONBF, 0); /* poll() sees what was not read */
    r.from = address(argv[1], atoi(argv[3]));
    r.to = address(argv[2], atoi(argv[3]));
    r.listen_fd = open_socket(SOCK_STREAM, &r.from, NULL);
    r.udp_fd = open_socket(SOCK_DGRAM, &r.from, NULL);
    if (listen(r.listen_fd, PAIRS))
        fail("listen");
    for (int i = 0; i < PAIRS; i++)
        r.tcp[i][0] = r.tcp[i][1] = r.udp[i].fd = -1;
    puts("up");
    fflush(stdout);
    while (on) {
        struct pollfd fds[3 + 3 * PAIRS] = { { .fd = 0, .events = POLLIN },
                                             { .fd = r.listen_fd, .events = POLLIN },
                                             { .fd = r.udp_fd, .events = POLLIN } };

        for (int i = 0; i < PAIRS; i++) {
            fds[3 + i] = (struct pollfd){ .fd = r.udp[i].fd, .events = POLLIN };
            fds[3 + PAIRS + 2 * i] = (struct pollfd){ .fd = r.tcp[i][0], .events = POLLIN };
            fds[4 + PAIRS + 2 * i] = (struct pollfd){ .fd = r.tcp[i][1], .events = POLLIN };
        }
        if (poll(fds, 3 + 3 * PAIRS, -1) < 0)
            continue;
        for (int i = 0; i < 2 * PAIRS; i++)
            if (fds[3 + PAIRS + i].revents && r.tcp[i / 2][i % 2] == fds[3 + PAIRS + i].fd)
                hand_on(i / 2, i % 2);
        for (int i = 0; i < PAIRS; i++)
            if (fds[3 + i].revents)
                hand_back_datagram(i);
        if (fds[2].revents)
            hand_on_datagram();
        if (fds[1].revents)
            accept_one();
        if (fds[0].revents)
            on = obey();
    }
    printf("%llu carried, %llu lost\n", r.carried, r.lost);
    return 0;
}
