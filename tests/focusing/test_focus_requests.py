"""What focusing may be asked for: each setting, the default grid, the finest tolerance, and what is refused."""

from __future__ import annotations

import inspect
from dataclasses import fields

import numpy as np
import pytest
from focusing_problems import BAND, line, small_sweep
from scipy.constants import speed_of_light

from mirrorfold import info
from mirrorfold.errors import InputError
from mirrorfold.focusing import FocusPlan, default_grid, focus, prepare
from mirrorfold.focusing.settings import FocusSettings
from mirrorfold.sweep import make_sweep

pytestmark = pytest.mark.usefixtures("every_sector_counts")


def test_a_request_that_makes_no_sense_is_refused_before_there_are_samples():
    with pytest.raises(InputError, match=r"tolerance is 2\.0"):
        prepare(small_sweep().drop_vars("s"), tolerance=2.0)


@pytest.mark.parametrize("function", [focus, FocusPlan, prepare])
def test_every_setting_is_in_the_signature_and_the_docstring(function):
    left_out = ("normalization", "memory_limit") if function is FocusPlan else ()
    names = [item.name for item in fields(FocusSettings) if item.name not in left_out]
    assert list(inspect.signature(function).parameters)[-len(names) :] == names
    described = inspect.getdoc(function)
    for name in names:
        assert f"\n{name} : " in described
    assert "**given" not in described
    assert inspect.signature(function).parameters["tolerance"].default == 1e-4


@pytest.mark.parametrize("tolerance", [2e-6, 3e-6])
def test_the_finest_tolerance_is_the_one_that_is_stated(tolerance):
    """The exact kernel works at half the tolerance, which must not be what a refusal names."""
    request = {"x": np.linspace(-0.1, 0.1, 5), "y": np.linspace(0.5, 1.0, 5)}
    assert focus(small_sweep(), **request, tolerance=tolerance).attrs["error"] <= tolerance
    with pytest.raises(InputError, match="tolerance is 1e-06, expected a finite number of at least 2e-06 and below 1"):
        focus(small_sweep(), **request, tolerance=1e-6)


@pytest.mark.parametrize("speed", [1e-3, 3.0, 340.0])
def test_an_ambiguous_range_shorter_than_the_array_is_refused_before_any_pixel(speed):
    """As with the speed of sound for radio waves: at 340 m/s and 25 MHz a range of 7 micrometres."""
    frequency, tx = np.linspace(290e9, 300e9, 401), np.linspace(-0.04, 0.04, 21)[:, None] * [1.0, 0.0, 0.0]
    with pytest.raises(InputError, match=r"ambiguous range of .* ends before 0\.08 m"):
        default_grid(frequency, tx, tx, speed)


def test_the_default_grid_covers_what_can_be_seen():
    frequency, tx = np.linspace(290e9, 300e9, 401), line(161, 0.5e-3)
    x, y = default_grid(frequency, tx, tx)
    far = speed_of_light / (2 * 25e6)
    assert 0.95 * far < y[-1] < far
    assert x[-1] == pytest.approx(0.9 * far, rel=0.02)
    assert x[-1] == pytest.approx(-x[0])
    assert y[1] - y[0] <= 0.0076
    assert 1e6 <= x.size * y.size <= 3.1e6


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"x": [0.0, 1.0, 0.5]}, "not sorted"),
        ({"x": [0.0, np.nan]}, "not finite"),
        ({"x": []}, "1D array"),
        ({"x": "wide"}, "not numbers"),
        ({"y": np.linspace(50.0, 60.0, 5)}, "ambiguous range"),
        ({"x": [0.25e-3], "y": [0.0, 1.0]}, "stands on the antenna"),
        ({"tolerance": 0.0}, "tolerance is 0.0"),
        ({"tolerance": 1e-9}, "tolerance is 1e-09, expected a finite number of at least 2e-06"),
        ({"taper": "kaiser"}, "taper is 'kaiser'"),
        ({"taper": np.ones(3)}, "expected (41,)"),
        ({"apodization": np.ones(3)}, "expected (8,)"),
        ({"wave_speed": 0.5}, "wave_speed is 0.5, expected a finite number [m/s] of at least 1"),
        ({"normalization": "r3"}, "normalization is 'r3'"),
        ({"normalization": "beam"}, "raster scans alone"),
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


