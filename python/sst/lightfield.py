# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""Light fields: lattices (views in rows and columns) and posed ones (a lens and a pose for every view)."""
import hashlib
import os
import struct

import numpy as np

from .calibration import Calibration, Camera
from .files import Fields, FormatError, absent, parse_json, read_bytes
from .pictures import MOST_BYTES, MOST_PIXELS, read_map, read_pfm, read_picture

_MOST_JSON = 4 << 20
_VERSIONS = (1, 2, 3)
_NONE = 65535   # disparity unknown
_STEPS = 64.0   # of a stored disparity per px


def open(path):  # noqa: A001
    """Open the light field in a folder. Pictures and maps are read when they are asked for, one at a time.

    Returns Lattice or Posed. Raises FileNotFoundError (no light field), FormatError (damaged, or newer than this reader).
    """
    path = os.fsdecode(path)
    name = os.path.join(path, "lightfield.json")
    if not os.path.exists(name):
        raise absent(path, "light field", "lightfield.json")
    f = Fields(parse_json(read_bytes(name, _MOST_JSON), name), name)
    if f.text("format") != "sst-lightfield":
        f.fault("format", 'is not "sst-lightfield"')
    version = f.int("version", 1, 1000000)
    if version not in _VERSIONS:
        raise FormatError(f"{name}: version {version} is newer than {_VERSIONS[-1]}, the newest that this reader knows; update python3-sst")
    return Posed(path, f) if "kind" in f else Lattice(path, f, version)


class _Folder:
    """Common parts: sizes and the files of the views."""

    def __init__(self, path, f):
        self.path = path
        self.width, self.height = f.int("width", 1, 32768), f.int("height", 1, 32768)
        if self.width * self.height > MOST_PIXELS:
            f.fault("width, height", "are too large")
        self.source, self.history = f.text("source"), f.text("history")
        self.samples = None
        if "samples" in f:
            self.samples = tuple(int(v) for v in f.numbers("samples", 2))
            if not 0 <= self.samples[0] < self.samples[1] <= 65535:
                f.fault("samples", "are not two ascending numbers in 0..65535")

    def _picture(self, file, sha256, verify, size):
        path = os.path.join(self.path, "views", file)
        made = read_picture(path, sha256 if verify else None)
        if made.shape[:2] != size:
            raise FormatError(f"{path} has {made.shape[1]} x {made.shape[0]} pixels, not {size[1]} x {size[0]}; make the light field again")
        return made


