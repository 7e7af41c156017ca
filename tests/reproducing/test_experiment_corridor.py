"""Around the corner of a corridor: what the page says of its walls and of what is hidden."""

from __future__ import annotations

import numpy as np
import pytest

from mirrorfold.reproducing import EXPERIMENTS, Work

pytestmark = [pytest.mark.slow, pytest.mark.replay]


@pytest.fixture(scope="module")
def found():
    pytest.importorskip("embreex")
    return EXPERIMENTS["corridor"].run(Work(quick=True))


def test_claims_agree_and_one_is_new(found):
    verdicts = [claim.verdict for claim in found.claims]
    assert verdicts == ["agrees"] * 4 + ["new"], [claim.measured for claim in found.claims]


def test_the_walls_stand_at_right_angles(found):
    assert abs(found.numbers["angle_between_deg"] - 90.0) < 0.15
    assert found.numbers["angle_between_se_deg"] < 0.1
    # Beams that straddle the corner turn a short wall by some hundredths of a degree; a longer one is not turned.
    assert abs(found.numbers["angle_end_wall_1m_deg"] - 90.0) < 0.03
    assert found.numbers["mirror_angle_error_deg"] < 0.1
    assert found.numbers["hidden_wall_angle_error_deg"] < 0.2


def test_what_is_hidden_is_folded_to_its_place_by_one_mirror(found):
    numbers = found.numbers
    for name, limit in (("mannequin", 0.006), ("box", 0.004), ("wall", 0.002)):
        assert numbers[f"{name}_distance_mean_m"] < limit, name
        assert numbers[f"{name}_covered"] > 0.85, name
        assert numbers[f"{name}_by_one_mirror"] > 0.95, name
        assert numbers[f"{name}_overlap"] > 0.75, name
    assert numbers["unexplained"] < 0.01


def test_the_section_shows_the_outline(found):
    assert found.numbers["section_distance_mean_m"] < 0.007
    assert found.numbers["section_distance_90_m"] < 0.012
    assert abs(found.numbers["mannequin_top_error_m"]) < 0.03


def test_the_box_is_as_bright_as_its_texture_makes_it(found):
    numbers = found.numbers
    assert 3.0 < numbers["box_over_wall_db"] < 7.0
    assert numbers["box_over_body_db"] > 4.0
    # Lambert's law, for the box of the scene and for one of a tenth of its diffuse share.
    assert abs(numbers["box_over_wall_db"] - numbers["predicted_box_over_wall_db"]) < 1.5
    drop = numbers["box_over_wall_at_share_0.3_db"] - numbers["box_over_wall_at_share_0.03_db"]
    assert abs(drop - 10.0) < 1.5
    assert 0.07 < numbers["least_diffuse_share"] < 0.15


def test_the_data_hold_what_the_pictures_show(found):
    assert set(found.figures) == {"plan", "hidden", "sections", "body", "levels", "space-before", "space"}
    points = found.data["points"].to_dataset()
    counted = {name: int(np.sum(points["nearest"].values == name)) for name in ("mannequin", "extinguisher box")}
    assert counted["mannequin"] == found.numbers["mannequin_points"]
    assert counted["extinguisher box"] == found.numbers["box_points"]
    # Folded, the box stands on the inner wall, far outside of the field of view.
    box = points.isel(point=points["nearest"].values == "extinguisher box")
    assert np.abs(box["x"].values + 0.96).max() < 0.2
    assert box["x_initial"].values.min() > 0.5
