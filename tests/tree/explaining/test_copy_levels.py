"""How strong copies are, and what they explain, on single samples of a view."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from synthetic import echoes_at, empty_view

from mirrorfold.common.types import ROOT, UNSEEN
from mirrorfold.detection.mirrors.line_mirror import LineMirror
from mirrorfold.detection.views.image_view import SAMPLES_PER_CELL
from mirrorfold.tree.explaining.copies import _quantile, _reflected, copies, copy_level
from mirrorfold.tree.lines_of_sight import Cover
from mirrorfold.tree.ordering import Order

pytestmark = pytest.mark.nojit

DELAY, LEVEL = 20, 0.3
"""In samples of range, and relative to the echo that is copied."""

COLUMNS = np.arange(200, 320, 20)
"""Directions of echoes that do not touch each other."""


def view_of(samples):
    """A view with that amplitude at samples of range and direction, and of nothing else."""
    view = empty_view()
    amplitude = np.zeros((view.range.size, view.u.size))
    for (row, column), value in samples.items():
        amplitude[row, column] = value
    return replace(view, amplitude=amplitude)


def level_of(samples, rows, columns, times=1.0):
    return copy_level(view_of(samples), np.array(rows), np.array(columns), times * np.ones(len(rows)))


def test_a_quarter_of_the_echoes_may_have_weaker_copies():
    """Of four copies 0.1, 0.3, 0.3 and 0.5 times as strong, the first quarter of the way from the weakest on."""
    samples = {(60, c): 2.0 for c in COLUMNS[:4]}
    samples |= {(60 + DELAY, c): 2.0 * part for c, part in zip(COLUMNS, (0.5, 0.3, 0.1, 0.3), strict=False)}
    level = level_of(samples, [60] * 4, COLUMNS[:4])
    assert_allclose(level[DELAY], 0.1 + 0.75 * 0.2)
    assert not np.delete(level, DELAY).any()
    # Sent back twice by what makes the copies, each has two of them.
    assert_allclose(level_of(samples, [60] * 4, COLUMNS[:4], times=2.0)[DELAY], 0.5 * (0.1 + 0.75 * 0.2))


@pytest.mark.parametrize(("apart", "told"), [(6, False), (8, True)])
def test_three_echoes_apart_from_each_other_tell_it(apart, told):
    """Two within two cells of each other, 6 samples, are one."""
    columns = np.array([200, 200 + apart, 300])
    samples = {(row, c): value for c in columns for row, value in ((60, 1.0), (60 + DELAY, LEVEL))}
    assert level_of(samples, [60] * 3, columns)[DELAY] == (LEVEL if told else 0.0)


def test_of_echoes_that_touch_each_other_the_middle_one_counts():
    """Of three groups with copies 0.3, 0.9 and 0.9 times as strong, the weakest quarter of the way is half-way."""
    columns = [200, 201, 202, 240, 280]
    samples = {(60, c): 1.0 for c in columns}
    samples |= {(60 + DELAY, c): part for c, part in zip(columns, (0.1, 0.9, 0.3, 0.9, 0.9), strict=True)}
    assert_allclose(level_of(samples, [60] * 5, columns)[DELAY], 0.6)


def test_nearer_than_a_cell_and_a_half_it_is_the_same_echo():
    near, far = round(1.5 * SAMPLES_PER_CELL) - 1, round(1.5 * SAMPLES_PER_CELL)
    samples = {(60 + delay, c): LEVEL for c in COLUMNS[:3] for delay in (near, far)}
    samples |= {(60, c): 1.0 for c in COLUMNS[:3]}
    level = level_of(samples, [60] * 3, COLUMNS[:3])
    assert_allclose(level[[near, far]], [0.0, LEVEL])


def test_what_follows_a_stronger_echo_itself_is_no_witness():
    """Of four one has no copy: a quarter of the way up. Behind a stronger echo it is not asked."""
    samples = {(60, c): 1.0 for c in COLUMNS[:4]} | {(60 + DELAY, c): LEVEL for c in COLUMNS[:3]}
    rows, columns = [60] * 4, COLUMNS[:4]
    assert_allclose(level_of(samples, rows, columns)[DELAY], 0.75 * LEVEL)
    for before, expected in ((1.0, 0.75 * LEVEL), (1.1, LEVEL)):
        with_one = samples | {(60 - DELAY, columns[3]): before}
        assert_allclose(level_of(with_one, rows, columns)[DELAY], expected)
    # Nor is it where the view ends before a copy could stand there; two witnesses are too few.
    last = empty_view().range.size - 10
    at_the_end = samples | {(last, c): 1.0 for c in columns[2:]}
    assert_allclose(level_of(at_the_end, [60, 60, 60, last], columns)[DELAY], LEVEL)
    assert level_of(at_the_end, [60, 60, last, last], columns)[DELAY] == 0.0


def test_echoes_nearer_than_the_delay_are_witnesses_too():
    """Before them is nothing, and not the far end of the view."""
    samples = {(10, c): 1.0 for c in COLUMNS[:3]} | {(10 + DELAY, c): LEVEL for c in COLUMNS[:3]}
    samples |= {(empty_view().range.size + 10 - DELAY, c): 9.0 for c in COLUMNS[:3]}
    assert_allclose(level_of(samples, [10] * 3, COLUMNS[:3])[DELAY], LEVEL)
    # What follows a stronger one in the very first sample is no witness, as anywhere.
    samples |= {(0, COLUMNS[3]): 1.1, (DELAY, COLUMNS[3]): 1.0}
    assert_allclose(level_of(samples, [10, 10, 10, DELAY], COLUMNS[:4])[DELAY], LEVEL)


def test_quantiles_leave_out_what_is_not_known():
    values = np.array([[np.nan, 3.0, 1.0, 2.0], [np.nan, np.nan, 7.0, np.nan], [np.nan] * 4])
    assert_array_equal(_quantile(values, 0.5), [2.0, 7.0, np.nan])
    assert_array_equal(_quantile(values, 0.25), [1.5, 7.0, np.nan])
    assert_array_equal(_quantile(np.array([[5.0, 4.0, 3.0, 2.0, 1.0, 0.0]]), 0.25), [1.25])


MIRROR = LineMirror(np.array([-2.0, 1.3]), np.array([2.0, 1.3]))


def found_in(samples, mirror=None, on_mirror=(), faint=(), unheard=()):
    """Which echoes, one at each of the samples but those that are `unheard`, are copies."""
    view = view_of(samples)
    samples = {one: value for one, value in samples.items() if one not in unheard}
    rows, columns = np.array(list(samples)).T
    echoes = echoes_at(view, view.to_points(view.range[rows], view.u[columns]), np.array(list(samples.values())))
    echoes = replace(echoes, strong=np.array([one not in faint for one in samples]))
    mirrors = [] if mirror is None else [mirror]
    crossing = np.array([one.crossing(view) for one in mirrors]).reshape(len(mirrors), view.u.size)
    face = np.array([0 if one in on_mirror else ROOT for one in samples])
    order = Order(view, mirrors, crossing, np.full(len(mirrors), ROOT), Cover.nothing(view.u.size), face=face)
    found = copies(order, echoes)
    return {one for one, is_copy in zip(samples, found, strict=True) if is_copy}


def test_what_exceeds_a_copy_by_six_decibels_is_none():
    samples = {(60, c): 1.0 for c in COLUMNS} | {(60 + DELAY, c): LEVEL for c in COLUMNS}
    samples[60 + DELAY, COLUMNS[0]] = 1.98 * LEVEL
    samples[60 + DELAY, COLUMNS[1]] = 2.02 * LEVEL
    expected = {(60 + DELAY, c) for c in COLUMNS if c != COLUMNS[1]}
    assert found_in(samples) == expected
    # A cell beside the line of sight of what is copied it still is one, farther aside not.
    beside = {(60 + DELAY, COLUMNS[2] + SAMPLES_PER_CELL): LEVEL, (60 + DELAY, COLUMNS[3] + 6): LEVEL}
    found = found_in(samples | beside, faint=beside)
    assert found == expected | {(60 + DELAY, COLUMNS[2] + SAMPLES_PER_CELL)}


def test_the_edges_of_a_view_are_no_exception():
    """Copies in the first and the last direction, and of what stands in the first sample of range."""
    columns = [0, *COLUMNS, empty_view().u.size - 1]
    samples = {(60, c): 1.0 for c in columns} | {(60 + DELAY, c): LEVEL for c in columns}
    samples |= {(0, 100): 1.0, (DELAY, 100): LEVEL}
    assert found_in(samples) == {(60 + DELAY, c) for c in columns} | {(DELAY, 100)}


def test_what_stands_nearer_than_the_delay_is_no_copy_of_the_far_end():
    samples = {(60, c): 1.0 for c in COLUMNS} | {(60 + DELAY, c): LEVEL for c in COLUMNS}
    end = empty_view().range.size
    samples |= {(5, COLUMNS[0]): 0.1, (end - (DELAY - 5), COLUMNS[0]): 1.0}
    assert (5, COLUMNS[0]) not in found_in(samples, faint={(5, COLUMNS[0])})


@pytest.fixture(scope="module")
def layered():
    """A mirror with a layer in its wall: copies of its face, twice as strong ones of what it shows; none of the rest.

    The samples, those of its face, and those of the copies.
    """
    view = empty_view()
    row = np.rint((view.meets(MIRROR.normal, MIRROR.center) - view.range[0]) / view.dr).astype(int)
    face = [(int(row[c]), int(c)) for c in COLUMNS]
    shown = [(int(row[c]) + 40, int(c)) for c in range(205, 325, 10)]
    copied = {(r + DELAY, c): times * LEVEL for times, some in ((1.0, face), (2.0, shown)) for r, c in some}
    direct = {(10, c): 1.0 for c in range(100, 400, 100)}
    return dict.fromkeys([*face, *shown], 1.0) | copied | direct, set(face), set(copied)


def test_copies_of_what_a_mirror_shows_are_twice_as_strong_as_those_of_its_face(layered):
    samples, face, copied = layered
    assert found_in(samples, MIRROR, face) == copied
    # More than twice as strong as the copies of the other places of its face, it is an object.
    (r, c) = sorted(face)[0]
    for times, expected in ((1.9, copied), (2.1, copied - {(r + DELAY, c)})):
        assert found_in(samples | {(r + DELAY, c): times * LEVEL}, MIRROR, face) == expected
    # The same for what it shows. How weak the weakest echo is does not matter.
    (r, c) = sorted(copied - {(r + DELAY, c) for r, c in face})[0]
    for times, expected in ((3.8, {(r, c)}), (4.2, set())):
        louder = samples | {(r, c): times * LEVEL}
        assert found_in(louder, MIRROR, face, unheard=copied - {(r, c)}) == expected


def test_what_stands_before_a_mirror_is_not_copied_in_its_wall(layered):
    """Of two objects in line of sight, one behind the other at the very delay of the layer, both are objects."""
    samples, face, copied = layered
    pair = {(10, 250): 1.0, (10 + DELAY, 250): LEVEL}
    assert found_in(samples | pair, MIRROR, face) == copied


def test_the_tail_of_the_pulse_follows_faces_in_line_of_sight_too(layered):
    """Of one object in line of sight alone it could not be told."""
    _, face, _ = layered
    samples = dict.fromkeys(face, 1.0) | {(r + DELAY, c): LEVEL for r, c in face}
    samples |= {(10, 250): 1.0, (10 + DELAY, 250): LEVEL}
    assert (10 + DELAY, 250) in found_in(samples, MIRROR, face)


def test_the_face_of_a_mirror_begins_a_cell_and_a_half_before_its_line(layered):
    """Its echoes stand about the line."""
    samples, face, copied = layered
    view = empty_view()
    exact = (view.meets(MIRROR.normal, MIRROR.center) - view.range[0]) / view.dr
    r, c = min(face, key=lambda one: abs(exact[one[1]] - one[0]))
    assert abs(exact[c] - r) < 0.3
    for before, is_copy in ((4, True), (5, False)):
        moved = {one: value for one, value in samples.items() if one not in ((r, c), (r + DELAY, c))}
        moved |= {(r - before, c): 1.0, (r - before + DELAY, c): LEVEL}
        found = found_in(moved, MIRROR, (face - {(r, c)}) | {(r - before, c)})
        assert found == copied - {(r + DELAY, c)} | ({(r - before + DELAY, c)} if is_copy else set())


def test_what_two_mirrors_show_is_copied_in_the_wall_of_the_first():
    """A chain of parents is followed to its end."""
    parent = np.array([1, 2, ROOT, ROOT, UNSEEN, ROOT])
    own = np.array([0, 1, 2, 3, ROOT, UNSEEN])
    assert_array_equal(_reflected(own, parent, 2), [True, True, True, False, False, False])
    assert_array_equal(_reflected(own, parent, 1), [True, True, False, False, False, False])
    assert_array_equal(_reflected(own, np.array([ROOT, 0, 1, 2, UNSEEN, ROOT]), 0), [True] * 4 + [False] * 2)
