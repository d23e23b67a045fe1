# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""Pictures and maps: PNG of any depth, PFM, and what Pillow reads."""
import hashlib
import io
import re
import zlib

import numpy as np

from .files import FormatError, read_bytes

MOST_BYTES = 1 << 30
MOST_SIDE = 32768
MOST_PIXELS = 1 << 28
_KINDS = ("PNG", "JPEG", "TIFF")  # of Pillow's: others start programs (EPS: Ghostscript), or are seldom tested
_CHANNELS = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}
_DEPTHS = {0: (1, 2, 4, 8, 16), 2: (8, 16), 3: (1, 2, 4, 8), 4: (8, 16), 6: (8, 16)}
_PASSES = ((0, 0, 8, 8), (4, 0, 8, 8), (0, 4, 4, 8), (2, 0, 4, 4), (0, 2, 2, 4), (1, 0, 2, 2), (0, 1, 1, 2))
_BAND = 128  # rows that are unfiltered together


def _chunks(data, name):
    """Kind and content of each chunk up to IEND, checksums compared."""
    at = 8
    while at + 12 <= len(data):
        n = int.from_bytes(data[at:at + 4], "big")
        kind, body = data[at + 4:at + 8], data[at + 8:at + 8 + n]
        if at + 12 + n > len(data):
            break
        if zlib.crc32(body, zlib.crc32(kind)) != int.from_bytes(data[at + 8 + n:at + 12 + n], "big"):
            raise FormatError(f"{name} is damaged: the checksum of a chunk differs")
        yield kind, body
        if kind == b"IEND":
            return
        at += 12 + n
    raise FormatError(f"{name} is truncated")


def _paeth(a, b, c):
    p = a + b - c
    pa, pb, pc = np.abs(p - a), np.abs(p - b), np.abs(p - c)
    return np.where((pa <= pb) & (pa <= pc), a, np.where(pb <= pc, b, c))


def _unfilter_skewed(raw, kinds, above, step):
    """Rows with means or Paeth's filter: along the anti-diagonals all neighbours are known, so that a band takes width + rows steps."""
    rows, width = len(raw), raw.shape[1] // step
    x = raw.reshape(rows, width, step).astype(np.int16)
    out = np.zeros((rows + 1, width + 1, step), np.int16)
    out[0, 1:] = above.reshape(width, step)
    kind = kinds[:, None]
    for t in range(rows + width - 1):
        y = np.arange(max(0, t - width + 1), min(rows, t + 1))
        c = t - y
        a, b, d = out[y + 1, c], out[y, c + 1], out[y, c]
        k = kind[y]
        guess = np.where(k == 1, a, np.where(k == 2, b, np.where(k == 3, (a + b) >> 1, 0)))
        if (k == 4).any():
            guess = np.where(k == 4, _paeth(a, b, d), guess)
        out[y + 1, c + 1] = (x[y, c] + guess) & 255
    return out[1:, 1:].reshape(rows, width * step).astype(np.uint8)


def _unfilter(raw, kinds, step):
    """Rows of bytes whose filters are undone (PNG 1.2, 6)."""
    out = np.empty_like(raw)
    above = np.zeros(raw.shape[1], np.uint8)
    y = 0
    while y < len(raw):
        if kinds[y] >= 3:
            end = y + 1
            while end < len(raw) and end - y < _BAND and kinds[end] != 0:
                end += 1
            out[y:end] = _unfilter_skewed(raw[y:end], kinds[y:end], above, step)
        else:
            end = y + 1
            if kinds[y] == 0:
                out[y] = raw[y]
            elif kinds[y] == 1:
                out[y] = np.cumsum(raw[y].reshape(-1, step), axis=0, dtype=np.uint8).ravel()
            else:
                out[y] = raw[y] + above
        above = out[end - 1]
        y = end
    return out


def _samples(rows, width, channels, depth):
    """Samples of unfiltered rows: (height, width, channels)."""
    if depth == 16:
        return rows.reshape(len(rows), width, channels, 2).copy().view(">u2")[..., 0].astype(np.uint16)
    if depth < 8:
        bits = np.unpackbits(rows, axis=1).reshape(len(rows), -1, depth)
        rows = bits.dot(1 << np.arange(depth)[::-1]).astype(np.uint8)[:, :width * channels]
    return rows.reshape(len(rows), width, channels)


