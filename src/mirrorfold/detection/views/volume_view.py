"""The radar's own view of a raster volume: amplitude against range, beam by beam."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray
from scipy.constants import speed_of_light

from mirrorfold.common.beams import HALF_POWER, beam_angles, beam_direction, beam_radius
from mirrorfold.common.decibels import ratio_of
from mirrorfold.common.facts import VOLUME, radar_place
from mirrorfold.common.statistics import in_equal_steps
from mirrorfold.common.types import Array, Complex, Index
from mirrorfold.common.windows import cell_of, hann, known_weights, side_lobe_envelope
from mirrorfold.detection.echoes import SIDE_LOBE_MARGIN_DB, noise_level, noise_limit
from mirrorfold.detection.views.view import FEWEST_SAMPLES, View, check_samples, in_pieces
from mirrorfold.errors import InputError
from mirrorfold.focusing.scans.range_profiles import beams_of, magnitudes, spreading

WINDOW_POINTS = 2048
"""Number of weights of a window over frequency that is known by its name, from which side lobes are computed."""

DYNAMIC_RANGE_DB = -80.0
"""Least level [dB] of an echo, relative to the brightest one, however low the noise: no instrument's beam or window is
cleaner."""

STEPS_A_BEAM = 2.0
"""Radius of an unknown beam in steps of the scan: in a useful scan, the beams overlap."""

OPAQUE_RADII = 5.7
"""Depth of an object in beam radii, ``tan(80 deg)``: the footprint of a beam that meets a surface at 80 degrees from
the normal spreads over so much range to either side. What lies farther behind is multiple scattering."""


@dataclass(frozen=True, eq=False)
class VolumeView(View):
    """A raster volume as the radar sees it: the amplitude along each beam, and what is known of the beam.

    Attributes
    ----------
    amplitude : (azimuths, elevations, ranges) array
        Single precision, without any normalisation.
    azimuth, elevation : 1D arrays [degree]
        Directions of the beams.
    gain : (ranges,) array
        Factor that normalises the amplitude at each range.
    noise : float
        Standard deviation of the real part of the noise in `amplitude`.
    beam : tuple of float [m], optional
        Radius at the focus, distance of the focus, and wavelength. Where these are not known, the radius of a beam is
        taken to be `STEPS_A_BEAM` steps of the scan.
    radar, range, range_cell, normalization, window
        See `View`.
    """

    amplitude: NDArray[np.float32]
    range: Array
    azimuth: Array
    elevation: Array
    gain: Array
    normalization: str
    noise: float
    radar: Array
    range_cell: float
    beam: tuple[float, float, float] | None = None
    window: Array = field(default_factory=lambda: hann(WINDOW_POINTS))

    widths_a_cell = 2.0  # the diameter of the beam

    @property
    def wavelength(self) -> float:  # type: ignore[override]
        """Wavelength in the middle of the band [m]; infinite where it is not known."""
        return np.inf if self.beam is None else self.beam[2]

    @cached_property
    def floor(self) -> float:
        """Amplitude, without normalisation, that noise stays below in the whole volume; see `DYNAMIC_RANGE_DB`, too."""
        weakest = float(self.amplitude.max()) * ratio_of(DYNAMIC_RANGE_DB)
        return max(noise_limit(self.noise, self.amplitude.size), weakest)

    @cached_property
    def side_lobes(self) -> NDArray[np.float32]:
        """Level of the side lobes in range, relative to the peak, 1, 2, ... samples from the edge of an echo,
        (ranges,).

        It is the envelope of the side lobes of the window, plus a margin. For an unknown window, those of the uniform
        one are taken, which fall slowest (Harris, Proc. IEEE 66, 1978).
        """
        # The edge of a run of samples, 12 dB below its peak, is more than one unit, c/(2B), away from the peak.
        x = 1.0 + np.arange(1, self.range.size + 1) * self.dr / self.range_unit
        weights = self.window if self.window.size else np.ones(WINDOW_POINTS)
        level = side_lobe_envelope(weights, x) * ratio_of(SIDE_LOBE_MARGIN_DB)
        return np.minimum(level, 1.0).astype(np.float32)

    @cached_property
    def axes(self) -> tuple[Array, ...]:
        """Azimuth and elevation of the beams [rad]."""
        return np.radians(self.azimuth), np.radians(self.elevation)

    @cached_property
    def sight(self) -> Array:
        """Unit vectors of all beams, (azimuths * elevations, 3)."""
        return beam_direction(self.azimuth[:, None], self.elevation[None, :]).reshape(-1, 3)

    def angles(self, points: ArrayLike) -> tuple[Array, Array]:
        """Range [m] of points (..., 3) [m], and their azimuth and elevation [rad], (..., 2).

        Azimuths are at most half a turn from the middle of the scan, which may look anywhere.
        """
        offset = np.asarray(points, dtype=float) - self.radar
        azimuth, elevation = np.radians(beam_angles(offset))
        azimuth -= 2.0 * np.pi * np.rint((azimuth - self.middle) / (2.0 * np.pi))
        return np.linalg.norm(offset, axis=-1), np.stack([azimuth, elevation], axis=-1)

    def in_cells(self, points: Array) -> Array:
        """As for any `View`, with angles from the middle of the scan.

        The beam's width as an angle changes with range, and shears the cells in proportion to the angles: those of
        places in one direction must not depend on where the scan looks.
        """
        range_, angles = self.angles(points)
        angles = angles - [0.5 * (axis[0] + axis[-1]) for axis in self.axes]
        beam = self.width(range_) / np.maximum(range_, self.dr)
        return np.column_stack([range_ / self.range_cell, angles / beam[:, None]])

    @property
    def middle(self) -> float:
        """Azimuth [rad] in the middle of the scan."""
        return float(np.radians(0.5 * (self.azimuth[0] + self.azimuth[-1])))

    @property
    def frame(self) -> Array:
        """Rotation (3, 3) about the vertical that turns the middle azimuth to y."""
        cosine, sine = np.cos(self.middle), np.sin(self.middle)
        return np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])

    @property
    def beam_step(self) -> float:
        """Angle between neighbouring beams [rad]."""
        return float(self.steps.mean())

    def width(self, range_: Array | float) -> Array:
        """Radius of the beam [m] at ranges [m]."""
        if self.beam is None:
            return STEPS_A_BEAM * self.beam_step * np.asarray(range_, dtype=float)
        spot_radius, focus_distance, wavelength = self.beam
        return beam_radius(range_, spot_radius=spot_radius, focus_distance=focus_distance, wavelength=wavelength)

    def cross_cell(self, points: Array) -> Array:
        """Width of the two-way beam [m], between half amplitudes."""
        return HALF_POWER * self.width(np.linalg.norm(points - self.radar, axis=-1))

    def beam_power(self, aside: Array) -> Array:
        """The two-way pattern of a Gaussian beam."""
        return np.exp2(-8.0 * aside**2)

    def power_at(self, range_: Array, beam: Index) -> Array:
        """Power at ranges [m] in beams, less the mean power of the noise; zero outside the view.

        The amplitude is interpolated linearly.
        """
        profile, power = self.amplitude.reshape(-1, self.range.size), np.empty(range_.shape)
        for some in in_pieces(len(range_)):
            row = (range_[some] - self.range[0]) / self.dr
            first = np.clip(row.astype(np.intp), 0, self.range.size - 2)
            share = row - first
            value = profile[beam[some], first] * (1.0 - share) + profile[beam[some], first + 1] * share
            power[some] = np.where((share >= 0.0) & (share <= 1.0), value**2 - 2.0 * self.noise**2, 0.0)
        return power

    def complex_along(
        self, image: xr.DataArray, points: Array, half: float, step: float, wavenumber: float
    ) -> tuple[Array, Complex]:
        """The samples of the beam nearest to each point, usually half a range resolution apart."""
        range_, direction, _ = self.locate(points)
        reach = np.arange(-int(half / self.dr), int(half / self.dr) + 1)
        sample = self.row(range_)
        place = sample[:, None] + reach
        azimuth, elevation = np.unravel_index(direction, self.shape)
        inside = (place >= 0) & (place < self.range.size)
        place = np.clip(place, 0, self.range.size - 1)
        values = np.where(inside, beams_of(image)[azimuth[:, None], elevation[:, None], place], 0.0)
        return np.asarray(reach * self.dr), values * np.exp(-2j * wavenumber * self.range[place])

    def strays(self, range_: Array) -> Array:
        """The radius of the beam at ranges [m], as an angle [rad]."""
        return self.width(range_) / np.maximum(range_, self.dr)

    def beside_steps(self, range_: Array) -> Index:
        """The beam's radius at ranges [m], in steps of the scan."""
        return np.ceil(self.strays(range_) / self.beam_step).astype(np.intp)

    def object_depth(self, range_: Array) -> Array:
        """`OPAQUE_RADII` radii of the beam."""
        return OPAQUE_RADII * self.width(range_)


