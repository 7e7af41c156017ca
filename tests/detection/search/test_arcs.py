"""Arcs as mirrors: their geometry against that of circles, their map against reflections, and how they are found."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from synthetic import radar_view

from mirrorfold.common.arcs import arc_through
from mirrorfold.common.geometry import Isometry, reflect, segment_normal
from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.image_echoes import find_ridges
from mirrorfold.detection.mirrors.arc_mirror import ArcMirror
from mirrorfold.detection.mirrors.curved import dimming
from mirrorfold.detection.mirrors.line_mirror import LineMirror
from mirrorfold.detection.mirrors.mirror import ChainFold, fold_of
from mirrorfold.detection.search.arcs import find_arcs
from mirrorfold.detection.views.image_view import ImageView

Array = NDArray[np.float64]


def arc_mirror(middle: tuple[float, float], radius: float, first: float, last: float) -> ArcMirror:
    """An arc seen from the origin, between two angles [degree]."""
    begin, end = np.radians([first, last])
    return ArcMirror(
        middle=np.array(middle), radius=radius, first=float(begin), span=float(end - begin), radar=np.zeros(2)
    )


PILLAR = arc_mirror((0.5, 1.4), 0.25, 170.0, 320.0)
BAY = arc_mirror((-0.4, 1.1), 1.2, -20.0, 40.0)


@pytest.mark.parametrize("arc", [PILLAR, BAY], ids=["convex", "concave"])
def test_map_is_the_law_of_reflection_at_the_place_that_is_met(arc: ArcMirror) -> None:
    along = np.linspace(0.1, 0.5, 9) * arc.length
    hit, normal = arc.at(along), arc.outward(along)
    before = np.linalg.norm(hit, axis=1)
    sight = hit / before[:, None]
    facing = np.sum(sight * normal, axis=1) * (1.0 if arc.convex else -1.0) < -0.1
    hit, normal, before, sight = (values[facing] for values in (hit, normal, before, sight))
    assert len(hit) >= 4
    out = sight - 2.0 * np.sum(sight * normal, axis=1)[:, None] * normal
    rest = 0.7
    image = (before + rest)[:, None] * sight
    np.testing.assert_allclose(fold_of([arc], 2)(image), hit + rest * out, atol=1e-12)


def test_width_of_the_pencil_is_the_derivative_of_the_map() -> None:
    for arc, image in ((PILLAR, np.array([0.55, 1.9])), (BAY, np.array([1.1, 2.0]))):
        fold = ChainFold([arc])
        range_ = np.linalg.norm(image)
        step = 1e-6 * np.array([-image[1], image[0]])
        moved = np.linalg.norm(fold(image + step) - fold(image - step)) / (2e-6 * range_)
        width, _ = arc.spread(image[None])
        # Along the arc of equal range the true place moves across the reflected ray by q for each radian.
        np.testing.assert_allclose(abs(width[0]), moved, rtol=1e-4)


def test_gently_curved_mirror_folds_as_the_flat_one() -> None:
    start, end = np.array([0.55, 1.9]), np.array([0.85, 0.9])
    line = LineMirror(start, end)
    normal = segment_normal(start, end)
    radius = 1e4
    middle = 0.5 * (start + end) - radius * normal * np.sign(-normal @ (0.5 * (start + end)))
    angle = np.sort(np.unwrap([np.arctan2(*(end_ - middle)[::-1]) for end_ in (start, end)]))
    arc = ArcMirror(middle=middle, radius=radius, first=float(angle[0]), span=float(np.ptp(angle)), radar=np.zeros(2))
    points = np.array([[1.2, 1.8], [1.5, 2.2], [1.0, 2.0]])
    np.testing.assert_allclose(fold_of([arc], 2)(points), line.reflection(points), atol=2e-4)
    np.testing.assert_allclose(dimming([arc], points), 1.0, atol=1e-3)


def test_flat_ways_stay_isometries_and_chains_with_arcs_meet_every_tangent() -> None:
    line = LineMirror(np.array([0.3, 0.8]), np.array([0.9, 0.6]))
    assert isinstance(fold_of([line, line], 2), Isometry)
    points = np.array([[0.62, 1.9], [0.6, 2.1]])
    hit, normal = PILLAR.facing(points)
    inner = np.array([reflect(p, h, n) for p, h, n in zip(points, hit, normal, strict=True)])
    np.testing.assert_allclose(fold_of([line, PILLAR], 2)(points), line.reflection(inner), atol=1e-12)


def test_caustic_is_where_the_pencil_has_no_width() -> None:
    sight = BAY.at(np.array([0.5 * BAY.length]))[0]
    before = float(np.linalg.norm(sight))
    cosine = abs(float(sight @ BAY.normal)) / before
    focus = 1.0 / (2.0 / (BAY.radius * cosine) - 1.0 / before)
    image = (before + focus) * sight / before
    width, _ = BAY.spread(np.stack([0.999 * image, image, 1.001 * image]))
    assert width[0] > 0.0 > width[2]
    assert abs(width[1]) < 1e-9


def speckled(surfaces: list[Array], view: ImageView, seed: int) -> tuple[ImageView, Echoes]:
    """The view of rough surfaces, each a row of points (n, 2) [m], and its echoes."""
    random = np.random.default_rng(seed)
    field = np.zeros((view.range.size, view.u.size), dtype=complex)
    for place in np.concatenate(surfaces):
        range_, u = view.to_polar(place)
        strength = random.standard_normal(2) @ [1.0, 1j]
        across = np.exp(-(((view.u - u) / (0.6 * view.u_cell)) ** 2))
        along = np.exp(-(((view.range - range_) / (0.6 * view.range_cell)) ** 2)) * np.exp(
            -2j * np.pi * 2.0 * (view.range - range_) / 1e-3
        )
        field += strength * along[:, None] * across[None]
    seen = replace(view, amplitude=np.abs(field))
    return seen, find_ridges(seen)


def empty_view() -> ImageView:
    return ImageView(
        radar=np.zeros(2),
        along=np.array([1.0, 0.0]),
        broadside=np.array([0.0, 1.0]),
        range=np.arange(0.3, 3.0, 0.01),
        u=np.arange(-0.9, 0.9, 0.0035),
        amplitude=np.empty((0, 0)),
        power=1.0,
        range_cell=0.03,
        u_cell=0.0107,
        aperture_tx=80.0,
        aperture_rx=80.0,
        wavelength=1e-3,
    )


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_rough_arcs_are_found_with_their_radius(seed: int) -> None:
    random = np.random.default_rng(100 + seed)
    convex = bool(seed % 2)
    radius = random.uniform(0.2, 0.4) if convex else random.uniform(1.0, 2.0)
    normal = np.array([np.cos(np.radians(215.0)), np.sin(np.radians(215.0))])
    face = np.array([0.6, 1.3])
    middle = face - radius * normal if convex else face + radius * normal
    half = 0.5 * min(1.0 / radius, 1.6)
    towards = np.radians(215.0) if convex else np.radians(35.0)
    angle = towards + np.linspace(-half, half, int(2 * half * radius / 2e-3))
    points = middle + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    view, echoes = speckled([points], empty_view(), seed)
    arcs = find_arcs(view, echoes)
    assert len(arcs) == 1
    assert arcs[0].convex == convex
    assert abs(arcs[0].radius / radius - 1.0) < 0.03
    assert np.linalg.norm(arcs[0].middle - middle) < 0.05 * radius


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("stray", "count"), [(0.0, 1), (0.01, 0)])
def test_rows_that_stray_to_either_side_are_no_arcs(stray: float, count: int, seed: int) -> None:
    """By a third of a resolution cell, as pieces of several things do that lie near a circle."""
    random, angle = np.random.default_rng(seed), np.radians(np.linspace(180.0, 320.0, 300))
    away = 0.25 + stray * np.sign(np.sin(14.0 * angle + seed))
    points = np.array([0.6, 1.3]) + away[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    strength = random.standard_normal(len(angle)) + 1j * random.standard_normal(len(angle))
    view = radar_view(points, strength, noise=0.02, seed=seed)
    assert len(find_arcs(view, find_ridges(view))) == count


@pytest.mark.slow
def test_gentle_arcs_are_found_whatever_their_speckle() -> None:
    """They bulge by 2 cm, hardly more than speckle makes their echoes stray, so that a kink fits nearly as well."""
    radius, length, found = 1.4, 0.45, 0
    for seed in range(12):
        random, convex = np.random.default_rng(seed), bool(seed % 2)
        towards = np.radians(215.0 if convex else 35.0)
        middle = np.array([0.6, 1.3]) - radius * np.array([np.cos(towards), np.sin(towards)])
        angle = towards + np.linspace(-0.5, 0.5, 225) * length / radius
        points = middle + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        strength = random.standard_normal(len(angle)) + 1j * random.standard_normal(len(angle))
        view = radar_view(points, strength, noise=0.02, seed=seed)
        arcs = find_arcs(view, find_ridges(view))
        found += len(arcs) == 1 and arcs[0].convex == convex and abs(arcs[0].radius / radius - 1.0) < 0.1
    assert found == 12


@pytest.mark.slow
def test_a_glint_does_not_cut_the_row_of_a_pillar() -> None:
    """The lobe of the glint of a smooth pillar is straight, and draws the row off the circle over two cells."""
    radius, nearest, found = 0.12, np.array([0.507, 0.862]), 0
    sight = nearest / np.linalg.norm(nearest)
    angle = np.arctan2(*-sight[::-1]) + np.radians(np.linspace(-75.0, 75.0, 314))
    outward = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    points = np.concatenate([nearest + radius * (sight + outward), nearest[None]])
    for seed in range(10):
        random = np.random.default_rng(seed)
        strength = (random.standard_normal(314) + 1j * random.standard_normal(314)) * np.sqrt(-outward @ sight)
        view = radar_view(points, np.append(strength, 300.0), noise=0.02, seed=seed)
        arcs = find_arcs(view, find_ridges(view))
        found += len(arcs) == 1 and arcs[0].length > 2.2 * radius and abs(arcs[0].radius / radius - 1.0) < 0.03
    assert found == 10


def coarse_view() -> ImageView:
    """As 4 GHz at 79 GHz and an array of 16 cm show a room."""
    return replace(
        empty_view(), range=np.arange(0.3, 3.0, 0.018), u=np.arange(-0.9, 0.9, 0.006), range_cell=0.074, u_cell=0.0202
    )


@pytest.mark.slow
def test_both_halves_of_an_s_are_found_in_coarse_cells() -> None:
    """Each bulges by half a cell, and none is known from its own echoes alone."""
    joint, along, found = np.array([0.62, 1.4]), np.linspace(0.0, 0.55, 275), 0
    way, square = np.array([-0.34, 0.94]), np.array([-0.94, -0.34])
    # Tangent to the direction `way` at the joint, one half bulges to either side.
    halves = [
        joint
        + side * radius * (np.sin(along / radius)[:, None] * way + (1.0 - np.cos(along / radius))[:, None] * square)
        for side, radius in ((1.0, 0.9), (-1.0, 0.7))
    ]
    for seed in range(6):
        arcs = find_arcs(*speckled(halves, coarse_view(), seed))
        found += sorted(arc.convex for arc in arcs) == [False, True]
    assert found >= 5


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
def test_straight_walls_are_no_arcs(seed: int) -> None:
    random = np.random.default_rng(seed)
    middle = np.array([random.uniform(-0.5, 0.5), random.uniform(1.0, 1.6)])
    direction = np.radians(random.uniform(-60.0, 60.0))
    half = 0.5 * random.uniform(0.6, 1.3) * np.array([np.cos(direction), np.sin(direction)])
    points = middle + np.linspace(-1.0, 1.0, 600)[:, None] * half
    view, echoes = speckled([points], empty_view(), seed)
    assert not find_arcs(view, echoes)


@pytest.mark.slow
@pytest.mark.parametrize("degrees", [8.0, 15.0, 25.0])
def test_two_walls_that_touch_are_no_arc(degrees: float) -> None:
    """As a screen and a wall do in the image, one seen in a mirror before the other."""
    corner, along = np.array([0.2, 1.3]), 0.3 * np.linspace(0.0, 1.0, 200)[:, None]
    for side in (1.0, -1.0):
        ways = (np.radians(side * degrees) * np.array([0.5, -0.5]) + [0.0, np.pi]) - 0.3
        legs = [corner + along * [np.cos(way), np.sin(way)] for way in ways]
        view, echoes = speckled(legs, empty_view(), 3)
        assert not find_arcs(view, echoes)


def test_drawn_arc_passes_its_three_points() -> None:
    start, middle, end = PILLAR.at(np.array([0.0, 0.5, 1.0]) * PILLAR.length)
    points = arc_through(start, middle, end)
    np.testing.assert_allclose(np.linalg.norm(points - PILLAR.middle, axis=1), PILLAR.radius, rtol=1e-9)
    np.testing.assert_allclose(points[[0, -1]], [start, end], atol=1e-9)
    assert np.linalg.norm(points - middle, axis=1).min() < 1e-9
    np.testing.assert_allclose(arc_through(start, 0.5 * (start + end), end), [start, end])


def test_files_of_mirrors_hold_arcs_beside_lines(tmp_path: Path) -> None:
    from mirrorfold.detection.mirrors.known_mirrors import known_mirrors, read_mirrors, write_mirrors

    start, through, end = BAY.at(np.array([0.0, 0.4, 1.0]) * BAY.length)
    text = json.dumps({"mirrors": [
        {"start": start.tolist(), "through": through.tolist(), "end": end.tolist()},
        {"start": [-0.8, 1.0], "end": [0.0, 1.1]},
    ]})  # fmt: skip
    (tmp_path / "mirrors.json").write_text(text, encoding="utf-8")
    places = read_mirrors(tmp_path / "mirrors.json")
    np.testing.assert_array_equal(read_mirrors(write_mirrors(places, tmp_path / "again.json")), places)
    view, echoes = speckled([BAY.at(np.linspace(0.0, BAY.length, 500))], empty_view(), 0)
    arc, line = known_mirrors(places, echoes, view)
    assert isinstance(arc, ArcMirror)
    assert isinstance(line, LineMirror)
    np.testing.assert_allclose(arc.radius, BAY.radius, rtol=1e-9)
    np.testing.assert_allclose(arc.middle, BAY.middle, atol=1e-9)
    assert not arc.convex
    assert arc.fill > 0.8
