"""Folding volumes, from the scan to the picture: known scenes, the symmetries of space, a slow twin of the kernel."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
import xarray as xr
from numpy.testing import assert_allclose
from scans import BOARD, FREQUENCY, SPOT, STEEL, ball, panel, periscope, point_sweep, scene, turned
from scipy.ndimage import map_coordinates

import mirrorfold as mf
from mirrorfold.common.beams import beam_angles
from mirrorfold.common.types import ROOT
from mirrorfold.detection import find_echoes, see, usual_settings
from mirrorfold.focusing.scans.range_profiles import focus_raster
from mirrorfold.folding import FoldSettings
from mirrorfold.folding.pictures import draw
from mirrorfold.folding.points import fold_back, owned_blobs
from mirrorfold.sweep import make_raster_sweep
from mirrorfold.tree.rounds import find_tree


def folded(world, *, bounces=3, seed=0, snr_db=25.0, **settings):
    return mf.fold(mf.focus(mf.simulate(world, bounces=bounces, seed=seed, snr_db=snr_db)), **settings)


def points_of(reconstruction, bounces=None):
    objects = reconstruction.children["objects"].dataset
    points = np.stack([objects[axis].values for axis in "xyz"], axis=-1)
    return (
        points if bounces is None else points[(objects["bounces"].values == bounces) & (objects["surface"] == "object")]
    )


def test_noise_alone_gives_no_echo():
    generator = np.random.default_rng(1)
    s = generator.standard_normal((401, 25, 25, 2)) @ [1.0, 1.0j]
    angle = np.linspace(-3.0, 3.0, 25)
    sweep = make_raster_sweep(s, frequency=FREQUENCY, azimuth=angle, elevation=angle, **SPOT)
    result = mf.reconstruct(sweep)
    assert result.children["objects"].sizes["point"] == 0
    assert result.children["mirrors"].sizes["mirror"] == 0
    assert "no mirror was found" in result.attrs["remark"]


@pytest.mark.parametrize("angle", [90.0, 180.0, -175.0, 500.0])
def test_a_scan_that_looks_back_folds_and_draws_as_one_that_looks_ahead(angle):
    ahead = mf.focus(point_sweep((0.03, 1.2, 0.05), (0.03, 1.23, 0.05), (-0.03, 1.5, -0.05), noise=1e-3))
    here, there = mf.fold(ahead), mf.fold(ahead.assign_coords(azimuth=ahead["azimuth"] + angle))
    assert_allclose(points_of(there), [turned({"center": p}, angle)["center"] for p in points_of(here)], atol=1e-9)
    confidence = [result["objects/confidence"] for result in (here, there)]
    assert_allclose(confidence[1], confidence[0], atol=1e-3)
    for picture in (lambda result: result["intensity"], lambda result: result["initial/initial"]):
        assert float(picture(there).max()) == pytest.approx(float(picture(here).max()), rel=0.3)


def wall_world(angle=0.0, lean=0.0, half=8.0, **settings):
    """A board turned by 45 degrees that shows a ball to the left."""
    normal = (-np.sqrt(0.5) * np.cos(lean), -np.sqrt(0.5) * np.cos(lean), np.sin(lean))
    things = [panel("wall", (0.0, 2.0, 0.0), normal, 2.0, 1.6, **BOARD), ball("ball", (-1.1, 2.0, 0.0), 0.16)]
    return scene(*(turned(thing, angle) for thing in things), half=half, azimuth=angle, **settings)


@pytest.mark.slow
@pytest.mark.parametrize("lean_deg", [0.0, 5.0, -8.0])
def test_a_wall_at_any_tilt_folds_the_ball_home(lean_deg):
    world = wall_world(lean=np.radians(lean_deg))
    score = mf.score(folded(world), world)
    assert [row["surface"] for row in score["mirrors"]] == ["wall"]
    assert score["mirrors"][0]["angle_error_deg"] < 0.15
    assert score["mirrors"][0]["offset_error_mm"] < 5.0
    assert score["surfaces"]["ball"]["points"] > 30
    assert score["surfaces"]["ball"]["accuracy_m"] < 0.006
    assert score["hidden"]["false_fraction"] == 0.0
    assert score["surfaces"]["ball"]["completeness_3cm"] > 0.95


@pytest.mark.slow
def test_a_thick_wall_is_found_at_its_face():
    """Volume scattering moves the centroid of the echoes inside, not the mirror."""
    for depth in (0.0, 0.03):
        finish = BOARD | {"volume_depth": depth}
        world = scene(panel("wall", (0.0, 2.0, 0.0), (-1, -1, 0), 2.0, 1.6, **finish), half=6.0, beams=31)
        (row,) = mf.score(folded(world, bounces=0), world)["mirrors"]
        assert row["offset_error_mm"] < 3.0
        assert row["angle_error_deg"] < 0.15


@pytest.mark.slow
def test_turning_the_scene_turns_the_result():
    here, there = folded(wall_world()), folded(wall_world(angle=20.0))
    found = here.children["mirrors"].dataset, there.children["mirrors"].dataset
    normals = [np.array([float(mirrors[f"folded_normal_{a}"][0]) for a in "xyz"]) for mirrors in found]
    assert beam_angles(-normals[1])[0] - beam_angles(-normals[0])[0] == pytest.approx(20.0, abs=0.1)
    middle = [points_of(result, 1).mean(axis=0) for result in (here, there)]
    expected = turned({"center": middle[0]}, 20.0)["center"]
    assert np.linalg.norm(middle[1] - expected) < 0.008


@pytest.mark.slow
def test_three_bounces_come_home():
    world = scene(*periscope())
    volume = mf.focus(mf.simulate(world, snr_db=25.0))
    # The scan shows 28 cm of the first mirror.
    result = mf.fold(volume, minimum_length=0.25)
    assert result["mirrors/generation"].max() == 3
    points = points_of(result, 3)
    distance = np.abs(np.linalg.norm(points - [-1.5, 1.8, 0.0], axis=1) - 0.15)
    assert len(points) > 20
    assert distance.mean() < 0.008
    score = mf.score(result, world)
    assert {row["surface"] for row in score["mirrors"]} >= {"first", "second", "third"}
    # Three mirrors deep, the last plane carries the errors of the two before it.
    assert max(row["angle_error_deg"] for row in score["mirrors"] if row["surface"]) < 0.3
    assert score["hidden"]["invented_fraction"] < 0.08


@pytest.fixture(scope="module")
def world_volume():
    """A board that shows a ball, and its volume."""
    world = wall_world()
    return world, mf.focus(mf.simulate(world, snr_db=25.0))


def corners_of(result):
    """The corners of the mirrors of a volume, (mirrors, 4, 3)."""
    mirrors = result.children["mirrors"].dataset
    return np.stack([mirrors[f"corner_{axis}"].values for axis in "xyz"], axis=-1)


@pytest.mark.slow
def test_the_planes_that_were_found_fold_to_the_same_scene_when_they_are_given(world_volume):
    world, volume = world_volume
    found = mf.fold(volume)
    given = mf.fold(volume, mirrors=corners_of(found))
    assert given.attrs["mirrors_given"]
    assert given["mirrors"].sizes["mirror"] == 1
    assert_allclose(corners_of(given), corners_of(found), atol=1e-9)
    first, second = (mf.score(result, world)["surfaces"]["ball"] for result in (found, given))
    assert second["points"] == pytest.approx(first["points"], rel=0.02)
    assert second["accuracy_m"] == pytest.approx(first["accuracy_m"], abs=2e-4)


def test_the_tree_of_a_volume_shows_itself(world_volume):
    _, volume = world_volume
    view = see(volume)
    echoes = find_echoes(view)
    tree = find_tree(view, echoes, FoldSettings().completed(**usual_settings(view, echoes))).tree
    size = f"{tree.mirrors[0].mirror.size:.2f} m"
    assert size in repr(tree)
    assert size in tree._repr_html_()
    assert json.loads(tree.to_json())["mirrors"][0]["line"]["start"][1] == tree.mirrors[0].mirror.ends[0, 1]


def test_a_plane_behind_the_scanner_shows_nothing():
    behind = [[-0.5, -2.0, -0.5], [0.5, -2.0, -0.5], [0.5, -2.0, 0.5], [-0.5, -2.0, 0.5]]
    assert mf.fold(mf.focus(point_sweep((0.03, 1.2, 0.05))), mirrors=[behind])["mirrors"].sizes["mirror"] == 0


@pytest.mark.slow
def test_a_moved_plane_moves_what_it_shows_by_twice_as_much(world_volume):
    _, volume = world_volume
    corners = corners_of(mf.fold(volume))
    shift = 0.02 * np.array([-np.sqrt(0.5), -np.sqrt(0.5), 0.0])
    here, there = (points_of(mf.fold(volume, mirrors=corners + move), 1) for move in (0.0, shift))
    ball = [np.median(points, axis=0) for points in (here, there)]
    assert_allclose(ball[1] - ball[0], 2.0 * shift, atol=0.006)


@pytest.mark.slow
def test_without_generations_a_volume_stays_unfolded(world_volume):
    _, volume = world_volume
    result = mf.fold(volume, generations=0)
    assert result["mirrors"].sizes["mirror"] == 0
    assert set(result["objects/bounces"].values) == {0}
    objects = result.children["objects"].dataset
    assert_allclose(objects["x"], objects["x_initial"], atol=1e-12)


@pytest.mark.slow
def test_the_published_algorithm_runs_on_volumes(world_volume):
    """It takes every bright sample for an object; its mirror is the wall all the same, and the ball comes home."""
    world, volume = world_volume
    result = mf.fold(volume, preset="published")
    score = mf.score(result, world)
    assert result.attrs["preset"] == "published"
    assert result.attrs["fold_normalization"] == "r2"
    assert "wall" in {row["surface"] for row in score["mirrors"]}
    assert score["surfaces"]["ball"]["points"] > 30
    assert score["surfaces"]["ball"]["accuracy_m"] < 0.02


@pytest.mark.slow
def test_the_wall_margin_acts_on_the_picture_of_a_volume_too(world_volume):
    """With a margin that reaches to the ball's image, neither points nor pixels of it are left."""
    _, volume = world_volume
    plan = mf.FoldPlan(volume)
    grid = np.linspace(-1.5, 0.5, 101), np.linspace(1.0, 2.8, 91), np.linspace(-0.3, 0.3, 21)
    for margin, bright in ((0.04, True), (1.5, False)):
        result = plan.fold(wall_margin=margin, grid=grid)
        at_the_ball = result["intensity"].sel(x=slice(-1.3, -0.9), y=slice(1.8, 2.2))
        assert (float(at_the_ball.max()) > 0.0) == bright
        assert (len(points_of(result, 1)) > 0) == bright


