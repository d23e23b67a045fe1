#!/usr/bin/env bash
# OpenCV 4.6 (dnn): a Softmax of an ONNX file without the attribute `axis` runs over axis 1 in every opset. Since opset 13 the default is the
# last axis: a valid file with Softmax between two Transposes gives other numbers, without a word. Written out, the axis is respected.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
. "$(dirname "$0")/../scripts/finding.sh"
unpack libopencv-dnn406=4.6.0+dfsg-12 python3-opencv=4.6.0+dfsg-12
cat >axis.py <<'P'
import cv2
import numpy as np


def number(n):
    out = b""
    while n > 127:
        out, n = out + bytes([n & 127 | 128]), n >> 7
    return out + bytes([n])


def field(k, v):
    """Of a protocol buffer: a number or bytes."""
    return number(k << 3) + number(v) if isinstance(v, int) else number(k << 3 | 2) + number(len(v)) + v


def ints(name, values):
    return field(1, name) + b"".join(field(8, v) for v in values) + field(20, 7)


def node(kind, source, to, attribute=None):
    return field(1, field(1, source) + field(2, to) + field(3, to) + field(4, kind) + (field(5, attribute) if attribute else b""))


def value(name, shape):
    dims = b"".join(field(1, field(1, d)) for d in shape)
    return field(1, name) + field(2, field(1, field(1, 1) + field(2, dims)))


def net(axis):
    graph = (node(b"Transpose", b"x", b"a", ints(b"perm", [0, 2, 3, 1])) +
             node(b"Softmax", b"a", b"b", field(1, b"axis") + field(3, 3) + field(20, 2) if axis else None) +
             node(b"Transpose", b"b", b"y", ints(b"perm", [0, 3, 1, 2])) + field(2, b"g") +
             field(11, value(b"x", [1, 3, 48, 64])) + field(12, value(b"y", [1, 3, 48, 64])))
    return field(1, 7) + field(7, graph) + field(8, field(2, 13))


x = np.zeros((1, 3, 48, 64), np.float32)
x[0, 0], x[0, 1] = 1, 0.2
for axis in (False, True):
    n = cv2.dnn.readNetFromONNX(np.frombuffer(net(axis), np.uint8))
    n.setInput(x)
    print("axis written" if axis else "axis left out", *("%.4f" % v for v in n.forward()[0, :, 20, 30]))
P
PYTHONPATH=$root/usr/lib/python3/dist-packages /usr/bin/python3 axis.py | tee seen
printf '%s\n' 'axis left out 0.0208 0.0208 0.0208' 'axis written 0.5503 0.2473 0.2024' >expected
holds "a Softmax of opset 13 without an axis runs over axis 1" cmp -s seen expected
# Seen: these two lines; the standard says 0.5503 0.2473 0.2024 in both
