"""Echoes that went one way by a rough wall's short cut and the other way by mirrors, where nothing stands.

Where one mirror is seen in another, and shows a bright object, the first mirror may face that object itself. If it is
rough, it scatters some of the wave straight to the object, which sends it back by way of both mirrors, and some takes
the same path the other way round. The echo leaves and arrives in the direction of the object, so that no test by
directions tells it; but its range is the mean of both ways, and short of the object's image.
"""

from __future__ import annotations

import numpy as np

from mirrorfold.common.types import Array, Mask
from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.mirrors.mirror import fold_of
from mirrorfold.detection.views.image_view import ImageView
from mirrorfold.tree.explaining.true_walls import EXPECTED_CELLS
from mirrorfold.tree.lines_of_sight import ROOT
from mirrorfold.tree.ordering import Order

SHORT_CUT = "took a short cut by a rough wall one way, and came by mirrors the other"

WEAKER_DB = -6.0
"""Such an echo is so much weaker, at least, than the object that mirrors show: what a rough wall scatters is weaker,
but the short cut is taken both ways round, which doubles the echo."""

ACROSS_CELLS = 1.5
"""How far aside of the object, in resolution cells, the echo may be: both beams must meet the object."""

APART_CELLS = 2.0
"""What is fewer range cells away from the object's image may be a part of it."""


def short_cuts(order: Order, echoes: Echoes) -> Mask:
    """Which echoes stand where brighter ones would be seen by a short cut, (n,); in a volume none.

    Parameters
    ----------
    order : Order
        Of the mirrors, with the `face` of the same echoes.
    echoes : Echoes
        Hidden ones, too: the bright object may be hidden by the very echo that is made of it.
    """
    found, sight, view = np.zeros(len(echoes), dtype=bool), order.sight, order.sight.view
    if not isinstance(view, ImageView):
        return found
    through = sight.seen_through(echoes.range, echoes.direction)
    objects = np.flatnonzero(echoes.strong & (order.face < 0) & (through >= 0))
    objects = objects[view.brightest(echoes.position[objects], echoes.amplitude[objects])]
    for last in np.unique(through[objects]):
        way = order.way(int(last))
        if any(mirror.curved for mirror in way):
            continue
        bright = echoes.take(objects[through[objects] == last])
        places = fold_of(way, view.dimensions)(bright.position)
        rough = int(sight.parent[last])
        while rough >= 0:
            before = fold_of(order.way(int(sight.parent[rough])), view.dimensions)
            crossing = sight.crossing[rough, echoes.direction]
            met = before(view.points(np.where(np.isfinite(crossing), crossing, np.nan), echoes.direction))
            found |= (echoes.range > crossing) & _by(met, crossing, view, echoes, bright, places)
            rough = int(sight.parent[rough])
    return found & (order.face == ROOT)


def _by(met: Array, crossing: Array, view: ImageView, echoes: Echoes, bright: Echoes, places: Array) -> Mask:
    """Which echoes a rough wall makes of `bright` ones, which truly stand at `places` (m, 2) [m], (n,).

    Lines of sight truly meet the wall at `met` (n, 2) [m], in the image at ranges `crossing` (n,) [m].
    """
    short = crossing[:, None] + np.linalg.norm(met[:, None] - places, axis=2)
    with np.errstate(invalid="ignore"):
        made = np.abs(echoes.range[:, None] - 0.5 * (short + bright.range)) <= EXPECTED_CELLS * view.range_cell
    made &= np.abs(view.u[echoes.direction][:, None] - view.u[bright.direction]) <= ACROSS_CELLS * view.u_cell
    made &= np.abs(echoes.range[:, None] - bright.range) >= APART_CELLS * view.range_cell
    made &= echoes.amplitude[:, None] <= 10.0 ** (WEAKER_DB / 20.0) * bright.amplitude
    return np.asarray(made.any(axis=1))
