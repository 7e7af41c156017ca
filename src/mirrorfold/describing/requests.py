"""What is asked of a plan, checked."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.constants import speed_of_light

from mirrorfold.common.arguments import number, shown, whole_number
from mirrorfold.common.plausible import FARTHEST, HIGHEST, frequency_unit, length_unit
from mirrorfold.errors import InputError
from mirrorfold.scenes.materials import names

MATERIALS = names()
"""What `materials` may hold."""

LARGEST_COUNT = 100_000
"""Antennas or frequencies; more are a slip of the unit."""


LEVEL = "dB", -200.0, 200.0
"""No power, gain, noise or signal that is measured lies outside of this."""

LIMITS: dict[str, tuple[str, float, float]] = {
    **dict.fromkeys(("power_dbm", "gain_dbi", "noise_figure_db", "detection_db"), LEVEL),
    **dict.fromkeys(("aperture", "pitch", "range", "rx_aperture", "rx_pitch"), ("m", 1e-9, FARTHEST)),
    **dict.fromkeys(("leg", "rms height of the roughness"), ("m", 0.0, FARTHEST)),
    "correlation length of the roughness": ("m", 1e-12, FARTHEST),
    **dict.fromkeys(("settling", "moving"), ("s", 0.0, 1e9)),
    "band": ("Hz", 1e-3, HIGHEST[True]),
    "if_bandwidth": ("Hz", 1e-6, 1e13),
    "target": ("m^2", 1e-20, 1e20),
}
"""Unit of each number, and the least and largest value, so wide that what lies outside is a slip."""


def limited(name: str, value: Any) -> float:
    """A number within its `LIMITS`.

    Raises
    ------
    InputError
        If it is none.
    """
    unit, low, high = LIMITS[name]
    return number(name, value, unit, lowest=low, highest=high)


@dataclass(frozen=True, kw_only=True)
class Request:
    """The arguments of `plan` as numbers in SI units, named as there; `rx_aperture` and `rx_pitch` are never None."""

    band: tuple[float, float]
    points: int
    aperture: float
    pitch: float
    range: float
    rx_aperture: float
    rx_pitch: float
    materials: tuple[str, ...]
    roughness: tuple[float, float | None]
    target: float
    leg: float
    detection_db: float


def requested(
    *, band: Any, points: Any, aperture: Any, pitch: Any, range: Any, rx_aperture: Any, rx_pitch: Any, materials: Any,
    roughness: Any, target: Any, leg: Any, detection_db: Any,
) -> Request:  # fmt: skip
    """What is asked for, from numbers and from texts with units.

    Raises
    ------
    InputError
        With the first argument that makes no sense.
    """
    wanted = "two rising frequencies in hertz, for example (270e9, 300e9)"
    start, stop = (limited("band", value) for value in _two("band", band, wanted))
    if not start < stop:
        raise InputError(f"band is {shown(band)}, expected {wanted}")
    points = whole_number("points", points, lowest=2, what="a whole number of frequencies")
    if points > LARGEST_COUNT:
        raise InputError(f"points is {points}, expected at most {LARGEST_COUNT} frequencies")
    aperture, pitch, range = limited("aperture", aperture), limited("pitch", pitch), limited("range", range)
    rx_aperture = aperture if rx_aperture is None else limited("rx_aperture", rx_aperture)
    rx_pitch = pitch if rx_pitch is None else limited("rx_pitch", rx_pitch)
    heights = "(rms height, correlation length or None) in metres, for example (50e-6, None)"
    height, length = _two("roughness", roughness, heights)
    request = Request(
        band=(start, stop),
        points=points,
        aperture=aperture,
        pitch=pitch,
        range=range,
        rx_aperture=rx_aperture,
        rx_pitch=rx_pitch,
        materials=_materials(materials),
        roughness=(
            limited("rms height of the roughness", height),
            None if length is None else limited("correlation length of the roughness", length),
        ),
        target=limited("target", target),
        leg=0.5 * range if leg is None else limited("leg", leg),
        detection_db=limited("detection_db", detection_db),
    )
    _check_lines(request)
    return request


def _two(name: str, value: Any, expected: str) -> tuple[Any, Any]:
    """Both entries of a pair."""
    if not isinstance(value, Sequence | np.ndarray) or isinstance(value, str) or len(value) != 2:
        raise InputError(f"{name} is {shown(value)}, expected {expected}")
    return value[0], value[1]


def _materials(given: Any) -> tuple[str, ...]:
    """The names of the materials, also of a single one."""
    found = (given,) if isinstance(given, str) else given
    if not isinstance(found, Sequence) or not found or not all(isinstance(name, str) for name in found):
        raise InputError(f"materials is {shown(given)}, expected one or more of: {', '.join(MATERIALS)}")
    return tuple(found)


def _check_lines(request: Request) -> None:
    """Refuse lines of antennas that make no sense at these frequencies."""
    (start, stop), aperture, pitch = request.band, request.aperture, request.pitch
    meant = frequency_unit(stop, aperture, pitch, speed_of_light)
    if meant is not None:
        raise InputError(
            f"band is {shown(request.band)} Hz, and an aperture of {aperture:g} m is "
            f"{aperture * stop / speed_of_light:.1g} wavelengths there; probably {meant} were meant, as in "
            f"{start:g}{meant}:{stop:g}{meant}"
        )
    coarse = length_unit(pitch, speed_of_light / stop)
    if coarse is not None:
        raise InputError(
            f"pitch is {pitch:g} m, {pitch * stop / speed_of_light:.0f} wavelengths; probably {pitch:g}{coarse} was "
            "meant"
        )
    for length, step, side in (
        (aperture, pitch, "aperture"),
        (request.rx_aperture, request.rx_pitch, "rx_aperture"),
    ):
        if step > length * (1 + 1e-9):
            raise InputError(f"{side} is {length:g} m, shorter than one pitch of {step:g} m; expected several pitches")
        if length / step > LARGEST_COUNT:
            raise InputError(f"{side} has {length / step:.3g} pitches, expected at most {LARGEST_COUNT:g}")
