"""The layers that napari is given; napari itself is not needed."""

from __future__ import annotations

import importlib
from importlib.resources import files

import numpy as np
import pytest
import yaml

import mirrorfold as mf
from mirrorfold.common.arcs import circle_through
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
    assert keywords["shape_type"] == ("polygon" if which == "folded_scan" else "path")
    assert shapes[0].shape == ((4, 3) if which == "folded_scan" else (2, 2))
    if which == "reconstruction":
        np.testing.assert_allclose(shapes[0], [[1.6, 0.4], [0.9, 0.6]])


@pytest.mark.parametrize("frames", [0, 2])
def test_curved_mirrors_are_round(reconstruction, tmp_path, frames):
    arc, line = np.array([[0.4, 1.6], [0.47, 1.22], [0.6, 0.9]]), np.array([[-0.6, 1.7], [-0.7, 0.9]])
    tree = mf.fold(reconstruction, mirrors=[arc, np.insert(line, 1, line.mean(axis=0), axis=0)])
    found = layers(join_frames([tree] * frames, {}) if frames else tree, tmp_path)
    shapes = next(data for data, _, kind in found if kind == "shapes")
    if frames:
        np.testing.assert_array_equal([np.unique(shape[:, 0]) for shape in shapes], [[0], [0], [1], [1]])
        shapes = [shape[:, 1:] for shape in shapes[-2:]]
    bent, straight = (shape[:, ::-1] for shape in shapes)
    center, radius = (found[0] for found in circle_through(*arc[:, None]))
    np.testing.assert_allclose(np.linalg.norm(bent - center, axis=1), radius, rtol=1e-5)
    np.testing.assert_allclose(bent[[0, len(bent) // 2, -1]].mean(axis=0), arc.mean(axis=0), atol=0.02)
    np.testing.assert_allclose(straight, line, rtol=1e-6)


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
