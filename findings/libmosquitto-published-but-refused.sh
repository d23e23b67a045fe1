#!/usr/bin/env bash
# libmosquitto and mosquitto 2.0.11: a message above the broker's max_packet_size (2,000,000 bytes by default from 2.1 on) is reported as
# published, by mosquitto_publish() and by on_publish(), and ends the connection. With QoS 1 the library sends it again after
# each reconnection, and each one ends. With MQTT 5 the broker states its limit and mosquitto_publish() refuses (25).
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
. "$(dirname "$0")/../scripts/finding.sh"
unpack mosquitto=2.0.11-1.2+deb12u2 libmosquitto1=2.0.11-1.2+deb12u2 libmosquitto-dev=2.0.11-1.2+deb12u2 libcjson1 libdlt2 libwrap0
cat >size.c <<'C'
#include <mosquitto.h>
#include <mqtt_protocol.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static int up, done;
static void on_connect(struct mosquitto *m, void *arg, int code, int flags, const mosquitto_property *p) { up = 1; }
static void on_publish(struct mosquitto *m, void *arg, int id, int code, const mosquitto_property *p) { done = 1; }

int main(int argc, char **argv)
{
    static char data[400000];

    mosquitto_lib_init();
    for (int i = 0; i < 4; i++) {
        const int v5 = i & 1, qos = i / 2;
        struct mosquitto *m = mosquitto_new(NULL, true, NULL);
        int publish = 0, lost = 0, err = 0;

        mosquitto_int_option(m, MOSQ_OPT_PROTOCOL_VERSION, v5 ? MQTT_PROTOCOL_V5 : MQTT_PROTOCOL_V311);
        mosquitto_connect_v5_callback_set(m, on_connect);
        mosquitto_publish_v5_callback_set(m, on_publish);
        done = 0;
        for (int round = 0; round < 3 && !(round && !err); round++) {
            up = 0;
            err = round ? mosquitto_reconnect_async(m) : mosquitto_connect_async(m, "127.0.0.1", atoi(argv[1]), 30);
            for (int k = 0; k < 100 && !up && !err; k++)
                err = mosquitto_loop(m, 100, 1);
            if (!round && up)
                publish = mosquitto_publish(m, NULL, "t", sizeof(data), data, qos, false);
            for (int k = 0; k < 20 && !err; k++)
                err = mosquitto_loop(m, 100, 1);
            lost += up && err == MOSQ_ERR_CONN_LOST;
        }
        printf("MQTT %s, QoS %d: publish returns %d, on_publish %d, connections lost %d\n", v5 ? "5" : "3.1.1", qos, publish, done, lost);
        mosquitto_destroy(m);
    }
    return 0;
}
C
compile size -lmosquitto
port=$((20000 + $$ % 10000))
printf 'listener %s 127.0.0.1\nallow_anonymous true\nmax_packet_size 300000\nuser root\n' $port >broker.conf
mosquitto -c broker.conf 2>log & sleep 2
./size $port | tee seen
holds "a refused message is reported as published with MQTT 3.1.1, and ends each connection with QoS 1" \
  awk -F '[ ,]+' '/3.1.1/ { bad += $7 != 0 || $12 < ($4 == "0:" ? 1 : 3) } /MQTT 5/ { bad += $7 == 0 || $12 != 0 } /3.1.1, QoS 0/ { bad += $9 != 1 } END { exit bad > 0 }' seen
# Seen: MQTT 3.1.1, QoS 0: publish returns 0, on_publish 1, connections lost 1; QoS 1: 0, 0, 3; MQTT 5: 25, 0, 0 in both
