"""The settings of a plan, declared once: options, signature, checks and help follow from the declarations.

The bounds are so wide that values outside of them must be in a wrong unit. This module is imported for `--help`, so it
imports nothing heavy.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from mirrorfold.common.arguments import in_message, number, whole_number
from mirrorfold.common.settings import REQUIRED, Settings, setting
from mirrorfold.common.units import FARTHEST
from mirrorfold.errors import InputError

LARGEST_COUNT = 100_000
"""Largest number of antennas or frequencies; larger ones come from a wrong unit."""

LEVEL: dict[str, Any] = {"kind": "float", "lowest": -200.0, "highest": 200.0}
"""Bounds of levels [dB]; no power, gain, noise or signal that is measured lies outside."""

LENGTH: dict[str, Any] = {"kind": "float", "unit": "m", "lowest": 1e-9, "highest": FARTHEST}
WAY: dict[str, Any] = {**LENGTH, "lowest": 0.0}
PAUSE: dict[str, Any] = {"kind": "float", "unit": "s", "lowest": 0.0, "highest": 1e9}


class Quantities(Settings):
    """Settings whose numbers may be texts with units, such as "80 mm"."""

    def __post_init__(self) -> None:
        for name, rule in self.rules().items():
            value = getattr(self, name)
            if rule.kind == "float" and not (value is None and self.is_optional(name)):
                found = number(name, value, rule.unit, lowest=rule.lowest, highest=rule.highest)
                object.__setattr__(self, name, found)


@dataclass(frozen=True, kw_only=True)
class Instrument(Quantities):
    """The radar's electronics, for the link budget and the time."""

    power_dbm: float = setting(
        0.0, "Transmitted power; 0 is a modest frequency extender at 0.3 THz.", unit="dBm", **LEVEL
    )
    gain_dbi: float = setting(
        20.0, "Gain of each antenna, transmitting and receiving; 20 is a small horn.", unit="dBi", **LEVEL
    )
    noise_figure_db: float = setting(
        20.0, "Noise figure of the receiver, conversion loss included.", unit="dB", **LEVEL
    )
    if_bandwidth: float = setting(
        1e4, "Bandwidth of the receiver's filter: one sample takes its inverse.", unit="Hz", lowest=1e-6,
        highest=1e13,
    )  # fmt: skip
    settling: float = setting(5e-5, "Time from one sample to the next, on top of that.", **PAUSE)
    moving: float = setting(
        0.0,
        "Time that a stage takes from one position to the next; zero where all antennas are there at once.",
        **PAUSE,
    )


