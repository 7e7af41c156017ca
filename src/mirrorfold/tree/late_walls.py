"""Echoes of walls that face each other, from beyond the ambiguous range.

Between two walls a wave goes to and fro and hardly fades: the image shows wall behind wall. Where equal frequency steps
cannot tell the range r from r - P, with P the ambiguous range, those from beyond it stand among the things nearby. Many
ways by rough walls add up there, so that no curvature tells their distance (`mirrorfold.tree.wrapped`); but the walls
are known, and lines of sight can be followed from one to the next.
"""

from __future__ import annotations

from itertools import cycle, permutations

import numpy as np
from scipy.ndimage import maximum_filter1d, uniform_filter1d

from mirrorfold.common.geometry import segment_normal
from mirrorfold.common.types import Array, Mask
from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.mirrors.mirror import fold_of
from mirrorfold.detection.search.lines import SMALLEST_FILL
from mirrorfold.detection.views.image_view import ImageView
from mirrorfold.tree.ordering import Order

CELLS, ACROSS_CELLS = 1.0, 1.0
"""How far an echo may be from where it is expected, in range cells and in resolution cells aside: it is seen half a
cell off, and so are walls, whose errors grow from one to the next."""

APART_CELLS = 4.0
"""Walls stand so many range cells apart, at least; what is nearer is another piece of the same."""

BEYOND = 1.0
"""How far beyond its ends a wall may go on, in lengths of what is seen of it: things often hide half of it."""

FEWEST_BOUNCES = 3
"""Meetings with walls from which on a way goes to and fro."""

STRETCH_CELLS = 8.0
"""Stretch of a row, in resolution cells, that must be filled: nothing says how far a row goes, which other things may
hide, and a few things that stand there by chance do not fill it."""

BRIGHTER_DB = 12.0
"""Such an echo is at most so much stronger than the brighter of both walls would be that far away: it has lost
something at each of them, but a wall that faces the radar shows a glint, four times the middle of its row. What stands
nearby is stronger, for an image amplifies the more the farther away."""

MOST_WALLS = 16
"""The strongest that are looked at: the time grows with the square of their number."""


def from_late_walls(order: Order, echoes: Echoes) -> Mask:
    """Which echoes stand where walls are seen by way of each other beyond the ambiguous range, (n,).

    Up to twice that range, where they are as weak as what has come so far, and fill a row as mirrors do, which no thing
    does that a line of sight meets there by chance; in a volume, and where ranges do not repeat, none.

    Parameters
    ----------
    order : Order
        Of the mirrors.
    echoes : Echoes
    """
    found, view = np.zeros(len(echoes), dtype=bool), order.sight.view
    if not isinstance(view, ImageView) or not np.isfinite(view.ambiguous):
        return found
    ways = [order.way(index) for index in range(len(order.mirrors))]
    flat = sorted((way for way in ways if not any(one.curved for one in way)), key=lambda way: -way[-1].strength)
    walls = [(fold_of(before, view.dimensions)(wall.ends), wall.strength) for *before, wall in flat[:MOST_WALLS]]
    faded = (echoes.range / (echoes.range + view.ambiguous)) ** view.power
    aside = round(ACROSS_CELLS * view.u_cell / view.du)
    beside = np.clip(echoes.direction + np.arange(-aside, aside + 1)[:, None], 0, len(view.sight) - 1)
    stretch = round(STRETCH_CELLS * view.u_cell / view.du)
    for (one, strength), (other, others) in permutations(walls, 2):
        weak = echoes.amplitude <= 10.0 ** (BRIGHTER_DB / 20.0) * max(strength, others) * faded
        late_ways = to_and_fro(view, one, other, 2.0 * view.ambiguous)[FEWEST_BOUNCES - 1 :] - view.ambiguous
        for late in late_ways:
            expected = late > view.range[0]
            on_it = expected[beside] & (np.abs(late[beside] - echoes.range) <= CELLS * view.range_cell)
            on_it = weak & on_it.any(axis=0)
            filled = np.zeros_like(expected)
            filled[echoes.direction[on_it]] = True
            full = uniform_filter1d(filled.astype(float), stretch, mode="constant") >= SMALLEST_FILL
            found |= on_it & maximum_filter1d(full, stretch)[echoes.direction]
    return found


def to_and_fro(view: ImageView, one: Array, other: Array, farthest: float) -> Array:
    """Ranges at which lines of sight meet two walls in turn, (bounces, nu) [m]; NaN where they do no more.

    Parameters
    ----------
    view : ImageView
    one, other : (2, 2) arrays [m]
        Their ends, where they truly stand, that first met first.
    farthest : float [m]
        Range up to which lines of sight are followed.
    """
    place, sight = np.repeat(view.radar[None], len(view.sight), axis=0), view.sight
    range_, met = np.zeros(len(view.sight)), list[Array]()
    for start, end in cycle((one, other)):
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
        sight = sight - 2.0 * (sight @ normal)[:, None] * normal
    return np.reshape(met, (len(met), len(view.sight)))
