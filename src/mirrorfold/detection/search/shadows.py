"""Step 2 in the floor plan, at its end: walls go on behind the objects that hide a part of them.

An object in front of a wall casts a shadow on it, where the row of the wall's echoes breaks off. If the row goes on
along the same line where the shadow ends, both parts are one wall: a mirror is continued, and two rows that are each
too short to be a mirror may be one together.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from mirrorfold.common.types import Array, Index, Mask
from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.mirrors.line_mirror import LineMirror
from mirrorfold.detection.search.growing import NEAR, lies_on
from mirrorfold.detection.search.rows import GAP_CELLS
from mirrorfold.detection.views.image_view import ImageView

FEWEST, SHORTEST_CELLS = 3, 1.75
"""Least number of echoes beyond a shadow, and least length of their row in resolution cells, for them to be the same
wall: the ridge of a single echo is shorter."""

HALF_HIDDEN_CELLS = 1.0
"""Length of a wall, in resolution cells, that is half hidden at the edge of a shadow, and may be faint."""

SAMPLES = 64
"""Number of places in a gap at which the line is tested for being hidden."""


Clear = Callable[[Array, Index, Array | float], Mask]
"""A function that tells which echoes, at ranges [m], in directions and of amplitudes, no object in front hides."""


def beyond_shadows(mirror: LineMirror, view: ImageView, echoes: Echoes, clear: Clear) -> LineMirror:
    """Continue a mirror beyond the shadows of objects, as far as its row of echoes goes on; else return it as it is.

    Parameters
    ----------
    mirror : LineMirror
        Its line is kept: it was fitted to the part that is seen without a gap.
    view : ImageView
    echoes : Echoes
        Only visible ones count; faint ones continue a wall, too.
    clear : callable
        See `Clear`.
    """
    backwards = mirror.part(mirror.length, 0.0)
    before, after = (_reach(way, view, echoes, clear) - way.length for way in (backwards, mirror))
    return mirror if before == after == 0.0 else mirror.part(-before, mirror.length + after)


def joined(
    rows: Sequence[LineMirror], view: ImageView, echoes: Echoes, clear: Clear, shortest: float
) -> list[LineMirror]:
    """Mirrors that each consist of two rows on one line, with the wall between them hidden by an object.

    Parameters
    ----------
    rows : sequence of LineMirror
        Rows of echoes, too short to be mirrors by themselves.
    view, echoes, clear
        As for `beyond_shadows`.
    shortest : float [m]
        Least length of a mirror: both rows together must have it, without the gap.
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
        for beyond in (points[on_line & before], points[on_line & after]):
            if len(beyond) and row.length + float(np.ptp(longer.along(beyond))) >= shortest:
                found.append(_through(row, beyond, longer, view))
    return found


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


def _reach(mirror: LineMirror, view: ImageView, echoes: Echoes, clear: Clear) -> float:
    """Length [m] of a mirror from its start to the end of the last row of echoes that continues it behind a shadow."""
    points = echoes.position[echoes.visible]
    position = mirror.along(points)
    on_line = np.abs(mirror.beside(points)) <= NEAR * view.extent(points, mirror.normal)
    beyond = np.sort(position[on_line & (position > mirror.length)])
    cell = view.extent(mirror.ends, mirror.direction).max()
    end = mirror.length
    for row in np.split(beyond, np.flatnonzero(np.diff(beyond) > GAP_CELLS * cell) + 1):
        if row.size and row[0] - end <= GAP_CELLS * cell:  # there is no shadow in between
            continue
        if row.size < FEWEST or np.ptp(row) < SHORTEST_CELLS * cell:
            break
        share = _shown(mirror, end, row[0], view, clear)
        if share == 1.0 or share * (row[0] - end) > (GAP_CELLS + 2.0 * HALF_HIDDEN_CELLS) * cell:
            break
        end = float(row[-1])
    return end


def _shown(mirror: LineMirror, before: float, after: float, view: ImageView, clear: Clear) -> float:
    """Share of the line, between two positions [m] along it, that lies in view and that no object hides."""
    places = mirror.start + np.linspace(before, after, SAMPLES)[:, None] * mirror.direction
    range_, direction, inside = view.locate(places)
    return float(np.mean(inside & clear(range_, direction, mirror.strength)))
