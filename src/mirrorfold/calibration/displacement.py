"""The displacement between the transmitting and the receiving aperture, from a reflector at known places."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from mirrorfold.calibration.common_delay import fit_reflectors
from mirrorfold.calibration.delays import Fit
from mirrorfold.calibration.elements import LARGEST_ERROR
from mirrorfold.calibration.record import checked_pairs, millimetres, recorded
from mirrorfold.calibration.reflectors import positions, sphere_paths
from mirrorfold.common.arguments import number
from mirrorfold.common.geometry import place
from mirrorfold.common.types import Array, Index
from mirrorfold.common.windows import hann
from mirrorfold.errors import InputError
from mirrorfold.sweep import wavenumber

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
    found = fit_displacement(sweep, at=at, radius=radius, largest=largest, largest_common=largest_common)
    return found.vector, found.cable_length


class Displacement(NamedTuple):
    """The displacement of the receivers (3,) [m] and the common delay as a path [m], as `estimate_displacement` says.

    `error` (3,) are the standard errors of the displacement [m], by noise and by delays of the receivers' own: infinite
    where the measured directions do not tell. Wrong places of the reflector are not in them.
    """

    vector: Array
    cable_length: float
    error: Array


def fit_displacement(
    sweep: xr.Dataset | Sequence[xr.Dataset],
    *,
    at: ArrayLike | Sequence[ArrayLike],
    radius: float = 0.0,
    largest: float = 4.0 * LARGEST_ERROR,
    largest_common: float | None = None,
) -> Displacement:
    """The displacement with its errors; the arguments are those of `estimate_displacement`."""
    largest = number("largest", largest, "m", above=0.0)
    found = fit_reflectors(sweep, at, radius, largest_error=largest, largest_common=largest_common)
    measured = np.concatenate([(fit.rx_delay + fit.tx_delay[fit.tx_valid].mean())[fit.rx_valid] for *_, fit in found])
    displacement, common = np.zeros(3), 0.0
    towards: list[Array] = []
    for _ in range(NEWTON_STEPS):
        lengthening, towards = [], []
        for one, centre, fit in found:
            tx, rx = positions(one)[0], positions(one)[1][fit.rx_valid]
            moved = rx + displacement
            longer = sphere_paths(tx, moved, centre, radius) - sphere_paths(tx, rx, centre, radius)
            lengthening.append(longer.mean(axis=0))
            towards.append((centre - moved) / np.linalg.norm(centre - moved, axis=1)[:, None])
        delay = measured - np.concatenate(lengthening)
        step, common, weight, rcond = _solved(delay, np.concatenate(towards))
        displacement = displacement + step
        if np.linalg.norm(displacement) > largest:
            raise InputError(
                f"the receivers seem to stand {1e3 * np.linalg.norm(displacement):.3g} mm from their stated places, "
                f"more than the {1e3 * largest:.3g} mm that are looked for; give more places, or check them"
            )
    seen = np.concatenate(towards)
    matrix = weight[:, None] * (np.average(seen, axis=0, weights=weight**2) - seen)
    pulls = matrix * (weight * (delay - common + seen @ step))[:, None]
    receiver = np.concatenate([np.flatnonzero(fit.rx_valid) for *_, fit in found])
    where = np.repeat(np.arange(len(found)), list(map(len, towards)))
    late = np.array([_common_error(wavenumber(one), fit) for one, _, fit in found])
    wrong = matrix * (weight * late[where])[:, None]
    return Displacement(displacement, common, _errors(matrix, rcond, _sums(receiver, pulls), _sums(where, wrong)))


def _solved(delay: Array, towards: Array) -> tuple[Array, float, Array, float]:
    """The displacement (3,) and common delay [m] that explain delays (n,) seen in directions (n, 3) best; the weights
    of the delays, and the share of the best told direction below which others are left at zero.

    Least squares, in which single wrong receivers do not count.
    """
    weight: Array = np.ones(len(delay))
    used, rcond, step, common = weight, 1.0, np.zeros(3), 0.0
    for _ in range(ROBUST_ITERATIONS):
        middle, mean = np.average(towards, axis=0, weights=weight**2), np.average(delay, weights=weight**2)
        matrix = weight[:, None] * (middle - towards)
        least = CONDITION * np.linalg.norm(weight) / max(np.linalg.norm(matrix, 2), np.finfo(float).tiny)
        used, rcond = weight, min(float(least), 1.0)
        step = np.asarray(np.linalg.lstsq(matrix, weight * (delay - mean), rcond=rcond)[0])
        common = float(mean + middle @ step)
        misfit = np.abs(delay - common + towards @ step)
        weight = 1.0 / np.maximum(misfit / (3.0 * np.median(misfit) + np.finfo(float).eps), 1.0)
    return step, common, used, rcond


def _common_error(k: Array, fit: Fit) -> float:
    """Standard error of the delay that all pairs share [m], by how far the phases of single pairs are off.

    Of a phase the samples are summed, weighted by the taper; of a delay besides by ``k - mean k``.
    """
    taper, offset = hann(k.size), k - k.mean()
    phase = np.linalg.norm(taper) / taper.sum()
    delay = np.linalg.norm(taper * offset) / (taper @ offset**2)
    pairs = np.count_nonzero(fit.tx_valid) * np.count_nonzero(fit.rx_valid)
    return float(fit.residual * k.mean() * delay / phase / np.sqrt(pairs))


def _sums(group: Index, rows: Array) -> Array:
    """The sum of the rows (n, 3) of each group, (groups, 3)."""
    sums = np.zeros((int(group.max()) + 1, rows.shape[1]))
    np.add.at(sums, group, rows)
    return sums


def _errors(matrix: Array, rcond: float, own: Array, shared: Array) -> Array:
    """Standard errors (3,) of the solution of least squares with a matrix (n, 3).

    A receiver's own delay is the same wherever the reflector stands, so that all of its rows err together (Liang and
    Zeger, Biometrika 73, 1986), and so do all receivers at one place: `own` and `shared` are the sums of their rows
    times errors, (receivers, 3) and (places, 3).
    """
    _, size, ways = np.linalg.svd(matrix, full_matrices=False)
    told = size > rcond * size[0]
    count, unknowns = np.count_nonzero(own.any(axis=1)), np.count_nonzero(told) + 1
    inverse = (ways[told].T / size[told] ** 2) @ ways[told]
    spread = own.T @ own * (count / max(int(count - unknowns), 1)) + shared.T @ shared
    variance = np.diag(inverse @ spread @ inverse)
    return np.where(np.sum(ways[told] ** 2, axis=0) > TOLD, np.sqrt(variance), np.inf)


TOLD = 0.99
"""Share of an axis along which the directions tell of a displacement, for an error to be known there."""

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
