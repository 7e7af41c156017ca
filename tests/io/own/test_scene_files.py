"""Scene files that are written, and files that stand beside them."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

import mirrorfold as mf
from mirrorfold.scenes.families import FAMILIES, draw


@pytest.mark.slow
@pytest.mark.parametrize("family", list(FAMILIES))
def test_a_scene_of_any_family_comes_back_from_its_file(tmp_path, family):
    scene = draw(family, seed=3)
    path = mf.save(scene, tmp_path / "scene.toml")
    assert path == tmp_path / "scene.toml"
    assert mf.load(path) == scene


def test_a_scene_by_another_suffix_and_something_else_are_refused(tmp_path):
    with pytest.raises(mf.InputError, match=r"suffix '\.nc', expected \.toml"):
        mf.save(draw("empty", seed=0), tmp_path / "scene.nc")
    with pytest.raises(mf.InputError, match="got a dict, expected a sweep, an image, a reconstruction or a scene"):
        mf.save({}, tmp_path / "scene.toml")
    assert not list(tmp_path.iterdir())


def test_meshes_and_directions_are_found_beside_the_scene_file(tmp_path, monkeypatch):
    folder = tmp_path / "scene"
    folder.mkdir()
    monkeypatch.chdir(tmp_path)
    trimesh.creation.icosphere(subdivisions=2, radius=0.1).export(folder / "ball.stl")
    trimesh.creation.icosphere(subdivisions=2, radius=0.2).export("elsewhere.stl")
    angles = np.array([(azimuth, elevation) for azimuth in (-5.0, 0.0, 5.0) for elevation in (-2.0, 2.0)])
    np.savetxt(folder / "grid.csv", angles, delimiter=",")
    (folder / "scene.toml").write_text("""
name = "ball"
dimensions = 3
band = {start = 270e9, stop = 300e9, points = 51}
scanner = {directions = "grid.csv", spot_radius = 0.017, focus_distance = 1.5}
surface = [
  {name = "ball", kind = "mesh", path = "ball.stl", position = [0.0, 2.0, 0.0]},
  {name = "other", kind = "mesh", path = "elsewhere.stl", position = [1.0, 2.0, 0.0]},
]
""")
    scene = mf.load("scene/scene.toml")
    assert [np.ptp(angles) for angles in scene.scanner.angles] == [10.0, 4.0]
    assert scene.surface[0].path.samefile(folder / "ball.stl")
    assert scene.surface[1].path.samefile(tmp_path / "elsewhere.stl")


@pytest.mark.parametrize("name", ["a" * 5000, "nul\\u0000", "../" * 2000 + "ball.stl"], ids=["long", "null", "far"])
def test_a_mesh_of_an_impossible_name_is_refused_in_a_sentence(tmp_path, name):
    path = tmp_path / "scene.toml"
    path.write_text(f"""
name = "ball"
dimensions = 3
band = {{start = 270e9, stop = 300e9, points = 51}}
scanner = {{directions = "{name}", spot_radius = 0.017, focus_distance = 1.5}}
surface = [{{name = "ball", kind = "mesh", path = "{name}", position = [0.0, 2.0, 0.0]}}]
""")
    with pytest.raises(mf.InputError):
        mf.load(path)
