"""The images of a report's page, read back."""

from __future__ import annotations

import base64
import zlib

import numpy as np


def unpacked_levels(packed, rows, columns):
    """The levels [dB] that `mirrorfold.reporting.document.packed_levels` has packed, NaN for nothing."""
    difference = np.frombuffer(zlib.decompress(base64.b64decode(packed["data"])), dtype=np.uint8)
    count = np.cumsum(difference.reshape(rows, columns), axis=1, dtype=np.uint8)
    return np.where(count > 0, packed["lowest"] + (count - 1.0) * packed["step"], np.nan)
