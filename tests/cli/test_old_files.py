"""Reconstructions written by earlier versions: every verb that takes a reconstruction still takes them."""

from __future__ import annotations

import json

import numpy as np
import pytest
import xarray as xr
from serving import opened
from synthetic import diffuse, radar_image, together

import mirrorfold as mf
from mirrorfold.cli import main
from mirrorfold.common.geometry import reflect, segment_normal

WALL, OBJECT = np.array([[0.5, 1.8], [0.9, 0.9]]), np.array([[-0.2, 1.9], [-0.06, 1.95]])

HALF_CELL = 0.017
"""Of the image [m]: the initial picture has lost its phase, and the ends of a mirror shift by less than this."""

SCENE = """
name = "a wall and an object"
[array]
kind = "linear"
elements = 9
pitch = 0.5e-3
[band]
start = 290e9
stop = 300e9
points = 41
[[surface]]
name = "wall"
kind = "segment"
start = [0.5, 1.8]
end = [0.9, 0.9]
[[surface]]
name = "object"
kind = "segment"
start = [-0.2, 1.9]
end = [-0.06, 1.95]
"""


def rewritten(reconstruction, attrs):
    """A reconstruction with the attributes of the radar and of the image, those given, and mirrors without a depth."""
    known = ("mirrorfold_kind", "threshold", "reference", "radar_", "image_")
    kept = {name: value for name, value in reconstruction.attrs.items() if name.startswith(known)}
    groups = {node.path: node.to_dataset(inherit=False) for node in reconstruction.subtree}
    groups["/"].attrs = {**kept, "mirrorfold_version": "0.0.1", "remark": "", **attrs}
    groups["/mirrors"] = groups["/mirrors"].drop_vars("depth", errors="ignore")
    return xr.DataTree.from_dict(groups)


@pytest.fixture(scope="module")
def image():
    """A wall, and by way of it an object."""
    ghost = reflect(OBJECT, WALL[0], segment_normal(*WALL))
    points = together(diffuse(*WALL, seed=0), diffuse(*ghost, seed=1))
    return radar_image(*points, np.linspace(-1.2, 2.4, 361), np.linspace(0.3, 2.9, 261))


@pytest.fixture(params=["all settings", "no settings"])
def old(request, image, tmp_path, monkeypatch):
    """The path of a reconstruction that has all settings of its time, or was written before any was recorded."""
    settings = {
        "fold_normalization": "r", "fold_threshold_db": -18.0, "fold_minimum_length": 0.25, "fold_wall_margin": 0.04,
        "fold_generations": None, "fold_opaque": True, "fold_published": False, "preset": "default",
        "mirrors_given": False, "mixed_x": np.empty(0), "mixed_y": np.empty(0),
    }  # fmt: skip
    monkeypatch.chdir(tmp_path)
    mf.save(rewritten(mf.fold(image), settings if request.param == "all settings" else {}), "old.nc")
    (tmp_path / "scene.toml").write_text(SCENE, encoding="utf-8")
    return tmp_path / "old.nc"


@pytest.fixture
def old_volume(folded_scan, tmp_path, monkeypatch):
    """The path of a folded scan as it was written when volumes had settings of their own."""
    settings = {"fold_threshold_db": -26.0, "fold_minimum_size": 0.4, "fold_wall_margin": 0.04,
                "fold_normalization": "default", "noise_floor": 0.1}  # fmt: skip
    monkeypatch.chdir(tmp_path)
    mf.save(rewritten(folded_scan, settings), "old.nc")
    return tmp_path / "old.nc"


def mirrors_of(tree):
    held = tree["mirrors"].to_dataset(inherit=False)
    return np.stack([held[f"folded_{name}"].values for name in ("x0", "y0", "x1", "y1")], axis=-1)


@pytest.mark.slow
def test_an_old_reconstruction_folds_to_what_it_holds(old):
    before = mf.load(old)
    again = mf.fold(before)
    assert len(mirrors_of(before)) == 1
    np.testing.assert_allclose(mirrors_of(again), mirrors_of(before), atol=HALF_CELL)
    assert main(["fold", "old.nc", "-o", "again.nc", "--threshold-db", "-18"]) == 0
    np.testing.assert_allclose(mirrors_of(mf.load("again.nc")), mirrors_of(again), atol=1e-9)


@pytest.mark.slow
def test_an_old_reconstruction_is_described_judged_and_shown(old, capsys):
    assert main(["info", "old.nc", "--json"]) == 0
    assert len(json.loads(capsys.readouterr().out)["mirrors"]) == 1
    assert main(["score", "old.nc", "scene.toml", "--json"]) == 0
    score = json.loads(capsys.readouterr().out)
    assert score["mirrors"][0]["surface"] == "wall"
    assert score["mirrors"][0]["offset_error_mm"] < 5.0
    assert main(["report", "old.nc", "-o", "old.html", "--scene", "scene.toml"]) == 0
    for what in ("before-after", "mirrors", "tree"):
        assert main(["show", "old.nc", "-o", f"{what}.png", "--what", what]) == 0


@pytest.mark.slow
def test_an_old_reconstruction_is_edited_in_the_page(old):
    session = opened(old)
    assert session.state["status"] == "ready"
    values = session.state["document"]["values"]
    assert values["threshold_db"] == -18.0
    assert 0.1 < values["minimum_length"] < 0.5
    assert 0.02 < values["wall_margin"] < 0.1
    assert values["generations"] is None
    folded = session.fold({"settings": {"generations": 0}})
    assert folded["mirrors"] == []
    session.save({"name": "edited.nc", "settings": {"generations": None}})
    np.testing.assert_allclose(mirrors_of(mf.load("edited.nc")), mirrors_of(mf.load(old)), atol=HALF_CELL)


@pytest.mark.slow
def test_an_old_volume_is_described_and_shown(old_volume, capsys):
    assert main(["info", "old.nc", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["mirrors"]
    assert main(["report", "old.nc", "-o", "old.html"]) == 0
    for what in ("before-after", "space", "tree"):
        assert main(["show", "old.nc", "-o", f"{what}.png", "--what", what]) == 0
    session = opened(old_volume)
    assert session.state["status"] == "ready"
    assert not session.state["document"]["editable"]
    parameters = dict(session.state["document"]["parameters"])
    assert parameters["fold_minimum_size"] == "0.4"


@pytest.mark.slow
def test_an_old_volume_says_why_it_cannot_be_folded_again(old_volume, capsys):
    assert main(["fold", "old.nc", "-o", "again.nc"]) == 2
    assert "does not hold the volume" in capsys.readouterr().err
