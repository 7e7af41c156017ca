"""Any radar is served alike: results scale with scene, array and wavelength, and a car's radar folds as well."""

from __future__ import annotations

import warnings
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scans import ball, panel, scene
from scipy.constants import speed_of_light
from synthetic import diffuse, radar_image, together

import mirrorfold as mf
from mirrorfold.common.geometry import reflect, segment_normal
from mirrorfold.scenes.floor_plan import parse_scene

WALL = np.array([[0.5, 1.8], [0.9, 0.9]])
OBJECT = np.array([[-0.2, 1.9], [-0.06, 1.95]])

LENGTHS = (
    "radar_position", "tx_aperture", "rx_aperture", "ambiguous_range", "range_resolution", "spot_radius",
    "focus_distance", "origin",
)  # fmt: skip


def scaled(image, factor, axes):
    """The image of the same scene, array and wavelength, all `factor` times as large."""
    attrs = dict(image.attrs)
    for name in LENGTHS:
        if name in attrs:
            attrs[name] = factor * np.asarray(attrs[name])
    for name in ("frequency_start", "frequency_stop", "frequency_step"):
        if name in attrs:
            attrs[name] = attrs[name] / factor
    return image.assign_coords({axis: factor * image[axis].values for axis in axes}).assign_attrs(attrs)


def points(reconstruction):
    return reconstruction.children["objects"].to_dataset(inherit=False)


@pytest.fixture(scope="module")
def image():
    ghost = reflect(OBJECT, WALL[0], segment_normal(*WALL))
    parts = together(diffuse(*WALL, seed=1), diffuse(*ghost, seed=2), diffuse((-0.7, 1.2), (-0.5, 1.3), seed=3))
    return radar_image(*parts, np.linspace(-1.0, 2.2, 401), np.linspace(0.3, 2.6, 288))


@pytest.mark.slow
@pytest.mark.parametrize("factor", [1e-3, 0.37, 1e3])
def test_an_image_of_everything_larger_folds_to_everything_larger(image, factor):
    here, there = mf.fold(image), mf.fold(scaled(image, factor, "xy"))
    assert here["mirrors"].sizes["mirror"] == there["mirrors"].sizes["mirror"] == 1
    assert points(here).sizes["point"] > 100
    for name in ("chain", "surface", "bounces"):
        assert_array_equal(points(there)[name], points(here)[name])
    for name in ("x", "y", "x_initial", "y_initial"):
        assert_allclose(points(there)[name], factor * points(here)[name], rtol=1e-6, atol=1e-6 * factor)
    assert_allclose(points(there)["confidence"], points(here)["confidence"], atol=1e-5)
    for name in ("x0", "y1", "folded_x1", "offset_error"):
        assert_allclose(there[f"mirrors/{name}"], factor * here[f"mirrors/{name}"], rtol=1e-5, atol=1e-6 * factor)
    for name in ("fold_minimum_length", "fold_wall_margin"):
        assert there.attrs[name] == pytest.approx(factor * here.attrs[name])


@pytest.mark.slow
@pytest.mark.parametrize("factor", [1e-3, 1e3])
def test_a_volume_of_everything_larger_folds_to_everything_larger(factor):
    world = scene(panel("wall", (0.0, 2.0, 0.0), (-1.0, -1.0, 0.0), 2.0, 1.6), ball("ball", (-1.1, 2.0, 0.0), 0.16))
    volume = mf.focus(mf.simulate(world, snr_db=25.0))
    here, there = mf.fold(volume), mf.fold(scaled(volume, factor, ["range"]))
    assert here["mirrors"].sizes["mirror"] == there["mirrors"].sizes["mirror"] == 1
    assert_array_equal(points(there)["chain"], points(here)["chain"])
    for name in ("x", "y", "z"):
        assert_allclose(points(there)[name], factor * points(here)[name], rtol=1e-4, atol=1e-4 * factor)


@pytest.mark.slow
def test_a_radar_at_79_ghz_sees_around_a_corner_too():
    """A band of 4 GHz and 16 cm of aperture: cells of 7.5 cm by 4 cm, in a hall."""
    roughness = {"rms_height": 0.2e-3, "correlation_length": 0.8e-3}
    wall = {"kind": "segment", "roughness": roughness}
    world = parse_scene(
        {
            "name": "hall",
            "dimensions": 2,
            "array": {"kind": "linear", "elements": 85, "pitch": 1.9e-3},
            "band": {"start": 77e9, "stop": 81e9, "points": 401},
            "surface": [
                {"name": "screen", "start": [-2.2, 3.0], "end": [-0.2, 2.8], **wall},
                {"name": "mirror", "start": [2.6, 5.6], "end": [3.4, 2.9], **wall},
                {"name": "disc", "kind": "circle", "center": [-1.2, 5.4], "radius": 0.35, "roughness": roughness},
            ],
        }
    )
    sweep = mf.simulate(world, seed=3, snr_db=20.0)
    score = mf.score(mf.reconstruct(sweep), world)
    mirror = next(row for row in score["mirrors"] if row["surface"] == "mirror")
    assert mirror["angle_error_deg"] < 0.3
    assert score["hidden"]["points"] > 5
    assert score["hidden"]["precision_5cm"] > 0.8
    assert score["hidden"]["invented_fraction"] < 0.1


