"""Images and point clouds of other tools: straight into folding."""

from __future__ import annotations

import h5py
import numpy as np
import pytest
import xarray as xr
from scipy.io import netcdf_file, savemat

import mirrorfold as mf
from mirrorfold.cli import main
from mirrorfold.errors import InputError


def content(image, form):
    """An image as other tools save it, with its options."""
    values, x, y = image.values, image["x"].values, image["y"].values
    return {
        "plain": ({"image": values, "x": x, "y": y}, {}),
        "turned": ({"img": values.T, "x_axis": x, "y_axis": y}, {}),
        "mesh": ({"I": np.abs(values), "X": np.meshgrid(x, y)[0], "Y": np.meshgrid(x, y)[1]}, {}),
        "falling": ({"image": values[::-1], "x": x, "y": y[::-1]}, {}),
        "named": ({"a": values, "b": np.ones((60, 60)), "p": x, "q": y}, {"image": "a", "x": "p", "y": "q"}),
        "millimetres": ({"image": values, "x": x * 1e3, "y": y * 1e3}, {"unit": "mm"}),
        "decibel": ({"image": 20 * np.log10(np.abs(values)), "x": x, "y": y}, {"decibel": True}),
        "single": ({"image": values, "x": x.astype(np.float32), "y": y.astype(np.float32)}, {}),
    }[form]


@pytest.mark.parametrize("form", ["plain", "turned", "mesh", "falling", "named", "millimetres", "decibel", "single"])
@pytest.mark.parametrize("suffix", [".npz", ".mat", ".h5"])
def test_an_image_is_the_same_however_it_was_saved(image, tmp_path, form, suffix):
    variables, options = content(image, form)
    path = tmp_path / f"image{suffix}"
    if suffix == ".npz":
        np.savez(path, **variables)
    elif suffix == ".mat":
        savemat(path, variables)
    else:
        with h5py.File(path, "w") as file:
            for name, values in variables.items():
                file[name] = values
    found = mf.import_image(path, **options)
    expected = np.abs(image) if form in ("mesh", "decibel") else image
    np.testing.assert_allclose(found.values, expected.values, rtol=1e-5)
    np.testing.assert_allclose(found["x"], image["x"], atol=1e-6)
    np.testing.assert_allclose(found["y"], image["y"], atol=1e-6)
    if not options:
        xr.testing.assert_allclose(np.abs(mf.load(path)), np.abs(found))


def test_classic_netcdf_images_are_loaded(image, tmp_path):
    with netcdf_file(tmp_path / "i.nc", "w") as file:
        for name in ("y", "x"):
            file.createDimension(name, image.sizes[name])
            file.createVariable(name, "f8", (name,))[:] = image[name].values
        file.createVariable("power", "f8", ("y", "x"))[:] = np.abs(image.values)
    np.testing.assert_allclose(mf.load(tmp_path / "i.nc").values, np.abs(image.values), rtol=1e-6)


def test_a_square_image_takes_its_axes_as_they_are_usual_or_named(tmp_path):
    values, axis = np.arange(9.0).reshape(3, 3), np.arange(3.0)
    np.savez(tmp_path / "i.npz", image=values, x=axis, y=axis)
    np.testing.assert_array_equal(mf.import_image(tmp_path / "i.npz").values, values)
    np.testing.assert_array_equal(mf.import_image(tmp_path / "i.npz", order="xy").values, values.T)


@pytest.mark.parametrize(
    ("variables", "options", "words"),
    [
        ({"image": np.ones((3, 4))}, {}, ["does not say the y", "--y"]),
        ({"image": np.ones((3, 4)), "x": np.arange(5.0), "y": np.arange(3.0)}, {}, ["shape (3, 4)", "x 5"]),
        ({"image": -np.ones((3, 4)), "x": np.arange(4.0), "y": np.arange(3.0)}, {}, ["--decibel"]),
        ({"x": np.arange(4.0)}, {}, ["no image"]),
        ({"image": np.ones((3, 4)), "x": np.arange(4.0), "y": np.arange(3.0)}, {"unit": "GHz"}, ["unit"]),
        ({"image": np.ones((3, 4)), "x": np.arange(4.0), "y": np.arange(3.0)}, {"cell": 0.1}, ["cell"]),
        ({"image": np.ones((3, 4)), "x": np.array([0, 1, 5, 6.0]), "y": np.arange(3.0)}, {}, ["steps from 1 to 4"]),
    ],
)
def test_what_is_missing_of_an_image_is_said(tmp_path, variables, options, words):
    np.savez(tmp_path / "i.npz", **variables)
    with pytest.raises(InputError) as caught:
        mf.import_image(tmp_path / "i.npz", **options)
    for word in [str(tmp_path / "i.npz"), *words]:
        assert word in str(caught.value)


