"""Objects that are left out once the whole tree is known, because the tree holds another cause of their echoes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from mirrorfold.common.types import Chain, Mask
from mirrorfold.detection import ImageView, Mirror, View
from mirrorfold.tree.assignment import Found
from mirrorfold.tree.explaining.behind_objects import BEHIND_AN_OBJECT, behind_objects
from mirrorfold.tree.explaining.behind_walls import (
    BEHIND,
    behind_rows,
    behind_walls,
    flat_objects,
    prolonged_where_hidden,
)
from mirrorfold.tree.explaining.corners import Corners
from mirrorfold.tree.explaining.flanks import ASIDE_CELLS, flanks
from mirrorfold.tree.explaining.in_corners import IN_CORNER, in_corners
from mirrorfold.tree.explaining.outshone import OUTSHONE, outshone
from mirrorfold.tree.explaining.reflected_on import REFLECTED_ON, reflected_on
from mirrorfold.tree.explaining.to_and_fro import TO_AND_FRO, to_and_fro
from mirrorfold.tree.mirror_tree import MirrorTree


def without_explained(
    found: Found, view: View, rejected: Sequence[Mirror] = (), corners: Corners | None = None
) -> Found:
    """What was found, without the object echoes that the tree gives another cause.

    The causes are those that the package lists under "With the whole tree". Curved rows of echoes in `rejected` were
    not proved to be mirrors; `corners` tells which places (n, 2) [m] of the image are vertices of corners, (n,).
    """
    nodes, rows = list(found.tree.walk()), flat_objects(found, view) if isinstance(view, ImageView) else {}
    walls = prolonged_where_hidden(found) | rows
    behind = {node.chain: behind_walls(node.objects, node.chain, walls, view) for node in nodes}
    if not isinstance(view, ImageView):  # in a volume, only walls are known to hide what is behind them
        return _without(found, {BEHIND: behind})
    behind[()] |= behind_rows(found.tree.objects, rejected, found.sight, view)
    found = _without(found, {
        BEHIND: behind,
        TO_AND_FRO: to_and_fro(found, view),
        REFLECTED_ON: reflected_on(found, view, found.tree.mirrors_by_chain() | rows),
        OUTSHONE: {node.chain: outshone(node.objects, view) for node in nodes},
    })  # fmt: skip
    if corners is not None:
        found = _without(found, {IN_CORNER: in_corners(found, view, corners)})
    flank = {node.chain: flanks(node.objects, found, view) for node in found.tree.walk()}
    found = _without(found, {why: {chain: names == why for chain, names in flank.items()} for why in ASIDE_CELLS})
    # Only objects that are kept hide others.
    return _without(found, {BEHIND_AN_OBJECT: behind_objects(found, view)})


def _without(found: Found, marks: Mapping[str, Mapping[Chain, Mask]]) -> Found:
    """What was found, without the objects of each chain that a cause marks, (n,); the first of several counts."""
    nodes, causes = list(found.tree.walk()), list(marks)
    why = {node.chain: np.select([marks[cause][node.chain] for cause in causes], causes, "") for node in nodes}
    gone = [(node.objects.take(why[node.chain] != ""), why[node.chain]) for node in nodes]
    if not any(len(echoes) for echoes, _ in gone):
        return found

    def kept(node: MirrorTree) -> MirrorTree:
        objects = node.objects.take(why[node.chain] == "")
        return replace(node, objects=objects, mirrors=tuple(map(kept, node.mirrors)))

    explained = found.explained.joined(*(echoes for echoes, _ in gone))
    explanation = np.concatenate([found.explanation, *(reason[reason != ""] for _, reason in gone)])
    return found._replace(tree=kept(found.tree), explained=explained, explanation=explanation)
