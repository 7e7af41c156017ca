"""Transmitters, or receivers, of a block of the factorised back-projection: as a few pixels see them.

A block pairs some transmitters with some receivers, and the same ones are in many blocks.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from mirrorfold.common.geometry import unit_or_zero
from mirrorfold.common.types import Array, Index


@dataclass(frozen=True, eq=False)
class Side:
    """What a block's band depends on of its transmitters, or of its receivers.

    Attributes
    ----------
    centre : (3,) array [m]
        Middle of the antennas.
    extent : float [m]
        Largest extent of the antennas along an axis.
    halves : tuple of two int arrays
        Indices of the antennas in two halves, cut square to the axis along which they extend most.
    from_centre : (pixels, 3) array
        Unit vectors from the centre to the pixels.
    low, high : (pixels, 3) arrays
        Least and largest components of the unit vectors from the antennas to these pixels.
    """

    centre: Array
    extent: float
    halves: tuple[Index, Index]
    from_centre: Array
    low: Array
    high: Array

    @classmethod
    def of(cls, position: Array, which: Index, pixels: Array) -> Side:
        """Of some of the antennas at positions (n, 3) [m], before pixels (m, 3) [m]."""
        antennas = position[which]
        centre, sight = middle_of(antennas), _towards(_outermost(antennas), pixels)
        extent = np.ptp(antennas, axis=0)
        order = which[np.argsort(antennas[:, int(np.argmax(extent))], kind="stable")]
        halves = np.sort(order[: order.size // 2]), np.sort(order[order.size // 2 :])
        from_centre = _towards(centre[None], pixels)[0]
        return cls(centre, float(extent.max()), halves, from_centre, sight.min(axis=0), sight.max(axis=0))


def middle_of(antennas: Array) -> Array:
    """Middle (3,) of the box around antennas (n, 3)."""
    return np.asarray(0.5 * (antennas.min(axis=0) + antennas.max(axis=0)))


def _outermost(antennas: Array) -> Array:
    """The antennas (n, 3) [m] that stand farthest out in each of 26 directions, at most 26."""
    if len(antennas) <= 26:
        return antennas
    directions = np.array([d for d in product((-1, 0, 1), repeat=3) if any(d)])
    return antennas[np.unique(np.argmax(antennas @ directions.T, axis=0))]


def _towards(antennas: Array, pixels: Array) -> Array:
    """Unit vectors (n, m, 3) from antennas (n, 3) to pixels (m, 3)."""
    return unit_or_zero(pixels[None] - antennas[:, None])
