"""What follows from a sweep's coordinates and attributes: its kind, antenna positions, wavenumbers and resolution."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.constants import speed_of_light

from mirrorfold.common.types import Array

AXES = ("x", "y", "z")
TIME_CONVENTION = "exp(+jwt)"
CONJUGATED = "exp(-jwt)"

PAIR_DIMENSIONS = ("frequency", "tx", "rx")

MONOSTATIC_DIMENSIONS = ("frequency", "position")

RASTER_DIMENSIONS = ("frequency", "azimuth", "elevation")

STEP_TOLERANCE = 1e-3
"""Largest deviation of a frequency step from the mean step, as a share of the mean step. With 1000 steps it causes a
phase error of a few degrees at the end of the unambiguous range."""

EXACT = 1e-9
"""Deviation of frequencies from equal steps, as a share of the step, up to which their steps are equal: the rounding of
double precision."""

LARGEST_ROUNDING = 0.1
"""Largest rounding of frequencies to single precision, as a share of the step, that is taken for rounding."""

AXES_REMEDY = (
    'name the axes of the positions anew when importing (axes = ["y", "-x", "z"]), or give the place of the scene as '
    "scene_center, or the pixels x and y"
)
"""Advice where the antennas do not stand along x."""

ASKEW, UPRIGHT = 0.5, 0.01
"""Largest extents by which `misaligned_axis` recognises an array along another axis than x.

Along x, as a share of the extent along y: below it, the array is turned by more than 63 degrees, and looks aside.
Along x and y, as a share of the extent along z: below it, the array is only as wide as its positions are inexact."""


def without_rounding(frequency: NDArray[Any]) -> NDArray[Any]:
    """Frequencies [Hz] in exactly equal steps if only rounding makes their steps differ; otherwise unchanged.

    Rounding moves a frequency by at most `STEP_TOLERANCE` of the step, in single precision by more: near 300 GHz, by 16
    kHz.
    """
    if frequency.ndim != 1 or frequency.size < 2 or frequency.dtype.kind != "f" or not np.isfinite(frequency).all():
        return frequency
    even = np.linspace(float(frequency[0]), float(frequency[-1]), frequency.size)
    step, moved = float(even[1] - even[0]), float(np.abs(even - frequency).max())
    most = STEP_TOLERANCE * step
    if frequency.dtype.itemsize <= np.dtype(np.float32).itemsize:
        most = max(most, min(float(np.spacing(np.abs(frequency).max())), LARGEST_ROUNDING * step))
    return even if EXACT * step < moved <= most else frequency


def uneven_steps(frequency: Array) -> str:
    """Which frequencies [Hz] stand twice, or are missing, where their steps are not equal; empty if that is not why.

    Examples
    --------
    >>> uneven_steps(1e9 * np.array([76.0, 76.1, 76.1, 76.2])), uneven_steps(1e6 * np.array([4.0, 4.1, 4.2, 4.4, 4.5]))
    ('76.1 GHz stands twice', '4.3 MHz is missing')
    >>> uneven_steps(1e9 * np.array([1.0, 2.0, 4.0, 8.0]))
    ''
    """
    rising = np.sort(frequency)
    step = np.diff(rising)
    usual = float(np.median(step))
    count = np.rint(step / usual) if usual > 0.0 else np.zeros(0)
    if not count.size or np.abs(step - count * usual).max() > STEP_TOLERANCE * usual * count.size:
        return ""
    twice = np.unique(rising[1:][count == 0])
    if twice.size:
        return f"{_named(twice)} {'stand' if twice.size > 1 else 'stands'} twice"
    gaps = zip(rising[:-1], count.astype(int), strict=True)
    missing = np.array([first + usual * n for first, steps in gaps for n in range(1, min(steps, frequency.size))])
    if not 0 < missing.size < 0.5 * frequency.size:
        return ""
    return f"{_named(missing)} {'are' if missing.size > 1 else 'is'} missing"


def _named(frequency: Array) -> str:
    """The first three frequencies [Hz] as text, in the unit that suits them."""
    unit, size = next(
        ((unit, size) for unit, size in (("GHz", 1e9), ("MHz", 1e6)) if frequency[0] >= size), ("Hz", 1.0)
    )
    more = ", ..." if frequency.size > 3 else ""
    return f"{', '.join(f'{one / size:.6g}' for one in frequency[:3])}{more} {unit}"


def is_raster(sweep: xr.Dataset) -> bool:
    """Whether a sweep is a raster scan, ``s(frequency, azimuth, elevation)``."""
    return isinstance(sweep, xr.Dataset) and "s" in sweep and sweep["s"].dims[-3:] == RASTER_DIMENSIONS


def is_monostatic(sweep: xr.Dataset) -> bool:
    """Whether every antenna of a sweep receives only its own signal, ``s(frequency, position)``."""
    return isinstance(sweep, xr.Dataset) and "s" in sweep and sweep["s"].dims[-2:] == MONOSTATIC_DIMENSIONS


def antenna_positions(sweep: xr.Dataset) -> tuple[Array, Array]:
    """Positions of the transmitters and of the receivers [m], (tx, 3) and (rx, 3); the same in monostatic sweeps."""
    names = ("antenna_position",) * 2 if "antenna_position" in sweep.variables else ("tx_position", "rx_position")
    tx, rx = (np.ascontiguousarray(sweep[name].values, dtype=np.float64) for name in names)
    return tx, rx


def wave_speed(sweep: xr.Dataset) -> float:
    """Speed of the waves [m/s]: the attr `wave_speed`, by default the speed of light in vacuum."""
    return float(sweep.attrs.get("wave_speed", speed_of_light))


def wavenumber(sweep: xr.Dataset) -> NDArray[np.float64]:
    """Wavenumbers [rad/m] at the frequencies, ``2 pi f / c`` with the sweep's own wave speed c."""
    return np.asarray(2.0 * np.pi * sweep["frequency"].values.astype(float) / wave_speed(sweep))


