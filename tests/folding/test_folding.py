"""The whole of steps 2 to 6 on images, and the Reconstruction that they leave."""

from __future__ import annotations

import gc
import pickle
import weakref

import numpy as np
import pytest
import xarray as xr
from numpy.testing import assert_allclose, assert_array_equal
from seen_scenes import nearest
from synthetic import diffuse, radar_image, together

import mirrorfold as mf
from mirrorfold.common.geometry import cross2, reflect, segment_normal
from mirrorfold.folding import PRESETS
from mirrorfold.reconstruction import FoldPlan
from mirrorfold.scenes.floor_plan import parse_scene

WALL = np.array([[0.75, 0.9], [0.45, 1.7]])
GHOSTS = np.array([[0.9, 1.6], [0.95, 1.9], [0.8, 1.8]])
"""Side by side as seen from the radar: none hides another."""
TARGETS = reflect(GHOSTS, WALL[0], segment_normal(*WALL))
LONE = np.array([[-0.4, 0.9]])


def grid():
    return np.arange(-0.6, 1.7, 0.0075), np.arange(0.5, 2.3, 0.0075)


@pytest.fixture(scope="module")
def view():
    """What a radar sees of a wall, of targets by way of it, and of a lone point directly."""
    return radar_image(*together(diffuse(*WALL, 1), (GHOSTS, np.array([8.0, 8.0j, -8.0])), (LONE, [6.0])), *grid())


@pytest.fixture(scope="module")
def folded(view):
    return mf.fold(view)


def places(objects, suffix=""):
    return np.stack([objects[f"x{suffix}"].values, objects[f"y{suffix}"].values], axis=-1)


def line(mirrors, i, prefix=""):
    return np.array([[float(mirrors[f"{prefix}{axis}{end}"][i]) for axis in "xy"] for end in "01"])


def test_what_was_seen_in_the_wall_comes_out_in_front_of_it(folded):
    objects, mirrors = folded["objects"].dataset, folded["mirrors"].dataset
    assert mirrors.sizes["mirror"] == 1
    assert np.abs(cross2(WALL[1] - WALL[0], line(mirrors, 0) - WALL[0])).max() < 0.001
    thing = objects["surface"].values == "object"
    by_mirror = objects["bounces"].values == 1
    assert set(np.unique(objects["bounces"].values)) == {0, 1}
    assert nearest(places(objects)[thing & by_mirror], TARGETS).max() < 0.025
    assert nearest(places(objects)[thing & ~by_mirror], LONE).max() < 0.02
    assert nearest(TARGETS, places(objects)).max() < 0.003
    # The face of the wall is seen directly.
    assert not by_mirror[~thing].any()
    assert thing.sum() + 50 < objects.sizes["point"]


def test_the_corrected_image_shows_targets_in_front_of_the_wall_and_no_ghosts(folded):
    intensity, initial = folded["intensity"], folded["initial/initial"]

    def brightest(image, place):
        x, y = place
        return float(image.sel(x=slice(x - 0.01, x + 0.01), y=slice(y - 0.01, y + 0.01)).max())

    for target, ghost in zip(TARGETS, GHOSTS, strict=True):
        # A pixel and the samples of the radar's view next to it may both lie off the peak.
        assert 6.4 < brightest(intensity, target) < 8.2
        assert 6.4 < brightest(initial, ghost) < 8.2
        assert brightest(intensity, ghost) == 0.0
        assert brightest(initial, target) < 0.2
    assert 4.8 < brightest(intensity, LONE[0]) < 6.2
    assert brightest(intensity, LONE[0]) == brightest(initial, LONE[0])


