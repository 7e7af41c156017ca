"""What the sweep told of echoes is still true when steps 2 to 4 are repeated with further mirrors."""

from __future__ import annotations

import numpy as np
from synthetic import diffuse, radar_view, together

from mirrorfold.detection import usual_settings
from mirrorfold.detection.image_echoes import find_ridges
from mirrorfold.folding import FoldSettings
from mirrorfold.tree.explaining.misplaced import MIXED
from mirrorfold.tree.measured import Measured
from mirrorfold.tree.rounds import find_tree

WALL = np.array([-0.8, 1.6]), np.array([0.8, 1.5])
GHOST = np.array([-0.1, 0.9]), np.array([0.1, 0.9])


def test_an_echo_that_comes_from_elsewhere_is_told_once():
    view = radar_view(*together(diffuse(*WALL, 1), diffuse(*GHOST, 2, 3.0)), noise=1e-3)
    echoes = find_ridges(view)
    settings = FoldSettings(**usual_settings(view, echoes))
    asked = []

    def explain(some):
        asked.append(some.position)
        return np.where(some.range < 1.1, MIXED, "")

    first = find_tree(view, echoes, settings, measured=Measured(explain=explain))
    assert (first.explanation == MIXED).any()
    before = np.concatenate(asked)
    asked.clear()
    again = find_tree(view, echoes, settings, measured=Measured(explain=explain), earlier=first)
    assert not any((some[:, 1] < 1.0).any() for some in asked)
    assert (before[:, 1] < 1.0).any()
    told = [set(map(tuple, one.explained.position[one.explanation == MIXED])) for one in (first, again)]
    assert told[0] == told[1]
    np.testing.assert_array_equal(again.echoes.position, first.echoes.position)
