"""The radars for the families of random scenes.

The frequency steps of the arrays are such that the ambiguous range is 6 m, which contains every scene with its
reflections; that of the scanner is 4.5 m. Antennas are half a wavelength apart at the upper end of the band.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from scipy.constants import speed_of_light

from mirrorfold.common.arguments import wrong_kind
from mirrorfold.errors import InputError

Content = dict[str, Any]


@dataclass(frozen=True, kw_only=True)
class Radar:
    """A radar: its antennas and its band, as a scene file states them.

    Attributes
    ----------
    name, what : str
    band : dict
        ``{"start": ..., "stop": ..., "points": ...}`` [Hz].
    array : dict
        The antennas of a radar in the floor plan, as in a scene file; empty for a scanner.
    scanner : dict
        The scanner of a radar in space; see `Scanner`. Empty for an array.
    """

    name: str
    what: str
    band: Content
    array: Content = field(default_factory=dict)
    scanner: Content = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Refuse what would be taken for another kind of radar; the entries are checked as those of a scene file."""
        if not isinstance(self.name, str) or not self.name:
            raise wrong_kind("radar: name", self.name, "a text that is not empty", reader="")
        if bool(self.array) == bool(self.scanner):
            which = "both" if self.array else "neither"
            raise InputError(f"radar {self.name!r}: has {which} an array {'and' if self.array else 'nor'} a scanner, "
                             "expected one of them")  # fmt: skip

    @property
    def cell(self) -> float:
        """Range resolution [m]: half the speed of light over the bandwidth."""
        return float(speed_of_light / (2.0 * (self.band["stop"] - self.band["start"])))


def _line(elements: int, pitch: float, **more: Any) -> Content:
    """Antennas side by side, `pitch` [m] apart."""
    return {"kind": "linear", "elements": elements, "pitch": pitch, **more}


def _band(start: float, stop: float, points: int) -> Content:
    """A band from `start` to `stop` [Hz]."""
    return {"start": start, "stop": stop, "points": points}


RADARS = {
    radar.name: radar
    for radar in (
        Radar(
            name="300 GHz",
            what="290-300 GHz, 161 antennas 0.5 mm apart (8 cm)",
            band=_band(290e9, 300e9, 401),
            array=_line(161, 0.5e-3),
        ),
        Radar(
            name="230 GHz",
            what="220-240 GHz, 130 antennas 0.62 mm apart (8 cm)",
            band=_band(220e9, 240e9, 801),
            array=_line(130, 0.62e-3),
        ),
        Radar(
            name="122 GHz",
            what="116-128 GHz, 123 antennas 1.15 mm apart (14 cm)",
            band=_band(116e9, 128e9, 481),
            array=_line(123, 1.15e-3),
        ),
        Radar(
            name="79 GHz",
            what="77-81 GHz, 90 antennas 1.8 mm apart (16 cm)",
            band=_band(77e9, 81e9, 161),
            array=_line(90, 1.8e-3),
        ),
        Radar(
            name="300 GHz thinned",
            what="290-300 GHz, 161 places 0.5 mm apart, every third without an antenna",
            band=_band(290e9, 300e9, 401),
            array=_line(161, 0.5e-3, missing=list(range(2, 161, 3))),
        ),
        Radar(
            name="scanner",
            what="270-300 GHz, a beam steered over 30 x 30 degrees in 81 x 81 steps",
            band=_band(270e9, 300e9, 901),
            scanner={
                "azimuth": {"start": -15.0, "stop": 15.0, "points": 81},
                "elevation": {"start": -15.0, "stop": 15.0, "points": 81},
                "spot_radius": 0.017,
                "focus_distance": 3.6,
            },
        ),
    )
}
"""All radars, by name. The first one is the default for floor plans, the scanner that for scenes in space."""
