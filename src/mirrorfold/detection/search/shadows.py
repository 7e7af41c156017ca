"""Step 2 in the floor plan, at its end: walls go on where a part of them is hidden by an object, or faint.

An object in front of a wall casts a shadow on it, where the row of the wall's echoes breaks off. If the row goes on
along the same line where the shadow ends, both parts are one wall: a mirror is continued, and two rows that are each
too short to be a mirror may be one together. The same holds across a gap in which the wall's speckle is too weak for
echoes, but the image is still brighter on the line than beside it. In an opening, it is dark there.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from mirrorfold.common.decibels import ratio_of
from mirrorfold.common.types import Array, Index, Mask
from mirrorfold.detection.echoes import SIDE_LOBE_MARGIN_DB, Echoes
from mirrorfold.detection.mirrors.line_mirror import LineMirror
from mirrorfold.detection.search.growing import NEAR, lies_on
from mirrorfold.detection.search.rows import GAP_CELLS
from mirrorfold.detection.search.thick_walls import SPECKLE_FLOOR
from mirrorfold.detection.views.image_view import ImageView

FEWEST, SHORTEST_CELLS = 3, 1.75
"""Least number of echoes beyond a shadow, and least length of their row in resolution cells, for them to be the same
wall: the ridge of a single echo is shorter."""

HALF_HIDDEN_CELLS = 1.0
"""Length of a wall, in resolution cells, that is half hidden at the edge of a shadow, and may be faint."""

BESIDE_CELLS, BESIDE_SAMPLES = (2.0, 4.0), 5
"""Where the image is looked at beside a line, in resolution cells across it, and at how many places: nearer, the row
itself would be seen. That is two cells, which vary half as much as one."""

SIGNIFICANT, SPECKLE_SPREAD = 3.0, np.pi / np.sqrt(6.0)
"""Number of standard deviations by which a row must be brighter than what is beside it; and the standard deviation of
the logarithm of the power of speckle, which is distributed exponentially."""

RING_CELLS = 2.0
"""Largest depth of a row, in range cells, that a ring of side lobes at one range fills: a cell to either side."""

SAMPLES = 64
"""Number of places in a gap at which the line is tested for being hidden."""


Clear = Callable[[Array, Index, Array | float], Mask]
"""A function of ranges [m], directions and amplitudes that returns which of these echoes no object in front hides."""


def beyond_shadows(
    mirror: LineMirror, view: ImageView, echoes: Echoes, clear: Clear, others: Sequence[LineMirror] | None = None
) -> LineMirror:
    """Continue a mirror beyond the shadows of objects, as far as its row of echoes goes on; else return it as it is.

    Its line is kept: it was fitted to the part that is seen without a gap. Only visible echoes count; faint ones
    continue a wall, too. If `others` are given, the mirror is also continued across gaps in which it is faint, see
    `goes_on`. These are mirrors that it does not run over: if the wall goes on up to one of them on its line, both meet
    halfway.
    """
    backwards = mirror.part(mirror.length, 0.0)
    before, after = (_reach(way, view, echoes, clear, others) - way.length for way in (backwards, mirror))
    return mirror if before == after == 0.0 else mirror.part(-before, mirror.length + after)


def joined(
    rows: Sequence[LineMirror], view: ImageView, echoes: Echoes, clear: Clear, shortest: float
) -> list[LineMirror]:
    """Mirrors that each consist of two rows on one line, with the wall between them hidden by an object.

    The `rows` are too short to be mirrors by themselves. Both together must have at least the length `shortest` [m],
    without the gap.
    """
    found: list[LineMirror] = []
    for row in sorted(rows, key=lambda row: -row.length):
        if any(lies_on(row, mirror, view) for mirror in found):
            continue
        longer = beyond_shadows(row, view, echoes, clear)
        points = echoes.position[echoes.visible]
        along, first = longer.along(points), float(longer.along(row.start))
        on_line = np.abs(longer.beside(points)) <= NEAR * view.extent(points, longer.normal)
        gap = GAP_CELLS * view.extent(row.ends, row.direction).max()  # nearer echoes belong to the row itself
        before = (along >= 0.0) & (along < first - gap)
        after = (along > first + row.length + gap) & (along <= longer.length)
        sides = [
            beyond
            for beyond in (points[on_line & before], points[on_line & after])
            if len(beyond) and row.length + float(np.ptp(longer.along(beyond))) >= shortest
        ]
        if sides:  # a row between two others gives one mirror, whose direction follows best from the farther one
            farther = max(sides, key=lambda beyond: float(np.linalg.norm(beyond.mean(axis=0) - row.center)))
            found.append(_through(row, farther, longer, view))
    return found


def goes_on(gap: LineMirror, view: ImageView) -> bool:
    """Whether a row goes on in a `gap` of its echoes, too faint for any: it is brighter there than what is beside it.

    Compared are the means of the logarithm of power on the line, and on that side of it that is brighter. What may be a
    side lobe of brighter echoes does not count.
    """
    places, cells = gap.places(view), max(gap.independent(view), 1.0)
    beside = np.linspace(*BESIDE_CELLS, BESIDE_SAMPLES)
    across = view.extent(places, gap.normal)[:, None] * np.concatenate([-beside, [0.0], beside])
    range_, u = view.to_polar(places[:, None] + across[..., None] * gap.normal)
    power, on_line = view.power_at(range_, u), (range_[:, BESIDE_SAMPLES], u[:, BESIDE_SAMPLES])
    lobes = ratio_of(SIDE_LOBE_MARGIN_DB) * _lobes(*on_line, view)
    power[power[:, BESIDE_SAMPLES] <= lobes**2, BESIDE_SAMPLES] = 0.0
    level = np.log(np.maximum(power, max(SPECKLE_FLOOR * gap.strength**2, np.finfo(float).tiny))).mean(axis=0)
    # The mean over a line of n cells has the variance ``1 / n``, that over two cells beside it half as much.
    brighter = level[BESIDE_SAMPLES] - max(level[:BESIDE_SAMPLES].mean(), level[-BESIDE_SAMPLES:].mean())
    return bool(brighter > SIGNIFICANT * SPECKLE_SPREAD * np.sqrt(1.5 / cells))


def _lobes(range_: Array, u: Array, view: ImageView) -> Array:
    """Amplitude of side lobes at ranges [m] and u, (n,) each.

    Those of echoes that only a part of the antennas sees make a ring, which fills no row that crosses it.
    """
    lobes = view.side_lobes[view.row(range_), view.column(u)]
    if np.ptp(range_) > RING_CELLS * view.range_cell:
        return lobes
    level, brightest = view.brightest_at(range_)
    return np.maximum(lobes, view.part_lobes(level, np.abs(u - view.u[brightest])))


def _through(row: LineMirror, beyond: Array, longer: LineMirror, view: ImageView) -> LineMirror:
    """The mirror on the line through the middle of a row and the mean of the echoes (n, 2) [m] beyond a shadow.

    The distance between both is longer than either row, so that the line is known better. `longer` is the row,
    continued over all echoes, from which the mirror takes its ends.
    """
    line = LineMirror(row.center, beyond.mean(axis=0))
    cells = np.ptp(line.along(beyond)) / view.extent(line.end[None], line.direction)[0]
    deviation = 0.5 * NEAR * float(view.extent(line.end[None], line.normal)[0]) / np.sqrt(max(cells, 1.0))
    error = float(np.hypot(row.offset_error, deviation))
    whole = line.part(*np.sort(line.along(longer.ends)))
    whole = replace(whole, strength=row.strength, fill=row.fill, depth=row.depth)
    return replace(whole, offset_error=error, angle_error=float(np.degrees(error / line.length)))


def _reach(
    mirror: LineMirror, view: ImageView, echoes: Echoes, clear: Clear, others: Sequence[LineMirror] | None
) -> float:
    """Length [m] of a mirror from its start to the end of the last row of echoes that continues it, see
    `beyond_shadows`.
    """
    points = echoes.position[echoes.visible]
    position, cell = mirror.along(points), float(view.extent(mirror.ends, mirror.direction).max())
    end, next_one = mirror.length, _next(mirror, others or (), view)
    halfway = 0.5 * (end + next_one)
    on_line = np.abs(mirror.beside(points)) <= NEAR * view.extent(points, mirror.normal)
    beyond = np.sort(position[on_line & (position > end) & (position < halfway)])
    for row in np.split(beyond, np.flatnonzero(np.diff(beyond) > GAP_CELLS * cell) + 1):
        is_row = row.size >= FEWEST and np.ptp(row) >= SHORTEST_CELLS * cell
        if not is_row or row[0] - end <= GAP_CELLS * cell:  # nearer ones belong to the mirror itself
            continue
        share = _shown(mirror, end, row[0], view, clear)
        seen = share == 1.0 or share * (row[0] - end) > (GAP_CELLS + 2.0 * HALF_HIDDEN_CELLS) * cell
        if seen and (others is None or not goes_on(mirror.part(end + cell, row[0] - cell), view)):
            break
        end = float(row[-1])
    if GAP_CELLS * cell < next_one - end < np.inf and goes_on(mirror.part(end + cell, next_one - cell), view):
        end = halfway
    return end


def _next(mirror: LineMirror, others: Sequence[LineMirror], view: ImageView) -> float:
    """Position [m] along a mirror at which the next one on its line begins, beyond its end; infinite if none does."""
    ends = np.array([other.ends for other in others]).reshape(-1, 2)
    on_line = (np.abs(mirror.beside(ends)) <= NEAR * view.extent(ends, mirror.normal)).reshape(-1, 2).all(axis=1)
    begins = mirror.along(ends).reshape(-1, 2).min(axis=1)
    return float(begins[on_line & (begins >= mirror.length)].min(initial=np.inf))


def _shown(mirror: LineMirror, before: float, after: float, view: ImageView, clear: Clear) -> float:
    """Share of the line, between two positions [m] along it, that lies in view, and that no object hides and no echo
    from elsewhere blurs.
    """
    places = mirror.at(np.linspace(before, after, SAMPLES))
    range_, direction, inside = view.locate(places)
    return float(np.mean(inside & ~view.near_misplaced(places) & clear(range_, direction, mirror.strength)))
