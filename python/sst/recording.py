# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""Recordings of an array: sets of frames, each camera's bytes as they came (docs/integrate/recordings.md)."""
import os
import zlib
from dataclasses import dataclass

import numpy as np

from .files import Fields, FormatError, absent, parse_json, read_bytes
from .jpeg_parts import base_ns, join
from .pictures import check_size, decode_picture

_MOST_JSON = 4 << 20
_MOST_LINE = 1024 + 256 * 192
_COLUMNS = ["cam", "sequence", "lost_before", "from_set_ns", "arrival_ns", "offset", "bytes", "stride", "faults", "crc32"]
_BAYER = {"RGGB": (0, 0), "GRBG": (1, 0), "GBRG": (0, 1), "BA81": (1, 1)}  # column and row of the red sample
_BAD, _PARTS = 127, 256
_MOST_OFFSET, _MOST_STRIDE = 1 << 62, 1 << 20
_SAME_NS = 1000        # between a base's time and that of its set
_BACK_NS = 10 * 10**9  # by which the wall clock may have been set while it was searched
_FAULTS = ("flagged by the driver", "empty", "short", "no JPEG start", "no JPEG end", "broken JPEG", "time stamp backwards", "frozen", "parts",
           "time of arrival", "another size")


@dataclass(frozen=True)
class Frame:
    """One camera's frame of a set.

    camera (row, col); t_ns (CLOCK_MONOTONIC of the recording machine, start of exposure); arrival_ns; sequence and lost_before of the driver;
    faults (bits, docs/integrate/recordings.md); data: the bytes as they came; pixel_format, width, height, stride (bytes; 0: compressed or
    without padding).
    """
    camera: tuple
    t_ns: int
    arrival_ns: int
    sequence: int
    lost_before: int
    faults: int
    data: bytes
    pixel_format: str
    width: int
    height: int
    stride: int
    name: str  # for messages
    base: bytes = None  # JPEG of the earlier frame, where `data` has the differences from it alone (faults 256)

    def __repr__(self):
        return f"<sst.Frame {self.name}: {self.pixel_format} {self.width} x {self.height}, {len(self.data)} bytes>"

    @property
    def good(self):
        """False: the driver or the recorder found a fault in it."""
        return not self.faults & _BAD

    def _fault(self, what):
        raise FormatError(f"{self.name} {what}")

    def raw(self):
        """Samples as the camera sent them: (height, width) uint8 (GREY, Bayer) or uint16 (Y16), (height, width, 2) uint8 (YUYV: luma and
        chroma), (height, width, 3) uint8 (RGB3). Raises FormatError: a JPEG, or fewer bytes than its size needs."""
        bytes_of = {"GREY": 1, "Y16": 2, "YUYV": 2, "RGB3": 3, **{k: 1 for k in _BAYER}}
        if self.pixel_format not in bytes_of:
            self._fault(f"is {self.pixel_format}, which has no raw samples; use rgb()")
        row = self.width * bytes_of[self.pixel_format]
        stride = self.stride or row
        if stride < row or len(self.data) < stride * (self.height - 1) + row:
            self._fault(f"has {len(self.data)} bytes, fewer than {self.width} x {self.height} pixels need")
        padded = self.data[:stride * self.height].ljust(stride * self.height, b"\0")
        rows = np.frombuffer(padded, np.uint8).reshape(self.height, stride)[:, :row]
        if self.pixel_format == "Y16":
            return np.ascontiguousarray(rows).view("<u2").astype(np.uint16)
        planes = bytes_of[self.pixel_format]
        return np.ascontiguousarray(rows.reshape(self.height, self.width, planes) if planes > 1 else rows)

    def jpeg(self):
        """A whole JPEG: `data`, or where it has only differences from an earlier frame (faults 256) joined with that one. Raises FormatError:
        no JPEG, or the earlier frame is not there any more."""
        if self.pixel_format not in ("MJPG", "JPEG"):
            self._fault(f"is {self.pixel_format}, not JPEG")
        if not self.faults & _PARTS:
            return self.data
        if self.base is None:
            self._fault("has the differences from an earlier frame alone, which is not there any more")
        return join(self.base, self.data, self.name)

    def rgb(self):
        """Pixels: (height, width, 3) uint8, of Y16 (height, width, 3) uint16.

        The values of `sst import recording`: Bayer by Malvar, He and Cutler (2004), YUYV by BT.601 in limited range, JPEG by Pillow. Raises
        FormatError.
        """
        if self.pixel_format in ("MJPG", "JPEG"):
            made = decode_picture(self.jpeg(), self.name)
            if made.shape[:2] != (self.height, self.width):
                self._fault(f"has {made.shape[1]} x {made.shape[0]} pixels, not {self.width} x {self.height}")
        else:
            made = self.raw()
            if self.pixel_format == "YUYV":
                return _yuyv(made)
            if self.pixel_format in _BAYER:
                return _demosaic(made, *_BAYER[self.pixel_format])
        return np.repeat(made[..., None], 3, 2) if made.ndim == 2 else made


