"""A curved mirror in the floor plan: an arc, with a tangent of its own for every line of sight.

An echo behind the arc is reflected by the tangent at the point where its line of sight crosses the arc. That is exact
for an array that is small against its depth of focus: its image shows each object in the direction in which the central
ray leaves the radar, at the length of the whole path.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from mirrorfold.common.geometry import circle_crossings, turned, unit_or_zero
from mirrorfold.common.types import Array, Index, Mask
from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.mirrors.line_mirror import covered_share, profile_count
from mirrorfold.detection.mirrors.mirror import Mirror
from mirrorfold.detection.views.image_view import ImageView

END_CELLS, END_SHARE = 0.5, 0.1
"""Length, in resolution cells, that profiles leave out at either end of an arc, where cells are half filled; but at
most the share `END_SHARE` of its length, so that most of a short arc is left."""


@dataclass(frozen=True, eq=False)
class ArcMirror(Mirror[ImageView]):
    """A part of a circle in an image, seen by a `radar` at (2,) [m].

    The circle has its `middle` at (2,) [m], and a `radius` [m]. The arc begins at the angle `first`, and goes on
    counter-clockwise by the angle `span` [rad], less than a full turn.
    """

    middle: Array
    radius: float
    first: float
    span: float
    radar: Array

    curved = True

    def __post_init__(self) -> None:
        half = self.first + 0.5 * self.span
        outward = np.array([np.cos(half), np.sin(half)])
        object.__setattr__(self, "center", self.middle + self.radius * outward)
        object.__setattr__(self, "normal", outward)

    @property
    def convex(self) -> bool:
        """Whether the arc bulges towards the radar."""
        return bool((self.radar - self.center) @ self.normal > 0.0)

    @property
    def curvature(self) -> float:
        """One over the radius [1/m], negative for a concave mirror."""
        return (1.0 if self.convex else -1.0) / self.radius

    @property
    def size(self) -> float:
        """Length of the arc [m], which is more than the distance between its ends."""
        return self.length

    @property
    def length(self) -> float:
        """Length of the arc [m]."""
        return self.radius * self.span

    @property
    def tangents(self) -> Array:
        """Unit tangent in the middle of the arc, (1, 2)."""
        return turned(self.normal)[None]

    @property
    def sides(self) -> Array:
        """Half the chord to either side of its center, (1, 2) [m]; half the diameter beyond a semicircle."""
        return self.radius * np.sin(0.5 * min(self.span, np.pi)) * np.array([[-1.0, 1.0]])

    @property
    def ends(self) -> Array:
        """First and last point of the arc, (2, 2) [m]."""
        return self.at(np.array([0.0, self.length]))

    def at(self, along: Array) -> Array:
        """Points at positions [m] along the arc, (..., 2)."""
        return self.middle + self.radius * self.outward(along)

    def outward(self, along: Array) -> Array:
        """Unit vectors from the center of the circle towards positions [m] along the arc, (..., 2)."""
        angle = self.first + along / self.radius
        return np.stack([np.cos(angle), np.sin(angle)], axis=-1)

    def along(self, points: Array) -> Array:
        """Position [m] of points (..., 2) along the arc, from its first point on.

        Positions before the first point are negative. They jump opposite the middle of the arc.
        """
        offset = points - self.middle
        angle = np.arctan2(offset[..., 1], offset[..., 0]) - self.first - 0.5 * self.span
        return self.radius * ((angle + np.pi) % (2.0 * np.pi) - np.pi + 0.5 * self.span)

    def off_middle(self, points: Array) -> Array:
        """Position [m] of points (n, 2) along the arc from its middle, (n,)."""
        return self.along(points) - 0.5 * self.length

    def part(self, first: float, last: float) -> ArcMirror:
        """The arc from one position [m] along it to another."""
        return replace(self, first=self.first + first / self.radius, span=(last - first) / self.radius)

    def with_errors(self, variance: Array) -> ArcMirror:
        """The arc with the standard errors that follow from variances, (3,): of its offset [m^2], its direction [rad^2]
        and its curvature [1/m^2].
        """
        offset, angle, bend = np.sqrt(np.maximum(variance, 0.0)).tolist()
        return replace(self, offset_error=offset, angle_error=float(np.degrees(angle)), curvature_error=bend)

    def beside(self, points: Array) -> Array:
        """Distance [m] of points (..., 2) from the circle, positive outside."""
        return np.linalg.norm(points - self.middle, axis=-1) - self.radius

    def met(self, sight: Array) -> Array:
        """Range [m] at which lines of sight (n, 2) meet the circle, NaN where they miss it: its near side if it is
        convex, its far side if it is concave.
        """
        near, far = circle_crossings(self.radar - self.middle, sight, self.radius)
        return near if self.convex else far

    def crossing(self, view: ImageView) -> Array:
        """Range [m] at which each direction meets the arc, (nu,); infinite where it does not."""
        range_ = self.met(view.sight)
        with np.errstate(invalid="ignore"):
            along = self.along(self.radar + range_[:, None] * view.sight)
            return np.where((along >= 0.0) & (along <= self.length) & (range_ > 0.0), range_, np.inf)

    def facing(self, points: Array) -> tuple[Array, Array]:
        """Points where the lines of sight through points (n, 2) meet the arc, and its normals there, (n, 2) each.

        A line of sight that misses the arc is taken to meet its nearer end.
        """
        sight = unit_or_zero(points - self.radar)
        range_ = self.met(sight)
        missed = ~np.isfinite(range_)
        nearest = (self.middle - self.radar) @ sight.T
        along = self.along(self.radar + np.where(missed, nearest, range_)[..., None] * sight)
        normal = self.outward(np.clip(along, 0.0, self.length))
        return self.middle + self.radius * normal, normal

    def spread(self, points: Array) -> tuple[Array, Array]:
        """How the arc widens and bends the pencil of rays to points (n, 2) behind it, (n,) each.

        The rays meet the arc after r1 at the angle of incidence i, and go on for s. For each radian, the pencil is then
        ``q = r1 + s + 2 r1 s / (R cos(i))`` wide. The first value is ``q / (r1 + s)``, negative behind a caustic. The
        second is ``1 + 2 s / (R cos(i))``; divided by q, it is the curvature at the radar of the waves from such a
        point.
        """
        hit, normal = self.facing(points)
        sight = hit - self.radar
        before = np.linalg.norm(sight, axis=-1)
        rest = np.maximum(np.linalg.norm(points - self.radar, axis=-1) - before, 0.0)
        cosine = np.maximum(np.abs(np.sum(sight * normal, axis=-1)) / before, np.finfo(float).eps)
        turn = 2.0 * self.curvature * rest / cosine
        return (before + rest + turn * before) / (before + rest), 1.0 + turn

    def growth(self, points: Array) -> Array:
        """``|q| / (r1 + s)``, see `spread`: positive in front of a caustic and behind it, (n, 1)."""
        return np.abs(self.spread(points)[0])[:, None]

    def holds(self, points: Array, beside: Array | float, beyond: float) -> Mask:
        """Whether points (n, 2) lie at most `beside` [m] from the circle and `beyond` [m] past the ends, (n,).

        `beyond` is measured along the arc.
        """
        along = self.along(points)
        inside = (along >= -beyond) & (along <= self.length + beyond)
        return (np.abs(self.beside(points)) <= beside) & inside

    def near(self, view: ImageView, echoes: Echoes) -> tuple[Mask, Mask, Array]:
        """Echoes beside it, up to a cell past its ends, as wall and as face alike; the cell's width across it [m]."""
        outward = self.outward(self.along(echoes.position))
        across = view.extent_each(echoes.position, outward)
        beyond = view.extent_each(echoes.position, turned(outward))
        beside = np.abs(self.along(echoes.position) - 0.5 * self.length) <= 0.5 * self.length + beyond
        return beside, beside, across

    def places(self, view: ImageView) -> Array:
        """Places in equal steps along the arc, without its ends, (n, 2) [m]."""
        left_out = min(END_CELLS * view.cell_at(self.center), END_SHARE * self.length)
        return self.at(np.linspace(left_out, self.length - left_out, profile_count(self.length, view)))

    def profiles(self, view: ImageView, places: Array, depth: Array) -> tuple[Array, Array]:
        """Square to the arc."""
        inward = self.side(view) * self.outward(self.along(places))
        return inward, view.power_at(*view.to_polar(places[:, None] + depth[..., None] * inward[:, None]))

    def independent(self, view: ImageView) -> float:
        """Length of the arc in resolution cells."""
        return float(self.length / view.cell_at(self.center))

    def filled(self, view: ImageView, echoes: Echoes) -> float:
        """Share of its length within half a resolution cell of one of the echoes."""
        tangent = turned(self.outward(self.along(echoes.position)))
        position, half = self.along(echoes.position), 0.5 * view.extent_each(echoes.position, tangent)
        return covered_share(position, half, self.length)

    def snapped(self, view: ImageView, echoes: Echoes) -> Echoes:
        """Its echoes, moved square onto the arc."""
        return replace(echoes, position=self.at(np.clip(self.along(echoes.position), 0.0, self.length)))

    def pieces(
        self, view: ImageView, direction: Index, before: Index, smallest: float
    ) -> tuple[list[ArcMirror], list[ArcMirror]]:
        """Cut the arc where `before` changes: the largest piece, and all others."""
        position = self.along(view.points(self.crossing(view)[direction], direction))
        order = np.argsort(position)
        position, before = position[order], before[order]
        changes = np.flatnonzero(before[1:] != before[:-1])
        cuts = sorted([0.0, self.length, *(0.5 * (position[changes] + position[changes + 1]))])
        parts = sorted((self.part(first, last) for first, last in pairwise(cuts)), key=lambda part: -part.length)
        return [parts[0]], [part for part in parts[1:] if part.length > 0.0]
