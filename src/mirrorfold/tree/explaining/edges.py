"""Echoes beside the end of a mirror that are what the mirror shows: a beam is wider than its line of sight.

Where the middle of a beam just misses the end of a mirror, half of the beam is still reflected: what the mirror shows
at its end appears up to a beam's width beyond the end, too, where it would pass for an object behind the mirror.
"""

from __future__ import annotations

import numpy as np

from mirrorfold.common.types import Index
from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.mirrors.mirror import fold_of
from mirrorfold.tree.grouping import STRONG_SHARE, object_numbers
from mirrorfold.tree.ordering import Order

BEHIND_CELLS = 1.5
"""What stands no more range cells behind a mirror may be the mirror itself."""


def beyond_ends(order: Order, echoes: Echoes, owner: Index) -> Index:
    """The mirror through which each echo is seen, corrected beside the ends of mirrors, (n,).

    An echo behind a mirror, less than a beam beside its end, is what the mirror shows, unless it belongs to an object
    that reaches farther away from that end, or would be folded to where the radar itself sees that nothing stands.

    Parameters
    ----------
    order : Order
    echoes : Echoes
    owner : (n,) array of int
        The mirror through which its line of sight shows each, `ROOT`, or `NOBODY` for echoes of no visible object.
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
            number = object_numbers(view, echoes.range[own], echoes.direction[own])
            reaches_on = np.bincount(number, weights=~beside) > 0.0
            moved = own[~reaches_on[number]]
            fold = fold_of(order.way(mirror), view.dimensions)
            owner[moved[~sight.contradicted(echoes.take(moved), fold)]] = mirror
    return owner
