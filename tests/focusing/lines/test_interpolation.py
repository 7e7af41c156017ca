"""Interpolation kernels against the spectra that they are fitted to."""

from __future__ import annotations

import numpy as np

from mirrorfold.focusing.lines.interpolation import triangular_kernel


def test_kernels_hold_the_error_they_state():
    kernel = triangular_kernel(6, 2.0, True)
    omega, t = 0.9, 0.37
    taps = np.arange(6) + kernel.first
    powers = (2 * t - 1) ** np.arange(kernel.coefficients.shape[1])
    weights = kernel.coefficients.astype(float) @ powers
    value = np.interp(omega, kernel.omega, kernel.factor) * np.sum(weights * np.exp(1j * omega * taps))
    assert abs(value - np.exp(1j * omega * t)) < 1e-4
