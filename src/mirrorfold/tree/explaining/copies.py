"""Echoes that are copies of stronger ones in front of them: the tail of the pulse, or the inside of a mirror's wall.

A pulse that rings on repeats every echo at a fixed delay, farther away and weaker. A wall with a layer inside does so,
too, but only with the echoes that it reflects, and once for each time that the wave meets the wall. So an echo that
follows most of the strong echoes at the same delay is a copy and no object. An echo that follows only one strong echo
may well be an object.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import label, maximum_filter

from mirrorfold.common.decibels import ratio_of
from mirrorfold.common.kernels import njit
from mirrorfold.common.types import ROOT, Array, Index, Mask
from mirrorfold.detection import Echoes, ImageView
from mirrorfold.detection.echoes import SIDE_LOBE_MARGIN_DB
from mirrorfold.detection.views.image_view import SAMPLES_PER_CELL
from mirrorfold.tree.ordering import Order

COPY = "is a copy of a stronger one, of the pulse's tail or a layer in a wall"

FOLLOWED = 0.75
"""Least share of the strong echoes that a copy must follow. In random scenes and in full waves, the level that this
share of the echoes has behind it is below -30 dB at every delay, so that no object is taken for a copy."""

FEWEST = 3
"""Least number of groups of strong echoes that prove copies: behind two, objects may stand alike by chance."""

SAME_CELLS = 1.5
"""Least delay of a copy, in range cells: nearer samples belong to the main lobe of the echo itself."""


def copies(order: Order, echoes: Echoes) -> Mask:
    """Which echoes are no stronger than copies of those in front of them, (n,); in a volume none.

    Copies by the pulse are sought among all direct echoes; copies by the wall of a mirror, among all echoes that the
    mirror reflects and those of its face. The `order` of the mirrors is that of the same echoes.
    """
    view = order.view
    found = np.zeros(len(echoes), dtype=bool)
    if not isinstance(view, ImageView):
        return found
    row, shown_by = view.row(echoes.range), order.shown_by(echoes)
    own = np.where(order.face == ROOT, shown_by, order.face)
    # Copies by the pulse begin at the radar, those by a wall at its face.
    sets = [(shown_by == ROOT, np.zeros(len(view.sight)))]
    sets += [(_reflected(own, order.parent, mirror), order.crossing[mirror]) for mirror in range(len(order.mirrors))]
    for reflected, begin in sets:
        which = np.flatnonzero(reflected & echoes.strong & echoes.visible)
        # An echo by way of a wall has met the wall twice, an echo of its face once.
        times = np.where(order.face[which] >= 0, 1.0, 2.0) if begin.any() else np.ones(which.size)
        level = copy_level(view, row[which], echoes.direction[which], times)
        found |= _explained(view, echoes, row, level, begin)
    return found


def _reflected(own: Index, parent: Index, mirror: int) -> Mask:
    """Which echoes are of a mirror's face, or are seen by way of it, also through further mirrors, (n,)."""
    found = own == mirror
    while (own := np.where(own >= 0, parent[np.maximum(own, 0)], ROOT)).max(initial=ROOT) >= 0:
        found |= own == mirror
    return found


def copy_level(view: ImageView, row: Index, column: Index, times: Array) -> Array:
    """Amplitude of a copy relative to its echo, for each delay in samples of range, (delays,); zero if there is none.

    Echoes that touch each other are one group. At each delay, the group has the median of the relative amplitudes
    behind its echoes. The level is the amplitude that the share `FOLLOWED` of all groups exceeds. The strong echoes are
    at the samples `row` and `column` (n,) of range and direction, and their waves have met the pulse or wall that makes
    the copies so many `times`, (n,).
    """
    amplitude = view.amplitude
    level = np.zeros(len(amplitude))
    at = np.zeros(amplitude.shape, dtype=bool)
    at[row, column] = True
    group = label(maximum_filter(at, size=2 * SAMPLES_PER_CELL + 1, mode="constant"))[0][row, column]
    groups = [np.flatnonzero(group == number) for number in np.unique(group)]
    if len(groups) < FEWEST:
        return level
    delay = np.arange(round(SAME_CELLS * SAMPLES_PER_CELL), level.size)
    after, before = row + delay[:, None], row - delay[:, None]
    counts = after < level.size
    # An echo that follows a stronger one at this delay may itself be a copy, and does not count.
    counts &= (before < 0) | (amplitude[before, column] <= amplitude[row, column])
    ratio = np.where(counts, amplitude[after * counts, column] / (times * amplitude[row, column]), np.nan)
    each = np.stack([_quantile(ratio[:, some], 0.5) for some in groups], axis=1)
    known = np.count_nonzero(np.isfinite(each), axis=1) >= FEWEST
    level[delay[known]] = _quantile(each[known], 1.0 - FOLLOWED)
    return level


def _quantile(values: Array, share: float) -> Array:
    """The quantile of the finite values in each row of (n, m), (n,); NaN in rows without any."""
    ordered = np.sort(values, axis=1)
    place = share * np.maximum(np.count_nonzero(np.isfinite(values), axis=1) - 1, 0)[:, None]
    low, high = (np.take_along_axis(ordered, edge(place).astype(np.intp), axis=1) for edge in (np.floor, np.ceil))
    return (low + (place % 1.0) * (high - low))[:, 0]


def _explained(view: ImageView, echoes: Echoes, row: Index, level: Array, begin: Array) -> Mask:
    """Which echoes may be copies of what the view shows in front of them, within a cell to either side, (n,).

    They exceed by no more than `SIDE_LOBE_MARGIN_DB` the copies of relative amplitude `level` (delays,). Copies by a
    wall begin at its face, at ranges `begin` (directions,) [m], and are twice as strong behind it.
    """
    # Delays at which even a copy of the strongest echo is weaker than all echoes can be skipped.
    margin = ratio_of(SIDE_LOBE_MARGIN_DB)
    enough = echoes.amplitude.min(initial=np.inf) / (2.0 * margin * view.amplitude.max(initial=np.finfo(float).tiny))
    delays = np.flatnonzero(level > enough)
    copy_amplitude = np.zeros(len(echoes))
    if delays.size:
        near, start = SAME_CELLS * view.range_cell, (begin - view.range[0]) / view.dr
        columns = echoes.direction, SAMPLES_PER_CELL, view.amplitude_by_direction
        _strongest_copies(row, *columns, delays, level[delays], start, near / view.dr, begin.any(), copy_amplitude)
    return echoes.amplitude <= margin * copy_amplitude


@njit(nogil=True, error_model="numpy")
def _strongest_copies(
    row: Index, direction: Index, beside: int, amplitude: Array, delays: Index, level: Array, start: Array, near: float,
    twice: bool, out: Array,
) -> None:  # fmt: skip
    """Amplitude of the strongest copy at each echo, (n,), into `out`: the largest ``t level[m] amplitude[c, row - d]``.

    The echo is at (`direction`, `row`), the directions c are its own and those `beside` it, and d is one of the rising
    `delays` (m,), in samples. Only samples from ``start[c] - near`` on are copied. The factor t is 1; but 2 for samples
    beyond ``start[c] + near``, if copies count `twice` there.
    """
    for n in range(row.size):
        for side in (-beside, 0, beside):
            column = min(max(direction[n] + side, 0), start.size - 1)
            for m in range(delays.size):
                before = row[n] - delays[m]
                behind = before - start[column]
                if before < 0 or behind < -near:
                    break
                times = 2.0 if twice and behind > near else 1.0
                out[n] = max(out[n], times * level[m] * amplitude[column, before])
