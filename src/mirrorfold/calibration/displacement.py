"""The displacement between the transmitting and the receiving aperture, from a reflector at known places."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from mirrorfold.calibration.common_delay import fit_reflectors
from mirrorfold.calibration.elements import LARGEST_ERROR
from mirrorfold.calibration.record import checked_pairs, millimetres, recorded
from mirrorfold.calibration.reflectors import positions, sphere_paths
from mirrorfold.common.arguments import number
from mirrorfold.common.geometry import place
from mirrorfold.common.types import Array
from mirrorfold.errors import InputError

CONDITION = 1e-3
"""Components of the displacement along which the measured directions differ by less, in the root mean square, are left
at zero."""


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
    the reflector and a common delay c, and by what is of higher order in delta. What all directions share is the delay;
    only how they differ tells of a displacement: places of the reflector in several directions do. Of one place the
    directions from the receivers differ a little, along the array alone.

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
        If the numbers of sweeps and places differ, the reflector is not heard, or the displacement is larger.
    """
    largest = number("largest", largest, "m", above=0.0)
    found = fit_reflectors(sweep, at, radius, largest_error=largest, largest_common=largest_common)
    measured = np.concatenate([(fit.rx_delay + fit.tx_delay[fit.tx_valid].mean())[fit.rx_valid] for *_, fit in found])
    displacement, common = np.zeros(3), 0.0
    for _ in range(NEWTON_STEPS):
        lengthening, towards = [], []
        for one, centre, fit in found:
            tx, rx = positions(one)[0], positions(one)[1][fit.rx_valid]
            moved = rx + displacement
            longer = sphere_paths(tx, moved, centre, radius) - sphere_paths(tx, rx, centre, radius)
            lengthening.append(longer.mean(axis=0))
            towards.append((centre - moved) / np.linalg.norm(centre - moved, axis=1)[:, None])
        step, common = _solved(measured - np.concatenate(lengthening), np.concatenate(towards))
        displacement = displacement + step
        if np.linalg.norm(displacement) > largest:
            raise InputError(
                f"the receivers seem to stand {1e3 * np.linalg.norm(displacement):.3g} mm from their stated places, "
                f"more than the {1e3 * largest:.3g} mm that are looked for; give more places, or check them"
            )
    return displacement, common


def _solved(delay: Array, towards: Array) -> tuple[Array, float]:
    """The displacement (3,) and common delay [m] that explain delays (n,) seen in directions (n, 3) best.

    Least squares, in which single wrong receivers do not count.
    """
    weight: Array = np.ones(len(delay))
    step, common = np.zeros(3), 0.0
    for _ in range(ROBUST_ITERATIONS):
        middle, mean = np.average(towards, axis=0, weights=weight**2), np.average(delay, weights=weight**2)
        matrix = weight[:, None] * (middle - towards)
        least = CONDITION * np.linalg.norm(weight) / max(np.linalg.norm(matrix, 2), np.finfo(float).tiny)
        step = np.asarray(np.linalg.lstsq(matrix, weight * (delay - mean), rcond=min(float(least), 1.0))[0])
        common = float(mean + middle @ step)
        misfit = np.abs(delay - common + towards @ step)
        weight = 1.0 / np.maximum(misfit / (3.0 * np.median(misfit) + np.finfo(float).eps), 1.0)
    return step, common


NEWTON_STEPS = 4
"""Each squares what is left, as a share of the distance to the reflector."""

ROBUST_ITERATIONS = 10
"""Rounds of reweighting, after which single wrong receivers no longer count."""


def displace_receivers(sweep: xr.Dataset, displacement: ArrayLike) -> xr.Dataset:
    """The sweep with all receivers moved by a vector [m]."""
    sweep = checked_pairs(sweep, "sweep", several=True)
    vector = place(displacement, "displacement")
    moved = (sweep["rx_position"].dims, sweep["rx_position"].values + vector, sweep["rx_position"].attrs)
    return recorded(sweep.assign_coords(rx_position=moved), f"receivers moved by {millimetres(vector)}")
