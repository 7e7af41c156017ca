"""The time gate: keeping what arrives between two ranges."""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from mirrorfold.calibration.record import by_blocks, with_samples
from mirrorfold.common.arguments import number
from mirrorfold.errors import InputError
from mirrorfold.sweep import ambiguous_range, check_sweep

FLANK_CELLS = 3.0
"""Length of the flanks of a gate in range cells: the transform of a raised cosine of that length has died out before
it moves an echo's neighbours."""


def time_gate(sweep: xr.Dataset, start: float | None = None, stop: float | None = None) -> xr.Dataset:
    """The sweep without what arrives before one range and after another.

    Nothing late is cut unless asked for: echoes of many bounces are what one wants to see. The flanks of the gate lie
    outside of it, half a raised cosine of three range cells each.

    Parameters
    ----------
    sweep : xarray.Dataset
    start : float [m], optional
        Range, half a path, from which on echoes are kept. By default everything early is kept too.
    stop : float [m], optional
        Range up to which echoes are kept; by default up to the ambiguous range.

    Returns
    -------
    xarray.Dataset

    Raises
    ------
    InputError
        If the gate is empty or the sweep has a single frequency.
    """
    sweep = check_sweep(sweep)
    frequency = sweep["frequency"].values.astype(float)
    if frequency.size < 2:
        raise InputError("time_gate: the sweep has a single frequency, so ranges cannot be told apart; sweep a band")
    farthest = ambiguous_range(sweep)
    first = 0.0 if start is None else number("start", start, "m")
    last = farthest if stop is None else number("stop", stop, "m")
    if not 0.0 <= first < last <= farthest * (1.0 + 1e-9):
        raise InputError(
            f"time gate from {first:g} to {last:g} m, expected 0 <= start < stop <= {farthest:.4g} m, "
            "the ambiguous range"
        )
    s = np.moveaxis(sweep["s"].values, sweep["s"].get_axis_num("frequency"), 0)
    gated = by_blocks(s, lambda part, _: gate_samples(part, farthest, first, last), axis=1)
    gated = np.moveaxis(gated, 0, sweep["s"].get_axis_num("frequency"))
    return with_samples(sweep, gated, f"time gate from {first:g} to {last:g} m")


def gate_samples(s: NDArray[np.complexfloating], farthest: float, start: float, stop: float) -> NDArray[np.complex128]:
    """Samples (frequency, ...) of what arrives between two ranges [m], which count around the ambiguous range [m]."""
    count = len(s)
    flank = FLANK_CELLS * farthest / count
    middle, half = 0.5 * (start + stop), 0.5 * (stop - start)
    away = np.arange(count) * farthest / count - middle
    away = np.abs((away + 0.5 * farthest) % farthest - 0.5 * farthest)
    weight = 0.5 + 0.5 * np.cos(np.pi * np.clip((away - half) / flank, 0.0, 1.0))
    profile = np.fft.ifft(s, axis=0)
    profile *= weight.reshape(-1, *[1] * (s.ndim - 1))
    return np.asarray(np.fft.fft(profile, axis=0))
