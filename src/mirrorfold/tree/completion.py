"""Mirrors that are found once the order is known: parts beyond the shadow of an object, and walls seen edge-on.

Only the order tells which parts of a wall objects hide, and which mirrors are in line of sight. With it, a mirror is
prolonged to where its row of echoes goes on behind a shadow or a faint gap, and two short rows on one line, seen by the
same way, are joined.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mirrorfold.common.types import ROOT, UNSEEN
from mirrorfold.detection import Echoes, ImageView, LineMirror, Mirror
from mirrorfold.detection.finding import find_mirrors
from mirrorfold.detection.search.coherent import trimmed
from mirrorfold.detection.search.edge_on import edge_on
from mirrorfold.detection.search.growing import lies_on
from mirrorfold.detection.search.lines import MINIMUM_CELLS, SHORT_CELLS
from mirrorfold.detection.search.shadows import beyond_shadows, joined
from mirrorfold.tree.ordering import Order


def completed(
    mirrors: Sequence[Mirror], order: Order, view: ImageView, echoes: Echoes, shortest: float
) -> list[Mirror]:
    """The mirrors, prolonged across shadows and faint gaps; and new ones: rows joined to one, and walls seen edge-on.

    Only straight mirrors are prolonged. `shortest` [m] is the least length of a mirror.
    """
    clear = order.cover.clear
    loose = echoes.take(order.face == ROOT)  # no mirror is prolonged along the echoes of another one
    lines = [mirror for mirror in mirrors if isinstance(mirror, LineMirror)]
    known = [mirror for mirror in order.mirrors if isinstance(mirror, LineMirror)]
    through = order.through(loose)
    longer = []
    for mirror in lines:
        # The image of a wall behind a mirror ends where that mirror ends: what goes on beside it is of another wall.
        pieces = [lies_on(piece, mirror, view) for piece in order.mirrors]
        same = np.isin(through, order.parent[np.flatnonzero(pieces)])
        longer.append(trimmed(beyond_shadows(mirror, view, loose.take(same), clear, known), view))
    arcs = [mirror for mirror in mirrors if not isinstance(mirror, LineMirror)]

    whole, images = list[LineMirror](), list[LineMirror]()
    for way in np.unique(through[through != UNSEEN]):
        seen = loose.take(through == way)
        rows = [row for row in find_mirrors(view, seen, minimum_length=0.5 * shortest) if isinstance(row, LineMirror)]
        halves = [row for row in rows if not any(lies_on(row, mirror, view) for mirror in longer)]
        whole += [trimmed(row, view) for row in joined(halves, view, seen, clear, shortest)]
        if way == ROOT:
            images = [row for row in halves if row.length >= SHORT_CELLS / MINIMUM_CELLS * shortest]
    direct = [mirror for mirror, before in zip(order.mirrors, order.parent, strict=True) if before == ROOT]
    sighted = [mirror for mirror in direct if isinstance(mirror, LineMirror)]
    return [*longer, *arcs, *whole, *edge_on(sighted, images, view, echoes, shortest)]
