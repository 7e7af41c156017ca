"""Lines of sight on a few echoes and one or two mirrors: what is hidden, seen through which mirror, and known empty."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from synthetic import RANGE_CELL, U_CELL, WAVELENGTH, echoes_at, empty_view, on_line

from mirrorfold.common.types import ROOT, UNSEEN
from mirrorfold.detection.mirrors.line_mirror import LineMirror
from mirrorfold.detection.views.image_view import OPAQUE_CELLS
from mirrorfold.tree.lines_of_sight import (
    CLEAR_DB,
    ITSELF_CELLS,
    OPEN_CELLS,
    POINT_CELLS,
    Cover,
    LinesOfSight,
    hidden_at,
    hiding_levels,
    images_of_radar,
    shadow_ends,
    through_at,
)

DEPTH = OPAQUE_CELLS * RANGE_CELL
LEVEL = 10.0 ** (CLEAR_DB / 20.0)

WALL = LineMirror(np.array([-0.3, 1.5]), np.array([0.3, 1.5]))


@pytest.fixture(scope="module")
def view():
    return empty_view()


def sight_of(view, *mirrors, parent=(ROOT,), **known):
    crossing = np.array([mirror.crossing(view) for mirror in mirrors])
    return LinesOfSight(view, mirrors, crossing, np.array(parent), Cover.nothing(view.u.size), **known)


def test_an_object_hides_what_is_behind_it_unless_that_is_much_stronger(view):
    cover = Cover.of(echoes_at(view, [0.0, 1.0], 2.0), view)
    ahead = np.array([view.column(0.0)])
    for range_, amplitude, clear in (
        (0.5, 0.1, True), (1.0 + 0.99 * DEPTH, 0.1, True), (1.0 + 1.01 * DEPTH, 0.99 * 2.0 * LEVEL, False),
        (2.9, 1.01 * 2.0 * LEVEL, True), (2.9, 2.0 * LEVEL, False),
    ):  # fmt: skip
        assert cover.clear(np.array([range_]), ahead, amplitude)[0] == clear


def test_a_small_object_hides_no_more_than_its_brightest_cell_says(view):
    """As often as one cell fades by 20 dB, the brightest of a few fades by the level that is allowed for it."""
    random = np.random.default_rng(0)
    for cells in range(1, POINT_CELLS + 3):
        places = np.column_stack([np.zeros(cells), 1.0 + RANGE_CELL * np.arange(cells)])
        level = hiding_levels(echoes_at(view, places, np.append(np.full(cells - 1, 0.5), 3.0)), view)
        if cells > POINT_CELLS:
            assert_allclose(level, LEVEL * np.append(np.full(cells - 1, 0.5), 3.0))
            continue
        intensity = random.exponential(size=(200_000, cells)).max(axis=1)
        exceeds = np.mean(intensity * (level[-1] / 3.0) ** 2 < 1.0)  # the mean is above what is taken for its limit
        assert exceeds == pytest.approx(0.01, abs=0.001)
        assert_allclose(level[:-1], min(level[-1], 0.5 * LEVEL))
        assert level[-1] <= 3.0 * LEVEL * (1.0 + 1e-12)


def test_the_array_looks_around_an_object_that_is_narrower_than_half_of_it(view):
    """The line from each antenna to a place behind the object is followed, and those that meet the object counted."""
    seen = replace(view, wavelength=WAVELENGTH)
    length, range_, wide = WAVELENGTH * view.aperture_tx, 0.3, 0.75 * U_CELL
    for steps in (0, 3, 7):
        half = range_ * steps * view.du  # half-width of the object [m]
        side = np.linspace(-half, half, 2 * steps + 1)
        places = np.column_stack([side, np.sqrt(range_**2 - side**2)])
        end = shadow_ends(echoes_at(seen, places), seen)[0]
        assert_array_equal(shadow_ends(echoes_at(view, places), view), np.inf)  # where the array is not known
        antennas = np.linspace(-0.5, 0.5, 2001) * length
        for beyond, hides_most in ((0.97 * end, True), (1.03 * end, False)):
            passed = antennas * (1.0 - range_ / beyond)
            assert (np.mean(np.abs(passed) < half + range_ * wide) > 0.5) == hides_most
    broad = np.column_stack([np.linspace(-0.5 * length, 0.5 * length, 40), np.full(40, range_)])
    assert_array_equal(shadow_ends(echoes_at(seen, broad), seen), np.inf)
    assert_array_equal(shadow_ends(echoes_at(seen, [[0.0, 1.0]]), replace(seen, aperture_tx=0.0)), np.inf)


def test_what_stands_in_the_shadow_of_another_object_stays_hidden(view):
    """A post before a wide object: beyond the shadow of the post, the object alone hides, with its own level."""
    seen = replace(view, wavelength=WAVELENGTH)
    across = np.linspace(-0.1, 0.1, 60)
    places = np.column_stack([np.append(0.1 * across, across), np.repeat([0.3, 1.0], 60)])
    echoes = echoes_at(seen, places, np.repeat([5.0, 1.0], 60))
    cover, ahead, end = Cover.of(echoes, seen), np.array([seen.column(0.0)]), shadow_ends(echoes, seen)
    assert np.isinf(end[60:]).all()
    assert 0.3 + DEPTH < end[0] < 0.99
    for range_, hidden in (
        (0.3, 0.0), (0.999 * end[0], 5.0 * LEVEL), (1.001 * end[0], 0.0), (0.99, 0.0), (1.1, LEVEL), (2.9, LEVEL),
    ):  # fmt: skip
        one = np.array([range_])
        assert cover.clear(one, ahead, 1.01 * hidden + 1e-6)[0]
        assert not cover.clear(one, ahead, 0.99 * hidden)[0]


def test_an_object_hides_three_quarters_of_a_cell_to_either_side(view):
    cover = Cover.of(echoes_at(view, [0.0, 1.0]), view)
    hidden = ~cover.clear(np.full(view.u.size, 2.0), np.arange(view.u.size), 1.0)
    assert_array_equal(hidden, np.abs(view.u) < 0.75 * U_CELL)


def test_only_objects_that_are_stronger_than_all_before_them_count(view):
    """Three along a line of sight, given in no order, and one beside them."""
    places = np.array([[0.0, 1.6], [0.0, 1.0], [0.5, 0.9], [0.0, 1.3]])
    cover = Cover.of(echoes_at(view, places, np.array([2.0, 1.0, 0.6, 0.5])), view)
    ahead, aside = view.column(np.array([0.0, 0.5 / np.hypot(0.5, 0.9)]))
    assert_allclose(cover.range[:, ahead], [1.0 + DEPTH, 1.6 + DEPTH])
    assert_allclose(cover.level[:, ahead], [LEVEL, 2.0 * LEVEL])
    assert_allclose(cover.range[:, aside], [np.hypot(0.5, 0.9) + DEPTH, np.inf])
    assert_allclose(cover.level[0, aside], 0.6 * LEVEL)
    fainter = Cover.of(echoes_at(view, places, 1e-3 * np.array([2.0, 1.0, 0.6, 0.5])), view)
    assert_allclose(fainter.level, 1e-3 * cover.level)  # in whatever unit
    assert Cover.of(echoes_at(view, np.empty((0, 2))), view).range.shape == (0, view.u.size)


@pytest.mark.nojit
def test_loops_and_arrays_agree_at_every_edge(view):
    """A point right on a mirror is seen before it; one right where an object ends is hidden, as is one no stronger."""
    crossing = np.array([[1.0, 1.0, np.inf], [2.0, np.inf, 2.0]])
    begin = np.array([[1.0, 1.5, np.inf], [2.0, np.inf, np.inf]])
    until = np.array([[np.inf, np.inf, np.inf], [3.0, np.inf, np.inf]])
    cover = Cover(begin, until, np.array([[4.0, 8.0, 0.0], [9.0, 0.0, 0.0]]))
    sight = LinesOfSight(view, (WALL, WALL), crossing, np.array([ROOT, 0]), cover)
    assert UNSEEN < ROOT < 0  # no mirror has their numbers
    expected = {(1.0, 0): ROOT, (1.5, 0): 0, (2.0, 0): 0, (2.5, 0): 1, (2.5, 1): 0, (2.0, 2): ROOT, (2.5, 2): UNSEEN}
    for (range_, direction), owner in expected.items():
        one = np.array([range_]), np.array([direction])
        assert sight.seen_through(*one)[0] == through_at(*sight.passages, range_, direction) == owner
    for range_, direction, hidden in (
        (0.9, 0, 0.0), (1.0, 0, 4.0), (1.9, 0, 4.0), (2.0, 0, 9.0), (2.9, 0, 9.0), (3.0, 0, 4.0),
        (1.5, 1, 8.0), (1.4, 1, 0.0), (9.0, 2, 0.0),
    ):  # fmt: skip
        assert hidden_at(*cover, range_, direction) == hidden
        one = np.array([range_]), np.array([direction])
        assert [bool(cover.clear(*one, amplitude)[0]) for amplitude in (hidden, hidden + 0.1)] == [False, True]


def test_without_mirrors_all_is_seen_directly_and_nothing_hidden(view):
    sight = LinesOfSight.unfolded(view)
    echoes = echoes_at(view, [[0.0, 1.0], [0.0, 2.0]])
    assert_array_equal(sight.seen_through(echoes.range, echoes.direction), ROOT)
    assert sight.clear(echoes).all()
    assert not sight.contradicted(echoes, WALL.reflection).any()  # what is not known contradicts nothing


def test_at_the_edge_of_a_mirror_the_radars_own_view_must_not_contradict(view):
    """Both echoes fold to 0.8 m before the radar; the second is nearer to the edge than its beam is wide."""
    edge = 0.3 * 2.2 / 1.5 - 0.01
    echoes = echoes_at(view, [[0.1, 2.2], [edge, 2.2], [-edge, 2.2]])
    for reach, expected in ((0.7, [False] * 3), (2.0, [False, True, True])):
        sight = sight_of(view, WALL, empty_up_to=np.full(view.u.size, reach))
        assert_array_equal(sight.contradicted(echoes, WALL.reflection), expected)
    # The radar does not look behind itself, nor nearer than its view begins.
    sight = sight_of(view, WALL, empty_up_to=np.full(view.u.size, 2.0))
    assert not sight.contradicted(echoes_at(view, [[edge, 2.2]]), lambda places: places * [1.0, -1.0]).any()
    assert not sight.contradicted(echoes_at(view, [[edge, 2.2]]), lambda places: 0.1 * places).any()


def test_what_the_radar_sees_nothing_in_is_open_up_to_three_cells_before_each_echo(view):
    """A wall straight ahead, an echo aside at 1.3 m, one behind the wall, and a faint one farthest aside."""
    aside, sine = 1.3 * np.array([0.5, np.sqrt(0.75)]), 0.5
    places = [aside, 1.5 * aside, [0.0, 2.0], [0.8, 0.6]]
    echoes = echoes_at(view, places, np.array([1.0, 1.0, 1.0, 0.01]))
    reach = sight_of(view, WALL).open_ranges(echoes)
    assert_array_equal(reach[np.abs(view.u) > sine + 0.01], 0.0)
    assert reach[view.column(-0.4)] == view.range[-1]
    # Before the wall the nearest of its own places, a margin of three cells away, counts; so it is a little less aside.
    margin = OPEN_CELLS * float(view.cell(1.5))
    assert reach[view.column(0.0)] == pytest.approx(1.5 - margin, abs=2e-3)
    margin = OPEN_CELLS * float(view.cell(1.3))
    near = np.abs(view.u - sine) < 0.99 * margin / 1.3
    assert_allclose(reach[near & (view.u <= sine)], 1.3 - margin)
    assert reach[view.column(sine - 1.1 * margin / 1.3)] > 1.5


def test_many_echoes_leave_no_gap_in_what_is_known(view):
    """More than are treated at once: the last ones count as the first do."""
    places = on_line([-0.8, 1.0], [0.8, 1.0], spacing=0.001)
    reach = sight_of(view, WALL).open_ranges(echoes_at(view, places))
    assert (reach[np.abs(view.u) < 0.6] < 1.17).all()
    assert reach[view.column(0.0)] < 1.0


def test_what_folds_to_the_antennas_is_the_radar_itself(view):
    known = replace(view, wavelength=1e-3)
    reach = ITSELF_CELLS * float(known.cell(3.0))
    places = np.array([[0.0, 3.0], [0.0, 3.0 - 0.95 * reach], [0.0, 3.0 - 1.05 * reach], [0.5, 3.0]])
    echoes = replace(echoes_at(known, places), range=np.full(4, 3.0))
    assert_array_equal(images_of_radar(known, echoes, WALL.reflection), [True, True, False, False])
    assert not images_of_radar(view, echoes, WALL.reflection).any()  # of an image of unknown origin
