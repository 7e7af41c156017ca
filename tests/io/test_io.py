"""Files: what goes in comes out, and what is broken is said in one sentence."""

from __future__ import annotations

import signal

import h5py
import numpy as np
import pytest
import xarray as xr
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from profiles import examples

import mirrorfold as mf
from mirrorfold.cli import main
from mirrorfold.errors import InputError
from mirrorfold.io import load_geometry
from mirrorfold.io.own import netcdf
from mirrorfold.io.readers import hdf5

ONE_FILE = settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=examples(60))


def test_a_sweep_comes_back_as_it_was(sweep, tmp_path):
    path = mf.save(sweep, tmp_path / "sweep.nc")
    xr.testing.assert_identical(mf.load(path), sweep)


def test_the_geometry_of_a_sweep_is_read_without_its_samples(sweep, image, tmp_path):
    geometry = load_geometry(mf.save(sweep, tmp_path / "sweep.nc"))
    for name in ("frequency", "tx_position", "rx_position"):
        xr.testing.assert_identical(geometry[name], sweep[name])
    assert "s" not in geometry
    assert not load_geometry(mf.save(image, tmp_path / "image.nc")).data_vars
    (tmp_path / "broken.nc").write_bytes((tmp_path / "sweep.nc").read_bytes()[:3000])
    with pytest.raises(InputError, match=r"broken\.nc"):
        load_geometry(tmp_path / "broken.nc")


def test_complex_numbers_are_stored_natively(sweep, tmp_path):
    with h5py.File(mf.save(sweep, tmp_path / "sweep.nc")) as file:
        assert file["s"].dtype == np.complex64
        assert file["s"].fletcher32


def test_attributes_of_every_kind_come_back(sweep, tmp_path):
    attrs = {
        "flag": True,
        "nothing": None,
        "steps": ["rounded", "gated"],
        "empty": [],
        "settings": {"gate": [0.1, 2.5], "on": False},
        "count": 3,
        "level": -20.5,
        "text": "plain, with [brackets",
    }
    loaded = mf.load(mf.save(sweep.assign_attrs(attrs), tmp_path / "sweep.nc"))
    assert {name: loaded.attrs[name] for name in attrs} == attrs


@pytest.mark.parametrize("part", [lambda z: z, abs])
def test_an_image_comes_back_as_it_was(image, part, tmp_path):
    image = part(image)
    loaded = mf.load(mf.save(image, tmp_path / "image.nc"))
    xr.testing.assert_identical(loaded, image.assign_attrs(mirrorfold_kind="image"))
    assert loaded.dtype == image.dtype


def test_a_volume_is_an_image(image, tmp_path):
    volume = image.expand_dims(z=[0.0, 0.1])
    xr.testing.assert_equal(mf.load(mf.save(volume, tmp_path / "volume.nc")), volume)


@pytest.mark.slow
def test_a_reconstruction_comes_back_as_it_was(reconstruction, tmp_path):
    loaded = mf.load(mf.save(reconstruction, tmp_path / "reconstruction.nc"))
    xr.testing.assert_identical(loaded, reconstruction)
    assert loaded["objects"]["x"].dims == ("point",)


@pytest.mark.slow
def test_a_reconstruction_without_mirrors_or_objects_comes_back(reconstruction, tmp_path):
    empty = reconstruction.copy()
    empty["/mirrors"] = xr.DataTree(reconstruction["/mirrors"].to_dataset(inherit=False).isel(mirror=slice(0)))
    empty["/objects"] = xr.DataTree(reconstruction["/objects"].to_dataset(inherit=False).isel(point=slice(0)))
    loaded = mf.load(mf.save(empty, tmp_path / "empty.nc"))
    assert loaded["mirrors"].sizes["mirror"] == 0
    assert loaded["objects"]["x"].shape == (0,)


@pytest.mark.slow
def test_places_of_objects_are_not_hidden_behind_the_pixels(reconstruction, tmp_path):
    plain = reconstruction.copy()
    objects = reconstruction["/objects"].to_dataset(inherit=False)
    plain["/objects"] = xr.DataTree(objects.reset_coords(["x", "y"]))
    loaded = mf.load(mf.save(plain, tmp_path / "reconstruction.nc"))
    np.testing.assert_array_equal(loaded["objects"]["x"].values, objects["x"].values)


@pytest.mark.slow
def test_nothing_is_left_to_read_once_a_file_is_loaded(sweep, reconstruction, tmp_path):
    paths = [mf.save(sweep, tmp_path / "a.nc"), mf.save(reconstruction, tmp_path / "b.nc")]
    loaded = [mf.load(path) for path in paths]
    for path in paths:
        path.unlink()
    xr.testing.assert_equal(loaded[0], sweep)
    xr.testing.assert_equal(loaded[1], reconstruction)


