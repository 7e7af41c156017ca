"""What lies on the flank of an explained wave is explained with it; what is brighter or farther away is not."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from synthetic import echoes_at, empty_view

from mirrorfold.tree.explaining.behind_walls import BEHIND
from mirrorfold.tree.explaining.flanks import AS_BRIGHT_DB, ASIDE_CELLS, FLANK_CELLS, flanks
from mirrorfold.tree.explaining.misplaced import LATE, MIXED
from mirrorfold.tree.explaining.reflected_on import REFLECTED_ON

VIEW = empty_view()
PEAK = np.array([0.1, 1.2])
RANGE, U = (value.item() for value in VIEW.to_polar(PEAK[None]))


def beside(cells_in_range, cells_in_direction):
    """A place so many resolution cells from the peak."""
    range_, u = RANGE + cells_in_range * VIEW.range_cell, U + cells_in_direction * VIEW.u_cell
    return range_ * np.array([u, np.sqrt(1.0 - u**2)])


CELLS = np.array([FLANK_CELLS, ASIDE_CELLS[REFLECTED_ON]])
"""How far the flanks of a wave reach in range and in direction, in resolution cells."""


def told(places, amplitude, peaks=(PEAK,), level=(1.0,), why=(REFLECTED_ON,)):
    explained = echoes_at(VIEW, np.reshape(peaks, (-1, 2)), np.array(level))
    found = SimpleNamespace(explained=explained, explanation=np.array(why, dtype=str))
    return list(flanks(echoes_at(VIEW, np.reshape(places, (-1, 2)), np.array(amplitude)), found, VIEW))


def test_a_flank_is_explained_with_its_wave():
    near = [beside(0.0, 0.7 * CELLS[1]), beside(0.7 * CELLS[0], 0.0), PEAK]
    assert told(near, [0.5, 0.9, 1.0]) == [REFLECTED_ON] * 3


@pytest.mark.parametrize("away", [(1.3, 0.0), (0.0, 1.3), (0.9, 0.9)])
def test_farther_away_it_is_another_wave(away):
    assert told([beside(*(np.array(away) * CELLS))], [0.5]) == [""]


def test_what_the_sweep_told_of_one_cell_holds_for_the_next_cell_at_most():
    for cells, expected in ((0.7, [MIXED]), (1.3, [""])):
        assert told([beside(0.0, cells)], [0.5], why=[MIXED]) == expected


def test_what_is_brighter_is_no_flank():
    bright = 10.0 ** (AS_BRIGHT_DB / 20.0)
    assert told([beside(0.0, 0.5)] * 2, [1.05 * bright, 0.95 * bright]) == ["", REFLECTED_ON]


def test_of_several_waves_the_brightest_explains_it():
    places = [beside(0.0, -0.8), beside(0.0, 0.8), beside(0.0, 1.2)]
    assert told([PEAK], [0.3], places, [1.0, 2.0, 0.5], [MIXED, LATE, REFLECTED_ON]) == [LATE]


def test_a_thing_behind_a_wall_explains_only_itself():
    assert told([PEAK], [0.3], [PEAK], [1.0], [BEHIND]) == [""]
    assert told([PEAK], [0.3], np.empty((0, 2)), [], []) == [""]
    assert told(np.empty((0, 2)), []) == []
