"""A point target as arrays of antennas measure it, to be written to files of any kind and read again."""

from __future__ import annotations

import numpy as np
from instruments import line
from scipy.constants import speed_of_light

TARGET = np.array([0.05, 0.4, 0.02])
AXES = ["frequency", "tx", "rx"]


def line_of(count, offset=0.0, pitch=0.5e-3):
    """Antennas on the x axis about `offset`, (count, 3) [m]."""
    return line(count, pitch=pitch, centre=(offset, 0.0, 0.0))


def echo(frequency, tx, rx, speed=speed_of_light):
    """The exact samples of the target, exp(-j k d)."""
    d = np.linalg.norm(tx - TARGET, axis=1)[:, None] + np.linalg.norm(rx - TARGET, axis=1)
    return np.exp(-2j * np.pi * frequency[:, None, None] / speed * d)


def same(sweep, f, tx, rx, s, *, within=1e-12):
    """Whether a sweep has these frequencies, antennas and samples; `within` is for all but the samples."""
    np.testing.assert_allclose(sweep["frequency"], f, rtol=within)
    np.testing.assert_allclose(sweep["tx_position"], tx, atol=within)
    np.testing.assert_allclose(sweep["rx_position"], rx, atol=within)
    np.testing.assert_allclose(sweep["s"], s, atol=1e-5)
    assert sweep["s"].dims == ("frequency", "tx", "rx")
    assert sweep["s"].dtype == np.complex64
