"""Echoes that the walls of a whole tree speak against, once it is found."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mirrorfold.common.types import Names
from mirrorfold.detection.view import View
from mirrorfold.tree.assignment import Found
from mirrorfold.tree.behind_walls import BEHIND, as_far_as_hidden, behind_walls, flat_things
from mirrorfold.tree.late_edges import late_edges
from mirrorfold.tree.mirror_tree import MirrorTree
from mirrorfold.tree.misplaced import LATE


def without_doubted(found: Found, view: View) -> Found:
    """What was found, without objects that would stand behind known walls, or that edges of these send on too late.

    Parameters
    ----------
    found : Found
    view : View
    """
    ways, longer = found.tree.ways(), as_far_as_hidden(found) | flat_things(found)

    def why(node: MirrorTree) -> Names:
        """What speaks against each of the objects of a node, (n,); empty for those that stay."""
        late, behind = late_edges(node.objects, ways, view), behind_walls(node.objects, node.chain, longer, view)
        return np.select([late, behind], [LATE, BEHIND], "")

    reasons = {node.chain: why(node) for node in found.tree.walk()}
    if not any((reason != "").any() for reason in reasons.values()):
        return found

    def kept(node: MirrorTree) -> MirrorTree:
        objects = node.objects.take(reasons[node.chain] == "")
        return replace(node, objects=objects, mirrors=tuple(map(kept, node.mirrors)))

    gone = [(node.objects.take(doubt != ""), doubt[doubt != ""]) for node in found.tree.walk()
            for doubt in [reasons[node.chain]]]  # fmt: skip
    elsewhere = found.elsewhere.joined(*(echoes for echoes, _ in gone))
    explanation = np.concatenate([found.explanation, *(doubt for _, doubt in gone)])
    return found._replace(tree=kept(found.tree), elsewhere=elsewhere, explanation=explanation)
