"""Sweeps of two polarizations: one dimension or two sweeps, imaged and folded alike; what is wrong said plainly."""

from __future__ import annotations

import base64
import re

import numpy as np
import pytest
import xarray as xr

import mirrorfold as mf
from mirrorfold.cli import main
from mirrorfold.cli.figures import draw
from mirrorfold.errors import InputError
from mirrorfold.sweep import join_polarizations

WALL = {"name": "wall", "kind": "segment", "start": [0.3, 0.4], "end": [0.7, 1.3]}
SCENE = {
    "name": "two",
    "array": {"elements": 21, "pitch": 1.15e-3},
    "band": {"start": 116e9, "stop": 128e9, "points": 121},
    "surface": [
        WALL | {"roughness": {"rms_height": 0.1e-3, "correlation_length": 0.4e-3}},
        {"name": "disc", "kind": "circle", "center": [0.0, 1.0], "radius": 0.05},
    ],
}


def simulated(**more):
    return mf.simulate(mf.parse_scene(SCENE | more), bounces=1)


@pytest.fixture(scope="module")
def both():
    return simulated(polarization="both")


@pytest.mark.slow
def test_two_sweeps_are_one_with_a_dimension_and_image_alike(both, tmp_path):
    te, tm = simulated(), simulated(polarization="TM")
    assert tm.attrs["polarization"] == "TM"
    assert "polarization" not in te.attrs
    joined = join_polarizations({"TE": te, "TM": tm})
    np.testing.assert_array_equal(joined["s"], both["s"])
    mf.save(joined, tmp_path / "both.nc")
    kept = mf.load(tmp_path / "both.nc")
    assert kept["s"].dims[0] == "polarization"
    assert list(kept["polarization"].values) == ["TE", "TM"]
    image = mf.focus(kept)
    assert image.dims == ("polarization", "y", "x")
    one = mf.focus(te)
    assert np.abs(image.sel(polarization="TE").values - one.values).max() < 2e-4 * np.abs(one.values).max()
    assert "valid" in mf.info(kept)


