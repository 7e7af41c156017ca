"""Echoes that a rough wall makes of another wall, where no mirror image of anything is.

A wall that is not quite smooth scatters a little of the wave from each of its places, also square towards another wall
before it. That one sends it straight back, and the same place scatters it once more. By the place of the rough wall at
range r0, which is d away from the other wall, the echo stands at r0 + d: nearer than the mirror image of that other
wall, which the same line of sight meets askew, and like a thing that is hidden between the two.
"""

from __future__ import annotations

import numpy as np

from mirrorfold.common.geometry import segment_normal, signed_distance, unit
from mirrorfold.common.types import Mask
from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.image_view import ImageView
from mirrorfold.detection.mirror import fold_of
from mirrorfold.tree.lines_of_sight import NOBODY, ROOT
from mirrorfold.tree.ordering import Order

SCATTERED = "was scattered by a rough wall towards another wall and back"

CELLS = 0.75
"""What stands at most so many range cells off was scattered so: it is seen half a cell off, and walls are, too."""

BRIGHT = 0.9
"""What is scattered twice is weaker than what the same wall scatters once: than this quantile of the echoes of its
face, of which a few may be glints."""


def scattered(order: Order, echoes: Echoes) -> Mask:
    """Which echoes behind mirrors may be what these scatter towards other walls and back, (n,); in a volume none.

    Those that would pass for a wall of their own, too.

    Parameters
    ----------
    order : Order
        Of the mirrors, with the `face` of the same echoes.
    echoes : Echoes
    """
    found, sight, view = np.zeros(len(echoes), dtype=bool), order.sight, order.sight.view
    if not isinstance(view, ImageView):
        return found
    parent = np.append(sight.parent, [NOBODY, ROOT])
    through = sight.seen_through(echoes.range, echoes.direction)
    through = np.where(order.face == ROOT, through, parent[order.face])
    before = [fold_of(order.way(int(parent)), view.dimensions) for parent in sight.parent]
    walls = [fold(mirror.ends) for mirror, fold in zip(order.mirrors, before, strict=True)]
    for rough, fold in enumerate(before):
        face = echoes.amplitude[echoes.visible & (order.face == rough)]
        if not face.size or order.mirrors[rough].curved:
            continue
        begin = sight.crossing[rough, echoes.direction]
        own = echoes.visible & (through == rough) & np.isfinite(begin)
        own = np.flatnonzero(own & (echoes.amplitude <= np.quantile(face, BRIGHT)))
        begin = begin[own]
        place = fold(view.points(begin, echoes.direction[own]))
        for other, (start, end) in enumerate(walls):
            if other != rough and not order.mirrors[other].curved:
                distance = np.abs(signed_distance(place, start, segment_normal(start, end)))
                near = np.abs(begin + distance - echoes.range[own]) <= CELLS * view.range_cell
                beside = np.abs((place - 0.5 * (start + end)) @ unit(end - start))
                near &= beside <= 0.5 * order.mirrors[other].size + view.cell(echoes.range[own])
                found[own[near & (order.face[own] != other)]] = True
    return found
