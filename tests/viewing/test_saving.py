"""What the live page of a reconstruction saves."""

from __future__ import annotations

import shlex

import numpy as np
import pytest
from serving import WALLS, opened, two_walls

import mirrorfold as mf
from mirrorfold.cli import main


@pytest.mark.slow
@pytest.mark.parametrize("mirrors", [None, WALLS[:1]], ids=["found", "given"])
def test_what_was_not_changed_is_saved_as_it_was_opened(tmp_path, mirrors):
    told = mf.fold(two_walls(), mirrors=mirrors)
    told.attrs |= {"command": "mirrorfold reconstruct sweep.nc -o out", "note": "kept"}
    mf.save(told, tmp_path / "r.nc")
    session = opened(tmp_path / "r.nc")
    first = session.state["document"]
    request = {"settings": first["values"], "mirrors": first["lines"]}
    session.fold({**request, "settings": {**first["values"], "threshold_db": -10.0}})
    saved = session.save({**request, "name": "same.nc"})
    assert saved == {"files": [str(tmp_path / "same.nc")], "command": told.attrs["command"]}
    assert mf.load(tmp_path / "same.nc").identical(mf.load(tmp_path / "r.nc"))
    changed = session.save({"settings": {**first["values"], "threshold_db": -10.0}, "name": "other.nc"})
    assert "--threshold-db -10" in changed["command"]
    assert not np.array_equal(mf.load(tmp_path / "other.nc")["intensity"], told["intensity"])


@pytest.mark.slow
@pytest.mark.parametrize("name", ["scan (1).nc", "wall+arc, d=3 m.nc", "it's 50% & more.nc", f"{90 * 'x'}.nc"])
def test_the_name_that_the_page_offers_can_be_saved_under_and_repeated(tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    mf.save(two_walls(), name)
    session = opened(name)
    saved = session.save({"name": session.state["document"]["save_as"], "mirrors": []})
    words = shlex.split(saved["command"])
    words[words.index("-o") + 1] = "again.nc"
    assert main(words[1:]) == 0
    assert np.array_equal(mf.load("again.nc")["intensity"], mf.load(saved["files"][0])["intensity"])
