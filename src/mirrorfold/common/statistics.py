"""Rows of numbers: their step, how far their errors spread, and runs of consecutive ones."""

from __future__ import annotations

import numpy as np

from mirrorfold.common.types import Array, Index

SIGMA_PER_MEDIAN = 1.4826
"""Standard deviation of normally distributed errors over the median of their absolute values."""

EQUAL_STEPS = 1e-3
"""Largest spread of the steps of a regular axis, as a share of their mean."""


def in_equal_steps(axis: Array) -> bool:
    """Whether the values (n,) rise in equal steps, to `EQUAL_STEPS`; True for a single one."""
    step = np.diff(axis)
    rises = bool(np.isfinite(step).all() and (step > 0.0).all())
    return rises and (not step.size or bool(np.ptp(step) <= EQUAL_STEPS * step.mean()))


def mean_step(axis: Array) -> float:
    """Mean difference of neighbouring values (n,), in their unit; zero for a single one."""
    return float(axis[-1] - axis[0]) / max(axis.size - 1, 1)


def consecutive(first: Index | int, count: Index) -> Index:
    """Runs of `count` (n,) whole numbers each, that begin with `first` (n,), one run after the other."""
    return np.arange(count.sum()) + np.repeat(first - np.cumsum(count) + count, count)


def robust_deviation(error: Array) -> float:
    """Standard deviation of errors around zero, in their unit, by the median of their absolute values."""
    return SIGMA_PER_MEDIAN * float(np.median(np.abs(error)))
