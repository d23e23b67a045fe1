# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""Calibrations of arrays: calib.yaml of sst. `sst calibration convert` makes one of other programs' files."""
import re
from dataclasses import dataclass, field

import numpy as np

from .files import FormatError, read_bytes

_MOST_BYTES = 64 << 20
_MOST_WITHIN = 8
_TOP = {"format", "version", "created", "source", "board", "rows", "cols", "width", "height", "reference", "rig", "range_mm", "noise_px", "cameras"}
_CAMERA = {"row", "col", "name", "focal_px", "centre_px", "distortion", "rotation", "position_mm", "gain", "falloff", "quality"}


@dataclass(frozen=True)
class Camera:
    """A lens and a pose; pixels with centres on whole numbers, axes x right, y down, z forward, mm.

    fx, fy, cx, cy    px
    distortion        (0,), (5,) or (8,) float64: k1 k2 p1 p2 k3 k4 k5 k6, OpenCV's model
    rotation          (3, 3) float64; position_mm (3,): P = rotation @ (X - position_mm)
    """
    name: str
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: np.ndarray
    rotation: np.ndarray
    position_mm: np.ndarray
    gain: np.ndarray = field(default_factory=lambda: np.ones(3))
    falloff: np.ndarray = field(default_factory=lambda: np.zeros(3))

    @property
    def matrix(self):
        """(3, 3) float64: the pinhole's matrix."""
        return np.array([[self.fx, 0, self.cx], [0, self.fy, self.cy], [0, 0, 1.0]])

    def project(self, points_mm):
        """Pixels (n, 2) float64 of points (n, 3) in mm; NaN of points that are not in front of the camera."""
        p = (np.asarray(points_mm, float).reshape(-1, 3) - self.position_mm) @ self.rotation.T
        k1, k2, p1, p2, k3, k4, k5, k6 = np.concatenate([self.distortion, np.zeros(8 - len(self.distortion))])
        with np.errstate(divide="ignore", invalid="ignore"):
            a, b = p[:, 0] / p[:, 2], p[:, 1] / p[:, 2]
            r2 = a * a + b * b
            s = (1 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1 + r2 * (k4 + r2 * (k5 + r2 * k6)))
            x = self.fx * (a * s + 2 * p1 * a * b + p2 * (r2 + 2 * a * a)) + self.cx
            y = self.fy * (b * s + p1 * (r2 + 2 * b * b) + 2 * p2 * a * b) + self.cy
        made = np.stack([x, y], 1)
        made[~(p[:, 2] > 0)] = np.nan
        return made


