"""What every mirror provides to the steps of folding, straight or curved, in the floor plan or in space."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Generic, Self, TypeVar

import numpy as np

from mirrorfold.common.geometry import Isometry, reflect_each, signed_distance
from mirrorfold.common.types import ROOT, UNSEEN, Array, Index, Mask
from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.views.view import View

WALL_CELLS, WALL_WAVELENGTHS = 1.25, 40.0
"""Depth behind a mirror, in resolution cells, or in wavelengths if that is less, up to which echoes come from inside
its wall. At 0.3 THz, building materials scatter from 1 to 3 cm deep; a material with the same loss per wavelength lets
waves in to the same number of wavelengths."""


V = TypeVar("V", bound=View)
"""The kind of view in which a mirror is seen: of an image, or of a volume."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Mirror(ABC, Generic[V]):
    """A mirror, where the unfolded image shows it: a mirror that is seen through another one is a ghost itself.

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
        Depth of the centroid of power of its echoes behind its face.
    curvature_error : float [1/m]
        Standard error of the curvature; zero if it is flat.
    overhang : tuple of two floats [m]
        How far lines of sight are taken to meet a line beyond its start and its end; negative where they miss its last
        part, zero where that was not measured. See `mirrorfold.tree.explaining.half_shadows`.
    """

    center: Array = field(init=False)
    normal: Array = field(init=False)
    strength: float = 1.0
    angle_error: float = 0.0
    offset_error: float = 0.0
    fill: float = 1.0
    depth: float = 0.0
    curvature_error: float = 0.0
    overhang: tuple[float, float] = (0.0, 0.0)

    curved = False
    """Whether the mirror is curved, so that each line of sight meets a tangent of its own."""

    @property
    @abstractmethod
    def tangents(self) -> Array:
        """Unit vectors along the mirror, (d - 1, d), the first of them horizontal."""

    @property
    @abstractmethod
    def sides(self) -> Array:
        """Where it begins and ends along each of its `tangents`, measured from its center, (d - 1, 2) [m]."""

    @abstractmethod
    def crossing(self, view: V) -> Array:
        """Range [m] at which each line of sight meets the mirror, (n,); infinite where it misses it."""

    @abstractmethod
    def near(self, view: V, echoes: Echoes) -> tuple[Mask, Mask, Array]:
        """Three values for each echo, (n,): whether its direction may be one of the wall; whether it may be one of the
        visible face; and the width of the resolution cell across the mirror at the echo [m].
        """

    @abstractmethod
    def places(self, view: V) -> Array:
        """Places on the mirror at which profiles of power across it are taken, (n, d) [m]."""

    @abstractmethod
    def profiles(self, view: V, places: Array, depth: Array) -> tuple[Array, Array]:
        """Profiles of power across the mirror at places (n, d).

        Returns the vectors (n, d) along which they are taken, from each place to 1 m behind the face, and the power at
        depths (n, m) [m] behind the face.
        """

    @abstractmethod
    def independent(self, view: V) -> float:
        """Number of resolution cells along the mirror, each with a speckle of its own."""

    @abstractmethod
    def filled(self, view: V, echoes: Echoes) -> float:
        """Share of its extent that echoes on the mirror fill."""

    @abstractmethod
    def snapped(self, view: V, echoes: Echoes) -> Echoes:
        """Its echoes, each moved onto the mirror."""

    @abstractmethod
    def pieces(self, view: V, direction: Index, before: Index, smallest: float) -> tuple[list[Self], list[Self]]:
        """Cut the mirror into pieces that are seen by way of different mirrors.

        `before` (n,) is the number of the mirror that the line of sight of each `direction` (n,) crossed last before
        this one; cuts are where it changes. Returns the pieces, and those that are too small next to `smallest` [m].
        """

    @property
    def ends(self) -> Array:
        """Ends of its horizontal middle line, (2, d) [m]."""
        return self.center + self.sides[0][:, None] * self.tangents[0]

    @property
    def size(self) -> float:
        """Distance between its ends [m]; of an arc, its length."""
        return float(np.linalg.norm(self.ends[1] - self.ends[0]))

    def columns(self, fold: Fold) -> dict[str, Any]:
        """Its place after a map, as columns of a file: values by name, here those of the ends, x0, y0, x1 ..."""
        return {f"{axis}{end}": place[i] for end, place in enumerate(fold(self.ends))
                for i, axis in zip(range(place.size), "xyz", strict=False)}  # fmt: skip

    @property
    def curvature(self) -> float:
        """One over the radius [1/m], positive where it bulges towards the radar; zero if it is flat."""
        return 0.0

    def growth(self, points: Array) -> Array:
        """Factor by which its curvature widens the pencil of rays to points (n, d) behind it, (n, d - 1)."""
        return np.ones((len(points), len(self.tangents)))

    def holds(self, points: Array, beside: Array | float, beyond: float) -> Mask:
        """Whether points (n, d) lie at most `beside` [m] from its face and `beyond` [m] past its ends, (n,)."""
        place, (first, last) = (points - self.center) @ self.tangents.T, self.sides.T
        inside = np.all((place >= first - beyond) & (place <= last + beyond), axis=-1)
        return (np.abs(self.beside(points)) <= beside) & inside

    def facing(self, points: Array) -> tuple[Array, Array]:
        """A point and the unit normal of the line or plane that the line of sight through each of points (n, d) meets.

        Both (n, d); for a curved mirror it is the tangent there.
        """
        return np.broadcast_to(self.center, points.shape), np.broadcast_to(self.normal, points.shape)

    @property
    def reflection(self) -> Isometry:
        """The map from where the image shows what is seen in the mirror to where it stands."""
        return Isometry.reflection(self.center, self.normal)

    def off_middle(self, points: Array) -> Array:
        """How far [m] points (n, d) on the mirror are from its middle, along its curvature, (n,); zero if flat."""
        return np.zeros(len(points))

    def displacement_covariance(self, places: Array) -> Array:
        """Covariance (n, d, d) [m^2] of half the displacement of mirror images of places (n, d), by errors of the fit.

        Let a place be at o from where its line of sight meets the mirror, or for a flat one from the center, n the
        normal there, and w how far it is `off_middle`. The result is ``(s^2 + (w^2 k / 2)^2) n n' + (a^2 + (w k)^2)
        B B'`` with ``B = n o' + (o.n) (I - 2 n n')``, and s, a and k the errors of the offset [m], the angle [rad] and
        the curvature [1/m]. For a place on the face itself it is the covariance of the face. A given mirror, whose
        errors are NaN, is taken to be exact.
        """
        hit, normal = self.facing(places)
        offset, way = places - hit, self.off_middle(hit)[:, None, None]
        errors = self.offset_error, np.radians(self.angle_error), self.curvature_error
        shift, angle, bend = (float(np.nan_to_num(error)) for error in errors)
        square = np.einsum("ni,nj->nij", normal, normal)
        depth = np.sum(offset * normal, axis=1)[:, None, None]
        turn = np.einsum("ni,nj->nij", normal, offset) + depth * (np.eye(places.shape[1]) - 2.0 * square)
        shifted, turned = shift**2 + (0.5 * way**2 * bend) ** 2, angle**2 + (way * bend) ** 2
        return shifted * square + turned * (turn @ np.swapaxes(turn, 1, 2))

    def beside(self, points: Array) -> Array:
        """Signed distance [m] of points (..., d) from its line or plane, positive on the side of `normal`."""
        return signed_distance(points, self.center, self.normal)

    def side(self, view: V) -> float:
        """-1 if the `normal` points to the side of the radar, else 1."""
        return -1.0 if (view.radar - self.center) @ self.normal > 0.0 else 1.0

    def inward(self, view: V) -> Array:
        """The unit normal that points away from the radar, (d,)."""
        return self.side(view) * self.normal

    def with_echoes(self, view: V, echoes: Echoes) -> Self:
        """The mirror with the `fill` and the `strength` that the echoes on it give; there must be at least one."""
        return replace(self, fill=self.filled(view, echoes), strength=float(np.median(echoes.amplitude)))

    def own(self, view: V, echoes: Echoes) -> Mask:
        """Which echoes lie on its face, to within the resolution cell across it, (n,)."""
        _, face, across = self.near(view, echoes)
        return face & (np.abs(self.beside(echoes.position)) <= across)

    def behind(self, view: V, points: Array) -> Array:
        """How far [m] points (..., d) lie behind the mirror, seen from the radar; for a curved one, see `beside`."""
        return self.side(view) * self.beside(points)


