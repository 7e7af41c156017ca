"""Late echoes of wall edges: waves that went to and fro between two walls, and come from beyond the ambiguous range.

The edge of a wall bends waves to all sides: also along the normal of another wall, and, when they return from there, to
the radar. If both walls face each other, the wave goes to and fro between them and hardly fades, as the first wall
sends back what its edge does not bend. Let the edge be at range r0 and at the distance d from the other wall. In the
direction of the edge, the image then shows echoes at r0 + d, r0 + 2 d, and so on. Equal frequency steps cannot tell the
range r from r - P, with P the ambiguous range. So echoes of this series from beyond P stand among the objects nearby.
They fill no row, as late walls do; but the earlier echoes of their series must be in the image, too.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cache, partial
from itertools import permutations

import numpy as np
from scipy.ndimage import maximum_filter

from mirrorfold.common.geometry import crossing, reflect, segment_normal, signed_distance
from mirrorfold.common.types import Array, Chain, Mask
from mirrorfold.detection import Echoes, ImageView, Mirror
from mirrorfold.detection.echoes import strongest_of
from mirrorfold.tree.explaining.late_walls import APART_CELLS
from mirrorfold.tree.explaining.true_walls import BEYOND, EXPECTED_CELLS, strongest_flat, true_ends
from mirrorfold.tree.grouping import object_numbers

NEAR_CELLS = 1.0, 2.0
"""Largest distance of the earlier echoes of a series from where they are expected, in range cells and in cells aside:
an edge bends waves into more than one beam, and later the wave has wandered along the walls."""

FADED_DB = 3.0
"""An echo may be this much stronger than an earlier one of its series: a series fades, but speckle varies."""


def late_edges(echoes: Echoes, by_chain: Mapping[Chain, tuple[Mirror, ...]], view: ImageView) -> Mask:
    """Which echoes are late echoes of the edges of known walls, (n,); none without an ambiguous range.

    The brightest echo of an object decides for all of its echoes. All earlier echoes of the series that lie within the
    image must be there, and at most `FADED_DB` weaker, once the amplification of echoes by their range is undone.

    Parameters
    ----------
    echoes : Echoes
        Object echoes by way of one chain of mirrors, or in line of sight.
    by_chain : mapping of chain to tuple of Mirror
        The mirrors of each chain, as `MirrorTree.mirrors_by_chain` returns them. Curved ones are not tested.
    view : ImageView
    """
    found = np.zeros(len(echoes), dtype=bool)
    if not np.isfinite(view.ambiguous) or not len(echoes):
        return found
    walls, nearby = [true_ends(way) for way in strongest_flat(by_chain.values())], cache(partial(_brightest, view))
    # The image has amplified a late echo by its apparent range; here, by its true range, as the earlier echoes are.
    level = echoes.amplitude * ((echoes.range + view.ambiguous) / echoes.range) ** view.power
    level *= 10.0 ** (-FADED_DB / 20.0)
    for bending, facing in permutations(walls, 2):
        series = np.full((0, len(echoes)), np.nan)
        for place in _series(echoes, view, bending, facing):
            on_it = np.flatnonzero(np.abs(place - view.ambiguous - echoes.range) <= EXPECTED_CELLS * view.range_cell)
            if len(series) and on_it.size:
                row = (series[:, on_it] - view.range[0]) / view.dr
                inside_image = (row >= 0.0) & (row <= view.range.size - 1)
                row = np.where(inside_image, np.rint(np.nan_to_num(row)), 0.0).astype(np.intp)
                before = nearby()[row, echoes.direction[on_it]]
                found[on_it] |= inside_image.any(axis=0) & ((before >= level[on_it]) | ~inside_image).all(axis=0)
            series = np.concatenate([series, place[None]])
    if not found.any():
        return found
    number = object_numbers(view, echoes.range, echoes.direction)
    return np.asarray(found[strongest_of(number, echoes.amplitude)][number])


def _brightest(view: ImageView) -> Array:
    """The largest amplitude of an image within `NEAR_CELLS` of each sample, (nr, nu)."""
    cells = view.range_cell / view.dr, view.u_cell / view.du
    size = tuple(2 * round(near * cell) + 1 for near, cell in zip(NEAR_CELLS, cells, strict=True))
    return np.asarray(maximum_filter(view.amplitude, size=size, mode="constant"))


def _series(echoes: Echoes, view: ImageView, bending: Array, facing: Array) -> Iterator[Array]:
    """Ranges of the echoes of a series, (n,) [m], for an edge of a wall in the direction of each echo; NaN if none.

    First those after one visit of the facing wall, then after two, and so on, up to twice the ambiguous range.

    Parameters
    ----------
    echoes : Echoes
    view : ImageView
    bending, facing : (2, 2) arrays [m]
        Ends of the wall whose edges bend waves, and of the wall that it faces, where they truly stand.
    """
    sight = view.sight[echoes.direction]
    edge, along = crossing(view.radar, view.radar + sight, *bending)
    on_it = (edge > 0.0) & (np.abs(along - 0.5) <= 0.5 + BEYOND)
    place = view.radar + np.where(on_it, edge, np.nan)[:, None] * sight
    # Unfolded, the wave goes straight on through the images of both walls in each other, and returns from the last one.
    before, wall, way = bending, facing, np.zeros(len(echoes))
    while on_it.any():
        normal, span = segment_normal(*wall), wall[1] - wall[0]
        last, way = way, np.abs(signed_distance(place, wall[0], normal))
        share = (place - wall[0]) @ span / (span @ span)
        with np.errstate(invalid="ignore"):
            on_it = on_it & (np.abs(share - 0.5) <= 0.5 + BEYOND) & (way - last >= APART_CELLS * view.range_cell)
            on_it &= edge + way <= 2.0 * view.ambiguous
        yield np.where(on_it, edge + way, np.nan)
        before, wall = wall, reflect(before, wall[0], normal)
