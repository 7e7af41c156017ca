"""Echoes that would stand behind a wall that is known, where no wave comes.

A line of sight ends at the next wall that it meets: what the image shows farther on went by way of that wall, too. Where
it shows that wall as a mirror, it is folded by it. But the image of a wall in a mirror may be too faint to be told, as of
one that is hidden there or lies askew, while the wall itself is known from elsewhere.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mirrorfold.common.types import Array, Chain, Mask
from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.mirror import Mirror, fold_of
from mirrorfold.detection.view import View
from mirrorfold.tree.assignment import Found
from mirrorfold.tree.mirror_tree import MirrorTree

BEHIND = "would stand behind a wall"

BEHIND_CELLS = 1.5
"""What stands no farther behind a wall, in resolution cells, may be the wall itself; nor is a wall before what is no
farther away from the mirror: in a corner, it is the other leg."""

INSIDE_CELLS = 1.0
"""So far inside its ends a wall is met, at least."""


def without_hidden(found: Found, view: View) -> Found:
    """What was found, without echoes that mirrors seem to show behind walls that are known."""
    ways = found.tree.ways()
    hidden = {
        node.chain: behind_walls(node.objects, node.chain, ways, view) for node in found.tree.walk() if node.chain
    }
    if not any(mask.any() for mask in hidden.values()):
        return found

    def kept(node: MirrorTree) -> MirrorTree:
        objects = node.objects.take(~hidden[node.chain]) if node.chain else node.objects
        return replace(node, objects=objects, mirrors=tuple(map(kept, node.mirrors)))

    gone = [node.objects.take(hidden[node.chain]) for node in found.tree.walk() if node.chain]
    elsewhere = found.elsewhere.joined(*gone)
    explanation = np.append(found.explanation, np.full(len(elsewhere) - len(found.elsewhere), BEHIND))
    return found._replace(tree=kept(found.tree), elsewhere=elsewhere, explanation=explanation)


def behind_walls(echoes: Echoes, chain: Chain, ways: dict[Chain, tuple[Mirror, ...]], view: View) -> Mask:
    """Which echoes that are seen through a chain of mirrors would stand behind another known wall, (n,).

    Parameters
    ----------
    echoes : Echoes
    chain : tuple of int
    ways : dict of chain to tuple of Mirror
        The mirrors on the way to what each chain shows, as `MirrorTree.ways` tells. Of curved ones nothing is said.
    view : View
    """
    behind, way = np.zeros(len(echoes), dtype=bool), ways[chain]
    if not len(echoes) or any(mirror.curved for mirror in way):
        return behind
    *before, last = way
    sight = echoes.position - view.radar
    share = ((last.center - view.radar) @ last.normal) / (sight @ last.normal)
    leaves = fold_of(before, view.dimensions)(view.radar + share[:, None] * sight)
    stands = fold_of(way, view.dimensions)(echoes.position)
    cell = np.asarray(view.cell(echoes.range))
    for other, (*to_it, wall) in ((other, way) for other, way in ways.items() if way):
        if other != chain and not wall.curved and not any(mirror.curved for mirror in to_it):
            behind |= _met(wall, to_it, leaves, stands, cell)
    return behind


def _met(wall: Mirror, to_it: list[Mirror], leaves: Array, stands: Array, cell: Array) -> Mask:
    """Whether a wall, where it truly stands, is met well before the end of ways (n, d) [m], (n,)."""
    fold = fold_of(to_it, leaves.shape[1])
    center, normal = fold(wall.center), fold.linear @ wall.normal
    way = stands - leaves
    length = np.linalg.norm(way, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = ((center - leaves) @ normal) / (way @ normal)
        offset = leaves + share[:, None] * way - center
        met = np.minimum(share, 1.0 - share) * length > BEHIND_CELLS * cell
        for tangent, (first, last) in zip(wall.tangents @ fold.linear.T, wall.sides, strict=True):
            along = offset @ tangent
            met &= np.minimum(along - first, last - along) >= INSIDE_CELLS * cell
    return np.asarray(met)
