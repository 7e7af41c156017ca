"""The plane z = 0 of a two-dimensional scene, in which all antennas must lie."""

from __future__ import annotations

import numpy as np

from mirrorfold.common.types import Array
from mirrorfold.errors import InputError


def in_plane(position: Array) -> Array:
    """Positions x and y (n, 2) [m] of antennas at positions (n, 3) [m] of a two-dimensional scene.

    Raises
    ------
    InputError
        If an antenna is outside the plane z = 0.
    """
    if np.any(position[:, 2] != 0.0):
        raise InputError(
            f"array: an antenna stands at z = {position[np.argmax(np.abs(position[:, 2])), 2]:g} m, expected z = 0 "
            "in a scene of two dimensions; leave the third coordinate out of center and direction"
        )
    return np.ascontiguousarray(position[:, :2])