class Lattice(_Folder):
    """Rectified views in rows and columns.

    rows, cols, width, height
    views             list of (row, col) of the views that are present, row by row
    reference         (row, col) of the reference view
    offsets           dict of (row, col) to (2,) float64: right and down of the reference view, in spacings
    focal_px, spacing_mm, infinity_px   NaN: not known
    disparity_range   (least, largest) px per spacing, or None
    labels            list of names; the label of a pixel is its index, 0 is "unlabeled"
    ground            list of bool beside it: surfaces that run through many depths
    calibration       Calibration of the raw frames; None: views/ are rectified already
    correction        dict of (row, col) to a dict of displacements and gains that sst applies to the files
    truth             Truth of simulated scenes and benchmarks, or None
    """

    def __init__(self, path, f, version):
        super().__init__(path, f)
        self.rows, self.cols = f.int("rows", 1, 256), f.int("cols", 1, 256)
        if self.rows * self.cols > 256:
            f.fault("rows, cols", "make more than 256 views")
        if f.number("disp_steps_per_px") != _STEPS:
            f.fault("disp_steps_per_px", "is not 64")
        self.disp_min_px = f.number("disp_min_px", -32768, 32768)
        low, high = f.number("range_min_px", -32768, 32768), f.number("range_max_px", -32768, 32768)
        self.disparity_range = (low, high) if low < high else None
        self.focal_px, self.spacing_mm = (f.number(k, 0, 1e9) or np.nan for k in ("focal_px", "spacing_mm"))
        self.infinity_px = f.number("infinity_px", -32768, 32768) if "infinity_px" in f else 0.0 if "parallel" in f and f.bool("parallel") else np.nan
        self.off_centre_px = f.numbers("off_centre_px", 2) if "off_centre_px" in f else np.zeros(2)
        self.skew_us = f.number("skew_us", 0) if "skew_us" in f else 0.0
        self._read_views(f)
        classes = f.objects("classes", 64)
        self.labels = ["unlabeled"] + [c.text("name", 31) for c in classes]
        self.ground = [False] + [c.bool("ground") for c in classes]
        self.correction = {}
        for c in f.objects("correction", 256) if "correction" in f else ():
            self.correction[c.int("row", 0, self.rows - 1), c.int("col", 0, self.cols - 1)] = dict(c.obj)
        self.calibration = self._rectified = None
        if version > 1:
            self._read_calibration(Fields(f.get("calibration"), f.name, "calibration."))

    def _read_views(self, f):
        self.offsets, self._files = {}, {}
        for v in f.objects("views", 256):
            place = v.int("row", 0, self.rows - 1), v.int("col", 0, self.cols - 1)
            if place in self._files:
                v.fault("row, col", "occur twice")
            self.offsets[place] = np.array([v.number("bx", -1e4, 1e4), v.number("by", -1e4, 1e4)])
            self._files[place] = v.file("file"), v.sha256("sha256")
        self.views = sorted(self._files)
        if not self.views:
            f.fault("views", "is empty")
        middle = (self.rows - 1) // 2, (self.cols - 1) // 2
        self.reference = min(self.views, key=lambda p: ((p[0] - middle[0]) ** 2 + (p[1] - middle[1]) ** 2, p))

    def _read_calibration(self, f):
        path = os.path.join(self.path, f.file("file"))
        if hashlib.sha256(read_bytes(path, 64 << 20)).hexdigest() != f.sha256("sha256"):
            raise FormatError(f"{path} has changed since it was stored (its SHA-256 differs); rectify the light field again")
        self.calibration = Calibration(path)
        self._rectified = f.numbers("rotation", 9).reshape(3, 3), f.number("cx"), f.number("cy")
        self.infinity_px = 0.0

    def _place(self, view):
        try:
            row, col = place = tuple(view)
        except (TypeError, ValueError):
            raise TypeError(f"{view!r} is no view of a lattice; give (row, col), as in `views`") from None
        if place not in self._files:
            raise KeyError(f"{self.path} has no view in row {row}, column {col}")
        return place

    def image(self, view, verify=True):
        """Pixels of a view's file: (height, width, 3) or (height, width), uint8 or uint16.

        view is (row, col). With a calibration these are raw frames (of the calibration's size), and `correction` is not applied:
        `sst rectify --bake` and `sst export npz` write what the method sees. verify=False accepts files that were altered. Raises
        KeyError (no such view), FileNotFoundError, FormatError.
        """
        file, sha256 = self._files[self._place(view)]
        c = self.calibration
        return self._picture(file, sha256, verify, (c.height, c.width) if c else (self.height, self.width))

    def image8(self, view, verify=True):
        """image() with three channels of 8 bits; 16-bit levels scaled from `samples`, alike in all views, as sst does."""
        return to_8_bits(self.image(view, verify), self.samples)

    def _map(self, folder, view, dtype):
        path = os.path.join(self.path, folder, "%02d_%02d.png" % self._place(view))
        return read_map(path, dtype, (self.height, self.width)) if os.path.exists(path) else None

    def disparity(self, view):
        """Disparity of a view, (height, width) float32 in px per spacing, NaN where there is none; None: the view has no map.

        Depth in mm is focal_px * spacing_mm / (disparity - infinity_px).
        """
        stored = self._map("disparity", view, np.uint16)
        if stored is None:
            return None
        made = (self.disp_min_px + stored / _STEPS).astype(np.float32)
        made[stored == _NONE] = np.nan
        return made

    def confidence(self, view):
        """Confidence of the disparity, (height, width) uint8: 255 is 1; 0 where it was filled in. None: no map."""
        return self._map("confidence", view, np.uint8)

    def label(self, view, kind="labels"):
        """Labels of a view, (height, width) uint8, indices of `labels`; None: no map. kind: "labels", "labels_initial" (of the network
        alone) or "labels_hcsm" (the confident ones)."""
        if kind not in ("labels", "labels_initial", "labels_hcsm"):
            raise ValueError(f"kind {kind!r} is not labels, labels_initial or labels_hcsm")
        made = self._map(kind, view, np.uint8)
        if made is not None and made.max() >= len(self.labels):
            raise FormatError(f"{self.path}/{kind}: view {view} has a label beyond the class list; run `sst process` again")
        return made

    def depth_mm(self, view):
        """Depth along the optical axis, (height, width) float32 in mm, NaN where there is none. None: no map. Raises ValueError where the
        focal length, the spacing or the disparity of infinity is not known."""
        if not np.isfinite([self.focal_px, self.spacing_mm, self.infinity_px]).all():
            raise ValueError(f"{self.path}: focal length, spacing or the disparity of infinity is not known, so that there are no depths")
        d = self.disparity(view)
        if d is None:
            return None
        with np.errstate(divide="ignore"):
            made = (self.focal_px * self.spacing_mm / (d - self.infinity_px)).astype(np.float32)
        made[~(made > 0) | np.isinf(made)] = np.nan
        return made

    def camera(self, view):
        """Camera of the rectified view, with the axes and the place of the reference view as the world's. Raises ValueError where focal
        length or spacing is not known."""
        if not (self.focal_px > 0 and self.spacing_mm > 0):
            raise ValueError(f"{self.path}: focal length or spacing is not known, so that its cameras have no poses")
        b, infinity = self.offsets[self._place(view)], np.nan_to_num(self.infinity_px)
        if self._rectified:
            centre = np.array(self._rectified[1:])
        else:
            centre = (np.array([self.width, self.height]) - 1) / 2 + self.off_centre_px - b * infinity
        return Camera("%02d_%02d" % tuple(view), self.focal_px, self.focal_px, *centre, np.zeros(0), np.eye(3), np.array([*(b * self.spacing_mm), 0.0]))

    @property
    def truth(self):
        folder = os.path.join(self.path, "truth")
        return Truth(folder) if os.path.isdir(folder) else None

    def __repr__(self):
        return f"<sst.Lattice {self.path}: {len(self.views)} views of {self.width} x {self.height}, {self.rows} x {self.cols}>"


