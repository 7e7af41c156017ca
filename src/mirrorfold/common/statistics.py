"""What a row of numbers tells at a glance: its step, and how far its errors spread."""

from __future__ import annotations

import numpy as np

from mirrorfold.common.types import Array

SIGMA_PER_MEDIAN = 1.4826
"""Standard deviation of normally distributed errors over the median of their absolute values."""


def mean_step(axis: Array) -> float:
    """Mean difference of neighbouring values (n,), in their unit; zero for a single one."""
    return float(axis[-1] - axis[0]) / max(axis.size - 1, 1)


def robust_deviation(error: Array) -> float:
    """Standard deviation of errors around zero, in their unit, by the median of their absolute values."""
    return SIGMA_PER_MEDIAN * float(np.median(np.abs(error)))
