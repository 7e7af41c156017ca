"""Sweeps of two polarizations: one dimension or two sweeps, imaged and folded alike; what is wrong said plainly."""

from __future__ import annotations

import numpy as np
import pytest

import mirrorfold as mf
from mirrorfold.cli import main
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


def test_metal_walls_fold_as_with_one_polarization_to_the_bit(both):
    te = both.isel(polarization=0).drop_vars("polarization")
    image = mf.focus(both)
    alone = mf.fold(image.isel(polarization=0).drop_vars("polarization"), sweep=te)
    for found in (mf.fold(image, sweep=both), mf.fold(image, sweep=both, transparent=False)):
        for name, column in alone["objects"].data_vars.items():
            np.testing.assert_array_equal(found["objects"][name].values, column.values)
        np.testing.assert_array_equal(found["intensity"], alone["intensity"])


def test_what_is_wrong_with_polarizations_is_said(both):
    te, tm = simulated(), simulated(polarization="TM")
    with pytest.raises(InputError, match="without names"):
        mf.focus(both.drop_vars("polarization"))
    with pytest.raises(InputError, match="X, TM"):
        mf.focus(both.assign_coords(polarization=["X", "TM"]))
    with pytest.raises(InputError, match="differ in their frequencies"):
        join_polarizations({"TE": te, "TM": tm.assign_coords(frequency=tm["frequency"] * 1.01)})
    with pytest.raises(InputError, match="differ in their shapes"):
        join_polarizations({"TE": te, "TM": tm.isel(frequency=slice(0, 50))})
    with pytest.raises(InputError, match="places of their transmitters"):
        join_polarizations({"TE": te, "TM": tm.assign_coords(tx_position=tm["tx_position"] + 0.01)})
    with pytest.raises(InputError, match="swap them"):
        join_polarizations({"TE": tm, "TM": te})
    with pytest.raises(InputError, match="vertical"):
        join_polarizations({"vertical": te})
    with pytest.raises(InputError, match="polarization"):
        mf.fold(mf.focus(te), sweep=both)
    with pytest.raises(InputError, match="expected TE or TM"):
        mf.focus(te.assign_attrs(polarization="slanted"))
