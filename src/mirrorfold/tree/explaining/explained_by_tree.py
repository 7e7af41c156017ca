"""Objects that are left out once the whole tree is known, because the tree holds another cause of their echoes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from mirrorfold.common.types import Chain, Names
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
from mirrorfold.tree.explaining.flanks import flanks
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
    longer = prolonged_where_hidden(found)
    if not isinstance(view, ImageView):  # in a volume, only walls are known to hide what is behind them
        marks = {node.chain: behind_walls(node.objects, node.chain, longer, view) for node in found.tree.walk()}
        return _without(found, {chain: np.where(hidden, BEHIND, "") for chain, hidden in marks.items()})
    rows = flat_objects(found, view)
    reflected = reflected_on(found, view, found.tree.mirrors_by_chain() | rows)
    longer, turned_back = longer | rows, to_and_fro(found, view)
    causes = (
        (BEHIND, lambda node: behind_walls(node.objects, node.chain, longer, view)),
        (BEHIND, lambda node: behind_rows(node.objects, () if node.chain else rejected, found.sight)),
        (TO_AND_FRO, lambda node: turned_back[node.chain]),
        (REFLECTED_ON, lambda node: reflected[node.chain]),
        (OUTSHONE, lambda node: outshone(node.objects, view)),
    )
    found = _without(found, {
        node.chain: np.select([cause(node) for _, cause in causes], [reason for reason, _ in causes], "")
        for node in found.tree.walk()
    })  # fmt: skip
    if corners is not None:
        marks = in_corners(found, view, corners)
        found = _without(found, {chain: np.where(seen, IN_CORNER, "") for chain, seen in marks.items()})
    found = _without(found, {node.chain: flanks(node.objects, found, view) for node in found.tree.walk()})
    # Only objects that are kept hide others.
    marks = behind_objects(found, view)
    return _without(found, {chain: np.where(hidden, BEHIND_AN_OBJECT, "") for chain, hidden in marks.items()})


def _without(found: Found, reasons: Mapping[Chain, Names]) -> Found:
    """What was found, without the objects of each chain that have a reason to be left out, (n,); "" means none."""
    if not any((reason != "").any() for reason in reasons.values()):
        return found

    def kept(node: MirrorTree) -> MirrorTree:
        objects = node.objects.take(reasons[node.chain] == "")
        return replace(node, objects=objects, mirrors=tuple(map(kept, node.mirrors)))

    gone = [(node.objects.take(doubt != ""), doubt[doubt != ""]) for node in found.tree.walk()
            for doubt in [reasons[node.chain]]]  # fmt: skip
    explained = found.explained.joined(*(echoes for echoes, _ in gone))
    explanation = np.concatenate([found.explanation, *(doubt for _, doubt in gone)])
    return found._replace(tree=kept(found.tree), explained=explained, explanation=explanation)
