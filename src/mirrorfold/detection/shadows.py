"""Step 2 in the floor plan, at its end: a wall goes on behind what stands in front of it.

An object in front hides a part of a wall, and the row of its echoes breaks off there. If the row goes on along the same
line where the object's shadow ends, it is one wall.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from mirrorfold.common.types import Array, Index, Mask
from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.growing import NEAR
from mirrorfold.detection.image_view import ImageView
from mirrorfold.detection.line_mirror import LineMirror
from mirrorfold.detection.lines import GAP_CELLS

FEWEST, SHORTEST_CELLS = 3, 1.75
"""Echoes beyond a shadow, and the resolution cells that they reach over at least, to be the same wall:
the ridge of a lone one reaches over less."""

HALF_HIDDEN_CELLS = 1.0
"""At the edge of a shadow, so many resolution cells of a wall are half hidden and may be faint."""

SAMPLES = 64
"""Places of a gap at which it is asked whether they are hidden."""


class Clear(Protocol):
    """Which echoes at ranges [m], directions and amplitudes nothing in front hides."""

    def __call__(self, range_: Array, direction: Index, amplitude: Array | float) -> Mask: ...  # noqa: D102


def beyond_shadows(mirror: LineMirror, view: ImageView, echoes: Echoes, clear: Clear) -> LineMirror:
    """The mirror, as long as its row of echoes is when parts that are hidden by objects make no gaps in it.

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
    first = mirror.length - _reach(mirror.part(mirror.length, 0.0), view, echoes, clear)
    return mirror.part(first, _reach(mirror, view, echoes, clear))


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
        enough = row.size >= FEWEST and np.ptp(row) >= SHORTEST_CELLS * cell
        if not enough or _shown(mirror, end, row[0], view, clear) > (GAP_CELLS + 2.0 * HALF_HIDDEN_CELLS) * cell:
            break
        end = float(row[-1])
    return end


def _shown(mirror: LineMirror, before: float, after: float, view: ImageView, clear: Clear) -> float:
    """How much [m] of the line from one position [m] to another nothing hides."""
    places = mirror.start + np.linspace(before, after, SAMPLES)[:, None] * mirror.direction
    range_, direction, inside = view.locate(places)
    return float((after - before) * np.mean(inside & clear(range_, direction, mirror.strength)))
