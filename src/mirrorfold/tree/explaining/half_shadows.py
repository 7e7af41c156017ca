"""What is seen past the end of a mirror, and what by way of it: told by which of the antennas see it.

Lines of sight are drawn from the middle of the radar. Where a mirror ends near the radar, some antennas look past its
end at what stands behind, while others look into the mirror, as an edge throws a half-shadow where the lamp is large.
What stands there is heard by the former alone, and what the mirror shows by the latter alone. So the echo is focused
twice, by the antennas whose line to it meets the mirror and by those whose line passes the mirror by: one group hears
the echo, the other hears nothing. Lines of sight are then taken to meet the mirror as far beyond its end as these
echoes tell, or not quite up to it: this length is the `hem` of the mirror there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import xarray as xr

from mirrorfold.common.geometry import crossing, unit
from mirrorfold.common.types import Array, Mask
from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.mirrors.line_mirror import LineMirror
from mirrorfold.detection.mirrors.mirror import Mirror
from mirrorfold.detection.views.image_view import ImageView
from mirrorfold.detection.views.view import View
from mirrorfold.sweep import antenna_positions
from mirrorfold.tree.explaining.directions import heard_by
from mirrorfold.tree.explaining.edges import BEHIND_CELLS
from mirrorfold.tree.ordering import Order

HEMS = "beyond_start", "beyond_end"
"""Columns of a table of mirrors that tell their hems [m]."""

LEAST_SHARE = 0.15
"""Least share of the antennas on either side: fewer resolve little."""

CLEARER_DB = 12.0
"""One side must hear an echo louder than the other by at least this. In full waves it mostly is 20 to 50 dB."""

LEAST_ZONES = 3.0
"""A half-shadow is seen where, on the echo's way past the end, the antennas are spread over at least so many Fresnel
zones: an edge bends waves over one of them."""

Known = dict[tuple[float, ...], float]


@dataclass(frozen=True)
class Hems:
    """How far lines of sight meet mirrors beyond their ends, where it is known.

    Attributes
    ----------
    end : (n, 2) array [m]
        Ends of mirrors, in the image.
    length : (n,) array [m]
        Beyond each; negative where antennas look past it.
    """

    end: Array
    length: Array

    @classmethod
    def nothing(cls) -> Hems:
        """None is known."""
        return cls(np.empty((0, 2)), np.empty(0))

    def same(self, other: Hems) -> bool:
        """Whether both say the same."""
        return np.array_equal(self.end, other.end) and np.array_equal(self.length, other.length)

    def on(self, mirrors: Sequence[Mirror], view: View) -> Sequence[Mirror]:
        """The mirrors with the hems of all ends that are a resolution cell from theirs at most."""
        if not self.length.size:
            return mirrors
        return [self._on(one, view) if isinstance(one, LineMirror) else one for one in mirrors]

    def _on(self, mirror: LineMirror, view: View) -> LineMirror:
        away = np.linalg.norm(mirror.ends[:, None] - self.end, axis=2)
        near = away.min(axis=1) <= [view.cell_at(end) for end in mirror.ends]
        first, last = np.where(near, self.length[away.argmin(axis=1)], 0.0)
        return replace(mirror, hem=(float(first), float(last)))


def half_shadows(order: Order, echoes: Echoes, sweep: xr.Dataset, known: Known) -> Hems:
    """How far lines of sight meet the mirrors of an order beyond their ends, by which antennas hear which echoes.

    Parameters
    ----------
    order : Order
    echoes : Echoes
        Those that the order was found with.
    sweep : xarray.Dataset
        Of several transmitters and receivers.
    known : dict
        What was measured in earlier calls; what is measured now is added.
    """
    view = order.sight.view
    hems = Hems.nothing()
    if not isinstance(view, ImageView) or min(map(len, antenna_positions(sweep))) < 2:
        return hems
    shown_by = order.shown_by(echoes)
    asked = np.zeros(len(echoes), dtype=bool)
    told = np.flatnonzero(echoes.visible & echoes.strong)
    asked[told[view.brightest(echoes.position[told], echoes.amplitude[told])]] = True
    ends, lengths = [hems.end], [hems.length]
    for index, mirror in enumerate(order.mirrors):
        if not isinstance(mirror, LineMirror):
            continue
        beside = (shown_by == index) | (shown_by == order.sight.parent[index])
        behind = mirror.behind(view, echoes.position) > BEHIND_CELLS * view.range_cell
        own = asked & beside & behind & (order.face != index)
        for end, far_end in (mirror.ends, mirror.ends[::-1]):
            outside, louder = _told(echoes.take(own), view, end, end - far_end, sweep, known)
            reach = 0.5 * view.cell_at(end)
            length = max(_hem(outside, louder > 0.0, reach), -0.5 * mirror.size)
            if length != 0.0:
                ends.append(end[None])
                lengths.append(np.array([length]))
    return Hems(np.concatenate(ends), np.concatenate(lengths))


def _beyond(start: Array, places: Array, end: Array, outward: Array) -> Array:
    """How far [m] beyond the end of a mirror lines from points (m, 2) to places (n, 2) meet its line, (n, m)."""
    return crossing(start, places[:, None], end, end + unit(outward))[1]


def _told(
    echoes: Echoes, view: ImageView, end: Array, outward: Array, sweep: xr.Dataset, known: Known
) -> tuple[Array, Array]:
    """Of each echo in the half-shadow of an end that one side hears clearly louder, how far beyond the end its line of
    sight passes [m], and how much louder the antennas that look into the mirror hear it [dB].
    """
    tx, rx = (_beyond(antennas[:, :2], echoes.position, end, outward) for antennas in antenna_positions(sweep))
    share = np.stack([(side <= 0.0).mean(axis=1) for side in (tx, rx)])
    told = ((share >= LEAST_SHARE) & (share <= 1.0 - LEAST_SHARE)).all(axis=0)
    half = np.flatnonzero(told & (_zones(view, echoes.range, end) >= LEAST_ZONES))
    range_, u = view.to_polar(echoes.position[half])
    where = [(*place, *np.rint(end / view.range_cell)) for place in zip(range_.tolist(), u.tolist(), strict=True)]
    new = np.array([i for i, place in enumerate(where) if place not in known], dtype=np.intp)
    if new.size:
        looks = [side[half[new]] <= 0.0 for side in (tx, rx)]
        into, past = (
            heard_by(sweep, view, range_[new], u[new], *sides) for sides in (looks, [~side for side in looks])
        )
        tiny = np.finfo(float).tiny
        known |= {where[i]: level for i, level in zip(new, 20.0 * np.log10((into + tiny) / (past + tiny)), strict=True)}
    louder = np.array([known[place] for place in where])
    clear = np.abs(louder) >= CLEARER_DB
    middle = _beyond(view.radar[None], echoes.position[half], end, outward)[:, 0]
    return middle[clear], louder[clear]


def _zones(view: ImageView, range_: Array, end: Array) -> Array:
    """How many Fresnel zones wide the aperture is, where the ways from echoes at ranges (n,) [m] pass an end, (n,).

    At the distance d of the end, what antennas see of an echo at range r passes over a width of ``L (r - d) / r`` of
    their L; the zone there is ``sqrt(lambda d (r - d) / r)`` wide (Born and Wolf, Principles of Optics, 7th ed., 8.3).
    """
    distance = np.linalg.norm(end - view.radar)
    length = min(view.aperture_tx, view.aperture_rx)  # in wavelengths
    ahead = np.maximum(range_ - distance, 0.0)
    return np.asarray(length * np.sqrt(view.wavelength * ahead / (range_ * distance)))


def _hem(outside: Array, into: Mask, reach: float) -> float:
    """How far beyond its end [m] a mirror is met, so that the fewest echoes are on the wrong side.

    Parameters
    ----------
    outside : (n,) array [m]
        How far beyond the end each echo's line of sight passes.
    into : (n,) bool array
        Those that are seen by way of the mirror.
    reach : float [m]
        How far beyond the outermost of these echoes the mirror may be taken to end.
    """
    if not outside.size:
        return 0.0
    place = np.sort(outside)
    tried = np.concatenate([[0.0, place[0] - reach, place[-1] + reach], 0.5 * (place[1:] + place[:-1])])
    wrong = np.count_nonzero(into != (outside <= tried[:, None]), axis=1)
    return float(min(zip(wrong, np.abs(tried), tried, strict=True))[2])
