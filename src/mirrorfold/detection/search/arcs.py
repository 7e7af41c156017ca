"""Step 2 in the floor plan, for curved mirrors: unbroken rows of echoes along an arc.

Three neighbouring echoes propose a circle. As for lines (`growing`), all echoes vote, and the best proposal grows to an
unbroken row of echoes. The row is curved if its curvature is significant against its standard error, and it bulges by
more than a straight mirror may. Whether it is a mirror or a round object is decided later, by the echoes that are seen
behind it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np
from scipy.ndimage import uniform_filter1d

from mirrorfold.common.geometry import turned, unit
from mirrorfold.common.types import Array, Index, Mask
from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.mirrors.arc_mirror import ArcMirror
from mirrorfold.detection.mirrors.curved import on_rows
from mirrorfold.detection.search.circles import (
    FEWEST,
    LARGEST_CELLS,
    NEAR,
    NEAR_CELLS,
    SMALLEST_CELLS,
    arc_over,
    fitted_circle,
    proposed,
)
from mirrorfold.detection.search.fit import (
    FEWEST_BLOCKS,
    fit_covariance,
    kink_residual,
    power_centroids,
    robust_weights,
)
from mirrorfold.detection.search.growing import clipped_weight, drawn
from mirrorfold.detection.search.joined import fitted_together, s_shaped
from mirrorfold.detection.search.lines import PROFILE
from mirrorfold.detection.search.rows import HARDLY, heaviest_row, longest_run, without_gaps
from mirrorfold.detection.views.image_view import ImageView

SHORTEST_CELLS = 4.5
"""Least length of an arc, in resolution cells: the radar sees some five cells of a pillar whose radius is two cells."""

SMALLEST_FILL = 0.7
"""Least share of its length that an arc's echoes must fill, between those of long and of short straight mirrors."""

BULGE_CELLS = 0.3
"""Least bulge of an arc, in resolution cells: the largest of a straight mirror."""

SIGNIFICANT = 3.0
"""Least curvature, in its standard errors: speckle bends one in four hundred straight walls as much."""

LARGEST_STRAY = 0.2
"""Largest standard deviation of the centroids of power from an arc, in resolution cells across it. Those of pillars and
curved walls stray by 0.04 to 0.12 cells, by speckle; of a piece of a wall beside a leg of a corner, by 0.24."""

GRAZING = 0.12
"""Cosine of the largest angle of incidence, 83 degrees: beyond it an arc is turned away from the radar."""

CLOSE_CELLS, SMOOTH_CELLS, EXTENDED_CELLS = 0.12, 2.0, 3.0
"""An arc ends where the centroids of power, averaged over `SMOOTH_CELLS` resolution cells, stray from it by more than
`CLOSE_CELLS` range cells, three times what speckle makes them stray. From one fit to the next, it may grow by
`EXTENDED_CELLS` cells at either end."""

LARGEST_SPAN, LONGEST_TURN = 1.5 * np.pi, 0.95 * 2.0 * np.pi
"""Largest angle [rad] over which an arc goes: of a pillar less than half a circle is seen, and what goes much farther
around is no single wall. And largest angle over which its row is searched: not all around, so that it has two ends."""

DARK = 0.1
"""An arc ends where the local mean of its amplitude falls below this share of its median."""

PASSES = 3
"""Largest number of searches, each among the echoes that lie on no arc yet."""

REFINEMENTS, SETTLED_CELLS = 10, 0.1
"""Largest number of fits of an arc, each to the part of its row that lies close to the fit before. They stop when both
ends of the arc move by less than `SETTLED_CELLS` range cells, less than centroids of power may stray from it."""

LEAST_STEP = 1e-6
"""Least distance of neighbouring centroids along an arc, in range cells, by which an average over them is divided: so
that centroids at one place make no endless average. Usual ones are `line_mirror.SPACING` apart."""

SAMPLES = 181
"""Number of places along an arc at which its distance from other arcs, and its angle to the radar, are computed."""

MISSES, MOST_ARCS, ROUNDS = 30, 8, 4
"""Number of failed proposals in a row that is tolerated; largest number of arcs that are found; and number of fits of
an arc to its echoes."""


def find_arcs(view: ImageView, echoes: Echoes) -> list[ArcMirror]:
    """Arcs among visible echoes that are all seen by way of the same mirrors, those with the most votes first.

    Strong echoes are evidence of an arc; faint ones continue it.
    """
    return _Arcs(echoes.take(echoes.visible), view).find()


