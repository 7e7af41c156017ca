"""Forecasts of `focus`, without focusing: the algorithm, its time and memory, and the image's shape and labels."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import xarray as xr

from mirrorfold.common.settings import takes
from mirrorfold.focusing.checks import make_problem
from mirrorfold.focusing.choosing.choice import explain
from mirrorfold.focusing.choosing.facts import Choice
from mirrorfold.focusing.choosing.strips import room_for_tables
from mirrorfold.focusing.labels import Labels
from mirrorfold.focusing.scans.imaging import choose_scan, expected_scan
from mirrorfold.focusing.settings import FocusSettings
from mirrorfold.sweep import is_raster


@takes(FocusSettings)
def choose_algorithm(geometry: xr.Dataset, *, frames: int = 1, **given: Any) -> Choice:
    """The algorithm that `focus` will take, the other possible ones, and the predicted time and memory of each.

    Parameters
    ----------
    geometry : xarray.Dataset
        A sweep, or only its ``frequency`` [Hz] and ``tx_position``, ``rx_position`` [m] (or ``antenna_position``).
    frames : int, default 1
        Number of images that will be made with one plan.
    **given

    Returns
    -------
    Choice
        Times hold for this machine with all its cores idle. The machine's speed is measured at the first call, in a
        quarter of a second, and kept in the user's cache folder.

    Raises
    ------
    InputError
        As `focus`.
    """
    settings = FocusSettings().with_given(**given)
    if is_raster(geometry):
        return choose_scan(geometry, settings)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        _, problem = make_problem(geometry, settings)
    room = room_for_tables(problem, frames, settings.memory_limit, samples_held="s" in geometry)
    return explain(problem, float(settings.tolerance), frames, [f"{warning.message}." for warning in caught], room)


@takes(FocusSettings)
def expected_image(geometry: xr.Dataset, **given: Any) -> xr.DataArray:
    """An image of zeros with the shape and labels that `focus` will give the image of a sweep.

    Of a raster scan it is the amplitude of the volume, or the voxels. One zero in memory stands for all values.

    Raises
    ------
    InputError
        As `focus`.
    """
    settings = FocusSettings().with_given(**given)
    if is_raster(geometry):
        return expected_scan(geometry, settings)
    sweep, problem = make_problem(geometry, settings)
    return Labels(sweep, problem, settings).image(np.broadcast_to(np.complex64(0.0), problem.shape), {})
