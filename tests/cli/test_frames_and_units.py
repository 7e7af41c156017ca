"""What the command line says where a frame has to be named, or numbers have a unit, or another one than expected."""

from __future__ import annotations

import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray as xr

import mirrorfold as mf
from mirrorfold.cli import main
from mirrorfold.common.units import UNITS


@pytest.fixture
def recording(sweep, tmp_path, monkeypatch):
    """In the working folder: a sweep, two frames of it, their images, and a reconstruction of these."""
    monkeypatch.chdir(tmp_path)
    both = sweep.assign(s=xr.concat([sweep["s"], sweep["s"]], dim="frame"))
    images = mf.focus(both, x=np.linspace(-0.1, 0.2, 41), y=np.linspace(0.2, 0.5, 41))
    result = mf.fold(images)
    for name, one in {"one": sweep, "both": both, "images": images, "result": result}.items():
        mf.save(one, f"{name}.nc")
    return images, result


def test_frames_that_are_to_be_named_are_asked_for(recording, capsys):
    assert main(["fold", "images.nc", "--sweep", "one.nc", "-o", "out.nc"]) == 2
    assert "has no frames and the image 2; give" in capsys.readouterr().err
    assert main(["export", "both.nc", "-o", "folder"]) == 2
    assert "choose one with --frame N" in capsys.readouterr().err
    assert main(["export", "both.nc", "-o", "folder", "--frame", "1"]) == 0
    for draw, drawn in zip((mf.plot.image, mf.plot.corrected), recording, strict=True):
        with pytest.raises(mf.InputError, match=r"mf\.pick_frame"):
            draw(drawn)


def test_a_level_with_its_unit_is_told(recording, capsys):
    assert main(["fold", "images.nc", "--frame", "0", "-o", "out.nc", "--threshold-db", "-18dB"]) == 2
    assert "'-18dB' is no number; leave out its unit" in capsys.readouterr().err
    assert main(["fold", "images.nc", "--frame", "0", "-o", "out.nc", "--threshold-db", "-18"]) == 0


@pytest.mark.parametrize(
    ("in_millimetres", "doubt"),
    [
        ([], ""),
        (["tx", "rx"], "Neighbouring antennas stand 0.5 m apart"),
        (["rx"], "Transmitters and receivers stand up to 2 m apart, but the frequency steps tell"),
    ],
)
@pytest.mark.parametrize("options", [[], ["--wave-speed", "3e8"]])
def test_focusing_doubts_positions_in_millimetres_once(
    sweep, tmp_path, monkeypatch, capsys, in_millimetres, doubt, options
):
    monkeypatch.chdir(tmp_path)
    for side in in_millimetres:
        sweep[f"{side}_position"] = 1e3 * sweep[f"{side}_position"]
    mf.save(sweep, "s.nc")
    assert main(["focus", "s.nc", "-o", "i.nc", "--x", "-0.1:0.1:0.01", "--y", "0.3:0.5:0.01", *options]) == 0
    said = capsys.readouterr().err
    assert said.count(doubt or "probably in") == bool(doubt)
    assert said.count("--position-unit mm") == bool(doubt)


@pytest.mark.parametrize(
    ("unit", "verb", "said"),
    [
        ("MHz", ["focus", "s.nc", "-o", "i.nc"], "s.nc: frequencies up to 300000 Hz make no sense"),
        ("MHz", ["focus", "s.nc", "--dry-run"], "s.nc: frequencies up to 300000 Hz make no sense"),
        ("GHz", ["focus", "s.nc", "-o", "i.nc"], "s.nc: frequencies up to 300 Hz make no sense"),
        ("GHz", ["info", "s.nc"], "calibrate s.nc -o s-repaired.nc --frequency-unit GHz"),
    ],
)
def test_frequencies_in_another_unit_are_told_once_and_with_the_file(
    sweep, tmp_path, monkeypatch, capsys, unit, verb, said
):
    monkeypatch.chdir(tmp_path)
    mf.save(sweep, "s.nc")
    with h5py.File("s.nc", "r+") as file:
        file["frequency"][...] /= UNITS[unit]
    assert main(verb) == 2
    message = capsys.readouterr().err
    assert said in message
    assert message.count(f"probably in {unit}") == 1


@pytest.mark.slow
@pytest.mark.parametrize("verb", [["reconstruct", "both.nc", "-o", "out"], ["fold", "images.nc", "-o", "out.nc"]])
@pytest.mark.parametrize(
    ("name", "words"), [("p.vti", "there are 2 frames"), ("p.vts", "no volume of beams"), ("p.dxf", "need ezdxf")]
)
def test_an_export_that_cannot_be_made_is_refused_before_the_work(recording, monkeypatch, capsys, verb, name, words):
    """It was refused at the end, when everything else was written, and nothing was said of that."""
    monkeypatch.setitem(sys.modules, "ezdxf", None)
    before = sorted(Path().iterdir())
    assert main([*verb, "--export", name]) == 2
    assert words in capsys.readouterr().err
    assert sorted(Path().iterdir()) == before
