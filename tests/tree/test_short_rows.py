"""Which short rows are mirrors: a piece of a wall, with objects of several strengths behind it."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
from numpy.testing import assert_allclose
from synthetic import diffuse, radar_view, together

import mirrorfold as mf
from mirrorfold.detection.finding import find_echoes, usual_settings
from mirrorfold.detection.mirrors.arc_mirror import ArcMirror
from mirrorfold.detection.search.lines import MINIMUM_CELLS, SHORT_CELLS
from mirrorfold.folding.settings import FoldSettings
from mirrorfold.tree import kinds
from mirrorfold.tree.rounds import find_tree
from mirrorfold.tree.short_rows import find_short, short_rows

CELL = 0.0318
"""Diagonal of the resolution cell at the wall, a metre away [m]."""

MIDDLE, ALONG = np.array([0.15, 1.0]), np.array([0.94, 0.34])


def wall(cells, seed=1):
    """A rough wall of so many resolution cells."""
    return diffuse(MIDDLE - 0.5 * cells * CELL * ALONG, MIDDLE + 0.5 * cells * CELL * ALONG, seed)


def objects(level, count=4, half=0.03):
    """Diffuse rows behind the wall, in a line of sight through its middle, so much [dB] above it; half their width."""
    sight = MIDDLE / np.linalg.norm(MIDDLE)
    places = [sight * distance for distance in np.linspace(1.4, 2.3, count)]
    strength = 10.0 ** (level / 20.0)
    aside = np.array([half, 0.01])
    return [diffuse(at - aside, at + aside, 10 + i, strength) for i, at in enumerate(places)]


def steps_2_to_4(*parts, corners=None):
    """What is found at first, and with short rows, where `corners` tells which places are vertices."""
    view = radar_view(*together(*parts), noise=1e-3)
    echoes = find_echoes(view)
    settings = FoldSettings().completed(**usual_settings(view, echoes))
    first = find_tree(view, echoes, settings)
    found, *_ = find_short(first, view, settings, partial(find_tree, view, settings=settings), corners=corners)
    return first, found, view, settings


def mirrors_of(found):
    return [node.mirror for node in found.tree.walk() if node.mirror is not None]


@pytest.mark.slow
def test_a_short_row_is_a_mirror_if_what_it_shows_outshines_it():
    """Six cells of wall: too short by itself; an object if what stands behind it is weaker, or one point."""
    for level, count, half, is_mirror in ((12.0, 4, 0.03, True), (-12.0, 4, 0.03, False), (9.0, 1, 0.001, False)):
        first, found, *_ = steps_2_to_4(wall(6.0), *objects(level, count, half))
        assert not mirrors_of(first)
        assert len(mirrors_of(found)) == is_mirror
        assert (found is first) == (not is_mirror)
        if is_mirror:
            (mirror,) = mirrors_of(found)
            assert abs(float(mirror.beside(MIDDLE))) < 0.003
            assert np.degrees(np.arccos(abs(mirror.direction @ ALONG) / np.linalg.norm(ALONG))) < 3.0
            assert len(found.tree.mirrors[0].objects) > 0


@pytest.mark.slow
@pytest.mark.parametrize(("level", "is_mirror"), [(12.0, True), (-6.0, False)])
def test_a_long_faint_row_is_a_mirror_if_what_it_shows_outshines_it(level, is_mirror):
    """A smooth wall at a slant, 20 dB below a rough one beside it that faces the radar."""
    places, amplitudes = wall(14.0)
    shown = [(at, 0.1 * amplitude) for at, amplitude in objects(level)]
    beside = diffuse((-0.3, 0.8), (0.0, 0.72), 3, 2.0)
    first, found, *_ = steps_2_to_4((places, 0.1 * amplitudes), *shown, beside)
    assert not any(abs(float(mirror.beside(MIDDLE))) < 0.01 for mirror in mirrors_of(first))
    assert any(abs(float(mirror.beside(MIDDLE))) < 0.01 for mirror in mirrors_of(found)) == is_mirror


@pytest.mark.slow
@pytest.mark.parametrize("is_corner", [False, True, None])
def test_a_row_that_ends_at_the_vertex_of_a_corner_is_no_mirror(is_corner):
    """Behind the vertex, what goes to and fro outshines the row as objects do that a mirror shows.

    Where no sweep tells what the bright place is, it counts as a vertex.
    """
    vertex = MIDDLE - 3.0 * CELL * ALONG
    asked = []

    def corners(places):
        asked.extend(places)
        return np.full(len(places), is_corner)

    bright = np.array([vertex]), np.array([50.0])
    told = None if is_corner is None else corners
    _, found, *_ = steps_2_to_4(wall(6.0), bright, *objects(12.0), corners=told)
    assert len(mirrors_of(found)) == (1 if is_corner is False else 0)
    if told is not None:
        assert np.linalg.norm(np.array(asked) - vertex, axis=1).max() < CELL


@pytest.mark.slow
def test_a_row_that_is_shorter_still_is_none():
    _, found, view, settings = steps_2_to_4(wall(3.5), *objects(12.0))
    assert not mirrors_of(found)
    assert_allclose(settings.minimum_length, MINIMUM_CELLS * CELL, rtol=0.02)
    assert not short_rows(found, view, SHORT_CELLS * CELL)


@pytest.mark.slow
def test_a_long_wall_is_no_short_row_and_what_curved_mirrors_show_neither():
    first, found, view, *_ = steps_2_to_4(wall(14.0), *objects(12.0))
    assert found is first
    assert not short_rows(found, view, SHORT_CELLS * CELL)
    pillar = ArcMirror(middle=np.array([0.0, 0.8]), radius=0.2, first=np.pi, span=np.pi, radar=np.zeros(2))
    view = radar_view(*wall(7.0), noise=1e-3)
    echoes = find_echoes(view)
    settings = FoldSettings().completed(**usual_settings(view, echoes))
    assert len(short_rows(find_tree(view, echoes, settings), view, SHORT_CELLS * CELL)) == 1
    bent = find_tree(view, echoes, settings, besides=[pillar])
    assert [line.curved for line in mirrors_of(bent)] == [True]
    assert not short_rows(bent, view, SHORT_CELLS * CELL)


@pytest.mark.slow
def test_what_would_fold_to_where_the_radar_sees_nothing_is_no_evidence():
    """A wall farther away, in line of sight beside the short row: all between the radar and it is empty."""
    facing = diffuse([0.15 - 3.0 * CELL, 1.0], [0.15 + 3.0 * CELL, 1.0], 1)
    behind = [diffuse([0.2 + at, 1.5 + 2.0 * at], [0.25 + at, 1.5 + 2.0 * at], 20 + i, 10.0)
              for i, at in enumerate((0.0, 0.1, 0.2))]  # fmt: skip
    around = diffuse([-0.9, 1.6], [-0.2, 1.6], 3), diffuse([0.5, 1.3], [0.9, 1.1], 4)
    _, found, *_ = steps_2_to_4(facing, *behind, *around)
    assert not [mirror for mirror in mirrors_of(found) if abs(float(mirror.beside(MIDDLE))) < 0.02]


@pytest.mark.slow
def test_a_shortest_mirror_that_is_given_holds(hidden_behind_short_wall):
    """`minimum_length` switches short rows off; without it the same image has the mirror."""
    image = hidden_behind_short_wall
    found = mf.fold(image)
    assert found["mirrors"].sizes["mirror"] == 1
    again = mf.fold(image, minimum_length=float(found.attrs["fold_minimum_length"]))
    assert again["mirrors"].sizes["mirror"] == 0
    assert mf.fold(image, preset="published", minimum_length=1.0)["mirrors"].sizes["mirror"] == 0


@pytest.mark.slow
def test_short_mirrors_stay_when_steps_2_to_4_are_done_again(hidden_behind_short_wall, monkeypatch):
    """As they are without what passed through walls."""
    monkeypatch.setattr(kinds, "guess_transparent", lambda found, view, every, full_pass: full_pass(echoes=every))
    assert mf.fold(hidden_behind_short_wall)["mirrors"].sizes["mirror"] == 1


@pytest.fixture(scope="module")
def hidden_behind_short_wall():
    from synthetic import radar_image

    places, amplitude = together(wall(6.0), *objects(12.0))
    return radar_image(places, amplitude, np.arange(-1.2, 1.2, 0.01), np.arange(0.5, 2.8, 0.01))
