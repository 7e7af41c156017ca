"""Step 2 in the floor plan, at its end: a wall goes on behind what stands in front of it.

An object in front hides a part of a wall, and the row of its echoes breaks off there. If the row goes on along the same
line where the object's shadow ends, it is one wall; and two rows, each too short to be a mirror, may be one together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np

from mirrorfold.common.types import Array, Index, Mask
from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.mirrors.line_mirror import LineMirror
from mirrorfold.detection.search.growing import NEAR, lies_on
from mirrorfold.detection.search.rows import GAP_CELLS
from mirrorfold.detection.views.image_view import ImageView

FEWEST, SHORTEST_CELLS = 3, 1.75
"""Echoes beyond a shadow, and the resolution cells that they reach over at least, to be the same wall:
the ridge of a lone one reaches over less."""

HALF_HIDDEN_CELLS = 1.0
"""At the edge of a shadow, so many resolution cells of a wall are half hidden and may be faint."""

SAMPLES = 64
"""Places of a gap at which it is asked whether they are hidden."""


class Clear(Protocol):
    """Tells which echoes, at ranges [m], directions and amplitudes, no object in front hides."""

    def __call__(self, range_: Array, direction: Index, amplitude: Array | float) -> Mask: ...  # noqa: D102


def beyond_shadows(mirror: LineMirror, view: ImageView, echoes: Echoes, clear: Clear) -> LineMirror:
    """The mirror as long as its row of echoes is when parts that objects hide make no gaps in it; itself if no longer.

    Parameters
    ----------
    mirror : LineMirror
        Its line stays as it is: it was fitted to what is seen without a gap.
    view : ImageView
    echoes : Echoes
        Their marks say which of them are visible; faint ones continue a wall, too.
    clear : callable
        See `Clear`.
    """
    backwards = mirror.part(mirror.length, 0.0)
    before, after = (_reach(way, view, echoes, clear) - way.length for way in (backwards, mirror))
    return mirror if before == after == 0.0 else mirror.part(-before, mirror.length + after)


def joined(
    rows: Sequence[LineMirror], view: ImageView, echoes: Echoes, clear: Clear, shortest: float
) -> list[LineMirror]:
    """Mirrors of two rows on one line, between which an object hides the rest.

    Parameters
    ----------
    rows : sequence of LineMirror
        Too short to be mirrors by themselves.
    view, echoes, clear
        As for `beyond_shadows`.
    shortest : float [m]
        Least length of a mirror, which both rows have together.
    """
    found: list[LineMirror] = []
    for row in sorted(rows, key=lambda row: -row.length):
        if any(lies_on(row, mirror, view) for mirror in found):
            continue
        longer = beyond_shadows(row, view, echoes, clear)
        points = echoes.position[echoes.visible]
        along, first = longer.along(points), float(longer.along(row.start))
        on_line = np.abs(longer.beside(points)) <= NEAR * view.extent(points, longer.normal)
        gap = GAP_CELLS * view.extent(row.ends, row.direction).max()  # nearer ones are the row's own
        before = (along >= 0.0) & (along < first - gap)
        after = (along > first + row.length + gap) & (along <= longer.length)
        for beyond in (points[on_line & before], points[on_line & after]):
            if len(beyond) and row.length + float(np.ptp(longer.along(beyond))) >= shortest:
                found.append(_through(row, beyond, longer, view))
    return found


def _through(row: LineMirror, beyond: Array, longer: LineMirror, view: ImageView) -> LineMirror:
    """The mirror through the middles of a row and of echoes (n, 2) beyond it: a longer lever than either of them."""
    line = LineMirror(row.center, beyond.mean(axis=0))
    cells = np.ptp(line.along(beyond)) / view.extent(line.end[None], line.direction)[0]
    stray = 0.5 * NEAR * float(view.extent(line.end[None], line.normal)[0]) / np.sqrt(max(cells, 1.0))
    error = float(np.hypot(row.offset_error, stray))
    whole = line.part(*np.sort(line.along(longer.ends)))
    whole = replace(whole, strength=row.strength, fill=row.fill, depth=row.depth)
    return replace(whole, offset_error=error, angle_error=float(np.degrees(error / line.length)))


def _reach(mirror: LineMirror, view: ImageView, echoes: Echoes, clear: Clear) -> float:
    """How far [m] the mirror goes on beyond its end, measured from its start."""
    points = echoes.position[echoes.visible]
    position = mirror.along(points)
    on_line = np.abs(mirror.beside(points)) <= NEAR * view.extent(points, mirror.normal)
    beyond = np.sort(position[on_line & (position > mirror.length)])
    cell = view.extent(mirror.ends, mirror.direction).max()
    end = mirror.length
    for row in np.split(beyond, np.flatnonzero(np.diff(beyond) > GAP_CELLS * cell) + 1):
        if row.size and row[0] - end <= GAP_CELLS * cell:  # not beyond any shadow
            continue
        if row.size < FEWEST or np.ptp(row) < SHORTEST_CELLS * cell:
            break
        share = _shown(mirror, end, row[0], view, clear)
        if share == 1.0 or share * (row[0] - end) > (GAP_CELLS + 2.0 * HALF_HIDDEN_CELLS) * cell:
            break
        end = float(row[-1])
    return end


def _shown(mirror: LineMirror, before: float, after: float, view: ImageView, clear: Clear) -> float:
    """Share of the line from one position [m] to another that nothing hides."""
    places = mirror.start + np.linspace(before, after, SAMPLES)[:, None] * mirror.direction
    range_, direction, inside = view.locate(places)
    return float(np.mean(inside & clear(range_, direction, mirror.strength)))
