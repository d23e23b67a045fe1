#!/usr/bin/env bash
# mosquitto 2.0.11: a client whose connection dies without a reset (cable, power, NAT) and that connects again with another client id
# publishes `online`, retained. The broker notices the dead connection after one and a half keep-alives, publishes its will, `offline`,
# retained, and that stays although the client is connected. With the same client id the broker ends the old connection at once.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
. "$(dirname "$0")/../scripts/finding.sh"
unpack mosquitto=2.0.11-1.2+deb12u2 mosquitto-clients=2.0.11-1.2+deb12u2 libmosquitto1=2.0.11-1.2+deb12u2 libcjson1 libdlt2 libwrap0
cat >will.py <<'P'
import socket
import struct
import subprocess
import sys
import time

PORT = int(sys.argv[1])


def text(t):
    return struct.pack(">H", len(t)) + t


def connect(ident, keep_alive_s):
    """With a retained will of QoS 1."""
    c = socket.create_connection(("127.0.0.1", PORT))
    body = text(b"MQTT") + bytes([4, 0x2e]) + struct.pack(">H", keep_alive_s) + text(ident) + text(b"available") + text(b"offline")
    c.sendall(bytes([0x10, len(body)]) + body)
    assert c.recv(4)[3] == 0
    body = text(b"available") + b"online"
    c.sendall(bytes([0x31, len(body)]) + body)
    return c


def retained():
    return subprocess.run(["mosquitto_sub", "-p", str(PORT), "-t", "available", "-C", "1", "-W", "5"],
                          stdout=subprocess.PIPE, text=True).stdout.strip()


for first, second in ((b"one", b"two"), (b"one", b"one")):
    old = connect(first, 4)  # silent from here on, and open
    new = connect(second, 120)
    time.sleep(1)
    at_once = retained()
    time.sleep(20)
    print("other id" if first != second else "same id", "- at once:", at_once, "- after 20 s:", retained())
    new.sendall(b"\xe0\0")
    old.close()
    new.close()
    time.sleep(1)
P
port=$((20000 + $$ % 10000))
printf 'listener %s 127.0.0.1\nallow_anonymous true\nuser root\n' $port >broker.conf
mosquitto -c broker.conf 2>log & sleep 2
/usr/bin/python3 will.py $port | tee seen
printf '%s\n' 'other id - at once: online - after 20 s: offline' 'same id - at once: online - after 20 s: online' >expected
holds "the will of a dead connection replaces what its successor published, unless it has the same id" cmp -s seen expected
# Seen: these two lines
