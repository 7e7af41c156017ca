"""What a curved mirror shows besides what is known."""

from __future__ import annotations

import numpy as np
import pytest

from mirrorfold.tree.curved import Evidence, _stands_near


@pytest.mark.parametrize(
    ("known", "near"), [((0.0, 0.09), True), ((0.09, 0.0), False), ((0.0, 0.11), False), ((0.019, -0.09), True)]
)
def test_places_are_told_apart_by_range_where_the_mirror_leaves_no_direction(known, near):
    """The waves arrive along x; a convex mirror has widened the cell across to 10 cm, along it stays at 2 cm."""
    place, arriving, reach = np.zeros((1, 2)), np.array([[3.0, 0.0]]), np.array([[0.02, 0.1]])
    assert _stands_near(place, arriving, reach, np.array([known])) == [near]
    turned = np.array([known])[:, ::-1] * [1.0, -1.0]  # all of it turned by 90 degrees
    assert _stands_near(place, np.array([[0.0, -1.0]]), reach, turned) == [near]


def test_where_nothing_is_known_all_is_new():
    assert not _stands_near(np.zeros((2, 2)), np.ones((2, 2)), np.ones((2, 2)), np.empty((0, 2))).any()


@pytest.mark.parametrize(
    ("cells", "new", "empty", "enough"),
    [(8, 2, 0.0, True), (8, 1, 0.0, False), (2, 2, 0.0, False), (20, 3, 0.0, False), (8, 2, 0.4, False)],
)
def test_a_mirror_shows_several_cells_and_new_ones_among_them(cells, new, empty, enough):
    assert Evidence(cells, new, empty).enough == enough
