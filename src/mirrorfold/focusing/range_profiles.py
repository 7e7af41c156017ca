"""Imaging a raster scan: S11 of every beam becomes its range profile, and all beams together a volume."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray
from scipy.constants import speed_of_light
from scipy.fft import ifft, next_fast_len

from mirrorfold.common.arguments import wrong_kind
from mirrorfold.common.beams import beam_radius
from mirrorfold.common.kernels import njit
from mirrorfold.common.normalization import RANGE_POWERS, VOLUME_NORMALIZATIONS
from mirrorfold.common.settings import takes
from mirrorfold.common.threads import for_each
from mirrorfold.common.types import Array, Progress
from mirrorfold.common.windows import window
from mirrorfold.errors import InputError
from mirrorfold.focusing.settings import FocusSettings
from mirrorfold.sweep import (
    ambiguous_range,
    check_sweep,
    frequency_step,
    radar_position,
    range_resolution,
    wave_speed,
    wavenumber,
)

LEAKAGE_BEAMS = 400
"""The leakage is taken from about as many beams, evenly chosen: what noise is left in it is 6 % of a beam's own."""

PADDING = 2
"""Samples per range cell c/(2B): the amplitude, unlike the complex profile, has twice its bandwidth."""


@takes(FocusSettings, without=("x", "y", "z", "tolerance", "apodization", "memory_limit"))
def focus_raster(
    sweep: xr.Dataset,
    *,
    limits: tuple[float, float] | None = None,
    padding: int = PADDING,
    remove_leakage: bool = True,
    progress: Progress | None = None,
    **given: Any,
) -> xr.DataArray:
    """Range profiles of all beams: ``I(r) = sum_m a[m] S[m] exp(+2 j k_m r)`` with the taper a over frequency.

    The sum is an inverse Fourier transform, ``k_m = k_0 + m dk`` and ``r_n = n pi / (N dk)``::

        I(r_n) = exp(2 j k_0 r_n) sum_m a[m] S[m] exp(2 pi j m n / N).

    The profiles are cut to `limits` as soon as each azimuth is transformed, so that the padded whole never exists.

    Parameters
    ----------
    sweep : xarray.Dataset
        ``s(frequency, azimuth, elevation)``.
    limits : (nearest, farthest) [m], optional
        Of the range; by default up to the ambiguous range.
    padding : int
        Range samples per cell c/(2B).
    remove_leakage : bool
        Subtract the median over all beams: what leaks inside the instrument is the same in all of them.
    progress : callable (done, total), optional
    **given

    Returns
    -------
    (range, azimuth, elevation) DataArray
        Complex64; range varies fastest in memory. Among its attrs are the band and the `wave_speed` [m/s].

    Raises
    ------
    InputError
        If the sweep or an argument cannot be used; for the normalization "beam" without the attrs `spot_radius` and
        `focus_distance` [m] of the sweep.
    """
    settings = FocusSettings().with_given(**given)
    sweep = check_sweep(sweep)
    if settings.wave_speed is not None:
        sweep = sweep.assign_attrs(wave_speed=float(settings.wave_speed))
    if sweep["s"].ndim != 3:
        raise InputError(f"sweep: s has dimensions {sweep['s'].dims}; image one polarization or frame at a time")
    if sweep.sizes["frequency"] < 2:
        raise InputError("sweep: has a single frequency, so ranges cannot be told apart; sweep a band")
    if padding < 1 or int(padding) != padding:
        raise InputError(f"padding is {padding!r}, expected a whole number of at least 1")
    normalization = settings.normalization
    frequency = sweep["frequency"].values.astype(float)
    weights = window(settings.taper, frequency.size, "taper")
    size = int(next_fast_len(int(padding) * frequency.size))
    step = ambiguous_range(sweep) / size
    nearest, farthest = limits if limits is not None else (0.0, ambiguous_range(sweep))
    if not 0.0 <= nearest < farthest <= ambiguous_range(sweep) * (1.0 + 1e-9):
        raise InputError(
            f"limits are {nearest:g} to {farthest:g} m, expected rising ranges up to the unambiguous "
            f"{ambiguous_range(sweep):.3g} m"
        )
    first, last = int(np.ceil(nearest / step - 1e-9)), min(int(np.floor(farthest / step + 1e-9)) + 1, size)
    if last - first < 4:
        raise InputError(
            f"limits are {nearest:g} to {farthest:g} m, less than four samples of {step:.2g} m; widen them"
        )
    range_: Array = step * np.arange(first, last, dtype=float)
    turn = np.exp(2j * (wavenumber(sweep)[0] * range_))
    turn *= size * spreading(sweep.attrs, range_, float(frequency.mean()), normalization, "sweep")
    turn = turn.astype(np.complex64)
    s = np.moveaxis(sweep["s"].values, 0, -1)
    volume = np.empty((*s.shape[:2], last - first), dtype=np.complex64)
    done = 0

    def column(i: int) -> None:
        padded = np.zeros((s.shape[1], size), dtype=np.complex64)
        np.multiply(s[i], weights.astype(np.complex64), out=padded[:, : frequency.size])
        np.multiply(ifft(padded, axis=1, overwrite_x=True)[:, first:last], turn, out=volume[i])

    def count() -> None:
        nonlocal done
        done += 1
        if progress is not None:
            progress(done, s.shape[0])

    for_each(column, range(s.shape[0]), count)
    if remove_leakage:
        leakage = _common(volume)
        for_each(lambda i: np.subtract(volume[i], leakage, out=volume[i]), range(s.shape[0]))
    attrs: dict[str, Any] = {
        "mirrorfold_kind": "image",
        "radar_position": radar_position(sweep),
        "ambiguous_range": ambiguous_range(sweep),
        "range_resolution": range_resolution(sweep),
        "frequency_start": float(frequency[0]),
        "frequency_stop": float(frequency[-1]),
        "frequency_step": frequency_step(sweep),
        "frequency_points": int(frequency.size),
        "wave_speed": wave_speed(sweep),
        "taper": settings.taper if isinstance(settings.taper, str) else np.abs(weights),
        "normalization": normalization,
        **{name: sweep.attrs[name] for name in ("title", "instrument", "spot_radius", "focus_distance")
           if name in sweep.attrs},
    }  # fmt: skip
    coords: dict[str, Any] = {
        "range": ("range", range_, {"units": "m"}),
        "azimuth": ("azimuth", sweep["azimuth"].values.astype(float), {"units": "degree"}),
        "elevation": ("elevation", sweep["elevation"].values.astype(float), {"units": "degree"}),
    }
    dims = ("range", "azimuth", "elevation")
    return xr.DataArray(np.moveaxis(volume, -1, 0), dims=dims, coords=coords, attrs=attrs, name="image")


