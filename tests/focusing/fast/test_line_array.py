"""The fast path of line arrays against the float64 direct sum."""

from __future__ import annotations

import numpy as np
import pytest
from focusing_problems import BAND, line, noise, problem, relative_error
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st
from profiles import examples
from scipy.constants import speed_of_light

from mirrorfold.common.windows import WINDOWS
from mirrorfold.focusing.choosing import choice
from mirrorfold.focusing.choosing.caching import PlanCache
from mirrorfold.focusing.choosing.proven import prove
from mirrorfold.focusing.exact.direct_sum import direct_sum
from mirrorfold.focusing.fast.line_array import LineArrayPlan
from mirrorfold.focusing.lines.lattice import build_lattice


@pytest.fixture(autouse=True)
def every_image_counts(every_sector_counts, monkeypatch):
    """Small test images would be left to the exact kernel as a whole."""
    monkeypatch.setattr(choice, "FEWEST_PAIR_PIXELS", 0)


LINES = {
    "coincident": (line(41, 0.5e-3), line(41, 0.5e-3)),
    "displaced along the line": (line(31, 0.5e-3, x=-0.02), line(31, 0.5e-3, x=0.02)),
    "unequal count": (line(31, 0.5e-3), line(20, 0.5e-3)),
    "unequal pitch, commensurate": (line(21, 1.0e-3), line(31, 0.5e-3)),
    "unequal pitch": (line(31, 0.5e-3), line(25, 0.63e-3)),
    "displaced and unequal": (line(31, 0.5e-3, x=-0.02), line(25, 0.63e-3, x=0.02)),
    "along another axis": (line(41, 0.5e-3)[:, [1, 0, 2]], line(41, 0.5e-3)[:, [1, 0, 2]]),
    "tilted": (line(41, 0.5e-3) @ np.array([[0.8, 0.6, 0], [-0.6, 0.8, 0], [0, 0, 1]]),) * 2,
    "far from the origin": (line(41, 0.5e-3, x=5.0, y=-0.3, z=1.0), line(41, 0.5e-3, x=5.0, y=-0.3, z=1.0)),
}


GRID = np.linspace(-0.6, 0.6, 80), np.linspace(0.3, 1.4, 60)

CASES = [(name, tolerance) for name in LINES for tolerance in (1e-3, 1e-5)]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "tolerance"), CASES)
def test_fast_path_holds_its_tolerance_on(name, tolerance):
    tx, rx = LINES[name]
    c = 0.5 * (tx.mean(axis=0) + rx.mean(axis=0))
    p = problem(tx, rx, BAND, c[0] + np.linspace(-1.2, 1.2, 90), c[1] + np.linspace(0.1, 1.4, 70))
    s = noise(p.data_shape)
    proven = prove(p, tolerance, s, PlanCache())
    assert proven.plan.algorithm == "polar"
    assert proven.error <= tolerance
    assert relative_error(proven.image, p, s, pixels=150) <= tolerance


def test_fast_path_for_one_moving_antenna():
    place = line(81, 0.25e-3)
    p = problem(place, place, BAND, np.linspace(-1.2, 1.2, 90), np.linspace(0.2, 1.4, 70), monostatic=True)
    s = noise(p.data_shape)
    assert relative_error(LineArrayPlan(p, 1e-4)(s), p, s) <= 1e-4


def test_fast_path_with_position_jitter():
    rng = np.random.default_rng(3)
    tx = line(41, 0.5e-3) + np.array([20e-6, 20e-6, 0.0]) * rng.standard_normal((41, 3))
    p = problem(tx, tx, BAND, np.linspace(-0.6, 0.6, 80), np.linspace(0.4, 1.4, 60))
    s = noise(p.data_shape)
    assert relative_error(LineArrayPlan(p, 1e-4)(s), p, s) <= 1e-4


def test_fast_path_where_midpoints_stand_beside_their_lattice_points():
    """What they are beside does not fall with range, so that nodes at one wavenumber do not serve a wide band."""
    p = problem(line(31, 0.5e-3), line(25, 0.63e-3), np.linspace(250e9, 300e9, 80), *GRID)
    regular = problem(line(31, 0.5e-3), line(16, 1.0e-3), np.linspace(250e9, 300e9, 80), *GRID)
    assert [build_lattice(each).scales for each in (p, regular)] == [False, True]
    s = noise(p.data_shape)
    plan = LineArrayPlan(p, 1e-4)
    assert max(sector.predicted_error for sector in plan.sectors) <= 1e-4
    assert relative_error(plan(s), p, s) <= 1e-4


@pytest.mark.slow
def test_wide_angle_close_in():
    tx = line(161, 0.5e-3)
    r, u = np.meshgrid(np.linspace(0.5, 3.0, 40), np.linspace(-0.9, 0.9, 41))
    p = problem(tx, tx, BAND, np.linspace(-2.7, 2.7, 200), np.linspace(0.22, 3.0, 120))
    s = noise(p.data_shape)
    image = LineArrayPlan(p, 1e-4)(s)
    inside = (r * u, r * np.sqrt(1 - u**2))
    ix = np.abs(p.x[None] - inside[0].reshape(-1, 1)).argmin(axis=1)
    iy = np.abs(p.y[None] - inside[1].reshape(-1, 1)).argmin(axis=1)
    flat = np.ravel_multi_index((np.zeros_like(iy), iy, ix), p.shape)[::20]
    reference = direct_sum(p, s, p.points(flat))
    assert np.linalg.norm(image.ravel()[flat] - reference) <= 1e-4 * np.linalg.norm(reference)


@pytest.mark.slow
@settings(
    max_examples=examples(12),
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture],
)
@given(seed=st.integers(0, 10_000))
def test_fast_path_on_random_lines_bands_and_grids(seed):
    rng = np.random.default_rng(seed)
    start = rng.uniform(50e9, 300e9)
    wavelength = speed_of_light / start
    tx = line(int(rng.integers(8, 50)), rng.uniform(0.2, 1.2) * wavelength)
    rx = tx if rng.random() < 0.5 else line(int(rng.integers(8, 50)), rng.uniform(0.2, 1.2) * wavelength)
    rx = rx + np.array([rng.uniform(-0.01, 0.01) if rng.random() < 0.5 else 0.0, 0.0, 0.0])
    band = start * np.linspace(1.0, rng.uniform(1.001, 1.12), int(rng.integers(2, 90)))
    taper = rng.choice(sorted(WINDOWS))
    length = max(np.ptp(tx[:, 0]), np.ptp(rx[:, 0]))
    x = np.linspace(-1, 1, int(rng.integers(1, 90))) * rng.uniform(1, 20) * length
    y = np.linspace(rng.uniform(2.0, 6.0), rng.uniform(7, 40), int(rng.integers(1, 60))) * length
    p = problem(tx, rx, band, x, y, taper=taper)
    s = noise(p.data_shape, seed)
    tolerance = 10.0 ** rng.uniform(-4.5, -2.5)
    proven = prove(p, tolerance, s, PlanCache())
    # The exact kernel takes the rest over; hypothesis complains where that is most of them.
    assume(proven is not None and proven.plan.algorithm == "polar")
    assert proven.error <= tolerance
    assert relative_error(proven.image, p, s, pixels=100) <= tolerance
