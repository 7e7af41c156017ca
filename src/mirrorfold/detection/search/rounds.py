"""Step 2 in space, for curved mirrors: sheets of echoes that follow a cylinder or a sphere.

Two echoes of a neighbourhood and the directions in which their surroundings face propose a cylinder and a sphere, all
echoes vote, and the best proposal grows to the unbroken sheet about it, as for planes (`growing`). What is seen
behind it tells whether it is a mirror, or a round object.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from mirrorfold.common.geometry import unit
from mirrorfold.common.round_surfaces import RoundSurface
from mirrorfold.common.types import Array, Index, Mask
from mirrorfold.detection.echoes import Echoes, strongest_of
from mirrorfold.detection.mirrors.curved import on_rows
from mirrorfold.detection.mirrors.round_mirror import RoundMirror
from mirrorfold.detection.search.arcs import BULGE_CELLS, LARGEST_CELLS, REACH_CELLS, SIGNIFICANT, SMALLEST_CELLS
from mirrorfold.detection.search.fit import SIGMA_PER_MEDIAN, trusted
from mirrorfold.detection.search.growing import CLIP, NEAR, drawn
from mirrorfold.detection.search.planes import SMALLEST_FILL, largest_sheet
from mirrorfold.detection.views.view import DEVIATION
from mirrorfold.detection.views.volume_view import VolumeView

PROPOSALS = 300
"""Pairs of echoes that propose a surface, each of either kind."""

NEAR_CELLS = 1.5
"""Echoes that propose a surface lie so many resolution cells apart, or more: closer ones say nothing of its curve."""

NEIGHBOURS = 24
"""Echoes around each that tell in which direction the surface faces: of beams half a cell apart those of two cells."""

TURNED = np.cos(np.radians(25.0))
"""An echo votes for a surface if its surroundings face as that does within this angle: speckle and range cells tilt
them."""

SMALLEST_TURN = np.radians(10.0)
"""Two echoes that face within this angle of each other propose no surface: their own errors are a few degrees."""

SHORTEST_CELLS = 3.5
"""Least width and height, in resolution cells: of a sphere whose radius is two cells the radar sees some four."""

LARGEST_DEVIATION, MOST_OFF = 0.6, 0.05
"""Deviation of a sheet's echoes from the surface, relative to that of power in the resolution cell: pillars and balls
show 0.32 to 0.45, for an echo is the mean of its cell, bodies 0.7 and more. And share of its beams whose brightest echo
lies off it: of pillars and balls 0.01 at most, of bodies 0.09 and more."""

GLINT = 10.0 ** (12.0 / 20.0)
"""A surface smooth enough to be a mirror returns a glint from where it faces the radar, brighter than the median of its
face by more than that: the brightest of a thousand speckles exceeds it by 10 dB, and a pillar's glint by 30."""

GRAZING = 0.3
"""Cosine to the line of sight, 72 degrees, below which an echo says little of the surface: the beam sees past it."""

FEWEST, MISSES, MOST, ROUNDS, FITS = 30, 6, 8, 4, 6
"""Echoes that make a sheet; proposals in a row that are none before the search ends; sheets that are found; rounds of
growth, and steps of each fit."""


def find_rounds(view: VolumeView, echoes: Echoes) -> list[RoundMirror]:
    """Round sheets among the visible of some echoes that are seen by one way; those with the most votes first."""
    return _Rounds(echoes.take(echoes.visible), view).find()