def _yuyv(raw):
    if raw.shape[1] % 2:
        raise FormatError("a frame of YUYV has an odd width")
    luma = 76309 * (raw[..., 0].astype(np.int64) - 16)
    chroma = [raw[:, i::2, 1].astype(np.int64) for i in (0, 1)]
    twice = []
    for c in chroma:  # odd columns: the mean of both neighbours
        full = np.repeat(2 * c, 2, 1)
        full[:, 1:-1:2] = c[:, :-1] + c[:, 1:]
        twice.append(full - 256)
    u2, v2 = twice
    rgb = np.stack([luma + 52299 * v2, luma - 12837 * u2 - 26639 * v2, luma + 66101 * u2], 2)
    return np.clip((rgb + 32768) >> 16, 0, 255).astype(np.uint8)


def _mirrored(n):
    i = np.arange(-2, n + 2)
    if n == 1:
        return np.zeros_like(i)
    i = np.abs(i) % (2 * (n - 1))
    return np.minimum(i, 2 * (n - 1) - i)


def _demosaic(raw, red_x, red_y):
    h, w = raw.shape
    p = raw.astype(np.int32)[_mirrored(h)][:, _mirrored(w)]

    def at(dx, dy):
        return p[2 + dy:2 + dy + h, 2 + dx:2 + dx + w]

    def byte(v):
        return np.clip((v + 8) >> 4, 0, 255)

    c, h1, v1 = at(0, 0), at(-1, 0) + at(1, 0), at(0, -1) + at(0, 1)
    h2, v2 = at(-2, 0) + at(2, 0), at(0, -2) + at(0, 2)
    diagonal = at(-1, -1) + at(1, -1) + at(-1, 1) + at(1, 1)
    green = byte(8 * c + 4 * (h1 + v1) - 2 * (h2 + v2))          # at red and blue samples
    other = byte(12 * c + 4 * diagonal - 3 * (h2 + v2))          # blue at red samples, red at blue ones
    beside = byte(10 * c + 8 * h1 - 2 * diagonal - 2 * h2 + v2)  # at green samples: the colour of their row ...
    above = byte(10 * c + 8 * v1 - 2 * diagonal - 2 * v2 + h2)   # ... and of their column
    red_col = (np.arange(w) % 2 == red_x)[None, :]
    red_row = (np.arange(h) % 2 == red_y)[:, None]
    coloured = red_col == red_row
    red = np.where(coloured, np.where(red_row, c, other), np.where(red_row, beside, above))
    blue = np.where(coloured, np.where(red_row, other, c), np.where(red_row, above, beside))
    return np.stack([red, np.where(coloured, green, c), blue], 2).astype(np.uint8)