@pytest.mark.slow
def test_the_kernel_draws_a_volume_as_its_slow_twin_does(world_volume):
    """The voxels by array arithmetic in float64, on a few of them."""
    _, volume = world_volume
    view = see(volume)
    echoes = find_echoes(view)
    found = find_tree(view, echoes, FoldSettings().completed(**usual_settings(view, echoes)))
    x, y, z = np.linspace(-1.4, 0.6, 23), np.linspace(1.2, 2.6, 19), np.array([-0.1, 0.0, 0.1])
    blobs = owned_blobs(fold_back(found.tree), found.sight)
    drawn = draw(found.sight, 0.04, (x, y, z), blobs)
    grid = np.stack(np.meshgrid(x, y, z, indexing="ij"), axis=-1).reshape(-1, 3)
    expected = np.zeros(len(grid))
    for number in (ROOT, *found.sight.ways):
        back = found.sight.fold(number).inverse(grid)
        range_, beam, inside = view.locate(back)
        azimuth, elevation = beam_angles(back - view.radar)
        place = [
            (azimuth - view.azimuth[0]) / np.diff(view.azimuth).mean(),
            (elevation - view.elevation[0]) / np.diff(view.elevation).mean(),
            (range_ - view.range[0]) / view.dr,
        ]
        edge = [(p >= 0.0) & (p <= n - 1) for p, n in zip(place, view.amplitude.shape, strict=True)]
        value = map_coordinates(view.amplitude.astype(float), place, order=1)
        value = value * view.gain[np.clip(place[2].astype(int), 0, view.range.size - 1)]
        seen = inside & np.logical_and.reduce(edge) & (found.sight.seen_through(range_ - 0.04, beam) == number)
        seen &= found.sight.cover.clear(range_, beam, value)
        if number != ROOT:
            sample = np.clip(np.rint(place[2]).astype(int), 0, view.range.size - 1)
            seen &= blobs[beam, sample] == number
            own, ahead, looked = view.locate(grid)
            sides = [found.sight.seen_through(range_ - 0.04, side) == number for side in view.beside(range_, beam)]
            seen &= ~(looked & (own < found.sight.empty_up_to[ahead])) | np.logical_and.reduce(sides)
        expected = np.maximum(expected, np.where(seen, value, 0.0))
    expected = expected.reshape(x.size, y.size, z.size).transpose(2, 1, 0)
    assert np.count_nonzero(expected) > 50
    close = np.abs(drawn - expected) <= 1e-3 * expected.max()
    assert close.mean() > 0.995  # a voxel on the border between two beams may belong to either


