"""Echoes that went one way straight from a rough wall to an object, and the other way by mirrors.

Let a mirror B be seen in a mirror A, and show a bright object. A may also face the object itself. If A is rough, it
scatters some of the wave straight to the object, which sends it back by way of both mirrors; and some of the wave takes
the same path in the opposite direction. The echo leaves and arrives in the direction of the object's image, so that the
test by directions does not detect it. But its range is the mean of both ways, and less than that of the image.
"""

from __future__ import annotations

import numpy as np

from mirrorfold.common.decibels import ratio_of
from mirrorfold.common.types import ROOT, Array, Mask
from mirrorfold.detection import Echoes, ImageView, any_curved
from mirrorfold.tree.explaining.true_walls import EXPECTED_CELLS
from mirrorfold.tree.ordering import Order

SHORT_CUT = "took a short cut by a rough wall one way, and came by mirrors the other"

WEAKER_DB = -6.0
"""Largest level of such an echo over that of the object's image: what a rough wall scatters is weaker than what it
reflects, but the short cut is taken in both directions, which doubles the echo."""

ACROSS_CELLS = 1.5
"""Largest distance of the echo aside of the object, in resolution cells: both beams must meet the object."""

FROM_IMAGE_CELLS = 2.0
"""Least distance of the echo from the object's image, in range cells: nearer echoes may be a part of the image."""


def short_cuts(order: Order, echoes: Echoes) -> Mask:
    """Which echoes stand where brighter objects would appear by a short cut, (n,); in a volume none.

    The `order` of the mirrors is that of the same echoes. Hidden ones are among them: a bright object may be hidden by
    its own echo by the short cut.
    """
    found, view = np.zeros(len(echoes), dtype=bool), order.view
    if not isinstance(view, ImageView):
        return found
    through = order.through(echoes)
    objects = np.flatnonzero(echoes.strong & (order.face < 0) & (through >= 0))
    objects = objects[view.brightest(echoes.position[objects], echoes.amplitude[objects])]
    for last in np.unique(through[objects]):
        if any_curved(order.way(int(last))):
            continue
        bright = echoes.take(objects[through[objects] == last])
        places = order.fold(int(last))(bright.position)
        rough = int(order.parent[last])
        while rough >= 0:
            before = order.fold(int(order.parent[rough]))
            crossing = order.crossing[rough, echoes.direction]
            met = before(view.points(np.where(np.isfinite(crossing), crossing, np.nan), echoes.direction))
            asked = np.flatnonzero((order.face == ROOT) & ~found & (echoes.range > crossing))
            found[asked] = _made_by(met[asked], crossing[asked], view, echoes.take(asked), bright, places)
            rough = int(order.parent[rough])
    return found


def _made_by(met: Array, crossing: Array, view: ImageView, echoes: Echoes, bright: Echoes, places: Array) -> Mask:
    """Which echoes a rough wall makes, by a short cut, of `bright` ones with true places `places` (m, 2) [m], (n,).

    Lines of sight meet the wall at true places `met` (n, 2) [m], and in the image at ranges `crossing` (n,) [m].
    """
    short = crossing[:, None] + np.linalg.norm(met[:, None] - places, axis=2)
    with np.errstate(invalid="ignore"):
        made = np.abs(echoes.range[:, None] - 0.5 * (short + bright.range)) <= EXPECTED_CELLS * view.range_cell
    made &= np.abs(view.u[echoes.direction][:, None] - view.u[bright.direction]) <= ACROSS_CELLS * view.u_cell
    made &= np.abs(echoes.range[:, None] - bright.range) >= FROM_IMAGE_CELLS * view.range_cell
    made &= echoes.amplitude[:, None] <= ratio_of(WEAKER_DB) * bright.amplitude
    return made.any(axis=1)
