"""Echoes from beyond the ambiguous range that the edge of a wall sends on, from between it and a wall that it faces.

The edge of a wall bends waves to all sides, also square towards another wall, and what returns from there to the radar.
If the first wall faces the other, it sends back what it does not bend, so that the wave goes to and fro between both,
and hardly fades. In the direction of the edge, which is at the range r0 and the distance d from the other wall, stands
an echo at r0 + d, one at r0 + 2 d, and so on. Where equal frequency steps cannot tell the range r from r - P, with P
the ambiguous range, late ones stand among the things nearby, and there is no row of them as there is of late walls.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cached_property
from itertools import permutations

import numpy as np
from scipy.ndimage import maximum_filter

from mirrorfold.common.geometry import crossing, reflect, segment_normal, signed_distance
from mirrorfold.common.types import Array, Chain, Index, Mask
from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.mirrors.mirror import Mirror, fold_of
from mirrorfold.detection.views.image_view import ImageView
from mirrorfold.detection.views.view import View
from mirrorfold.tree.late_walls import APART_CELLS, BEYOND, MOST_WALLS
from mirrorfold.tree.things import things

CELLS = 0.75
"""How far an echo may be, in range cells, from where it is expected: it is seen half a cell off, and walls are, too."""

NEAR_CELLS = 1.0, 2.0
"""How far in range and direction, in resolution cells, the earlier echoes of the series may be from where they are
expected: edges bend waves to more than one beam, and of the later ones the wave has wandered along the walls."""

FADED_DB = 3.0
"""An echo may be this much stronger than an earlier one of its series, which it follows fainter: for speckle."""


def late_edges(echoes: Echoes, ways: Mapping[Chain, tuple[Mirror, ...]], view: View) -> Mask:
    """Which echoes are late ones of edges of walls that are known, (n,); in a volume, and without any range P, none.

    Those of one thing are what its brightest is. All of the same series that come before it, as far as the image
    reaches, must be there and be as strong, but for what an image amplifies later ones less.

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
    flat = sorted((way for way in ways.values() if way and not any(one.curved for one in way)),
                  key=lambda way: -way[-1].strength)[:MOST_WALLS]  # fmt: skip
    walls, image = [fold_of(before, view.dimensions)(wall.ends) for *before, wall in flat], _Brightest(view)
    # An image amplifies by the range that it takes echoes to have.
    level = echoes.amplitude * ((echoes.range + view.ambiguous) / echoes.range) ** view.power
    level *= 10.0 ** (-FADED_DB / 20.0)
    for one, other in permutations(walls, 2):
        series = np.full((0, len(echoes)), np.nan)
        for place in _series(echoes, view, one, other):
            on_it = np.flatnonzero(np.abs(place - view.ambiguous - echoes.range) <= CELLS * view.range_cell)
            if len(series) and on_it.size:
                before = image.at(series[:, on_it], echoes.direction[on_it])
                held = np.isfinite(before)
                found[on_it] |= held.any(axis=0) & ((before >= level[on_it]) | ~held).all(axis=0)
            series = np.concatenate([series, place[None]])
    if not found.any():
        return found
    thing = things(view, echoes.range, echoes.direction)
    brightest = np.lexsort([-echoes.amplitude, thing])
    brightest = brightest[np.unique(thing[brightest], return_index=True)[1]]
    return np.asarray(found[brightest][thing])


class _Brightest:
    """What an image shows near places of it."""

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


def _series(echoes: Echoes, view: ImageView, one: Array, other: Array) -> Iterator[Array]:
    """Ranges at which edges of a wall in the directions of echoes are seen by way of another, (n,) [m], NaN for none.

    First by one visit of the other wall, then by two, and so on, up to twice the ambiguous range.

    Parameters
    ----------
    echoes : Echoes
    view : ImageView
    one, other : (2, 2) arrays [m]
        Ends of both walls, where they truly stand.
    """
    sight = view.sight[echoes.direction]
    edge, along = crossing(view.radar, view.radar + sight, *one)
    on_it = (edge > 0.0) & (np.abs(along - 0.5) <= 0.5 + BEYOND)
    place = view.radar + np.where(on_it, edge, np.nan)[:, None] * sight
    # The wave goes straight on through the images of both walls in each other, and returns from the last of them.
    before, wall, way = one, other, np.zeros(len(echoes))
    while on_it.any():
        normal, span = segment_normal(*wall), wall[1] - wall[0]
        last, way = way, np.abs(signed_distance(place, wall[0], normal))
        share = (place - wall[0]) @ span / (span @ span)
        with np.errstate(invalid="ignore"):
            on_it = on_it & (np.abs(share - 0.5) <= 0.5 + BEYOND) & (way - last >= APART_CELLS * view.range_cell)
            on_it &= edge + way <= 2.0 * view.ambiguous
        yield np.where(on_it, edge + way, np.nan)
        before, wall = wall, reflect(before, wall[0], normal)
