"""A straight mirror in the floor plan, and the resolution cell about its line."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from mirrorfold.common.geometry import Isometry, cross2, segment_normal
from mirrorfold.common.types import Array, Index, Mask
from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.image_view import ImageView
from mirrorfold.detection.mirror import Mirror


@dataclass(frozen=True, eq=False)
class LineMirror(Mirror):
    """A straight mirror of an image.

    Attributes
    ----------
    start, end : (2,) arrays [m]
        Its ends.
    strength, angle_error, offset_error, fill, depth : float
        See `Mirror`.
    """

    start: Array
    end: Array
    strength: float = 1.0
    angle_error: float = 0.0
    offset_error: float = 0.0
    fill: float = 1.0
    depth: float = 0.0

    @property
    def length(self) -> float:
        """Length [m]."""
        return float(np.linalg.norm(self.end - self.start))

    @property
    def direction(self) -> Array:
        """Unit vector from start to end, (2,)."""
        return (self.end - self.start) / self.length

    @property
    def normal(self) -> Array:  # type: ignore[override]
        """Unit normal, to the left of `direction`, (2,)."""
        return np.asarray(segment_normal(self.start, self.end))

    @property
    def center(self) -> Array:  # type: ignore[override]
        """Midpoint (2,) [m]."""
        return 0.5 * (self.start + self.end)

    @property
    def ends(self) -> Array:
        """Start and end, (2, 2) [m]."""
        return np.stack([self.start, self.end])

    def along(self, points: Array) -> Array:
        """Position [m] of points (..., 2) along the mirror, from its start."""
        return np.asarray((points - self.start) @ self.direction)

    def crossing(self, view: ImageView) -> Array:  # type: ignore[override]
        """Range [m] at which each direction meets the mirror, (nu,); infinite where it does not."""
        towards = view.sight @ self.normal
        with np.errstate(divide="ignore", invalid="ignore"):
            range_ = ((self.start - view.radar) @ self.normal) / towards
            along = self.along(view.radar + range_[:, None] * view.sight)
        return np.where((range_ > 0.0) & (along >= 0.0) & (along <= self.length), range_, np.inf)

    def near(self, view: ImageView, echoes: Echoes) -> tuple[Mask, Mask, Array]:  # type: ignore[override]
        """Echoes beside the mirror, up to a cell beyond its ends; and the cell's width across it [m]."""
        across, along_cell = line_cell(view, echoes.position, self.direction)
        position = self.along(echoes.position)
        beside = (position >= -along_cell) & (position <= self.length + along_cell)
        return beside, beside.copy(), across

    def snapped(self, view: ImageView, echoes: Echoes) -> Echoes:  # type: ignore[override]
        """Its echoes, moved square onto its line."""
        along = np.clip(self.along(echoes.position), 0.0, self.length)
        return replace(echoes, position=self.start + along[:, None] * self.direction)

    def pieces(  # type: ignore[override]
        self, view: ImageView, direction: Index, before: Index, smallest: float
    ) -> tuple[list[LineMirror], list[LineMirror]]:
        """Cut it where `before` changes: mirrors of at least the smallest length [m], and what is shorter."""
        position = self.along(view.points(self.crossing(view)[direction], direction))
        cuts = [0.0, self.length]
        for i in np.flatnonzero(before[1:] != before[:-1]):
            cuts.append(0.5 * (position[i] + position[i + 1]))
        cuts.sort()
        parts = [
            replace(self, start=self.start + a * self.direction, end=self.start + b * self.direction)
            for a, b in pairwise(cuts)
        ]
        kept = [part for part in parts if part.length >= smallest]
        if not kept:
            return [self], []
        return kept, [part for part in parts if 0.0 < part.length < smallest]

    def columns(self, fold: Isometry) -> dict[str, Any]:
        """The ends after a map: x0, y0, x1 and y1."""
        return {f"{axis}{end}": fold(self.ends)[end, i] for end in (0, 1) for i, axis in enumerate("xy")}


def line_cell(view: ImageView, points: Array, direction: Array) -> tuple[Array, Array]:
    """Extent of the resolution cell at points (n, 2), across and along a line of the given direction, each (n,) [m]."""
    range_, u = view.to_polar(points)
    sight = (points - view.radar) / range_[:, None]
    cosine = np.abs(sight @ direction)
    sine = np.abs(cross2(sight, direction))
    cross = view.cross_cell(range_, u)
    return np.hypot(view.range_cell * sine, cross * cosine), np.hypot(view.range_cell * cosine, cross * sine)
