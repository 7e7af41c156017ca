"""A glass door from the sweep to the score: what it reflected is folded, what passed through it stays behind it."""

from __future__ import annotations

from dataclasses import replace
from importlib.resources import files
from itertools import pairwise

import numpy as np
import pytest
import xarray as xr

import mirrorfold as mf
from mirrorfold.detection.search import lines
from mirrorfold.reconstruction import FoldPlan
from mirrorfold.scoring.transparent import NEEDED
from mirrorfold.tree import short_rows
from mirrorfold.tree.half_transparent import transparent

pytestmark = pytest.mark.slow

SCENE = files("mirrorfold") / "scenes/shipped/glass-door.toml"


@pytest.fixture(scope="module")
def seen():
    scene = mf.load_scene(SCENE)
    scene = replace(scene, array=replace(scene.array, elements=81), band=replace(scene.band, points=241))
    sweep = mf.simulate(scene, bounces=1, snr_db=20.0)
    return scene, sweep, mf.focus(sweep, x=np.arange(-1.0, 1.2, 0.005), y=np.arange(0.4, 2.8, 0.005), tolerance=1e-3)


@pytest.fixture(scope="module")
def plan(seen):
    _, sweep, image = seen
    return FoldPlan(image, sweep=sweep)


@pytest.fixture(scope="module")
def folded(plan):
    return plan.fold()


def test_door_shows_the_corner_and_lets_the_arc_be_seen(seen, plan, folded):
    scene = seen[0]
    score = mf.score(folded, scene)
    assert score.sides_right >= 0.95
    points = folded["objects"].to_dataset(inherit=False)
    # Of half the array: to a quarter of the range cell of 25 mm, and closer than without the delay of the door.
    assert score.passed_m <= 0.006
    arc = np.array([0.508, 1.925])
    through = points["wall"].values != ""
    distance = [
        np.abs(np.hypot(points[x].values - arc[0], points[y].values - arc[1])[through] - 0.18)
        for x, y in (("x", "y"), ("x_initial", "y_initial"))
    ]
    assert np.median(distance[0]) < np.median(distance[1])
    mirrors = folded["mirrors"].to_dataset()
    door = int(np.flatnonzero(np.isfinite(mirrors["thickness"].values))[0])
    assert set(points["wall"].values[through]) == {str(mirrors["chain"].values[door])}
    assert (points["bounces"].values[through] == 0).all()
    assert (points["passed"].values[through] > 0.5).all()
    # Opaque, the door shows the arc where nothing stands.
    opaque = mf.score(plan.fold(transparent=False), scene)
    assert score.hidden.precision_cells >= opaque.hidden.precision_cells + 0.1
    assert score.hidden.f_score_cells >= 0.85


def test_exchanged_polarizations_are_told(seen, folded):
    image = seen[2]
    other = image.isel(polarization=[1, 0]).assign_coords(polarization=image["polarization"])
    said = "TE and TM seem to be exchanged"
    assert said in mf.fold(other).attrs["remark"]
    assert said not in folded.attrs["remark"]


def test_doors_that_only_what_stands_behind_them_tells_are_asked_too(seen, monkeypatch):
    scene, sweep, image = seen
    monkeypatch.setattr(lines, "MINIMUM_CELLS", 30.0)  # 0.94 m, longer than the door
    monkeypatch.setattr(short_rows, "OUTSHINES_DB", 0.0)  # whose face is nearly as bright as what it shows
    found = mf.fold(image, sweep=sweep)
    assert found.attrs["fold_minimum_length"] > 0.93
    assert np.isfinite(found["mirrors"].to_dataset()["thickness"].values).any()
    assert mf.score(found, scene).sides_right >= 0.95


def test_files_keep_it_and_one_polarization_decides_nothing(seen, folded, tmp_path):
    image = seen[2]
    mf.save(folded, tmp_path / "found.nc")
    kept = mf.load(tmp_path / "found.nc")["objects"].to_dataset()
    np.testing.assert_array_equal(kept["passed"].values, folded["objects"]["passed"].values)
    one = mf.fold(image.isel(polarization=0).drop_vars("polarization"))
    assert "passed" not in one["objects"]
    assert "thickness" not in one["mirrors"]


def test_where_the_wall_is_not_known_no_point_is_surer_than_its_side(seen, plan, monkeypatch):
    scene, cut_out, asked_about = seen[0], transparent.pairs_of, list[np.ndarray]()

    def noted(view, images, echoes, mirror):
        asked_about.append(echoes.position)
        return cut_out(view, images, echoes, mirror)

    monkeypatch.setattr(transparent, "pairs_of", noted)
    monkeypatch.setattr(transparent, "AGAINST_METAL", np.inf)
    found = plan.fold(min_confidence=0.0)
    assert not any(np.array_equal(one, other) for one, other in pairwise(asked_about))  # nothing is cut out twice
    points = found["objects"].to_dataset(inherit=False)
    asked = points.isel(point=np.isfinite(points["passed"].values))
    assert asked.sizes["point"] > 20
    assert (asked["decided"] == "polarization").all()
    assert "thickness" not in found["mirrors"]
    through = asked["wall"].values != ""
    side = np.where(through, asked["passed"].values, 1.0 - asked["passed"].values)
    assert (asked["confidence"].values <= side + 1e-6).all()
    # What passed stays where the image shows it.
    assert through.any()
    assert (asked["passed"].values[through] > 0.5).all()
    np.testing.assert_array_equal(asked["x"].values[through], asked["x_initial"].values[through])
    assert mf.score(found, scene).sides_right >= 0.95


def test_points_of_other_methods_need_no_more_than_places(seen, folded):
    scene, found = seen[0], folded.copy()
    every, points = mf.score(found, scene), found["objects"].to_dataset(inherit=False)
    found["objects"] = xr.DataTree(points.drop_vars(NEEDED))
    score = mf.score(found, scene)
    assert score.points == every.points
    assert score.sides_right is None
