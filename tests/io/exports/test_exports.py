"""Results for ParaView, CAD and maps, read back by their own libraries where these are there."""

from __future__ import annotations

import base64
import json
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
import trimesh
import xarray as xr

import mirrorfold as mf
from mirrorfold.cli import main
from mirrorfold.cli.schema import check
from mirrorfold.folding.frames import join_frames

KINDS = {"Float32": "<f4", "Float64": "<f8", "Int32": "<i4", "Int64": "<i8"}


def arrays_of(path):
    """The arrays of a VTK file by name, and its root; only what the format says is relied on."""
    root = ElementTree.parse(path).getroot()
    arrays = {}
    for array in root.iter("DataArray"):
        raw = base64.b64decode(array.text)
        assert int(np.frombuffer(raw[:4], "<u4")[0]) == len(raw) - 4
        arrays[array.attrib["Name"]] = np.frombuffer(raw[4:], KINDS[array.attrib["type"]])
    return arrays, root


@pytest.fixture
def two_mirrors(reconstruction):
    """The second mirror is seen through the first, and one point through both."""
    mirrors = reconstruction["mirrors"].to_dataset(inherit=False)
    deeper = mirrors.assign(
        **{name: mirrors[name] + 1.0 for name in mirrors if name.startswith(("x", "y", "folded"))},
        parent=("mirror", [0]), generation=("mirror", [2]),
    )  # fmt: skip
    objects = reconstruction["objects"].to_dataset(inherit=False)
    chain = objects["chain"].values.astype("<U3")
    chain[-1] = "0/0"
    between = np.arange(chain.size) == 1
    nodes = {node.path: node.to_dataset(inherit=False) for node in reconstruction.subtree}
    nodes["/mirrors"] = xr.concat([mirrors, deeper], "mirror")
    nodes["/objects"] = objects.assign(chain=("point", chain), interpolated=("point", between))
    return xr.DataTree.from_dict(nodes)


@pytest.mark.parametrize("suffix", [".ply", ".pcd", ".csv", ".xyz", ".vtp"])
def test_places_far_from_the_origin_keep_their_digits(on_a_map, tmp_path, suffix):
    """In single precision, points of a radar in the coordinates of a map were a quarter of a metre off."""
    path = mf.export(on_a_map, tmp_path / f"cloud{suffix}")
    x, y = (on_a_map[f"objects/{axis}"].values for axis in "xy")
    np.testing.assert_allclose(places_in(path), np.stack([x, y, 0.0 * x], axis=-1), rtol=0.0, atol=1e-5)


def places_in(path):
    """The places (n, 3) [m] of the points of a file."""
    if path.suffix == ".ply":
        return np.asarray(trimesh.load(path).vertices)
    if path.suffix == ".vtp":
        return arrays_of(path)[0]["Points"].reshape(-1, 3)
    if path.suffix == ".pcd":
        header, _, table = path.read_bytes().partition(b"DATA binary\n")
        lines = dict(line.split(" ", 1) for line in header.decode().splitlines() if not line.startswith("#"))
        kinds = [
            f"<{kind.lower()}{size}" for kind, size in zip(lines["TYPE"].split(), lines["SIZE"].split(), strict=True)
        ]
        points = np.frombuffer(table, dtype=list(zip(lines["FIELDS"].split(), kinds, strict=True)))
        return np.stack([points[axis] for axis in "xyz"], axis=-1)
    rows = [line.replace(",", " ").split() for line in path.read_text().splitlines() if not line.startswith("#")]
    return np.array([row[:3] for row in rows if row[0] != "x"], dtype=float)


def test_walls_far_from_the_origin_keep_their_digits(on_a_map, tmp_path):
    corners = arrays_of(mf.export(on_a_map, tmp_path / "walls.vtp", what="mirrors"))[0]["Points"].reshape(-1, 3)
    mirrors = on_a_map["mirrors"]
    np.testing.assert_allclose(corners[0, :2], [mirrors["x0"].item(), mirrors["y0"].item()], rtol=0.0, atol=1e-5)