class _Arcs:
    """The search for arcs among echoes that are all seen by way of the same mirrors."""

    def __init__(self, echoes: Echoes, view: ImageView) -> None:
        self.echoes, self.view = echoes, view
        self.weight = clipped_weight(echoes, echoes.amplitude[echoes.strong])
        self.random = np.random.default_rng(0)

    def find(self) -> list[ArcMirror]:
        """All arcs, that with the most votes first."""
        found: list[ArcMirror] = []
        for _ in range(PASSES):
            known = len(found)
            self._search(found)
            found = self._cut_apart(found)
            if len(found) == known:
                break
        return found

    def _search(self, found: list[ArcMirror]) -> None:
        """Add to `found` the arcs among the echoes that lie on none of them yet."""
        free, missed = self.echoes.strong & ~on_rows(found, self.view, self.echoes), 0
        while np.count_nonzero(free) >= FEWEST and missed <= MISSES and len(found) < MOST_ARCS:
            arc = self._proposed(np.flatnonzero(free))
            if arc is None:
                break
            arc, member = self._grown(arc, free)
            arcs = [] if arc is None else self._halves(arc, free) or self._refined(arc, free)
            if arcs:
                missed = 0
                found.extend(arcs)
                free &= ~on_rows(arcs, self.view, self.echoes)
                continue
            missed += 1
            # Only the middle of the row is taken out: the rest may belong to an arc that this one crosses.
            place, cell = self.echoes.position[member], self.view.cell(self.echoes.range[member])
            offset = np.linalg.norm(place - np.median(place, axis=0), axis=1)
            free[member[offset <= np.maximum(2.0 * NEAR_CELLS * cell, offset.min())]] = False

    def _cut_apart(self, arcs: list[ArcMirror]) -> list[ArcMirror]:
        """The arcs, with those cut that pass into each other.

        Two such arcs are cut in the middle of the part that they share. Then each is fitted to its own part; or both
        together, if they are the halves of one smooth curve.
        """
        for i, j in combinations(range(len(arcs)), 2):
            cell = self.view.cell_at(arcs[i].center)
            cut = []
            for one, other in ((arcs[i], arcs[j]), (arcs[j], arcs[i])):
                along = np.linspace(0.0, one.length, SAMPLES)
                place = one.at(along)
                on = other.along(place)
                shared = (np.abs(other.beside(place)) <= 0.5 * cell) & (on >= -cell) & (on <= other.length + cell)
                if not shared.any() or shared.mean() > 0.5:
                    break
                middle = float(along[shared].mean())
                cut.append(one.part(0.0, middle) if middle > 0.5 * one.length else one.part(middle, one.length))
            if len(cut) == 2:
                apart = [self._fitted(part) or whole for part, whole in zip(cut, (arcs[i], arcs[j]), strict=True)]
                arcs[i], arcs[j] = self._joined(*apart) or apart
        return arcs

    def _joined(self, one: ArcMirror, other: ArcMirror) -> Sequence[ArcMirror] | None:
        """Two arcs, fitted together as the halves of one smooth curve; None if they are not, or become implausible."""
        measured = self._centroids(one), self._centroids(other)
        known = all(len(points) for points, _ in measured)
        halves = fitted_together((one, other), measured, self.view) if known else None
        return halves if halves is not None and all(map(self._plausible, halves)) else None

    def _halves(self, arc: ArcMirror, free: Mask) -> list[ArcMirror]:
        """The two halves of an S-shaped row of free echoes, of which an arc follows a part; empty if there is no S.

        Where cells are coarse, neither half tells its curvature alone, but their common end and tangent do. One half
        must be curved beyond doubt, and so must the change of curvature at the joint be.
        """
        points, chord = self.echoes.position, unit(arc.ends[1] - arc.ends[0])
        # All of the S lies within a cell of the circle that passes near most of its echoes.
        rows, width, before = [arc], 1.0, np.empty(0, dtype=np.intp)
        for _ in range(2 * ROUNDS):
            member = np.flatnonzero(free & np.any([self._beside(row, width) for row in rows], axis=0))
            cell = self.view.cell(self.echoes.range[member])
            member = member[heaviest_row(points[member] @ chord, cell, self.weight[member])]
            enough = member.size >= FEWEST
            halves = s_shaped(points[member], self.weight[member], self.view.radar) if enough else None
            if halves is None:
                return []
            rows, width = list(halves), NEAR
            if np.array_equal(before, member):
                break
            before = member
        together = self._joined(rows[0], rows[1])
        if together is None:
            return []
        bend, error = np.transpose([(abs(arc.curvature), arc.curvature_error) for arc in together])
        if not (bend >= SIGNIFICANT * error).any() or bend.sum() < SIGNIFICANT * np.linalg.norm(error):
            return []
        whole = [arc for arc in map(self._filled, together) if arc is not None]
        return whole if len(whole) == len(together) else []

    def _filled(self, arc: ArcMirror) -> ArcMirror | None:
        """The arc with its fill and strength; None if its echoes fill less than `SMALLEST_FILL` of it."""
        on_it = self.echoes.take(arc.own(self.view, self.echoes))
        if not len(on_it):
            return None
        arc = arc.with_echoes(self.view, on_it)
        return arc if arc.fill >= SMALLEST_FILL else None

    def _beside(self, arc: ArcMirror, width: float) -> Mask:
        """Which echoes lie beside an arc, up to `width` cells across it and `EXTENDED_CELLS` past its ends, (n,)."""
        points = self.echoes.position
        return arc.holds(points, width * self._across(arc, points), EXTENDED_CELLS * self.view.cell_at(arc.center))

    def _fitted(self, arc: ArcMirror) -> ArcMirror | None:
        """The arc, fitted to the centroids of power with its ends kept; None if it becomes implausible."""
        ends = arc.ends
        for _ in range(ROUNDS):
            fitted = self._on_centroids(arc)
            if fitted is None:
                return None
            circle, points, weight = fitted
            arc = circle.part(*np.sort(circle.along(ends)).tolist())
            if not self._plausible(arc):
                return None
        return self._with_errors(arc, points, weight)

    def _proposed(self, free: Index) -> ArcMirror | None:
        """The most bent row of `free` echoes, as an arc; None if there is none."""
        judge = drawn(free)
        cell = self.view.cell(self.echoes.range[judge])
        return proposed(self.echoes.position[judge], self.weight[judge], cell, self.view.radar, self.random)

    def _grown(self, arc: ArcMirror, free: Mask) -> tuple[ArcMirror | None, Index]:
        """Grow a proposed arc to the unbroken row of echoes near it that has the most weight.

        Returns the arc, None if it is implausible; and the numbers of the echoes of the row.
        """
        member = np.flatnonzero(free)
        points = self.echoes.position
        for _ in range(ROUNDS):
            near = np.flatnonzero(free & (np.abs(arc.beside(points)) <= NEAR * self._across(arc, points)))
            if near.size < FEWEST:
                return None, near if near.size else member
            around = arc_over(arc.middle, arc.radius, points[near], self.view.radar)
            member = near[self._row(around, points[near], self.weight[near])]
            if member.size < FEWEST:
                return None, near
            across = self._across(arc, points[member])
            middle, radius = fitted_circle(points[member], self.weight[member] / across**2, arc.middle, arc.radius)
            if not 0.0 < radius < LARGEST_CELLS * np.median(self.view.cell(self.echoes.range[member])):
                return None, member
            arc = arc_over(middle, radius, points[member], self.view.radar)
        return (arc if self._plausible(arc) else None), member

    def _across(self, arc: ArcMirror, points: Array) -> Array:
        """Width of the resolution cell across the arc [m], at points (n, 2), (n,)."""
        return self.view.extent_each(points, arc.outward(arc.along(points)))

    def _row(self, arc: ArcMirror, points: Array, weight: Array) -> Index:
        """Numbers of the points (n, 2) along an arc in the unbroken row that has the most weight."""
        return heaviest_row(arc.along(points), self.view.cells_at(points), weight)

    def _plausible(self, arc: ArcMirror) -> bool:
        """Whether radius, length, bulge and span of an arc are in their limits."""
        cell = self.view.cell_at(arc.center)
        bulge = arc.radius * (1.0 - np.cos(0.5 * min(arc.span, np.pi)))
        sizes = SMALLEST_CELLS * cell <= arc.radius <= LARGEST_CELLS * cell and arc.length >= SHORTEST_CELLS * cell
        return bool(sizes and bulge >= BULGE_CELLS * cell and arc.span < LARGEST_SPAN)

    def _facing(self, arc: ArcMirror) -> ArcMirror | None:
        """The longest part of an arc that is turned towards the radar; None if there is none."""
        along = np.linspace(0.0, arc.length, SAMPLES)
        sight = arc.at(along) - self.view.radar
        cosine = -np.sum(sight * arc.outward(along), axis=1) / np.linalg.norm(sight, axis=1)
        run = longest_run((cosine if arc.convex else -cosine) >= GRAZING)
        return None if run is None else arc.part(*along[run][[0, -1]].tolist())

    def _refined(self, arc: ArcMirror, free: Mask) -> list[ArcMirror]:
        """The arc, continued as far as its row goes on, and fitted to the centroids of power; empty if it is no arc."""
        arc = self._continued(arc, free)
        for _ in range(REFINEMENTS):
            facing = self._facing(arc)
            if facing is None or not self._plausible(facing):
                return []
            fitted = self._on_centroids(facing)
            # If the circle becomes straight, or bulges to the other side, the row is no arc.
            if fitted is None or (fitted[0].middle - facing.center) @ (facing.middle - facing.center) <= 0.0:
                return []
            circle, points, weight = fitted
            before = facing.ends
            arc = self._part_on_row(circle, before)
            if np.linalg.norm(arc.ends - before, axis=1).max() < SETTLED_CELLS * self.view.range_cell:
                break
        arc = self._with_errors(arc, points, weight)
        if not self._plausible(arc) or abs(arc.curvature) < SIGNIFICANT * arc.curvature_error:
            return []
        # Two flat walls that touch in the image are no curved one: the likelier of the two is the one that fits better.
        beside, chord, offset = arc.beside(points), unit(arc.ends[1] - arc.ends[0]), points - arc.ends[0]
        deviation, trust = robust_weights(beside, weight, np.finfo(float).tiny)
        if deviation > LARGEST_STRAY * np.median(self._across(arc, points)):
            return []
        if np.sum(trust * beside**2) > kink_residual(offset @ chord, offset @ turned(chord), trust):
            return []
        filled = self._filled(arc)
        return [] if filled is None else [filled]

    def _on_centroids(self, arc: ArcMirror) -> tuple[ArcMirror, Array, Array] | None:
        """The arc, moved to the circle through its centroids of power; these, (n, 2); and their weights, (n,).

        None if there are too few of them, or the circle is straight.
        """
        points, weight = self._centroids(arc)
        if not len(points):
            return None
        middle, radius = fitted_circle(points, weight, arc.middle, arc.radius)
        straight = not 0.0 < radius < LARGEST_CELLS * self.view.cell_at(arc.center)
        return None if straight else (replace(arc, middle=middle, radius=radius), points, weight)

    def _centroids(self, arc: ArcMirror) -> tuple[Array, Array]:
        """Centroids of power across an arc (n, 2), and their weights (n,); none of them where there are too few."""
        points, weight = power_centroids(arc, self.view, *PROFILE)
        enough = len(points) if len(points) >= 4 * FEWEST_BLOCKS else 0
        return points[:enough], weight[:enough]

    def _part_on_row(self, circle: ArcMirror, ends: Array) -> ArcMirror:
        """The longest part of a circle, between about these `ends`, to which the centroids of power stay close.

        So an S-shaped row is cut at its joint, where it leaves the circle of either half.
        """
        first, last = np.sort(circle.along(ends))
        margin = EXTENDED_CELLS * self.view.cell_at(circle.center)
        most = LONGEST_TURN * circle.radius
        wider = circle.part(first - margin, min(last + margin, first - margin + most))
        wider = self._facing(wider) or wider
        points, weight = self._centroids(wider)
        if not len(points):
            return circle.part(first, last)
        along = wider.along(points)
        step = max(np.median(np.diff(along)), LEAST_STEP * self.view.range_cell)
        window = max(1, round(SMOOTH_CELLS * self.view.cell_at(circle.center) / step))
        beside = uniform_filter1d(weight * wider.beside(points), window) / uniform_filter1d(weight, window)
        # Beyond the end of a row there is hardly any power.
        bright = uniform_filter1d(np.sqrt(self.view.power_at(*self.view.to_polar(points))), window)
        # A row that comes back within one average has not left the circle: a single speckle has drawn the average away.
        near = without_gaps(np.abs(beside) <= CLOSE_CELLS * self.view.range_cell, window)
        run = longest_run(near & (bright >= DARK * np.median(bright)))
        return circle.part(first, last) if run is None else wider.part(*along[run][[0, -1]].tolist())

    def _continued(self, arc: ArcMirror, free: Mask) -> ArcMirror:
        """The arc, continued along its circle as far as its row of echoes goes on, faint ones included."""
        points = self.echoes.position[free | ~self.echoes.strong]
        near = points[np.abs(arc.beside(points)) <= NEAR * self._across(arc, points)]
        if not len(near):
            return arc
        towards = np.arctan2(*(arc.center - arc.middle)[::-1])
        whole = replace(arc, first=float(towards) - np.pi, span=2.0 * np.pi)
        along, own = whole.along(near), whole.along(arc.ends)
        inside = (along >= own.min()) & (along <= own.max())
        row = along[self._row(whole, near, np.where(inside, 1.0, HARDLY))]
        return whole.part(min(float(row.min()), float(own.min())), max(float(row.max()), float(own.max())))

    def _with_errors(self, arc: ArcMirror, points: Array, weight: Array) -> ArcMirror:
        """The arc with the standard errors of its offset, direction and curvature, from how much its blocks differ."""
        along, beside = arc.along(points) - 0.5 * arc.length, arc.beside(points)
        design = np.column_stack([np.ones_like(along), along, 0.5 * along**2])
        variance = np.diag(fit_covariance(design, beside, weight, along[:, None], arc.independent(self.view)))
        return arc.with_errors(variance)
