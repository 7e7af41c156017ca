"""Fields of monopoles and dipoles in a medium that may absorb: ``H0^(2)``, ``H1^(2)`` and the matrix blocks of them.

Every unknown of the integral equations is a source ``m' + N' . grad' / k0`` of the wave ``H0^(2)(k r)``. The field is
tested by the same operator, with m and N, at the place of each unknown. A monopole has m = 1 and N = 0, a dipole m = 0
and N the unit normal. Primed quantities are those of the source, x is the place of the test. With ``e = (x - x') / r``,
``A = e . N``, ``B = e . N'``, ``C = N . N'`` and ``q = k / k0``, the block is

``K = H0 (m m' + q^2 A B) + H1 (q (m B - A m') + q^2 (C - 2 A B) / (k r))``,

which is symmetric under the exchange of source and test. For large arguments (Watson, "Theory of Bessel Functions",
section 13.75) ``H(x) = f(1 / x) exp(-j x) / sqrt(x)`` with slowly varying f. In one medium the argument x = k r lies on
a ray from the origin of the complex plane. There f is approximated by a polynomial in ``NEAR / |x|``, fitted for each
medium.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.polynomial import Chebyshev, Polynomial
from numpy.typing import NDArray
from scipy.special import hankel2e

from mirrorfold.common.kernels import njit
from mirrorfold.common.types import Array
from mirrorfold.simulation.fullwave.kernel import NEAR, ONE, ROUNDER, TURNS_PER_RADIAN, TWO, C, S

Complex = NDArray[np.complex64]
Indices = NDArray[np.int64]
Single = NDArray[np.float32]

DEGREE = 10
"""Degree of the polynomials that approximate f."""

SERIES_TERMS = 12
"""Number of terms of the power series below `NEAR`; the first neglected term is below 1e-16."""

DEEPEST = 24.0
"""Largest absorption that is computed [Np]: a wave absorbed further keeps the relative amplitude 4e-11."""

HALVED = np.float32(0.5**6)
"""Factor on the exponent of the decay: it is halved six times, and the power series of the result squared six times."""

E2, E3, E4, E5 = (np.float32(1.0 / math.factorial(n)) for n in range(2, 6))
NEAR_SINGLE = np.float32(NEAR)


@dataclass(frozen=True, eq=False)
class Medium:
    """A medium at one frequency.

    Attributes
    ----------
    k : complex [rad/m]
        Wavenumber; its imaginary part is negative or zero.
    ratio : complex
        Wavenumber over that of free space.
    coefficients : (4, DEGREE + 1) float32 array
        Coefficients of the real and the imaginary part of f, for H0 and for H1.
    """

    k: complex
    ratio: complex
    coefficients: NDArray[np.float32]


@lru_cache(maxsize=64)
def medium(k0: float, permittivity: complex = 1.0) -> Medium:
    """The medium of relative permittivity ``eps' - j eps''`` where the wavenumber of free space is k0 [rad/m]."""
    ratio = complex(np.sqrt(complex(permittivity)))
    if ratio.imag > 0.0:
        ratio = -ratio
    direction = ratio / abs(ratio)
    s = 0.5 + 0.5 * np.cos(np.pi * (np.arange(200) + 0.5) / 200)
    x = NEAR / s * direction
    rows = []
    for order in (0, 1):
        f = hankel2e(order, x) * np.sqrt(NEAR / s)
        fit = Chebyshev.fit(s, f, DEGREE, domain=[0.0, 1.0]).convert(kind=Polynomial).coef
        rows += [fit.real, fit.imag]
    return Medium(ratio * k0, ratio, np.array(rows, dtype=np.float32))


@njit(error_model="numpy", nogil=True)
def bessel(x: complex) -> tuple[complex, complex]:
    """J0(x) and ``J1(x) / x`` by power series, for ``|x|`` below `NEAR`."""
    square = -0.25 * x * x
    term, zeroth, first = 1.0 + 0.0j, 1.0 + 0.0j, 0.5 + 0.0j
    for m in range(1, SERIES_TERMS):
        term *= square / (m * m)
        zeroth += term
        first += 0.5 * term / (m + 1)
    return zeroth, first


@njit(error_model="numpy", nogil=True)
def _near(x: complex) -> tuple[complex, complex]:
    """H0^(2)(x) and H1^(2)(x) by power series, for ``|x|`` below `NEAR`; infinite at zero."""
    square = -0.25 * x * x
    logarithm = np.log(0.5 * x) + np.euler_gamma
    term, harmonic = 1.0 + 0.0j, 0.0
    j0, y0 = 1.0 + 0.0j, 0.0j
    j1, y1 = 1.0 + 0.0j, 1.0 + 0.0j
    for m in range(1, SERIES_TERMS):
        term *= square / (m * m)
        harmonic += 1.0 / m
        j0 += term
        y0 -= harmonic * term
        j1 += term / (m + 1)
        y1 += (2.0 * harmonic + 1.0 / (m + 1)) * term / (m + 1)
    y0 = 2.0 / math.pi * (logarithm * j0 + y0)
    j1 *= 0.5 * x
    y1 = 2.0 / math.pi * (logarithm * j1 - 1.0 / x - 0.25 * x * y1)
    return j0 - 1j * y0, j1 - 1j * y1


