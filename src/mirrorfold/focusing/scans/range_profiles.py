"""Imaging a raster scan: S11 of every beam becomes its range profile, and all beams together a volume."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.constants import speed_of_light
from scipy.fft import ifft, next_fast_len

from mirrorfold.common.arguments import in_message, wrong_kind
from mirrorfold.common.beams import beam_radius
from mirrorfold.common.facts import VOLUME
from mirrorfold.common.kernels import njit
from mirrorfold.common.normalization import RANGE_POWERS, VOLUME_NORMALIZATIONS
from mirrorfold.common.settings import takes
from mirrorfold.common.statistics import in_equal_steps, mean_step
from mirrorfold.common.threads import counted, for_each
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
from mirrorfold.sweep.samples import check_level

LEAKAGE_BEAMS = 400
"""Approximate number of beams, evenly chosen, that give the leakage: its noise is then 6 % of that of a single beam."""

PADDING = 2
"""Range samples per range cell c/(2B): two, because the amplitude has twice the bandwidth of the complex profile."""


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

    With ``k_m = k_0 + m dk`` and ``r_n = n pi / (N dk)`` the sum is an inverse Fourier transform of length N::

        I(r_n) = exp(2 j k_0 r_n) sum_m a[m] S[m] exp(2 pi j m n / N).

    Each azimuth is cut to `limits` as soon as it is transformed, so that the padded volume never exists as a whole.

    Parameters
    ----------
    sweep : xarray.Dataset
        ``s(frequency, azimuth, elevation)``.
    limits : (nearest, farthest) [m], optional
        Limits of the range; by default zero and the ambiguous range.
    padding : int
        Range samples per range cell c/(2B).
    remove_leakage : bool
        Subtract the median over the beams: what leaks inside the instrument is the same in all of them.
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
    return Profiles.of(sweep, settings, limits, padding, remove_leakage).volume(progress=progress)


@dataclass(frozen=True, eq=False)
class Profiles:
    """How the samples of a raster scan become range profiles, one azimuth after the other.

    Attributes
    ----------
    samples : (azimuths, elevations, frequencies) complex array
        The samples of the sweep, not copied.
    weights : (frequencies,) complex64 array
        The taper.
    size : int
        Length of the Fourier transform.
    span : slice
        Part of the transform whose ranges are kept.
    turn : (ranges,) complex64 array
        Factor of each range: phase ``exp(2 j k_0 r)``, length of the transform, and normalization.
    leakage : (ranges,) complex64 array
        Median profile of the beams, which is subtracted; zero where the leakage is to stay.
    coords, attrs : dict
        Coordinates and attributes of the volume.
    """

    samples: NDArray[np.complexfloating]
    weights: NDArray[np.complex64]
    size: int
    span: slice
    turn: NDArray[np.complex64]
    leakage: NDArray[np.complex64]
    coords: dict[str, Any]
    attrs: dict[str, Any]

    @classmethod
    def of(
        cls,
        sweep: xr.Dataset,
        settings: FocusSettings,
        limits: tuple[float, float] | None = None,
        padding: int = PADDING,
        remove_leakage: bool = True,
    ) -> Profiles:
        """The profiles of a scan; the arguments are those of `focus_raster`.

        Raises
        ------
        InputError
            As `focus_raster`.
        """
        sweep = check_sweep(sweep)
        check_level("sweep: s", sweep["s"].values)
        if settings.wave_speed is not None:
            sweep = sweep.assign_attrs(wave_speed=float(settings.wave_speed))
        if sweep["s"].ndim != 3:
            raise InputError(f"sweep: s has dimensions {sweep['s'].dims}; image one polarization or frame at a time")
        if sweep.sizes["frequency"] < 2:
            raise InputError("sweep: has a single frequency, so ranges cannot be told apart; sweep a band")
        if padding < 1 or int(padding) != padding:
            raise InputError(f"padding is {in_message(padding)}, expected a whole number of at least 1")
        frequency = sweep["frequency"].values.astype(float)
        weights = window(settings.taper, frequency.size, "taper")
        size = int(next_fast_len(int(padding) * frequency.size))
        step, span = ambiguous_range(sweep) / size, _kept(limits, ambiguous_range(sweep), size)
        range_: Array = step * np.arange(span.start, span.stop, dtype=float)
        turn = np.exp(2j * (wavenumber(sweep)[0] * range_))
        turn *= size * spreading(sweep.attrs, range_, float(frequency.mean()), settings.normalization, "sweep")
        coords: dict[str, Any] = {
            "range": ("range", range_, {"units": "m"}),
            "azimuth": ("azimuth", sweep["azimuth"].values.astype(float), {"units": "degree"}),
            "elevation": ("elevation", sweep["elevation"].values.astype(float), {"units": "degree"}),
        }
        found = cls(
            samples=np.moveaxis(sweep["s"].values, 0, -1),
            weights=weights.astype(np.complex64),
            size=size,
            span=span,
            turn=turn.astype(np.complex64),
            leakage=np.zeros(range_.size, dtype=np.complex64),
            coords=coords,
            attrs=_attrs_of(sweep, settings, weights),
        )
        return replace(found, leakage=found._common()) if remove_leakage else found

    def of_beams(self, samples: NDArray[np.complexfloating]) -> NDArray[np.complex64]:
        """Range profiles (beams, ranges) of samples (beams, frequencies), with the leakage still in them."""
        padded = np.zeros((len(samples), self.size), dtype=np.complex64)
        np.multiply(samples, self.weights, out=padded[:, : samples.shape[1]])
        return np.asarray(ifft(padded, axis=1, overwrite_x=True)[:, self.span] * self.turn)

    def _common(self) -> NDArray[np.complex64]:
        """The leakage (ranges,), which all beams have in common: the median over beams of real and imaginary parts.

        A mean would put a bright echo of a few beams into all of them.
        """
        columns, rows = self.samples.shape[:2]
        some = np.arange(0, columns * rows, max(1, columns * rows // LEAKAGE_BEAMS) | 1)
        profiles = self.of_beams(self.samples[some // rows, some % rows])
        middle = np.median(profiles.real, axis=0) + 1j * np.median(profiles.imag, axis=0)
        return np.asarray(middle, dtype=np.complex64)

    @property
    def shape(self) -> tuple[int, int, int]:
        """Azimuths, elevations and ranges of the volume."""
        columns, rows, _ = self.samples.shape
        return columns, rows, self.turn.size

    def beams(self, columns: range, *, amplitude: bool = False, progress: Progress | None = None) -> NDArray[Any]:
        """The volume (azimuths, elevations, ranges) of some azimuths, or only its amplitude, in half the memory.

        It is made azimuth by azimuth: padded profiles never exist as a whole, nor complex ones where only the amplitude
        is wanted.
        """
        kind = np.float32 if amplitude else np.complex64
        out: NDArray[Any] = np.empty((len(columns), *self.shape[1:]), dtype=kind)

        def column(i: int) -> None:
            found = self.of_beams(self.samples[columns[i]])
            np.subtract(found, self.leakage, out=found if amplitude else out[i])
            if amplitude:
                magnitude(found.reshape(-1), out[i].reshape(-1))

        for_each(column, range(len(columns)), counted(progress, len(columns)))
        return out

    def volume(self, *, amplitude: bool = False, progress: Progress | None = None) -> xr.DataArray:
        """The volume (range, azimuth, elevation), or only its amplitude, with coordinates and attributes."""
        values = np.moveaxis(self.beams(range(self.shape[0]), amplitude=amplitude, progress=progress), -1, 0)
        return xr.DataArray(values, dims=VOLUME, coords=self.coords, attrs=self.attrs, name="image")


def _kept(limits: tuple[float, float] | None, ambiguous: float, size: int) -> slice:
    """Which of `size` ranges, in equal steps up to the ambiguous range [m], lie within the limits [m].

    Raises
    ------
    InputError
        If the limits are no rising ranges up to the ambiguous one, or too few ranges lie within them.
    """
    step = ambiguous / size
    nearest, farthest = limits if limits is not None else (0.0, ambiguous)
    if not 0.0 <= nearest < farthest <= ambiguous * (1.0 + 1e-9):
        raise InputError(
            f"limits are {nearest:g} to {farthest:g} m, expected rising ranges up to the unambiguous {ambiguous:.3g} m"
        )
    first, last = int(np.ceil(nearest / step - 1e-9)), min(int(np.floor(farthest / step + 1e-9)) + 1, size)
    if last - first < 4:
        raise InputError(
            f"limits are {nearest:g} to {farthest:g} m, less than four samples of {step:.2g} m; widen them"
        )
    return slice(first, last)


def _attrs_of(sweep: xr.Dataset, settings: FocusSettings, weights: NDArray[Any]) -> dict[str, Any]:
    """Attributes of the volume of a scan, whose frequencies have these weights, (frequencies,)."""
    frequency = sweep["frequency"].values.astype(float)
    return {
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
        "normalization": settings.normalization,
        **{name: sweep.attrs[name] for name in ("title", "instrument", "spot_radius", "focus_distance")
           if name in sweep.attrs},
    }  # fmt: skip


def spreading(attrs: dict[Any, Any], range_: Array, frequency: float, normalization: str, source: str) -> Array:
    """Factor of a volume's normalization at each range [m]: it undoes the spreading of the waves.

    For "beam" it is ``w(r)^2 / w0^2``, with the radius w(r) of the focused beam and w0 at the focus, from the attrs
    `spot_radius` and `focus_distance` [m]. The wavelength follows from the attr `wave_speed` [m/s], by default
    that of light, and the `frequency` [Hz].

    Raises
    ------
    InputError
        If the attrs are missing, or volumes do not have this normalization; `source` names what lacks the attrs.
    """
    if normalization not in VOLUME_NORMALIZATIONS:
        raise InputError(
            f"normalization is {in_message(normalization)}, which a raster scan does not have; "
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
    """The values of a volume with the range axis last, (azimuth, elevation, range), not copied."""
    if not isinstance(volume, xr.DataArray) or volume.dims != VOLUME:
        raise wrong_kind("volume", volume, "a volume (range, azimuth, elevation), as focus returns of a raster scan")
    return np.asarray(np.moveaxis(volume.values, 0, -1))


def angle_table(angle: Array) -> Array:
    """First angle and step [rad] of an axis of angles [degree]: the index of an angle is ``(angle - first) / step``.

    Raises
    ------
    InputError
        If the steps are not equal.
    """
    if angle.size < 2 or not in_equal_steps(angle):
        raise InputError("image: azimuth and elevation must rise in equal steps; resample the scan")
    return np.radians(np.array([angle[0], mean_step(angle)]))


@njit(nogil=True, fastmath=True, error_model="numpy", inline="always")
def at_point(amplitude, a, e, k):  # type: ignore[no-untyped-def]
    """Trilinear interpolation of an amplitude (azimuth, elevation, range) at fractional indices.

    Zero outside, and from the last sample of each axis on, behind which there is none to interpolate with.
    """
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
def magnitude(values, out):  # type: ignore[no-untyped-def]
    """out[i] = |values[i]|."""
    for i in range(values.size):
        out[i] = np.sqrt(values[i].real * values[i].real + values[i].imag * values[i].imag)


def magnitudes(values: NDArray[Any]) -> NDArray[np.float32]:
    """Absolute values in single precision, (azimuth, elevation, range), contiguous.

    A contiguous array of float32 without negative values is returned as it is.
    """
    if values.dtype == np.float32 and values.min(initial=0.0) >= 0.0:
        return np.ascontiguousarray(values)
    out = np.empty(values.shape, dtype=np.float32)
    if values.dtype == np.complex64:
        for_each(lambda i: magnitude(values[i].ravel(), out[i].reshape(-1)), range(len(values)))
    else:
        wide = np.float32 if values.dtype.kind in "iu" else values.dtype  # the least integer has no absolute value
        for_each(lambda i: np.abs(values[i].astype(wide), out=out[i], casting="same_kind"), range(len(values)))
    return out
