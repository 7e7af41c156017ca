"""A range gate: the part of a sweep that the ranges of some pixels hold, at fewer frequencies.

Pixels whose paths differ by much less than the ambiguous path length P do not need its fine frequency steps: what else
is in the sweep may be removed first. A low-pass filter h over frequency, centred on the window's middle path d_c, keeps
paths d with ``|d - d_c| <= w`` and suppresses those with ``|d - d_c| >= P/D - w``, so that every D-th frequency is
enough::

    y_n = sum_m h[D n - m] a_m S_m exp(j (m - D n) dk d_c),
    sum_n y_n exp(j k_Dn d) = sum_m a_m S_m exp(j k_m d).

h is the sinc of the ideal filter under a Kaiser window, whose ripple and length are known (Oppenheim and Schafer,
Discrete-Time Signal Processing, 3rd ed., section 7.6). Because h depends on frequency alone, all pairs are filtered by
one matrix product.
"""

from __future__ import annotations

from dataclasses import replace
from math import ceil, log10, pi

import numpy as np
from numpy.typing import NDArray

from mirrorfold.focusing.problem import Problem

BEHIND_DB = 40.0
"""What is suppressed may be this much stronger than what is kept: walls glint, and near pixels hold little."""

FEWEST = 8
"""Frequencies from which on some may be left out."""

WORTHWHILE = 0.5
"""Share of the frequencies that may remain for the filter to pay."""


def gated(problem: Problem, s: NDArray[np.complex64], tolerance: float) -> tuple[Problem, NDArray[np.complex64]]:
    """The same problem at fewer frequencies, and its data; both as they were given where that does not pay.

    Parameters
    ----------
    problem : Problem
    s : (frequencies, tx, rx) or, monostatic, (frequencies, tx) array
    tolerance : float
        Ripple of the filter, relative to what the window holds.
    """
    design = _design(problem, tolerance)
    if design is None:
        return problem, s
    keep_every, reach, beta = design
    count, step, (middle, _) = problem.k.size, problem.wavenumber_step, _paths(problem)
    first = -ceil(reach / keep_every)
    kept = np.arange(first, (count - 1 + reach) // keep_every + 1) * keep_every
    lag = kept[:, None] - np.arange(count)
    taps = np.sinc(lag / keep_every) * np.i0(beta * np.sqrt(np.maximum(1.0 - (lag / reach) ** 2, 0.0))) / np.i0(beta)
    matrix = np.where(np.abs(lag) <= reach, taps, 0.0) * problem.taper * np.exp(-1j * step * middle * lag)
    fewer = replace(problem, k=problem.k[0] + step * kept, taper=np.ones(kept.size, dtype=np.complex128))
    data = matrix.astype(np.complex64) @ s.reshape(count, -1)
    return fewer, data.reshape(kept.size, *s.shape[1:])


def _paths(problem: Problem) -> tuple[float, float]:
    """Middle and half extent of the path lengths from a transmitter by way of a pixel to a receiver [m]."""
    axes = (problem.x, problem.y, problem.z)
    low, high = (np.array([end(axis) for axis in axes]) for end in (np.min, np.max))
    shortest, longest = 0.0, 0.0
    for elements in (problem.tx, problem.rx):
        nearest = np.linalg.norm(np.maximum(np.maximum(low - elements, elements - high), 0.0), axis=1)
        farthest = np.linalg.norm(np.maximum(np.abs(low - elements), np.abs(high - elements)), axis=1)
        shortest, longest = shortest + float(nearest.min()), longest + float(farthest.max())
    return 0.5 * (shortest + longest), 0.5 * (longest - shortest)


def _design(problem: Problem, tolerance: float) -> tuple[int, int, float] | None:
    """D, the filter's reach [steps of frequency] and Kaiser's beta; None where too many frequencies would remain."""
    count, (_, half) = problem.k.size, _paths(problem)
    if count < FEWEST:
        return None
    period = 2.0 * pi / problem.wavenumber_step
    attenuation = BEHIND_DB - 20.0 * log10(tolerance)
    beta = 0.1102 * (attenuation - 8.7)
    best, fewest = None, WORTHWHILE * count
    for keep_every in range(2, count):
        transition = period / keep_every - 2.0 * half
        if transition <= 0.0:
            break
        reach = ceil(0.5 * (attenuation - 8.0) / (2.285 * 2.0 * pi * transition / period))
        remain = (count + 2 * reach) / keep_every
        if remain < fewest:
            best, fewest = (keep_every, reach, beta), remain
    return best


def gated_frequencies(problem: Problem, tolerance: float) -> int:
    """How many frequencies `gated` will leave."""
    design = _design(problem, tolerance)
    return problem.k.size if design is None else ceil((problem.k.size + 2 * design[1]) / design[0])
