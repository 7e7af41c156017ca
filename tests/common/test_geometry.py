"""Reflections, isometries and crossings: what must hold for every mirror and every point."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.testing import assert_allclose

from mirrorfold.common.geometry import (
    Isometry,
    circle_crossings,
    cross2,
    crossing,
    reflect,
    segment_normal,
    signed_distance,
    unit,
)

metres = st.floats(-10.0, 10.0, allow_subnormal=False)
TOLERANCE = {"rtol": 0, "atol": 1e-11}


def vectors(dimensions):
    return arrays(float, dimensions, elements=metres)


@st.composite
def mirrors(draw, dimensions=None):
    """A point on a mirror, its unit normal, and two more points; in two or in three dimensions."""
    dimensions = dimensions or draw(st.sampled_from([2, 3]))
    on_mirror, normal, p, q = (draw(vectors(dimensions)) for _ in range(4))
    assume(np.linalg.norm(normal) > 1e-3)
    return on_mirror, unit(normal), p, q


@st.composite
def chains(draw):
    """Up to four reflections one after the other, and a point."""
    dimensions = draw(st.sampled_from([2, 3]))
    chain = [draw(mirrors(dimensions))[:2] for _ in range(draw(st.integers(1, 4)))]
    isometry = Isometry.identity(dimensions)
    for on_mirror, normal in chain:
        isometry = isometry @ Isometry.reflection(on_mirror, normal)
    return isometry, chain, draw(vectors(dimensions))


@st.composite
def segments(draw):
    start, end = draw(vectors(2)), draw(vectors(2))
    assume(np.linalg.norm(end - start) > 1e-2)
    return start, end


def turn(points, angle, shift):
    """Rotated by an angle [rad] and shifted."""
    c, s = np.cos(angle), np.sin(angle)
    return np.asarray(points) @ np.array([[c, s], [-s, c]]) + shift


@pytest.mark.slow
@given(mirrors())
def test_reflecting_twice_is_the_identity(case):
    on_mirror, normal, p, _ = case
    assert_allclose(reflect(reflect(p, on_mirror, normal), on_mirror, normal), p, **TOLERANCE)


@pytest.mark.slow
@given(mirrors())
def test_reflection_keeps_distances_and_changes_side(case):
    on_mirror, normal, p, q = case
    image_p, image_q = reflect(p, on_mirror, normal), reflect(q, on_mirror, normal)
    assert_allclose(np.linalg.norm(image_p - image_q), np.linalg.norm(p - q), **TOLERANCE)
    assert_allclose(
        signed_distance(image_p, on_mirror, normal), -signed_distance(p, on_mirror, normal), rtol=0, atol=1e-11
    )


@pytest.mark.slow
@given(mirrors())
def test_points_of_the_mirror_stay(case):
    on_mirror, normal, p, _ = case
    foot = p - signed_distance(p, on_mirror, normal) * normal
    assert_allclose(reflect(foot, on_mirror, normal), foot, **TOLERANCE)


def test_reflection_in_the_line_y_equals_x_swaps_coordinates():
    normal = unit([1.0, -1.0])
    assert_allclose(reflect([[3.0, 1.0], [0.0, -2.0]], [5.0, 5.0], normal), [[1.0, 3.0], [-2.0, 0.0]], atol=1e-15)


@pytest.mark.slow
@given(chains())
def test_a_chain_of_reflections_is_one_isometry(case):
    isometry, chain, p = case
    expected = p
    for on_mirror, normal in reversed(chain):
        expected = reflect(expected, on_mirror, normal)
    assert_allclose(isometry(p), expected, rtol=0, atol=1e-10)
    assert_allclose(np.linalg.det(isometry.linear), (-1.0) ** len(chain), atol=1e-12)


@pytest.mark.slow
@given(chains())
def test_the_inverse_undoes_an_isometry_from_both_sides(case):
    isometry, _, p = case
    assert_allclose(isometry.inverse(isometry(p)), p, rtol=0, atol=1e-10)
    for product in (isometry @ isometry.inverse, isometry.inverse @ isometry):
        assert_allclose(product.linear, np.eye(p.size), atol=1e-12)
        assert_allclose(product.shift, 0.0, atol=1e-10)


@pytest.mark.slow
@given(chains(), st.data())
def test_composition_is_one_after_the_other_and_keeps_distances(case, data):
    isometry, _, p = case
    on_mirror, normal, q, _ = data.draw(mirrors(p.size))
    second = Isometry.reflection(on_mirror, normal)
    assert_allclose((second @ isometry)(p), second(isometry(p)), rtol=0, atol=1e-10)
    assert_allclose(np.linalg.norm(isometry(p) - isometry(q)), np.linalg.norm(p - q), rtol=0, atol=1e-10)


def test_isometries_map_arrays_of_points_of_any_shape():
    isometry = Isometry.reflection([0.0, 1.0], [0.0, 1.0])
    points = np.arange(24.0).reshape(3, 4, 2)
    assert_allclose(isometry(points), points * [1, -1] + [0, 2])


@pytest.mark.slow
@given(segments())
def test_the_normal_of_a_segment_is_its_direction_turned_left(segment):
    start, end = segment
    normal = segment_normal(start, end)
    assert_allclose(np.linalg.norm(normal), 1.0)
    assert_allclose(normal @ (end - start), 0.0, atol=1e-12)
    assert cross2(end - start, normal) > 0


@pytest.mark.slow
@given(vectors(2), vectors(2), segments())
def test_two_lines_cross_at_one_point_whichever_is_called_the_ray(origin, target, segment):
    start, end = segment
    sine = cross2(target - origin, end - start)
    assume(abs(sine) > 1e-2 * np.linalg.norm(target - origin) * np.linalg.norm(end - start) > 0)
    assume(np.linalg.norm(target - origin) > 1e-2)
    along_ray, along_segment = crossing(origin, target, start, end)
    assert_allclose(origin + along_ray * (target - origin), start + along_segment * (end - start), rtol=0, atol=1e-7)
    swapped = crossing(start, end, origin, target)
    assert_allclose(swapped, (along_segment, along_ray), rtol=1e-9, atol=1e-9)


def in_shadow(origin, target, start, end):
    """Whether the segment start-end stands between the origin and each target."""
    along_ray, along_segment = crossing(origin, target, start, end)
    return (along_ray > 0.0) & (along_ray < 1.0) & (along_segment >= 0.0) & (along_segment <= 1.0)


def test_parallel_rays_never_meet_the_line():
    along_ray, along_segment = crossing([0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0])
    assert np.isinf(along_ray)
    assert np.isinf(along_segment)
    assert not in_shadow([0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0])


@pytest.mark.slow
@given(vectors(2), vectors(2), segments(), st.floats(-np.pi, np.pi), vectors(2))
def test_shadows_turn_and_move_with_the_scene(origin, target, segment, angle, shift):
    start, end = segment
    assume(np.linalg.norm(target - origin) > 1e-2)  # shorter rays lose their direction in the sums of the move
    along_ray, along_segment = crossing(origin, target, start, end)
    clearance = [along_ray, 1 - along_ray, along_segment, 1 - along_segment]
    assume(np.isfinite(clearance).all() and np.abs(clearance).min() > 1e-6)
    moved = (turn(point, angle, shift) for point in (origin, target, start, end))
    assert in_shadow(*moved) == in_shadow(origin, target, start, end)


@pytest.mark.slow
@given(segments(), st.floats(0.05, 0.95), st.floats(0.1, 5.0), st.floats(0.1, 5.0))
def test_a_point_beyond_the_segment_is_in_its_shadow_and_one_before_it_is_not(segment, along, before, beyond):
    start, end = segment
    normal = segment_normal(start, end)
    middle = start + along * (end - start)
    origin = middle - before * normal
    assert in_shadow(origin, middle + beyond * normal, start, end)
    assert not in_shadow(origin, middle - 0.5 * before * normal, start, end)
    assert in_shadow(middle + beyond * normal, origin, start, end)


def test_a_point_beside_the_segment_is_not_in_its_shadow():
    seen = in_shadow([0.0, 0.0], [[0.0, 2.0], [0.9, 2.0], [2.1, 2.0], [0.0, 0.9]], [-1.0, 1.0], [1.0, 1.0])
    assert seen.tolist() == [True, True, False, False]


def test_the_identity_is_of_the_plan_unless_it_is_told_otherwise():
    places = np.array([[0.3, -1.2], [4.0, 0.0]])
    np.testing.assert_array_equal(Isometry.identity()(places), places)
    assert Isometry.identity(3).linear.shape == (3, 3)


def test_many_segments_have_a_normal_each():
    random = np.random.default_rng(0)
    start, end = random.normal(size=(2, 5, 2))
    normals = segment_normal(start, end)
    for normal, one, other in zip(normals, start, end, strict=True):
        np.testing.assert_array_equal(normal, segment_normal(one, other))
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0)
    np.testing.assert_allclose(np.einsum("nd,nd->n", normals, end - start), 0.0, atol=1e-12)


def test_a_ray_meets_a_line_where_it_should_and_one_that_runs_along_it_nowhere():
    """With steps of one, where a cross product of one must not be taken for parallel."""
    fractions = crossing([0.0, 0.0], [1.0, 0.0], [0.5, -0.25], [0.5, 0.75])
    assert fractions == (0.5, 0.25)
    assert crossing([0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [3.0, 0.0]) == (np.inf, np.inf)
    assert crossing([0.0, 0.0], [1.0, 0.0], [2.0, -1.0], [3.0, -1.0]) == (np.inf, np.inf)


def test_rays_meet_both_sides_of_a_circle_or_miss_it():
    """From 5 m before a circle of 3 m: through its middle, aside of it, and past it. The power of the origin is 4^2."""
    rays = np.array([[0.0, 1.0], [0.28, 0.96], [0.8, 0.6]])
    near, far = circle_crossings(np.array([0.0, -5.0]), rays, 3.0)
    assert_allclose(near + far, [10.0, 9.6, np.nan])
    assert_allclose(near * far, [16.0, 16.0, np.nan])
    assert near[0] == 2.0


def test_rays_of_any_length_meet_a_sphere_at_the_same_places():
    random = np.random.default_rng(0)
    offset, rays = np.array([0.2, -4.0, 0.5]), random.normal([0.0, 1.0, 0.0], 0.2, (200, 3))
    for t in circle_crossings(offset, rays, 1.5, np.sum(rays**2, axis=1)):
        met = np.isfinite(t)
        assert 20 < met.sum() < 200
        assert_allclose(np.linalg.norm(offset + t[met, None] * rays[met], axis=1), 1.5)
