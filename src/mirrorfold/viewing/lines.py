"""The lines and arcs that are edited in the live page."""

from __future__ import annotations

from typing import Any

import numpy as np

from mirrorfold.common.arcs import arc_through
from mirrorfold.common.types import Array


def without_straight_middle(points: Array) -> Array:
    """A given mirror [m] without its middle point, if that lies on the line between its ends; else unchanged."""
    return points[[0, -1]] if len(arc_through(points[0], points[len(points) // 2], points[-1])) == 2 else points


def line_of(ends: Any, lines: Array) -> int:
    """Index of the given line (n, 2, 2) or arc (n, 3, 2) [m] on which a mirror lies.

    It is the one with the smallest distance from the mirror's ends, of which the larger counts.
    """
    points = np.asarray(ends, dtype=float)[:, None]
    distances = []
    for line in lines:
        curve = arc_through(line[0], line[len(line) // 2], line[-1])
        start, way = curve[:-1], np.diff(curve, axis=0)
        along = np.sum(way * (points - start), axis=-1) / np.sum(way * way, axis=-1)
        nearest = start + np.clip(along, 0.0, 1.0)[..., None] * way
        distances.append(np.linalg.norm(points - nearest, axis=-1).min(axis=1).max())
    return int(np.argmin(distances))
