"""Step 2 in the floor plan, for curved mirrors: unbroken rows of echoes along an arc.

Three echoes of a neighbourhood propose a circle, all echoes vote, and the best proposal grows to the unbroken row
about it, as for lines (`growing`). A row is curved if its curvature stands out of its own standard error and it bulges
by more than a straight mirror may. What is seen behind it tells whether it is a mirror, or a round object.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.spatial.distance import cdist

from mirrorfold.common.arcs import circle_through
from mirrorfold.common.geometry import turned, unit
from mirrorfold.common.types import Array, Index, Mask
from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.mirrors.arc_mirror import ArcMirror
from mirrorfold.detection.mirrors.curved import on_rows
from mirrorfold.detection.search.fit import FEWEST_BLOCKS, block_covariance, centres, left_of_kink, trusted
from mirrorfold.detection.search.growing import CLIP, drawn
from mirrorfold.detection.search.joined import joined
from mirrorfold.detection.search.lines import LOBE
from mirrorfold.detection.search.rows import heaviest_row, longest_run
from mirrorfold.detection.views.image_view import ImageView

PROPOSALS = 600
"""Circles that are proposed for each mirror."""

NEAR_CELLS, REACH_CELLS = 2.0, 24.0
"""Echoes that propose a circle lie so many resolution cells apart: closer ones say nothing of the curvature."""

PROPOSED_BULGE_CELLS = 0.25
"""How far the middle one of three that propose a circle lies beside the line of the others, in resolution cells:
through an S-shaped row most circles that pass near many echoes are nearly straight."""

SMALLEST_CELLS, LARGEST_CELLS = 1.2, 400.0
"""Radii, in resolution cells: what bulges on the scale of a cell is a point, and a larger circle is straight over any
row that fits into a room."""

SHORTEST_CELLS = 4.5
"""Least length of an arc, in resolution cells: of a pillar whose radius is two cells the radar sees some five."""

SMALLEST_FILL = 0.7
"""Share of its length that an arc's echoes must fill, between that of long and of short straight mirrors."""

NEAR = 0.35
"""Echoes of a row lie within this part of the resolution cell across it: less than for lines, for the
two halves of an S leave each other's circles bit by bit."""

BULGE_CELLS = 0.3
"""A row that bulges by less, in resolution cells, is a straight mirror; that is where straight ones end."""

SIGNIFICANT = 5.0
"""Standard errors by which the curvature must differ from zero."""

LEFT_OF_KINK = 0.8
"""An arc leaves no more of the centres of power, as a sum of squares, than this share of what a straight line with one
kink leaves: two flat walls that touch in the image are no curved one. It was 0.6 at most for arcs of random scenes, and
1.1 for two walls of a full-wave one."""

GRAZING = 0.12
"""Cosine of the angle of incidence, 83 degrees, below which an arc is turned away from the radar."""

CLOSE_CELLS, SMOOTH_CELLS, EXTENDED_CELLS = 0.12, 2.0, 3.0
"""An arc ends where the centres of power, averaged over so many resolution cells, stray from it by more than this share
of the range cell, three times what speckle makes them stray; it may go on by so many cells from one fit to the next."""

DARK = 0.1
"""An arc ends where its mean amplitude falls below this share of its median."""

FEWEST, PASSES = 6, 3
"""Fewest echoes of an arc; and most searches, each among the echoes that lie on no arc yet."""

REFINEMENTS = 10
"""Most fits of an arc, each to the part of its row that lay close to the fit before."""

SAMPLES = 181
"""Places along an arc at which its neighbours and its direction to the radar are looked at."""

MISSES, MOST_ARCS, ROUNDS = 30, 8, 4
"""A search ends after so many proposals in a row that are no arcs, or with so many arcs; fits to the echoes of one."""


def find_arcs(view: ImageView, echoes: Echoes) -> list[ArcMirror]:
    """Curved rows among the strong visible of some echoes that are seen by one way; those with the most votes first."""
    return _Arcs(echoes.take(echoes.visible), view).find()


def fitted_circle(points: Array, weight: Array, middle: Array, radius: float) -> tuple[Array, float, Array]:
    """The circle with the least weighted squared distances to points (n, 2), from a first one on.

    Cauchy weights keep out what stands elsewhere (see `fit.trusted`). Returns middle, radius and trust (n,).
    """
    trust = weight
    for _ in range(2 * ROUNDS):
        offset = points - middle
        away = np.linalg.norm(offset, axis=1)
        beside = away - radius
        _, trust = trusted(beside, weight, np.finfo(float).eps * radius)
        design = np.column_stack([offset / away[:, None], np.ones(len(points))])
        root = np.sqrt(trust)
        step = np.linalg.lstsq(root[:, None] * design, root * beside, rcond=None)[0]
        middle, radius = middle + step[:2], radius + float(step[2])
    return middle, radius, trust


