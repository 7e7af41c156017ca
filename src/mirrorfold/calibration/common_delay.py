"""The delay that all pairs share, such as that of metres of cable, from the echo of a reflector at a known place.

The known path over the reflector is removed from every pair, so that the reflector's echo stands at the common delay in
all pairs. At this delay the samples of all pairs form a matrix (tx, rx) of rank one, ``g_i h_k``, whatever the gains
and phases of the elements are. The echo of a wall has another path length in every pair, and does not form such a
matrix. So the common delay is the one at which the largest singular value of the matrix is largest.

The coupling, which goes directly from each transmitter to each receiver, is often stronger than the reflector's echo.
Its path lengths are known too, and it has the same common delay. So both are searched together: a delay at which the
reflector and the coupling both show is preferred to one at which something stronger shows alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import maximum_filter1d, uniform_filter1d

from mirrorfold.calibration.delays import Fit, fit_delays
from mirrorfold.calibration.gate import gate_samples
from mirrorfold.calibration.record import by_blocks, check_same_axes, checked_pairs, scaled_to_single_precision
from mirrorfold.calibration.reflectors import check_reach, positions, sphere_paths
from mirrorfold.common.arguments import number
from mirrorfold.common.geometry import place
from mirrorfold.common.types import Array
from mirrorfold.common.windows import hann
from mirrorfold.errors import InputError
from mirrorfold.sweep import ambiguous_range, wavenumber

COUPLING_WEIGHT = 0.9
"""Weight w of the coupling in the score ``log(reflector) + w log(coupling)`` of a common delay, with both powers over
noise. It is below one, so that the reflector's echo is not taken for coupling where the coupling was removed. It is
close to one, because the coupling is taken for the reflector where the reflector's level over noise is below ``1 - w``
times that of the coupling: below 6 dB, where the coupling has 60 dB."""

NO_CABLE = np.log(10.0)
"""Bonus on the score for a common delay of about zero: the reflector's echo is still found there if it has a tenth of
the power of the strongest echo. The delay of cables is often removed before, and a wall may return more than a
sphere."""

COUPLING_CELLS = 2.0
"""Resolution cells by which the gate that removes a strong coupling reaches beyond the elements' own delays: half the
width of the taper's main lobe."""

POWER_ITERATIONS = 8
"""Steps of the power iteration for the largest singular value; where one echo dominates, the first few suffice."""


def _places(at: Any) -> list[Any]:
    """One place, or several places, as a list of places."""
    several = isinstance(at, list | tuple | np.ndarray) and getattr(at, "ndim", 1) > 0
    return list(at) if several and any(np.ndim(one) > 0 for one in at) else [at]


def fit_reflectors(
    sweep: xr.Dataset | Sequence[xr.Dataset],
    at: ArrayLike | Sequence[ArrayLike],
    radius: float,
    *,
    largest_error: float,
    largest_common: float | None,
) -> list[tuple[xr.Dataset, Array, Fit]]:
    """Fit the delays and gains of all elements to one or several sweeps of a sphere.

    Parameters
    ----------
    sweep : xarray.Dataset, or several
        With s(frequency, tx, rx).
    at : (2,) or (3,) [m], or several
        The middle of the sphere in each sweep.
    radius : float [m]
    largest_error : float [m]
        Largest difference between the delay of one element and that of the others.
    largest_common : float [m], optional
        Largest delay that all pairs share. If None, any delay up to the period ``c / df`` of the sweep is searched; the
        common delay is known modulo this period.

    Returns
    -------
    list of (sweep, place (3,) [m], Fit)
        One entry for each sweep. The delay that all pairs share is divided equally between both sides.

    Raises
    ------
    InputError
        If the numbers of sweeps and places differ, a largest delay is not positive, the sweeps are not of the same
        frequencies, or the reflector's echo does not show.
    """
    given: list[Any] = list(sweep) if isinstance(sweep, list | tuple) else [sweep]
    places = _places(at)
    if not given or len(given) != len(places):
        raise InputError(f"at: got {len(places)} places for {len(given)} sweeps, expected one for each")
    radius = number("radius", radius, "m", lowest=0.0)
    largest_error = number("largest_error", largest_error, "m", above=0.0)
    largest_common = None if largest_common is None else number("largest_common", largest_common, "m", above=0.0)
    sweeps = [checked_pairs(one, "sweep") for one in given]
    found: list[tuple[xr.Dataset, Array, Fit]] = []
    for n, (one, where) in enumerate(zip(sweeps, places, strict=True), 1):
        check_same_axes(sweeps[0], one, f"sweep {n}", antennas=False)
        centre = place(where, "at")
        check_reach(centre, one)
        period = 2.0 * ambiguous_range(one)
        if largest_error > period:
            raise InputError(
                f"errors of up to {largest_error:.3g} m are looked for, expected at most {period:.3g} m, the longest "
                "delay that the frequency steps tell"
            )
        common = None if largest_common is None else min(largest_common, period)
        fit = _fit(one, centre, radius, largest_error, common)
        if found:
            # Near the ends of the period, one sweep may give a delay just above zero, another just below the period.
            fit = fit.later(period * np.round((found[0][2].common - fit.common) / period))
        found.append((one, centre, fit))
    return found


