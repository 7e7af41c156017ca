"""A glass door with one polarization: geometry guesses what passed through it, says so, and claims no more."""

from __future__ import annotations

import numpy as np
import pytest

import mirrorfold as mf
from mirrorfold.reconstruction import FoldPlan
from mirrorfold.tree.half_transparent.guessed import GUESS, UNDECIDED

pytestmark = pytest.mark.slow

ROUGH = {"rms_height": 0.1e-3, "correlation_length": 0.2e-3}
DOOR = {"name": "door", "kind": "segment", "start": [0.29, 1.376], "end": [0.556, 1.023], "material": "glass",
        "thickness": 6e-3, "roughness": {"rms_height": 0.08e-3, "correlation_length": 0.4e-3}}  # fmt: skip
ARC = {"name": "arc", "kind": "arc", "center": [0.6, 1.85], "radius": 0.18, "start_angle": -158.0,
       "stop_angle": -20.0, "roughness": ROUGH}  # fmt: skip
CEILING = {"name": "ceiling", "kind": "segment", "start": [0.25, 2.3], "end": [0.75, 2.3],
           "roughness": {"rms_height": 0.08e-3, "correlation_length": 0.4e-3}}  # fmt: skip
DISC = {"name": "disc", "kind": "circle", "center": [0.0, 1.1], "radius": 0.08, "roughness": ROUGH}
RADAR = {
    "name": "one",
    "array": {"elements": 81, "pitch": 1.15e-3},
    "band": {"start": 116e9, "stop": 128e9, "points": 301},
}
GRID = {"x": np.arange(-0.6, 1.4, 0.006), "y": np.arange(0.5, 3.3, 0.006)}


def measured(*surfaces):
    """What a scene of these surfaces is folded from."""
    scene = mf.parse_scene(RADAR | {"surface": list(surfaces)})
    sweep = mf.simulate(scene, bounces=1, snr_db=20.0)
    return FoldPlan(mf.focus(sweep, tolerance=1e-3, **GRID), sweep=sweep)


def folded(*surfaces):
    return measured(*surfaces).fold()["objects"].to_dataset()


@pytest.fixture(scope="module")
def whole():
    """An arc behind the door that a mirror behind both shows, too, and before it a disc seen directly and in it."""
    return measured(DOOR, ARC, CEILING, DISC)


@pytest.fixture(scope="module")
def result(whole):
    return whole.fold()


@pytest.fixture(scope="module")
def points(result):
    return result["objects"].to_dataset()


def test_what_another_mirror_shows_behind_the_wall_is_guessed_to_have_passed(points):
    through = points["wall"].values != ""
    assert through.any()
    assert (points["decided"].values[through] == "geometry").all()
    np.testing.assert_allclose(points["passed"].values[through], GUESS)
    assert (points["bounces"].values[through] == 0).all()
    center = ARC["center"]
    away = np.abs(np.hypot(points["x"].values - center[0], points["y"].values - center[1])[through] - ARC["radius"])
    assert np.median(away) < 0.02
    assert points["confidence"].values[through].max() <= GUESS + 1e-6


def test_whoever_reads_the_result_is_told_that_it_is_a_guess(result, points):
    asked = (points["decided"].values == "geometry") & (
        points["confidence"].values >= result.attrs["fold_min_confidence"]
    )
    (remark,) = mf.info(result).remarks
    assert f"hether {np.count_nonzero(asked)} points passed through a wall or were reflected is a guess" in remark
    assert mf.info(result).points_through_walls > 0


def test_what_is_seen_directly_where_it_folds_to_was_reflected(points):
    """The disc's image in the door folds onto the disc."""
    away = np.hypot(points["x"].values - DISC["center"][0], points["y"].values - DISC["center"][1])
    shown = (away < 2.0 * DISC["radius"]) & (points["bounces"].values == 1)
    assert shown.any()
    assert (points["passed"].values[shown] <= UNDECIDED).all()
    assert (points["wall"].values[shown] == "").all()


def test_what_the_radar_sees_nowhere_else_is_taken_for_reflected():
    """A smooth object may be seen in a mirror alone: that nothing is seen at its place is no reason to doubt."""
    assert "passed" not in folded(DOOR, ARC)


def test_a_wall_that_shows_nothing_impossible_stays_a_mirror(whole):
    metal = {name: value for name, value in DOOR.items() if name not in ("material", "thickness")}
    points = folded(metal, DISC)
    assert (points["bounces"] == 1).any()
    assert "passed" not in points
    assert "passed" not in whole.fold(transparent=False)["objects"].to_dataset()
