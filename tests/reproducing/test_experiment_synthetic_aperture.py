"""The synthetic-aperture experiment: files, calibration, the drywall, and what is folded about it."""

import numpy as np
import pytest

from mirrorfold.reproducing import Findings, Work
from mirrorfold.reproducing.experiments import synthetic_aperture
from mirrorfold.reproducing.parts.scenes import shipped_plan

pytestmark = [pytest.mark.slow, pytest.mark.replay]


@pytest.fixture(scope="module")
def findings() -> Findings:
    return synthetic_aperture.run(Work(quick=True))


def test_reduced_band_has_the_same_steps():
    whole, part = shipped_plan("synthetic_aperture").band, synthetic_aperture._scene(Work(quick=True)).band
    steps = [(band.stop - band.start) / (band.points - 1) for band in (whole, part)]
    assert steps[0] == pytest.approx(steps[1])
    assert part.stop == whole.stop


def test_touchstone_files_bring_back_the_same_bits(findings):
    assert findings.numbers["files_apart"] == 0.0


def test_sphere_calibrates_to_a_thousandth_of_a_wavelength(findings):
    assert findings.numbers["worst_delay_m"] < 2e-6
    assert findings.numbers["uncalibrated_db"] < -10.0


def test_drywall_is_found_at_its_place(findings):
    draws = findings.data["draws"].to_dataset()
    assert np.abs(draws["angle_deg"]).max() < 0.25
    assert np.abs(draws["deeper_m"]).max() < 5e-3
    assert findings.numbers["angle_largest_deg"] == pytest.approx(float(np.abs(draws["angle_deg"]).max()))
    placed = findings.numbers["angle_largest_deg"] <= synthetic_aperture.ASKED_ANGLE_DEG
    assert findings.claims[0].verdict == ("agrees" if placed else "differs")


def test_ghosts_stand_in_the_shadow_of_the_drywall(findings):
    assert findings.numbers["ghosts_behind"] == 1.0
    assert findings.numbers["least_seen"] > 0.5
    assert findings.claims[1].verdict == "agrees"


def test_folded_to_the_true_set_up(findings):
    assert findings.numbers["hidden_f_smallest"] >= 0.9
    assert findings.numbers["accuracy_m"] < findings.numbers["cell_m"]
    assert findings.claims[2].verdict == "agrees"
    assert findings.numbers["usual_f_smallest"] > 0.6
    precision, completeness = (float(findings.data["draws"][f"hidden_{name}"][0]) for name in
                               ("precision", "completeness"))  # fmt: skip
    score = 2.0 * precision * completeness / (precision + completeness)
    assert findings.numbers["hidden_f_mean"] == pytest.approx(score)
