"""Pairs of a line array, gathered by their midpoints on a uniform lattice.

With antennas near a line through c along the unit vector e, and a pixel at distance r from c and u the cosine of its
angle to e, the path of a pair with midpoint X (along e) is ``R_i + R_k = 2 (r - X_s u) + E``: X_s is the nearest
point of the lattice, and E the rest - curvature, half the distance of the pair, and what the array lacks in
regularity. E varies slowly over the image: its values at
few pixels tell those at all others (see `nodes`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mirrorfold.common.types import Array, Index
from mirrorfold.focusing.problem import Problem


@dataclass(frozen=True, eq=False)
class Lattice:
    """Pairs sorted by the lattice point s of their midpoint.

    Attributes
    ----------
    centre, axis : (3,) arrays
        Origin [m] and direction of the lattice.
    pitch : float [m]
        Lattice points stand at ``centre + pitch * s * axis`` for s from `lowest`.
    lowest : int
    first : (points + 1,) array
        Pairs ``first[n]:first[n+1]`` belong to the lattice point ``lowest + n``.
    tx, rx : (pairs,) arrays
        The elements of each pair.
    folded : bool
        Each pair i <= k also stands for (k, i): their data are added first.
    weight : (pairs,) complex array
        Product of the element weights, halved where a folded pair is its own partner.
    """

    centre: Array
    axis: Array
    pitch: float
    lowest: int
    first: Index
    tx: Index
    rx: Index
    folded: bool
    weight: NDArray[np.complex128]

    @property
    def points(self) -> int:
        """Number of lattice points."""
        return self.first.size - 1

    @property
    def half_length(self) -> float:
        """Largest distance [m] of a lattice point from the centre."""
        return self.pitch * max(abs(self.lowest), abs(self.lowest + self.points - 1), 1)

    def curvature(self, problem: Problem) -> float:
        """Half of the largest factor [m^2] of ``(1 - u^2) / r`` in a pair's path: taken off, the rest is halved."""
        tx, rx = ((element - self.centre) @ self.axis for element in (problem.tx, problem.rx))
        return 0.25 * float((tx[self.tx] ** 2 + rx[self.rx] ** 2).max())

    @property
    def point_of_pair(self) -> Array:
        """Lattice coordinate [m] of each pair."""
        return self.pitch * (self.lowest + np.repeat(np.arange(self.points), np.diff(self.first))).astype(float)


def line_of(problem: Problem) -> tuple[Array, Array, float]:
    """Centre [m], direction and the largest distance [m] of an antenna from the best line through all of them."""
    every = np.concatenate([problem.tx, problem.rx])
    midpoints = 0.5 * (problem.tx.mean(axis=0) + problem.rx.mean(axis=0))
    centred = every - every.mean(axis=0)
    axis = np.linalg.svd(centred, full_matrices=False)[2][0]
    axis = axis * np.sign(axis[np.argmax(np.abs(axis))])
    if np.abs(axis).max() > 1.0 - 1e-12:
        axis = np.round(axis)
    off = centred - np.outer(centred @ axis, axis)
    return midpoints, axis, float(np.linalg.norm(off, axis=1).max())


def across(lattice: Lattice) -> tuple[Array, Array]:
    """Two unit vectors across the lattice: forward (as near to y as can be) and upward."""
    y = np.array([0.0, 1.0, 0.0])
    if abs(lattice.axis[1]) > 0.9:
        y = np.array([1.0, 0.0, 0.0])
    forward = y - (y @ lattice.axis) * lattice.axis
    forward = forward / np.linalg.norm(forward)
    return forward, np.cross(lattice.axis, forward)


def natural_pitch(problem: Problem, axis: Array) -> float:
    """The lattice pitch [m] that a regular array asks for: half the finer of the two element pitches."""
    pitches = []
    for element in (problem.tx, problem.rx):
        along = np.sort(element @ axis)
        if along.size > 1 and along[-1] > along[0]:
            pitches.append((along[-1] - along[0]) / (along.size - 1))
    finest = min(pitches) if pitches else 0.0
    return finest if problem.monostatic else 0.5 * finest


def build_lattice(problem: Problem, pitch: float) -> Lattice:
    """Sort the pairs of a problem on a lattice of the given pitch [m] along the best line."""
    centre, axis, _ = line_of(problem)
    tx, rx = (problem.tx - centre) @ axis, (problem.rx - centre) @ axis
    weights_agree = np.array_equal(problem.tx_weight, problem.rx_weight)
    folded = problem.coincident and not problem.monostatic and weights_agree
    if problem.monostatic:
        i = k = np.arange(tx.size)
    elif folded:
        i, k = np.triu_indices(tx.size)
    else:
        i, k = (a.ravel() for a in np.indices((tx.size, rx.size)))
    middle = 0.5 * (tx[i] + rx[k])
    origin = middle.min()
    point = np.rint((middle - origin) / pitch).astype(np.int64)
    lowest = -(int(point.max()) // 2)
    # The lattice's own centre becomes the origin of the polar coordinates, so that its points are s * pitch.
    centre = centre + (origin - lowest * pitch) * axis
    order = np.lexsort((i, point))
    first = np.searchsorted(point[order], np.arange(int(point.max()) + 2))
    weight = problem.tx_weight[i] * problem.rx_weight[k]
    if folded:
        weight = np.where(i == k, 0.5 * weight, weight)
    return Lattice(centre, axis, pitch, lowest, first, i[order], k[order], folded, weight[order])
