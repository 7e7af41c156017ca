"""Focusing against the float64 direct sum, and against what physics says."""

from __future__ import annotations

import threading
from pathlib import Path

import numpy as np
import pytest
import scipy.io
import xarray as xr
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from profiles import examples
from scipy.constants import speed_of_light

from mirrorfold.common.windows import WINDOWS, window
from mirrorfold.errors import InputError
from mirrorfold.focusing import FocusPlan, default_grid, factorized, focus, linear, plan
from mirrorfold.focusing.bandlimited import Axis
from mirrorfold.focusing.interpolation import triangular_kernel
from mirrorfold.focusing.linear import PolarPlan, line_array
from mirrorfold.focusing.problem import Problem
from mirrorfold.focusing.tfm import direct_sum, focus_exact, interpolation_error, table_cells
from mirrorfold.focusing.window import windowed
from mirrorfold.sweep import make_sweep

DATA = Path(__file__).resolve().parents[3] / "shared" / "data"


def line(count: int, pitch: float, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> np.ndarray:
    position = np.zeros((count, 3))
    position[:, 0] = x + pitch * (np.arange(count) - 0.5 * (count - 1))
    position[:, 1], position[:, 2] = y, z
    return position


def problem(tx, rx, frequency, x, y, z=0.0, taper="hann", monostatic=False, wave_speed=speed_of_light) -> Problem:
    return Problem(
        k=2 * np.pi * np.asarray(frequency) / wave_speed,
        tx=tx,
        rx=rx,
        taper=window(taper, len(frequency), "taper"),
        tx_weight=window(None, len(tx), "apodization"),
        rx_weight=window(None, len(rx), "apodization"),
        x=np.atleast_1d(x),
        y=np.atleast_1d(y),
        z=np.atleast_1d(z).astype(float),
        monostatic=monostatic,
    )


def noise(shape, seed=0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return rng.standard_normal((*shape, 2)).astype(np.float32).view(np.complex64)[..., 0]


def literal_sum(p: Problem, s: np.ndarray, points: np.ndarray) -> np.ndarray:
    """The formula, written out."""
    total = np.zeros(len(points), complex)
    for n, point in enumerate(points):
        r_tx = np.linalg.norm(p.tx - point, axis=1)
        r_rx = np.linalg.norm(p.rx - point, axis=1)
        for m, k in enumerate(p.k):
            path = 2 * r_tx if p.monostatic else r_tx[:, None] + r_rx[None, :]
            weight = p.tx_weight * p.rx_weight if p.monostatic else np.outer(p.tx_weight, p.rx_weight)
            total[n] += p.taper[m] * np.sum(weight * s[m] * np.exp(1j * k * path))
    return total


def relative_error(image: np.ndarray, p: Problem, s: np.ndarray, pixels: int = 60, seed: int = 1) -> float:
    flat = np.random.default_rng(seed).integers(0, p.pixels, pixels)
    reference = direct_sum(p, s, p.points(flat))
    return float(np.linalg.norm(image.ravel()[flat] - reference) / np.linalg.norm(reference))


BAND = np.linspace(296e9, 300e9, 41)


@pytest.fixture(autouse=True)
def every_sector_counts(monkeypatch):
    """Small test images would leave their sectors to the exact kernel."""
    monkeypatch.setattr(linear, "FEWEST_PAIR_PIXELS", 0)


# The exact kernel.


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


@pytest.mark.nojit
@pytest.mark.parametrize("tolerance", [1e-2, 1e-3, 1e-4, 1e-5])
def test_exact_kernel_holds_its_tolerance(tolerance):
    p = problem(line(12, 0.5e-3), line(12, 0.5e-3), BAND, np.linspace(-0.4, 0.4, 23), np.linspace(0.2, 1.4, 31))
    s = noise(p.data_shape)
    assert relative_error(focus_exact(p, s, tolerance), p, s) <= tolerance


def test_interpolation_error_is_what_is_predicted():
    p = problem(line(12, 0.5e-3), line(11, 0.5e-3), BAND, np.linspace(-0.4, 0.4, 40), np.linspace(0.2, 1.4, 40))
    s = noise(p.data_shape)
    predicted = interpolation_error(p.taper, table_cells(p.taper, 1e-2))
    assert 0.7 * predicted < relative_error(focus_exact(p, s, 1e-2), p, s, pixels=200) < 1.4 * predicted


@settings(max_examples=examples(25), suppress_health_check=[HealthCheck.too_slow])
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
    s = noise(p.data_shape, seed)
    image = focus_exact(p, s, 1e-4)
    reference = direct_sum(p, s, p.points(np.arange(p.pixels)))
    assert np.linalg.norm(image.ravel() - reference) <= 3e-4 * np.linalg.norm(reference)


def test_a_point_target_focuses_where_it_stands_with_full_gain():
    tx, target = line(21, 0.5e-3), np.array([0.12, 0.8, 0.0])
    r = np.linalg.norm(tx - target, axis=1)
    k = 2 * np.pi * BAND / speed_of_light
    s = np.exp(-1j * k[:, None, None] * (r[:, None] + r[None, :]))
    sweep = make_sweep(s, frequency=BAND, tx_position=tx, rx_position=tx)
    image = focus(sweep, x=np.linspace(0.0, 0.24, 49), y=np.linspace(0.7, 0.9, 41), taper="uniform")
    iy, ix = np.unravel_index(int(np.abs(image).argmax()), image.shape)
    assert abs(float(image.x[ix]) - 0.12) < 1e-9
    assert abs(float(image.y[iy]) - 0.8) < 1e-9
    assert complex(image[iy, ix]) == pytest.approx(s.size, rel=1e-4)


def test_swapping_transmitters_and_receivers_changes_nothing():
    tx, rx = line(9, 0.5e-3, x=-0.1), line(7, 0.7e-3, x=0.1)
    s = noise((41, 9, 7))
    x, y = np.linspace(-0.2, 0.2, 20), np.linspace(0.5, 1.0, 20)
    there = focus(make_sweep(s, frequency=BAND, tx_position=tx, rx_position=rx), x=x, y=y)
    back = focus(make_sweep(s.swapaxes(1, 2), frequency=BAND, tx_position=rx, rx_position=tx), x=x, y=y)
    assert np.abs(there - back).max() < 1e-4 * np.abs(there).max()


def test_moving_everything_along_x_moves_the_image():
    tx = line(9, 0.5e-3)
    s = noise((41, 9, 9))
    x, y = np.linspace(-0.2, 0.2, 20), np.linspace(0.5, 1.0, 20)
    here = focus(make_sweep(s, frequency=BAND, tx_position=tx, rx_position=tx), x=x, y=y)
    shift = np.array([3.0, 0.0, 0.0])
    there = focus(make_sweep(s, frequency=BAND, tx_position=tx + shift, rx_position=tx + shift), x=x + 3.0, y=y)
    assert np.abs(here.values - there.values).max() < 1e-3 * np.abs(here).max()


def test_the_image_is_linear_in_the_data():
    tx = line(9, 0.5e-3)
    a, b = noise((41, 9, 9), 1), noise((41, 9, 9), 2)
    kwargs = {"x": np.linspace(-0.2, 0.2, 20), "y": np.linspace(0.5, 1.0, 20)}
    ia, ib, iab = (
        focus(make_sweep(s, frequency=BAND, tx_position=tx, rx_position=tx), **kwargs) for s in (a, b, a + 2j * b)
    )
    assert np.abs(iab - ia - 2j * ib).max() < 3e-4 * np.abs(iab).max()


# The structured path.

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


@pytest.mark.parametrize("name", LINES)
@pytest.mark.parametrize("tolerance", [1e-3, 1e-5])
def test_fast_path_holds_its_tolerance_on(name, tolerance, monkeypatch):
    tx, rx = LINES[name]
    c = 0.5 * (tx.mean(axis=0) + rx.mean(axis=0))
    p = problem(tx, rx, BAND, c[0] + np.linspace(-1.2, 1.2, 90), c[1] + np.linspace(0.1, 1.4, 70))
    s = noise(p.data_shape)
    monkeypatch.setattr(plan, "FEWEST_PAIR_PIXELS", 0)
    made, image, error = plan.prove(p, tolerance, s)
    if name not in ("unequal pitch", "displaced and unequal"):  # These may be left to the exact kernel.
        assert made is not None
    if made is not None:
        assert error <= tolerance
        assert relative_error(image, p, s, pixels=150) <= 1.5 * tolerance


def test_fast_path_for_one_moving_antenna():
    place = line(81, 0.25e-3)
    p = problem(place, place, BAND, np.linspace(-1.2, 1.2, 90), np.linspace(0.2, 1.4, 70), monostatic=True)
    s = noise(p.data_shape)
    assert relative_error(PolarPlan(p, 1e-4)(s), p, s) <= 1e-4


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
    fewer, data = windowed(whole, s, tolerance)
    assert fewer.k.size <= 0.5 * count
    assert data.shape == fewer.data_shape
    points = whole.points(np.arange(whole.pixels))
    wanted, found = direct_sum(whole, s, points), direct_sum(fewer, data, points)
    assert np.linalg.norm(found - wanted) < max(tolerance, 1e-5) * np.linalg.norm(wanted)


def test_the_exact_kernel_computes_what_is_wanted_and_no_more():
    p = problem(line(7, 1e-3), line(7, 1e-3), BAND, np.linspace(-0.2, 0.2, 40), np.linspace(0.3, 0.6, 30))
    s, where = noise(p.data_shape), np.zeros(p.shape, dtype=bool)
    where[0, :, 7:19] = np.random.default_rng(4).random((30, 12)) < 0.5
    some = focus_exact(p, s, 1e-4, where=where)
    np.testing.assert_array_equal(some[~where], 0.0)
    whole = focus_exact(p, s, 1e-4)
    assert np.linalg.norm((some - whole)[where]) < 1e-4 * np.linalg.norm(whole[where])


def test_a_range_window_that_does_not_pay_leaves_everything_as_it_is():
    whole = problem(line(5, 2e-3), line(5, 2e-3), BAND, np.linspace(-1, 1, 5), np.linspace(0.3, 5.0, 5))
    s = noise(whole.data_shape)
    assert windowed(whole, s, 1e-4) == (whole, s)


def test_fast_path_with_position_jitter():
    rng = np.random.default_rng(3)
    tx = line(41, 0.5e-3) + np.array([20e-6, 20e-6, 0.0]) * rng.standard_normal((41, 3))
    p = problem(tx, tx, BAND, np.linspace(-0.6, 0.6, 80), np.linspace(0.4, 1.4, 60))
    s = noise(p.data_shape)
    assert line_array(p)
    assert relative_error(PolarPlan(p, 1e-4)(s), p, s) <= 1e-4


def test_wide_angle_close_in():
    tx = line(161, 0.5e-3)
    r, u = np.meshgrid(np.linspace(0.5, 3.0, 40), np.linspace(-0.9, 0.9, 41))
    p = problem(tx, tx, BAND, np.linspace(-2.7, 2.7, 200), np.linspace(0.22, 3.0, 120))
    s = noise(p.data_shape)
    image = PolarPlan(p, 1e-4)(s)
    inside = (r * u, r * np.sqrt(1 - u**2))
    ix = np.abs(p.x[None] - inside[0].reshape(-1, 1)).argmin(axis=1)
    iy = np.abs(p.y[None] - inside[1].reshape(-1, 1)).argmin(axis=1)
    flat = np.ravel_multi_index((np.zeros_like(iy), iy, ix), p.shape)[::20]
    reference = direct_sum(p, s, p.points(flat))
    assert np.linalg.norm(image.ravel()[flat] - reference) <= 1e-4 * np.linalg.norm(reference)


@settings(max_examples=examples(12), suppress_health_check=[HealthCheck.too_slow])
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
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(plan, "FEWEST_PAIR_PIXELS", 0)
        _, image, error = plan.prove(p, tolerance, s)
    if image is not None:  # Else the exact kernel takes over.
        assert error <= tolerance
        assert relative_error(image, p, s, pixels=100) <= 1.5 * tolerance


# Any array.


def plane(columns: int, rows: int, pitch: float, y: float = 0.0) -> np.ndarray:
    x, z = np.meshgrid(line(columns, pitch)[:, 0], line(rows, pitch)[:, 0])
    return np.stack([x.ravel(), np.full(x.size, y), z.ravel()], axis=1)


@pytest.fixture
def divide_always(monkeypatch):
    """Small problems would leave everything to the exact kernel."""
    monkeypatch.setattr(factorized, "WORTHWHILE", np.inf)
    monkeypatch.setattr(factorized, "CALL", 0.0)


@pytest.mark.parametrize("tolerance", [1e-2, 1e-3, 1e-4])
def test_few_samples_tell_a_band_limited_function(tolerance):
    rng = np.random.default_rng(0)
    position = np.sort(rng.uniform(-0.3, 0.5, 400))
    axis = Axis(position, tolerance)
    found = axis.interpolator(120.0)
    waves = np.exp(1j * rng.uniform(-120.0, 120.0, (50, 1)) * position)
    error = np.abs(waves[:, found.index] @ found.matrix - waves)
    assert np.sqrt(np.mean(error**2)) <= 1.5 * tolerance
    # As many as the band and length ask for, and a few for the ends.
    assert 120.0 * np.ptp(position) / np.pi < found.index.size < 120.0 * 1.12 * np.ptp(position) / np.pi + 16


def test_factorized_path_for_one_antenna_moved_over_a_plane(divide_always):
    tx = plane(21, 17, 1.5e-3)
    x, y, z = np.linspace(-0.2, 0.2, 40), np.linspace(0.5, 1.4, 60), np.linspace(-0.1, 0.15, 30)
    p = problem(tx, tx, BAND, x, y, z, monostatic=True)
    s = noise(p.data_shape)
    divided = factorized.FactorizedPlan(p, 1e-3)
    assert any(slab.whole.parts for slab in divided.slabs)
    assert relative_error(divided(s), p, s, pixels=200) <= 1e-3


def test_factorized_path_for_planes_of_transmitters_and_receivers(divide_always):
    tx, rx = plane(6, 5, 4e-3), plane(5, 8, 5e-3, y=0.01) - np.array([0.02, 0.0, 0.01])
    x, y, z = np.linspace(-0.3, 0.2, 50), np.linspace(0.6, 1.0, 50), np.linspace(-0.1, 0.1, 20)
    p = problem(tx, rx, BAND, x, y, z)
    s = noise(p.data_shape)
    divided = factorized.FactorizedPlan(p, 1e-3)
    assert any(slab.whole.parts for slab in divided.slabs)
    assert relative_error(divided(s), p, s, pixels=200) <= 1e-3


@settings(max_examples=examples(15), suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(seed=st.integers(0, 2**32 - 1))
def test_factorized_path_on_arrays_anywhere(seed, divide_always):
    rng = np.random.default_rng(seed)
    size = rng.uniform(0.01, 0.15, 3)
    tx, rx = rng.uniform(-1, 1, (rng.integers(2, 60), 3)) * size, rng.uniform(-1, 1, (rng.integers(2, 40), 3)) * size
    monostatic = bool(rng.integers(2))
    start = rng.uniform(50e9, 300e9)
    frequency = np.linspace(start, start + rng.uniform(1e9, 20e9), int(rng.integers(5, 40)))
    reach = 0.9 * speed_of_light / 2 / (frequency[1] - frequency[0])
    y = np.sort(rng.uniform(0.2, min(3.0, max(reach, 0.5)), int(rng.integers(1, 60)))) + 0.15
    half = rng.uniform(0.05, 0.6)
    x = np.linspace(-half, rng.uniform(0.1, 1.0) * half, int(rng.integers(1, 80)))
    z = np.linspace(-0.2, 0.1, int(rng.integers(1, 12)))
    p = problem(tx, tx if monostatic else rx, frequency, x, y, z, monostatic=monostatic)
    s = noise(p.data_shape, seed=seed % 1000)
    assert relative_error(factorized.FactorizedPlan(p, 1e-3)(s), p, s) <= 2e-3


def test_focus_takes_the_factorized_path_where_it_pays():
    tx = plane(40, 40, 1e-3)
    sweep = xr.Dataset(
        {"s": (("frequency", "position"), noise((41, 1600)))},
        coords={"frequency": BAND, "antenna_position": (("position", "axis"), tx), "axis": ["x", "y", "z"]},
    )
    grid = {"x": np.linspace(-0.3, 0.3, 100), "y": np.linspace(0.6, 1.4, 120), "z": np.linspace(-0.2, 0.2, 40)}
    image = focus(sweep, **grid, tolerance=1e-3)
    assert image.attrs["algorithm"] == "factorized"
    assert 0.0 < image.attrs["error"] <= 1e-3
    p = problem(tx, tx, BAND, **grid, monostatic=True)
    assert relative_error(image.values, p, sweep["s"].values, pixels=200) <= 1.3e-3


def test_focus_proves_its_tolerance_and_says_so():
    tx = line(61, 0.5e-3)
    sweep = make_sweep(noise((41, 61, 61)), frequency=BAND, tx_position=tx, rx_position=tx)
    grid = {"x": np.linspace(-1, 1, 400), "y": np.linspace(0.3, 1.4, 300)}
    image = focus(sweep, **grid, tolerance=1e-4)
    assert image.attrs["algorithm"] == "polar"
    assert 0.0 < image.attrs["error"] <= 1e-4
    p = problem(tx, tx, BAND, grid["x"], grid["y"])
    assert relative_error(image.values, p, sweep["s"].values) <= 1.5e-4


def test_a_plan_made_from_the_geometry_is_the_one_that_focuses(monkeypatch):
    tx = line(61, 0.5e-3)
    sweep = make_sweep(noise((41, 61, 61)), frequency=BAND, tx_position=tx, rx_position=tx)
    grid = {"x": np.linspace(-1, 1, 400), "y": np.linspace(0.3, 1.4, 300)}
    wanted = focus(sweep, **grid, tolerance=1e-4)
    monkeypatch.setattr(plan, "_latest", None)
    plan.prepare(sweep.drop_vars("s"), **grid, tolerance=1e-4)

    def refuse(*_):
        raise AssertionError("a second plan")

    monkeypatch.setattr(PolarPlan, "__init__", refuse)
    np.testing.assert_array_equal(focus(sweep, **grid, tolerance=1e-4), wanted)


def test_a_request_that_makes_no_sense_is_refused_before_there_are_samples():
    with pytest.raises(InputError, match="tolerance"):
        plan.prepare(small_sweep().drop_vars("s"), tolerance=2.0)


@pytest.mark.parametrize("shape", [(1, 1), (1, 50), (50, 1), (1, 5000), (5000, 1)])
def test_a_grid_of_any_shape_gives_the_same_numbers(shape):
    tx = line(41, 0.5e-3)
    p = problem(tx, tx, BAND, np.linspace(0.1, 0.9, shape[1]), np.linspace(0.4, 1.3, shape[0]))
    s = noise(p.data_shape)
    sweep = make_sweep(s, frequency=BAND, tx_position=tx, rx_position=tx)
    assert relative_error(focus(sweep, x=p.x, y=p.y).values, p, s) <= 1e-4
    assert relative_error(PolarPlan(p, 1e-4)(s), p, s) <= 1e-4


def test_a_volume_is_its_planes():
    tx, rx = line(11, 1e-3), line(12, 1e-3)[:, [2, 1, 0]]
    sweep = make_sweep(noise((41, 11, 12)), frequency=BAND, tx_position=tx, rx_position=rx)
    x, y, z = np.linspace(-0.1, 0.1, 12), np.linspace(0.4, 0.6, 9), np.linspace(-0.1, 0.1, 5)
    volume = focus(sweep, x=x, y=y, z=z)
    assert volume.dims == ("z", "y", "x")
    for height in z:
        plane = focus(sweep, x=x, y=y, z=height)
        assert plane.dims == ("y", "x")
        assert np.abs(volume.sel(z=height).values - plane.values).max() < 1e-3 * np.abs(volume).max()


def test_frames_are_imaged_one_by_one():
    tx = line(11, 0.5e-3)
    one = make_sweep(noise((41, 11, 11)), frequency=BAND, tx_position=tx, rx_position=tx)
    two = one.assign(s=xr.concat([one["s"], 2j * one["s"]], dim="frame"))
    grid = {"x": np.linspace(-0.2, 0.2, 20), "y": np.linspace(0.5, 1.0, 15)}
    calls = []
    images = focus(two, **grid, progress=lambda done, total: calls.append((done, total)))
    assert images.dims == ("frame", "y", "x")
    np.testing.assert_allclose(images[1], 2j * images[0], rtol=1e-4, atol=1e-2)
    np.testing.assert_allclose(images[0], focus(one, **grid), rtol=1e-4, atol=1e-2)
    assert calls == [(1, 2), (2, 2)]
    assert images.attrs["frames_per_second"] > 0


def test_a_plan_gives_the_same_from_two_threads():
    tx = line(61, 0.5e-3)
    frames = [noise((41, 61, 61), seed) for seed in range(2)]
    sweep = make_sweep(frames[0], frequency=BAND, tx_position=tx, rx_position=tx)
    made = FocusPlan(sweep, x=np.linspace(-1, 1, 400), y=np.linspace(0.3, 1.4, 300), tolerance=1e-3)
    assert made.algorithm == "polar"
    assert made.error <= 1e-3
    assert made.nbytes > 0
    alone = [made(frame) for frame in frames]
    together: dict[int, np.ndarray] = {}
    threads = [threading.Thread(target=lambda n=n: together.update({n: made(frames[n % 2])})) for n in range(6)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for n in range(6):
        np.testing.assert_array_equal(together[n], alone[n % 2])


def test_one_moving_antenna_from_a_dataset():
    place = line(31, 0.3e-3)
    sweep = xr.Dataset(
        {"s": (("frequency", "position"), noise((41, 31)))},
        coords={"frequency": BAND, "antenna_position": (("position", "axis"), place), "axis": ["x", "y", "z"]},
    )
    image = focus(sweep, x=np.linspace(-0.3, 0.3, 30), y=np.linspace(0.3, 1.0, 20))
    p = problem(place, place, BAND, image.x.values, image.y.values, monostatic=True)
    assert relative_error(image.values, p, sweep["s"].values) <= 1e-4


def test_normalization_multiplies_by_range():
    tx = line(11, 0.5e-3)
    sweep = make_sweep(noise((41, 11, 11)), frequency=BAND, tx_position=tx, rx_position=tx)
    grid = {"x": np.linspace(-0.2, 0.2, 20), "y": np.linspace(0.5, 1.0, 15)}
    plain = focus(sweep, **grid)
    r = np.hypot(plain.x, plain.y)
    np.testing.assert_allclose(
        focus(sweep, **grid, normalization="r2").values, (plain * r**2).transpose("y", "x"), rtol=1e-5
    )


def test_apodization_weighs_the_elements():
    tx = line(11, 0.5e-3)
    s = noise((41, 11, 11))
    weight = np.random.default_rng(0).standard_normal(11) + 1j
    grid = {"x": np.linspace(-0.2, 0.2, 20), "y": np.linspace(0.5, 1.0, 15)}
    weighted = s * weight[:, None] * np.hanning(13)[1:-1]
    expected = focus(make_sweep(weighted, frequency=BAND, tx_position=tx, rx_position=tx), **grid)
    sweep = make_sweep(s, frequency=BAND, tx_position=tx, rx_position=tx)
    image = focus(sweep, **grid, apodization=(weight, "hann"))
    assert np.abs(image - expected).max() < 1e-3 * np.abs(expected).max()


def test_the_published_taper_is_triangular():
    m = 41
    n = np.arange(1, m + 1)
    np.testing.assert_allclose(window("triangular", m, "taper").real, 1 - 2 / (m - 1) * np.abs(n - (m + 1) / 2))


@pytest.mark.nojit
def test_kernels_hold_the_error_they_state():
    kernel = triangular_kernel(6, 2.0, True)
    omega, t = 0.9, 0.37
    taps = np.arange(6) + kernel.first
    powers = (2 * t - 1) ** np.arange(kernel.coefficients.shape[1])
    weights = kernel.coefficients.astype(float) @ powers
    value = np.interp(omega, kernel.omega, kernel.factor) * np.sum(weights * np.exp(1j * omega * taps))
    assert abs(value - np.exp(1j * omega * t)) < 1e-4


def test_the_default_grid_covers_what_can_be_seen():
    frequency, tx = np.linspace(290e9, 300e9, 401), line(161, 0.5e-3)
    x, y = default_grid(frequency, tx, tx)
    far = speed_of_light / (2 * 25e6)
    assert 0.95 * far < y[-1] < far
    assert x[-1] == pytest.approx(0.9 * far, rel=0.02)
    assert x[-1] == pytest.approx(-x[0])
    assert y[1] - y[0] <= 0.0076
    assert 1e6 <= x.size * y.size <= 3.1e6


# What is refused.


def small_sweep(**changes) -> xr.Dataset:
    tx = line(8, 0.5e-3)
    return make_sweep(noise((41, 8, 8)), frequency=BAND, tx_position=tx, rx_position=tx).assign(**changes)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"x": [0.0, 1.0, 0.5]}, "not sorted"),
        ({"x": [0.0, np.nan]}, "not finite"),
        ({"x": []}, "1D array"),
        ({"x": "wide"}, "not numbers"),
        ({"y": np.linspace(50.0, 60.0, 5)}, "ambiguous range"),
        ({"x": [0.25e-3], "y": [0.0, 1.0]}, "stands on the antenna"),
        ({"tolerance": 0.0}, "tolerance"),
        ({"tolerance": 1e-9}, "single-precision"),
        ({"taper": "kaiser"}, "taper is 'kaiser'"),
        ({"taper": np.ones(3)}, "expected (41,)"),
        ({"apodization": np.ones(3)}, "expected (8,)"),
        ({"wave_speed": -1.0}, "wave_speed"),
        ({"normalization": "r3"}, "normalization"),
        ({"x": np.arange(3e6), "y": 1.0 + np.arange(1e5) * 1e-6}, "memory"),
    ],
)
def test_bad_requests_get_one_sentence(changes, words):
    request = {"x": np.linspace(-0.1, 0.1, 5), "y": np.linspace(0.5, 1.0, 5)} | changes
    with pytest.raises(InputError) as refusal:
        focus(small_sweep(), **request)
    message = str(refusal.value)
    assert words in message
    assert "\n" not in message


