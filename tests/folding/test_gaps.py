"""Surfaces go on through gaps that the radar cannot see, and end where the image is dark."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from synthetic import RANGE_CELL, U_CELL, diffuse, echoes_at, empty_view, radar_image, radar_view, together

import mirrorfold as mf
from mirrorfold.common.geometry import reflect
from mirrorfold.detection.image_echoes import find_ridges
from mirrorfold.detection.mirrors.line_mirror import LineMirror
from mirrorfold.folding.confidence import mirror_confidence
from mirrorfold.folding.gaps import GAP_CELLS, STEP_CELLS, close_gaps
from mirrorfold.folding.points import fold_back
from mirrorfold.tree.mirror_tree import MirrorTree

MIRROR = LineMirror(np.array([-0.5, 0.9]), np.array([0.5, 1.1]))


def lit_view(level=1.0):
    """A view in which nothing is dark."""
    view = empty_view()
    return replace(view, amplitude=np.full_like(view.amplitude, level))


def points_at(view, *places, mirror=None):
    """Points at places by range and u in resolution cells, and their tree; seen in a mirror, where one is given."""
    range_, u = np.reshape(places, (-1, 2)).T
    echoes = echoes_at(view, view.to_points(RANGE_CELL * range_, U_CELL * u))
    nothing = echoes.take([])
    children = () if mirror is None else (MirrorTree((mirror,), nothing, echoes, (), (0,)),)
    tree = MirrorTree((), nothing, echoes if mirror is None else nothing, children, ())
    return fold_back(tree), tree


def added(points, tree, view):
    """What lies in gaps."""
    closed = close_gaps(points, tree, view)
    assert not closed.interpolated[: len(points.initial)].any()
    return closed.take(closed.interpolated)


@pytest.mark.parametrize("apart", [(2.0, 0.0), (0.0, 2.0), (1.2, -1.6), (GAP_CELLS - 0.01, 0.0)])
@pytest.mark.parametrize("mirror", [None, MIRROR])
def test_points_follow_each_other_within_a_step_on_the_line_between_folded_neighbours(apart, mirror):
    view = lit_view()
    points, tree = points_at(view, (50.0, 3.0), (50.0 + apart[0], 3.0 + apart[1]), mirror=mirror)
    new = added(points, tree, view)
    start, end = points.position
    every = np.concatenate([[start], new.position, [end]])
    along = (every - start) @ (end - start) / np.sum((end - start) ** 2)
    assert np.all(np.diff(along) > 0.0)
    assert_allclose(every, start + along[:, None] * (end - start), atol=1e-12)
    cells = view.in_cells(np.concatenate([points.initial[:1], new.initial, points.initial[1:]]))
    assert np.linalg.norm(np.diff(cells, axis=0), axis=1).max() <= STEP_CELLS + 0.02  # chords of a curved grid
    place = new.initial if mirror is None else reflect(new.initial, MIRROR.center, MIRROR.normal)
    assert_allclose(new.position, place, atol=1e-12)
    assert set(new.chain) == ({""} if mirror is None else {"0"})


def test_wider_gaps_and_what_was_seen_otherwise_stay_apart():
    view = lit_view()
    pair, tree = points_at(view, (50.0, 0.0), (52.0, 0.0))
    assert len(added(pair, tree, view).initial) == 3
    assert not len(added(*points_at(view, (50.0, 0.0), (50.0 + GAP_CELLS + 0.01, 0.0)), view).initial)
    for other in (
        {"chain": np.array(["", "0"])}, {"mirror": np.array(["", "0"])}, {"wall": np.array(["0", "0"])},
        {"explanation": np.array(["", "comes from afar"])}, {"explanation": np.array(["comes from afar"] * 2)},
    ):  # fmt: skip
        assert not len(added(replace(pair, **other), tree, view).initial), other
    doubted = replace(pair, confidence=np.array([0.9, 0.3]))
    assert added(doubted, tree, view).confidence.tolist() == pytest.approx([0.3] * 3)
    # What was measured of the echoes, and what they say of the mirror they lie on, is theirs alone.
    asked = replace(doubted, confocal=np.ones(2), passed=np.ones(2), decided=np.array(["geometry"] * 2))
    new = added(replace(asked, mirror=np.array(["0", "0"])), tree, view)
    assert np.isnan([new.confocal, new.passed]).all()
    assert set(new.decided) == {""}
    on_face = close_gaps(replace(doubted, mirror=np.array(["0", "0"])), tree, view)
    assert mirror_confidence(on_face, "0") == pytest.approx(0.6)
    for few in ([], [0]):
        assert not len(added(pair.take(few), tree, view).initial)


def test_what_is_as_near_by_way_of_others_is_joined_once():
    """Between three in a row there are two gaps, not three."""
    view = lit_view()
    row, tree = points_at(view, (50.0, 0.0), (50.9, 0.0), (51.8, 0.0))
    assert_allclose(np.sort(view.in_cells(added(row, tree, view).initial)[:, 0]), [50.45, 51.35], atol=1e-9)


def test_a_gap_is_where_the_echoes_around_it_are_not_where_its_ends_stray_to():
    """On a straight surface the two ends of a gap are a third of a cell off, both to one side."""
    view = lit_view()
    depth = np.array([*np.arange(0.0, 2.1, 0.4), *np.arange(4.4, 6.5, 0.4)])
    aside = np.where(np.abs(depth - 3.2) < 1.3, 0.33, 0.0)
    row, tree = points_at(view, *zip(50.0 + depth, aside, strict=True))
    off = view.in_cells(added(row, tree, view).initial)[:, 1]
    assert off.size
    assert np.all((off > 0.0) & (off < 0.25))


@pytest.mark.parametrize("axis", [0, 1])
def test_two_things_with_a_dark_gap_between_them_stay_two(axis):
    apart = np.zeros(2)
    apart[axis] = 2.9
    places = np.array([50.0, 0.0]) + np.stack([0.0 * apart, apart])
    view = empty_view()
    where = view.to_points(*(places * [RANGE_CELL, U_CELL]).T)
    view = radar_view(where, np.array([0.5, 0.5j]), samples=6)
    assert not len(added(*points_at(view, *places), view).initial)
    # As soon as there is something in it, they are one.
    middle = view.to_points(*((places.mean(axis=0) * [RANGE_CELL, U_CELL])[:, None]))
    view = radar_view(*together((where, np.array([0.5, 0.5j])), (middle, np.array([0.2]))), samples=6)
    new = added(*points_at(view, *places), view)
    assert_allclose(new.amplitude[len(new.amplitude) // 2 - 1 :][:2].max(), 0.2, rtol=0.3)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
def test_a_rough_surface_whose_echoes_are_torn_apart_is_whole_again(seed):
    start, end = np.array([-0.25, 1.5]), np.array([0.25, 1.62])
    view = radar_view(*diffuse(start, end, seed), samples=6, noise=1e-3)
    echoes = find_ridges(view)
    along = (echoes.position - start) @ (end - start) / np.linalg.norm(end - start)
    cell = float(view.cell_at(0.5 * (start + end)))
    torn = echoes.take(echoes.strong & (np.abs(along - 0.25) > 0.6 * cell))
    tree = MirrorTree((), echoes.take([]), torn, (), ())
    points = fold_back(tree)
    closed = close_gaps(points, tree, view)
    truth = start + np.linspace(0.0, 1.0, 200)[:, None] * (end - start)

    def farthest(places):
        return np.linalg.norm(truth[:, None] - places, axis=-1).min(axis=1).max()

    assert farthest(closed.position) < 0.75 * farthest(points.position)
    normal = np.array([start[1] - end[1], end[0] - start[0]]) / np.linalg.norm(end - start)
    off = np.abs((closed.position - start) @ normal)
    assert off[closed.interpolated].max() <= off[~closed.interpolated].max()
    assert off[closed.interpolated].mean() < off[~closed.interpolated].mean()


@pytest.mark.slow
def test_the_table_says_which_points_they_are_and_the_setting_leaves_them_out():
    scatterers = together(diffuse((-0.25, 1.2), (0.3, 1.3), 3), diffuse((-0.3, 1.8), (-0.1, 1.7), 4))
    image = radar_image(*scatterers, np.arange(-0.8, 0.8, 0.006), np.arange(0.4, 2.4, 0.006))
    whole, torn = mf.fold(image), mf.fold(image, close_gaps=False)
    assert not torn["objects"]["interpolated"].any()
    own = ~whole["objects"]["interpolated"].values
    assert 0 < np.count_nonzero(~own) < np.count_nonzero(own)
    for name in ("x", "y", "confidence", "amplitude"):
        assert_allclose(whole["objects"][name].values[own], torn["objects"][name].values)
    assert not mf.fold(image, preset="published")["objects"]["interpolated"].any()