def test_a_file_from_elsewhere_with_s_is_a_sweep(sweep, tmp_path):
    foreign = sweep.drop_attrs()
    foreign.to_netcdf(tmp_path / "foreign.nc", engine="h5netcdf")
    xr.testing.assert_equal(mf.load(tmp_path / "foreign.nc"), sweep)


def test_an_image_that_xarray_has_written_is_an_image(image, tmp_path):
    """xarray keeps the kind as an attribute of the variable, where it was not looked for."""
    for name, written in (("plain.nc", image), ("bare.nc", image.drop_attrs())):
        written.rename("image").to_netcdf(tmp_path / name, engine="h5netcdf")
        loaded = mf.load(tmp_path / name)
        xr.testing.assert_equal(loaded, image)
        assert {key: loaded.attrs[key] for key in written.attrs} == pytest.approx(dict(written.attrs))


@pytest.mark.slow
def test_the_data_that_is_shared_is_read(shared_data):
    sweep = mf.load(shared_data / "two_walls_fullwave.nc")
    assert sweep["s"].shape == (401, 161, 161)
    assert np.isfinite(sweep["s"].values).all()


def refused(path, words):
    with pytest.raises(InputError, match=words) as caught:
        mf.load(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


def test_what_is_no_netcdf_file_is_refused(tmp_path):
    refused(tmp_path / "absent.nc", "does not exist")
    refused(tmp_path, "is a directory")
    for content in (b"", b"not a netCDF file at all"):
        (tmp_path / "text.nc").write_bytes(content)
        refused(tmp_path / "text.nc", "is not a netCDF-4 file")
    (tmp_path / "classic.nc").write_bytes(b"CDF\x01" + bytes(100))
    refused(tmp_path / "classic.nc", "holds no array of numbers")


def test_what_is_none_of_ours_is_refused(tmp_path):
    xr.Dataset({"t": ("x", [1.0])}).to_netcdf(tmp_path / "t.nc", engine="h5netcdf")
    refused(tmp_path / "t.nc", r"holds the variables \['t'\], expected a sweep, an image or")
    xr.Dataset(attrs={"mirrorfold_kind": "cake"}).to_netcdf(tmp_path / "cake.nc", engine="h5netcdf")
    refused(tmp_path / "cake.nc", "mirrorfold_kind is 'cake'")
    xr.Dataset(attrs={"mirrorfold_kind": [1, 2]}).to_netcdf(tmp_path / "two.nc", engine="h5netcdf")
    refused(tmp_path / "two.nc", "mirrorfold_kind is an array")
    xr.Dataset(attrs={"mirrorfold_kind": "image"}).to_netcdf(tmp_path / "image.nc", engine="h5netcdf")
    refused(tmp_path / "image.nc", "holds no variable 'image'")


def test_a_sweep_is_checked_when_it_is_read(sweep, tmp_path):
    sweep.drop_vars("tx_position").to_netcdf(tmp_path / "sweep.nc", engine="h5netcdf")
    refused(tmp_path / "sweep.nc", "no coordinate 'tx_position'")


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda groups: groups.pop("/mirrors"), "the group /mirrors is missing"),
        (lambda groups: groups.update({"/": groups["/"].drop_vars("intensity")}), "'intensity' is missing from"),
        (lambda groups: groups["/"].attrs.update(mirrorfold_kind="image"), "holds no variable 'image'"),
    ],
)
def test_a_reconstruction_is_checked_when_it_is_read(reconstruction, spoil, words, tmp_path):
    groups = {node.path: node.to_dataset(inherit=False) for node in reconstruction.subtree}
    spoil(groups)
    xr.DataTree.from_dict(groups).to_netcdf(tmp_path / "r.nc", engine="h5netcdf")
    refused(tmp_path / "r.nc", words)


def test_variables_with_wrong_dimensions_are_refused(reconstruction):
    wrong = reconstruction.copy()
    objects = reconstruction["/objects"].to_dataset(inherit=False)
    wrong["/objects"] = xr.DataTree(objects.rename(point="points"))
    with pytest.raises(InputError, match=r"has dimensions \('points',\), expected \('point',\)"):
        mf.save(wrong, "never.nc")


def bent(mirrors):
    """The columns of a curved mirror."""
    return {"curvature": mirrors["x0"]} | {
        f"{folded}{axis}m": mirrors["x0"] for folded in ("", "folded_") for axis in "xy"
    }


