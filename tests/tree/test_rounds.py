"""Mirrors are found and ordered in turn: what an early round hides, the last one may show again."""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import replace
from unittest.mock import patch

import numpy as np
import pytest
from synthetic import echoes_at, empty_view, on_line

from mirrorfold.detection.mirrors.arc_mirror import ArcMirror
from mirrorfold.detection.mirrors.line_mirror import LineMirror
from mirrorfold.folding.settings import FoldSettings
from mirrorfold.tree import completion, rounds
from mirrorfold.tree.rounds import find_tree

WALL = np.array([[-0.5, 1.2], [0.5, 1.3]])
GHOST, DEEP = np.array([0.45, 1.9]), np.array([0.52, 2.2])
"""Seen in the right half of the wall; and behind that, in the same direction."""

SETTINGS = FoldSettings(minimum_length=0.3, wall_margin=0.02, curved=False, copies=False, rough_walls=False)


@contextmanager
def finds(*answers):
    """Searches give one answer after the other, and then the last one again and again."""
    left = list(answers)

    def find(view, echoes, **options):
        return [replace(mirror, strength=1.0) for mirror in (left.pop(0) if len(left) > 1 else left[0])]

    with patch.object(rounds, "find_mirrors", find), patch.object(completion, "find_mirrors", find):
        yield


def visible(*answers):
    """Whether the wall's own echoes, the one that it shows, and the one behind that are visible in the end."""
    view = empty_view()
    places = np.concatenate([on_line(*WALL, spacing=0.005), [GHOST, DEEP]])
    with finds(*answers):
        found = find_tree(view, echoes_at(view, places), SETTINGS)
    (mirror,) = found.tree.mirrors
    assert len(mirror.objects) == found.echoes.visible[-2]
    return bool(found.echoes.visible[:-2].all()), *found.echoes.visible[-2:].tolist()


def test_part_of_a_wall_that_is_found_later_hides_nothing_any_more():
    """Before it is found, its echoes pass for an object, and hide what the wall shows there.

    The echo farthest away is multiple scattering of the one that the wall shows, and stays hidden.
    """
    whole, half = LineMirror(*WALL), LineMirror(WALL[0], WALL.mean(axis=0))
    assert visible([whole]) == (True, True, False)
    assert visible([half]) == (True, False, False)
    assert visible([half], [whole]) == (True, True, False)


def test_a_wall_that_does_not_last_shows_nothing():
    whole, half = LineMirror(*WALL), LineMirror(WALL[0], WALL.mean(axis=0))
    assert visible([half], [whole], [half]) == (True, False, False)


def test_a_round_with_an_image_of_the_radar_keeps_curved_mirrors_besides():
    """A wall that faces the array shows the array's own surface, in a straight row: that is no mirror."""
    view = replace(empty_view(), wavelength=1e-3)
    faces = LineMirror(np.array([-0.4, 1.1]), np.array([0.4, 1.1]))
    own = LineMirror(np.array([-0.05, 2.2]), np.array([0.05, 2.2]))
    arc = ArcMirror(middle=np.array([0.8, 1.4]), radius=0.2, first=np.pi, span=1.0, radar=np.zeros(2))
    places = np.concatenate([on_line(*mirror.ends, spacing=0.005) for mirror in (faces, own)])
    with finds([faces, own]):
        found = find_tree(view, echoes_at(view, places), SETTINGS, besides=[arc])
    assert {type(node.mirror) for node in found.tree.mirrors} == {LineMirror, ArcMirror}
    assert len(list(found.tree.walk())) == 3


@pytest.mark.parametrize(("marked", "stay"), [(0.3, True), (0.7, False)])
def test_a_wall_of_which_a_part_may_be_scattered_stays_whole(marked, stay):
    """Where a true wall crosses the places of scattered echoes, it must not be cut, and become too short."""
    view, searched = empty_view(), []
    echoes = echoes_at(view, on_line(*WALL, spacing=0.005))
    left = WALL[0, 0] + marked * np.diff(WALL[:, 0])

    def find(view, echoes, **options):
        searched.append(len(echoes))
        return [replace(LineMirror(*WALL), strength=1.0)]

    def scattered(order, echoes, corners):
        return echoes.position[:, 0] < left

    settings = replace(SETTINGS, rough_walls=True)
    with patch.object(rounds, "find_mirrors", find), patch.object(rounds, "scattered", scattered):
        find_tree(view, echoes, settings)
    assert (min(searched) == len(echoes)) is stay
