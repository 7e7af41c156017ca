"""Step 2 in the floor plan: unbroken, straight rows of echoes are mirrors, if they stand out of their surroundings.

The search is that of `growing`. What lines add: a row goes on along faint echoes; bright objects and other walls at its
ends are cut off; it is fitted to the image; and where the wall scatters from inside, the line moves to its face.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np

from mirrorfold.common.decibels import power_ratio_of
from mirrorfold.common.types import Array, Index, Mask
from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.mirrors.line_mirror import LineMirror
from mirrorfold.detection.search.coherent import trimmed
from mirrorfold.detection.search.fit import FEWEST_PLACES, power_centroids, refined, split_in_two
from mirrorfold.detection.search.fronts import find_front
from mirrorfold.detection.search.growing import NEAR, Search
from mirrorfold.detection.search.remembered import remembered
from mirrorfold.detection.search.rows import HARDLY, heaviest_row
from mirrorfold.detection.search.side_lobes import are_side_lobes
from mirrorfold.detection.search.thick_walls import normal_by_speckle
from mirrorfold.detection.views.image_view import ImageView

MINIMUM_CELLS = 7.75
"""Least length of a mirror, in resolution cells: a shorter row of echoes says too little about its direction."""

SHORT_CELLS = 5.0
"""Least length, in resolution cells, of a row that is a mirror only if what stands behind it outshines it, about that
of an arc; see `mirrorfold.tree.short_rows`."""

STRONG_SHARE = 0.65
"""Share of the least length, five cells, that strong echoes must cover if faint ones continue the row: beside a smooth,
bright object, half of a wall may lie below the threshold."""

GLINT, GLINT_CELLS = 0.9, 4.0
"""A row that faces the array may be shorter than others: at least `GLINT` times as long as the glint of a smooth wall,
where that is at least `GLINT_CELLS` resolution cells. Other glints are shorter: at the distance r, that of a bulging
wall of radius R has ``R / (R + r)`` of the length, that of a point is one cell long."""

DARK_CELLS, GLINT_RATIO, BESIDE_CELLS = 1.25, power_ratio_of(8.0), 4.0
"""A row of a wall ends at a gap of more than `DARK_CELLS` resolution cells, if beyond it the power is `GLINT_RATIO`
times (8 dB) that of the wall. Both are means over `BESIDE_CELLS` cells beside the gap: a wall fades slowly, and the
mean of four speckles strays by 2 dB. A wall that faces the radar may be as bright itself, and is not cut there."""

FAINTER_CELLS, FAINTER_RATIO = 1.0, power_ratio_of(-15.0)
"""Echoes over more than `FAINTER_CELLS` resolution cells do not continue a row if their mean power is less than
`FAINTER_RATIO` (-15 dB) of the row's own: the median over its last `BESIDE_CELLS` cells, or over all of it if that is
less. Beyond the end of a row, a beam fades by 15 dB within a cell, so that longer rows are of something else. At 290
ends of walls, those in half-shadow went on with -8.4 dB, and scattering among several objects with -21.5 dB."""

KEPT_SHARE = 0.75
"""Least share of a row, between the ends of the line that is fitted to the image, that this line keeps within `NEAR`:
it turns away from the flank of a round object that passed for a straight row. Of 230 rows in corridors six kept 0.41 to
0.66, and were turned by 7 to 41 degrees; all others kept 0.78 or more."""

SMALLEST_FILL = 0.55
"""Least share of its length that a mirror's echoes must fill; each fills one resolution cell along the line."""

SMALLEST_FILL_SHORT = 0.85
"""The same for a mirror of the minimum length, falling to `SMALLEST_FILL` at twice that length: by chance, clutter
makes short rows that are filled by up to 85 %, but no long ones."""

SMALLEST_CONTRAST = 2.0
"""Least ratio of the weight of the echoes on a mirror's line to that in a band of equal width in front of it: clutter
has a ratio near one."""

ON_LINE, BEFORE_LINE = 0.75, (1.0, 2.5)
"""Half-width of the band on a mirror's line, and where the band in front of it begins and ends, in resolution cells
across the line: both are 1.5 cells wide."""

PROFILE = 0.75, 0.5, 4.0
"""Arguments `reach`, `lobe` and `clip` of `power_centroids` for lines: half-length of the profiles across the mirror,
in resolution cells across it; least amplitude of their main lobe relative to the peak, as in the definition of the
cell; and largest weight, in multiples of the median power."""

DEEP = 0.1
"""Least depth, in range cells, of a fitted line behind the face of its wall, from which on speckle inside the wall may
have turned the line."""

