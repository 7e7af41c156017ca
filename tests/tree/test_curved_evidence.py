"""Which arcs are mirrors: what stands behind one that was drawn by hand, and a pillar in an image."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from synthetic import RANGE_CELL, diffuse, echoes_at, empty_view, radar_view, together

from mirrorfold.common.types import ROOT, UNSEEN
from mirrorfold.detection.finding import find_echoes, usual_settings
from mirrorfold.detection.mirrors.arc_mirror import ArcMirror
from mirrorfold.detection.mirrors.curved import dimming, gains, overlap
from mirrorfold.detection.mirrors.line_mirror import LineMirror
from mirrorfold.detection.mirrors.mirror import fold_of
from mirrorfold.detection.views.image_view import OPAQUE_CELLS
from mirrorfold.folding.settings import FoldSettings
from mirrorfold.tree import curved, evidence
from mirrorfold.tree.assignment import Found, assign_echoes
from mirrorfold.tree.curved import FEWEST_CELLS, candidates, find_curved, shows_new
from mirrorfold.tree.evidence import KNOWN_CELLS, Evidence, agreeing, behind, evidence_of, known_places, with_rows
from mirrorfold.tree.ordering import order_mirrors, without_bent
from mirrorfold.tree.rounds import find_tree

SETTINGS = FoldSettings(minimum_length=0.1, wall_margin=0.0, opaque=False)

PILLAR = ArcMirror(middle=np.array([0.0, 1.3]), radius=0.3, first=np.pi, span=np.pi, radar=np.zeros(2))
"""The near half of a pillar straight ahead, that begins at 1 m."""

FLAT = LineMirror(np.array([0.5, 1.0]), np.array([0.8, 0.6]))


@pytest.fixture(scope="module")
def view():
    return empty_view()


def found_with(view, mirrors, places, amplitude=1.0, opened=0.0):
    """What is found of echoes by way of those mirrors, where the radar sees nothing up to a range."""
    echoes = echoes_at(view, places, amplitude)
    order = order_mirrors(mirrors, view, echoes, SETTINGS)
    tree, sight = assign_echoes(order, echoes, opaque=False)
    sight = replace(sight, empty_up_to=np.full(view.u.size, opened) if opened else np.zeros(0))
    return Found(echoes, tree, sight, echoes.take(np.zeros(len(echoes), dtype=bool)), np.empty(0, dtype=str))


@pytest.mark.parametrize(
    ("cells", "new", "empty", "tells", "enough"),
    [
        (3, 3, 0.3, True, True), (8, 2, 0.0, False, False), (3, 3, 0.31, True, False),
        (13, 3, 0.0, True, True), (16, 3, 0.0, False, False), (16, 4, 0.0, True, True),
    ],
)  # fmt: skip
def test_a_mirror_shows_enough_that_is_new_and_little_that_cannot_be(cells, new, empty, tells, enough):
    seen = Evidence(cells, new, empty)
    assert shows_new(seen) == tells
    assert (shows_new(seen) and seen.possible) == enough


def test_behind_an_arc_is_what_is_strong_and_deeper_than_an_object(view):
    depth = OPAQUE_CELLS * RANGE_CELL
    places = [[0.0, 1.0 + 0.99 * depth], [0.0, 1.0 + 1.01 * depth], [0.0, 2.0], [0.6, 2.0], [0.0, 0.7]]
    echoes = echoes_at(view, places, np.array([1.0, 1.0, 0.01, 1.0, 1.0]))
    assert_array_equal(behind(view, echoes, PILLAR), [False, True, False, False, False])
    assert view.filled_cells(echoes.position) == 4
    assert view.filled_cells(np.array([[0.0, 1.5], [0.0, 1.501], [0.0, 1.56]])) == 2
    assert view.filled_cells(np.zeros((0, 2))) == 0


def test_an_arc_dims_what_is_behind_it_and_nothing_else(view):
    wider = replace(PILLAR, middle=np.array([0.1, 1.8]), radius=0.5)
    one, other = gains(view, [PILLAR]), gains(view, [wider])

    def at(x, y):
        return round((np.hypot(x, y) - view.range[0]) / view.dr), int(view.column(x / np.hypot(x, y)))

    # With r1 = s = 1 m and R = 0.3 m: q / (r1 + s) = 1 + 2 / (2 R).
    assert_allclose(one[at(0.0, 2.0)], 1.0 + 1.0 / 0.3, rtol=0.01)
    assert one[at(0.0, 0.98)] == one[at(0.5, 2.0)] == 1.0
    # Of two arcs, whichever is named first, the one that dims more counts.
    for both in ([PILLAR, wider], [wider, PILLAR]):
        assert_array_equal(gains(view, both), np.maximum(one, other))
    assert_array_equal(gains(view, []), 1.0)


SHALLOW = ArcMirror(middle=np.array([0.0, 5.3]), radius=4.0, first=1.5 * np.pi - 0.1, span=0.2, radar=np.zeros(2))
"""A convex wall, 0.8 m long, that bulges by 2 cm."""


@pytest.mark.parametrize(
    ("first", "last", "aside", "piece"),
    [
        (0.0, 0.8, 0.0, True), (0.2, 0.5, 0.0, True), (0.57, 1.17, 0.0, True), (0.62, 1.22, 0.0, False),
        (-0.37, 0.23, 0.0, True), (-0.42, 0.18, 0.0, False), (0.0, 0.8, 0.06, False), (0.0, 0.8, -0.08, False),
    ],
)  # fmt: skip
def test_a_flat_mirror_is_a_piece_of_an_arc_if_two_fifths_of_it_lie_on_it(view, first, last, aside, piece):
    ends = SHALLOW.at(np.array([first, last])) + np.array([0.0, aside])
    assert evidence._along(LineMirror(*ends), SHALLOW, view) == piece
    assert not evidence._along(SHALLOW, SHALLOW, view)


def test_known_is_all_but_what_flat_pieces_of_the_arc_place(view):
    """Objects in line of sight, behind a flat mirror, and behind a chord of the arc; and an echo of either face."""
    chord = LineMirror(*SHALLOW.at(np.array([0.0, 0.8])))
    beyond = FLAT.center * 1.3
    places = np.array([[-0.8, 0.8], beyond, [0.0, 2.0], FLAT.center, chord.center])
    found = found_with(view, [FLAT, chord], places)
    assert [len(node.objects) for node in found.tree.walk()] == [1, 1, 1]
    known = known_places(found, view, [SHALLOW])
    expected = [places[0], FLAT.reflection(beyond), FLAT.center, chord.center]
    assert_allclose(sorted(known.tolist()), sorted(np.array(expected).tolist()), atol=1e-12)
    assert len(known_places(found, view, [])) == 5
    nothing = found_with(view, [], np.empty((0, 2)))
    assert known_places(nothing, view, [SHALLOW]).shape == (0, 2)


SHOWN = np.array([[0.0, 1.5], [0.05, 1.9], [-0.1, 1.9], [0.1, 2.3]])
"""Places behind the pillar, in cells of their own."""


def test_evidence_counts_cells_that_show_what_is_new(view):
    true = fold_of([PILLAR], 2)(SHOWN)
    found = found_with(view, [PILLAR], [*SHOWN, SHOWN[0], [0.7, 0.9], [0.0, 1.02]])
    assert evidence_of(found, view, PILLAR, np.empty((0, 2))) == Evidence(4, 4, 0.0, 0, 4)
    # Known is what is near in cells as wide as the mirror leaves them.
    width = np.abs(PILLAR.spread(SHOWN)[0]) * view.cross_cell(SHOWN)
    reach = KNOWN_CELLS * np.hypot(RANGE_CELL, width)
    for factor, new in ((0.99, 2), (1.01, 4)):
        known = true[:2] + factor * reach[:2, None] * np.array([0.6, -0.8])
        assert evidence_of(found, view, PILLAR, known) == Evidence(4, new, 0.0, 0, 4)
    # Another arc has nothing behind it.
    assert evidence_of(found, view, replace(PILLAR, middle=np.array([0.0, 1.4])), true) == Evidence(0, 0, 0.0)
    hidden = found._replace(echoes=replace(found.echoes, visible=np.zeros(7, dtype=bool)))
    assert evidence_of(hidden, view, PILLAR, true) == Evidence(0, 0, 0.0)


@pytest.mark.parametrize(
    ("along", "across", "confirmed"), [(1.4, 0.0, 3), (-1.4, 0.7, 3), (1.6, 0.0, 0), (0.0, 0.8, 0)]
)
def test_known_places_are_confirmed_at_their_ranges_alone(view, along, across, confirmed):
    """Shifted along and across the ray that arrives there, in range cells and in cells as wide as the pillar's."""
    fold = fold_of([PILLAR], 2)
    true = fold(SHOWN)
    ray = np.array([(fold((1.0 + 1e-6) * place[None])[0] - fold(place[None])[0]) for place in SHOWN])
    ray /= np.linalg.norm(ray, axis=1, keepdims=True)
    width = np.abs(PILLAR.spread(SHOWN)[0]) * view.cross_cell(SHOWN)
    known = true + along * RANGE_CELL * ray + across * width[:, None] * ray[:, ::-1] * [1.0, -1.0]
    seen = evidence_of(found_with(view, [PILLAR], SHOWN), view, PILLAR, known[:3])
    assert (seen.confirmed, seen.unconfirmed) == (confirmed, 4 - confirmed)


