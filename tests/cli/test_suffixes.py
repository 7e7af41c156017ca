"""Names of outputs that say another kind of file than what is written are refused, and nothing is written."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from point_target import echo, line_of

import mirrorfold as mf
from mirrorfold.cli import main
from mirrorfold.io.readers import readers


@pytest.fixture(scope="module")
def sweep():
    f, tx = np.linspace(290e9, 300e9, 11), line_of(5)
    return mf.make_sweep(echo(f, tx, tx), frequency=f, tx_position=tx, rx_position=tx)


@pytest.mark.parametrize(
    "arguments",
    [
        ["focus", "s.nc", "-o", "image.png"],
        ["simulate", "SCENE", "-o", "a.txt"],
        ["calibrate", "s.nc", "-o", "a.mat"],
        ["import", "s.nc", "-o", "a.csv"],
        ["fold", "s.nc", "-o", "a.html"],
        ["export", "s.nc", "-o", "a.vtp"],
    ],
)
def test_a_name_of_another_kind_of_file_is_refused(sweep, scene_file, arguments, tmp_path, monkeypatch, capsys):
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    mf.save(sweep, "s.nc")
    assert main([str(scene_file) if word == "SCENE" else word for word in arguments]) == 2
    assert f"{arguments[-1]}: has the suffix" in capsys.readouterr().err
    assert [path.name for path in (tmp_path / "here").iterdir()] == ["s.nc"]


def test_save_refuses_it_too(sweep, tmp_path):
    with pytest.raises(mf.InputError, match=r"'\.npz', and a netCDF file is written, expected \.nc"):
        mf.save(sweep, tmp_path / "a.npz")
    mf.save(sweep, tmp_path / "sweep")
    mf.save(sweep, tmp_path / "sweep.h5")


def test_every_reader_and_writer_says_its_suffixes(sweep, tmp_path, monkeypatch):
    """Those of readers of other packages count, too, and one that cannot be loaded hinders nothing."""
    mine = replace(readers()["citi"], name="mine", suffixes=(".mine",))
    monkeypatch.setattr("mirrorfold.io.readers.readers", lambda: readers() | {"mine": mine})
    for suffix in (".mine", ".cti", ".S2P", ".ply", ".vts", ".geojson", ".svg", ".toml"):
        with pytest.raises(mf.InputError, match=f"has the suffix '{suffix}'"):
            mf.save(sweep, tmp_path / f"a{suffix}")

    def broken():
        raise mf.InputError("cannot be loaded")

    monkeypatch.setattr("mirrorfold.io.readers.readers", broken)
    mf.save(sweep, tmp_path / "a.mine")
