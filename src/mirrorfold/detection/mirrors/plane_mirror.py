"""A plane mirror in space."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mirrorfold.common.types import Array, Mask
from mirrorfold.detection.mirrors.beam_mirror import BeamMirror
from mirrorfold.detection.views.volume_view import VolumeView

SMALLEST_COSINE = 0.087
"""Cosine of 85 degrees, the largest angle of incidence at which a footprint is small against its range."""


@dataclass(frozen=True, eq=False)
class PlaneMirror(BeamMirror):
    """A plane mirror of a raster volume; its `normal` (3,) points towards the radar. For the rest see `BeamMirror`."""

    center: Array
    normal: Array

    @property
    def corners(self) -> Array:
        """The rectangle around the visible part of the plane, two of its sides horizontal, (4, 3) [m]."""
        (left, right), (low, high) = self.sides
        return self.center + np.array([[left, low], [right, low], [right, high], [left, high]]) @ self.tangents

    def met(self, view: VolumeView) -> Array:
        """Range [m] at which the axes of the beams meet the plane, (beams,)."""
        return view.meets(self.normal, self.center)

    def off_axis(self, view: VolumeView, places: Array) -> Array:
        """``w^2 / (8 r) (1 - 2 tan^2(a))`` for a beam of radius w that meets the plane at range r and angle a.

        The range to the plane grows faster on the far side of the footprint than on its near side; but by Lambert's
        law and by spreading, a solid angle returns waves as ``r w^-4``, and less from the far side. Both are of second
        order in w / r, and change along a plane: without them, floors seen at 75 to 80 degrees are turned.
        """
        offset = places - view.radar
        range_ = np.linalg.norm(offset, axis=1)
        cosine = np.maximum(np.abs(offset @ self.normal) / range_, SMALLEST_COSINE)
        return view.width(range_) ** 2 / (8.0 * range_) * (3.0 - 2.0 / cosine**2)

    def moved(self, normal: Array, center: Array) -> PlaneMirror:
        """The mirror of the same beams on another plane, with that normal and through the point `center`."""
        middle = self.center - ((self.center - center) @ normal) * normal
        return replace(self, center=middle, normal=normal * np.sign(normal @ self.normal))

    def part_in_beams(self, view: VolumeView, beams: Mask) -> PlaneMirror:
        """The part of the plane that the given beams show."""
        points = replace(self, beams=beams).places(view)
        return replace(self, center=points.mean(axis=0), outline=points, beams=beams)