def test_bad_sweeps_get_one_sentence():
    uneven = BAND.copy()
    uneven[3] += 1e8
    with pytest.raises(InputError, match="equal rising steps"):
        focus(small_sweep(frequency=uneven))
    holed = small_sweep()
    holed["s"][3, 2, 1] = np.nan
    with pytest.raises(InputError, match="not finite"):
        focus(holed)
    with pytest.raises(InputError, match="one element"):
        focus(small_sweep().isel(tx=[0], rx=[0]))


def test_a_frame_of_another_shape_is_refused():
    made = FocusPlan(small_sweep(), x=[0.0], y=[1.0])
    with pytest.raises(InputError, match="shape"):
        made(np.ones((41, 8, 7)))


def test_pixels_partly_beyond_the_ambiguous_range_are_warned_of():
    with pytest.warns(UserWarning, match="ambiguous range"):
        focus(small_sweep(), x=[0.0], y=[0.5, 2.0])


# Real data.


def test_ultrasonic_notch_and_back_wall():
    path = DATA / "arim" / "contact_notch_aluminium.mat"
    if not path.exists():
        pytest.skip(f"{path} is not there")
    data = scipy.io.loadmat(path, squeeze_me=True, struct_as_record=False)["exp_data"]
    time = data.time
    traces = np.asarray(data.time_data, dtype=float)
    position = np.zeros((data.array.el_xc.size, 3))
    position[:, 0] = data.array.el_xc
    # Positive frequencies around the probe's centre; forward transform exp(-jwt) is the sweep's convention.
    spectrum = np.fft.rfft(traces, axis=0)
    frequency = np.fft.rfftfreq(time.size, time[1] - time[0])
    spectrum *= np.exp(-2j * np.pi * frequency * time[0])[:, None]
    band = (frequency > 1e6) & (frequency < 9e6)
    s = np.zeros((band.sum(), position.shape[0], position.shape[0]), np.complex64)
    i, k = data.tx.astype(int) - 1, data.rx.astype(int) - 1
    s[:, i, k] = spectrum[band]
    s[:, k, i] = spectrum[band]
    sweep = make_sweep(s, frequency=frequency[band], tx_position=position, rx_position=position)
    image = np.abs(focus(sweep, x=np.linspace(-25e-3, 25e-3, 201), y=np.linspace(10e-3, 50e-3, 321), wave_speed=6300.0))
    wall = image.sel(y=slice(35e-3, 46e-3))
    assert float(wall.y[int(wall.mean("x").argmax())]) == pytest.approx(40.8e-3, abs=0.5e-3)
    notch = image.sel(y=slice(15e-3, 25e-3), x=slice(0.0, 15e-3))
    iy, ix = np.unravel_index(int(notch.argmax()), notch.shape)
    assert float(notch.x[ix]) == pytest.approx(7e-3, abs=1.5e-3)
    assert float(notch.y[iy]) == pytest.approx(20e-3, abs=1.5e-3)
