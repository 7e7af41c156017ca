"""What is not folded stays where the image shows it, whichever mirrors are given: switched off, moved, or drawn."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scans import ball, panel, scene
from scipy.spatial import cKDTree
from synthetic import diffuse, radar_image, together

import mirrorfold as mf
from mirrorfold.common.geometry import reflect, segment_normal
from mirrorfold.reconstruction import FoldPlan

WALLS = np.array([[[0.5, 1.8], [0.9, 0.9]], [[-0.95, 1.0], [-0.5, 1.9]]])
OBJECTS = np.array([[[-0.2, 1.9], [-0.06, 1.95]], [[0.15, 1.45], [0.28, 1.5]]])
"""The first is seen by way of the first wall, the second by way of the second."""

DIRECT = np.array([[-0.05, 1.1], [0.05, 1.1]])
"""An object in line of sight."""

SPECKLE = np.array([[-0.03, 1.35], [0.02, 1.38]])
"""Behind it, where only multiple scattering can be."""


def points(result, axes="xy"):
    """Table of the points that echoes stand for, and their places in the unfolded image (n, d) [m]."""
    objects = result.children["objects"].to_dataset(inherit=False)
    objects = objects.isel(point=~objects["interpolated"].values)
    return objects, np.stack([objects[f"{axis}_initial"].values for axis in axes], axis=-1)


def ends(result):
    held = result.children["mirrors"].to_dataset(inherit=False)
    return np.stack([held[name].values for name in ("x0", "y0", "x1", "y1")], -1).reshape(-1, 2, 2)


def ghosts_of(result, wall):
    """The points that stood behind one of the walls, about where the image shows the ghost of its object."""
    objects, place = points(result)
    seemed = reflect(OBJECTS[wall].mean(axis=0), WALLS[wall][0], segment_normal(*WALLS[wall]))
    return objects.isel(point=np.linalg.norm(place - seemed, axis=1) < 0.1), place


def held_by(places, others):
    """Whether each place (n, d) is one of the others, to the last bit."""
    return cKDTree(others).query(places)[0] == 0.0


@pytest.fixture(scope="module")
def plan():
    """Two walls, of which the second is lossy; by each an object; one in line of sight with speckle behind it."""
    parts = [diffuse(*WALLS[0], seed=0), diffuse(*WALLS[1], seed=1)]
    for i, strength in enumerate((1.0, 0.4)):
        thing = reflect(OBJECTS[i], WALLS[i][0], segment_normal(*WALLS[i]))
        parts.append(diffuse(*thing, seed=9 + i, strength=strength))
    parts += [diffuse(*DIRECT, seed=12), diffuse(*SPECKLE, seed=13, strength=0.5)]
    plan = FoldPlan(radar_image(*together(*parts), np.linspace(-2.2, 2.4, 461), np.linspace(0.3, 2.9, 261)))
    assert len(ends(plan.fold())) == 2
    return plan


@pytest.mark.slow
@pytest.mark.parametrize("without", [{"mirrors": []}, {"generations": 0}])
def test_without_mirrors_the_scene_is_the_initial_image_point_for_point(plan, without):
    found, place = points(plan.fold())
    result = plan.fold(**without)
    unfolded, seemed = points(result)
    assert_allclose(result["intensity"], result["initial/initial"], rtol=1e-6)
    assert np.array_equal(np.column_stack([unfolded["x"], unfolded["y"]]), seemed)
    assert set(unfolded["chain"].values) == {""}
    assert set(unfolded["bounces"].values) == {0}
    objects = found["surface"].values == "object"
    assert objects.sum() > 30
    assert held_by(place[objects], seemed).all()
    # The echoes of walls are moved onto their mirrors; without mirrors they stand where they were.
    assert cKDTree(seemed).query(place)[0].max() < 0.02
    # The speckle behind the object in line of sight is not folded, and stays, too.
    near = np.linalg.norm(seemed - SPECKLE.mean(axis=0), axis=1) < 0.05
    assert near.any()
    assert len(unfolded["x"]) >= len(found["x"])


@pytest.mark.slow
@pytest.mark.parametrize("off", [0, 1])
def test_with_one_wall_off_its_ghosts_return_and_the_rest_stays_folded(plan, off):
    found = plan.fold()
    lines = ends(found)
    keep = np.argmin(np.linalg.norm(lines.mean(axis=1) - WALLS[1 - off].mean(axis=0), axis=1))
    result = plan.fold(mirrors=lines[[keep]])
    returned, place = ghosts_of(result, off)
    before, _ = ghosts_of(found, off)
    assert before.sizes["point"] > 5
    assert set(before["bounces"].values) == {1}
    assert held_by(np.column_stack([before["x_initial"], before["y_initial"]]), place).all()
    assert set(returned["chain"].values) == {""}
    assert np.array_equal(returned["x"], returned["x_initial"])
    assert np.array_equal(returned["y"], returned["y_initial"])
    others, same = ghosts_of(result, 1 - off)[0], ghosts_of(found, 1 - off)[0]
    for name in ("x", "y", "bounces"):
        assert_allclose(others[name], same[name])
    # A given mirror is taken to stand where it is drawn.
    assert_allclose(others["confidence"], same["confidence"], atol=0.05)
    # Not a pixel of what is not folded has changed.
    here = {"x": before["x_initial"], "y": before["y_initial"], "method": "nearest"}
    assert_allclose(result["intensity"].sel(**here), result["initial/initial"].sel(**here), rtol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("shift", [0.02, -0.02])
@pytest.mark.parametrize("wall", [0, 1])
def test_with_a_wall_moved_its_ghosts_move_by_twice_as_much_and_none_vanishes(plan, wall, shift):
    lines = ends(plan.fold())
    moved = int(np.argmin(np.linalg.norm(lines.mean(axis=1) - WALLS[wall].mean(axis=0), axis=1)))
    normal = segment_normal(*lines[moved])
    before, _ = ghosts_of(plan.fold(), wall)
    lines[moved] += shift * normal
    after, _ = ghosts_of(plan.fold(mirrors=lines), wall)
    assert after.sizes["point"] >= before.sizes["point"]
    folded = after.isel(point=after["bounces"].values == 1)
    both = held_by(*(np.column_stack([part["x_initial"], part["y_initial"]]) for part in (before, folded)))
    assert both.mean() > 0.9
    place = {tuple(p): q for p, q in zip(
        np.column_stack([folded["x_initial"], folded["y_initial"]]), np.column_stack([folded["x"], folded["y"]]),
        strict=True)}  # fmt: skip
    for i in np.flatnonzero(both):
        one = before.isel(point=i)
        way = place[float(one["x_initial"]), float(one["y_initial"])] - np.array([float(one["x"]), float(one["y"])])
        assert_allclose(way, 2.0 * shift * normal, atol=1e-9)


@pytest.mark.slow
def test_a_wall_that_only_the_hand_knows_may_be_drawn_outward_of_its_echoes(plan):
    """No mirror is found here: what stands before a given one still hides nothing of what it shows."""
    settings = {"minimum_length": 3.0}
    assert not len(ends(plan.fold(**settings)))
    for wall in (0, 1):
        outward = segment_normal(*WALLS[wall])
        outward = outward * np.sign(WALLS[wall].mean(axis=0) @ outward)
        drawn, _ = ghosts_of(plan.fold(mirrors=[WALLS[wall] + 0.02 * outward], **settings), wall)
        assert drawn.sizes["point"] > 5
        assert set(drawn["bounces"].values) == {1}


@pytest.mark.slow
def test_objects_are_opaque_where_they_are_folded_unless_the_switch_says_no():
    """Multiple scattering behind a ghost is no object, with found mirrors and with given ones."""
    ghost = reflect(OBJECTS[0], WALLS[0][0], segment_normal(*WALLS[0]))
    speckle = 1.15 * (0.3 * ghost + 0.7 * ghost.mean(axis=0))
    parts = diffuse(*WALLS[0], seed=0), diffuse(*ghost, seed=9), diffuse(*speckle, seed=10, strength=0.5)
    view = radar_image(*together(*parts), np.linspace(-1.0, 2.8, 381), np.linspace(0.3, 2.9, 261))
    found = mf.fold(view)
    for opaque, seen in ((True, False), (False, True)):
        objects, place = points(mf.fold(view, mirrors=ends(found), opaque=opaque))
        behind = np.linalg.norm(place - speckle.mean(axis=0), axis=1) < 0.05
        assert behind.any() == seen
        assert set(objects["bounces"].values[behind]) <= {1}


@pytest.mark.slow
def test_a_volume_without_its_mirror_is_unfolded_and_a_moved_one_loses_nothing():
    world = scene(panel(), ball(), panel("board", (0.35, 1.2, 0.2), (0.0, -1.0, 0.0), 0.2, 0.2))
    plan = FoldPlan(mf.focus(mf.simulate(world, snr_db=25.0)))
    first = plan.fold(min_confidence=0.0)
    found, place = points(first, "xyz")
    objects = found["surface"].values == "object"
    hidden = found["bounces"].values == 1
    assert (hidden & objects).sum() > 30
    result = plan.fold(mirrors=[], min_confidence=0.0)
    unfolded, seemed = points(result, "xyz")
    assert set(unfolded["chain"].values) == {""}
    assert np.array_equal(np.stack([unfolded[axis].values for axis in "xyz"], -1), seemed)
    assert held_by(place[objects], seemed).all()
    assert_allclose(result["intensity"], result["initial/initial"], rtol=1e-6)
    held = first.children["mirrors"].dataset
    corners = np.stack([held[f"corner_{axis}"].values for axis in "xyz"], axis=-1)
    outward = np.array([0.5, 0.5, 0.0]) ** 0.5
    moved, there = points(plan.fold(mirrors=corners + 0.02 * outward), "xyz")
    through = moved["bounces"].values == 1
    assert held_by(place[hidden & objects], there[through]).mean() > 0.9


@pytest.mark.slow
def test_every_blob_that_is_folded_has_a_point(plan):
    """What the corrected picture shows and the initial image does not, above the pages' floor, is near a point."""
    result = plan.fold()
    objects, _ = points(result)
    folded, unfolded = result["intensity"].values, result["initial/initial"].values
    new = (folded > 1.001 * unfolded) & (folded > 0.01 * np.quantile(unfolded, 0.9995))
    rows, columns = np.nonzero(new)
    places = np.column_stack([result["x"].values[columns], result["y"].values[rows]])
    assert len(places) > 100
    stands = cKDTree(np.column_stack([objects["x"], objects["y"]])[objects["bounces"].values > 0])
    cell = np.hypot(0.03, np.linalg.norm(places, axis=1).max() * 1.5 * 0.011)
    assert stands.query(places)[0].max() < 2.0 * cell


@pytest.mark.slow
@pytest.mark.parametrize(
    ("mirrors", "said"),
    [
        ([[[450, 1500], [900, 1500]]], "the given mirror is not in the radar's sight within the image, x -"),
        ([[[0.4, -1.5], [0.9, -1.5]], [[450, 1500], [900, 1500]]], "none of the 2 given mirrors is in"),
        ([], ""),
    ],
)
def test_given_mirrors_that_the_image_does_not_hold_are_told(mirrors, said):
    image = radar_image(
        np.array([[-0.4, 0.9]]), np.array([6.0]), np.arange(-0.6, 1.7, 0.0075), np.arange(0.5, 2.3, 0.0075)
    )
    remark = mf.fold(image, mirrors=mirrors).attrs["remark"]
    assert remark.startswith(said)
    assert bool(remark) == bool(said)
    assert not mf.fold(image, generations=0).attrs["remark"]
