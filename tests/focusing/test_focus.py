"""Focusing as users see it: what physics says of images, volumes, frames and real data."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import scipy.io
import xarray as xr
from focusing_problems import BAND, line, noise, plane, problem, relative_error
from scipy.constants import speed_of_light

from mirrorfold.common.windows import window
from mirrorfold.focusing import focus
from mirrorfold.focusing.fast.line_array import LineArrayPlan
from mirrorfold.sweep import make_sweep

DATA = Path(__file__).resolve().parents[3] / "shared" / "data"

pytestmark = pytest.mark.usefixtures("every_sector_counts")


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


@pytest.mark.slow
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
