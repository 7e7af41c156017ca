"""What a mirror shows at its end appears beside it, too, as wide as a beam: a few echoes, one mirror drawn by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from synthetic import echoes_at, empty_view

from mirrorfold.detection import fold_of
from mirrorfold.detection.mirrors.arc_mirror import ArcMirror
from mirrorfold.detection.mirrors.line_mirror import LineMirror
from mirrorfold.detection.mirrors.plane_mirror import PlaneMirror
from mirrorfold.detection.views.volume_view import VolumeView
from mirrorfold.folding.settings import FoldSettings
from mirrorfold.tree.assignment import assign_echoes
from mirrorfold.tree.ordering import order_mirrors

MIRROR = LineMirror(np.array([-0.3, 1.0]), np.array([0.3, 1.1]))
END = 0.3 / np.hypot(0.3, 1.1)
"""Sine of the direction in which it ends."""


@pytest.fixture(scope="module")
def view():
    return replace(empty_view(), wavelength=1e-3)


def at(view, range_, beams):
    """So many resolution cells beyond the end of the mirror."""
    sine = END + beams * view.u_cell
    return [range_ * sine, range_ * np.sqrt(1.0 - sine**2)]


def owners(view, places, amplitude=1.0, **given):
    """How many echoes are seen directly, and by way of the mirror."""
    echoes = echoes_at(view, [[-0.8, 0.8], *places], np.append(1.0, amplitude * np.ones(len(places))))
    settings = FoldSettings(minimum_length=0.1, wall_margin=0.0, opaque=False)
    tree, _ = assign_echoes(order_mirrors([MIRROR], view, echoes, settings), echoes, **given)
    return len(tree.objects) - 1, len(tree.mirrors[0].objects)


@pytest.mark.parametrize(
    ("beams", "direct", "mirrored"), [([0.5], 0, 1), ([1.2], 0, 1), ([1.8], 1, 0), ([-0.5, 0.5, 1.2], 0, 3)]
)
def test_what_is_less_than_a_beam_beside_the_end_is_what_the_mirror_shows(view, beams, direct, mirrored):
    assert owners(view, [at(view, 2.9, each) for each in beams]) == (direct, mirrored)


def test_an_object_that_reaches_farther_away_stands_beside_the_mirror(view):
    assert owners(view, [at(view, 2.9, each) for each in (0.5, 1.4, 2.3)]) == (3, 0)
    # Cut in two by a gap, the near part alone is the mirror's.
    assert owners(view, [at(view, 2.9, each) for each in (0.5, 2.3)]) == (1, 1)


@pytest.mark.parametrize(
    ("amplitude", "before", "direct", "mirrored"),
    [
        pytest.param([0.3, 1.0, 1.0, 1.0], [-0.5], 4, 0, id="the flank of an object beside the mirror"),
        pytest.param([1.0, 0.3, 0.3, 0.3], [-0.5], 3, 1, id="brighter than what stands beside the mirror"),
        pytest.param([0.3, 0.3, 1.0, 1.0, 1.0], [-0.5, -1.9], 3, 2, id="on from the end of the mirror"),
        pytest.param([0.3, 1.0, 1.0, 1.0], [-2.5], 3, 1, id="another object"),
    ],
)
def test_what_is_less_than_a_beam_before_the_end_may_be_of_an_object_beside_it(
    view, amplitude, before, direct, mirrored
):
    places = [at(view, 2.9, each) for each in (*before, 0.5, 1.4, 2.3)]
    assert owners(view, places, amplitude) == (direct, mirrored)


def test_the_foot_of_a_beam_does_not_reach_on(view):
    """20 dB below what stands beside the mirror, and two beams away from it."""
    places = [at(view, 2.9, each) for each in (-1.9, -0.5, 0.5, 1.4, 2.3)]
    assert owners(view, places, [0.1, 0.3, 1.0, 1.0, 1.0]) == (5, 0)


def owned(view, other, places, amplitude):
    """How many object echoes are seen directly, by way of the mirror, and of another one."""
    echoes = echoes_at(view, [[-0.8, 0.8], *places], np.append(1.0, amplitude))
    settings = FoldSettings(minimum_length=0.1, wall_margin=0.02, opaque=False)
    order = order_mirrors([MIRROR, other], view, echoes, settings)
    tree, _ = assign_echoes(order, echoes)
    return [len(tree.objects) - 1, *(len(node.objects) for node in tree.mirrors)]


@pytest.mark.parametrize(("flank", "expected"), [(0.3, [0, 0, 4]), (3.0, [0, 1, 3])])
def test_beside_the_end_another_mirror_may_show_the_object(view, flank, expected):
    beside = LineMirror(np.array(at(view, 0.9, 0.2)), np.array(at(view, 0.9, 20.0)))
    places = [at(view, 2.9, each) for each in (-0.5, 0.5, 1.4, 2.3)]
    assert owned(view, beside, places, [flank, 1.0, 1.0, 1.0]) == expected


@pytest.mark.parametrize(("beams", "expected"), [((0.5, 1.4, 2.3, 3.2), [0, 0, 4]), ((-1.3, -0.4, 0.5), [0, 3, 0])])
def test_between_the_ends_of_two_mirrors_an_echo_is_of_the_object_that_it_touches(view, beams, expected):
    beside = LineMirror(np.array(at(view, 0.9, 1.1)), np.array(at(view, 0.9, 20.0)))
    assert owned(view, beside, [at(view, 2.9, each) for each in beams], np.ones(len(beams))) == expected


@pytest.mark.parametrize(("beyond", "direct"), [(1.0, 5), (0.2, 2)])
def test_beside_a_pillar_a_bright_object_has_a_wide_foot(view, beyond, direct):
    """What a pillar shows fades towards its edge, and stands at other ranges than what is seen past the edge."""
    pillar = ArcMirror(np.array([0.0, 1.2]), 1.2 * END, -np.pi, np.pi, view.radar)
    places = [at(view, 2.9, each) for each in (-2.5, -1.6, -0.7, 0.5, 1.4)]
    echoes = echoes_at(view, [[-0.8, 0.8], *places], np.array([1.0, 0.3, 0.4, 0.6, beyond, beyond]))
    settings = FoldSettings(minimum_length=0.1, wall_margin=0.0, opaque=False)
    tree, _ = assign_echoes(order_mirrors([pillar], view, echoes, settings), echoes)
    assert len(tree.objects) - 1 == direct


@pytest.mark.parametrize(("flank", "expected"), [(0.3, [1, 0, 0]), (3.0, [0, 1, 0])])
def test_a_wall_beside_the_end_appears_before_it_too(view, flank, expected):
    """The mirror does not show what the wall's own row runs on to."""
    wall = LineMirror(np.array(at(view, 2.9, 0.7)), np.array(at(view, 2.9, 20.0)))
    places = [
        at(view, 2.9, -0.7),
        *(wall.start + share * (wall.end - wall.start) for share in np.linspace(0.0, 1.0, 40)),
    ]
    assert owned(view, wall, places, np.append(flank, np.ones(len(places) - 1))) == expected


