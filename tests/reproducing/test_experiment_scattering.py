"""Between microwaves and light there are frequencies at which walls mirror and are visible at once."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.constants import speed_of_light

from mirrorfold.reproducing.experiments import scattering
from mirrorfold.reproducing.findings import Findings
from mirrorfold.reproducing.parts.window import MATERIALS, PAPER_ROUGHNESS, ROUGHNESSES, Window, reflected
from mirrorfold.reproducing.work import Work

pytestmark = [pytest.mark.slow, pytest.mark.replay]


@pytest.fixture(scope="module")
def found() -> Findings:
    return scattering.run(Work(quick=True))


def test_published_claims_hold_but_by_little_at_10_ghz(found):
    assert [claim.verdict for claim in found.claims] == ["agrees", "agrees", "agrees", "new", "new"]
    low = [found.numbers[f"{name}_scattered_10_ghz_db"] for name in MATERIALS]
    assert np.median(low) == pytest.approx(-60.3, abs=0.2)
    assert found.numbers["concrete_mirrored_300_ghz_db"] == pytest.approx(-6.4, abs=0.1)
    assert found.numbers["concrete_scattered_300_ghz_db"] == pytest.approx(-17.3, abs=0.1)
    assert found.numbers["pec_mirrored_300_ghz_db"] == pytest.approx(-0.5, abs=0.1)


def test_power_is_neither_lost_nor_made():
    angle = np.radians([0.0, 45.0, 80.0])
    for frequency in (10e9, 300e9, 3e12):
        mirrored, scattered = reflected("pec", np.array(frequency), angle, PAPER_ROUGHNESS)
        np.testing.assert_allclose(mirrored + scattered, 1.0, atol=1e-12)


def test_the_upper_edge_goes_as_one_over_the_height_for_slow_heights():
    """At the edge |R|^2 exp(-(2 k h cos 45)^2) is -25 dB, which a conductor gives in closed form."""
    edge = np.sqrt(2.5 * np.log(10.0)) * np.sqrt(2.0) / (2.0 * 0.1e-3) * speed_of_light / (2.0 * np.pi)
    assert Window.of("pec", (0.1e-3, 20e-3)).mirrors == pytest.approx(edge, rel=1e-3)
    assert Window.of("pec", (0.05e-3, 20e-3)).mirrors == pytest.approx(2.0 * edge, rel=1e-3)


def test_windows_are_open_and_rougher_walls_have_lower_ones(found):
    smooth, rough = (
        [
            found.numbers[f"{name}_h{height}_l200_um_window_{edge}_ghz"]
            for name in MATERIALS
            for edge in ("start", "stop")
        ]
        for height in (10, 100)
    )
    assert np.all(np.array(rough) < np.array(smooth))
    for name in MATERIALS:
        for height, length in ROUGHNESSES:
            key = f"{name}_h{1e6 * height:.0f}_l{1e6 * length:.0f}_um_window"
            assert found.numbers[f"{key}_start_ghz"] < 60.0 < 300.0 < found.numbers[f"{key}_stop_ghz"]


def test_full_waves_tell_the_two_formulas_apart(found):
    line = {
        name: found.numbers[f"line_h100_l200_um_0_deg_{name}"]
        for name in ("measured", "standard_error", "corrected", "ament")
    }
    assert line["standard_error"] < 0.08
    assert abs(line["measured"] - line["corrected"]) < 3.0 * line["standard_error"]
    assert line["measured"] - line["ament"] > 2.5 * line["standard_error"]


def test_data_have_units(found):
    for name, variable in found.data.data_vars.items():
        assert variable.attrs["units"], name
    assert float(found.data["scattered"].max()) <= 0.01
