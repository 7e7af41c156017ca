"""Background: what is measured without the thing of interest, and what leaks inside the instrument."""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from mirrorfold.calibration.record import blocks, by_blocks, check_same_axes, with_samples
from mirrorfold.common.arguments import truth
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
    s, other = sweep["s"].values, background["s"].values
    match = truth("match", match)
    gain = _gain(s, other) if match else 1.0
    left = by_blocks(s, lambda part, some: part.astype(complex) - gain * other[some].astype(complex))
    if not left.any():
        raise InputError("background: is the same as the sweep, nothing is left; give the sweep of the empty scene")
    matched = f" times {abs(gain):.4g} at {np.degrees(np.angle(gain)):.4g} degrees" if match else ""
    title = str(background.attrs.get("title", "")) or "another sweep"
    return with_samples(sweep, left, f"background subtracted: {title}{matched}")


def _gain(s: NDArray[np.complexfloating], other: NDArray[np.complexfloating]) -> complex:
    """The complex number times which the other samples leave least of the first ones."""
    product, power = 0.0j, 0.0
    for some in blocks(len(s), s.nbytes):
        mine, its = s[some].astype(complex), other[some].astype(complex)
        product += complex(np.vdot(its, mine))
        power += float(np.vdot(its, its).real)
    return product / power


def _middle(s: NDArray[np.complexfloating]) -> NDArray[np.complexfloating]:
    """Medians of real and imaginary parts over the last two axes."""
    real, imag = (np.median(part, axis=(-2, -1), keepdims=True) for part in (s.real, s.imag))
    return np.asarray(real + 1j * imag)


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
    left = by_blocks(s, lambda part, _: part - _middle(part))
    if not left.any():
        raise InputError("subtract_mean: all channels are the same, nothing is left; use a background")
    return with_samples(sweep, left, "median of all channels subtracted, frequency by frequency")