def test_a_reconstruction_holds_what_it_promises(folded, view):
    assert set(folded.children) == {"initial", "objects", "mirrors"}
    root, objects, mirrors = folded.dataset, folded["objects"].dataset, folded["mirrors"].dataset
    assert root["intensity"].dims == folded["initial/initial"].dims == ("y", "x")
    for axis in "xy":
        step = np.diff(root[axis].values)
        assert_allclose(step, 0.0075, rtol=1e-9)
        assert root[axis].attrs["units"] == "m"
        assert_array_equal(root[axis].values, folded["initial"][axis].values)
        # The image's own pixels stay where they are.
        assert np.abs(root[axis].values[:, None] - view[axis].values).min(axis=0).max() < 1e-9
    assert set(objects.variables) == {
        "x", "y", "x_initial", "y_initial", "amplitude", "bounces", "chain", "surface", "confidence",
        "x_error", "y_error", "explanation", "confocal", "interpolated",
    }  # fmt: skip
    assert all(variable.dims == ("point",) for variable in objects.variables.values())
    assert set(objects.coords) == {"x", "y"}
    assert objects["bounces"].dtype == np.int32
    assert set(objects["surface"].values) == {"object", "mirror"}
    confidence = objects["confidence"].values
    assert confidence.min() >= 0.0
    assert 0.9 < confidence.max() <= 1.0
    assert set(mirrors.data_vars) == {
        *(f"{prefix}{axis}{end}" for prefix in ("", "folded_") for axis in "xy" for end in "01"),
        *("parent", "generation", "chain", "confidence", "strength", "angle_error", "offset_error", "fill", "depth"),
        *("folded_angle_error", "folded_offset_error"),
    }
    assert all(variable.dims == ("mirror",) for variable in mirrors.data_vars.values())
    assert folded.attrs["mirrorfold_kind"] == "reconstruction"
    assert folded.attrs["mirrorfold_version"] == mf.__version__
    assert folded.attrs["preset"] == "default"
    assert folded.attrs["remark"] == ""
    assert (folded.attrs["radar_x"], folded.attrs["radar_y"]) == (0.0, 0.0)
    assert folded.attrs["fold_normalization"] == "r"
    assert folded.attrs["image_frequency_points"] == view.attrs["frequency_points"]
    assert 0.0 < folded.attrs["threshold"] < folded.attrs["reference"]
    assert objects["amplitude"].values[objects["surface"].values == "object"].min() >= folded.attrs["threshold"]


def test_points_and_mirrors_agree_on_their_origin(folded):
    objects, mirrors = folded["objects"].dataset, folded["mirrors"].dataset
    chain = objects["chain"].values
    assert_array_equal(objects["bounces"].values, [0 if not c else len(c.split("/")) for c in chain])
    assert set(chain) <= {"", *mirrors["chain"].values}
    # Each point is the mirror image of where it was seen, in the one mirror there is.
    start, end = line(mirrors, 0)
    image = reflect(places(objects, "_initial"), start, segment_normal(start, end))
    expected = np.where((chain == "0")[:, None], image, places(objects, "_initial"))
    assert_allclose(places(objects), expected, atol=1e-12)
    assert_array_equal(line(mirrors, 0), line(mirrors, 0, "folded_"))


# A mirror at true places in front of another: seen through `outer` a wall at `inner`, and targets through both.
OUTER = np.array([[-0.35, 0.9], [0.3, 1.5]])
INNER = np.array([[0.8, 0.95], [1.35, 1.65]])
DEEP = np.array([[0.7, 1.75], [0.8, 1.85]])


@pytest.fixture(scope="module")
def twice():
    ghost = reflect(INNER, OUTER[0], segment_normal(*OUTER))
    deep = reflect(reflect(DEEP, INNER[0], segment_normal(*INNER)), OUTER[0], segment_normal(*OUTER))
    x, y = np.arange(-0.9, 0.9, 0.0075), np.arange(0.4, 3.0, 0.0075)
    return mf.fold(radar_image(*together(diffuse(*OUTER, 1), diffuse(*ghost, 2), (deep, [15.0, 15.0j])), x, y))


def test_folding_by_a_chain_is_reflecting_in_each_of_its_lines_the_last_first(twice):
    objects, mirrors = twice["objects"].dataset, twice["mirrors"].dataset
    assert mirrors["chain"].values.tolist() == ["0", "0/0"]
    lines = {"": (), "0": (line(mirrors, 0),), "0/0": (line(mirrors, 1), line(mirrors, 0))}
    chains = objects["chain"].values
    assert set(chains) == set(lines)
    for chain, ghosts in lines.items():
        mine = chains == chain
        expected = places(objects, "_initial")[mine]
        for start, end in ghosts:
            expected = reflect(expected, start, segment_normal(start, end))
        assert_allclose(places(objects)[mine], expected, atol=1e-12)
    assert nearest(places(objects)[chains == "0/0"], DEEP).max() < 0.03
    assert nearest(DEEP, places(objects)[chains == "0/0"]).max() < 0.004


