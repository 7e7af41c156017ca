"""What goes to an object by a rough wall's short cut, and comes back by mirrors, is no object before it."""

from __future__ import annotations

import numpy as np
import pytest
from synthetic import RANGE_CELL, build_tree, diffuse, radar_view, together

from mirrorfold.common.geometry import reflect, segment_normal
from mirrorfold.detection.image_echoes import find_ridges
from mirrorfold.tree import lines_of_sight

FIRST = np.array([0.2, 1.0]), np.array([1.0, 1.1])
SECOND = np.array([0.6, 0.39]), np.array([1.5, 0.45])
"""The wall that the radar looks at, and one of which it sees the image there."""

OBJECT = np.array([1.0, 0.8])
"""Seen in the first wall in the second."""

BRIGHT = 150.0 + 0j


def seen_in(wall, points):
    return reflect(points, wall[0], segment_normal(*wall))


IMAGE = seen_in(FIRST, seen_in(SECOND, OBJECT))


def short_cut():
    """Where the image shows what the first wall scatters to the object: the mean of both ways, in its direction."""
    away = IMAGE / np.linalg.norm(IMAGE)
    normal = segment_normal(*FIRST)
    met = away * (FIRST[0] @ normal) / (away @ normal)
    ways = np.linalg.norm(met) + np.linalg.norm(met - OBJECT), np.linalg.norm(IMAGE)
    return away * np.mean(ways)


def shown(place, amplitude, **settings):
    """Whether the image, and another place, are taken for objects, when that has so much amplitude."""
    second = diffuse(*(seen_in(FIRST, end) for end in SECOND), 1)
    objects = np.array([IMAGE, place]), np.array([BRIGHT, amplitude])
    view = radar_view(*together(diffuse(*FIRST, 0), second, objects), noise=1e-3)
    tree, _ = build_tree(find_ridges(view), view, **settings)
    nodes = list(tree.walk())
    assert [node.chain for node in nodes] == [(), (0,), (0, 0)]
    points = nodes[2].objects.position
    return [np.linalg.norm(points - one, axis=1).min(initial=np.inf) < RANGE_CELL for one in (IMAGE, place)]


@pytest.mark.slow
def test_it_is_left_out_and_hides_nothing(monkeypatch):
    """Even if it hid as much as a large object does."""
    monkeypatch.setattr(lines_of_sight, "POINT_CELLS", 0)
    assert shown(short_cut(), 40.0 + 0j, rough_walls=False) == [False, True]
    assert shown(short_cut(), 40.0 + 0j) == [True, False]


@pytest.mark.parametrize("cells", [-3.0, 3.0])
def test_what_stands_nearer_or_farther_stays(cells):
    place = short_cut() * (1.0 + cells * RANGE_CELL / np.linalg.norm(short_cut()))
    assert shown(place, 20.0 + 0j)[1]


@pytest.mark.slow
def test_what_is_as_bright_as_the_object_stays():
    assert shown(short_cut(), 0.8 * BRIGHT)[1]
