"""Rows of echoes break off at gaps of three cells; of several, the heaviest counts."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from mirrorfold.detection.search.rows import GAP_CELLS, heaviest_row, longest_run, without_gaps

pytestmark = pytest.mark.nojit


@pytest.mark.parametrize(("gap", "found"), [(GAP_CELLS - 0.01, [2, 0, 1, 3]), (GAP_CELLS + 0.01, [1, 3])])
def test_a_row_ends_at_a_gap(gap, found):
    position = np.array([1.0, 1.0 + gap, 0.0, 2.0 + gap])
    assert_array_equal(heaviest_row(position, np.ones(4), np.array([1.0, 1.0, 1.0, 1.5])), found)


def test_the_wider_cell_beside_a_gap_counts():
    row = heaviest_row(np.array([0.0, 5.0]), np.array([1.0, 2.0]), np.ones(2))
    assert_array_equal(row, [0, 1])


@pytest.mark.parametrize(
    ("marked", "run"), [([], None), ([0, 0], None), ([1, 1, 0, 1], slice(0, 2)), ([0, 1, 0, 1, 1], slice(3, 5))]
)
def test_the_longest_run(marked, run):
    assert longest_run(np.array(marked, dtype=bool)) == run


@pytest.mark.parametrize(
    ("marked", "filled"),
    [
        ([0, 1, 0, 0, 1, 0], [0, 1, 1, 1, 1, 0]),
        ([1, 0, 0, 0, 1], [1, 0, 0, 0, 1]),
        ([0, 0, 1, 1, 0], [0, 0, 1, 1, 0]),
        ([0, 0], [0, 0]),
    ],
    ids=["short gap", "long gap", "ends", "nothing"],
)
def test_short_gaps_are_filled_and_ends_are_kept(marked, filled):
    assert_array_equal(without_gaps(np.array(marked, dtype=bool), 2), np.array(filled, dtype=bool))