@pytest.mark.slow
def test_a_result_explains_itself_and_survives_the_disk(tmp_path):
    result = folded(wall_world())
    again = mf.load(mf.save(result, tmp_path / "result.nc"))
    for group in ("objects", "mirrors"):
        xr.testing.assert_equal(
            result.children[group].to_dataset(inherit=False), again.children[group].to_dataset(inherit=False)
        )
    objects = again.children["objects"].dataset
    assert set(np.unique(objects["chain"])) == {"", "0"}
    assert ((objects["confidence"] >= 0) & (objects["confidence"] <= 1)).all()
    assert float(again["intensity"].max()) > 0.0
    assert mf.info(again)["points_by_bounces"].keys() == {"0", "1"}
    # The picture of the true scene shows the ball where it stands.
    near = again["intensity"].sel(x=slice(-1.3, -0.9), y=slice(1.8, 2.2))
    assert float(near.max()) > 0.2 * float(again["intensity"].max()) * 0.1


@pytest.mark.slow
def test_no_mirror_no_folding():
    world = scene(ball("ball", (0.1, 2.5, 0.0), 0.2), half=6.0, beams=31)
    result = folded(world)
    assert re.match(
        r"no mirror was found: no flat sheet of echoes is .* m wide and as much high", result.attrs["remark"]
    )
    assert set(result.children["objects"]["bounces"].values) == {0}
    assert np.abs(np.linalg.norm(points_of(result) - [0.1, 2.5, 0.0], axis=1) - 0.2).mean() < 0.008


