"""Coherence of echoes in pairs of antennas with the same midpoint: how far they have come, whatever they come from.

A rough wall sends speckle back: many echoes of random phase from slightly different directions. In a short array it may
resemble a wave of stronger or weaker curvature than its distance has. But the speckle depends on the midpoint of
transmitter and receiver alone. The path by way of any point in the direction u at the distance rho is, to second order,

    2 rho - 2 u m + (1 - u^2) (m^2 + h^2) / rho,        m = (x_i + x_k) / 2,  h = (x_i - x_k) / 2,

and a sum of echoes has the phases of a random function of m, times ``exp(-j k h^2 (1 - u^2) / rho)``. A flat face or
any smooth shape differs in the function of m only (Hubral, Geophysics 48, 1051-1062, 1983). So samples are added up in
phase within each midpoint, and powers over the midpoints, as seismologists find the velocity of waves (Neidell and
Taner, Geophysics 36, 482-497, 1971). What a wrong distance takes from this coherence is the variance of the phase that
it changes over the array. An array too short to tell the distance loses nothing, and claims nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mirrorfold.common.kernels import njit
from mirrorfold.common.threads import for_each
from mirrorfold.common.types import Array
from mirrorfold.diagnosis.wavefronts import Wavefronts
from mirrorfold.focusing.echoes.coherence import POINT, lengthen, look_up, profiles, sides_of, squares, windows
from mirrorfold.sweep.pairs import Pairs

SAME = 1.0 / 16.0
"""Midpoints, and distances, that differ by less than this share of a wavelength are the same: the phases of an echo
change by less than a quarter of a cycle there and back, even at grazing directions."""

FEWEST_DISTANCES = 3
"""Smallest number of distances between transmitter and receiver at a midpoint that is used: with two, noise in either
sample is half of the result."""

MOST_DISTANCES = 25
"""Largest number of distances at a midpoint, chosen at random; so that many midpoints are looked at."""


BLUR_STEPS = 1024
"""Differences of curvature for which the loss of coherence is calculated; in between it is interpolated."""


@dataclass(frozen=True, eq=False)
class MidpointCoherence:
    """How well echoes fit each curvature, and how well the array can tell two curvatures.

    Attributes
    ----------
    coherence : (gates, curvatures) array
        Share of a gate's power that adds up in phase within midpoints.
    sine : (gates,) array
        Of the angle off broadside from which a gate's echoes come.
    difference : (differences,) array [1/m]
        Rising from 0.
    loss : (differences,) array
        Share of the coherence of an echo ahead that is lost at a curvature that differs by this from its own.
    """

    coherence: Array
    sine: Array
    difference: Array
    loss: Array

    def lost(self, difference: Array) -> Array:
        """Share of the coherence that is lost where curvatures differ by this [1/m], (gates, differences).

        From the direction u the array is seen shorter by the cosine, and the phases of a wave bend by ``1 - u^2``.
        """
        seen = np.abs(difference) * (1.0 - self.sine[:, None] ** 2)
        return np.asarray(np.interp(seen, self.difference, self.loss))


def midpoint_coherence(
    pairs: Pairs, waves: Wavefronts, *, contracting: bool, reversed_: bool
) -> MidpointCoherence | None:
    """Measure the coherence within midpoints for each curvature of `waves` of one sign.

    It is taken in the direction in which all pairs together add up best. None where transmitters and receivers have too
    few midpoints in common.

    Parameters
    ----------
    pairs : Pairs
        With transmitters and receivers at their true places.
    waves : Wavefronts
    contracting : bool
        Whether waves contract: curvatures are negative.
    reversed_ : bool
        Whether delays shift against the phases.
    """
    found = _chosen(pairs, waves.pairs)
    if found is None:
        return None
    chosen, group = found
    profile, step = profiles(pairs.s[:, chosen], pairs.wavenumber)
    centre = float(pairs.wavenumber.mean())
    reach = float(np.linalg.norm(np.concatenate([pairs.tx, pairs.rx]), axis=1).max())
    windowed = windows(
        profile, waves.gate, int(np.ceil(2.0 * reach / step)) + 2, centre - float(pairs.wavenumber[0]), step
    )
    curvature = waves.one_sign(contracting)
    tx_of, rx_of = pairs.tx_of[chosen], pairs.rx_of[chosen]

    def measured(windowed: NDArray[np.float32], directions: Array) -> tuple[Array, Array, Array]:
        """The best coherence of all pairs over the directions, that of the midpoints there, and the direction."""
        best, coherence, sine = np.zeros((3, curvature.size, windowed.shape[-1]))

        def look(at: tuple[int]) -> None:
            _grouped(
                *(windowed, step, -1.0 if reversed_ else 1.0, pairs.tx, pairs.rx, tx_of, rx_of, group, centre),
                *(directions, curvature[at], waves.along, waves.ahead, best[at], coherence[at], sine[at]),
            )

        for_each(look, np.ndindex(curvature.size))
        return best, coherence, sine

    best, _, sine = measured(windowed, waves.direction)
    # One direction of each echo for all curvatures: a wave from nearer by and more from the side bends as much.
    sine = np.take_along_axis(sine, best.argmax(axis=0)[None], axis=0)[0]
    sign = -1.0 if contracting else 1.0
    coherence = np.empty((waves.gate.size, curvature.size))
    for gate, towards in enumerate(sine):
        alone = np.ascontiguousarray(windowed[..., gate : gate + 1])
        coherence[gate] = measured(alone, np.array([sign * towards]))[1][:, 0]
    difference = np.linspace(0.0, float(np.ptp(curvature)), BLUR_STEPS)
    return MidpointCoherence(
        coherence=coherence,
        sine=sine,
        difference=difference,
        loss=_loss(pairs.tx[tx_of], pairs.rx[rx_of], group, centre * difference),
    )


def _chosen(pairs: Pairs, most: int) -> tuple[NDArray[np.int64], NDArray[np.int64]] | None:
    """About `most` random pairs, ordered by midpoint, and the number of the midpoint of each: two (chosen,) arrays.

    Of pairs with the same midpoint and distance one is kept. None where no midpoint has enough distances.
    """
    tx, rx = pairs.tx[pairs.tx_of], pairs.rx[pairs.rx_of]
    cell = np.round(np.concatenate([0.5 * (tx + rx), np.abs(tx - rx)], axis=1) / (SAME * pairs.wavelength))
    random = np.random.default_rng(0)
    shuffled = random.permutation(len(cell))
    different = shuffled[np.unique(cell[shuffled], axis=0, return_index=True)[1]]
    _, midpoint, count = np.unique(cell[different, :3], axis=0, return_inverse=True, return_counts=True)
    rich = random.permutation(np.flatnonzero(count >= FEWEST_DISTANCES))
    chosen: list[NDArray[np.int64]] = []
    for n in rich:
        if sum(map(len, chosen)) >= most:
            break
        chosen.append(random.permutation(different[midpoint.ravel() == n])[:MOST_DISTANCES])
    if not chosen:
        return None
    return np.concatenate(chosen), np.repeat(np.arange(len(chosen)), [len(one) for one in chosen])


def _loss(tx: Array, rx: Array, group: NDArray[np.int64], bend: Array) -> Array:
    """Share of the coherence within groups that is lost by the phase ``bend h^2``, (bends,); h is half of ``tx - rx``.

    `bend` is the wavenumber times the difference of the curvatures [rad/m^2].
    """
    square = 0.25 * np.sum((tx - rx) ** 2, axis=1)
    first = np.flatnonzero(np.diff(group, prepend=-1))
    members = np.diff(first, append=group.size)
    sums = np.add.reduceat(np.exp(1j * np.multiply.outer(bend, square)), first, axis=1)
    return np.asarray(1.0 - np.sum(np.abs(sums) ** 2 / members, axis=1) / group.size)


@njit(makes_arrays=True, error_model="numpy", nogil=True, fastmath=True)
def _grouped(
    windows: NDArray[np.float32], step: float, shift: float, tx: Array, rx: Array, tx_of: NDArray[np.int64],
    rx_of: NDArray[np.int64], group: NDArray[np.int64], centre: float, directions: Array, curvature: float,
    along: Array, ahead: Array, best: Array, out: Array, sine: Array,
) -> None:  # fmt: skip
    """Set `best` (gates,) to the largest coherence of all pairs over u, `out` to that of groups, and `sine` to the u.

    ``out = sum_m (|sum_p y_p|^2 / n_m) / sum_p |y_p|^2`` at the u of `best`: m runs over the groups, p over the n_m
    pairs of each. Pairs must be ordered by group.
    """
    pairs, size, _, gates = windows.shape
    sign = 1.0 if curvature >= 0.0 else -1.0
    sides, square = sides_of(tx, rx, tx_of, rx_of), np.empty((2, pairs), np.float32)
    squares(sides, POINT, square)
    q, turns = np.float32(abs(curvature)), np.float32(sign * centre / (2.0 * np.pi))
    cells = np.float32(shift * sign / step)
    longer, cell, rest = np.empty(pairs, np.float32), np.empty(pairs, np.int32), np.empty(pairs, np.float32)
    cos, sin = np.empty(pairs, np.float32), np.empty(pairs, np.float32)
    part, total = np.empty((2, gates), np.float32), np.empty((4, gates), np.float32)
    for u in sign * directions:
        direction = (u * along + np.sqrt(1.0 - u * u) * ahead).astype(np.float32)
        lengthen(sides, square, direction, q, POINT, longer)
        look_up(longer, cells, np.float32(size // 2), np.float32(size - 2), turns, cell, rest, cos, sin)
        total[:] = 0.0
        first = 0
        while first < pairs:
            part[:] = 0.0
            p = first
            while p < pairs and group[p] == group[first]:
                here, beyond, share, c, s = windows[p, cell[p]], windows[p, cell[p] + 1], rest[p], cos[p], sin[p]
                for g in range(gates):
                    re = here[0, g] + share * (beyond[0, g] - here[0, g])
                    im = here[1, g] + share * (beyond[1, g] - here[1, g])
                    part[0, g] += re * c - im * s
                    part[1, g] += re * s + im * c
                    total[2, g] += re * re + im * im
                p += 1
            for g in range(gates):
                total[0, g] += part[0, g]
                total[1, g] += part[1, g]
                total[3, g] += (part[0, g] ** 2 + part[1, g] ** 2) / np.float32(p - first)
            first = p
        for g in range(gates):
            if total[2, g] > 0.0:
                all_pairs = (total[0, g] ** 2 + total[1, g] ** 2) / (pairs * total[2, g])
                if all_pairs > best[g]:
                    best[g], out[g], sine[g] = all_pairs, total[3, g] / total[2, g], u
