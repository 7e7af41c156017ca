"""Rows of side lobes, which are no mirrors.

Side lobes stand at the range of their echo, in a row about the radar. Those of the whole array are known, and are never
taken for echoes. Those of a glint that only a part of the array sees are higher, see `ImageView.part_lobes`, and the
smaller the part the higher they are. But they do not fade and move as the echoes of a surface do, by speckle: they
stand exactly at one range.
"""

from __future__ import annotations

import numpy as np

from mirrorfold.common.types import Array, Index, Mask
from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.views.image_view import EDGE_CELLS, ImageView

LARGEST_SHARE = 0.62
"""Largest share of a row, by weight, that may be side lobes within one range cell. It was 0.72 to 1.0 in rows of side
lobes, of rays and of full waves. A wall beside a glint may be as faint as side lobes in all of its length, but stands
at many ranges: its share was 0.54 at most, where a range cell was 4 cm."""

DEEPEST = 2.0
"""Largest depth of such a row, in range cells: side lobes stand at one range, and echoes that are blurred over a cell
to either side of it. Faint walls that would be taken for side lobes, by a share of 0.64, were 2.1 to 2.3 cells deep,
and rows of side lobes up to 1.9."""

SMALLEST_PART = 1.0 / 8.0
"""Smallest part of the array whose lobes are recognised: they are so many times higher than those of half an array.
What a smaller part sees is eight resolution cells wide."""

RING_REACH, RING_DEPTH = 1.5, 0.1
"""A row stands at one range if, this far to either side in resolution cells, the strongest echoes in all directions are
within so many range cells of each other. Speckle moves the echoes of a surface by several times as much."""


def are_side_lobes(row: Echoes, weight: Array, view: ImageView) -> bool:
    """Whether most of a row, by the `weight` (n,) of its echoes, may be side lobes of brighter echoes beyond its ends.

    A bright echo in the row itself does not count: a wall that faces the radar shows a glint, and stands at one range.
    """
    if not len(row) or np.ptp(row.range) > DEEPEST * view.range_cell:
        return False
    level, brightest = view.brightest_at(row.range)
    u, sine, reach = view.u[brightest], view.u[row.direction], EDGE_CELLS * view.u_cell
    beyond = (u < sine.min() - reach) | (u > sine.max() + reach)
    lobes = beyond & may_be_lobes(row, view, level, np.abs(sine - u))
    return _heaviest_cell(row.range[lobes], weight[lobes], view.range_cell) > LARGEST_SHARE * float(weight.sum())


def _heaviest_cell(ranges: Array, weight: Array, cell: float) -> float:
    """Largest sum of the weights of echoes that are within one range cell, of `ranges` and `weight` (n,)."""
    order = np.argsort(ranges)
    ranges, sums = ranges[order], np.concatenate([[0.0], np.cumsum(weight[order])])
    return float((sums[np.searchsorted(ranges, ranges + cell, "right")] - sums[:-1]).max(initial=0.0))


def may_be_lobes(echoes: Echoes, view: ImageView, level: Array, aside: Array) -> Mask:
    """Which echoes may be side lobes of brighter ones at the same range that only a part of the array sees, (n,).

    The brighter echo has the amplitude `level` (n,), and is `aside` (n,) in u. An echo may be its lobe if it is no
    stronger than `ImageView.part_lobes`, or up to ``1 / SMALLEST_PART`` times as strong and in a row at one range.
    """
    height = echoes.amplitude / view.part_lobes(level, aside)
    found = height <= 1.0
    doubtful = np.flatnonzero(~found & (height * SMALLEST_PART <= 1.0))
    found[doubtful] = at_one_range(echoes, view, doubtful)
    return found


def at_one_range(echoes: Echoes, view: ImageView, which: Index) -> Mask:
    """Whether echoes are in the middle of a row at one range: for the echoes with the numbers `which` (m,), (m,)."""
    u, reach = view.u[echoes.direction], RING_REACH * view.u_cell
    order, found = np.argsort(u, kind="stable"), np.zeros(len(which), dtype=bool)
    first = np.searchsorted(u, u[which] - reach, "left", order)
    last = np.searchsorted(u, u[which] + reach, "right", order)
    for k, i in enumerate(which):
        near = order[first[k] : last[k]]
        near = near[np.abs(echoes.range[near] - echoes.range[i]) <= 0.5 * view.range_cell]
        near = near[np.argsort(-echoes.amplitude[near], kind="stable")]
        strongest = near[np.unique(u[near], return_index=True)[1]]
        depth = np.ptp(echoes.range[strongest])
        found[k] = np.ptp(u[near]) >= reach and depth <= RING_DEPTH * view.range_cell
    return found
