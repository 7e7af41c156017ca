"""The image of a glint that only a part of the pairs of antennas sees, as of a wall that ends."""

from __future__ import annotations

import numpy as np
import xarray as xr
from scipy.constants import speed_of_light

import mirrorfold as mf

GLINT = np.array([0.5, 1.0])
"""Where the glint appears [m]."""


HALF, PART = 0.005, -0.05
"""Sums of the places of both antennas [m] below which are half of the pairs, and 7 % of them."""


def glint_image(*, seen_below: float = np.inf) -> xr.DataArray:
    """The image by an array of 8 cm, of the pairs whose places have a sum below that [m]; by default of all.

    The noise is 60 dB below each sample.
    """
    position = np.zeros((161, 3))
    position[:, 0] = along = np.linspace(-0.04, 0.04, 161)
    frequency = np.linspace(290e9, 300e9, 141)
    distance = np.linalg.norm(position[:, :2] - GLINT, axis=1)
    path = distance[:, None] + distance
    s = np.exp(-2j * np.pi * frequency[:, None, None] / speed_of_light * path)
    s *= along[:, None] + along < seen_below
    real, imag = np.random.default_rng(0).standard_normal((2, *s.shape))
    sweep = mf.make_sweep(
        s + 7e-4 * (real + 1j * imag), frequency=frequency, tx_position=position, rx_position=position
    )
    return mf.focus(sweep, x=np.arange(-0.9, 1.2, 0.005), y=np.arange(0.3, 1.15, 0.005))
