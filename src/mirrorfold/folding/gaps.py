"""End of step 5: points are added in the gaps between echoes through which a surface goes on.

A bright echo outshines weaker echoes up to a resolution cell to either side, and speckle fades over as long a distance.
So a surface may go on where no echo stands. It truly ends only where the image is dark between two echoes.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import minimum_spanning_tree
from scipy.spatial import cKDTree

from mirrorfold.common.chains import chain_name
from mirrorfold.common.decibels import ratio_of
from mirrorfold.common.statistics import consecutive
from mirrorfold.common.types import Array, Index
from mirrorfold.detection import ImageView
from mirrorfold.detection.image_echoes import FAINT_DB
from mirrorfold.folding.points import Points, joined
from mirrorfold.tree.mirror_tree import MirrorTree

GAP_CELLS = 3.0
"""Widest gap that is closed, in resolution cells: one cell beside each of two bright echoes, and one in which speckle
fades."""

STEP_CELLS = 0.5
"""Largest distance between points in a closed gap, in resolution cells: closer points would add no information."""

FIT_CELLS = 1.5
"""Distance, in resolution cells, at which an echo has the weight ``exp(-1/2)`` in the fit that places a new point: that
from the middle of the widest gap to its ends."""

SAMPLES = 12
"""Number of places in a gap at which the image is looked up: four in a resolution cell of the widest gap."""

FARTHEST = 3.0
"""Echoes farther away than this multiple of `FIT_CELLS` are left out of the fit: they weigh less than ``exp(-9/2)``, a
hundredth."""

SPECK_CELLS = 0.25
"""A place is dark only if the image is dark up to this distance to all sides, in resolution cells: speckle fades at
single points."""


def close_gaps(points: Points, tree: MirrorTree, view: ImageView) -> Points:
    """The points; appended, new ones in each gap between neighbours in which the image is not dark.

    Neighbours are echoes joined by the minimum spanning tree of all echoes in the unfolded image (Kruskal, Proc. AMS 7,
    1956), with distances in resolution cells, by whatever chains they were seen: so a gap is the same before folding
    and after. It is closed if both ends have the same chain, and lie on the face of the same mirror or on none.

    The points, which have their confidence, were found in the image of the `view`, and folded by the mirrors below the
    root `tree`. A new point has the amplitude of the image at its place, and the confidence of the less certain end of
    its gap. What is known of echoes alone, such as `confocal`, is NaN.
    """
    if len(points.initial) < 2:
        return points
    cells = cKDTree(view.in_cells(points.initial))
    first, second, apart = _neighbours(points, cells)
    share = np.linspace(0.0, 1.0, SAMPLES + 2)[1:-1, None, None]
    between = (1.0 - share) * points.initial[first] + share * points.initial[second]
    needed = np.minimum(points.exceeded[first], points.exceeded[second]) * ratio_of(FAINT_DB)
    bright = np.all(_brightest_beside(between, view) >= needed, axis=0)
    first, second, pieces = first[bright], second[bright], np.ceil(apart[bright] / STEP_CELLS).astype(np.intp)

    gap = np.repeat(np.arange(len(pieces)), pieces - 1)
    first, second, share = first[gap], second[gap], (consecutive(1, pieces - 1) / pieces[gap])[:, None]
    new = points.take(np.where(share[:, 0] < 0.5, first, second))
    straight = (1.0 - share) * points.initial[first] + share * points.initial[second]
    initial = _on_surface(straight, points, cells, view)
    position = np.empty_like(initial)
    for node in tree.walk():
        own = new.chain == chain_name(node.chain)
        position[own] = node.fold(initial[own])
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
    """Both indices of neighbours with the same chain and face that are farther apart than `STEP_CELLS` and at most
    `GAP_CELLS`, and their distance, (n,) each. `cells` holds the points in units of resolution cells.
    """
    edges = minimum_spanning_tree(cells.sparse_distance_matrix(cells, GAP_CELLS, output_type="coo_matrix")).tocoo()
    first, second = edges.row, edges.col
    gap = (edges.data > STEP_CELLS) & (points.wall[first] == "") & (points.wall[second] == "")
    for seen in (points.chain, points.mirror, points.explanation):
        gap &= seen[first] == seen[second]
    gap &= points.explanation[first] == ""
    return first[gap], second[gap], edges.data[gap]


def _on_surface(places: Array, points: Points, cells: cKDTree, view: ImageView) -> Array:
    """Places (n, 2) [m] of the image, each moved onto the straight line that fits the echoes around it, (n, 2).

    Moving least squares (Levin, Math. Comput. 67, 1998): the weight of an echo is the root of its amplitude, and falls
    with its distance.
    """
    middle = points.initial.mean(axis=0)
    offset, place_cells = points.initial - middle, cKDTree(view.in_cells(places))
    around = place_cells.sparse_distance_matrix(cells, FARTHEST * FIT_CELLS, output_type="coo_matrix")
    weight = np.exp(-0.5 * (around.data / FIT_CELLS) ** 2) * np.sqrt(points.amplitude[around.col])
    around = csr_array((weight, (around.row, around.col)), shape=around.shape)
    total = around.sum(axis=1)[:, None]
    mean = around @ offset / total
    squares = np.einsum("ni,nj->nij", offset, offset).reshape(-1, 4)
    spread = (around @ squares / total).reshape(-1, 2, 2) - np.einsum("ni,nj->nij", mean, mean)
    along = np.linalg.eigh(spread)[1][:, :, -1]
    aside = places - middle - mean
    return middle + mean + along * np.sum(aside * along, axis=1, keepdims=True)


def _brightest_beside(places: Array, view: ImageView) -> Array:
    """Largest amplitude of the image at places (..., 2) [m] and `SPECK_CELLS` to their four sides, (...)."""
    range_, u = view.to_polar(places)
    depth, across = SPECK_CELLS * view.range_cell, SPECK_CELLS * view.u_cell
    sides = (0.0, 0.0), (depth, 0.0), (-depth, 0.0), (0.0, across), (0.0, -across)
    return np.sqrt(np.max([view.power_at(range_ + far, u + aside) for far, aside in sides], axis=0))
