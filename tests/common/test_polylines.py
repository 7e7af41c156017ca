"""Lines that cross themselves or fold back are told, wherever they do."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mirrorfold.common.polylines import meets_itself

BOX = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.0, 0.0]])


@pytest.mark.parametrize(
    ("points", "place"),
    [
        ([[-0.3, 1.0], [0.3, 1.1], [-0.3, 1.0]], [0.3, 1.1]),
        ([[0.0, 0.0], [2.0, 0.0], [1.0, 0.0]], [2.0, 0.0]),
        ([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, -1.0]], [1.5, 0.0]),
        (BOX, None),
        ([[0.0, 0.0], [1.0, 0.0]], None),
        ([[0.0, 0.0], [1.0, 0.0], [0.0, 1e-3]], None),
        ([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]], None),
    ],
)
def test_places_where_lines_meet_themselves(points, place):
    found = meets_itself(np.array(points))
    assert (found is None) == (place is None)
    if place is not None:
        np.testing.assert_allclose(found, place)


@pytest.mark.slow
@given(st.integers(0, 2**31), st.floats(0.0, 6.3))
def test_all_pairs_of_pieces_are_compared(seed, angle):
    points = np.random.default_rng(seed).uniform(-1, 1, (7, 2))
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])

    def crosses(a, b, c, d):
        side = lambda p, q, r: np.linalg.det([q - p, r - p])  # noqa: E731
        return side(a, b, c) * side(a, b, d) < 0 and side(c, d, a) * side(c, d, b) < 0

    pairs = [(i, k) for i in range(6) for k in range(i + 2, 6)]
    expected = any(crosses(*points[[i, i + 1]], *points[[k, k + 1]]) for i, k in pairs)
    assert (meets_itself(points @ turn.T) is not None) == expected


@pytest.mark.parametrize("turn", [0.0, 1.0])
def test_long_profiles_are_looked_through_quickly(turn):
    x = np.linspace(0.0, 1.0, 50_000)
    profile = np.column_stack([x, 1e-4 * np.sin(300 * x)])
    profile = profile @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    assert meets_itself(profile) is None
    assert (
        meets_itself(np.concatenate([profile, profile[-1:] + 1.0, profile[:1] - 1.0, profile[100:101] + 0.1]))
        is not None
    )
