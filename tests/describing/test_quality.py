"""The F-score to expect is the table's, within the range of the table, and nothing outside."""

from __future__ import annotations

import pytest

import mirrorfold as mf
from mirrorfold.describing.quality import cell_diagonal, expected_quality

TABLE = {
    "found": {"valid": [4.0, 16.0], "at": [4.0, 16.0], "mean": [0.0, 1.0], "standard_error": [0.1, 0.0]},
    "close": {"valid": [0.1, 1.0], "at": [0.1, 1.0], "mean": [0.2, 1.0], "standard_error": [0.1, 0.0]},
    "close_in_cells": {"mean": 0.9, "standard_error": 0.02},
    "mirrored": {"at": [-10.0, 0.0], "mean": [0.5, 1.0], "standard_error": [0.1, 0.0]},
}
RADAR = {"frequency": 300e9, "bandwidth": 15e9, "aperture": 0.1, "range": 3.0}


def test_cell_is_that_of_range_and_of_the_aperture():
    assert cell_diagonal(299.792458e9, 14.9896229e9, 0.1, 3.0) == pytest.approx((0.01**2 + 0.03**2) ** 0.5)


def test_factors_are_interpolated_over_the_logarithm_and_multiplied():
    cell = cell_diagonal(300e9, 15e9, 0.1, 1.0)
    found = expected_quality(**RADAR, wall_range=1.0, wall=8.0 * cell, table=TABLE)
    assert found.wall_found == pytest.approx(0.5, abs=1e-4)
    assert found.wall_found_error == pytest.approx(0.05, abs=1e-4)
    assert found.f_score_cells == pytest.approx(0.45, abs=1e-4)
    assert found.f_score_cells_error == pytest.approx((0.05**2 * 0.81 + 0.25 * 0.0004) ** 0.5, abs=1e-4)
    lossy = expected_quality(**RADAR, wall_range=1.0, wall=8.0 * cell, mirrored_db=-5.0, table=TABLE)
    assert lossy.f_score_cells == pytest.approx(0.75 * found.f_score_cells, abs=1e-4)


@pytest.mark.parametrize("change", [{"wall": 0.01}, {"wall": 100.0}, {"mirrored_db": -10.1}, {"mirrored_db": None}])
def test_outside_of_the_table_nothing_is_promised(change):
    found = expected_quality(**RADAR, **{"wall_range": 1.0, "wall": 0.15, **change}, table=TABLE)
    assert found.wall_found is None
    assert found.f_score_2cm is None
    assert found.f_score_cells is None


def test_plan_states_it():
    base = {"points": 401, "pitch": 0.5e-3, "range": 2.0, "aperture": 0.08}
    sharp = mf.plan(**base, band=(290e9, 300e9), materials=("concrete",)).hidden_quality
    assert sharp.f_score_5cm > 0.8
    assert 0.0 < sharp.f_score_5cm_error < 0.2
    coarse = mf.plan(**base, band=(99e9, 101e9), materials=("concrete",)).hidden_quality
    assert coarse.cell_m > sharp.cell_m
    assert coarse.f_score_5cm is None or coarse.f_score_5cm < sharp.f_score_5cm