def test_parents_and_generations_fit_together(twice):
    mirrors = twice["mirrors"].dataset
    for i, (parent, generation, chain) in enumerate(
        zip(mirrors["parent"].values, mirrors["generation"].values, mirrors["chain"].values, strict=True)
    ):
        assert generation == len(chain.split("/"))
        assert parent < i
        if parent < 0:
            assert generation == 1
        else:
            assert mirrors["generation"].values[parent] == generation - 1
            assert mirrors["chain"].values[parent] == chain.rpartition("/")[0]
            start, end = line(mirrors, parent)
            assert_allclose(line(mirrors, i, "folded_"), reflect(line(mirrors, i), start, segment_normal(start, end)))
    assert mirrors.sizes["mirror"] == 2


def test_the_grid_grows_to_hold_what_folds_to_outside_of_it(twice):
    assert twice["x"].values[0] == pytest.approx(-0.9)
    assert twice["x"].values[-1] >= 1.3
    objects = twice["objects"].dataset
    assert objects["x"].values.max() <= twice["x"].values[-1] + 0.0075
    assert_allclose(np.diff(twice["x"].values), 0.0075, rtol=1e-9)


@pytest.mark.slow
def test_a_reconstruction_survives_the_disk(folded, tmp_path):
    path = tmp_path / "reconstruction.nc"
    mf.save(folded, path)
    again = mf.load(path)
    assert set(again.children) == set(folded.children)
    for name in ("/", "initial", "objects", "mirrors"):
        before, after = folded[name].to_dataset(), again[name].to_dataset()
        xr.testing.assert_equal(after, before)
        for variable in before.variables:
            assert after[variable].attrs == before[variable].attrs
            assert after[variable].dtype.kind == before[variable].dtype.kind
    assert set(again.attrs) >= set(folded.attrs)
    for key, value in folded.attrs.items():
        assert_array_equal(again.attrs[key], value)


def test_a_radar_that_looks_down_steeply_seeks_no_mirrors_but_uses_given_ones(view):
    """Half of the echoes are up to 1.4 m away. Seen from 0.3 m above the image is a floor plan, from 1 m it is none."""
    levels = abs(view)
    low, high = levels.assign_coords(z=-0.3), levels.assign_coords(z=-1.0)
    assert mf.fold(low)["mirrors"].sizes["mirror"] == 1
    unfolded = mf.fold(high)
    assert not unfolded["mirrors"].sizes["mirror"]
    assert not unfolded["objects"]["bounces"].any()
    assert "the radar looks down by 35 degrees" in unfolded.attrs["remark"]
    assert mf.fold(high, mirrors=[WALL])["mirrors"].sizes["mirror"] == 1
    assert not mf.fold(high, generations=0).attrs["remark"]


def test_an_image_without_mirrors_stays_unfolded_and_says_so():
    image = radar_image(LONE, np.array([6.0]), *grid())
    result = mf.fold(image)
    assert "no mirror was found" in result.attrs["remark"]
    assert "unfolded" in result.attrs["remark"]
    objects = result["objects"].dataset
    assert result["mirrors"].dataset.sizes["mirror"] == 0
    assert objects.sizes["point"] > 0
    assert_array_equal(places(objects), places(objects, "_initial"))
    assert set(objects["chain"].values) == {""}
    intensity, initial = result["intensity"].values, result["initial/initial"].values
    near = np.hypot(result["x"].values - LONE[0, 0], result["y"].values[:, None] - LONE[0, 1]) < 0.05
    assert_array_equal(intensity[near], initial[near])
    assert intensity[near].max() > 5.0
    assert_array_equal(result["x"].values, image["x"].values)


@pytest.mark.slow
def test_an_image_of_nothing_folds_to_nothing(tmp_path):
    result = mf.fold(radar_image(np.empty((0, 2)), np.empty(0), *grid()))
    assert result["objects"].dataset.sizes["point"] == 0
    assert result["mirrors"].dataset.sizes["mirror"] == 0
    assert not result["intensity"].values.any()
    mf.save(result, tmp_path / "nothing.nc")
    assert mf.load(tmp_path / "nothing.nc")["objects"].dataset.sizes["point"] == 0


