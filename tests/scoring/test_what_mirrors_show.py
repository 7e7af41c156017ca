"""What a radar sees of a scene, directly and by way of its mirrors: the truth that scores are against."""

from __future__ import annotations

from functools import partial

import floor_plans
import numpy as np
import pytest
from floor_plans import HIDDEN, MIRROR, SCREEN, segment
from scipy.constants import speed_of_light

from mirrorfold.scenes.floor_plan import parse_scene
from mirrorfold.scenes.visibility import visible_truth
from mirrorfold.scoring import volumes

make_scene = partial(floor_plans.make_scene, band={"start": 290e9, "stop": 300e9, "points": 401})


def seen(scene, *, bounces=3):
    """Middle thirds of every surface: whether they are seen directly, and at all."""
    points, normals, owner = [], [], []
    for i, surface in enumerate(scene.surface):
        p, n, _ = surface.sample(0.002)
        part = slice(len(p) // 3, 2 * len(p) // 3)
        points.append(p[part])
        normals.append(n[part])
        owner.append(np.full(len(p[part]), i))
    points, normals, owner = map(np.concatenate, (points, normals, owner))
    direct, reachable = visible_truth(scene, points, normals, bounces=bounces)
    assert (direct <= reachable).all()
    return [(float(direct[owner == i].mean()), float(reachable[owner == i].mean())) for i in range(len(scene.surface))]


def test_what_a_screen_hides_is_seen_by_way_of_a_mirror():
    assert seen(make_scene(SCREEN, HIDDEN)) == [(1.0, 1.0), (0.0, 0.0)]
    assert seen(make_scene(SCREEN, MIRROR, HIDDEN)) == [(1.0, 1.0), (1.0, 1.0), (0.0, 1.0)]
    assert seen(make_scene(SCREEN, MIRROR, HIDDEN), bounces=0)[2] == (0.0, 0.0)


def test_a_mirror_shows_only_what_reflects_on_it():
    """The rays to x = 1.8, y = 1.6 to 1.8 m cross x = 0.8 at y = 0.71 to 0.8 m."""
    for end, share in ((0.68, 0.0), (0.84, 1.0)):
        assert seen(make_scene(SCREEN, segment((0.8, 0.5), (0.8, end)), HIDDEN))[2] == (0.0, share)
    half = seen(make_scene(SCREEN, segment((0.8, 0.5), (0.8, 1.7 / 1.8 * 0.8)), HIDDEN))[2]
    assert half == (0.0, pytest.approx(0.5, abs=0.04))
    # Nor with something standing in the way, before the mirror or behind it.
    for blocker in (segment((0.3, 0.2), (0.3, 0.6)), segment((0.3, 0.9), (0.3, 1.5))):
        assert seen(make_scene(SCREEN, MIRROR, HIDDEN, blocker), bounces=1)[2] == (0.0, 0.0)


def test_short_pieces_are_not_counted_on_as_mirrors_and_curved_ones_are():
    for start, share in ((0.68, 1.0), (0.7, 0.0)):
        assert seen(make_scene(SCREEN, segment((0.8, start), (0.8, 0.84)), HIDDEN))[2] == (0.0, share)
    curved = {"kind": "arc", "center": [20.8, 1.6], "radius": 20.0, "start_angle": 178.0, "stop_angle": 183.0}
    assert seen(make_scene(SCREEN, curved, HIDDEN))[2] == (0.0, 1.0)
    # Turned away, or behind the screen itself, the arc shows nothing.
    assert seen(make_scene(SCREEN, {**curved, "start_angle": 170.0, "stop_angle": 174.0}, HIDDEN))[2][1] == 0.0


@pytest.mark.parametrize(("radius", "share"), [(0.051, 1.0), (0.049, 0.0)])
def test_a_rod_is_no_mirror_and_a_pipe_is_one(radius, share):
    rod = {"kind": "circle", "center": [0.85, 0.75], "radius": radius}
    assert seen(make_scene(SCREEN, rod, HIDDEN))[2] == (0.0, share)


@pytest.mark.parametrize(("radius", "shown"), [(0.051, True), (0.049, False)])
def test_a_small_ball_is_no_mirror_and_a_larger_one_is(radius, shown):
    """It stands before the scanner, which sees the box aside in it alone."""
    metal = {"material": "pec", "diffuse_fraction": 0.0}
    ball = {"kind": "sphere", "center": [0.0, 2.0, 0.0], "radius": radius}
    box = {"kind": "box", "center": [1.0, 1.6, 0.0], "size": [0.2, 0.2, 0.2]}
    sides = {"start": -10.0, "stop": 10.0, "points": 21}
    scanner = {"azimuth": sides, "elevation": sides, "spot_radius": 0.01, "focus_distance": 2.0}
    surfaces = [{"name": name, **metal, **what} for name, what in (("ball", ball), ("box", box))]
    band = {"start": 280e9, "stop": 300e9, "points": 1001}
    scene = parse_scene({"name": "test", "dimensions": 3, "scanner": scanner, "band": band, "surface": surfaces})
    seen = volumes.truth(scene)
    of_box = seen.owner == 1
    assert of_box.any()
    assert not seen.direct[of_box].any()
    assert seen.reachable[of_box].any() == shown


def test_two_mirrors_show_what_one_does_not():
    """A periscope of two mirrors at 45 degrees, with walls all round what they show."""
    first, second = segment((-0.3, 0.9), (0.3, 1.5)), segment((0.9, 0.8), (1.5, 1.6))
    target = segment((1.1, 2.2), (1.3, 2.2))
    screens = segment((0.35, 0.2), (0.35, 0.9)), segment((0.75, 1.7), (0.75, 3.0))
    parts = (first, second, target, *screens)
    assert seen(make_scene(*parts), bounces=1)[2][1] == 0.0
    direct, reachable = seen(make_scene(*parts), bounces=2)[2]
    assert direct == 0.0
    assert reachable > 0.5


def test_a_surface_is_seen_from_both_sides():
    """Surfaces have no back: a screen's far side is seen in a mirror behind it."""
    forward, backward = segment((-0.2, 1.0), (0.2, 1.0)), segment((0.2, 1.0), (-0.2, 1.0))
    assert seen(make_scene(forward)) == seen(make_scene(backward)) == [(1.0, 1.0)]
    assert seen(make_scene(SCREEN, MIRROR, segment((-0.2, 1.8), (-0.2, 1.6))))[2] == (0.0, 1.0)


def test_nothing_is_seen_edge_on():
    assert seen(make_scene(segment((0.0, 1.0), (0.0, 1.5)))) == [(0.0, 0.0)]
    assert seen(make_scene(segment((0.0, 1.0), (0.3, 1.5)))) == [(1.0, 1.0)]


def test_nothing_is_seen_beyond_the_ambiguous_range():
    band = {"start": 290e9, "stop": 300e9, "points": 101}
    limit = speed_of_light * 100 / (2 * 10e9)
    assert limit == pytest.approx(1.499, abs=1e-3)
    near, far = segment((-0.1, 1.45), (0.1, 1.45)), segment((-0.1, 1.55), (0.1, 1.55))
    assert seen(make_scene(near, band=band)) == [(1.0, 1.0)]
    assert seen(make_scene(far, band=band)) == [(0.0, 0.0)]
    # The way by the mirror is 2.5 m long.
    assert seen(make_scene(SCREEN, MIRROR, HIDDEN, band=band))[2] == (0.0, 0.0)
