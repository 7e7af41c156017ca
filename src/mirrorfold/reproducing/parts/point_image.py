"""The image of one point: where its peak is, and how high and wide it is."""

from __future__ import annotations

import numpy as np
import xarray as xr
from scipy.interpolate import RectBivariateSpline
from scipy.optimize import brentq, minimize

import mirrorfold as mf
from mirrorfold.common.geometry import unit
from mirrorfold.common.types import Array

PIXELS = 97
"""Pixels along each side of the image."""


class PointImage:
    """The image of a sweep around the place where the echo of a point is expected.

    Parameters
    ----------
    sweep : Sweep
    expected : (2,) array [m]
    reach : float [m]
        Half the side of the image.

    Attributes
    ----------
    top : (2,) array [m]
        Place of the peak.
    power : RectBivariateSpline
        Power of the image as a function of y and x [m].
    """

    def __init__(self, sweep: xr.Dataset, expected: Array, reach: float) -> None:
        x, y = (place + np.linspace(-reach, reach, PIXELS) for place in expected)
        image = mf.focus(sweep, x=x, y=y)
        # Unlike the amplitude, the power is smooth where the echo falls to zero, so that splines fit it.
        self.power = RectBivariateSpline(y, x, np.abs(image.values.astype(complex)) ** 2, kx=3, ky=3)
        scale = self.at(expected)
        peak = minimize(lambda place: -self.at(expected + 1e-3 * place) / scale, np.zeros(2), method="Nelder-Mead",
                        options={"xatol": 1e-4, "fatol": 1e-12})  # fmt: skip
        self.top = expected + 1e-3 * peak.x

    def at(self, place: Array) -> float:
        """The power at a place (2,) [m]."""
        return float(self.power(place[1], place[0], grid=False))

    def width(self, along: Array) -> float:
        """Full width at half power through the peak, in one direction (2,) [m]."""
        half = 0.5 * self.at(self.top)
        along = unit(along)
        sides = []
        for sign in (1.0, -1.0):
            step = next(d for d in np.arange(1e-3, 0.2, 1e-3) if self.at(self.top + sign * d * along) < half)
            sides.append(brentq(lambda d, s=sign: self.at(self.top + s * d * along) - half, step - 1e-3, step))
        return float(sum(sides))
