"""The wavefronts of a sweep: direction, curvature and delay of its echoes, measured on the samples.

An echo from the direction u and the distance rho travels the one-way path R_i to element i, which deviates by
``D_i = R_i - rho`` from the path to the middle of the array. The echo arrives in the pair (i, k) at the delay
``L + D_i + D_k``, and all pairs are in phase there after multiplication with ``exp(+j k_c (D_i + D_k))``. Here,
direction, curvature q = 1 / rho and delay L are free of each other. The curvature may be negative, for a wave that
contracts, and the delays may shift in the opposite sense. So each mistake in a sweep shows:

* In a correct sweep, waves expand, q = 2 / L, and delays follow the phases.
* Conjugation reverses time: waves contract, and their distance counts down from the ambiguous range.
* Reversed frequencies reverse the delays but not the phases at mid-band: waves expand, but late echoes have the
  stronger curvature, and delays shift against the phases.
* A cable adds to L and leaves q as it is.
* Exchanged transmitters and receivers have each other's positions: where the apertures are displaced from each other,
  the parallax has the wrong sign.
* Positions in the wrong unit fit no wave at all.

Small objects and flat faces give different echoes. A face shows the mirror image of the transmitter, so the path
depends only on the distance between transmitter and receiver: it grows by ``(x_i - x_k)^2 / 4 rho`` for a face ahead.
For a point it grows by ``(x_i^2 + x_k^2) / 2 rho``. A face that is taken for a point seems to stand at twice its
distance. So each gate is taken for the one of both that it fits better. What the distance between transmitter and
receiver adds to the path is the same for both, and for any shape between them (Hubral, Geophysics 48, 1051-1062, 1983).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mirrorfold.common.decibels import power_ratio_of
from mirrorfold.common.threads import for_each
from mirrorfold.common.types import Array
from mirrorfold.focusing.echoes.coherence import FACE, OVERSAMPLING, POINT, Complex64, coherence, profiles, windows
from mirrorfold.sweep.pairs import Pairs

PAIRS = (300, 600)
"""Smallest and largest number of pairs that are looked at, chosen at random. An echo that is in phase in all of them
exceeds random phases by this factor."""

LARGEST_WORK = 4e8
"""Largest product of the numbers of pairs, directions, curvatures and gates for each table of coherences: a quarter of
a second of work. Where it would be exceeded, fewer gates and pairs are looked at."""

LARGEST_WINDOWS = 1e8
"""Largest number of values of the pieces of all range profiles (pairs, points, 2, gates): 2 GB while they are cut out.
Where it would be exceeded, fewer gates are looked at."""

MOST_DIRECTIONS = 1500
"""Largest number of directions that the array resolves; a longer array could not be judged quickly."""

GATES = 128
FEWEST_GATES = 10
"""Largest and smallest number of range bins that are looked at; rather than take fewer, the number of pairs and of
curvatures is reduced."""

NEAREST = (0.3, 0.05)
"""The strongest curvature that is tried is one over a distance: the smaller of this length [m] and this share of the
ambiguous range, but at least twice the distance of the outermost element from the middle."""

CURVATURE_STEP = 1.5
"""By how much the phase at the edge of the array changes from one curvature to the next [rad], before the steps are
made finer (`FINEST`) or their number is limited (`MOST_CURVATURES`)."""

MOST_CURVATURES = 60
"""Largest number of curvatures of each sign."""

FINEST = 2.0
"""Largest factor by which the steps of direction and curvature are made finer. It is used for short arrays, which have
few of both, so that values interpolated between two steps are exact enough."""

WIDEST = 0.95
"""Largest sine of the angle off broadside that is tried."""

ABOVE_NOISE = 4.0
"""Smallest power of a range bin that is looked at, relative to the noise."""

QUIET = 0.1
"""Share of the range bins whose powers are taken to lie below that of the noise."""

DIRECT_DB = 30.0
"""Level below the strongest echo [dB] under which echoes have mostly come by mixed paths, out by one mirror and back by
another. The curvature of such waves fits no single distance."""


IN_PHASE = 25.0
"""Smallest median coherence of the gates, relative to that of random phases, at which the positions fit the waves.
Noise stays below 15, although the largest coherence of all tried directions and curvatures is taken."""


@dataclass(frozen=True, eq=False)
class Wavefronts:
    """How well the echoes of a sweep fit waves of each curvature.

    Attributes
    ----------
    range : (gates,) array [m]
        Half the path, as the sweep states it.
    curvature : (curvatures,) array [1/m]
        Rising, negative for contracting waves.
    coherence : (arrangements, 2, gates, curvatures) array
        Share of a gate's power that adds up in phase: the largest over all directions, and over points and flat faces.
        First axis: antennas as stated, and with transmitters and receivers exchanged if that is tried; second axis:
        delays that follow the phases, and delays that shift against them.
    pairs : int
        Number of pairs; random phases have a coherence of ``1 / pairs``.
    ambiguous_range : float [m]
    gate : (gates,) array
        Points of the range profile.
    direction : (directions,) array
        Sines of the angles off broadside that were tried.
    along, ahead : (3,) array
        Unit vectors along the array, and across it to where the sine is zero.
    """

    range: Array
    curvature: Array
    coherence: Array
    pairs: int
    ambiguous_range: float
    gate: NDArray[np.int64]
    direction: Array
    along: Array
    ahead: Array

    def one_sign(self, contracting: bool) -> Array:
        """The curvatures of waves that expand, or of those that contract, flat waves included; rising."""
        middle = self.curvature.size // 2
        return self.curvature[: middle + 1] if contracting else self.curvature[middle:]


def wavefronts(pairs: Pairs, *, exchange: bool, gates: int = GATES) -> Wavefronts | None:
    """Measure the wavefronts of a sweep; None where it has too few echoes, or its array is too short, long or wide.

    Parameters
    ----------
    pairs : Pairs
    exchange : bool
        Whether to try exchanged transmitters and receivers too.
    gates : int
        Largest number of range bins that are looked at, the strongest ones; the time grows with it.
    """
    places = np.concatenate([pairs.tx, pairs.rx])
    along = pairs.axes[0]
    along = along * (1.0 if along[np.argmax(np.abs(along))] > 0 else -1.0)
    aperture = max(float(np.ptp(pairs.tx @ along)), float(np.ptp(pairs.rx @ along)))
    reach = float(np.linalg.norm(places, axis=1).max())
    centre = float(pairs.wavenumber.mean())
    directions = int(2.0 * WIDEST * centre * aperture / np.pi)
    if not 8 <= directions <= MOST_DIRECTIONS or pairs.wavenumber.size < 16:
        return None
    ahead = np.cross([0.0, 0.0, 1.0], along)
    if np.linalg.norm(ahead) < 0.5:  # an upright array: any direction across it will do
        ahead = np.array([0.0, 1.0, 0.0])
    ahead = ahead / np.linalg.norm(ahead) * (1.0 if ahead[1] >= 0 else -1.0)
    farthest = np.pi * (pairs.wavenumber.size - 1) / float(pairs.wavenumber[-1] - pairs.wavenumber[0])
    strongest = 1.0 / max(min(NEAREST[0], NEAREST[1] * farthest), 2.0 * reach)
    curvatures = strongest * centre * reach**2 / CURVATURE_STEP
    fineness = np.clip(np.sqrt(LARGEST_WORK / (2.0 * directions * curvatures * GATES * PAIRS[1])), 1.0, FINEST)
    if pairs.moving:  # both ways change with each step, so that a beam is half as wide
        directions *= 2
    u = np.linspace(-WIDEST, WIDEST, int(fineness * directions))
    most = min(MOST_CURVATURES, LARGEST_WORK / (2.0 * u.size * FEWEST_GATES * PAIRS[0]))
    curvatures = int(np.ceil(min(fineness * curvatures, most)))
    curvature = np.linspace(-strongest, strongest, 2 * curvatures + 1)

    affordable = LARGEST_WORK / (u.size * curvature.size)
    count = int(np.clip(affordable / GATES, *PAIRS))
    chosen = np.random.default_rng(0).permutation(pairs.tx_of.size)[:count]
    profile, step = profiles(pairs.s[:, chosen], pairs.wavenumber)
    half = int(np.ceil(2.0 * reach / step)) + 2
    most = int(LARGEST_WINDOWS / (2.0 * (2.0 * half + 1.0) * chosen.size))
    if most < FEWEST_GATES:
        return None
    gate = _gates(profile, int(np.clip(affordable / chosen.size, FEWEST_GATES, min(most, gates))))
    if gate.size < 2:
        return None
    windowed = windows(profile, gate, half, centre - pairs.wavenumber[0], step)
    tx_of, rx_of = pairs.tx_of[chosen], pairs.rx_of[chosen]
    arrangements = [(pairs.tx, pairs.rx), (pairs.rx, pairs.tx)][: 2 if exchange else 1]
    found = np.zeros((len(arrangements), 2, curvature.size, gate.size))

    def look(task: tuple[int, int, int]) -> None:
        n, m, at = task
        for shape in (POINT, FACE):
            coherence(
                *(windowed, step, (1.0, -1.0)[m], shape, *arrangements[n], tx_of, rx_of, centre, u),
                *(curvature[at], along, ahead, found[task]),
            )

    for_each(look, np.ndindex(*found.shape[:3]))
    return Wavefronts(
        range=np.asarray(0.5 * step * gate),
        curvature=curvature,
        coherence=found.swapaxes(2, 3),
        pairs=chosen.size,
        ambiguous_range=0.5 * profile.shape[1] * step,
        gate=gate,
        direction=u,
        along=along,
        ahead=ahead,
    )


def in_phase(waves: Wavefronts) -> float:
    """Median over the gates of the largest coherence, relative to that of random phases, ``1 / pairs``."""
    return float(np.median(waves.coherence.max(axis=(0, 1, 3)))) * waves.pairs


def _gates(profile: Complex64, most: int) -> NDArray[np.int64]:
    """Points of the range profile (pairs, points) that are looked at, (gates,), rising.

    The profile is cut into equal pieces, and the strongest point of each that exceeds the noise is a candidate. Of
    these the strongest are taken, at most `most`, and only those less than `DIRECT_DB` below the strongest point,
    unless fewer than `FEWEST_GATES` were left.
    """
    power = np.mean(np.abs(profile) ** 2, axis=0)
    cells = power.size // OVERSAMPLING
    pieces = np.array_split(np.arange(power.size), min(2 * most, cells // 2))
    strongest = np.array([piece[np.argmax(power[piece])] for piece in pieces])
    loud = strongest[power[strongest] > ABOVE_NOISE * float(np.quantile(power, QUIET))]
    loud = loud[np.argsort(power[loud])[::-1]]
    direct = np.count_nonzero(power[loud] > power.max() * power_ratio_of(-DIRECT_DB))
    return np.sort(loud[: min(most, max(direct, FEWEST_GATES))])
