"""Ratios in decibels, and the decibels and colours that all pictures have in common, whichever program draws them."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

from mirrorfold.common.types import Array

COLOURS = ("#009E73", "#E69F00", "#CC79A7", "#56B4E9", "#D55E00", "#0072B2")
"""Colours by number of bounces, which the colour-blind can tell apart, too (Okabe and Ito, 2008)."""

PASSED_COLOUR, PASSED_LABEL = "#7B3294", "seen through a wall"
"""Colour and label of points that passed through a half-transparent wall, and are therefore not folded."""

TRUTH_COLOUR = "#CC0000"

NEPER = float(np.log(10.0)) / 20.0
"""Nepers in a decibel: a level L [dB] is the natural logarithm ``NEPER L`` of a ratio of amplitudes."""

Level = TypeVar("Level", float, Array)
"""A level in decibels, or an array of levels."""

REFERENCE_QUANTILE = 0.9995
"""Quantile over the pixels in view that is shown as 0 dB: the few glints above it are saturated."""


def reference(amplitude: ArrayLike) -> float:
    """The amplitude shown as 0 dB: the quantile `REFERENCE_QUANTILE` of positive amplitudes, or 1 if there are none."""
    values = np.asarray(amplitude)
    positive = values[values > 0]
    return float(np.quantile(positive, REFERENCE_QUANTILE)) if positive.size else 1.0


def decibels(amplitude: Array, floor_db: float) -> Array:
    """``20 log10`` of amplitudes over their `reference`, clipped to [floor_db, 0]; all floor_db if none is positive."""
    if not (amplitude > 0).any():
        return np.full(amplitude.shape, floor_db)
    level = 20.0 * np.log10(np.maximum(amplitude / reference(amplitude), ratio_of(floor_db)))
    return np.asarray(np.minimum(level, 0.0))


def to_db(ratio: Array) -> Array:
    """``20 log10`` of ratios of amplitudes (n,); for zero, a very low number."""
    return np.asarray(20.0 * np.log10(np.maximum(ratio, np.finfo(float).tiny)))


def ratio_of(db: Level) -> Level:
    """The ratio of amplitudes that decibels stand for, ``10^(db / 20)``: the inverse of `to_db`."""
    return 10.0 ** (db / 20.0)


def power_ratio_of(db: Level) -> Level:
    """The ratio of powers that decibels stand for, ``10^(db / 10)``."""
    return 10.0 ** (db / 10.0)


def power_decibel(power: float) -> float | None:
    """``10 log10`` of a ratio of powers; None where there is no power."""
    return 10.0 * float(np.log10(power)) if power > 0 else None


def bounce_label(count: int) -> str:
    """The words for a number of bounces."""
    return "in line of sight" if count == 0 else "1 bounce" if count == 1 else f"{count} bounces"
