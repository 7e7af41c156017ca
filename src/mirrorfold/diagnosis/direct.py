"""Whether the range axis of a sweep is reversed, from the direct waves between its antennas.

Where antennas stand several range cells apart, as in a ring around the scene, the direct wave from transmitter i to
receiver k is the first and strongest signal. It arrives at the path length ``L + |t_i - r_k|``, with one length L for
the cables, so the later, the farther apart the antennas are. If the samples are conjugated, or stored from the highest
frequency to the lowest, the range axis runs backwards: the direct wave then arrives the sooner, the farther apart they
are. So the range profiles of all pairs are aligned for both cases, and the case in which they add up higher is the
right one. Draws of the pairs, with repetition, tell how sure that is.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mirrorfold.common.types import Array
from mirrorfold.diagnosis.findings import Finding
from mirrorfold.focusing.echoes.coherence import profiles
from mirrorfold.sweep.pairs import Pairs

LEAST_SPREAD = 1.0
"""Smallest difference between the quartiles of the distances from transmitter to receiver, in resolution cells of the
path, ``c / B``."""

LEAST_RATIO = 1.5
"""How many times the peak of the mean profile, aligned for delays that fall with the distance, must exceed the peak of
that aligned for delays that rise."""

RESAMPLES = 200
"""Random draws of the pairs, with repetition."""

SURE_ENOUGH = 0.95
"""Smallest share of these draws in which the ratio must exceed `LEAST_RATIO`."""

SUREST = 0.98
"""Highest certainty that a finding states."""


def direct_findings(pairs: Pairs) -> list[Finding]:
    """The finding that the range axis is reversed, where direct waves arrive the sooner, the farther antennas stand
    apart; none otherwise, and none where the distances are too equal to tell.
    """
    apart = np.linalg.norm(pairs.tx[pairs.tx_of] - pairs.rx[pairs.rx_of], axis=1)
    usable = np.any(pairs.s, axis=0) & (apart > 0.0)
    count = pairs.wavenumber.size
    if count < 16 or np.count_nonzero(usable) < 8:
        return []
    cell = 2.0 * np.pi / float(np.ptp(pairs.wavenumber))
    if np.subtract(*np.quantile(apart[usable], [0.75, 0.25])) < LEAST_SPREAD * cell:
        return []
    profile, step = profiles(pairs.s[:, usable], pairs.wavenumber)
    power = np.abs(profile.astype(complex)) ** 2
    power /= power.mean(axis=1, keepdims=True)
    rising, falling = (_aligned(power, sign * apart[usable] / step) for sign in (1.0, -1.0))
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
    """Profiles (pairs, points), each shifted circularly to the left by its own number of points, `shift` (pairs,)."""
    at = (np.arange(power.shape[1]) + np.rint(shift).astype(int)[:, None]) % power.shape[1]
    return np.asarray(np.take_along_axis(power, at, axis=1))
