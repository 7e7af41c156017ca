"""Who is seen through whom, on mirrors drawn by hand and a few echoes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from synthetic import U_CELL, echoes_at, empty_view, on_line

from mirrorfold.common.types import ROOT, UNSEEN
from mirrorfold.detection.mirrors.arc_mirror import ArcMirror
from mirrorfold.detection.mirrors.line_mirror import LineMirror
from mirrorfold.detection.views.volume_view import VolumeView
from mirrorfold.folding.settings import FoldSettings
from mirrorfold.tree.lines_of_sight import Cover
from mirrorfold.tree.ordering import Order, order_mirrors

SETTINGS = FoldSettings(minimum_length=0.3, wall_margin=0.0)


def line(start, end):
    return LineMirror(np.array(start), np.array(end))


NEAR, FAR = line([-0.3, 1.0], [0.3, 1.0]), line([-0.5, 2.0], [0.5, 2.0])
"""One wholly behind the other, as seen from the radar."""

WIDE = line([-1.2, 2.0], [1.2, 2.0])
"""One that goes on to either side of it: the middle 1.2 m are seen by way of it."""


@pytest.fixture(scope="module")
def view():
    return empty_view()


def ordered(view, mirrors, places=((0.0, 0.5),), amplitude=1.0, walls=None, **settings):
    echoes = echoes_at(view, places, amplitude)
    return order_mirrors(mirrors, view, echoes, replace(SETTINGS, **settings), walls), echoes


def ends(order):
    return [np.round(mirror.ends[:, 0], 2).tolist() for mirror in order.mirrors]


def test_a_mirror_behind_another_is_seen_through_it(view):
    order, _ = ordered(view, [FAR, NEAR], opaque=False)
    assert order.mirrors == [FAR, NEAR]
    assert_array_equal(order.parent, [1, ROOT])
    assert order.way(0) == (NEAR, FAR)
    assert order.way(1) == (NEAR,)
    assert order.way(ROOT) == order.way(UNSEEN) == ()


def test_a_face_is_shown_by_what_shows_its_mirror(view):
    order, echoes = ordered(view, [NEAR, FAR], [(0.0, y) for y in (0.5, 1.0, 1.5, 2.0, 2.5)], opaque=False)
    assert_array_equal(order.face, [ROOT, 0, ROOT, 1, ROOT])
    assert_array_equal(order.shown_by(echoes), [ROOT, ROOT, 0, 0, 1])
    inside = replace(order, face=np.full(5, UNSEEN))
    assert_array_equal(inside.shown_by(echoes), np.full(5, UNSEEN))


def test_a_mirror_is_cut_where_the_view_by_way_of_another_ends(view):
    last = line([1.5, 1.0], [1.6, 1.5])
    order, _ = ordered(view, [WIDE, NEAR, last], opaque=False)
    assert_allclose(ends(order), [[-1.2, -0.6], [-0.6, 0.6], [0.6, 1.2], [-0.3, 0.3], [1.5, 1.6]], atol=0.02)
    assert_array_equal(order.parent, [ROOT, 3, ROOT, ROOT, ROOT])


def test_what_is_cut_off_a_mirror_cuts_no_other(view):
    """The first hides a part of the near one. Without that part, enough is left of the middle one to be a mirror."""
    first, near = line([-0.35, 0.5], [-0.125, 0.5]), line([-0.6, 1.0], [0.45, 1.0])
    middle, far = line([-1.25, 1.5], [-0.55, 1.5]), line([-1.9, 2.0], [-0.5, 2.0])
    order, _ = ordered(view, [first, near, middle, far], opaque=False, minimum_length=0.4)
    expected = [[-0.35, -0.125], [-0.25, 0.45], [-1.05, -0.55], [-1.9, -1.4], [-1.4, -0.73]]
    assert_allclose(ends(order), expected, atol=0.03)
    assert_array_equal(order.parent, [ROOT, ROOT, 0, ROOT, 2])


@pytest.mark.parametrize(("past", "moved", "parent"), [(1.0, 0.0, 0), (1.0, 0.06, ROOT), (3.0, 0.0, ROOT)])
def test_the_image_of_a_wall_past_the_end_of_a_mirror_is_seen_in_the_mirror(view, past, moved, parent):
    """Most lines of sight to the image miss the mirror, by so many beams. What is no image is a wall of its own."""
    end, shows = 0.7 / np.hypot(0.7, 1.0), line([0.7, 1.0], [0.7, 1.4])
    u = end + np.array([-0.4, past]) * U_CELL
    row = np.array([1.5, 1.8])[:, None] * np.column_stack([u, np.sqrt(1.0 - u**2)])
    wall = line(*(shows.reflection(row) + moved * np.array([-1.0, -1.0])))
    order, _ = ordered(view, [shows, wall, line(*row)], opaque=False)
    assert_array_equal(order.parent, [ROOT, ROOT, parent])


def test_what_is_too_small_for_a_mirror_is_the_edge_of_a_wall(view):
    """Pieces of 0.6 m are no mirrors where these have at least 0.7 m, and echoes on them no objects."""
    places = [[0.0, 2.0], [0.9, 2.0], [0.9, 1.5]]
    order, _ = ordered(view, [WIDE, NEAR], places, opaque=False, minimum_length=0.7)
    assert_allclose(ends(order), [[-0.6, 0.6], [-0.3, 0.3]], atol=0.02)
    assert_array_equal(order.parent, [1, ROOT])
    assert_array_equal(order.face, [0, UNSEEN, ROOT])


@pytest.mark.parametrize(
    ("leg", "known", "parents"),
    [(0.24, True, [ROOT, 2, ROOT, 0]), (0.24, False, [ROOT, ROOT]), (0.15, True, [ROOT, ROOT])],
)
def test_the_legs_of_a_known_corner_are_mirrors_that_show_each_other(view, leg, known, parents):
    """Each leg is continued by the image of the other one. At least 0.65 of 0.3 m of a leg must be seen."""
    vertex, axes = np.array([0.0, 2.0]), np.array([[0.6, 0.8], [-0.8, 0.6]])
    cross = [line(vertex - leg * axis, vertex + leg * axis) for axis in axes]
    told = view.knowing(corners=vertex[None] + 0.005) if known else view
    order, _ = ordered(told, cross, [vertex + 3.0 * axis for axis in axes], opaque=False)
    assert_array_equal(order.parent, parents)
    assert_allclose(sum(mirror.length for mirror in order.mirrors), 4.0 * leg, atol=0.04)  # a line of sight at each end


def test_echoes_lie_on_mirrors_inside_their_walls_or_elsewhere(view):
    places = [[0.1, 1.0], [0.1, 1.08], [0.1, 1.3], [0.1, 2.0]]
    order, _ = ordered(view, [NEAR, FAR], places, opaque=False, wall_margin=0.1)
    assert_array_equal(order.face, [0, UNSEEN, ROOT, 1])


SCREEN = on_line([-0.3, 0.7], [0.3, 0.7])
"""An object before all of the near mirror."""


def test_a_mirror_behind_objects_is_none_and_its_echoes_are_objects(view):
    places = [*SCREEN, [0.1, 1.0]]
    order, _ = ordered(view, [NEAR], places)
    assert order.mirrors == []
    assert order.face[-1] == ROOT
    assert not order.cover.clear(np.array([1.0]), order.view.column(np.array([0.1])), 1.0)[0]
    for given in ({"opaque": False}, {"amplitude": 0.05}):  # objects that hide nothing, and echoes that are too faint
        order, _ = ordered(view, [NEAR], places, **given)
        assert order.mirrors == [NEAR]
        assert order.face[-1] == 0
    # One that is much brighter than all before it is seen all the same.
    assert ordered(view, [replace(NEAR, strength=11.0)], places)[0].mirrors


def test_a_mirror_is_hidden_by_what_is_before_it_however_near_and_not_by_what_is_behind(view):
    for distance, hidden in ((0.05, True), (-0.05, False)):
        places = on_line([-0.4, 1.0 - distance], [0.4, 1.0 - distance])
        assert (ordered(view, [NEAR], places)[0].mirrors == []) == hidden


def test_echoes_of_walls_hide_nothing(view):
    places = on_line(*NEAR.ends)
    order, _ = ordered(view, [NEAR, FAR], places)
    assert len(order.mirrors) == 2
    assert order.cover.range.size == 0


@pytest.mark.parametrize("mark", ["visible", "strong"])
def test_what_is_faint_or_hidden_itself_hides_nothing(view, mark):
    echoes = replace(echoes_at(view, SCREEN), **{mark: np.zeros(len(SCREEN), dtype=bool)})
    assert order_mirrors([NEAR], view, echoes, SETTINGS).cover.range.size == 0


def test_a_mirror_may_be_met_by_one_line_of_sight(view):
    order, _ = ordered(view, [line([-0.001, 1.0], [0.001, 1.0])], opaque=False)
    assert np.count_nonzero(np.isfinite(order.crossing)) == 1


def test_a_mirror_that_was_cut_off_numbers_the_others_anew(view):
    """The near mirror is hidden: the far one beside it is the first, and the only one that is left."""
    beside = line([0.8, 1.0], [1.0, 1.6])
    order, _ = ordered(view, [NEAR, beside], [*SCREEN, [0.9, 1.3]])
    assert order.mirrors == [beside]
    assert_array_equal(order.parent, [ROOT])
    assert order.face[-1] == 0
    assert order.crossing.shape == (1, view.u.size)


@pytest.mark.parametrize(("generations", "kept"), [(0, 0), (1, 1), (2.0, 2), (1000, 3), (None, 3)])
def test_mirrors_of_so_many_generations_are_kept(view, generations, kept):
    """Three behind each other, in either order."""
    three = [FAR, line([-0.4, 1.5], [0.4, 1.5]), NEAR]
    order, _ = ordered(view, three, [[0.0, 2.0]], opaque=False, generations=generations)
    assert order.mirrors == three[3 - kept :]
    assert order.face[0] == (0 if kept == 3 else ROOT)
    order, _ = ordered(view, three[::-1], [[0.0, 2.0]], opaque=False, generations=generations)
    assert order.mirrors == three[::-1][:kept]


def test_where_mirrors_are_given_objects_hide_only_what_is_behind_the_same_mirrors(view):
    """An object in front of the given mirror hides nothing; one behind it does, but no wall does."""
    before, after, wall_ = [[0.0, 0.7]], [[0.05, 1.3]], [[0.15, 1.3]]
    later = np.array([1.8])
    walls = np.array([False, False, True])
    order, _ = ordered(view, [NEAR], [*before, *after, *wall_], walls=walls)
    assert order.mirrors == [NEAR]
    for u, clear in ((0.0, True), (0.05 / np.hypot(0.05, 1.3), False), (0.15 / np.hypot(0.15, 1.3), True)):
        assert order.cover.clear(later, view.column(np.array([u])), 1.0)[0] == clear


def test_beside_given_mirrors_nothing_is_hidden(view):
    """Neither by what stands there nor by what covers the last lines of sight to the mirror; else all is."""
    edge = np.flatnonzero(np.isfinite(NEAR.crossing(view)))[-1] + np.array([0, 1])
    places = [[0.8, 0.8], 1.5 * view.sight[edge[0]]]
    aside = np.append(edge, view.column(np.sqrt(0.5)))
    for walls, clear in ((np.zeros(2, dtype=bool), [False, True, True]), (None, [False, False, False])):
        order, _ = ordered(view, [NEAR], places, walls=walls)
        assert_array_equal(order.cover.clear(np.full(3, 2.0), aside, 1.0), clear)


def test_the_threshold_follows_what_a_lossy_mirror_dims(view):
    """In line of sight a bright echo; behind the mirror a dimmer one, by which others there are judged."""
    angle = np.array([-0.1, -0.05, 0.0, 0.05, 0.1])
    behind = 1.6 * np.stack([np.sin(angle), np.cos(angle)], axis=1)
    places = [[0.8, 0.8], *behind, [0.1, 1.0], [-0.6, 1.2]]
    amplitude = np.array([1.0, 0.2, 0.2, 0.2, 0.015, 0.005, 0.05, 0.05])
    order, echoes = ordered(view, [NEAR], places, amplitude, opaque=False)
    echoes = replace(echoes, reference=2.0)
    seen = order.seen(echoes)
    # 0.2 is a tenth of the reference: a tenth of the threshold of 0.1.
    assert_allclose(seen.limit, [0.1, *[0.01] * 5, 0.1, 0.1])
    assert_array_equal(seen.strong, [True, True, True, True, True, False, False, False])
    assert seen.visible.all()
    # Of brighter ones the threshold does not follow; where none is strong there is nothing to follow.
    for factor in (20.0, 0.4):
        brighter = replace(echoes, amplitude=factor * amplitude, strong=factor * amplitude >= 0.1)
        assert_allclose(order.seen(brighter).limit, 0.1)


def test_of_each_beam_the_brightest_echo_counts_for_the_reference(view):
    """Many weaker ones at other ranges of one beam do not lower it."""
    ahead = np.column_stack([np.zeros(9), np.linspace(1.3, 2.1, 9)])
    beside = 1.6 * np.stack([np.sin([0.1, 0.15]), np.cos([0.1, 0.15])], axis=1)
    amplitude = np.array([0.4, *[0.2] * 8, 0.4, 0.4])
    order, echoes = ordered(view, [NEAR], [*ahead, *beside], amplitude, opaque=False)
    assert_allclose(order.seen(echoes).limit, 0.04)


def test_echoes_a_cell_apart_are_of_different_beams(view):
    """Of three beams with 0.4, 0.2 and 0.2 the middle of the weights is 0.2; of two of them it would be 0.4."""
    places = view.to_points(np.full(3, 1.5), U_CELL * np.arange(3))
    order, echoes = ordered(view, [NEAR], places, np.array([0.4, 0.2, 0.2]), opaque=False)
    assert_allclose(order.seen(echoes).limit, 0.02)


@pytest.mark.parametrize("step", [(1, 0), (0, 1), (1, -1)])
def test_beams_of_a_volume_differ_along_either_angle(step):
    angle = np.arange(-5.0, 6.0)
    view = VolumeView(np.zeros((11, 11, 20), dtype=np.float32), np.linspace(0.5, 2.4, 20), angle, angle, np.ones(20),
                      "none", 0.0, np.zeros(3), 0.05)  # fmt: skip
    at = 5 + np.outer([-1, 0, 1], step)
    places = 1.5 * view.sight[np.ravel_multi_index(at.T, (11, 11))]
    echoes = echoes_at(view, places, np.array([0.4, 0.2, 0.2]))
    order = Order(view, [NEAR], np.full((1, 121), 1.0), np.array([ROOT]), Cover.nothing(121), face=np.full(3, ROOT))
    assert_allclose(order.seen(echoes).limit, 0.02)


def test_what_objects_hide_is_no_evidence_of_how_much_a_mirror_dims(view):
    screen, behind = on_line([-0.2, 1.3], [0.2, 1.3]), on_line([-0.25, 2.2], [0.25, 2.2])
    amplitude = np.repeat([1.0, 5.0], [len(screen), len(behind)])
    order, echoes = ordered(view, [NEAR], [*screen, *behind], amplitude)
    seen = order.seen(replace(echoes, reference=10.0))
    assert_array_equal(seen.visible, amplitude == 1.0)
    assert_allclose(seen.limit, np.where(seen.visible, 0.01, 0.1))


def test_what_a_curved_mirror_spreads_is_no_loss(view):
    """Behind a pillar echoes are as much weaker as the pencil of rays is wider, there and back."""
    pillar = ArcMirror(middle=np.array([0.0, 1.3]), radius=0.3, first=np.pi, span=np.pi, radar=np.zeros(2))
    place = np.array([[0.0, 2.0]])
    # q / r = 1 + 2 r1 s / (R r), with r1 = s = 1 m.
    gain = 1.0 + 2.0 / (0.3 * 2.0)
    order, echoes = ordered(view, [pillar], place, 1.0 / gain, opaque=False)
    assert_allclose(order.seen(echoes).limit, 0.1 / gain, rtol=1e-6)


def test_the_radar_sees_itself_at_twice_the_distance_of_a_mirror(view):
    own, other = line([-0.05, 2.0], [0.05, 2.0]), line([-0.05, 1.8], [0.05, 1.8])
    known = replace(view, wavelength=1e-3)
    for mirror, itself in ((own, True), (other, False)):
        order, _ = ordered(known, [NEAR, mirror], opaque=False, minimum_length=0.01)
        assert_array_equal(order.images_of_radar(), [False, itself])


@pytest.mark.parametrize(
    ("known", "moved", "image"), [(True, 0.0, True), (True, 0.02, True), (True, 0.1, False), (False, 0.0, False)]
)
def test_both_legs_of_a_known_corner_show_a_wall_turned_about_the_vertex(view, known, moved, image):
    vertex, wall = np.array([0.0, 2.2]), line([-0.3, 1.0], [-0.3, 1.5])
    legs = [line([side * 0.3, 1.9], [side * 0.01, 2.19]) for side in (-1.0, 1.0)]
    row = line(*(2.0 * vertex - wall.ends + [moved, 0.0]))
    told = view.knowing(corners=vertex[None] + 0.003) if known else view
    order, _ = ordered(told, [wall, *legs, row], opaque=False, minimum_length=0.2)
    assert_array_equal(order.parent, [ROOT, ROOT, ROOT, 2])
    assert_array_equal(order.images_in_corners(), [False, False, False, image])


@pytest.mark.parametrize("count", [4, 12])
def test_lines_of_sight_are_met_with_each_mirror_and_each_piece_only_a_few_times(view, count, monkeypatch):
    asked = []
    monkeypatch.setattr(
        LineMirror, "crossing", lambda mirror, view, met=LineMirror.crossing: asked.append(mirror) or met(mirror, view)
    )
    mirrors = [line([-0.3, 1.0 + 0.1 * place], [0.3, 1.0 + 0.1 * place]) for place in range(count)]
    order, _ = ordered(view, mirrors, opaque=False)
    assert len(order.mirrors) >= count
    assert len(asked) <= 3 * len(order.mirrors)  # not once for every other mirror, too