def test_clouds_carry_chain_mirror_and_confidence(two_mirrors, tmp_path):
    cloud = trimesh.load(mf.export(two_mirrors, tmp_path / "cloud.ply"))
    held = cloud.metadata["_ply_raw"]["vertex"]["data"]
    np.testing.assert_array_equal(held["chain"].ravel(), [-1, -1, 0, 0, 1])
    np.testing.assert_allclose(held["confidence"].ravel(), 0.9)
    for name, separator in (("cloud.csv", ","), ("cloud.xyz", " ")):
        path = mf.export(two_mirrors, tmp_path / name)
        lines = path.read_text().splitlines()
        heading = next(line for line in lines if "confidence" in line)
        columns = heading.removeprefix("# ").split(separator)
        rows = np.loadtxt(lines[lines.index(heading) + 1 :], delimiter=separator)
        np.testing.assert_array_equal(rows[:, columns.index("chain")], [-1, -1, 0, 0, 1])
        np.testing.assert_array_equal(rows[:, columns.index("interpolated")], [0, 1, 0, 0, 0])
        np.testing.assert_allclose(rows[:, :2], np.stack([two_mirrors["objects/x"], two_mirrors["objects/y"]], 1))
    assert "# chain 1 is by way of mirrors 0/0" in lines
    path = mf.export(two_mirrors, tmp_path / "cloud.vtp")
    np.testing.assert_array_equal(arrays_of(path)[0]["chain"], [-1, -1, 0, 0, 1])
    assert "<!-- chain 1 is by way of mirrors 0/0 -->" in path.read_text()
    assert mf.load(tmp_path / "cloud.csv").dims == ("y", "x")  # our own reader takes it too


def test_clouds_of_recordings_carry_frames(two_mirrors, tmp_path):
    arrays, _ = arrays_of(mf.export(join_frames([two_mirrors] * 2, {}), tmp_path / "cloud.vtp"))
    np.testing.assert_array_equal(arrays["frame"], np.repeat([0, 1], 5))
    np.testing.assert_array_equal(arrays["chain"], [-1, -1, 0, 0, 1, -1, -1, 2, 2, 3])


def test_mirrors_are_lines_in_a_floor_plan_and_faces_in_space(two_mirrors, folded_scan, tmp_path):
    arrays, root = arrays_of(mf.export(two_mirrors, tmp_path / "m.vtp", what="mirrors"))
    assert root.find(".//Piece").attrib["NumberOfLines"] == "4"
    points = arrays["Points"].reshape(4, 2, 3)
    np.testing.assert_array_equal(arrays["image"], [0, 0, 1, 1])
    np.testing.assert_allclose(points[0], [[0.4, 1.6, 0.0], [0.6, 0.9, 0.0]], rtol=1e-6)
    np.testing.assert_allclose(points[1], [[1.4, 2.6, 0.0], [1.6, 1.9, 0.0]], rtol=1e-6)
    np.testing.assert_array_equal(arrays["offsets"], [2, 4, 6, 8])
    arrays, root = arrays_of(mf.export(folded_scan, tmp_path / "m.vtp", what="mirrors"))
    assert root.find(".//Piece").attrib["NumberOfPolys"] == "2"
    np.testing.assert_allclose(arrays["Points"].reshape(2, 4, 3)[0, :, 1], [1.5, 2.5, 2.5, 1.5])


def test_pictures_keep_their_pixels_in_their_places(reconstruction, image, tmp_path):
    arrays, root = arrays_of(mf.export(reconstruction, tmp_path / "p.vti"))
    grid = root.find("ImageData").attrib
    assert grid["WholeExtent"] == "0 100 0 75 0 0"
    np.testing.assert_allclose(np.array(grid["Origin"].split(), float), [-0.5, 0.5, 0.0])
    np.testing.assert_allclose(np.array(grid["Spacing"].split(), float), [0.02, 0.02, 1.0])
    # x varies fastest, as VTK has it.
    np.testing.assert_array_equal(arrays["corrected"].reshape(76, 101), reconstruction["intensity"])
    np.testing.assert_array_equal(arrays["initial"].reshape(76, 101), reconstruction["initial/initial"])
    arrays, _ = arrays_of(mf.export(image, tmp_path / "i.vti"))
    found = arrays["image_amplitude"] * np.exp(1j * arrays["image_phase"])
    np.testing.assert_allclose(found.reshape(image.shape), image, rtol=1e-5)


