"""Step 2 in the floor plan: unbroken, straight rows of echoes are mirrors, if they stand out of their surroundings."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np
from scipy.ndimage import uniform_filter1d

from mirrorfold.common.geometry import turned, unit
from mirrorfold.common.types import Array, Index, Mask
from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.mirrors.line_mirror import LineMirror
from mirrorfold.detection.search.fit import FEWEST_PLACES, bowed, broken, centres, flat, refined
from mirrorfold.detection.search.fronts import find_front
from mirrorfold.detection.search.growing import NEAR, Search
from mirrorfold.detection.search.rows import heaviest_row
from mirrorfold.detection.views.image_view import ImageView

MINIMUM_CELLS = 7.75
"""Shortest mirror in resolution cells: the row of echoes of a shorter one says too little about its direction."""

STRONG_SHARE = 0.65
"""Share of that length, five cells, that its strong echoes must cover where faint ones continue them: beside a
smooth object, which is bright, half of a wall may lie below the threshold."""

GLINT, GLINT_CELLS = 0.9, 4.0
"""A row that faces the array may be as short as this share of the glint of a smooth wall, where that is so many cells
long: the glint of a bulging wall of radius R at the distance r is R / (R + r) of it, that of a point one cell."""

DARK_CELLS, SHINES, BESIDE_CELLS = 1.25, 10.0 ** (8.0 / 10.0), 4.0
"""Beyond a gap of `DARK_CELLS` resolution cells, echoes are no part of a wall where their power exceeds the wall's by
8 dB, each in the mean over `BESIDE_CELLS` beside the gap: a wall fades slowly, and the mean of four speckles strays by
2 dB. Of 595 rough walls 8 had such an end. Where it faces the radar, a wall itself may be as bright."""

SMALLEST_FILL = 0.55
"""Share of its length that a mirror's echoes must fill; each fills one resolution cell along the line."""

SMALLEST_FILL_SHORT = 0.85
"""The same for a mirror of the minimum length, falling to the above at twice that: clutter makes short rows by chance,
filled by up to 85 %, but no long ones."""

SMALLEST_CONTRAST = 2.0
"""Echoes on a mirror's line over those in a band of equal width in front of it: clutter has a ratio near one."""

ON_LINE, BEFORE_LINE = 0.75, (1.0, 2.5)
"""Half the width of a mirror's own band, and where the band in front begins and ends, in cells across it: both hold 1.5
cells."""

LOBE = 0.75, 0.5, 4.0
"""Half-length of the profiles across a mirror, in cells across it; the amplitude relative to the peak down to which
their main lobe is taken, the cell's own definition; and the power, over the median, up to which they weigh with it."""

DEEP = 0.1
"""A line that was fitted this many range cells behind the face of its wall is turned by speckle inside the wall."""

STRAY = 0.2
"""Where the centres of power stray by less than this share of their depth behind the face, the pulse rings, and the
wall is not thick: its echo is drawn out alike all along. In walls that scatter inside, or at their back, the centres
stray from speckle to speckle by half the depth in the median, and by less than 0.25 of it in two of 160."""

LARGEST_TURN_DEG, TURNS = 0.8, (17, 9)
"""How far [degree] the speckle of a thick wall may have turned the line through it: 1 cm of depth over 1 m. And angles
that are tried: over all of it, and between the neighbours of the best."""

BREAK = 10.0
"""A row is two if two lines that need not touch are likelier than one by this much, in twice the logarithm of the
likelihoods' ratio: ``n ln(s_1 / s_2)``, with s the squares that one line and two leave of n places, each with a speckle
of its own. Of 700 rough walls, 7 to 32 cells long, it was more in one, and less than 8 in 99 of a hundred."""

LOBE_SPREAD, SPREAD_CELLS = 0.08, 1.25
"""Variance of the power across a thin wall about its centre, in square cells, up to `SPREAD_CELLS` to either side: 0.07
to 0.09. Walls that scatter from inside have 0.1 to 0.4, and their centres stray by their depth, so that one in ten, a
metre long, would exceed `BREAK`. Hence `BREAK` grows with the median variance of a row over that of a thin wall. But
only in line of sight: behind objects, wide rows are mostly multiple scattering."""

SPREAD_SAMPLES = 21
"""Samples of such a profile."""

NO_BOW = 0.9
"""A row that bulges is a wall with an object at its end if two lines leave less than this share of the squares that a
bow leaves. Of rows of arcs they leave 0.96 and more, of the row of a wall between two round objects they left 0.82."""

BEHIND = 2.0
"""Half-length, in cells across the wall, of the profiles that show what scatters behind its front."""

LEVEL_CELLS = 8.0
"""Resolution cells along a wall over which its speckle is averaged to tell how bright the wall is there."""

SPECKLE_SAMPLES = 241
"""Samples of the profiles that are turned with the line, so close that straight lines join them."""

SPECKLE_FLOOR = 1e-4
"""Power, relative to the wall's, that speckle cannot be told from noise and side lobes below."""


