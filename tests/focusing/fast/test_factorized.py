"""Factorised back-projection, the fast path of any array, against the float64 direct sum."""

from __future__ import annotations

import numpy as np
import pytest
from focusing_problems import BAND, noise, plane, problem, relative_error
from hypothesis import HealthCheck, given, reject, settings
from hypothesis import strategies as st
from profiles import examples
from scipy.constants import speed_of_light
from threadpoolctl import threadpool_info, threadpool_limits

from mirrorfold.focusing.exact.exact_sum import focus_exact
from mirrorfold.focusing.fast import factorized
from mirrorfold.focusing.fast.bandlimited import Axis
from mirrorfold.focusing.problem import UnsuitedError


@pytest.fixture
def divide_always(monkeypatch):
    """Small problems would leave everything to the exact kernel."""
    monkeypatch.setattr(factorized, "exact_seconds", lambda cells, pairs, antennas, pixels: 1e-3 * pairs * pixels)


@pytest.mark.parametrize("tolerance", [1e-2, 1e-3, 1e-4])
def test_few_samples_tell_a_band_limited_function(tolerance):
    rng = np.random.default_rng(0)
    position = np.sort(rng.uniform(-0.3, 0.5, 400))
    axis = Axis(position, tolerance)
    found = axis.interpolator(axis.step(120.0))
    waves = np.exp(1j * rng.uniform(-120.0, 120.0, (50, 1)) * position)
    error = np.abs(waves[:, found.index] @ found.matrix - waves)
    assert np.sqrt(np.mean(error**2)) <= tolerance
    # As many as the band and length ask for, and a few for the ends.
    assert 120.0 * np.ptp(position) / np.pi < found.index.size < 120.0 * 1.12 * np.ptp(position) / np.pi + 16


@pytest.mark.slow
def test_factorized_path_for_one_antenna_moved_over_a_plane(divide_always):
    tx = plane(21, 17, 1.5e-3)
    x, y, z = np.linspace(-0.2, 0.2, 40), np.linspace(0.5, 1.4, 60), np.linspace(-0.1, 0.15, 30)
    p = problem(tx, tx, BAND, x, y, z, monostatic=True)
    s = noise(p.data_shape)
    divided = factorized.FactorizedPlan(p, 1e-3)
    assert any(slab.whole.parts for slab in divided.slabs)
    assert relative_error(divided(s), p, s, pixels=200) <= 1e-3


def test_linear_algebra_does_not_spin_beside_the_sums(divide_always, monkeypatch):
    threads = []

    def counted(*given):
        threads.append({one["num_threads"] for one in threadpool_info() if one["user_api"] == "blas"})
        return focus_exact(*given)

    monkeypatch.setattr(factorized, "focus_exact", counted)
    tx = plane(6, 5, 4e-3)
    p = problem(tx, tx, BAND, np.linspace(-0.3, 0.2, 30), np.linspace(0.6, 1.0, 30), np.zeros(1), monostatic=True)
    with threadpool_limits(2, "blas"):
        factorized.FactorizedPlan(p, 1e-2)(noise(p.data_shape))
    assert threads
    assert all(used == {1} for used in threads)


@pytest.mark.slow
def test_factorized_path_for_planes_of_transmitters_and_receivers(divide_always):
    tx, rx = plane(6, 5, 4e-3), plane(5, 8, 5e-3, y=0.01) - np.array([0.02, 0.0, 0.01])
    x, y, z = np.linspace(-0.3, 0.2, 50), np.linspace(0.6, 1.0, 50), np.linspace(-0.1, 0.1, 20)
    p = problem(tx, rx, BAND, x, y, z)
    s = noise(p.data_shape)
    divided = factorized.FactorizedPlan(p, 1e-3)
    assert any(slab.whole.parts for slab in divided.slabs)
    assert relative_error(divided(s), p, s, pixels=200) <= 1e-3


@pytest.mark.slow
@settings(max_examples=examples(10), deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(seed=st.integers(0, 2**32 - 1))
def test_factorized_path_on_arrays_anywhere(seed, divide_always):
    rng = np.random.default_rng(seed)
    size = rng.uniform(0.01, 0.15, 3)
    tx, rx = (rng.uniform(-1, 1, (rng.integers(least, most), 3)) * size for least, most in ((12, 60), (8, 40)))
    monostatic = bool(rng.integers(2))
    start = rng.uniform(50e9, 300e9)
    frequency = np.linspace(start, start + rng.uniform(1e9, 20e9), int(rng.integers(15, 40)))
    reach = 0.9 * speed_of_light / 2 / (frequency[1] - frequency[0])
    y = np.sort(rng.uniform(0.2, min(3.0, max(reach, 0.5)), int(rng.integers(1, 30)))) + 0.15
    half = rng.uniform(0.05, 0.6)
    x = np.linspace(-half, rng.uniform(0.1, 1.0) * half, int(rng.integers(1, 40)))
    z = np.linspace(-0.2, 0.1, int(rng.integers(1, 6)))
    p = problem(tx, tx if monostatic else rx, frequency, x, y, z, monostatic=monostatic)
    s = noise(p.data_shape, seed=seed % 1000)
    try:
        plan = factorized.FactorizedPlan(p, 1e-3)
    except UnsuitedError:
        reject()  # too few antennas to be divided
    assert relative_error(plan(s), p, s) <= 1e-3
