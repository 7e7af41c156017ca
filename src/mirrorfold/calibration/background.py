"""Subtraction of a background: a sweep without the object of interest, or the leakage that all channels share."""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from mirrorfold.calibration.record import blocks, by_blocks, check_same_axes, check_same_steps, unmeasured, with_samples
from mirrorfold.common.arguments import boolean
from mirrorfold.errors import InputError
from mirrorfold.sweep import check_sweep


def subtract_background(sweep: xr.Dataset, background: xr.Dataset, *, match: bool = False) -> xr.Dataset:
    """Subtract a background, a second sweep, from a sweep.

    Parameters
    ----------
    sweep, background : xarray.Dataset
        Two sweeps measured in the same way. The background shows the empty scene, or the scene with the target turned;
        then the target shows twice, once negative. One background may serve for all frames of a recording.
    match : bool, default False
        Multiply the background by the complex number that leaves the least power, which removes a drift of gain and
        phase between the two sweeps. Do not use it where the target is stronger than the background.

    Returns
    -------
    xarray.Dataset
        Samples of pairs that were not measured in one of the two sweeps are zero; see `mirrorfold.sweep`.

    Raises
    ------
    InputError
        If the two differ in frequencies, positions, directions, frames or steps of calibration, or nothing is left.
    """
    sweep, background = check_sweep(sweep), check_sweep(background, source="background")
    check_same_axes(sweep, background, "background")
    check_same_steps(sweep, background, "background")
    frames, frames_of_other = (one["s"].sizes.get("frame") for one in (sweep, background))
    if frames_of_other is not None and frames_of_other != frames:
        raise InputError(
            f"background: is a recording of {frames_of_other} frames, and the sweep has {frames or 'none'}; "
            "give one of its frames"
        )
    s, other = sweep["s"].values, np.broadcast_to(background["s"].values, sweep["s"].shape)
    match = boolean("match", match)
    lacking = unmeasured(s, sweep["s"].get_axis_num("frequency"))
    if "measured" in background.variables:
        known = background["measured"].astype(bool)
        sweep = sweep.assign_coords(measured=known & sweep["measured"].astype(bool) if "measured" in sweep else known)
        lacking = lacking | ~known.values
    gain = _gain(s, other, np.broadcast_to(lacking, s.shape)) if match else 1.0
    left = by_blocks(s, lambda part, some: part.astype(complex) - gain * other[some].astype(complex))
    np.copyto(left, 0.0, where=lacking)
    if not left.any():
        raise InputError("background: is the same as the sweep, nothing is left; give the sweep of the empty scene")
    matched = f" times {abs(gain):.4g} at {np.degrees(np.angle(gain)):.4g} degrees" if match else ""
    title = str(background.attrs.get("title", "")) or "another sweep"
    return with_samples(sweep, left, f"background subtracted: {title}{matched}")


def _gain(s: NDArray[np.complexfloating], other: NDArray[np.complexfloating], lacking: NDArray[np.bool_]) -> complex:
    """The complex number g that minimises the power of ``s - g other``, where samples are not `lacking`."""
    product, power = 0.0j, 0.0
    for some in blocks(len(s), s.nbytes):
        mine, its = s[some].astype(complex), np.where(lacking[some], 0.0, other[some].astype(complex))
        product += complex(np.vdot(its, mine))
        power += float(np.vdot(its, its).real)
    return product / power if power > 0.0 else 1.0


def _without_middle(s: NDArray[np.complexfloating], lacking: NDArray[np.bool_]) -> NDArray[np.complexfloating]:
    """Samples (frequencies, channels) minus the medians of their real and imaginary parts over the channels.

    Channels that are `lacking` (channels,) do not count, and become zero.
    """
    left = np.zeros_like(s)
    there = s[:, ~lacking]
    real, imag = (np.median(part, axis=1, keepdims=True) for part in (there.real, there.imag))
    left[:, ~lacking] = there - (real + 1j * imag)
    return left


def subtract_mean(sweep: xr.Dataset) -> xr.Dataset:
    """Subtract what all channels or beams of a sweep have in common at each frequency: leakage.

    It is estimated as the median over the channels, of real and imaginary parts separately. Bright echoes in some
    channels do not shift the median, as they would the mean.

    Parameters
    ----------
    sweep : xarray.Dataset

    Returns
    -------
    xarray.Dataset

    Raises
    ------
    InputError
        If the sweep has a single channel, or nothing is left.
    """
    sweep = check_sweep(sweep)
    s = sweep["s"].values
    axis = sweep["s"].get_axis_num("frequency")
    lacking = unmeasured(s, axis)
    if s[(0,) * axis].size < 2 * s.shape[axis]:
        raise InputError(
            "subtract_mean: the sweep has a single channel, of which nothing would be left; use a background"
        )
    left = np.zeros(s.shape, dtype=np.complex64)
    for frame in np.ndindex(s.shape[:axis]):
        channels = lacking[frame].ravel()
        flat, out = s[frame].reshape(s.shape[axis], -1), left[frame].reshape(s.shape[axis], -1)
        if not channels.all():
            for some in blocks(len(flat), flat.nbytes):
                out[some] = _without_middle(flat[some], channels)
    if not left.any():
        raise InputError("subtract_mean: all channels are the same, nothing is left; use a background")
    return with_samples(sweep, left, "median of all channels subtracted, frequency by frequency")