class _Yaml:
    """The subset that calib.yaml uses: mappings by indentation, lists of mappings, flow lists and mappings, plain and quoted scalars."""

    def __init__(self, text, name):
        self.name, self.lines = name, []
        flow, first, depth = [], 0, 0
        for n, line in enumerate(text.splitlines(), 1):
            line = self._uncommented(line).rstrip()
            if not line.strip() or line in ("---", "...") or line.startswith("%"):
                continue
            first = first if flow else n
            flow.append(line.strip() if flow else line)
            depth += self._depth(line)
            if depth <= 0:
                self.lines.append((first, " ".join(flow)))
                flow, depth = [], 0
        if flow:
            self.fault(first, "a list or mapping is not closed")
        self.at = 0

    def fault(self, line, what):
        raise FormatError(f"{self.name}:{line}: {what}; calibrate again or correct it")

    @staticmethod
    def _split(line):
        """Characters outside quotes, with their places."""
        quote, i = "", 0
        while i < len(line):
            c = line[i]
            if quote:
                if c == "\\" and quote == '"':
                    i += 1
                elif c == quote:
                    quote = ""
            elif c in "\"'":
                quote = c
            else:
                yield i, c
            i += 1

    def _uncommented(self, line):
        for i, c in self._split(line):
            if c == "#" and (i == 0 or line[i - 1] in " \t"):
                return line[:i]
        return line

    def _depth(self, text):
        return sum((c in "[{") - (c in "]}") for _, c in self._split(text))

    def scalar(self, text, line):
        if text[:1] == '"':
            if len(text) < 2 or text[-1] != '"':
                self.fault(line, "a text is not closed")
            return re.sub(r"\\(.)", r"\1", text[1:-1])
        if text[:1] == "'":
            return text[1:-1].replace("''", "'")
        if text in ("true", "false"):
            return text == "true"
        if re.fullmatch(r"[-+]?\d{1,18}", text):
            return int(text)
        try:
            return float(text) if re.fullmatch(r"[-+]?[0-9.]{1,40}([eE][-+]?\d{1,4})?", text) else text
        except ValueError:
            return text

    def value(self, text, line, within=0):
        text = text.strip()
        if text[:1] not in ("[", "{"):
            return self.scalar(text, line)
        if within == _MOST_WITHIN:
            self.fault(line, "lists lie too deep in one another")
        if text[-1] != {"[": "]", "{": "}"}[text[0]]:
            self.fault(line, "a list or mapping is not closed")
        inner, parts, start, depth = text[1:-1], [], 0, 0
        for i, c in self._split(inner):
            depth += (c in "[{") - (c in "]}")
            if c == "," and depth == 0:
                parts.append(inner[start:i])
                start = i + 1
        parts.append(inner[start:])
        parts = [p for p in parts if p.strip()]
        if text[0] == "[":
            return [self.value(p, line, within + 1) for p in parts]
        return self.pairs([(line, *self.key(p.strip(), line)) for p in parts], within + 1)

    def pairs(self, items, within=0):
        made = {}
        for line, key, value in items:
            if key in made:
                self.fault(line, f"key `{key}` occurs twice")
            made[key] = self.value(value, line, within) if isinstance(value, str) else value
        return made

    def key(self, text, line):
        for i, c in self._split(text):
            if c == ":" and (i + 1 == len(text) or text[i + 1] in " \t"):
                return text[:i].strip(), text[i + 1:].strip()
        self.fault(line, f"`{text[:40]}` is no key with a value")

    def mapping(self, indent, within=0):
        if within == _MOST_WITHIN:
            self.fault(self.lines[self.at - 1][0], "lists lie too deep in one another")
        items = []
        while self.at < len(self.lines):
            line, text = self.lines[self.at]
            own = len(text) - len(text.lstrip())
            if own < indent or text.lstrip().startswith("- "):
                break
            if own > indent:
                self.fault(line, "the indentation is wrong")
            key, value = self.key(text.strip(), line)
            self.at += 1
            items.append((line, key, value if value else self.sequence(indent, within)))
        return self.pairs(items)

    def sequence(self, indent, within):
        made = []
        while self.at < len(self.lines):
            line, text = self.lines[self.at]
            own = len(text) - len(text.lstrip())
            if own < indent or not text.lstrip().startswith("- "):
                break
            self.lines[self.at] = (line, " " * own + "  " + text.lstrip()[2:])
            made.append(self.mapping(own + len(text.lstrip()[2:]) - len(text.lstrip()[2:].lstrip()) + 2, within + 1))
        return made


