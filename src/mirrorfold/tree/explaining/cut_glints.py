"""Rows of echoes that are side lobes of a glint which only a part of the antennas sees, where no wall stands.

A smooth wall that faces the radar shows a glint there. If a mirror shows that wall, and ends beside the glint, only
some of the antennas see it. Its side lobes then fall slowly, as those of an aperture that is cut off, and fill the
range of the glint far beyond the mirror's end. They make a row at one range, which passes for a wall that faces the
radar. But on such a wall would stand the glint itself, and on this row it does not.
"""

from __future__ import annotations

import numpy as np

from mirrorfold.common.types import Mask
from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.mirrors.line_mirror import LineMirror
from mirrorfold.detection.views.image_view import ImageView
from mirrorfold.tree.lines_of_sight import ROOT
from mirrorfold.tree.ordering import Order

SAME_RANGE = 0.5
"""Range cells over which such a row may reach, and its echoes may stray: all stand at the range of the glint."""

BESIDE_CELLS = 1.5
"""The main lobe of what stands at the end of a row reaches so many cells beyond it."""

BRIGHTER_DB = 10.0
"""The glint is so much brighter than the brightest echo of the row. It is 20 to 35 dB brighter than what a smooth wall
scatters; of a hundred speckles of a rough wall, which has no glint, the brightest exceeds the median by 8 dB."""

PLACES = 9
"""Places along a row at which its range is looked at."""


def cut_glints(order: Order, echoes: Echoes) -> Mask:
    """Which echoes are side lobes of such a glint, (n,): those of rows that pass for walls, and others at their range
    that are no brighter.

    Parameters
    ----------
    order : Order
        Of the mirrors, with the `face` of the same echoes.
    echoes : Echoes
    """
    view, found = order.sight.view, np.zeros(len(echoes), dtype=bool)
    if not isinstance(view, ImageView):
        return found
    for number, mirror in enumerate(order.mirrors):
        along = mirror.along(echoes.position) if isinstance(mirror, LineMirror) else np.zeros(0)
        own = order.face == number
        if not isinstance(mirror, LineMirror) or not own.any():
            continue
        range_, u = view.to_polar(mirror.start + np.linspace(0.0, 1.0, PLACES)[:, None] * (mirror.end - mirror.start))
        foot = float(mirror.along(view.radar))
        if not np.ptp(range_) <= SAME_RANGE * view.range_cell or not 0.0 <= foot <= mirror.length:
            continue
        on_it = own & (along >= 0.0) & (along <= mirror.length)
        brightest = echoes.amplitude[on_it].max(initial=0.0)
        rows = np.abs(view.range - np.median(range_)) <= SAME_RANGE * view.range_cell
        beyond = np.abs(view.u - 0.5 * (u[0] + u[-1])) > 0.5 * np.abs(u[-1] - u[0]) + BESIDE_CELLS * view.u_cell
        if view.amplitude[np.ix_(rows, beyond)].max(initial=0.0) >= brightest * 10.0 ** (BRIGHTER_DB / 20.0) > 0.0:
            ring = np.abs(echoes.range - np.median(range_)) <= SAME_RANGE * view.range_cell
            found |= own | (ring & (order.face == ROOT) & (echoes.amplitude <= brightest))
    return found
