# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""JPEGs that a service recorded as differences from an earlier one (pipeline/image/jpeg_parts.h), joined with it, coefficient by coefficient."""
from .files import FormatError

_COMMENT = b"sst-parts "
_HEAD = len(_COMMENT) + 21
_RESTART = range(0xD0, 0xD8)
# ITU-T T.81, K.3: a DHT segment with the tables that frames of video leave out.
_K3 = bytes.fromhex(
    "ffc401a20000010501010101010100000000000000000102030405060708090a0b100002010303020403050504040000017d0102030004110512213141061351610722711432"
    "8191a1082342b1c11552d1f02433627282090a161718191a25262728292a3435363738393a434445464748494a535455565758595a636465666768696a737475767778797a83"
    "8485868788898a92939495969798999aa2a3a4a5a6a7a8a9aab2b3b4b5b6b7b8b9bac2c3c4c5c6c7c8c9cad2d3d4d5d6d7d8d9dae1e2e3e4e5e6e7e8e9eaf1f2f3f4f5f6f7f8"
    "f9fa0100030101010101010101010000000000000102030405060708090a0b110002010204040304070504040001027700010203110405213106124151076171132232810814"
    "4291a1b1c109233352f0156272d10a162434e125f11718191a262728292a35363738393a434445464748494a535455565758595a636465666768696a737475767778797a8283"
    "8485868788898a92939495969798999aa2a3a4a5a6a7a8a9aab2b3b4b5b6b7b8b9bac2c3c4c5c6c7c8c9cad2d3d4d5d6d7d8d9dae2e3e4e5e6e7e8e9eaf2f3f4f5f6f7f8f9fa"
)