def test_what_stands_at_the_mirror_or_before_it_is_not_behind_it(view):
    near = [at(view, range_, 0.7) for range_ in (0.9, 1.14)]
    assert owners(view, near)[1] == 0


def test_what_the_radars_own_view_contradicts_stays_where_it_is_seen(view):
    """It would stand half a metre before the radar, which sees nothing there."""
    assert owners(view, [at(view, 1.6, 0.5)]) == (1, 0)


def test_echoes_as_published_belong_to_their_lines_of_sight(view):
    assert owners(view, [at(view, 2.9, 0.5)], opaque=False) == (1, 0)


def test_only_echoes_of_the_view_that_shows_the_mirror_are_its_own(view):
    """A wall crosses the way beyond the end of the mirror: what stands behind it is seen by way of that wall alone."""
    wall = LineMirror(np.array(at(view, 1.4, 0.2)), np.array(at(view, 1.5, 12.0)))
    echoes = echoes_at(view, [[-0.8, 0.8], at(view, 2.9, 0.5)])
    settings = FoldSettings(minimum_length=0.05, wall_margin=0.0, opaque=False)
    tree, _ = assign_echoes(order_mirrors([MIRROR, wall], view, echoes, settings), echoes)
    assert_array_equal([len(child.objects) for child in tree.mirrors], [0, 1])


