"""Step 2 in three dimensions, first half: the echoes in a raster volume as a cloud of points.

Everything is judged beam by beam: a beam's echoes are the runs of its range profile that stand above the noise, and of
neighbouring beams that see the same thing those count whose axis passes near it.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cached_property

import numba
import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.constants import speed_of_light

from mirrorfold.common.beams import beam_angles, beam_direction, beam_radius
from mirrorfold.common.threads import for_each
from mirrorfold.detection.image_echoes import FALSE_ALARMS, RAYLEIGH_MEDIAN, SIDE_LOBE_MARGIN_DB
from mirrorfold.errors import InputError
from mirrorfold.focusing.range_profiles import angle_table, beam_area, beams_of

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]

HANN_CELL = 2.0
"""Half-amplitude width of the Hann window's main lobe in units of c/(2B)."""

RUN_DB = -12.0
"""An echo's run of samples ends where its amplitude falls this far below its peak: speckle fades by as much."""

RIDGE_DB = -9.0
"""An echo this far below the one that a neighbouring beam sees at the same range is the edge of that beam's: at 0.7
beam radii the two-way pattern has fallen by as much."""

DYNAMIC_RANGE_DB = -80.0
"""Nothing this far below the brightest echo counts, however low the noise: no instrument's beam or window is
cleaner."""

MOST_ECHOES = 24
"""In one beam; the strongest count."""

NOISE_SAMPLES = 400_000
"""From as many samples, evenly chosen, the noise is estimated: the median is then good to 0.2 %."""


@dataclass(frozen=True, eq=False)
class RadarVolume:
    """A raster volume as the radar sees it: normalised amplitude, with what is known of the beam.

    Attributes
    ----------
    amplitude : (azimuths, elevations, ranges) array
        Single precision, without any normalisation.
    range : (ranges,) array [m]
    azimuth, elevation : 1D arrays [degree]
    gain : (ranges,) array
        What normalises the amplitude.
    noise : float
        Standard deviation of the real part of the noise in `amplitude`.
    origin : (3,) array [m]
    range_cell : float [m]
        Width of an echo between half-amplitude points.
    spot_radius, focus_distance, wavelength : float [m]
        Of the beam.
    taper : str
        Window over frequency.
    """

    amplitude: NDArray[np.float32]
    range: Array
    azimuth: Array
    elevation: Array
    gain: Array
    noise: float
    origin: Array
    range_cell: float
    spot_radius: float
    focus_distance: float
    wavelength: float
    taper: str = "hann"

    @property
    def step(self) -> float:
        """Range step [m]."""
        return float(self.range[1] - self.range[0])

    @property
    def floor(self) -> float:
        """Amplitude, not normalised, that noise stays below in the whole volume."""
        noise = float(np.sqrt(2.0 * np.log(self.amplitude.size / FALSE_ALARMS)) * self.noise)
        return max(noise, self.brightest * 10.0 ** (DYNAMIC_RANGE_DB / 20.0))

    @cached_property
    def brightest(self) -> float:
        """Largest amplitude, not normalised."""
        return float(self.amplitude.max())

    @cached_property
    def side_lobes(self) -> NDArray[np.float32]:
        """Envelope of the window's side lobes, with a margin, by distance from the edge of an echo in samples.

        With x in units of c/(2B): ``1 / (pi x (x^2 - 1))`` for Hann, ``1 / (pi x / 2)^2`` for the triangle, and
        ``1 / (pi x)``, the slowest, for any other window (Harris, Proc. IEEE 66, 1978).
        """
        # The edge of a run, 12 dB below its peak, is more than one unit away from it.
        x = 1.0 + np.arange(1, self.range.size + 1) * self.step / (self.range_cell / HANN_CELL)
        envelope = {"hann": 1.0 / (np.pi * x * (x**2 - 1.0)), "triangular": 4.0 / (np.pi * x) ** 2}
        level = envelope.get(self.taper, 1.0 / (np.pi * x)) * 10.0 ** (SIDE_LOBE_MARGIN_DB / 20.0)
        return np.minimum(level, 1.0).astype(np.float32)

    @cached_property
    def sight(self) -> Array:
        """Directions of all beams, (azimuths, elevations, 3)."""
        return beam_direction(self.azimuth[:, None], self.elevation[None, :])

    @property
    def shape(self) -> tuple[int, int]:
        """Number of azimuths and elevations."""
        return self.azimuth.size, self.elevation.size

    @property
    def beam_step(self) -> float:
        """Angle between neighbouring beams [rad]."""
        return float(np.radians(0.5 * (np.diff(self.azimuth).mean() + np.diff(self.elevation).mean())))

    def width(self, range_: Array | float) -> Array:
        """Radius of the beam [m] at ranges [m]."""
        return beam_radius(
            range_, spot_radius=self.spot_radius, focus_distance=self.focus_distance, wavelength=self.wavelength
        )

    def beam_of(self, points: Array) -> tuple[Index, Mask]:
        """Number of the beam nearest to points (n, 3) [m], and whether they lie inside the scan."""
        azimuth, elevation = beam_angles(points - self.origin)
        column = np.rint((azimuth - self.azimuth[0]) / np.diff(self.azimuth).mean()).astype(np.intp)
        row = np.rint((elevation - self.elevation[0]) / np.diff(self.elevation).mean()).astype(np.intp)
        inside = (column >= 0) & (column < self.shape[0]) & (row >= 0) & (row < self.shape[1])
        return np.where(inside, column * self.shape[1] + row, 0), inside


