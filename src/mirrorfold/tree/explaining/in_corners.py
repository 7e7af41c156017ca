"""Echoes of what the legs of a corner reflect, beside and behind its vertex.

The legs of a corner are mirrors, as other walls are. Legs that are too short to be found as mirrors are opaque all the
same: what the image shows behind a leg stands elsewhere, on the side of the radar. The image of the leg itself may be
invisible, because the side lobes of the vertex outshine it.

Both legs together turn the scene by half a turn about the vertex. What is seen in a leg that was found, and stands on a
known wall after that turn, is seen in both legs.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

import numpy as np

from mirrorfold.common.types import Chain, Mask
from mirrorfold.detection import Echoes, ImageView, Mirror
from mirrorfold.tree.assignment import Found
from mirrorfold.tree.explaining.corners import BRIGHTER, Corners
from mirrorfold.tree.explaining.to_and_fro import bright_echoes
from mirrorfold.tree.ordering import vertices_of

IN_CORNER = "may be seen in a leg of a corner"

LEG_CELLS = 2.5
"""Distance from a vertex, in resolution cells across the line of sight, up to which its side lobes may hide a leg.
The side lobes of two arrays have fallen by 33 dB there, and a vertex is some 30 to 45 dB brighter than its legs. A
longer leg shows itself beside the lobes, and hides what is behind it as other objects do."""


def in_corners(found: Found, view: ImageView, corners: Corners) -> dict[Chain, Mask]:
    """Which object echoes of each chain of mirrors may be seen in the legs of corners, (n,) each.

    They are behind a vertex that is seen by way of the same mirrors, and no brighter than the vertex; or both legs show
    them of a wall. `corners` tells which places (n, 2) [m] of the image are vertices of right-angled corners, (n,).
    """
    marks = {
        node.chain: _behind_legs(node.objects, found.echoes.threshold, view, corners) for node in found.tree.walk()
    }
    for parent in found.tree.walk():
        walls = [node.way[-1] for node in parent.mirrors]
        for leg, node in zip(walls, parent.mirrors, strict=True):
            others = [wall for wall in (*walls, *parent.way[-1:]) if wall is not leg]
            marks[node.chain] |= _seen_in_both(node.objects, leg, others, cast(ImageView, found.sight.view))
    return marks


def _seen_in_both(objects: Echoes, leg: Mirror, walls: Sequence[Mirror], view: ImageView) -> Mask:
    """Which of the objects that are seen in the leg of a corner are those of walls, seen in both legs, (n,)."""
    both = np.zeros(len(objects), dtype=bool)
    for vertex in vertices_of(leg, view):
        for wall in walls:
            turned = 2.0 * vertex - objects.position
            both |= wall.holds(turned, view.extent(objects.position, wall.normal), 0.0)
    return both


def _behind_legs(objects: Echoes, threshold: float, view: ImageView, corners: Corners) -> Mask:
    """Which of the objects that are seen by way of the same mirrors are behind the legs of corners, (n,)."""
    peak = bright_echoes(objects, view)
    vertices = np.unique(peak[objects.amplitude[peak] >= BRIGHTER * threshold])
    behind = np.zeros(len(objects), dtype=bool)
    for vertex in vertices[corners(objects.position[vertices])] if len(vertices) else ():
        aside = np.abs(view.u[objects.direction] - view.u[objects.direction[vertex]])
        far = objects.range > objects.range[vertex] + view.object_depth(objects.range)
        behind |= far & (aside <= LEG_CELLS * view.u_cell) & (objects.amplitude <= objects.amplitude[vertex])
    return behind[peak]
