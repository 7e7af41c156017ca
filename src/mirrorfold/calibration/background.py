"""Background: what is measured without the thing of interest, and what leaks inside the instrument."""

from __future__ import annotations

import numpy as np
import xarray as xr

from mirrorfold.calibration.record import check_same_axes, with_samples
from mirrorfold.errors import InputError
from mirrorfold.sweep import check_sweep


def subtract_background(sweep: xr.Dataset, background: xr.Dataset, *, match: bool = False) -> xr.Dataset:
    """The sweep without what a second sweep shows as well.

    Parameters
    ----------
    sweep, background : xarray.Dataset
        Measured in the same way: the second of the empty scene, or of the scene with the target turned, in which case
        the target shows twice, once negative.
    match : bool, default False
        Multiply the background by the one complex number that leaves least, which removes a drift of gain and phase
        between the two. Not where the target is stronger than the background.

    Returns
    -------
    xarray.Dataset

    Raises
    ------
    InputError
        If the two differ in frequencies, positions or directions, or nothing is left.
    """
    sweep, background = check_sweep(sweep), check_sweep(background, source="background")
    check_same_axes(sweep, background, "background")
    s, other = sweep["s"].values.astype(complex), background["s"].values.astype(complex)
    gain = complex(np.vdot(other, s) / np.vdot(other, other).real) if match else 1.0
    left = s - gain * other
    if not left.any():
        raise InputError("background: is the same as the sweep, nothing is left; give the sweep of the empty scene")
    matched = f" times {abs(gain):.4g} at {np.degrees(np.angle(gain)):.4g} degrees" if match else ""
    title = str(background.attrs.get("title", "")) or "another sweep"
    return with_samples(sweep, left, f"background subtracted: {title}{matched}")


def subtract_mean(sweep: xr.Dataset) -> xr.Dataset:
    """The sweep without what all its channels or beams have in common, frequency by frequency: leakage.

    The mean is taken over real and imaginary parts separately as the median, which bright echoes in some channels
    do not move.

    Parameters
    ----------
    sweep : xarray.Dataset

    Returns
    -------
    xarray.Dataset
    """
    sweep = check_sweep(sweep)
    s = sweep["s"].values
    if s.shape[-1] * s.shape[-2] < 2:
        raise InputError(
            "subtract_mean: the sweep has a single channel, of which nothing would be left; use a background"
        )
    common = np.median(s.real, axis=(-2, -1), keepdims=True) + 1j * np.median(s.imag, axis=(-2, -1), keepdims=True)
    left = s - common
    if not left.any():
        raise InputError("subtract_mean: all channels are the same, nothing is left; use a background")
    return with_samples(sweep, left, "median of all channels subtracted, frequency by frequency")
