"""Where walls truly stand, and how far places are from them."""

from __future__ import annotations

import numpy as np
from numpy.testing import assert_allclose

from mirrorfold.detection.mirrors.line_mirror import LineMirror
from mirrorfold.tree.explaining.true_walls import square_distances, true_ends

WALL = LineMirror(np.array([-1.0, 1.0]), np.array([1.0, 1.0]))
GHOST = LineMirror(np.array([0.5, 1.5]), np.array([0.5, 2.5]), strength=2.0)
"""The image, in the wall, of one that stands before it."""


def test_a_wall_stands_where_the_mirrors_before_it_fold_it_to():
    assert_allclose(true_ends((WALL,)), WALL.ends)
    assert_allclose(true_ends((WALL, GHOST)), [[0.5, 0.5], [0.5, -0.5]], atol=1e-12)


def test_distances_are_square_to_a_wall_and_along_it_beyond_its_ends():
    away, beyond = square_distances(np.array([[0.0, 0.2], [1.5, 2.0], [-3.0, 1.0]]), WALL.ends)
    assert_allclose(away, [0.8, 1.0, 0.0], atol=1e-12)
    assert_allclose(beyond, [-1.0, 0.5, 2.0], atol=1e-12)
