"""Who is seen through whom: generations, opacity, walls; against scenes whose ghosts are known exactly."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from seen_scenes import behind, line_errors, nearest, seen_by, tree_of, wall
from synthetic import diffuse, empty_view, radar_image, together

import mirrorfold as mf
from mirrorfold.common.geometry import cross2
from mirrorfold.common.types import ROOT, UNSEEN
from mirrorfold.tree.lines_of_sight import Cover, LinesOfSight
from mirrorfold.tree.mirror_tree import place_covariance

A, B, C = wall((0.0, 1.2), 47.0, 0.8), wall((1.0, 1.25), 44.0, 0.9), wall((1.05, 2.05), 42.0, 1.0)

TARGETS = np.array([[1.6, 2.0], [1.7, 2.15], [1.65, 1.75]])


@pytest.fixture(scope="module")
def periscope():
    """Scatterers at the places where the radar sees them."""
    ghosts = seen_by([A, B, C], TARGETS)
    rows = [diffuse(*line, seed) for seed, line in enumerate((A, seen_by([A], B), seen_by([A, B], C)))]
    return together(*rows, (ghosts, np.array([15.0, 15.0j, -15.0])))


@pytest.fixture(scope="module")
def periscope_tree(periscope):
    return tree_of(periscope, reach=(0.3, 4.3))


def test_three_bounces_arrive_where_the_targets_are(periscope_tree):
    tree, _, view, _ = periscope_tree
    assert [node.chain for node in tree.walk()] == [(), (0,), (0, 0), (0, 0, 0)]
    for node in tree.walk():
        assert node.generation == len(node.chain)
        assert (node.objects.range.size > 0) == (node.generation == 3)
        if node.mirror is not None:
            true = (A, B, C)[node.generation - 1]
            found = node.face_fold(np.stack([node.mirror.start, node.mirror.end]))
            angle, offset = line_errors(found, true)
            assert angle < 0.06
            assert offset < 1.5
            assert np.linalg.norm(found.mean(axis=0) - true.mean(axis=0)) < 0.02
            assert node.mirror.length == pytest.approx(np.linalg.norm(true[1] - true[0]), abs=0.04)
    deepest = list(tree.walk())[-1]
    places = deepest.fold(deepest.objects.position)
    # An echo lies within the main lobe of its point.
    assert nearest(places, TARGETS).max() < 0.8 * view.cross_cell(view.to_points([3.65], [0.0]))
    for target in TARGETS:
        mine = np.linalg.norm(places - target, axis=1) < 0.05
        assert mine.any()
        best = places[mine][np.argmax(deepest.objects.amplitude[mine])]
        assert np.linalg.norm(best - target) < 0.004


@pytest.mark.slow
def test_three_bounces_fold_in_an_image(periscope):
    x, y = np.arange(-1.0, 1.0, 0.0075), np.arange(0.5, 4.1, 0.0075)
    result = mf.fold(radar_image(*periscope, x, y))
    mirrors, objects = result["mirrors"].dataset, result["objects"].dataset
    assert mirrors["chain"].values.tolist() == ["0", "0/0", "0/0/0"]
    assert mirrors["generation"].values.tolist() == [1, 2, 3]
    assert mirrors["parent"].values.tolist() == [-1, 0, 1]
    for i, (true, ghost) in enumerate(zip((A, B, C), (A, seen_by([A], B), seen_by([A, B], C)), strict=True)):
        for prefix, line in (("folded_", true), ("", ghost)):
            found = np.array([[mirrors[f"{prefix}{axis}{end}"].values[i] for axis in "xy"] for end in "01"])
            angle, offset = line_errors(found, line)
            assert angle < 0.06
            assert offset < 1.5
    places = np.stack([objects["x"].values, objects["y"].values], axis=-1)
    is_object = objects["surface"].values == "object"
    assert set(objects["chain"].values[is_object]) == {"0/0/0"}
    assert set(objects["bounces"].values[is_object]) == {3}
    assert nearest(places[is_object], TARGETS).max() < 0.032
    initial = np.stack([objects["x_initial"].values, objects["y_initial"].values], axis=-1)
    assert nearest(initial[is_object], seen_by([A, B, C], TARGETS)).max() < 0.032
    # The face of a mirror is seen by way of the mirrors in front of it only.
    for bounces, line in enumerate((A, B, C)):
        face = ~is_object & (objects["bounces"].values == bounces)
        assert face.sum() > 50
        along = (places[face] - line[0]) @ (line[1] - line[0]) / np.sum((line[1] - line[0]) ** 2)
        beside = cross2(line[1] - line[0], places[face] - line[0]) / np.linalg.norm(line[1] - line[0])
        assert np.abs(beside).max() < 0.003
        assert -0.05 < along.min() < 0.1
        assert 0.9 < along.max() < 1.05
    # The folded image is brightest around the targets where nothing else is.
    around = result["intensity"].sel(x=slice(1.5, 1.8), y=slice(1.6, 2.25))
    top = np.unravel_index(np.argmax(around.values), around.shape)
    brightest = np.array([[around["x"].values[top[1]], around["y"].values[top[0]]]])
    assert around.values.max() == pytest.approx(15.0, rel=0.15)  # the peak may stand between pixels
    assert nearest(brightest, TARGETS)[0] < 0.01


def test_a_tree_tells_what_it_holds(periscope_tree):
    tree, *_ = periscope_tree
    nodes = list(tree.walk())
    assert [node.chain for node in nodes] == [(), (0,), (0, 0), (0, 0, 0)]
    number = nodes[-1].objects.range.size
    lines = repr(tree).splitlines()
    assert lines[0] == "radar: 0 object echoes"
    assert [line.index("mirror") for line in lines[1:]] == [2, 4, 6]
    assert lines[3].strip() == f"mirror 0/0/0, {nodes[3].mirror.length:.2f} m: {number} object echoes"
    plain = json.loads(tree.to_json())
    assert plain["line"] is None
    assert plain["chain"] == []
    for node in nodes[1:]:
        (plain,) = plain["mirrors"]
        assert plain["chain"] == list(node.chain)
        assert_allclose([plain["line"]["start"], plain["line"]["end"]], [node.mirror.start, node.mirror.end])
        assert plain["line"]["strength"] == node.mirror.strength
        assert plain["line"]["angle_error_deg"] == node.mirror.angle_error
        assert plain["line"]["offset_error_m"] == node.mirror.offset_error
        assert plain["objects"] == node.objects.range.size
    assert plain["mirrors"] == []
    by_chain = tree.mirrors_by_chain()
    assert [len(by_chain[node.chain]) for node in nodes] == [0, 1, 2, 3]
    assert all(one is node.mirror for one, node in zip(by_chain[0, 0, 0], nodes[1:], strict=True))


@pytest.mark.slow
def test_the_errors_of_a_mirror_hold_those_of_all_on_its_way(periscope_tree):
    """Against mirrors that are moved and turned at random, each by its own errors."""
    tree, *_ = periscope_tree
    lines = [node.mirror for node in tree.walk() if node.mirror is not None]
    random = np.random.default_rng(0)
    true, *_ = folded(lines)
    strays, seen = [], []
    place = lines[-1].center + np.array([0.1, 0.3])
    for _ in range(2000):
        moved = []
        for line in lines:
            turn = np.radians(line.angle_error) * random.standard_normal()
            normal = line.normal + turn * line.direction
            moved.append(line.moved(normal / np.linalg.norm(normal), line.center))
            shift = line.offset_error * random.standard_normal() * line.normal
            moved[-1] = replace(moved[-1], start=moved[-1].start + shift, end=moved[-1].end + shift)
        found, *_ = folded(moved)
        along = (true[1] - true[0]) / np.linalg.norm(true[1] - true[0])
        step = found[1] - found[0]
        angle = np.degrees(np.arcsin(cross2(along, step) / np.linalg.norm(step)))
        strays.append((angle, cross2(along, found.mean(axis=0) - true.mean(axis=0))))
        seen.append(place)
        for line in reversed(moved):
            seen[-1] = line.reflection(seen[-1])
    _, first, _, third = tree.walk()
    assert_allclose(np.std(strays, axis=0), third.errors, rtol=0.1)
    assert first.errors == (lines[0].angle_error, lines[0].offset_error)
    # And so do those of what is seen by way of them all.
    assert_allclose(
        np.cov(np.transpose(seen)), place_covariance(place[None], lines)[0], rtol=0.1, atol=1e-3 * np.var(seen)
    )


def folded(lines):
    """Ends of each mirror of a chain at its true place, the last first."""
    ends = []
    for number, line in enumerate(lines):
        place = line.ends
        for mirror in reversed(lines[:number]):
            place = mirror.reflection(place)
        ends.append(place)
    return ends[::-1]


def test_the_radars_view_of_the_periscope_opens_mirror_by_mirror(periscope_tree):
    tree, sight, view, _ = periscope_tree
    assert sorted(sight.chain, key=len) == [(0,), (0, 0), (0, 0, 0)]
    number = {chain: index for index, chain in enumerate(sight.chain)}
    lines = {node.chain: node.mirror for node in tree.walk()}
    range_, u = view.to_polar(0.5 * (lines[0,].center + lines[0, 0].center))
    column = view.column(np.atleast_1d(u))
    for distance, owner in ((0.5, ROOT), (range_, number[0,]), (2.4, number[0, 0]), (3.6, number[0, 0, 0])):
        assert sight.seen_through(np.atleast_1d(distance), column)[0] == owner


@pytest.fixture(scope="module")
def right_angle():
    """Two walls at right angles whose images in each other continue them."""
    first, second = np.array([[-0.4, 1.6], [0.6, 1.6]]), np.array([[0.6, 0.8], [0.6, 1.6]])
    tree, views, *_ = tree_of(
        diffuse(*first, 1), diffuse(*second, 2), diffuse(*seen_by([first], second), 3), reach=(0.3, 3.2)
    )
    return first, second, tree, views


def test_a_wall_that_its_own_image_continues_is_split_where_the_image_begins(right_angle):
    first, second, tree, _ = right_angle
    assert len(tree.mirrors) == 2
    found = {}
    for node in tree.walk():
        if node.mirror is not None:
            ends = node.face_fold(np.stack([node.mirror.start, node.mirror.end]))
            horizontal = abs(ends[1, 0] - ends[0, 0]) > abs(ends[1, 1] - ends[0, 1])
            found[node.generation, bool(horizontal)] = ends
            angle, offset = line_errors(ends, first if horizontal else second)
            assert angle < 0.15
            assert offset < 1.5
    # The second wall, and its image folded back onto it.
    assert set(found) == {(1, True), (1, False), (2, False)}
    for generation in (1, 2):
        assert np.sort(found[generation, False][:, 1]) == pytest.approx([0.8, 1.6], abs=0.04)
    assert np.sort(found[1, True][:, 0]) == pytest.approx([-0.4, 0.6], abs=0.04)


def test_an_image_without_mirrors_has_a_root_alone():
    tree, sight, _, echoes = tree_of((behind(1.0, 0.2), np.full(7, 5.0)))
    assert list(tree.walk()) == [tree]
    assert tree.generation == 0
    assert sight.chain == ()
    assert tree.objects.range.size == np.count_nonzero(echoes.strong)
    assert repr(tree) == f"radar: {tree.objects.range.size} object echoes"


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_scattered_clutter_is_no_mirror(seed):
    random = np.random.default_rng([seed, 100])
    points = np.stack([random.uniform(-0.5, 0.5, 100), random.uniform(0.9, 1.9, 100)], axis=1)
    tree, *_ = tree_of((points, random.standard_normal(100) + 1j * random.standard_normal(100)))
    assert tree.mirrors == ()
    assert tree.objects.range.size > 50


def test_every_echo_is_in_the_tree_at_most_once(periscope_tree):
    tree, _, _, echoes = periscope_tree
    # Faces are moved onto their lines, but range and direction stay those of the image.
    held = [part for node in tree.walk() for part in (node.objects, node.face)]
    places = np.stack(
        [np.concatenate([getattr(part, name) for part in held]) for name in ("range", "direction", "amplitude")], axis=1
    )
    assert len(places) > 0.8 * echoes.range.size
    assert len(np.unique(places, axis=0)) == len(places)


def test_the_radar_itself_has_no_face(periscope_tree):
    tree, *_ = periscope_tree
    assert tree.mirror is None
    assert tree.face.range.size == 0


def test_the_mirror_of_a_node_has_its_earlier_name_too(periscope_tree):
    tree, *_ = periscope_tree
    for node in tree.walk():
        with pytest.warns(DeprecationWarning, match="is called mirror now"):
            assert node.line is node.mirror


def test_mirror_worlds_open_only_through_their_parents():
    """Mirror 1 is seen through mirror 0; a line of sight that misses mirror 0 ends at mirror 1's line."""
    inf = np.inf
    crossing = np.array([[1.0, 1.0, inf, inf], [2.0, inf, 2.0, inf]])
    view = replace(empty_view(), u=np.linspace(-0.3, 0.3, 4))
    sight = LinesOfSight(view, (), crossing, np.array([ROOT, 0]), Cover.nothing(4))
    column = np.arange(4)
    assert_array_equal(sight.seen_through(np.full(4, 0.5), column), [ROOT, ROOT, ROOT, ROOT])
    assert_array_equal(sight.seen_through(np.full(4, 1.5), column), [0, 0, ROOT, ROOT])
    assert_array_equal(sight.seen_through(np.full(4, 2.5), column), [1, 0, UNSEEN, ROOT])
    assert_array_equal(view.column(np.array([-0.31, -0.12, 0.09, 2.0])), [0, 1, 2, 3])


