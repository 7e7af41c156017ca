"""Focusing as users see it: what physics says of images, what is refused, plans, frames and real data."""

from __future__ import annotations

import inspect
import threading
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
import scipy.io
import xarray as xr
from focusing_problems import BAND, line, noise, plane, problem, relative_error
from scipy.constants import speed_of_light

from mirrorfold.common.windows import window
from mirrorfold.errors import InputError
from mirrorfold.focusing import FocusPlan, PlanCache, choice, default_grid, focus, line_array, plan_cache, prepare
from mirrorfold.focusing.cost import Cost
from mirrorfold.focusing.line_array import LineArrayPlan
from mirrorfold.focusing.settings import FocusSettings
from mirrorfold.sweep import make_sweep

DATA = Path(__file__).resolve().parents[3] / "shared" / "data"


@pytest.fixture(autouse=True)
def every_sector_counts(monkeypatch):
    """Small test images would be left to the exact kernel, which is as fast for them."""
    for module in (choice, line_array):
        monkeypatch.setattr(module, "exact_cost", lambda *_: Cost(0.0, 1e6))


def test_a_point_target_focuses_where_it_stands_with_full_gain():
    tx, target = line(21, 0.5e-3), np.array([0.12, 0.8, 0.0])
    r = np.linalg.norm(tx - target, axis=1)
    k = 2 * np.pi * BAND / speed_of_light
    s = np.exp(-1j * k[:, None, None] * (r[:, None] + r[None, :]))
    sweep = make_sweep(s, frequency=BAND, tx_position=tx, rx_position=tx)
    image = focus(sweep, x=np.linspace(0.0, 0.24, 49), y=np.linspace(0.7, 0.9, 41), taper="uniform")
    iy, ix = np.unravel_index(int(np.abs(image.values).argmax()), image.shape)
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


@pytest.mark.slow
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
    assert relative_error(image.values, p, sweep["s"].values, pixels=200) <= 1e-3


def test_focus_measures_its_error_and_says_so():
    tx = line(61, 0.5e-3)
    sweep = make_sweep(noise((41, 61, 61)), frequency=BAND, tx_position=tx, rx_position=tx)
    grid = {"x": np.linspace(-1, 1, 400), "y": np.linspace(0.3, 1.4, 300)}
    image = focus(sweep, **grid, tolerance=1e-4)
    assert image.attrs["algorithm"] == "polar"
    assert 0.0 < image.attrs["error"] <= 1e-4
    p = problem(tx, tx, BAND, grid["x"], grid["y"])
    assert relative_error(image.values, p, sweep["s"].values) <= 1e-4


@pytest.fixture
def large():
    """A sweep and a grid that are worth a plan."""
    tx = line(61, 0.5e-3)
    sweep = make_sweep(noise((41, 61, 61)), frequency=BAND, tx_position=tx, rx_position=tx)
    return sweep, {"x": np.linspace(-1, 1, 400), "y": np.linspace(0.3, 1.4, 300), "tolerance": 1e-4}


@pytest.fixture
def plans_made(monkeypatch):
    """Counts the plans that are made."""
    made, build = [], LineArrayPlan.__init__

    def counted(self, *given):
        made.append(self)
        build(self, *given)

    monkeypatch.setattr(LineArrayPlan, "__init__", counted)
    return made


def test_a_plan_made_from_the_geometry_is_the_one_that_focuses(large, plans_made):
    sweep, settings = large
    wanted = focus(sweep, **settings, plans=PlanCache())
    plans = prepare(sweep.drop_vars("s"), **settings)
    assert plans.nbytes > 0
    assert len(plans_made) == 2
    np.testing.assert_array_equal(focus(sweep, **settings, plans=plans), wanted)
    assert len(plans_made) == 2


def test_the_same_geometry_again_needs_no_second_plan_until_the_cache_is_cleared(large, plans_made):
    sweep, settings = large
    plan_cache.clear()
    first = focus(sweep, **settings)
    np.testing.assert_array_equal(focus(sweep, **settings), first)
    assert len(plans_made) == 1
    assert plan_cache.nbytes > 0
    plan_cache.clear()
    assert plan_cache.nbytes == 0
    focus(sweep, **settings)
    assert len(plans_made) == 2
    focus(sweep, **settings, taper="uniform")
    assert len(plans_made) == 3
    plan_cache.clear()


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


