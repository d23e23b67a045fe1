# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""Light fields, maps, recordings and calibrations of sst as arrays of NumPy, and a client of its service.

    import sst
    lf = sst.open("scene.lf")             # Lattice or Posed
    rgb = lf.image(lf.reference)          # (height, width, 3) uint8
    d = lf.disparity(lf.reference)        # (height, width) float32, px per spacing, NaN where there is none
    recording = sst.Recording("night")
    status = sst.Client("http://127.0.0.1:8090", token="...").status()

Conventions are those of docs/integrate/formats.md: views in rows and columns from the top left, image x right and y down, pixel centres on
whole numbers, camera axes x right, y down, z forward, lengths in millimetres, P = rotation @ (X - position_mm). A point seen at x in
the reference view is at x - disparity * offset in another one.

Damaged files raise FormatError (a ValueError), missing ones FileNotFoundError, a service that refuses ServiceError (an OSError): one
sentence with file, fault and remedy.
"""
from .calibration import Calibration, Camera
from .client import Client, ServiceError
from .files import FormatError
from .lightfield import Lattice, Posed, open  # noqa: A004
from .pictures import read_pfm, read_picture
from .recording import Frame, Recording

__all__ = ["Calibration", "Camera", "Client", "FormatError", "Frame", "Lattice", "Posed", "Recording", "ServiceError", "open", "read_pfm",
           "read_picture"]
__version__ = "0.2.0"
