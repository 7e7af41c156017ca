"""The displacement of the receiving from the transmitting aperture, from the echoes of a reflector at known places.

If all receivers stand away from their stated positions by the same vector, the path over the reflector changes by the
component of this vector along the direction to the reflector. So the delays of the receivers, measured for several
directions to the reflector, give the vector by least squares.
"""

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
from mirrorfold.common.plausible import extent, shorter_unit
from mirrorfold.common.types import Array, Index
from mirrorfold.common.windows import hann
from mirrorfold.errors import InputError
from mirrorfold.sweep import ambiguous_range, wavenumber

CONDITION = 1e-3
"""Smallest rms difference of the measured directions, unit vectors, along a component of the displacement; components
along which they differ by less are not measured and left at zero."""


def estimate_displacement(
    sweep: xr.Dataset | Sequence[xr.Dataset],
    *,
    at: ArrayLike | Sequence[ArrayLike],
    radius: float = 0.0,
    largest: float = 4.0 * LARGEST_ERROR,
    largest_common: float | None = None,
) -> tuple[Array, float]:
    """Estimate the displacement of all receivers from their stated positions, the same vector for all.

    With the displacement delta, the path over the reflector at place n to receiver k is longer by ``c - u_nk . delta``,
    and terms of higher order in delta. Here u is the direction from the receiver to the reflector, and c a common
    delay. What all directions have in common cannot be separated from this delay; only their differences tell the
    displacement. So put the reflector at places in several directions. For a single place, the directions from the
    receivers differ a little, and only along the array.

    Parameters
    ----------
    sweep : xarray.Dataset, or several
    at : (2,) or (3,) [m], or several
        The middle of the sphere, in each of the sweeps.
    radius : float [m], default 0
        Of the sphere.
    largest : float [m], default 20 mm
        Largest displacement that is searched.
    largest_common : float [m], optional
        Largest common delay; by default any, modulo the period ``c / df`` of the sweep.

    Returns
    -------
    displacement : (3,) array [m]
        To be added to the receivers' positions: see `displace_receivers`.
    cable_length : float [m]
        The common delay as a path length.

    Raises
    ------
    InputError
        If the numbers of sweeps and places differ, the reflector's echo does not show, or the displacement is larger
        than `largest`.
    """
    found = fit_displacement(sweep, at=at, radius=radius, largest=largest, largest_common=largest_common)
    return found.vector, found.cable_length


class Displacement(NamedTuple):
    """The displacement of the receivers (3,) [m] and the common delay as a path length [m].

    `error` (3,) holds the standard errors of the displacement [m], caused by noise and by the receivers' own delays;
    infinite along axes that the directions do not measure. Errors in the reflector's places are not included.
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
    """Estimate the displacement with its standard errors; the arguments are those of `estimate_displacement`."""
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
    receiver_rows = matrix * (weight * (delay - common + seen @ step))[:, None]
    receiver = np.concatenate([np.flatnonzero(fit.rx_valid) for *_, fit in found])
    where = np.repeat(np.arange(len(found)), list(map(len, towards)))
    delay_errors = np.array([_common_error(wavenumber(one), fit) for one, _, fit in found])
    place_rows = matrix * (weight * delay_errors[where])[:, None]
    return Displacement(
        displacement, common, _errors(matrix, rcond, _sums(receiver, receiver_rows), _sums(where, place_rows))
    )


def _solved(delay: Array, towards: Array) -> tuple[Array, float, Array, float]:
    """Solve ``delay = common - towards . displacement`` by least squares, in which single wrong receivers do not count.

    Parameters
    ----------
    delay : (n,) array [m]
    towards : (n, 3) array
        Unit vectors from the receivers to the reflector.

    Returns
    -------
    displacement : (3,) array [m]
    common : float [m]
    weight : (n,) array
        Weights of the delays.
    rcond : float
        Singular values below this share of the largest one are left out; the displacement along them is zero.
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
    """Standard error of the delay that all pairs share [m], from the scatter of the phases of single pairs.

    A phase is estimated from the sum of the samples weighted by the taper, a delay from their sum weighted by the taper
    times ``k - mean k``. The ratio of both errors turns the scatter of phases into an error of the delay.
    """
    taper, offset = hann(k.size), k - k.mean()
    phase = np.linalg.norm(taper) / taper.sum()
    delay = np.linalg.norm(taper * offset) / (taper @ offset**2)
    pairs = np.count_nonzero(fit.tx_valid) * np.count_nonzero(fit.rx_valid)
    return float(fit.residual * fit.carrier * delay / phase / np.sqrt(pairs))


def _sums(group: Index, rows: Array) -> Array:
    """The sum of the rows (n, 3) of each group, (groups, 3)."""
    sums = np.zeros((int(group.max()) + 1, rows.shape[1]))
    np.add.at(sums, group, rows)
    return sums


def _errors(matrix: Array, rcond: float, own: Array, shared: Array) -> Array:
    """Standard errors (3,) of the least-squares solution with a matrix (n, 3).

    A receiver's own delay is the same wherever the reflector stands, so the errors of all of its rows are correlated
    (Liang and Zeger, Biometrika 73, 1986). So are the errors of all rows of one place of the reflector. `own`
    (receivers, 3) and `shared` (places, 3) are the sums of rows times errors of each receiver and each place.
    """
    _, size, components = np.linalg.svd(matrix, full_matrices=False)
    resolved = size > rcond * size[0]
    count, unknowns = np.count_nonzero(own.any(axis=1)), np.count_nonzero(resolved) + 1
    inverse = (components[resolved].T / size[resolved] ** 2) @ components[resolved]
    spread = own.T @ own * (count / max(int(count - unknowns), 1)) + shared.T @ shared
    variance = np.diag(inverse @ spread @ inverse)
    return np.where(np.sum(components[resolved] ** 2, axis=0) > MEASURED_SHARE, np.sqrt(variance), np.inf)


MEASURED_SHARE = 0.99
"""Smallest squared projection of a coordinate axis onto the measured components of the displacement, at which the error
along this axis is finite."""

NEWTON_STEPS = 4
"""Steps of Newton's method; each squares the error that is left, as a share of the distance to the reflector."""

ROBUST_ITERATIONS = 10
"""Rounds of reweighting, after which single wrong receivers no longer count."""


def displace_receivers(sweep: xr.Dataset, displacement: ArrayLike) -> xr.Dataset:
    """Add a displacement vector [m] to the positions of all receivers.

    Raises
    ------
    InputError
        If the vector is longer than the ambiguous range and the array: it was then given in a wrong unit.
    """
    sweep = checked_pairs(sweep, "sweep", several=True)
    vector = place(displacement, "displacement")
    away, limit = float(np.linalg.norm(vector)), max(ambiguous_range(sweep), extent(*positions(sweep)))
    if away > limit and sweep.attrs.get("scene_center") is None:
        raise InputError(
            f"displacement: moves the receivers by {away:.4g} m, expected at most the ambiguous range or the length of "
            f"the array, {limit:.3g} m{shorter_unit(away, limit)}"
        )
    moved = (sweep["rx_position"].dims, sweep["rx_position"].values + vector, sweep["rx_position"].attrs)
    return recorded(sweep.assign_coords(rx_position=moved), f"receivers moved by {millimetres(vector)}")