def test_the_error_of_an_exact_plan_is_measured():
    made = FocusPlan(small_sweep(), x=np.linspace(-0.2, 0.2, 20), y=np.linspace(0.5, 1.0, 20), tolerance=1e-3)
    assert made.algorithm == "exact"
    assert 0.0 < made.error < 1e-3
    s = noise((41, 8, 8), 5)
    p = problem(line(8, 0.5e-3), line(8, 0.5e-3), BAND, made.x, made.y)
    assert relative_error(made.values(s), p, s, pixels=300) == pytest.approx(made.error, rel=0.5)


@pytest.mark.parametrize("tolerance", [2e-6, 3e-6])
def test_the_finest_tolerance_is_the_one_that_is_stated(tolerance):
    """The exact kernel works at half the tolerance, which must not be what a refusal names."""
    request = {"x": np.linspace(-0.1, 0.1, 5), "y": np.linspace(0.5, 1.0, 5)}
    assert focus(small_sweep(), **request, tolerance=tolerance).attrs["error"] <= tolerance
    with pytest.raises(InputError, match="tolerance is 1e-06, expected a finite number of at least 2e-06 and below 1"):
        focus(small_sweep(), **request, tolerance=1e-6)


@pytest.mark.parametrize("shape", [(1, 1), (1, 50), (50, 1), (1, 5000), (5000, 1)])
def test_a_grid_of_any_shape_gives_the_same_numbers(shape):
    tx = line(41, 0.5e-3)
    p = problem(tx, tx, BAND, np.linspace(0.1, 0.9, shape[1]), np.linspace(0.4, 1.3, shape[0]))
    s = noise(p.data_shape)
    sweep = make_sweep(s, frequency=BAND, tx_position=tx, rx_position=tx)
    assert relative_error(focus(sweep, x=p.x, y=p.y).values, p, s) <= 1e-4
    assert relative_error(LineArrayPlan(p, 1e-4)(s), p, s) <= 1e-4


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
    together: dict[int, xr.DataArray] = {}
    threads = [threading.Thread(target=lambda n=n: together.update({n: made(frames[n % 2])})) for n in range(6)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for n in range(6):
        np.testing.assert_array_equal(together[n], alone[n % 2])


@pytest.mark.parametrize("z", [None, 0.1, [0.0, 0.1]])
def test_a_plan_returns_what_focus_does(z):
    """So that it can be folded: coordinates and attributes too, but for the error, which is that of white noise."""
    sweep = small_sweep().assign_attrs(title="a room")
    settings = {"x": np.linspace(-0.2, 0.2, 9), "y": np.linspace(0.5, 1.0, 7), "z": z, "tolerance": 1e-3}
    made = FocusPlan(sweep, **settings)
    image, wanted = made(sweep["s"]), focus(sweep, **settings)
    assert image.attrs.pop("error") == made.error
    wanted.attrs.pop("error")
    xr.testing.assert_identical(image, wanted)
    np.testing.assert_array_equal(made.values(sweep["s"]), image)


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
        ({"tolerance": 0.0}, "tolerance is 0.0"),
        ({"tolerance": 1e-9}, "tolerance is 1e-09, expected a finite number of at least 2e-06"),
        ({"taper": "kaiser"}, "taper is 'kaiser'"),
        ({"taper": np.ones(3)}, "expected (41,)"),
        ({"apodization": np.ones(3)}, "expected (8,)"),
        ({"wave_speed": -1.0}, "wave_speed is -1.0, expected a finite number [m/s] above 0"),
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


def test_a_frame_of_another_shape_is_refused():
    made = FocusPlan(small_sweep(), x=[0.0], y=[1.0])
    with pytest.raises(InputError, match="shape"):
        made(np.ones((41, 8, 7)))


def test_pixels_partly_beyond_the_ambiguous_range_are_warned_of():
    with pytest.warns(UserWarning, match="ambiguous range"):
        focus(small_sweep(), x=[0.0], y=[0.5, 2.0])


# Real data.


@pytest.mark.slow
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
    sweep = make_sweep(s, frequency=frequency[band], tx_position=position, rx_position=position, wave_speed=6300.0)
    image = np.abs(focus(sweep, x=np.linspace(-25e-3, 25e-3, 201), y=np.linspace(10e-3, 50e-3, 321)))
    wall = image.sel(y=slice(35e-3, 46e-3))
    assert float(wall.y[int(wall.mean("x").argmax("y"))]) == pytest.approx(40.8e-3, abs=0.5e-3)
    notch = image.sel(y=slice(15e-3, 25e-3), x=slice(0.0, 15e-3))
    iy, ix = np.unravel_index(int(notch.values.argmax()), notch.shape)
    assert float(notch.x[ix]) == pytest.approx(7e-3, abs=1.5e-3)
    assert float(notch.y[iy]) == pytest.approx(20e-3, abs=1.5e-3)