class ChainFold:
    """The map from the image to the true place, for echoes seen by way of mirrors of which at least one is curved.

    Each line of sight has an isometry of its own: its echoes are reflected by the tangents that this same line of sight
    meets in the image, the deepest mirror first. Flat mirrors are the special case in which all lines of sight meet the
    same tangents. The `way` begins with the mirror that the radar looks into.
    """

    STEP = 1e-5
    """Length over which the map is differentiated, as a share of the smallest radius: about the cube root of the
    rounding of numbers, at which rounding and bending spoil a difference of both sides least."""

    def __init__(self, way: Sequence[Mirror]) -> None:
        self.way = tuple(way)
        self.step = self.STEP * min((1.0 / abs(mirror.curvature) for mirror in way if mirror.curved), default=1.0)

    def __call__(self, points: Array) -> Array:
        """Map points (..., d) [m] of the image."""
        seen = np.asarray(points, dtype=float).reshape(-1, np.shape(points)[-1])
        place = seen
        for mirror in reversed(self.way):
            place = reflect_each(place, *mirror.facing(seen))
        return place.reshape(np.shape(points))

    def turn(self, points: Array) -> Array:
        """Derivative of the map at points (n, d), (n, d, d)."""
        steps = self.step * np.eye(points.shape[1])
        return np.stack([(self(points + step) - self(points - step)) / (2.0 * self.step) for step in steps], axis=2)


