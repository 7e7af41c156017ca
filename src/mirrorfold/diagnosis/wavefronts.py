"""How waves arrive: direction, curvature and delay of the echoes, straight from the samples of a sweep.

An echo from the direction u and the distance rho reaches the elements with deviations ``D_i = R_i - rho`` of its path
from that to the middle of the array. Its samples are in phase after multiplication with ``exp(+j k_c (D_i + D_k))`` at
the delays ``L + D_i + D_k``. Here, direction, curvature q = 1 / rho and delay L are kept apart, and q may be negative,
for a wave that contracts, and the delays may shift the wrong way:

* In a correct sweep, waves expand, q = 2 / L, and delays follow the phases.
* Conjugation turns time around: waves contract, from a distance that counts from the ambiguous range down.
* Reversed frequencies turn the delays around and leave the phases at mid-band: waves expand, but late echoes have the
  stronger curvature, and delays shift against the phases.
* A cable adds to L and leaves q alone.
* Exchanged transmitters and receivers stand on the wrong sides: parallax has the wrong sign where the apertures are
  displaced.
* Positions in the wrong unit fit to no wave at all.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from mirrorfold.diagnosis.pairs import Pairs

Array = NDArray[np.float64]
Complex64 = NDArray[np.complex64]

PAIRS = (400, 1200)
"""Fewest and most pairs that are looked at, a random choice: an echo stands out of their incoherent sum by this."""

LARGEST_WORK = 1.5e8
"""Pair-pixels per table, half a second of work; fewer gates and pairs are looked at where there would be more."""

MOST_DIRECTIONS = 1500
"""Directions that a beam resolves, above which the array is too long to be judged quickly."""

GATES = 48
FEWEST_GATES = 10
"""Largest number of range bins that are looked at, and the number below which pairs are saved instead."""

OVERSAMPLING = 4
"""Points of the range profile in a cell, between which it is linear to a few percent."""

NEAREST = (0.3, 0.05)
"""Distance of the strongest curvature looked for: the smaller of a length [m] and a share of the ambiguous range, or
the aperture where that is more."""

CURVATURE_STEP = 1.5
"""Phase at the edge of the array from one curvature to the next [rad]."""

MOST_CURVATURES = 60
"""Largest number of curvatures of either sign."""

WIDEST = 0.95
"""Largest sine of the angle off broadside."""

ABOVE_NOISE = 4.0
"""Power of a range bin that is looked at over the quietest tenth of them."""

QUIET = 0.1

RANDOM = 4.0
"""Coherences below this many times the expectation of random phases are taken to be random."""

FLOOR = 0.02
"""Concentration of a gate, as a share of its largest, below which differences no longer count: a single gate must not
outvote all others."""


@dataclass(frozen=True, eq=False)
class Wavefronts:
    """How well the echoes of a sweep fit to waves of every curvature.

    Attributes
    ----------
    range : (gates,) array [m]
        Half the path, as the sweep has it.
    curvature : (curvatures,) array [1/m]
        Rising, negative for contracting waves.
    fit : (arrangements, 2, gates, curvatures) array
        Log of the concentration over directions, at most about zero. First axis: as stated, and with transmitters and
        receivers exchanged where that makes a difference; second: with delays that follow the phases, and that shift
        against them.
    coherence : (gates,) array
        Largest share of a gate's power that adds up in phase, over all of these.
    pairs : int
        Number of pairs: random phases would make a coherence of one over this.
    ambiguous_range : float [m]
    """

    range: Array
    curvature: Array
    fit: Array
    coherence: Array
    pairs: int
    ambiguous_range: float


def wavefronts(pairs: Pairs, *, exchange: bool) -> Wavefronts | None:
    """Look at the waves of a sweep; None where there is nothing to look at, or the array is none that can be judged.

    Parameters
    ----------
    pairs : Pairs
    exchange : bool
        Try transmitters and receivers exchanged too.
    """
    places = np.concatenate([pairs.tx, pairs.rx])
    along = np.linalg.svd(places, full_matrices=False)[2][0]
    along = along * (1.0 if along[np.argmax(np.abs(along))] > 0 else -1.0)
    aperture = max(float(np.ptp(pairs.tx @ along)), float(np.ptp(pairs.rx @ along)))
    reach = float(np.linalg.norm(places, axis=1).max())
    centre = float(pairs.wavenumber.mean())
    directions = int(2.0 * WIDEST * centre * aperture / np.pi)
    if not 8 <= directions <= MOST_DIRECTIONS or pairs.wavenumber.size < 16:
        return None
    ahead = np.cross([0.0, 0.0, 1.0], along)
    if np.linalg.norm(ahead) < 0.5:  # the array stands upright: any direction across it does
        ahead = np.array([0.0, 1.0, 0.0])
    ahead = ahead / np.linalg.norm(ahead) * (1.0 if ahead[1] >= 0 else -1.0)
    u = np.linspace(-WIDEST, WIDEST, directions)
    farthest = np.pi * (pairs.wavenumber.size - 1) / float(pairs.wavenumber[-1] - pairs.wavenumber[0])
    strongest = 1.0 / max(min(NEAREST[0], NEAREST[1] * farthest), 2.0 * reach)
    most = min(MOST_CURVATURES, LARGEST_WORK / (2.0 * u.size * FEWEST_GATES * PAIRS[0]))
    curvatures = int(np.ceil(min(strongest * centre * reach**2 / CURVATURE_STEP, most)))
    curvature = np.linspace(-strongest, strongest, 2 * curvatures + 1)

    affordable = LARGEST_WORK / (u.size * curvature.size)
    count = int(np.clip(affordable / GATES, *PAIRS))
    chosen = np.random.default_rng(0).permutation(pairs.tx_of.size)[:count]
    profile, step = _profiles(pairs.s[:, chosen], pairs.wavenumber)
    gate = _gates(profile, int(np.clip(affordable / chosen.size, FEWEST_GATES, GATES)))
    if gate.size < 2:
        return None
    windows = _windows(profile, gate, int(np.ceil(2.0 * reach / step)) + 2, centre - pairs.wavenumber[0], step)
    tx_of, rx_of = pairs.tx_of[chosen], pairs.rx_of[chosen]
    arrangements = [(pairs.tx, pairs.rx), (pairs.rx, pairs.tx)][: 2 if exchange else 1]
    concentration = np.zeros((len(arrangements), 2, gate.size, curvature.size))
    coherence = np.zeros(gate.size)
    part = np.zeros((gate.size, curvature.size, u.size), dtype=np.float32)
    for n, (tx, rx) in enumerate(arrangements):
        for m, shift in enumerate((1.0, -1.0)):
            _coherences(windows, step, shift, tx, rx, tx_of, rx_of, centre, u, curvature, along, ahead, part)
            coherence = np.maximum(coherence, part.max(axis=(1, 2)))
            excess = np.maximum(part - RANDOM / chosen.size, 0.0).astype(float)
            concentration[n, m] = np.sum(excess**2, axis=2)
    largest = concentration.max(axis=(0, 1, 3))
    heard = largest > 0.0
    if np.count_nonzero(heard) < 2:
        return None
    return Wavefronts(
        range=0.5 * gate[heard] * step,
        curvature=curvature,
        fit=np.log(concentration[:, :, heard] / largest[heard, None] + FLOOR),
        coherence=coherence[heard],
        pairs=chosen.size,
        ambiguous_range=0.5 * profile.shape[1] * step,
    )


def _profiles(s: NDArray[np.complexfloating], wavenumber: Array) -> tuple[Complex64, float]:
    """Range profiles (pairs, points) with the carrier of mid-band taken out, and the path between two points [m]."""
    count = wavenumber.size
    taper = np.hanning(count + 2)[1:-1, None].astype(np.float32)
    profile = np.fft.ifft((s * taper).T, OVERSAMPLING * count, axis=1)
    step = 2.0 * np.pi / ((wavenumber[-1] - wavenumber[0]) / (count - 1)) / (OVERSAMPLING * count)
    carrier = np.exp(-1j * (wavenumber.mean() - wavenumber[0]) * step * np.arange(OVERSAMPLING * count))
    return (profile * carrier).astype(np.complex64), float(step)


def _gates(profile: Complex64, most: int) -> NDArray[np.int64]:
    """Points of the profile at which to look: the strongest of each of equal pieces, above the noise, spread evenly."""
    power = np.mean(np.abs(profile) ** 2, axis=0)
    cells = power.size // OVERSAMPLING
    noise = float(np.quantile(power, QUIET))
    pieces = np.array_split(np.arange(power.size), min(2 * most, cells // 2))
    strongest = np.array([piece[np.argmax(power[piece])] for piece in pieces])
    loud = strongest[power[strongest] > ABOVE_NOISE * noise]
    return np.sort(loud[np.argsort(power[loud])[::-1][:most]])


def _windows(profile: Complex64, gate: NDArray[np.int64], half: int, carrier: float, step: float) -> Complex64:
    """Pieces of the profiles around the gates, (gates, pairs, 2 half + 1), unwrapped around the ambiguous range."""
    size = profile.shape[1]
    index = gate[:, None] + np.arange(-half, half + 1)
    turn = np.exp(-1j * carrier * size * step * np.floor_divide(index, size))
    return np.ascontiguousarray((profile[:, index % size] * turn).transpose(1, 0, 2).astype(np.complex64))


@njit(cache=True, error_model="numpy", nogil=True, fastmath=True)
def _deviations(place: Array, direction: Array, curvature: float, sign: float) -> Array:
    """``sign (sqrt(1 - 2 q r.d + q^2 r^2) - 1) / q`` for all places r (n, 3), exact for q = 0 too."""
    out = np.empty(place.shape[0])
    for i in range(place.shape[0]):
        across = place[i, 0] * direction[0] + place[i, 1] * direction[1] + place[i, 2] * direction[2]
        square = place[i, 0] ** 2 + place[i, 1] ** 2 + place[i, 2] ** 2
        change = -2.0 * across + curvature * square
        out[i] = sign * change / (np.sqrt(max(1.0 + curvature * change, 0.0)) + 1.0)
    return out


@njit(cache=True, error_model="numpy", nogil=True, parallel=True, fastmath=True)
def _coherences(
    windows: Complex64, step: float, shift: float, tx: Array, rx: Array, tx_of: NDArray[np.int64],
    rx_of: NDArray[np.int64], centre: float, directions: Array, curvature: Array, along: Array, ahead: Array,
    out: NDArray[np.float32],
) -> None:  # fmt: skip
    """``|sum y|^2 / (n sum |y|^2)`` with ``y = w(L + shift D) exp(j k_c D)``, (gates, curvatures, directions).

    A contracting wave is the time reversal of one from the opposite side.
    """
    gates, pairs, size = windows.shape
    middle = size // 2
    for task in prange(curvature.size * directions.size):
        at_curvature, at_direction = task // directions.size, task % directions.size
        sign = 1.0 if curvature[at_curvature] >= 0.0 else -1.0
        u = sign * directions[at_direction]
        direction = u * along + np.sqrt(1.0 - u * u) * ahead
        to_tx = _deviations(tx, direction, abs(curvature[at_curvature]), sign)
        to_rx = _deviations(rx, direction, abs(curvature[at_curvature]), sign)
        tx_turn, rx_turn = np.exp(1j * centre * to_tx), np.exp(1j * centre * to_rx)
        cell = np.empty(pairs, dtype=np.int64)
        rest = np.empty(pairs, dtype=np.float32)
        turn = np.empty(pairs, dtype=np.complex64)
        for p in range(pairs):
            at = shift * (to_tx[tx_of[p]] + to_rx[rx_of[p]]) / step + middle
            cell[p] = int(min(max(np.floor(at), 0.0), size - 2.0))
            rest[p] = np.float32(at - cell[p])
            turn[p] = tx_turn[tx_of[p]] * rx_turn[rx_of[p]]
        for g in range(gates):
            total = np.complex64(0.0)
            power = np.float32(0.0)
            for p in range(pairs):
                here, beyond = windows[g, p, cell[p]], windows[g, p, cell[p] + 1]
                value = here + rest[p] * (beyond - here)
                total += value * turn[p]
                power += value.real * value.real + value.imag * value.imag
            if power > 0.0:
                out[g, at_curvature, at_direction] = (total.real**2 + total.imag**2) / (pairs * power)