# From the sweep: the grid, the focusing, the tests of paths and waves, too.

ANTENNAS, FREQUENCY = 48, np.linspace(74e9, 84e9, 121)
PITCH = 0.5 * speed_of_light / FREQUENCY.mean()
PLACES = PITCH * (np.arange(ANTENNAS) - 0.5 * (ANTENNAS - 1))[:, None] * [1.0, 0.0, 0.0]


@cache
def samples():
    """Of a wall and two objects seen in it, in noise: S = A^T diag(sigma) A with spherical waves A."""
    wall = np.array([[0.1, 1.15], [0.85, 0.75]])
    hidden = reflect(np.array([[0.5, 0.25], [0.55, 0.3]]), wall[0], segment_normal(*wall))
    place, amplitude = together(diffuse(*wall, seed=1), (hidden, np.full(2, 60.0 + 0j)))
    way = np.linalg.norm(PLACES[:, None, :2] - place, axis=-1)
    wave = np.exp(-2j * np.pi / speed_of_light * FREQUENCY[:, None, None] * way) / np.sqrt(way)
    s = (wave * amplitude) @ wave.swapaxes(1, 2)
    noise = np.random.default_rng(4).standard_normal((2, *s.shape))
    return (s + 0.3 * (noise[0] + 1j * noise[1])).astype(np.complex64)


def reconstructed(factor, *, faster=False):
    """Scene and array as many times as large; the waves as many times as long, by their frequency or their speed."""
    speed, frequency = (factor, FREQUENCY) if faster else (1.0, FREQUENCY / factor)
    antennas = factor * PLACES
    with warnings.catch_warnings():  # of waves that are neither light nor sound
        warnings.simplefilter("ignore")
        sweep = mf.make_sweep(samples(), frequency=frequency, tx_position=antennas, rx_position=antennas)
        return mf.reconstruct(sweep.assign_attrs(wave_speed=speed * speed_of_light), tolerance=1e-5)


once = cache(reconstructed)


def assert_scaled(there, here, factor, rounding):
    """Whether lengths are `factor` times as large and all else is the same, to `rounding` metres of the first."""
    assert here["mirrors"].sizes["mirror"] == there["mirrors"].sizes["mirror"] == 1
    assert set(points(here)["bounces"].values) == {0, 1}
    for name in ("chain", "surface", "bounces"):
        assert_array_equal(points(there)[name], points(here)[name])
    for name in ("x", "y", "x_initial", "y_initial"):
        assert_allclose(points(there)[name] / factor, points(here)[name], rtol=0.0, atol=rounding)
    for name in ("x0", "y0", "x1", "y1", "folded_x1", "offset_error", "depth"):
        assert_allclose(there[f"mirrors/{name}"] / factor, here[f"mirrors/{name}"], rtol=0.0, atol=rounding)
    for name in ("fold_minimum_length", "fold_wall_margin"):
        assert there.attrs[name] / factor == pytest.approx(here.attrs[name], rel=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize("faster", [False, True])
@pytest.mark.parametrize("power", [-10, 1, 10])
def test_a_sweep_of_everything_larger_by_a_power_of_two_gives_the_same_picture_to_the_bit(power, faster):
    here, there = once(1.0), reconstructed(2.0**power, faster=faster)
    assert_array_equal(there["initial/initial"], 2.0**power * here["initial/initial"])
    assert_scaled(there, here, 2.0**power, 1e-14)
    assert_allclose(points(there)["confidence"], points(here)["confidence"], rtol=1e-6)


@pytest.mark.slow
@settings(max_examples=3)
@given(exponent=st.floats(-3.0, 3.0))
def test_a_sweep_of_everything_larger_gives_everything_larger(exponent):
    """To the tolerance of the image, 1e-5, in resolution cells of 3 cm by 3.6 cm a metre away."""
    assert_scaled(reconstructed(10.0**exponent), once(1.0), 10.0**exponent, 4e-7)
