"""The loops that find echoes and draw pictures, as plain Python: what compiled code gives, with every index checked."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from numpy.testing import assert_allclose
from synthetic import diffuse, radar_image, together

from mirrorfold.common.geometry import reflect, segment_normal
from mirrorfold.detection import volume_echoes
from mirrorfold.folding import blocks, drawing, pictures
from mirrorfold.reconstruction import FoldPlan

WALL = np.array([[0.5, 1.8], [0.9, 0.9]])
THING = np.array([[-0.2, 1.9], [-0.06, 1.95]])
DIRECT = np.array([[-0.05, 1.1], [0.05, 1.1]])


def plain(kernel):
    return getattr(kernel, "py_func", kernel)


@pytest.fixture
def as_plain_python(monkeypatch):
    """Run these loops, and what they call, as plain Python from now on."""

    def change():
        for module, name in (
            (pictures, "draw_row"),
            (blocks, "_fill"),
            (blocks, "_passes"),
            (blocks, "_raise"),
            (blocks, "_span"),
            (drawing, "_place"),
            (drawing, "_shown"),
            (drawing, "through_at"),
            (drawing, "hidden_at"),
            (drawing, "at_point"),
            (volume_echoes, "_runs_of"),
        ):
            monkeypatch.setattr(module, name, plain(getattr(module, name)))

    return change


def volume():
    """An oblique wall before a raster scan, and behind it what it shows of an object that stands aside."""
    azimuth, elevation = np.linspace(-10, 10, 11), np.linspace(-6, 6, 7)
    distance = np.arange(0.8, 1.6, 0.02)[:, None, None]
    wall = 1.1 + 0.01 * azimuth[:, None] + 0.0 * elevation
    thing = np.where((np.abs(azimuth[:, None]) < 5) & (np.abs(elevation) < 5), 1.4, np.inf)
    values = np.exp(-(((distance - wall) / 0.01) ** 2)) + 0.3 * np.exp(-(((distance - thing) / 0.01) ** 2))
    coords = {"range": distance.ravel(), "azimuth": azimuth, "elevation": elevation}
    attrs = {"spot_radius": 0.02, "focus_distance": 1.2, "frequency_start": 270e9, "frequency_stop": 300e9}
    return xr.DataArray(values.astype(np.complex64), dims=("range", "azimuth", "elevation"), coords=coords, attrs=attrs)


def same(found, expected):
    for name in ("x", "y", "amplitude", "bounces"):
        assert_allclose(found["objects"][name].values, expected["objects"][name].values, rtol=1e-5, atol=1e-6)
    picture, other = found["intensity"].values, expected["intensity"].values
    # On an edge a pixel may fall to either side where single precision rounds another way.
    assert np.mean(np.abs(picture - other) > 1e-4 * other.max()) < 0.002
    assert other.max() > 0.0


@pytest.mark.slow
def test_a_plan_with_a_ghost_is_drawn_the_same(as_plain_python):
    ghost = reflect(THING, WALL[0], segment_normal(*WALL))
    parts = diffuse(*WALL, seed=0), diffuse(*ghost, seed=9), diffuse(*DIRECT, seed=12)
    plan = FoldPlan(radar_image(*together(*parts), np.linspace(-1.2, 2.4, 361), np.linspace(0.3, 2.9, 261)))
    grid = np.linspace(-1.2, 2.4, 73), np.linspace(0.3, 2.9, 53)
    expected = plan.fold(grid=grid)
    as_plain_python()
    found = plan.fold(grid=grid)
    same(found, expected)
    # The object stands at its true place, where the unfolded image has nothing.
    x, y = THING.mean(axis=0)
    assert found["intensity"].sel(x=x, y=y, method="nearest") > 3 * found["initial/initial"].sel(
        x=x, y=y, method="nearest"
    )


@pytest.mark.slow
def test_a_volume_is_drawn_the_same(as_plain_python):
    corners = [[-0.15, 1.02, -0.1], [0.2, 1.18, -0.1], [0.2, 1.18, 0.1], [-0.15, 1.02, 0.1]]
    grid = np.linspace(-0.5, 0.5, 21), np.linspace(0.6, 1.5, 19), np.linspace(-0.2, 0.2, 9)
    expected = FoldPlan(volume()).fold(mirrors=[corners], grid=grid)
    as_plain_python()
    found = FoldPlan(volume()).fold(mirrors=[corners], grid=grid)
    same(found, expected)
    assert set(np.unique(found["objects"]["bounces"])) == {0, 1}