@pytest.mark.parametrize(
    ("group", "change", "words"),
    [
        ("/", lambda d: d.assign(intensity=d["intensity"].astype("S3")), "'intensity' has type"),
        ("/initial", lambda d: d.assign(initial=1j * d["initial"]), "'initial' has type complex"),
        ("/objects", lambda d: d.assign(x_error=d["amplitude"].astype(str)), "'x_error' in the group /objects holds a"),
        ("/objects", lambda d: d.assign(chain=d["chain"].astype("S3")), "'chain' in the group /objects holds a value"),
        ("/objects", lambda d: d.assign(confocal=1.0), r"'confocal' .* has dimensions \(\)"),
        ("/objects", lambda d: d.assign(passed=d["amplitude"]), "'wall' is missing"),
        ("/mirrors", lambda d: d.assign(fill=d["strength"] > 0.0), "'fill' in the group /mirrors holds a value"),
        ("/mirrors", lambda d: d.assign(parent=0 * d["parent"]), "'parent' .* leads from a mirror to itself"),
        ("/mirrors", lambda d: d.assign(parent=0 * d["parent"] + 1), "'parent' .* is no whole number from -1 to 0"),
        ("/mirrors", lambda d: d.assign(curvature=d["strength"]), "'xm' is missing"),
        (
            "/mirrors",
            lambda d: d.assign(bent(d) | {"xm": np.nan * d["x0"]}),
            "'xm' in the group /mirrors holds a value",
        ),
        (
            "/mirrors",
            lambda d: d.assign(bent(d) | {"curvature": 1e300 * d["x0"]}),
            "'curvature' in the group /mirrors holds",
        ),
    ],
)
def test_pictures_and_columns_that_hold_no_numbers_are_refused(reconstruction, group, change, words):
    groups = {node.path: node.to_dataset(inherit=False) for node in reconstruction.subtree}
    with pytest.raises(InputError, match=words):
        mf.save(xr.DataTree.from_dict(groups | {group: change(groups[group])}), "never.nc")


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda i: i.transpose("x", "y"), r"has dimensions \('x', 'y'\)"),
        (lambda i: i.astype(str), "expected real or complex"),
        (lambda i: i.isel(x=slice(0)), "is empty"),
        (lambda i: i.drop_vars("x"), "no coordinate 'x'"),
        (lambda i: i.assign_coords(x=i["x"] * np.nan), "'x' holds a value that is not finite"),
        (lambda i: i.assign_coords(x=i["x"].assign_attrs(units="mm")), "x is in mm, .* expected m"),
        (lambda i: i.isel(x=slice(None, None, -1)), "equal rising steps"),
        (lambda i: i.isel(y=[0, 1, 3, 4]), "equal rising steps"),
        (lambda i: i.where(i["x"] > 0.09), "1000 pixels of 2000 are not finite"),
        (lambda i: i.assign_coords(z=np.nan), "z is nan, expected the one height"),
        (lambda i: i.assign_coords(z="up"), "z is 'up', expected the one height"),
    ],
)
def test_an_image_is_checked(image, spoil, words, tmp_path):
    with pytest.raises(InputError, match=words) as caught:
        mf.save(spoil(image), tmp_path / "image.nc")
    assert "\n" not in str(caught.value)
    assert list(tmp_path.iterdir()) == []


def test_only_our_own_objects_can_be_saved(tmp_path):
    with pytest.raises(InputError, match="got a dict"):
        mf.save({}, tmp_path / "x.nc")


@pytest.fixture(scope="module")
def content(tmp_path_factory):
    """The bytes of a small sweep file and a directory to play in."""
    folder = tmp_path_factory.mktemp("damage")
    position = np.zeros((4, 3))
    position[:, 0] = np.arange(4)
    s = np.random.default_rng(0).standard_normal((100, 4, 4)) + 1j
    sweep = mf.make_sweep(s, frequency=1e9 + 1e6 * np.arange(100), tx_position=position, rx_position=position)
    return mf.save(sweep, folder / "whole.nc").read_bytes(), folder, sweep


@pytest.mark.slow
@ONE_FILE
@given(share=st.floats(0.0, 1.0, exclude_max=True))
def test_a_truncated_file_is_refused(content, share):
    whole, folder, _ = content
    path = folder / "cut.nc"
    path.write_bytes(whole[: int(share * len(whole))])
    with pytest.raises(InputError, match=r"^\S*cut\.nc: ") as caught:
        mf.load(path)
    assert "\n" not in str(caught.value)


