"""Pairs of a line array, sorted by their midpoints on a uniform lattice, and the polar coordinates of the pixels.

Far from a line of antennas, the path of a pair to a pixel depends almost only on the midpoint of the pair. Pairs with
the same midpoint can therefore be summed first, which leaves far fewer terms. Transmitters and receivers stand on two
lines, or nearly so, around their middles t and q, the foci. The lines need not coincide: the range r of a pixel p is
half the path from t by way of the pixel to q, which includes the effect of the displacement that all pairs share. Let u
be the sine of the pixel's angle from broadside, seen from a centre between the foci, and X the midpoint of a pair along
the line, where each antenna is counted from its own focus. Then

    r = (|p - t| + |p - q|) / 2,    R_i + R_k = 2 (r - X_s u) + E(pair; p),

where X_s is the lattice point nearest to X. The remainder E is due to the curvature of the waves, the distance between
transmitter and receiver, and irregular places of the antennas. It varies slowly over the image: its values at few
pixels determine those at all other pixels (see `nodes`).

The second coordinate of a pixel is w. Paths to antennas on one line depend only on how far along the line a pixel is,
and how far from it: then w = u, and E is an analytic function of w beyond 1, too. Paths to antennas off a line also
differ between its sides, and above and below it: all pixels must then lie in one plane, w is the angle in this plane,
and u = sin(w).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mirrorfold.common.types import Array, Index
from mirrorfold.focusing.problem import Problem, UnsuitedError

ON_LINE = 1e-7
"""Distances from a line below this count as zero: with lengths in wavelengths they turn phases by at most 1e-6 rad."""


@dataclass(frozen=True, eq=False)
class Lattice:
    """Pairs sorted by the lattice point s of their midpoint.

    Attributes
    ----------
    centre : (3,) array [m]
        Origin of the polar coordinates.
    frame : (3, 3) array
        Rows: unit vectors along the lattice, forward and upward.
    foci : (2, 3) array [m]
        Middles of the transmitters and of the receivers, moved along the line to the lattice point s = 0.
    planar : bool
        Whether the pixels' second coordinate is the angle in the image plane, not the cosine to the line.
    pitch : float [m]
        Lattice points stand at ``pitch * s`` for s from `lowest`.
    lowest : int
    first : (points + 1,) array
        Pairs ``first[n]:first[n+1]`` belong to the lattice point ``lowest + n``.
    tx, rx : (pairs,) arrays
        Indices of the transmitter and of the receiver of each pair.
    folded : bool
        Whether each pair i <= k also stands for the pair (k, i), whose samples are added first.
    weight : (pairs,) complex array
        Product of the weights of its antennas, halved for pairs (i, i) if folded.
    regular : bool
        Whether the midpoints of all pairs stand on lattice points.
    """

    centre: Array
    frame: Array
    foci: Array
    planar: bool
    pitch: float
    lowest: int
    first: Index
    tx: Index
    rx: Index
    folded: bool
    weight: NDArray[np.complex128]
    regular: bool

    @property
    def points(self) -> int:
        """Number of lattice points."""
        return self.first.size - 1

    @property
    def half_length(self) -> float:
        """Largest distance [m] of a lattice point from the centre."""
        return self.pitch * max(abs(self.lowest), abs(self.lowest + self.points - 1), 1)

    @property
    def point_of_pair(self) -> Array:
        """Lattice coordinate [m] of each pair."""
        return self.pitch * (self.lowest + np.repeat(np.arange(self.points), np.diff(self.first))).astype(float)

    @property
    def concentric(self) -> bool:
        """Whether all antennas stand on one line, and both foci at the centre."""
        return not self.planar and not self.places(self.foci).any()

    @property
    def scales(self) -> bool:
        """Whether k E depends on k and r only through r / k, nearly, so that nodes at one wavenumber serve all.

        This needs midpoints on the lattice points: otherwise E has a part that does not fall with range.
        """
        return self.concentric and self.regular

    def curvature(self, problem: Problem) -> float:
        """Half of the largest factor [m^2] of ``(1 - u^2) / r`` in a pair's path: without it E spans half as much."""
        tx, rx = ((a - f) @ self.frame[0] for a, f in zip((problem.tx, problem.rx), self.foci, strict=True))
        return 0.25 * float((tx[self.tx] ** 2 + rx[self.rx] ** 2).max())

    def places(self, position: Array) -> Array:
        """Coordinates (n, 3) [m] of positions (n, 3) [m]: along the lattice, forward and upward from the centre."""
        place = (position - self.centre) @ self.frame.T
        place[np.abs(place) < ON_LINE] = 0.0
        return np.asarray(place)

    def length(self, problem: Problem) -> float:
        """Extent [m] of the antennas and the centre, by which near and far are measured."""
        return float(np.linalg.norm(np.ptp(self.places(np.vstack([problem.tx, problem.rx, self.centre])), axis=0)))

    def direction(self, w: Array) -> tuple[Array, Array]:
        """Components of the unit vector in direction w: along the lattice, and forward.

        For antennas on one line the forward component has no effect, and is returned as zero.
        """
        return (np.sin(w), np.cos(w)) if self.planar else (w, np.zeros_like(w))

    def polar(self, x: Array, y: float, z: float) -> tuple[Array, Array]:
        """Range r [m] and second coordinate w of a row of pixels (x, y, z) [m]."""

        def distance(place: Array) -> Array:
            return np.asarray(np.sqrt((x - place[0]) ** 2 + ((y - place[1]) ** 2 + (z - place[2]) ** 2)))

        def part(axis: Array) -> Array:
            return (x - self.centre[0]) * axis[0] + ((y - self.centre[1]) * axis[1] + (z - self.centre[2]) * axis[2])

        r = distance(self.foci[0])
        if not np.array_equal(*self.foci):
            r = 0.5 * (r + distance(self.foci[1]))
        if self.planar:
            return r, np.asarray(np.arctan2(part(self.frame[0]), part(self.frame[1])))
        return r, part(self.frame[0]) / np.maximum(r if self.concentric else distance(self.centre), 1e-12)

    def distance(self, r: Array, w: Array) -> Array:
        """Distance [m] from the centre to the pixels at range r in direction w.

        On the ray ``d v`` from the centre the ellipse ``|d v - t| + |d v - q| = 2 r`` is a quadratic equation for d.
        """
        tx, rx = self.places(self.foci)
        if not tx.any() and not rx.any():
            return r
        u, ahead = self.direction(w)
        along_tx, along_rx = (f[0] * u + f[1] * ahead for f in (tx, rx))
        level = r + (rx @ rx - tx @ tx) / (4.0 * r)
        slope = (along_tx - along_rx) / (2.0 * r)
        linear, square = along_rx + level * slope, 1.0 - slope**2
        root = np.sqrt(np.maximum(linear**2 + square * (level**2 - rx @ rx), 0.0))
        return np.asarray((linear + root) / square)


