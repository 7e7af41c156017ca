"""What the sweep told of echoes is still true when steps 2 to 4 are repeated with further mirrors."""

from __future__ import annotations

from functools import partial
from itertools import pairwise

import numpy as np
from synthetic import diffuse, radar_view, together

from mirrorfold.detection import usual_settings
from mirrorfold.detection.image_echoes import find_ridges
from mirrorfold.detection.mirrors.arc_mirror import ArcMirror
from mirrorfold.folding import FoldSettings
from mirrorfold.tree.explaining.misplaced import LATE, MIXED
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


def test_a_concave_mirror_flattens_waves_so_that_they_seem_to_come_from_farther_away():
    """Late echoes are told by flat waves, and what the mirror shows must not pass for them."""
    bay = ArcMirror(
        middle=np.array([0.0, 1.0]), radius=1.0, first=np.radians(60.0), span=np.radians(60.0), radar=np.zeros(2)
    )
    corners = bay.middle + bay.radius * np.array([[np.cos(a), np.sin(a)] for a in np.radians(np.linspace(60, 120, 13))])
    chords = [diffuse(*ends, seed) for seed, ends in enumerate(pairwise(corners))]
    shown = np.array([-0.05, 2.3]), np.array([0.05, 2.3])
    view = radar_view(*together(*chords, diffuse(*shown, 50, 40.0)), noise=1e-3)
    echoes = find_ridges(view)
    settings = FoldSettings(**usual_settings(view, echoes))
    find = partial(find_tree, view, echoes, settings)
    measured = Measured(explain=lambda some: np.where(some.range > 2.15, LATE, ""))

    first = find(measured=measured)
    assert (first.explanation == LATE).any()
    for found in (find(measured=measured, besides=[bay]), find(measured=measured, besides=[bay], earlier=first)):
        assert not (found.explanation == LATE).any()
        assert any((node.objects.range > 2.15).any() for node in found.tree.walk() if node.chain)
