"""Flat walls at their true places, between which paths of waves are followed to predict the places of echoes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mirrorfold.common.geometry import segment_normal, signed_distance, unit
from mirrorfold.common.types import Array
from mirrorfold.detection import Mirror, fold_of

EXPECTED_CELLS = 0.75
"""Largest distance of an echo from where it is expected, in range cells: echoes and walls each err by half a cell."""

BEYOND = 1.0
"""Largest length of a wall beyond either end, in lengths of its seen part: objects often hide half of a wall."""


def true_ends(way: Sequence[Mirror]) -> Array:
    """True places of the ends of the last mirror of a chain, (2, d) [m]."""
    *before, wall = way
    return fold_of(before, wall.ends.shape[1])(wall.ends)


def in_image(way: Sequence[Mirror], places: Array) -> Array:
    """Where true places (n, 2) [m] appear in the image by way of flat mirrors, (n, 2) [m]."""
    for mirror in way:
        places = mirror.reflection.inverse(places)
    return places


def square_distances(places: Array, wall: Array) -> tuple[Array, Array]:
    """Distance of places (n, 2) [m] from the line of a wall, and along it beyond the nearer end, (n,) [m] each.

    The latter is negative for places between the ends. `wall` (2, 2) [m] holds the ends.
    """
    start, end = wall
    along = np.abs((places - 0.5 * (start + end)) @ unit(end - start)) - 0.5 * float(np.linalg.norm(end - start))
    return np.abs(signed_distance(places, start, segment_normal(start, end))), along
