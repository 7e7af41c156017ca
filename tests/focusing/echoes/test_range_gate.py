"""A window of range, filtered out of a sweep, against the whole sweep."""

from __future__ import annotations

import numpy as np
from focusing_problems import BAND, line, noise, problem
from hypothesis import given, settings
from hypothesis import strategies as st
from profiles import examples
from scipy.constants import speed_of_light

from mirrorfold.focusing.echoes.range_gate import gated
from mirrorfold.focusing.exact.direct_sum import direct_sum


@settings(max_examples=examples(15))
@given(st.integers(0, 10**6), st.integers(150, 500), st.floats(0.1, 1.2), st.booleans())
def test_a_range_window_needs_fewer_frequencies(seed, count, nearest, monostatic):
    """What lies outside of it, a hundred times as strong, does not matter."""
    rng = np.random.default_rng(seed)
    frequency = np.linspace(290e9, 300e9, count)
    tx, rx = line(7, 2e-3), line(7, 2e-3, x=0.01 * rng.random() * (not monostatic))
    x, y = np.linspace(-0.1, 0.1, 9), nearest + np.linspace(0.0, 0.25, 9)
    whole = problem(tx, tx if monostatic else rx, frequency, x, y, monostatic=monostatic)
    tolerance = 10.0 ** rng.uniform(-5.0, -3.0)
    inside = np.array([rng.uniform(-0.1, 0.1, 5), rng.uniform(y[0], y[-1], 5), np.zeros(5)]).T
    period = 0.5 * speed_of_light * (count - 1) / 10e9
    outside = np.array([[0.1, min(nearest + 1.2, 0.8 * period), 0.0]])
    s = np.zeros(whole.data_shape, dtype=complex)
    for place, strength in (*((p, 1.0) for p in inside), *((p, 100.0) for p in outside)):
        way_tx, way_rx = (np.linalg.norm(e - place, axis=1) for e in (whole.tx, whole.rx))
        path = 2.0 * way_tx if monostatic else way_tx[:, None] + way_rx
        s += strength * np.exp(-1j * np.multiply.outer(whole.k, path))
    s = s.astype(np.complex64)
    fewer, data = gated(whole, s, tolerance)
    assert fewer.k.size <= 0.5 * count
    assert data.shape == fewer.data_shape
    points = whole.points(np.arange(whole.pixels))
    wanted, found = direct_sum(whole, s, points), direct_sum(fewer, data, points)
    assert np.linalg.norm(found - wanted) < max(tolerance, 1e-5) * np.linalg.norm(wanted)


def test_a_range_window_that_does_not_pay_leaves_everything_as_it_is():
    whole = problem(line(5, 2e-3), line(5, 2e-3), BAND, np.linspace(-1, 1, 5), np.linspace(0.3, 5.0, 5))
    s = noise(whole.data_shape)
    assert gated(whole, s, 1e-4) == (whole, s)
