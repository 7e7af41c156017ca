"""Point clouds for other programs, read back by other programs where there are some."""

from __future__ import annotations

import base64
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
import trimesh
from scans import ball, panel, scene

import mirrorfold as mf
from mirrorfold.cli import main
from mirrorfold.io.exports.results import export
from mirrorfold.plotting import volumes as plot_volume


def test_ply_is_read_by_others(reconstruction, tmp_path):
    cloud = trimesh.load(export(reconstruction, tmp_path / "cloud.ply"))
    objects = reconstruction.children["objects"].dataset
    assert np.allclose(cloud.vertices[:, 0], objects["x"], atol=1e-6)
    assert np.allclose(cloud.vertices[:, 1], objects["y"], atol=1e-6)
    assert np.array_equal(cloud.colors[0, :3], [0, 158, 115])
    assert np.array_equal(cloud.colors[-1, :3], [230, 159, 0])


def test_pcd_holds_the_points(reconstruction, tmp_path):
    raw = export(reconstruction, tmp_path / "cloud.pcd").read_bytes()
    header, _, table = raw.partition(b"DATA binary\n")
    lines = dict(line.split(" ", 1) for line in header.decode().splitlines() if not line.startswith("#"))
    kinds = [f"<{kind.lower()}{size}" for kind, size in zip(lines["TYPE"].split(), lines["SIZE"].split(), strict=True)]
    points = np.frombuffer(table, dtype=list(zip(lines["FIELDS"].split(), kinds, strict=True)))
    assert len(points) == int(lines["POINTS"]) == int(lines["WIDTH"])
    objects = reconstruction.children["objects"].dataset
    assert np.allclose(points["y"], objects["y"])
    assert np.array_equal(points["bounces"], objects["bounces"])


def test_vtp_holds_the_points(reconstruction, tmp_path):
    root = ElementTree.parse(export(reconstruction, tmp_path / "cloud.vtp")).getroot()
    arrays = {}
    for array in root.iter("DataArray"):
        raw = base64.b64decode(array.text)
        size = int(np.frombuffer(raw[:4], "<u4")[0])
        assert size == len(raw) - 4
        kind = {"Float32": "<f4", "Int32": "<i4", "Int64": "<i8"}[array.attrib["type"]]
        arrays[array.attrib["Name"]] = np.frombuffer(raw[4:], kind)
    objects = reconstruction.children["objects"].dataset
    assert np.allclose(arrays["Points"].reshape(-1, 3)[:, :2], np.stack([objects["x"], objects["y"]], axis=1))
    assert np.array_equal(arrays["bounces"], objects["bounces"])
    assert np.array_equal(arrays["offsets"], np.arange(1, 6))


def test_other_formats_are_refused(reconstruction, tmp_path):
    with pytest.raises(mf.InputError, match=r"expected one of \.ply, \.pcd, \.vtp"):
        export(reconstruction, tmp_path / "cloud.stl")


SCENE = """
name = "small"
dimensions = 3
[scanner]
azimuth = {start = -6, stop = 6, points = 31}
elevation = {start = -6, stop = 6, points = 31}
spot_radius = 0.017
focus_distance = 3.0
leakage = {level_db = -30}
[band]
start = 270e9
stop = 300e9
points = 701
[[surface]]
name = "wall"
kind = "panel"
center = [0.0, 2.0, 0.0]
normal = [-1.0, -1.0, 0.0]
width = 2.0
height = 1.6
material = "plasterboard"
volume_depth = 0.01
[[surface]]
name = "ball"
kind = "sphere"
center = [-1.1, 2.0, 0.0]
radius = 0.16
diffuse_fraction = 1.0
"""


@pytest.mark.replay
@pytest.mark.slow
def test_the_command_line_from_scene_to_cloud(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scene.toml").write_text(SCENE, encoding="utf-8")
    assert main(["simulate", "scene.toml", "-o", "sweep.nc", "--dry-run"]) == 0
    assert "needed frequencies" in capsys.readouterr().out
    assert not (tmp_path / "sweep.nc").exists()
    assert main(["simulate", "scene.toml", "-o", "sweep.nc", "--snr-db", "25"]) == 0
    assert main(["info", "sweep.nc"]) == 0
    assert "701" in capsys.readouterr().out
    assert main(["info", "scene.toml"]) == 0
    assert main(["reconstruct", "sweep.nc", "-o", "out", "--export", "cloud.ply"]) == 0
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert names == {"reconstruction.nc", "before_after.png", "space.png", "body.png", "report.html"}
    assert len(trimesh.load("cloud.ply").vertices) > 100
    assert main(["score", "out/reconstruction.nc", "scene.toml"]) == 0
    assert "wall" in capsys.readouterr().out
    assert main(["focus", "sweep.nc", "-o", "volume.nc"]) == 0
    assert main(["fold", "volume.nc", "-o", "folded.nc", "--export", "cloud.vtp"]) == 0
    for file in ("scene.toml", "sweep.nc", "volume.nc", "folded.nc"):
        assert main(["show", file, "-o", "figure.png", "--dpi", "40"]) == 0
    assert main(["fold", "volume.nc", "-o", "unfolded.nc", "--generations", "0"]) == 0
    assert mf.load("unfolded.nc")["mirrors"].sizes["mirror"] == 0
    capsys.readouterr()
    assert main(["fold", "volume.nc", "-o", "x.nc", "--generations", "-1"]) == 2
    assert "generations" in capsys.readouterr().err
    assert main(["fold", "volume.nc", "-o", "folded.nc", "--export", "cloud.stl"]) == 2
    assert ".stl" in capsys.readouterr().err
    few = SCENE.replace("points = 701", "points = 301")
    (tmp_path / "few.toml").write_text(few, encoding="utf-8")
    assert main(["simulate", "few.toml", "-o", "few.nc"]) == 2
    assert "at least" in capsys.readouterr().err
    assert main(["simulate", "few.toml", "-o", "few.nc", "--force"]) == 0


@pytest.mark.slow
def test_pictures_of_a_folded_volume(reconstruction):
    world = scene(
        panel("wall", (0, 2, 0), (-1, -1, 0), 2.0, 1.6), ball("ball", (-1.1, 2.0, 0.0), 0.16), half=6.0, beams=31
    )
    result = mf.reconstruct(mf.simulate(world, snr_db=25.0))
    assert plot_volume.has_body(result)
    front, side, _ = plot_volume.body(result).axes
    # What faces the mirror is drawn as large as it is.
    assert np.ptp(front.get_xlim()) == pytest.approx(0.32 + 0.16, abs=0.06)
    assert side.get_ylim() == front.get_ylim()
    assert not front.collections
    labels = [text.get_text() for text in plot_volume.space(result, world).legends[0].get_texts()]
    assert {"1 bounce: mirrors and points", "truth", "radar"} <= set(labels)
    # The truth, drawn thin, is a circle around the ball from the front, and the ball's own from the side.
    front, side, _ = plot_volume.body(result, world).axes
    outline = max((path.vertices for path in front.collections[0].get_paths()), key=len)
    assert np.ptp(outline, axis=0) == pytest.approx([0.32, 0.32], abs=0.02)
    lines = np.concatenate([path.vertices for path in side.collections[-1].get_paths()])
    assert np.ptp(lines[:, 1]) == pytest.approx(0.32, abs=0.01)
    with pytest.raises(mf.InputError, match="no heights"):
        plot_volume.body(reconstruction)


def test_scores_need_a_scene_of_the_same_dimensions(reconstruction):
    with pytest.raises(mf.InputError, match="2 dimensions and the scene 3"):
        mf.score(reconstruction, scene(ball()))
