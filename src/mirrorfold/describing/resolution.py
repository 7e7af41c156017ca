"""What a band can resolve together with two arrays, or with a raster scan."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.constants import speed_of_light

from mirrorfold.common.plausible import pitch
from mirrorfold.common.records import Number, Record, fact
from mirrorfold.common.types import Array
from mirrorfold.common.units import length_text

RANGES = (1.0, 2.0, 4.0)
"""Ranges for which the cross-range resolution is stated [m] if nothing tells where the scene is: as on a desk, in a
room and in a hall."""

SHARES = (0.25, 0.5, 1.0)
"""Ranges for which the cross-range resolution of a sweep is stated, as shares of the ambiguous range."""

PITCH_TOLERANCE = 0.01
"""Share by which the pitch may exceed half a wavelength without a remark: grating lobes then stay beyond 80 degrees."""


class Band(Record):
    """The frequencies of a sweep."""

    band_hz: list[float] = fact("lowest and highest frequency", min_length=2, max_length=2)
    frequencies: int
    frequency_step_hz: Number


class Depth(Record):
    """What a band resolves along range."""

    range_resolution_m: Number = fact("`c / (2 B)`")
    ambiguous_range_m: Number = fact("`c / (2 df)`")


class ArraySizes(Record):
    """Two arrays."""

    tx: int = fact("transmitters")
    rx: int = fact("receivers")
    aperture_m: list[float] = fact("of the transmitters and the receivers")
    pitch_m: list[Number] = fact("likewise")


class Arrays(Depth, ArraySizes, Band):
    """What a band and two arrays can resolve."""

    cross_range_resolution_m: dict[str, float] | None = fact("by range [m]")
    field_of_view_deg: Number = fact("the sector free of grating lobes")


class Beams(Record):
    """The beams of a raster scan."""

    azimuth_deg: list[float] = fact("first and last")
    elevation_deg: list[float] = fact("first and last")
    beams: list[int] = fact("in azimuth and elevation")
    scan_step_deg: list[Number]
    spot_radius_m: Number
    focus_distance_m: Number


class Scan(Depth, Beams, Band):
    """What a band and a raster scan can resolve."""


def resolution(
    frequency: Array,
    tx_position: Array,
    rx_position: Array,
    speed: float = speed_of_light,
    ranges: Sequence[float] | None = None,
    *,
    monostatic: bool = False,
) -> tuple[Arrays, list[str]]:
    """What a band and two arrays can resolve, and remarks on what they cannot.

    Parameters
    ----------
    frequency : (frequencies,) array [Hz]
    tx_position, rx_position : (tx, 3) and (rx, 3) arrays [m]
    speed : float [m/s]
        Speed of the waves, by default that of light in vacuum.
    ranges : sequence of float [m], optional
        Ranges for which the cross-range resolution is stated, such as those of the scene. By default a quarter, half
        and all of the ambiguous range.
    monostatic : bool
        Whether one antenna, that both sends and receives, goes along the array: its paths differ by twice as much, as
        in an array of twice the length and pitch.

    Returns
    -------
    facts : Arrays
        The cross-range resolution is ``lambda r / D`` at the centre of the band, with the longer aperture D: the
        distance of the first zero from the focus. The field of view is ``2 arcsin(lambda / (2 p))`` at the top of the
        band, with the finer pitch p: in this sector around broadside, no object has a grating lobe. Of one moving
        antenna, D and p count twice.
    remarks : list of str
    """
    wavelength = speed / float(frequency.mean())
    shortest = speed / float(frequency[-1])
    ways = 2.0 if monostatic else 1.0
    steps = [pitch(tx_position) or None, pitch(rx_position) or None]
    aperture = ways * max(_extent(tx_position), _extent(rx_position))
    pitches = [ways * step for step in steps if step is not None]
    field_of_view = 2.0 * float(np.degrees(np.arcsin(min(1.0, shortest / (2.0 * min(pitches)))))) if pitches else None
    band, depth, remarks = _band(frequency, speed)
    if ranges is None:
        far = depth.ambiguous_range_m
        ranges = RANGES if far is None else [share * far for share in SHARES]
    facts = Arrays(
        **band,
        tx=len(tx_position),
        rx=len(rx_position),
        aperture_m=[_extent(tx_position), _extent(rx_position)],
        pitch_m=list(steps),
        **depth,
        cross_range_resolution_m=cross_range_resolution(wavelength, aperture, ranges) if aperture else None,
        field_of_view_deg=field_of_view,
    )
    if not aperture:
        remarks.append("All antennas stand at one place, so directions cannot be told apart; move them.")
    if pitches and min(pitches) > (1.0 + PITCH_TOLERANCE) * shortest / 2.0:
        remarks.append(
            f"The pitch of {length_text(min(pitches) / ways)} exceeds {'a quarter of' if monostatic else 'half'} a "
            f"wavelength, {length_text(0.5 * shortest / ways)}: grating "
            f"lobes will show objects at wrong places outside a field of view of {field_of_view:.3g} degrees."
        )
    return facts, remarks


def cross_range_resolution(wavelength: float, aperture: float, ranges: Sequence[float]) -> dict[str, float]:
    """Cross-range resolution ``lambda r / D`` [m] by range r [m], rounded to three digits, with the aperture D."""
    return {f"{r:.3g}": wavelength * float(f"{r:.3g}") / aperture for r in ranges}


def scan_resolution(
    frequency: Array,
    azimuth: Array,
    elevation: Array,
    beam: tuple[float, float] | None,
    speed: float = speed_of_light,
) -> tuple[Scan, list[str]]:
    """What a band and a raster scan can resolve, and remarks on what they cannot.

    Parameters
    ----------
    frequency : (frequencies,) array [Hz]
    azimuth, elevation : 1D arrays [degree]
    beam : (radius of the focus, its distance) [m], optional
        The beam, where it is known.
    speed : float [m/s]
        Speed of the waves, by default that of light in vacuum.

    Returns
    -------
    facts : Scan
    remarks : list of str
    """
    steps = [float(np.diff(angle).max()) if angle.size > 1 else None for angle in (azimuth, elevation)]
    band, depth, remarks = _band(frequency, speed)
    facts = Scan(
        **band,
        azimuth_deg=[float(azimuth[0]), float(azimuth[-1])],
        elevation_deg=[float(elevation[0]), float(elevation[-1])],
        beams=[int(azimuth.size), int(elevation.size)],
        scan_step_deg=steps,
        spot_radius_m=beam[0] if beam else None,
        focus_distance_m=beam[1] if beam else None,
        **depth,
    )
    if beam is not None:
        widest = 2.0 * float(np.degrees(beam[0] / beam[1]))
        if any(angle is not None and angle > widest for angle in steps):
            remarks.append(
                f"The scan steps are wider than the beam, {widest:.2g} degrees: objects between two beams are seen by "
                "neither."
            )
    return facts, remarks


def _band(frequency: Array, speed: float) -> tuple[Band, Depth, list[str]]:
    """The band, what it resolves along range, and a remark where there is only one frequency."""
    step = float(frequency[-1] - frequency[0]) / (frequency.size - 1) if frequency.size > 1 else None
    band = Band(
        band_hz=[float(frequency[0]), float(frequency[-1])], frequencies=int(frequency.size), frequency_step_hz=step
    )
    depth = Depth(
        range_resolution_m=speed / (2.0 * step * frequency.size) if step else None,
        ambiguous_range_m=speed / (2.0 * step) if step else None,
    )
    return band, depth, [] if step else ["There is a single frequency, so ranges cannot be told apart; sweep a band."]


def _extent(position: Array) -> float:
    """Length [m] of an array along its longest direction."""
    centred = position - position.mean(axis=0)
    longest = np.linalg.svd(centred, full_matrices=False)[2][0]
    return float(np.ptp(centred @ longest))
