"""Which of the classic mistakes explain the wavefronts of a sweep; see `wavefronts` for the physics.

The classic mistakes are conjugated samples, frequencies in reversed order, transmitters taken for receivers, and a
range offset, such as the delay of a cable. Each mistake predicts another relation between the delay of an echo and the
curvature of its wave. All combinations are compared with the measured curvatures. The combination that fits best is
taken, where each mistake must improve the fit by a penalty. Random draws of the range gates tell how sure it is.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline, PPoly

from mirrorfold.common.types import Array
from mirrorfold.diagnosis.midpoints import MidpointCoherence, midpoint_coherence
from mirrorfold.diagnosis.wavefronts import Wavefronts
from mirrorfold.sweep.pairs import Pairs

PENALTY = 0.03
"""By how much each mistake, a range offset included, must improve the mean fit over that of the sweep without it.

In full-wave simulations of 3 cm arrays, single mistakes changed the mean fit by at least three times as much, of 8 cm
arrays by ten times. No wrong explanation fitted better than the right one by means of its free offset."""

RESAMPLES = 200
"""Random draws of the gates, with repetition, that tell how sure a conclusion is: the bootstrap (Efron, Ann. Statist.
7, 1979)."""

SUREST = 0.99
"""Highest certainty that is stated for a conclusion from random draws."""

SURE_ENOUGH = 0.8
"""Mistakes that are less certain than this are not reported: two of 50 correct sweeps of short arcs with few echoes
seemed to have one, at 0.7 and 0.78."""

LEAST_OFFSETS = (2.0, 4.0)
"""Smallest range offsets that are reported, in units of the smaller length of `SMALLEST_OFFSET`: of positive offsets,
as cables cause; and of negative ones, where too much delay was removed, which is rarer."""

LEAST_GAIN = 0.01
"""By how much an offset must improve the mean fit to be reported. Profiles that are interpolated to a few percent, and
echoes by mixed paths, improve the fit of correct sweeps by up to 0.007."""

LEAST_SHARES = (0.5, 0.9)
"""Shares of the improvement that an offset predicts, were it the cause, that must be there: of offsets up to `USUAL`,
and of longer ones. Closer to the prediction of no offset, another fault makes the waves fit better: a displaced
aperture, a wrong pitch or frequency step. Such faults reached 0.8 of what some long offset predicts, and true long
offsets 0.93, but for arrays of 2 cm."""

PITCH_SHARE = 0.67
"""Share of the improvement by an offset from which on antennas twice as far apart explain the waves, at all ranges. In
simulated and full-wave sweeps this share was 0.97 and more where the pitch was halved, up to 0.4 with a cable."""

USUAL = 0.6
"""Longest usual offset, as a share of the ambiguous range."""

OFFSET_STEPS = 300
"""Steps of the search for a range offset, counted over the whole ambiguous range."""

SMALLEST_OFFSET = (0.1, 0.05)
"""A length [m] and a share of the ambiguous range. Range offsets below the smaller of both cannot be distinguished from
an inexact delay reference, nor from the depth of focus."""

OFFSET_SURE = (0.75, 0.95)
"""Smallest share of the draws that must agree on the sign of an offset, for positive and for negative ones; some scenes
have few echoes."""

MOST_WRAPS = 4
"""Largest number of ambiguous ranges by which echoes are taken to be late."""

UNEXPLAINED = 0.02
"""Share of a gate's power that is taken to fit no wave, in addition to what is measured: it bounds the logarithm, so
that a single gate cannot outvote all others."""

LOWEST_OFFSET = -0.15
"""Lowest range offset that is tried, as a share of the ambiguous range: cables make echoes late, and a calibration that
removes too much makes them early. All higher ones are tried up to an ambiguous range more, where echoes stand at the
same places again. Were some left out, a sweep with one of these would be explained by other mistakes."""


@dataclass(frozen=True)
class Explanation:
    """Which mistakes were made.

    Attributes
    ----------
    conjugated, reversed, exchanged : bool
        Whether the samples are conjugated; the frequencies in reversed order; transmitters taken for receivers.
    offset : float [m]
        By how much the ranges of echoes are too large; zero where no offset is certain.
    pitch_halved : bool
        Whether antennas twice as far apart explain the waves that the offset would explain.
    offset_error : float [m]
        Half the width between the 10 % and 90 % quantiles of the offset over the draws; at least a step of the search.
    sure : float
        Share of the draws in which `conjugated`, `reversed` and `exchanged` come out the same.
    offset_sure : float
        Share of the draws in which the offset has the same sign and is not too small.
    waves_suffice, exchange_recognisable : bool
        Whether the waves suffice to recognise conjugation and reversal, and exchange. They do not where all echoes are
        so distant that their waves are flat. An exchange does not show where the apertures are displaced only across
        the plane of the echoes.
    """

    conjugated: bool
    reversed: bool
    exchanged: bool
    offset: float
    pitch_halved: bool
    offset_error: float
    sure: float
    offset_sure: float
    waves_suffice: bool
    exchange_recognisable: bool


def explain(pairs: Pairs, waves: Wavefronts) -> Explanation:
    """The combination of mistakes that explains best how the waves of `pairs` arrive.

    Each mistake costs a penalty. The range offset is then measured by pairs with the same midpoint; see `midpoints`.
    """
    tried = LOWEST_OFFSET + np.arange(OFFSET_STEPS) / OFFSET_STEPS
    offsets = np.concatenate([[0.0], tried * waves.ambiguous_range])
    cases = list(_cases(waves.coherence.shape[0] == 2))
    fits = np.stack(
        [_fit(waves, waves.coherence[int(case[2]), int(case[1])], waves.curvature, case, offsets) for case in cases]
    )  # (cases, gates, offsets)
    number = np.array([sum(case) for case in cases])
    draws = np.random.default_rng(0).integers(0, waves.range.size, (RESAMPLES, waves.range.size))
    best = _decide(fits.mean(axis=1), number)
    agree = sum(_decide(fits[:, draw].mean(axis=1), number) == best for draw in draws)
    offset, pitch_halved, error, same_side = _offset(pairs, waves, cases[best], offsets, draws)
    recognisable = [_is_recognisable(fits.mean(axis=1), cases, cases[best], mistake) for mistake in range(3)]
    return Explanation(
        *cases[best],
        waves_suffice=recognisable[0] and recognisable[1],
        exchange_recognisable=recognisable[2],
        offset=offset,
        pitch_halved=pitch_halved,
        offset_error=error,
        sure=min(SUREST, agree / RESAMPLES),
        offset_sure=min(SUREST, same_side),
    )


def _cases(exchange: bool) -> Iterator[tuple[bool, bool, bool]]:
    """All combinations of (conjugated, reversed, exchanged), the fewest mistakes first.

    Without `exchange`, the third entry is always False.
    """
    cases = product((False, True), (False, True), (False, True) if exchange else (False,))
    yield from sorted(cases, key=sum)


def _offset(
    pairs: Pairs, waves: Wavefronts, case: tuple[bool, bool, bool], offsets: Array, draws: NDArray[np.int64]
) -> tuple[float, bool, float, float]:
    """Range offset [m], zero where none is certain; whether a halved pitch explains it; its error [m]; and the share of
    the draws that agree on it.
    """
    conjugated, reversed_, exchanged = case
    error = waves.ambiguous_range / OFFSET_STEPS
    if exchanged:
        pairs = replace(pairs, tx=pairs.rx, rx=pairs.tx)
    measured = midpoint_coherence(pairs, waves, contracting=conjugated, reversed_=reversed_)
    if measured is None:
        return 0.0, False, error, 0.0
    gain, predicted = _gain(waves, measured, case, offsets)
    drawn = offsets[[_best_offset(gain[draw], predicted[draw]) for draw in draws]]
    low, high = np.quantile(drawn, [0.1, 0.9])
    best = _best_offset(gain, predicted)
    mean = np.minimum(gain, predicted).mean(axis=0)
    offset = float(offsets[best])
    smallest = min(SMALLEST_OFFSET[0], SMALLEST_OFFSET[1] * waves.ambiguous_range)
    same_side = float(np.mean(drawn * np.sign(offset) > smallest)) if offset else 0.0
    side = 0 if offset > 0 else 1
    least_share = LEAST_SHARES[int(offset > USUAL * waves.ambiguous_range)]
    certain = (
        abs(offset) > LEAST_OFFSETS[side] * smallest
        and mean[best] > max(LEAST_GAIN, least_share * predicted[:, best].mean())
        and same_side >= OFFSET_SURE[side]
    )
    halved = offset > 0.0 and _gain_of_pitch(waves, measured, case) > PITCH_SHARE * gain.mean(axis=0)[best]
    return offset if certain else 0.0, bool(certain and halved), float(max(0.5 * (high - low), error)), same_side


def _gain_of_pitch(waves: Wavefronts, measured: MidpointCoherence, case: tuple[bool, bool, bool]) -> float:
    """By how much antennas that stand twice as far apart as stated improve the mean fit.

    The sine u of an echo seems to be s = 2 u. The phase of its curvature q, ``(1 - u^2) q x^2``, is then
    ``(4 - s^2) q`` times the square of the stated place, and seems to be that of the curvature
    ``q (4 - s^2) / (1 - s^2)``.
    """
    curvatures = waves.one_sign(case[0])
    near = _expected(waves, case, np.zeros(1))[0]
    seeming = near * ((4.0 - measured.sine**2) / (1.0 - measured.sine**2))[:, None]
    fit = [
        np.stack([CubicSpline(curvatures, row)(q) for row, q in zip(measured.coherence, at, strict=True)])
        for at in (near, np.clip(seeming, curvatures[0], curvatures[-1]))
    ]
    return float(np.mean(_explained(fit[1]) - _explained(fit[0])))


def _best_offset(gain: Array, predicted: Array) -> int:
    """The number of the offset that improves the fit most, by the gains of gates (gates, offsets); see `_gain`.

    Limited gains tell which peak is that of a delay. They grow with the offset, so that its place is that of the fit.
    """
    limited = np.minimum(gain, predicted).mean(axis=0)
    return int(np.where(limited > 0.5 * limited.max(), gain.mean(axis=0), -np.inf).argmax())


def _gain(
    waves: Wavefronts, measured: MidpointCoherence, case: tuple[bool, bool, bool], offsets: Array
) -> tuple[Array, Array]:
    """By how much each offset improves the fit of each gate, and by how much it would as the cause: (gates, offsets).

    A delay changes the curvatures that are expected, and the array tells the change by the phase that it makes at its
    ends. What improves the fit by more than this phase can is another fault: an echo out by one mirror and back by
    another, say, fits no curvature. So a gain counts up to that of an echo of the curvature that an offset predicts.
    """
    conjugated = case[0]
    fit = _fit(waves, measured.coherence, waves.one_sign(conjugated), case, offsets)
    coherence = 1.0 + UNEXPLAINED - np.exp(-fit)
    expected = np.minimum(np.abs(_expected(waves, case, offsets)), waves.curvature[-1])  # (n, gates, offsets)
    lost = np.max([np.min([measured.lost(q - one) for one in expected[:, :, :1]], axis=0) for q in expected], axis=0)
    return fit - fit[:, :1], fit - _explained(coherence * (1.0 - lost))


def _expected(waves: Wavefronts, case: tuple[bool, bool, bool], offsets: Array) -> Array:
    """Curvatures that a combination of mistakes and the offsets predict for each gate, (n, gates, offsets) [1/m].

    They are +-1 / range: first of echoes as they are, then of those that have wrapped around from beyond the ambiguous
    range, once and up to `MOST_WRAPS` times, as any may have. Conjugation and reversal each reverse the range axis, and
    cancel together.
    """
    conjugated, reversed_, _ = case
    stated = waves.ambiguous_range - waves.range if conjugated != reversed_ else waves.range
    true = np.maximum((stated[:, None] - offsets) % waves.ambiguous_range, 1e-6)
    late = waves.ambiguous_range * np.arange(MOST_WRAPS + 1)[:, None, None]
    return np.asarray((-1.0 if conjugated else 1.0) / (true + late))


def _fit(waves: Wavefronts, table: Array, curvatures: Array, case: tuple[bool, bool, bool], offsets: Array) -> Array:
    """Fit of every gate to a combination of mistakes at every range offset, (gates, offsets).

    The fit is ``-ln(share of power that does not add up in phase)`` at the expected curvature, by a table of coherences
    (gates, curvatures).
    """
    splines = CubicSpline(curvatures, table, axis=1)
    pieces = [PPoly(splines.c[..., row], splines.x) for row in range(len(table))]
    expected = _expected(waves, case, offsets)
    fit, *late = (_explained(np.stack([piece(q) for piece, q in zip(pieces, at, strict=True)])) for at in expected)
    # At ranges so short that the curvature exceeds the tried ones, the fit is the mean over all curvatures.
    within = np.abs(expected[0]) <= waves.curvature[-1]
    return np.max([np.where(within, fit, _explained(table).mean(axis=1, keepdims=True)), *late], axis=0)


def _explained(coherence: Array) -> Array:
    """``-ln(1 - coherence + UNEXPLAINED)``: minus the log of the share of power that does not add up in phase."""
    return np.asarray(-np.log(1.0 - np.clip(coherence, 0.0, 1.0) + UNEXPLAINED))


def _is_recognisable(fit: Array, cases: Sequence[tuple[bool, ...]], best: tuple[bool, ...], mistake: int) -> bool:
    """Whether the waves suffice to recognise one mistake, given by its place in a case.

    They do where the best case fits by more than `PENALTY` better than the case that differs from it in this mistake
    alone; `fit` is (cases, offsets).
    """
    other = tuple(made != (n == mistake) for n, made in enumerate(best))
    if other not in cases:
        return False
    worth = np.maximum(fit[:, 0], fit.max(axis=1) - PENALTY)
    return bool(worth[cases.index(best)] - worth[cases.index(other)] > PENALTY)


def _decide(fit: Array, number: NDArray[np.int64]) -> int:
    """Index of the best case by the fits (cases, offsets), with a penalty for each mistake, also for an offset.

    The first offset is zero; `number` (cases,) counts the mistakes of each case.
    """
    worth = np.maximum(fit[:, 0], fit.max(axis=1) - PENALTY) - PENALTY * number
    return int(worth.argmax())
