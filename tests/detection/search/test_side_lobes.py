"""Rows of side lobes of a glint that a part of the array sees are no mirrors; walls with a glint of their own are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from partial_glint import GLINT, HALF, PART, glint_image
from synthetic import diffuse, radar_view, together

from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.finding import find_echoes, find_mirrors, see
from mirrorfold.detection.image_echoes import find_ridges
from mirrorfold.detection.search.side_lobes import are_side_lobes, at_one_range


def seen_by(below):
    """View and echoes of a glint that only some of the pairs see."""
    view = see(glint_image(seen_below=below))
    return view, find_echoes(view)


@pytest.fixture(scope="module")
def ring():
    """View and echoes of a glint that half of the pairs see."""
    return seen_by(HALF)


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
def test_the_smaller_the_part_that_sees_a_glint_the_higher_its_lobes():
    """They are higher by the inverse of the part's length, 0.03 m of 0.08 m, and are told by standing at one range."""
    view, echoes = seen_by(PART)
    range_, u = view.to_polar(GLINT)
    aside = u - view.u[echoes.direction]
    beside = echoes.take((aside > 0.15) & (aside < 0.4) & (np.abs(echoes.range - range_) < 0.5 * view.range_cell))
    level = view.amplitude[view.row(np.array([range_]))[0]].max()
    height = beside.amplitude / view.part_lobes(level, aside[:1] * 0.0 + view.u[beside.direction] - u)
    assert np.median(height) == pytest.approx(0.08 / 0.03, rel=0.2)
    assert at_one_range(beside, view, np.arange(len(beside))).mean() > 0.9
    assert are_side_lobes(beside, beside.length, view)


@pytest.mark.parametrize(("slope", "told"), [(0.0, True), (0.5, False)])
def test_a_row_at_one_range_is_told_from_one_that_recedes(slope, told):
    """By half a range cell in a cell across, of which noise does not matter."""
    view = radar_view(np.array([[0.0, 1.0]]), np.array([1.0]))
    u = np.linspace(-4.0, 4.0, 25) * view.u_cell
    range_ = 1.0 + slope * u / view.u_cell * view.range_cell
    places = view.to_points(range_, u)
    row = Echoes.found(places, range_, view.column(u), np.ones(25), np.ones(25), 0.0 * u, 0.0, 1.0)
    assert (at_one_range(row, view, np.arange(25))[8:-8] == told).all()
    assert at_one_range(row, view, np.array([], dtype=int)).tolist() == []


def row_beside_glints(range_cells):
    """A row of 49 weak echoes, 10 to 26 cells beside 18 bright glints, so many range cells beyond 1 m: view and row."""
    view = radar_view(np.array([[0.0, 1.0]]), np.array([1.0]))
    glints = view.to_points(1.0 + np.arange(-4.0, 14.0) * view.range_cell, np.zeros(18))
    view = radar_view(glints, np.full(18, 100.0))
    u, range_ = np.linspace(10.0, 26.0, 49) * view.u_cell, 1.0 + range_cells * view.range_cell
    row = Echoes.found(view.to_points(range_, u), range_, view.column(u), np.ones(49), np.ones(49), 0.0 * u, 0.0, 1.0)
    return view, row


@pytest.mark.parametrize(("slope", "told"), [(0.0, True), (0.5, False)])
def test_a_wall_as_weak_as_side_lobes_of_many_glints_recedes(slope, told):
    """Side lobes of one glint stand at one range."""
    view, row = row_beside_glints(slope * np.linspace(0.0, 16.0, 49))
    range_, u = view.to_polar(row.position)
    level, _ = view.brightest_at(range_)
    assert (view.part_lobes(level, u) > 1.0).all()
    assert are_side_lobes(row, row.length, view) == told


@pytest.mark.parametrize(("deep", "told"), [(1.5, True), (2.5, False)])
def test_a_row_that_is_deeper_than_side_lobes_is_a_wall(deep, told):
    """Two thirds of it are in one range cell, and as weak as side lobes."""
    range_cells = deep * np.linspace(0.0, 1.0, 49) ** 3
    view, row = row_beside_glints(range_cells)
    assert np.mean(range_cells <= 1.0) > 0.66
    assert are_side_lobes(row, row.length, view) == told


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
