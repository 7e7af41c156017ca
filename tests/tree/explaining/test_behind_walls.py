"""No wave comes by way of a mirror from behind another wall that is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from synthetic import RANGE_CELL, diffuse, echoes_at, empty_view, radar_view, together

from mirrorfold.common.geometry import reflect, segment_normal
from mirrorfold.detection import usual_settings
from mirrorfold.detection.image_echoes import find_ridges
from mirrorfold.detection.mirrors.arc_mirror import ArcMirror
from mirrorfold.detection.mirrors.line_mirror import LineMirror
from mirrorfold.folding import FoldSettings
from mirrorfold.tree.explaining.behind_walls import BEHIND, behind_rows, behind_walls, prolonged_where_hidden
from mirrorfold.tree.explaining.explained_by_tree import without_explained
from mirrorfold.tree.rounds import find_tree

MIRROR = np.array([0.76, 0.53]), np.array([0.36, 1.44])
"""It shows what is to its left."""

WALL = np.array([-0.45, 0.8]), np.array([-0.3, 1.3])
"""A wall in line of sight, which ends what the mirror shows; of its image nothing is told."""

BEFORE, BEHIND_IT, OVER_IT = np.array([-0.1, 1.05]), np.array([-0.7, 1.1]), np.array([-0.5, 1.6])

VIEW = empty_view()


def seen_in(points, mirror=MIRROR):
    return reflect(points, mirror[0], segment_normal(*mirror))


def told(places, chain=(0,), ways=None):
    """Which objects the mirror cannot show."""
    ways = {(): (), (0,): (LineMirror(*MIRROR),), (1,): (LineMirror(*WALL),)} if ways is None else ways
    return behind_walls(echoes_at(VIEW, places), chain, ways, VIEW).tolist()


def test_what_the_mirror_shows_before_and_beside_the_wall_stays():
    assert told(seen_in(np.array([BEFORE, BEHIND_IT, OVER_IT]))) == [False, True, False]


def test_the_wall_itself_stays():
    on_it = WALL[0] + np.linspace(0.2, 0.8, 4)[:, None] * (WALL[1] - WALL[0])
    assert not any(told(seen_in(on_it)))


def test_a_wall_seen_in_another_mirror_stands_where_it_truly_stands():
    """By way of a third wall it is seen elsewhere, and ends the same view."""
    third = np.array([-0.2, 0.6]), np.array([0.2, 0.65])
    image = LineMirror(*(seen_in(end, third) for end in WALL))
    ways = {(): (), (0,): (LineMirror(*MIRROR),), (1,): (LineMirror(*third),), (1, 0): (LineMirror(*third), image)}
    assert told(seen_in(np.array([BEFORE, BEHIND_IT, OVER_IT])), ways=ways) == [False, True, False]


def test_the_radar_itself_sees_nothing_behind_a_wall_that_is_known_by_a_mirror_alone():
    image = LineMirror(*(seen_in(end) for end in WALL))
    ways = {(): (), (0,): (LineMirror(*MIRROR),), (0, 0): (LineMirror(*MIRROR), image)}
    assert told(np.array([BEFORE, OVER_IT]), (), ways) == [False, True]


def test_what_a_pillar_shows_ends_at_the_wall_by_more_than_the_cell_that_it_widens():
    """The cell is five times as wide: close behind the wall an object may stand before it, or be seen over its end."""
    pillar = ArcMirror(middle=np.array([0.7, 1.3]), radius=0.35, first=-3.4, span=2.0, radar=np.zeros(2))
    ways = {(): (), (0,): (pillar,), (1,): (LineMirror(*WALL),)}
    sight = np.array([[np.sin(angle), np.cos(angle)] for angle in (0.358, 0.358, 0.358, 0.331)])
    seen = (pillar.met(sight) + np.array([0.5, 1.0, 1.35, 1.35]))[:, None] * sight
    assert told(seen, ways=ways) == [False, False, True, False]


def test_curved_walls_end_no_way():
    bent = ArcMirror(middle=np.array([-0.65, 1.05]), radius=0.3, first=-0.6, span=1.2, radar=np.zeros(2))
    ways = {(): (), (0,): (LineMirror(*MIRROR),), (1,): (bent,)}
    assert told(seen_in(BEHIND_IT[None]), ways=ways) == [False]
    assert told(seen_in(BEHIND_IT[None]), (1,), ways) == [False]


BENT = ArcMirror(middle=np.array([0.0, 2.5]), radius=1.0, first=1.5 * np.pi - 0.3, span=0.6, radar=np.zeros(2))
"""The near side of a column straight ahead, from 1.5 m on, 0.6 m wide."""


def test_behind_a_curved_row_that_is_no_mirror_nothing_is_in_line_of_sight(found):
    """Well behind it; as deep as an object is; before it; at its end; beyond that; and behind a row in a mirror."""
    sight = found[0].sight
    depth = float(sight.view.object_depth(np.array([1.5]))[0])
    end = BENT.at(0.0)
    places = [[0.0, 2.2], [0.0, 1.5 + 0.9 * depth], [0.0, 1.3], 1.5 * end, 1.5 * (end - np.array([0.1, 0.0]))]
    objects = echoes_at(sight.view, np.array(places))
    assert behind_rows(objects, [BENT], sight, sight.view).tolist() == [True, False, False, False, False]
    assert not behind_rows(objects, [], sight, sight.view).any()
    shown = replace(BENT, middle=np.array([1.3, 2.5]), first=1.5 * np.pi - 0.45, span=0.2)
    assert not behind_rows(echoes_at(sight.view, 1.3 * shown.center[None]), [shown], sight, sight.view).any()
    after = without_explained(*found, [replace(BENT, middle=np.array([0.0, 1.9]))])
    assert after.explanation.tolist() == without_explained(*found).explanation.tolist()


@pytest.fixture(scope="module")
def found():
    """Steps 2 to 4 of an image of both walls and three objects in the mirror."""
    objects = seen_in(np.array([BEFORE, BEHIND_IT, OVER_IT])), np.full(3, 60.0 + 0j)
    view = radar_view(*together(diffuse(*MIRROR, 0), diffuse(*WALL, 1), objects), noise=1e-3)
    echoes = find_ridges(view)
    settings = FoldSettings(opaque=False).completed(**usual_settings(view, echoes))
    return find_tree(view, echoes, settings, known=np.array([MIRROR, WALL])), view


def test_they_are_left_out_with_a_reason(found):
    before, view = found
    after = without_explained(before, view)

    def shown(tree):
        points = np.concatenate([node.objects.position for node in tree.walk()])
        places = seen_in(np.array([BEFORE, BEHIND_IT, OVER_IT]))
        return (np.linalg.norm(points[:, None] - places, axis=-1).min(axis=0) < RANGE_CELL).tolist()

    assert shown(before.tree) == [True, True, True]
    assert shown(after.tree) == [True, False, True]
    assert len(after.explained) == len(after.explanation) > len(before.explained)
    assert set(after.explanation[len(before.explanation) :].tolist()) == {BEHIND}


def test_what_nothing_speaks_against_is_what_it_was(found):
    before, view = found
    after = without_explained(before, view)
    assert without_explained(after, view) is after


HALF, SCREEN = np.array([[-0.4, 1.2], [0.2, 1.2]]), np.array([[0.1, 0.6], [0.28, 0.6]])
"""A wall, of which the radar sees no more than up to the shadow of another one."""


def gone_on(*walls):
    """The ends of the first of some walls, with what others hide of it."""
    view = radar_view(*together(*(diffuse(*wall, i) for i, wall in enumerate(walls))), noise=1e-3)
    echoes = find_ridges(view)
    settings = FoldSettings().completed(**usual_settings(view, echoes))
    found = find_tree(view, echoes, settings, known=np.array(walls))
    longer = prolonged_where_hidden(found)
    assert longer.keys() == found.tree.mirrors_by_chain().keys()
    ends = [way[-1].ends for way in longer.values() if way and np.ptp(way[-1].ends[:, 1]) == 0.0]
    return max(ends, key=lambda ends: ends[0, 1])


def test_a_wall_goes_on_where_another_hides_its_end():
    shadow = 2.0 * SCREEN[1, 0]
    start, end = gone_on(HALF, SCREEN)
    assert_allclose(start, HALF[0])
    assert shadow - 2.0 * RANGE_CELL < end[0] < shadow + 0.5 * RANGE_CELL
    assert_allclose(gone_on(HALF), HALF)


def test_it_goes_on_by_as_much_as_is_seen_of_it():
    wide = SCREEN + np.array([[0.0, 0.0], [0.6, 0.0]])
    assert gone_on(HALF, wide)[1, 0] == pytest.approx(0.8, abs=RANGE_CELL)


@pytest.mark.parametrize(("cells", "stays"), [(6.5, False), (2.0, True)], ids=["flat", "lone"])
def test_a_flat_object_too_short_for_a_mirror_ends_the_view_too(cells, stays):
    """What is seen behind it cannot be there; of what is no row, nothing tells how far it reaches."""
    middle = 0.5 * (WALL[0] + WALL[1])
    cell = VIEW.cell_at(middle)
    half = 0.5 * cells * cell * (WALL[1] - WALL[0]) / np.linalg.norm(WALL[1] - WALL[0])
    beyond = middle + 0.24 * (middle - seen_in(np.zeros((1, 2)))[0])  # on the way from the radar by the mirror
    objects = seen_in(beyond[None]), np.full(1, 60.0 + 0j)
    view = radar_view(*together(diffuse(*MIRROR, 0), diffuse(middle - half, middle + half, 1), objects), noise=1e-3)
    echoes = find_ridges(view)
    settings = FoldSettings(opaque=False).completed(**usual_settings(view, echoes))
    found = find_tree(view, echoes, settings, known=np.array([MIRROR]))
    after = without_explained(found, view)
    points = np.concatenate([node.objects.position for node in after.tree.walk() if node.chain])
    assert bool((np.linalg.norm(points - seen_in(beyond[None]), axis=1) < RANGE_CELL).any()) == stays