@pytest.mark.slow
@ONE_FILE
@given(place=st.floats(0.0, 1.0, exclude_max=True), garbage=st.binary(min_size=1, max_size=200))
def test_a_damaged_file_is_refused_or_still_a_valid_sweep(content, place, garbage):
    whole, folder, _ = content
    start = int(place * len(whole))
    path = folder / "damaged.nc"
    path.write_bytes(whole[:start] + garbage + whole[start + len(garbage) :])
    try:
        loaded = mf.load(path)
    except InputError as error:
        assert "\n" not in str(error)
    else:
        mf.check_sweep(loaded)


@pytest.mark.skipif(not hasattr(signal, "SIGSTOP"), reason="needs POSIX signals")
def test_a_file_that_never_releases_its_reader_is_refused(content, monkeypatch):
    """The library runs in a process of its own first, which stands still here."""
    whole, folder, _ = content
    path = folder / "endless.nc"
    path.write_bytes(whole)
    hdf5.prepare()
    hdf5._library._process.send_signal(signal.SIGSTOP)
    monkeypatch.setattr(hdf5, "PATIENCE", 0.2)
    refused(path, "reading it does not end")
    monkeypatch.undo()
    assert mf.load(path)["s"].shape == (100, 4, 4)


def test_damaged_samples_are_noticed(content):
    whole, folder, sweep = content
    samples = sweep["s"].values.tobytes()[:64]
    assert whole.count(samples) == 1
    path = folder / "flipped.nc"
    path.write_bytes(whole.replace(samples, samples[:32] + bytes(32)))
    refused(path, "is damaged")


@pytest.mark.parametrize("dims", [("frame", "y", "x"), ("polarization", "frame", "z", "y", "x")])
def test_many_images_are_kept_in_one_file(tmp_path, dims):
    shape = (3, 2, 2, 5, 4)[5 - len(dims) :]
    values = np.random.default_rng(0).standard_normal((*shape, 2)).view(complex)[..., 0]
    axes = {name: np.arange(size, dtype=float) for name, size in zip(dims, shape, strict=True) if name in "xyz"}
    film = xr.DataArray(values, dims=dims, coords=axes)
    again = mf.load(mf.save(film, tmp_path / "film.nc"))
    assert again.dims == dims
    np.testing.assert_array_equal(again.values, values)
    found = mf.info(again)
    assert list(found["extent"]) == [name for name in dims if name in "xyz"]
    brightest = np.unravel_index(np.abs(values).argmax(), shape)
    assert found["strongest_at"] == dict(zip(dims, brightest, strict=True))
    if "polarization" in dims:
        with pytest.raises(InputError, match="image: has a dimension polarization without names"):
            mf.fold(again)
    else:
        assert mf.fold(again)["intensity"].sizes["frame"] == shape[0]


@pytest.mark.filterwarnings("ignore:Neighbouring antennas stand")
def test_frames_are_focused_to_a_file(tmp_path):
    place = np.array([[-0.01, 0.0, 0.0], [0.01, 0.0, 0.0]])
    frequency = np.linspace(290e9, 300e9, 16)
    s = np.random.default_rng(1).standard_normal((3, 16, 2, 2, 2)).view(complex)[..., 0]
    sweep = mf.make_sweep(s[0], frequency=frequency, tx_position=place, rx_position=place)
    frames = sweep.drop_vars("s").assign(s=(("frame", *sweep["s"].dims), s.astype(np.complex64)))
    mf.save(frames, tmp_path / "s.nc")
    arguments = ["focus", str(tmp_path / "s.nc"), "-o", str(tmp_path / "i.nc"), "--x", "-0.02:0.02:0.01", "--y", "0.1"]
    assert main(arguments) == 0
    image = mf.load(tmp_path / "i.nc")
    assert image.sizes == {"frame": 3, "y": 1, "x": 5}
    one = mf.focus(sweep, x=image["x"].values, y=[0.1])
    np.testing.assert_allclose(image.values[0], one.values, atol=1e-4 * np.abs(one.values).max())


def test_a_small_file_that_declares_gigabytes_is_refused_unread(sweep, tmp_path, monkeypatch):
    """Chunks that were never written take no place in the file, and all of it in the memory."""
    path = mf.save(sweep, tmp_path / "sweep.nc")
    with h5py.File(path, "a") as file:
        del file["s"]
        file.create_dataset("s", (900, 640, 640), np.complex64, chunks=(10, 64, 64), compression="gzip")
    assert path.stat().st_size < 100_000
    monkeypatch.setattr(netcdf, "_read_groups", lambda *_: pytest.fail("the samples were read"))
    for read in (mf.load, mf.info):
        with pytest.raises(mf.InputError, match=r"would expand from \d+ bytes to 2.95e\+09"):
            read(path)
