"""What another mirror shows behind a wall tells that it passed the wall, unless the wall itself shows it there."""

from __future__ import annotations

import numpy as np
import pytest
from synthetic import diffuse, radar_view, together

from mirrorfold.common.geometry import reflect, segment_normal
from mirrorfold.detection import usual_settings
from mirrorfold.detection.image_echoes import find_ridges
from mirrorfold.folding import FoldSettings
from mirrorfold.tree.explaining.behind_walls import as_far_as_hidden
from mirrorfold.tree.half_transparent.guessed import GUESS, UNDECIDED, passage
from mirrorfold.tree.rounds import find_tree

WALL = np.array([0.45, 0.7]), np.array([0.825, 1.7])
"""It faces to the left."""

SHOWN = np.array([1.0, 1.62])
"""A place behind it."""

FACING = np.array([-0.8, 0.3]), np.array([-0.5, 1.1])
"""A mirror in front of it: its way to the place behind the wall meets the wall."""

ABOVE = np.array([0.6, 2.4]), np.array([1.0, 2.4])
"""A mirror beyond its end, whose way passes the wall by."""


@pytest.mark.parametrize(("other", "expected"), [(ABOVE, GUESS), (FACING, UNDECIDED)], ids=["around", "by the wall"])
def test_only_ways_around_a_wall_tell_what_is_behind_it(other, expected):
    post = SHOWN + np.array([[0.0, 0.0], [0.06, 0.0], [0.0, 0.06]])
    ghost = reflect(post, other[0], segment_normal(*other))
    rough = (diffuse(*wall, seed) for seed, wall in enumerate((WALL, other)))
    view = radar_view(
        *together(*rough, (post, np.full(3, 20.0)), (ghost, np.full(3, 20.0))), noise=1e-3, reach=(0.3, 4.5)
    )
    echoes = find_ridges(view)
    settings = FoldSettings(opaque=False).completed(**usual_settings(view, echoes))
    found = find_tree(view, echoes, settings, known=np.array([WALL, other]))
    (node,) = [
        node for node in found.tree.mirrors if np.allclose(np.sort(node.line.ends, axis=0), np.sort(WALL, axis=0))
    ]
    passed = passage(found, view, node, found.tree.folds(), as_far_as_hidden(found))
    near = np.linalg.norm(node.objects.position - SHOWN, axis=1) < 0.02
    assert near.any()
    np.testing.assert_allclose(passed[near], expected)
