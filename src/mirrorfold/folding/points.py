"""Step 5 of the algorithm: every echo is moved back to where its object stands.

An echo that was seen by way of a chain of mirrors is reflected across the last mirror of the chain first, and across
the first mirror last. The mirrors are taken where the unfolded image shows them; a deeper mirror is a ghost there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from mirrorfold.common.chains import chain_name
from mirrorfold.common.types import ROOT, UNSEEN, Array, Chain, Index, Mask, Names
from mirrorfold.detection import Echoes, View
from mirrorfold.detection.views.view import in_pieces
from mirrorfold.folding.magnification import magnified
from mirrorfold.tree.half_transparent.transparent import TransparentWall
from mirrorfold.tree.lines_of_sight import LinesOfSight
from mirrorfold.tree.mirror_tree import MirrorTree

BLOB_CELLS = 1.5
"""Samples of the image within this many resolution cells of an echo belong to it; its main lobe reaches one cell."""


SAME = 1e-9
"""Echoes closer than this are the same echo: a share of the largest coordinate, more than the rounding of
coordinates."""


@dataclass(frozen=True, eq=False)
class Points:
    """The folded scene: one point for every echo, and points in gaps between echoes.

    Attributes
    ----------
    position, initial : (n, d) arrays [m]
        Place of the point, and its place in the unfolded image.
    amplitude, exceeded : (n,) arrays
        Amplitude of the echo, and what it had to exceed: noise, side lobes, and the threshold.
    bounces : (n,) array of int
        Number of mirrors on the way to the point; a mirror on whose face the point lies is not counted.
    chain, mirror : (n,) arrays of str
        The chain of mirrors by which the point was seen, such as "0/1", empty in line of sight; and the chain of the
        mirror on whose face it lies, empty for objects.
    confidence : (n,) array
        Probability that a surface stands there, see `mirrorfold.folding.confidence`; one before it is judged.
    error : (n, d) array [m]
        Standard errors of the position; zero before it is judged.
    explanation : (n,) array of str
        Why the echo does not come from where the image shows it; empty if it does.
    confocal : (n,) array
        Share of the echo's energy that came back the way it went, see `tree.explaining.directions.confocal_share`; NaN
        where it is not known.
    growth : (n,) array
        Factor by which curved mirrors widen the resolution cell across the line of sight; one for flat mirrors.
    caustic : (n,) array of str
        "near" or "beyond" a caustic of a concave mirror, see `mirrorfold.folding.magnification`; else empty.
    passed : (n,) array
        Probability that the echo passed through the wall in front of it instead of being reflected by it; NaN where
        this was not asked.
    wall : (n,) array of str
        The chain of the wall that the echo passed through; empty for all that did not.
    decided : (n,) array of str
        How `passed` was found: by "polarization", or by "geometry", which is a guess; empty where this was not asked.
    interpolated : (n,) bool array
        Whether the point has no echo, but closes a gap in a surface, see `mirrorfold.folding.gaps`.
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
        """Points of echoes at `position` (n, d) [m]: unjudged objects in line of sight, unless `known` sets a field."""
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


def fold_back(tree: MirrorTree, view: View | None = None, transparent_walls: Sequence[TransparentWall] = ()) -> Points:
    """Every echo at its true place, as points.

    Parameters
    ----------
    tree : MirrorTree
        The root. Points are in the order of its nodes, depth first; in each, objects before the face of its mirror.
    view : View, optional
        Gives the resolution behind curved mirrors; without it, the points get that behind flat mirrors.
    transparent_walls : sequence of TransparentWall, optional
        Half-transparent walls, with the echoes that passed through them; their points come last.
    """
    parts = []
    for node in tree.walk():
        for echoes, bounces, fold, mirror in (
            (node.objects, node.generation, node.fold, ()),
            (node.face, max(node.generation - 1, 0), node.face_fold, node.chain),
        ):
            growth, caustic = magnified(node.way[:bounces], echoes.position, view)
            parts.append(Points.of(
                echoes, fold(echoes.position), bounces=np.int32(bounces), chain=chain_name(node.chain[:bounces]),
                mirror=chain_name(mirror), growth=growth, caustic=caustic.astype(str),
            ))  # fmt: skip
    points = joined(*parts)
    for wall in transparent_walls:
        chain = next((chain_name(node.chain) for node in tree.mirrors if node.mirror is wall.mirror), "?")
        passed = Points.of(wall.echoes, wall.place, passed=wall.probability, wall=chain, decided=wall.decided)
        points = joined(_tested(points, wall), passed)
    return points


def joined(*parts: Points) -> Points:
    """Points, one after the other."""
    return Points(*(np.concatenate([getattr(part, item.name) for part in parts]) for item in fields(parts[0])))


def _tested(points: Points, wall: TransparentWall) -> Points:
    """The points with the probability that they passed through a wall, where it was tested for this wall."""
    if not len(points.initial) or not len(wall.tested):
        return points
    distance, nearest = cKDTree(wall.tested).query(points.initial)
    is_tested = distance <= SAME * np.abs(points.initial).max()
    return replace(
        points,
        passed=np.where(is_tested, wall.passed[nearest], points.passed),
        decided=np.where(is_tested, wall.decided, points.decided),
    )


def owned_blobs(points: Points, sight: LinesOfSight, least: float = 0.0) -> NDArray[np.int16]:
    """Number of the mirror by which each sample of the image is folded, (directions, ranges).

    It is `ROOT` for samples that stay where they are, and `UNSEEN` around points of less than the `least` confidence. A
    sample belongs to a mirror if it lies within `BLOB_CELLS` of a point that was folded by that mirror. All else that a
    mirror shows is weak, or contradicted by the radar's own view: it has no point, so no picture may show it folded.
    """
    doubted, points = points.take(points.confidence < least), points.take(points.confidence >= least)
    view = sight.view
    owner = np.full((len(view.sight), view.range.size), ROOT, dtype=np.int16)
    reach = int(np.ceil(BLOB_CELLS * view.range_cell / view.dr))

    def seen_by(chain: Chain) -> Array:
        return points.initial[(points.wall == "") & (points.chain == chain_name(chain))]

    # Where blobs overlap, a point counts before a doubted one, and of two mirrors the one with the higher number.
    shown = {UNSEEN: doubted.initial, ROOT: seen_by(())} if len(doubted.initial) else {}
    shown |= {mirror: seen_by(chain) for mirror, chain in enumerate(sight.chain) if chain}
    for number, seen in shown.items():
        for some in in_pieces(len(seen)):
            range_ = view.locate(seen[some])[0]
            point, direction = view.within(seen[some], BLOB_CELLS * view.cell(range_) / range_)
            sample = np.rint((range_ - view.range[0]) / view.dr).astype(np.intp)[point]
            for offset in range(-reach, reach + 1):
                owner[direction, np.clip(sample + offset, 0, view.range.size - 1)] = number
    return owner
