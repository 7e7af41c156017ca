"""Whether a polyline crosses itself or folds back on itself."""

from __future__ import annotations

import numpy as np

from mirrorfold.common.geometry import cross2
from mirrorfold.common.statistics import consecutive
from mirrorfold.common.types import Array, Index

PAIRS_AT_ONCE = 1_000_000
"""Number of pairs of pieces that are compared at once, which limits the memory."""

FOLDED = 1e-9
"""Largest sine of the angle between a piece and the next one, going backwards, at which both lie on each other."""


def meets_itself(points: Array) -> Array | None:
    """A place where the polyline through points crosses itself or folds back on itself; None if it does neither.

    Ends that touch, as those of a closed polyline, are no crossing.

    Parameters
    ----------
    points : (n, 2) array [m]
        No two consecutive points are the same.

    Returns
    -------
    (2,) array [m] or None

    Examples
    --------
    >>> meets_itself(np.array([[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]]))
    array([0.5, 0.5])
    >>> meets_itself(np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 0.0]]))
    """
    step = np.diff(points, axis=0)
    length = np.linalg.norm(step, axis=1)
    turn = cross2(step[:-1], step[1:])
    back = np.sum(step[:-1] * step[1:], axis=1) < 0.0
    folded = np.flatnonzero(back & (np.abs(turn) <= FOLDED * length[:-1] * length[1:]))
    if folded.size:
        return points[folded[0] + 1]
    # With pieces sorted along the longer axis of the polyline, a piece can only cross those that begin before it ends.
    along = np.sort(np.stack([points[:-1], points[1:]])[..., int(np.argmax(np.ptp(points, axis=0)))], axis=0)
    order = np.argsort(along[0])
    later = np.searchsorted(along[0, order], along[1, order], side="right") - np.arange(len(order)) - 1
    first = 0
    while first < len(order):
        last = max(first + 1, int(np.searchsorted(np.cumsum(later[first:]), PAIRS_AT_ONCE)) + first)
        one = np.repeat(np.arange(first, last), later[first:last])
        other = one + consecutive(1, later[first:last])
        place = _crossing(points, order[one], order[other])
        if place is not None:
            return place
        first = last
    return None


def _crossing(points: Array, one: Index, other: Index) -> Array | None:
    """The crossing (2,) of the first pair of pieces that truly cross, not only touch; None if there is none."""
    a, b, c, d = points[one], points[one + 1], points[other], points[other + 1]
    apart = cross2(b - a, c - a) * cross2(b - a, d - a) < 0.0
    crossing = np.flatnonzero(apart & (cross2(d - c, a - c) * cross2(d - c, b - c) < 0.0))
    if not crossing.size:
        return None
    at = crossing[0]
    share = cross2(c[at] - a[at], d[at] - c[at]) / cross2(b[at] - a[at], d[at] - c[at])
    return a[at] + share * (b[at] - a[at])