class Recording:
    """A recording: `len(recording)` sets, counted from 0 in the order of recording, as `sst import recording --sets`.

    rows, cols, width, height, rate_hz (0: not known), spacing_mm (0: not known), pixel_format ("MJPG", "GREY", "Y16", "YUYV", "RGGB" ...)
    cameras       list of (row, col), by camera number; names beside it
    damaged       list of the sets whose lines of the manifest are damaged
    removed       number of sets that were removed from the beginning to make room
    """

    def __init__(self, path):
        """Open the recording in a folder and index its manifest. Raises FileNotFoundError, FormatError."""
        self.path = os.fsdecode(path)
        name = os.path.join(self.path, "recording.json")
        if not os.path.exists(name):
            raise absent(path, "recording", "recording.json")
        f = Fields(parse_json(read_bytes(name, _MOST_JSON), name), name)
        if f.text("format") != "sst-recording" or f.int("version", 1, 1000000) != 1:
            raise FormatError(f"{name} is not of a recording of version 1; update python3-sst")
        if f.list("frame_columns", 16) != _COLUMNS:
            f.fault("frame_columns", "has other names")
        self.rows, self.cols = f.int("rows", 1, 256), f.int("cols", 1, 256)
        self.width, self.height = f.int("width", 1, 32768), f.int("height", 1, 32768)
        check_size(self.width, self.height, name)
        self.rate_hz, self.spacing_mm = f.number("rate_hz", 0), f.number("spacing_mm", 0)
        self.pixel_format = f.text("pixel_format", 4)
        self.cameras, self.names = [], []
        for k, t in enumerate(f.objects("tracks", 256)):
            if t.int("cam", 0, 255) != k:
                t.fault("cam", "is not in order")
            self.cameras.append((t.int("row", 0, self.rows - 1), t.int("col", 0, self.cols - 1)))
            self.names.append(t.text("name", 255))
        if len(set(self.cameras)) != f.int("cameras", 1, 256):
            f.fault("cameras", "do not match the tracks")
        self.removed, before = self._removed()
        self._index(before)

    def _removed(self):
        name = os.path.join(self.path, "removed.json")
        if not os.path.exists(name):
            return 0, 0
        try:
            f = Fields(parse_json(read_bytes(name, 64 << 10), name), name)
            return f.int("sets", 0, 1 << 62), f.int("before_segment", 0, 999999)
        except FormatError:  # sets before the first present segment were removed
            there = [int(n[:6]) for n in os.listdir(os.path.join(self.path, "segments")) if len(n) == 10 and n.endswith(".mkv") and n[:6].isdigit()]
            return 0, min(there, default=0)

    def _index(self, before):
        """Places of the sets' lines. A torn end, where a recorder was killed or is writing, is no set."""
        lines, segment, session, good, at = [], -1, 0, 0, 0
        name = os.path.join(self.path, "sets.jsonl")
        if not os.path.isfile(name):
            raise FormatError(f"{self.path} is not whole: it has no sets.jsonl")
        with open(name, "rb") as f:
            while line := f.readline(_MOST_LINE):
                n = len(line)
                while line[-1:] != b"\n" and (more := f.readline(1 << 20)):  # a line that no recorder writes
                    line, n = more, n + len(more)
                if line[-1:] != b"\n":
                    break
                whole = n == len(line) and _whole(line[:-1])
                good = len(lines) if whole else good
                if whole and not line.startswith(b'{"set":'):
                    s = Fields(parse_json(line, name), name)
                    segment, session = s.int("segment", 0, 999999), s.int("session", 0, 1 << 31)
                elif not 0 <= segment < before:
                    lines.append((at, n, segment, session, not whole))
                    good = len(lines) if whole else good
                at += n
        self._lines = lines[:good]
        self.damaged = [i for i, line in enumerate(self._lines) if line[4]]

    def __len__(self):
        return len(self._lines)

    def set(self, i):
        """The line of set i of the manifest as a dict (docs/integrate/recordings.md), with `segment`, `session`, and `frames`: a dict of
        camera number to a dict of the columns. Raises IndexError, FormatError (the line is damaged)."""
        if not 0 <= i < len(self._lines):
            raise IndexError(f"{self.path} has no set {i}; they are numbered 0 to {len(self._lines) - 1}")
        at, n, segment, session, damaged = self._lines[i]
        name = os.path.join(self.path, "sets.jsonl")
        if damaged:
            raise FormatError(f"{name}: the line of set {i} is damaged")
        with open(name, "rb") as f:
            f.seek(at)
            line = f.read(n)
        if not _whole(line[:-1]):
            raise FormatError(f"{name}: the line of set {i} has changed")
        f = Fields(parse_json(line, name), name, f"set {i}: ")
        made = dict(f.obj, segment=segment, session=session, frames={})
        for k in ("set", "t_ns", "wall_ns", "spread_ns", "from_edge_ns"):
            f.int(k, -(1 << 63), (1 << 63) - 1)
        for row in f.list("frames", len(self.cameras)):
            if not isinstance(row, list) or len(row) != len(_COLUMNS) or any(type(v) is not int for v in row):
                f.fault("frames", "has a row that is not ten whole numbers")
            frame = dict(zip(_COLUMNS, row))
            if (not 0 <= frame["cam"] < len(self.cameras) or frame["cam"] in made["frames"] or not 0 <= frame["bytes"] < 1 << 31 or
                    not (0 if frame["bytes"] else -1) <= frame["offset"] < _MOST_OFFSET or not 0 <= frame["stride"] <= _MOST_STRIDE):
                f.fault("frames", "has a row with numbers out of range")
            made["frames"][frame["cam"]] = frame
        return made

    def _camera(self, camera):
        if isinstance(camera, tuple):
            if camera not in self.cameras:
                raise KeyError(f"{self.path} has no camera in row {camera[0]}, column {camera[1]}")
            return self.cameras.index(camera)
        if not 0 <= camera < len(self.cameras):
            raise KeyError(f"{self.path} has no camera {camera}; they are numbered 0 to {len(self.cameras) - 1}")
        return camera

    def frame(self, i, camera):
        """Frame of a camera, its number or (row, col), in set i, its bytes compared with their checksum; None: the set lacks it.

        Raises IndexError, KeyError, FormatError (the bytes are damaged, or not there).
        """
        camera = self._camera(camera)
        made = self.set(i)
        f = made["frames"].get(camera)
        if f is None or f["bytes"] == 0:
            return None
        segment = os.path.join(self.path, "segments", f"{made['segment']:06d}.mkv")
        name = f"set {i}, camera r{self.cameras[camera][0]}c{self.cameras[camera][1]} of {self.path}"
        if not os.path.isfile(segment):
            raise FormatError(f"{name}: {segment} is not there")
        with open(segment, "rb") as file:
            file.seek(f["offset"])
            data = file.read(min(f["bytes"], max(0, os.path.getsize(segment) - f["offset"])))
        if len(data) != f["bytes"] or zlib.crc32(data) != f["crc32"]:
            raise FormatError(f"{name} is damaged: its bytes are missing or differ from their checksum")
        t = made["t_ns"] + f["from_set_ns"]
        base = self._base(i, camera, base_ns(data, name)) if f["faults"] & _PARTS else None
        return Frame(self.cameras[camera], t, t + f["arrival_ns"], f["sequence"], f["lost_before"], f["faults"], data, self.pixel_format, self.width,
                     self.height, f["stride"], name, base)

    def _base(self, i, camera, wall_ns):
        """Bytes of the whole frame of a moment before set i: at most a minute of sets lies between. None: it is not there."""
        for k in range(i - 1, -1, -1):
            if self._lines[k][4]:
                continue
            other = self.set(k)
            if abs(other["wall_ns"] - wall_ns) <= _SAME_NS:
                f = other["frames"].get(camera)
                return self.frame(k, camera).data if f and not f["faults"] & _PARTS else None
            if other["wall_ns"] < wall_ns - _BACK_NS:
                return None
        return None

    def frames(self, i):
        """Frames of set i by (row, col); cameras without one are left out. Raises as frame()."""
        made = ((c, self.frame(i, k)) for k, c in enumerate(self.cameras))
        return {c: f for c, f in made if f is not None}

    def time(self, i):
        """Time of set i, float64 seconds since 1970 (UTC). Raises as set()."""
        return self.set(i)["wall_ns"] / 1e9

    def __repr__(self):
        return f"<sst.Recording {self.path}: {len(self)} sets of {len(self.cameras)} cameras, {self.width} x {self.height} {self.pixel_format}>"


def _whole(line):
    """Whether a line without its end has the checksum that it ends with."""
    return len(line) > 18 and line[-18:] == b',"crc":"%08x"}' % zlib.crc32(line[:-18])
