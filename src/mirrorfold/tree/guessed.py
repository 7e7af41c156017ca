"""In the mirror, or through it, where only one polarization was measured: a guess from geometry alone.

What stands behind a wall in the image may be folded, or stand there. Geometry tells only if the same thing is seen
otherwise, too: by way of other mirrors at one of both places, or directly where it would fold to. Then it stands there.
Two things tell nothing. That the radar sees nothing where it would fold to: things may turn a smooth face to the mirror
alone. That it goes on beside the end of the wall: from one end of the array to the other, the end of a mirror moves
before what it shows. All echoes of a thing are decided together, and a wall of which nothing is told stays a mirror.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.spatial import cKDTree

from mirrorfold.common.types import Array, Chain, Index, Mask
from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.mirror import Fold
from mirrorfold.detection.view import View
from mirrorfold.tree.assignment import Found
from mirrorfold.tree.mirror_tree import MirrorTree
from mirrorfold.tree.things import things
from mirrorfold.tree.transparent import BY_GEOMETRY, FEWEST, UNDECIDED, Again, Window, taken_out

GUESS = 0.8
"""Probability of what geometry tells. It is no more: two things may stand where a mirror would show one of them."""

SAME_PLACE = 1.5
"""Two echoes show the same place up to so many resolution cells."""


def guess_transparent(found: Found, view: View, every: Echoes, *, again: Again) -> Found:
    """Steps 2 to 4 once more without what, by geometry, passed through walls; the same as before where nothing did.

    Beside curved mirrors nothing is guessed: what they show is sorted by other means.

    Parameters
    ----------
    found : Found
        With all echoes taken for reflected ones.
    view : View
    every : Echoes
        All echoes of the view.
    again : callable
    """
    if any(node.line is not None and node.line.curved for node in found.tree.walk()):
        return found
    folds = found.tree.folds()
    windows = []
    for node in found.tree.mirrors:
        if node.line is None or not len(node.objects):
            continue
        passed = passage(found, view, node, folds)
        through = passed > UNDECIDED
        if through.any():
            seen = node.objects.take(through)
            place = seen.position
            tested = node.objects.position
            windows.append(Window(node.line, None, seen, place, passed[through], tested, passed, BY_GEOMETRY))
    return taken_out(found, windows, view, every, again)


def passage(found: Found, view: View, node: MirrorTree, folds: Mapping[Chain, Fold]) -> Array:
    """The probability of each echo behind a wall that it passed, (n,)."""
    echoes, chain = node.objects, node.chain
    folded = folds[chain](echoes.position)
    ways = {other.chain: folds[other.chain](other.objects.position) for other in found.tree.walk() if other is not node}
    # What stands behind the wall is shown there by no chain that begins with it.
    there = _shown(view, echoes.position, [ways[other] for other in ways if other and other[: len(chain)] != chain])
    mirrored = _shown(view, folded, list(ways.values()))
    thing = things(view, echoes.range, echoes.direction)
    # Seen at both places, a thing tells nothing.
    passed = _told(thing, there & ~mirrored, view, echoes)
    reflected = _told(thing, mirrored & ~there, view, echoes)
    return np.select([passed & ~reflected, reflected & ~passed], [GUESS, 1.0 - GUESS], UNDECIDED)


def _told(thing: Index, told: Mask, view: View, echoes: Echoes) -> Mask:
    """Echoes of things of which enough resolution cells are told of, (n,)."""
    pairs = np.unique(np.stack([thing, view.cell_numbers(echoes.position)])[:, told], axis=1)
    return np.asarray((np.bincount(pairs[0], minlength=int(thing.max(initial=0)) + 1) >= FEWEST)[thing])


def _shown(view: View, places: Array, seen: Sequence[Array]) -> Mask:
    """Which places (n, d) [m] are those of something that is seen, (m, d) [m] each."""
    elsewhere = np.concatenate([np.empty((0, view.dimensions)), *seen])
    if not len(elsewhere):
        return np.zeros(len(places), dtype=bool)
    cell = np.asarray(view.cell(np.linalg.norm(places - view.radar, axis=1)))
    return np.asarray(cKDTree(elsewhere).query(places)[0] < SAME_PLACE * cell)
