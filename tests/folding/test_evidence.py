"""What speaks for and against points, on a few of them; and what is said of echoes that come from elsewhere."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.special import expit
from synthetic import RANGE_CELL, U_CELL, WAVELENGTH, echoes_at, empty_view

from mirrorfold.detection.mirrors.arc_mirror import ArcMirror
from mirrorfold.detection.mirrors.curved import dimming
from mirrorfold.detection.mirrors.line_mirror import LineMirror
from mirrorfold.detection.mirrors.mirror import fold_of
from mirrorfold.folding.confidence import (
    EXPLAINED,
    LARGEST_MIRROR_ERROR,
    LEAST_OVER_FACE_DB,
    LEAST_SHARE,
    MOST_EXCESS_DB,
    NEIGHBOUR_CELLS,
    OWN_ERROR,
    TABLES,
    WEIGHTS,
    WEIGHTS_MEASURED,
    WEIGHTS_ONE_WAY,
    errors,
    features,
    mirror_confidence,
    over_faces,
    with_confidence,
    with_confocal_shares,
)
from mirrorfold.folding.points import fold_back
from mirrorfold.tree.assignment import Found
from mirrorfold.tree.lines_of_sight import LinesOfSight
from mirrorfold.tree.mirror_tree import MirrorTree
from mirrorfold.tree.rounds import OWN_SHARE

WALL = LineMirror(np.array([-0.3, 1.0]), np.array([0.3, 1.0]), angle_error=0.5, offset_error=2e-3)

LONE = 10.0
"""So many cells from each other, echoes are no neighbours."""


@pytest.fixture(scope="module")
def view():
    return empty_view()


def cells(view, *places):
    """Places by range and u in resolution cells."""
    range_, u = np.reshape(places, (-1, 2)).T
    return view.to_points(RANGE_CELL * range_, U_CELL * u)


def found_of(view, direct, behind=(), face=(), explained=(), amplitude=1.0, mirror=WALL):
    parts = [echoes_at(view, np.reshape(part, (-1, 2)), amplitude) for part in (direct, behind, face, explained)]
    node = MirrorTree((mirror,), parts[2], parts[1], (), (0,))
    tree = MirrorTree((), parts[0].take([]), parts[0], (node,) if mirror is not None else (), ())
    return Found(parts[0], tree, LinesOfSight.unfolded(view), parts[3], np.full(len(parts[3]), "comes from afar"))


def test_evidence_counts_level_and_filled_cells_of_the_same_kind_nearby(view):
    """Three cells in a row, one of them twice; a lone one; and one of another kind in their midst."""
    row = cells(view, (40, 0), (42, 0), (44, 0), (44.1, 0))
    points = fold_back(found_of(view, [*row, *cells(view, (60, LONE))], cells(view, (42, 1))).tree)
    points = replace(points, amplitude=np.array([1.0, 10.0, 0.05, 1.0, 100.0, 1.0]))
    given = features(points, view, np.array([0.0, 1.0, 2.0, 3.0, 4.0, 9.0]), np.linspace(-30.0, 20.0, 6))
    assert_array_equal(given[:, 0], 1.0)
    assert_allclose(given[:, 1], [20.0, MOST_EXCESS_DB, 0.0, 20.0, MOST_EXCESS_DB, 20.0])
    # From end to end are four cells: those see two, the middle one all three.
    assert NEIGHBOUR_CELLS == 2.5
    assert_allclose(2.0 ** given[:, 2], [2, 3, 2, 2, 1, 1])
    assert_allclose(given[:, 3], [0.0, 1.0, 2.0, 3.0, LARGEST_MIRROR_ERROR, LARGEST_MIRROR_ERROR])
    assert np.isnan(given[:, 4]).all()
    assert_allclose(given[:, 5], [-20.0, -20.0, -10.0, 0.0, 10.0, 10.0])
    assert_array_equal(given[:, 6], 0.0)
    deeper = features(replace(points, bounces=np.arange(6, dtype=np.int32)), view, np.zeros(6), np.zeros(6))[:, 6]
    assert_array_equal(deeper, [0.0, 0.0, 1.0, 2.0, 3.0, 4.0])


def test_shares_are_averaged_over_cells_in_which_they_are_known(view):
    """The mean of each cell first, so that a cell with many echoes counts no more than others."""
    points = fold_back(found_of(view, cells(view, (40, 0), (40.1, 0), (42, 0), (44, 0), (70, 0)), mirror=None).tree)
    points = replace(points, confocal=np.array([0.9, 0.7, 1.0, np.nan, 0.1]))
    given = features(points, view, np.zeros(5), np.zeros(5))
    assert_allclose(given[:, 4], [0.9, 0.9, 0.9, 1.0, 0.1])
    partly = replace(points, confocal=np.array([0.6, 0.6, 0.6, np.nan, 0.6]))
    assert_allclose(features(partly, view, np.zeros(5), np.zeros(5))[:, 4], LEAST_SHARE)
    alone = replace(points, confocal=np.array([np.nan, np.nan, np.nan, np.nan, 0.8]))
    assert_array_equal(np.isnan(features(alone, view, np.zeros(5), np.zeros(5))[:, 4]), [True] * 4 + [False])


def test_shares_are_measured_of_objects_alone(view):
    points = fold_back(found_of(view, cells(view, (40, 0)), cells(view, (50, 0)), cells(view, (33, 0))).tree)
    asked = []
    shares = lambda place, amplitude: asked.append((place, amplitude)) or np.array([0.5, 0.6])  # noqa: E731
    assert_array_equal(with_confocal_shares(points, shares).confocal, [0.5, 0.6, np.nan])
    assert_array_equal(asked[0][0], points.initial[:2])
    assert asked[0][1].shape == (2,)


def test_what_a_mirror_shows_is_compared_with_its_face(view):
    """Of a mirror of which no face is seen, and of what no mirror shows, nothing can be said."""
    points = fold_back(found_of(view, cells(view, (40, 0)), cells(view, (50, 0), (55, 0)), cells(view, (33, 0))).tree)
    points = replace(points, amplitude=np.array([9.0, 0.2, 20.0, 2.0]))
    tree = found_of(view, [], cells(view, (50, 0))).tree
    assert_allclose(over_faces(points, tree), [0.0, -20.0, 20.0, 0.0], atol=1e-9)
    faceless = points.take(np.array([0, 1, 2]))
    assert_array_equal(over_faces(faceless, tree), 0.0)


def test_what_a_pillar_spreads_is_no_loss(view):
    pillar = ArcMirror(middle=np.array([0.0, 1.3]), radius=0.3, first=np.pi, span=np.pi, radar=np.zeros(2))
    found = found_of(view, [], cells(view, (50, 0)), cells(view, (30, 0)), mirror=pillar)
    points = fold_back(found.tree)
    expected = 20.0 * np.log10(dimming((pillar,), points.initial[points.mirror == ""]))
    assert expected > 3.0
    assert_allclose(over_faces(points, found.tree)[points.mirror == ""], expected)


def test_odds_are_weighed_by_kind_and_by_what_was_measured(view):
    """Lone points 20 dB over their threshold, of a mirror without errors: in line of sight, behind it, and on it."""
    exact = replace(WALL, angle_error=0.0, offset_error=0.0)
    places = cells(view, (40, 2 * LONE)), cells(view, (50, 0)), cells(view, (33, 0))
    found = found_of(view, *places, mirror=exact)
    points = with_confidence(fold_back(found.tree), found)
    direct, behind, on_it = (expit(weight[0] + 20.0 * weight[1]) for weight in WEIGHTS.values())
    # What is seen in a mirror is no likelier than the mirror.
    assert_allclose(points.confidence, [direct, behind * on_it, on_it])
    points = with_confidence(fold_back(found.tree), found, lambda place, amplitude: np.array([1.0, OWN_SHARE]))
    seen, hidden, face = WEIGHTS_MEASURED.values()
    on_it = expit(face[0])
    direct = expit(seen[0] + 20.0 * seen[1] + seen[4])
    behind = expit(hidden[0] + 20.0 * hidden[1] + LEAST_SHARE * hidden[4])
    assert_allclose(points.confidence, [direct, behind * on_it, on_it])
    assert mirror_confidence(points, "0") == pytest.approx(on_it)
    assert mirror_confidence(points, "7") == 1.0
    # If most of the energy came back another way, strong echoes in line of sight are doubted; behind mirrors, such
    # echoes were tested before.
    for share in (0.0, OWN_SHARE - 0.01):
        doubted = with_confidence(fold_back(found.tree), found, lambda place, amplitude, s=share: np.array([s, s]))
        assert doubted.confidence[0] < 0.1 * direct
        assert doubted.confidence[1] == points.confidence[1]


def test_a_corner_in_line_of_sight_is_believed_although_its_wave_came_back_another_way(view):
    """The corners that are asked about are those in line of sight of which little came back the way it went."""
    exact = replace(WALL, angle_error=0.0, offset_error=0.0)
    places = cells(view, (40, 2 * LONE), (44, 6 * LONE)), cells(view, (50, 0)), cells(view, (33, 0))
    found, asked = found_of(view, *places, mirror=exact), []

    def few(place, amplitude):
        return np.array([0.2, 0.8, 0.2])

    def corners(place):
        asked.extend(place)
        return np.ones(len(place), dtype=bool)

    points = with_confidence(fold_back(found.tree), found, few, corners)
    doubted = with_confidence(fold_back(found.tree), found, few)
    assert_array_equal(asked, points.initial[:1])
    assert_allclose(points.confocal, [1.0, 0.8, 0.2, np.nan])
    assert points.confidence[0] > 50.0 * doubted.confidence[0]
    assert_array_equal(points.confidence[1:], doubted.confidence[1:])


@pytest.mark.parametrize("weights", TABLES, ids=["both arrays", "one array", "measured"])
def test_what_speaks_for_a_point_makes_it_likelier(weights):
    """A lone echo at the threshold is doubted, eight cells in a row at 20 dB are believed, whatever was measured."""
    for name, (base, *slopes) in weights.items():
        face, measured = name == "on mirrors", weights is WEIGHTS_MEASURED
        assert (np.array(slopes) * [1, 1, -1, 1, 1, -1] >= 0).all()
        weak = base + np.dot(slopes, [0.0, 0.0, 0.0, LEAST_SHARE, LEAST_OVER_FACE_DB, 0.0])
        strong = base + np.dot(slopes, [20.0, 3.0, 0.0, 1.0, 0.0, 0.0])
        assert expit(strong) > (0.85 if weights is WEIGHTS_ONE_WAY else 0.95)
        assert expit(weak) < 0.15 or (face and weights is not WEIGHTS_ONE_WAY)
        assert (slopes[3] > 0.0) == (measured and not face)
        # Behind a mirror that is hardly known even the best echo proves little.
        assert name == "in line of sight" or expit(strong + LARGEST_MIRROR_ERROR * slopes[2]) < 0.5 * expit(strong)


def test_faces_behind_two_mirrors_are_doubted_without_the_sweep(view):
    """Mixed paths pass for the second mirror without the sweep. What such a wall shows is doubted, too."""
    exact = replace(WALL, angle_error=0.0, offset_error=0.0)
    some = [echoes_at(view, cells(view, (at, 0))) for at in (40, 50, 33, 60, 45, 70, 55)]
    third = MirrorTree((exact,) * 3, some[6], some[5], (), (0, 0, 0))
    second = MirrorTree((exact,) * 2, some[4], some[3], (third,), (0, 0))
    first = MirrorTree((exact,), some[2], some[1], (second,), (0,))
    tree = MirrorTree((), some[0].take([]), some[0], (first,), ())
    found = found_of(view, np.empty((0, 2)))._replace(tree=tree)
    alone, by_sweep = (
        with_confidence(fold_back(tree), found, shares) for shares in (None, lambda p, a: np.ones(len(p)))
    )
    sure = dict(zip(alone.mirror, alone.confidence, strict=True))
    assert sure["0"] > 0.95
    assert sure["0/0"] > 0.95
    assert sure["0/0/0"] < 0.65
    assert (alone.confidence[alone.chain == "0/0/0"] < 0.65).all()
    assert (by_sweep.confidence[by_sweep.mirror == "0/0/0"] > 0.9).all()


@pytest.mark.parametrize("shares", [None, lambda place, amplitude: np.full(len(place), np.nan)], ids=["image", "sweep"])
def test_where_one_array_resolves_directions_less_is_believed(view, shares):
    """Mixed paths are as sharp as true echoes there. The sweep tells no shares then, but helped to find the mirrors."""
    row = cells(view, (40, 0), (42, 0), (44, 0))
    moving = replace(view, aperture_rx=0.0, wavelength=WAVELENGTH)
    assert moving.one_way
    sure, unsure = (
        with_confidence(replace(fold_back(found.tree), amplitude=np.full(5, 0.15)), found, shares).confidence
        for found in (found_of(each, row, cells(view, (50, 0)), cells(view, (33, 0))) for each in (view, moving))
    )
    assert (unsure[:3] < 0.8 * sure[:3]).all()
    assert unsure[4] == sure[4] if shares else unsure[4] < 0.6 * sure[4]


def test_what_two_mirrors_show_is_no_likelier_than_either(view):
    """Of the chains that begin with 1 only those by way of it: 10 is another mirror."""
    exact = replace(WALL, angle_error=0.0, offset_error=0.0)
    none, one = echoes_at(view, np.empty((0, 2))), echoes_at(view, cells(view, (50, 0)))
    face = echoes_at(view, cells(view, (33, 0)))
    deeper = MirrorTree((exact, exact), none, one, (), (1, 0))
    nodes = [MirrorTree((exact,), face if index == 1 else none, one, (deeper,) if index == 1 else (), (index,))
             for index in range(11)]  # fmt: skip
    found = found_of(view, np.empty((0, 2)))._replace(tree=MirrorTree((), none, none, tuple(nodes), ()))
    points = with_confidence(fold_back(found.tree), found)
    sure = dict(zip(zip(points.chain, points.mirror, strict=True), points.confidence, strict=True))
    _, behind, on_it = (expit(weight[0] + 20.0 * weight[1]) for weight in WEIGHTS.values())
    assert sure["", "1"] == pytest.approx(on_it)
    assert sure["1", ""] == sure["1/0", ""] == pytest.approx(behind * on_it)
    assert sure["10", ""] == sure["0", ""] == pytest.approx(behind)


def test_an_echo_is_known_to_a_part_of_its_cell_and_turned_as_it_is_folded(view):
    """Along the line of sight and across it; what lies on a mirror, across that as well as the mirror."""
    slanted = LineMirror(np.array([-0.5, 0.7]), np.array([0.3, 1.5]), angle_error=0.0, offset_error=0.0)
    ahead, mirrored, on_it = [0.0, 1.5], [0.0, 2.0], [-0.2, 1.0]
    found = found_of(view, [ahead, [1.2, 0.0]], [mirrored], [on_it], mirror=slanted)
    points = fold_back(found.tree)
    error, mirror_error = errors(points, found.tree, view)
    own = OWN_ERROR * np.array([U_CELL * 1.5, RANGE_CELL])
    assert_allclose(error[0], own)
    assert error[1, 0] == pytest.approx(OWN_ERROR * RANGE_CELL)
    # A mirror at 45 degrees swaps the two axes.
    assert_allclose(error[2], OWN_ERROR * np.array([RANGE_CELL, U_CELL * 2.0]))
    # On the mirror what is left of both lies along it: the same in x and y.
    sight = np.array(on_it) / np.linalg.norm(on_it)
    along = np.array([1.0, 1.0]) / np.sqrt(2.0)
    part = np.hypot(RANGE_CELL * (sight @ along),
                    float(view.cross_cell(np.array([on_it]))[0]) * (sight @ [along[1], -along[0]]))  # fmt: skip
    assert_allclose(error[3], OWN_ERROR * part / np.sqrt(2.0))
    assert_allclose(mirror_error, 0.0, atol=1e-12)


def test_the_cell_of_an_echo_is_mapped_as_its_surroundings_are(view):
    """By way of a pillar it is turned and stretched: against random places in the cell, each folded by itself."""
    pillar = ArcMirror(middle=np.array([0.0, 1.3]), radius=0.3, first=np.pi, span=np.pi, radar=np.zeros(2))
    place = np.array([0.15, 1.8])
    found = found_of(view, np.empty((0, 2)), [place], mirror=pillar)
    error, _ = errors(fold_back(found.tree), found.tree, view)
    sight = place / np.linalg.norm(place)
    random = 0.01 * np.random.default_rng(0).standard_normal((2, 20000))  # of a cell: small, so that the map is linear
    own = RANGE_CELL * random[0], float(view.cross_cell(place[None])[0]) * random[1]
    places = place + own[0][:, None] * sight + own[1][:, None] * [sight[1], -sight[0]]
    assert_allclose(error[0], OWN_ERROR * np.std(fold_of([pillar], 2)(places), axis=0) / 0.01, rtol=0.02)


def test_errors_are_the_same_wherever_the_radar_stands(view):
    shift = np.array([0.3, -0.4])
    places = np.array([[-0.5, 0.8]]), np.array([[0.1, 1.6]]), np.array([[0.0, 1.0]])
    there = replace(WALL, start=WALL.start + shift, end=WALL.end + shift)
    here, moved = (errors(fold_back(found.tree), found.tree, found.sight.view) for found in (
        found_of(view, *places),
        found_of(replace(view, radar=shift), *(place + shift for place in places), mirror=there)))  # fmt: skip
    for one, other in zip(here, moved, strict=True):
        assert_allclose(one, other, rtol=1e-9)


def test_a_mirror_leads_astray_by_twice_its_offset(view):
    """In resolution cells of where the echo stood; a point on it keeps the mirror's own error."""
    wall = replace(WALL, angle_error=0.0, offset_error=0.01)
    found = found_of(view, [0.8, 0.8], [0.0, 1.6], [0.0, 1.0], mirror=wall)
    error, mirror_error = errors(fold_back(found.tree), found.tree, view)
    assert_allclose(mirror_error, [0.0, 0.02 / float(view.cell(1.6)), 0.0])
    assert error[1, 1] == pytest.approx(np.hypot(0.02, OWN_ERROR * RANGE_CELL))
    assert error[2, 1] == pytest.approx(0.01)


def test_echoes_from_elsewhere_stand_where_they_are_seen_with_the_reason(view):
    found = found_of(view, cells(view, (40, 0)), explained=cells(view, (70, 0), (72, 0)), mirror=None)
    points = with_confidence(fold_back(found.tree), found)
    assert len(points.position) == 3
    assert_allclose(points.position[1:], found.explained.position)
    assert_allclose(points.initial[1:], found.explained.position)
    assert points.explanation.tolist() == ["", *["comes from afar"] * 2]
    assert_allclose(points.confidence[1:], EXPLAINED)
    assert_array_equal(points.bounces, 0)
    assert np.isnan(points.error[1:]).all()
    assert np.isfinite(points.error[0]).all()
    assert_array_equal(points.growth, 1.0)
    assert_allclose(points.exceeded[1:], 0.1)
