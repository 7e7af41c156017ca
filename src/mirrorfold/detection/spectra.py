"""What an image holds at a place, frequency by frequency: the echo's spectrum, cut out along its line of sight."""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.constants import speed_of_light
from scipy.ndimage import map_coordinates, spline_filter

from mirrorfold.common.types import Array
from mirrorfold.detection.image_view import ImageView

GATE_CELLS = 3.0
"""An echo is cut out up to so many range cells before and behind it, by a Hann window: what a pane as thick as a cell
makes of one echo lies within."""

SAMPLES_PER_CELL = 6
"""Of the line of sight there."""

BAND_SHARE, FREQUENCIES = 0.42, 15
"""Frequencies lie so far to either side of the middle, in bandwidths, and are so many: the taper ends the band."""


def offsets(image: xr.DataArray) -> Array:
    """Wavenumbers [rad/m] at which spectra are taken, (m,)."""
    low, high = float(image.attrs["frequency_start"]), float(image.attrs["frequency_stop"])
    speed = float(image.attrs.get("wave_speed", speed_of_light))
    around = np.linspace(-BAND_SHARE, BAND_SHARE, FREQUENCIES) * (high - low)
    return np.asarray(2.0 * np.pi * (0.5 * (low + high) + around) / speed)


def independent(view: ImageView, image: xr.DataArray) -> float:
    """How many values of a spectrum are independent: the span of the frequencies over the width of the window's own."""
    return float(np.ptp(offsets(image)) / np.pi * GATE_CELLS * view.range_cell)


def spectra(view: ImageView, image: xr.DataArray, range_: Array, u: Array) -> NDArray[np.complex128]:
    """Spectra of what a complex image (y, x) holds at ranges [m] and sines u, (n,) each: (n, m) at `offsets`."""
    wavenumber = offsets(image)
    middle = wavenumber[wavenumber.size // 2]
    half = GATE_CELLS * view.range_cell
    depth = np.arange(-half, half, view.range_cell / SAMPLES_PER_CELL)
    window = np.cos(0.5 * np.pi * depth / half) ** 2
    x, y = image["x"].values.astype(float), image["y"].values.astype(float)
    places = view.to_points(range_[:, None] + depth, np.broadcast_to(u[:, None], (u.size, depth.size)))
    pixel = [(places[..., 1] - y[0]) / (y[1] - y[0]), (places[..., 0] - x[0]) / (x[1] - x[0])]
    # Only the part of the image about these places is looked at; the carrier is taken out before it is interpolated.
    low = [max(int(np.floor(axis.min())) - 16, 0) for axis in pixel]
    high = [int(np.ceil(axis.max())) + 17 for axis in pixel]
    part = image.values[low[0] : high[0], low[1] : high[1]]
    across, ahead = x[low[1] : high[1]] - view.radar[0], y[low[0] : high[0]] - view.radar[1]
    distance = np.hypot(across[None, :], ahead[:, None])
    carried = part * np.exp(-2j * middle * distance)
    where = [axis - first for axis, first in zip(pixel, low, strict=True)]
    values = sum(
        unit * map_coordinates(spline_filter(piece), where, prefilter=False, order=3)
        for unit, piece in ((1.0, carried.real), (1j, carried.imag))
    )
    turn = np.exp(-2j * np.outer(depth, wavenumber - middle))
    return np.asarray((values * window) @ turn)
