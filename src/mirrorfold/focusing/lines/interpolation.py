"""Short interpolation kernels, fitted by least squares to the spectrum of the signals that they interpolate.

A signal known at the integers, with a spectrum inside a band, is interpolated as ``f(n + t) = sum_a w_a(t) f(n + a)``.
The weights minimise the mean square error over the band, weighted with the power expected at each frequency (Fraser
1989 for a flat spectrum). Where the spectrum can be changed beforehand, it may be multiplied by a factor p(omega), a
prefilter. Kernel and factor are then fitted in turns, and become as accurate as the usual prefiltered kernels of
non-uniform FFTs.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from mirrorfold.common.kernels import njit

FRACTIONS = 33
"""Number of fractional positions t at which the weights are fitted, before a polynomial in t is fitted to them."""

ALTERNATIONS = 12
"""Number of times that kernel and factor are fitted in turns."""

POLYNOMIAL_TERMS = 10
"""Number of terms of this polynomial."""

BAND_SAMPLES = 201
"""Number of frequencies of the band at which kernels are fitted."""

FACTOR_DEGREE = 24
"""Degree of the polynomial that interpolates the factor between the frequencies of the fit."""

SEMICIRCLE_SHARE = 0.98
"""Exponent of the semicircle kernel, over the exponent at which its spectrum ends just before the alias band."""

RIDGE = 1e-15
"""Number added to the diagonal of the normal equations, times their trace, so that they can always be solved."""

POWER_FLOOR = 1e-4
"""Share of the mean power that is added at every frequency of the band, so that none is ignored."""


@dataclass(frozen=True, eq=False)
class Kernel:
    """An interpolation kernel of `width` taps.

    Attributes
    ----------
    coefficients : (width, terms) float32 array
        Weight of tap a at fraction t in [0, 1): ``sum_n coefficients[a, n] (2 t - 1)^n``.
    omega, factor : arrays
        The prefilter: `factor`, by which the spectrum must be multiplied, at the frequencies `omega` [rad/sample].
    error : float
        Root-mean-square error relative to the signal, for the assumed power spectrum.
    """

    coefficients: NDArray[np.float32]
    omega: NDArray[np.float64]
    factor: NDArray[np.float64]
    error: float

    def factor_at(self, omega: NDArray[np.float64]) -> NDArray[np.float64]:
        """The factor at any frequencies of the band [rad/sample], by a polynomial fitted to its smooth samples."""
        edge = float(np.abs(self.omega).max())
        series = np.polynomial.chebyshev.chebfit(self.omega / edge, self.factor, FACTOR_DEGREE)
        return np.asarray(np.polynomial.chebyshev.chebval(omega / edge, series))

    @property
    def width(self) -> int:
        """Number of taps."""
        return len(self.coefficients)

    @property
    def first(self) -> int:
        """Offset of the first tap from the integer below the position."""
        return 1 - self.width // 2


def _semicircle_factor(width: int, omega: NDArray[np.float64]) -> NDArray[np.float64]:
    """First guess of the factor: the inverse spectrum of exp(beta (sqrt(1 - t^2) - 1)) (Barnett et al. 2019)."""
    slope = width * (1.0 - np.abs(omega).max() / (2.0 * np.pi)) * np.pi * SEMICIRCLE_SHARE
    t, w = np.polynomial.legendre.leggauss(64)
    kernel = w * np.exp(slope * (np.sqrt(1.0 - t**2) - 1.0))
    spectrum = np.cos(np.outer(omega, 0.5 * width * t)) @ kernel
    return np.asarray(spectrum[np.argmin(np.abs(omega))] / spectrum)


def fit_kernel(
    width: int, omega: NDArray[np.float64], power: NDArray[np.float64], *, prefiltered: bool = False
) -> Kernel:
    """The kernel of even `width` with the least mean square error for a spectrum `power` at `omega` [rad/sample]."""
    taps = np.arange(width) + 1 - width // 2
    fraction = 0.5 + 0.5 * np.cos(np.pi * (np.arange(FRACTIONS) + 0.5) / FRACTIONS)
    weight = power / power.mean() + POWER_FLOOR
    weight = weight / weight.sum()
    phases = np.exp(1j * np.outer(omega, taps))
    target = np.exp(1j * np.outer(omega, fraction))
    factor = _semicircle_factor(width, omega) if prefiltered else np.ones(omega.size)
    solution = np.zeros((width, FRACTIONS))
    for turn in range(ALTERNATIONS if prefiltered else 1):
        if turn:
            interpolated = phases @ solution
            factor = np.sum((interpolated.conj() * target).real, axis=1) / np.sum(np.abs(interpolated) ** 2, axis=1)
        # Normal equations of a few taps: small enough to be solved directly, ridged against rounding.
        left = phases * (weight * factor**2)[:, None]
        normal = (phases.conj().T @ left).real
        normal[np.diag_indices(width)] += RIDGE * np.trace(normal)
        solution = np.linalg.solve(normal, (phases.conj().T @ (target * (weight * factor)[:, None])).real)
    error = np.sqrt(np.mean(np.sum(weight[:, None] * np.abs(factor[:, None] * (phases @ solution) - target) ** 2, 0)))
    powers = np.vander(2.0 * fraction - 1.0, POLYNOMIAL_TERMS, increasing=True)
    coefficients = np.linalg.solve(powers.T @ powers, powers.T @ solution.T).T
    return Kernel(np.ascontiguousarray(coefficients, dtype=np.float32), omega, factor, float(error))


@lru_cache(maxsize=64)
def triangular_kernel(width: int, oversampling: float, prefiltered: bool) -> Kernel:
    """Kernel for the spectrum of an array: the number of pairs with the same midpoint falls linearly to both ends."""
    shape = np.linspace(-1.0, 1.0, BAND_SAMPLES)
    return fit_kernel(width, shape * np.pi / oversampling, 1.0 - np.abs(shape), prefiltered=prefiltered)


def taper_kernel(width: int, oversampling: float, taper: NDArray[np.complex128]) -> Kernel:
    """Kernel for a spectrum with the power of a taper over frequency."""
    shape = np.linspace(-1.0, 1.0, BAND_SAMPLES)
    power = np.interp(shape, np.linspace(-1.0, 1.0, taper.size), np.abs(taper) ** 2)
    return fit_kernel(width, shape * np.pi / oversampling, power)


@njit(nogil=True, error_model="numpy", fastmath=True)
def kernel_weights(coefficients, fraction, weights):  # type: ignore[no-untyped-def]
    """weights[a, p] = sum_n coefficients[a, n] (2 fraction[p] - 1)^n by Horner's rule."""
    width, terms = coefficients.shape
    size = fraction.size
    for a in range(width):
        for p in range(size):
            weights[a, p] = coefficients[a, terms - 1]
        for n in range(terms - 2, -1, -1):
            c = coefficients[a, n]
            for p in range(size):
                weights[a, p] = weights[a, p] * (np.float32(2.0) * fraction[p] - np.float32(1.0)) + c


def weights_at(kernel: Kernel, position: NDArray[np.float64]) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
    """Index of the first tap, and weights (..., width) of all taps, of a kernel at fractional positions."""
    below = np.floor(position)
    weights = np.empty((kernel.width, position.size), dtype=np.float32)
    kernel_weights(kernel.coefficients, (position - below).astype(np.float32).ravel(), weights)
    return below.astype(np.int64) + kernel.first, np.ascontiguousarray(weights.T).reshape(*position.shape, -1)
