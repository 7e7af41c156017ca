"""Rows that were measured to and fro and are displaced from each other by the backlash of the stage.

A stage that measures on its way back, too, stands a fraction of a step beside the places that it reaches on its way
out. Two successive rows see nearly the same echoes, so that the products of their spatial spectra, over the wavenumber
K along the rows and summed over all frequencies,

    C_i(K) = sum S_i(K) conj(S_{i+1}(K)),

have a phase that depends on the scene, but is the same for even and for odd i. A displacement d of every other row adds
``-K d`` to the one and ``+K d`` to the other. So the slope of the phase of ``sum_even C_i conj(sum_odd C_i)`` over K is
``-2 d``, whatever the scene is. A phase of their own of every other row, as by a switch, has no slope.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.fft import fft

from mirrorfold.common.statistics import in_equal_steps
from mirrorfold.common.windows import hann
from mirrorfold.diagnosis.findings import PLACES, Finding
from mirrorfold.sweep import antenna_positions, is_raster

FEWEST_ROWS, FEWEST_PLACES = 11, 16
"""Smallest number of rows, and of places in a row, for a judgement."""

LARGEST, TRIED = 0.6, 241
"""Largest displacement that is tried, in steps along the row, and number of those that are tried to both sides."""

LEAST = 0.1
"""Smallest displacement that is named, in steps along the row."""

BLOCKS = 5
"""Number of parts of the rows, each of which must show the same displacement."""

AGREED = 0.25
"""Largest deviation of the displacement of a part from the median, as a share of it."""

IN_PHASE = 0.5
"""Smallest share of the products that is in phase after the displacement was taken off."""

ENOUGH_FREQUENCIES = 50
"""Number of frequencies that are looked at, where there are more."""

SURE = 0.95
"""Certainty of a finding."""


class Rows(NamedTuple):
    """Samples (frequencies, rows, places), the step of the places along a row, in `unit`, and what stands there."""

    s: NDArray[np.complexfloating]
    step: float
    unit: str
    name: str


def backlash_findings(sweep: xr.Dataset) -> list[Finding]:
    """The finding that every other row of a valid sweep, without further dimensions, is displaced along the row."""
    for rows in _rows(sweep):
        shift = _displacement(rows.s)
        if shift is not None:
            size = abs(shift) * rows.step
            length = f"{1e3 * size:.2g} mm" if rows.unit == "m" else f"{size:.2g} degrees"
            what = (
                f"Every other row of {rows.name} is displaced along the row by {length}, {abs(shift):.2g} steps: the "
                "stage measured on its way back, too, and has backlash."
            )
            remedy = "measure all rows in one direction, or give the rows of the way back their true places"
            return [Finding("stage-backlash", what, SURE, remedy, by_command=False)]
    return []


def _rows(sweep: xr.Dataset) -> list[Rows]:
    """The rows of a sweep along each of its two axes; none where places are not in equal steps."""
    s = sweep["s"].values
    s = s[:: max(1, len(s) // ENOUGH_FREQUENCIES)]
    names, unit = [PLACES[str(name)] for name in sweep["s"].dims[1:]], "m"
    found = []
    if is_raster(sweep):
        axes, unit = [sweep[name].values[:, None] for name in ("azimuth", "elevation")], "degree"
    elif s.ndim == 3:
        axes = list(antenna_positions(sweep))
    else:
        grid = _grid(antenna_positions(sweep)[0])
        if grid is None:
            return []
        order, axes = grid
        s, names = s[:, order], 2 * names
    for places, name, turned in zip(axes, names, (s.swapaxes(1, 2), s), strict=True):
        along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(places, axis=0), axis=1))])
        if turned.shape[1] >= FEWEST_ROWS and along.size >= FEWEST_PLACES and in_equal_steps(along):
            found.append(Rows(turned, float(along[1]), unit, name))
    return found


def _grid(places: NDArray[np.float64]) -> tuple[NDArray[np.int64], list[NDArray[np.float64]]] | None:
    """The order (rows, columns) of places (n, 3) on a grid along two axes, and the places along both; None for others.

    Places are told apart to a millionth of the extent.
    """
    extent = np.ptp(places, axis=0)
    one, other = np.argsort(extent)[:0:-1]
    if not extent[other] > 0.0:
        return None
    digits = np.rint(places[:, [one, other]] / (1e-6 * extent[one])).astype(np.int64)
    (first, i), (second, k) = (np.unique(column, return_inverse=True) for column in digits.T)
    if first.size * second.size != len(places) or len(np.unique(i * second.size + k)) != len(places):
        return None
    order = np.empty((first.size, second.size), dtype=np.int64)
    order[i, k] = np.arange(len(places))
    return order, [places[order[:, 0]], places[order[0]]]


def _displacement(s: NDArray[np.complexfloating]) -> float | None:
    """By how many steps every other row of samples (frequencies, rows, places) is displaced; None where by none."""
    s = s - s.mean(axis=(1, 2), keepdims=True)  # what is the same everywhere comes from the instrument
    spectrum = fft(s * hann(s.shape[2]).astype(s.real.dtype), axis=2)
    product = np.einsum("frk,frk->rk", spectrum[:, :-1], spectrum[:, 1:].conj())
    product = product[: len(product) // (2 * BLOCKS) * 2 * BLOCKS]
    halves = product.reshape(BLOCKS, -1, 2, product.shape[1]).sum(axis=1)
    turn = halves[:, 0] * halves[:, 1].conj()
    strength = np.abs(turn)
    turn = np.divide(turn, np.sqrt(strength), out=np.zeros_like(turn), where=strength > 0.0)
    tried = np.linspace(-LARGEST, LARGEST, TRIED)
    wavenumber = 2.0 * np.pi * np.fft.fftfreq(s.shape[2])
    aligned = np.abs(turn @ np.exp(2j * np.outer(wavenumber, tried)))
    each = tried[np.argmax(aligned, axis=1)]
    shift = float(np.median(each))
    if abs(shift) < LEAST or abs(shift) >= tried[-2] or np.abs(each - shift).max() > AGREED * abs(shift):
        return None
    share = aligned.max(axis=1) / np.maximum(np.abs(turn).sum(axis=1), np.finfo(float).tiny)
    return shift if np.median(share) > IN_PHASE else None
