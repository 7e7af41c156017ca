"""Folding is as exact after several bounces as after one; what ends it is that echoes get faint."""

from __future__ import annotations

import numpy as np
import pytest

from mirrorfold.reproducing.experiments import bounces
from mirrorfold.reproducing.findings import Findings
from mirrorfold.reproducing.parts.zigzag import corridor, way
from mirrorfold.reproducing.work import Work
from mirrorfold.scenes.visibility import visible_truth

pytestmark = [pytest.mark.slow, pytest.mark.replay]


@pytest.fixture(scope="module")
def found() -> Findings:
    return bounces.run(Work(quick=True))


@pytest.mark.parametrize("count", [1, 2, 3, 4, 5])
def test_a_corridor_shows_its_target_by_so_many_bounces_and_no_fewer(count):
    scene = corridor(count, 7, "pec")
    points, normals, _ = scene.surface[count].sample(0.01)
    assert scene.surface[count].name == "target"
    assert not visible_truth(scene, points, normals, bounces=count - 1)[1].any()
    assert visible_truth(scene, points, normals, bounces=count)[1].mean() >= 0.3
    assert 1.1 + 0.65 * count < way(scene, count) < 1.3 + 0.85 * count + 0.15


def test_one_bounce_is_folded_and_three_walls_of_concrete_lose_too_much(found):
    at = {n: found.numbers[f"concrete_0_dbm_threshold_18_db_{n}_bounces_completeness_cells"] for n in (1, 3)}
    assert at[1] > 0.8
    assert at[3] < 0.2
    assert found.numbers["concrete_0_dbm_threshold_18_db_1_bounces_median_m"] < 0.01


def test_the_link_budget_promises_more_than_folding_keeps(found):
    key = "concrete_0_dbm_threshold_18_db"
    assert found.numbers[f"{key}_plan_promises_bounces"] > found.numbers[f"{key}_folding_reaches_bounces"]
    # Each wall takes twice 6.4 dB, and the way grows from 1.2 m by 0.75 m each, with the fourth power.
    snr = [found.numbers[f"{key}_{n}_bounces_plan_snr_db"] for n in (1, 3)]
    assert snr[0] - snr[1] == pytest.approx(4 * 6.4 + 40 * np.log10(3.45 / 1.95), abs=0.5)


def test_data_and_claims_are_complete(found):
    assert {claim.verdict for claim in found.claims} == {"new"}
    assert found.data.sizes["scene"] == 4
    assert all(variable.attrs["units"] for variable in found.data.data_vars.values())