def cloud_of(points, amplitude, path):
    """Write a cloud by its suffix."""
    table = np.column_stack([points, np.zeros(len(points)), amplitude])
    rows = [" ".join(map(repr, row)) for row in table.tolist()]
    if path.suffix == ".csv":
        text = "\n".join(["x,y,z,amplitude", *(row.replace(" ", ",") for row in rows)])
        path.write_text(text)
        return
    binary = table.astype("<f4").tobytes()
    names = ("x", "y", "z", "intensity")
    if path.suffix == ".ply":
        head = ["ply", "format binary_little_endian 1.0", f"element vertex {len(points)}"]
        head += [*(f"property float {name}" for name in names), "end_header", ""]
    else:
        head = ["VERSION .7", "FIELDS " + " ".join(names), "SIZE 4 4 4 4", "TYPE F F F F", "COUNT 1 1 1 1"]
        head += [f"WIDTH {len(points)}", "HEIGHT 1", f"POINTS {len(points)}", "DATA binary", ""]
    path.write_bytes("\n".join(head).encode() + binary)


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [".ply", ".pcd", ".csv"])
def test_a_cloud_becomes_a_plan_view_with_a_spot_for_each_point(tmp_path, suffix):
    rng = np.random.default_rng(0)
    points = rng.uniform(0.5, 1.5, (400, 2))
    amplitude = rng.uniform(0.1, 1.0, 400)
    path = tmp_path / f"cloud{suffix}"
    cloud_of(points, amplitude, path)
    image = mf.import_image(path, cell=0.05)
    assert image.dims == ("y", "x")
    assert float(image.max()) == pytest.approx(amplitude.max(), rel=1e-6)
    for point, value in zip(points, amplitude, strict=True):
        assert float(image.sel(x=point[0], y=point[1], method="nearest")) >= np.float32(value) * (1 - 1e-6)
    y, x = np.nonzero(image.values)
    pixels = np.stack([image["x"].values[x], image["y"].values[y]], axis=-1)
    away = np.abs(pixels[:, None] - points).max(axis=-1).min(axis=1)
    assert away.max() < 4.6 * 0.05


@pytest.fixture
def wall_and_ghosts():
    """The points of an oblique wall, of an object before it, and of its ghost behind it."""
    start, end = np.array([0.5, 1.9]), np.array([0.8, 0.9])
    normal = np.array([-(end - start)[1], (end - start)[0]]) / np.linalg.norm(end - start)
    wall = start + np.linspace(0, 1, 250)[:, None] * (end - start)
    angle = np.linspace(0, np.pi, 60)
    body = np.stack([-0.1 + 0.08 * np.cos(angle), 1.6 - 0.08 * np.sin(angle)], axis=-1)
    ghost = body - 2 * ((body - start) @ normal)[:, None] * normal
    return wall, body, ghost


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [".ply", ".npz", ".h5"])
def test_the_command_folds_what_other_tools_have_made(wall_and_ghosts, tmp_path, suffix, capsys):
    wall, body, ghost = wall_and_ghosts
    points = np.concatenate([wall, ghost])
    path = tmp_path / f"cloud{suffix}"
    if suffix == ".ply":
        cloud_of(points, np.concatenate([np.full(len(wall), 1.0), np.full(len(ghost), 0.5)]), path)
    else:
        x, y = np.arange(0.0, 2.5, 0.01), np.arange(0.5, 2.6, 0.01)
        distance = np.full((y.size, x.size), np.inf)
        for place in points:
            np.minimum(distance, np.hypot(x - place[0], y[:, None] - place[1]), out=distance)
        image = np.exp(-((distance / 0.015) ** 2)) + 1e-4
        if suffix == ".npz":
            np.savez(path, image=image, x=x, y=y)
        else:  # a volume whose middle holds the scene
            with h5py.File(path, "w") as file:
                file["volume"], file["x"], file["y"] = np.stack([1e-4 + 0 * image, image, 0.3 * image]), x, y
                file["z"] = np.array([0.0, 0.1, 0.2])
    out = tmp_path / "r.nc"
    assert main(["fold", str(path), "-o", str(out)]) == 0, capsys.readouterr().err
    found = mf.load(out)
    mirrors = found["mirrors"].to_dataset(inherit=False)
    assert mirrors.sizes["mirror"] == 1
    slope = float((mirrors["x1"] - mirrors["x0"])[0] / (mirrors["y1"] - mirrors["y0"])[0])
    assert np.degrees(np.arctan(slope)) == pytest.approx(np.degrees(np.arctan(-0.3)), abs=1.0)
    objects = found["objects"].to_dataset(inherit=False)
    folded = np.stack([objects["x"], objects["y"]], axis=-1)[objects["bounces"].values == 1]
    assert len(folded) > 10
    nearest = np.linalg.norm(folded[:, None] - body, axis=-1).min(axis=1)
    assert np.median(nearest) < 0.03


