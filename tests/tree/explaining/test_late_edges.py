"""What the edge of a wall sends on from beyond the ambiguous range is no object nearby, if its series says so."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from synthetic import RANGE_CELL, diffuse, echoes_at, radar_view, together

from mirrorfold.common.geometry import reflect, segment_normal
from mirrorfold.detection import usual_settings
from mirrorfold.detection.image_echoes import find_ridges
from mirrorfold.detection.mirrors.line_mirror import LineMirror
from mirrorfold.folding import FoldSettings
from mirrorfold.tree.explaining.explained_by_tree import without_explained
from mirrorfold.tree.explaining.late_edges import late_edges
from mirrorfold.tree.explaining.misplaced import LATE
from mirrorfold.tree.rounds import find_tree

FAR = np.array([-0.6, 1.32]), np.array([0.3, 1.25])
"""The wall before the radar."""

SIDE = np.array([-0.9, 0.72]), np.array([-0.3, 0.7])
"""A wall that faces it, 2.5 degrees askew, and ends at its `EDGE`; of which a part is told."""

EDGE, TOLD = SIDE[1], np.array([SIDE[0], 0.4 * SIDE[0] + 0.6 * SIDE[1]])

AMBIGUOUS = 1.9

WAYS = {(): (), (0,): (LineMirror(*FAR),), (1,): (LineMirror(*TOLD),)}


def place(visits, further=0.0):
    """Where the image shows the edge after so many visits of the far wall, one ambiguous range nearer if it must.

    The way is a straight line to the image of the edge in one wall after the other.
    """
    image = EDGE
    for visit in range(2 * visits - 1):
        wall = (FAR, SIDE)[visit % 2]
        image = reflect(image, wall[0], segment_normal(*wall))
    range_ = np.linalg.norm(EDGE) + 0.5 * np.linalg.norm(image - EDGE) + further
    return EDGE / np.linalg.norm(EDGE) * (range_ - AMBIGUOUS if range_ > AMBIGUOUS else range_)


LATEST = 3
"""The first visit that is beyond the ambiguous range, and not before the nearest range of the image."""


def view_of(*levels):
    """The view of the walls and of the edge by so many visits, the first first, as strong as that."""
    places = np.reshape([place(visit + 1) for visit in range(len(levels))], (-1, 2))
    parts = diffuse(*FAR, 0), diffuse(*TOLD, 1), (places, np.array(levels, dtype=complex))
    return replace(radar_view(*together(*parts), noise=1e-3, reach=(0.3, AMBIGUOUS)), ambiguous=AMBIGUOUS)


def told(view, where, amplitude, ways=WAYS):
    return late_edges(echoes_at(view, where, amplitude), ways, view).tolist()


def test_it_stands_where_its_series_goes_on():
    """It is as strong as the first, but for what an image amplifies less one ambiguous range nearer."""
    nearby = np.linalg.norm(place(LATEST))
    view, level = view_of(60.0), 60.0 * nearby / (nearby + AMBIGUOUS)
    assert np.linalg.norm(place(2)) < view.range[0] < nearby
    assert told(view, place(LATEST), level) == [True]
    assert told(view, place(LATEST), 1.3 * level) == [True]  # speckle
    assert told(view, place(LATEST), 3.0 * level) == [False]


def test_what_stands_nearer_farther_or_aside_stays():
    view = view_of(60.0)
    for cells in (-2.0, 2.0):
        assert told(view, place(LATEST, cells * RANGE_CELL), 5.0) == [False]
    angle = np.radians(8.0)
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    assert told(view, turn @ place(LATEST), 5.0) == [False]


def test_without_the_earlier_ones_it_stays():
    assert told(view_of(), place(LATEST), 5.0) == [False]


@pytest.mark.parametrize(
    "ways",
    [
        {(): (), (0,): (LineMirror(*FAR),)},
        WAYS | {(1,): (LineMirror(*(TOLD + np.array([0.0, 0.1]))),)},
        WAYS | {(1,): (LineMirror(TOLD[0], TOLD[0] + 0.1 * (TOLD[1] - TOLD[0])),)},
    ],
    ids=["one wall", "elsewhere", "too far from the edge"],
)
def test_without_such_walls_it_stays(ways):
    assert told(view_of(60.0), place(LATEST), 5.0, ways) == [False]


def test_where_ranges_do_not_repeat_it_stays():
    assert told(replace(view_of(60.0), ambiguous=np.inf), place(LATEST), 5.0) == [False]


def test_its_tail_goes_with_it_and_stays_with_what_is_brighter():
    view = view_of(60.0)
    where = np.array([place(LATEST), place(LATEST, 1.5 * RANGE_CELL)])
    assert told(view, where, np.array([5.0, 2.0])) == [True, True]
    assert told(view, where, np.array([2.0, 5.0])) == [False, False]


def test_it_is_left_out_with_a_reason():
    view = view_of(200.0, 0.0, 20.0)
    echoes = find_ridges(view)
    settings = FoldSettings(opaque=False).completed(**usual_settings(view, echoes))
    before = find_tree(view, echoes, settings, known=np.array([FAR, TOLD]))
    after = without_explained(before, view)

    def near(points):
        return bool((np.linalg.norm(points - place(LATEST), axis=1) < RANGE_CELL).any())

    def shown(tree):
        return near(np.concatenate([node.objects.position for node in tree.walk()]))

    assert shown(before.tree)
    assert not shown(after.tree)
    assert near(after.explained.position[after.explanation == LATE])
