"""What the steps of the calibration share: checks of the given sweeps, work in blocks, and the history of steps."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from mirrorfold.common.arguments import wrong_kind
from mirrorfold.common.plausible import as_real_numbers
from mirrorfold.common.types import Array
from mirrorfold.errors import InputError
from mirrorfold.sweep import PAIR_DIMENSIONS, check_sweep, is_raster
from mirrorfold.sweep.polarization import polarizations


def history(sweep: xr.Dataset) -> list[str]:
    """The calibration steps applied to a sweep so far, oldest first."""
    steps = sweep.attrs.get("processing", [])
    return [steps] if isinstance(steps, str) else [str(step) for step in steps]


def recorded(sweep: xr.Dataset, step: str) -> xr.Dataset:
    """The sweep with one more step in its attribute `processing`."""
    return sweep.assign_attrs(processing=[*history(sweep), step])


def with_samples(sweep: xr.Dataset, s: NDArray[np.complexfloating], step: str) -> xr.Dataset:
    """The sweep with other samples of the same shape, and one more step in its history."""
    return recorded(sweep.assign(s=sweep["s"].copy(data=np.ascontiguousarray(s, dtype=np.complex64))), step)


BLOCK_BYTES = 4e6
"""Size of the blocks of samples that a step works on [bytes]. All samples at once, in double precision, would take
several times the memory of the sweep."""


def blocks(count: int, nbytes: float) -> list[slice]:
    """Slices of an axis of length `count` that cut an array of `nbytes` bytes into blocks of about `BLOCK_BYTES`."""
    rows = max(1, int(BLOCK_BYTES * count / max(nbytes, 1.0)))
    return [slice(first, first + rows) for first in range(0, count, rows)]


def by_blocks(
    s: NDArray[np.complexfloating], work: Callable[[NDArray[Any], slice], NDArray[Any]], axis: int = 0
) -> NDArray[np.complex64]:
    """New samples of the same shape: each block along an axis is replaced by ``work(block, its slice)``."""
    out = np.empty(s.shape, dtype=np.complex64)
    for some in blocks(s.shape[axis], s.nbytes):
        at = (*[slice(None)] * axis, some)
        out[at] = work(s[at], some)
    return out


MODERATE = (1e-12, 1e12)
"""Bounds on the largest sample, between which single precision holds the powers of samples, and the sums of these."""


def single_precision_scale(s: NDArray[np.complexfloating]) -> float:
    """The largest of the samples where their powers would overflow or vanish in single precision; elsewhere one."""
    peak = max((float(np.abs(as_real_numbers(part)).max(initial=0.0)) for part in s), default=0.0)
    return 1.0 if peak == 0.0 or MODERATE[0] < peak < MODERATE[1] else peak


def scaled_to_single_precision(s: NDArray[np.complexfloating]) -> NDArray[np.complexfloating]:
    """The samples, divided by their `single_precision_scale`."""
    scale = single_precision_scale(s)
    return s if scale == 1.0 else np.asarray(s / s.real.dtype.type(scale))


def unmeasured(s: NDArray[np.complexfloating], axis: int) -> NDArray[np.bool_]:
    """Which channels hold nothing but zeros, because they were not measured or are masked.

    The shape is that of `s` with one frequency; `axis` is the axis of the frequencies.
    """
    return np.asarray(~s.any(axis=axis, keepdims=True))


def samples_to_repair(sweep: Any, name: str) -> xr.Dataset:
    """Return a sweep that has complex samples over frequency, though it need not be valid otherwise.

    Raises
    ------
    InputError
        If it has none; `name` is that of the calling function, for the message.
    """
    if not isinstance(sweep, xr.Dataset):
        raise wrong_kind(name, sweep, "a sweep (xarray.Dataset)")
    if "s" not in sweep or sweep["s"].dtype.kind != "c":
        raise InputError(f"{name}: expected a sweep with a complex variable s")
    if "frequency" not in sweep["s"].dims:
        raise InputError(f"{name}: s has the dimensions {sweep['s'].dims}, expected 'frequency' among them")
    return sweep


def checked_pairs(sweep: xr.Dataset, name: str, *, several: bool = False) -> xr.Dataset:
    """Check that a sweep is a valid one of pairs, ``s(frequency, tx, rx)``, and return it.

    With `several`, the samples may have further dimensions before these, such as frames or polarizations.

    Raises
    ------
    InputError
        If the sweep is no valid one of pairs; `name` is that of the argument or of the function, for the message.
    """
    sweep = check_sweep(sweep, source=name)
    if is_raster(sweep):
        raise InputError(f"{name}: is a raster scan, expected a sweep with s(frequency, tx, rx)")
    pairs = sweep["s"].dims[-3:] == PAIR_DIMENSIONS
    if not pairs or (sweep["s"].ndim != 3 and not several):
        remedy = f"select one {sweep['s'].dims[0]}" if pairs else "one moving antenna has no pairs, leave this step out"
        raise InputError(f"{name}: s has dimensions {sweep['s'].dims}, expected (frequency, tx, rx); {remedy}")
    return sweep


def check_same_axes(sweep: xr.Dataset, other: xr.Dataset, name: str, *, antennas: bool = True) -> None:
    """Refuse a second sweep that was not measured at the same frequencies and, if `antennas`, the same positions.

    Raises
    ------
    InputError
        If the two differ; the message tells in what, and calls the second sweep `name`.
    """
    axes = ["frequency"]
    if antennas:
        sizes = [[(n, size) for n, size in one["s"].sizes.items() if n != "frame"] for one in (sweep, other)]
        if sizes[0] != sizes[1]:
            raise InputError(
                f"{name}: s has the sizes {dict(sizes[1])}, expected {dict(sizes[0])} as in the sweep; "
                "measure both in the same way"
            )
        waves = [polarizations(one) or one.attrs.get("polarization") for one in (sweep, other)]
        if None not in waves and waves[0] != waves[1]:
            raise InputError(f"{name}: has another polarization than the sweep; measure both in the same way")
        places = ("azimuth", "elevation", "tx_position", "rx_position", "antenna_position")
        axes += [n for n in places if n in sweep.variables]
    for axis in axes:
        if axis not in other.variables or other[axis].shape != sweep[axis].shape:
            raise InputError(f"{name}: has another {axis} than the sweep; measure both in the same way")
        a, b = sweep[axis].values.astype(float), other[axis].values.astype(float)
        if not np.allclose(a, b, rtol=1e-6, atol=1e-9):
            raise InputError(
                f"{name}: {axis} differs from that of the sweep by up to {np.abs(a - b).max():g}; "
                "measure both in the same way"
            )


FACTORS = tuple(
    re.compile(step) for step in ("delays.* of the elements removed", "divided by the response", "cable of .* removed")
)
"""Beginnings of those steps in the history that multiply the samples; a sweep that others are divided by needs the same
steps."""

OF_THE_INSTRUMENT = (re.compile("background subtracted"), *FACTORS)
"""Beginnings of all steps that remove an effect of the instrument; a second sweep, such as a background, needs the
same."""


def check_same_steps(
    sweep: xr.Dataset, other: xr.Dataset, name: str, kinds: Sequence[re.Pattern[str]] = OF_THE_INSTRUMENT
) -> None:
    """Refuse a second sweep that lacks a step of these kinds that the first sweep has been through.

    Using it on the first sweep would put in again what the step has removed.

    Raises
    ------
    InputError
        If a step is lacking; the message tells which, and calls the second sweep `name`.
    """
    for kind in kinds:
        done = [step for step in history(sweep) if kind.match(step)]
        if done and not any(kind.match(step) for step in history(other)):
            raise InputError(
                f"{name}: the sweep has been through the step '{done[0]}' and the {name} has not; give the sweep "
                "as it was measured, or both with the same steps"
            )


def millimetres(values: Sequence[float] | Array) -> str:
    """Lengths [m] as a text in millimetres, for the history."""
    return ", ".join(f"{1e3 * value:.4g}" for value in values) + " mm"
