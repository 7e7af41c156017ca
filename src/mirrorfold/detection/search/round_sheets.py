"""Step 2 in space, for curved mirrors: sheets of echoes that follow a cylinder or a sphere.

The normal of the surface at each echo is estimated from the echoes around it. Two neighbouring echoes and their normals
propose a cylinder and a sphere. As for planes (`growing`), all echoes vote, and the best proposal grows to an unbroken
sheet of echoes. Whether it is a mirror or a round object is decided later, by the echoes that are seen behind it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from mirrorfold.common.decibels import ratio_of
from mirrorfold.common.geometry import unit, unit_or_zero
from mirrorfold.common.round_surfaces import RoundSurface
from mirrorfold.common.statistics import robust_deviation
from mirrorfold.common.types import Array, Index, Mask
from mirrorfold.detection.echoes import Echoes, strongest_of
from mirrorfold.detection.mirrors.curved import on_rows
from mirrorfold.detection.mirrors.round_mirror import RoundMirror
from mirrorfold.detection.search.arcs import BULGE_CELLS
from mirrorfold.detection.search.circles import LARGEST_CELLS, REACH_CELLS, SMALLEST_CELLS
from mirrorfold.detection.search.fit import robust_weights, weighted_fit
from mirrorfold.detection.search.growing import NEAR, clipped_weight, drawn
from mirrorfold.detection.search.planes import SMALLEST_FILL, largest_sheet
from mirrorfold.detection.views.view import DEVIATION
from mirrorfold.detection.views.volume_view import VolumeView

PROPOSALS = 300
"""Number of pairs of echoes that propose surfaces; each pair proposes a cylinder and a sphere."""

NEAR_CELLS = 1.5
"""Least distance, in resolution cells, between two echoes that propose a surface: closer ones say nothing of its
curvature."""

NEIGHBOURS = 24
"""Number of echoes around each one from which the normal there is estimated: with beams half a cell apart, those within
two cells."""

TURNED = np.cos(np.radians(25.0))
"""Cosine of the largest angle between the normal at an echo and that of a surface for which it votes: speckle and range
cells tilt the normal."""

SMALLEST_TURN = np.radians(10.0)
"""Least angle [rad] between the normals at two echoes that propose a surface: they err by a few degrees."""

SHORTEST_CELLS = 3.5
"""Least width and height, in resolution cells: the radar sees some four cells of a sphere whose radius is two cells."""

LARGEST_DEVIATION, MOST_OFF = 0.6, 0.05
"""Largest standard deviation of a sheet's echoes from the surface, relative to that of power in the resolution cell. It
is 0.32 to 0.45 for pillars and balls, because an echo is the mean of its cell, and 0.7 and more for bodies. And largest
share of its beams whose brightest echo lies off the surface: 0.01 at most for pillars and balls, 0.09 and more for
bodies."""

SIGNIFICANT = 5.0
"""Least curvature, in its standard errors."""

GLINT = ratio_of(12.0)
"""Least amplitude of the glint of a mirror, relative to the median of its face: a surface that is smooth enough for a
mirror returns a glint from where it faces the radar. The brightest of a thousand speckles exceeds the median by 10 dB,
the glint of a pillar by 30 dB."""

FLAT, SPREAD_CELLS = 0.25, 4.0
"""Neighbours of an echo lie in a flat sheet if their variance across it is less than the share `FLAT` of the smaller
one along it, so that they spread along it at least twice as far; and if their standard deviation is less than
`SPREAD_CELLS` resolution cells, as neighbours farther apart are single echoes."""

GRAZING = 0.3
"""Cosine of the largest angle of incidence, 72 degrees: beyond it an echo says little of the surface, because the beam
reaches past it."""

FEWEST, MISSES, MOST, ROUNDS, FITS = 30, 6, 8, 4, 6
"""Least number of echoes of a sheet; number of failed proposals in a row that is tolerated; largest number of sheets
that are found; rounds of growth; and steps of each fit."""


def find_round_sheets(view: VolumeView, echoes: Echoes) -> list[RoundMirror]:
    """Cylinders and spheres among visible echoes that are all seen by way of the same mirrors, most votes first."""
    echoes = echoes.take(echoes.visible)
    return _SheetSearch(echoes, view).find() if len(echoes) >= FEWEST else []


def fitted(shape: RoundSurface, points: Array, weight: Array) -> tuple[RoundSurface, Array, Array]:
    """The surface of the same kind that fits points (n, 3) best, by weighted least squares from a first surface on.

    The fit makes Gauss-Newton steps, with Cauchy weights against outliers (see `fit.robust_weights`). Returns also
    these weights (n,), and the derivatives (n, p) of the distances by the fitted parameters: the middle, in the plane
    across the axis, the radius, and for a cylinder the tilt of its axis along both directions of that plane.
    """
    trust, design = weight, np.empty((len(points), 0))
    cylinder = bool(shape.axis.any())
    if cylinder:  # its axis is tilted about the point beside the mean of the points
        shape = replace(shape, middle=shape.middle + np.average(shape.along(points), weights=weight) * shape.axis)
    for _ in range(FITS):
        base = shape.base
        normal, beside = shape.outward(points), shape.beside(points)
        _, trust = robust_weights(beside, weight, 1e-9 * shape.radius)
        flat = normal @ base.T
        design = np.column_stack([flat, np.ones(len(points))])
        if cylinder:
            design = np.column_stack([design, shape.along(points)[:, None] * flat])
        step = weighted_fit(design, beside, trust)
        count = len(base)
        middle, radius = shape.middle + step[:count] @ base, shape.radius + float(step[count])
        axis = unit(shape.axis + step[count + 1 :] @ base) if cylinder else shape.axis
        if not radius > 0.0 or not np.isfinite(middle).all():
            break
        shape = RoundSurface(middle, axis, radius)
    return shape, trust, design


class _SheetSearch:
    """The search for round sheets among echoes that are all seen by way of the same mirrors."""

    def __init__(self, echoes: Echoes, view: VolumeView) -> None:
        self.echoes, self.view = echoes, view
        self.weight = clipped_weight(echoes, echoes.amplitude)
        self.random = np.random.default_rng(0)
        self.normal, self.reliable = self._normals()

    def find(self) -> list[RoundMirror]:
        """All sheets, that with the most votes first."""
        free, missed, found = self.reliable.copy(), 0, list[RoundMirror]()
        while np.count_nonzero(free) >= FEWEST and missed <= MISSES and len(found) < MOST:
            shape = self._proposed(np.flatnonzero(free))
            if shape is None:
                break
            mirror, member = self._grown(shape, free)
            missed = 0 if mirror is not None else missed + 1
            if mirror is not None:
                found.append(mirror)
                free &= ~on_rows([mirror], self.view, self.echoes)
            if not free[member].any() and mirror is None:
                break
            free[member] = False
        return found

    def _normals(self) -> tuple[Array, Mask]:
        """Unit normals of the surface at each echo, towards the radar, (n, 3), and where they are reliable, (n,).

        The normal is that of the plane through the neighbours of the echo. It is reliable if these lie in a flat sheet.
        """
        points, view = self.echoes.position, self.view
        _, near = cKDTree(points).query(points, k=min(NEIGHBOURS, len(points)))
        offset = points[near] - points[near].mean(axis=1, keepdims=True)
        size, axes = np.linalg.eigh(np.einsum("nki,nkj->nij", offset, offset) / near.shape[1])
        normal = axes[:, :, 0]
        sight = unit(points - view.radar)
        normal *= -np.sign(np.sum(normal * sight, axis=1))[:, None]
        cell = view.cell(self.echoes.range)
        # The neighbours in a sheet spread along two directions; single echoes and thin strips define no normal.
        reliable = (size[:, 0] < FLAT * size[:, 1]) & (size[:, 2] < (SPREAD_CELLS * cell) ** 2)
        return normal, reliable

    def _proposed(self, free: Index) -> RoundSurface | None:
        """The proposed surface with the most votes of `free` echoes, by their weight; None if there is none."""
        judge = drawn(free)
        points, weight, normal = self.echoes.position[judge], self.weight[judge], self.normal[judge]
        cell = float(np.median(self.view.cell(self.echoes.range[judge])))
        seeds = self.random.choice(judge.size, PROPOSALS, p=weight / weight.sum())
        distance = cdist(points[seeds], points)
        near = (distance > NEAR_CELLS * cell) & (distance < REACH_CELLS * cell)
        other = np.argmax(near * self.random.random(near.shape), axis=1)
        turned = np.sum(normal[seeds] * normal[other], axis=1) < np.cos(SMALLEST_TURN)
        valid = turned & near[np.arange(seeds.size), other]
        best, most = None, 0.0
        limit = 0.5 * self.view.extent_each(points, normal)
        for a, b in zip(seeds[valid], other[valid], strict=True):
            for axis in (unit_or_zero(np.cross(normal[a], normal[b])), np.zeros(3)):
                shape = _through(points[a], normal[a], points[b], normal[b], axis)
                if shape is None or not SMALLEST_CELLS * cell < shape.radius < LARGEST_CELLS * cell:
                    continue
                votes = float(self._on(shape, points, normal, limit) @ weight)
                if votes > most:
                    best, most = shape, votes
        return best

    @staticmethod
    def _on(shape: RoundSurface, points: Array, normal: Array, limit: Array) -> Mask:
        """Which points (n, 3) lie less than `limit` (n,) [m] beside a surface, and have normals (n, 3) as it has."""
        return (np.abs(shape.beside(points)) < limit) & (np.sum(shape.outward(points) * normal, axis=1) > TURNED)

    def _grown(self, shape: RoundSurface, free: Mask) -> tuple[RoundMirror | None, Index]:
        """Grow a proposed surface to a mirror, from the echoes that are still `free`.

        Returns the mirror, None if it fails a test; and the numbers of the echoes to take out of the search.
        """
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
            residual = [float(np.sum(t * s.beside(points[member]) ** 2) / np.sum(t)) for s, t, _ in fits]
            shape, trust, design = fits[int(np.argmin(residual))]
            largest = LARGEST_CELLS * np.median(view.cell(echoes.range[member]))
            if not 0.0 < shape.radius < largest:
                return None, member
        mirror = replace(mirror, shape=shape).part_in_beams(view, mirror.beams)
        return self._judged(mirror, member, trust, design), member

    def _patch(self, mirror: RoundMirror, near: Index) -> tuple[RoundMirror, Index]:
        """The part of the mirror in the largest connected set of beams that show it, its small gaps closed; and the
        numbers of the echoes there.
        """
        beam = self.echoes.direction[near]
        beams = largest_sheet(beam, self.view.shape, thinnest=1).ravel()
        if not beams.any():
            return mirror, near[:0]
        return mirror.part_in_beams(self.view, beams), near[beams[beam]]

    def _judged(self, mirror: RoundMirror, member: Index, trust: Array, design: Array) -> RoundMirror | None:
        """The mirror with its standard errors, in all beams that show it; None if it is no round sheet.

        Echoes `member` were fitted with the weights `trust` (n,) and the derivatives `design` (n, p), see `fitted`.
        """
        view, echoes, shape = self.view, self.echoes, mirror.shape
        cell = view.cell_at(mirror.center)
        # The visible extent across the axis of a cylinder, the larger extent of a sphere; and its bulge.
        across = shape.across(mirror.outline - mirror.center) if shape.axis.any() else mirror.outline - mirror.center
        half = min(0.5 * float(np.ptp(across @ mirror.tangents.T, axis=0).max()), shape.radius)
        bulge = shape.radius - np.sqrt(shape.radius**2 - half**2)
        if mirror.extent.min() < SHORTEST_CELLS * cell or bulge < BULGE_CELLS * cell:
            return None
        points = echoes.position[member]
        stray = shape.beside(points) / (DEVIATION * view.extent_each(points, shape.outward(points)))
        if robust_deviation(stray) > LARGEST_DEVIATION or self._share_off(mirror) > MOST_OFF:
            return None
        mirror = self._with_errors(mirror, points, trust, design).with_echoes(view, echoes.take(member))
        certain = mirror.curvature > SIGNIFICANT * mirror.curvature_error and self._has_glint(mirror)
        return self._extended(mirror) if certain and mirror.fill >= SMALLEST_FILL else None

    def _with_errors(self, mirror: RoundMirror, points: Array, trust: Array, design: Array) -> RoundMirror:
        """The mirror with the standard errors of its fit to points (n, 3); `trust` and `design` are as in `_judged`."""
        shape = mirror.shape
        # Echoes within a resolution cell stray together, and count as one.
        cells = self.view.filled_cells(points)
        bread = np.linalg.pinv(design.T @ (trust[:, None] * design))
        squares = float(np.sum(trust * shape.beside(points) ** 2))
        variance = bread * squares / max(cells - design.shape[1], 1)
        base = shape.base
        count = len(base)
        at = np.concatenate([np.zeros(count), [1.0], np.zeros(design.shape[1] - count - 1)])
        at[:count] = base @ mirror.normal
        tangents = mirror.tangents @ base.T
        turn = np.linalg.eigvalsh(tangents @ variance[:count, :count] @ tangents.T)[-1] / shape.radius**2
        if count == 2:
            turn += np.linalg.eigvalsh(variance[count + 1 :, count + 1 :])[-1]
        return replace(
            mirror,
            offset_error=float(np.sqrt(max(at @ variance @ at, 0.0))),
            angle_error=float(np.degrees(np.sqrt(max(turn, 0.0)))),
            curvature_error=float(np.sqrt(variance[count, count])) / shape.radius**2,
        )

    def _share_off(self, mirror: RoundMirror) -> float:
        """Share of the mirror's beams with echoes in which the brightest echo does not lie on the surface."""
        echoes = self.echoes.take(mirror.beams[self.echoes.direction])
        points = echoes.position[strongest_of(echoes.direction, echoes.amplitude)]
        across = self.view.extent_each(points, mirror.shape.outward(points))
        return float(np.mean(np.abs(mirror.shape.beside(points)) > NEAR * across))

    def _has_glint(self, mirror: RoundMirror) -> bool:
        """Whether the mirror returns a glint; True if the point that faces the radar is out of view."""
        view, echoes = self.view, self.echoes
        place = mirror.shape.nearest(view.radar)
        range_, direction, inside = view.locate(place)
        if not inside or not mirror.beams[direction]:
            return True
        near = np.linalg.norm(echoes.position - place, axis=1) <= view.cell(range_)
        return bool(echoes.amplitude[near].max(initial=0.0) >= GLINT * mirror.strength)

    def _extended(self, mirror: RoundMirror) -> RoundMirror:
        """The mirror, extended over neighbouring beams that hold its own echoes, however obliquely they meet it."""
        echoes, view = self.echoes, self.view
        everywhere = mirror.part_in_beams(view, np.ones(len(view.sight), bool))
        _, _, across = everywhere.near(view, echoes)
        range_ = everywhere.met(view)[echoes.direction]
        near = np.flatnonzero(np.isfinite(range_) & (np.abs(everywhere.beside(echoes.position)) <= across))
        wider, _ = self._patch(mirror, near) if near.size else (mirror, near)
        return wider.part_in_beams(view, wider.beams | mirror.beams)


def _through(a: Array, facing_a: Array, b: Array, facing_b: Array, axis: Array) -> RoundSurface | None:
    """The sphere, or the cylinder with that axis, through points a and b (3,) with normals there; None if not convex.

    In the plane across the axis, ``a - R n_a = b - R n_b``. So ``R = (a - b).(n_a - n_b) / |n_a - n_b|^2``.
    """
    turn = facing_a - facing_b
    radius = float((a - b) @ turn / (turn @ turn))
    if not radius > 0.0:
        return None
    return RoundSurface(0.5 * (a + b - radius * (facing_a + facing_b)), axis, radius)


def _other_kind(shape: RoundSurface, points: Array, normal: Array) -> list[RoundSurface]:
    """A sphere instead of a cylinder, or the reverse, as a first guess for points (n, 3) with normals (n, 3)."""
    if shape.axis.any():
        return [replace(shape, middle=shape.middle + shape.along(points.mean(axis=0)) * shape.axis, axis=np.zeros(3))]
    spread = normal - normal.mean(axis=0)
    return [replace(shape, axis=np.linalg.eigh(spread.T @ spread)[1][:, 0])]
