"""Step 4 of the algorithm: every echo is assigned to the mirror through which it is seen."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from mirrorfold.common.types import ROOT, UNSEEN, Mask, Names
from mirrorfold.detection import Echoes
from mirrorfold.tree.explaining.edges import before_ends, beyond_ends
from mirrorfold.tree.lines_of_sight import LinesOfSight, images_of_radar
from mirrorfold.tree.mirror_tree import MirrorTree
from mirrorfold.tree.ordering import Order

if TYPE_CHECKING:
    from mirrorfold.tree.half_transparent.transparent import TransparentWall

ITSELF = "is the radar itself, seen in a mirror"
AT_EDGE = "may be seen in a mirror or past its edge"


class Found(NamedTuple):
    """The result of steps 2 to 4.

    Attributes
    ----------
    echoes : Echoes
        Echoes from which the mirrors and their order were found. Those that were `explained` afterwards, by the last
        order or the whole tree, are among them.
    tree : MirrorTree
        The root of the tree of mirrors.
    sight : LinesOfSight
        Lines of sight, with the mirrors and which is seen through which.
    explained : Echoes
        Echoes that were left out, because no object stands where the image shows them.
    explanation : (n,) array of str
        Why each of them was left out.
    transparent_walls : tuple of TransparentWall
        Half-transparent walls and the echoes that passed through them, see
        `mirrorfold.tree.half_transparent.transparent`.
    """

    echoes: Echoes
    tree: MirrorTree
    sight: LinesOfSight
    explained: Echoes
    explanation: Names
    transparent_walls: tuple[TransparentWall, ...] = ()


Pass = Callable[..., Found]
"""`mirrorfold.tree.rounds.find_tree` with its view and settings: steps 2 to 4 for ``echoes=``, with the mirrors
``besides=`` in addition to those that are found, and with the reasons that an ``earlier=`` result has against echoes.
"""


def assign_echoes(order: Order, echoes: Echoes, *, opaque: bool = True) -> tuple[MirrorTree, LinesOfSight]:
    """The root of the tree of mirrors with their echoes, and the lines of sight with what is known to be empty.

    Where objects are `opaque`, three kinds of echoes are left out: those that are `at_edges`, those at the edge of a
    mirror that would fold to where the radar itself sees nothing, and images of the radar's own antennas in a mirror.
    """
    owner = np.where(echoes.visible & echoes.strong & (order.face == ROOT), order.through(echoes), UNSEEN)
    if opaque:
        order = replace(order, empty_up_to=order.open_ranges(echoes.take(echoes.visible)))
        owner = before_ends(order, echoes, beyond_ends(order, echoes, owner))
        owner[at_edges(order, echoes)] = UNSEEN

    def node(index: int) -> MirrorTree:
        """The part of the tree from mirror `index` on."""
        objects, face = echoes.take(owner == index), echoes.take(echoes.visible & (order.face == index))
        if opaque:
            fold = order.fold(index)
            objects = objects.take(~order.contradicted(objects, fold) & ~images_of_radar(order.view, objects, fold))
        face = order.mirrors[index].snapped(order.view, face)
        return MirrorTree(order.way(index), face, objects, below(index), order.chain[index])

    def below(index: int) -> tuple[MirrorTree, ...]:
        """The parts of the tree that are seen by way of mirror `index`, or directly (`ROOT`)."""
        return tuple(map(node, np.flatnonzero(order.parent == index).tolist()))

    return MirrorTree((), echoes.take(np.arange(0)), echoes.take(owner == ROOT), below(ROOT)), order


def at_edges(order: Order, echoes: Echoes) -> Mask:
    """Which objects are so near to the edge of a mirror that they may be seen in it or past it, (n,)."""
    found = echoes.visible & echoes.strong & (order.face == ROOT)
    found[found] = order.undecided(echoes.take(found))
    return found


def radar_itself(sight: LinesOfSight, echoes: Echoes) -> Mask:
    """Which echoes are images of the radar's own antennas in mirrors, (n,)."""
    found = np.zeros(len(echoes), dtype=bool)
    through = np.where(echoes.visible & echoes.strong, sight.through(echoes), UNSEEN)
    for index in sight.ways:
        if (seen := through == index).any():
            found[seen] = images_of_radar(sight.view, echoes.take(seen), sight.fold(index))
    return found
