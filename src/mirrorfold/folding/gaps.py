"""Step 5, last: points are added where a surface goes on through a gap between its echoes.

A bright echo outshines weaker ones for a resolution cell to either side, and speckle fades over as much. So a surface
may go on where no echo stands, unless the image is dark there, too: only then it has a gap.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import minimum_spanning_tree
from scipy.spatial import cKDTree

from mirrorfold.common.chains import chain_name
from mirrorfold.common.types import Array, Index
from mirrorfold.detection.image_echoes import FAINT_DB
from mirrorfold.detection.views.image_view import ImageView
from mirrorfold.folding.points import Points, joined
from mirrorfold.tree.mirror_tree import MirrorTree

GAP_CELLS = 3.0
"""Widest gap that is closed, in resolution cells: one to the side of each of two bright echoes, and one that fades."""

STEP_CELLS = 0.5
"""Largest distance of the points in a closed gap, in resolution cells: closer ones would tell nothing new."""

FIT_CELLS = 1.5
"""Distance, in resolution cells, at which an echo weighs ``exp(-1/2)`` in the place of a new point: from the middle of
the widest gap to its ends."""

SAMPLES = 12
"""Places in a gap at which the image is looked at, four in a resolution cell of the widest."""

FARTHEST = 3.0
"""Echoes farther away than so many of these distances weigh nothing: less than ``exp(-9/2)``, a hundredth."""

SPECK_CELLS = 0.25
"""A place is dark if the image is dark this far to all sides, too, in resolution cells: speckle fades at points."""


def close_gaps(points: Points, tree: MirrorTree, view: ImageView) -> Points:
    """The points, and after them new ones in each gap between neighbours in which the image is not dark.

    Neighbours are joined by the shortest tree that joins all echoes of the image (Kruskal, Proc. AMS 7, 1956), by
    distances in resolution cells, whatever they were seen by: so a gap is the same before folding and after. It is
    closed where both ends were folded alike, or lie on the face of the same mirror.

    Parameters
    ----------
    points : Points
        As they were judged.
    tree : MirrorTree
        The root, which they were folded by.
    view : ImageView
        The image that they were found in.

    Returns
    -------
    Points
        New points have the amplitude of the image there, and the confidence of the less certain end of their gap. What
        the sweep tells of echoes alone, such as `confocal`, is NaN.
    """
    if len(points.initial) < 2:
        return points
    cells = cKDTree(view.in_cells(points.initial))
    first, second, apart = _neighbours(points, cells)
    share = np.linspace(0.0, 1.0, SAMPLES + 2)[1:-1, None, None]
    between = (1.0 - share) * points.initial[first] + share * points.initial[second]
    needed = np.minimum(points.exceeded[first], points.exceeded[second]) * 10.0 ** (FAINT_DB / 20.0)
    lit = np.all(_brightest_beside(between, view) >= needed, axis=0)
    first, second, pieces = first[lit], second[lit], np.ceil(apart[lit] / STEP_CELLS).astype(np.intp)

    gap = np.repeat(np.arange(len(pieces)), pieces - 1)
    piece = np.arange(len(gap)) - (np.cumsum(pieces - 1) - pieces)[gap]
    first, second, share = first[gap], second[gap], (piece / pieces[gap])[:, None]
    new = points.take(np.where(share[:, 0] < 0.5, first, second))
    straight = (1.0 - share) * points.initial[first] + share * points.initial[second]
    initial = _on_surface(straight, points, cells, view)
    position = np.empty_like(initial)
    for chain, fold in tree.folds().items():
        own = new.chain == chain_name(chain)
        position[own] = fold(initial[own])
    new = replace(
        new,
        position=position,
        initial=initial,
        amplitude=np.sqrt(view.power_at(*view.to_polar(initial))),
        confidence=np.minimum(points.confidence[first], points.confidence[second]),
        error=np.maximum(points.error[first], points.error[second]),
        confocal=np.full(len(gap), np.nan),
        passed=np.full(len(gap), np.nan),
        decided=np.full(len(gap), ""),
        interpolated=np.ones(len(gap), dtype=bool),
    )
    return joined(points, new)


def _neighbours(points: Points, cells: cKDTree) -> tuple[Index, Index, Array]:
    """Pairs of neighbours that were seen alike, and more than a step and at most a gap apart; and their distance, each
    (n,). All distances are those of the `cells`: the points in units of resolution cells.
    """
    edges = minimum_spanning_tree(cells.sparse_distance_matrix(cells, GAP_CELLS, output_type="coo_matrix")).tocoo()
    first, second = edges.row, edges.col
    gap = (edges.data > STEP_CELLS) & (points.wall[first] == "") & (points.wall[second] == "")
    for seen in (points.chain, points.mirror, points.explanation):
        gap &= seen[first] == seen[second]
    gap &= points.explanation[first] == ""
    return first[gap], second[gap], edges.data[gap]


def _on_surface(places: Array, points: Points, cells: cKDTree, view: ImageView) -> Array:
    """Places (n, 2) [m] of the image, moved to the straight line that fits the echoes around each of them, (n, 2).

    Moving least squares (Levin, Math. Comput. 67, 1998): an echo weighs with the root of its amplitude, and less the
    farther away it is.
    """
    middle = points.initial.mean(axis=0)
    offset, asked = points.initial - middle, cKDTree(view.in_cells(places))
    around = asked.sparse_distance_matrix(cells, FARTHEST * FIT_CELLS, output_type="coo_matrix")
    weight = np.exp(-0.5 * (around.data / FIT_CELLS) ** 2) * np.sqrt(points.amplitude[around.col])
    around = csr_array((weight, (around.row, around.col)), shape=around.shape)
    total = around.sum(axis=1)[:, None]
    mean = around @ offset / total
    squares = np.einsum("ni,nj->nij", offset, offset).reshape(-1, 4)
    spread = (around @ squares / total).reshape(-1, 2, 2) - np.einsum("ni,nj->nij", mean, mean)
    along = np.linalg.eigh(spread)[1][:, :, -1]
    aside = places - middle - mean
    return np.asarray(middle + mean + along * np.sum(aside * along, axis=1, keepdims=True))


def _brightest_beside(places: Array, view: ImageView) -> Array:
    """Largest amplitude of the image up to `SPECK_CELLS` to any side of places (..., 2) [m], (...)."""
    range_, u = view.to_polar(places)
    depth, across = SPECK_CELLS * view.range_cell, SPECK_CELLS * view.u_cell
    sides = (0.0, 0.0), (depth, 0.0), (-depth, 0.0), (0.0, across), (0.0, -across)
    return np.asarray(np.sqrt(np.max([view.power_at(range_ + far, u + aside) for far, aside in sides], axis=0)))
