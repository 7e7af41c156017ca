"""Echoes beside the end of a mirror that are seen on the other side of that end, because a beam has a width.

Where the middle of a beam just misses the end of a mirror, half of the beam is still reflected. So an object that the
mirror shows at its end also appears up to a beam's width beyond the end, where it would pass for an object behind the
mirror. In the same way, an object behind the mirror and beside its end also appears up to a beam's width before the
end, where it would pass for an object that the mirror shows.
"""

from __future__ import annotations

import numpy as np

from mirrorfold.common.decibels import ratio_of
from mirrorfold.common.types import ROOT, UNSEEN, Index, Mask
from mirrorfold.detection import Echoes, Mirror, View
from mirrorfold.detection.echoes import brightest_of
from mirrorfold.tree.grouping import STRONG_SHARE, object_numbers
from mirrorfold.tree.ordering import Order

BEHIND_CELLS = 1.5
"""Echoes at most this many range cells behind a mirror may be of the mirror itself."""

FALLEN = ratio_of(-15.0)
"""Amplitude, relative to the middle of a beam, to which a beam has fallen where echoes count as beside its object."""


def beyond_ends(order: Order, echoes: Echoes, owner: Index) -> Index:
    """Number of the mirror through which each echo is seen, corrected beside the ends of mirrors, (n,).

    `owner` (n,) is that number by the echo's line of sight: `ROOT` if direct, `UNSEEN` for echoes that are not of a
    visible object. An echo behind a mirror and less than a beam beside its end is assigned to the mirror, unless it
    belongs to an object that reaches farther away from that end, or would fold to where the direct view is empty.
    """
    view, owner = order.view, owner.copy()
    for side in view.beside(echoes.range, echoes.direction, STRONG_SHARE):
        shown = order.seen_through(echoes.range, side)
        for mirror, parent in enumerate(order.parent):
            behind = echoes.range > order.crossing[mirror, side] + BEHIND_CELLS * view.range_cell
            beside = (owner == parent) & (shown == mirror) & behind
            if not beside.any():
                continue
            others = np.flatnonzero((owner != mirror) & (owner != UNSEEN))
            number = object_numbers(view, echoes.take(others))
            reaches_on = np.bincount(number, weights=~beside[others]) > 0.0
            moved = others[~reaches_on[number]]
            owner[moved[~order.contradicted(echoes.take(moved), order.fold(mirror))]] = mirror
    return owner


def before_ends(order: Order, echoes: Echoes, owner: Index) -> Index:
    """As `beyond_ends`, for echoes that are seen by way of a mirror, less than a beam before its end, (n,).

    Such an echo is assigned to the way by which the radar sees beside that end, if it is the foot of an object there:

    * the object is brighter beyond the end than before it;
    * a beam or more before the end, it has no echo above `FALLEN` of its brightest one beyond the end; or the mirror is
      convex: what it shows fades towards its edge, and stands at other ranges than what is seen past the edge;
    * at the echo's own range, it touches a brighter echo beyond the end.

    The object beyond the end may also be a wall, whose row seems to go on before it.
    """
    view, corrected = order.view, owner.copy()
    if not order.mirrors:
        return corrected
    through, of_wall = order.through(echoes), order.shown_by(echoes)
    of_wall[~(echoes.visible & echoes.strong) | (order.face < 0)] = UNSEEN
    sides = view.beside(echoes.range, echoes.direction, STRONG_SHARE)
    beside_in = np.array([order.seen_through(echoes.range, side) for side in sides])
    for side, shown in zip(sides, beside_in, strict=True):
        # What stands a little behind a wall beside the end is of that wall. `ROOT` and `UNSEEN` are their own parents.
        depth = echoes.range - order.crossing[shown, side]
        at_wall = (shown != through) & (depth <= BEHIND_CELLS * view.range_cell)
        shown = np.where(at_wall, order.parent_of[shown], shown)
        for mirror, parent in enumerate(order.parent):
            here = (owner == mirror) & (through == mirror)
            near = (beside_in == mirror).any(axis=0)
            for other in np.unique(shown[here & (shown != mirror) & (shown != UNSEEN)]):
                # The mirror does not end there if another one begins that it shows. And a curved one shows nothing
                # beyond its own end.
                if other not in (ROOT, parent) and (order.parent[other] == mirror or order.mirrors[other].curvature):
                    continue
                wall = near & (of_wall == other) & (order.face != mirror)
                own = np.flatnonzero((owner == other) | here | wall)
                foot = _foot(view, echoes.take(own), owner[own] == mirror, shown[own] == other, order.mirrors[mirror])
                corrected[own[foot]] = other
    return corrected


def _foot(view: View, echoes: Echoes, before: Mask, beside: Mask, mirror: Mirror) -> Mask:
    """Which of the echoes `before` the end of a mirror, (n,), are the foot of an object beyond it, see `before_ends`.

    Those `beside` the end, (n,), are less than a beam away from it.
    """
    amplitude = echoes.amplitude
    number, level = object_numbers(view, echoes), object_numbers(view, echoes, depth=BEHIND_CELLS * view.range_cell)
    inside, beyond, far = (brightest_of(number, np.where(some, amplitude, 0.0))
                           for some in (before, ~before, before & ~beside))  # fmt: skip
    foot = before & ((beyond > inside) & ((far <= FALLEN * beyond) | (mirror.curvature > 0.0)))[number]
    outshone = brightest_of(level, np.where(before, 0.0, amplitude))[level] > amplitude
    return foot & outshone
