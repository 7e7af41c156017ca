"""What another mirror shows behind a wall tells that it passed the wall, unless the wall itself shows it there."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from synthetic import diffuse, radar_view, together

from mirrorfold.common.geometry import reflect, segment_normal
from mirrorfold.detection import usual_settings
from mirrorfold.detection.image_echoes import find_ridges
from mirrorfold.folding import FoldSettings
from mirrorfold.tree.explaining.behind_walls import prolonged_where_hidden
from mirrorfold.tree.half_transparent.guessed import (
    GUESS,
    UNDECIDED,
    _of_marked_objects,
    _shown,
    guess_transparent,
    passage_by_geometry,
)
from mirrorfold.tree.half_transparent.transparent import BY_GEOMETRY, FEWEST
from mirrorfold.tree.mirror_tree import MirrorTree
from mirrorfold.tree.rounds import find_tree

WALL = np.array([0.45, 0.7]), np.array([0.825, 1.7])
"""It faces to the left."""

SHOWN = np.array([1.0, 1.62])
"""A place behind it."""

FACING = np.array([-0.8, 0.3]), np.array([-0.5, 1.1])
"""A mirror in front of it: its way to the place behind the wall meets the wall."""

ABOVE = np.array([0.6, 2.4]), np.array([1.0, 2.4])
"""A mirror beyond its end, whose way passes the wall by."""

OVER_ITS_END = np.array([0.251, 1.645]), np.array([0.591, 1.856])
"""A mirror whose way to the place behind the wall meets the wall about a resolution cell from its end."""

ASIDE = np.array([0.95, 1.9])
"""Another one, which no other mirror shows."""

LEFT = reflect(SHOWN, WALL[0], segment_normal(*WALL))
"""Where the wall would show what seems to stand behind it."""


def find(*others, objects):
    """What steps 2 to 4 find of the wall, other mirrors and objects, the wall's node, and how they are found anew."""
    rough = (diffuse(*wall, seed) for seed, wall in enumerate((WALL, *others)))
    post = np.array([[0.0, 0.0], [0.06, 0.0], [0.0, 0.06]])
    posts = ((place + post, np.full(3, 20.0)) for place in objects)
    ghosts = ((reflect(SHOWN + post, other[0], segment_normal(*other)), np.full(3, 20.0)) for other in others)
    view = radar_view(*together(*rough, *posts, *ghosts), noise=1e-3, reach=(0.3, 4.5))
    echoes = find_ridges(view)
    settings = FoldSettings(opaque=False).completed(**usual_settings(view, echoes))

    def again(*, echoes):
        return find_tree(view, echoes, settings, known=np.array([WALL, *others]))

    found = again(echoes=echoes)
    (node,) = [
        node for node in found.tree.mirrors if np.allclose(np.sort(node.mirror.ends, axis=0), np.sort(WALL, axis=0))
    ]
    return found, node, view, again


def near(echoes, place):
    close = np.linalg.norm(echoes.position - place, axis=1) < 0.02
    assert close.any()
    return close


def passed(found, node, view):
    return passage_by_geometry(found, view, node, prolonged_where_hidden(found))


@pytest.mark.parametrize(
    ("other", "expected"),
    [(ABOVE, GUESS), (FACING, UNDECIDED), (OVER_ITS_END, UNDECIDED)],
    ids=["around", "by the wall", "by the end of the wall"],
)
def test_only_ways_around_a_wall_tell_what_is_behind_it(other, expected):
    found, node, view, again = find(other, objects=[SHOWN, ASIDE])
    np.testing.assert_allclose(passed(found, node, view)[near(node.objects, SHOWN)], expected)
    asked = []

    def once_more(*, echoes):
        asked.append(echoes)
        return again(echoes=echoes)

    result = guess_transparent(found, view, found.echoes, full_pass=once_more)
    if expected == UNDECIDED:
        assert result is found
        assert not asked
        return
    (wall,) = result.transparent_walls
    assert wall.decided == BY_GEOMETRY
    assert (np.linalg.norm(wall.echoes.position - SHOWN, axis=1) < 0.08).all()
    np.testing.assert_allclose(wall.probability, GUESS)
    assert len(wall.tested) == len(wall.passed) == len(node.objects)
    assert len(asked[0]) == len(found.echoes) - len(wall.echoes)
    curved = MirrorTree((SimpleNamespace(curved=True),), node.face.take([]), node.objects.take([]), chain=(9,))
    beside = found._replace(tree=replace(found.tree, mirrors=(*found.tree.mirrors, curved)))
    assert guess_transparent(beside, view, found.echoes, full_pass=once_more) is beside


def test_what_stands_before_a_wall_and_seems_to_behind_was_reflected():
    found, node, view, again = find(objects=[SHOWN, LEFT])
    np.testing.assert_allclose(passed(found, node, view)[near(node.objects, SHOWN)], 1.0 - GUESS)
    assert guess_transparent(found, view, found.echoes, full_pass=again) is found


def test_what_folds_onto_the_face_of_another_wall_is_that_wall():
    along = np.array([0.15, 0.02])
    found, node, view, _ = find((LEFT - along, LEFT + along), objects=[SHOWN])
    np.testing.assert_allclose(passed(found, node, view)[near(node.objects, SHOWN)], 1.0 - GUESS)


def test_an_object_at_both_places_tells_nothing():
    found, node, view, _ = find(ABOVE, objects=[SHOWN, LEFT])
    np.testing.assert_allclose(passed(found, node, view)[near(node.objects, SHOWN)], UNDECIDED)


@pytest.mark.parametrize(("cells", "expected"), [(FEWEST - 1, False), (FEWEST, True)])
def test_so_many_cells_of_an_object_tell_of_all_its_echoes(cells, expected):
    view = SimpleNamespace(cell_numbers=lambda position: position[:, 0].astype(int))
    echoes = SimpleNamespace(position=np.arange(10.0)[:, None] // np.array([2.0]))
    number = np.repeat([0, 1], [8, 2])
    told = echoes.position[:, 0] < cells
    np.testing.assert_array_equal(_of_marked_objects(number, told, view, echoes), (number == 0) & expected)


def test_places_are_the_same_up_to_a_cell_and_a_half_there():
    """The radar stands at (1, 0) m, and a cell is a tenth of the range."""
    radar = np.array([1.0, 0.0])
    view = SimpleNamespace(dimensions=2, cells_at=lambda places: 0.1 * np.linalg.norm(places - radar, axis=1))
    places = np.array([[2.0, 0.0], [4.0, 0.0]])
    np.testing.assert_array_equal(_shown(view, places, [places + np.array([0.2, 0.0])]), [False, True])
    assert not _shown(view, places, []).any()