def test_an_echo_at_the_edge_of_a_mirrors_view_must_not_be_contradicted_by_the_radars_own():
    """Two bright objects behind a wall, on whose right the view goes on: one deep in its shadow, one at the edge."""
    wall_ = wall((-0.3, 1.5), 0.0, 0.6)
    inside, edge = np.array([[-0.3, 2.2]]), np.array([[-0.012, 2.2]])
    far = np.array([[0.9, 1.2]])
    tree, _, _, echoes = tree_of(
        diffuse(*wall_, 3), (inside, np.array([15.0])), (edge, np.array([15.0])), (far, np.array([15.0]))
    )
    (mirror,) = tree.mirrors
    held = mirror.objects.position
    assert nearest(inside, held)[0] < 0.01
    # Reflected, it would stand 0.8 m in front of the radar, in full view.
    assert nearest(edge, echoes.position)[0] < 0.01
    assert nearest(edge, held)[0] > 0.1
    # Beside something that the radar does see, nothing contradicts it.
    beside = (np.array([[0.06, 0.8]]), np.array([8.0]))
    tree, *_ = tree_of(diffuse(*wall_, 3), (inside, np.array([15.0])), (edge, np.array([15.0])), beside)
    assert nearest(edge, tree.mirrors[0].objects.position)[0] < 0.01


def test_the_radars_own_view_is_not_trusted_beyond_its_echoes():
    """Without an echo from further aside, its antennas may be deaf there."""
    _, sight, view, _ = tree_of(diffuse(*wall((-0.3, 1.5), 0.0, 0.6), 3))
    assert not sight.empty_up_to[np.abs(view.u) > 0.42].any()
    assert (sight.empty_up_to[(view.u > 0.12) & (view.u < 0.35)] > 2.9).all()
    before = sight.empty_up_to[(view.u < -0.1) & (view.u > -0.3)]
    assert ((before > 1.35) & (before < 1.5)).all()
