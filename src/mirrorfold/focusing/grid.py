"""The default pixel grid, from the resolution cell and the ambiguous range of a sweep."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr
from scipy.constants import speed_of_light

from mirrorfold.common.statistics import mean_step
from mirrorfold.common.types import Array
from mirrorfold.errors import InputError
from mirrorfold.sweep import antenna_positions, wave_speed

ENDLESS = 100.0
"""A single frequency has no ambiguous range. The default grid then ends at this many times its near end, or around the
centre of a scene this many range resolution cells to either side."""

FIELD_OF_VIEW = 0.9
"""Half width of the default grid in cross-range over its far range: the sine of the largest angle off broadside. It is
large because ghosts stand far to the side."""

CELLS_PER_RESOLUTION = 2.0
"""Pixels per resolution cell, in range and in cross-range."""

NEAR_SHARE = 1.0 / 6.0
"""Nearest range of interest, as a share of the far range. Cross-range cells grow with range; the width of the pixels is
chosen for this range."""

MAXIMUM_PIXELS = 3_000_000
"""Number of pixels of the default grid, at most: where there would be more, the pixels are made larger."""

RANGE_SHARE = 0.995
"""Far end of the default grid, as a share of the ambiguous range: just short of it."""


@dataclass(frozen=True)
class Extent:
    """Resolution cell and range limits that follow from band and aperture.

    Attributes
    ----------
    range_resolution : float [m]
        ``c / (2 B)``.
    angle_resolution : float [rad]
        ``lambda / (2 D)`` at broadside, with the aperture D.
    ambiguous_range : float [m]
        ``c / (2 df)``; infinite for a single frequency.
    near : float [m]
        The y at which the grid begins: the y of the foremost antenna plus the largest of aperture, range resolution
        and two wavelengths. Nearer pixels would show coupling: waves straight from antenna to antenna seem to come
        from ranges up to half the aperture, surface waves of a solid from ranges up to nearly all of it.
    aperture : float [m]
        Length D of the two-way array: half the length of the transmitters plus half that of the receivers.
    """

    range_resolution: float
    angle_resolution: float
    ambiguous_range: float
    near: float
    aperture: float


def extent(frequency: Array, tx: Array, rx: Array, wave_speed: float = speed_of_light) -> Extent:
    """Resolution and range limits of `frequency` [Hz] with antennas at `tx`, `rx` (n, 3) [m]."""
    step = mean_step(frequency)
    band = step * frequency.size
    wavelength = wave_speed / float(frequency.mean())
    aperture = 0.5 * float(np.linalg.norm(np.ptp(tx, axis=0)) + np.linalg.norm(np.ptp(rx, axis=0)))
    ambiguous = wave_speed / (2.0 * step) if step > 0.0 else float("inf")
    range_resolution = wave_speed / (2.0 * band) if band > 0.0 else wavelength
    front = float(max(tx[:, 1].max(), rx[:, 1].max()))
    return Extent(
        range_resolution=range_resolution,
        angle_resolution=wavelength / (2.0 * aperture) if aperture > 0.0 else 1.0,
        ambiguous_range=ambiguous,
        near=front + max(range_resolution, aperture, 2.0 * wavelength),
        aperture=aperture,
    )


def default_grid(
    frequency: Array,
    tx: Array,
    rx: Array,
    wave_speed: float = speed_of_light,
    maximum_pixels: int = MAXIMUM_PIXELS,
    centre: Array | None = None,
) -> tuple[Array, Array]:
    """Pixel coordinates x and y [m] of everything that the array can see.

    y runs from just in front of the array to the ambiguous range R, x symmetrically over ``|x| <= 0.9 R`` around the
    array. Pixels are half a range resolution cell ``c/(2B)`` deep and half a cross-range cell
    ``r lambda / (2 D)`` wide at the nearest range of interest r = R/6, but never wider than deep: far to the
    side, range runs along x. Where there would be more than `maximum_pixels`, depth and width grow by the same factor.

    Where the centre of a scene is given, the pixels fill a square around it, whose half diagonal is half the ambiguous
    range; they are square, half a resolution cell wide.

    Parameters
    ----------
    frequency : (frequencies,) array [Hz]
    tx, rx : (n, 3) arrays [m]
    wave_speed : float [m/s]
    maximum_pixels : int
    centre : (3,) array [m], optional

    Returns
    -------
    x, y : 1D arrays [m]

    Raises
    ------
    InputError
        If nothing lies between the array and the ambiguous range.
    """
    limits = extent(frequency, tx, rx, wave_speed)
    if centre is not None:
        return _square(
            limits, centre, float(np.linalg.norm(0.5 * (tx.mean(axis=0) + rx.mean(axis=0)) - centre)), maximum_pixels
        )
    far = RANGE_SHARE * limits.ambiguous_range if np.isfinite(limits.ambiguous_range) else ENDLESS * limits.near
    middle = 0.5 * (tx[:, 0].mean() + rx[:, 0].mean())
    side = FIELD_OF_VIEW * far
    pitch_y = limits.range_resolution / CELLS_PER_RESOLUTION
    pitch_x = min(pitch_y, NEAR_SHARE * far * limits.angle_resolution / CELLS_PER_RESOLUTION)
    last = 0.5 * float(tx[:, 1].mean() + rx[:, 1].mean()) + far
    if last <= limits.near:
        raise InputError(
            f"pixels: the ambiguous range of {limits.ambiguous_range:.3g} m ends before {limits.near:.3g} m, the least "
            f"distance at which an array of {limits.aperture:.3g} m sees, with waves of {wave_speed:.3g} m/s; measure "
            "at smaller frequency steps, correct wave_speed, or give the pixels x and y"
        )
    wanted = 2.0 * side / pitch_x * (last - limits.near) / pitch_y
    growth = max(1.0, float(np.sqrt(wanted / maximum_pixels)))
    pitch_x, pitch_y = growth * pitch_x, growth * pitch_y
    half = int(np.ceil(side / pitch_x))
    x = middle + pitch_x * np.arange(-half, half + 1)
    y = limits.near + pitch_y * np.arange(int((last - limits.near) / pitch_y) + 1)
    return np.asarray(x), np.asarray(y)


def _square(limits: Extent, centre: Array, distance: float, maximum_pixels: int) -> tuple[Array, Array]:
    """Square grid x, y [m] of unambiguous ranges around the centre of a scene, at a distance [m] from the radar."""
    half = (
        0.5 * limits.ambiguous_range / np.sqrt(2.0)
        if np.isfinite(limits.ambiguous_range)
        else ENDLESS * limits.range_resolution
    )
    cell = min(limits.range_resolution, max(distance, half) * limits.angle_resolution) / CELLS_PER_RESOLUTION
    pitch = max(cell, 2.0 * half / np.sqrt(maximum_pixels))
    steps = pitch * np.arange(-int(half / pitch), int(half / pitch) + 1)
    return np.asarray(centre[0] + steps), np.asarray(centre[1] + steps)


def sweep_grid(sweep: xr.Dataset) -> tuple[Array, Array]:
    """The default grid x, y [m] of a sweep, with the wave speed of the sweep: see `default_grid`."""
    return default_grid(
        sweep["frequency"].values, *antenna_positions(sweep), wave_speed(sweep), centre=scene_centre(sweep)
    )


def scene_centre(sweep: xr.Dataset) -> Array | None:
    """Centre (3,) [m] of the scene that antennas stand around, by the attr `scene_center`; None without it."""
    centre = sweep.attrs.get("scene_center")
    return None if centre is None else np.asarray(centre, dtype=float)
