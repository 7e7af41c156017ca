"""A mirror, as far as folding needs to know it: in the floor plan a line, in space a plane."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Self

import numpy as np

from mirrorfold.common.geometry import Isometry, signed_distance
from mirrorfold.common.types import Array, Index, Mask
from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.views.view import View

WALL_CELLS, WALL_WAVELENGTHS = 1.25, 40.0
"""Echoes up to so many resolution cells, or wavelengths if that is less, behind a mirror leak from inside its wall.
Building materials scatter from 1 to 3 cm deep at 0.3 THz, and waves reach the same number of wavelengths deep where a
material loses the same share of them in each."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Mirror(ABC):
    """A mirror in the coordinates of the unfolded image: one that is seen through another is a ghost itself.

    Attributes
    ----------
    center : (d,) array [m]
        Middle of its face.
    normal : (d,) array
        Unit normal.
    strength : float
        Median amplitude of its echoes, normalised as in the view.
    angle_error : float [degree]
    offset_error : float [m]
        Standard errors of the fit: of its direction, and of its position at the center.
    fill : float
        Share of its extent that its echoes fill.
    depth : float [m]
        How deep the centre of power of its echoes lies behind its face.
    """

    center: Array = field(init=False)
    normal: Array = field(init=False)
    strength: float = 1.0
    angle_error: float = 0.0
    offset_error: float = 0.0
    fill: float = 1.0
    depth: float = 0.0

    @property
    @abstractmethod
    def tangents(self) -> Array:
        """Unit vectors along the mirror, (d - 1, d), the first of them horizontal."""

    @property
    @abstractmethod
    def sides(self) -> Array:
        """Where it begins and ends along each of its `tangents`, seen from its center, (d - 1, 2) [m]."""

    @abstractmethod
    def crossing(self, view: View) -> Array:
        """Range [m] at which each line of sight meets the mirror, (n,); infinite where it misses it."""

    @abstractmethod
    def near(self, view: View, echoes: Echoes) -> tuple[Mask, Mask, Array]:
        """Which echoes lie in the directions of its wall, which of its face; and the cell's width across it [m]."""

    @abstractmethod
    def places(self, view: View) -> Array:
        """Places on the mirror where the view is sampled across it, (n, d) [m]."""

    @abstractmethod
    def profiles(self, view: View, places: Array, depth: Array) -> tuple[Array, Array]:
        """Vectors from places (n, d) to 1 m behind the face, (n, d), and the power at depths (n, m) [m] along them."""

    @abstractmethod
    def independent(self, view: View) -> float:
        """Number of resolution cells along it, each with a speckle of its own."""

    @abstractmethod
    def moved(self, normal: Array, center: Array) -> Self:
        """The mirror, as large as it is, on another line or plane, of that normal and through that point."""

    @abstractmethod
    def filled(self, view: View, echoes: Echoes) -> float:
        """Share of its extent that echoes on it fill."""

    @abstractmethod
    def snapped(self, view: View, echoes: Echoes) -> Echoes:
        """Its echoes, moved onto it."""

    @abstractmethod
    def pieces(self, view: View, direction: Index, before: Index, smallest: float) -> tuple[list[Self], list[Self]]:
        """Cut it where `before`, the mirror that lines of sight met last, changes: mirrors, and what is too small."""

    @property
    def ends(self) -> Array:
        """Ends of its horizontal middle line, (2, d) [m]."""
        return np.asarray(self.center + self.sides[0][:, None] * self.tangents[0])

    @property
    def size(self) -> float:
        """Distance of its ends [m]."""
        return float(np.linalg.norm(self.ends[1] - self.ends[0]))

    def columns(self, fold: Fold) -> dict[str, Any]:
        """What a file says of its place after a map: values by name, here those of the ends, x0, y0, x1 ..."""
        return {f"{axis}{end}": place[i] for end, place in enumerate(fold(self.ends))
                for i, axis in zip(range(place.size), "xyz", strict=False)}  # fmt: skip

    @property
    def curved(self) -> bool:
        """Whether it is curved: each line of sight meets a tangent of its own."""
        return False

    @property
    def curvature(self) -> float:
        """One over the radius [1/m], positive where it bulges towards the radar; zero if it is flat."""
        return 0.0

    def growth(self, points: Array) -> Array:
        """By how much it widens the pencil of rays to points (n, d) behind it, along d - 1 directions, (n, d - 1)."""
        return np.ones((len(points), len(self.tangents)))

    def holds(self, points: Array, beside: float, beyond: float) -> Mask:
        """Whether points (n, d) lie on it, so far [m] beside its face and beyond its ends at most, (n,)."""
        place, (first, last) = (points - self.center) @ self.tangents.T, self.sides.T
        inside = np.all((place >= first - beyond) & (place <= last + beyond), axis=-1)
        return np.asarray((np.abs(self.beside(points)) <= beside) & inside)

    def facing(self, points: Array) -> tuple[Array, Array]:
        """Place and unit normal (n, d) of the line or plane that the lines of sight through points (n, d) meet."""
        return np.broadcast_to(self.center, points.shape), np.broadcast_to(self.normal, points.shape)

    @property
    def reflection(self) -> Isometry:
        """The map from what is seen in the mirror to where it stands."""
        return Isometry.reflection(self.center, self.normal)

    def strays(self, places: Array) -> Array:
        """Covariance (n, d, d) [m^2] of places (n, d) that move and turn with the mirror, from the errors of its fit.

        Images in the mirror move by twice as much. A mirror that was given is taken to stand where it was drawn.
        """
        offset, angle = places - self.center, float(np.nan_to_num(np.radians(self.angle_error)))
        square = np.nan_to_num(self.offset_error) ** 2 * np.outer(self.normal, self.normal)
        total = np.repeat(square[None], len(places), axis=0)
        for tangent in self.tangents:
            turn = np.outer(offset @ tangent, self.normal) + np.outer(offset @ self.normal, tangent)
            total += angle**2 * np.einsum("ni,nj->nij", turn, turn)
        return total

    def beside(self, points: Array) -> Array:
        """Signed distance [m] of points (..., d), positive on the side of `normal`."""
        return signed_distance(points, self.center, self.normal)

    def inward(self, view: View) -> Array:
        """The normal that points away from the radar, (d,)."""
        return self.normal * (-np.sign((view.radar - self.center) @ self.normal) or 1.0)

    def own(self, view: View, echoes: Echoes) -> Mask:
        """Which echoes lie on its face, to within the resolution cell across it, (n,)."""
        _, face, across = self.near(view, echoes)
        return np.asarray(face & (np.abs(self.beside(echoes.position)) <= across))

    def behind(self, view: View, points: Array) -> Array:
        """How far [m] points (..., d) lie behind the mirror, seen from the radar."""
        return np.asarray((points - self.center) @ self.inward(view))


