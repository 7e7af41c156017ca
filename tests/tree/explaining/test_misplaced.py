"""Echoes that come from elsewhere: what was measured of them, once in each resolution cell, and what it says."""

from __future__ import annotations

from types import SimpleNamespace

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
from mirrorfold.tree.explaining.waves import SweepWaves
from mirrorfold.tree.explaining.wrapped import wrapping_ratio


@pytest.fixture(scope="module")
def view():
    return empty_view()


def cells(view, range_, u):
    """Places so many resolution cells away and aside."""
    return view.to_points(RANGE_CELL * np.array(range_), U_CELL * np.array(u))


@pytest.mark.parametrize(
    ("lobe", "least"),
    [
        (0.0, SMALLEST_DIRECTION_RATIO),
        (0.4, ABOVE_LOBES * 0.4),
        (0.5, ABOVE_LOBES * 0.5),
        # As many decibels above the lobe as below a true echo.
        (0.64, 0.8),
        (0.7225, 0.85),
    ],
)
def test_verdicts_follow_from_the_ratios(view, lobe, least):
    """Lobes and late echoes first; of the others those whose ratio is no larger than that of a ghost in a lobe."""
    waves = SimpleNamespace(grating_lobe=lobe)  # all else is known
    lobes = np.append(np.full(5, 0.5), 1.0)  # of echoes of amplitude one
    echoes = echoes_at(view, cells(view, np.full(6, 40.2), [0.2, 10.2, 20.2, 30.2, -10.2, -20.2]))
    wrapping = [0.5, LARGEST_WRAPPING_RATIO, 1.01 * LARGEST_WRAPPING_RATIO, 1.0, 1.0, 1.0]
    direction = [1.0, least, np.nan, 0.99 * least, 1.01 * least, np.nan]
    range_, u = view.to_polar(echoes.position)
    known = {(measure, float(r), float(sine)): value
             for measure, values in ((lobe_level, lobes), (wrapping_ratio, wrapping), (direction_ratio, direction))
             for r, sine, value in zip(range_, u, values, strict=True) if np.isfinite(value)}  # fmt: skip
    assert_array_equal(misplaced(echoes, waves, view, known), ["", "", LATE, MIXED, "", LOBE])
    assert not misplaced(echoes.take(np.zeros(6, dtype=bool)), waves, view, {}).size


def test_a_cell_is_measured_once_at_its_brightest_echo(view, monkeypatch):
    calls = []

    def measured(waves, view, range_, u):
        calls.append(np.round(range_ / RANGE_CELL, 3).tolist())
        return 10.0 * range_ / RANGE_CELL

    monkeypatch.setattr(module, "confocal_share", measured)
    places, amplitude = cells(view, [40.1, 40.4, 40.7, 50.2], [5.2, 5.4, 5.6, 5.2]), np.array([1.0, 3.0, 2.0, 1.0])
    waves, known = SweepWaves(None), {}
    np.testing.assert_allclose(confocal(places, amplitude, waves, view, known), [404.0, 404.0, 404.0, 502.0])
    assert calls == [[40.4, 50.2]]
    # One more cell: only that is measured.
    more = np.concatenate([places, cells(view, [60.3], [5.2])])
    assert confocal(more, np.append(amplitude, 1.0), waves, view, known)[-1] == pytest.approx(603.0)
    assert calls[1:] == [[60.3]]
    assert not confocal(np.empty((0, 2)), np.empty(0), waves, view, known).size
    assert len(calls) == 2


def test_what_was_known_before_holds_within_half_a_cell(view):
    known = cells(view, [40.0, 50.0], [5.0, 5.0])
    asked = cells(view, [40.0 + 0.99 * GHOST_CELLS, 50.0 + 1.01 * GHOST_CELLS, 50.0], [5.0, 5.0, 5.0])
    assert_array_equal(known_confocal(asked, np.ones(3), view, known, np.array([0.3, 0.8])), [0.3, np.nan, 0.8])
    assert np.isnan(known_confocal(asked, np.ones(3), view, np.empty((0, 2)), np.empty(0))).all()
    assert_array_equal(known_ghosts(echoes_at(view, asked), view, known, np.array([LATE, MIXED])), [LATE, "", MIXED])