def test_beams_of_a_volume_lie_where_they_look(tmp_path):
    axes = {"range": np.arange(1.0, 3.0, 0.5), "azimuth": [-10.0, 0.0, 10.0], "elevation": [0.0, 30.0]}
    volume = xr.DataArray(np.arange(24.0).reshape(4, 3, 2), dims=tuple(axes), coords=axes,
                          attrs={"radar_position": [0.0, 0.0, 1.0]})  # fmt: skip
    arrays, root = arrays_of(mf.export(volume, tmp_path / "v.vts"))
    assert root.find("StructuredGrid").attrib["WholeExtent"] == "0 1 0 2 0 3"
    points = arrays["Points"].reshape(4, 3, 2, 3)
    azimuth, elevation = np.radians(10.0), np.radians(30.0)
    there = [np.sin(azimuth) * np.cos(elevation), np.cos(azimuth) * np.cos(elevation), np.sin(elevation)]
    np.testing.assert_allclose(points[2, 2, 1], 2.0 * np.array(there) + [0.0, 0.0, 1.0], rtol=1e-6)
    assert arrays["image"].reshape(4, 3, 2)[2, 2, 1] == volume.values[2, 2, 1]
    with pytest.raises(mf.InputError, match=r"ends in \.vts"):
        mf.export(volume, tmp_path / "v.vti")


def test_vtk_reads_them(two_mirrors, tmp_path):
    io = pytest.importorskip("vtkmodules.vtkIOXML", reason="VTK, of 110 MB, is no part of any extra")
    for name, what, reader in (("p.vtp", "points", io.vtkXMLPolyDataReader()),
                               ("m.vtp", "mirrors", io.vtkXMLPolyDataReader()),
                               ("i.vti", "points", io.vtkXMLImageDataReader())):  # fmt: skip
        reader.SetFileName(str(mf.export(two_mirrors, tmp_path / name, what=what)))
        reader.Update()
        found = reader.GetOutput()
        if name == "p.vtp":
            assert found.GetNumberOfVerts() == 5
            assert found.GetPointData().GetArray("chain").GetValue(4) == 1
        elif name == "m.vtp":
            assert (found.GetNumberOfLines(), found.GetCellData().GetArray("image").GetValue(3)) == (4, 1)
        else:
            assert found.GetDimensions() == (101, 76, 1)


@pytest.mark.slow
def test_the_command_line_exports_each_kind(reconstruction, image, sweep, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    mf.save(reconstruction, "r.nc")
    mf.save(image, "i.nc")
    mf.save(sweep, "s.nc")
    for arguments, name in ((["r.nc"], "a.vtp"), (["r.nc", "--what", "mirrors"], "b.vtp"), (["r.nc"], "c.vti"),
                            (["i.nc"], "d.vti"), (["r.nc"], "e.geojson")):  # fmt: skip
        assert main(["export", *arguments, "-o", name, "--json"]) == 0
        found = check("export", capsys.readouterr().out)
        assert (found.kind, found.files) == ("export", [name])
    assert main(["export", "s.nc", "-o", "scan", "--json"]) == 0
    assert check("export", capsys.readouterr().out).kind == "scan"
    for arguments, word in ((["r.nc", "-o", "x.stl"], "expected one of .ply"), (["i.nc", "-o", "x.ply"], ".vti"),
                            (["r.nc", "-o", "x.ply", "--what", "mirrors"], ".vtp"),
                            (["r.nc", "-o", "r.nc"], "input")):  # fmt: skip
        assert main(["export", *arguments]) == 2
        assert word in capsys.readouterr().err


def test_geojson_names_every_feature(two_mirrors, tmp_path):
    content = json.loads(mf.export(two_mirrors, tmp_path / "plan.geojson").read_text())
    layers = [feature["properties"]["layer"] for feature in content["features"]]
    assert layers == ["mirrors"] * 2 + ["mirror-images"] * 2 + ["points"] * 5
    assert (
        content["features"][1]["properties"] | {"mirror": 1, "chain": "0/0", "parent": 0}
        == (content["features"][1]["properties"])
    )
    last = content["features"][-1]
    assert last["geometry"] == {"type": "Point", "coordinates": [0.14, 1.54]}
    assert last["properties"]["chain"] == "0/0"
