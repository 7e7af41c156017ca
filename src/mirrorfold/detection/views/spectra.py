"""The spectrum of an echo, from the complex image.

Along a line of sight, the complex image is the Fourier transform of the sweep over frequency. So the echo at a place is
cut out by a window along its line of sight and transformed back: this gives its amplitude and phase at each frequency.
"""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.constants import speed_of_light

from mirrorfold.common.types import Array
from mirrorfold.common.windows import window
from mirrorfold.detection.views.view import View

GATE_CELLS = 3.0
"""Half-length, in range cells, of the Hann window that cuts out an echo: the echoes of a pane as thick as a cell lie
within it."""

WHOLE_CELLS, LONG_CELLS, EDGE_CELLS = 2.0, 4.0, 2.0
"""Half-length, in range cells, of the flat top of windows that cut out a whole echo, with all that goes to and fro in a
pane as thick as a cell, and a long piece around the echo; and length of their edges."""

SAMPLES_PER_CELL = 6
"""Samples per range cell along the line of sight."""

BAND_SHARE, FREQUENCIES = 0.42, 21
"""Largest distance of a frequency from the middle of the band, in bandwidths: near its ends, the taper leaves little of
the band. And number of frequencies: enough for the longest window."""


def wavenumbers(image: xr.DataArray) -> Array:
    """Wavenumbers [rad/m] at which spectra are computed, one way, (m,)."""
    low, high = float(image.attrs["frequency_start"]), float(image.attrs["frequency_stop"])
    speed = float(image.attrs.get("wave_speed", speed_of_light))
    around = np.linspace(-BAND_SHARE, BAND_SHARE, FREQUENCIES) * (high - low)
    return 2.0 * np.pi * (0.5 * (low + high) + around) / speed


def independent(view: View, image: xr.DataArray) -> float:
    """Number of independent values in a spectrum: its span over ``pi / (GATE_CELLS range_cell)`` [rad/m], the width of
    the spectrum of the window that cuts out an echo.
    """
    return float(np.ptp(wavenumbers(image)) / np.pi * GATE_CELLS * view.range_cell)


def spectra(
    view: View, image: xr.DataArray, points: Array, *, flat_cells: float | None = None
) -> NDArray[np.complex128]:
    """Spectra of the echoes that a complex image or volume holds at points (n, d) [m], at the `wavenumbers`, (n, m).

    A window that is flat for `flat_cells` to either side leaves the shape of the spectrum as it is; by default it is
    Hann's.
    """
    wavenumber = wavenumbers(image)
    middle = wavenumber[wavenumber.size // 2]
    flat, edge = (0.0, GATE_CELLS) if flat_cells is None else (flat_cells, EDGE_CELLS)
    half = (flat + edge) * view.range_cell
    depth, values = view.complex_along(image, points, half, view.range_cell / SAMPLES_PER_CELL, float(middle))
    beyond = np.clip((np.abs(depth) / view.range_cell - flat) / edge, 0.0, 1.0)
    turn = np.exp(-2j * np.outer(depth, wavenumber - middle))
    return (values * np.cos(0.5 * np.pi * beyond) ** 2) @ turn


def tapers(image: xr.DataArray) -> Array:
    """Weights of the window over frequency with which the image was focused, at the `wavenumbers`, (m,)."""
    kind = image.attrs.get("taper", "hann")
    points = np.size(kind) if not isinstance(kind, str) else int(image.attrs["frequency_points"])
    weight = np.abs(window(kind, points, "taper"))
    share = np.linspace(0.5 - BAND_SHARE, 0.5 + BAND_SHARE, FREQUENCIES)
    return np.interp(share, np.linspace(0.0, 1.0, points), weight / weight.max())
