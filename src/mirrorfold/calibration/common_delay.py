"""The delay that all pairs share - metres of cable - from the echo of a reflector at a known place.

The way over the reflector is taken out of every pair, so that its echo stands at the common delay in all of them. There
the samples of all pairs form a matrix (tx, rx) of rank one, ``g_i h_k``, whatever the gains and phases of the elements
are. A wall has another length in every pair, which no product of two factors follows. So the common delay is where the
largest singular value of that matrix is largest.

What goes straight from every transmitter to every receiver is often stronger than the reflector. It has the same common
delay, and its lengths are known as well. So both are asked for together: a delay at which one and the other are heard
is better than one at which something louder stands alone.
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
from mirrorfold.calibration.record import by_blocks, check_same_axes, checked_pairs, moderate
from mirrorfold.calibration.reflectors import positions, sphere_paths
from mirrorfold.common.arguments import number
from mirrorfold.common.geometry import place
from mirrorfold.common.types import Array
from mirrorfold.common.windows import hann
from mirrorfold.errors import InputError
from mirrorfold.sweep import ambiguous_range, wavenumber

COUPLING_WEIGHT = 0.9
"""What coupling counts against the reflector, in the sum of the logarithms of their powers over noise. Below one: where
coupling was taken away, the reflector alone must not pass for it. Above the share by which the reflector's logarithm
may lie below that of coupling, which in 60 dB over noise is 6 dB."""

NO_CABLE = np.log(10.0)
"""An echo where the reflector would stand without any cable may have a tenth of the loudest one's power, and is still
taken for it: cables are often taken away before, and a wall may return more than a sphere."""

COUPLING_CELLS = 2.0
"""Resolution cells, half the main lobe of the taper, by which the cut of a strong coupling reaches beyond the elements'
own delays."""

POWER_ITERATIONS = 8
"""Steps towards the largest singular value; where one echo stands out the first few find it."""


def _places(at: Any) -> list[Any]:
    """One place or several as a list."""
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
    """Delays and gains of all elements from sweeps of a sphere, one after the other.

    Parameters
    ----------
    sweep : xarray.Dataset, or several
        With s(frequency, tx, rx).
    at : (2,) or (3,) [m], or several
        The middle of the sphere, in each of the sweeps.
    radius : float [m]
    largest_error : float [m]
        Largest difference between the delay of one element and that of the others.
    largest_common : float [m], optional
        Largest delay that all pairs share; where None, anything up to the period ``c / df`` of the sweep, modulo which
        it is known.

    Returns
    -------
    list of (sweep, place (3,) [m], Fit)
        What all pairs share is halved between both sides.

    Raises
    ------
    InputError
        If the numbers of sweeps and places differ, a largest delay is not positive, the sweeps are not of the same
        frequencies, or the reflector is not heard.
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
    for one, where in zip(sweeps, places, strict=True):
        check_same_axes(sweeps[0], one, "the next sweep", antennas=False)
        centre = place(where, "at")
        fit = _fit(one, centre, radius, largest_error, largest_common)
        if found:
            # Near the ends of the period one sweep may tell a little more than none, another a little less than all.
            period = 2.0 * ambiguous_range(one)
            fit = fit.later(period * np.round((found[0][2].common - fit.common) / period))
        found.append((one, centre, fit))
    return found


def _fit(sweep: xr.Dataset, centre: Array, radius: float, largest_error: float, largest_common: float | None) -> Fit:
    """The fit to one sweep."""
    tx, rx = positions(sweep)
    k, s = wavenumber(sweep), moderate(sweep["s"].values)
    length, apart = sphere_paths(tx, rx, centre, radius), np.linalg.norm(tx[:, None] - rx, axis=-1)
    common, coupled = find_common_delay(s, k, length, apart, largest_error=largest_error, largest_common=largest_common)
    if coupled:
        period = 2.0 * ambiguous_range(sweep)
        reach = 2.0 * largest_error + COUPLING_CELLS * period / k.size

        def without_coupling(part: NDArray[np.complexfloating], some: slice) -> NDArray[np.complexfloating]:
            turn = np.exp(1j * k[:, None, None] * (apart[some] + common))
            return np.asarray(part - gate_samples(part * turn, period, -reach, reach) * np.conj(turn))

        s = by_blocks(s, without_coupling, axis=1)
    return fit_delays(s, k, length + common, largest_error=largest_error).later(common)


