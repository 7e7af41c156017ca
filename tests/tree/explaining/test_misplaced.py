"""Echoes that come from elsewhere: what was measured of each of them, and what it says."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from synthetic import RANGE_CELL, U_CELL, echoes_at, empty_view

from mirrorfold.tree.explaining import misplaced as module
from mirrorfold.tree.explaining.directions import direction_ratio
from mirrorfold.tree.explaining.lobes import LOBE, lobe_level
from mirrorfold.tree.explaining.misplaced import (
    ABOVE_LOBES,
    GHOST_CELLS,
    LARGEST_WRAPPING_RATIO,
    LATE,
    MIXED,
    SMALLEST_DIRECTION_RATIO,
    confocal,
    known_confocal,
    known_ghosts,
    misplaced,
)
from mirrorfold.tree.explaining.wrapped import wrapping_ratio


@pytest.fixture(scope="module")
def view():
    return empty_view()


def cells(view, range_, u):
    """Places so many resolution cells away and aside."""
    return view.to_points(RANGE_CELL * np.array(range_), U_CELL * np.array(u))


@pytest.mark.parametrize("lobe", [0.0, 0.5])
def test_verdicts_follow_from_the_ratios(view, monkeypatch, lobe):
    """Lobes and late echoes first; of the others those whose ratio is no larger than that of a ghost in a lobe."""
    monkeypatch.setattr(module, "grating_lobe", lambda sweep: lobe)
    lobes = np.append(np.full(5, 0.5), 1.0)  # of echoes of amplitude one
    echoes = echoes_at(view, cells(view, np.full(6, 40.2), [0.2, 10.2, 20.2, 30.2, -10.2, -20.2]))
    least = max(SMALLEST_DIRECTION_RATIO, ABOVE_LOBES * lobe)
    wrapping = [0.5, LARGEST_WRAPPING_RATIO, 1.01 * LARGEST_WRAPPING_RATIO, 1.0, 1.0, 1.0]
    direction = [1.0, least, np.nan, 0.99 * least, 1.01 * least, np.nan]
    range_, u = view.to_polar(echoes.position)
    known = {(measure, float(r), float(sine)): value
             for measure, values in ((lobe_level, lobes), (wrapping_ratio, wrapping), (direction_ratio, direction))
             for r, sine, value in zip(range_, u, values, strict=True) if np.isfinite(value)}  # fmt: skip
    assert_array_equal(misplaced(echoes, None, view, known), ["", "", LATE, MIXED, "", LOBE])
    assert not misplaced(echoes.take(np.zeros(6, dtype=bool)), None, view).size


def test_each_echo_is_measured_once_by_itself(view, monkeypatch):
    calls = []

    def measured(sweep, view, range_, u):
        calls.append(np.round(range_ / RANGE_CELL, 3).tolist())
        return 10.0 * range_ / RANGE_CELL

    monkeypatch.setattr(module, "confocal_share", measured)
    places, known = cells(view, [40.1, 40.4, 40.4, 50.2], [5.2, 5.4, 5.4, 5.2]), {}
    np.testing.assert_allclose(confocal(places, None, view, known), [401.0, 404.0, 404.0, 502.0])
    assert calls == [[40.1, 40.4, 50.2]]
    # Of the next call only what is new is measured.
    more = np.concatenate([places, cells(view, [60.3], [5.2])])
    assert confocal(more, None, view, known)[-1] == pytest.approx(603.0)
    assert calls[1:] == [[60.3]]
    assert not confocal(np.empty((0, 2)), None, view, known).size
    assert len(calls) == 2


@pytest.mark.parametrize("turned", [0.0, 0.3, 0.5, 0.7])
def test_the_flanks_of_a_ghost_go_with_it_wherever_cells_begin(view, monkeypatch, turned):
    """Weaker echoes within half a cell of a ghost are of its waves; stronger ones, and those farther away, are not."""
    monkeypatch.setattr(module, "grating_lobe", lambda sweep: 0.0)
    beside = np.array([0.0, 0.9, -0.9, 0.8, 1.1]) * GHOST_CELLS
    places = cells(view, np.full(5, 40.0 + turned), 7.0 + turned + beside)
    echoes = echoes_at(view, places, np.array([1.0, 0.9, 0.3, 1.1, 0.5]))
    ratio = np.array([0.1, 1.0, 1.0, 1.0, 1.0])
    monkeypatch.setattr(module, "lobe_level", lambda sweep, view, range_, u: np.zeros(len(u)))
    monkeypatch.setattr(module, "wrapping_ratio", lambda sweep, view, range_, u: np.ones(len(u)))
    monkeypatch.setattr(module, "direction_ratio", lambda sweep, view, range_, u: ratio)
    assert_array_equal(misplaced(echoes, None, view), [MIXED, MIXED, MIXED, "", ""])


def test_what_was_known_before_holds_within_half_a_cell(view):
    known = cells(view, [40.0, 50.0], [5.0, 5.0])
    asked = cells(view, [40.0 + 0.99 * GHOST_CELLS, 50.0 + 1.01 * GHOST_CELLS, 50.0], [5.0, 5.0, 5.0])
    assert_array_equal(known_confocal(asked, view, known, np.array([0.3, 0.8])), [0.3, np.nan, 0.8])
    assert np.isnan(known_confocal(asked, view, np.empty((0, 2)), np.empty(0))).all()
    assert_array_equal(known_ghosts(echoes_at(view, asked), view, known, np.array([LATE, MIXED])), [LATE, "", MIXED])