@pytest.mark.slow
def test_the_amplitude_of_an_image_is_enough_and_its_unit_nothing(view, folded):
    for image in (np.abs(view), 1e-6 * view):
        result = mf.fold(image.assign_attrs(view.attrs))
        mirrors = result["mirrors"].dataset
        assert mirrors.sizes["mirror"] == 1
        assert_allclose(line(mirrors, 0), line(folded["mirrors"].dataset, 0), atol=0.01)
        objects = result["objects"].dataset
        hidden = places(objects)[(objects["bounces"].values == 1) & (objects["surface"].values == "object")]
        assert nearest(TARGETS, hidden).max() < 0.006
        assert nearest(hidden, TARGETS).max() < 0.03


def test_the_published_algorithm_runs_and_its_settings_are_recorded(view, folded):
    result = mf.fold(view, preset="published")
    assert result.attrs["preset"] == "published"
    assert result.attrs["fold_normalization"] == "r2"
    assert result.attrs["fold_threshold_db"] == -30.0
    assert not result.attrs["fold_opaque"]
    assert result["mirrors"].dataset.sizes["mirror"] >= 1
    # Every pixel above the threshold is a point: many times as many.
    objects = result["objects"].dataset
    assert objects.sizes["point"] > 3 * folded["objects"].dataset.sizes["point"]
    assert_array_equal(np.unique(objects["amplitude"].values), 1.0)
    assert nearest(TARGETS, places(objects)[objects["bounces"].values == 1]).max() < 0.03


def test_settings_take_the_place_of_the_presets(view):
    result = mf.fold(view, minimum_length=1.5, threshold_db=-10.0, wall_margin=0.0, normalization="none")
    assert result.attrs["remark"]
    assert result.attrs["fold_minimum_length"] == 1.5
    assert result.attrs["fold_wall_margin"] == 0.0
    assert result.attrs["fold_normalization"] == "none"
    assert result.attrs["threshold"] == pytest.approx(result.attrs["reference"] * 10.0**-0.5)
    assert result.attrs["fold_opaque"] == PRESETS["default"].opaque


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"preset": "best"}, "preset is 'best', expected one of default, published"),
        ({"normalization": "beam"}, "normalization is 'beam', expected one of none, r, r2"),
        ({"threshold_db": np.nan}, "threshold_db is nan, expected a finite number"),
        ({"minimum_length": 0.0}, "minimum_length is 0.0, expected"),
        ({"minimum_length": np.inf}, "minimum_length is inf, expected"),
        ({"wall_margin": -0.01}, "wall_margin is -0.01, expected"),
    ],
)
def test_a_wrong_setting_is_refused_by_its_name_and_value(view, arguments, message):
    with pytest.raises(mf.InputError, match=message):
        mf.fold(view, **arguments)


def test_an_image_with_missing_pixels_is_refused(view):
    values = view.values.copy()
    values[:2, 7] = np.nan
    with pytest.raises(mf.InputError, match=r"2 of \d+ pixels are not finite"):
        mf.fold(view.copy(data=values))


def test_progress_is_reported_to_the_end(view):
    seen = []
    mf.fold(view, progress=lambda done, total: seen.append((done, total)))
    assert seen[-1][0] == seen[-1][1]
    assert seen == sorted(seen)


def moved(points, angle, shift):
    """Turned about the origin by an angle [degree], then shifted."""
    cosine, sine = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    return np.asarray(points) @ np.array([[cosine, sine], [-sine, cosine]]) + shift


def undone(points, angle, shift):
    return moved(np.asarray(points) - shift, -angle, 0.0)


PITCH = 0.005


