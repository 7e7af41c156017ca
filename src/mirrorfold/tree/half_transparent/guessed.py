"""Reflected by a wall, or passed through it, if only one polarization was measured: a guess from geometry alone.

An object that the image shows behind a wall may stand there, seen through the wall, or before the wall, where its
echoes fold to. Geometry decides only if the object is also seen elsewhere: at one of the two places by way of other
mirrors, or directly before the wall. Then it stands there. What folds onto the face of another wall is that wall. Two
other facts decide nothing. If the radar does not see the object before the wall, the object may turn a smooth face to
the mirror alone. If the object is also seen past the end of the wall, it may still be mirrored, for from one end of the
array to the other the end of a mirror moves before the objects that the mirror shows. All echoes of an object are
decided together. A wall about which geometry says nothing stays a mirror.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.spatial import cKDTree

from mirrorfold.common.types import Array, Chain, Index, Mask
from mirrorfold.detection import Echoes, Mirror, View, any_curved
from mirrorfold.tree.assignment import Found, Pass
from mirrorfold.tree.explaining.behind_walls import last_leg, met_by, prolonged_where_hidden
from mirrorfold.tree.grouping import object_numbers
from mirrorfold.tree.half_transparent.transparent import BY_GEOMETRY, FEWEST, UNDECIDED, TransparentWall, taken_out
from mirrorfold.tree.mirror_tree import MirrorTree

GUESS = 0.8
"""Probability of the place that geometry decides for. It is not higher, as one object may stand where a mirror would
show another."""

SAME_PLACE = 1.5
"""Largest distance of two echoes that show the same place, in resolution cells."""


def guess_transparent(found: Found, view: View, every: Echoes, *, full_pass: Pass) -> Found:
    """Steps 2 to 4 once more without the echoes that, by geometry, passed through walls; unchanged if none did.

    `found` takes all echoes behind walls for reflected ones; `every` are all echoes of the view. If any mirror is
    curved, nothing is guessed: the echoes behind curved mirrors are judged by other tests.
    """
    if any(any_curved(node.way) for node in found.tree.walk()):
        return found
    by_chain = prolonged_where_hidden(found)
    transparent_walls = []
    for node in found.tree.mirrors:
        if node.mirror is None or not len(node.objects):
            continue
        passed = passage_by_geometry(found, view, node, by_chain)
        through = passed > UNDECIDED
        if through.any():
            seen, tested = node.objects.take(through), (node.objects.position, passed)
            wall = TransparentWall(node.mirror, None, seen, seen.position, passed[through], *tested, BY_GEOMETRY)
            transparent_walls.append(wall)
    return taken_out(found, transparent_walls, view, every, full_pass)


def passage_by_geometry(
    found: Found, view: View, node: MirrorTree, by_chain: Mapping[Chain, tuple[Mirror, ...]]
) -> Array:
    """Probability that each object echo of `node`, behind its wall, passed through the wall, (n,)."""
    echoes, chain = node.objects, node.chain
    folded = node.fold(echoes.position)
    others = [other for other in found.tree.walk() if other is not node]
    # An object behind the wall is seen there by chains that do not begin with the wall.
    around = [other for other in others if other.chain and other.chain[: len(chain)] != chain]
    there = _shown(view, echoes.position, [_seen_around(other, by_chain, by_chain[chain], view) for other in around])
    faces = [other.face_fold(other.face.position) for other in others if other.chain]
    mirrored = _shown(view, folded, [*faces, *(other.fold(other.objects.position) for other in others)])
    number = object_numbers(view, echoes)
    # An object that is seen at both places decides nothing.
    passed = _of_marked_objects(number, there & ~mirrored, view, echoes)
    reflected = _of_marked_objects(number, mirrored & ~there, view, echoes)
    return np.select([passed & ~reflected, reflected & ~passed], [GUESS, 1.0 - GUESS], UNDECIDED)


def _seen_around(
    node: MirrorTree, by_chain: Mapping[Chain, tuple[Mirror, ...]], wall: tuple[Mirror, ...], view: View
) -> Array:
    """True places of the objects of a node, without those whose path may meet a wall on its last leg, (n, d) [m].

    Those are left out because every mirror that shows the wall also shows, behind it, the objects that it reflects.
    """
    leaves, stands = last_leg(node.objects, by_chain[node.chain], view)
    return stands[~met_by([wall], leaves, stands, view.cell(node.objects.range), surely=False)]


def _of_marked_objects(number: Index, marked: Mask, view: View, echoes: Echoes) -> Mask:
    """Which echoes are of objects with enough resolution cells that hold `marked` echoes, (n,)."""
    pairs = np.unique(np.stack([number, view.cell_numbers(echoes.position)])[:, marked], axis=1)
    return (np.bincount(pairs[0], minlength=int(number.max(initial=0)) + 1) >= FEWEST)[number]


def _shown(view: View, places: Array, seen: Sequence[Array]) -> Mask:
    """Which places (n, d) [m] agree with one of the places in `seen`, arrays of (m, d) [m]: (n,)."""
    elsewhere = np.concatenate([np.empty((0, view.dimensions)), *seen])
    cell = view.cells_at(places)
    return cKDTree(elsewhere).query(places)[0] < SAME_PLACE * cell