def test_clouds_without_extent_are_refused(tmp_path):
    cloud_of(np.ones((3, 2)), np.ones(3), tmp_path / "c.ply")
    with pytest.raises(InputError, match="coincide"):
        mf.import_image(tmp_path / "c.ply")
    cloud_of(np.array([[0.0, 0.0], [1.0, 1.0]]), np.ones(2), tmp_path / "c.ply")
    with pytest.raises(InputError, match="grid of"):
        mf.import_image(tmp_path / "c.ply", cell=1e-9)


def test_the_command_imports_images_by_name(image, tmp_path, capsys):
    np.savez(tmp_path / "i.npz", a=image.values, p=image["x"].values, q=image["y"].values)
    arguments = [
        "import",
        str(tmp_path / "i.npz"),
        "--image",
        "a",
        "--x",
        "p",
        "--y",
        "q",
        "-o",
        str(tmp_path / "i.nc"),
    ]
    assert main(arguments) == 0
    np.testing.assert_allclose(mf.load(tmp_path / "i.nc").values, image.values)


def test_units_in_the_file_count(image, tmp_path):
    path = tmp_path / "i.h5"
    with h5py.File(path, "w") as file:
        file["image"], file["x"], file["y"] = image.values, 100 * image["x"].values, image["y"].values
        file["x"].attrs["units"] = "cm"
    found = mf.import_image(path)
    np.testing.assert_allclose(found["x"], image["x"], atol=1e-12)
    np.testing.assert_allclose(found["y"], image["y"], atol=1e-12)


def test_amplitudes_of_points_are_taken_in_decibels_by_their_name_or_missed_aloud(tmp_path, capsys):
    path, table = tmp_path / "c.csv", np.array([[0.0, 1.0, 20.0], [0.5, 1.5, 40.0]])
    np.savetxt(path, table, delimiter=",", header="x,y,amplitude_dB", comments="")
    assert float(mf.import_image(path, cell=0.05).max()) == pytest.approx(100.0)
    np.savetxt(path, table, delimiter=",", header="x,y,snr", comments="")
    with pytest.warns(UserWarning, match="none of snr is known"):
        assert float(mf.import_image(path, cell=0.05).max()) == 1.0
    output = tmp_path / "i.nc"
    assert main(["import", str(path), "--image", "snr", "-o", str(output)]) == 0, capsys.readouterr().err
    assert float(mf.load(output).max()) == pytest.approx(40.0)


def test_the_command_imports_tables_of_points(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "points.csv").write_text("x,y,z,amplitude,chain\n0.0,1.0,0,3,1/0\n0.5,1.5,0,2,-1\n-0.5,1.2,0,1,0\n")
    assert main(["import", "points.csv", "-o", "image.nc"]) == 0
    assert float(mf.load("image.nc").max()) == 3.0
    samples = "f_GHz,x,y,amplitude,phase_deg\n" + "".join(f"{f},{x},0,1,0\n" for f in (290, 291) for x in (0, 0.001))
    (tmp_path / "samples.csv").write_text(samples)
    assert main(["import", "samples.csv", "-o", "sweep.nc"]) == 0
    assert mf.load("sweep.nc")["s"].dims == ("frequency", "position")
    assert main(["import", "missing.csv", "-o", "image.nc"]) == 2
    assert "missing.csv: does not exist" in capsys.readouterr().err
