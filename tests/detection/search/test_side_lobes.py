"""Rows of side lobes of a glint that a part of the array sees are no mirrors; walls with a glint of their own are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from partial_glint import GLINT, glint_image
from synthetic import diffuse, radar_view, together

from mirrorfold.detection.finding import find_echoes, find_mirrors, see
from mirrorfold.detection.image_echoes import find_ridges
from mirrorfold.detection.search.side_lobes import are_side_lobes


@pytest.fixture(scope="module")
def ring():
    """View and echoes of a glint that half of the pairs see."""
    view = see(glint_image(partly=True))
    return view, find_echoes(view)


@pytest.mark.slow
def test_side_lobes_fall_as_one_over_their_distance(ring):
    view, _ = ring
    range_, u = view.to_polar(GLINT)
    level = view.amplitude[view.row(np.array([range_]))[0]]
    aside = np.linspace(0.1, 0.4, 31)
    found = level[view.column(u - aside)] / view.part_lobes(level.max(), aside)
    assert np.median(found) == pytest.approx(0.84, abs=0.15)  # 0.94 of an edge as long as the array, 0.56 of the pairs
    assert found.max() < 1.3


@pytest.mark.slow
def test_a_row_beside_the_glint_is_side_lobes_and_one_with_the_glint_is_not(ring):
    view, echoes = ring
    _, u = view.to_polar(GLINT)
    aside = u - view.u[echoes.direction]
    beside, around = echoes.take((aside > 0.05) & (aside < 0.3)), echoes.take((aside > -0.1) & (aside < 0.1))
    assert len(beside) > 50
    assert are_side_lobes(beside, beside.length, view)
    assert not are_side_lobes(around, around.length, view)
    nothing = echoes.take(aside > 10.0)
    assert not are_side_lobes(nothing, nothing.length, view)


@pytest.mark.parametrize("lobes", [False, True])
def test_a_wall_is_found_if_it_is_not_as_weak_as_side_lobes(lobes):
    """A wall that faces the radar stands at the range of a glint beyond its end, and is a mirror all the same."""
    view = radar_view(*diffuse((-0.25, 1.2), (0.1, 1.2), 3), noise=1e-3)
    usual = np.median(find_ridges(view, threshold_db=-40.0).amplitude)
    glint = np.array([[0.5, np.sqrt(1.2**2 - 0.5**2)]]), np.array([usual * (3000.0 if lobes else 10.0)])
    both = radar_view(*together(diffuse((-0.25, 1.2), (0.1, 1.2), 3), glint), noise=1e-3)
    echoes = find_ridges(view, threshold_db=-40.0)
    found = find_mirrors(replace(view, amplitude=np.maximum(view.amplitude, both.amplitude)), echoes)
    assert len(found) == (0 if lobes else 1)