def simulated(angle, shift):
    """The Reconstruction of a scene of one wall, a pillar and what it hides, turned and shifted with its array."""

    def place(*point):
        return moved(point, angle, shift).tolist()

    def bow(facing):
        rough = {"rms_height": 0.1e-3, "correlation_length": 0.2e-3}
        return {"start_angle": angle + facing - 80.0, "stop_angle": angle + facing + 80.0, "roughness": rough}

    scene = parse_scene(
        {
            "name": "pillar",
            "array": {
                "elements": 81, "pitch": 0.5e-3, "center": place(0, 0), "direction": moved((1, 0), angle, 0).tolist(),
            },
            "band": {"start": 290e9, "stop": 300e9, "points": 201},
            "surface": [
                {"name": "wall", "kind": "segment", "start": place(0.55, 0.75), "end": place(0.35, 1.5), "roughness":
                    {"rms_height": 0.05e-3, "correlation_length": 0.2e-3}},
                {"name": "pillar", "kind": "arc", "center": place(-0.2, 0.8), "radius": 0.15, **bow(-90.0)},
                {"name": "target", "kind": "arc", "center": place(-0.35, 1.4), "radius": 0.1, **bow(-10.0)},
            ],
        }
    )  # fmt: skip
    # Wide enough to hold the scene whichever way it is turned, and all in front of the array.
    x, y = np.arange(-0.7, 1.85, PITCH) + shift[0], np.arange(0.5, 2.5, PITCH) + shift[1]
    image = mf.focus(mf.simulate(scene, seed=3), x=x, y=y, tolerance=1e-3)
    return mf.fold(image)


@pytest.fixture(scope="module")
def unmoved():
    return simulated(0.0, np.zeros(2))


@pytest.mark.slow
@pytest.mark.parametrize(("angle", "shift"), [(0.0, (0.31, -0.17)), (14.0, (0.0, 0.0)), (-15.0, (-0.4, 1.3))])
def test_turning_and_shifting_scene_and_array_turns_and_shifts_the_result(unmoved, angle, shift):
    shift = np.array(shift)
    result = simulated(angle, shift)
    here, there = unmoved["mirrors"].dataset, result["mirrors"].dataset
    assert here.sizes["mirror"] == there.sizes["mirror"] == 1
    before, after = line(here, 0), undone(line(there, 0), angle, shift)
    if np.linalg.norm(after - before) > np.linalg.norm(after[::-1] - before):
        after = after[::-1]
    span = before[1] - before[0]
    turn = np.degrees(np.arcsin(abs(cross2(span, after[1] - after[0])) / np.linalg.norm(span) ** 2))
    # A hundredth of the range cell of 3 cm, and of an angle cell.
    assert turn < 0.05
    assert np.abs(cross2(span, after - before[0])).max() / np.linalg.norm(span) < 0.3e-3
    assert np.linalg.norm(after - before, axis=1).max() < 0.02
    for bounces in (0, 1):
        sets = []
        for tree, undo in ((unmoved, (0.0, np.zeros(2))), (result, (angle, shift))):
            objects = tree["objects"].dataset
            wanted = (objects["bounces"].values == bounces) & (objects["surface"].values == "object")
            sets.append(undone(places(objects)[wanted], *undo))
        assert min(map(len, sets)) > 15
        for one, other in (sets, sets[::-1]):
            # An echo at the threshold may come and go with the pixels; others move by a thirtieth of a cell.
            assert np.quantile(nearest(one, other), 0.95) < 0.001
            assert nearest(one, other).max() < 0.03


def test_a_plan_that_is_done_with_keeps_no_image(image):
    """Without waiting for the garbage collector: a recording makes a plan for each of its frames."""
    gc.disable()
    try:
        plan = FoldPlan(image)
        plan.fold(mirrors=[])
        forgotten = weakref.ref(plan)
        del plan
        assert forgotten() is None
    finally:
        gc.enable()


def test_a_shortest_mirror_without_length_is_refused(image):
    with pytest.raises(mf.InputError, match="minimum_length is 5e-324"):
        mf.fold(image, minimum_length=5e-324)


@pytest.mark.parametrize("with_sweep", [False, True])
def test_a_plan_may_be_pickled(image, sweep, with_sweep):
    if with_sweep:
        image = mf.focus(sweep, x=np.linspace(-0.1, 0.2, 41), y=np.linspace(0.2, 0.5, 41))
    plan = mf.FoldPlan(image, sweep=sweep if with_sweep else None)
    result, again = plan.fold(), pickle.loads(pickle.dumps(plan)).fold()
    assert again.identical(result)
    assert pickle.loads(pickle.dumps(mf.FoldPlan(result))).fold().identical(mf.fold(result))
