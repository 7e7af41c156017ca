"""Groups of echoes that belong to one object."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from mirrorfold.common.types import Index
from mirrorfold.detection import Echoes, View

STRONG_SHARE = 0.75
"""Share of the half-width of a beam up to which echoes are of one object. That far aside the beam of an array has
fallen by some 30 dB, which is as much as bright echoes exceed the threshold."""


def object_numbers(view: View, echoes: Echoes, depth: float | None = None) -> Index:
    """Number of the object that each of the echoes belongs to, (n,).

    Two echoes touch if they differ in direction by at most `STRONG_SHARE` of a beam's half-width, and in range by at
    most `depth` [m]. By default this is the depth of an object, `View.object_depth`: from one line of sight to the
    next, the range of a slanting surface changes by many range cells. Echoes that touch, directly or by way of others,
    are of one object.
    """
    reach = np.rint(STRONG_SHARE * view.beside_steps(echoes.range))
    steps = np.unravel_index(echoes.direction, view.shape)
    deep = view.object_depth(echoes.range) if depth is None else depth
    places = np.column_stack([echoes.range / deep, *(axis / reach for axis in steps)])
    pairs = cKDTree(places).query_pairs(1.0, p=np.inf, output_type="ndarray")
    return connected(pairs, len(places))


def connected(pairs: Index, count: int) -> Index:
    """Number of the group that each of `count` echoes belongs to, (count,); `pairs` (n, 2) are those that touch."""
    touching = coo_array((np.ones(len(pairs)), pairs.T), shape=(count, count))
    return connected_components(touching, directed=False)[1]
