"""Echoes that walls and things of a whole tree, or far brighter ones, speak against, once it is found."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from mirrorfold.common.types import Chain, Names
from mirrorfold.detection.mirrors.mirror import Mirror
from mirrorfold.detection.views.view import View
from mirrorfold.tree.assignment import Found
from mirrorfold.tree.behind_things import BEHIND_A_THING, behind_things
from mirrorfold.tree.behind_walls import BEHIND, as_far_as_hidden, behind_rows, behind_walls, flat_things
from mirrorfold.tree.late_edges import late_edges
from mirrorfold.tree.mirror_tree import MirrorTree
from mirrorfold.tree.misplaced import LATE
from mirrorfold.tree.outshone import OUTSHONE, outshone
from mirrorfold.tree.to_and_fro import TO_AND_FRO, to_and_fro


def without_doubted(found: Found, view: View, bent: Sequence[Mirror] = ()) -> Found:
    """What was found, without objects that known walls and things speak against, or far brighter echoes.

    Those would stand behind them, went to and fro before walls, or are sent on too late by their edges; or they may be
    side lobes.

    Parameters
    ----------
    found : Found
    view : View
    bent : sequence of Mirror
        Curved rows of echoes of which nothing tells that they are mirrors.
    """
    ways, longer = found.tree.ways(), as_far_as_hidden(found) | flat_things(found)
    between = to_and_fro(found, view)
    told = (
        (LATE, lambda node: late_edges(node.objects, ways, view)),
        (BEHIND, lambda node: behind_walls(node.objects, node.chain, longer, view)),
        (BEHIND, lambda node: behind_rows(node.objects, () if node.chain else bent, found.sight)),
        (TO_AND_FRO, lambda node: between[node.chain]),
        (OUTSHONE, lambda node: outshone(node.objects, view)),
    )
    found = _without(found, {
        node.chain: np.select([tells(node) for _, tells in told], [reason for reason, _ in told], "")
        for node in found.tree.walk()
    })  # fmt: skip
    # Only what is left ends the view of other things.
    hidden = behind_things(found, view)
    return _without(found, {chain: np.where(marks, BEHIND_A_THING, "") for chain, marks in hidden.items()})


def _without(found: Found, reasons: Mapping[Chain, Names]) -> Found:
    """What was found, without the objects of each chain that there is a reason against, (n,); empty for the others."""
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
