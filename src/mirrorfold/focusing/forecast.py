"""What `focus` will make of a sweep, told beforehand: the algorithm, its time and memory, and the labelled image."""

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
    """Which algorithm `focus` will take, what else is possible, and the predicted time and memory of each.

    Parameters
    ----------
    geometry : xarray.Dataset
        A sweep, or only its ``frequency`` [Hz] and ``tx_position``, ``rx_position`` [m] (or ``antenna_position``).
    frames : int, default 1
        Images that will be made with one plan.
    **given

    Returns
    -------
    Choice
        Times are those of this machine with all its cores idle. Its speed is measured when it is first asked for, in a
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
    """The image that `focus` makes of a sweep, or the amplitude of a scan's volume, with its labels and without values:
    one number stands for all.

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
