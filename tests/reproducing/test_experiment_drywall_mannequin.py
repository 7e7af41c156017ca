"""A mannequin beside a drywall: what the page says of wall, body and foil."""

from __future__ import annotations

import numpy as np
import pytest

from mirrorfold.reproducing import EXPERIMENTS, Work

pytestmark = [pytest.mark.slow, pytest.mark.replay]


@pytest.fixture(scope="module")
def found():
    pytest.importorskip("embreex")
    return EXPERIMENTS["drywall-mannequin"].run(Work(quick=True))


def test_all_claims_agree(found):
    assert [claim.verdict for claim in found.claims] == ["agrees"] * 5, [claim.measured for claim in found.claims]


def test_the_wall_is_in_its_place(found):
    assert found.numbers["wall_angle_error_deg"] < 0.1
    assert found.numbers["wall_offset_error_m"] < 0.002


def test_scattering_inside_makes_the_wall_thicker_as_its_depths_and_the_beam_predict(found):
    numbers = found.numbers
    # A Gaussian beam of 32 mm on a wall at 45 degrees, there and back, is 34 mm wide at -10 dB across the wall.
    assert 0.031 < numbers["thickness_0mm_m"] < 0.036
    assert 0.003 < numbers["thicker_m"] < 0.006
    assert numbers["thicker_m"] > 5.0 * numbers["thicker_se_m"]
    assert abs(numbers["predicted_15mm_m"] - numbers["thickness_15mm_m"]) < 0.001
    assert 0.008 < numbers["range_cell_alone_m"] < 0.010
    # The mean depth of the scatterers, less the share of the face and the error of the fit.
    assert 0.003 < numbers["center_15mm_m"] < 0.0055
    assert abs(numbers["face_behind_15mm_m"]) < 0.002


def test_the_body_has_its_outline_and_pose(found):
    numbers = found.numbers
    assert numbers["body_distance_mean_m"] < 0.004
    assert numbers["body_distance_90_m"] < 0.008
    assert numbers["body_covered"] > 0.95
    assert 0.80 < numbers["body_overlap"] < 0.95
    # A body that is widened by the beam and half a step all around overlaps less: the outline is sharper than that.
    assert numbers["overlap_of_beam"] < numbers["body_overlap"]
    assert numbers["arms_error_deg"] < 4.0
    assert 15.0 < numbers["wall_over_body_db"] < 35.0
    assert abs(numbers["body_top_error_m"]) < 0.03


def test_the_foil_shines_and_its_absence_does_not(found):
    assert 11.0 < found.numbers["foil_contrast_db"] < 17.0
    assert abs(found.numbers["control_contrast_db"]) < 3.0
    # Fresnel's coefficient of the cloth, against which the foil reflects everything.
    assert 11.5 < found.numbers["foil_predicted_db"] < 13.5
    assert abs(found.numbers["foil_contrast_db"] - found.numbers["foil_predicted_db"]) < 3.0


def test_the_data_hold_what_the_pictures_show(found):
    data = found.data
    assert set(found.figures) == {"plan", "sections", "body", "thickness", "space"}
    profile = data["thickness/profile"]
    assert profile.sizes["volume_depth"] == 2
    assert np.abs(profile.max("depth") - 1.0).max() < 1e-6
    # The body in the section after folding: left of the wall, at the depth of its chest.
    plan = data["plan_after/amplitude"].sel(x=slice(-1.5, -1.0))
    z = plan.where(plan == plan.max(), drop=True)
    assert -1.32 < float(z["x"][0]) < -1.12
    assert 1.9 < float(z["y"][0]) < 2.6
    assert data["points"].sizes["point"] == found.numbers["body_points"]
