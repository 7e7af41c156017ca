"""What curved mirrors have in common, in the floor plan and in space."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mirrorfold.common.types import Array, Mask
from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.mirrors.mirror import Mirror
from mirrorfold.detection.views.view import View

LARGEST_DIMMING = 10.0 ** (30.0 / 20.0)
"""Mirrors that dim by more than 30 dB are taken to dim by 30 dB: weaker echoes cannot be told from multiple scattering,
which starts 15 dB below echoes that were scattered once."""


def last_curved(way: Sequence[Mirror]) -> Mirror | None:
    """The last curved mirror on a way, if there is one."""
    return next((mirror for mirror in reversed(way) if mirror.curved), None)


def growth_over(way: Sequence[Mirror], points: Array) -> Array:
    """`Mirror.growth` of the last curved mirror on a way at points (n, d); ones for flat mirrors."""
    mirror = last_curved(way)
    return np.ones((len(points), 1)) if mirror is None else mirror.growth(points)


def fit_variances(offset: float, angle: float, curvature: float, way: Array) -> tuple[Array, Array]:
    """Variances of a fitted surface's place [m^2] and of its direction [rad^2], ways (n,) [m] from its middle, (n,).

    They follow from the standard errors of its offset [m], angle [degree] and curvature [1/m]; NaN counts as zero.
    """
    offset, angle, curvature = (float(np.nan_to_num(error)) for error in (offset, angle, curvature))
    return offset**2 + (0.5 * way**2 * curvature) ** 2, np.radians(angle) ** 2 + (way * curvature) ** 2


def dimming(way: Sequence[Mirror], points: Array) -> Array:
    """By how much amplitudes at points (n, d) of the image are weaker than by way of flat mirrors, (n,), at least one.

    Waves that spread to `|q|` instead of the length r of the way lose ``sqrt(|q| / r)`` there and as much back, in
    space along either direction. Where a concave mirror gathers them, what is brighter is not counted on: the array's
    own depth of focus takes it away.
    """
    return np.clip(np.prod(growth_over(way, points), axis=1), 1.0, LARGEST_DIMMING)


def dimmed(echoes: Echoes, view: View, mirrors: Sequence[Mirror]) -> Echoes:
    """The echoes of a volume with thresholds lowered by what curved mirrors take from those behind them."""
    gain = np.ones(len(echoes))
    for mirror in mirrors:
        behind = echoes.range > mirror.crossing(view)[echoes.direction]
        gain[behind] = np.maximum(gain[behind], dimming([mirror], echoes.position[behind]))
    limit = echoes.limit / gain
    return replace(echoes, limit=limit, strong=echoes.strong | (echoes.amplitude >= limit))


def on_rows(rows: Sequence[Mirror], view: View, echoes: Echoes) -> Mask:
    """Which echoes lie on one of the rows or sheets, (n,)."""
    found = np.zeros(len(echoes), dtype=bool)
    for row in rows:
        found |= row.own(view, echoes)
    return found


def overlap(row: Mirror, other: Mirror) -> bool:
    """Whether the middle of one row or sheet lies on the other, within a tenth of its size."""
    return bool(other.holds(row.center[None], 0.1 * other.size, 0.0)[0])
