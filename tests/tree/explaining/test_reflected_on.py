"""What a flat object beside a path reflects on to a known place stands at no place of its own."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
from synthetic import echoes_at, empty_view

from mirrorfold.common.geometry import reflect, segment_normal
from mirrorfold.detection import fold_of
from mirrorfold.detection.mirrors.arc_mirror import ArcMirror
from mirrorfold.detection.mirrors.line_mirror import LineMirror
from mirrorfold.tree.explaining.reflected_on import reflected_on
from mirrorfold.tree.mirror_tree import MirrorTree

VIEW = empty_view()

MIRROR = np.array([0.76, 0.53]), np.array([0.36, 1.44])
"""It shows what is to its left."""

SCREEN = np.array([-0.3, 0.7]), np.array([0.1, 0.74])
"""A flat object whose upper side only the mirror looks at."""

WALL = np.array([-0.8, 0.6]), np.array([-0.6, 1.6])
"""A wall farther on."""

RADAR = reflect(np.zeros(2), MIRROR[0], segment_normal(*MIRROR))
"""The radar's mirror image, from which straight paths lead to what the mirror shows."""


def over_end(inside, length, *walls):
    """True place [m], `length` [m] beyond the screen, `inside` [m] of its left end; its image in walls."""
    start, end = SCREEN
    crossing = start + inside * (end - start) / np.linalg.norm(end - start)
    place = crossing + length * (crossing - RADAR) / np.linalg.norm(crossing - RADAR)
    for wall in walls:
        place = reflect(place, wall[0], segment_normal(*wall))
    return place


def told(place, known, walls=(SCREEN,), shown=()):
    """Whether an echo by way of the mirror is reflected on, if this place would be its true one, and others are known.

    Those `known` are in line of sight, those `shown` are seen in the mirror, too.
    """
    seen = reflect(np.array([place, *shown]), MIRROR[0], segment_normal(*MIRROR))
    face = echoes_at(VIEW, np.empty((0, 2)))
    child = MirrorTree((LineMirror(*MIRROR),), face, echoes_at(VIEW, seen), (), (0,))
    tree = MirrorTree((), face, echoes_at(VIEW, np.reshape(known, (-1, 2))), (child,), ())
    ways = {(-1 - i,): (LineMirror(*wall),) for i, wall in enumerate(walls)}
    marks = reflected_on(SimpleNamespace(tree=tree), VIEW, {(0,): (LineMirror(*MIRROR),), **ways})
    assert not marks[()].any()
    return bool(marks[0,][0])


def test_an_echo_over_the_end_of_a_flat_object_comes_from_what_the_object_reflects():
    place = over_end(0.01, 0.3)
    assert told(place, over_end(0.01, 0.3, SCREEN))
    assert not told(place, [])
    assert not told(place, place)  # the thing may be where it seems
    assert not told(place, over_end(0.01, 0.3, SCREEN) + np.array([0.0, 0.1]))


def test_past_the_end_by_more_than_a_beam_nothing_is_reflected():
    beam = VIEW.u_cell * np.linalg.norm(over_end(0.0, 0.0))
    for beyond, reflected in ((0.5 * beam, True), (4.0 * beam, False)):
        assert told(over_end(-beyond, 0.3), over_end(-beyond, 0.3, SCREEN)) == reflected


def test_what_stands_close_to_the_end_of_the_object_is_another_object():
    short = 0.5 * VIEW.cell(1.0)
    assert not told(over_end(0.01, short), over_end(0.01, short, SCREEN))


def test_the_wave_is_followed_from_wall_to_wall():
    place = over_end(0.01, 0.9)
    twice = over_end(0.01, 0.9, SCREEN, WALL)
    assert told(place, twice, [SCREEN, WALL])
    assert not told(place, twice)
    assert not told(place, over_end(0.01, 0.9, SCREEN), [SCREEN, WALL])  # the wall hides it


def test_an_echo_in_doubt_explains_no_other():
    """The mirror shows two things over the end of the screen, either of which would be the other's image in it."""
    place = over_end(0.01, 0.3)
    other = over_end(0.01, 0.3, SCREEN)
    # From the other place, too, the leg must pass the end of a wall: of one that stands before it.
    across = segment_normal(RADAR, other)
    before = other + 0.3 * (RADAR - other) / np.linalg.norm(RADAR - other)
    post = before + 0.01 * across, before - 0.3 * across
    assert told(place, [], (SCREEN, post), shown=[other]) is False
    assert told(place, [], shown=[other]) is True


def test_where_a_wall_surely_reflects_is_a_known_place():
    """Of one object, the mirror shows a part over the end of the screen, and a part that the screen surely reflects."""
    over, inside = over_end(0.03, 0.3), over_end(0.046, 0.3)
    assert not told(over, [])
    assert told(over, [], shown=[inside])
    assert not told(inside, [], shown=[over])
    assert not told(over, [], shown=[over_end(0.2, 0.3)])


def test_a_pillar_shows_what_a_flat_object_reflects_to_the_cell_that_it_widens():
    """Its cell is five times as wide, 0.2 m."""
    pillar = ArcMirror(middle=np.array([0.7, 1.3]), radius=0.35, first=-3.4, span=2.0, radar=np.zeros(2))
    screen = np.array([-0.29, 0.9]), np.array([-0.5, 0.9])
    sight = np.array([[np.sin(0.384), np.cos(0.384)]])
    seen = (pillar.met(sight) + 1.35)[:, None] * sight
    true = reflect(fold_of((pillar,), 2)(seen), screen[0], segment_normal(*screen))[0]
    face = echoes_at(VIEW, np.empty((0, 2)))
    child = MirrorTree((pillar,), face, echoes_at(VIEW, seen), (), (0,))
    for off, reflected in ((0.0, True), (0.1, True), (0.4, False)):
        tree = MirrorTree((), face, echoes_at(VIEW, true[None] + np.array([0.0, off])), (child,), ())
        walls = {(0,): (pillar,), (-1,): (LineMirror(*screen),)}
        assert reflected_on(SimpleNamespace(tree=tree), VIEW, walls)[0,].tolist() == [reflected]
