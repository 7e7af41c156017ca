"""A radar of one transmitter sees a corner around the corner as one of many does, in its own, wider cells."""

from __future__ import annotations

from dataclasses import replace
from importlib.resources import files

import pytest

import mirrorfold as mf
from mirrorfold.scenes.arrays import LinearArray


@pytest.mark.slow
def test_what_is_hidden_is_found_by_one_transmitter():
    scene = mf.load(files("mirrorfold").joinpath("scenes", "shipped", "hidden_corner.toml"))
    one = replace(scene, array=LinearArray(elements=1, pitch=scene.array.pitch, rx=scene.array))
    assert one.array.tx_position.tolist() == scene.array.tx_position[80:81].tolist()
    score = mf.score(mf.reconstruct(mf.simulate(one, snr_db=30.0, seed=3)), scene)
    assert score.f_score_cells > 0.9
    assert score.hidden.precision_cells > 0.75  # side lobes of one aperture fall as 1 / u, and some stand beside an arc
    assert score.hidden.completeness_cells > 0.9
