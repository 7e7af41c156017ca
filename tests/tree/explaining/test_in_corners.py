"""What the image shows behind the legs of a corner is seen in them, even if side lobes of the vertex hide the legs."""

from __future__ import annotations

import numpy as np
import pytest
from synthetic import U_CELL, diffuse, radar_view, together

from mirrorfold.common.geometry import reflect, segment_normal
from mirrorfold.detection import usual_settings
from mirrorfold.detection.image_echoes import find_ridges
from mirrorfold.folding import FoldSettings
from mirrorfold.tree.explaining.explained_by_tree import without_explained
from mirrorfold.tree.explaining.in_corners import IN_CORNER
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
