"""A plane mirror in space."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.ndimage import binary_dilation, label
from scipy.spatial import ConvexHull

from mirrorfold.common.geometry import Isometry, unit
from mirrorfold.common.types import Array, Index, Mask
from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.mirror import Mirror
from mirrorfold.detection.volume_view import VolumeView

EDGE_RADII = 1.0
"""Within this many beam radii of a mirror's edge a beam still shows echoes of its wall."""

STRAY_DEVIATIONS = 4.0
"""Echoes of a face lie within this many standard deviations of it: the wings of a beam 40 dB above the noise."""

FEWEST_BEAMS = 4
"""A piece of a mirror in fewer beams has no extent to speak of."""


@dataclass(frozen=True, eq=False)
class PlaneMirror(Mirror):
    """A plane mirror of a raster volume.

    Attributes
    ----------
    center : (3,) array [m]
        Mean of its face.
    normal : (3,) array
        Unit normal, towards the radar.
    outline : (n, 3) array [m]
        Corners of the hull of all that is seen of it.
    beams : (azimuths * elevations,) bool array
        Which beams meet it.
    strength, angle_error, offset_error, fill, depth : float
        See `Mirror`.
    """

    center: Array
    normal: Array
    outline: Array = field(repr=False)
    beams: Mask = field(repr=False)
    strength: float = 1.0
    angle_error: float = 0.0
    offset_error: float = 0.0
    fill: float = 1.0
    depth: float = 0.0

    @cached_property
    def right(self) -> Array:
        """Horizontal unit vector in the plane, (3,)."""
        return horizontal(self.normal)

    @cached_property
    def sides(self) -> Array:
        """Where the face begins and ends along `right`, and along the direction up in the plane, (2, 2) [m]."""
        offset = self.outline - self.center
        flat = np.stack([offset @ self.right, offset @ np.cross(self.normal, self.right)])
        return np.stack([flat.min(axis=1), flat.max(axis=1)], axis=1)

    @property
    def extent(self) -> tuple[float, float]:
        """Width along `right` and height across it [m]."""
        return float(np.ptp(self.sides[0])), float(np.ptp(self.sides[1]))

    @property
    def ends(self) -> Array:
        """Ends of its horizontal middle line, (2, 3) [m]."""
        return np.asarray(self.center + self.sides[0][:, None] * self.right)

    @property
    def corners(self) -> Array:
        """The rectangle around what is seen of it, its sides horizontal and upright, (4, 3) [m]."""
        (left, right), (low, high) = self.sides
        up = np.cross(self.normal, self.right)
        around = ((left, low), (right, low), (right, high), (left, high))
        return np.array([self.center + u * self.right + v * up for u, v in around])

    def crossing(self, view: VolumeView) -> Array:  # type: ignore[override]
        """Range [m] at which each beam meets the mirror, (beams,); infinite where it does not."""
        return np.where(self.beams, plane_ranges(view, self.normal, self.center), np.inf)

    def near(self, view: VolumeView, echoes: Echoes) -> tuple[Mask, Mask, Array]:  # type: ignore[override]
        """Echoes in beams that reach over to the mirror, in those that meet it; and how far they stray [m]."""
        distance = float(np.linalg.norm(self.center - view.radar))
        steps = int(np.ceil(EDGE_RADII * float(view.width(distance)) / (view.beam_step * distance)))
        wide = binary_dilation(self.beams.reshape(view.shape), iterations=steps).ravel()
        cosine = np.abs(view.sight[echoes.direction] @ self.normal)
        stray = view.range_cell + STRAY_DEVIATIONS * view.spread_across(echoes.range, cosine)
        return wide[echoes.direction], self.beams[echoes.direction], stray

    def snapped(self, view: VolumeView, echoes: Echoes) -> Echoes:  # type: ignore[override]
        """One echo a beam, the strongest, where the beam's axis meets the mirror."""
        order = np.lexsort([-echoes.amplitude, echoes.direction])
        echoes = echoes.take(order[np.unique(echoes.direction[order], return_index=True)[1]])
        range_ = self.crossing(view)[echoes.direction]
        return replace(echoes, position=view.points(range_, echoes.direction), range=range_)

    def pieces(  # type: ignore[override]
        self, view: VolumeView, direction: Index, before: Index, smallest: float
    ) -> tuple[list[PlaneMirror], list[PlaneMirror]]:
        """Cut it where `before` changes: connected pieces of half the smallest width and height [m], and the rest."""
        kept: list[PlaneMirror] = []
        remains: list[PlaneMirror] = []
        for value in np.unique(before):
            part = np.zeros(self.beams.size, dtype=bool)
            part[direction[before == value]] = True
            regions, count = label(part.reshape(view.shape))
            for number in range(1, count + 1):
                beams = (regions == number).ravel()
                if beams.sum() < FEWEST_BEAMS:
                    continue
                points = plane_points(view, self.normal, self.center, beams)
                piece = replace(self, center=points.mean(axis=0), outline=points, beams=beams)
                (kept if min(piece.extent) >= 0.5 * smallest else remains).append(piece)
        if not kept:
            return [self], []
        return [replace(piece, outline=hull(piece.outline, piece.normal)) for piece in kept], remains

    def columns(self, fold: Isometry) -> dict[str, Any]:
        """Ends x0 ... z1, center, normal and corners after a map."""
        found: dict[str, Any] = {}
        center = fold(self.center)
        normal, ends, corners = fold(self.center + self.normal) - center, fold(self.ends), fold(self.corners)
        for i, axis in enumerate("xyz"):
            found |= {f"{axis}{end}": ends[end, i] for end in (0, 1)}
            found |= {f"center_{axis}": center[i], f"normal_{axis}": normal[i], f"corner_{axis}": corners[:, i]}
        return found


def horizontal(normal: Array) -> Array:
    """Horizontal unit vector in the plane of that normal, (3,)."""
    across = np.cross([0.0, 0.0, 1.0], normal)
    return unit(across) if np.linalg.norm(across) > 1e-6 else np.array([1.0, 0.0, 0.0])


def plane_ranges(view: VolumeView, normal: Array, center: Array) -> Array:
    """Range [m] at which each beam meets an endless plane, (beams,); infinite where it does not."""
    towards = view.sight @ normal
    with np.errstate(divide="ignore", invalid="ignore"):
        range_ = float((center - view.radar) @ normal) / towards
    return np.where(range_ > 0.0, range_, np.inf)


def plane_points(view: VolumeView, normal: Array, center: Array, beams: Mask) -> Array:
    """Where some of the beams meet an endless plane, (n, 3) [m]."""
    return view.points(plane_ranges(view, normal, center)[beams], np.flatnonzero(beams))


def hull(points: Array, normal: Array) -> Array:
    """Corners of the convex hull of points (n, 3) of a plane, in order."""
    right = horizontal(normal)
    flat = np.stack([points @ right, points @ np.cross(normal, right)], axis=1)
    return np.asarray(points[ConvexHull(flat).vertices])