@pytest.fixture(scope="module")
def scan():
    """A raster volume whose beams are narrower than the steps between them."""
    angle, range_ = np.arange(-10.0, 10.5), np.arange(0.5, 4.0, 0.01)
    nothing = np.zeros((angle.size, angle.size, range_.size), dtype=np.float32)
    return VolumeView(nothing, range_, angle, angle, np.ones(range_.size), "none", 0.0, np.zeros(3), 0.02,
                      beam=(0.008, 2.0, 1e-3))  # fmt: skip


@pytest.mark.parametrize(("columns", "mirrored"), [(1, 9), (4, 0)])
def test_a_slanting_object_beside_a_plane_is_one_object_from_beam_to_beam(scan, columns, mirrored):
    """From each column to the next by three range cells."""
    steps = np.rint(np.degrees(scan.angles(scan.radar + scan.sight)[1])).astype(int)
    wall = PlaneMirror(
        np.array([-0.1, 1.0, 0.0]),
        np.array([0.0, -1.0, 0.0]),
        np.array([[x, 1.0, z] for x in (-0.2, 0.0) for z in (-0.2, 0.2)]),
        steps[:, 0] < 0,
    )
    slanting = (steps[:, 0] >= 0) & (steps[:, 0] < columns) & (np.abs(steps[:, 1]) <= 4)
    range_ = 3.0 - 0.06 * steps[slanting, 0]
    echoes = echoes_at(scan, range_[:, None] * scan.sight[slanting])
    settings = FoldSettings(minimum_length=0.1, wall_margin=0.0, opaque=False)
    tree, _ = assign_echoes(order_mirrors([wall], scan, echoes, settings), echoes)
    assert len(tree.mirrors[0].objects) == mirrored
    assert len(tree.objects) == slanting.sum() - mirrored


def test_in_a_corner_of_two_planes_a_wall_seen_in_the_other_stays_its_image(scan):
    """It begins at the edge where both meet, and all of it is 20 dB weaker than the wall beyond that edge."""
    view = replace(scan, beam=(0.05, 2.0, 1e-3))
    azimuth = np.degrees(view.axes[0])[np.arange(len(view.sight)) // len(view.elevation)]
    edge, across = np.array([0.0, 2.0, 0.0]), (np.array([0.6, -0.8, 0.0]), np.array([-0.8, -0.6, 0.0]))
    left, right = (
        PlaneMirror(edge, normal, np.empty((0, 3)), some).part_in_beams(view, some)
        for normal, some in zip(across, (azimuth < 0.0, azimuth > 0.0), strict=True)
    )
    image = fold_of((left,), 3)(edge + np.linspace(0.01, 0.4, 40)[:, None] * [0.6, -0.8, 0.0])
    high = np.concatenate([image + np.array([0.0, 0.0, height]) for height in np.linspace(-0.3, 0.3, 15)])
    range_, beam, _ = view.locate(high)
    keep = azimuth[beam] < 0.0
    faint = view.points(range_[keep], beam[keep])
    walls = np.concatenate([left.places(view), right.places(view)])
    echoes = echoes_at(view, [*walls, *faint], np.append(np.ones(len(walls)), 0.1 * np.ones(len(faint))))
    settings = FoldSettings(minimum_length=0.1, wall_margin=0.0)
    tree, _ = assign_echoes(order_mirrors([left, right], view, echoes, settings), echoes)
    assert not len(tree.objects)
    assert len(tree.mirrors[0].objects) > 0.75 * len(faint)  # the others lie on the walls
