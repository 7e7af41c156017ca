"""Three-dimensional scenes: shapes, materials and every mistake in plain words."""

from __future__ import annotations

import sys

import numpy as np
import pytest
import trimesh
from scans import ball, content, panel

import mirrorfold as mf
from mirrorfold.scenes.floor_plan import parse_scene
from mirrorfold.scenes.solids import Mannequin, Patch
from mirrorfold.simulation.raster.mannequin import mannequin_mesh
from mirrorfold.simulation.raster.meshes import solids

SCENES = ("drywall-mannequin", "drywall-control", "corridor")


def shipped(name):
    from importlib.resources import files

    return mf.load(files("mirrorfold").joinpath("scenes", "shipped", f"{name}.toml"))


def mistake(**changes):
    """The complaint about a scene with these changes to its ball."""
    with pytest.raises(mf.InputError) as caught:
        solids(parse_scene(content(ball() | changes)))
    return str(caught.value)


@pytest.mark.parametrize("name", SCENES)
def test_shipped_scenes_have_the_published_instrument(name):
    scene = shipped(name)
    assert (scene.band.start, scene.band.stop) == (270e9, 300e9)
    assert (scene.scanner.spot_radius, scene.scanner.focus_distance) == (0.017, 3.6)
    assert all(axis[0] == -15.0 and axis[-1] == 15.0 for axis in scene.scanner.angles)


def test_the_control_differs_by_the_foil_only():
    with_foil, without = shipped("drywall-mannequin"), shipped("drywall-control")
    assert tuple(s for s in with_foil.surface if s.kind != "patch") == without.surface
    assert with_foil.scanner == without.scanner
    assert with_foil.band == without.band


@pytest.mark.parametrize("pose", [((12.0, 12.0), (10.0, 10.0), 0.0), ((80.0, 5.0), (90.0, 0.0), 20.0)])
def test_the_mannequin_is_one_closed_body_of_plausible_volume(pose):
    vertices, faces = mannequin_mesh(1.75, *pose)
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    assert mesh.is_watertight
    assert mesh.body_count == 1
    # People displace about their weight: 60 to 90 litres.
    assert 0.055 < mesh.volume < 0.095
    assert vertices[:, 2].min() == pytest.approx(0.0)
    assert vertices[:, 2].max() == pytest.approx(1.75)
    # It looks along +y: the toes point there.
    assert vertices[vertices[:, 2] < 0.05, 1].max() > 0.12


def test_a_taller_mannequin_is_the_same_one_larger():
    small, large = (trimesh.Trimesh(*mannequin_mesh(h, (12.0, 12.0), (10.0, 10.0), 0.0)).volume for h in (1.5, 1.8))
    assert large / small == pytest.approx((1.8 / 1.5) ** 3, rel=0.03)


@pytest.mark.parametrize(
    ("surface", "volume"),
    [
        ({"kind": "box", "center": [0, 2, 0], "size": [0.3, 0.2, 0.5], "heading": 30}, 0.03),
        ({"kind": "sphere", "center": [0, 2, 0], "radius": 0.2}, 4 / 3 * np.pi * 0.008),
        ({"kind": "cylinder", "start": [0, 2, 0], "end": [0.3, 2, 0.4], "radius": 0.1}, np.pi * 0.01 * 0.5),
        ({"kind": "box", "center": [0, 2, 0], "size": [0.3, 0.2, 0.5], "rounding": 0.05}, 0.02802),
    ],
)
def test_solids_have_their_volume_and_face_outward(surface, volume):
    (solid,) = solids(parse_scene(content({"name": "solid", **surface})))
    mesh = trimesh.Trimesh(solid.vertices, solid.faces)
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(volume, rel=0.02)
    for quad in solid.quads:
        assert (quad.center - mesh.centroid) @ quad.normal > 0.0


def test_a_panel_has_the_size_tilt_and_sides_that_it_is_given():
    (solid,) = solids(parse_scene(content(panel("wall", (0, 2, 0), (-1.0, -2.0, 0.3), 1.2, 0.7))))
    normal = np.array([-1.0, -2.0, 0.3]) / np.linalg.norm([-1.0, -2.0, 0.3])
    front, back = solid.quads
    assert np.allclose(front.normal, normal)
    assert np.allclose(back.normal, -normal)
    corners = solid.vertices
    assert np.linalg.norm(corners[1] - corners[0]) == pytest.approx(1.2)
    assert np.linalg.norm(corners[2] - corners[1]) == pytest.approx(0.7)
    assert corners[1, 2] == pytest.approx(corners[0, 2])
    assert np.allclose((corners - [0, 2, 0]) @ normal, 0.0)


def test_a_mesh_file_is_a_surface_like_any_other(tmp_path):
    trimesh.creation.icosphere(subdivisions=3, radius=100.0).export(tmp_path / "ball.stl")
    surface = {"name": "m", "kind": "mesh", "path": str(tmp_path / "ball.stl"), "scale": 1e-3, "position": [0, 2, 0.5]}
    (solid,) = solids(parse_scene(content(surface)))
    assert np.allclose(solid.vertices.mean(axis=0), [0.0, 2.0, 0.5], atol=1e-6)
    assert np.allclose(np.linalg.norm(solid.vertices - [0, 2, 0.5], axis=1), 0.1)


def test_a_mesh_in_millimetres_is_refused_with_a_hint(tmp_path):
    trimesh.creation.box(extents=(400.0, 300.0, 1700.0)).export(tmp_path / "body.stl")
    found = mistake(kind="mesh", path=str(tmp_path / "body.stl"), center=None)
    assert "center" in found
    surface = {"name": "m", "kind": "mesh", "path": str(tmp_path / "body.stl")}
    with pytest.raises(mf.InputError, match=r"1700 m large.*millimetres: set scale = 0\.001"):
        solids(parse_scene(content(surface)))