@pytest.mark.parametrize(
    ("cells", "confirmed", "unconfirmed", "tells"),
    [(9, 5, 4, True), (9, 2, 7, False), (7, 5, 2, False), (9, 6, 3, False), (20, 12, 8, True), (20, 13, 7, False)],
)
def test_a_small_pillar_is_told_by_what_it_confirms(cells, confirmed, unconfirmed, tells):
    """Its cells are so wide that each holds a known place, so that none is new."""
    assert shows_new(Evidence(cells, 0, 0.0, confirmed, unconfirmed)) == tells


def test_what_folds_to_where_the_radar_sees_nothing_speaks_against_a_mirror(view):
    """The first stands half a metre before the radar, the others where it does not look."""
    assert_allclose(fold_of([PILLAR], 2)(SHOWN[0]), [0.0, 0.5], atol=1e-12)
    for opened, found in ((0.4, Evidence(4, 4, 0.0, 0, 4)), (0.6, Evidence(4, 3, 0.25, 0, 3))):
        tried = found_with(view, [PILLAR], SHOWN, opened=opened)
        assert evidence_of(tried, view, PILLAR, np.empty((0, 2))) == found


def test_what_two_rows_show_at_one_place_speaks_for_both(view):
    """A pillar and a flat mirror show the same two places, the pillar two more: four cells there count for either."""
    true = fold_of([PILLAR], 2)(SHOWN)
    both = true[[0, 2]]
    found = found_with(view, [PILLAR, FLAT], [*SHOWN, *FLAT.reflection(both)])
    alone = [evidence_of(found, view, row, np.empty((0, 2))) for row in (PILLAR, FLAT)]
    assert [what.cells for what in alone] == [4, 2]
    together = agreeing(alone, view)
    assert [(what.cells, what.new, what.empty) for what in together] == [(6, 6, 0.0), (4, 4, 0.0)]
    assert agreeing(alone[:1], view) == alone[:1]
    # What is known already agrees with nothing new, and what stands elsewhere with nothing at all.
    known = [evidence_of(found, view, row, true) for row in (PILLAR, FLAT)]
    assert agreeing(known, view) == known
    apart = found_with(view, [PILLAR, FLAT], [*SHOWN, *FLAT.reflection(both + 0.15)])
    elsewhere = [evidence_of(apart, view, row, np.empty((0, 2))) for row in (PILLAR, FLAT)]
    assert agreeing(elsewhere, view) == elsewhere


