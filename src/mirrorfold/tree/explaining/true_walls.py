"""Flat walls where they truly stand: between them waves are followed to where their echoes are expected."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from mirrorfold.common.geometry import segment_normal, signed_distance, unit
from mirrorfold.common.types import Array
from mirrorfold.detection.mirrors.mirror import Mirror, fold_of

EXPECTED_CELLS = 0.75
"""How far an echo may be, in range cells, from where it is expected: it is seen half a cell off, and walls are, too."""

BEYOND = 1.0
"""How far a wall may go on beyond its ends, in lengths of what is seen of it: objects often hide half of it."""

MOST_WALLS = 16
"""The strongest walls that are looked at in pairs: the time grows with the square of their number."""

Way = tuple[Mirror, ...]
"""The mirrors on the way to what the last of them shows, the first first."""


def strongest_flat(ways: Iterable[Way]) -> list[Way]:
    """The ways that end at the strongest walls, of those without any curved mirror."""
    flat = (way for way in ways if way and not any(mirror.curved for mirror in way))
    return sorted(flat, key=lambda way: -way[-1].strength)[:MOST_WALLS]


def true_ends(way: Way) -> Array:
    """Ends of the last mirror of a way where it truly stands, (2, d) [m]."""
    *before, wall = way
    return fold_of(before, wall.ends.shape[1])(wall.ends)


def square_distances(places: Array, wall: Array) -> tuple[Array, Array]:
    """How far places (n, 2) [m] are from a wall, square to it, and along it beyond its ends, (n,) [m] each.

    The latter is negative for places before the wall itself, whose ends are `wall` (2, 2) [m].
    """
    start, end = wall
    along = np.abs((places - 0.5 * (start + end)) @ unit(end - start)) - 0.5 * float(np.linalg.norm(end - start))
    return np.abs(signed_distance(places, start, segment_normal(start, end))), along