def find_common_delay(
    s: NDArray[np.complexfloating],
    k: Array,
    length: Array,
    apart: Array,
    *,
    largest_error: float = 0.0,
    largest_common: float | None = None,
) -> tuple[float, bool]:
    """The delay of all echoes of a reflector, to a fraction of a resolution cell.

    Parameters
    ----------
    s : (frequencies, tx, rx) complex array
    k : (frequencies,) array [rad/m]
        Wavenumbers.
    length, apart : (tx, rx) arrays [m]
        The way over the reflector, and the straight one.
    largest_error, largest_common : float [m]
        See `fit_reflectors`.

    Returns
    -------
    delay : float [m]
    coupled : bool
        Whether what goes straight from transmitters to receivers is louder than the reflector.

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
    # Summed over three neighbours the power hardly depends on where between two steps of a cell an echo lies.
    sharp = _power(s, k, length)
    power = uniform_filter1d(np.stack([sharp, _power(s, k, apart)]), 3, axis=1, mode="wrap")
    by_reflector, straight = np.log(np.maximum(power / (np.median(power) + np.finfo(float).tiny), 1.0))
    straight = maximum_filter1d(_coupling(by_reflector, straight, (apart - length) / cell), 3, mode="wrap")
    score = (by_reflector + COUPLING_WEIGHT * straight)[tried % k.size]
    score += np.where(np.abs(tried * cell) <= 2.0 * largest_error + cell, NO_CABLE, 0.0)
    best = tried[score.argmax()]
    neighbours = best + np.arange(-1, 2)
    weights = sharp[neighbours % k.size] + np.finfo(float).tiny
    return float(cell * np.average(neighbours, weights=weights)), bool(
        straight[best % k.size] > by_reflector[best % k.size]
    )


def _coupling(by_reflector: Array, straight: Array, earlier: Array) -> Array:
    """How loud coupling is at every common delay; none where the same echo adds up better by way of the reflector.

    Coupling comes `earlier` than the reflector's echo would, by a number of cells (tx, rx) below zero.
    """
    middle, half = 0.5 * (earlier.max() + earlier.min()), 0.5 * np.ptp(earlier) + COUPLING_CELLS
    around = maximum_filter1d(by_reflector, 2 * int(np.ceil(half)) + 1, mode="wrap")
    other = np.roll(around, -int(np.round(middle)))
    return np.where(straight > other, straight, 0.0)


def _power(s: NDArray[np.complexfloating], k: Array, length: Array) -> Array:
    """Power of echoes by way of a length of path (tx, rx), at delays in steps of a cell: of the part of rank one."""
    taper = hann(k.size)[:, None, None]

    def profile(part: NDArray[np.complexfloating], some: slice) -> NDArray[np.complexfloating]:
        return np.asarray(np.fft.ifft(taper * part * np.exp(1j * k[:, None, None] * length[some]), axis=0))

    matrix = by_blocks(s, profile, axis=1)
    vector = np.ones((len(matrix), matrix.shape[2], 1), dtype=np.complex64)
    power = np.zeros(len(matrix))
    for _ in range(POWER_ITERATIONS):
        vector /= np.linalg.norm(vector, axis=1, keepdims=True) + np.finfo(np.float32).tiny
        other = matrix @ vector
        power = np.sum(np.abs(other[..., 0]) ** 2, axis=1).astype(float)
        vector = np.conj(np.swapaxes(np.conj(np.swapaxes(other, 1, 2)) @ matrix, 1, 2))
    return power
