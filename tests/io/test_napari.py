"""The layers that napari is given; napari itself is not needed."""

from __future__ import annotations

import importlib
from importlib.resources import files

import numpy as np
import pytest
import yaml

import mirrorfold as mf
from mirrorfold.folding.frames import join_frames
from mirrorfold.napari_plugin import get_reader


def layers(obj, tmp_path):
    path = str(mf.save(obj, tmp_path / "file.nc"))
    return get_reader(path)(path)


def test_the_manifest_names_a_function_that_is_there():
    manifest = yaml.safe_load(files("mirrorfold").joinpath("napari.yaml").read_text())
    (command,) = manifest["contributions"]["commands"]
    module, name = command["python_name"].split(":")
    assert getattr(importlib.import_module(module), name) is get_reader
    assert manifest["contributions"]["readers"][0]["command"] == command["id"]


def test_an_image_lies_where_its_pixels_are(image, tmp_path):
    ((data, keywords, kind),) = layers(image, tmp_path)
    assert kind == "image"
    row, column = np.unravel_index(data.argmax(), data.shape)
    place = np.array(keywords["translate"]) + np.array(keywords["scale"]) * [row, column]
    np.testing.assert_allclose(place, [1.2, 0.1], atol=0.02)
    assert (data.max(), data.min() >= -40.0) == (0.0, True)


@pytest.mark.slow
@pytest.mark.parametrize("which", ["reconstruction", "folded_scan"])
def test_points_and_mirrors_have_their_features(which, request, tmp_path):
    tree = request.getfixturevalue(which)
    found = {kind: (data, keywords) for data, keywords, kind in layers(tree, tmp_path)}
    axes = "zyx" if which == "folded_scan" else "yx"
    points, keywords = found["points"]
    np.testing.assert_array_equal(points, np.stack([tree["objects"].to_dataset(inherit=False)[a] for a in axes], -1))
    assert len(keywords["features"]["chain"]) == len(keywords["face_color"]) == len(points)
    shapes, keywords = found["shapes"]
    assert keywords["shape_type"] == ("polygon" if which == "folded_scan" else "line")
    assert shapes[0].shape == ((4, 3) if which == "folded_scan" else (2, 2))
    if which == "reconstruction":
        np.testing.assert_allclose(shapes[0], [[1.6, 0.4], [0.9, 0.6]])


@pytest.mark.slow
def test_frames_come_before_the_other_axes(reconstruction, tmp_path):
    found = {kind: data for data, _, kind in layers(join_frames([reconstruction] * 3, {}), tmp_path)}
    assert found["image"].shape == (3, 76, 101)
    np.testing.assert_array_equal(found["points"][:, 0], np.repeat([0, 1, 2], 5))
    np.testing.assert_array_equal([shape[0, 0] for shape in found["shapes"]], [0, 1, 2])


def test_what_is_not_for_us_is_left_to_others(sweep, tmp_path):
    path = mf.save(sweep, tmp_path / "sweep.nc")
    (tmp_path / "other.nc").write_text("no file of ours")
    for one in (str(path), str(tmp_path / "other.nc"), str(tmp_path / "x.tif"), [str(path)]):
        assert get_reader(one) is None
