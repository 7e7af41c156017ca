"""What the command line says where a frame has to be named, or a level has a unit."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

import mirrorfold as mf
from mirrorfold.cli import main


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