class WayFold:
    """The map from the image to the true place for what is seen by way of mirrors, at least one of them curved.

    Each line of sight has an isometry of its own: it is reflected by the tangents that this same line of sight meets in
    the image, the deepest first. Flat mirrors are the special case in which all lines of sight meet the same.

    Parameters
    ----------
    way : sequence of Mirror
        The mirrors, first the one that the radar looks into.
    """

    STEP = 1e-5
    """Length [m] over which the map is differentiated."""

    def __init__(self, way: Sequence[Mirror]) -> None:
        self.way = tuple(way)

    def __call__(self, points: Array) -> Array:
        """Map points (..., d) [m] of the image."""
        seen = np.asarray(points, dtype=float).reshape(-1, np.shape(points)[-1])
        place = seen
        for mirror in reversed(self.way):
            hit, normal = mirror.facing(seen)
            place = place - 2.0 * np.sum((place - hit) * normal, axis=1)[:, None] * normal
        return place.reshape(np.shape(points))

    def turn(self, points: Array) -> Array:
        """Derivative of the map at points (n, d), (n, d, d)."""
        steps = self.STEP * np.eye(points.shape[1])
        return np.stack([(self(points + step) - self(points - step)) / (2.0 * self.STEP) for step in steps], axis=2)


Fold = Isometry | WayFold
"""A map from the image to true places."""


def fold_of(way: Sequence[Mirror], dimensions: int) -> Fold:
    """The map from the image to the true place for what is seen by way of mirrors, the first on the way first."""
    if any(mirror.curved for mirror in way):
        return WayFold(way)
    fold = Isometry.identity(dimensions)
    for mirror in way:
        fold = fold @ mirror.reflection
    return fold


def turns(fold: Fold, points: Array) -> Array:
    """Derivative of a map at points (n, d): (n, d, d), or (d, d) where it is the same everywhere."""
    return fold.turn(points) if isinstance(fold, WayFold) else fold.linear


def evidence(echoes: Echoes, view: View) -> Echoes:
    """What can prove a mirror: visible echoes; of an image only the strong ones, for faint ones form rows by chance."""
    return echoes.take(echoes.visible & (echoes.strong | (view.dimensions == 3)))


def faces(
    mirrors: Sequence[Mirror], view: View, echoes: Echoes, wall_margin: float, *, nobody: int, root: int
) -> Index:
    """The mirror that each echo lies on, `nobody` for echoes from inside a wall, `root` for all others, (n,).

    Echoes behind a mirror belong to its wall up to the `wall_margin` [m], or to twice its own `depth` if that is more.
    """
    face = np.full(len(echoes), root, dtype=np.intp)
    nearest = np.full(len(echoes), np.inf)
    for index, mirror in enumerate(mirrors):
        wall, own, across = mirror.near(view, echoes)
        behind = mirror.behind(view, echoes.position)
        wall &= (behind >= -across) & (behind <= across + max(wall_margin, 2.0 * mirror.depth))
        face[wall & (face == root)] = nobody
        closer = wall & own & (np.abs(behind) <= across + mirror.depth) & (np.abs(behind) < nearest)
        face[closer] = index
        nearest[closer] = np.abs(behind)[closer]
    return face
