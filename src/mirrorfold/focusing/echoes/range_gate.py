"""A range gate: the part of a sweep that comes from the ranges of some pixels, at fewer frequencies.

The frequency step dk of a sweep makes paths unambiguous over P = 2 pi / dk. Some pixels have paths that differ by much
less than P. For them coarser steps are enough, once the echoes from all other ranges are removed. A low-pass filter h
over frequency, centred on the middle path d_c of the window, keeps paths d with ``|d - d_c| <= w`` and suppresses those
with ``|d - d_c| >= P/D - w``, so that every D-th frequency is enough::

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
"""Echoes outside of the window may be this much stronger [dB] than those inside: walls glint, near pixels are dark."""

FEWEST = 8
"""Sweeps with fewer frequencies than this are not filtered."""

WORTHWHILE = 0.5
"""The filter is used only if at most this share of the frequencies remains."""


def gated(problem: Problem, s: NDArray[np.complex64], tolerance: float) -> tuple[Problem, NDArray[np.complex64]]:
    """The same problem at fewer frequencies, and its samples; both as given where the filter does not pay.

    Parameters
    ----------
    problem : Problem
    s : (frequencies, tx, rx) or, monostatic, (frequencies, tx) array
    tolerance : float
        Largest ripple of the filter, relative to the echoes inside of the window.
    """
    design = _design(problem, tolerance)
    if design is None:
        return problem, s
    keep_every, reach, beta = design
    count, step, (middle, _) = problem.k.size, problem.wavenumber_step, _paths(problem)
    first = -ceil(reach / keep_every)
    kept_steps = np.arange(first, (count - 1 + reach) // keep_every + 1) * keep_every
    lag = kept_steps[:, None] - np.arange(count)
    taps = np.sinc(lag / keep_every) * np.i0(beta * np.sqrt(np.maximum(1.0 - (lag / reach) ** 2, 0.0))) / np.i0(beta)
    matrix = np.where(np.abs(lag) <= reach, taps, 0.0) * problem.taper * np.exp(-1j * step * middle * lag)
    fewer = replace(problem, k=problem.k[0] + step * kept_steps, taper=np.ones(kept_steps.size, dtype=np.complex128))
    data = matrix.astype(np.complex64) @ s.reshape(count, -1)
    return fewer, data.reshape(kept_steps.size, *s.shape[1:])


def _paths(problem: Problem) -> tuple[float, float]:
    """Middle and half extent [m] of the path lengths from any transmitter by way of any pixel to any receiver."""
    axes = (problem.x, problem.y, problem.z)
    low, high = (np.array([end(axis) for axis in axes]) for end in (np.min, np.max))
    shortest, longest = 0.0, 0.0
    for elements in (problem.tx, problem.rx):
        nearest = np.linalg.norm(np.maximum(np.maximum(low - elements, elements - high), 0.0), axis=1)
        farthest = np.linalg.norm(np.maximum(np.abs(low - elements), np.abs(high - elements)), axis=1)
        shortest, longest = shortest + float(nearest.min()), longest + float(farthest.max())
    return 0.5 * (shortest + longest), 0.5 * (longest - shortest)


def _design(problem: Problem, tolerance: float) -> tuple[int, int, float] | None:
    """D, the filter's half length [frequency steps] and Kaiser's beta; None where too many frequencies would remain."""
    count, (_, half_extent) = problem.k.size, _paths(problem)
    if count < FEWEST:
        return None
    period = 2.0 * pi / problem.wavenumber_step
    attenuation = BEHIND_DB - 20.0 * log10(tolerance)
    beta = 0.1102 * (attenuation - 8.7)
    best, fewest = None, WORTHWHILE * count
    for keep_every in range(2, count):
        transition = period / keep_every - 2.0 * half_extent
        if transition <= 0.0:
            break
        reach = ceil(0.5 * (attenuation - 8.0) / (2.285 * 2.0 * pi * transition / period))
        remain = (count + 2 * reach) / keep_every
        if remain < fewest:
            best, fewest = (keep_every, reach, beta), remain
    return best


def gated_frequencies(problem: Problem, tolerance: float) -> int:
    """Number of frequencies that `gated` will leave, to within one."""
    design = _design(problem, tolerance)
    return problem.k.size if design is None else ceil((problem.k.size + 2 * design[1]) / design[0])
