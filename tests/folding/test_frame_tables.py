"""Frames joined and taken apart again, and what is left of a result: on tables and pictures made by hand."""

from __future__ import annotations

import json

import numpy as np
import pytest
import xarray as xr
from numpy.testing import assert_allclose, assert_array_equal

import mirrorfold as mf
from mirrorfold.errors import InputError
from mirrorfold.folding.confident import confident_points, with_confident_points
from mirrorfold.folding.earlier import initial_image, known_places, known_shares
from mirrorfold.folding.frames import _joined, each_frame, frame_count, join_frames, pick_frame
from mirrorfold.tree.assignment import ITSELF
from mirrorfold.tree.explaining.misplaced import LATE, MIXED


def changed(tree, **groups):
    """The same with other tables."""
    nodes = {node.path: node.to_dataset(inherit=False) for node in tree.subtree}
    return xr.DataTree.from_dict(nodes | {f"/{name}": table for name, table in groups.items()})


def two_mirrors(tree):
    """With a second mirror, that is seen in the first."""
    mirrors = tree.children["mirrors"].to_dataset(inherit=False)
    both = xr.concat([mirrors, mirrors.assign(parent=("mirror", [0]))], "mirror")
    return changed(tree, mirrors=both)


def assert_same(first, second):
    for path in ("/", "/initial", "/objects", "/mirrors"):
        xr.testing.assert_identical(*(tree[path].to_dataset(inherit=False) for tree in (first, second)))


def test_parents_count_the_mirrors_of_all_frames(reconstruction):
    first, second = two_mirrors(reconstruction), two_mirrors(reconstruction)
    second.attrs["threshold"] = np.array([0.5, 0.25])
    first.attrs["threshold"] = np.array([0.1, 0.2])
    joined = join_frames([first, second], {"time": xr.Variable("frame", [0.0, 0.5])})
    assert joined["mirrors"]["parent"].values.tolist() == [-1, 0, -1, 2]
    assert joined["mirrors"]["frame"].values.tolist() == [0, 0, 1, 1]
    assert joined["objects"]["frame"].values.tolist() == [0] * 5 + [1] * 5
    assert joined["time"].values.tolist() == [0.0, 0.5]
    # What all frames have in common is said once, the rest of each.
    assert "threshold" not in joined.attrs
    assert joined.attrs["mirrorfold_kind"] == "reconstruction"
    own = [json.loads(str(text)) for text in joined["attributes"].values]
    assert own == [{"threshold": [0.1, 0.2]}, {"threshold": [0.5, 0.25]}]
    assert frame_count(joined) == 2
    for number, alone in enumerate((first, second)):
        alone.attrs["threshold"] = alone.attrs["threshold"].tolist()
        picked = pick_frame(joined, number)
        assert_same(picked, alone)
        assert picked.attrs == alone.attrs
        assert frame_count(picked) is None


def test_a_frame_without_mirrors_has_none(reconstruction):
    empty = changed(reconstruction, mirrors=reconstruction["mirrors"].to_dataset(inherit=False).isel(mirror=slice(0)))
    joined = join_frames([empty, two_mirrors(reconstruction), empty], {})
    assert joined["mirrors"]["parent"].values.tolist() == [-1, 0]
    assert [pick_frame(joined, number)["mirrors"].sizes["mirror"] for number in range(3)] == [0, 2, 0]


def test_a_recording_may_have_one_frame(reconstruction):
    joined = join_frames([reconstruction], {})
    assert frame_count(joined) == 1
    assert_same(pick_frame(joined), reconstruction)
    assert pick_frame(joined).attrs == reconstruction.attrs


@pytest.mark.parametrize(("obj", "count"), [
    (xr.DataArray(np.zeros((3, 2)), dims=("frame", "x")), 3), (xr.DataArray(np.zeros(2), dims="x"), None),
    (xr.Dataset({"s": ("frame", np.zeros(4))}), 4), (xr.Dataset({"other": ("frame", np.zeros(4))}), None),
    (np.zeros((3, 2)), None),
])  # fmt: skip
def test_frames_are_counted(obj, count):
    assert frame_count(obj) == count


