"""Pairs of a line array, gathered by their midpoints on a uniform lattice, and the polar coordinates that suit it.

Transmitters and receivers stand on two lines, or nearly so, about their middles t and q - the foci. The lines need not
coincide: a pixel's range r is half the path from t by way of the pixel to q, which takes off what the displacement of
the lines does to all pairs alike. With u the sine of the pixel's angle from broadside, as seen from a centre
between the foci, and X the midpoint of a pair, each antenna counted from its own focus along the unit vector e,

    r = (|p - t| + |p - q|) / 2,    R_i + R_k = 2 (r - X_s u) + E(pair; p):

X_s is the lattice point nearest to X, and E the rest: the curvature of the waves, the distance of the pair, and what
the array lacks in regularity. E varies slowly over the image: its values at few pixels tell those at all other pixels
(see `nodes`).

The second coordinate of a pixel is w. Antennas on one line see no more than how far along the line a pixel is, and how
far from it: w = u, in which E is analytic beyond 1, too. Antennas off a line also tell its sides apart, and what lies
above and below them: all pixels must then lie in one plane, w is the angle in that plane, and u = sin(w).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mirrorfold.common.types import Array, Index
from mirrorfold.focusing.problem import Problem, UnsuitedError

ON_LINE = 1e-7
"""Distance from the line that counts as none: with lengths in wavelengths a phase of 1e-6 rad."""


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
        Middles of the transmitters and of the receivers, from which the lattice counts.
    planar : bool
        The pixels' second coordinate is their angle in the image plane, not the cosine to the line.
    pitch : float [m]
        Lattice points stand at ``pitch * s`` for s from `lowest`.
    lowest : int
    first : (points + 1,) array
        Pairs ``first[n]:first[n+1]`` belong to the lattice point ``lowest + n``.
    tx, rx : (pairs,) arrays
        The elements of each pair.
    folded : bool
        Each pair i <= k also stands for (k, i): their data are added first.
    weight : (pairs,) complex array
        Product of the element weights, halved where a folded pair is its own partner.
    regular : bool
        The midpoints of all pairs stand on the lattice.
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
        """Whether both foci are one point of a line of all antennas."""
        return not self.planar and not self.places(self.foci).any()

    @property
    def scales(self) -> bool:
        """Whether k E depends on k and r by r / k alone, so that nodes at one wavenumber serve all.

        Where a midpoint stands beside its lattice point, E has a part that does not fall with range.
        """
        return self.concentric and self.regular

    def curvature(self, problem: Problem) -> float:
        """Half of the largest factor [m^2] of ``(1 - u^2) / r`` in a pair's path: without it the rest is halved."""
        tx, rx = ((a - f) @ self.frame[0] for a, f in zip((problem.tx, problem.rx), self.foci, strict=True))
        return 0.25 * float((tx[self.tx] ** 2 + rx[self.rx] ** 2).max())

    def places(self, position: Array) -> Array:
        """Coordinates [m] along the lattice, forward and upward, from the centre, (n, 3)."""
        place = (position - self.centre) @ self.frame.T
        place[np.abs(place) < ON_LINE] = 0.0
        return np.asarray(place)

    def length(self, problem: Problem) -> float:
        """Extent [m] of the antennas, the centre among them: the measure of what is near."""
        return float(np.linalg.norm(np.ptp(self.places(np.vstack([problem.tx, problem.rx, self.centre])), axis=0)))

    def direction(self, w: Array) -> tuple[Array, Array]:
        """Unit vector of the second coordinate: its parts along the lattice and forward.

        On one line the forward part is seen by no antenna, and left out.
        """
        return (np.sin(w), np.cos(w)) if self.planar else (w, np.zeros_like(w))

    def polar(self, x: Array, y: float, z: float) -> tuple[Array, Array]:
        """Range r and second coordinate w of a row of pixels."""

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
    """The lattice pitch [m] that antennas at places along a line ask for: half the finer of the two element pitches."""
    pitches = []
    for place in (tx, rx):
        along = np.unique(np.round(place, 9))
        if along.size > 1:
            pitches.append((along[-1] - along[0]) / (along.size - 1))
    finest = min(pitches) if pitches else 0.0
    return finest if monostatic else 0.5 * finest


def _frame(problem: Problem) -> tuple[Array, bool]:
    """Axes of the lattice, and whether it is seen in a plane.

    Raises
    ------
    UnsuitedError
        If the antennas stand at one place, or off a line while there is more than one image plane.
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
    """Unit vector along which places (n, 3) extend most, rounded to x, y or z where it nearly is one of these."""
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
    # The foci move to where the lattice counts from, so that its points are s * pitch.
    foci = foci + (origin - lowest * pitch) * axis
    # Paths turn with the directions from their own foci: the centre is nearer to that of the longer array.
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
