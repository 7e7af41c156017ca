"""Decibels and colours: what every picture has in common, drawn by whatever program."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from mirrorfold.common.types import Array

COLOURS = ("#009E73", "#E69F00", "#CC79A7", "#56B4E9", "#D55E00", "#0072B2")
"""By number of bounces; apart for the colour-blind too (Okabe and Ito, 2008)."""

PASSED_COLOUR, PASSED_LABEL = "#7B3294", "seen through a wall"
"""Of what passed through a half-transparent wall, and stays where it is seen."""

TRUTH_COLOUR = "#CC0000"

REFERENCE_QUANTILE = 0.9995
"""The amplitude shown as 0 dB, as a quantile over the pixels in view: glints above it are shown saturated."""


def reference(amplitude: ArrayLike) -> float:
    """The amplitude shown as 0 dB: the quantile `REFERENCE_QUANTILE` of what is above zero, 1 where nothing is."""
    values = np.asarray(amplitude)
    positive = values[values > 0]
    return float(np.quantile(positive, REFERENCE_QUANTILE)) if positive.size else 1.0


def decibels(amplitude: Array, floor_db: float) -> Array:
    """``20 log10`` of amplitudes over their reference, clipped to [floor, 0]; all floor where nothing is above zero.

    The reference is the quantile `REFERENCE_QUANTILE` of the pixels that are above zero.
    """
    if not (amplitude > 0).any():
        return np.full(amplitude.shape, floor_db)
    level = 20.0 * np.log10(np.maximum(amplitude / reference(amplitude), 10.0 ** (floor_db / 20.0)))
    return np.asarray(np.minimum(level, 0.0))


def to_db(ratio: Array) -> Array:
    """``20 log10`` of ratios of amplitudes (n,), of zero a very low number."""
    return np.asarray(20.0 * np.log10(np.maximum(ratio, np.finfo(float).tiny)))


def power_decibel(power: float) -> float | None:
    """``10 log10`` of a ratio of powers; None where there is no power."""
    return 10.0 * float(np.log10(power)) if power > 0 else None


def bounce_label(count: int) -> str:
    """The words for a number of bounces."""
    return "in line of sight" if count == 0 else "1 bounce" if count == 1 else f"{count} bounces"
