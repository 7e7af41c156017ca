"""Which echoes belong together, as those of one object."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from mirrorfold.common.types import Array, Index
from mirrorfold.detection.views.view import View

STRONG_SHARE = 0.75
"""Of the half-width of a beam: there a beam has fallen by some 30 dB, as much as bright echoes exceed the threshold."""


def object_numbers(view: View, range_: Array, direction: Index) -> Index:
    """The number of the object that each echo belongs to, (n,), by their ranges [m] and directions.

    Echoes of one object follow each other within a beam, or from one line of sight to the next, and no deeper than an
    object is: from line to line, the range of a slanting surface changes by many range cells.
    """
    reach = np.rint(STRONG_SHARE * view.beside_steps(range_))
    steps = np.unravel_index(direction, view.shape)
    places = np.column_stack([range_ / view.object_depth(range_), *(axis / reach for axis in steps)])
    pairs = cKDTree(places).query_pairs(1.0, p=np.inf, output_type="ndarray")
    return connected(pairs, len(places))


def connected(pairs: Index, count: int) -> Index:
    """The number of the group that each of so many echoes belongs to, (count,), where those of pairs (n, 2) touch."""
    touching = coo_array((np.ones(len(pairs)), pairs.T), shape=(count, count))
    return np.asarray(connected_components(touching, directed=False)[1])