STRAY = 0.2
"""If the centroids of power stray by less than this share of their depth behind the face, the wall is not thick, but
the pulse rings: the echo is drawn out alike all along the wall. In walls that scatter inside, or at their back,
centroids stray from speckle to speckle by half the depth in the median, and by less than 0.25 of it in two of 160
walls."""

BREAK = 10.0
"""Least value of ``n ln(s_1 / s_2)`` for which a row is taken for two: s_1 and s_2 are the sums of squared residuals of
one line and of two lines that need not touch, and n the number of places with independent speckle. This is twice the
logarithm of the likelihood ratio. Of 700 rough walls, 7 to 32 cells long, it was more in one, and less than 8 in 99 of
a hundred."""

LOBE_SPREAD, SPREAD_CELLS = 0.08, 1.25
"""Variance of the power across a thin wall about its centroid, in squared resolution cells, over `SPREAD_CELLS` cells
to either side: it is 0.07 to 0.09. Walls that scatter from inside have 0.1 to 0.4, and their centroids stray by their
depth, so that one in ten such walls of a metre would exceed `BREAK`. So `BREAK` is multiplied by the median variance of
a row over `LOBE_SPREAD`; but only in line of sight, for wide rows behind objects are mostly multiple scattering."""

LEAST_APART = 0.15
"""Least distance, in resolution cells, by which one part of such a row in line of sight leaves the line of the other.
Long walls fade at their ends, into the half-shadow of another edge, and a few bright speckles there sway by 0.1 cells.
An object at the end of a wall left its line by 0.7 and 0.8."""

SPREAD_SAMPLES = 21
"""Number of samples of the profiles from which that variance is computed."""


def find_lines(echoes: Echoes, view: ImageView, *, minimum_length: float, tested: bool = True) -> list[LineMirror]:
    """Straight mirrors among the visible echoes of an image, that with the most votes first: see `Search`.

    Strong echoes are evidence of a mirror; faint ones continue it.
    """
    # A filled row of the minimum length has more votes, even of echoes with a quarter of the median amplitude.
    enough = 0.25 * minimum_length * SMALLEST_FILL
    return _Lines(echoes, view, minimum_length, tested).find(enough)


