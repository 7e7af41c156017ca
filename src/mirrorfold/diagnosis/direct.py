"""The direction of time, told by what goes straight from one antenna to another.

Antennas that stand apart by several range cells, such as a ring around the scene, hear each other first and loudest,
the later the farther apart they are: at ``L + |t_i - r_k|``, with one length L for what is left of cables. Where the
samples are conjugated or stored from the highest frequency to the lowest, all comes at the ambiguous range less that.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mirrorfold.common.types import Array
from mirrorfold.diagnosis.findings import Finding
from mirrorfold.focusing.echoes.coherence import profiles
from mirrorfold.sweep.pairs import Pairs

LEAST_SPREAD = 1.0
"""Range cells over which the distances of antennas must spread, between their quartiles."""

LEAST_RATIO = 1.5
"""How much louder the profiles must be at delays that fall with the distance than at those that rise."""

RESAMPLES = 200
SURE_ENOUGH = 0.95
"""Share of random draws of the pairs, with repetition, in which that holds."""

SUREST = 0.98


def direct_findings(pairs: Pairs) -> list[Finding]:
    """Whether direct waves arrive at delays that fall with the distance; nothing where they do not tell."""
    apart = np.linalg.norm(pairs.tx[pairs.tx_of] - pairs.rx[pairs.rx_of], axis=1)
    heard = np.any(pairs.s, axis=0) & (apart > 0.0)
    count = pairs.wavenumber.size
    if count < 16 or np.count_nonzero(heard) < 8:
        return []
    cell = 2.0 * np.pi / float(np.ptp(pairs.wavenumber))
    if np.subtract(*np.quantile(apart[heard], [0.75, 0.25])) < LEAST_SPREAD * cell:
        return []
    profile, step = profiles(pairs.s[:, heard], pairs.wavenumber)
    power = np.abs(profile.astype(complex)) ** 2
    power /= power.mean(axis=1, keepdims=True)
    rising, falling = (_aligned(power, sign * apart[heard] / step) for sign in (1.0, -1.0))
    draws = np.random.default_rng(0).integers(0, len(power), (RESAMPLES, len(power)))
    backwards = [falling[draw].mean(axis=0).max() > LEAST_RATIO * rising[draw].mean(axis=0).max() for draw in draws]
    sure = float(np.mean(backwards))
    if sure < SURE_ENOUGH:
        return []
    what = (
        "What goes straight from antenna to antenna comes the sooner the farther they stand apart: the samples are "
        "conjugated (the other time convention), or I and Q are exchanged, or, which delays cannot tell, they are "
        "stored from the highest frequency to the lowest and need --reverse-frequency."
    )
    return [Finding("range-reversed", what, min(SUREST, sure), "--conjugate")]


def _aligned(power: Array, shift: Array) -> NDArray[np.float64]:
    """Profiles (pairs, points), each moved to the left by its own number of points, around the ambiguous range."""
    at = (np.arange(power.shape[1]) + np.rint(shift).astype(int)[:, None]) % power.shape[1]
    return np.asarray(np.take_along_axis(power, at, axis=1))
