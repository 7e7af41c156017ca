"""Mirrors that the radar sees edge-on, found by what they show of another wall."""

from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest
from synthetic import RANGE_CELL, diffuse, radar_image, together

from mirrorfold.common.geometry import reflect, segment_normal
from mirrorfold.detection.finding import find_echoes, find_mirrors, see
from mirrorfold.detection.mirrors.line_mirror import LineMirror
from mirrorfold.detection.search.edge_on import _as_far_as_lit, _between, edge_on

FAR = np.array([[-0.5, 1.5], [0.5, 1.45]])
SIDE = np.array([[-0.24, 0.4], [-0.31, 0.8]])
"""A far wall across the view, and a wall along which the radar at the origin looks."""

SHORTEST = 0.15


def scene(*more, side_level=0.02, far=FAR, first=0.3):
    """The radar's view of the far wall, of its image in the side wall, and of the side wall itself, hardly visible."""
    normal = segment_normal(*SIDE)
    image = [reflect(np.array([place]), SIDE[0], normal)[0] for place in (far[0] + first * (far[1] - far[0]), far[1])]
    position, amplitude = diffuse(*SIDE, seed=3)
    parts = diffuse(*far, seed=1), diffuse(*image, seed=2), (position, side_level * np.asarray(amplitude)), *more
    view = see(radar_image(*together(*parts), np.linspace(-1.4, 1.0, 241), np.linspace(0.25, 1.9, 166)))
    echoes = find_echoes(view)
    return view, echoes, find_mirrors(view, echoes, minimum_length=SHORTEST)


def angle_deg(mirror, true):
    """Between a mirror and the true one."""
    return np.degrees(np.arccos(min(1.0, abs(mirror.normal @ segment_normal(*true)))))


@pytest.mark.slow
def test_a_side_wall_is_found_by_the_image_in_it():
    view, echoes, mirrors = scene()
    assert all(angle_deg(mirror, SIDE) > 5.0 for mirror in mirrors)  # its own echoes are too faint
    (found,) = edge_on(mirrors, [], view, echoes, SHORTEST)
    assert angle_deg(found, SIDE) < 0.15
    assert abs(found.beside(SIDE.mean(axis=0))) < 2e-3
    # It is as long as the directions in which it shows the far wall, but no longer than the side wall itself.
    (shown,) = (line for image, wall in permutations(mirrors, 2) for line in _between(wall, image, view))
    assert shown.ends[:, 1].min() < SIDE[0, 1] - 0.1
    assert found.ends[:, 1].max() == pytest.approx(shown.ends[:, 1].max(), abs=0.02)
    assert found.ends[:, 1].min() == pytest.approx(SIDE[0, 1], abs=2.0 * RANGE_CELL)
    assert found.angle_error < 0.2
    assert 0.0 < found.offset_error < 2e-3


@pytest.mark.slow
def test_the_faint_line_tells_where_the_side_wall_is_if_wall_and_image_are_nearly_parallel():
    """Their crossing is then known to a resolution cell alone."""
    normal = segment_normal(*SIDE)
    turn = np.radians(2.0)
    across = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]) @ normal
    far = np.array([-0.32, 1.45]) + np.outer([0.0, 1.0], 0.9 * across * np.sign(across[0]))
    view, echoes, mirrors = scene(far=far, first=0.0)
    (found,) = edge_on(mirrors, [], view, echoes, SHORTEST)
    assert angle_deg(found, SIDE) < 0.15
    assert abs(found.beside(SIDE.mean(axis=0))) < 2e-3
    assert found.offset_error < 2e-3


@pytest.mark.slow
def test_a_row_too_short_for_a_mirror_may_be_an_image():
    view, echoes, mirrors = scene()
    wall, image = sorted(mirrors, key=lambda mirror: -mirror.length)[:2]
    if angle_deg(wall, FAR) > angle_deg(image, FAR):
        wall, image = image, wall
    short = image.part(0.0, 0.5 * image.length)
    assert edge_on([wall], [], view, echoes, SHORTEST) == []
    (found,) = edge_on([wall], [short], view, echoes, SHORTEST)
    assert angle_deg(found, SIDE) < 0.3


def test_a_short_image_tells_a_mirror_whose_line_is_long_enough():
    """The image in it is seen along a part of the mirror; the faint line goes on beyond it."""
    view, echoes, mirrors = scene()
    wall, image = sorted(mirrors, key=lambda mirror: angle_deg(mirror, FAR))[:2]
    short = image.part(0.0, 0.2 * image.length)
    (shown,) = _between(wall, short, view)
    shortest = 1.1 * shown.length
    (found,) = edge_on([wall], [short], view, echoes, shortest)
    assert found.length >= shortest
    assert angle_deg(found, SIDE) < 0.3
    # No more than the line itself: a mirror must be as long as that of others.
    assert edge_on([wall], [short], view, echoes, 1.1 * found.length) == []


@pytest.mark.slow
def test_the_line_ends_where_it_has_faded_however_dark_it_is_beside_it(monkeypatch):
    """What goes on there, 40 dB weaker, is what bends round the edge of the wall."""
    longer = LineMirror(SIDE[0], SIDE[1] + 0.35 * (SIDE[1] - SIDE[0]))
    view, _, _ = scene(diffuse(SIDE[1], longer.end, seed=4, strength=0.01), side_level=1.0)
    assert _as_far_as_lit(longer, view).ends[:, 1].max() == pytest.approx(SIDE[1, 1], abs=RANGE_CELL)
    monkeypatch.setattr("mirrorfold.detection.search.edge_on.FADED", 0.0)
    assert _as_far_as_lit(longer, view).ends[:, 1].max() > SIDE[1, 1] + 2.0 * RANGE_CELL


def test_where_no_faint_line_halves_the_angle_of_two_walls_there_is_no_mirror():
    """They may well be the two walls of a room's corner."""
    view, echoes, mirrors = scene(side_level=0.0)
    assert len(mirrors) == 2
    assert edge_on(mirrors, [], view, echoes, SHORTEST) == []


def test_one_wall_has_no_image():
    view, echoes, mirrors = scene()
    assert edge_on(mirrors[:1], [], view, echoes, SHORTEST) == []
    parallel = LineMirror(*(mirrors[0].ends + np.array([0.0, 0.1])))
    assert edge_on([mirrors[0], parallel], [], view, echoes, SHORTEST) == []
