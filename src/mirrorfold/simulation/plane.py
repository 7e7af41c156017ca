"""The plane of a two-dimensional scene."""

from __future__ import annotations

import numpy as np

from mirrorfold.common.types import Array
from mirrorfold.errors import InputError


def in_plane(position: Array) -> Array:
    """Antenna positions (n, 2) [m] in the plane of a two-dimensional scene.

    Raises
    ------
    InputError
        If one stands outside it.
    """
    if np.any(position[:, 2] != 0.0):
        raise InputError(
            f"array: an antenna stands at z = {position[np.argmax(np.abs(position[:, 2])), 2]:g} m, expected z = 0 "
            "in a scene of two dimensions; leave the third coordinate out of center and direction"
        )
    return np.ascontiguousarray(position[:, :2])
