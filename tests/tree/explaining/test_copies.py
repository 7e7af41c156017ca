"""Echoes that repeat others: the tail of the pulse, a layer in a wall, the radar itself in a mirror."""

from __future__ import annotations

import numpy as np
import pytest
from synthetic import APERTURE, RANGE_CELL, build_tree, diffuse, radar_view, together

from mirrorfold.common.geometry import reflect
from mirrorfold.detection.image_echoes import find_ridges

NOISE = 1e-3
DELAY, LEVEL = 5.0 * RANGE_CELL, 0.3

PLACES = np.array([[-0.5, 1.0], [0.1, 0.8], [0.6, 1.3], [-0.2, 1.9]])
"""Small objects apart from each other."""


def behind(points, distance):
    """Where points appear that are as much farther [m] away in the same direction."""
    return points * (1.0 + distance / np.linalg.norm(points, axis=1))[:, None]


def objects(*parts, reach=(0.3, 3.0), **settings):
    view = radar_view(*together(*parts), noise=NOISE, reach=reach)
    tree, _ = build_tree(find_ridges(view), view, opaque=False, **settings)
    return tree, view


def count_near(tree, place, reach):
    """Objects of all nodes, where the image shows them, near one of the places."""
    shown = np.concatenate([node.objects.position for node in tree.walk()])
    return int(np.count_nonzero(np.linalg.norm(shown[:, None] - place, axis=-1).min(axis=1) < reach))


def test_the_tail_of_the_pulse_is_no_object():
    true = PLACES, np.ones(len(PLACES), dtype=complex)
    late = behind(PLACES, DELAY), LEVEL * true[1]
    alone, _ = objects(true)
    ringing, _ = objects(true, late)
    assert count_near(ringing, PLACES, RANGE_CELL) >= len(PLACES)
    assert count_near(ringing, late[0], RANGE_CELL) == 0
    assert count_near(objects(true, late, copies=False)[0], late[0], RANGE_CELL) >= len(PLACES)
    assert len(ringing.objects) == pytest.approx(len(alone.objects), abs=2)


def test_what_follows_one_echo_alone_is_an_object():
    true = PLACES, np.ones(len(PLACES), dtype=complex)
    second = behind(PLACES[:1], DELAY)
    assert count_near(objects(true, (second, np.array([LEVEL + 0j])))[0], second, RANGE_CELL) >= 1


def test_what_is_stronger_than_a_copy_is_an_object_in_the_midst_of_copies():
    true = PLACES, np.ones(len(PLACES), dtype=complex)
    late = behind(PLACES, DELAY), LEVEL * np.array([1.0, 1.0, 1.0, 4.0], dtype=complex)
    tree, _ = objects(true, late)
    assert count_near(tree, late[0][:3], RANGE_CELL) == 0
    assert count_near(tree, late[0][3:], RANGE_CELL) >= 1


@pytest.mark.slow
@pytest.mark.parametrize("tilt", [0.0, 20.0])
def test_a_layer_in_a_wall_is_seen_behind_its_face_and_behind_all_that_it_shows(tilt):
    """Copies of what is in line of sight there are none, so that no tail of the pulse explains it."""
    along = np.array([np.cos(np.radians(tilt)), np.sin(np.radians(tilt))])
    normal = np.array([-along[1], along[0]])
    middle = np.array([0.2, 1.3])
    ends = middle - 0.5 * along, middle + 0.5 * along
    face = diffuse(*ends, 0)
    hidden = np.array([[0.25, 0.75], [0.05, 0.6]])
    images = reflect(hidden, middle, normal)
    shown = images, 5.0 * np.ones(2, dtype=complex)
    layer = behind(face[0], DELAY), LEVEL * face[1]
    after = behind(images, DELAY), 2.0 * LEVEL * shown[1]
    sight = np.array([[-0.7, 0.9], [-0.8, 1.4], [-0.6, 1.7]]), 5.0 * np.ones(3, dtype=complex)
    tree, _ = objects(face, shown, layer, after, sight)
    (mirror,) = tree.mirrors
    assert not mirror.mirrors
    assert count_near(tree, np.concatenate([layer[0], after[0]]), RANGE_CELL) == 0
    assert count_near(tree, images, RANGE_CELL) >= 2
    assert count_near(tree, sight[0], RANGE_CELL) >= 3
    without, _ = objects(face, shown, layer, after, sight, copies=False)
    assert count_near(without, after[0], RANGE_CELL) >= 2


@pytest.mark.slow
def test_the_radar_does_not_take_itself_for_an_object_or_a_mirror():
    """A wall that faces the array shows it the array's own surface, here twice as wide as the array."""
    wall = diffuse((-0.4, 1.1), (0.4, 1.1), 0)
    own = diffuse((-APERTURE, 2.2), (APERTURE, 2.2), 1, strength=3.0)
    hidden = np.array([[0.25, 1.6]]), np.array([5.0 + 0j])
    view = radar_view(*together(wall, own, hidden), noise=NOISE)
    tree, _ = build_tree(find_ridges(view), view, minimum_length=0.12)
    assert [node.chain for node in tree.walk()] == [(), (0,), (0, 0)]  # without what is known of the antennas
    known = radar_view(*together(wall, own, hidden), noise=NOISE)
    object.__setattr__(known, "wavelength", 1e-3)
    tree, _ = build_tree(find_ridges(known), known, minimum_length=0.12)
    assert [node.chain for node in tree.walk()] == [(), (0,)]
    (node,) = tree.mirrors
    folded = node.mirror.reflection(node.objects.position)
    assert np.linalg.norm(folded - [0.25, 0.6], axis=1).max() < 2.0 * RANGE_CELL
