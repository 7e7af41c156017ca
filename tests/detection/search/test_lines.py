"""Mirrors: lines found where they are, whichever way they lie, and nothing else taken for one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from profiles import examples
from straight_walls import INSIDE, NOISE, errors, look, random_wall, thick, wall_at
from synthetic import diffuse, empty_view, radar_view, together

from mirrorfold.common.geometry import cross2
from mirrorfold.detection import find_mirrors
from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.image_echoes import find_pixels, find_ridges
from mirrorfold.detection.mirrors.line_mirror import LineMirror
from mirrorfold.detection.search.fit import refined
from mirrorfold.detection.search.fronts import Front, find_front
from mirrorfold.detection.search.lines import DEEP, PROFILE


def bare_mirrors(echoes, view, monkeypatch):
    """Mirrors without the search for the face."""
    with monkeypatch.context() as patch:
        patch.setattr("mirrorfold.detection.search.lines._front", lambda mirror, view: Front(0.0, 0.0))
        return find_mirrors(replace(view), echoes)  # another view, which knows nothing of these rows yet


@pytest.mark.slow
@pytest.mark.parametrize("incidence", [-30.0, 40.0])
def test_the_ends_of_a_short_wall_hardly_turn_it(incidence):
    """The cells at the ends of a slanting row turn it by 0.1 degree, towards the same side for any speckle."""
    start, end = wall_at(empty_view().to_points(1.1, 0.3), incidence, 0.4)
    turns = []
    for seed in range(25):
        _, _, (mirror,) = look(*diffuse(start, end, seed), seed=seed)
        along = mirror.direction * np.sign(mirror.direction @ (end - start))
        turns.append(np.degrees(np.arcsin(cross2(end - start, along) / np.linalg.norm(end - start))))
    assert abs(np.mean(turns)) < 0.075
    assert np.std(turns) < 0.11


@pytest.mark.slow
@settings(max_examples=examples(15))
@given(
    st.integers(0, 10**6),
    st.floats(0.9, 1.9),
    st.floats(-0.5, 0.5),
    st.floats(-75.0, 75.0),
    st.floats(0.5, 1.0),
)
def test_a_wall_is_found_to_a_tenth_of_a_degree_and_half_a_millimetre(seed, range_, u, incidence, length):
    start, end = wall_at(empty_view().to_points(range_, u), incidence, length)
    view, _, mirrors = look(*diffuse(start, end, seed), seed=seed)
    assert len(mirrors) == 1
    (mirror,) = mirrors
    angle, offset = errors(mirror, start, end)
    assert angle < 0.1
    assert offset < 0.5
    # Its ends are as sharp as the resolution along it.
    cell = view.extent(np.stack([start, end]), mirror.direction)
    ends = [mirror.start, mirror.end]
    if np.linalg.norm(mirror.start - start) > np.linalg.norm(mirror.end - start):
        ends.reverse()
    assert (np.linalg.norm(np.array(ends) - [start, end], axis=1) < 1.5 * cell).all()
    assert mirror.fill > 0.9


@pytest.mark.slow
def test_the_stated_errors_are_those_that_are_made():
    """That of the angle by speckle alone, that of the offset also by what a wall may hide inside."""
    ratios = []
    for seed in range(16):
        start, end = random_wall(seed)
        _, _, (mirror,) = look(*diffuse(start, end, seed), seed=seed)
        angle, offset = errors(mirror, start, end)
        ratios.append((angle / mirror.angle_error, 1e-3 * offset / mirror.offset_error))
        assert mirror.angle_error < 0.1
        assert mirror.offset_error < 0.0015
    angle, offset = np.sqrt(np.mean(np.square(ratios), axis=0))
    assert 0.5 < angle < 1.5
    assert offset < 1.0


@pytest.mark.slow
@pytest.mark.parametrize("inside", list(INSIDE))
def test_a_face_is_found_however_the_wall_scatters_inside(inside):
    """Where nothing scatters near the face, as by a profile that rises towards the back, less well."""
    made, stated = [], []
    for seed in range(6):
        start, end = random_wall(seed, length=1.0, obliquity=60.0)
        _, _, (mirror, *_) = look(*thick(start, end, seed, 0.007, inside), seed=seed)
        made.append(1e-3 * errors(mirror, start, end)[1])
        stated.append(mirror.offset_error)
    known = inside != "rising"
    assert np.mean(made) < (0.0025 if known else 0.0045)
    assert np.sqrt(np.mean(np.square(np.array(made) / stated))) < (2.0 if known else 4.0)


@pytest.mark.parametrize(("gap", "expected"), [(0.02, [1.02]), (0.15, [0.5, 0.5])])
@pytest.mark.parametrize("seed", range(3))
def test_pieces_on_a_line_are_one_mirror_over_a_small_gap_and_two_over_a_large_one(gap, expected, seed):
    direction, corner = np.array([np.cos(0.35), np.sin(0.35)]), np.array([-0.5, 1.3])
    pieces = together(
        diffuse(corner, corner + 0.5 * direction, 2 * seed),
        diffuse(corner + (0.5 + gap) * direction, corner + (1.0 + gap) * direction, 2 * seed + 1),
    )
    _, _, mirrors = look(*pieces, seed=seed)
    assert len(mirrors) == len(expected)
    assert_allclose([m.length for m in mirrors], expected, atol=0.03)
    for mirror in mirrors:
        angle, offset = errors(mirror, corner, corner + direction)
        assert angle < 0.2
        assert offset < 0.5


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(("length", "number"), [(0.18, 0), (0.33, 1)])
def test_a_short_row_says_too_little_to_be_a_mirror(seed, length, number):
    start, end = wall_at(np.array([0.2, 1.3]), 15.0 * seed, length)
    view, echoes, mirrors = look(*diffuse(start, end, seed), seed=seed)
    assert len(mirrors) == number
    assert len(find_mirrors(view, echoes, minimum_length=0.1)) == 1
    assert not find_mirrors(view, echoes, minimum_length=0.5)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("radius", [0.15, 0.25])
def test_an_arc_is_not_a_mirror(seed, radius):
    random = np.random.default_rng([seed, 3])
    angle = np.radians(np.arange(210.0, 330.0, np.degrees(0.002 / radius)))
    center = np.array([random.uniform(-0.6, 0.6), random.uniform(1.2, 2.0)])
    points = center + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    amplitude = random.standard_normal(angle.size) + 1j * random.standard_normal(angle.size)
    _, echoes, mirrors = look(points, amplitude)
    assert np.count_nonzero(echoes.strong) > 20
    assert mirrors == []


def clutter(seed, number):
    random = np.random.default_rng([seed, number])
    points = np.stack([random.uniform(-0.5, 0.5, number), random.uniform(0.9, 1.9, number)], axis=1)
    return points, random.standard_normal(number) + 1j * random.standard_normal(number)


@pytest.mark.parametrize("seed", range(6))
def test_scattered_clutter_is_not_a_mirror(seed):
    _, echoes, mirrors = look(*clutter(seed, 30), seed=seed)
    assert np.count_nonzero(echoes.strong) > 30
    assert mirrors == []


@pytest.mark.parametrize("seed", range(4))
def test_a_wall_amid_clutter_is_found_as_well(seed):
    start, end = random_wall(seed, obliquity=50.0)
    _, _, mirrors = look(*together(diffuse(start, end, seed), clutter(seed, 30)), seed=seed)
    assert len(mirrors) == 1
    angle, offset = errors(mirrors[0], start, end)
    assert angle < 0.25
    assert offset < 1.0


def test_nothing_shows_no_mirror():
    _, echoes, mirrors = look(np.empty((0, 2)), np.empty(0))
    assert echoes.range.size == 0
    assert mirrors == []


@pytest.fixture(scope="module")
def room():
    """Two walls, and something too short to be one."""
    return look(
        *together(
            diffuse((-0.6, 1.1), (0.1, 1.4), 1),
            diffuse((0.5, 1.9), (0.8, 1.0), 2, strength=2.0),
            diffuse((-0.3, 1.8), (-0.1, 1.85), 3),
        )
    )


@pytest.mark.slow
@settings(max_examples=examples(12))
@given(st.floats(-180.0, 180.0), st.floats(-5.0, 5.0), st.floats(-5.0, 5.0))
def test_mirrors_turn_and_move_with_the_radar_and_its_echoes(room, angle, x, y):
    view, echoes, mirrors = room
    cosine, sine = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    turn, shift = np.array([[cosine, -sine], [sine, cosine]]), np.array([x, y])
    moved_view = replace(
        view, radar=turn @ view.radar + shift, along=turn @ view.along, broadside=turn @ view.broadside
    )
    moved = find_mirrors(moved_view, replace(echoes, position=echoes.position @ turn.T + shift))
    assert len(moved) == len(mirrors) == 2
    for mirror, other in zip(mirrors, moved, strict=True):
        start, end = turn @ mirror.start + shift, turn @ mirror.end + shift
        angle_error, offset = errors(other, start, end)
        assert angle_error < 0.02
        assert offset < 0.1
        assert other.length == pytest.approx(mirror.length, abs=0.01)


def test_the_strongest_mirror_comes_first_whatever_the_unit(room):
    view, echoes, mirrors = room
    assert_allclose([m.length for m in mirrors], [0.95, 0.76], atol=0.03)
    assert mirrors[0].strength > 1.4 * mirrors[1].strength
    unit = 2.0**-20
    scaled = find_mirrors(
        replace(view, amplitude=unit * view.amplitude), replace(echoes, amplitude=unit * echoes.amplitude)
    )
    for mirror, other in zip(mirrors, scaled, strict=True):
        assert_allclose([other.start, other.end], [mirror.start, mirror.end], atol=1e-6)
        assert other.strength == pytest.approx(unit * mirror.strength)


def test_echoes_that_are_not_usable_support_no_mirror(room):
    view, echoes, _ = room
    usable = echoes.position[:, 0] < 0.3
    found = find_mirrors(view, replace(echoes, visible=usable))
    assert len(found) == 1
    assert errors(found[0], np.array([-0.6, 1.1]), np.array([0.1, 1.4]))[1] < 1.0
    assert find_mirrors(view, replace(echoes, visible=np.zeros_like(usable))) == []


def test_a_glint_does_not_turn_a_mirror():
    start, end = np.array([-0.5, 1.3]), np.array([0.4, 1.5])
    points, amplitude = diffuse(start, end, 4)
    # 20 dB above the wall, 1 cm in front of it near one end.
    glint = start + 0.1 * (end - start) + [0.0, -0.01]
    _, _, mirrors = look(*together((points, amplitude), (glint[None], [150.0])))
    angle, offset = errors(max(mirrors, key=lambda m: m.length), start, end)
    assert angle < 0.3
    assert offset < 2.0


@pytest.mark.slow
@pytest.mark.parametrize("depth", [0.01, 0.02])
def test_the_line_of_a_wall_that_scatters_from_inside_is_moved_to_its_face(depth, monkeypatch):
    before, after = [], []
    for seed in range(6):
        start, end = random_wall(seed, length=0.9, obliquity=60.0)
        view, echoes, mirrors = look(*thick(start, end, seed, depth), seed=seed)
        assert len(mirrors) == 1
        before.append(errors(bare_mirrors(echoes, view, monkeypatch)[0], start, end)[1])
        after.append(errors(mirrors[0], start, end)[1])
    assert np.mean(before) > 6.0
    assert np.mean(after) < 0.5 * np.mean(before)
    assert np.max(after) < (4.5 if depth == 0.01 else 6.5)


@pytest.mark.slow
def test_walls_whose_backs_are_seen_apart_are_moved_to_their_faces():
    """The centres of one of them, seed 12, stray by less than a quarter of the depth: the line runs askew."""
    offsets = []
    for seed in range(25):
        random = np.random.default_rng([seed, 77])
        middle = np.array([0.2, 1.3]) * random.uniform(0.8, 1.3)
        start, end = wall_at(middle, random.uniform(20.0, 65.0), random.uniform(0.35, 0.9))
        (mirror,) = look(*thick(start, end, seed, 0.006, "front and back"), seed=seed)[2]
        offsets.append(errors(mirror, start, end)[1])
    assert np.mean(offsets) < 1.5
    assert np.max(offsets) < 5.0


@pytest.mark.parametrize("seed", range(4))
def test_the_line_of_a_thin_wall_is_left_where_it_is(seed):
    start, end = random_wall(seed, length=0.9)
    view, _, (mirror,) = look(*diffuse(start, end, seed), seed=seed)
    front = find_front(mirror, view)
    assert abs(front.depth) < min(front.error, DEEP * view.range_cell)


def test_the_front_of_a_wall_so_near_that_its_cell_is_deeper_than_wide_is_found():
    mirror = LineMirror(np.array([-0.1, 0.35]), np.array([0.1, 0.35]))
    view = radar_view(*diffuse(*mirror.ends, 3, spacing=0.001), noise=NOISE, reach=(0.15, 1.0))
    assert view.cell_at(mirror.center) == pytest.approx(view.range_cell, rel=0.02)
    assert abs(find_front(mirror, view).depth) < DEEP * view.range_cell


def test_a_line_a_little_wrong_is_refined_to_the_image():
    start, end = np.array([-0.4, 1.2]), np.array([0.5, 1.5])
    view, _, _ = look(*diffuse(start, end, 5))
    # Half a degree and half a centimetre off.
    wrong = LineMirror(start + np.array([0.0, 0.009]), end + np.array([0.0, 0.001]))
    assert errors(wrong, start, end)[0] > 0.4
    angle, offset = errors(refined(wrong, view, *PROFILE)[0], start, end)
    assert angle < 0.05
    assert offset < 0.2


def test_profiles_across_a_mirror_peak_on_it():
    start, end = np.array([-0.4, 1.2]), np.array([0.5, 1.5])
    view, _, _ = look(*diffuse(start, end, 6))
    mirror = LineMirror(start, end)
    places = mirror.places(view)
    assert_allclose(mirror.beside(places), 0.0, atol=1e-12)
    assert 0.0 <= mirror.along(places).min() < mirror.along(places).max() <= mirror.length
    depth = np.broadcast_to(1.5 * view.range_cell * np.linspace(-1.0, 1.0, 121), (len(places), 121))
    inward, power = mirror.profiles(view, places, depth)
    assert_allclose(np.linalg.norm(inward, axis=1), 1.0)
    assert (inward @ (view.radar - mirror.center) < 0.0).all()
    # Where speckle fades, what is left may lie beside the line.
    bright = power.max(axis=1) > np.median(power.max(axis=1))
    top = depth[0, power.argmax(axis=1)]
    assert np.quantile(np.abs(top[bright]), 0.95) < 0.2 * view.range_cell
    assert abs(np.average(top, weights=power.max(axis=1))) < 0.03 * view.range_cell
    assert (power[:, [0, -1]].max(axis=1) < 0.1 * power.max(axis=1)).mean() > 0.9


def test_the_cell_along_and_across_a_line_is_that_of_range_and_of_angle():
    view = empty_view()
    ahead = np.array([[0.0, 2.0]])
    cross = 2.0 * view.u_cell
    assert_allclose(view.extent(ahead, np.eye(2)), [[cross, view.range_cell]])
    diagonal = view.extent(ahead, np.array([1.0, 1.0]) / np.sqrt(2.0))
    assert_allclose(diagonal, np.hypot(view.range_cell, cross) / np.sqrt(2.0))


def test_a_mirror_knows_its_geometry():
    mirror = LineMirror(np.array([1.0, 1.0]), np.array([1.0, 3.0]))
    assert mirror.length == mirror.size == 2.0
    assert_allclose(mirror.direction, [0.0, 1.0])
    assert_allclose(mirror.normal, [-1.0, 0.0])
    assert_allclose(mirror.center, [1.0, 2.0])
    points = np.array([[0.0, 1.5], [4.0, 1.0]])
    assert_allclose(mirror.along(points), [0.5, 0.0])
    assert_allclose(mirror.beside(points), [1.0, -3.0])
    other = LineMirror(np.array([0.0, 0.0]), np.array([1.0, 1.0]))
    assert_allclose(other.reflection(mirror.ends), [[1.0, 1.0], [3.0, 1.0]], atol=1e-15)


def test_as_published_every_long_row_of_pixels_is_a_mirror():
    """Without the tests of straightness, fill and contrast an arc of pixels passes too."""
    angle = np.radians(np.arange(210.0, 330.0, 0.4))
    points = np.array([0.1, 1.5]) + 0.25 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    random = np.random.default_rng(1)
    amplitude = random.standard_normal(angle.size) + 1j * random.standard_normal(angle.size)
    start, end = np.array([-0.9, 1.2]), np.array([-0.3, 1.3])
    view, echoes, _ = look(*together((points, amplitude), diffuse(start, end, 2)))
    published = find_mirrors(view, find_pixels(view, threshold_db=-25.0), tested=False)
    assert len(published) > len(find_mirrors(view, echoes)) == 1
    assert all(mirror.length >= 0.2 for mirror in published)
    assert min(errors(m, start, end)[1] for m in published if errors(m, start, end)[0] < 3.0) < 10.0


def exact_echoes(points):
    """Echoes at given places, all alike."""
    view = empty_view()
    range_, u = view.to_polar(points)
    ones = np.ones(len(points))
    return view, Echoes.found(np.asarray(points), range_, view.column(u), ones, 0.005 * ones, 0.0 * ones, 0.1, 1.0)


def test_untested_rows_are_fitted_by_least_squares_alone():
    along = np.linspace(0.0, 0.6, 121)
    start, direction = np.array([-0.2, 1.0]), np.array([0.8, 0.6])
    view, echoes = exact_echoes(start + along[:, None] * direction)
    (mirror,) = find_mirrors(view, echoes, tested=False)
    ends = sorted([mirror.start.tolist(), mirror.end.tolist()])
    assert_allclose(ends, [start, start + 0.6 * direction], atol=1e-12)


def test_faint_echoes_are_no_evidence_but_continue_a_mirror():
    start, end = np.array([-0.5, 1.4]), np.array([0.5, 1.6])
    points, amplitude = diffuse(start, end, 8)
    view = radar_view(points, amplitude, noise=NOISE)
    echoes = find_ridges(view)
    outer = echoes.position[:, 0] > 0.1
    faded = replace(echoes, strong=echoes.strong & ~outer)
    assert find_mirrors(view, replace(echoes, strong=np.zeros_like(outer))) == []
    (mirror,) = find_mirrors(view, faded)
    assert mirror.length == pytest.approx(np.hypot(1.0, 0.2), abs=0.05)


@pytest.mark.parametrize(("strong", "whole", "count"), [(0.21, 0.4, 1), (0.21, 0.21, 0), (0.1, 0.4, 0)])
@pytest.mark.parametrize("seed", range(3))
def test_what_continues_a_short_row_faintly_makes_it_a_mirror(seed, strong, whole, count):
    """The least length is 0.25 m."""
    start, end = wall_at(np.array([0.2, 1.3]), 20.0, whole)
    view, echoes, _ = look(*diffuse(start, end, seed), seed=seed)
    along = (echoes.position - start) @ (end - start) / whole
    assert len(find_mirrors(view, replace(echoes, strong=echoes.strong & (along < strong)))) == count