class _Header:
    """Segments of a sequential JPEG with one scan, and where its entropy-coded data begin."""

    def __init__(self, data, name):
        self.name, self.data, at = name, data, 2
        self.tables, self.quant, self.comments, self.interval, self.frame = {}, b"", [], 0, None
        self._huffman(_K3[4:])
        if data[:2] != b"\xff\xd8":
            self.fault("is no JPEG")
        while True:
            while data[at:at + 1] == b"\xff" and data[at + 1:at + 2] == b"\xff":
                at += 1
            n = int.from_bytes(data[at + 2:at + 4], "big")
            mark, body = data[at + 1:at + 2], data[at + 4:at + 2 + n]
            if data[at:at + 1] != b"\xff" or n < 2 or len(body) != n - 2:
                self.fault("is damaged: its header ends early")
            mark, at = mark[0], at + 2 + n
            if mark == 0xDB:
                self.quant += b"\xff\xdb" + n.to_bytes(2, "big") + body
            elif mark == 0xC4:
                self._huffman(body)
            elif mark == 0xDD:
                self.interval = int.from_bytes(body[:2], "big")
            elif mark == 0xFE:
                self.comments.append(body)
            elif mark in (0xC0, 0xC1):
                self._frame(body)
            elif mark in range(0xC2, 0xD0):
                self.fault("is no sequential JPEG")
            elif mark == 0xDA:
                break
        if self.frame is None or len(body) != 4 + 2 * len(self.components) or body[0] != len(self.components):
            self.fault("has several scans, or no frame, which is not joined here; use `sst import recording`")
        self.scan = [(body[1 + 2 * i], body[2 + 2 * i] >> 4, body[2 + 2 * i] & 15) for i in range(body[0])]
        self.at = at

    def fault(self, what):
        raise FormatError(f"{self.name} {what}")

    def _huffman(self, body):
        while len(body) > 17:
            counts, lut, code, k = body[1:17], [(0, 0)] * 65536, 0, 17
            for length, count in enumerate(counts, 1):
                for value in body[k:k + count]:
                    low = code << 16 - length
                    if low >= 65536:
                        self.fault("is damaged: a Huffman table has too many codes")
                    lut[low:low + (1 << 16 - length)] = [(value, length)] * (1 << 16 - length)
                    code += 1
                k, code = k + count, code << 1
            self.tables[body[0]] = lut
            body = body[17 + sum(counts):]

    def _frame(self, body):
        if len(body) < 6 or len(body) != 6 + 3 * body[5] or body[0] != 8 or body[5] not in (1, 3):
            self.fault("is no JPEG of one or three components with 8 bits")
        self.frame, self.height, self.width = body, int.from_bytes(body[1:3], "big"), int.from_bytes(body[3:5], "big")
        self.components = [(body[6 + 3 * i], body[7 + 3 * i] >> 4, body[7 + 3 * i] & 15) for i in range(body[5])]
        most_h, most_v = (max(c[i] for c in self.components) for i in (1, 2))
        if not all(1 <= c[1] <= 4 and 1 <= c[2] <= 4 for c in self.components) or (body[5] == 1 and (most_h, most_v) != (1, 1)):
            self.fault("has sampling factors that are not joined here; use `sst import recording`")
        self.groups = -(-self.width // (8 * most_h)) * -(-self.height // (8 * most_v))


def _segments(h):
    """Entropy-coded data between restart markers, without stuffed bytes."""
    data, at, start, made = h.data, h.at, h.at, []
    while True:
        at = data.find(b"\xff", at)
        mark = data[at + 1] if 0 <= at < len(data) - 1 else 0xD9
        if mark == 0:
            at += 2
            continue
        made.append(data[start:at if at >= 0 else len(data)].replace(b"\xff\x00", b"\xff"))
        if mark not in _RESTART:
            return made
        at = start = at + 2


def _groups(h):
    """Blocks of each group (MCU): lists of (component, DC, ((zeros, value), ...))."""
    made, segments = [], _segments(h)
    order = []
    for ident, dc, ac in h.scan:
        index = next((i for i, c in enumerate(h.components) if c[0] == ident), None)
        if index is None or dc not in h.tables or 16 + ac not in h.tables:
            h.fault("is damaged: its scan names no component or table")
        order += [(index, h.tables[dc], h.tables[16 + ac])] * (h.components[index][1] * h.components[index][2])
    per = h.interval or h.groups
    for segment in segments:
        before, window, have, at = [0] * len(h.components), 0, 0, 0
        for _ in range(min(per, h.groups - len(made))):
            group = []
            for index, dc, ac in order:
                pairs, k, zeros = [], 0, 0
                while k < 64:
                    if have < 32:
                        window = (window & (1 << have) - 1) << 64 | int.from_bytes(segment[at:at + 8].ljust(8, b"\xff"), "big")
                        at, have = at + 8, have + 64
                    value, length = (ac if k else dc)[window >> have - 16 & 65535]
                    if not length or at > len(segment) + 24:
                        h.fault("is damaged: its picture has no known code")
                    have -= length
                    size = value & 15 if k else value
                    if k:
                        zeros = value >> 4
                        if not size:
                            if zeros != 15:
                                break
                            k += 16
                            continue
                        k += zeros
                    if size > 15 or k > 63:
                        h.fault("is damaged: a block has more than 64 coefficients")
                    level = 0
                    if size:
                        have -= size
                        level = window >> have & (1 << size) - 1
                        if level < 1 << size - 1:
                            level -= (1 << size) - 1
                    if k:
                        pairs.append((k, level))
                    else:
                        before[index] += level
                    k += 1
                group.append((index, before[index], pairs))
            made.append(group)
        if len(made) == h.groups:
            return made
    return h.fault("is damaged: its picture ends early")


def _codes():
    """Code and length of each symbol of K.3, by class and destination."""
    made, body = {}, _K3[4:]
    while body:
        codes, code, k = {}, 0, 17
        for length, count in enumerate(body[1:17], 1):
            for value in body[k:k + count]:
                codes[value] = code, length
                code += 1
            k, code = k + count, code << 1
        made[body[0]] = codes
        body = body[k:]
    return made


def _encode(groups, components):
    codes, words, before = _codes(), [], [0] * components
    put = words.append

    def number(level):
        size = abs(level).bit_length()
        return size, level + (1 << size) - 1 if level < 0 else level

    for group in groups:
        for index, dc, pairs in group:
            table, at = min(index, 1), 0
            size, rest = number(dc - before[index])
            before[index] = dc
            code, length = codes[table][size]
            put(format(code << size | rest, f"0{length + size}b"))
            for k, level in pairs:
                zeros = k - at - 1
                while zeros > 15:
                    put(format(codes[16 + table][0xF0][0], f"0{codes[16 + table][0xF0][1]}b"))
                    zeros -= 16
                size, rest = number(level)
                code, length = codes[16 + table][zeros << 4 | size]
                put(format(code << size | rest, f"0{length + size}b"))
                at = k
            if at < 63:
                put(format(codes[16 + table][0][0], f"0{codes[16 + table][0][1]}b"))
    text = "".join(words)
    text += "1" * (-len(text) % 8)
    return int(text, 2).to_bytes(len(text) // 8, "big").replace(b"\xff", b"\xff\x00")


def base_ns(parts, name):
    """Time of the frame that parts belong to, in ns since 1970."""
    for comment in _Header(parts, name).comments:
        if comment.startswith(_COMMENT) and comment[len(_COMMENT):_HEAD - 1].isdigit():
            return int(comment[len(_COMMENT):_HEAD - 1])
    raise FormatError(f"{name} has no mark of its parts")


def join(base, parts, name):
    """A whole JPEG of parts and the frame that they belong to. Raises FormatError."""
    b, p = _Header(base, name), _Header(parts, name)
    mask = next((c[_HEAD:] for c in p.comments if c.startswith(_COMMENT)), b"")
    if (b.width, b.height, b.components) != (p.width, p.height, p.components) or len(mask) != p.groups // 8 + 1:
        p.fault("does not belong to its earlier frame")
    where = {ident: i for i, (ident, _, _) in enumerate(p.components)}
    groups = [g if mask[i >> 3] >> (i & 7) & 1 else old for i, (g, old) in enumerate(zip(_groups(p), _groups(b)))]
    try:
        data = _encode(groups, len(p.components))
    except KeyError:
        raise FormatError(f"{name} is damaged: a coefficient is out of range") from None
    scan = bytes([len(p.scan)]) + b"".join(bytes([ident, 0x11 * min(where[ident], 1)]) for ident, _, _ in p.scan) + b"\0\x3f\0"
    return (b"\xff\xd8" + p.quant + b"\xff\xc0" + (len(p.frame) + 2).to_bytes(2, "big") + p.frame + _K3 +
            b"\xff\xda" + (len(scan) + 2).to_bytes(2, "big") + scan + data + b"\xff\xd9")