def _by_chord(arc: ArcMirror, points: Array) -> tuple[Array, Array]:
    """Places (n, 2) along the chord of an arc and beside it, (n,) [m] each."""
    chord = unit(arc.ends[1] - arc.ends[0])
    offset = points - arc.ends[0]
    return offset @ chord, offset @ turned(chord)


@dataclass
class _Arcs:
    """The search among echoes that are seen by one way."""

    echoes: Echoes
    view: ImageView

    def find(self) -> list[ArcMirror]:
        """Arcs, from the one with the most votes on."""
        usual = np.median(self.echoes.amplitude[self.echoes.strong]) if self.echoes.strong.any() else 1.0
        self.weight = self.echoes.length * np.minimum(self.echoes.amplitude / usual, CLIP)
        self.random = np.random.default_rng(0)
        found: list[ArcMirror] = []
        for _ in range(PASSES):
            known = len(found)
            self._search(found)
            found = self._parted(found)
            if len(found) == known:
                break
        return found

    def _search(self, found: list[ArcMirror]) -> None:
        """Add arcs among the echoes that lie on none yet."""
        free, missed = self.echoes.strong & ~on_rows(found, self.view, self.echoes), 0
        while np.count_nonzero(free) >= FEWEST and missed <= MISSES and len(found) < MOST_ARCS:
            arc = self._proposed(np.flatnonzero(free))
            if arc is None:
                break
            arc, member = self._grown(arc, free)
            fitted = None if arc is None else self._refined(arc, free)
            if fitted is None:
                missed += 1
                # Its neighbours may still belong to an arc that this one crosses.
                place, cell = self.echoes.position[member], np.asarray(self.view.cell(self.echoes.range[member]))
                offset = np.linalg.norm(place - np.median(place, axis=0), axis=1)
                free[member[offset <= np.maximum(2.0 * NEAR_CELLS * cell, offset.min())]] = False
                continue
            missed = 0
            found.append(fitted)
            free &= ~on_rows([fitted], self.view, self.echoes)

    def _parted(self, arcs: list[ArcMirror]) -> list[ArcMirror]:
        """Arcs that pass into each other, cut in the middle of what they share and fitted to what is left of each, or
        together where they are one smooth curve.
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
        """Two arcs as the halves of one smooth curve; None if they are none, or no arcs any more."""
        first, second = self._centres(one), self._centres(other)
        halves = None if first is None or second is None else joined((one, other), (first, second), self.view)
        return halves if halves is not None and all(map(self._plausible, halves)) else None

    def _fitted(self, arc: ArcMirror) -> ArcMirror | None:
        """The arc on the circle that fits best to the centres of power, as long as before; None if it is no arc."""
        ends = arc.ends
        for _ in range(ROUNDS):
            measured = self._centres(arc)
            if measured is None:
                return None
            points, weight = measured
            middle, radius, trust = fitted_circle(points, weight, arc.middle, arc.radius)
            if not 0.0 < radius < LARGEST_CELLS * self.view.cell_at(arc.center):
                return None
            circle = replace(arc, middle=middle, radius=radius)
            first, last = np.sort(circle.along(ends))
            arc = circle.part(float(first), float(last))
            if not self._plausible(arc):
                return None
        return self._with_errors(arc, points, trust)

    def _arc(self, middle: Array, radius: float, points: Array) -> ArcMirror:
        """The arc of a circle about points that lie on one side of it."""
        towards = np.mean((points - middle) / np.linalg.norm(points - middle, axis=1)[:, None], axis=0)
        whole = ArcMirror(
            middle=middle,
            radius=radius,
            first=float(np.arctan2(towards[1], towards[0])) - np.pi,
            span=2.0 * np.pi,
            radar=self.view.radar,
        )
        along = whole.along(points)
        return whole.part(float(along.min()), float(along.max()))

    def _proposed(self, free: Index) -> ArcMirror | None:
        """The circle near most echoes of a neighbourhood, by their weight."""
        judge = drawn(free)
        points, weight = self.echoes.position[judge], self.weight[judge]
        cell = float(np.median(self.view.cell(self.echoes.range[judge])))
        seeds = self.random.choice(judge.size, PROPOSALS, p=weight / weight.sum())
        distance = cdist(points[seeds], points)
        near = (distance > NEAR_CELLS * cell) & (distance < REACH_CELLS * cell)
        a, b = (np.argmax(near * self.random.random(near.shape), axis=1) for _ in range(2))
        middle, radius = circle_through(points[seeds], points[a], points[b])
        sound = near[np.arange(seeds.size), a] & near[np.arange(seeds.size), b] & np.isfinite(radius)
        sound &= (radius > SMALLEST_CELLS * cell) & (radius < LARGEST_CELLS * cell)
        chord = np.linalg.norm(points[a] - points[b], axis=1)
        chord = np.maximum(chord, np.maximum(distance[np.arange(seeds.size), a], distance[np.arange(seeds.size), b]))
        sound &= np.linalg.norm(points[a] - points[b], axis=1) > NEAR_CELLS * cell
        # A chord c bulges by c^2 / (8 R); one that is longer than R by c / 8 or more.
        sound &= chord**2 > 8.0 * np.minimum(radius, chord) * PROPOSED_BULGE_CELLS * cell
        if not sound.any():
            return None
        middle, radius, seeds = middle[sound], radius[sound], seeds[sound]
        beside = cdist(middle, points) - radius[:, None]
        on_it = (np.abs(beside) < 0.5 * NEAR * cell) & (distance[sound] < 2.0 * REACH_CELLS * cell)
        best = int(np.argmax(on_it @ weight))
        return self._arc(middle[best], float(radius[best]), points[on_it[best]])

    def _grown(self, arc: ArcMirror, free: Mask) -> tuple[ArcMirror | None, Index]:
        """The arc with the heaviest unbroken row about it, and the echoes of that row."""
        member = np.flatnonzero(free)
        points = self.echoes.position
        for _ in range(ROUNDS):
            near = np.flatnonzero(free & (np.abs(arc.beside(points)) <= NEAR * self._across(arc, points)))
            if near.size < FEWEST:
                return None, near if near.size else member
            around = self._arc(arc.middle, arc.radius, points[near])
            member = near[self._row(around, points[near], self.weight[near])]
            if member.size < FEWEST:
                return None, near
            across = self._across(arc, points[member])
            middle, radius, _ = fitted_circle(points[member], self.weight[member] / across**2, arc.middle, arc.radius)
            if not 0.0 < radius < LARGEST_CELLS * np.median(self.view.cell(self.echoes.range[member])):
                return None, member
            arc = self._arc(middle, radius, points[member])
        return (arc if self._plausible(arc) else None), member

    def _across(self, arc: ArcMirror, points: Array) -> Array:
        """Width of the cell at points, across the arc [m]."""
        return self.view.extent_each(points, arc.outward(arc.along(points)))

    def _row(self, arc: ArcMirror, points: Array, weight: Array) -> Index:
        """The heaviest unbroken row of points along an arc."""
        cell = np.asarray(self.view.cell(np.linalg.norm(points - self.view.radar, axis=1)))
        return heaviest_row(arc.along(points), cell, weight)

    def _plausible(self, arc: ArcMirror) -> bool:
        """Whether its radius, length and bulge are large enough, and it is less than three quarters of a circle."""
        cell = self.view.cell_at(arc.center)
        bulge = arc.radius * (1.0 - np.cos(0.5 * min(arc.span, np.pi)))
        sizes = SMALLEST_CELLS * cell <= arc.radius <= LARGEST_CELLS * cell and arc.length >= SHORTEST_CELLS * cell
        return bool(sizes and bulge >= BULGE_CELLS * cell and arc.span < 1.5 * np.pi)

    def _facing(self, arc: ArcMirror) -> ArcMirror | None:
        """The part of an arc that is turned towards the radar."""
        along = np.linspace(0.0, arc.length, SAMPLES)
        sight = arc.at(along) - self.view.radar
        cosine = -np.sum(sight * arc.outward(along), axis=1) / np.linalg.norm(sight, axis=1)
        run = longest_run((cosine if arc.convex else -cosine) >= GRAZING)
        return None if run is None else arc.part(*along[run][[0, -1]].tolist())

    def _refined(self, arc: ArcMirror, free: Mask) -> ArcMirror | None:
        """The arc fitted to the centres of power across it, as far as its row goes on; None if it is no arc."""
        arc = self._as_long(arc, free)
        for _ in range(REFINEMENTS):
            facing = self._facing(arc)
            if facing is None or not self._plausible(facing):
                return None
            measured = self._centres(facing)
            if measured is None:
                return None
            points, weight = measured
            middle, radius, trust = fitted_circle(points, weight, facing.middle, facing.radius)
            # A circle that has become straight, or bulges to the other side, is no arc of this row.
            largest = LARGEST_CELLS * self.view.cell_at(facing.center)
            if not 0.0 < radius < largest or (middle - facing.center) @ (facing.middle - facing.center) <= 0.0:
                return None
            before = facing.ends
            arc = self._close(replace(facing, middle=middle, radius=radius), before)
            if np.linalg.norm(arc.ends - before, axis=1).max() < 0.1 * self.view.range_cell:
                break
        arc = self._with_errors(arc, points, trust)
        if not self._plausible(arc) or abs(arc.curvature) < SIGNIFICANT * arc.curvature_error:
            return None
        if np.sum(trust * arc.beside(points) ** 2) > LEFT_OF_KINK * left_of_kink(*_by_chord(arc, points), trust):
            return None
        on_it = self.echoes.take(arc.own(self.view, self.echoes))
        if not len(on_it):
            return None
        arc = replace(arc, fill=arc.filled(self.view, on_it), strength=float(np.median(on_it.amplitude)))
        return arc if arc.fill >= SMALLEST_FILL else None

    def _centres(self, arc: ArcMirror) -> tuple[Array, Array] | None:
        """Centres of power across an arc (n, 2), and their weights; None where there are too few."""
        points, weight = centres(arc, self.view, *LOBE)
        return None if len(points) < 2 * FEWEST_BLOCKS else (points, weight)

    def _close(self, circle: ArcMirror, ends: Array) -> ArcMirror:
        """The part of a circle, between about these ends, along which the centres of power stay close to it.

        An S-shaped row leaves the circle of either half at its joint.
        """
        first, last = np.sort(circle.along(ends))
        margin = EXTENDED_CELLS * self.view.cell_at(circle.center)
        wider = circle.part(first - margin, min(last + margin, first - margin + 0.95 * 2.0 * np.pi * circle.radius))
        wider = self._facing(wider) or wider
        measured = self._centres(wider)
        if measured is None:
            return circle.part(first, last)
        points, weight = measured
        along = wider.along(points)
        window = max(1, round(SMOOTH_CELLS * self.view.cell_at(circle.center) / max(np.median(np.diff(along)), 1e-9)))
        beside = uniform_filter1d(weight * wider.beside(points), window) / uniform_filter1d(weight, window)
        # Beyond the end of a row there is no power to speak of.
        bright = uniform_filter1d(np.sqrt(self.view.power_at(*self.view.to_polar(points))), window)
        near = (np.abs(beside) <= CLOSE_CELLS * self.view.range_cell) & (bright >= DARK * np.median(bright))
        run = longest_run(near)
        return circle.part(first, last) if run is None else wider.part(*along[run][[0, -1]].tolist())

    def _as_long(self, arc: ArcMirror, free: Mask) -> ArcMirror:
        """The arc as far as its row of echoes goes on along its circle, faint ones included."""
        points = self.echoes.position[free | ~self.echoes.strong]
        near = points[np.abs(arc.beside(points)) <= NEAR * self._across(arc, points)]
        if not len(near):
            return arc
        towards = np.arctan2(*(arc.center - arc.middle)[::-1])
        whole = replace(arc, first=float(towards) - np.pi, span=2.0 * np.pi)
        along, own = whole.along(near), whole.along(arc.ends)
        inside = (along >= own.min()) & (along <= own.max())
        row = along[self._row(whole, near, np.where(inside, 1.0, 1e-6))]
        return whole.part(min(float(row.min()), float(own.min())), max(float(row.max()), float(own.max())))

    def _with_errors(self, arc: ArcMirror, points: Array, trust: Array) -> ArcMirror:
        """The arc with standard errors of its offset, direction and curvature, from how its blocks differ."""
        along, beside = arc.along(points) - 0.5 * arc.length, arc.beside(points)
        design = np.column_stack([np.ones_like(along), along, 0.5 * along**2])
        variance = np.diag(block_covariance(design, beside, trust, along[:, None], arc.independent(self.view)))
        offset, angle, bend = np.sqrt(np.maximum(variance, 0.0))
        return replace(
            arc, offset_error=float(offset), angle_error=float(np.degrees(angle)), curvature_error=float(bend)
        )