def test_a_frame_is_named_where_there_is_a_choice():
    image = xr.DataArray(np.arange(6).reshape(3, 2), dims=("frame", "x"))
    assert pick_frame(image, 2).values.tolist() == [4, 5]
    assert pick_frame(image[:1]).values.tolist() == [0, 1]
    assert pick_frame(image[0]) is not None
    alone = image[0]
    assert pick_frame(alone) is alone
    assert pick_frame(alone, 0) is alone
    for wrong, said in ((None, "a frame is needed, but there are 3 frames, numbered from 0 to 2"),
                        (3, "frame is 3, but there are 3 frames"), (-1, "is -1"), ("1", "is '1'"),
                        ("a", "frame is 'a', but there are 3 frames, numbered from 0 to 2; choose one"),
                        (1.5, "frame is 1.5, but there are 3 frames, numbered from 0 to 2; choose one"),
                        (np.arange(2), "frame is an array")):  # fmt: skip
        with pytest.raises(InputError, match=said):
            pick_frame(image, wrong)
    with pytest.raises(InputError, match="frame is 1, but there are no frames; leave --frame out"):
        pick_frame(alone, 1)


def test_a_recording_of_no_frame_is_refused():
    axis = np.arange(8.0)
    image = xr.DataArray(np.zeros((0, 8, 8)), dims=("frame", "y", "x"), coords={"y": axis, "x": axis})
    with pytest.raises(InputError, match="the recording has no frame"):
        mf.fold(image)


@pytest.mark.parametrize(
    ("finished", "said"),
    [
        ("out", "finished: got the text 'out', expected a dict for the frames of a recording that are done"),
        (3, "finished: got the number 3"),
        ({0: "frame.nc"}, "finished: frame 0: got the text 'frame.nc', expected its reconstruction"),
    ],
)
def test_what_keeps_no_frames_is_refused_for_single_images_too(finished, said):
    axis = np.arange(8.0)
    image = xr.DataArray(np.zeros((8, 8)), dims=("y", "x"), coords={"y": axis, "x": axis})
    with pytest.raises(InputError, match=said):
        mf.fold(image, finished=finished)
    with pytest.raises(InputError, match=said):
        mf.reconstruct(xr.Dataset(), finished=finished)


def test_each_frame_is_worked_on_once_with_what_stands_beside_it(reconstruction):
    images = xr.DataArray(
        np.arange(6.0).reshape(3, 2), dims=("frame", "x"), coords={"time": ("frame", [1.0, 2.0, 3.0])}
    )
    beside = xr.Dataset({"s": ("frame", [7.0, 8.0, 9.0])})
    asked, told = [], []

    def work(image, sweep, other):
        asked.append((image.values.tolist(), float(sweep["s"]), other))
        return reconstruction

    finished = {1: reconstruction}
    result = each_frame(images, work, finished, lambda *done: told.append(done), sweep=beside, other=None)
    assert asked == [([0.0, 1.0], 7.0, None), ([4.0, 5.0], 9.0, None)]
    assert told == [(1, 3), (2, 3), (3, 3)]
    assert sorted(finished) == [0, 1, 2]
    assert result["time"].values.tolist() == [1.0, 2.0, 3.0]
    assert frame_count(each_frame(images, lambda image: reconstruction, None, None)) == 3

    def fails(image):
        raise InputError("is wrong")

    with pytest.raises(InputError, match="frame 0: is wrong"):
        each_frame(images, fails, None, None)


def test_beyond_its_own_grid_a_frame_has_no_pixels(reconstruction):
    """The second frame has grown by ten columns to the left and five rows."""
    picture = reconstruction.to_dataset()["intensity"]
    nodes = {node.path: node.to_dataset(inherit=False) for node in reconstruction.subtree}
    for path in ("/", "/initial"):
        nodes[path] = nodes[path].pad(x=(10, 0), y=(0, 5), constant_values=1.0).assign_coords(
            x=np.concatenate([picture["x"].values[0] - 0.02 * np.arange(10, 0, -1), picture["x"]]),
            y=np.concatenate([picture["y"], picture["y"].values[-1] + 0.02 * np.arange(1, 6)]),
        )  # fmt: skip
    joined = join_frames([reconstruction, xr.DataTree.from_dict(nodes)], {})
    first, second = joined["intensity"].values
    assert np.isfinite(second).all()
    assert_array_equal(first[:-5, 10:], picture)
    assert np.isnan(first[-5:]).all()
    assert np.isnan(first[:, :10]).all()