def test_open_crossing_and_missing_meshes_are_refused(tmp_path):
    whole = trimesh.creation.box(extents=(0.3, 0.3, 0.3))
    trimesh.Trimesh(whole.vertices, whole.faces[:-1]).export(tmp_path / "open.ply")
    # A star-shaped slab that folds over itself: closed, oriented, and self-intersecting.
    first = trimesh.creation.box(extents=(0.3, 0.3, 0.3))
    second = first.copy()
    second.apply_translation([0.1, 0.12, 0.13])
    trimesh.util.concatenate([first, second]).export(tmp_path / "crossing.ply")
    (tmp_path / "text.stl").write_text("no mesh")
    for name, complaint in (("open.ply", "open mesh"), ("crossing.ply", "crosses itself"),
                            ("text.stl", "no triangles"), ("absent.obj", "does not exist")):  # fmt: skip
        with pytest.raises(mf.InputError, match=complaint):
            solids(parse_scene(content({"name": "m", "kind": "mesh", "path": str(tmp_path / name)})))


def test_a_patch_covers_what_faces_it():
    patch = Patch(name="p", on="b", direction=(0, -1, 0), outline=((-0.1, -0.1), (0.2, -0.1), (0.2, 0.3), (-0.1, 0.3)))
    points = np.array([[0.15, -1.0, 0.2], [-0.15, -1.0, 0.2], [0.15, 1.0, 0.2], [0.15, -1.0, -0.2]])
    normals = np.array([[0, -1.0, 0], [0, -1.0, 0], [0, 1.0, 0], [0, -1.0, 0]])
    # Seen from -y, +x is to the right; the far side and what is left of the outline or below it stay bare.
    assert patch.covers(points, normals).tolist() == [True, False, False, False]


def test_every_mistake_is_named():
    assert "surface[0].radius" in mistake(radius=-1.0)
    assert "did you mean 'diffuse_fraction'" in mistake(diffuse_fracton=0.3)
    assert "material 'plaster' is not known" in mistake(material="plaster")
    assert "permittivity" in mistake(material={"permittivity": 0.2})
    assert "expected one of panel, box, sphere" in mistake(kind="ball")
    with pytest.raises(mf.InputError, match="lies on 'nobody'"):
        parse_scene(
            content(ball(), {"name": "p", "kind": "patch", "on": "nobody", "outline": [[0, 0], [1, 0], [1, 1]]})
        )
    with pytest.raises(mf.InputError, match="used more than once"):
        parse_scene(content(ball(), ball()))
    with pytest.raises(mf.InputError, match=r"1\.7 m was meant"):
        parse_scene(content({"name": "m", "kind": "mannequin", "position": [0, 2, -1], "height": 1700.0}))
    with pytest.raises(mf.InputError, match="stop"):
        parse_scene(content(ball(), half=-3.0))


def test_without_the_extra_packages_it_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "embreex.mesh_construction", None)
    monkeypatch.setitem(sys.modules, "trimesh", None)
    with pytest.raises(mf.InputError, match=r"install 'mirrorfold\[mesh\]'"):
        mf.simulate(parse_scene(content(panel(), half=2.0, beams=9)))
    with pytest.raises(mf.InputError, match=r"install 'mirrorfold\[mesh\]'"):
        solids(parse_scene(content(ball())))
    monkeypatch.setitem(sys.modules, "skimage.measure", None)
    with pytest.raises(mf.InputError, match=r"scikit-image; install 'mirrorfold\[mesh\]'"):
        mannequin_mesh(1.71, (12.0, 12.0), (10.0, 10.0), 0.0)


def test_directions_from_a_file(tmp_path):
    grid = np.array([[a, e] for a in (-2.0, 0.0, 1.0) for e in (0.0, 0.5)])
    np.savetxt(tmp_path / "grid.csv", grid, delimiter=",")
    np.savetxt(tmp_path / "hole.csv", grid[:-1], delimiter=",")
    scanner = {"directions": str(tmp_path / "grid.csv"), "spot_radius": 0.017, "focus_distance": 3.0}
    scene = parse_scene(content(ball()) | {"scanner": scanner})
    azimuth, elevation = scene.scanner.angles
    assert azimuth.tolist() == [-2.0, 0.0, 1.0]
    assert elevation.tolist() == [0.0, 0.5]
    with pytest.raises(mf.InputError, match="all combinations"):
        parse_scene(content(ball()) | {"scanner": scanner | {"directions": str(tmp_path / "hole.csv")}})
    with pytest.raises(mf.InputError, match="does not exist"):
        parse_scene(content(ball()) | {"scanner": scanner | {"directions": str(tmp_path / "none.csv")}})


def test_the_mannequin_stands_and_looks_where_it_is_told():
    body = Mannequin(name="m", position=(1.0, 2.0, -0.9), heading=90.0)
    ahead = body.frame.linear @ [0.0, 1.0, 0.0]
    assert np.allclose(ahead, [1.0, 0.0, 0.0])
    assert np.allclose(body.frame(np.zeros(3)), [1.0, 2.0, -0.9])


def test_a_mesh_that_would_fill_the_memory_is_refused_unread(tmp_path, monkeypatch):
    path = tmp_path / "huge.stl"
    with path.open("wb") as file:
        file.truncate(1 << 40)  # takes no place on the disk
    scene = parse_scene(content({"name": "huge", "kind": "mesh", "path": str(path)}))
    monkeypatch.setattr(trimesh, "load", lambda *_, **__: pytest.fail("the mesh was read"))
    with pytest.raises(mf.InputError, match=r"huge.stl: its triangles need about .* GB of memory, and .* GB are free"):
        solids(scene)
