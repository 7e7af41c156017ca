"""In the mirror or through it: what the page says, at reduced size."""

from __future__ import annotations

import numpy as np
import pytest

from mirrorfold.reproducing import EXPERIMENTS, Work
from mirrorfold.reproducing.experiments import semi_transparent


@pytest.fixture(scope="module")
def found():
    return EXPERIMENTS["semi-transparent"].run(Work(quick=True))


def test_bands_follow_fresnel():
    """At normal incidence the polarizations are the same; near Brewster's angle TM is hardly reflected, and passes."""
    upright, steep = (semi_transparent._band_of(np.radians([angle]), 0)[:, 0] for angle in (0.01, 62.0))
    np.testing.assert_allclose(upright, 0.0, atol=1e-3)
    assert steep.max() < -15.0
    assert semi_transparent._band_of(np.radians([62.0]), 1).min() > 1.0


@pytest.mark.replay
@pytest.mark.slow
def test_two_polarizations_decide_and_one_does_not(found):
    numbers = found.numbers
    assert numbers["echoes"] > 20
    assert numbers["right_two"] > 0.95
    assert numbers["right_opaque"] < 0.8
    assert numbers["right_one"] >= numbers["right_opaque"]
    assert numbers["f_cells_two"] > numbers["f_cells_opaque"] + 0.05
    assert numbers["passed_after_m"] < 0.85 * numbers["passed_before_m"]


@pytest.mark.replay
@pytest.mark.slow
def test_the_claims_say_what_the_numbers_say(found):
    told, one, place, use = found.claims
    assert told.verdict == "agrees"
    assert f"{100 * found.numbers['right_one']:.0f} %" in one.measured
    assert f"{1e3 * found.numbers['passed_after_m']:.1f} mm" in place.measured
    assert f"{found.numbers['f_cells_published']:.2f} as published" in use.measured


@pytest.mark.replay
@pytest.mark.slow
def test_the_data_hold_what_the_pictures_show(found):
    data = found.data
    assert data.sizes["echo"] == found.numbers["echoes"]
    passed = data["truth"] == 1.0
    assert float(data["ratio_db"][passed].median()) > 2.0
    assert float(data["ratio_db"][~passed].median()) < -5.0