def test_grids_are_joined_in_the_largest_of_their_steps():
    fine, coarse = 0.1 * np.arange(10), 0.5 + 0.3 * np.arange(4)
    assert_array_equal(_joined([fine, fine]), fine)
    joined = _joined([fine, coarse])
    assert_allclose(np.diff(joined), 0.3)
    assert joined[0] == 0.0
    assert 1.4 <= joined[-1] < 1.4 + 0.3
    # Grids of equal steps keep their coordinates, half a step off at most, and gaps between them are filled.
    far = 2.0 + 0.1 * np.arange(5)
    assert_allclose(_joined([fine, far]), 0.1 * np.arange(25), atol=1e-12)
    assert_array_equal(_joined([fine, far])[-5:], far)
    assert_array_equal(_joined([fine, fine + 1e-9]), fine)
    assert _joined([np.array([0.0, 0.4])]).tolist() == [0.0, 0.4]
    assert _joined([np.array([2.0])]).tolist() == [2.0]
    assert _joined([np.array([2.0]), np.array([4.0])]).tolist() == [2.0, 3.0, 4.0]


def with_objects(reconstruction, **columns):
    table = reconstruction["objects"].to_dataset(inherit=False)
    return changed(reconstruction, objects=table.assign({name: ("point", values) for name, values in columns.items()}))


def test_points_of_enough_confidence_are_shown(reconstruction):
    result = with_objects(reconstruction, confidence=np.array([0.1, 0.5, 0.6, 0.9, 0.0]))
    assert confident_points(result).sizes["point"] == 5  # as of files of earlier versions
    result.attrs["fold_min_confidence"] = 0.5
    assert confident_points(result)["x"].values.tolist() == result["objects"]["x"].values[1:4].tolist()
    assert confident_points(result, 0.0).sizes["point"] == 5
    assert confident_points(result, 0.55).sizes["point"] == 2
    kept = with_confident_points(result)
    assert kept["objects"].sizes["point"] == 3
    assert result["objects"].sizes["point"] == 5


def test_what_is_known_of_ghosts_is_read_again(reconstruction):
    why = np.array(["", LATE, ITSELF, MIXED, ""])
    places, said = known_places(with_objects(reconstruction, explanation=why))
    objects = reconstruction["objects"]
    assert_allclose(places, np.column_stack([objects["x_initial"], objects["y_initial"]]))
    assert said.tolist() == ["", LATE, "", MIXED, ""]
    assert known_places(with_objects(reconstruction, explanation=np.array([""] * 5))) is None
    # Files of earlier versions hold the places of mixed paths as attributes.
    assert known_places(reconstruction) is None
    old = reconstruction.copy()
    old.attrs |= {"mixed_x": np.array([0.1, 0.2]), "mixed_y": np.array([1.1, 1.2])}
    places, said = known_places(old)
    assert_allclose(places, [[0.1, 1.1], [0.2, 1.2]])
    assert said.tolist() == [MIXED, MIXED]


def test_what_was_measured_is_read_again(reconstruction):
    assert known_shares(reconstruction) is None
    places, shares = known_shares(with_objects(reconstruction, confocal=np.array([0.5, np.nan, 1.0, np.nan, 0.2])))
    assert shares.tolist() == [0.5, 1.0, 0.2]
    assert_allclose(places[:, 0], reconstruction["objects"]["x_initial"].values[[0, 2, 4]])


def test_an_initial_image_knows_its_radar(reconstruction, folded_scan):
    result = reconstruction.copy()
    result.attrs |= {"radar_x": 0.3, "radar_y": -0.1, "image_tx_aperture": 0.08, "fold_normalization": "r2"}
    image = initial_image(result)
    assert image.name == "image"
    assert image.dims == ("y", "x")
    assert image.attrs["radar_position"] == [0.3, -0.1, 0.0]
    assert image.attrs["tx_aperture"] == 0.08
    assert image.attrs["normalization"] == "r2"
    assert_array_equal(image, result["initial/initial"])
    with pytest.raises(mf.InputError, match="does not hold the volume"):
        initial_image(folded_scan)
    without = xr.DataTree.from_dict({"/": result.to_dataset(), "/objects": result["objects"].to_dataset(inherit=False)})
    for broken in (without, changed(result, initial=xr.Dataset())):
        with pytest.raises(mf.InputError, match=r"holds no (initial image|group 'initial')"):
            initial_image(broken)