def to_radar_volume(volume: xr.DataArray, *, normalization: str | None = None) -> RadarVolume:
    """What detection needs to know of a raster volume.

    Parameters
    ----------
    volume : (range, azimuth, elevation) DataArray
        Complex or amplitude. Attrs: `normalization` done already, `frequency_start`, `frequency_stop`,
        `frequency_points`, `spot_radius`, `focus_distance` [m], `radar_position`.
    normalization : {"beam", "r2", "none"}, optional
        By default for the beam if it is known, else for range squared.

    Raises
    ------
    InputError
        If the volume cannot be used.
    """
    if not isinstance(volume, xr.DataArray) or volume.dims != ("range", "azimuth", "elevation"):
        found = getattr(volume, "dims", type(volume).__name__)
        raise InputError(f"image: has dimensions {found}, expected a volume (range, azimuth, elevation)")
    if min(volume.shape) < 4:
        raise InputError(f"image: has the shape {volume.shape}, expected at least four samples along each axis")
    axes = [volume[name].values.astype(float) for name in volume.dims]
    for name, axis in zip(volume.dims, axes, strict=True):
        steps = np.diff(axis)
        if not np.isfinite(axis).all() or steps.min() <= 0 or np.ptp(steps) > 1e-3 * steps.mean():
            raise InputError(f"image: the coordinate {name} does not rise in equal steps; resample to a regular grid")
    angle_table(axes[1])
    amplitude: NDArray[np.float32] = _magnitudes(beams_of(volume))
    if not np.isfinite(amplitude).all():
        raise InputError("image: holds pixels that are not finite (NaN or infinite); mask them with 0")
    if not amplitude.any():
        raise InputError("image: every pixel is zero; there is nothing to fold")
    attrs = volume.attrs
    range_ = axes[0]
    step = float(range_[1] - range_[0])
    frequency = 0.5 * (float(attrs.get("frequency_start", 285e9)) + float(attrs.get("frequency_stop", 285e9)))
    known = "spot_radius" in attrs and "focus_distance" in attrs
    chosen = normalization if normalization is not None else ("beam" if known else "r2")

    def gain_of(kind: str) -> Array:
        if kind == "beam":
            return beam_area(attrs, range_, frequency, "image")
        if kind == "r2":
            return range_**2
        if kind == "none":
            return np.ones_like(range_)
        raise InputError(f"normalization is {kind!r}, expected one of none, r2, beam")

    done = gain_of(str(attrs.get("normalization", "none")))
    if np.ptp(done) > 0.0:
        amplitude /= np.maximum(done, 1e-12).astype(np.float32)
    stride = max(1, amplitude.size // NOISE_SAMPLES)
    # An odd stride visits all ranges and beams alike.
    sample = amplitude.ravel()[:: stride | 1]
    resolution = float(attrs.get("range_resolution", step))
    spot = float(attrs["spot_radius"]) if known else float(np.radians(np.diff(axes[1]).mean())) * float(range_.mean())
    return RadarVolume(
        amplitude=amplitude,
        range=range_,
        azimuth=axes[1],
        elevation=axes[2],
        gain=gain_of(chosen),
        noise=float(np.median(sample[sample > 0.0])) / RAYLEIGH_MEDIAN,
        origin=np.asarray(attrs.get("radar_position", (0.0, 0.0, 0.0)), dtype=float),
        range_cell=max(HANN_CELL * resolution, 2.0 * step),
        spot_radius=spot,
        focus_distance=float(attrs["focus_distance"]) if known else float(range_.mean()),
        wavelength=speed_of_light / frequency,
        taper=str(attrs.get("taper", "hann")),
    )


def _magnitudes(values: NDArray[np.complex64]) -> NDArray[np.float32]:
    out = np.empty(values.shape, dtype=np.float32)
    for_each(lambda i: np.abs(values[i], out=out[i], casting="same_kind"), range(len(values)))
    return out


@dataclass(frozen=True, eq=False)
class Cloud:
    """Echoes of a raster volume.

    Attributes
    ----------
    position : (n, 3) array [m]
        On the axis of the beam, in the volume, before any folding.
    range : (n,) array [m]
        Centre of power of the echo's run: finer than a sample.
    beam : (n,) array of int
        ``azimuth index * elevations + elevation index``.
    amplitude : (n,) array
        Of the run's peak, normalised.
    contrast : (n,) array
        The same over the noise floor.
    """

    position: Array
    range: Array
    beam: Index
    amplitude: Array
    contrast: Array

    def take(self, which: Mask | Index) -> Cloud:
        """Some of the points, by mask or index."""
        return replace(self, **{field.name: getattr(self, field.name)[which] for field in fields(self)})


def find_peaks(volume: RadarVolume) -> Cloud:
    """All echoes above the noise, with sub-sample ranges."""
    cell = max(1, round(0.5 * volume.range_cell / volume.step))
    columns, rows = volume.shape
    beams = np.zeros((columns, rows * MOST_ECHOES), dtype=np.int64)
    found = np.zeros((columns, rows * MOST_ECHOES, 2))
    counts = np.zeros(columns, dtype=np.int64)

    def column(i: int) -> None:
        counts[i] = _peaks_of(
            volume.amplitude, i, np.float32(volume.floor), np.float32(10.0 ** (RUN_DB / 20.0)),
            np.float32(10.0 ** (RIDGE_DB / 20.0)), volume.side_lobes, cell, beams[i], found[i],
        )  # fmt: skip

    for_each(column, range(columns))
    beam = np.concatenate([beams[i, :n] + i * rows for i, n in enumerate(counts)])
    values = np.concatenate([found[i, :n] for i, n in enumerate(counts)])
    range_ = volume.range[0] + volume.step * values[:, 0]
    amplitude = values[:, 1] * np.interp(range_, volume.range, volume.gain)
    position = volume.origin + range_[:, None] * volume.sight.reshape(-1, 3)[beam]
    return Cloud(position, range_, beam, amplitude, values[:, 1] / volume.floor)


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _peaks_of(amplitude, column, floor, run, ridge, lobes, cell, beams, found):  # type: ignore[no-untyped-def]
    """Echoes of all beams of one azimuth: elevation index, fractional range index and peak amplitude of each.

    The strongest sample of a beam begins a run that goes on, both ways, as long as no more than `cell` samples lie
    below ``run`` times the peak; the next run begins at the strongest sample that is left and no side lobe of the runs
    before it.
    """
    edges = np.zeros((MOST_ECHOES, 2), dtype=np.int64)
    brightness = np.zeros(MOST_ECHOES, dtype=np.float32)
    columns, rows, size = amplitude.shape
    taken = np.zeros(size, dtype=np.bool_)
    count = 0
    for j in range(rows):
        profile = amplitude[column, j]
        taken[:] = False
        candidates = np.flatnonzero(profile > floor)
        order = candidates[np.argsort(-profile[candidates])]
        here = runs = 0
        for k in order:
            if taken[k]:
                continue
            if here == MOST_ECHOES or runs == MOST_ECHOES:
                break
            side_lobe = False
            for m in range(runs):
                away = max(edges[m, 0] - k, k - edges[m, 1])
                side_lobe = side_lobe or profile[k] < brightness[m] * lobes[max(away, 1) - 1]
            if side_lobe:
                continue
            low = max(run * profile[k], 0.5 * floor)
            first, gap, n = k, 0, k
            while n > 0 and gap <= cell and not taken[n - 1]:
                n -= 1
                gap = gap + 1 if profile[n] < low else 0
                if gap == 0:
                    first = n
            last, gap, n = k, 0, k
            while n + 1 < size and gap <= cell and not taken[n + 1]:
                n += 1
                gap = gap + 1 if profile[n] < low else 0
                if gap == 0:
                    last = n
            power = moment = 0.0
            for n in range(first, last + 1):
                power += profile[n] * profile[n]
                moment += n * profile[n] * profile[n]
            for n in range(max(first - cell, 0), min(last + cell + 1, size)):
                taken[n] = True
            edges[runs, 0], edges[runs, 1], brightness[runs] = first, last, profile[k]
            runs += 1
            brightest = profile[k]
            for a in range(max(column - 1, 0), min(column + 2, columns)):
                for b in range(max(j - 1, 0), min(j + 2, rows)):
                    for n in range(max(k - cell, 0), min(k + cell + 1, size)):
                        brightest = max(brightest, amplitude[a, b, n])
            if profile[k] < ridge * brightest:
                continue
            beams[count] = j
            found[count, 0] = moment / power
            found[count, 1] = profile[k]
            count += 1
            here += 1
    return count
