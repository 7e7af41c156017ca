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

Echoes of small objects and of flat faces differ: a face shows the image of the transmitter, so that the path changes
with the distance of transmitter and receiver alone, by ``(x_i - x_k)^2 / 4 rho`` for a face ahead, while a point adds
``(x_i^2 + x_k^2) / 2 rho``. Taken for a point, a face seems to stand at twice its distance. Each gate is taken for that
of the two to which it fits better: what the distance of transmitter and receiver adds to the path is the same for both,
and for any shape between them (Hubral, Geophysics 48, 1051-1062, 1983).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mirrorfold.common.threads import for_each
from mirrorfold.common.types import Array
from mirrorfold.focusing.echoes.coherence import FACE, OVERSAMPLING, POINT, Complex64, coherence, profiles, windows
from mirrorfold.sweep.pairs import Pairs

PAIRS = (300, 600)
"""Fewest and most pairs that are looked at, a random choice: an echo stands out of their incoherent sum by this."""

LARGEST_WORK = 4e8
"""Pair-pixels per table, a quarter of a second of work; fewer gates and pairs are looked at where there would be
more."""

MOST_DIRECTIONS = 1500
"""Directions that a beam resolves, above which the array is too long to be judged quickly."""

GATES = 128
FEWEST_GATES = 10
"""Largest number of range bins that are looked at, and the number below which pairs are saved instead."""

NEAREST = (0.3, 0.05)
"""Distance of the strongest curvature looked for: the smaller of a length [m] and a share of the ambiguous range, or
the aperture where that is more."""

CURVATURE_STEP = 1.5
"""Phase at the edge of the array from one curvature to the next [rad]."""

MOST_CURVATURES = 60
"""Largest number of curvatures of either sign."""

FINEST = 2.0
"""Short arrays have few directions and curvatures, whose steps are made finer by up to this: their echoes hardly change
from one to the next, and what is read between two of them counts."""

WIDEST = 0.95
"""Largest sine of the angle off broadside."""

ABOVE_NOISE = 4.0
"""Power of a range bin that is looked at over the quietest tenth of them."""

QUIET = 0.1

DIRECT_DB = 30.0
"""Echoes so far below the strongest [dB] have mostly come by way of several mirrors, out by one and back by another,
which bends their waves like those of none."""


@dataclass(frozen=True, eq=False)
class Wavefronts:
    """How well the echoes of a sweep fit to waves of every curvature.

    Attributes
    ----------
    range : (gates,) array [m]
        Half the path, as the sweep has it.
    curvature : (curvatures,) array [1/m]
        Rising, negative for contracting waves.
    coherence : (arrangements, 2, gates, curvatures) array
        Largest share of a gate's power that adds up in phase, over all directions, for points and for flat faces.
        First axis: as stated, and with transmitters and receivers exchanged where that makes a difference; second:
        with delays that follow the phases, and that shift against them.
    pairs : int
        Number of pairs: random phases would make a coherence of one over this.
    ambiguous_range : float [m]
    """

    range: Array
    curvature: Array
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
    farthest = np.pi * (pairs.wavenumber.size - 1) / float(pairs.wavenumber[-1] - pairs.wavenumber[0])
    strongest = 1.0 / max(min(NEAREST[0], NEAREST[1] * farthest), 2.0 * reach)
    curvatures = strongest * centre * reach**2 / CURVATURE_STEP
    fineness = np.clip(np.sqrt(LARGEST_WORK / (2.0 * directions * curvatures * GATES * PAIRS[1])), 1.0, FINEST)
    u = np.linspace(-WIDEST, WIDEST, int(fineness * directions))
    most = min(MOST_CURVATURES, LARGEST_WORK / (2.0 * u.size * FEWEST_GATES * PAIRS[0]))
    curvatures = int(np.ceil(min(fineness * curvatures, most)))
    curvature = np.linspace(-strongest, strongest, 2 * curvatures + 1)

    affordable = LARGEST_WORK / (u.size * curvature.size)
    count = int(np.clip(affordable / GATES, *PAIRS))
    chosen = np.random.default_rng(0).permutation(pairs.tx_of.size)[:count]
    profile, step = profiles(pairs.s[:, chosen], pairs.wavenumber)
    gate = _gates(profile, int(np.clip(affordable / chosen.size, FEWEST_GATES, GATES)))
    if gate.size < 2:
        return None
    around = windows(profile, gate, int(np.ceil(2.0 * reach / step)) + 2, centre - pairs.wavenumber[0], step)
    tx_of, rx_of = pairs.tx_of[chosen], pairs.rx_of[chosen]
    arrangements = [(pairs.tx, pairs.rx), (pairs.rx, pairs.tx)][: 2 if exchange else 1]
    found = np.zeros((len(arrangements), 2, curvature.size, gate.size))

    def look(task: tuple[int, int, int]) -> None:
        n, m, at = task
        for shape in (POINT, FACE):
            coherence(
                *(around, step, (1.0, -1.0)[m], shape, *arrangements[n], tx_of, rx_of, centre, u),
                *(curvature[at], along, ahead, found[task]),
            )

    for_each(look, np.ndindex(*found.shape[:3]))
    return Wavefronts(
        range=np.asarray(0.5 * step * gate),
        curvature=curvature,
        coherence=found.swapaxes(2, 3),
        pairs=chosen.size,
        ambiguous_range=0.5 * profile.shape[1] * step,
    )


def _gates(profile: Complex64, most: int) -> NDArray[np.int64]:
    """Points of the profile at which to look: the strongest of each of equal pieces, spread evenly.

    Above the noise, and not far below the strongest, unless there are few.
    """
    power = np.mean(np.abs(profile) ** 2, axis=0)
    cells = power.size // OVERSAMPLING
    pieces = np.array_split(np.arange(power.size), min(2 * most, cells // 2))
    strongest = np.array([piece[np.argmax(power[piece])] for piece in pieces])
    loud = strongest[power[strongest] > ABOVE_NOISE * float(np.quantile(power, QUIET))]
    loud = loud[np.argsort(power[loud])[::-1]]
    direct = np.count_nonzero(power[loud] > power.max() * 10.0 ** (-DIRECT_DB / 10.0))
    return np.sort(loud[: min(most, max(direct, FEWEST_GATES))])
