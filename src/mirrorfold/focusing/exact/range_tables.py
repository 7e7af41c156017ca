"""The range-compressed pairs of the exact kernel: one cubic polynomial for each cell of path length.

For a pair (i, k) the sum over frequency is a function of one variable, the path length d = R_i + R_k::

    sum_m a[m] S[m,i,k] exp(+j k_m d) = exp(+j k_c d) Q_ik(d),

with Q_ik band-limited (k_c is the middle wavenumber). The ambiguous path length, after which Q_ik repeats, is divided
into N cells, and Q_ik is tabulated as a cubic polynomial in each cell. With u from -1 to 1 over the cell, and w the
phase through which a frequency turns in one cell, the coefficients follow from the Jacobi-Anger expansion (Abramowitz
and Stegun 9.1.44-45) ``exp(j w u / 2) = sum_q eps_q j^q J_q(w/2) T_q(u)``, truncated after q = 3 and summed over
frequency by FFT. The truncation error is known in closed form (`interpolation_error`), so N follows from the tolerance.
"""

from __future__ import annotations

from math import pi

import numpy as np
import scipy.fft
from numpy.typing import NDArray
from scipy.special import jv

from mirrorfold.common.kernels import njit
from mirrorfold.focusing.settings import FINEST_TOLERANCE

TERMS = 4
"""Coefficients of the polynomial in each cell: a cubic."""

OVERSAMPLING = (2, 4, 8, 16)
"""Choices of the number of table cells per frequency; the finest reaches the rounding error of single precision."""


def interpolation_error(taper: NDArray[np.complex128], cells: int) -> float:
    """Relative root-mean-square error of the tabulated profiles on white data.

    Parameters
    ----------
    taper : (frequencies,) array
    cells : int
        Table cells per ambiguous path length.

    Returns
    -------
    float
        ``sqrt(sum |a e|^2 / sum |a|^2)`` with ``e_m^2 = sum_{q>3} 2 J_q(w_m/2)^2``, the part of
        ``exp(j w_m u / 2)`` that the cubic leaves out.
    """
    w = 2.0 * pi * (np.arange(taper.size) - taper.size // 2) / cells
    missing = sum(2.0 * jv(q, w / 2.0) ** 2 for q in range(TERMS, TERMS + 6))
    power = np.abs(taper) ** 2
    return float(np.sqrt(np.sum(power * missing) / np.sum(power)))


def table_cells(taper: NDArray[np.complex128], tolerance: float) -> int:
    """Number of cells per ambiguous path length that keeps the interpolation error under half the tolerance.

    A tolerance below `FINEST_TOLERANCE`, which single precision cannot reach, counts as `FINEST_TOLERANCE`.
    """
    wanted = 0.5 * max(tolerance, FINEST_TOLERANCE)
    for oversampling in OVERSAMPLING:
        cells = scipy.fft.next_fast_len(oversampling * taper.size)
        if interpolation_error(taper, cells) <= wanted:
            break
    return int(cells)


def spectral_weights(taper: NDArray[np.complex128], cells: int) -> NDArray[np.complex64]:
    """Factors (TERMS, frequencies) from the samples to the spectra of the cubic's coefficients of 1, u, u^2 and u^3."""
    w = 2.0 * pi * (np.arange(taper.size) - taper.size // 2) / cells
    t = [(1.0 if q == 0 else 2.0) * 1j**q * jv(q, w / 2.0) for q in range(TERMS)]
    monomial = np.stack([t[0] - t[2], t[1] - 3.0 * t[3], 2.0 * t[2], 4.0 * t[3]])
    return (monomial * (taper * np.exp(0.5j * w))).astype(np.complex64)


@njit(nogil=True, error_model="numpy")
def unfold_spectrum(data, weight, spectrum):  # type: ignore[no-untyped-def]
    """spectrum[k, q, (m - M//2) mod N] = weight[q, m] data[m, k]."""
    frequencies, elements = data.shape
    terms, cells = spectrum.shape[1], spectrum.shape[2]
    middle = frequencies // 2
    spectrum[:] = 0.0
    for k in range(elements):
        for q in range(terms):
            for m in range(frequencies):
                spectrum[k, q, (m - middle) % cells] = weight[q, m] * data[m, k]


@njit(nogil=True, error_model="numpy")
def interleave_coefficients(profile, table):  # type: ignore[no-untyped-def]
    """table[k, n, q] = profile[k, q, n mod N]: the coefficients of a cell side by side; the first cells repeat."""
    elements, terms, cells = profile.shape
    for k in range(elements):
        for n in range(table.shape[1]):
            for q in range(terms):
                table[k, n, q] = profile[k, q, n % cells]
