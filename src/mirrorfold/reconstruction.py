"""The six steps, one call each: from a raw sweep to the corrected scene."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import xarray as xr

from mirrorfold.focusing import focus
from mirrorfold.folding.plan import fold
from mirrorfold.sweep import is_monostatic, is_raster

Progress = Callable[[int, int], None]


def reconstruct(
    sweep: xr.Dataset,
    *,
    tolerance: float = 1e-3,
    progress: Progress | None = None,
    **settings: Any,
) -> xr.DataTree:
    """See around the corner: focus a sweep (step 1) and fold the image (steps 2 to 6).

    Parameters
    ----------
    sweep : xarray.Dataset
        MIMO or synthetic-aperture Sweep, or that of a raster scan.
    tolerance : float
        Relative error of the image. 1e-3 is 60 dB below the image, and far below the threshold.
    progress : callable (done, total), optional
    **settings
        Passed on to `mirrorfold.fold`.

    Returns
    -------
    xarray.DataTree
        The Reconstruction.

    Raises
    ------
    InputError
        If the sweep or a setting cannot be used.
    """
    image = focus(sweep, tolerance=tolerance, progress=progress)
    if is_raster(sweep) or is_monostatic(sweep):
        return fold(image, **settings)
    return fold(image, sweep=sweep, **settings)