@pytest.mark.slow
def test_two_files_become_one_on_the_command_line(both, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    mf.save(simulated(), "te.nc")
    mf.save(simulated(polarization="TM"), "tm.nc")
    assert main(["import", "tm.nc", "te.nc", "--polarization", "TM,TE", "-o", "both.nc"]) == 0
    joined = mf.load("both.nc")
    assert list(joined["polarization"].values) == ["TE", "TM"]
    np.testing.assert_array_equal(joined["s"], both["s"])
    assert main(["import", "te.nc", "--polarization", "TE", "-o", "named.nc"]) == 0
    assert mf.load("named.nc").attrs["polarization"] == "TE"
    mf.save(simulated().isel(frequency=slice(0, 50)), "short.nc")
    wrong = (
        ("te.nc tm.nc", "--polarization TE,TE", "TE, TM"),
        ("te.nc tm.nc", "--polarization vertical,horizontal", "TE, TM"),
        ("te.nc tm.nc", "--polarization TE", "one for each file"),
        ("te.nc tm.nc", "", "--polarization TE,TM"),
        ("te.nc tm.nc", "--polarization TM,TE", "swap them"),
        ("tm.nc", "--polarization TE", "says of itself"),
        ("te.nc short.nc", "--polarization TE,TM", "their shapes"),
        ("both.nc te.nc", "--polarization TE,TM", "several polarizations already"),
        ("te.nc tm.nc", "--polarization TE,TM --guess", "leave it out"),
    )
    capsys.readouterr()
    for files, options, said in wrong:
        assert main(["import", *files.split(), *options.split(), "-o", "wrong.nc"]) == 2
        sentence = capsys.readouterr().err
        assert said in sentence
        assert sentence.count("\n") == 1
        assert not (tmp_path / "wrong.nc").exists()


@pytest.mark.slow
def test_metal_walls_fold_as_with_one_polarization_to_the_bit(both):
    te = both.isel(polarization=0).drop_vars("polarization")
    image = mf.focus(both)
    alone = mf.fold(image.isel(polarization=0).drop_vars("polarization"), sweep=te)
    for found in (mf.fold(image, sweep=both), mf.fold(image, sweep=both, transparent=False)):
        for name, column in alone["objects"].data_vars.items():
            np.testing.assert_array_equal(found["objects"][name].values, column.values)
        np.testing.assert_array_equal(found["intensity"], alone["intensity"])


@pytest.mark.slow
def test_images_that_tell_a_part_of_their_band_fold_as_one_polarization(both):
    image = mf.focus(both, x=np.arange(-0.4, 0.8, 0.006), y=np.arange(0.2, 1.5, 0.006), tolerance=1e-2)
    del image.attrs["frequency_start"]
    alone = mf.fold(image.isel(polarization=0).drop_vars("polarization"))
    np.testing.assert_array_equal(mf.fold(image)["intensity"], alone["intensity"])


@pytest.mark.parametrize("of_the_other_time", [("TE",), ("TM",), ("TE", "TM")])
def test_sweeps_of_either_time_convention_are_joined_alike(of_the_other_time):
    sweeps = {name: simulated(polarization=name) for name in ("TE", "TM")}
    mixed = {
        name: sweep.assign(s=np.conj(sweep["s"])).assign_attrs(time_convention="exp(-jwt)")
        if name in of_the_other_time
        else sweep
        for name, sweep in sweeps.items()
    }
    joined = mf.check_sweep(join_polarizations(mixed))
    for name, sweep in sweeps.items():
        np.testing.assert_array_equal(joined["s"].sel(polarization=name), sweep["s"])


@pytest.mark.slow
def test_polarizations_that_were_chosen_are_joined_again(both):
    """After `sel`, the name is a coordinate of one value, at which xarray's own error ended the join."""
    te, tm = (both.sel(polarization=name) for name in ("TE", "TM"))
    joined = join_polarizations({"TM": tm, "TE": te})
    assert joined["s"].identical(both["s"])
    assert te["polarization"].item() == "TE"  # what was given stays as it was
    with pytest.raises(InputError, match="that of TE says of itself that its polarization is 'TM'; swap them"):
        join_polarizations({"TE": tm, "TM": te})
    assert mf.check_sweep(tm).attrs["polarization"] == "TM"
    with pytest.raises(InputError, match="another polarization than the sweep"):
        mf.calibrate.subtract_background(te, tm)


@pytest.mark.slow
def test_what_is_wrong_with_polarizations_is_said(both):
    te, tm = simulated(), simulated(polarization="TM")
    with pytest.raises(InputError, match="without names"):
        mf.focus(both.drop_vars("polarization"))
    with pytest.raises(InputError, match="'X', 'TM'"):
        mf.focus(both.assign_coords(polarization=["X", "TM"]))
    with pytest.raises(InputError, match="differ in their frequencies"):
        join_polarizations({"TE": te, "TM": tm.assign_coords(frequency=tm["frequency"] * 1.01)})
    with pytest.raises(InputError, match="differ in their shapes"):
        join_polarizations({"TE": te, "TM": tm.isel(frequency=slice(0, 50))})
    with pytest.raises(InputError, match="places of their transmitters"):
        join_polarizations({"TE": te, "TM": tm.assign_coords(tx_position=tm["tx_position"] + 0.01)})
    with pytest.raises(InputError, match="TE and TM are equal in every sample"):  # one file, named twice
        join_polarizations({"TE": te, "TM": te})
    with pytest.raises(InputError, match="swap them"):
        join_polarizations({"TE": tm, "TM": te})
    with pytest.raises(InputError, match="speed of their waves"):
        join_polarizations({"TE": te, "TM": tm.assign_attrs(wave_speed=2e8)})
    pairs = (("tx", "rx"), np.zeros(te["s"].shape[1:], dtype=bool))
    with pytest.raises(InputError, match="which pairs were measured"):
        join_polarizations({"TE": te, "TM": tm.assign_coords(measured=pairs)})
    places = {name: te[name] for name in ("frequency", "tx_position", "rx_position")}
    with pytest.raises(InputError, match="a dimension of polarizations before these"):
        mf.make_sweep(te["s"].values, polarization=["TE", "TM"], **places)
    with pytest.raises(InputError, match="vertical"):
        join_polarizations({"vertical": te})
    with pytest.raises(InputError, match="polarization"):
        mf.fold(mf.focus(te), sweep=both)
    with pytest.raises(InputError, match="expected TE or TM"):
        mf.focus(te.assign_attrs(polarization="slanted"))


@pytest.fixture
def both_images():
    """An image of each polarization, TM half as strong."""
    x, y = np.linspace(-0.5, 0.5, 11), np.linspace(0.5, 1.5, 21)
    te = np.hypot(x, y[:, None] - 1.0).astype(np.complex64)
    axes = {"polarization": ["TE", "TM"], "y": y, "x": x}
    return xr.DataArray(np.stack([te, 0.5j * te]), coords=axes, dims=tuple(axes), name="image").assign_attrs(
        mirrorfold_kind="image"
    )


def test_an_exported_picture_has_an_array_for_each_polarization(both_images, tmp_path):
    text = mf.export(both_images, tmp_path / "image.vti").read_text()
    names = ("image_TE_amplitude", "image_TE_phase", "image_TM_amplitude", "image_TM_phase")
    for name, value in zip(names, (abs(both_images[0]), None, abs(both_images[1]), None), strict=True):
        content = base64.b64decode(re.search(f'Name="{name}"[^>]*>([^<]*)<', text)[1])
        assert len(content) == 4 + 4 * 11 * 21  # as many numbers as the grid has points
        if value is not None:
            np.testing.assert_allclose(np.frombuffer(content[4:], "<f4"), value.values.ravel())


@pytest.mark.slow
def test_images_of_two_polarizations_are_shown_and_compared_by_te(both_images, tmp_path, capsys):
    path = tmp_path / "image.nc"
    mf.save(both_images, path)
    other = both_images.copy(data=2.0 * both_images.values)
    found = mf.compare(both_images, other)
    assert found.remarks == ["Of several polarizations TE was compared."]
    assert found.levels.median_db == pytest.approx(20.0 * np.log10(2.0), abs=1e-4)
    titles = [ax.get_title() for ax in mf.plot.compare(both_images, other).axes]
    assert titles[:2] == ["first, TE", "second, TE"]
    what, figure = draw(both_images, None, None, -40.0, "image.nc")
    assert what == "image"
    assert figure.axes[0].get_title() == "polarization TE"
    assert main(["show", str(path), "-o", str(tmp_path / "x.png")]) == 0


def test_an_exported_volume_of_beams_has_an_array_for_each_polarization(tmp_path):
    axes = {"polarization": ["TE", "TM"], "range": [1.0, 1.5], "azimuth": [-1.0, 0.0, 1.0], "elevation": [0.0, 1.0]}
    values = np.ones([len(axis) for axis in axes.values()], dtype=np.float32)
    volume = xr.DataArray(values, coords=axes, dims=tuple(axes), name="image").assign_attrs(mirrorfold_kind="image")
    text = mf.export(volume, tmp_path / "volume.vts").read_text()
    assert re.findall('Name="([^"]*)"', text) == ["image_TE", "image_TM", "Points"]