def _fit(sweep: xr.Dataset, centre: Array, radius: float, largest_error: float, largest_common: float | None) -> Fit:
    """The fit to one sweep: its common delay, the coupling removed if it is stronger, then the elements' delays."""
    tx, rx = positions(sweep)
    k, s = wavenumber(sweep), scaled_to_single_precision(sweep["s"].values)
    length, direct_length = sphere_paths(tx, rx, centre, radius), np.linalg.norm(tx[:, None] - rx, axis=-1)
    common, coupled = find_common_delay(
        s, k, length, direct_length, largest_error=largest_error, largest_common=largest_common
    )
    if coupled:
        period = 2.0 * ambiguous_range(sweep)
        reach = 2.0 * largest_error + COUPLING_CELLS * period / k.size

        def without_coupling(part: NDArray[np.complexfloating], some: slice) -> NDArray[np.complexfloating]:
            turn = np.exp(1j * k[:, None, None] * (direct_length[some] + common))
            return np.asarray(part - gate_samples(part * turn, period, -reach, reach) * np.conj(turn))

        s = by_blocks(s, without_coupling, axis=1)
    return fit_delays(s, k, length + common, largest_error=largest_error).later(common)


def find_common_delay(
    s: NDArray[np.complexfloating],
    k: Array,
    length: Array,
    direct_length: Array,
    *,
    largest_error: float = 0.0,
    largest_common: float | None = None,
) -> tuple[float, bool]:
    """Find the delay that a reflector's echo has in all pairs, to a fraction of a resolution cell.

    Parameters
    ----------
    s : (frequencies, tx, rx) complex array
    k : (frequencies,) array [rad/m]
        Wavenumbers.
    length, direct_length : (tx, rx) arrays [m]
        Lengths of the path over the reflector, and of the direct path.
    largest_error, largest_common : float [m]
        See `fit_reflectors`.

    Returns
    -------
    delay : float [m]
    coupled : bool
        Whether the coupling is stronger than the reflector's echo.

    Raises
    ------
    InputError
        If there are fewer than three frequencies.
    """
    if k.size < 3:
        raise InputError(f"the sweep has {k.size} frequencies, expected three at least to measure delays")
    period = 2.0 * np.pi * (k.size - 1) / (k[-1] - k[0])
    cell = period / k.size
    # The mean of the elements' own delays may be negative, so the search begins a little below zero.
    first = -2.0 * largest_error - cell if largest_common is None else -largest_common
    last = first + period if largest_common is None else min(first + period, largest_common + cell)
    tried = np.arange(np.floor(first / cell), np.ceil(last / cell)).astype(int)
    # Averaged over three neighbours, the power hardly depends on where an echo lies between two delays.
    sharp = _power(s, k, length)
    power = uniform_filter1d(np.stack([sharp, _power(s, k, direct_length)]), 3, axis=1, mode="wrap")
    by_reflector, direct = np.log(np.maximum(power / (np.median(power) + np.finfo(float).tiny), 1.0))
    direct = maximum_filter1d(_coupling(by_reflector, direct, (direct_length - length) / cell), 3, mode="wrap")
    score = (by_reflector + COUPLING_WEIGHT * direct)[tried % k.size]
    score += np.where(np.abs(tried * cell) <= 2.0 * largest_error + cell, NO_CABLE, 0.0)
    best = tried[score.argmax()]
    neighbours = best + np.arange(-1, 2)
    weights = sharp[neighbours % k.size] + np.finfo(float).tiny
    return float(cell * np.average(neighbours, weights=weights)), bool(
        direct[best % k.size] > by_reflector[best % k.size]
    )


def _coupling(by_reflector: Array, direct: Array, earlier: Array) -> Array:
    """Strength of the coupling at every common delay; zero where the same echo adds up better over the reflector.

    Parameters
    ----------
    by_reflector, direct : (delays,) arrays
        Log of the power over noise, with the paths over the reflector and the direct paths removed.
    earlier : (tx, rx) array
        Direct path minus path over the reflector in resolution cells, below zero.
    """
    middle, half = 0.5 * (earlier.max() + earlier.min()), 0.5 * np.ptp(earlier) + COUPLING_CELLS
    around = maximum_filter1d(by_reflector, 2 * int(np.ceil(half)) + 1, mode="wrap")
    other = np.roll(around, -int(np.round(middle)))
    return np.where(direct > other, direct, 0.0)


def _power(s: NDArray[np.complexfloating], k: Array, length: Array) -> Array:
    """Power of the echoes at each common delay beyond the path `length` (tx, rx) [m], in steps of a resolution cell.

    It is the square of the largest singular value of the pairs' matrix at this delay, (frequencies,).
    """
    taper = hann(k.size)[:, None, None]

    def profile(part: NDArray[np.complexfloating], some: slice) -> NDArray[np.complexfloating]:
        return np.asarray(np.fft.ifft(taper * part * np.exp(1j * k[:, None, None] * length[some]), axis=0))

    matrix = by_blocks(s, profile, axis=1)
    vector = np.ones((len(matrix), matrix.shape[2], 1), dtype=np.complex64)
    power = np.zeros(len(matrix))
    for _ in range(POWER_ITERATIONS):
        # In double precision: the vector holds powers of samples, whose squares single precision does not hold.
        vector /= np.linalg.norm(vector.astype(complex), axis=1, keepdims=True) + np.finfo(np.float32).tiny
        other = matrix @ vector
        power = np.sum(np.abs(other[..., 0]) ** 2, axis=1).astype(float)
        vector = np.conj(np.swapaxes(np.conj(np.swapaxes(other, 1, 2)) @ matrix, 1, 2))
    return power
