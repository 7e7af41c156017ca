"""The window of frequencies in which a wall is both a mirror and visible.

It begins at the frequency at which the wall scatters enough power to be visible, and ends where roughness has reduced
the mirrored power too much.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mirrorfold.common.decibels import power_ratio_of
from mirrorfold.common.types import Array
from mirrorfold.describing.planning import DULL_DB, INVISIBLE_DB
from mirrorfold.describing.walls import shares
from mirrorfold.scenes.materials import coherent_factor

MATERIALS = ("concrete", "plasterboard", "glass", "wood", "marble")
"""Building materials of Recommendation ITU-R P.2040-4."""

PAPER_ROUGHNESS = (0.05e-3, 0.2e-3)
"""Rms height and correlation length of the published walls [m]."""

ROUGHNESSES = (
    (0.01e-3, 0.2e-3),
    (0.02e-3, 0.2e-3),
    PAPER_ROUGHNESS,
    (0.05e-3, 2e-3),
    (0.1e-3, 0.2e-3),
    (0.2e-3, 0.8e-3),
)
"""Rms heights and correlation lengths [m], from a polished tile to coarse plaster. The wavelength of light is far less
than the least of them."""

OBLIQUE = np.radians(45.0)
"""Angle of incidence on a wall that serves as a mirror [rad]."""

LOWEST, HIGHEST, EXTRAPOLATED = 0.1e9, 30e12, 3e12
"""Ends of the search for the window, and the highest frequency to which the formulas of the recommendation are
extrapolated [Hz]."""

VISIBLE_DB = (INVISIBLE_DB, -40.0, -30.0)
"""Levels of scattered power from which a wall may be called visible [dB]: the level of `plan`, and two for radars with
less dynamic range."""


def reflected(name: str, frequency: Array, angle: Array, roughness: tuple[float, float]) -> tuple[Array, Array]:
    """Shares of the power that a wall mirrors (TE) and scatters (mean of TE and TM).

    Above `EXTRAPOLATED`, the reflection of a smooth wall is taken from there.
    """
    frequency, angle = np.broadcast_arrays(np.asarray(frequency, dtype=float), np.asarray(angle, dtype=float))
    smooth = shares(name, np.minimum(frequency, EXTRAPOLATED), angle, (0.0, None))[0]
    left = coherent_factor(roughness[0], frequency, angle, correlation_length=roughness[1]) ** 2
    return smooth[0] * left, smooth.mean(axis=0) * (1.0 - left)


@dataclass(frozen=True)
class Window:
    """The frequencies at which a wall both mirrors and scatters.

    Attributes
    ----------
    name, roughness : str and (rms height, correlation length) [m]
        Material and roughness of the wall.
    visible : dict of float [Hz]
        Lowest frequency at which the wall is visible, by the level of scattered power [dB] that this takes.
    mirrors : float [Hz]
        Highest frequency at which the wall is a mirror.
    """

    name: str
    roughness: tuple[float, float]
    visible: dict[float, float]
    mirrors: float

    @classmethod
    def of(cls, name: str, roughness: tuple[float, float]) -> Window:
        """The window of a material, by bisection: with frequency, scattered power rises and mirrored power falls."""

        def scattered(f: float) -> float:
            return float(reflected(name, np.array(f), np.array(OBLIQUE), roughness)[1])

        def mirrored(f: float) -> float:
            return -float(reflected(name, np.array(f), np.array(OBLIQUE), roughness)[0])

        visible = {level: _rises_above(scattered, power_ratio_of(level)) for level in VISIBLE_DB}
        return cls(name, roughness, visible, _rises_above(mirrored, -power_ratio_of(DULL_DB)))


def _rises_above(value: Callable[[float], float], level: float) -> float:
    """The frequency [Hz] at which a rising function passes a level."""
    low, high = LOWEST, HIGHEST
    for _ in range(60):
        middle = float(np.sqrt(low * high))
        low, high = (low, middle) if value(middle) > level else (middle, high)
    return float(np.sqrt(low * high))
