"""Mirrors that the order of the others tells: which echoes and mirrors are asked for them."""

from __future__ import annotations

import numpy as np
import pytest
from synthetic import diffuse, radar_view, together

from mirrorfold.detection.image_echoes import find_ridges
from mirrorfold.detection.mirrors.arc_mirror import ArcMirror
from mirrorfold.detection.mirrors.line_mirror import LineMirror
from mirrorfold.folding.settings import FoldSettings
from mirrorfold.tree import completion
from mirrorfold.tree.completion import completed
from mirrorfold.tree.ordering import order_mirrors

LEFT, RIGHT = ((-0.5, 1.4), (-0.1, 1.36)), ((0.1, 1.34), (0.5, 1.3))
"""Two rows of one wall, of which an object hides the part between."""

OBJECT = (-0.1, 0.9), (0.1, 0.9)


@pytest.fixture(scope="module")
def seen():
    view = radar_view(*together(diffuse(*LEFT, 1), diffuse(*RIGHT, 2), diffuse(*OBJECT, 3, strength=3.0)), noise=1e-3)
    return view, find_ridges(view)


def complete(seen, mirrors, shortest):
    view, echoes = seen
    settings = FoldSettings(minimum_length=shortest, wall_margin=0.0)
    order = order_mirrors(mirrors, view, echoes, settings)
    return completed(mirrors, order, view, echoes, settings.minimum_length)


def test_a_mirror_goes_on_behind_an_object(seen):
    (longer,) = complete(seen, [LineMirror(*np.array(LEFT))], 0.45)
    assert longer.length == pytest.approx(1.0, abs=0.05)


def test_two_rows_of_half_the_least_length_are_one_mirror(seen):
    (whole,) = complete(seen, [], 0.7)
    assert whole.length == pytest.approx(1.0, abs=0.05)
    assert np.abs(whole.beside(np.array([*LEFT, *RIGHT]))).max() < 0.01
    # Together they must have the least length, and each half of it.
    assert complete(seen, [], 0.95) == []


def test_arcs_stay_as_they_are(seen):
    """They are no lines: they are neither made longer nor counted among them."""
    arc = ArcMirror(middle=np.array([0.8, 1.4]), radius=0.2, first=np.pi, span=1.0, radar=np.zeros(2))
    (same,) = complete(seen, [arc], 0.95)
    assert same is arc


def test_walls_edge_on_are_looked_for_between_mirrors_in_line_of_sight(monkeypatch, seen):
    """Not between those that another shows, nor between arcs."""
    asked = []
    monkeypatch.setattr(completion, "edge_on", lambda mirrors, *others: asked.append(mirrors) or [])
    near, far = LineMirror(*np.array(OBJECT)), LineMirror(np.array([-0.1, 1.8]), np.array([0.1, 1.8]))
    arc = ArcMirror(middle=np.array([0.8, 1.4]), radius=0.2, first=np.pi, span=1.0, radar=np.zeros(2))
    complete(seen, [near, far, arc], 0.1)
    assert asked == [[near]]


@pytest.mark.parametrize("last", [0.5, -0.045])
def test_rows_by_way_of_a_mirror_are_halves_of_one_wall_where_both_are_seen_by_that_way(last):
    """The same two rows and the object, behind a mirror that shows all of them, or all but the right row."""
    shift = np.array([0.0, 0.8])
    parts = [diffuse(*(np.array(part) + shift), seed) for seed, part in enumerate((LEFT, RIGHT, OBJECT))]
    near = LineMirror(np.array([-0.6, 1.0]), np.array([last, 1.0]))
    view = radar_view(*together(*parts, diffuse(*near.ends, 7)), noise=1e-3)
    same, *whole = complete((view, find_ridges(view)), [near], 0.7)
    assert same is near
    assert [mirror.length for mirror in whole] == pytest.approx([1.0] if last > 0.0 else [], abs=0.05)


@pytest.mark.parametrize("by_way", [False, True])
def test_the_image_of_a_wall_ends_where_the_mirror_does_that_shows_it(by_way):
    """A row beside the mirror, on the same line and beyond the shadow of an object, is of another wall."""
    shift = np.array([0.0, 0.8])
    parts = [diffuse(*(np.array(part) + shift), seed) for seed, part in enumerate((LEFT, RIGHT, OBJECT))]
    near = LineMirror(np.array([-0.6, 1.0]), np.array([-0.045, 1.0]))
    seen = [diffuse(*near.ends, 7)] if by_way else []
    view = radar_view(*together(*parts, *seen), noise=1e-3)
    left = LineMirror(*(np.array(LEFT) + shift))
    found = complete((view, find_ridges(view)), [left, near] if by_way else [left], 0.35)
    assert found[0].length == pytest.approx(left.length if by_way else 1.0, abs=0.05)
