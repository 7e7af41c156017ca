"""Raster scanners: one transceiver with a focused beam that is steered over a grid of directions."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator
from pydantic.dataclasses import dataclass

from mirrorfold.common.beams import beam_radius
from mirrorfold.common.memory import check_room
from mirrorfold.common.reading import read_text
from mirrorfold.common.types import Array
from mirrorfold.common.units import Quantity
from mirrorfold.scenes.arrays import (
    STEP_BYTES,
    STRICT,
    Count,
    Finite,
    NonNegativeLength,
    Number,
    Point3,
    PositiveLength,
    both_ends_in_one_unit,
)

WIDEST = 89.0
"""Largest azimuth or elevation [degree]: a scanner looks forward."""


@dataclass(frozen=True, config=STRICT, kw_only=True)
class Steps:
    """Equally spaced angles.

    Attributes
    ----------
    start, stop : float [degree]
    points : int
        Both ends included.
    """

    start: Annotated[Number, Field(ge=-WIDEST, le=WIDEST), Quantity("angle")]
    stop: Annotated[Number, Field(ge=-WIDEST, le=WIDEST), Quantity("angle")]
    points: Annotated[Count, Field(ge=2)]

    _units = model_validator(mode="before")(both_ends_in_one_unit)

    def __post_init__(self) -> None:
        if not self.stop > self.start:
            raise ValueError(f"stop ({self.stop:g} degrees) must lie above start ({self.start:g} degrees)")
        check_room(STEP_BYTES * self.points, f"{self.points} angles", "give fewer points")


@dataclass(frozen=True, config=STRICT, kw_only=True)
class Leakage:
    """Leakage from the transmitter to the receiver inside the instrument, which appears as an echo.

    Attributes
    ----------
    level_db : float [dB]
        Level of this echo, ``20 log10 |S11|``.
    range : float [m]
        Range at which it appears.
    """

    level_db: Finite
    range: NonNegativeLength = 0.1


@dataclass(frozen=True, config=STRICT, kw_only=True)
class Scanner:
    """A transceiver at `origin` with a focused beam that pivots about the origin.

    Attributes
    ----------
    azimuth, elevation : Steps, optional
        The grid of directions; give both, or `directions` instead.
    directions : path, optional
        CSV file with the columns azimuth, elevation [degree], one line for each direction of a complete grid.
    spot_radius : float [m]
        Radius of the beam in its focus, at which the amplitude has fallen to 1/e.
    focus_distance : float [m]
        Distance of the focus from the origin.
    origin : (3,) [m], default (0, 0, 0)
    leakage : Leakage, optional
        None by default.
    """

    kind: Literal["raster"] = "raster"
    azimuth: Steps | None = None
    elevation: Steps | None = None
    directions: Path | None = None
    spot_radius: PositiveLength
    focus_distance: PositiveLength
    origin: Point3 = (0.0, 0.0, 0.0)
    leakage: Leakage | None = None

    def __post_init__(self) -> None:
        if self.directions is not None:
            if self.azimuth is not None or self.elevation is not None:
                raise ValueError("give either azimuth and elevation or directions, not both")
            _read_directions(self.directions)
        elif self.azimuth is None or self.elevation is None:
            raise ValueError("azimuth and elevation are missing; give both, or directions = a CSV file")

    @property
    def angles(self) -> tuple[Array, Array]:
        """Azimuths (a,) and elevations (e,) of the grid [degree], in rising order."""
        if self.directions is not None:
            return _read_directions(self.directions)
        assert self.azimuth is not None  # for the type checker; see __post_init__
        assert self.elevation is not None
        return (
            np.linspace(self.azimuth.start, self.azimuth.stop, self.azimuth.points),
            np.linspace(self.elevation.start, self.elevation.stop, self.elevation.points),
        )

    def radius(self, range_: NDArray[np.float64] | float, wavelength: float) -> Array:
        """Radius of the beam [m] at a distance [m] from the scanner; see `mirrorfold.common.beams.beam_radius`."""
        return beam_radius(
            range_, spot_radius=self.spot_radius, focus_distance=self.focus_distance, wavelength=wavelength
        )


def _read_directions(path: Path) -> tuple[Array, Array]:
    """Azimuths and elevations of a complete grid from a CSV file.

    Raises
    ------
    ValueError
        If the file cannot be read, or its directions are not a complete grid.
    """
    text = read_text(path, "give the path of a CSV file of directions")
    try:
        table = np.loadtxt(text.splitlines(), delimiter=",", comments="#", ndmin=2)
    except ValueError as error:
        raise ValueError(f"directions: {path} holds something else than numbers ({error})") from None
    if table.ndim != 2 or table.shape[1] != 2 or not np.isfinite(table).all() or np.abs(table).max() > WIDEST:
        raise ValueError(f"directions: {path} must have two columns, azimuth and elevation, within {WIDEST:g} degrees")
    azimuth, elevation = np.unique(table[:, 0]), np.unique(table[:, 1])
    if len(np.unique(table, axis=0)) != azimuth.size * elevation.size or min(azimuth.size, elevation.size) < 2:
        raise ValueError(
            f"directions: {path} has {len(table)} directions, expected all combinations of {azimuth.size} azimuths "
            f"and {elevation.size} elevations, at least two of each"
        )
    return azimuth, elevation
