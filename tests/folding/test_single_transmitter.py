"""A radar of one transmitter sees a corner around the corner as one of many does, in its own, wider cells."""

from __future__ import annotations

from importlib.resources import files

import pytest

import mirrorfold as mf


@pytest.mark.slow
def test_what_is_hidden_is_found_by_one_transmitter():
    scene = mf.load(files("mirrorfold").joinpath("scenes", "shipped", "hidden_corner.toml"))
    sweep = mf.simulate(scene, snr_db=30.0, seed=3)
    one = sweep.isel(tx=[sweep.sizes["tx"] // 2])
    score = mf.score(mf.reconstruct(one), scene)
    assert score.f_score_cells > 0.9
    assert score.hidden.precision_cells > 0.75  # side lobes of one aperture fall as 1 / u, and some stand beside an arc
    assert score.hidden.completeness_cells > 0.9
