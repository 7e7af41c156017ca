"""Windows of range against the whole sweep, echo by echo."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.constants import speed_of_light

from mirrorfold.focusing.echoes.range_windows import RangeWindows

FREQUENCIES = 401
K = 2.0 * np.pi * np.linspace(290e9, 300e9, FREQUENCIES) / speed_of_light
TAPER = np.sin(np.pi * np.arange(1, FREQUENCIES + 1) / (FREQUENCIES + 1)) ** 2
PERIOD = 2.0 * np.pi / (K[1] - K[0])
"""Of unambiguous path lengths [m]."""


def samples_of(paths, amplitudes):
    """Samples of one pair that hears echoes by way of those paths [m]."""
    return (np.exp(-1j * np.outer(K, paths)) @ amplitudes).astype(np.complex64)[:, None]


def focused(k, samples, taper, paths):
    """``sum over k of taper(k) samples(k) exp(j k d)`` for paths d, relative to an echo of amplitude one."""
    return np.exp(1j * np.outer(paths, k)) @ (taper * samples[:, 0].astype(np.complex128)) / TAPER.sum()


@pytest.mark.parametrize("middle", [2.5, 0.05, PERIOD - 0.1, PERIOD + 1.0])
def test_what_a_window_holds_is_focused_as_from_the_whole_sweep(middle):
    rng = np.random.default_rng(0)
    paths = middle + rng.uniform(-0.2, 0.2, 12)
    amplitudes = rng.standard_normal(12) + 1j * rng.standard_normal(12)
    samples = samples_of(paths, amplitudes)
    windows = RangeWindows(K, samples, TAPER)
    windows.transform()
    window = windows.window(middle - 0.2, middle + 0.2)
    assert window.k.size == windows.frequencies(middle - 0.2, middle + 0.2) < 0.2 * FREQUENCIES
    at = np.linspace(middle - 0.2, middle + 0.2, 400)
    exact = focused(K, samples, TAPER, at)
    assert_allclose(focused(*window, at), exact, atol=3e-4 * np.abs(exact).max())


def test_a_glint_far_outside_leaves_less_than_its_side_lobes():
    glint = samples_of(np.array([4.0]), np.array([1.0]))
    windows = RangeWindows(K, glint, TAPER)
    windows.transform()
    at = np.linspace(2.0, 3.0, 400)
    left = np.abs(focused(*windows.window(2.0, 3.0), at)).max()
    assert left < 1e-4
    assert left < 2.0 * np.abs(focused(K, glint, TAPER, at)).max()


def test_a_window_of_most_ranges_is_the_sweep_itself():
    samples = samples_of(np.array([3.0]), np.array([1.0]))
    windows = RangeWindows(K, samples, TAPER)
    assert windows.frequencies(0.1, 0.8 * PERIOD) == FREQUENCIES
    for made in (False, True):
        if made:
            windows.transform()
        window = windows.window(0.1, 0.8 * PERIOD)
        assert window.samples is samples
        assert_array_equal(window.k, K)
        assert_allclose(window.taper, TAPER, rtol=1e-6)
    assert windows.profile_bytes >= samples.nbytes
