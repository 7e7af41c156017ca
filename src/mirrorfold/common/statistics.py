"""Rows of numbers: their step, how far their errors spread, and runs of consecutive ones."""

from __future__ import annotations

import numpy as np

from mirrorfold.common.types import Array, Index

SIGMA_PER_MEDIAN = 1.4826
"""Standard deviation of normally distributed errors over the median of their absolute values."""

EQUAL_STEPS = 1e-3
"""Largest spread of the steps of a regular axis, as a share of their mean."""


LARGEST_PLAY = 0.2
"""Largest distance of a value from equal steps, as a share of the step, that is taken for rounding or for the play of a
drive. Beams overlap by more, so that no echo moves by a resolution cell."""


def in_equal_steps(axis: Array) -> bool:
    """Whether the values (n,) rise in equal steps, to `EQUAL_STEPS`; True for a single one."""
    step = np.diff(axis)
    rises = bool(np.isfinite(step).all() and (step > 0.0).all())
    return rises and (not step.size or bool(np.ptp(step) <= EQUAL_STEPS * step.mean()))


def without_play(axis: Array) -> Array:
    """The values (n,) in exactly equal steps if only rounding or play make their steps differ; otherwise unchanged.

    Examples
    --------
    >>> np.diff(without_play(np.array([0.0, 0.38, 0.75, 1.12, 1.5]))).round(6)  # two decimals of steps of 0.375
    array([0.374, 0.374, 0.374, 0.374])
    """
    if in_equal_steps(axis):
        return axis
    number = np.arange(axis.size)
    slope, first = np.polyfit(number, axis, 1)
    even = first + slope * number
    return even if np.abs(even - axis).max() <= LARGEST_PLAY * slope else axis


def mean_step(axis: Array) -> float:
    """Mean difference of neighbouring values (n,), in their unit; zero for a single one."""
    return float(axis[-1] - axis[0]) / max(axis.size - 1, 1)


def consecutive(first: Index | int, count: Index) -> Index:
    """Runs of `count` (n,) whole numbers each, that begin with `first` (n,), one run after the other."""
    return np.arange(count.sum()) + np.repeat(first - np.cumsum(count) + count, count)


def robust_deviation(error: Array) -> float:
    """Standard deviation of errors around zero, in their unit, by the median of their absolute values."""
    return SIGMA_PER_MEDIAN * float(np.median(np.abs(error)))