def radar_position(sweep: xr.Dataset) -> Array:
    """Position of the radar, (3,) [m]: midway between the mean tx and mean rx positions, or where the beams start."""
    if is_raster(sweep):
        return np.array(sweep.attrs.get("origin", (0.0, 0.0, 0.0)), dtype=float)
    tx, rx = antenna_positions(sweep)
    return np.asarray(0.5 * (tx.mean(axis=0) + rx.mean(axis=0)))


def misaligned_axis(sweep: xr.Dataset) -> str | None:
    """The axis, "y" or "z", along which all antennas stand instead of along x; None where they do not.

    The floor plan lies before the array, in the direction y. An array along y or z hardly tells directions in it. None
    too for raster scans and for antennas around a scene, which have a `scene_center`.
    """
    if is_raster(sweep) or sweep.attrs.get("scene_center") is not None:
        return None
    spans = [span for span in (np.ptp(places, axis=0) for places in antenna_positions(sweep)) if span.any()]
    if spans and all(span[0] < ASKEW * span[1] and span[2] <= span[1] for span in spans):
        return "y"
    return "z" if spans and all(max(span[0], span[1]) < UPRIGHT * span[2] for span in spans) else None


def frequency_step(sweep: xr.Dataset) -> float:
    """Mean distance between neighbouring frequencies [Hz]; infinite for a single frequency."""
    frequency = sweep["frequency"].values
    return float((frequency[-1] - frequency[0]) / (frequency.size - 1)) if frequency.size > 1 else float("inf")


def ambiguous_range(sweep: xr.Dataset) -> float:
    """The range [m] at which echoes wrap around to zero, ``c / (2 df)``; infinite for a single frequency."""
    return np.inf if sweep.sizes["frequency"] == 1 else wave_speed(sweep) / (2.0 * frequency_step(sweep))


def range_resolution(sweep: xr.Dataset) -> float:
    """Range resolution [m], ``c / (2 B)`` with the bandwidth B of all samples; infinite for a single frequency."""
    return ambiguous_range(sweep) / sweep.sizes["frequency"]
