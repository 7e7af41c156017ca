"""Step 5 of the algorithm: every echo back to where it stands.

What was seen through a chain of mirrors is reflected across the last of them first and across the first of them last;
all mirrors are those of the unfolded image, where a deeper one is a ghost itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from mirrorfold.common.chains import chain_name
from mirrorfold.common.types import Array, Chain, Index, Mask, Names
from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.views.view import View, in_pieces
from mirrorfold.folding.magnification import magnified
from mirrorfold.tree.half_transparent.transparent import Window
from mirrorfold.tree.lines_of_sight import NOBODY, ROOT, LinesOfSight
from mirrorfold.tree.mirror_tree import MirrorTree

BLOB_CELLS = 1.5
"""What the image shows this close to an echo, in resolution cells, is that echo; its main lobe reaches one cell."""


SAME = 1e-9
"""Echoes closer than this [m] are the same one: above the rounding of coordinates."""


@dataclass(frozen=True, eq=False)
class Points:
    """The folded scene: one point for every echo, and some in gaps between them.

    Attributes
    ----------
    position, initial : (n, d) arrays [m]
        Where it stands, and where it stood before folding.
    amplitude, exceeded : (n,) arrays
        Of the echo, and what it had to exceed: noise, side lobes, and the threshold.
    bounces : (n,) array of int
        Number of mirrors on the way to it; the mirror on whose face a point lies is not counted.
    chain, mirror : (n,) arrays of str
        By which chain of mirrors it was seen, such as "0/1", and the chain of the mirror on whose face it lies; empty
        for objects.
    confidence : (n,) array
        Probability that a surface stands there, see `mirrorfold.folding.confidence`; one until it is judged.
    error : (n, d) array [m]
        Standard errors of the position; zero until it is judged.
    explanation : (n,) array of str
        Why the echo does not come from where the image shows it; empty for those that do.
    confocal : (n,) array
        Share of its energy that came back the way it went, see `tree.explaining.directions.confocal_share`; NaN where
        that is not known.
    growth : (n,) array
        By how much the resolution cell across is wider than by way of flat mirrors; one for these.
    caustic : (n,) array of str
        "near" or "beyond" a caustic of a concave mirror, see `mirrorfold.folding.magnification`; else empty.
    passed : (n,) array
        Probability that the echo passed through the wall before it instead of being reflected; NaN where no wall is
        known to be transparent.
    wall : (n,) array of str
        The chain of the wall that it passed through; empty for all that did not.
    decided : (n,) array of str
        By what `passed` was found, "polarization" or "geometry", which is a guess; empty where it was not asked.
    interpolated : (n,) bool array
        Whether it has no echo of its own, but closes a gap in a surface, see `mirrorfold.folding.gaps`.
    """

    position: Array
    initial: Array
    amplitude: Array
    exceeded: Array
    bounces: NDArray[np.int32]
    chain: Names
    mirror: Names
    confidence: Array
    error: Array
    explanation: Names
    confocal: Array
    growth: Array
    caustic: Names
    passed: Array
    wall: Names
    decided: Names
    interpolated: Mask

    @classmethod
    def of(cls, echoes: Echoes, position: Array, **known: Any) -> Points:
        """Echoes at their places (n, d) [m]: objects in line of sight, not judged yet, but for what is `known`."""
        nan, none = np.nan, ""
        usual: dict[str, Any] = {
            "bounces": np.int32(0), "chain": none, "mirror": none, "confidence": 1.0, "explanation": none,
            "confocal": nan, "growth": 1.0, "caustic": none, "passed": nan, "wall": none, "decided": none,
            "interpolated": False,
        }  # fmt: skip
        each = {name: np.full(len(echoes), value) for name, value in (usual | known).items() if name != "error"}
        exceeded, error = np.maximum(echoes.noise, echoes.limit), known.get("error", np.zeros_like(position))
        return cls(position, echoes.position, echoes.amplitude, exceeded, error=error, **each)

    def take(self, which: Mask | Index) -> Points:
        """Some of the points, by mask or index."""
        return replace(self, **{item.name: getattr(self, item.name)[which] for item in fields(self)})


def fold_back(tree: MirrorTree, view: View | None = None, windows: Sequence[Window] = ()) -> Points:
    """Every echo at its true place.

    Parameters
    ----------
    tree : MirrorTree
        The root. Its echoes come depth first, and of each node the objects before the face of its mirror.
    view : View, optional
        Tells what resolution remains behind curved mirrors; without it, as much as behind flat ones.
    windows : sequence of Window, optional
        What passed through half-transparent walls; these echoes come last.
    """
    folds, ways = tree.folds(), tree.ways()
    parts = []
    for node in tree.walk():
        for echoes, chain, mirror in ((node.objects, node.chain, ()), (node.face, node.chain[:-1], node.chain)):
            growth, caustic = magnified(ways[chain], echoes.position, view)
            parts.append(Points.of(
                echoes, folds[chain](echoes.position), bounces=np.int32(len(chain)), chain=chain_name(chain),
                mirror=chain_name(mirror), growth=growth, caustic=caustic.astype(str),
            ))  # fmt: skip
    points = joined(*parts)
    for window in windows:
        points = joined(_asked(points, window), _through(window, tree))
    return points


def joined(*parts: Points) -> Points:
    """Points, one after the other."""
    return Points(*(np.concatenate([getattr(part, item.name) for part in parts]) for item in fields(parts[0])))


def _asked(points: Points, window: Window) -> Points:
    """The points with the probability that they passed through a wall, where that was asked."""
    if not len(points.initial) or not len(window.tested):
        return points
    distance, nearest = cKDTree(window.tested).query(points.initial)
    asked = distance < SAME
    return replace(
        points,
        passed=np.where(asked, window.passed[nearest], points.passed),
        decided=np.where(asked, window.decided, points.decided),
    )


def _through(window: Window, tree: MirrorTree) -> Points:
    """What passed through a wall, as points in line of sight."""
    chain = next((chain_name(node.chain) for node in tree.mirrors if node.line is window.mirror), "?")
    return Points.of(window.echoes, window.place, passed=window.probability, wall=chain, decided=window.decided)


def owned_blobs(points: Points, sight: LinesOfSight, least: float = 0.0) -> NDArray[np.int16]:
    """By which mirror each sample of the image is folded, (directions, ranges): by its number, `ROOT` for what stands
    where the image shows it, `NOBODY` around points of less than the `least` confidence.

    A sample belongs to a mirror if it lies within `BLOB_CELLS` of a point that was folded by it. What else a mirror
    shows is weak, or contradicted by the radar's own view: no point stands for it, and no picture may show it at a
    place where nothing was found.
    """
    doubted, points = points.take(points.confidence < least), points.take(points.confidence >= least)
    view = sight.view
    owner = np.full((len(view.sight), view.range.size), ROOT, dtype=np.int16)
    step = float(view.range[1] - view.range[0])
    reach = int(np.ceil(BLOB_CELLS * view.range_cell / step))

    def seen_by(chain: Chain) -> Array:
        return points.initial[(points.wall == "") & (points.chain == chain_name(chain))]

    # Where blobs meet, that of a point counts, and of two points the deeper one.
    shown = {NOBODY: doubted.initial, ROOT: seen_by(())} if len(doubted.initial) else {}
    shown |= {mirror: seen_by(chain) for mirror, chain in enumerate(sight.chain) if chain}
    for number, seen in shown.items():
        if not len(seen):
            continue
        for some in in_pieces(len(seen)):
            range_ = view.locate(seen[some])[0]
            point, direction = view.within(seen[some], BLOB_CELLS * view.cell(range_) / range_)
            sample = np.rint((range_ - view.range[0]) / step).astype(np.intp)[point]
            for offset in range(-reach, reach + 1):
                owner[direction, np.clip(sample + offset, 0, view.range.size - 1)] = number
    return owner
