"""The sweep of a point as one antenna measures it that moves along a path and both sends and receives, at 24 GHz."""

from __future__ import annotations

import numpy as np
import xarray as xr
from scipy.constants import speed_of_light

import mirrorfold as mf

PATH = 0.48
"""Length of the path [m]: two and a half range cells to either side of its middle."""


def sweep_of_point(point: tuple[float, float], *, seen_below: float = np.inf) -> xr.Dataset:
    """The sweep of a `point` [m], in noise 30 dB below each sample.

    The point is seen where the antenna is at an x below `seen_below` [m], by default all along the path.
    """
    frequency = np.linspace(23.5e9, 26.5e9, 161)
    position = np.zeros((161, 3))
    position[:, 0] = np.linspace(-0.5 * PATH, 0.5 * PATH, 161)
    distance = np.linalg.norm(position[:, :2] - point, axis=1)
    s = np.exp(-4j * np.pi / speed_of_light * frequency[:, None] * distance) * (position[:, 0] < seen_below)
    real, imag = np.random.default_rng(0).standard_normal((2, *s.shape))
    noise = 10.0 ** (-30.0 / 20.0) / np.sqrt(2.0) * (real + 1j * imag)
    return mf.make_monostatic_sweep(s + noise, frequency=frequency, antenna_position=position)
