"""Echoes beside the end of a mirror that the mirror shows: a beam is wider than the line that it is drawn as.

Where the middle of a beam just misses the end of a mirror, half of it is still reflected: what the mirror shows at its
end appears up to a beam's width beyond it, too, where it would pass for a thing that stands behind the mirror.
"""

from __future__ import annotations

import numpy as np

from mirrorfold.common.types import Index
from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.mirrors.mirror import fold_of
from mirrorfold.tree.ordering import Order
from mirrorfold.tree.things import STRONG_SHARE, things

BEHIND_CELLS = 1.5
"""What stands no farther behind the mirror, in range cells, may be its own end."""


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
            thing = things(view, echoes.range[own], echoes.direction[own])
            reaches_on = np.bincount(thing, weights=~beside) > 0.0
            moved = own[~reaches_on[thing]]
            fold = fold_of(order.way(mirror), view.dimensions)
            owner[moved[~sight.contradicted(echoes.take(moved), fold)]] = mirror
    return owner