@dataclass(frozen=True, kw_only=True)
class PlanSettings(Quantities):
    """What a plan is made for: the band, two line arrays, the room and its walls."""

    band: tuple[float, float] = setting(REQUIRED, "Lowest and highest frequency.", kind="(start, stop)", unit="Hz")
    points: int = setting(REQUIRED, "Number of frequencies, both ends of the band included.")
    aperture: float = setting(REQUIRED, "Length of the transmitting array.", **LENGTH)
    pitch: float = setting(REQUIRED, "Distance of neighbouring transmitting antennas.", **LENGTH)
    range: float = setting(REQUIRED, "Distance to the farthest object in line of sight.", **LENGTH)
    rx_aperture: float | None = setting(None, "Length of the receiving array, where it differs.", **LENGTH)
    rx_pitch: float | None = setting(None, "Distance of neighbouring receiving antennas, where it differs.", **LENGTH)
    materials: Sequence[str] = setting(
        ("plasterboard",),
        "Materials of the walls, by the names of scene files; the first serves for the link budget.",
        kind="str or list of str",
        option=False,
    )
    roughness: tuple[float, float | None] = setting(
        (50e-6, None),
        "Rms height and correlation length of the walls; without a correlation length the heights vary slowly.",
        kind="(height, length or None)",
        unit="m",
    )
    target: float = setting(
        1e-3, "Radar cross section to be seen in one resolution cell.", unit="m^2", lowest=1e-20,
        highest=1e20,
    )  # fmt: skip
    leg: float | None = setting(None, "Length that each bounce adds to the range; half the range by default.", **WAY)
    detection_db: float = setting(
        13.0, "Signal over noise in the image from which an object counts as seen.", unit="dB", **LEVEL
    )

    def __post_init__(self) -> None:
        from mirrorfold.common.plausible import HIGHEST

        wanted = "two rising frequencies in hertz, for example (270e9, 300e9)"
        start, stop = (
            number("band", value, "Hz", lowest=1e-3, highest=HIGHEST[True]) for value in _two("band", self.band, wanted)
        )
        if not start < stop:
            raise InputError(f"band is {in_message(self.band)}, expected {wanted}")
        points = whole_number("points", self.points, lowest=2, what="a whole number of frequencies")
        if points > LARGEST_COUNT:
            raise InputError(f"points is {points}, expected at most {LARGEST_COUNT} frequencies")
        super().__post_init__()
        heights = "(rms height, correlation length or None) in metres, for example (50e-6, None)"
        height, length = _two("roughness", self.roughness, heights)
        height = number("rms height of the roughness", height, "m", lowest=0.0, highest=FARTHEST)
        if length is not None:
            length = number("correlation length of the roughness", length, "m", lowest=1e-12, highest=FARTHEST)
        read = {"band": (start, stop), "points": points, "roughness": (height, length)}
        for name, value in (read | {"materials": _materials(self.materials)}).items():
            object.__setattr__(self, name, value)
        self._check_lines()

    @property
    def lines(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """(aperture, pitch) [m] of the transmitting and of the receiving array."""
        rx_aperture = self.aperture if self.rx_aperture is None else self.rx_aperture
        return (self.aperture, self.pitch), (rx_aperture, self.pitch if self.rx_pitch is None else self.rx_pitch)

    def _check_lines(self) -> None:
        """Refuse apertures and pitches that make no sense at these frequencies."""
        from scipy.constants import speed_of_light

        from mirrorfold.common.plausible import frequency_unit, length_unit

        (start, stop), aperture, pitch = self.band, self.aperture, self.pitch
        for (length, step), side in zip(self.lines, ("aperture", "rx_aperture"), strict=True):
            if step > length * (1 + 1e-9):
                raise InputError(
                    f"{side} is {length:g} m, shorter than one pitch of {step:g} m; expected several pitches: perhaps "
                    "the two are exchanged"
                )
        meant = frequency_unit(stop, aperture, pitch, speed_of_light)
        if meant is not None:
            raise InputError(
                f"band is {in_message(self.band)} Hz, and an aperture of {aperture:g} m is "
                f"{aperture * stop / speed_of_light:.1g} wavelengths there; probably {meant} were meant, as in "
                f"{start:g}{meant}:{stop:g}{meant}"
            )
        coarse = length_unit(pitch, speed_of_light / stop)
        if coarse is not None:
            raise InputError(
                f"pitch is {pitch:g} m, {pitch * stop / speed_of_light:.0f} wavelengths; probably {pitch:g}{coarse} "
                "was meant"
            )
        for (length, step), side in zip(self.lines, ("aperture", "rx_aperture"), strict=True):
            if length / step > LARGEST_COUNT:
                raise InputError(f"{side} has {length / step:.3g} pitches, expected at most {LARGEST_COUNT:g}")


def _two(name: str, value: Any, expected: str) -> tuple[Any, Any]:
    """Both entries of a pair; a value that is no pair is refused."""
    several = isinstance(value, Sequence) and not isinstance(value, str) and len(value) == 2
    if not several and getattr(value, "shape", None) != (2,):
        raise InputError(f"{name} is {in_message(value)}, expected {expected}")
    first, second = value
    return first, second


def _materials(given: Any) -> tuple[str, ...]:
    """The names of the materials as a tuple, also where a single name is given."""
    found = (given,) if isinstance(given, str) else given
    if not isinstance(found, Sequence) or not found or not all(isinstance(name, str) for name in found):
        from mirrorfold.scenes.materials import names

        raise InputError(f"materials is {in_message(given)}, expected one or more of: {', '.join(names())}")
    return tuple(found)
