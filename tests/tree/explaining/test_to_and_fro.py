"""What goes to and fro between an object and a wall stands behind the object by its distance from the wall."""

from __future__ import annotations

import numpy as np
import pytest
from synthetic import RANGE_CELL, U_CELL, diffuse, radar_view, together

from mirrorfold.common.geometry import reflect, segment_normal
from mirrorfold.detection import usual_settings
from mirrorfold.detection.image_echoes import find_ridges
from mirrorfold.folding import FoldSettings
from mirrorfold.tree.explaining.explained_by_tree import without_explained
from mirrorfold.tree.explaining.to_and_fro import TO_AND_FRO
from mirrorfold.tree.rounds import find_tree

MIRROR = np.array([0.76, 0.53]), np.array([0.36, 1.44])
"""It shows what is to its left."""

WALL = np.array([-0.5, 1.5]), np.array([0.1, 1.45])
"""A wall in line of sight."""

PLACE = np.array([-0.1, 1.35])
"""An object before the wall; the wall sends back what comes square to it."""

BESIDE = np.array([0.35, 0.8])
"""Another one, beside the mirror."""


def in_mirror(place):
    return reflect(place, MIRROR[0], segment_normal(*MIRROR))


def later(seen, way):
    """The place that is seen farther away by a way [m], in the same direction."""
    return seen * (1.0 + way / np.linalg.norm(seen))


def explained(*objects, walls=(MIRROR, WALL)):
    """Whether echoes at places, each with its amplitude, are told to have gone to and fro."""
    places, levels = np.array([place for place, _ in objects]), np.array([level for _, level in objects], dtype=complex)
    rough = (diffuse(*wall, seed) for seed, wall in enumerate(walls))
    view = radar_view(*together(*rough, (places, levels)), noise=1e-3)
    echoes = find_ridges(view)
    settings = FoldSettings(opaque=False).completed(**usual_settings(view, echoes))
    found = without_explained(find_tree(view, echoes, settings, known=np.array(walls)), view)
    gone = found.explained.position[found.explanation == TO_AND_FRO]
    kept = np.concatenate([node.objects.position for node in found.tree.walk()])
    told = []
    for place in places:
        near = [np.any(np.linalg.norm(some - place, axis=-1) < 0.5 * RANGE_CELL) for some in (gone, kept)]
        assert near[0] != near[1]
        told.append(bool(near[0]))
    return told


def away(place, wall):
    """Its distance [m] from a wall."""
    return float(np.abs((place - wall[0]) @ segment_normal(*wall)))


AWAY = away(PLACE, WALL)


@pytest.mark.parametrize(
    ("seen", "way"),
    [(BESIDE, away(BESIDE, MIRROR)), (in_mirror(PLACE), AWAY)],
    ids=["in line of sight", "in a mirror"],
)
def test_an_echo_behind_an_object_by_its_distance_from_a_wall_is_none_of_an_object(seen, way):
    assert explained((seen, 60.0), (later(seen, way), 60.0)) == [False, True]


def test_one_at_another_distance_stays():
    seen = in_mirror(PLACE)
    assert explained((seen, 60.0), (later(seen, 1.5 * AWAY), 60.0)) == [False, False]


def test_one_that_outshines_the_object_by_far_stays():
    """As the vertex of a corner does behind the edges of its legs."""
    seen = in_mirror(PLACE)
    assert explained((seen, 15.0), (later(seen, AWAY), 120.0)) == [False, False]


def test_no_wave_comes_back_from_beyond_the_end_of_a_wall():
    seen, short = in_mirror(PLACE), (WALL[0], WALL[0] + 0.4 * (WALL[1] - WALL[0]))
    assert explained((seen, 60.0), (later(seen, AWAY), 60.0), walls=(MIRROR, short)) == [False, False]


def test_the_object_may_be_known_from_another_side():
    """The mirror may show nothing of it but what went to and fro."""
    assert explained((PLACE, 60.0), (later(in_mirror(PLACE), AWAY), 60.0)) == [False, True]


@pytest.mark.parametrize(("level", "told"), [(15.0, True), (60.0, False)], ids=["fainter", "as bright"])
def test_after_a_second_turn_it_stands_twice_as_far_behind_and_is_fainter(level, told):
    seen = in_mirror(PLACE)
    assert explained((seen, 60.0), (later(seen, 2.0 * AWAY), level)) == [False, told]


OTHER = PLACE + np.array([-0.06, -0.04])
"""Another object, before the first."""


@pytest.mark.parametrize(("ways", "told"), [(1.0, True), (3.0, False)])
def test_two_objects_beside_each_other_have_echoes_behind_them_by_their_distance(ways, told):
    """Fainter ones than both, as both spread the wave."""
    seen, other = in_mirror(PLACE), in_mirror(OTHER)
    apart = float(np.linalg.norm(OTHER - PLACE))
    assert explained((seen, 60.0), (other, 60.0), (later(seen, ways * apart), 30.0)) == [False, False, told]


@pytest.mark.parametrize(("cells", "told"), [(1.7, True), (2.5, False)])
def test_the_place_may_lie_between_two_echoes_of_a_face(cells, told):
    """The wave turns on a flank, which throws aside what it scatters otherwise."""
    seen = in_mirror(PLACE)
    aside = cells * U_CELL * np.array([-seen[1], seen[0]])
    face = [(seen + side * aside, 60.0) for side in (-1.0, 1.0)]
    assert explained(*face, (later(seen, AWAY), 60.0)) == [False, False, told]
