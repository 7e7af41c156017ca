"""Every echo back to its place, and whose the blobs of the image are: a tree of two mirrors made by hand."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from synthetic import RANGE_CELL, U_CELL, echoes_at, empty_view

from mirrorfold.common.geometry import reflect
from mirrorfold.common.types import ROOT, UNSEEN
from mirrorfold.detection.mirrors.arc_mirror import ArcMirror
from mirrorfold.detection.mirrors.line_mirror import LineMirror
from mirrorfold.folding.collection import _mirrors, _objects, _remark
from mirrorfold.folding.magnification import magnified
from mirrorfold.folding.points import BLOB_CELLS, fold_back, owned_blobs
from mirrorfold.folding.settings import FoldSettings
from mirrorfold.tree.lines_of_sight import Cover, LinesOfSight
from mirrorfold.tree.mirror_tree import MirrorTree

NEAR = LineMirror(np.array([-0.3, 1.0]), np.array([0.3, 1.0]))
FAR = LineMirror(np.array([-0.5, 1.8]), np.array([0.5, 2.2]))


@pytest.fixture(scope="module")
def view():
    return empty_view()


def tree_of(view, direct, behind, both, *, mirrors=(NEAR, FAR), faces=((), ())):
    """One mirror seen in another, with what is seen directly, by way of the first, and by way of both."""
    parts = [echoes_at(view, np.reshape(places, (-1, 2))) for places in (direct, behind, both, *faces)]
    deeper = MirrorTree(tuple(mirrors[:2]), parts[4], parts[2], (), (0, 0))
    first = MirrorTree((mirrors[0],), parts[3], parts[1], (deeper,), (0,))
    return MirrorTree((), parts[0].take([]), parts[0], (first,), ())


def test_each_echo_is_reflected_in_the_mirrors_of_its_way_the_last_first(view):
    direct, behind, both, faces = [-0.5, 0.8], [0.1, 1.6], [0.1, 2.5], ([0.0, 1.0], [0.0, 2.0])
    tree = tree_of(view, direct, behind, both, faces=faces)
    tree = replace(tree, objects=replace(tree.objects, noise=np.array([0.3]), limit=np.array([0.2])))
    points = fold_back(tree)
    by_near = lambda place: reflect(np.array(place), NEAR.center, NEAR.normal)  # noqa: E731
    by_both = by_near(reflect(np.array(both), FAR.center, FAR.normal))
    # Objects before faces, from the root on; a face is seen by way of the mirrors before it.
    assert_allclose(points.position, [direct, by_near(behind), faces[0], by_both, by_near(faces[1])], atol=1e-12)
    assert_allclose(points.initial, [direct, behind, faces[0], both, faces[1]])
    assert points.chain.tolist() == ["", "0", "", "0/0", "0"]
    assert points.mirror.tolist() == ["", "", "0", "", "0/0"]
    assert points.bounces.tolist() == [0, 1, 0, 2, 1]
    assert points.exceeded.tolist() == [0.3, 0.1, 0.1, 0.1, 0.1]
    # Until they are judged all are believed, and nothing is known of their errors.
    assert points.confidence.tolist() == points.growth.tolist() == [1.0] * 5
    assert not points.error.any()
    assert points.error.shape == (5, 2)
    assert np.isnan(points.confocal).all()
    assert set(points.explanation) == set(points.caustic) == {""}
    assert points.take(points.bounces == 2).chain.tolist() == ["0/0"]


@pytest.mark.parametrize(
    ("passed", "decided", "said"),
    [
        ((0.95, 0.05), "polarization", ""),
        ((0.95, 0.5), "polarization", "whether 1 point passed through a wall or was reflected is doubtful"),
        ((0.5, 0.8), "geometry", "whether 2 points passed through a wall or were reflected is a guess from geometry"),
        ((np.nan, np.nan), "", ""),
    ],
    ids=["certain", "doubtful", "guessed", "not tested"],
)
def test_the_remark_tells_what_may_have_passed_through_a_wall(view, passed, decided, said):
    tree = tree_of(view, [], [[0.1, 1.6], [0.0, 1.7]], [])
    points = replace(fold_back(tree), passed=np.array(passed), decided=np.array([decided] * 2))
    nothing = SimpleNamespace(range=np.empty(0), direction=np.empty(0), take=lambda _: nothing)
    sight = SimpleNamespace(through=lambda _: np.empty(0, dtype=int))
    found = SimpleNamespace(tree=tree, sight=sight, explained=nothing, explanation=np.empty(0, dtype=str))
    remark = _remark(None, found, points, FoldSettings(min_confidence=0.0), None, None)
    assert remark.startswith(said)
    assert bool(remark) == bool(said)


def test_only_what_a_curved_mirror_shows_is_coarser(view):
    pillar = ArcMirror(middle=np.array([0.0, 1.3]), radius=0.3, first=np.pi, span=np.pi, radar=np.zeros(2))
    tree = tree_of(view, [-0.5, 0.8], [0.0, 2.0], np.empty((0, 2)), mirrors=(pillar, FAR))
    # With r1 = s = 1 m the pencil of rays is 1 + 2 r1 s / (R (r1 + s)) as wide.
    assert_allclose(fold_back(tree, view).growth, [1.0, 1.0 + 1.0 / 0.3])
    assert fold_back(tree).growth.tolist() == [1.0, 1.0]
    # A flat mirror before it leaves the cell as it is.
    assert_array_equal(magnified([NEAR, pillar], np.array([[0.0, 2.0]]), view)[0], [1.0 + 1.0 / 0.3])
    # Where the wavelength is not known, nor is the blur, nor what is near a caustic.
    bay = replace(pillar, middle=np.array([0.0, 0.5]), radius=0.5, first=0.0)
    growth, caustic = magnified([bay], np.array([[0.0, 1.2], [0.0, 1.9]]), view)
    assert_allclose(growth, np.abs(bay.spread(np.array([[0.0, 1.2], [0.0, 1.9]]))[0]))
    assert caustic.tolist() == ["", "beyond"]


def test_tables_of_a_result_tell_of_curved_mirrors_where_there_are_any(view):
    """The pillar, and a wall behind it that it shows; where the middle of each face is, and how it is curved."""
    pillar = ArcMirror(middle=np.array([0.0, 1.3]), radius=0.3, first=np.pi, span=np.pi, radar=np.zeros(2),
                       curvature_error=0.1)  # fmt: skip
    for first, curved in ((pillar, True), (NEAR, False)):
        tree = tree_of(view, [-0.5, 0.8], [0.0, 2.0], np.empty((0, 2)), mirrors=(first, FAR))
        points = fold_back(tree, view)
        objects, mirrors = _objects(points), _mirrors(tree, points)
        assert ("growth" in objects) == ("caustic" in objects) == ("curvature" in mirrors) == curved
        assert mirrors["chain"].values.tolist() == ["0", "0/0"]
        assert mirrors["parent"].values.tolist() == [-1, 0]
        units = {"x0": "m", "offset_error": "m", "angle_error": "degree", "fill": "1", "confidence": "1"}
        assert {name: mirrors[name].attrs["units"] for name in units} == units
        if curved:
            assert_allclose(objects["growth"], points.growth, rtol=1e-6)
            assert_allclose(mirrors["curvature"], [1.0 / 0.3, 0.0])
            assert_allclose(mirrors["curvature_error"], [0.1, 0.0])
            middle = np.column_stack([mirrors["xm"], mirrors["ym"]])
            assert_allclose(middle, [pillar.center, FAR.center], atol=1e-12)
            true = np.column_stack([mirrors["folded_xm"], mirrors["folded_ym"]])
            assert_allclose(true, [pillar.center, tree.mirrors[0].fold(FAR.center)], atol=1e-12)
            assert mirrors["curvature"].attrs["units"] == "1/m"


def owned(view, direct=(), behind=(), both=(), confidence=1.0, **given):
    tree = tree_of(view, direct, behind, both)
    points = fold_back(tree)
    points = replace(points, confidence=confidence * np.ones(len(points.initial)))
    crossing = np.full((2, view.u.size), np.inf)
    sight = LinesOfSight(view, (NEAR, FAR), crossing, np.array([ROOT, 0]), Cover.nothing(view.u.size))
    return owned_blobs(points, sight, **given)


def at(view, range_, u):
    """Direction and sample of a place."""
    return int(view.column(u)), round((range_ - view.range[0]) / view.dr)


def polar(view, *places):
    return view.to_points(*np.array(places).T)


def test_a_blob_is_a_cell_and_a_half_about_its_echo(view):
    owner = owned(view, behind=polar(view, (1.5, 0.1)))
    direction, sample = at(view, 1.5, 0.1)
    samples, columns = (owner == 0).any(axis=0).nonzero()[0], (owner == 0).any(axis=1).nonzero()[0]
    reach = round(BLOB_CELLS * RANGE_CELL / view.dr + 0.5)
    assert samples.tolist() == list(range(sample - reach, sample + reach + 1))
    # Across it is the cell at that range, diagonal as it is.
    half = BLOB_CELLS * np.hypot(RANGE_CELL, 1.5 * U_CELL) / 1.5
    assert_array_equal(columns, np.flatnonzero(np.abs(view.u - 0.1) < half))
    assert (owner[columns][:, samples] == 0).all()
    assert np.count_nonzero(owner != ROOT) == samples.size * columns.size
    assert owner[direction, sample] == 0


def test_where_blobs_meet_the_deeper_one_counts_and_doubt_the_least(view):
    place = polar(view, (1.5, 0.1))
    spot = at(view, 1.5, 0.1)
    assert owned(view, direct=place)[spot] == ROOT
    assert owned(view, direct=place, behind=place)[spot] == 0
    assert owned(view, behind=place, both=place)[spot] == 1
    assert owned(view, direct=place, behind=place, both=place)[spot] == 1
    # What is doubted is nobody's, unless a point stands there that is not.
    assert owned(view, behind=place, confidence=0.4, least=0.5)[spot] == UNSEEN
    assert owned(view, behind=place, confidence=0.5, least=0.5)[spot] == 0
    assert owned(view, behind=place, confidence=0.0)[spot] == 0
    assert owned(view, direct=place, confidence=0.4, least=0.5)[spot] == UNSEEN
    for beside in ("direct", "behind"):
        parts = {beside: place, "both": place}
        assert owned(view, **parts, confidence=np.array([0.4, 0.9]), least=0.5)[spot] == 1
    assert owned(view, direct=place, both=place, confidence=np.array([0.9, 0.4]), least=0.5)[spot] == ROOT


def test_blobs_end_where_the_view_does(view):
    first, last = float(view.range[0]), float(view.range[-1])
    owner = owned(view, behind=polar(view, (first, 0.1), (last, -0.1), (1.5, float(view.u[-1]))))
    assert owner[at(view, first, 0.1)] == owner[at(view, last, -0.1)] == owner[at(view, 1.5, view.u[-1])] == 0
    # Nothing at the far end of what stands at the near one, and the other way round.
    assert owner[at(view, last, 0.1)] == owner[at(view, first, -0.1)] == owner[at(view, 1.5, view.u[0])] == ROOT


def test_of_more_points_than_are_treated_at_once_each_has_its_blob(view):
    angle = np.linspace(-0.8, 0.8, 2500)
    places = 1.5 * np.stack([np.sin(angle), np.cos(angle)], axis=1)
    owner = owned(view, behind=places)
    sample = at(view, 1.5, 0.0)[1]
    assert (owner[np.abs(view.u) < 0.7, sample] == 0).all()