def fitted(shape: RoundSurface, points: Array, weight: Array) -> tuple[RoundSurface, Array, Array]:
    """The surface of the same kind with the least weighted squared distances to points (n, 3), from a first one on.

    Gauss and Newton's steps, with Cauchy weights against what stands elsewhere (see `fit.trusted`). Returns trust
    (n,), and the derivatives (n, p) of the distances by what was fitted: the middle, in the plane across the axis, the
    radius, and for a cylinder the tilt of its axis, along both directions of that plane.
    """
    trust, design = weight, np.empty((len(points), 0))
    cylinder = bool(shape.axis.any())
    if cylinder:  # the middle of the axis beside the points, about which it is tilted
        shape = replace(shape, middle=shape.middle + np.average(shape.along(points), weights=weight) * shape.axis)
    for _ in range(FITS):
        base = shape.base
        normal, beside = shape.outward(points), shape.beside(points)
        _, trust = trusted(beside, weight, 1e-9 * shape.radius)
        flat = normal @ base.T
        design = np.column_stack([flat, np.ones(len(points))])
        if cylinder:
            design = np.column_stack([design, shape.along(points)[:, None] * flat])
        root = np.sqrt(trust)
        step = np.linalg.lstsq(root[:, None] * design, root * beside, rcond=None)[0]
        count = len(base)
        middle, radius = shape.middle + step[:count] @ base, shape.radius + float(step[count])
        axis = unit(shape.axis + step[count + 1 :] @ base) if cylinder else shape.axis
        if not radius > 0.0 or not np.isfinite(middle).all():
            break
        shape = RoundSurface(middle, axis, radius)
    return shape, trust, design


