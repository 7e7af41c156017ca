"""Unbroken rows of echoes along a line or an arc."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from mirrorfold.common.types import Array, Index, Mask

GAP_CELLS = 3.0
"""Largest gap in a row of echoes, in resolution cells: speckle fades over one or two."""


def heaviest_row(position: Array, cell: Array, weight: Array) -> Index:
    """Numbers of the echoes of the unbroken row that has the most weight.

    `position` (n,) [m] are the echoes' positions along a line, and `cell` (n,) [m] the extents of the resolution cell
    along it.
    """
    order = np.argsort(position)
    position, cell = position[order], cell[order]
    gap = np.diff(position) > GAP_CELLS * np.maximum(cell[:-1], cell[1:])
    row = np.concatenate([[0], np.cumsum(gap)])
    return order[row == np.argmax(np.bincount(row, weights=weight[order]))]


def longest_run(mask: Mask) -> slice | None:
    """The longest run of neighbouring True values in a mask (n,); None if there are none."""
    edges = np.flatnonzero(np.diff(mask, prepend=False, append=False)).reshape(-1, 2)
    return slice(*edges[np.argmax(np.diff(edges))].tolist()) if len(edges) else None


def without_gaps(mask: Mask, most: int) -> Mask:
    """A mask (n,) in which False values between two True ones are True, too, if they are at most `most` in a row."""
    filled = mask.copy()
    for before, behind in pairwise(np.flatnonzero(mask).tolist()):
        if behind - before - 1 <= most:
            filled[before:behind] = True
    return filled
