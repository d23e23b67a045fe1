# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""Files read whole up to a limit, JSON with checked fields, and the error of damaged ones."""
import json
import os

import numpy as np


class FormatError(ValueError):
    """A file is damaged, of another format, or newer than this reader: one sentence with file, fault and remedy."""


def absent(path, kind, file):
    """FileNotFoundError of a folder that is no light field, or no recording, since it lacks `file`."""
    why = f"it has no {file}" if os.path.isdir(path) else "it is not a folder" if os.path.exists(path) else "there is no such folder"
    return FileNotFoundError(f"{path} is not a {kind}: {why}" + ("; numpy.load() opens it" if str(path).endswith(".npz") else ""))


def read_bytes(path, limit):
    """Bytes of a regular file of at most `limit` bytes. Raises FileNotFoundError, OSError, FormatError (too large, no file)."""
    path = os.fsdecode(path)
    if not os.path.exists(path):
        raise FileNotFoundError(f"{path} does not exist")
    if not os.path.isfile(path):
        raise FormatError(f"{path} is not a regular file")
    with open(path, "rb") as f:
        data = f.read(limit + 1)
    if len(data) > limit:
        raise FormatError(f"{path} is larger than {limit} bytes, the most that is read")
    return data


def _unique(pairs):
    made = dict(pairs)
    if len(made) != len(pairs):
        raise ValueError("a key occurs twice")
    return made


def parse_json(data, name):
    """An object of JSON in UTF-8; a key that occurs twice is a fault."""
    try:
        root = json.loads(data.decode("utf-8"), object_pairs_hook=_unique)
    except (ValueError, RecursionError) as e:
        raise FormatError(f"{name} is not valid JSON: {str(e)[:200]}") from None
    if not isinstance(root, dict):
        raise FormatError(f"{name} is not a JSON object")
    return root


class Fields:
    """Members of a JSON object with their checks; faults name file and field."""

    def __init__(self, obj, name, where=""):
        self.name, self.where = name, where
        if not isinstance(obj, dict):
            self.fault(where.rstrip(".") or "it", "is not an object")
        self.obj = obj

    def fault(self, field, what):
        raise FormatError(f"{self.name}: {self.where if self.where.rstrip('.') != field else ''}{field} {what}; make it again with sst")

    def __contains__(self, field):
        return field in self.obj

    def get(self, field):
        if field not in self.obj:
            self.fault(field, "is missing")
        return self.obj[field]

    def int(self, field, lo, hi):
        v = self.get(field)
        if type(v) is not int or not lo <= v <= hi:
            self.fault(field, f"is not a whole number in {lo}..{hi}")
        return v

    def number(self, field, lo=-1e12, hi=1e12):
        v = self.get(field)
        if type(v) not in (int, float) or not lo <= v <= hi:
            self.fault(field, f"is not a number in {lo:g}..{hi:g}")
        return float(v)

    def bool(self, field):
        v = self.get(field)
        if type(v) is not bool:
            self.fault(field, "is not true or false")
        return v

    def text(self, field, most=4096):
        v = self.get(field)
        if not isinstance(v, str) or len(v) > most:
            self.fault(field, f"is not a text of at most {most} characters")
        return v

    def file(self, field):
        v = self.text(field, 255)
        if not v or v[0] == "." or "/" in v or any(ord(c) < 32 or ord(c) == 127 for c in v):
            self.fault(field, "is not a plain file name")
        return v

    def sha256(self, field):
        v = self.text(field, 64)
        if len(v) != 64 or v.strip("0123456789abcdef"):
            self.fault(field, "is not 64 hexadecimal digits")
        return v

    def list(self, field, most):
        v = self.get(field)
        if not isinstance(v, list) or len(v) > most:
            self.fault(field, f"is not a list of at most {most}")
        return v

    def numbers(self, field, *counts):
        v = self.list(field, max(counts))
        if len(v) not in counts or any(type(x) not in (int, float) or not -1e12 <= x <= 1e12 for x in v):
            self.fault(field, f"is not a list of {' or '.join(map(str, counts))} numbers")
        return np.array(v, dtype=np.float64)

    def objects(self, field, most):
        return [Fields(o, self.name, f"{self.where}{field}[{i}].") for i, o in enumerate(self.list(field, most))]