class _Lines(Search[LineMirror]):
    """The search for straight rows of echoes."""

    fewest, sagitta, misses, strong_share = 3, 0.3, 100, STRONG_SHARE
    view: ImageView

    def patch(self, normal: Array, center: Array, near: Index) -> tuple[LineMirror, Index]:
        """The unbroken row of echoes that has the most weight, along a line."""
        line = LineMirror(center, center + np.array([normal[1], -normal[0]]))
        position = line.along(self.echoes.position[near])
        row = heaviest_row(position, np.sqrt(self.square(line.direction, near)), self.weight[near])
        return line.part(position[row].min(), position[row].max()), np.sort(near[row])

    def shortest(self, mirror: LineMirror) -> float:
        """The minimum length; for a mirror that faces the radar, `GLINT` times a glint if that is shorter.

        The mirror faces the radar where the foot of the perpendicular from the radar lies on it.
        """
        glint, foot = GLINT * self.view.glint, float(mirror.along(self.view.radar))
        resolved = self.tested and glint >= GLINT_CELLS * self.view.cell_at(mirror.center)
        return min(self.minimum_length, glint) if resolved and 0.0 <= foot <= mirror.length else self.minimum_length

    def along_bend(self, mirror: LineMirror, points: Array) -> Array:
        """Their places along the row."""
        return mirror.along(points)

    def passes(self, mirror: LineMirror) -> bool:
        """Whether echoes fill the mirror, outweigh those in a band of equal width before it, and are no side lobes."""
        short = np.clip(2.0 - mirror.length / self.minimum_length, 0.0, 1.0)
        if mirror.fill < SMALLEST_FILL + short * (SMALLEST_FILL_SHORT - SMALLEST_FILL):
            return False
        points = self.echoes.position
        position, before = mirror.along(points), -mirror.behind(self.view, points)
        weight = np.where((position >= 0.0) & (position <= mirror.length), self.weight, 0.0)
        across = np.sqrt(self.square(mirror.normal))
        in_front = (before > BEFORE_LINE[0] * across) & (before <= BEFORE_LINE[1] * across)
        on_it = np.abs(before) <= ON_LINE * across
        if weight[on_it].sum() < SMALLEST_CONTRAST * weight[in_front].sum():
            return False
        own = np.flatnonzero(on_it & (weight > 0.0))
        return not are_side_lobes(self.echoes.take(own), weight[own], self.view)

    def refined(self, mirror: LineMirror) -> LineMirror | None:
        """The mirror, continued as far as its row goes on, faint echoes included, and fitted to the image.

        On rows that are doubtful, only what its waves show to be a wall. None if the fitted line leaves the row:
        `KEPT_SHARE`.
        """
        row = self._on_image(mirror)
        return None if row is None else trimmed(row, self.view)

    def _on_image(self, mirror: LineMirror) -> LineMirror | None:
        """The mirror as the power of the image shows it, see `refined`."""
        points = self.every.position[self.every.visible]
        on_it = np.abs(mirror.beside(points)) <= NEAR * self.view.extent(points, mirror.normal)
        near = points[on_it]
        position = mirror.along(near)
        weight = np.where((position >= 0.0) & (position <= mirror.length), 1.0, HARDLY)
        row = heaviest_row(position, self.view.extent(near, mirror.direction), weight)
        own = self.every.take(np.flatnonzero(self.every.visible)[on_it][row])
        longer = self._without_shining_ends(self._continued(mirror, own), own)
        mirror, stray = self._fitted(longer)
        for _ in range(2):  # an object may stand at either end
            whole = self._unbroken(mirror, own)
            if whole is mirror:
                break
            mirror, stray = self._fitted(whole)
        if self._kept_share(mirror, own) < KEPT_SHARE:
            return None
        front = _front(mirror, self.view)
        if stray < STRAY * front.depth:
            return mirror
        face = mirror.moved(mirror.normal, mirror.center - front.depth * mirror.inward(self.view))
        face = replace(face, offset_error=float(np.hypot(mirror.offset_error, front.error)))
        if front.depth <= DEEP * self.view.range_cell:
            return face
        normal = normal_by_speckle(face, self.view)
        return face if normal is None else face.moved(normal, face.center)

    def _fitted(self, mirror: LineMirror) -> tuple[LineMirror, float]:
        """The mirror, fitted to the image, and the deviation [m] of the centroids from it; see `fit.refined`."""
        line, deviation = _fit(mirror, self.view)
        fitted = replace(mirror, start=line.start, end=line.end, angle_error=line.angle_error)
        return replace(fitted, offset_error=line.offset_error), deviation

    def _kept_share(self, mirror: LineMirror, own: Echoes) -> float:
        """Share of the row of echoes between the ends of a mirror, by length, that the mirror keeps within `NEAR`."""
        along, across = mirror.along(own.position), self.view.extent(own.position, mirror.normal)
        between = np.where((along >= 0.0) & (along <= mirror.length), own.length, 0.0)
        kept = np.abs(mirror.beside(own.position)) <= NEAR * across
        return float(between[kept].sum() / max(between.sum(), np.finfo(float).tiny))

    def _continued(self, mirror: LineMirror, own: Echoes) -> LineMirror:
        """The mirror up to the last echoes of its row, its `own`, unless what follows is too faint: `FAINTER_RATIO`."""
        along, power = mirror.along(own.position), own.amplitude**2
        cell = self.view.extent(own.position, mirror.direction)
        ends = []
        for place, first in ((-along, 0.0), (along, mirror.length)):  # outward from either end of the mirror
            order = np.argsort(place)
            place, level, one = place[order], power[order], cell[order]
            end = max(first, float(place[-1]))
            for i in np.flatnonzero((place[1:] > first) & (place[-1] - place[:-1] > FAINTER_CELLS * one[:-1])):
                beside = np.median(level[: i + 1][place[: i + 1] >= place[i] - BESIDE_CELLS * one[i]])
                if level[i + 1 :].mean() < FAINTER_RATIO * min(beside, np.median(level[: i + 1])):
                    end = float(place[i])
                    break
            ends.append(end)
        return mirror.part(-ends[0], ends[1])

    def _without_shining_ends(self, mirror: LineMirror, own: Echoes) -> LineMirror:
        """The mirror without bright objects at its ends, as explained at `DARK_CELLS`.

        `own` are the echoes of its row. A bright end is cut off only where nothing stands before it, and if it is too
        short for a mirror.
        """
        own = own.take(np.argsort(mirror.along(own.position)))
        place, power = mirror.along(own.position), own.amplitude**2
        cell, foot = self.view.extent(own.position, mirror.direction), float(mirror.along(self.view.radar))
        clear, glint = self._nothing_before(mirror), self.view.glint
        first, last = 0.0, mirror.length
        for i in np.flatnonzero(np.diff(place) > DARK_CELLS * np.maximum(cell[:-1], cell[1:])):
            sides = (
                (place <= place[i]) & (place >= place[i] - BESIDE_CELLS * cell[i]),
                ((place > place[i]) & (place <= place[i + 1] + BESIDE_CELLS * cell[i + 1])),
            )
            late = bool(place[i] > 0.5 * mirror.length)
            wall, beyond = sides if late else sides[::-1]
            seen = np.sort(own.direction[beyond | (np.arange(place.size) == i + (not late))])
            if power[beyond].mean() < GLINT_RATIO * power[wall].mean() or not clear[seen[0] : seen[-1] + 1].all():
                continue
            end = mirror.part(place[i], mirror.length) if late else mirror.part(0.0, place[i + 1])
            if end.length >= self.shortest(end):
                continue
            if late and not place[i] - glint < foot < mirror.length + glint:
                last = min(last, float(place[i]))
            elif not late and not -glint < foot < place[i + 1] + glint:
                first = max(first, float(place[i + 1]))
        part = mirror.part(first, last)
        return part if part.length >= self.shortest(part) else mirror

    def _nothing_before(self, mirror: LineMirror) -> Mask:
        """Directions in which no strong echo stands in front of the mirror, by more than an object's depth, (nu,)."""
        crossing = mirror.crossing(self.view)
        return ~np.isfinite(crossing) | (self._nearest > crossing - self.view.object_depth(crossing))

    @cached_property
    def _nearest(self) -> Array:
        """Range of the first strong echo in each direction, (nu,) [m]; infinite where there is none."""
        nearest = np.full(len(self.view.sight), np.inf)
        np.minimum.at(nearest, self.echoes.direction, self.echoes.range)
        return nearest

    def _in_sight(self, mirror: LineMirror) -> bool:
        """Whether most of the mirror has nothing in front of it."""
        met = np.isfinite(mirror.crossing(self.view))
        return bool(2 * np.count_nonzero(self._nothing_before(mirror) & met) > np.count_nonzero(met))

    def _unbroken(self, mirror: LineMirror, own: Echoes) -> LineMirror:
        """The mirror; or its longer part, where the row is two: a wall, and an object at its end almost in line.

        The part ends at the last of the row's `own` echoes before the break, for both may be some cells apart.
        """
        place, left, apart, share = _split(mirror, self.view)
        if not share:
            return mirror
        likelier = -share * mirror.independent(self.view) * np.log(max(left, np.finfo(float).tiny))
        if likelier < BREAK:
            return mirror
        if self._in_sight(mirror) and (
            apart < LEAST_APART or likelier < BREAK * _spread(mirror, self.view) / LOBE_SPREAD
        ):
            return mirror
        along = mirror.along(own.position)
        before, after = along[along <= place].max(initial=0.0), along[along >= place].min(initial=mirror.length)
        parts = mirror.part(0.0, before), mirror.part(after, mirror.length)
        longer = max(parts, key=lambda part: part.length)
        return longer if longer.length >= self.shortest(longer) else mirror


