"""Echoes near the end of a mirror: the antennas that receive them decide whether they are seen past it or in it.

Lines of sight are drawn from the middle of the radar. Where a mirror ends near the radar, some antennas look past its
end at the objects behind, while others look into the mirror, just as an edge throws a half-shadow if the lamp is large.
An object behind the mirror is received by the former antennas alone, an object that the mirror shows by the latter
alone. So each echo is focused twice, by the antennas whose line to it meets the mirror and by those whose line misses
it, and the two amplitudes are compared. From these echoes follows the `overhang` of the mirror at that end: the length
beyond its end (negative: before its end) up to which lines of sight are taken to meet the mirror.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from mirrorfold.common.decibels import to_db
from mirrorfold.common.geometry import crossing, unit
from mirrorfold.common.types import Array, Mask
from mirrorfold.detection import Echoes, ImageView, LineMirror, Mirror, View
from mirrorfold.tree.explaining.directions import amplitude_at
from mirrorfold.tree.explaining.edges import BEHIND_CELLS
from mirrorfold.tree.explaining.waves import SweepWaves
from mirrorfold.tree.ordering import Order

OVERHANG_COLUMNS = "beyond_start", "beyond_end"
"""Columns of a table of mirrors that hold their overhangs [m], at start and end."""

LEAST_SHARE = 0.15
"""Least share of the antennas in each of the two groups: fewer antennas resolve too little."""

CLEARER_DB = 12.0
"""Least difference in amplitude between the two groups of antennas; in full waves it is mostly 20 to 50 dB."""

DIRECTIONS = 8.0
"""What was measured at an end of a mirror is kept for mirrors whose direction rounds to the same multiples of one over
this number. Another mirror that ends there, in another direction, divides the antennas otherwise."""

LEAST_ZONES = 2.3
"""Least spread of the antennas in Fresnel zones, where the paths to an echo pass the end of the mirror: an edge bends
waves over one zone, which blurs a half-shadow of few zones."""

Known = dict[tuple[float, ...], float]


class Overhangs(NamedTuple):
    """Lengths beyond the ends of mirrors up to which lines of sight meet these, for the ends where they are known.

    The `end` (n, 2) [m] is that of a mirror in the image, and `length` (n,) [m] the overhang there: beyond that end, or
    before it if negative.
    """

    end: Array = np.empty((0, 2))
    length: Array = np.empty(0)

    def same(self, other: Overhangs) -> bool:
        """Whether both hold the same ends and lengths."""
        return np.array_equal(self.end, other.end) and np.array_equal(self.length, other.length)

    def on(self, mirrors: Sequence[Mirror], view: View) -> Sequence[Mirror]:
        """The mirrors, each with the overhangs that are known within a resolution cell of its ends."""
        if not self.length.size:
            return mirrors
        return [self._on(one, view) if isinstance(one, LineMirror) else one for one in mirrors]

    def _on(self, mirror: LineMirror, view: View) -> LineMirror:
        away = np.linalg.norm(mirror.ends[:, None] - self.end, axis=2)
        near = away.min(axis=1) <= [view.cell_at(end) for end in mirror.ends]
        first, last = np.where(near, self.length[away.argmin(axis=1)], 0.0)
        return replace(mirror, overhang=(float(first), float(last)))


def half_shadows(order: Order, echoes: Echoes, waves: SweepWaves, known: Known) -> Overhangs:
    """The overhangs of the mirrors of an order, from which antennas receive which of the echoes that it was found with.

    The `waves` are of several transmitters and receivers. `known` holds the measurements of earlier calls; those of
    this call are added.
    """
    view = order.view
    if not isinstance(view, ImageView) or min(len(side.position) for side in waves.apertures) < 2:
        return Overhangs()
    asked = np.zeros(len(echoes), dtype=bool)
    seen = np.flatnonzero(echoes.visible & echoes.strong)
    asked[seen[view.brightest(echoes.position[seen], echoes.amplitude[seen])]] = True
    ends, lengths = [np.empty((0, 2))], list[float]()
    for index, mirror in enumerate(order.mirrors):
        if not isinstance(mirror, LineMirror):
            continue
        # Echoes behind the line of the mirror whose own line of sight gets there by the way by which the radar sees the
        # mirror: it may meet the mirror there, or pass its end.
        met = view.meets(mirror.normal, mirror.center)[echoes.direction]
        beside = order.seen_through(met, echoes.direction) == order.parent[index]
        behind = mirror.behind(view, echoes.position) > BEHIND_CELLS * view.range_cell
        own = asked & beside & behind & (order.face != index)
        for end, far_end in (mirror.ends, mirror.ends[::-1]):
            outside, excess = _in_half_shadow(echoes.take(own), view, end, end - far_end, waves, known)
            reach = 0.5 * view.cell_at(end)
            length = max(_overhang(outside, excess > 0.0, reach), -0.5 * mirror.size)
            if length != 0.0:
                ends.append(end[None])
                lengths.append(length)
    return Overhangs(np.concatenate(ends), np.array(lengths))


def _beyond(start: Array, places: Array, end: Array, outward: Array) -> Array:
    """Distance [m] beyond a mirror's end at which lines from points (m, 2) to places (n, 2) meet its line, (n, m)."""
    return crossing(start, places[:, None], end, end + unit(outward))[1]


