"""What mirrors in space, flat or round, have in common: their extent is the set of beams that meet them."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Self

import numpy as np
from scipy.ndimage import binary_dilation, label

from mirrorfold.common.geometry import unit
from mirrorfold.common.types import Array, Index, Mask
from mirrorfold.detection.echoes import Echoes, strongest_of
from mirrorfold.detection.mirrors.mirror import Fold, Mirror
from mirrorfold.detection.views.view import DEVIATION
from mirrorfold.detection.views.volume_view import VolumeView

STRAY_DEVIATIONS = 4.0
"""Largest distance of a face's echoes from it, in standard deviations: it covers the wings of a beam 40 dB above the
noise."""

LEVEL = 1e-6
"""Sine of the angle from the vertical below which the normal of a mirror counts as upright, as that of a floor: no
direction along it is more horizontal than others."""

FEWEST_BEAMS = 4
"""Least number of beams of a piece of a mirror: fewer have hardly any extent."""


@dataclass(frozen=True, eq=False)
class BeamMirror(Mirror[VolumeView]):
    """A mirror of a raster volume.

    The `beams` (azimuths * elevations,) are those that meet it, and its `outline` (n, 3) [m] holds the corners of its
    face, or all points where beams meet it.
    """

    outline: Array = field(repr=False)
    beams: Mask = field(repr=False)

    @abstractmethod
    def met(self, view: VolumeView) -> Array:
        """Range [m] at which each beam meets the endless surface, (beams,); not finite where it does not."""

    @abstractmethod
    def part_in_beams(self, view: VolumeView, beams: Mask) -> Self:
        """The part of its endless surface that the given beams show."""

    @property
    @abstractmethod
    def corners(self) -> Array:
        """Four corners around the visible part of the mirror, in order around its face, (4, 3) [m]."""

    @cached_property
    def tangents(self) -> Array:
        """Unit vectors along the tangent plane at its center, horizontal and up, (2, 3)."""
        across = np.cross([0.0, 0.0, 1.0], self.normal)
        right = unit(across) if np.linalg.norm(across) > LEVEL else np.array([1.0, 0.0, 0.0])
        return np.stack([right, np.cross(self.normal, right)])

    @cached_property
    def sides(self) -> Array:
        """Where the face begins and ends along its `tangents`, measured from its `center`, (2, 2) [m]."""
        flat = self.tangents @ (self.outline - self.center).T
        return np.stack([flat.min(axis=1), flat.max(axis=1)], axis=1)

    @property
    def extent(self) -> Array:
        """Width and height of the face [m], (2,)."""
        return np.ptp(self.sides, axis=1)

    def beam_steps(self, view: VolumeView) -> float:
        """Radius of the beam at the `center`, in steps of the scan."""
        distance = float(np.linalg.norm(self.center - view.radar))
        return float(view.width(distance)) / (view.beam_step * distance)

    def crossing(self, view: VolumeView) -> Array:
        """Range [m] at which each beam meets the mirror, (beams,); infinite where it does not."""
        return np.where(self.beams, self.met(view), np.inf)

    def near(self, view: VolumeView, echoes: Echoes) -> tuple[Mask, Mask, Array]:
        """Echoes in beams of which a part, up to the radius, meets the mirror; echoes in beams whose axis meets it; and
        the largest distance from the face of the echoes that are its own [m].
        """
        wide = binary_dilation(self.beams.reshape(view.shape), iterations=int(np.ceil(self.beam_steps(view)))).ravel()
        across = view.extent_each(echoes.position, self.facing(echoes.position)[1])
        reach = view.range_cell + STRAY_DEVIATIONS * DEVIATION * across
        return wide[echoes.direction], self.beams[echoes.direction], reach

    def places(self, view: VolumeView) -> Array:
        """Where its beams meet it, (n, 3) [m]; not finite for a beam that misses its endless surface."""
        return view.points(self.met(view)[self.beams], np.flatnonzero(self.beams))

    def profiles(self, view: VolumeView, places: Array, depth: Array) -> tuple[Array, Array]:
        """Along its beams, not square to it: a beam gathers echoes from its footprint, which is nearly symmetric about
        its axis. Depths count from where the echoes of a face have their centroid of power, see `off_axis`.
        """
        sight = view.sight[self.beams]
        inward = sight / np.abs(np.sum(sight * self.facing(places)[1], axis=1))[:, None]
        face = np.linalg.norm(places - view.radar, axis=1) + self.off_axis(view, places)
        range_ = face[:, None] + np.linalg.norm(inward, axis=1)[:, None] * depth
        return inward, view.power_at(range_, np.flatnonzero(self.beams)[:, None])

    def off_axis(self, view: VolumeView, places: Array) -> Array:
        """By how much [m] the centroid of power of its echoes is farther away than where the axis of a beam meets it.

        `places` (n, 3) [m] are those where the axes meet it; zero where it is not known.
        """
        return np.zeros(len(places))

    def independent(self, view: VolumeView) -> float:
        """Number of its beams, divided by the number of beams in a square of one beam radius, which see the same
        speckle.
        """
        steps = view.beside_steps(np.linalg.norm(self.places(view) - view.radar, axis=1))
        return np.count_nonzero(self.beams) / max(float(np.mean(steps**2)), 1.0)

    def filled(self, view: VolumeView, echoes: Echoes) -> float:
        """Share of its beams that hold one of the echoes."""
        return float(self.beams[np.unique(echoes.direction)].sum() / max(self.beams.sum(), 1))

    def snapped(self, view: VolumeView, echoes: Echoes) -> Echoes:
        """The strongest echo of each beam, moved to where the axis of the beam meets the mirror."""
        echoes = echoes.take(strongest_of(echoes.direction, echoes.amplitude))
        range_ = self.met(view)[echoes.direction]
        return replace(echoes, position=view.points(range_, echoes.direction), range=range_)

    def pieces(
        self, view: VolumeView, direction: Index, before: Index, smallest: float
    ) -> tuple[list[Self], list[Self]]:
        """Cut the mirror into connected sets of beams with the same `before`.

        Returns the pieces of at least half the `smallest` width and height [m], and the smaller ones.
        """
        kept: list[Self] = []
        remains: list[Self] = []
        for value in np.unique(before):
            part = np.zeros(self.beams.size, dtype=bool)
            part[direction[before == value]] = True
            regions, count = label(part.reshape(view.shape))
            for number in range(1, count + 1):
                beams = (regions == number).ravel()
                if beams.sum() < FEWEST_BEAMS:
                    continue
                piece = self.part_in_beams(view, beams)
                (kept if min(piece.extent) >= 0.5 * smallest else remains).append(piece)
        return (kept, remains) if kept else ([self], [])

    def columns(self, fold: Fold) -> dict[str, Any]:
        """Its ends, center, normal and corners."""
        center, corners = fold(self.center), fold(self.corners)
        normal = fold(self.center + self.normal) - center
        found = super().columns(fold)
        for i, axis in enumerate("xyz"):
            found |= {f"center_{axis}": center[i], f"normal_{axis}": normal[i], f"corner_{axis}": corners[:, i]}
        return found
