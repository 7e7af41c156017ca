"""In the mirror, or through it, where only one polarization was measured: a guess from geometry alone.

What stands behind a wall in the image may be folded, or stand there. Geometry tells sometimes. Folded, a thing would
stand where the radar itself looks and sees nothing: then it passed. Or it is seen directly where it would fold to, or
by way of other mirrors at one of both places: then it stands there. Of most things geometry tells nothing. All echoes
of a thing are decided together, and a wall that shows nothing which cannot be its reflection stays a mirror.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.spatial import cKDTree

from mirrorfold.common.types import Array, Chain, Index, Mask
from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.image_view import ImageView
from mirrorfold.detection.mirror import Fold
from mirrorfold.tree.assignment import Found
from mirrorfold.tree.mirror_tree import MirrorTree
from mirrorfold.tree.things import things
from mirrorfold.tree.transparent import BY_GEOMETRY, FEWEST, UNDECIDED, Again, Window, taken_out

GUESS = 0.8
"""Probability of what geometry tells. It is no more: an object may turn a smooth face to the mirror alone, and the
radar then sees nothing where it stands."""

SAME_PLACE = 1.5
"""Two echoes show the same place up to so many resolution cells."""


def guess_transparent(found: Found, view: ImageView, every: Echoes, *, again: Again) -> Found:
    """Steps 2 to 4 once more without what, by geometry, passed through walls; the same as before where nothing did.

    Beside curved mirrors nothing is guessed: what they show is sorted by other means.

    Parameters
    ----------
    found : Found
        With all echoes taken for reflected ones.
    view : ImageView
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


def passage(found: Found, view: ImageView, node: MirrorTree, folds: Mapping[Chain, Fold]) -> Array:
    """The probability of each echo behind a wall that it passed, (n,).

    What stands behind the wall is shown there by no chain that begins with it, and not directly: what is seen beside
    the wall's end belongs to the same thing.
    """
    echoes, chain = node.objects, node.chain
    folded = folds[chain](echoes.position)
    seen = {other.chain: folds[other.chain](other.objects.position) for other in found.tree.walk() if other is not node}
    there = _shown(view, echoes.position, [seen[other] for other in seen if other and other[: len(chain)] != chain])
    mirrored = _shown(view, folded, list(seen.values()))
    range_, direction, inside = view.locate(folded)
    empty = inside & (range_ < found.sight.open[direction]) if found.sight.open.size else np.zeros(len(echoes), bool)
    thing = things(view, echoes)
    # Seen at both places, a thing tells nothing.
    passed = _told(thing, (empty | there) & ~mirrored, view, echoes)
    reflected = _told(thing, mirrored & ~there, view, echoes)
    return np.select([passed & ~reflected, reflected & ~passed], [GUESS, 1.0 - GUESS], UNDECIDED)


def _told(thing: Index, told: Mask, view: ImageView, echoes: Echoes) -> Mask:
    """Echoes of things of which enough resolution cells are told of, (n,)."""
    cell = np.unique(np.rint(view.in_cells(echoes.position)), axis=0, return_inverse=True)[1].ravel()
    pairs = np.unique(np.stack([thing, cell])[:, told], axis=1)
    return np.asarray((np.bincount(pairs[0], minlength=int(thing.max(initial=0)) + 1) >= FEWEST)[thing])


def _shown(view: ImageView, places: Array, seen: Sequence[Array]) -> Mask:
    """Which places (n, 2) [m] are those of something that is seen, (m, 2) [m] each."""
    elsewhere = np.concatenate([np.empty((0, 2)), *seen])
    if not len(elsewhere):
        return np.zeros(len(places), dtype=bool)
    cell = np.asarray(view.cell(np.linalg.norm(places - view.radar, axis=1)))
    return np.asarray(cKDTree(elsewhere).query(places)[0] < SAME_PLACE * cell)