def test_an_arc_in_a_flat_mirror_is_followed_by_both(view):
    """The pillar as the flat mirror shows it: the place is that of both reflections, and known there."""
    wall = LineMirror(np.array([-0.4, 0.8]), np.array([0.4, 0.8]))
    true = fold_of([wall, PILLAR], 2)(SHOWN)
    found = found_with(view, [wall, PILLAR], SHOWN)
    assert evidence_of(found, view, PILLAR, true) == Evidence(4, 0, 0.0)


def test_mirrors_seen_by_way_of_a_curved_one_are_left_out(view):
    """A wall behind the pillar is cut in three: its middle piece is seen in the pillar."""
    wall = LineMirror(np.array([-1.0, 2.0]), np.array([1.0, 2.0]))
    echoes = echoes_at(view, SHOWN)
    order = order_mirrors([wall, PILLAR, FLAT], view, echoes, SETTINGS)
    assert_array_equal(order.parent, [ROOT, 3, ROOT, ROOT, ROOT])
    assert without_bent(order, list) == [order.mirrors[index] for index in (0, 2, 3, 4)]
    # A curved mirror seen in a flat one is none of these.
    before = LineMirror(np.array([-0.4, 0.8]), np.array([0.4, 0.8]))
    seen_in_a_flat_one = order_mirrors([before, PILLAR], view, echoes, SETTINGS)
    assert without_bent(seen_in_a_flat_one, list) is seen_in_a_flat_one