def _png_passes(width, height, interlaced):
    for x0, y0, dx, dy in _PASSES if interlaced else ((0, 0, 1, 1),):
        w, h = -(-(width - x0) // dx), -(-(height - y0) // dy)
        if w > 0 and h > 0:
            yield x0, y0, dx, dy, w, h


def _png_head(data, name):
    if len(data) < 33 or data[12:16] != b"IHDR":
        raise FormatError(f"{name} is a PNG without its header")
    width, height = int.from_bytes(data[16:20], "big"), int.from_bytes(data[20:24], "big")
    depth, colour, interlaced = data[24], data[25], data[28]
    if depth not in _DEPTHS.get(colour, ()) or interlaced > 1 or data[26] or data[27]:
        raise FormatError(f"{name} is damaged: its header names no kind of PNG")
    check_size(width, height, name)
    return width, height, depth, colour, interlaced


def check_size(width, height, name):
    """Refuse absurd sizes before memory is taken for them."""
    if not 0 < width <= MOST_SIDE or not 0 < height <= MOST_SIDE or width * height > MOST_PIXELS:
        raise FormatError(f"{name} claims {width} x {height} pixels, more than {MOST_SIDE} on a side or {MOST_PIXELS} in all")


def decode_png(data, name="picture", indices=False):
    """Pixels of a PNG in memory.

    Returns (height, width) for grey, (height, width, 3) for colour; uint8, or uint16 for samples of 16 bits. Alpha is dropped, a
    palette applied unless `indices`. Grey of less than 8 bits is scaled to 0..255, indices are not. Raises FormatError.
    """
    width, height, depth, colour, interlaced = _png_head(data, name)
    channels, body, palette = _CHANNELS[colour], [], None
    for kind, content in _chunks(data, name):
        if kind == b"IDAT":
            body.append(content)
        elif kind == b"PLTE":
            palette = np.frombuffer(content[:len(content) // 3 * 3], np.uint8).reshape(-1, 3)
    sizes = [(p, -(-p[4] * channels * depth // 8) + 1) for p in _png_passes(width, height, interlaced)]
    total = sum(p[5] * row for p, row in sizes)
    try:
        stream = zlib.decompressobj()
        flat = stream.decompress(b"".join(body), total)
    except zlib.error as e:
        raise FormatError(f"{name} is damaged: {e}") from None
    if len(flat) != total:
        raise FormatError(f"{name} is truncated")
    flat = np.frombuffer(flat, np.uint8)
    out = np.empty((height, width, channels), np.uint16 if depth == 16 else np.uint8)
    for (x0, y0, dx, dy, w, h), row in sizes:
        part, flat = flat[:h * row].reshape(h, row), flat[h * row:]
        if (part[:, 0] > 4).any():
            raise FormatError(f"{name} is damaged: a row has no known filter")
        rows = _unfilter(part[:, 1:], part[:, 0], max(1, channels * depth // 8))
        out[y0::dy, x0::dx] = _samples(rows, w, channels, depth)
    if colour == 3 and not indices:
        if palette is None or out.max() >= len(palette):
            raise FormatError(f"{name} is damaged: a pixel lies outside its palette")
        return palette[out[..., 0]]
    if colour == 0 and depth < 8 and not indices:
        out *= 255 // ((1 << depth) - 1)
    return out[..., 0] if channels < 3 else np.ascontiguousarray(out[..., :3])


def _pillow(data, name, indices=False):
    try:
        from PIL import Image
    except ImportError:
        raise FormatError(f"{name} is no PNG, and Pillow, which reads other pictures, is not installed; install python3-pil, or `pip install "
                          "Pillow`") from None
    try:
        with Image.open(io.BytesIO(data), formats=_KINDS) as img:
            check_size(*img.size, name)
            if img.mode == "P" and indices:
                return np.array(img)
            if img.mode.startswith("I;16"):
                return np.array(img).astype(np.uint16)
            if img.mode in ("I", "F"):
                raise FormatError(f"{name} has pixels of 32 bits, which are not read; convert it to 8 or 16 bits")
            if img.format == "TIFF" and max(img.tag_v2.get(258, (8,))) > 8:
                raise FormatError(f"{name} is a TIFF of colours with 16 bits, which Pillow does not read; convert it to PNG")
            return np.array(img.convert("L" if img.mode in ("1", "L", "LA") else "RGB"))
    except FormatError:
        raise
    except Exception as e:  # noqa: BLE001 - plugins of Pillow raise exceptions of any kind at damaged files
        why = "it is of no format that Pillow knows" if type(e).__name__ == "UnidentifiedImageError" else str(e)[:200]
        raise FormatError(f"{name} cannot be read as a picture: {why}") from None


def decode_picture(data, name="picture"):
    """Pixels of a picture in memory, by its content: PNG of any depth, JPEG and TIFF by Pillow.

    Returns (height, width) or (height, width, 3); uint8, or uint16 for samples of 16 bits. EXIF's orientation is not applied. Raises
    FormatError.
    """
    if data[:8] != b"\x89PNG\r\n\x1a\n":
        return _pillow(data, name)
    width, height, depth, _, _ = _png_head(data, name)
    if depth <= 8:  # Pillow is quicker there, and cuts 16 bits of colours to 8
        try:
            import PIL  # noqa: F401
        except ImportError:
            pass
        else:
            for _ in _chunks(data, name):
                pass
            return _pillow(data, name)
    return decode_png(data, name)


def read_picture(path, sha256=None):
    """decode_picture() of a file. `sha256`: hexadecimal digits that the file must have, or it raises FormatError."""
    data = read_bytes(path, MOST_BYTES)
    made = decode_picture(data, str(path))
    if sha256 and hashlib.sha256(data).hexdigest() != sha256:
        raise FormatError(f"{path} has changed since it was stored (its SHA-256 differs); import it again, or pass verify=False")
    return made


def read_map(path, dtype, shape):
    """Samples of a PNG with one channel, palette indices as they are: (height, width) of `dtype` (uint8 or uint16)."""
    made = decode_png_map(read_bytes(path, MOST_BYTES), str(path))
    if made.dtype != dtype or made.shape != shape:
        raise FormatError(f"{path} has {made.shape[1]} x {made.shape[0]} samples of {made.dtype}, not {shape[1]} x {shape[0]} of {np.dtype(dtype)}; make "
                          "it again with `sst process`")
    return made


def decode_png_map(data, name):
    """As decode_png() with indices=True, refusing colours."""
    if data[:8] != b"\x89PNG\r\n\x1a\n":
        raise FormatError(f"{name} is not a PNG")
    _, _, depth, colour, _ = _png_head(data, name)
    if colour not in (0, 3):
        raise FormatError(f"{name} is a picture of colours, not a map")
    if depth == 8:
        try:
            import PIL  # noqa: F401
        except ImportError:
            pass
        else:
            for _ in _chunks(data, name):
                pass
            return _pillow(data, name, indices=True)
    return decode_png(data, name, indices=True)


def read_pfm(path):
    """A PFM as (height, width) float32, NaN where the file has infinity: disparity or depth maps of sst, truth of scenes.

    Raises FileNotFoundError, FormatError.
    """
    data = read_bytes(path, MOST_BYTES)
    head = re.match(rb"Pf\s+(\d{1,6})\s+(\d{1,6})\s+([-+0-9.eE]{1,20})\s", data[:64])
    if not head:
        raise FormatError(f"{path} is not a PFM of one channel")
    width, height = int(head[1]), int(head[2])
    check_size(width, height, path)
    try:
        scale = float(head[3])
    except ValueError:
        scale = 0.0
    if scale == 0 or len(data) - head.end() != 4 * width * height:
        raise FormatError(f"{path} has {len(data) - head.end()} bytes of pixels, not {4 * width * height}, or no scale")
    made = np.frombuffer(data, "<f4" if scale < 0 else ">f4", offset=head.end()).reshape(height, width)[::-1].astype(np.float32)
    made[~np.isfinite(made)] = np.nan
    return made
