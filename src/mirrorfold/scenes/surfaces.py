"""Surfaces of the floor plan: segments, polylines, arcs, circles and curves, with their material and roughness."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, field_validator
from pydantic.dataclasses import dataclass

from mirrorfold.common.polylines import meets_itself
from mirrorfold.common.types import Array
from mirrorfold.errors import InputError
from mirrorfold.scenes import materials
from mirrorfold.scenes.arrays import STRICT, AnyAngle, NonNegativeLength, Point2, PositiveLength


@dataclass(frozen=True, config=STRICT, kw_only=True)
class Roughness:
    """Roughness of a surface: Gaussian heights with the Gaussian autocovariance ``h^2 exp(-d^2 / L^2)``.

    Attributes
    ----------
    rms_height : float [m]
        Root-mean-square height h.
    correlation_length : float [m]
        Correlation length L along the surface.
    """

    rms_height: NonNegativeLength
    correlation_length: PositiveLength


@dataclass(frozen=True, config=STRICT, kw_only=True)
class _Surface:
    """Attributes that surfaces of all shapes share.

    Attributes
    ----------
    name : str
    material : str or Substance
        A name that `mirrorfold.scenes.materials` knows, or permittivity and conductivity.
    roughness : Roughness, optional
        By default the surface is smooth: it only reflects specularly, and does not scatter on its face.
    volume_depth : float [m], default 0
        Depth over which the inside of the wall scatters, too: 1-3 cm for drywall at 0.3 THz.
    volume_profile : {"exponential", "uniform", "layers"}, default "exponential"
        How that scattering is distributed over the depth; see `mirrorfold.scenes.materials.VolumeProfile`.
    """

    name: str
    material: str | materials.Substance = "pec"
    roughness: Roughness | None = None
    volume_depth: NonNegativeLength = 0.0
    volume_profile: materials.VolumeProfile = "exponential"

    @field_validator("material")
    @classmethod
    def _known(cls, value: str | materials.Substance) -> str | materials.Substance:
        materials.material(value)
        return value

    def pieces(self, spacing: float) -> list[Array]:
        """The outline as polylines (n, 2) [m]; curved ones in chords of at most `spacing` [m].

        Raises
        ------
        NotImplementedError
            In this base class; every shape of this module has its own method.
        """
        raise NotImplementedError

    def sample(self, spacing: float) -> tuple[Array, Array, Array]:
        """Points on the surface at most `spacing` [m] apart.

        Returns
        -------
        points : (n, 2) array [m]
        normals : (n, 2) array
            Unit normals, to the left of the direction of travel.
        lengths : (n,) array [m]
            Length of the piece of outline that each point represents.
        """
        points, normals, lengths = [], [], []
        for piece in self.pieces(spacing):
            for start, end in pairwise(piece):
                length = float(np.linalg.norm(end - start))
                count = max(1, _steps(length, spacing))
                along = (np.arange(count) + 0.5) / count
                points.append(start + along[:, None] * (end - start))
                normal = np.array([start[1] - end[1], end[0] - start[0]]) / length
                normals.append(np.tile(normal, (count, 1)))
                lengths.append(np.full(count, length / count))
        return np.concatenate(points), np.concatenate(normals), np.concatenate(lengths)


def check_names(surfaces: Sequence[Any]) -> None:
    """Refuse surfaces of a scene of which two have the same name.

    Raises
    ------
    ValueError
    """
    twice = sorted(name for name, count in Counter(surface.name for surface in surfaces).items() if count > 1)
    if twice:
        raise ValueError(f"surface names must differ, but {', '.join(map(repr, twice))} is used more than once")


def surface_named(scene: Any, name: str) -> Any:
    """The surface with that name, of a scene in the floor plan or in space that has one."""
    return next(surface for surface in scene.surface if surface.name == name)


def _steps(length: float, spacing: float) -> int:
    """Number of steps of at most `spacing` [m] along a length [m].

    Raises
    ------
    InputError
        If there are more than `MOST_STEPS`.
    """
    if length > MOST_STEPS * spacing:
        raise InputError(
            f"surface: an outline of {length:.3g} m is to be followed in steps of {spacing:.3g} m, more than "
            f"{MOST_STEPS:.0e} of them; give lengths in metres, or make it shorter"
        )
    return int(np.ceil(length / spacing))


MOST_STEPS = 10_000_000
"""Largest number of steps along one straight piece or arc: that many points take a gigabyte."""


CHORDS = 8
"""Number of chords per point of a curve, for the test whether the curve crosses itself."""


def _check_simple(points: Array) -> None:
    """Refuse a polyline (n, 2) [m] that crosses itself or folds back on itself, as it has no two distinct sides."""
    place = meets_itself(points)
    if place is not None:
        raise ValueError(
            f"crosses itself or folds back at ({place[0]:.4g}, {place[1]:.4g}) m; end it there, or give its parts as "
            "surfaces of their own"
        )


def _arc_points(center: Point2, radius: float, start: float, stop: float, spacing: float) -> Array:
    """Ends (n, 2) [m] of chords of at most `spacing` [m] along an arc; angles [degree] counter-clockwise from +x."""
    count = max(8, _steps(abs(np.radians(stop - start)) * radius, spacing))
    angle = np.radians(np.linspace(start, stop, count + 1))
    return np.asarray(center) + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)


@dataclass(frozen=True, config=STRICT, kw_only=True)
class _Wall(_Surface):
    """Attributes that straight surfaces share.

    Attributes
    ----------
    thickness : float [m], optional
        Thickness of a half-transparent wall, half of it on either side of the outline; by default the wall is opaque.
    """

    thickness: PositiveLength | None = None

    def __post_init__(self) -> None:
        materials.check_passable(self.material, self.thickness, self.volume_depth)


@dataclass(frozen=True, config=STRICT, kw_only=True)
class Segment(_Wall):
    """A straight wall from `start` to `end` [m]."""

    kind: Literal["segment"] = "segment"
    start: Point2
    end: Point2

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.start == self.end:
            raise ValueError("start and end are the same point; a segment needs a length")

    def pieces(self, spacing: float) -> list[Array]:
        """The segment itself."""
        return [np.array([self.start, self.end])]


@dataclass(frozen=True, config=STRICT, kw_only=True)
class Polyline(_Wall):
    """Straight pieces through `points` [m], at least two."""

    kind: Literal["polyline"] = "polyline"
    points: Annotated[tuple[Point2, ...], Field(min_length=2)]

    def __post_init__(self) -> None:
        super().__post_init__()
        if any(a == b for a, b in pairwise(self.points)):
            raise ValueError("two consecutive points are the same; each piece needs a length")
        _check_simple(np.array(self.points))

    def pieces(self, spacing: float) -> list[Array]:
        """The polyline itself."""
        return [np.array(self.points)]


@dataclass(frozen=True, config=STRICT, kw_only=True)
class Arc(_Surface):
    """Part of a circle, from `start_angle` to `stop_angle` [degree], counter-clockwise from +x."""

    kind: Literal["arc"] = "arc"
    center: Point2
    radius: PositiveLength
    start_angle: AnyAngle
    stop_angle: AnyAngle

    def __post_init__(self) -> None:
        if not 0 < abs(self.stop_angle - self.start_angle) <= 360:
            raise ValueError("start_angle and stop_angle must differ, by at most 360 degrees")

    def pieces(self, spacing: float) -> list[Array]:
        """Chords of the arc."""
        return [_arc_points(self.center, self.radius, self.start_angle, self.stop_angle, spacing)]


@dataclass(frozen=True, config=STRICT, kw_only=True)
class Circle(_Surface):
    """A closed circle around `center` [m] of `radius` [m]."""

    kind: Literal["circle"] = "circle"
    center: Point2
    radius: PositiveLength

    def pieces(self, spacing: float) -> list[Array]:
        """Chords of the circle; clockwise, so that the normals of `sample` point outward."""
        return [_arc_points(self.center, self.radius, 360.0, 0.0, spacing)]


@dataclass(frozen=True, config=STRICT, kw_only=True)
class Curve(_Surface):
    """A smooth curve through `points` [m]: a cubic spline with continuous second derivative.

    In a scene file the points may come from a file beside it, ``file = "profile.csv"`` (or .npy), with one x and y per
    row. The curve is closed if the last point equals the first one.
    """

    kind: Literal["curve"] = "curve"
    points: Annotated[tuple[Point2, ...], Field(min_length=4)]

    def __post_init__(self) -> None:
        if any(a == b for a, b in pairwise(self.points)):
            raise ValueError("two consecutive points are the same; a spline needs distinct ones")
        spline, length = self.spline()
        _check_simple(np.asarray(spline(np.linspace(0.0, length, CHORDS * len(self.points) + 1))))

    @property
    def is_closed(self) -> bool:
        """Whether the curve ends where it begins."""
        return self.points[0] == self.points[-1]

    def spline(self) -> tuple[Callable[..., Array], float]:
        """The curve as a function of the accumulated length of the chords between its points, and that length [m]."""
        from scipy.interpolate import CubicSpline

        points = np.array(self.points)
        along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
        return CubicSpline(along, points, bc_type="periodic" if self.is_closed else "not-a-knot"), float(along[-1])

    def pieces(self, spacing: float) -> list[Array]:
        """Chords of the curve."""
        spline, length = self.spline()
        count = max(len(self.points), _steps(length, spacing))
        return [np.asarray(spline(np.linspace(0.0, length, count + 1)))]


Surface = Segment | Polyline | Arc | Circle | Curve
