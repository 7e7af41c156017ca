"""The Hankel function ``H0^(2)(k r)``, the wave of a line source, fast enough to fill large matrices.

With x = k r and slowly varying amplitude and phase (Watson, "Theory of Bessel Functions", section 13.75),

``H0^(2)(x) = sqrt(2 / (pi x)) a(1/x^2) exp(-j (x - pi/4 + p(1/x^2) / x))``.

a and p are approximated by polynomials in single precision; the phase is reduced to one turn in double precision. Below
x = `NEAR` the power series is used. The relative error is below 1e-6 everywhere.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.polynomial import Chebyshev, Polynomial
from numpy.typing import NDArray
from scipy.special import j0, y0

from mirrorfold.common.kernels import njit
from mirrorfold.common.types import Array

Complex = NDArray[np.complex64]

NEAR = 2.0
"""Argument x below which the power series is used: only distances below a third of a wavelength."""

SERIES_TERMS = 11
"""Number of terms of the power series; the first neglected term is below 1e-14 at `NEAR`."""

ROUNDER = 1.5 * 2.0**52
"""Adding and subtracting this rounds a float64 to the nearest whole number."""


Coefficients = tuple[np.float32, ...]


def _fit(function: Callable[[Array], Array], stop: float, degree: int) -> Coefficients:
    """Coefficients of a polynomial that approximates a function on [0, stop], with nearly the least maximum error."""
    nodes = stop * (0.5 + 0.5 * np.cos(np.pi * (np.arange(200) + 0.5) / 200))
    fit = Chebyshev.fit(nodes, function(nodes), degree, domain=[0.0, stop])
    return tuple(np.float32(c) for c in fit.convert(kind=Polynomial).coef)


def _rotated(x: Array) -> NDArray[np.complex128]:
    """``H0^(2)(x) exp(j (x - pi/4))``, of which modulus and phase vary slowly."""
    return np.asarray((j0(x) - 1j * y0(x)) * np.exp(1j * (x - 0.25 * np.pi)))


def _amplitude(u: Array) -> Array:
    """The function that the polynomial a approximates, of the variable ``u = (NEAR / x)^2``."""
    x = NEAR / np.sqrt(u)
    return np.asarray(np.abs(_rotated(x)) * np.sqrt(0.5 * np.pi * x))


def _turns(u: Array) -> Array:
    """The function that the polynomial p approximates, in turns, of the same variable."""
    x = NEAR / np.sqrt(u)
    return np.asarray(-np.angle(_rotated(x)) * x / (2.0 * np.pi))


A, P = _fit(_amplitude, 1.0, 6), _fit(_turns, 1.0, 6)
S = _fit(lambda q: np.sin(np.pi * np.sqrt(q)) / np.sqrt(q), 0.25, 5)
C = _fit(lambda q: np.cos(np.pi * np.sqrt(q)), 0.25, 5)
PREFACTOR = np.float32(math.sqrt(2.0 / math.pi))
NEAR_SQUARED = np.float32(NEAR**2)
ONE, TWO = np.float32(1.0), np.float32(2.0)
TURNS_PER_RADIAN = 1.0 / (2.0 * math.pi)


@njit(error_model="numpy", nogil=True, fastmath={"contract"})
def _far(x: float) -> complex:
    """H0^(2)(x) by amplitude and phase, for x of at least `NEAR`."""
    z = ONE / np.float32(x)
    u = NEAR_SQUARED * z * z
    amplitude = A[0] + u * (A[1] + u * (A[2] + u * (A[3] + u * (A[4] + u * (A[5] + u * A[6])))))
    shift = z * (P[0] + u * (P[1] + u * (P[2] + u * (P[3] + u * (P[4] + u * (P[5] + u * P[6]))))))
    turns = x * TURNS_PER_RADIAN + (np.float64(shift) - 0.125)
    f = np.float32(turns - ((turns + ROUNDER) - ROUNDER))
    # Sine and cosine of the angle from those of half the angle, which needs no distinction of cases.
    q = f * f
    sine = f * (S[0] + q * (S[1] + q * (S[2] + q * (S[3] + q * (S[4] + q * S[5])))))
    cosine = C[0] + q * (C[1] + q * (C[2] + q * (C[3] + q * (C[4] + q * C[5]))))
    amplitude *= PREFACTOR * np.sqrt(z)
    return complex(amplitude * (cosine - sine) * (cosine + sine), -TWO * amplitude * sine * cosine)


@njit(error_model="numpy", nogil=True)
def _near(x: float) -> complex:
    """H0^(2)(x) by power series, for x below `NEAR`; infinite at zero."""
    square = -0.25 * x * x
    term, bessel, harmonic, rest = 1.0, 1.0, 0.0, 0.0
    for m in range(1, SERIES_TERMS):
        term *= square / (m * m)
        harmonic += 1.0 / m
        bessel += term
        rest -= harmonic * term
    neumann = (np.log(0.5 * x) + np.euler_gamma) * bessel + rest
    return complex(bessel, -2.0 / math.pi * neumann)


@njit(error_model="numpy", nogil=True, fastmath={"contract"})
def _fill(tx: Array, ty: Array, sx: Array, sy: Array, k: float, out: Complex) -> None:
    """out[i, j] = H0^(2)(k |t_i - s_j|)."""
    for i in range(tx.size):
        x0, y0 = tx[i], ty[i]
        close = 0
        for j in range(sx.size):
            dx, dy = sx[j] - x0, sy[j] - y0
            x = k * np.sqrt(dx * dx + dy * dy)
            close += x < NEAR
            out[i, j] = _far(x)
        if close > 0:
            for j in range(sx.size):
                dx, dy = sx[j] - x0, sy[j] - y0
                x = k * np.sqrt(dx * dx + dy * dy)
                if x < NEAR:
                    out[i, j] = _near(x)


def hankel(targets: Array, sources: Array, k: float) -> Complex:
    """``H0^(2)(k r)`` between points.

    Parameters
    ----------
    targets, sources : (n, 2) and (m, 2) arrays [m]
    k : float [rad/m]
        Wavenumber.

    Returns
    -------
    (n, m) complex64 array, relative error below 1e-6; infinite where two points coincide.

    Examples
    --------
    >>> round(complex(hankel(np.zeros((1, 2)), np.array([[3.0, 4.0]]), 2.0)[0, 0]).imag, 4)  # -Y0(10)
    -0.0557
    """
    out = np.empty((len(targets), len(sources)), dtype=np.complex64)
    (tx, ty), (sx, sy) = (np.ascontiguousarray(np.asarray(p, dtype=float).T) for p in (targets, sources))
    _fill(tx, ty, sx, sy, float(k), out)
    return out
