#!/usr/bin/env bash
# libmodbus 3.1.6, Modbus RTU, error recovery off (the default): a reply later than the response time-out stays in the tty's input, and
# the next read of the same unit and number of registers returns it at once, without an error. Its own reply is left for the request after
# it: all later readings are those of the request before. An RTU reply bears no address by which it could be told. Discarding
# the input before each request (modbus_flush) prevents it where the reply has come by then.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
. "$(dirname "$0")/../scripts/finding.sh"
unpack libmodbus5=3.1.6-2.1+deb12u1 libmodbus-dev=3.1.6-2.1+deb12u1
cat >late.c <<'C'
/* A master and a slave on a pair of pseudo-terminals: each register's value is its address, and the first reply is late. */
#define _GNU_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <modbus/modbus.h>
#include <pthread.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

static int line;

static void append_crc(uint8_t *frame, int n)
{
    unsigned c = 0xFFFF;

    for (int i = 0; i < n; i++) {
        c ^= frame[i];
        for (int bit = 0; bit < 8; bit++)
            c = c & 1 ? c >> 1 ^ 0xA001 : c >> 1;
    }
    frame[n] = (uint8_t)c;
    frame[n + 1] = (uint8_t)(c >> 8);
}

static void *slave(void *arg)
{
    uint8_t ask[8], reply[7];

    for (int n = 0, late = 1; read(line, ask + n, 1) == 1;) {
        if (++n < 8)
            continue;
        n = 0;
        if (late)
            usleep(450000);
        late = 0;
        reply[0] = ask[0];
        reply[1] = 3;
        reply[2] = 2;
        reply[3] = ask[2];
        reply[4] = ask[3];
        append_crc(reply, 5);
        if (write(line, reply, 7) != 7)
            break;
    }
    return NULL;
}

int main(void)
{
    pthread_t thread;
    modbus_t *m;
    uint16_t value;

    line = posix_openpt(O_RDWR | O_NOCTTY);
    if (line < 0 || grantpt(line) || unlockpt(line))
        return 2;
    m = modbus_new_rtu(ptsname(line), 19200, 'N', 8, 1);
    modbus_set_slave(m, 1);
    modbus_set_response_timeout(m, 0, 200000);
    if (modbus_connect(m) || pthread_create(&thread, NULL, slave, NULL))
        return 2;
    for (int address = 101; address <= 105; address++) {
        const int n = modbus_read_registers(m, address, 1, &value);

        if (n == 1) {
            printf("register %d: %d\n", address, value);
            continue;
        }
        printf("register %d: %s\n", address, modbus_strerror(errno));
        usleep(500000); /* the line is silent, and the late reply is there */
    }
    return 0;
}
C
compile late -lmodbus -lpthread
./late | tee seen
holds "all readings after a late reply are those of the request before" \
  awk -F '[ :]+' 'NR > 1 && $3 != $2 - 1 { bad = 1 } END { exit bad || NR != 5 }' seen
# Seen: register 101: Connection timed out, then 102: 101, 103: 102, 104: 103, 105: 104