class Truth:
    """Truth of a simulated scene or benchmark."""

    def __init__(self, path):
        self.path = path

    def disparity(self, view):
        """True disparity of a view (row, col), (height, width) float32, NaN where it is not known."""
        return read_pfm(os.path.join(self.path, "%02d_%02d.pfm" % tuple(view)))

    def label(self, view):
        """True labels of a view, (height, width) uint8."""
        from .pictures import decode_png_map
        path = os.path.join(self.path, "%02d_%02d.png" % tuple(view))
        return decode_png_map(read_bytes(path, MOST_BYTES), path)

    def behind(self, name=""):
        """The reference view without its principal occluder, or without the one of this name: (height, width, 3) uint8."""
        return read_picture(os.path.join(self.path, f"behind-{name}.png" if name else "behind.png"))

    def occluder(self, name=""):
        """Pixels that it covers, (height, width) bool."""
        return read_picture(os.path.join(self.path, f"occluder-{name}.png" if name else "occluder.png")) > 0

    def facts(self):
        """truth.json as a dict."""
        path = os.path.join(self.path, "truth.json")
        return parse_json(read_bytes(path, _MOST_JSON), path)


class Posed(_Folder):
    """Views with a lens and a pose each.

    width, height, channels, bits     of every picture
    names             list of the views' names; a view is its index or its name
    cameras           list of Camera; None: the view is not placed
    placed            list of indices of the views that are placed
    moments           (n,) int: views of one moment were taken together; 0: not known
    time_s            (n,) float64 since the first view; NaN: not known
    metric            lengths are millimetres; False: in a unit of the source
    up                (3,) against gravity in the world's axes, or None
    geographic        (latitude, longitude, altitude_m) of the world's origin, x east, y north, z up, or None
    kelvin            (scale, offset): temperature = level * scale + offset, or None
    """

    def __init__(self, path, f):
        super().__init__(path, f)
        if f.text("kind") != "posed":
            f.fault("kind", 'is not "posed"')
        self.channels, self.bits = f.int("channels", 1, 3), f.int("bits", 8, 16)
        self.metric = f.bool("metric")
        self.up = f.numbers("up", 3) if "up" in f else None
        self.kelvin = tuple(f.numbers("kelvin", 2)) if "kelvin" in f else None
        self.geographic = None
        if "geographic" in f:
            g = Fields(f.get("geographic"), f.name, "geographic.")
            self.geographic = tuple(g.number(k) for k in ("latitude", "longitude", "altitude_m"))
        self._points = None
        if "points" in f:
            p = Fields(f.get("points"), f.name, "points.")
            self._points = p.file("file"), p.sha256("sha256"), p.int("count", 1, 200000)
        self.names, self.cameras, self._files, moments, times = [], [], [], [], []
        for v in f.objects("views", 1024):
            self.names.append(v.text("name", 255))
            self._files.append((v.file("file"), v.sha256("sha256")))
            self.cameras.append(self._camera(v))
            moments.append(v.int("moment", 0, 10**9) if "moment" in v else 0)
            times.append(v.number("time_s") if "time_s" in v else np.nan)
        if not self.names or len(set(self.names)) != len(self.names):
            f.fault("views", "is empty, or has a name twice")
        self.moments, self.time_s = np.array(moments), np.array(times)
        self.placed = [k for k, c in enumerate(self.cameras) if c]

    @staticmethod
    def _camera(v):
        if "rotation" not in v and "position_mm" not in v:
            return None
        lens = Fields(v.get("lens"), v.name, v.where + "lens.")
        rotation = v.numbers("rotation", 9).reshape(3, 3)
        if np.abs(rotation @ rotation.T - np.eye(3)).max() > 1e-6 or np.linalg.det(rotation) < 0:
            v.fault("rotation", "is not a rotation")
        return Camera(v.text("camera", 63) if "camera" in v else "", *(lens.number(k) for k in ("fx", "fy", "cx", "cy")), lens.numbers("k", 0, 5, 8), rotation,
                      v.numbers("position_mm", 3))

    def _index(self, view):
        if isinstance(view, str):
            if view not in self.names:
                raise KeyError(f"{self.path} has no view named {view}")
            return self.names.index(view)
        if not 0 <= view < len(self.names):
            raise KeyError(f"{self.path} has no view {view}; they are numbered 0 to {len(self.names) - 1}")
        return view

    def image(self, view, verify=True):
        """Levels of a view's picture as they are: (height, width) or (height, width, 3), uint8 or uint16.

        view is its index or name. Raises KeyError, FileNotFoundError, FormatError.
        """
        file, sha256 = self._files[self._index(view)]
        made = self._picture(file, sha256, verify, (self.height, self.width))
        if made.ndim != (3 if self.channels == 3 else 2) or made.dtype.itemsize * 8 != self.bits:
            raise FormatError(f"{self.path}/views/{file} is not of {self.channels} channels with {self.bits} bits, as lightfield.json says")
        return made

    def image8(self, view, verify=True):
        """image() with three channels of 8 bits; 16-bit levels scaled from `samples`."""
        return to_8_bits(self.image(view, verify), self.samples)

    def temperature(self, view):
        """Temperatures, (height, width) float64 in kelvin. Raises ValueError where the pictures are not thermal."""
        if not self.kelvin:
            raise ValueError(f"{self.path} is not thermal: its lightfield.json has no kelvin")
        return self.image(view) * self.kelvin[0] + self.kelvin[1]

    def camera(self, view):
        """Camera of a view; None: it is not placed."""
        return self.cameras[self._index(view)]

    def points(self):
        """Points of the scene that the poses were found with: (n, 3) float64 in mm and (n,) int, the number of views that see each; none:
        (0, 3) and (0,)."""
        if not self._points:
            return np.zeros((0, 3)), np.zeros(0, int)
        file, sha256, count = self._points
        path = os.path.join(self.path, file)
        data = read_bytes(path, 16 + count * 28 + 4000000 * 12)
        if hashlib.sha256(data).hexdigest() != sha256:
            raise FormatError(f"{path} has changed since it was stored (its SHA-256 differs); import the pictures again")
        if len(data) < 16 + 28 * count or data[:8] not in (b"SSTPTS1\n", b"SSTPTS2\n") or struct.unpack_from("<Q", data, 8)[0] != count:
            raise FormatError(f"{path} is not of the number of points that lightfield.json names")
        made = np.frombuffer(data, np.dtype([("at", "<f8", 3), ("views", "<i4")]), count, 16)
        return made["at"].copy(), made["views"].astype(int)

    def __repr__(self):
        return f"<sst.Posed {self.path}: {len(self.names)} views of {self.width} x {self.height}, {len(self.placed)} placed>"


def to_8_bits(image, samples=None):
    """(height, width, 3) uint8 of a picture; levels of 16 bits are scaled so that samples = (black, white) become 0 and 255."""
    if image.dtype == np.uint16:
        black, white = samples or (0, 65535)
        span = white - black
        image = ((np.clip(image.astype(np.int64) - black, 0, span) * 255 + span // 2) // span).astype(np.uint8)
    return np.repeat(image[..., None], 3, 2) if image.ndim == 2 else image


