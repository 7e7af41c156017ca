"""Arcs among the pieces of polylines: circles and arcs are found, rooms and bay windows stay straight."""

from __future__ import annotations

import numpy as np
import pytest

from mirrorfold.common.arcs import Arc, arc_through, circle_through
from mirrorfold.common.smooth_lines import straight_and_curved


def around(first, last, count, radius=0.35, center=(0.7, 1.5)):
    """Vertices along an arc between two angles [degree]."""
    angle = np.radians(np.linspace(first, last, count))
    return np.array(center) + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def turns(arcs):
    return [Arc.through(*arc).turn for arc in arcs]


@pytest.mark.parametrize("count", [20, 37, 361])
def test_a_circle_is_arcs_all_around(count):
    straight, arcs = straight_and_curved(around(0.0, 360.0, count))
    assert len(straight) == 0
    assert len(arcs) == 2
    center, radius = circle_through(*np.moveaxis(arcs, 1, 0))
    np.testing.assert_allclose(center, [[0.7, 1.5]] * len(arcs), atol=1e-9)
    np.testing.assert_allclose(radius, 0.35, rtol=1e-9)
    assert sum(turns(arcs)) == pytest.approx(2.0 * np.pi)
    np.testing.assert_array_equal(arcs[1:, 0], arcs[:-1, 2])  # one begins where the other ends


def test_the_halves_of_an_s_turn_to_either_side():
    line = np.concatenate([around(180.0, 270.0, 12), around(90.0, 0.0, 12, center=(0.7, 0.8))[1:]])
    straight, arcs = straight_and_curved(line)
    assert len(straight) == 0
    np.testing.assert_allclose(turns(arcs), [0.5 * np.pi, -0.5 * np.pi], rtol=1e-6)


def test_a_rounded_corner_lies_between_straight_walls():
    line = np.concatenate([[[-1.0, 1.15]], around(270.0, 360.0, 10), [[1.05, 3.0]]])
    straight, arcs = straight_and_curved(line)
    np.testing.assert_array_equal(straight, [line[:2], line[-2:]])
    np.testing.assert_array_equal(arcs[:, [0, -1]], [line[[1, -2]]])


@pytest.mark.parametrize("length", [0.3, 0.5, 1.0, 1.5, 5.0])
def test_walls_beside_wide_corners_are_no_part_of_them(length):
    """Through a wall and the first pieces of a bend there is a circle, too; walls of 0.5 to 1.5 m were bent."""
    bend = around(270.0, 360.0, 19, radius=1.0)
    line = np.concatenate([[bend[0] - [length, 0.0]], bend, [bend[-1] + [0.0, length]]])
    straight, arcs = straight_and_curved(line)
    np.testing.assert_array_equal(straight, [line[:2], line[-2:]])
    np.testing.assert_array_equal(arcs[:, [0, -1]], [line[[1, -2]]])


@pytest.mark.parametrize("corners", [3, 4, 6, 8, 12])
def test_rooms_with_edges_stay_straight(corners):
    line = around(0.0, 360.0, corners + 1)
    straight, arcs = straight_and_curved(line)
    assert len(arcs) == 0
    np.testing.assert_array_equal(straight, np.stack([line[:-1], line[1:]], axis=1))


def test_a_straight_line_of_many_vertices_stays_straight():
    line = np.linspace([0.0, 1.0], [1.0, 2.0], 30)
    straight, arcs = straight_and_curved(np.repeat(line, 2, axis=0))
    assert (len(straight), len(arcs)) == (29, 0)


def test_an_ellipse_is_arcs_that_are_nearer_to_it_than_its_pieces():
    angle = np.linspace(0.0, 2.0 * np.pi, 73)
    axes = np.array([0.5, 0.3])
    straight, arcs = straight_and_curved(axes * np.stack([np.cos(angle), np.sin(angle)], axis=1))
    assert len(straight) <= 6
    off = np.concatenate([np.linalg.norm(arc_through(*arc) / axes, axis=1) - 1.0 for arc in arcs])
    assert np.abs(off).max() * 0.5 < 1e-3
