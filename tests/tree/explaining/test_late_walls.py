"""What walls that face each other send from beyond the ambiguous range stands among the objects nearby, and is none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from synthetic import RANGE_CELL, build_tree, diffuse, empty_view, radar_view, together

from mirrorfold.detection.image_echoes import find_ridges
from mirrorfold.tree.explaining.late_walls import met_in_turn

FAR, SIDE = np.array([[-0.5, 1.2], [0.5, 1.2]]), np.array([[-0.9, 0.5], [-0.4, 0.5]])
"""The wall before the radar, and one that faces it and goes on beyond what the radar sees of it."""

AMBIGUOUS = 1.5

OBJECT = np.array([0.1, 0.8])

SEEN = -14.0, -2.0
"""Directions [degree] of most of the far wall that is seen so late."""


def late(degrees):
    """Where the far wall stands that is seen in the other one in itself, one ambiguous range nearer."""
    angle = np.radians(degrees)
    way = (1.2 + 0.7 + 0.7) / np.cos(angle) - AMBIGUOUS
    return way[:, None] * np.column_stack([np.sin(angle), np.cos(angle)])


def objects(ambiguous=AMBIGUOUS, degrees=SEEN, level=0.3, **settings):
    """What is taken for objects in line of sight."""
    places = late(np.linspace(*degrees, 150))
    random = np.random.default_rng(3)
    speckle = level * (random.standard_normal(150) + 1j * random.standard_normal(150))
    parts = diffuse(*FAR, 0), diffuse(*SIDE, 1), (places, speckle), (OBJECT[None], np.array([5.0 + 0j]))
    view = radar_view(*together(*parts), noise=1e-3, reach=(0.3, AMBIGUOUS))
    view = replace(view, ambiguous=ambiguous)
    tree, _ = build_tree(find_ridges(view), view, opaque=False, known=np.array([FAR, SIDE]), **settings)
    assert [node.chain for node in tree.walk()] == [(), (0,), (1,)]
    return tree.objects.position


def near(points, places):
    """Whether a point is near any of the places."""
    return bool((np.linalg.norm(points[:, None] - places, axis=-1) < 0.5 * RANGE_CELL).any())


def test_lines_of_sight_go_to_and_fro():
    view = empty_view()
    ranges = met_in_turn(view, FAR, SIDE, 3.0)
    ahead = int(np.argmin(np.abs(view.u - np.sin(np.radians(-5.0)))))
    heights = ranges[:, ahead] * np.sqrt(1.0 - view.u[ahead] ** 2)
    assert_allclose(heights, [1.2, 1.9, 2.6], atol=1e-9)  # the next would be farther than 3 m
    # To the right they leave by the side of the other wall, which is no longer there.
    right = int(np.argmin(np.abs(view.u - np.sin(np.radians(15.0)))))
    assert np.isnan(ranges[1:, right]).all()
    # What turns its back to them, they do not meet.
    assert np.isnan(met_in_turn(view, FAR - [0.0, 4.0], SIDE, 3.0)).all()


def test_walls_from_beyond_the_ambiguous_range_are_no_objects():
    there = late(np.linspace(-9.0, -4.0, 9))
    found = objects()
    assert not near(found, there)
    assert near(found, OBJECT[None])


@pytest.mark.parametrize("how", [{"ambiguous": np.inf}, {"ambiguous": AMBIGUOUS + 0.1}, {"rough_walls": False}])
def test_what_would_stand_elsewhere_stays(how):
    assert near(objects(**how), late(np.linspace(-9.0, -4.0, 9)))


def test_an_object_that_lies_there_by_chance_stays():
    """It fills no row of those lines of sight."""
    assert near(objects(degrees=(-8.0, -7.0)), late(np.array([-7.5])))


def test_what_is_brighter_than_walls_so_far_away_stays():
    assert near(objects(level=3.0), late(np.linspace(-9.0, -4.0, 9)))


def test_without_two_walls_all_stays():
    view = radar_view(*together(diffuse(*FAR, 0), (OBJECT[None], np.array([5.0 + 0j]))), noise=1e-3)
    view = replace(view, ambiguous=AMBIGUOUS)
    tree, _ = build_tree(find_ridges(view), view)
    assert near(tree.objects.position, OBJECT[None])