def test_what_stands_behind_an_object_is_no_object():
    """Objects are opaque: in the beams of one in front, later echoes are dropped."""
    sweep = point_sweep((0.0, 1.2, 0.0), (0.0, 1.5, 0.0), (0.06, 1.5, 0.0), noise=0.003)
    points = points_of(mf.reconstruct(sweep))
    ranges = np.linalg.norm(points[np.abs(points[:, 0]) < 0.008], axis=1)
    assert ranges.max() < 1.3
    assert np.any((points[:, 0] > 0.05) & (points[:, 1] > 1.45))


@pytest.mark.parametrize(
    ("kept", "match"),
    [
        ({"elevation": slice(1)}, "beams at 1 elevation, expected at least 4"),
        ({"azimuth": slice(3)}, "beams at 3 azimuths"),
        ({"azimuth": [0, 1, 3, 4, 5]}, "azimuth does not rise in equal steps"),
    ],
)
def test_a_scan_that_cannot_be_folded_is_refused_before_it_is_focused(kept, match):
    def focusing(done, total):
        raise AssertionError("the scan was focused")

    scan = point_sweep((0.0, 1.2, 0.0)).isel(kept)
    with pytest.raises(mf.InputError, match=match):
        mf.reconstruct(scan, progress=focusing)


def test_wrong_volumes_and_settings_are_refused():
    volume = focus_raster(point_sweep((0.0, 1.2, 0.0)), limits=(1.0, 1.4))
    with pytest.raises(mf.InputError, match="every pixel is zero"):
        mf.fold(volume * 0.0)
    with pytest.raises(mf.InputError, match="not finite"):
        mf.fold(volume.where(volume["range"] > 1.2))
    with pytest.raises(mf.InputError, match="at least 4 pixels"):
        mf.fold(volume[:, :2])
    with pytest.raises(mf.InputError, match="normalization is 'r3'"):
        mf.fold(volume, normalization="r3")
    with pytest.raises(mf.InputError, match="spot_radius"):
        mf.fold(volume.drop_attrs(), normalization="beam")
    with pytest.raises(mf.InputError, match="four corners of planes"):
        mf.fold(volume, mirrors=[[[0.0, 1.0], [0.5, 1.5]]])
    with pytest.raises(mf.InputError, match="not flat"):
        mf.fold(volume, mirrors=[[[0, 1, 0], [1, 1, 0], [1, 1, 1], [0, 2, 1]]])
    for around in ({"center": [0, 0, 0], "radius": 1}, {"start": [0, 0, -1], "end": [0, 0, 1], "radius": 1}):
        with pytest.raises(mf.InputError, match="mirror 0 is around the radar"):
            mf.fold(volume, mirrors=[around])
    assert (
        "not in the radar's sight" in mf.fold(volume, mirrors=[{"center": [0, -2, 0], "radius": 0.5}]).attrs["remark"]
    )
    with pytest.raises(mf.InputError, match="minimum_length is -1"):
        mf.fold(volume, minimum_length=-1.0)
    sweep = point_sweep((0.0, 1.2, 0.0))
    for arguments, complaint in (
        ({"limits": (1.0, 0.5)}, "rising ranges"), ({"padding": 0}, "padding"), ({"normalization": "r"}, "one of"),
        ({"limits": (1.0, 1.001)}, "less than four samples"),
    ):  # fmt: skip
        with pytest.raises(mf.InputError, match=complaint):
            focus_raster(sweep, **arguments)
    with pytest.raises(mf.InputError, match="all three or on none"):
        mf.focus(sweep, x=[0.0, 0.1])
    with pytest.raises(mf.InputError, match="not finite"):
        mf.focus(sweep.assign(s=sweep["s"] * np.nan))