def test_what_curved_mirrors_show_is_no_row_of_another(view, monkeypatch):
    """Neither behind the pillar, nor behind or on a wall that it shows; its own face is, and what lies beside it."""
    monkeypatch.setattr(curved, "find_curved_rows", lambda view, echoes, own: own)
    wall = LineMirror(np.array([-1.0, 2.0]), np.array([1.0, 2.0]))
    places = [[0.0, 1.6], [0.0, 2.4], [0.0, 2.0], [0.0, 1.0], [-0.7, 1.0], [0.9, 2.0]]
    own = candidates(found_with(view, [wall, PILLAR], places), view)
    assert own.tolist() == [UNSEEN, UNSEEN, UNSEEN, ROOT, ROOT, ROOT]


class Tried:
    """Steps 2 to 4 of the same echoes, whatever arcs are tried; what was asked."""

    def __init__(self, view, places, monkeypatch):
        self.view, self.places, self.glanced, self.tried, self.through = view, places, [], [], []
        self.earlier = []
        monkeypatch.setattr(evidence, "find_echoes", self.find_echoes)
        monkeypatch.setattr(evidence, "ordered_again", self.ordered_again)

    def find_echoes(self, view, *, threshold_db, through):
        self.through.append(list(through))
        return echoes_at(self.view, self.places)

    def ordered_again(self, view, echoes, mirrors, settings):
        self.glanced.append(list(mirrors))
        return found_with(self.view, list(mirrors), echoes.position)

    def full_pass(self, *, echoes, besides, earlier):
        self.tried.append(list(besides))
        self.earlier.append(earlier)
        return found_with(self.view, list(besides), echoes.position)


@pytest.fixture
def curved_of(view, monkeypatch):
    """What is found where some arcs are proposed in turn; what was found before, and what was tried."""

    def found_of(places, *proposed):
        tried, rounds, first = Tried(view, places, monkeypatch), iter(proposed), found_with(view, [], places)
        enough = {"fewest": FEWEST_CELLS, "is_enough": shows_new, "proposed": lambda found, view: next(rounds)}
        return with_rows(first, view, SETTINGS, tried.full_pass, **enough)[0], first, tried

    return found_of


ASIDE = replace(PILLAR, middle=np.array([0.9, 1.0]), first=np.pi - 0.6)
"""A pillar with nothing behind it."""


def test_nothing_changes_where_no_arc_is_a_mirror(curved_of):
    found, first, steps = curved_of(SHOWN, [])
    assert found is first
    assert not steps.through
    # Too little behind it: steps 2 to 4 are not even tried.
    found, first, steps = curved_of(SHOWN[:2], [PILLAR])
    assert found is first
    assert len(steps.through) == 1
    assert not steps.glanced
    # Enough behind it, but all of that is known: a glance tells.
    known = [*SHOWN, *fold_of([PILLAR], 2)(SHOWN)]
    found, first, steps = curved_of(known, [PILLAR])
    assert found is first
    assert steps.glanced == [[PILLAR]]
    assert not steps.tried


