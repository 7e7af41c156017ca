"""A pillar as a mirror: the view gained, and what it costs, at reduced size."""

from __future__ import annotations

import numpy as np
import pytest

from mirrorfold.reproducing import EXPERIMENTS, Work
from mirrorfold.reproducing.experiments import convex


@pytest.fixture(scope="module")
def found():
    return EXPERIMENTS["convex"].run(Work(quick=True))


def test_a_pillar_is_seen_over_its_width_and_shows_the_room():
    """A small, far pillar is met by parallel rays: seen up to 80 degrees it turns them by 4 times as much less."""
    seen, shown = convex.view_of(1e-4)
    away = np.linalg.norm(convex.HIT)
    assert np.radians(seen) == pytest.approx(2e-4 * np.sin(convex.GRAZING) / away, rel=1e-3)
    assert shown == pytest.approx(4.0 * 80.0 - seen, rel=1e-3)


@pytest.mark.parametrize("radius", [0.1, 0.4, np.inf])
def test_the_ghost_obeys_the_law_of_reflection(radius):
    """The way to a point that is moved aside is shortest where both angles are equal."""
    target = convex._target() + np.array([0.02, 0.05])
    ghost, hit = convex._ghost(radius, target)
    normal = convex._normal() if np.isinf(radius) else (hit - (convex.HIT - radius * convex._normal())) / radius
    way, rest = hit / np.linalg.norm(hit), (target - hit) / np.linalg.norm(target - hit)
    assert -way @ normal == pytest.approx(rest @ normal, abs=1e-6)
    length = np.linalg.norm(hit) + np.linalg.norm(target - hit) - convex.RADIUS
    np.testing.assert_allclose(ghost, length * way, atol=1e-9)


@pytest.mark.replay
@pytest.mark.slow
def test_the_point_moves_as_the_pencil_of_rays_says(found):
    np.testing.assert_allclose(found.data["growth"], found.data["growth_predicted"], rtol=0.01)
    assert found.numbers["growth_of_a_flat_mirror"] == pytest.approx(1.0, abs=2e-3)
    assert found.numbers["cross_width_m"] / found.numbers["cross_width_flat_m"] == pytest.approx(
        found.numbers["growth"], rel=0.05
    )
    assert found.numbers["level_off_most_db"] < 1.5
    assert found.numbers["ghost_error_largest_m"] < 1e-3


@pytest.mark.replay
@pytest.mark.slow
def test_what_only_the_pillar_shows_is_folded(found):
    assert found.numbers["f_cells_curved"] > 0.9
    assert found.numbers["f_cells_flat"] == 0.0
    assert found.numbers["curvature_error_largest"] < 0.03


@pytest.mark.replay
@pytest.mark.slow
def test_the_claims_say_what_the_numbers_say(found):
    view, cost, level, blind = found.claims
    assert view.verdict == cost.verdict == "agrees"
    assert f"{found.numbers['shown_deg']:.0f}" in view.measured
    assert f"{found.numbers['growth']:.1f} times" in cost.measured
    assert level.verdict == blind.verdict == "new"
    assert len(found.tables[0].rows) == found.data.sizes["radius"]
