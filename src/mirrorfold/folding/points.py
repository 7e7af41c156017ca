"""Step 5 of the algorithm: every echo back to where it stands.

What was seen through a chain of mirrors is reflected across the last of them first and across the first of them last;
all mirrors are those of the unfolded image, where a deeper one is a ghost itself.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mirrorfold.common.types import Array, Chain
from mirrorfold.tree.lines_of_sight import NOBODY, ROOT, LinesOfSight
from mirrorfold.tree.mirror_tree import MirrorTree

BLOB_CELLS = 1.5
"""What the image shows this close to an echo, in resolution cells, is that echo; its main lobe reaches one cell."""


@dataclass(frozen=True, eq=False)
class Points:
    """The folded scene: one point for every echo that belongs to an object or to the face of a mirror.

    Attributes
    ----------
    position, initial : (n, d) arrays [m]
        Where it stands, and where it stood before folding.
    amplitude : (n,) array
    bounces : (n,) array of int
        Mirrors on the way: objects by the chain of their node, faces of mirrors by that of its parent.
    chain, surface : (n,) arrays of str
        Such as "0/1", and "object" or "mirror".
    confidence : (n,) array
        Share of its power above what it had to exceed, noise or threshold, times the filled share of each mirror on
        the way.
    """

    position: Array
    initial: Array
    amplitude: Array
    bounces: NDArray[np.int32]
    chain: NDArray[np.str_]
    surface: NDArray[np.str_]
    confidence: Array


def fold_back(tree: MirrorTree) -> Points:
    """Every echo of the tree, of which the root is given, at its true place: depth first, objects before faces."""
    folds = tree.folds()
    trust: dict[Chain, float] = {}
    parts: list[tuple[Any, ...]] = []
    for node in tree.walk():
        trust[node.chain] = 1.0 if node.line is None else trust[node.chain[:-1]] * node.line.fill
        for echoes, chain, surface in ((node.objects, node.chain, "object"), (node.face, node.chain[:-1], "mirror")):
            exceeded = np.maximum(echoes.noise, echoes.limit)
            excess = 1.0 - (exceeded / np.maximum(echoes.amplitude, np.maximum(exceeded, np.finfo(float).tiny))) ** 2
            names = [np.full(len(echoes), name, dtype=object) for name in ("/".join(map(str, chain)), surface)]
            bounces = np.full(len(echoes), len(chain), dtype=np.int32)
            folded = folds[chain](echoes.position)
            parts.append((folded, echoes.position, echoes.amplitude, bounces, *names, excess * trust[chain]))
    position, initial, amplitude, bounces, chains, surfaces, confidence = map(np.concatenate, zip(*parts, strict=True))
    return Points(position, initial, amplitude, bounces, chains.astype(str), surfaces.astype(str), confidence)


def owned_blobs(points: Points, sight: LinesOfSight, misplaced: Array | None = None) -> NDArray[np.int16]:
    """Whose the blobs of the image are, (directions, ranges): the number of the mirror they fold by, `ROOT` for what
    stands where the image shows it, `NOBODY` for echoes that come from elsewhere, at `misplaced` (n, d) [m].

    What a mirror shows elsewhere is weak or contradicted by the radar's own view. No point stands for it, and no
    picture may show it at a place where nothing was found.
    """
    view = sight.view
    owner = np.full((len(view.sight), view.range.size), ROOT, dtype=np.int16)
    step = float(view.range[1] - view.range[0])
    reach = int(np.ceil(BLOB_CELLS * view.range_cell / step))

    def seen_by(chain: Chain) -> Array:
        return points.initial[(points.bounces == len(chain)) & (points.chain == "/".join(map(str, chain)))]

    # Where blobs meet, that of a point counts, and of two points the deeper one.
    shown = {NOBODY: misplaced, ROOT: seen_by(())} if misplaced is not None and len(misplaced) else {}
    shown |= {mirror: seen_by(chain) for mirror, chain in enumerate(sight.chain) if chain}
    for number, seen in shown.items():
        if not len(seen):
            continue
        range_ = view.locate(seen)[0]
        point, direction = view.within(seen, BLOB_CELLS * view.cell(range_) / range_)
        sample = np.rint((range_ - view.range[0]) / step).astype(np.intp)[point]
        for offset in range(-reach, reach + 1):
            owner[direction, np.clip(sample + offset, 0, view.range.size - 1)] = number
    return owner