@remembered
def _fit(mirror: LineMirror, view: ImageView) -> tuple[LineMirror, float]:
    """The line through the centroids of power across the mirror, see `fit.refined`."""
    return refined(mirror, view, *PROFILE)


_front = remembered(find_front)


@remembered
def _split(mirror: LineMirror, view: ImageView) -> tuple[float, float, float, float]:
    """Where the row would break into two [m], what is left of its squared residuals, and how far apart both rows are,
    in resolution cells across the mirror, see `fit.split_in_two`.

    Also the share of its places from which this follows, zero where there are too few.
    """
    # Clipped at one, the weights of bright places are no larger than those of others.
    points, weight = power_centroids(mirror, view, *PROFILE[:2], clip=1.0)
    along, beside = mirror.along(points), mirror.beside(points)
    # The last cell at either end may also show the neighbouring wall, as in the corner of a room.
    first, last = view.extent(mirror.ends, mirror.direction)
    inside = (along >= first) & (along <= mirror.length - last)
    if np.count_nonzero(inside) < FEWEST_PLACES:
        return 0.0, 1.0, 0.0, 0.0
    cell = view.extent(points[inside], mirror.normal)
    place, left, apart = split_in_two(along[inside], beside[inside], weight[inside])
    return place, left, apart / float(np.median(cell)), float(inside.mean())


@remembered
def _spread(mirror: LineMirror, view: ImageView) -> float:
    """Median variance of the power across a mirror about the centroid of each profile, in squared resolution cells."""
    places, across = mirror.places(view), np.linspace(-SPREAD_CELLS, SPREAD_CELLS, SPREAD_SAMPLES)
    power = mirror.profiles(view, places, view.extent(places, mirror.normal)[:, None] * across)[1]
    total = np.maximum(power.sum(axis=1), np.finfo(float).tiny)
    return float(np.median((power @ across**2) / total - ((power @ across) / total) ** 2))
