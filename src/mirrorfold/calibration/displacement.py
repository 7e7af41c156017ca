"""The displacement between the transmitting and the receiving aperture, from a reflector at known places."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from mirrorfold.calibration.common_delay import fit_reflectors
from mirrorfold.calibration.elements import LARGEST_ERROR
from mirrorfold.calibration.record import checked_pairs, millimetres, recorded
from mirrorfold.calibration.reflectors import positions
from mirrorfold.common.arguments import number
from mirrorfold.common.geometry import place
from mirrorfold.common.types import Array

CONDITION = 1e-3
"""Combinations of displacement and cable length that the measured places tell apart worse than this, as a share of
the best, are left at zero."""


def estimate_displacement(
    sweep: xr.Dataset | Sequence[xr.Dataset],
    *,
    at: ArrayLike | Sequence[ArrayLike],
    radius: float = 0.0,
    largest: float = 4.0 * LARGEST_ERROR,
    largest_common: float | None = None,
) -> tuple[Array, float]:
    """How far the receivers stand from where they are said to stand, all by the same vector.

    The ways over the reflector at place n lengthen by ``c - u_nk . delta`` with the direction u from receiver k to
    the reflector and a common delay c. Across the direction of sight one place tells the displacement; along it, at
    least two places in different directions are needed, to tell it from the delay.

    Parameters
    ----------
    sweep : xarray.Dataset, or several
    at : (2,) or (3,) [m], or several
        The middle of the sphere, in each of the sweeps.
    radius : float [m], default 0
        Of the sphere.
    largest : float [m], default 20 mm
        Largest displacement that is looked for.
    largest_common : float [m], optional
        Largest common delay; by default any, modulo the period ``c / df`` of the sweep.

    Returns
    -------
    displacement : (3,) array [m]
        To be added to the receivers' positions: see `displace_receivers`.
    cable_length : float [m]
        The common delay as a path.

    Raises
    ------
    InputError
        If the numbers of sweeps and places differ, or the reflector is not heard.
    """
    largest = number("largest", largest, "m", above=0.0)
    rows, measured = [], []
    for one, centre, fit in fit_reflectors(sweep, at, radius, largest_error=largest, largest_common=largest_common):
        rx = positions(one)[1]
        towards = (centre - rx) / np.linalg.norm(centre - rx, axis=1)[:, None]
        rows.append(np.column_stack([-towards, np.ones(len(rx))])[fit.rx_valid])
        measured.append((fit.rx_delay + fit.tx_delay[fit.tx_valid].mean())[fit.rx_valid])
    matrix, delay = np.concatenate(rows), np.concatenate(measured)
    weight: Array = np.ones(len(delay))
    solution: Array = np.zeros(4)
    for _ in range(ROBUST_ITERATIONS):
        solution = np.asarray(np.linalg.lstsq(matrix * weight[:, None], delay * weight, rcond=CONDITION)[0])
        misfit = np.abs(delay - matrix @ solution)
        weight = 1.0 / np.maximum(misfit / (3.0 * np.median(misfit) + np.finfo(float).eps), 1.0)
    return solution[:3], float(solution[3])


ROBUST_ITERATIONS = 10
"""Rounds of reweighting, after which single wrong receivers no longer count."""


def displace_receivers(sweep: xr.Dataset, displacement: ArrayLike) -> xr.Dataset:
    """The sweep with all receivers moved by a vector [m]."""
    sweep = checked_pairs(sweep, "sweep")
    vector = place(displacement, "displacement")
    moved = (sweep["rx_position"].dims, sweep["rx_position"].values + vector, sweep["rx_position"].attrs)
    return recorded(sweep.assign_coords(rx_position=moved), f"receivers moved by {millimetres(vector)}")
