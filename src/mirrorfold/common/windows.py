"""Windows: weights over the frequencies and over the elements of an array."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mirrorfold.common.arguments import in_message
from mirrorfold.errors import InputError

TAYLOR_SIDE_LOBE_DB = 30
"""Level of the nearest side lobes of the Taylor window below its main lobe [dB]."""

TAYLOR_NBAR = 4
"""Number of side lobes next to the main lobe of the Taylor window that have nearly the same level."""


def hann(n: int) -> NDArray[np.float64]:
    """``sin^2(pi (i + 1) / (n + 1))``, i = 0..n-1: a Hann window without its two zeros, so that every sample counts."""
    return np.sin(np.pi * np.arange(1, n + 1) / (n + 1)) ** 2


def _triangular(n: int) -> NDArray[np.float64]:
    """``1 - 2/(n-1) |i - (n+1)/2|``, i = 1..n (Cui and Trichopoulos 2024)."""
    if n < 3:
        return np.ones(n)
    return 1.0 - 2.0 / (n - 1) * np.abs(np.arange(1, n + 1) - (n + 1) / 2.0)


def _taylor(n: int) -> NDArray[np.float64]:
    from scipy.signal.windows import taylor  # takes a second to import

    return taylor(n, nbar=TAYLOR_NBAR, sll=TAYLOR_SIDE_LOBE_DB, norm=False)


HANN_CELL = 2.0
"""Half-amplitude width of the Hann window's main lobe, in the inverse of its length: in range, in units of c/(2B)."""

ENVELOPE_SAMPLES = 16
"""Samples of a window's spectrum in the inverse of its length."""


WINDOWS: dict[str, Callable[[int], NDArray[np.float64]]] = {
    "uniform": np.ones,
    "hann": hann,
    "triangular": _triangular,
    "taylor": _taylor,
}
"""The functions that make n weights, by the name of the window."""


MOST_WEIGHTS = 4096
"""Largest number of weights of a window known by name: a file may say that it has billions."""


def known_weights(taper: Any, points: int) -> NDArray[np.float64]:
    """Weights (n,) that a file tells: of a window by its name, or the user's own; empty if they are not known."""
    with suppress(InputError):
        return np.abs(window(taper, min(points, MOST_WEIGHTS) if isinstance(taper, str) else points, "taper"))
    return np.zeros(0)


def window(kind: str | ArrayLike | None, n: int, name: str) -> NDArray[np.complex128]:
    """`n` weights: those of a window by its name, the user's own numbers, or ones for None.

    Raises
    ------
    InputError
        For an unknown name, a wrong length, weights that are not finite or all zero; `name` is the argument's name.
    """
    if kind is None:
        kind = "uniform"
    if isinstance(kind, str):
        if kind not in WINDOWS:
            raise InputError(
                f"{name} is {in_message(kind)}, expected one of {', '.join(sorted(WINDOWS))} or an array of {n} weights"
            )
        return np.asarray(WINDOWS[kind](n), dtype=np.complex128)
    try:
        weights = np.asarray(kind, dtype=np.complex128)
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"{name} holds values that are not numbers; give a window's name or {n} weights") from None
    if weights.shape != (n,):
        raise InputError(f"{name} has shape {weights.shape}, expected ({n},): one weight for each sample")
    if not np.isfinite(weights).all() or not weights.any():
        raise InputError(f"{name} holds weights that are not finite, or only zeros; give finite numbers")
    return weights


def spectrum_of(weights: ArrayLike, samples: int = ENVELOPE_SAMPLES) -> NDArray[np.float64]:
    """Amplitude of a window's spectrum over its peak, from zero on, with so many `samples` for each inverse length."""
    weight = np.abs(np.asarray(weights))
    spectrum = np.abs(np.fft.rfft(weight, samples * weight.size))
    return spectrum / spectrum[0]


def half_amplitude_width(weights: ArrayLike) -> float:
    """Width of a window's main lobe at half of its amplitude, in the inverse of its length: 1.21 for equal weights."""
    level = spectrum_of(weights)
    after = int(np.argmax(level < 0.5))
    if after == 0:  # two or three weights, of which one counts
        return float(np.size(weights))
    share = (level[after - 1] - 0.5) / (level[after - 1] - level[after])
    return float(2.0 * (after - 1 + share) / ENVELOPE_SAMPLES)


def cell_of(weights: ArrayLike) -> float:
    """Half-amplitude width of a window's main lobe, in units of c/(2B): `HANN_CELL` for Hann, others in proportion.

    Where no weights are known, they are taken to be those of Hann.
    """
    count = np.size(weights)
    return HANN_CELL * half_amplitude_width(weights) / half_amplitude_width(hann(count)) if count else HANN_CELL


def side_lobe_envelope(weights: ArrayLike, distance: ArrayLike) -> NDArray[np.float64]:
    """Level of the highest side lobe at a distance or farther from the main lobe of a window, relative to its peak.

    The unit of the distance is the inverse length of the window: a uniform one has its first null at one, and at the
    distance x about the level ``1 / (pi x)``.
    """
    envelope = np.maximum.accumulate(spectrum_of(weights)[::-1])[::-1]
    at = np.arange(envelope.size) / ENVELOPE_SAMPLES
    return np.interp(np.asarray(distance, dtype=float), at, envelope)