def test_pixels_partly_beyond_the_ambiguous_range_are_warned_of():
    with pytest.warns(UserWarning, match="ambiguous range"):
        focus(small_sweep(), x=[0.0], y=[0.5, 2.0])


@pytest.mark.parametrize("tolerance", [1e-2, 1e-3, 1e-4])
def test_the_dark_beside_bright_echoes_is_as_exact_as_asked(tolerance):
    """The image of a place where hardly anything is: relative to it, errors of the samples are a larger part."""
    antennas = line(41, 1e-3)
    frequency = np.linspace(140e9, 150e9, 101)
    path = np.hypot(antennas[:, 0] - 0.1, 1.1)
    phase = 2.0 * np.pi / speed_of_light * np.multiply.outer(frequency, path[:, None] + path)
    sweep = make_sweep(np.exp(-1j * phase), frequency=frequency, tx_position=antennas, rx_position=antennas)
    dark = {"x": np.linspace(0.95, 1.05, 6), "y": np.linspace(0.25, 0.35, 6)}
    image = focus(sweep, **dark, tolerance=tolerance)
    bright = focus(sweep, x=np.linspace(0.05, 0.15, 6), y=np.linspace(1.05, 1.15, 6))
    assert abs(image).max() < 1e-3 * abs(bright).max()
    assert image.attrs["error"] <= tolerance


def test_antennas_along_the_wrong_axis_are_told():
    """Of arrays that stand along the range, or upright, the default floor plan shows ranges alone."""
    upright, along = [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]
    places = line(8, 0.5e-3)
    for axis, direction in (("y", along), ("z", upright)):
        turned = places[:, :1] * direction
        sweep = small_sweep(tx_position=(("tx", "axis"), turned), rx_position=(("rx", "axis"), turned))
        with pytest.warns(UserWarning, match=f"stand along {axis}"):
            focus(sweep)
        assert any(f"stand along {axis}" in remark for remark in info(sweep)["remarks"])
        focus(sweep, x=np.linspace(-0.1, 0.1, 5), y=np.linspace(0.3, 0.4, 5))  # pixels that are given are meant so
        focus(sweep.assign_attrs(scene_center=[0.5, 0.0, 0.0]))
    for degrees in (0.0, 45.0, 60.0, 180.0):
        direction = [np.cos(np.radians(degrees)), np.sin(np.radians(degrees)), 0.0]
        turned = places[:, :1] * direction
        sweep = small_sweep(tx_position=(("tx", "axis"), turned), rx_position=(("rx", "axis"), turned))
        assert not any("stand along" in remark for remark in info(sweep)["remarks"])


@pytest.mark.parametrize(("heights", "height"), [
    ((0.0, 0.0), 0.0),
    ((0.0, 0.015), 0.0),
    ((-0.02, 0.01), 0.0),
    ((0.003, 0.003), 0.0),
    ((1.0, 1.0), 1.0),
    ((1.0, 1.015), 1.0075),
    ((-0.8, -0.8), -0.8),
])  # fmt: skip
def test_the_image_lies_at_the_height_of_an_array_that_stands_far_above(heights, height):
    """A point at the array's height stands where it is, not nearer by ``z^2 / 2r``."""
    tx, rx = line(8, 0.5e-3, z=heights[0]), line(8, 0.5e-3, z=heights[1])
    sweep = small_sweep(tx_position=(("tx", "axis"), tx), rx_position=(("rx", "axis"), rx))
    image = focus(sweep, x=np.linspace(-0.1, 0.1, 5), y=np.linspace(0.3, 0.4, 5))
    assert float(image["z"]) == pytest.approx(height)
    assert float(focus(sweep, x=np.linspace(-0.1, 0.1, 5), y=np.linspace(0.3, 0.4, 5), z=0.0)["z"]) == 0.0