def _common(volume: NDArray[np.complex64]) -> NDArray[np.complex64]:
    """What all beams have in common, (ranges,): the median of real and imaginary parts.

    A mean would spread a bright echo of a few beams over all of them.
    """
    profiles = volume.reshape(-1, volume.shape[-1])
    some = profiles[:: max(1, len(profiles) // LEAKAGE_BEAMS) | 1]
    middle = np.median(some.real, axis=0) + 1j * np.median(some.imag, axis=0)
    return np.asarray(middle, dtype=np.complex64)


def spreading(attrs: dict[Any, Any], range_: Array, frequency: float, normalization: str, source: str) -> Array:
    """What one of the `VOLUME_NORMALIZATIONS` multiplies each range [m] with.

    That of the beam is ``w(r)^2 / w0^2`` of the focused beam that the attrs `spot_radius` and `focus_distance` [m]
    describe. Its wavelength is that of the attr `wave_speed` [m/s], by default of light, at a frequency [Hz].

    Raises
    ------
    InputError
        If the attrs are missing, or the normalization is none of a volume; `source` names where they are missing.
    """
    if normalization not in VOLUME_NORMALIZATIONS:
        raise InputError(
            f"normalization is {normalization!r}, which a raster scan does not have; "
            f"expected one of {', '.join(VOLUME_NORMALIZATIONS)}"
        )
    if normalization != "beam":
        return np.asarray(range_ ** float(RANGE_POWERS[normalization]))
    if "spot_radius" not in attrs or "focus_distance" not in attrs:
        raise InputError(
            f"{source}: has no attrs spot_radius and focus_distance [m], which the normalization 'beam' needs; "
            "add them, or choose 'r2' or 'none'"
        )
    spot = float(attrs["spot_radius"])
    wavelength = float(attrs.get("wave_speed", speed_of_light)) / frequency
    width = beam_radius(range_, spot_radius=spot, focus_distance=float(attrs["focus_distance"]), wavelength=wavelength)
    return np.asarray((width / spot) ** 2)


def beams_of(volume: xr.DataArray) -> NDArray[Any]:
    """The values with the range axis last, contiguous: (azimuth, elevation, range)."""
    if not isinstance(volume, xr.DataArray) or volume.dims != ("range", "azimuth", "elevation"):
        raise wrong_kind("volume", volume, "a volume (range, azimuth, elevation), as focus returns of a raster scan")
    return np.ascontiguousarray(np.moveaxis(volume.values, 0, -1))


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
    """
    amplitude = magnitudes(beams_of(volume))
    range_, azimuth, elevation = (volume[name].values.astype(float) for name in volume.dims)
    step = float(range_[1] - range_[0])
    pixel = 2.0 * step if pixel is None else float(pixel)
    if not (np.isfinite(pixel) and pixel > 0.0):
        raise InputError(f"pixel is {pixel!r}, expected a length in metres above zero")
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
    beams = beams_of(volume)
    origin = np.asarray(volume.attrs.get("radar_position", (0.0, 0.0, 0.0)), dtype=float)
    axes = []
    for name, axis, shift in zip("xyz", (x, y, z), origin, strict=True):
        axis = np.atleast_1d(np.asarray(axis, dtype=float))
        steps = np.diff(axis)
        if axis.ndim != 1 or not axis.size or not np.isfinite(axis).all() or (steps.size and steps.min() <= 0):
            raise InputError(f"{name} must be a rising list of at least one finite coordinate in metres")
        if steps.size and np.ptp(steps) > 1e-3 * steps.mean():
            raise InputError(f"{name} must rise in equal steps; resample it")
        axes.append(axis - shift)
    amplitude = magnitudes(beams)
    range_, azimuth, elevation = (volume[name].values.astype(float) for name in volume.dims)
    values = np.empty((axes[1].size, axes[0].size, axes[2].size), dtype=np.float32)
    grid = angle_table(azimuth), angle_table(elevation)

    def row(i: int) -> None:
        grid_row(amplitude, axes[0], float(axes[1][i]), axes[2], *grid, float(range_[0]),
                  float(range_[1] - range_[0]), values[i])  # fmt: skip

    for_each(row, range(axes[1].size))
    coords: dict[str, Any] = {
        name: (name, np.atleast_1d(np.asarray(axis, dtype=float)), {"units": "m"})
        for name, axis in (("z", z), ("y", y), ("x", x))
    }
    attrs = {**volume.attrs, "mirrorfold_kind": "image"}
    return xr.DataArray(np.moveaxis(values, -1, 0), dims=("z", "y", "x"), coords=coords, attrs=attrs, name="image")


def angle_table(angle: Array) -> Array:
    """First angle and step [rad] of an axis of angles [degree]: they turn an angle into its index by one division.

    Raises
    ------
    InputError
        If the steps are not equal.
    """
    step = np.diff(angle)
    if not step.size or np.ptp(step) > 1e-3 * step.mean():
        raise InputError("image: azimuth and elevation must rise in equal steps; resample the scan")
    return np.radians(np.array([angle[0], step.mean()]))


@njit(nogil=True, fastmath=True, error_model="numpy")
def strongest(profile, cosine, first, step, out):  # type: ignore[no-untyped-def]
    """``out[k] = max_e profile[e](r_k / cosine[e])``: along one azimuth, what stands above each ground range."""
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
    """Bilinear interpolation from (azimuth, ground range) to (y, x); `angle` is the azimuth's index, -1 outside."""
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


@njit(nogil=True, fastmath=True, error_model="numpy", inline="always")
def at_point(amplitude, a, e, k):  # type: ignore[no-untyped-def]
    """Trilinear interpolation of (azimuth, elevation, range) at fractional indices; zero outside."""
    if not (a >= 0.0 and e >= 0.0 and k >= 0.0):
        return np.float32(0.0)
    i, j, n = int(a), int(e), int(k)
    if i + 1 >= amplitude.shape[0] or j + 1 >= amplitude.shape[1] or n + 1 >= amplitude.shape[2]:
        return np.float32(0.0)
    u, v, w = np.float32(a - i), np.float32(e - j), np.float32(k - n)
    low = amplitude[i, j, n] + w * (amplitude[i, j, n + 1] - amplitude[i, j, n])
    high = amplitude[i, j + 1, n] + w * (amplitude[i, j + 1, n + 1] - amplitude[i, j + 1, n])
    near = low + v * (high - low)
    low = amplitude[i + 1, j, n] + w * (amplitude[i + 1, j, n + 1] - amplitude[i + 1, j, n])
    high = amplitude[i + 1, j + 1, n] + w * (amplitude[i + 1, j + 1, n + 1] - amplitude[i + 1, j + 1, n])
    return near + u * (low + v * (high - low) - near)


@njit(nogil=True, fastmath=True, error_model="numpy")
def grid_row(amplitude, x, y, z, azimuth, elevation, first, step, out):  # type: ignore[no-untyped-def]
    """Voxels of one y: (x, z). The azimuth of a vertical column is that of its foot."""
    for j in range(x.size):
        ground = x[j] * x[j] + y * y
        flat = np.sqrt(ground)
        a = (np.arctan2(x[j], y) - azimuth[0]) / azimuth[1]
        if a < 0.0 or a > amplitude.shape[0] - 1:
            out[j] = 0.0
            continue
        for i in range(z.size):
            r = np.sqrt(ground + z[i] * z[i])
            e = (np.arctan(z[i] / flat) - elevation[0]) / elevation[1]
            out[j, i] = at_point(amplitude, a, e, (r - first) / step)


@njit(nogil=True, fastmath=True, error_model="numpy")
def magnitude(values, out):  # type: ignore[no-untyped-def]
    """out[i] = |values[i]|."""
    for i in range(values.size):
        out[i] = np.sqrt(values[i].real * values[i].real + values[i].imag * values[i].imag)


def magnitudes(values: NDArray[Any]) -> NDArray[np.float32]:
    """Absolute values in single precision, (azimuth, elevation, range)."""
    if values.dtype != np.complex64:
        return np.abs(values).astype(np.float32)
    out = np.empty(values.shape, dtype=np.float32)
    for_each(lambda i: magnitude(values[i].ravel(), out[i].reshape(-1)), range(len(values)))
    return out