@dataclass
class _Rounds:
    """The search among echoes that are seen by one way."""

    echoes: Echoes
    view: VolumeView

    def find(self) -> list[RoundMirror]:
        """Sheets, from the one with the most votes on."""
        if len(self.echoes) < FEWEST:
            return []
        echoes, view = self.echoes, self.view
        usual = np.median(echoes.amplitude)
        self.weight = np.minimum(echoes.amplitude / usual, CLIP)
        self.random = np.random.default_rng(0)
        self.normal, self.even = self._facing()
        free, missed, found = self.even.copy(), 0, list[RoundMirror]()
        while np.count_nonzero(free) >= FEWEST and missed <= MISSES and len(found) < MOST:
            shape = self._proposed(np.flatnonzero(free))
            if shape is None:
                break
            mirror, member = self._grown(shape, free)
            missed = 0 if mirror is not None else missed + 1
            if mirror is not None:
                found.append(mirror)
                free &= ~on_rows([mirror], view, echoes)
            if not free[member].any() and mirror is None:
                break
            free[member] = False
        return found

    def _facing(self) -> tuple[Array, Mask]:
        """In which direction the surroundings of each echo face, (n, 3), and where they are even enough to tell."""
        points, view = self.echoes.position, self.view
        _, near = cKDTree(points).query(points, k=min(NEIGHBOURS, len(points)))
        offset = points[near] - points[near].mean(axis=1, keepdims=True)
        size, axes = np.linalg.eigh(np.einsum("nki,nkj->nij", offset, offset) / near.shape[1])
        normal = axes[:, :, 0]
        sight = unit(points - view.radar)
        normal *= -np.sign(np.sum(normal * sight, axis=1))[:, None]
        cell = np.asarray(view.cell(self.echoes.range))
        # Of a sheet, neighbours reach as far in two directions; single echoes and threads tell nothing.
        even = (size[:, 0] < 0.25 * size[:, 1]) & (size[:, 2] < (4.0 * cell) ** 2)
        return normal, even

    def _proposed(self, free: Index) -> RoundSurface | None:
        """The surface near most echoes, by their weight."""
        judge = drawn(free)
        points, weight, normal = self.echoes.position[judge], self.weight[judge], self.normal[judge]
        cell = float(np.median(self.view.cell(self.echoes.range[judge])))
        seeds = self.random.choice(judge.size, PROPOSALS, p=weight / weight.sum())
        distance = cdist(points[seeds], points)
        near = (distance > NEAR_CELLS * cell) & (distance < REACH_CELLS * cell)
        other = np.argmax(near * self.random.random(near.shape), axis=1)
        sound = near[np.arange(seeds.size), other] & (
            np.sum(normal[seeds] * normal[other], axis=1) < np.cos(SMALLEST_TURN)
        )
        best, most = None, 0.0
        limit = 0.5 * self.view.extent_each(points, normal)
        for a, b in zip(seeds[sound], other[sound], strict=True):
            for axis in (unit(np.cross(normal[a], normal[b])), np.zeros(3)):
                shape = _through(points[a], normal[a], points[b], normal[b], axis)
                if shape is None or not SMALLEST_CELLS * cell < shape.radius < LARGEST_CELLS * cell:
                    continue
                votes = float(self._on(shape, points, normal, limit) @ weight)
                if votes > most:
                    best, most = shape, votes
        return best

    @staticmethod
    def _on(shape: RoundSurface, points: Array, normal: Array, limit: Array) -> Mask:
        """Which points lie on a surface to so far beside it, (n,) [m], and face as it does."""
        return (np.abs(shape.beside(points)) < limit) & (np.sum(shape.outward(points) * normal, axis=1) > TURNED)

    def _grown(self, shape: RoundSurface, free: Mask) -> tuple[RoundMirror | None, Index]:
        """The mirror that a proposal grows to, None if it is none; and the echoes to take out of the search."""
        echoes, view = self.echoes, self.view
        points, member = echoes.position, np.flatnonzero(free)
        mirror = RoundMirror(np.empty((0, 3)), np.zeros(len(view.sight), bool), shape, view.radar, view.beam)
        trust, design = np.empty(0), np.empty((0, 0))
        for i in range(ROUNDS):
            limit = (NEAR if i else 1.0) * view.extent_each(points, shape.outward(points))
            towards = np.sum(shape.outward(points) * (view.radar - points), axis=1) > GRAZING * echoes.range
            near = np.flatnonzero(free & towards & self._on(shape, points, self.normal, limit))
            if near.size < FEWEST:
                return None, near if near.size else member
            mirror, member = self._patch(replace(mirror, shape=shape), near)
            if member.size < FEWEST:
                return None, near
            across = view.extent_each(points[member], shape.outward(points[member]))
            weight = self.weight[member] / across**2
            kinds = [shape] if i else [shape, *_other_kind(shape, points[member], self.normal[member])]
            fits = [fitted(kind, points[member], weight) for kind in kinds]
            left = [float(np.sum(t * s.beside(points[member]) ** 2) / np.sum(t)) for s, t, _ in fits]
            shape, trust, design = fits[int(np.argmin(left))]
            largest = LARGEST_CELLS * np.median(view.cell(echoes.range[member]))
            if not 0.0 < shape.radius < largest:
                return None, member
        return self._judged(replace(mirror, shape=shape).shown(view, mirror.beams), member, trust, design), member

    def _patch(self, mirror: RoundMirror, near: Index) -> tuple[RoundMirror, Index]:
        """The largest connected set of beams that show the surface, its small gaps closed."""
        beam = self.echoes.direction[near]
        beams = largest_sheet(beam, self.view.shape, thinnest=1).ravel()
        if not beams.any():
            return mirror, near[:0]
        return mirror.shown(self.view, beams), near[beams[beam]]

    def _judged(self, mirror: RoundMirror, member: Index, trust: Array, design: Array) -> RoundMirror | None:
        """The mirror with its errors, as far as it is seen; None if it is no round sheet."""
        view, echoes, shape = self.view, self.echoes, mirror.shape
        cell = view.cell_at(mirror.center)
        # What is seen of it across its axis, or in its larger extent.
        across = shape.across(mirror.outline - mirror.center) if shape.axis.any() else mirror.outline - mirror.center
        half = min(0.5 * float(np.ptp(across @ mirror.tangents.T, axis=0).max()), shape.radius)
        bulge = shape.radius - np.sqrt(shape.radius**2 - half**2)
        if mirror.extent.min() < SHORTEST_CELLS * cell or bulge < BULGE_CELLS * cell:
            return None
        points, on_it = echoes.position[member], echoes.take(member)
        beside = shape.beside(points)
        footprint = DEVIATION * view.extent_each(points, shape.outward(points))
        if (
            SIGMA_PER_MEDIAN * float(np.median(np.abs(beside) / footprint)) > LARGEST_DEVIATION
            or self._off(mirror) > MOST_OFF
        ):
            return None
        # Echoes of one resolution cell stray together.
        share = len(member) / max(view.cell_numbers(points).max() + 1.0, 1.0)
        bread = np.linalg.pinv(design.T @ (trust[:, None] * design))
        variance = bread * float(np.sum(trust * beside**2)) / max(len(member) / share - design.shape[1], 1.0)
        base = shape.base
        count = len(base)
        at = np.concatenate([np.zeros(count), [1.0], np.zeros(design.shape[1] - count - 1)])
        at[:count] = base @ mirror.normal
        tangents = mirror.tangents @ base.T
        turn = np.linalg.eigvalsh(tangents @ variance[:count, :count] @ tangents.T)[-1] / shape.radius**2
        if count == 2:
            turn += np.linalg.eigvalsh(variance[count + 1 :, count + 1 :])[-1]
        mirror = replace(
            mirror,
            offset_error=float(np.sqrt(max(at @ variance @ at, 0.0))),
            angle_error=float(np.degrees(np.sqrt(max(turn, 0.0)))),
            curvature_error=float(np.sqrt(variance[count, count])) / shape.radius**2,
            fill=mirror.filled(view, on_it),
            strength=float(np.median(on_it.amplitude)),
        )
        sure = mirror.curvature > SIGNIFICANT * mirror.curvature_error and self._shines(mirror)
        return self._whole(mirror) if sure and mirror.fill >= SMALLEST_FILL else None

    def _off(self, mirror: RoundMirror) -> float:
        """Share of the beams with echoes in which the brightest one lies beside the surface."""
        echoes = self.echoes.take(mirror.beams[self.echoes.direction])
        points = echoes.position[strongest_of(echoes.direction, echoes.amplitude)]
        across = self.view.extent_each(points, mirror.shape.outward(points))
        return float(np.mean(np.abs(mirror.shape.beside(points)) > NEAR * across))

    def _shines(self, mirror: RoundMirror) -> bool:
        """Whether it returns a glint, where the place that faces the radar is in view."""
        view, echoes = self.view, self.echoes
        place = mirror.shape.nearest(view.radar)
        range_, direction, inside = view.locate(place)
        if not inside or not mirror.beams[direction]:
            return True
        near = np.linalg.norm(echoes.position - place, axis=1) <= view.cell(range_)
        return bool(echoes.amplitude[near].max(initial=0.0) >= GLINT * mirror.strength)

    def _whole(self, mirror: RoundMirror) -> RoundMirror:
        """The mirror with the beams beside it in which its own echoes stand, however obliquely they meet it."""
        echoes, view = self.echoes, self.view
        everywhere = mirror.shown(view, np.ones(len(view.sight), bool))
        _, _, across = everywhere.near(view, echoes)
        range_ = everywhere.met(view)[echoes.direction]
        near = np.flatnonzero(np.isfinite(range_) & (np.abs(everywhere.beside(echoes.position)) <= across))
        wider, _ = self._patch(mirror, near) if near.size else (mirror, near)
        return wider.shown(view, wider.beams | mirror.beams)


def _through(a: Array, facing_a: Array, b: Array, facing_b: Array, axis: Array) -> RoundSurface | None:
    """The sphere, or the cylinder about an axis, on which two places lie and face so; None if none bulges.

    From ``a - R n_a = b - R n_b``, in the plane across the axis: ``R = (a - b).(n_a - n_b) / |n_a - n_b|^2``.
    """
    turn = facing_a - facing_b
    radius = float((a - b) @ turn / (turn @ turn))
    if not radius > 0.0:
        return None
    return RoundSurface(0.5 * (a + b - radius * (facing_a + facing_b)), axis, radius)


def _other_kind(shape: RoundSurface, points: Array, normal: Array) -> list[RoundSurface]:
    """A cylinder in the place of a sphere, or the reverse, through the same points (n, 3) with those normals."""
    if shape.axis.any():
        return [replace(shape, middle=shape.middle + shape.along(points.mean(axis=0)) * shape.axis, axis=np.zeros(3))]
    spread = normal - normal.mean(axis=0)
    return [replace(shape, axis=np.linalg.eigh(spread.T @ spread)[1][:, 0])]
