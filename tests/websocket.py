# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""A WebSocket client (RFC 6455) with the standard library alone, which can misbehave; and the H.264 that the service sends over it."""
import base64
import hashlib
import json
import os
import socket
import struct

GUID = b"258EAFA5-E914-47DA-95CA-C5AB0DC85B11"
TEXT, BINARY, CLOSE, PING, PONG = 1, 2, 8, 9, 10


class Refused(Exception):
    """The handshake was answered otherwise: status, text."""


class Closed(Exception):
    """The service closed: code, reason."""


class Socket:
    def __init__(self, port, path, headers=None, key=None, wrap=lambda s: s):
        self.key = key or base64.b64encode(os.urandom(16)).decode()
        self.sock = wrap(socket.create_connection(("127.0.0.1", port), 60))
        fields = {"Host": f"127.0.0.1:{port}", "Upgrade": "websocket", "Connection": "keep-alive, Upgrade", "Sec-WebSocket-Version": "13",
                  "Sec-WebSocket-Key": self.key, **(headers or {})}
        lines = "".join(f"{name}: {value}\r\n" for name, value in fields.items() if value is not None)
        self.sock.sendall(f"GET {path} HTTP/1.1\r\n{lines}\r\n".encode())
        self.data = b""
        self.pong = True  # pings are answered
        while b"\r\n\r\n" not in self.data:
            self.more()
        head, self.data = self.data.split(b"\r\n\r\n", 1)
        self.head = head.decode()
        status = int(self.head.split()[1])
        if status != 101:
            raise Refused(status, self.head)
        accept = base64.b64encode(hashlib.sha1(self.key.encode() + GUID).digest()).decode()
        assert f"sec-websocket-accept: {accept}".lower() in self.head.lower(), self.head

    def more(self):
        try:
            data = self.sock.recv(1 << 16)
        except ConnectionResetError:
            data = b""
        if not data:
            raise Closed(0, "without a word")
        self.data += data

    def take(self, count):
        while len(self.data) < count:
            self.more()
        data, self.data = self.data[:count], self.data[count:]
        return data

    def frame(self):
        """(opcode, payload) of any frame."""
        first, second = self.take(2)
        assert first & 0xf0 == 0x80 and second < 128, "a frame in pieces, with reserved bits or masked"
        length = second
        if length == 126:
            length, = struct.unpack(">H", self.take(2))
        elif length == 127:
            length, = struct.unpack(">Q", self.take(8))
        return first & 15, self.take(length)

    def message(self):
        """(opcode, payload) of text or binary; pings are answered."""
        while True:
            op, data = self.frame()
            if op == PING and self.pong:
                self.send(PONG, data)
            elif op == CLOSE:
                raise Closed(struct.unpack(">H", data[:2])[0], data[2:].decode())
            elif op in (TEXT, BINARY):
                return op, data

    def picture(self):
        """{us, set, key, data, ...the description} of the next picture."""
        op, data = self.message()
        while op == TEXT:
            self.info = json.loads(data)
            op, data = self.message()
        us, number, flags = struct.unpack(">QQI", data[:20])
        return {**self.info, "us": us, "set": number, "key": flags & 1 == 1, "data": data[20:]}

    def send(self, op, data=b"", first=0x80, mask=b"\1\2\3\4", length=None):
        length = len(data) if length is None else length
        head = bytes([first | op, (0x80 if mask else 0) | length])
        body = bytes(b ^ mask[i % 4] for i, b in enumerate(data)) if mask else data
        self.sock.sendall(head + (mask or b"") + body)

    def close_code(self):
        """Code with which the service closes."""
        try:
            while True:
                self.message()
        except Closed as e:
            return e.args[0]

    def close(self):
        self.sock.close()
