"""What the live page of a reconstruction saves."""

from __future__ import annotations

import numpy as np
import pytest
from serving import WALLS, opened, two_walls

import mirrorfold as mf


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
