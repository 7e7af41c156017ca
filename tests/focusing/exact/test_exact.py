"""The exact kernel against the float64 direct sum, and that against the formula."""

from __future__ import annotations

import numpy as np
import pytest
from focusing_problems import BAND, line, literal_sum, noise, problem, relative_error
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from mirrorfold.focusing.exact.direct_sum import direct_sum
from mirrorfold.focusing.exact.exact_sum import MONOSTATIC_BLOCK, MONOSTATIC_PIXELS, focus_exact
from mirrorfold.focusing.exact.range_tables import interpolation_error, table_cells


def test_the_oracle_is_the_formula():
    p = problem(line(5, 1e-3), line(4, 2e-3, x=0.1), BAND, [0.1, 0.3], [0.5, 1.0])
    s = noise(p.data_shape)
    points = p.points(np.arange(4))
    np.testing.assert_allclose(direct_sum(p, s, points), literal_sum(p, s, points), rtol=1e-9)


def test_the_oracle_is_the_formula_for_one_moving_antenna():
    place = line(6, 1e-3)
    p = problem(place, place, BAND, [0.1, 0.3], [0.5, 1.0], monostatic=True)
    s = noise(p.data_shape)
    points = p.points(np.arange(4))
    np.testing.assert_allclose(direct_sum(p, s, points), literal_sum(p, s, points), rtol=1e-9)


@pytest.mark.parametrize("tolerance", [1e-2, 1e-3, 1e-4, 1e-5])
def test_exact_kernel_holds_its_tolerance(tolerance):
    p = problem(line(12, 0.5e-3), line(12, 0.5e-3), BAND, np.linspace(-0.4, 0.4, 23), np.linspace(0.2, 1.4, 31))
    s = noise(p.data_shape)
    assert relative_error(focus_exact(p, s, tolerance), p, s) <= tolerance


def test_exact_kernel_for_more_positions_and_pixels_than_are_summed_together():
    """Of one moving antenna, some of the positions and a tile of the pixels are summed at a time."""
    place = line(2 * MONOSTATIC_BLOCK + 5, 1e-3)
    x, y = np.linspace(-0.4, 0.4, 61), np.linspace(0.2, 1.4, 83)
    p = problem(place, place, BAND, x, y, monostatic=True)
    assert p.pixels > 2 * MONOSTATIC_PIXELS
    s = noise(p.data_shape)
    assert relative_error(focus_exact(p, s, 1e-4), p, s, pixels=200) <= 1e-4


def test_interpolation_error_is_what_is_predicted():
    p = problem(line(12, 0.5e-3), line(11, 0.5e-3), BAND, np.linspace(-0.4, 0.4, 40), np.linspace(0.2, 1.4, 40))
    s = noise(p.data_shape)
    predicted = interpolation_error(p.taper, table_cells(p.taper, 1e-2))
    assert 0.7 * predicted < relative_error(focus_exact(p, s, 1e-2), p, s, pixels=200) < 1.4 * predicted


@pytest.mark.slow
@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(
    seed=st.integers(0, 10_000),
    elements=st.tuples(st.integers(1, 7), st.integers(2, 7)),
    shape=st.tuples(st.integers(1, 3), st.integers(1, 9), st.integers(1, 40)),
    frequencies=st.integers(1, 40),
    monostatic=st.booleans(),
    same=st.booleans(),
)
def test_exact_kernel_on_random_geometries(seed, elements, shape, frequencies, monostatic, same):
    rng = np.random.default_rng(seed)
    tx = rng.uniform(-0.1, 0.1, (max(elements), 3))
    rx = tx if same or monostatic else rng.uniform(-0.1, 0.1, (elements[1], 3))
    start = rng.uniform(1e9, 100e9)
    band = start + rng.uniform(1e6, 50e6) * np.arange(frequencies)
    axes = [np.sort(rng.uniform(-3, 3, n)) for n in shape]
    p = problem(tx, rx, band, axes[2], axes[1] + 4.0, axes[0], taper="uniform", monostatic=monostatic)
    # The promise is one of the mean over white data: images of few pixels need several draws of it.
    points, error, power = p.points(np.arange(p.pixels)), 0.0, 0.0
    for n in range(-(-300 // p.pixels)):
        s = noise(p.data_shape, 1000 * seed + n)
        reference = direct_sum(p, s, points)
        error += np.linalg.norm(focus_exact(p, s, 1e-4).ravel() - reference) ** 2
        power += np.linalg.norm(reference) ** 2
    assert np.sqrt(error / power) <= 1e-4


def test_the_exact_kernel_computes_what_is_wanted_and_no_more():
    p = problem(line(7, 1e-3), line(7, 1e-3), BAND, np.linspace(-0.2, 0.2, 40), np.linspace(0.3, 0.6, 30))
    s, where = noise(p.data_shape), np.zeros(p.shape, dtype=bool)
    where[0, :, 7:19] = np.random.default_rng(4).random((30, 12)) < 0.5
    some = focus_exact(p, s, 1e-4, where=where)
    np.testing.assert_array_equal(some[~where], 0.0)
    whole = focus_exact(p, s, 1e-4)
    assert np.linalg.norm((some - whole)[where]) < 1e-4 * np.linalg.norm(whole[where])
