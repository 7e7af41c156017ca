"""The classic mistakes, told from how waves arrive; see `wavefronts` for the physics."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline, PPoly

from mirrorfold.common.types import Array
from mirrorfold.diagnosis.wavefronts import Wavefronts

PENALTY = 0.03
"""What each mistake, a range offset among them, has to explain more than the sweep as it stands, in the mean fit: a
third of the smallest margin by which single mistakes showed in full-wave simulations of 3 cm arrays, a tenth of that of
8 cm arrays. No wrong explanation fitted better than the right one for its free offset."""

RESAMPLES = 200
"""Draws of the gates, with repetition, that tell how sure a conclusion is (Efron, Ann. Statist. 7, 1979)."""

SUREST = 0.99
"""No conclusion from random draws is surer."""

SURE_ENOUGH = 0.6
"""Mistakes of which one is less sure are not named."""

LEAST_OFFSETS = (2.0, 4.0)
"""Range offsets that are named, in units of `SMALLEST_OFFSET`: of cables, and of delays that were taken away in excess,
which is rarer."""

LEAST_GAIN = 0.01
"""What an offset has to explain in the mean fit to be named: in correct full-wave sweeps of arrays from 5 mm on, echoes
by mixed paths feigned offsets worth up to 0.007."""

OFFSET_STEPS = 300
"""Steps of the search for a range offset in the ambiguous range."""

SMALLEST_OFFSET = (0.1, 0.05)
"""Range offsets below the smaller of a length [m] and a share of the ambiguous range are not told from an inexact delay
reference, nor from the depth of focus."""

OFFSET_SURE = (0.75, 0.95)
"""Share of the draws that must agree on such an offset; echoes are few in some scenes."""

UNEXPLAINED = 0.02
"""Share of a gate's power that fits to no wave, at least: a single gate must not outvote all others."""

OFFSET_REACH = (-0.15, 0.6)
"""Range offsets that are looked for, as shares of the ambiguous range: cables delay, and an excess of calibration
advances."""


@dataclass(frozen=True)
class Explanation:
    """Which mistakes were made.

    Attributes
    ----------
    conjugated, reversed, exchanged : bool
        Time convention; order of the frequencies; transmitters for receivers.
    offset : float [m]
        Range that echoes have too much; zero where none is certain.
    offset_error : float [m]
        Half width of its interval of 80 % certainty, a step of the search at least.
    sure : float
        Share of the draws that agree, for the first three.
    offset_sure : float
        Share of the draws that agree on an offset.
    told, exchange_told : bool
        Whether the waves would show conjugation and reversal, and exchange, had they been made: from afar all waves are
        flat, and apertures that are displaced across the plane of the echoes differ in nothing.
    """

    conjugated: bool
    reversed: bool
    exchanged: bool
    offset: float
    offset_error: float
    sure: float
    offset_sure: float
    told: bool
    exchange_told: bool


def explain(waves: Wavefronts) -> Explanation:
    """The fewest mistakes that explain how the waves arrive."""
    reach = np.arange(OFFSET_REACH[0], OFFSET_REACH[1], 1.0 / OFFSET_STEPS) * waves.ambiguous_range
    smallest = min(SMALLEST_OFFSET[0], SMALLEST_OFFSET[1] * waves.ambiguous_range)
    offsets = np.concatenate([[0.0], reach])
    cases = list(_cases(waves.coherence.shape[0] == 2))
    fits = np.stack([_fit(waves, *case, offsets) for case in cases])  # (cases, gates, offsets)
    number = np.array([sum(case) for case in cases])
    draws = np.random.default_rng(0).integers(0, waves.range.size, (RESAMPLES, waves.range.size))
    best = _decide(fits.mean(axis=1), number)
    agree, found = 0, []
    for draw in draws:
        agree += _decide(fits[:, draw].mean(axis=1), number) == best
        found.append(offsets[int(fits[best][draw].mean(axis=0).argmax())])
    away = np.array(found)
    low, high = np.quantile(away, [0.1, 0.9])
    mean = fits[best].mean(axis=0)
    offset = float(offsets[int(mean.argmax())])
    same_side = np.mean(away * np.sign(offset) > smallest) if offset else 0.0
    side = 0 if offset > 0 else 1
    certain = (
        abs(offset) > LEAST_OFFSETS[side] * smallest
        and mean.max() - mean[0] > LEAST_GAIN
        and same_side >= OFFSET_SURE[side]
    )
    told = [_tells(fits.mean(axis=1), cases, cases[best], mistake) for mistake in range(3)]
    return Explanation(
        *cases[best],
        told=told[0] and told[1],
        exchange_told=told[2],
        offset=offset if certain else 0.0,
        offset_error=float(max(0.5 * (high - low), waves.ambiguous_range / OFFSET_STEPS)),
        sure=min(SUREST, agree / RESAMPLES),
        offset_sure=min(SUREST, float(same_side)),
    )


def _cases(exchange: bool) -> Iterator[tuple[bool, bool, bool]]:
    """Combinations of conjugated, reversed, exchanged; the fewest mistakes first."""
    cases = product((False, True), (False, True), (False, True) if exchange else (False,))
    yield from sorted(cases, key=sum)


def _fit(waves: Wavefronts, conjugated: bool, reversed_: bool, exchanged: bool, offsets: Array) -> Array:
    """Fit of every gate to a case, at every range offset (gates, offsets): minus the log of the power left over.

    Conjugation and reversal each turn the range axis around, so that both together leave it.
    """
    around = conjugated != reversed_
    stated = waves.ambiguous_range - waves.range if around else waves.range
    true = np.maximum((stated[:, None] - offsets) % waves.ambiguous_range, 1e-6)
    sign = -1.0 if conjugated else 1.0
    table = waves.coherence[int(exchanged), int(reversed_)]
    splines = CubicSpline(waves.curvature, table, axis=1)
    pieces = [PPoly(splines.c[..., row], splines.x) for row in range(len(table))]
    # An echo may also come from beyond the ambiguous range, whatever else is wrong.
    curvature, beyond = sign / true, sign / (true + waves.ambiguous_range)
    coherence = [np.maximum(piece(q), piece(late)) for piece, q, late in zip(pieces, curvature, beyond, strict=True)]
    fit = _explained(np.stack(coherence))
    # Nearer than the strongest curvature looked for, echoes tell nothing.
    return np.where(np.abs(curvature) <= waves.curvature[-1], fit, _explained(table).mean(axis=1, keepdims=True))


def _explained(coherence: Array) -> Array:
    """Minus the log of the share of power that is left over."""
    return np.asarray(-np.log(1.0 - np.clip(coherence, 0.0, 1.0) + UNEXPLAINED))


def _tells(fit: Array, cases: Sequence[tuple[bool, ...]], best: tuple[bool, ...], mistake: int) -> bool:
    """Whether fits (cases, offsets) to the best case and to the one that differs in one mistake lie apart enough."""
    other = tuple(made != (n == mistake) for n, made in enumerate(best))
    if other not in cases:
        return False
    worth = np.maximum(fit[:, 0], fit.max(axis=1) - PENALTY)
    return bool(worth[cases.index(best)] - worth[cases.index(other)] > PENALTY)


def _decide(fit: Array, number: NDArray[np.int64]) -> int:
    """The best of all cases (cases, offsets), no offset first; each mistake has to be worth its penalty."""
    worth = np.maximum(fit[:, 0], fit.max(axis=1) - PENALTY) - PENALTY * number
    return int(worth.argmax())
