"""Plans of focusing: made from the geometry alone, kept for the next sweep, shared by threads, and measured."""

from __future__ import annotations

import threading

import numpy as np
import pytest
import xarray as xr
from focusing_problems import BAND, line, noise, problem, relative_error, small_sweep

from mirrorfold.errors import InputError
from mirrorfold.focusing import FocusPlan, PlanCache, focus, plan_cache, prepare
from mirrorfold.focusing.fast.line_array import LineArrayPlan
from mirrorfold.sweep import make_sweep

pytestmark = pytest.mark.usefixtures("every_sector_counts")


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


@pytest.mark.slow
def test_a_plan_made_from_the_geometry_is_the_one_that_focuses(large, plans_made):
    sweep, settings = large
    wanted = focus(sweep, **settings, plans=PlanCache())
    plans = prepare(sweep.drop_vars("s"), **settings)
    assert plans.nbytes > 0
    assert len(plans_made) == 2
    np.testing.assert_array_equal(focus(sweep, **settings, plans=plans), wanted)
    assert len(plans_made) == 2


@pytest.mark.slow
def test_an_empty_first_frame_does_not_cost_the_plan(large, plans_made):
    """A relative error cannot be measured on it: the plan is proven on a frame that holds something."""
    sweep, settings = large
    frames = xr.concat([0.0 * sweep, sweep], dim="frame", data_vars=["s"], coords="minimal", compat="override")
    images = focus(frames, **settings, plans=PlanCache())
    assert images.attrs["algorithm"] == "polar"
    assert not images[0].any()
    np.testing.assert_array_equal(images[1], focus(sweep, **settings, plans=PlanCache()))


@pytest.mark.parametrize("name", ["frequency", "tx_position", "rx_position"])
def test_a_geometry_along_other_dimensions_is_refused(large, name):
    sweep, _ = large
    geometry = sweep.drop_vars(["s", name])
    with pytest.raises(InputError, match=f"{name} has dimensions"):
        FocusPlan(geometry.assign({name: sweep[name].rename({sweep[name].dims[0]: "other"})}))


@pytest.mark.slow
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


@pytest.mark.parametrize(("name", "change"), [
    ("frequency", lambda sweep: sweep.isel(frequency=slice(None, None, -1))),
    ("tx_position", lambda sweep: sweep.isel(tx=slice(None, None, -1))),
    ("rx_position", lambda sweep: sweep.isel(rx=slice(None, None, -1))),
    ("frequency", lambda sweep: sweep.assign_coords(frequency=sweep["frequency"] - 60e9)),
])  # fmt: skip
def test_frames_of_another_geometry_are_refused(name, change):
    sweep = small_sweep()
    made = FocusPlan(sweep, x=np.linspace(-0.2, 0.2, 5), y=np.linspace(0.5, 1.0, 5))
    with pytest.raises(InputError, match=f"another {name}"):
        made(change(sweep) if name != "frequency" else change(sweep)["s"])
    rounded = sweep.assign_coords(tx_position=sweep["tx_position"].astype(np.float32))
    np.testing.assert_array_equal(made(rounded), made(sweep["s"].values))


def test_the_error_of_an_exact_plan_is_measured():
    made = FocusPlan(small_sweep(), x=np.linspace(-0.2, 0.2, 20), y=np.linspace(0.5, 1.0, 20), tolerance=1e-3)
    assert made.algorithm == "exact"
    assert 0.0 < made.error < 1e-3
    s = noise((41, 8, 8), 5)
    p = problem(line(8, 0.5e-3), line(8, 0.5e-3), BAND, made.x, made.y)
    assert relative_error(made.values(s), p, s, pixels=300) == pytest.approx(made.error, rel=0.5)


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


def test_a_frame_of_another_shape_is_refused():
    made = FocusPlan(small_sweep(), x=[0.0], y=[1.0])
    with pytest.raises(InputError, match="shape"):
        made(np.ones((41, 8, 7), dtype=complex))