@njit(error_model="numpy", nogil=True, fastmath={"contract"})
def add_waves(
    rows: Indices,
    tx: Array,
    ty: Array,
    tm: Single,
    tnx: Single,
    tny: Single,
    sx: Array,
    sy: Array,
    sm: Single,
    snx: Single,
    sny: Single,
    k: complex,
    ratio: complex,
    strength: complex,
    f: Single,
    sign: float,
    out: Complex,
) -> None:
    """Add the block K: ``out[i, j] += sign K(t_i, s_j)`` for i in `rows`, with monopoles of the given strength.

    Tests and sources have coordinates x, y [m] (`tx`, `ty`; `sx`, `sy`), monopole moments (`tm`; `sm`), and dipole
    moments along x and y (`tnx`, `tny`; `snx`, `sny`). `f` holds the coefficients of the `Medium`.
    """
    magnitude, forward, nepers = abs(k), k.real * TURNS_PER_RADIAN, -k.imag
    q = ratio
    # Complex factors of the four products s1 to s4 below: s1 and s2 multiply H0, s3 and s4 multiply H1.
    mono, both, mixed, dipole = strength * strength, q * q, q * strength, q * q * magnitude / k
    mono_r, mono_i = np.float32(mono.real), np.float32(mono.imag)
    both_r, both_i = np.float32(both.real), np.float32(both.imag)
    mixed_r, mixed_i = np.float32(mixed.real), np.float32(mixed.imag)
    dipole_r, dipole_i = np.float32(dipole.real), np.float32(dipole.imag)
    nearest = NEAR / magnitude
    factor = np.float32(sign)
    for i in rows:
        x0, y0, m0, nx0, ny0 = tx[i], ty[i], tm[i], tnx[i], tny[i]
        close = 0
        for j in range(sx.size):
            dx, dy = x0 - sx[j], y0 - sy[j]
            r = np.sqrt(dx * dx + dy * dy)
            near = r < nearest
            close += near
            r = max(r, nearest)  # closer pairs are added below, by the power series
            z = ONE / np.float32(magnitude * r)
            u = NEAR_SINGLE * z
            h0r, h0i, h1r, h1i = f[0, DEGREE], f[1, DEGREE], f[2, DEGREE], f[3, DEGREE]
            for n in range(DEGREE - 1, -1, -1):
                h0r = f[0, n] + u * h0r
                h0i = f[1, n] + u * h0i
                h1r = f[2, n] + u * h1r
                h1i = f[3, n] + u * h1i
            turns = forward * r
            half = np.float32(turns - ((turns + ROUNDER) - ROUNDER))
            p = half * half
            sine = half * (S[0] + p * (S[1] + p * (S[2] + p * (S[3] + p * (S[4] + p * S[5])))))
            cosine = C[0] + p * (C[1] + p * (C[2] + p * (C[3] + p * (C[4] + p * C[5]))))
            y = -np.float32(min(nepers * r, DEEPEST)) * HALVED
            decay = ONE + y * (ONE + y * (E2 + y * (E3 + y * (E4 + y * E5))))
            decay *= decay
            decay *= decay
            decay *= decay
            decay *= decay
            decay *= decay
            decay *= decay
            level = factor * np.sqrt(z) * decay * np.float32(1 - near)
            wave_r, wave_i = level * (cosine - sine) * (cosine + sine), -TWO * level * sine * cosine
            inverse = ONE / np.float32(r)
            ex, ey = np.float32(dx) * inverse, np.float32(dy) * inverse
            at_test, at_source = ex * nx0 + ey * ny0, ex * snx[j] + ey * sny[j]
            s1, s2 = m0 * sm[j], at_test * at_source
            s3, s4 = m0 * at_source - at_test * sm[j], z * (nx0 * snx[j] + ny0 * sny[j] - TWO * s2)
            w0r, w0i = mono_r * s1 + both_r * s2, mono_i * s1 + both_i * s2
            w1r, w1i = mixed_r * s3 + dipole_r * s4, mixed_i * s3 + dipole_i * s4
            value_r = h0r * w0r - h0i * w0i + h1r * w1r - h1i * w1i
            value_i = h0r * w0i + h0i * w0r + h1r * w1i + h1i * w1r
            out[i, j] += complex(wave_r * value_r - wave_i * value_i, wave_r * value_i + wave_i * value_r)
        if close > 0:
            for j in range(sx.size):
                dx, dy = x0 - sx[j], y0 - sy[j]
                r = np.sqrt(dx * dx + dy * dy)
                if 0.0 < r < nearest:
                    h0, h1 = _near(k * r)
                    a, b = (dx * nx0 + dy * ny0) / r, (dx * snx[j] + dy * sny[j]) / r
                    c = nx0 * snx[j] + ny0 * sny[j]
                    zeroth = h0 * (mono * m0 * sm[j] + both * a * b)
                    first = h1 * (mixed * (m0 * b - a * sm[j]) + both * (c - 2.0 * a * b) / (k * r))
                    out[i, j] += sign * (zeroth + first)
