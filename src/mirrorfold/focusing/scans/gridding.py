"""The volume of a raster scan on Cartesian pixels: its floor plan, or its voxels."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from mirrorfold.common.arguments import number
from mirrorfold.common.facts import VOLUME, VOXELS, check_facts, check_unit, doubt_angles, radar_place
from mirrorfold.common.kernels import njit
from mirrorfold.common.memory import check_room
from mirrorfold.common.plausible import not_finite
from mirrorfold.common.statistics import in_equal_steps
from mirrorfold.common.threads import for_each
from mirrorfold.common.types import Array
from mirrorfold.errors import InputError
from mirrorfold.focusing.problem import pixel_axis
from mirrorfold.focusing.scans.range_profiles import angle_table, at_point, beams_of, magnitudes

PLAN_BYTES = 28.0
"""Bytes of a pixel of a plan view while it is made: its amplitude, and three angles."""

FINEST_PIXEL = 1e-3
"""Finest pixel of a plan view, in range samples."""

VOXEL_BYTES = 4.0
"""Bytes of the amplitude of a voxel."""


def plan_view(volume: xr.DataArray, *, pixel: float | None = None) -> xr.DataArray:
    """The floor plan of a volume: the strongest voxel of each vertical column.

    Parameters
    ----------
    volume : (range, azimuth, elevation) DataArray
        Azimuths may have unequal steps, and there may be a single elevation.
    pixel : float [m], optional
        By default two range samples.

    Returns
    -------
    (y, x) DataArray
        Amplitude, float32.

    Raises
    ------
    InputError
        If this is no volume with rising coordinates, or the pixel is too fine.
    """
    amplitude = _samples(volume)
    range_, azimuth, elevation = _coordinates(volume, {"range": 2, "azimuth": 2, "elevation": 1}).values()
    step = float(range_[1] - range_[0])
    pixel = 2.0 * step if pixel is None else number("pixel", pixel, "m", lowest=FINEST_PIXEL * step)
    polar = np.zeros((azimuth.size, range_.size), dtype=np.float32)

    def column(i: int) -> None:
        strongest(amplitude[i], np.cos(np.radians(elevation)), float(range_[0]), step, polar[i])

    for_each(column, range(azimuth.size))
    # The border of the plan goes through ends of the scan, or where it crosses an axis.
    quarters = 90.0 * np.arange(np.ceil(azimuth[0] / 90.0), azimuth[-1] / 90.0)
    side = np.radians(np.concatenate([azimuth[[0, -1]], quarters]))
    across, ahead = (np.multiply.outer(range_[[0, -1]], wave(side)) for wave in (np.sin, np.cos))
    x = np.arange(np.floor(min(across.min(), 0.0) / pixel), max(across.max(), 0.0) / pixel + 1)
    y = np.arange(np.floor(ahead.min() / pixel) or 1.0, ahead.max() / pixel + 1)
    x, y = x * pixel, y * pixel
    check_room(PLAN_BYTES * x.size * y.size, f"a plan view of {x.size} x {y.size} pixels", "ask for larger pixels")
    values = np.zeros((y.size, x.size), dtype=np.float32)
    angle = np.degrees(np.arctan2(x[None, :], y[:, None]))
    angle += 360.0 * np.rint((0.5 * (azimuth[0] + azimuth[-1]) - angle) / 360.0)
    angle = np.interp(angle, azimuth, np.arange(azimuth.size), -1.0, -1.0)
    polar_to_plan(polar, x, y, angle, float(range_[0]), step, values)
    origin = radar_place(volume.attrs)
    coords: dict[str, Any] = {
        "y": ("y", y + origin[1], {"units": "m", "long_name": "range"}),
        "x": ("x", x + origin[0], {"units": "m", "long_name": "cross-range"}),
    }
    attrs = {**volume.attrs, "mirrorfold_kind": "image"}
    return xr.DataArray(values, dims=("y", "x"), coords=coords, attrs=attrs, name="image")


def to_voxels(volume: xr.DataArray, *, x: ArrayLike, y: ArrayLike, z: ArrayLike) -> xr.DataArray:
    """Amplitude of a volume on a Cartesian grid, interpolated linearly in range, azimuth and elevation.

    Parameters
    ----------
    volume : (range, azimuth, elevation) DataArray
    x, y, z : 1D arrays [m]

    Returns
    -------
    (z, y, x) DataArray
        Float32; zero outside of the scan.

    Raises
    ------
    InputError
        If there are no voxels, or coordinates do not rise in equal steps.
    """
    amplitude = _samples(volume)
    coords = _coordinates(volume, dict.fromkeys(VOLUME, 2))
    voxels = Voxels.of(coords, volume.attrs, x=x, y=y, z=z)
    voxels.fill(amplitude, range(len(amplitude)))
    return voxels.labelled()


def _samples(volume: xr.DataArray) -> NDArray[np.float32]:
    """The amplitude of a volume, (azimuth, elevation, range).

    Raises
    ------
    InputError
        If this is no volume, or samples are not finite.
    """
    values = beams_of(volume)
    if missing := not_finite(values):
        wrong = f"{missing} of {values.size} samples are not finite (NaN or infinite); replace them, as by zero"
        raise InputError(f"volume: {wrong}")
    return magnitudes(values)


def _coordinates(volume: xr.DataArray, least: Mapping[str, int]) -> dict[str, Array]:
    """Range [m], azimuth and elevation [degree] of a volume, with at least as many values as `least` says.

    Raises
    ------
    InputError
        If there are fewer, they do not rise, or ranges do not in equal steps; or if attributes say what cannot be.
    """
    check_facts(volume.attrs, "volume")
    for name, count in least.items():
        if name not in volume.coords or volume.sizes[name] < count:
            raise InputError(f"volume: needs a coordinate {name} [m or degree] with at least {count} values")
        check_unit(volume[name], "volume")
        step = np.diff(volume[name].values.astype(float))
        if not (step > 0.0).all():
            raise InputError(f"volume: the coordinate {name} does not rise; sort it, as by volume.sortby({name!r})")
        if name == "elevation" and np.abs(volume[name].values).max() > 90.0:
            raise InputError("volume: elevations go beyond -90 to 90 degrees; give them above the horizon, in degrees")
        if name == "range" and not in_equal_steps(volume[name].values):
            raise InputError("volume: the coordinate range does not rise in equal steps; resample the volume")
    doubt_angles(volume, "volume")
    return {name: volume[name].values.astype(float) for name in least}


@dataclass(frozen=True, eq=False)
class Voxels:
    """The amplitude of a volume on a Cartesian grid, filled in azimuth by azimuth, as these are imaged.

    Attributes
    ----------
    values : (y, x, z) array
        Amplitudes, in single precision; zero where nothing has been filled in.
    axes : tuple of three 1D arrays [m]
        x, y and z relative to the radar.
    given : dict of 1D array [m]
        z, y and x as they were given.
    azimuth, elevation : (2,) arrays [rad]
        First angle and step, see `angle_table`.
    columns : int
        Number of azimuths of the whole volume.
    first, step : float [m]
        Range of the first sample, and distance from one sample to the next.
    attrs : dict
    """

    values: NDArray[np.float32]
    axes: tuple[Array, Array, Array]
    given: dict[str, Array]
    azimuth: Array
    elevation: Array
    columns: int
    first: float
    step: float
    attrs: dict[Any, Any]

    @classmethod
    def of(
        cls, coords: Mapping[Any, Array], attrs: dict[Any, Any], *, x: ArrayLike, y: ArrayLike, z: ArrayLike
    ) -> Voxels:
        """Empty voxels for a volume with these coordinates `range` [m], `azimuth` and `elevation` [degree].

        Raises
        ------
        InputError
            If there are no voxels, their coordinates do not rise in equal steps, or they do not fit into the memory.
        """
        origin = radar_place(attrs)
        given = {name: pixel_axis(axis, name) for name, axis in (("z", z), ("y", y), ("x", x))}
        for name, axis in given.items():
            steps = np.diff(axis)
            if steps.size and steps.min() <= 0:
                raise InputError(f"{name} must be a rising list of coordinates in metres; sort it")
            if not in_equal_steps(axis):
                raise InputError(f"{name} must rise in equal steps; resample it")
        shape = given["y"].size, given["x"].size, given["z"].size
        check_room(
            VOXEL_BYTES * np.prod(shape, dtype=float), f"{np.prod(shape, dtype=float):.3g} voxels", "ask for fewer"
        )
        range_ = coords["range"]
        return cls(
            values=np.zeros(shape, dtype=np.float32),
            axes=(given["x"] - origin[0], given["y"] - origin[1], given["z"] - origin[2]),
            given=given,
            azimuth=angle_table(coords["azimuth"]),
            elevation=angle_table(coords["elevation"]),
            columns=coords["azimuth"].size,
            first=float(range_[0]),
            step=float(range_[1] - range_[0]),
            attrs=attrs,
        )

    def fill(self, amplitude: NDArray[np.float32], columns: range) -> None:
        """Fill in the voxels between the azimuths `columns`, from their amplitude (azimuths, elevations, ranges)."""

        def row(i: int) -> None:
            grid_row(amplitude, columns.start, self.columns, self.axes[0], float(self.axes[1][i]), self.axes[2],
                     self.azimuth, self.elevation, self.first, self.step, self.values[i])  # fmt: skip

        for_each(row, range(self.axes[1].size))

    def labelled(self) -> xr.DataArray:
        """The image (z, y, x)."""
        coords: dict[str, Any] = {name: (name, axis, {"units": "m"}) for name, axis in self.given.items()}
        attrs = {**self.attrs, "mirrorfold_kind": "image"}
        values = np.moveaxis(self.values, -1, 0)
        return xr.DataArray(values, dims=VOXELS, coords=coords, attrs=attrs, name="image")


@njit(nogil=True, fastmath=True, error_model="numpy")
def strongest(profile, cosine, first, step, out):  # type: ignore[no-untyped-def]
    """``out[k] = max_e profile[e](r_k / cosine[e])``: the strongest echo of an azimuth at each ground range."""
    for e in range(cosine.size):
        for k in range(out.size):
            at = ((first + k * step) / cosine[e] - first) / step
            i = int(at)
            if i + 1 < out.size:
                share = np.float32(at - i)
                value = profile[e, i] * (np.float32(1.0) - share) + profile[e, i + 1] * share
                out[k] = max(out[k], value)


@njit(nogil=True, fastmath=True, error_model="numpy")
def polar_to_plan(polar, x, y, angle, first, step, out):  # type: ignore[no-untyped-def]
    """Bilinear interpolation from (azimuth, ground range) to (y, x); `angle`: fractional azimuth index, -1 outside."""
    for i in range(y.size):
        for j in range(x.size):
            a = angle[i, j]
            at = (np.sqrt(x[j] * x[j] + y[i] * y[i]) - first) / step
            if a < 0.0 or at < 0.0 or at >= polar.shape[1] - 1:
                continue
            p, k = min(int(a), polar.shape[0] - 2), int(at)
            u, v = a - p, at - k
            near = polar[p, k] * (1.0 - v) + polar[p, k + 1] * v
            far = polar[p + 1, k] * (1.0 - v) + polar[p + 1, k + 1] * v
            out[i, j] = near * (1.0 - u) + far * u


@njit(nogil=True, fastmath=True, error_model="numpy")
def grid_row(amplitude, begin, columns, x, y, z, azimuth, elevation, first, step, out):  # type: ignore[no-untyped-def]
    """Write the voxels (x, z) of one y. All voxels of a vertical column have the same azimuth.

    `amplitude` holds the azimuths from index `begin` on, out of `columns` of the volume; other voxels are not changed.
    """
    middle, turn = 0.5 * (columns - 1), 2.0 * np.pi / azimuth[1]
    for j in range(x.size):
        ground = x[j] * x[j] + y * y
        flat = np.sqrt(ground)
        a = (np.arctan2(x[j], y) - azimuth[0]) / azimuth[1]
        a -= turn * np.rint((a - middle) / turn)  # a scan may look anywhere
        if a < 0.0 or a > columns - 1 or int(a) < begin or int(a) + 1 >= begin + amplitude.shape[0]:
            continue
        for i in range(z.size):
            r = np.sqrt(ground + z[i] * z[i])
            e = (np.arctan2(z[i], flat) - elevation[0]) / elevation[1]
            out[j, i] = at_point(amplitude, a - begin, e, (r - first) / step)
