"""Which parts of given arcs the radar sees, and from which side.

Seen from outside, a circle shows its near side, which bulges towards the radar. Where a wall follows only a part of the
circle, the radar looks past its ends at the inner face of the far side. An arc of a drawing, as a whole pillar, holds
parts of both.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from mirrorfold.common.geometry import cross2
from mirrorfold.detection.mirrors.arc_mirror import ArcMirror

SAME_CIRCLE = 0.01
"""Largest distance between the centers, and difference of the radii, of arcs of one circle that was drawn in pieces: a
share of the radius, as much as a drawing by hand is off."""

SHORTEST_SPAN = 1e-6
"""Smallest angle [rad] of a part: less is rounding where an arc ends at its outline."""

TURN = 2.0 * np.pi


def seen_parts(arcs: Sequence[ArcMirror]) -> list[list[ArcMirror]]:
    """The parts of each arc that the radar sees, each from one side; the arc itself where that is all of it.

    The far side of a circle is left out where arcs of the same circle stand before it: its mirror image would not be a
    part of that circle.
    """
    near = [[part for part in _cut(arc, _outline(arc)) if part.convex] for arc in arcs]
    seen = []
    for arc, own in zip(arcs, near, strict=True):
        same = [parts for other, parts in zip(arcs, near, strict=True) if _same(arc, other)]
        hidden = [_behind(part) for parts in same for part in parts]
        edges = [angle for interval in hidden for angle in interval]
        far = [part for part in _cut(arc, [*_outline(arc), *edges]) if not part.convex]
        seen.append([*own, *(part for part in far if not any(_within(part, *interval) for interval in hidden))])
    return seen


def _outline(arc: ArcMirror) -> list[float]:
    """Both angles [rad] at which lines of sight touch the circle; none if the radar stands inside."""
    away = arc.radar - arc.middle
    distance = float(np.linalg.norm(away))
    if distance <= arc.radius:
        return []
    towards, half = float(np.arctan2(away[1], away[0])), float(np.arccos(arc.radius / distance))
    return [towards - half, towards + half]


def _cut(arc: ArcMirror, angles: Sequence[float]) -> list[ArcMirror]:
    """The arc, cut at those of the angles [rad] that lie on it."""
    places = sorted((angle - arc.first) % TURN for angle in angles)
    cuts = [place for place in places if SHORTEST_SPAN < place < arc.span - SHORTEST_SPAN]
    if not cuts:
        return [arc]
    spans = pairwise([0.0, *cuts, arc.span])
    return [arc.part(a * arc.radius, b * arc.radius) for a, b in spans if b - a > SHORTEST_SPAN]


def _same(arc: ArcMirror, other: ArcMirror) -> bool:
    """Whether two arcs are parts of one circle."""
    most = SAME_CIRCLE * arc.radius
    return bool(np.linalg.norm(arc.middle - other.middle) <= most and abs(arc.radius - other.radius) <= most)


def _behind(part: ArcMirror) -> tuple[float, float]:
    """The angles [rad] between which the far side of the circle lies behind a part of its near side.

    A line of sight that meets the circle at the angle b, with the angle of incidence i, leaves it at ``b + pi - 2 i``.
    """
    first, last = part.first, part.first + part.span
    left = [angle + np.pi - 2.0 * _incidence(part, angle) for angle in (last, first)]
    return left[0], left[1]


def _incidence(part: ArcMirror, angle: float) -> float:
    """Angle [rad] from the normal of the circle, at the polar `angle` [rad], to the radar; positive clockwise."""
    normal = np.array([np.cos(angle), np.sin(angle)])
    away = part.radar - part.middle - part.radius * normal
    return float(np.arctan2(cross2(away, normal), normal @ away))


def _within(part: ArcMirror, first: float, last: float) -> bool:
    """Whether the middle of a part lies between two angles [rad], counter-clockwise."""
    return (part.first + 0.5 * part.span - first) % TURN <= (last - first) % TURN
