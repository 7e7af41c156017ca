"""Rows of echoes along a line or an arc: where they break off."""

from __future__ import annotations

import numpy as np

from mirrorfold.common.types import Array, Index, Mask

GAP_CELLS = 3.0
"""A row of echoes ends at a gap of this many resolution cells: speckle fades over one or two."""


def heaviest_row(position: Array, cell: Array, weight: Array) -> Index:
    """The unbroken row with the most weight, of echoes at positions [m] along a line, each with its cell there [m]."""
    order = np.argsort(position)
    position, cell = position[order], cell[order]
    gap = np.diff(position) > GAP_CELLS * np.maximum(cell[:-1], cell[1:])
    row = np.concatenate([[0], np.cumsum(gap)])
    return order[row == np.argmax(np.bincount(row, weights=weight[order]))]


def longest_run(mask: Mask) -> slice | None:
    """The longest run of neighbouring places that a mask (n,) marks; None if it marks none."""
    edges = np.flatnonzero(np.diff(mask, prepend=False, append=False)).reshape(-1, 2)
    return slice(*edges[np.argmax(np.diff(edges))].tolist()) if len(edges) else None