def _in_half_shadow(
    echoes: Echoes, view: ImageView, end: Array, outward: Array, waves: SweepWaves, known: Known
) -> tuple[Array, Array]:
    """For each echo in the half-shadow of an end that is clearly stronger at one group of antennas: how far beyond the
    end its line of sight passes [m], and how much stronger the antennas that look into the mirror receive it [dB].
    """
    tx, rx = (_beyond(side.position[:, :2], echoes.position, end, outward) for side in waves.apertures)
    share = np.stack([(side <= 0.0).mean(axis=1) for side in (tx, rx)])
    inside = ((share >= LEAST_SHARE) & (share <= 1.0 - LEAST_SHARE)).all(axis=0)
    half = np.flatnonzero(inside & (_zones(view, echoes.range, end) >= LEAST_ZONES))
    range_, u = view.to_polar(echoes.position[half])
    which = np.rint(end / view.range_cell), np.rint(DIRECTIONS * unit(outward))
    where = [(*place, *np.concatenate(which)) for place in zip(range_.tolist(), u.tolist(), strict=True)]
    new = np.array([i for i, place in enumerate(where) if place not in known], dtype=np.intp)
    if new.size:
        looks = [side[half[new]] <= 0.0 for side in (tx, rx)]
        groups = looks, [~side for side in looks]
        into, past = (amplitude_at(waves, view, range_[new], u[new], *sides) for sides in groups)
        level = to_db(into) - to_db(past)
        known |= {where[i]: excess for i, excess in zip(new, level.tolist(), strict=True)}
    excess = np.array([known[place] for place in where])
    clear = np.abs(excess) >= CLEARER_DB
    middle = _beyond(view.radar[None], echoes.position[half], end, outward)[:, 0]
    return middle[clear], excess[clear]


def _zones(view: ImageView, range_: Array, end: Array) -> Array:
    """Width of the aperture in Fresnel zones, where the paths from echoes at ranges (n,) [m] pass an end, (n,).

    At the distance d of the end, the paths from an echo at range r to an aperture of length L are spread over the width
    ``L (r - d) / r``. A zone there is ``sqrt(lambda d (r - d) / r)`` wide (Born and Wolf, Principles of Optics, 7th
    ed., 8.3).
    """
    distance = np.linalg.norm(end - view.radar)
    length = min(view.aperture_tx, view.aperture_rx)  # in wavelengths
    ahead = np.maximum(range_ - distance, 0.0)
    return length * np.sqrt(view.wavelength * ahead / (range_ * distance))


def _overhang(outside: Array, into: Mask, reach: float) -> float:
    """Length [m] beyond its end up to which a mirror is met, chosen so that the fewest echoes are on the wrong side.

    The line of sight of each echo passes `outside` [m] beyond the end, (n,), and `into` (n,) marks the echoes that are
    seen by way of the mirror. The mirror may be taken to end up to `reach` [m] beyond the outermost of them.
    """
    if not outside.size:
        return 0.0
    place = np.sort(outside)
    tried = np.concatenate([[0.0, place[0] - reach, place[-1] + reach], 0.5 * (place[1:] + place[:-1])])
    wrong = np.count_nonzero(into != (outside <= tried[:, None]), axis=1)
    return float(min(zip(wrong, np.abs(tried), tried, strict=True))[2])
