"""Antenna arrays and bands: where the transmitters and receivers stand, and at which frequencies they measure."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BeforeValidator, ConfigDict, Field, model_validator
from pydantic.dataclasses import dataclass
from pydantic_core import ArgsKwargs
from scipy.constants import speed_of_light

from mirrorfold.common.memory import check_room
from mirrorfold.common.types import Array
from mirrorfold.common.units import FARTHEST, Quantity, mixes_units


def no_boolean(given: Any) -> Any:
    """Return anything but true and false unchanged, which count as one and zero otherwise."""
    if isinstance(given, bool | np.bool_):
        raise ValueError(f"{str(given).lower()} is no number; write one")
    return given


Number = Annotated[float, BeforeValidator(no_boolean)]
Finite = Annotated[Number, Field(allow_inf_nan=False)]
Positive = Annotated[Number, Field(gt=0, allow_inf_nan=False)]
NonNegative = Annotated[Number, Field(ge=0, allow_inf_nan=False)]
PositiveLength = Annotated[Positive, Field(le=FARTHEST), Quantity("length")]
NonNegativeLength = Annotated[NonNegative, Field(le=FARTHEST), Quantity("length")]
Coordinate = Annotated[Finite, Field(ge=-FARTHEST, le=FARTHEST), Quantity("length")]
AnyAngle = Annotated[Finite, Quantity("angle")]
"""Types of numbers that a scene file may give with units."""

Count = Annotated[int, BeforeValidator(no_boolean), Field(le=10**15)]
"""A number of elements. The limit: no measurement has petabytes of data, and much larger integers exceed float64."""

STRICT = ConfigDict(extra="forbid")
"""Configuration of all dataclasses of scenes: unknown entries are errors."""

POSITION_BYTES = 72.0
"""Memory per antenna while the positions of its array are computed [B]."""

STEP_BYTES = 16.0
"""Memory per frequency or angle while the steps are computed [B]."""


def in_one_unit(given: Any) -> Any:
    """Return the numbers of one entry unchanged, such as a point; refuse them if only some of them have a unit."""
    if mixes_units(list(given.values()) if isinstance(given, dict) else given):
        raise ValueError(f"{given} gives some numbers a unit and others none; give each its unit, or none")
    return given


def both_ends_in_one_unit(given: Any) -> Any:
    """Return the fields of a band or of steps unchanged; refuse them if only one of start and stop has a unit."""
    fields = given.kwargs if isinstance(given, ArgsKwargs) else given
    if isinstance(fields, dict):
        in_one_unit({name: fields[name] for name in ("start", "stop") if name in fields})
    return given


Point2 = Annotated[tuple[Coordinate, Coordinate], BeforeValidator(in_one_unit)]
Point3 = Annotated[tuple[Coordinate, Coordinate, Coordinate], BeforeValidator(in_one_unit)]
Point = Point2 | Point3


def point3(point: Sequence[float]) -> Array:
    """A point or direction of two or three coordinates as an array (3,); z is 0 by default."""
    return np.array((*point, 0.0)[:3], dtype=float)


@dataclass(frozen=True, config=STRICT, kw_only=True)
class LinearArray:
    """Equally spaced antennas on a straight line.

    Attributes
    ----------
    elements : int
        Number of antennas.
    pitch : float [m]
        Distance between neighbours; at most half a wavelength at the top frequency avoids grating lobes.
    center : (2,) or (3,) [m], default the origin
        Midpoint between the first antenna and the last.
    direction : (2,) or (3,), default along +x
        From the first antenna to the last; need not have length one.
    horn : float [m], optional
        Width of the aperture of each antenna along the array; a point source by default. The aperture field is that of
        a horn in the H-plane, a cosine: the half-power beamwidth is about ``1.19 lambda / horn``.
    missing : tuple of int, default ()
        Numbers of antennas that are missing, counted from 0: broken ones, or those that a thinned array omits.
    rx : LinearArray, optional
        The receiving array, if it differs from the transmitting one.
    """

    kind: Literal["linear"] = "linear"
    elements: Annotated[Count, Field(ge=1)]
    pitch: PositiveLength
    center: Point = (0.0, 0.0)
    direction: tuple[Finite, Finite] | tuple[Finite, Finite, Finite] = (1.0, 0.0)
    horn: PositiveLength | None = None
    missing: tuple[Annotated[Count, Field(ge=0)], ...] = ()
    rx: LinearArray | None = None

    def __post_init__(self) -> None:
        if not np.linalg.norm(point3(self.direction)) > 0:
            raise ValueError("direction must have a length above zero, for example [1, 0]")
        if any(index >= self.elements for index in self.missing):
            raise ValueError(f"missing names antenna {max(self.missing)}, but they count from 0 to {self.elements - 1}")
        if self.rx is not None and self.rx.rx is not None:
            raise ValueError("rx is the receiving array and has an rx of its own; leave that out")
        if not self.count:
            raise ValueError("missing names every antenna; leave one at least")
        check_room(POSITION_BYTES * self.elements, f"{self.elements} elements", "give fewer")

    @property
    def count(self) -> int:
        """Number of antennas that are not missing."""
        return self.elements - len(set(self.missing))

    @property
    def present(self) -> NDArray[np.int64]:
        """Numbers of the antennas that are not missing, shape (n,)."""
        there = np.ones(self.elements, dtype=bool)
        there[list(self.missing)] = False
        return np.flatnonzero(there)

    @property
    def tx_position(self) -> Array:
        """Positions of the transmitters, shape (n, 3) [m]."""
        along = (self.present - (self.elements - 1) / 2) * self.pitch
        direction = point3(self.direction)
        return point3(self.center) + along[:, None] * (direction / np.linalg.norm(direction))

    @property
    def rx_position(self) -> Array:
        """Positions of the receivers, shape (n, 3) [m]."""
        return self.tx_position if self.rx is None else self.rx.tx_position

    @property
    def middle(self) -> Array:
        """The point midway between the mean positions of the transmitters and of the receivers, shape (3,) [m]."""
        return np.asarray(0.5 * (self.tx_position.mean(axis=0) + self.rx_position.mean(axis=0)))


@dataclass(frozen=True, config=STRICT, kw_only=True)
class Band:
    """Equally spaced frequencies.

    Attributes
    ----------
    start, stop : float [Hz]
    points : int
        Number of frequencies, both ends included.
    """

    start: Annotated[Positive, Quantity("frequency")]
    stop: Annotated[Positive, Quantity("frequency")]
    points: Annotated[Count, Field(ge=2)]

    _units = model_validator(mode="before")(both_ends_in_one_unit)

    def __post_init__(self) -> None:
        if not self.stop > self.start:
            raise ValueError(f"stop ({self.stop:g} Hz) must lie above start ({self.start:g} Hz)")
        check_room(STEP_BYTES * self.points, f"{self.points} frequencies", "give fewer points")

    @property
    def frequency(self) -> Array:
        """The frequencies, shape (points,) [Hz]."""
        return np.linspace(self.start, self.stop, self.points)

    @property
    def middle(self) -> float:
        """The frequency in the middle of the band [Hz]."""
        return 0.5 * (self.start + self.stop)

    @property
    def ambiguous_range(self) -> float:
        """The range [m] at which echoes wrap around to zero, ``c / (2 df)`` with the frequency step df."""
        return speed_of_light * (self.points - 1) / (2.0 * (self.stop - self.start))
