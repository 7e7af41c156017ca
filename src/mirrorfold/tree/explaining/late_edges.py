"""Echoes from beyond the ambiguous range that the edge of a wall sends on, after waves went to and fro before it.

The edge of a wall bends waves to all sides, also square towards another wall, and the wave that returns from there to
the radar. If both walls face each other, the first sends back what its edge does not bend, so that the wave goes to and
fro between them and hardly fades. In the direction of the edge, at the range r0 and the distance d from the other wall,
the image shows an echo at r0 + d, one at r0 + 2 d, and so on. Where equal frequency steps cannot tell the range r from
r - P, with P the ambiguous range, late ones stand among the objects nearby, but in no row as late walls do.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cached_property
from itertools import permutations

import numpy as np
from scipy.ndimage import maximum_filter

from mirrorfold.common.geometry import crossing, reflect, segment_normal, signed_distance
from mirrorfold.common.types import Array, Chain, Index, Mask
from mirrorfold.detection.echoes import Echoes, strongest_of
from mirrorfold.detection.mirrors.mirror import Mirror
from mirrorfold.detection.views.image_view import ImageView
from mirrorfold.detection.views.view import View
from mirrorfold.tree.explaining.late_walls import APART_CELLS
from mirrorfold.tree.explaining.true_walls import BEYOND, EXPECTED_CELLS, strongest_flat, true_ends
from mirrorfold.tree.grouping import object_numbers

NEAR_CELLS = 1.0, 2.0
"""How far, in range cells and in cells aside, the earlier echoes of a series may be from where they are expected: an
edge bends waves into more than one beam, and later on the wave has wandered along the walls."""

FADED_DB = 3.0
"""A series fades, but by speckle an echo may be this much stronger than an earlier one."""


def late_edges(echoes: Echoes, ways: Mapping[Chain, tuple[Mirror, ...]], view: View) -> Mask:
    """Which echoes are late ones of edges of walls that are known, (n,); in a volume, and without any range P, none.

    All echoes of an object are judged by its brightest one. All earlier echoes of the same series, as far as the image
    reaches, must be there and be as strong, apart from how an image amplifies echoes by their range.

    Parameters
    ----------
    echoes : Echoes
        Objects that one chain of mirrors shows, or that are in line of sight.
    ways : mapping of chain to tuple of Mirror
        The mirrors on the way to what each chain shows, as `MirrorTree.ways` tells. Of curved ones nothing is said.
    view : View
    """
    found = np.zeros(len(echoes), dtype=bool)
    if not isinstance(view, ImageView) or not np.isfinite(view.ambiguous) or not len(echoes):
        return found
    walls, image = [true_ends(way) for way in strongest_flat(ways.values())], _Brightest(view)
    # An image amplifies by the range that it takes echoes to have.
    level = echoes.amplitude * ((echoes.range + view.ambiguous) / echoes.range) ** view.power
    level *= 10.0 ** (-FADED_DB / 20.0)
    for bending, facing in permutations(walls, 2):
        series = np.full((0, len(echoes)), np.nan)
        for place in _series(echoes, view, bending, facing):
            on_it = np.flatnonzero(np.abs(place - view.ambiguous - echoes.range) <= EXPECTED_CELLS * view.range_cell)
            if len(series) and on_it.size:
                before = image.at(series[:, on_it], echoes.direction[on_it])
                held = np.isfinite(before)
                found[on_it] |= held.any(axis=0) & ((before >= level[on_it]) | ~held).all(axis=0)
            series = np.concatenate([series, place[None]])
    if not found.any():
        return found
    number = object_numbers(view, echoes.range, echoes.direction)
    return np.asarray(found[strongest_of(number, echoes.amplitude)][number])


class _Brightest:
    """The brightest that an image shows near places of it."""

    def __init__(self, view: ImageView) -> None:
        self.view = view

    @cached_property
    def level(self) -> Array:
        """The largest amplitude as near as `NEAR_CELLS` to each sample, (nr, nu)."""
        cells = self.view.range_cell / self.view.dr, self.view.u_cell / self.view.du
        size = tuple(2 * round(near * cell) + 1 for near, cell in zip(NEAR_CELLS, cells, strict=True))
        return np.asarray(maximum_filter(self.view.amplitude, size=size, mode="constant"))

    def at(self, range_: Array, direction: Index) -> Array:
        """That level at ranges (k, n) [m] in directions (n,); NaN beyond the image."""
        row = (range_ - self.view.range[0]) / self.view.dr
        inside = (row >= 0.0) & (row <= self.view.range.size - 1)
        row = np.where(inside, np.rint(np.nan_to_num(row)), 0.0).astype(np.intp)
        return np.where(inside, self.level[row, direction], np.nan)


def _series(echoes: Echoes, view: ImageView, bending: Array, facing: Array) -> Iterator[Array]:
    """Ranges at which edges of a wall, in the directions of echoes, are seen by way of a facing wall, (n,) [m], or NaN.

    First by one visit of the facing wall, then by two, and so on, up to twice the ambiguous range.

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
    # The wave goes straight on through the images of both walls in each other, and returns from the last of them.
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