Fold = Isometry | ChainFold
"""A map from the image to true places."""


def any_curved(mirrors: Iterable[Mirror]) -> bool:
    """Whether any of the mirrors is curved, as those of a chain by way of which echoes are seen."""
    return any(mirror.curved for mirror in mirrors)


def fold_of(way: Sequence[Mirror], dimensions: int) -> Fold:
    """The map from the image to the true place for echoes seen by way of mirrors, of which the nearest comes first."""
    if any_curved(way):
        return ChainFold(way)
    fold = Isometry.identity(dimensions)
    for mirror in way:
        fold = fold @ mirror.reflection
    return fold


def turns(fold: Fold, points: Array) -> Array:
    """Derivative of a map at points (n, d): (n, d, d), or (d, d) where it is the same everywhere."""
    return fold.turn(points) if isinstance(fold, ChainFold) else fold.linear


def proving_echoes(echoes: Echoes, view: View) -> Echoes:
    """Echoes that can prove a mirror: the visible ones; in images, where faint ones form rows by chance, if strong."""
    return echoes.take(echoes.visible & (echoes.strong | (view.dimensions == 3)))


def faces(mirrors: Sequence[Mirror], view: View, echoes: Echoes, wall_margin: float) -> Index:
    """Number of the mirror that each echo lies on, `UNSEEN` for echoes from inside a wall, `ROOT` for all others, (n,).

    Echoes behind a mirror come from inside its wall up to the depth `wall_margin` [m], or twice the `depth` of the
    mirror if that is more.
    """
    face = np.full(len(echoes), ROOT, dtype=np.intp)
    nearest = np.full(len(echoes), np.inf)
    for index, mirror in enumerate(mirrors):
        wall, own, across = mirror.near(view, echoes)
        behind = mirror.behind(view, echoes.position)
        wall = wall & (behind >= -across) & (behind <= across + max(wall_margin, 2.0 * mirror.depth))
        face[wall & (face == ROOT)] = UNSEEN
        closer = wall & own & (np.abs(behind) <= across + mirror.depth) & (np.abs(behind) < nearest)
        face[closer] = index
        nearest[closer] = np.abs(behind)[closer]
    return face
