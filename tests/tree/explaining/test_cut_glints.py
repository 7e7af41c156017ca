"""Lobes of a glint that only some antennas see make a row at one range; a wall there would show a glint of its own."""

from __future__ import annotations

import numpy as np
import pytest
from synthetic import RANGE_CELL, U_CELL, build_tree, diffuse, empty_view, radar_view, together

from mirrorfold.detection.image_echoes import find_ridges

WALL = (-0.7, 1.0), (-0.2, 1.3)
RANGE, ROW = 1.2, (0.1, 0.34)
"""Where the row stands: range [m], and sines of the angles between which it lies."""

GLINT = 100.0 + 0j


def row(seed=3):
    """Speckle all along the row, as strong as that of a rough wall."""
    points, amplitude = diffuse((ROW[0], 0.0), (ROW[1], 0.0), seed, spacing=0.002 / RANGE)
    return empty_view().to_points(np.full(len(points), RANGE), points[:, 0]), amplitude


def mirrors(*more):
    """Middles of the mirrors of an image of a wall and the row, and of more scatterers, at ranges [m] and sines."""
    places = [(empty_view().to_points(*np.array([where]).T), np.array([bright])) for *where, bright in more]
    view = radar_view(*together(diffuse(*WALL, 1), row(), *places), noise=1e-3)
    tree, _ = build_tree(find_ridges(view), view)
    return [node.line.center.tolist() for node in tree.walk() if node.line is not None], view


def faces_the_radar(found):
    centers, view = found
    range_, u = view.to_polar(np.array(centers))
    return bool(np.any((np.abs(range_ - RANGE) < RANGE_CELL) & (u > ROW[0]) & (u < ROW[1])))


def test_lobes_of_a_glint_beside_them_are_no_wall():
    found = mirrors((RANGE, ROW[1] + 5.0 * U_CELL, GLINT))
    assert not faces_the_radar(found)
    assert len(found[0]) == 1  # the other wall stays


@pytest.mark.parametrize(
    "more",
    [
        pytest.param([], id="a rough wall has none"),
        pytest.param([(RANGE, np.mean(ROW), 0.3 * GLINT)], id="a smooth wall has its own"),
        pytest.param([(RANGE + 2.0 * RANGE_CELL, ROW[1] + 5.0 * U_CELL, GLINT)], id="at another range"),
        pytest.param([(RANGE, ROW[1] + 5.0 * U_CELL, 0.02 * GLINT)], id="no brighter than the row"),
    ],
)
def test_a_row_that_no_glint_beside_it_explains_is_a_wall(more):
    assert faces_the_radar(mirrors(*more))