def test_what_is_new_at_a_glance_must_stay_when_copies_and_mixed_paths_are_left_out(view, monkeypatch):
    monkeypatch.setattr(curved, "candidates", lambda found, view: [PILLAR])
    steps, first = Tried(view, SHOWN, monkeypatch), found_with(view, [], SHOWN)

    def again(*, echoes, besides, earlier):
        return found_with(view, list(besides), echoes.position[:2])

    assert find_curved(first, view, SETTINGS, again)[0] is first
    assert steps.glanced == [[PILLAR]]


def test_arcs_without_evidence_are_dropped_and_the_others_tried_again(curved_of):
    found, first, steps = curved_of(SHOWN, [PILLAR, ASIDE], [])
    assert steps.tried == [[PILLAR]]
    assert steps.earlier == [first]
    assert [node.mirror for node in found.tree.walk()] == [None, PILLAR]
    assert steps.through[-1] == [PILLAR]


def test_arcs_that_others_show_are_looked_for_once_more(curved_of):
    """In the second round those of the first are kept, and not proposed twice."""
    right = ArcMirror(middle=np.array([0.9, 1.2]), radius=0.3, first=np.pi - 0.5, span=np.pi, radar=np.zeros(2))
    unit = right.middle / np.linalg.norm(right.middle)
    places = [*SHOWN, *(distance * unit for distance in (1.8, 2.1, 2.4))]
    again = replace(PILLAR, middle=np.array([0.0, 1.31]))
    found, _, steps = curved_of(places, [PILLAR], [again, right])
    assert steps.tried == [[PILLAR], [PILLAR, right]]
    assert {node.mirror for node in found.tree.walk()} == {None, PILLAR, right}


@pytest.mark.slow
def test_a_pillar_in_an_image_is_a_mirror_if_it_shows_what_is_hidden(monkeypatch):
    """A rough pillar, alone and with what it shows of an object that a screen hides."""
    random = np.random.default_rng(4)
    face = PILLAR.at(np.linspace(0.15, 0.85, 300) * PILLAR.length)
    pillar = face, random.standard_normal((300, 2)) @ [1.0, 1.0j]
    places = together(diffuse([-0.02, 1.8], [0.02, 1.95], 1), diffuse([-0.1, 2.0], [-0.06, 2.1], 2))
    seen = places[0], 3.0 * places[1] / dimming([PILLAR], places[0])
    for parts, bent in (([pillar], False), ([pillar, seen], True)):
        view = radar_view(*together(*parts), noise=1e-3)
        echoes = find_echoes(view)
        settings = FoldSettings(curved=True).completed(**usual_settings(view, echoes))
        flat = find_tree(view, echoes, settings)
        (arc,) = candidates(flat, view)
        assert abs(arc.radius - 0.3) < 0.02
        again = partial(find_tree, view, settings=settings)
        found = find_curved(flat, view, settings, again)[0]
        assert [node.mirror.curved for node in found.tree.walk() if node.mirror is not None] == [True] * bent
        # It is proposed once more, and no row of what it shows is.
        assert all(overlap(one, arc) for one in candidates(found, view))


def test_a_bay_that_was_taken_for_flat_mirrors_is_proposed_whole():
    """Echoes on flat mirrors are rows as before, seen as the mirror itself is."""
    bay = ArcMirror(middle=np.array([0.0, 0.2]), radius=1.2, first=0.5 * np.pi - 0.4, span=0.8, radar=np.zeros(2))
    random = np.random.default_rng(2)
    view = radar_view(bay.at(np.linspace(0.0, bay.length, 500)), random.standard_normal((500, 2)) @ [1.0, 1.0j],
                      noise=1e-3)  # fmt: skip
    echoes = find_echoes(view)
    chords = [LineMirror(*bay.at(bay.length * np.array(part))) for part in ((0.0, 0.45), (0.55, 1.0))]
    order = order_mirrors(chords, view, echoes, SETTINGS)
    tree, sight = assign_echoes(order, echoes, opaque=False)
    assert np.isin(order.face, [0, 1]).mean() > 0.5
    (arc,) = candidates(Found(echoes, tree, sight, echoes.take([]), np.empty(0, dtype=str)), view)
    assert abs(arc.length / bay.length - 1.0) < 0.1
    assert not arc.convex
