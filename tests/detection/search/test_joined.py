"""Two arcs that pass into each other, fitted as one smooth curve: closer to the truth than each fitted by itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from synthetic import WAVELENGTH, empty_view

from mirrorfold.common.geometry import turned
from mirrorfold.detection.mirrors.arc_mirror import ArcMirror
from mirrorfold.detection.search.circles import fitted_circle
from mirrorfold.detection.search.joined import beside, fitted_together

VIEW = replace(empty_view(), wavelength=WAVELENGTH)

JOINT, HEADING, LENGTH, RADII = np.array([0.7, 1.4]), np.radians(115.0), 0.5, (0.9, 1.1)


def s_wall(seed, *, kink=0.0, turn=0.0, shift=0.0):
    """The halves of an S, each fitted by itself to places that stray by a millimetre, and these places.

    The second half leaves the first with a kink [rad]. All may be turned and shifted along the floor plan.
    """
    random, halves, measured = np.random.default_rng(seed), [], []
    for sign, radius, bend in ((-1.0, RADII[0], kink), (1.0, RADII[1], 0.0)):
        heading = HEADING + bend + turn
        along = np.array([np.cos(heading), np.sin(heading)])
        middle = JOINT + shift - sign * radius * turned(along)  # one half convex, one concave
        towards = np.arctan2(*(JOINT + shift - middle)[::-1])
        last = towards - LENGTH / radius  # both go on clockwise, seen from either middle, as their ends lie apart
        arc = ArcMirror(middle=middle, radius=radius, first=last, span=LENGTH / radius, radar=np.zeros(2))
        place = np.linspace(0.03, 0.97, 120) * LENGTH
        # The places of a resolution cell share their speckle.
        stray = np.repeat(random.normal(0.0, 1e-3, 24), 5)
        points = arc.at(place) + stray[:, None] * arc.outward(place)
        center, size = fitted_circle(points, np.ones(120), arc.middle, arc.radius)
        circle = replace(arc, middle=center, radius=size)
        halves.append(circle.part(*np.sort(circle.along(arc.ends)).tolist()))
        measured.append((points, np.ones(120)))
    return tuple(halves), tuple(measured)


def test_distances_from_a_smooth_curve_are_those_from_its_circles():
    curve = np.array([*JOINT, HEADING, -1.0 / 0.9, 1.0 / 1.1])
    along = np.array([np.cos(HEADING), np.sin(HEADING)])
    points = JOINT + np.array([[-0.3], [-0.1], [0.2]]) * along + 0.02 * turned(along)
    for i, radius in ((slice(0, 2), -0.9), (slice(2, 3), 1.1)):
        middle = JOINT + radius * turned(along)
        expected = np.sign(radius) * (abs(radius) - np.linalg.norm(points[i] - middle, axis=1))
        np.testing.assert_allclose(beside(curve, points)[i], expected, atol=1e-12)
    flat = np.array([*JOINT, HEADING, 0.0, 0.0])
    np.testing.assert_allclose(beside(flat, points), 0.02, atol=1e-12)


@pytest.mark.slow
def test_halves_share_their_joint_and_tangent_and_are_closer_to_the_truth():
    apart, together = [], []
    for seed in range(60):
        halves, measured = s_wall(seed)
        found = fitted_together(halves, measured, VIEW)
        assert found is not None
        ends = np.linalg.norm(found[0].ends[:, None] - found[1].ends[None], axis=2)
        assert ends.min() < 1e-9
        i, j = np.unravel_index(ends.argmin(), (2, 2))
        tangents = [turned((arc.ends[end] - arc.middle) / arc.radius) for arc, end in zip(found, (i, j), strict=True)]
        assert abs(tangents[0] @ tangents[1]) == pytest.approx(1.0, abs=1e-9)
        for errors, arcs in ((apart, halves), (together, found)):
            assert [arc.convex for arc in arcs] == [False, True]
            errors.append([true / arc.radius - 1.0 for true, arc in zip(RADII, arcs, strict=True)])
    assert np.sqrt(np.mean(np.square(together))) < 0.9 * np.sqrt(np.mean(np.square(apart)))


@pytest.mark.slow
def test_standard_errors_are_those_of_many_draws():
    off = []
    for seed in range(60):
        found = fitted_together(*s_wall(seed), VIEW)
        off += [(1.0 / arc.radius - 1.0 / true) / arc.curvature_error for arc, true in zip(found, RADII, strict=True)]
    assert 0.6 < np.sqrt(np.mean(np.square(off))) < 2.0


def test_walls_that_meet_with_a_kink_are_no_smooth_curve():
    assert fitted_together(*s_wall(0, kink=np.radians(15.0)), VIEW) is None


def test_a_curve_that_is_turned_and_shifted_is_the_same_curve():
    first, second = (fitted_together(*s_wall(1, **moved), VIEW) for moved in ({}, {"turn": 0.3, "shift": 0.2}))
    for one, other in zip(first, second, strict=True):
        assert one.radius == pytest.approx(other.radius, rel=1e-4)


def test_points_of_one_half_alone_tell_nothing_of_the_other():
    halves, (first, _) = s_wall(0)
    assert fitted_together(halves, (first, first), VIEW) is None
