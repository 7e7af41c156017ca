"""The time gate: it keeps the echoes between two ranges and removes all others."""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from mirrorfold.calibration.record import by_blocks, with_samples
from mirrorfold.common.arguments import number
from mirrorfold.common.types import Array
from mirrorfold.errors import InputError
from mirrorfold.sweep import ambiguous_range, antenna_positions, check_sweep, is_monostatic, is_raster

FLANK_CELLS = 3.0
"""Length of each flank of a gate, in range cells: the transform of a raised cosine of this length decays so fast that
the gate does not change neighbouring echoes."""


def time_gate(sweep: xr.Dataset, start: float | None = None, stop: float | None = None) -> xr.Dataset:
    """Remove from a sweep what arrives before one range or after another one.

    Late echoes are removed only where `stop` is given, because echoes of many bounces are of interest. The flanks of
    the gate lie outside of both ranges; each is half a raised cosine, three range cells long. Only where early echoes
    are removed and `stop` lies at the end of the ambiguous range, its flank lies before it: ranges beyond the end are
    those of the earliest echoes, such as leakage into the receiver.

    Parameters
    ----------
    sweep : xarray.Dataset
    start : float [m], optional
        Range, half a path, from which on echoes are kept; by default all early echoes are kept.
    stop : float [m], optional
        Range up to which echoes are kept; by default the ambiguous range. If the sweep has a `scene_center`, both
        ranges lie at most half the ambiguous range from that of this place.

    Returns
    -------
    xarray.Dataset

    Raises
    ------
    InputError
        If the gate is empty or reaches beyond the ambiguous range, or the sweep has a single frequency.
    """
    sweep = check_sweep(sweep)
    frequency = sweep["frequency"].values.astype(float)
    if frequency.size < 2:
        raise InputError("time_gate: the sweep has a single frequency, so ranges cannot be told apart; sweep a band")
    span = ambiguous_range(sweep)
    earliest, latest = _unambiguous(sweep, span)
    first = earliest if start is None else number("start", start, "m")
    last = latest if stop is None else number("stop", stop, "m")
    if not (np.all(earliest <= first) and np.all(first < last) and np.all(last <= latest + 1e-9 * span)):
        where = "" if sweep.attrs.get("scene_center") is None else " around the scene_center"
        raise InputError(
            f"time gate from {np.min(first):g} to {np.max(last):g} m, expected {np.max(earliest):.4g} <= start < stop "
            f"<= {np.min(latest):.4g} m, the ambiguous range{where}"
        )
    flank = _flank(span, frequency.size)
    end = np.where(first > earliest, np.minimum(last, np.maximum(first, latest - flank)), last)
    s = np.moveaxis(sweep["s"].values, sweep["s"].get_axis_num("frequency"), 0)

    def kept(part: NDArray[np.complexfloating], some: slice) -> NDArray[np.complex128]:
        ends = (one if np.ndim(one) == 0 else np.broadcast_to(one, s.shape[1:])[some] for one in (first, end))
        return gate_samples(part, span, *ends)

    gated = by_blocks(s, kept, axis=1)
    gated = np.moveaxis(gated, 0, sweep["s"].get_axis_num("frequency"))
    return with_samples(sweep, gated, f"time gate from {np.mean(first):g} to {np.mean(end):g} m")


def _unambiguous(sweep: xr.Dataset, span: float) -> tuple[Array, Array]:
    """First and last unambiguous range [m], for each channel where there is a `scene_center`, else the same for all.

    `span` is the ambiguous range [m].
    """
    centre = sweep.attrs.get("scene_center")
    if centre is None or is_raster(sweep):
        return np.zeros(()), np.full((), span)
    tx, rx = (np.linalg.norm(places - np.asarray(centre, dtype=float), axis=1) for places in antenna_positions(sweep))
    middle = tx if is_monostatic(sweep) else 0.5 * (tx[:, None] + rx)
    return middle - 0.5 * span, middle + 0.5 * span


def _flank(span: float, count: int) -> float:
    """Length [m] of each flank, with the ambiguous range `span` [m] and the number of frequencies."""
    return FLANK_CELLS * span / count


def gate_samples(
    s: NDArray[np.complexfloating], farthest: float, start: ArrayLike, stop: ArrayLike
) -> NDArray[np.complex128]:
    """Gate samples (frequency, ...): keep what arrives between the ranges `start` and `stop` [m].

    The ranges are the same for all channels, or arrays (...) with one for each. They are understood modulo the
    ambiguous range, `farthest` [m].
    """
    count = len(s)
    flank = _flank(farthest, count)
    start, stop = np.asarray(start), np.asarray(stop)
    middle, half = 0.5 * (start + stop), 0.5 * (stop - start)
    distance = (np.arange(count) * farthest / count).reshape(-1, *[1] * (s.ndim - 1)) - middle
    distance = np.abs((distance + 0.5 * farthest) % farthest - 0.5 * farthest)
    profile = np.fft.ifft(s, axis=0)
    profile *= 0.5 + 0.5 * np.cos(np.pi * np.clip((distance - half) / flank, 0.0, 1.0))
    return np.asarray(np.fft.fft(profile, axis=0))