def natural_pitch(tx: Array, rx: Array, monostatic: bool) -> float:
    """Lattice pitch [m] of antennas at places [m] along a line: half the finer of the two mean element pitches.

    Of one moving antenna the whole pitch, because each midpoint is the antenna itself.
    """
    pitches = []
    for place in (tx, rx):
        along = np.unique(np.round(place, 9))
        if along.size > 1:
            pitches.append((along[-1] - along[0]) / (along.size - 1))
    finest = min(pitches) if pitches else 0.0
    return finest if monostatic else 0.5 * finest


def _frame(problem: Problem) -> tuple[Array, bool]:
    """Axes (3, 3) of the lattice, and whether antennas stand off its line, so that the pixels must lie in a plane.

    Raises
    ------
    UnsuitedError
        If antennas stand off a line and there is more than one image plane.
    """
    every = np.concatenate([problem.tx, problem.rx])
    centred = every - every.mean(axis=0)
    axis = _longest(centred)
    off = centred - np.outer(centred @ axis, axis)
    planar = float(np.linalg.norm(off, axis=1).max()) >= ON_LINE
    if planar:
        if problem.z.size > 1:
            raise UnsuitedError("antennas off a line see the height of a volume's pixels")
        flat = np.array([1.0, 1.0, 0.0])
        axis = _longest(np.concatenate([(a - a.mean(axis=0)) * flat for a in (problem.tx, problem.rx)]))
    y = np.array([0.0, 1.0, 0.0]) if abs(axis[1]) <= 0.9 else np.array([1.0, 0.0, 0.0])
    forward = y - (y @ axis) * axis
    forward = forward / np.linalg.norm(forward)
    if planar:
        middle = np.array([problem.x.mean(), problem.y.mean(), problem.z[0]])
        forward = forward if (middle - every.mean(axis=0)) @ forward >= 0.0 else -forward
    return np.stack([axis, forward, np.cross(axis, forward)]), planar


def _longest(centred: Array) -> Array:
    """Unit vector along which places (n, 3) extend most, rounded to the axis x, y or z where it nearly is one."""
    axis = np.linalg.svd(centred, full_matrices=False)[2][0]
    axis = axis * np.sign(axis[np.argmax(np.abs(axis))])
    return np.round(axis) if np.abs(axis).max() > 1.0 - 1e-12 else axis


def build_lattice(problem: Problem) -> Lattice:
    """Sort the pairs of a problem on a lattice along its antennas.

    Raises
    ------
    UnsuitedError
        If the antennas stand at one place, or off a line while there is more than one image plane.
    """
    frame, planar = _frame(problem)
    axis = frame[0]
    foci = np.stack([problem.tx.mean(axis=0), problem.rx.mean(axis=0)])
    tx, rx = ((a - focus) @ axis for a, focus in zip((problem.tx, problem.rx), foci, strict=True))
    pitch = natural_pitch(tx, rx, problem.monostatic)
    if pitch == 0.0:
        raise UnsuitedError("the antennas stand at one place")
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
    # The foci are moved to the origin of the lattice, so that its points are s * pitch.
    foci = foci + (origin - lowest * pitch) * axis
    # Each path depends on the direction from its own focus: the centre is nearer to the focus of the longer array.
    share = np.ptp(rx) / (np.ptp(tx) + np.ptp(rx))
    centre = (1.0 - share) * foci[0] + share * foci[1]
    if planar:
        centre[2] = problem.z[0]
    order = np.lexsort((i, point))
    first = np.searchsorted(point[order], np.arange(int(point.max()) + 2))
    weight = problem.tx_weight[i] * problem.rx_weight[k]
    if folded:
        weight = np.where(i == k, 0.5 * weight, weight)
    regular = float(np.abs(middle - origin - pitch * point).max()) < ON_LINE
    return Lattice(
        centre, frame, foci, planar, pitch, lowest, first, i[order], k[order], folded, weight[order], regular
    )
