"""What the image shows behind the legs of a corner is seen in them, even if side lobes of the vertex hide the legs."""

from __future__ import annotations

import numpy as np
import pytest
from synthetic import U_CELL, diffuse, echoes_at, empty_view, radar_view, together

from mirrorfold.common.geometry import reflect, segment_normal
from mirrorfold.detection import usual_settings
from mirrorfold.detection.image_echoes import find_ridges
from mirrorfold.detection.mirrors.line_mirror import LineMirror
from mirrorfold.folding import FoldSettings
from mirrorfold.tree.assignment import Found, assign_echoes
from mirrorfold.tree.explaining.explained_by_tree import without_explained
from mirrorfold.tree.explaining.in_corners import IN_CORNER, in_corners
from mirrorfold.tree.ordering import order_mirrors
from mirrorfold.tree.rounds import find_tree

MIRROR = np.array([0.76, 0.53]), np.array([0.36, 1.44])
"""It shows what is to its left."""

VERTEX = reflect(np.array([-0.1, 1.35]), MIRROR[0], segment_normal(*MIRROR))
"""A bright place in the mirror."""


def beyond(cells, way=0.3):
    """The place that is seen so many resolution cells aside of the vertex, and farther away than it by a way [m]."""
    range_ = np.linalg.norm(VERTEX)
    u = VERTEX[0] / range_ + cells * U_CELL
    return (range_ + way) * np.array([u, np.sqrt(1.0 - u**2)])


def explained(place, level=60.0, corner=True):
    """Whether an echo at a place is told to be seen in a leg of a vertex of amplitude 400, a corner or not."""
    points = np.array([VERTEX, place]), np.array([400.0, level], dtype=complex)
    view = radar_view(*together(diffuse(*MIRROR, 0), points), noise=1e-3)
    echoes = find_ridges(view)
    settings = FoldSettings(opaque=False).completed(**usual_settings(view, echoes))
    tree = find_tree(view, echoes, settings, known=np.array([MIRROR]))
    found = without_explained(tree, view, corners=lambda places: np.full(len(places), corner))
    gone = found.explained.position[found.explanation == IN_CORNER]
    kept = np.concatenate([node.objects.position for node in found.tree.walk()])
    told, stays = (np.any(np.linalg.norm(some - place, axis=-1) < 0.01) for some in (gone, kept))
    assert told != stays
    assert np.any(np.linalg.norm(kept - VERTEX, axis=-1) < 0.01)
    return bool(told)


@pytest.mark.parametrize("cells", [-2.0, 2.0])
def test_an_echo_behind_a_leg_that_side_lobes_hide_is_none_of_an_object(cells):
    assert explained(beyond(cells))


def test_farther_aside_a_leg_would_be_seen():
    assert not explained(beyond(4.0))


def test_nothing_is_seen_in_a_leg_before_it():
    assert not explained(beyond(2.0, -0.3))


def test_points_and_faces_have_no_legs():
    assert not explained(beyond(2.0), corner=False)


def test_what_outshines_the_vertex_is_not_seen_in_its_legs():
    assert not explained(beyond(2.0), level=800.0)


@pytest.mark.parametrize(("moved", "told"), [(0.0, True), (0.1, False)])
def test_an_object_in_a_leg_that_stands_on_a_wall_when_turned_about_the_vertex_is_seen_in_both_legs(moved, told):
    vertex, wall = np.array([0.0, 2.2]), LineMirror(np.array([-0.3, 1.0]), np.array([-0.3, 1.5]))
    legs = [LineMirror(np.array([side * 0.3, 1.9]), np.array([side * 0.01, 2.19])) for side in (-1.0, 1.0)]
    view = empty_view().knowing(corners=vertex[None])
    place = 2.0 * vertex - wall.center + [moved, 0.0]
    echoes = echoes_at(view, [place])
    settings = FoldSettings(minimum_length=0.2, wall_margin=0.0, opaque=False)
    order = order_mirrors([wall, *legs], view, echoes, settings)
    tree, sight = assign_echoes(order, echoes, opaque=False)
    nothing = echoes.take(np.zeros(len(echoes), dtype=bool))
    found = Found(echoes, tree, sight, nothing, np.zeros(0, dtype=str))
    marks = in_corners(found, view, corners=lambda places: np.zeros(len(places), dtype=bool))
    assert {chain: mask.tolist() for chain, mask in marks.items() if mask.size} == {(2,): [told]}
