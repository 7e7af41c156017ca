"""No wave comes by way of a mirror from behind an opaque object that is known."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from synthetic import RANGE_CELL, diffuse, echoes_at, empty_view, on_line, radar_view, together

from mirrorfold.common.geometry import reflect, segment_normal
from mirrorfold.detection import usual_settings
from mirrorfold.detection.image_echoes import find_ridges
from mirrorfold.detection.mirrors.arc_mirror import ArcMirror
from mirrorfold.detection.mirrors.line_mirror import LineMirror
from mirrorfold.folding import FoldSettings
from mirrorfold.tree.explaining.behind_objects import BEHIND_AN_OBJECT, behind_objects
from mirrorfold.tree.explaining.explained_by_tree import without_explained
from mirrorfold.tree.mirror_tree import MirrorTree
from mirrorfold.tree.rounds import find_tree

VIEW = empty_view()
CELL = float(VIEW.cell(1.0))

MIRROR = np.array([0.76, 0.53]), np.array([0.36, 1.44])
"""It shows what is to its left."""

OBJECT = on_line([-0.2, 0.95], [-0.2, 1.15], 0.3 * CELL)
"""A face that looks at the mirror."""

BEFORE, BEHIND_IT, OVER_IT = np.array([-0.05, 1.05]), np.array([-0.5, 1.05]), np.array([-0.5, 1.7])


def in_mirror(places, mirror=MIRROR):
    return reflect(np.asarray(places), mirror[0], segment_normal(*mirror))


def node(places, chain=(), way=(), mirrors=(), amplitude=1.0):
    places = np.reshape(places, (-1, 2))
    objects = echoes_at(VIEW, places, amplitude)
    return MirrorTree(tuple(way), echoes_at(VIEW, np.empty((0, 2))), objects, tuple(mirrors), chain)


def told(places, *, direct=OBJECT, shown=(), line=None, brighter=1.0):
    """Which objects at their true places, seen by way of the mirror, are behind others, direct ones and shown ones."""
    seen = in_mirror(np.concatenate([np.reshape(places, (-1, 2)), np.reshape(shown, (-1, 2))]))
    mirror = LineMirror(*MIRROR) if line is None else line
    tree = node(direct, mirrors=[node(seen, (0,), [mirror], (), brighter)])
    marks = behind_objects(SimpleNamespace(tree=tree), VIEW)
    assert not marks[()].any()  # of what is in line of sight, others tell
    return marks[0,].tolist()[: len(np.reshape(places, (-1, 2)))]


def test_what_the_mirror_shows_before_and_beside_an_object_stays():
    assert told([BEFORE, BEHIND_IT, OVER_IT]) == [False, True, False]


def test_the_object_may_be_seen_in_the_same_mirror():
    assert told([BEFORE, BEHIND_IT, OVER_IT], direct=[], shown=OBJECT) == [False, True, False]
    assert told(OBJECT, direct=[]) == [False] * len(OBJECT)


def test_what_stands_close_behind_an_object_may_belong_to_it():
    """Where the radar is seen in the mirror, lines of sight to the object begin."""
    radar = in_mirror(VIEW.radar)
    middle = OBJECT[len(OBJECT) // 2]
    ahead = (middle - radar) / np.linalg.norm(middle - radar)
    assert told([middle + 0.8 * CELL * ahead, middle + 1.6 * CELL * ahead]) == [False, True]


@pytest.mark.parametrize("direct", [OBJECT[::3], OBJECT[:1], []], ids=["far apart", "alone", "nothing"])
def test_waves_pass_between_echoes_that_are_no_surface_together(direct):
    assert told([BEHIND_IT], direct=direct) == [False]


def test_what_is_brighter_than_the_object_before_it_stays():
    """That one may be a side lobe of it."""
    assert told([BEHIND_IT], brighter=1.01) == [False]


def test_waves_bend_around_the_edge_of_an_object():
    """The way to what stands on the line through its last echo touches it."""
    radar = in_mirror(VIEW.radar)
    edge = radar + 1.3 * (OBJECT[-1] - radar)
    assert told([edge]) == [False]


def test_what_is_known_by_more_mirrors_ends_no_view_by_fewer():
    other = LineMirror(*in_mirror(np.array([[-0.9, 0.5], [-0.9, 1.5]])))
    deeper = node(
        in_mirror(reflect(OBJECT, np.array([-0.9, 0.5]), np.array([1.0, 0.0]))), (0, 0), [LineMirror(*MIRROR), other]
    )
    tree = node([], mirrors=[node(in_mirror([BEHIND_IT]), (0,), [LineMirror(*MIRROR)], [deeper])])
    found = SimpleNamespace(tree=tree)
    np.testing.assert_allclose(np.asarray(deeper.fold(deeper.objects.position)), OBJECT, atol=1e-9)
    assert behind_objects(found, VIEW)[0,].tolist() == [False]


def test_of_curved_mirrors_nothing_is_said():
    arc = ArcMirror(middle=np.array([0.9, 1.1]), radius=0.3, first=2.0, span=2.0, radar=VIEW.radar)
    assert told([BEHIND_IT], line=arc) == [False]


def test_of_volumes_nothing_is_said():
    tree = node(OBJECT, mirrors=[node(in_mirror([BEHIND_IT]), (0,), [LineMirror(*MIRROR)])])
    found = SimpleNamespace(tree=tree, sight=SimpleNamespace(ways={}))
    volume = SimpleNamespace(radar=VIEW.radar, cell=VIEW.cell, dimensions=2)
    assert behind_objects(found, VIEW)[0,].tolist() == [True]
    assert without_explained(found, volume) is found


def test_it_is_left_out_with_the_reason_once_the_tree_is_found():
    """A round face in line of sight; a bright echo that the mirror would show through it, and one above."""
    turn = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 120)[:, None]
    face = [-0.3, 0.81] + 0.08 * np.hstack([np.cos(turn), np.sin(turn)])
    behind, above = np.array([-0.6, 0.8]), np.array([-0.5, 1.5])
    random = np.random.default_rng(3)
    objects = face, 20.0 * np.exp(2j * np.pi * random.random(len(face)))
    bright = in_mirror([behind, above]), np.array([60.0, 60.0], dtype=complex)
    view = radar_view(*together(diffuse(*MIRROR, 0), objects, bright), noise=1e-3)
    echoes = find_ridges(view)
    settings = FoldSettings().completed(**usual_settings(view, echoes))
    found = find_tree(view, echoes, settings, known=np.array([MIRROR]))
    doubted = without_explained(found, view)
    gone = doubted.explained.position[doubted.explanation == BEHIND_AN_OBJECT]
    kept = np.concatenate([one.objects.position for one in doubted.tree.walk()])
    for place, leaves in zip(in_mirror([behind, above]), (True, False), strict=True):
        near = [np.any(np.linalg.norm(some - place, axis=-1) < 0.5 * RANGE_CELL) for some in (gone, kept)]
        assert near == [leaves, not leaves]
