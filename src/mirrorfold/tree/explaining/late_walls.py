"""Late walls: echoes of walls that face each other, from beyond the ambiguous range.

Between two walls a wave goes to and fro and hardly fades: the image shows wall behind wall. Equal frequency steps
cannot tell the range r from r - P, with P the ambiguous range, so that walls from beyond P stand among the objects
nearby. Many paths by rough walls add up in them, so that the curvature of the waves does not tell their distance (see
`wrapped`). But both walls are known: lines of sight are followed from one to the other, to where late walls are
expected.
"""

from __future__ import annotations

from itertools import cycle, permutations

import numpy as np
from scipy.ndimage import maximum_filter1d, uniform_filter1d

from mirrorfold.common.decibels import ratio_of
from mirrorfold.common.geometry import reflect, segment_normal
from mirrorfold.common.types import Array, Mask
from mirrorfold.detection import Echoes, ImageView
from mirrorfold.detection.search.lines import SMALLEST_FILL
from mirrorfold.tree.explaining.true_walls import BEYOND, strongest_flat, true_ends
from mirrorfold.tree.ordering import Order

LATE_WALL = "is of a wall seen in another one, from beyond the ambiguous range"

CELLS, ACROSS_CELLS = 1.0, 1.0
"""Largest distance of an echo from where it is expected, in range cells and in resolution cells aside: the places of
echoes and walls err by half a cell, and the errors of walls add from bounce to bounce."""

APART_CELLS = 4.0
"""Least way from one wall to the other along a line of sight, in range cells: nearer ones are pieces of the same
wall."""

FEWEST_BOUNCES = 3
"""Least number of bounces at walls of a wave that goes to and fro."""

STRETCH_CELLS = 8.0
"""Length of the part of a row, in resolution cells, that echoes must fill. The whole row need not be filled, as objects
may hide parts of it; but a few objects that stand there by chance do not fill this much."""

BRIGHTER_DB = 12.0
"""Largest level of such an echo over that of the brighter of both walls, if that wall were as far away. The wave has
lost power at each wall, but a wall that faces the radar shows a glint, four times the median of its row. Objects nearby
are stronger: an image amplifies echoes by their range, and a late one by its apparent range only."""


def from_late_walls(order: Order, echoes: Echoes) -> Mask:
    """Which echoes stand where walls are seen by way of each other beyond the ambiguous range, (n,).

    Up to twice the ambiguous range is searched. Such echoes are as weak as an echo from there would be, and fill a row,
    as a wall does and an object that stands there by chance does not. In a volume, or without an ambiguous range, none.
    """
    found, view = np.zeros(len(echoes), dtype=bool), order.sight.view
    if not isinstance(view, ImageView) or not np.isfinite(view.ambiguous):
        return found
    chains = [order.mirrors_to(index) for index in range(len(order.mirrors))]
    walls = [(true_ends(way), way[-1].strength) for way in strongest_flat(chains)]
    faded = (echoes.range / (echoes.range + view.ambiguous)) ** view.power
    aside = round(ACROSS_CELLS * view.u_cell / view.du)
    beside = np.clip(echoes.direction + np.arange(-aside, aside + 1)[:, None], 0, len(view.sight) - 1)
    stretch = round(STRETCH_CELLS * view.u_cell / view.du)
    for (first, strength), (second, second_strength) in permutations(walls, 2):
        weak = echoes.amplitude <= ratio_of(BRIGHTER_DB) * max(strength, second_strength) * faded
        late_ways = met_in_turn(view, first, second, 2.0 * view.ambiguous)[FEWEST_BOUNCES - 1 :] - view.ambiguous
        for late in late_ways:
            expected = late > view.range[0]
            on_it = expected[beside] & (np.abs(late[beside] - echoes.range) <= CELLS * view.range_cell)
            on_it = weak & on_it.any(axis=0)
            filled = np.zeros_like(expected)
            filled[echoes.direction[on_it]] = True
            full = uniform_filter1d(filled.astype(float), stretch, mode="constant") >= SMALLEST_FILL
            found |= on_it & maximum_filter1d(full, stretch)[echoes.direction]
    return found


def met_in_turn(view: ImageView, first: Array, second: Array, farthest: float) -> Array:
    """Ranges at which lines of sight meet two walls in turn, (bounces, nu) [m]; NaN from where they meet none.

    Parameters
    ----------
    view : ImageView
    first, second : (2, 2) arrays [m]
        Ends of the wall that is met first and of the other wall, where they truly stand.
    farthest : float [m]
        Range up to which lines of sight are followed.
    """
    place, sight = np.repeat(view.radar[None], len(view.sight), axis=0), view.sight
    range_, met = np.zeros(len(view.sight)), list[Array]()
    for start, end in cycle((first, second)):
        along, normal = end - start, segment_normal(start, end)
        with np.errstate(divide="ignore", invalid="ignore"):
            way = (start - place) @ normal / (sight @ normal)
            place = place + way[:, None] * sight
            share = (place - start) @ along / (along @ along)
            range_ = range_ + way
            on_it = (way > APART_CELLS * view.range_cell) & (np.abs(share - 0.5) <= 0.5 + BEYOND)
            range_ = np.where(on_it & (range_ <= farthest), range_, np.nan)
        if np.isnan(range_).all():
            break
        met.append(range_)
        sight = reflect(sight, 0.0, normal)
    return np.reshape(met, (len(met), len(view.sight)))
