/* tests/free_port.h - a port of the loopback that nobody has. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_TESTS_FREE_PORT_H
#define SST_TESTS_FREE_PORT_H

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include "tests/test.h"

/** @return a port that is free for TCP and UDP, below those that the kernel gives to clients: it stays free */
static inline int free_port(void)
{
    static unsigned at;
    int err = -1, number = 0;

    for (int i = 0; i < 1000 && err; i++) {
        const int tcp = socket(AF_INET, SOCK_STREAM, 0), udp = socket(AF_INET, SOCK_DGRAM, 0);
        struct sockaddr_in a = { .sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK) };

        number = 10000 + (int)((unsigned)getpid() * 7 + ++at) % 20000;
        a.sin_port = htons((uint16_t)number);
        err = bind(tcp, (struct sockaddr *)&a, sizeof(a)) || bind(udp, (struct sockaddr *)&a, sizeof(a));
        close(tcp);
        close(udp);
    }
    assert_int_equal(err, 0);
    return number;
}

#endif
