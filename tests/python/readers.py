# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""python3-sst against `sst export npz`, the light fields that `sst import recording` makes, and damaged files: readers.py SST [PART ...]"""
import dataclasses
import hashlib
import json
import os
import re
import shutil
import struct
import subprocess
import sys
import zlib

import numpy as np

import sst
from sst import pictures

PROGRAM = sys.argv[1]


def run(*words):
    subprocess.run([PROGRAM, *words], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def refused(words, call, *args, kind=(ValueError, OSError)):
    try:
        call(*args)
    except kind as e:
        text = str(e)
        assert words in text and "\n" not in text and len(text) < 500, (words, text)
        return
    raise AssertionError(f"not refused: {words}")


def same(a, b):
    assert a.dtype == b.dtype and np.array_equal(a, b, equal_nan=a.dtype.kind == "f"), (a.dtype, b.dtype, a.shape, b.shape)


def lattice(name, pixels=True):
    """Every view and map of a light field beside its arrays."""
    run("export", "npz", name, "-o", name + ".npz", "--force")
    lf = sst.open(name)
    with np.load(name + ".npz") as z:
        assert [tuple(p) for p in z["place"]] == lf.views and lf.views[int(z["reference"])] == lf.reference
        for i, view in enumerate(lf.views):
            same(np.asarray(lf.offsets[view]), z["offset"][i])
            if pixels:
                same(lf.image8(view), z["views"][i])
            for key, made in (("disparity", lf.disparity(view)), ("labels", lf.label(view)), ("confidence", lf.confidence(view))):
                assert (key in z.files) == (made is not None), key
                if made is not None:
                    same(made, z[key][i])
            if "camera_matrix" in z.files:
                c = lf.camera(view)
                assert np.allclose(c.matrix, z["camera_matrix"][i], atol=1e-9) and np.allclose(c.position_mm, z["position_mm"][i])
        if "label_names" in z.files:
            assert list(z["label_names"]) == lf.labels
        for key in ("focal_px", "spacing_mm", "infinity_px"):
            assert np.array_equal(z[key], getattr(lf, key), equal_nan=True), key
    return lf


def posed(name):
    run("export", "npz", name, "-o", name + ".npz", "--force")
    lf = sst.open(name)
    with np.load(name + ".npz") as z:
        assert list(z["names"]) == lf.names
        for i, view in enumerate(lf.names):
            same(lf.image(view), z["views"][i])
            c = lf.camera(i)
            if c is None:
                assert np.isnan(z["rotation"][i]).all()
                continue
            same(c.matrix, z["camera_matrix"][i])
            same(c.rotation, z["rotation"][i])
            same(c.position_mm, z["position_mm"][i])
        if "points_mm" in z.files:
            same(lf.points()[0], z["points_mm"])
    return lf


def check_lightfields():
    lf = lattice("bush.lf")
    assert lf.truth.behind().shape == (120, 160, 3) and lf.truth.occluder().any() and lf.truth.facts()["scene"] == "bush"
    error = np.abs(lf.disparity(lf.reference) - lf.truth.disparity(lf.reference))
    assert np.nanmedian(error) < 2, np.nanmedian(error)
    depth = lf.depth_mm(lf.reference)
    assert 500 < np.nanmedian(depth) < 50000
    flight = posed("flight.lf")
    assert flight.bits == 16 and 250 < np.median(flight.temperature(0)) < 330 and flight.geographic[0] > 40
    posed("forest.lf")
    found = posed("points.lf") if os.path.isdir("points.lf") else None
    assert found is None or len(found.points()[0])
    calibrated = lattice("calibrated.lf", pixels=False)
    assert calibrated.calibration and calibrated.image(calibrated.reference).shape == (128, 160, 3)
    refused("has no view", calibrated.image, (9, 9), kind=KeyError)
    for view in (3, None, "r0c0", (1, 2, 3)):
        refused("give (row, col)", calibrated.image, view, kind=TypeError)


def check_calibration():
    calib = sst.Calibration("calib.yaml")
    shown = json.loads(subprocess.run([PROGRAM, "calibration", "show", "calib.yaml", "--json"], check=True, capture_output=True).stdout)
    for c in shown["cameras"]:
        mine = calib.cameras[c["row"], c["col"]]
        for key, values in (("focal_px", [mine.fx, mine.fy]), ("centre_px", [mine.cx, mine.cy]), ("distortion", mine.distortion), ("position_mm", mine.position_mm)):
            assert key not in c or np.allclose(c[key], values), key
    assert len(shown["cameras"]) == len(calib.cameras)
    text = open("calib.yaml", encoding="utf8").read()
    for bad, words in ((text.replace("format: sst-calib", "format: x"), "not a calibration of sst"), (text.replace("version: 1", "version: 7"), "version 7"),
                       (text + "odd: 1\n", "unknown key"), (text.replace("rows: ", "rows: -"), "rows"), (text[:len(text) // 2], ""),
                       (text.replace("focal_px: [", "focal_px: [-"), "focal length"), ("cameras: [[[[", "not closed"), ("\xff", ""),
                       (re.sub("\\nrange_mm: .*", "", text) + "range_mm: [1]\n", "range_mm is not a number"), ("a: " + "[" * 9999 + "]" * 9999, "too deep"),
                       ("a:\n" + "".join(" " * 4 * i + "- a:\n" for i in range(1, 999)), "too deep"), ("format: [\n" + "1,\n" * 99999 + "]\n", "not a calibration")):
        with open("bad.yaml", "w", encoding="utf8") as f:
            f.write(bad)
        if words or bad == "\xff":
            refused(words, sst.Calibration, "bad.yaml")
        else:
            refused("bad.yaml", sst.Calibration, "bad.yaml")


def check_damage():
    def changed(edit, words, use=sst.open):
        shutil.rmtree("bad.lf", ignore_errors=True)
        shutil.copytree("bush.lf", "bad.lf")
        with open("bad.lf/lightfield.json", encoding="utf8") as f:
            root = json.load(f)
        edit(root)
        with open("bad.lf/lightfield.json", "w", encoding="utf8") as f:
            json.dump(root, f)
        refused(words, lambda: use("bad.lf"))

    def bytes_of(path, data):
        def edit(_):
            with open("bad.lf/" + path, "wb") as f:
                f.write(data)
        return edit

    refused("no such folder", sst.open, "nowhere", kind=FileNotFoundError)
    refused("no lightfield.json", sst.open, ".", kind=FileNotFoundError)
    open("bad.npz", "w").close()
    refused("it is not a folder; numpy.load() opens it", sst.open, "bad.npz", kind=FileNotFoundError)
    refused("no format that Pillow knows", sst.read_picture, __file__)
    changed(lambda r: r.update(version=9), "newer than 3")
    changed(lambda r: r.update(rows=0), "rows is not a whole number")
    changed(lambda r: r.update(rows=True), "rows is not a whole number")
    changed(lambda r: r.update(focal_px=float("nan")), "focal_px is not a number")
    changed(lambda r: r.update(focal_px=10**400), "focal_px is not a number")
    changed(lambda r: r.update(off_centre_px=[10**400, 0]), "off_centre_px is not a list")
    changed(lambda r: r.update(samples=[7, 7]), "samples are not two ascending")
    changed(lambda r: r.update(views=[]), "views is empty")
    changed(lambda r: r["views"][0].update(file="../x"), "not a plain file name")
    changed(lambda r: r["views"].append(r["views"][0]), "occur twice")
    changed(lambda r: r.update(width=30000, height=30000), "too large")
    first = open("bush.lf/views/00_00.png", "rb").read()
    image = lambda d: sst.open(d).image((0, 0))  # noqa: E731
    changed(bytes_of("views/00_00.png", first[:-20]), "truncated", image)
    changed(bytes_of("views/00_00.png", first[:60] + b"x" + first[61:]), "checksum", image)
    changed(bytes_of("views/00_00.png", b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 9 9\n%%EndComments\nshowpage\n"), "cannot be read as a picture", image)
    other = open("bush.lf/views/00_01.png", "rb").read()
    changed(bytes_of("views/00_00.png", other), "SHA-256", image)
    assert sst.open("bad.lf").image((0, 0), verify=False).shape == (120, 160, 3)
    disparity = lambda d: sst.open(d).disparity((0, 0))  # noqa: E731
    changed(bytes_of("disparity/00_00.png", first), "colours", disparity)
    changed(bytes_of("disparity/00_00.png", b""), "not a PNG", disparity)
    changed(bytes_of("disparity/00_00.png", open("bush.lf/labels/00_00.png", "rb").read()), "not 160 x 120 of uint16", disparity)
    for bad, words in ((b"[]", "not a JSON object"), (b'{"a":1,"a":2}', "twice"), (b"{" * 100000, "not valid JSON"), (b"\xff\xfe", "not valid JSON")):
        bytes_of("lightfield.json", bad)(None)
        refused(words, sst.open, "bad.lf")
    with open("bad.lf/lightfield.json", "wb") as f:
        f.truncate(5 << 20)
    refused("larger than", sst.open, "bad.lf")
    if os.path.isdir("points.lf"):
        shutil.rmtree("bad.lf")
        shutil.copytree("points.lf", "bad.lf")
        with open("bad.lf/lightfield.json", encoding="utf8") as f:
            root = json.load(f)
        bytes_of(root["points"]["file"], b"SSTPTS1\n")(None)
        root["points"]["sha256"] = hashlib.sha256(b"SSTPTS1\n").hexdigest()
        bytes_of("lightfield.json", json.dumps(root).encode())(None)
        refused("number of points", sst.open("bad.lf").points)
    for bad, words in ((b"Pf 2 2 -1\n" + b"\0" * 15, "15 bytes"), (b"PF 2 2 -1\n", "not a PFM"), (b"Pf 99999 99999 -1\n", "claims")):
        with open("bad.pfm", "wb") as f:
            f.write(bad)
        refused(words, sst.read_pfm, "bad.pfm")


def png(pixels, depth, colour, filters, interlaced=False, palette=None):
    """A PNG with a chosen filter in each row, written the plain way."""
    def chunk(kind, body):
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))

    channels = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}[colour]
    step, out = max(1, channels * depth // 8), bytearray()
    h, w = pixels.shape[:2]
    for x0, y0, dx, dy in pictures._PASSES if interlaced else ((0, 0, 1, 1),):
        part = pixels[y0::dy, x0::dx].reshape(-(-(h - y0) // dy) if h > y0 else 0, -1)
        above = None
        for n, row in enumerate(part if part.size else ()):
            if depth == 16:
                raw = row.astype(">u2").tobytes()
            elif depth == 8:
                raw = row.astype(np.uint8).tobytes()
            else:
                raw = np.packbits(np.unpackbits(row.astype(np.uint8)[:, None], axis=1)[:, 8 - depth:].ravel()).tobytes()
            above = above or bytes(len(raw))
            f = filters[n % len(filters)]
            out.append(f)
            for i, v in enumerate(raw):
                a, b, c = raw[i - step] if i >= step else 0, above[i], above[i - step] if i >= step else 0
                p = a + b - c
                paeth = a if abs(p - a) <= abs(p - b) and abs(p - a) <= abs(p - c) else b if abs(p - b) <= abs(p - c) else c
                out.append((v - (0, a, b, (a + b) // 2, paeth)[f]) & 255)
            above = raw
    head = struct.pack(">IIBBBBB", w, h, depth, colour, 0, 0, interlaced)
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + (chunk(b"PLTE", palette) if palette else b"") + chunk(b"IDAT", zlib.compress(bytes(out), 1)) +
            chunk(b"IEND", b""))


def check_png():
    rng = np.random.default_rng(1)
    for interlaced in (False, True):
        for depth, colour in ((1, 0), (2, 0), (4, 0), (8, 0), (16, 0), (8, 2), (16, 2), (4, 3), (8, 3), (8, 4), (16, 4), (8, 6), (16, 6)):
            channels = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}[colour]
            palette = bytes(range(48)) if colour == 3 else None
            pixels = rng.integers(0, min(1 << depth, 16 if palette else 65536), (13, 11, channels)).astype(np.uint16)
            data = png(pixels, depth, colour, [4, 3, 1, 2, 0, 4, 4, 3], interlaced, palette)
            made = pictures.decode_png(data, indices=True)
            want = pixels[..., 0] if channels < 3 else pixels[..., :3]
            assert made.dtype == (np.uint16 if depth == 16 else np.uint8) and (made == want).all(), (depth, colour, interlaced)
            plain = pictures.decode_png(data)
            assert colour != 3 or (plain == np.frombuffer(palette, np.uint8).reshape(-1, 3)[want]).all()
            assert not (colour == 0 and depth < 8) or (plain == want * (255 // ((1 << depth) - 1))).all()
    good = png(np.zeros((4, 4, 3)), 8, 2, [0])
    refused("claims", pictures.decode_png, good[:16] + struct.pack(">II", 1 << 20, 4) + good[24:])
    refused("no kind of PNG", pictures.decode_png, good[:24] + b"\x07" + good[25:])
    refused("filter", pictures.decode_png, _bad_filter())
    refused("truncated", pictures.decode_png, good[:-30])


def _bad_filter():
    body = zlib.compress(b"\x07" + bytes(12))
    out = b"\x89PNG\r\n\x1a\n"
    for kind, content in ((b"IHDR", struct.pack(">IIBBBBB", 4, 1, 8, 2, 0, 0, 0)), (b"IDAT", body), (b"IEND", b"")):
        out += struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))
    return out


def check_recordings():
    for f in "MJPG GREY Y16 YUYV RGGB GRBG GBRG BA81".split():
        recording, lf = sst.Recording("rec-" + f), sst.open("set-" + f)
        assert len(recording) == 4 and not recording.damaged and recording.pixel_format == f
        for view in lf.views:
            made, want = recording.frame(2, view).rgb(), lf.image(view)
            same(made, np.repeat(want[..., None], 3, 2) if want.ndim == 2 else want)
        if f != "MJPG":
            raw = recording.frame(1, 0).raw()
            assert raw.dtype == (np.uint16 if f == "Y16" else np.uint8) and raw.shape[:2] == (26, 38)
            lattice("set-" + f)
        assert abs(recording.time(2) - 1.7e9) < 10 and len(recording.frames(3)) == 4
    parts, lf = sst.Recording("rec-parts"), sst.open("set-parts")
    for view in lf.views:
        frame = parts.frame(3, view)
        assert frame.faults == 256 and frame.base and len(frame.data) < len(frame.base)
        same(frame.rgb(), lf.image(view))
    cut = frame.data[:len(frame.data) - 40]
    refused("damaged", dataclasses.replace(frame, data=cut).rgb)
    refused("not there any more", dataclasses.replace(frame, base=None).rgb)
    refused("earlier frame", dataclasses.replace(frame, base=sst.Recording("rec-MJPG").frame(0, 0).data).rgb)
    holes = sst.Recording("rec-holes")
    missing = [(i, k) for i in range(len(holes)) for k in range(4) if holes.frame(i, k) is None]
    assert missing == [(i, k) for i in range(len(holes)) for k in holes.set(i)["missing"]] and missing, missing
    # Damage: a byte of a frame, a line of the manifest, a torn end, a segment that went.
    shutil.copytree("rec-GREY", "torn")
    place = sst.Recording("torn").set(0)["frames"][1]
    with open("torn/segments/000000.mkv", "r+b") as f:
        f.seek(place["offset"] + 3)
        byte = f.read(1)[0]
        f.seek(place["offset"] + 3)
        f.write(bytes([byte ^ 255]))
    lines = open("torn/sets.jsonl", "rb").read().splitlines(keepends=True)
    sets = [n for n, line in enumerate(lines) if line.startswith(b'{"set"')]
    lines[sets[1]] = lines[sets[1]].replace(b'"edge"', b'"Edge"')
    for column, value in ((5, -1), (5, 1 << 70), (7, 1 << 40), (7, -1)):  # offsets and strides that no recorder writes
        root = json.loads(lines[sets[0]])
        root.pop("crc")
        root["frames"][1][column] = value
        line = json.dumps(root, separators=(",", ":"))[:-1].encode()
        with open("torn/sets.jsonl", "wb") as f:
            f.write(b"".join(lines[:sets[0]]) + line + b',"crc":"%08x"}\n' % zlib.crc32(line))
        refused("out of range", sst.Recording("torn").frame, 0, 1)
    with open("torn/sets.jsonl", "wb") as f:
        f.write(b"".join(lines) + b'{"set":99,"t_ns":')
    torn = sst.Recording("torn")
    assert len(torn) == 4 and torn.damaged == [1], torn.damaged
    refused("damaged", torn.frame, 0, 1)
    assert torn.frame(0, 2).good
    refused("line of set 1 is damaged", torn.set, 1)
    refused("no set 4", torn.set, 4, kind=IndexError)
    refused("no camera", torn.frame, 0, 44, kind=KeyError)
    last = torn.set(3)["segment"]
    os.unlink(f"torn/segments/{last:06d}.mkv")
    refused("is not there", torn.frame, 3, 0)
    assert len(repr(frame)) < 200, repr(frame)
    refused("no recording.json", sst.Recording, "bush.lf", kind=FileNotFoundError)


def check_client():
    socket, port = sys.argv[3], open(sys.argv[4], encoding="utf8").read()
    for client in (sst.Client("unix:" + socket), sst.Client("http://127.0.0.1:" + port, token="fake-token")):
        assert client.status()["capture"]["present"] == 35 and len(client.cameras()["cameras"]) == 36
        assert len(client.events()) == 30 and [e["id"] for e in client.events(after=25)] == [26, 27, 28, 29, 30]
        assert len(client.events(limit=7)) == 7
        assert [e["id"] for e in client.follow(after=0)][-1] == 32
        assert client.download("2026-11-21T18-04-00Z.tar", b"all.tar") == os.path.getsize("all.tar")
        umask = os.umask(0o027)
        os.umask(umask)
        assert os.stat("all.tar").st_mode & 0o777 == 0o666 & ~umask, oct(os.stat("all.tar").st_mode)
        refused("there is no /api/v1/visits", client.visits)
        refused("cannot be read as a picture", client.snapshot, "r0c5")  # the fake's pictures are none
    try:
        sst.Client("http://127.0.0.1:" + port, token="wrong").status()
        raise AssertionError("a wrong token is accepted")
    except sst.ServiceError as e:
        assert e.status == 401, e.status
    refused("does not answer", sst.Client("unix:/nowhere").status)
    refused("not an address", sst.Client, "ftp://x")
    refused("token is empty", sst.Client, "http://x", "")
    refused("nowhere, the file of the token", lambda: sst.Client("http://x", token_file="nowhere"), kind=FileNotFoundError)
    refused("nowhere, the file of certificates", lambda: sst.Client("https://x", cafile="nowhere"), kind=FileNotFoundError)
    refused("no certificates in PEM", lambda: sst.Client("https://x", cafile=__file__))
    for mode, words in (("hang", "no answer within 0.5 s"), ("garbage", ""), ("huge", ""), ("cut", ""), ("evil", "two?lines")):
        with open(socket + ".mode", "w", encoding="utf8") as f:
            f.write(mode)
        refused(words, sst.Client("unix:" + socket, timeout=0.5).status, kind=sst.ServiceError)
    with open(socket + ".mode", "w", encoding="utf8") as f:
        f.write("other")
    other = sst.Client("unix:" + socket)
    for ask in (other.status, other.cameras, other.labels, other.events, other.visits, other.recordings):
        refused("no object of JSON" if ask == other.events else "another form", ask, kind=sst.ServiceError)
    with open(socket + ".mode", "w", encoding="utf8") as f:
        f.write("stalled")
    refused("ends early: no answer within 0.5 s", sst.Client("unix:" + socket, timeout=0.5).download, "all.tar", "stalled.tar", kind=sst.ServiceError)
    refused("is a folder", other.download, "all.tar", ".", kind=IsADirectoryError)
    os.unlink(socket + ".mode")
    assert not os.path.exists("stalled.tar") and not [f for f in os.listdir(".") if f.startswith(".sst-")]


for part in sys.argv[2].split(","):
    globals()["check_" + part]()