def find_lines(echoes: Echoes, view: ImageView, *, minimum_length: float, tested: bool = True) -> list[LineMirror]:
    """Straight mirrors among the visible echoes of an image, strongest first: see `Search`.

    Strong echoes are evidence, faint ones continue it.
    """
    # Less than this many votes cannot be a filled row of the minimum length, even of faint echoes.
    enough = 0.25 * minimum_length * SMALLEST_FILL
    return _Lines(echoes, view, minimum_length, tested).find(enough)


class _Lines(Search[LineMirror]):
    """Rows of echoes."""

    fewest, sagitta, misses, strong_share = 3, 0.3, 100, STRONG_SHARE
    view: ImageView

    def patch(self, normal: Array, center: Array, near: Index) -> tuple[LineMirror, Index]:
        """The heaviest unbroken row."""
        line = LineMirror(center, center + np.array([normal[1], -normal[0]]))
        position = line.along(self.echoes.position[near])
        row = heaviest_row(position, np.sqrt(self.square(line.direction, near)), self.weight[near])
        return line.part(position[row].min(), position[row].max()), np.sort(near[row])

    def shortest(self, mirror: LineMirror) -> float:
        """As given; of a mirror that faces the radar its glint, if that is shorter and can be told from a point's."""
        glint, foot = GLINT * self.view.glint, float(mirror.along(self.view.radar))
        told = self.tested and glint >= GLINT_CELLS * self.view.cell_at(mirror.center)
        return min(self.minimum_length, glint) if told and 0.0 <= foot <= mirror.length else self.minimum_length

    def straight_part(self, mirror: LineMirror, member: Index) -> tuple[LineMirror, Index] | None:
        """The wall in a row that bulges because objects stand at its ends; None if the row is a bow."""
        for _ in range(2):  # an object may stand at either end
            points = self.echoes.position[member]
            along, beside = mirror.along(points), mirror.beside(points)
            weight = self.weight[member] / self.square(mirror.normal, member)
            place, left = broken(along, beside, weight)
            longer = (along <= place) == (place >= 0.5 * mirror.length)
            if left > NO_BOW * bowed(along, beside, weight) or np.count_nonzero(longer) < self.fewest:
                return None
            mirror, member = self.patch(*flat(points[longer], weight[longer]), member[longer])
            if mirror.length < self.shortest(mirror):
                return None
            if not self.bulges(mirror, member):
                return mirror, member
        return None

    def passes(self, mirror: LineMirror) -> bool:
        """Whether its echoes fill it and outweigh those in a band of the same width in front of it."""
        short = np.clip(2.0 - mirror.length / self.minimum_length, 0.0, 1.0)
        if mirror.fill < SMALLEST_FILL + short * (SMALLEST_FILL_SHORT - SMALLEST_FILL):
            return False
        points = self.echoes.position
        position, before = mirror.along(points), -mirror.behind(self.view, points)
        weight = np.where((position >= 0.0) & (position <= mirror.length), self.weight, 0.0)
        across = np.sqrt(self.square(mirror.normal))
        in_front = (before > BEFORE_LINE[0] * across) & (before <= BEFORE_LINE[1] * across)
        return bool(weight[np.abs(before) <= ON_LINE * across].sum() >= SMALLEST_CONTRAST * weight[in_front].sum())

    def refined(self, mirror: LineMirror) -> LineMirror:
        """The mirror as far as its row, faint echoes included, goes on, fitted to the image."""
        points = self.every.position[self.every.visible]
        on_it = np.abs(mirror.beside(points)) <= NEAR * self.view.extent(points, mirror.normal)
        near = points[on_it]
        position = mirror.along(near)
        # Its own echoes outweigh any other row on the same line.
        weight = np.where((position >= 0.0) & (position <= mirror.length), 1.0, 1e-6)
        row = heaviest_row(position, self.view.extent(near, mirror.direction), weight)
        longer = mirror.part(min(float(position[row].min()), 0.0), max(float(position[row].max()), mirror.length))
        longer = self._without_shining_ends(longer, self.every.take(np.flatnonzero(self.every.visible)[on_it][row]))
        mirror, stray = refined(longer, self.view, *LOBE)
        for _ in range(2):  # an object may stand at either end
            whole = self._unbroken(mirror)
            if whole is mirror:
                break
            mirror, stray = refined(whole, self.view, *LOBE)
        front = find_front(mirror, self.view)
        if stray < STRAY * front.depth:
            return mirror
        face = mirror.moved(mirror.normal, mirror.center - front.depth * mirror.inward(self.view))
        face = replace(face, offset_error=float(np.hypot(mirror.offset_error, front.error)))
        return _parallel_to_speckle(face, self.view) if front.depth > DEEP * self.view.range_cell else face

    def _without_shining_ends(self, mirror: LineMirror, own: Echoes) -> LineMirror:
        """The mirror without bright objects at its ends, beyond gaps of its row; all of them in line of sight."""
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
            if power[beyond].mean() < SHINES * power[wall].mean() or not clear[seen[0] : seen[-1] + 1].all():
                continue
            if late and not place[i] - glint < foot < mirror.length + glint:
                last = min(last, float(place[i]))
            elif not late and not -glint < foot < place[i + 1] + glint:
                first = max(first, float(place[i + 1]))
        part = mirror.part(first, last)
        return part if part.length >= self.shortest(part) else mirror

    def _nothing_before(self, mirror: LineMirror) -> Mask:
        """In which directions no echo stands before the mirror, (nu,)."""
        crossing = mirror.crossing(self.view)
        return np.asarray(~np.isfinite(crossing) | (self._nearest > crossing - self.view.object_depth(crossing)))

    @cached_property
    def _nearest(self) -> Array:
        """Range of the first echo in each direction, (nu,) [m]."""
        nearest = np.full(len(self.view.sight), np.inf)
        np.minimum.at(nearest, self.echoes.direction, self.echoes.range)
        return nearest

    def _in_sight(self, mirror: LineMirror) -> bool:
        """Whether nothing stands before most of the mirror."""
        met = np.isfinite(mirror.crossing(self.view))
        return bool(2 * np.count_nonzero(self._nothing_before(mirror) & met) > np.count_nonzero(met))

    def _unbroken(self, mirror: LineMirror) -> LineMirror:
        """The longer part of a row that is two: a wall, and what stands at its end almost on the same line."""
        points, weight = centres(mirror, self.view, *LOBE[:2], clip=1.0)  # bright places say no more than others
        along, beside = mirror.along(points), mirror.beside(points)
        # The last cell at either end shows the neighbouring wall, too, as in the corner of a room.
        first, last = self.view.extent(mirror.ends, mirror.direction)
        inside = (along >= first) & (along <= mirror.length - last)
        if np.count_nonzero(inside) < FEWEST_PLACES:
            return mirror
        place, left = broken(along[inside], beside[inside], weight[inside])
        likelier = -inside.mean() * mirror.independent(self.view) * np.log(max(left, np.finfo(float).tiny))
        if likelier < BREAK or (self._in_sight(mirror) and likelier < BREAK * _spread(mirror, self.view) / LOBE_SPREAD):
            return mirror
        parts = mirror.part(0.0, place), mirror.part(place, mirror.length)
        longer = max(parts, key=lambda part: part.length)
        return longer if longer.length >= self.shortest(longer) else mirror


