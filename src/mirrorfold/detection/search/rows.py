"""Unbroken rows of echoes along a line or an arc."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import binary_closing

from mirrorfold.common.kernels import njit
from mirrorfold.common.types import Array, Index, Mask

HARDLY = 1e-6
"""Weight of echoes outside of a known row: the heaviest row is then the known one, not another one on the same line,
and still goes on along them."""

GAP_CELLS = 3.0
"""Largest gap in a row of echoes, in resolution cells: speckle fades over one or two."""


def heaviest_row(position: Array, cell: Array, weight: Array) -> Index:
    """Numbers of the echoes of the unbroken row that has the most `weight` (n,), in the order of their positions.

    `position` (n,) [m] are the echoes' positions along a line, and `cell` (n,) [m] the extents of the resolution cell
    along it.
    """
    order = np.argsort(position)
    first, end, _ = heaviest_run(position[order], cell[order], weight[order])
    return order[first:end]


@njit(nogil=True, error_model="numpy")
def heaviest_run(position, cell, weight):  # type: ignore[no-untyped-def]
    """`heaviest_row` of echoes by rising `position` (n,) [m]: its first echo, the one after its last, its weight."""
    start, first, end, heaviest, total = 0, 0, 0, 0.0, 0.0
    for k in range(position.size):
        if k and position[k] - position[k - 1] > GAP_CELLS * max(cell[k - 1], cell[k]):
            start, total = k, 0.0
        total += weight[k]
        if total > heaviest or start == first:
            first, end, heaviest = start, k + 1, total
    return first, end, heaviest


def longest_run(mask: Mask) -> slice | None:
    """The longest run of neighbouring True values in a mask (n,); None if there are none."""
    edges = np.flatnonzero(np.diff(mask, prepend=False, append=False)).reshape(-1, 2)
    return slice(*edges[np.argmax(np.diff(edges))].tolist()) if len(edges) else None


def without_gaps(mask: Mask, most: int) -> Mask:
    """A mask (n,) in which False values between two True ones are True, too, if they are at most `most` in a row."""
    pad = most + 1  # beyond its ends, a mask is False
    return np.asarray(binary_closing(np.pad(mask, pad), np.ones(pad))[pad:-pad])
