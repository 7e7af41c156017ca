"""By how much a slab delays and shifts a ray that passes through it."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from mirrorfold.common.slabs import inside
from mirrorfold.common.types import Array


def delay(permittivity: ArrayLike, thickness: ArrayLike, angle: ArrayLike) -> Array:
    """Length [m] by which a slab makes the way through it electrically longer, ``d (Re q - cos t)``."""
    return np.asarray(thickness) * (inside(permittivity, angle).real - np.cos(angle))


def shift(permittivity: ArrayLike, thickness: ArrayLike, angle: ArrayLike) -> Array:
    """Distance [m] by which a slab shifts a ray parallel to itself, ``d sin t (1 - cos t / Re q)``.

    It is the derivative of `delay` by the angle: an array that looks through the slab sees objects shifted by as much.
    """
    within = np.maximum(inside(permittivity, angle).real, np.finfo(float).tiny)
    return np.asarray(thickness) * np.sin(angle) * (1.0 - np.cos(angle) / within)
