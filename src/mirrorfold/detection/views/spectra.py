"""What an image holds at a place, frequency by frequency: the echo's spectrum, cut out along its line of sight."""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.constants import speed_of_light

from mirrorfold.common.types import Array
from mirrorfold.common.windows import window
from mirrorfold.detection.views.view import View

GATE_CELLS = 3.0
"""An echo is cut out up to so many range cells before and behind it, by a Hann window: what a pane as thick as a cell
makes of one echo lies within."""

WHOLE_CELLS = 4.0
"""A whole echo, with all that runs to and fro in a pane as thick as a cell, lies within so many range cells before and
behind it; half as far nothing is taken off."""

SAMPLES_PER_CELL = 6
"""Samples of the line of sight there, in a range cell."""

BAND_SHARE, FREQUENCIES = 0.42, 15
"""Frequencies lie so far to either side of the middle, in bandwidths, and are so many: the taper ends the band."""


def offsets(image: xr.DataArray) -> Array:
    """Wavenumbers [rad/m] at which spectra are taken, (m,)."""
    low, high = float(image.attrs["frequency_start"]), float(image.attrs["frequency_stop"])
    speed = float(image.attrs.get("wave_speed", speed_of_light))
    around = np.linspace(-BAND_SHARE, BAND_SHARE, FREQUENCIES) * (high - low)
    return np.asarray(2.0 * np.pi * (0.5 * (low + high) + around) / speed)


def independent(view: View, image: xr.DataArray) -> float:
    """How many values of a spectrum are independent: the frequencies span so many widths of the window's spectrum."""
    return float(np.ptp(offsets(image)) / np.pi * GATE_CELLS * view.range_cell)


def spectra(view: View, image: xr.DataArray, points: Array, *, whole: bool = False) -> NDArray[np.complex128]:
    """Spectra of what a complex image or volume holds at points (n, d) [m]: (n, m) at `offsets`.

    A `whole` echo is cut out by a window with a flat top, which leaves its shape over frequency as it is.
    """
    wavenumber = offsets(image)
    middle = wavenumber[wavenumber.size // 2]
    half = (WHOLE_CELLS if whole else GATE_CELLS) * view.range_cell
    depth, values = view.held_along(image, points, half, view.range_cell / SAMPLES_PER_CELL, float(middle))
    beyond = np.clip(2.0 * np.abs(depth) / half - 1.0, 0.0, 1.0) if whole else np.abs(depth) / half
    turn = np.exp(-2j * np.outer(depth, wavenumber - middle))
    return np.asarray((values * np.cos(0.5 * np.pi * beyond) ** 2) @ turn)


def tapers(image: xr.DataArray) -> Array:
    """The window over frequency that an image was focused with, at `offsets`, (m,)."""
    kind = image.attrs.get("taper", "hann")
    points = np.size(kind) if not isinstance(kind, str) else int(image.attrs["frequency_points"])
    weight = np.abs(window(kind, points, "taper"))
    share = np.linspace(0.5 - BAND_SHARE, 0.5 + BAND_SHARE, FREQUENCIES)
    return np.asarray(np.interp(share, np.linspace(0.0, 1.0, points), weight / weight.max()))
