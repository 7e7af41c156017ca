"""A curved mirror in space: a cylinder or a sphere, with a tangent plane of its own for every line of sight.

An echo behind the surface is reflected by the tangent plane at the point where its line of sight meets the surface.
That is exact for the axis of the beam, whose echo the volume shows at the length of the whole path.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mirrorfold.common.beams import spread_beam
from mirrorfold.common.geometry import unit_or_zero
from mirrorfold.common.round_surfaces import RoundSurface
from mirrorfold.common.types import Array, Mask
from mirrorfold.detection.mirrors.beam_mirror import BeamMirror
from mirrorfold.detection.mirrors.mirror import Fold
from mirrorfold.detection.views.volume_view import VolumeView


@dataclass(frozen=True, eq=False)
class RoundMirror(BeamMirror):
    """A part of a cylinder or of a sphere, its whole `shape`, in a raster volume, seen from outside; see `BeamMirror`.

    The `radar` stands at (3,) [m], and its `beam` is that of the scanner, as in `VolumeView`.
    """

    shape: RoundSurface
    radar: Array
    beam: tuple[float, float, float] | None = None

    curved = True

    def __post_init__(self) -> None:
        center, normal = self.shape.middle, np.array([0.0, -1.0, 0.0])
        if len(self.outline):
            center = self.shape.nearest(self.outline.mean(axis=0))
            normal = self.shape.outward(center)
        object.__setattr__(self, "center", center)
        object.__setattr__(self, "normal", normal)

    @property
    def curvature(self) -> float:
        """One over the radius [1/m]; positive, as it bulges towards the radar."""
        return 1.0 / self.shape.radius

    @property
    def ends(self) -> Array:
        """The outermost visible points to the left and to the right, shifted along the axis of a cylinder to its
        center, (2, 3) [m].
        """
        across = (self.outline - self.center) @ self.tangents[0]
        found = self.outline[[np.argmin(across), np.argmax(across)]]
        along, axis = self.shape.along, self.shape.axis
        return found + along(self.center) * axis - along(found)[:, None] * axis

    @property
    def corners(self) -> Array:
        """Four points around its face, (4, 3) [m]: of a cylinder, its `ends` at either end of the axis; of a sphere,
        the outermost visible points to all four sides.
        """
        if not self.shape.axis.any():
            place = (self.outline - self.center) @ self.tangents.T
            return self.outline[[f(place[:, i]) for f in (np.argmin, np.argmax) for i in (0, 1)]]
        place, here = self.shape.along(self.outline), self.shape.along(self.center)
        low, high = ((edge - here) * self.shape.axis for edge in (place.min(), place.max()))
        left, right = self.ends
        return np.stack([left + low, right + low, right + high, left + high])

    def met(self, view: VolumeView) -> Array:
        """Range [m] at which the axes of the beams enter the endless surface, (beams,); infinite where they miss it."""
        return np.nan_to_num(self.shape.met(self.radar, view.sight), nan=np.inf)

    def facing(self, points: Array) -> tuple[Array, Array]:
        """Points where the lines of sight through points (n, 3) meet the surface, and its normals there, (n, 3) each.

        A line of sight that misses the surface is taken to meet it at the point that it passes nearest.
        """
        sight = unit_or_zero(points - self.radar)
        range_ = self.shape.met(self.radar, sight)
        range_ = np.where(np.isfinite(range_), range_, self.shape.passed(self.radar, sight))
        hit = self.shape.nearest(self.radar + range_[..., None] * sight)
        return hit, self.shape.outward(hit)

    def beside(self, points: Array) -> Array:
        """Distance [m] of points (n, 3) from the tangent planes that their lines of sight meet, positive outside."""
        hit, normal = self.facing(points)
        return np.sum((points - hit) * normal, axis=-1)

    def growth(self, points: Array) -> Array:
        """Factor by which the mirror widens the beam at the true places of points (n, 3) of the image, (n, 2).

        It is the radius of the beam over that behind a flat mirror, along both principal directions of the mirror.
        Where the beam is not known, it is that of thin pencils of rays, ``1 + p r1 s / (r1 + s)``, with p the curvature
        [1/m] that the mirror adds to the waves.
        """
        hit, normal = self.facing(points)
        sight, way = hit - self.radar, np.linalg.norm(points - self.radar, axis=-1)
        before = np.linalg.norm(sight, axis=-1)
        rest = np.maximum(way - before, 0.0)
        power, _ = self.shape.bending(sight / before[:, None], normal)
        if self.beam is None:
            return 1.0 + power * (before * rest / way)[:, None]
        known = dict(zip(("spot_radius", "focus_distance", "wavelength"), self.beam, strict=True))
        width, straight = (spread_beam(before[:, None], rest[:, None], p, **known)[0] for p in (power, 0.0 * power))
        return width / straight

    def part_in_beams(self, view: VolumeView, beams: Mask) -> RoundMirror:
        """The part of the surface that the given beams show."""
        range_ = self.met(view)
        beams = beams & np.isfinite(range_)
        return replace(self, beams=beams, outline=view.points(range_[beams], np.flatnonzero(beams)))

    def off_middle(self, points: Array) -> Array:
        """Distance [m] of points (n, 3) from its center, across the axis of a cylinder, (n,)."""
        return np.linalg.norm(self.shape.across(points - self.center), axis=1)

    def columns(self, fold: Fold) -> dict[str, Any]:
        """Columns as of any `BeamMirror`, and the axis of a cylinder; zero for a sphere."""
        axis = fold(self.center + self.shape.axis) - fold(self.center)
        return super().columns(fold) | {f"axis_{name}": axis[i] for i, name in enumerate("xyz")}