def _spread(mirror: LineMirror, view: ImageView) -> float:
    """Median variance of the power across a mirror about the centre of each profile, in squared cells."""
    places, across = mirror.places(view), np.linspace(-SPREAD_CELLS, SPREAD_CELLS, SPREAD_SAMPLES)
    power = mirror.profiles(view, places, view.extent(places, mirror.normal)[:, None] * across)[1]
    total = np.maximum(power.sum(axis=1), np.finfo(float).tiny)
    return float(np.median((power @ across**2) / total - ((power @ across) / total) ** 2))


def _parallel_to_speckle(mirror: LineMirror, view: ImageView) -> LineMirror:
    """A thick wall's mirror, turned about its middle to where the wall's speckle is likeliest.

    The power of speckle is distributed exponentially about its mean (Goodman 2007), which depends on the depth behind
    the face alone. With the mean at each depth taken from the wall itself, the likelihood is largest where the mean of
    the depths' logarithmic means is smallest: a line askew smears the wall's steep front.
    """
    places = mirror.places(view)
    across = view.extent(places, mirror.normal)
    power = mirror.profiles(view, places, across[:, None] * np.linspace(-BEHIND, BEHIND, SPECKLE_SAMPLES))[1]
    width = round(LEVEL_CELLS * len(places) / mirror.independent(view))
    level = uniform_filter1d(power.max(axis=1), max(1, width), mode="nearest")
    power /= np.maximum(level, np.finfo(float).tiny)[:, None]
    # Turning the line by an angle moves each profile along itself.
    samples = (places - mirror.center) @ mirror.direction / (across * 2.0 * BEHIND / (SPECKLE_SAMPLES - 1))

    def unlikelihood(angle: float) -> float:
        shift = np.tan(angle) * samples
        whole = np.floor(shift).astype(np.intp)
        # Profiles in a row that move by as many whole samples are added up before they are moved.
        first = np.flatnonzero(np.diff(whole, prepend=whole[0] + 1))
        turned = np.zeros(SPECKLE_SAMPLES)
        for more, share in ((0, 1.0 - shift + whole), (1, shift - whole)):
            at = np.clip(whole[first][:, None] + more + np.arange(SPECKLE_SAMPLES), 0, SPECKLE_SAMPLES - 1)
            turned += np.take_along_axis(np.add.reduceat(share[:, None] * power, first), at, axis=1).sum(axis=0)
        return float(np.log(turned / len(places) + SPECKLE_FLOOR).mean())

    angle, step = 0.0, np.radians(LARGEST_TURN_DEG)
    for turns in TURNS:
        angle = min(angle + np.linspace(-step, step, turns), key=unlikelihood)
        step *= 2.0 / (turns - 1)
    tilted = mirror.direction + np.tan(angle) * mirror.inward(view)
    return mirror.moved(unit(turned(tilted)), mirror.center)