class Calibration:
    """Cameras of an array, as `sst calibrate` writes them.

    rows, cols, width, height   grid; frames in px
    reference                   (row, col) of the camera whose axes are those of all
    cameras                     dict of (row, col) to Camera; cameras that are not known are absent
    range_mm, noise_px          working range and corner noise; 0: not known
    """

    def __init__(self, path):
        """Read calib.yaml, or the calibration of a light field's folder. Raises FileNotFoundError, FormatError (file:line)."""
        import os
        if os.path.isdir(path):
            path = os.path.join(path, "calibration.yaml")
        self.path = os.fsdecode(path)
        try:
            text = read_bytes(path, _MOST_BYTES).decode("utf-8-sig")
        except UnicodeDecodeError:
            raise FormatError(f"{path} is not a text in UTF-8") from None
        yaml = _Yaml(text, self.path)
        root = yaml.mapping(0)
        if yaml.at < len(yaml.lines):
            yaml.fault(yaml.lines[yaml.at][0], "is neither a key nor in a list")
        if root.get("format") != "sst-calib":
            raise FormatError(f"{path} is not a calibration of sst; `sst calibration convert` makes one of other programs' files")
        if root.get("version") != 1:
            raise FormatError(f"{path}: version {root.get('version')} is not 1, the one that this reader knows; update python3-sst")
        self._known(root, _TOP, "")
        self.rows, self.cols = self._int(root, "rows", 1, 256), self._int(root, "cols", 1, 256)
        self.width, self.height = self._int(root, "width", 1, 32768), self._int(root, "height", 1, 32768)
        reference = root.get("reference")
        if not isinstance(reference, list) or len(reference) != 2 or any(type(v) is not int for v in reference):
            raise FormatError(f"{path}: reference is not [row, column]")
        self.reference = tuple(reference)
        self.rig = root.get("rig", False) is True
        self.range_mm, self.noise_px = (self._number(root, k) for k in ("range_mm", "noise_px"))
        self.source = str(root.get("source", ""))
        self.cameras = {}
        cameras = root.get("cameras")
        if not isinstance(cameras, list) or not cameras:
            raise FormatError(f"{path}: cameras is missing or empty")
        for c in cameras:
            self._add(c)
        if self.reference not in self.cameras:
            raise FormatError(f"{path}: reference names no camera")

    def _known(self, mapping, keys, where):
        for key in mapping:
            if key not in keys:
                raise FormatError(f"{self.path}: {where}unknown key `{key}`")

    def _int(self, mapping, key, lo, hi):
        v = mapping.get(key)
        if type(v) is not int or not lo <= v <= hi:
            raise FormatError(f"{self.path}: {key} is not a whole number in {lo}..{hi}")
        return v

    def _number(self, mapping, key):
        v = mapping.get(key, 0)
        if type(v) not in (int, float) or not 0 <= v <= 1e12:
            raise FormatError(f"{self.path}: {key} is not a number in 0..1e12")
        return float(v)

    def _numbers(self, mapping, key, counts, default=None):
        v = mapping.get(key, default)
        if not isinstance(v, list) or len(v) not in counts or any(type(x) not in (int, float) or not abs(x) <= 1e12 for x in v):
            raise FormatError(f"{self.path}: {key} of a camera is not a list of {' or '.join(map(str, counts))} numbers")
        return np.array(v, dtype=np.float64)

    def _add(self, c):
        if not isinstance(c, dict):
            raise FormatError(f"{self.path}: a camera is no mapping")
        self._known(c, _CAMERA, "cameras: ")
        place = self._int(c, "row", 0, self.rows - 1), self._int(c, "col", 0, self.cols - 1)
        if place in self.cameras:
            raise FormatError(f"{self.path}: two cameras have row {place[0]}, col {place[1]}")
        fx, fy = self._numbers(c, "focal_px", (2,))
        cx, cy = self._numbers(c, "centre_px", (2,))
        rotation = self._numbers(c, "rotation", (9,)).reshape(3, 3)
        if not (fx > 0 and fy > 0) or np.abs(rotation @ rotation.T - np.eye(3)).max() > 1e-6 or np.linalg.det(rotation) < 0:
            raise FormatError(f"{self.path}: the camera of row {place[0]}, col {place[1]} has no positive focal length, or no rotation")
        self.cameras[place] = Camera(str(c.get("name", "")), fx, fy, cx, cy, self._numbers(c, "distortion", (0, 5, 8)), rotation,
                                     self._numbers(c, "position_mm", (3,)), self._numbers(c, "gain", (3,), [1, 1, 1]),
                                     self._numbers(c, "falloff", (3,), [0, 0, 0]))

    def __repr__(self):
        return f"<sst.Calibration {self.path}: {len(self.cameras)} cameras, {self.rows} x {self.cols}, {self.width} x {self.height}>"