@pytest.mark.slow
def test_a_lossy_wall_still_shows_what_is_behind_the_corner():
    world = scene(panel("wall", (0.0, 2.0, 0.0), (-1, -1, 0), 2.0, 1.6, **(BOARD | {"loss_db": 4.0})),
                  ball("ball", (-1.1, 2.0, 0.0), 0.16), half=6.0, beams=31)  # fmt: skip
    assert len(points_of(folded(world), 1)) > 20


@pytest.mark.slow
def test_a_steel_wall_is_a_mirror_too():
    world = scene(panel("wall", (0.0, 2.0, 0.0), (-1, -1, 0), 2.0, 1.6, **STEEL), ball("ball", (-1.1, 2.0, 0.0), 0.16),
                  half=6.0, beams=31)  # fmt: skip
    score = mf.score(folded(world), world)
    assert score["surfaces"]["ball"]["accuracy_m"] < 0.006


@pytest.mark.slow
def test_a_scan_without_noise_folds_as_one_with_noise():
    """Far below the echoes, numerical dust is no echo either."""
    world = wall_world()
    result = mf.fold(mf.focus(mf.simulate(world)))
    score = mf.score(result, world)
    assert [row["surface"] for row in score["mirrors"]] == ["wall"]
    assert score["surfaces"]["ball"]["accuracy_m"] < 0.006
    assert score["hidden"]["invented_fraction"] < 0.02


def test_the_sweep_of_a_scan_adds_nothing_and_that_of_another_is_refused():
    sweep = point_sweep((0.0, 3.0, 0.0), (0.05, 3.1, 0.0))
    volume = mf.focus(sweep)
    xr.testing.assert_identical(mf.fold(volume, sweep=sweep), mf.fold(volume))
    slower = sweep.assign_coords(frequency=sweep["frequency"] - 20e9)
    with pytest.raises(mf.InputError, match="of another radar than the image"):
        mf.fold(volume, sweep=slower)
