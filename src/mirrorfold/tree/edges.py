"""Echoes beside the end of a mirror that the mirror shows: a beam is wider than the line that it is drawn as.

Where the middle of a beam just misses the end of a mirror, half of it is still reflected: what the mirror shows at its
end appears up to a beam's width beyond it, too, where it would pass for a thing that stands behind the mirror.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from mirrorfold.common.types import Index
from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.mirror import fold_of
from mirrorfold.detection.view import View
from mirrorfold.tree.ordering import Order

BEHIND_CELLS = 1.5
"""What stands no farther behind the mirror, in range cells, may be its own end."""

STRONG_SHARE = 0.75
"""Of the half-width of a beam: there a beam has fallen by some 30 dB, as much as bright echoes exceed the threshold."""


def beyond_ends(order: Order, echoes: Echoes, owner: Index) -> Index:
    """The mirror through which each echo is seen, corrected beside the ends of mirrors, (n,).

    An echo behind a mirror, less than a beam beside its end, is what the mirror shows, unless it belongs to something
    that reaches farther away from the mirror, or would stand where the radar itself sees that nothing stands.

    Parameters
    ----------
    order : Order
    echoes : Echoes
    owner : (n,) array of int
        The mirror that each is seen through by its line of sight, `ROOT`, or `NOBODY` for what is no object in view.
    """
    sight, view, owner = order.sight, order.sight.view, owner.copy()
    for side in view.beside(echoes.range, echoes.direction, STRONG_SHARE):
        shown = sight.seen_through(echoes.range, side)
        for mirror, parent in enumerate(sight.parent):
            behind = echoes.range > sight.crossing[mirror, side] + BEHIND_CELLS * view.range_cell
            own = np.flatnonzero(owner == parent)
            beside = ((shown == mirror) & behind)[own]
            if not beside.any():
                continue
            thing = _things(view, echoes.take(own))
            reaches_on = np.bincount(thing, weights=~beside) > 0.0
            moved = own[~reaches_on[thing]]
            fold = fold_of(order.way(mirror), view.dimensions)
            owner[moved[~sight.contradicted(echoes.take(moved), fold)]] = mirror
    return owner


def _things(view: View, echoes: Echoes) -> Index:
    """The number of the thing that each echo belongs to, (n,).

    Echoes of one thing follow each other within a beam, or from one line of sight to the next, and no deeper than an
    object is: from line to line, the range of a slanting surface changes by many range cells.
    """
    reach = np.rint(STRONG_SHARE * view.beside_steps(echoes.range))
    steps = np.unravel_index(echoes.direction, view.shape)
    places = np.column_stack([echoes.range / view.object_depth(echoes.range), *(axis / reach for axis in steps)])
    pairs = cKDTree(places).query_pairs(1.0, p=np.inf, output_type="ndarray")
    touching = coo_array((np.ones(len(pairs)), pairs.T), shape=(len(places), len(places)))
    return np.asarray(connected_components(touching, directed=False)[1])