def check_scan(sweep: xr.Dataset) -> None:
    """Refuse a raster scan whose volume could be focused, but not folded.

    Raises
    ------
    InputError
        If it has fewer than `FEWEST_SAMPLES` azimuths or elevations, or they do not rise in equal steps.
    """
    alone = "or look at the image alone, with focus"
    for name in VOLUME[1:]:
        angles = sweep[name].values.astype(float)
        if angles.size < FEWEST_SAMPLES:
            raise InputError(
                f"sweep: has beams at {angles.size} {name}{'s' if angles.size > 1 else ''}, expected at least "
                f"{FEWEST_SAMPLES}, because mirrors are found as planes; scan more of them, {alone}"
            )
        if not in_equal_steps(angles):
            raise InputError(f"sweep: {name} does not rise in equal steps; scan or resample to equal steps, {alone}")


def to_volume_view(volume: xr.DataArray, *, normalization: str | None = None) -> VolumeView:
    """The radar's own view of a raster volume (range, azimuth, elevation).

    The attrs of the volume tell what is known of the radar: `normalization`, which was applied already and is undone,
    `frequency_start`, `frequency_stop`, `spot_radius`, `focus_distance` [m], `wave_speed` [m/s], `range_resolution`
    [m], `taper` and `radar_position` [m]. The `normalization`, "beam", "r2" or "none", is by default "beam" if the beam
    is known, else "r2".

    Raises
    ------
    InputError
        If the volume cannot be used.
    """
    check_samples(volume, VOLUME)
    range_, azimuth, elevation = (volume[name].values.astype(float) for name in volume.dims)
    amplitude = magnitudes(beams_of(volume))
    if not amplitude.any():
        raise InputError("image: every pixel is zero; there is nothing to fold")
    attrs = volume.attrs
    step = float(range_[1] - range_[0])
    beam, frequency = None, 0.0
    if all(name in attrs for name in ("spot_radius", "focus_distance", "frequency_start", "frequency_stop")):
        frequency = 0.5 * (float(attrs["frequency_start"]) + float(attrs["frequency_stop"]))
        wavelength = float(attrs.get("wave_speed", speed_of_light)) / frequency
        beam = (float(attrs["spot_radius"]), float(attrs["focus_distance"]), wavelength)
    chosen = normalization if normalization is not None else ("beam" if beam else "r2")
    done = spreading(attrs, range_, frequency, str(attrs.get("normalization", "none")), "image")
    if np.ptp(done) > 0.0:
        amplitude = np.divide(amplitude, np.maximum(done, np.finfo(np.float32).tiny), dtype=np.float32)
    radar = radar_place(attrs)
    taper = attrs.get("taper", "hann")
    weights = known_weights(taper, WINDOW_POINTS if isinstance(taper, str) else np.size(taper))
    range_cell = max(cell_of(weights) * float(attrs.get("range_resolution", step)), 2.0 * step)
    gain = spreading(attrs, range_, frequency, chosen, "image")
    noise = noise_level(amplitude)
    return VolumeView(amplitude, range_, azimuth, elevation, gain, chosen, noise, radar, range_cell, beam, weights)
