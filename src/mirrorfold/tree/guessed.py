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
from mirrorfold.detection.mirrors.mirror import Fold, Mirror
from mirrorfold.detection.views.view import View
from mirrorfold.tree.assignment import Found
from mirrorfold.tree.behind_walls import as_far_as_hidden, last_leg, met_by
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
    folds, ways = found.tree.folds(), as_far_as_hidden(found)
    windows = []
    for node in found.tree.mirrors:
        if node.line is None or not len(node.objects):
            continue
        passed = passage(found, view, node, folds, ways)
        through = passed > UNDECIDED
        if through.any():
            seen = node.objects.take(through)
            place = seen.position
            tested = node.objects.position
            windows.append(Window(node.line, None, seen, place, passed[through], tested, passed, BY_GEOMETRY))
    return taken_out(found, windows, view, every, again)


def passage(
    found: Found, view: View, node: MirrorTree, folds: Mapping[Chain, Fold], ways: Mapping[Chain, tuple[Mirror, ...]]
) -> Array:
    """The probability of each echo behind a wall that it passed, (n,)."""
    echoes, chain = node.objects, node.chain
    folded = folds[chain](echoes.position)
    others = [other for other in found.tree.walk() if other is not node]
    # What stands behind the wall is shown there by no chain that begins with it.
    around = [other for other in others if other.chain and other.chain[: len(chain)] != chain]
    there = _shown(view, echoes.position, [_seen_around(other, ways, ways[chain], view) for other in around])
    mirrored = _shown(view, folded, [folds[other.chain](other.objects.position) for other in others])
    thing = things(view, echoes.range, echoes.direction)
    # Seen at both places, a thing tells nothing.
    passed = _told(thing, there & ~mirrored, view, echoes)
    reflected = _told(thing, mirrored & ~there, view, echoes)
    return np.select([passed & ~reflected, reflected & ~passed], [GUESS, 1.0 - GUESS], UNDECIDED)


def _seen_around(
    node: MirrorTree, ways: Mapping[Chain, tuple[Mirror, ...]], wall: tuple[Mirror, ...], view: View
) -> Array:
    """Where objects of a node stand that are not seen in the direction of a wall, (n, d) [m].

    In every mirror that shows the wall, what it reflects stands behind it, too.
    """
    leaves, stands = last_leg(node.objects, ways[node.chain], view)
    return stands[~met_by([wall], leaves, stands, np.asarray(view.cell(node.objects.range)))]


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
