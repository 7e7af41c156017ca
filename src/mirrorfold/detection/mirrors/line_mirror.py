"""A straight mirror in the floor plan, and the profiles of power across it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from mirrorfold.common.geometry import unit
from mirrorfold.common.types import Array, Index, Mask
from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.mirrors.mirror import Mirror
from mirrorfold.detection.views.image_view import ImageView

SPACING, FEWEST_PROFILES = 0.25, 8
"""Distance between neighbouring profiles along a mirror, in range cells: the cell along it is hardly smaller, so that
they show all that varies along it. And least number of profiles of a short mirror: twice what a fit needs."""

CLEAR_SHARE = 0.25
"""Places on a wall that misplaced echoes blur are left out of its profiles, if more than this share of the places is
clear of them: fewer would not say where the wall stands. At 79 GHz, the echoes that go by way of both of two walls at
right angles blur up to two thirds of what is seen of one of them."""

LEG_SHARE = 0.65
"""Least length of the legs of a corner whose vertex is known, as a share of the least length of mirrors: five
resolution cells. Each leg is the mirror in which the other leg seems to go on straight beyond the vertex. So the image
shows a row of twice the length, which is long enough to be known as straight."""

END_CELLS = 0.6
"""Length that profiles leave out at either end of a row, as a share of the resolution cell along it, if the cell lies
askew to the row."""


@dataclass(frozen=True, eq=False)
class LineMirror(Mirror[ImageView]):
    """A straight mirror of an image from `start` to `end`, (2,) [m] each.

    Its `length` [m] and its `direction` (2,), a unit vector from start to end, follow from these.
    """

    start: Array
    end: Array
    length: float = field(init=False)
    direction: Array = field(init=False)

    def __post_init__(self) -> None:
        along = self.end - self.start
        length = math.sqrt(along @ along)
        direction = along / (length or math.nan)  # a piece that is cut off may have no length
        object.__setattr__(self, "center", 0.5 * (self.start + self.end))
        object.__setattr__(self, "length", length)
        object.__setattr__(self, "direction", direction)
        object.__setattr__(self, "normal", np.array([-direction[1], direction[0]]))

    @property
    def tangents(self) -> Array:
        """`direction` as a row, (1, 2)."""
        return self.direction[None]

    @property
    def sides(self) -> Array:
        """Where it begins and ends along its `direction`, measured from its `center`, (1, 2) [m]."""
        return 0.5 * self.length * np.array([[-1.0, 1.0]])

    @property
    def ends(self) -> Array:
        """Start and end, (2, 2) [m]."""
        return np.stack([self.start, self.end])

    def at(self, along: Array) -> Array:
        """Points at positions [m] along the mirror, (..., 2)."""
        return self.start + along[..., None] * self.direction

    def along(self, points: Array) -> Array:
        """Position [m] of points (..., 2) along the mirror, from its start."""
        return (points - self.start) @ self.direction

    def part(self, first: float, last: float) -> LineMirror:
        """The mirror from one position [m] along it to another."""
        overhang = self.overhang[0] if first <= 0.0 else 0.0, self.overhang[1] if last >= self.length else 0.0
        start, end = (self.start + place * self.direction for place in (first, last))
        return replace(self, start=start, end=end, overhang=overhang)

    def crossing(self, view: ImageView) -> Array:
        """Range [m] at which each direction meets the mirror, (nu,); infinite where it does not."""
        range_ = view.meets(self.normal, self.center)
        with np.errstate(invalid="ignore"):
            along = self.along(view.radar + range_[:, None] * view.sight)
        return np.where((along >= -self.overhang[0]) & (along <= self.length + self.overhang[1]), range_, np.inf)

    def near(self, view: ImageView, echoes: Echoes) -> tuple[Mask, Mask, Array]:
        """Echoes beside it, up to a cell past its ends, as wall and as face alike; the cell's width across it [m]."""
        along, across = view.extent(echoes.position, np.stack([self.direction, self.normal], axis=1)).T
        beside = np.abs(self.along(echoes.position) - 0.5 * self.length) <= 0.5 * self.length + along
        return beside, beside, across

    def places(self, view: ImageView) -> Array:
        """Places in equal steps along the mirror, without its ends, (n, 2) [m].

        Places that echoes from elsewhere blur are left out, too, if enough others remain. The ends are left out because
        a resolution cell that lies askew to the row is filled on one side only where the row ends. Its centroid of
        power moves off the line, to opposite sides at the two ends, which turns a short wall. The effect grows with the
        correlation of the cell's extents along and across the row; so does the length that is left out.
        """
        square = view.squares(self.ends)
        across, along = (np.sqrt(square(axis)) for axis in (self.normal, self.direction))
        overlap = view.range_cell * view.cross_cell(self.ends) / (across * along)
        left_out = END_CELLS * np.sqrt(np.maximum(1.0 - overlap**2, 0.0)) * along
        if left_out.any():
            left_out *= min(1.0, 0.5 * self.length / left_out.sum())
        count = profile_count(self.length, view)
        row = self.at(np.linspace(left_out[0], self.length - left_out[1], count))
        clear = ~view.near_misplaced(row)
        return row[clear] if np.mean(clear) > CLEAR_SHARE else row

    def profiles(self, view: ImageView, places: Array, depth: Array) -> tuple[Array, Array]:
        """Square to the mirror."""
        inward = np.broadcast_to(self.inward(view), places.shape)
        return inward, view.power_at(*view.to_polar(places[:, None] + depth[..., None] * inward[:, None]))

    def section(self, view: ImageView, points: Array) -> Array:
        """Length [m] of the section of its line through the resolution cell at each of points (n, 2), (n,).

        Where the cell lies askew to the line, this section is shorter than the extent of the cell along the line.
        """
        return view.range_cell * view.cross_cell(points) / view.extent(points, self.normal)

    def independent(self, view: ImageView) -> float:
        """Length of the mirror over the section of its line through a resolution cell."""
        return float(self.length / self.section(view, self.ends).mean())

    def moved(self, normal: Array, center: Array) -> LineMirror:
        """A mirror of the same length, whose middle is moved square onto the new line."""
        middle = self.center - ((self.center - center) @ normal) * normal
        half = 0.5 * self.length * unit(self.direction - (self.direction @ normal) * normal)
        return replace(self, start=middle - half, end=middle + half)

    def filled(self, view: ImageView, echoes: Echoes) -> float:
        """Share of its length within half a resolution cell of one of the echoes."""
        position, half = self.along(echoes.position), 0.5 * view.extent(echoes.position, self.direction)
        return covered_share(position, half, self.length)

    def snapped(self, view: ImageView, echoes: Echoes) -> Echoes:
        """Its echoes, moved square onto the line, and onto its ends if they lie beyond."""
        return replace(echoes, position=self.at(np.clip(self.along(echoes.position), 0.0, self.length)))

    def pieces(
        self, view: ImageView, direction: Index, before: Index, smallest: float
    ) -> tuple[list[LineMirror], list[LineMirror]]:
        """Cut the mirror where `before` changes: pieces of at least the `smallest` length [m], and shorter ones.

        If none is so long, and the cut is at a corner, its legs and their images need only `LEG_SHARE` of that length.
        """
        position = self.along(view.points(self.crossing(view)[direction], direction))
        changes = np.flatnonzero(before[1:] != before[:-1])
        middle = 0.5 * (position[changes] + position[changes + 1])
        cuts = np.unique(np.clip([0.0, self.length, *middle], 0.0, self.length)).tolist()  # none beyond its ends
        parts = [self.part(first, last) for first, last in pairwise(cuts) if last > first]
        kept = [part for part in parts if part.length >= smallest]
        if not kept and view.near_corner(np.array([part.end for part in parts[:-1]]).reshape(-1, 2)).any():
            smallest *= LEG_SHARE
            kept = [part for part in parts if part.length >= smallest]
        return (kept, [part for part in parts if part.length < smallest]) if kept else ([self], [])


def profile_count(length: float, view: ImageView) -> int:
    """Number of profiles along a mirror of a length [m]."""
    return max(FEWEST_PROFILES, int(length / (SPACING * view.range_cell)))


def covered_share(position: Array, half: Array, length: float) -> float:
    """Share of a length [m] that echoes cover, each from ``position - half`` to ``position + half`` [m], (n,)."""
    first, last = np.clip([position - half, position + half], 0.0, length)
    order = np.argsort(first)
    # Each echo adds what it covers beyond all echoes before it.
    covered = np.maximum.accumulate(np.concatenate([[0.0], last[order]]))
    return float(np.maximum(last[order] - np.maximum(first[order], covered[:-1]), 0.0).sum() / length)
