"""The volume of a raster scan on Cartesian pixels: its floor plan, or its voxels."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from mirrorfold.common.arguments import number
from mirrorfold.common.kernels import njit
from mirrorfold.common.memory import check_room
from mirrorfold.common.threads import for_each
from mirrorfold.common.types import Array
from mirrorfold.errors import InputError
from mirrorfold.focusing.problem import pixel_axis
from mirrorfold.focusing.scans.range_profiles import angle_table, at_point, beams_of, magnitudes

VOXEL_BYTES = 4.0
"""Bytes of the amplitude of a voxel."""


def plan_view(volume: xr.DataArray, *, pixel: float | None = None) -> xr.DataArray:
    """The floor plan of a volume: the strongest voxel of each vertical column.

    Parameters
    ----------
    volume : (range, azimuth, elevation) DataArray
    pixel : float [m], optional
        By default two range samples.

    Returns
    -------
    (y, x) DataArray
        Amplitude, float32.

    Raises
    ------
    InputError
        If this is no volume, or the pixel no positive length.
    """
    amplitude = magnitudes(beams_of(volume))
    range_, azimuth, elevation = (volume[name].values.astype(float) for name in volume.dims)
    step = float(range_[1] - range_[0])
    pixel = 2.0 * step if pixel is None else number("pixel", pixel, "m", above=0.0)
    polar = np.zeros((azimuth.size, range_.size), dtype=np.float32)

    def column(i: int) -> None:
        strongest(amplitude[i], np.cos(np.radians(elevation)), float(range_[0]), step, polar[i])

    for_each(column, range(azimuth.size))
    side = np.radians(azimuth[[0, -1]])
    x = np.arange(
        np.floor(min(range_[-1] * np.sin(side[0]), 0) / pixel), range_[-1] * max(np.sin(side[1]), 0) / pixel + 1
    )
    y = np.arange(max(np.floor(range_[0] * np.cos(np.abs(side).max()) / pixel), 1.0), range_[-1] / pixel + 1)
    x, y = x * pixel, y * pixel
    values = np.zeros((y.size, x.size), dtype=np.float32)
    angle = np.interp(np.degrees(np.arctan2(x[None, :], y[:, None])), azimuth, np.arange(azimuth.size), -1.0, -1.0)
    polar_to_plan(polar, x, y, angle, float(range_[0]), step, values)
    origin = np.asarray(volume.attrs.get("radar_position", (0.0, 0.0, 0.0)), dtype=float)
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
        If there are no voxels, or their coordinates do not rise in equal steps.
    """
    amplitude = magnitudes(beams_of(volume))
    coords = {name: volume[name].values.astype(float) for name in volume.dims}
    voxels = Voxels.of(coords, volume.attrs, x=x, y=y, z=z)
    voxels.fill(amplitude, range(len(amplitude)))
    return voxels.labelled()


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
        origin = np.asarray(attrs.get("radar_position", (0.0, 0.0, 0.0)), dtype=float)
        given = {name: pixel_axis(axis, name) for name, axis in (("z", z), ("y", y), ("x", x))}
        for name, axis in given.items():
            steps = np.diff(axis)
            if steps.size and steps.min() <= 0:
                raise InputError(f"{name} must be a rising list of coordinates in metres; sort it")
            if steps.size and np.ptp(steps) > 1e-3 * steps.mean():
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
        return xr.DataArray(values, dims=("z", "y", "x"), coords=coords, attrs=attrs, name="image")


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
    for j in range(x.size):
        ground = x[j] * x[j] + y * y
        flat = np.sqrt(ground)
        a = (np.arctan2(x[j], y) - azimuth[0]) / azimuth[1]
        if a < 0.0 or a > columns - 1 or int(a) < begin or int(a) + 1 >= begin + amplitude.shape[0]:
            continue
        for i in range(z.size):
            r = np.sqrt(ground + z[i] * z[i])
            e = (np.arctan(z[i] / flat) - elevation[0]) / elevation[1]
            out[j, i] = at_point(amplitude, a - begin, e, (r - first) / step)
