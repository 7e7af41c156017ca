"""What curved mirrors have in common, in the floor plan and in space: above all, that they dim what they show.

A convex mirror spreads the waves, so that all echoes behind it are weaker than behind a flat mirror. The factor follows
from its shape, and thresholds behind it are lowered by it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mirrorfold.common.decibels import ratio_of
from mirrorfold.common.types import Array, Mask
from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.mirrors.mirror import Mirror
from mirrorfold.detection.views.image_view import ImageView
from mirrorfold.detection.views.view import View

LARGEST_DIMMING = ratio_of(30.0)
"""Largest factor by which mirrors are taken to dim amplitudes, 30 dB: weaker echoes cannot be distinguished from
multiple scattering, which starts 15 dB below echoes that were scattered once."""

SAME_ROW = 0.1
"""Two rows are the same if the middle of one lies on the other, or beside it by at most this share of the other's size.
A line and an arc over the same echoes differ in the middle by the bulge of the arc: by so much if it turns by 45
degrees."""


def last_curved(way: Sequence[Mirror]) -> Mirror | None:
    """The last curved mirror of a chain of mirrors; None if all are flat."""
    return next((mirror for mirror in reversed(way) if mirror.curved), None)


def growth_over(way: Sequence[Mirror], points: Array) -> Array:
    """`Mirror.growth` of the last curved mirror of a chain at points (n, d); ones if all are flat."""
    mirror = last_curved(way)
    return np.ones((len(points), 1)) if mirror is None else mirror.growth(points)


def dimming(way: Sequence[Mirror], points: Array) -> Array:
    """Factor by which amplitudes at points (n, d) of the image are weaker than by way of flat mirrors, (n,), at least
    1.

    Behind a flat mirror, a pencil of rays is as wide as the path is long, r, for each radian; behind a curved one it is
    |q| wide. The amplitude falls by ``sqrt(|q| / r)`` on the way there, and as much on the way back; in space along
    each of two directions. Where a concave mirror gathers waves, |q| < r, the gain is not counted: the depth of focus
    of the array takes it away.
    """
    return np.clip(np.prod(growth_over(way, points), axis=1), 1.0, LARGEST_DIMMING)


def gains(view: ImageView, mirrors: Sequence[Mirror]) -> Array:
    """Factor by which curved mirrors dim what the image shows behind them, (nr, nu); one elsewhere."""
    gain = np.ones((view.range.size, view.u.size))
    for mirror in mirrors:
        crossing = mirror.crossing(view)
        met = np.flatnonzero(np.isfinite(crossing))
        places = view.to_points(view.range[:, None], view.u[None, met])
        behind = view.range[:, None] > crossing[met]
        own = dimming([mirror], places.reshape(-1, 2)).reshape(behind.shape)
        gain[:, met] = np.where(behind, np.maximum(gain[:, met], own), gain[:, met])
    return gain


def dimmed(echoes: Echoes, view: View, mirrors: Sequence[Mirror]) -> Echoes:
    """The echoes of a volume, with the thresholds behind curved mirrors lowered by the factor by which these dim."""
    gain = np.ones(len(echoes))
    for mirror in mirrors:
        behind = echoes.range > mirror.crossing(view)[echoes.direction]
        gain[behind] = np.maximum(gain[behind], dimming([mirror], echoes.position[behind]))
    limit = echoes.limit / gain
    return replace(echoes, limit=limit, strong=echoes.strong | (echoes.amplitude >= limit))


def on_rows(rows: Sequence[Mirror], view: View, echoes: Echoes) -> Mask:
    """Which echoes lie on any of the rows or sheets, (n,)."""
    found = np.zeros(len(echoes), dtype=bool)
    for row in rows:
        found |= row.own(view, echoes)
    return found


def overlap(row: Mirror, other: Mirror) -> bool:
    """Whether the middle of one row or sheet lies on the other, to within `SAME_ROW`."""
    return bool(other.holds(row.center[None], SAME_ROW * other.size, 0.0)[0])
