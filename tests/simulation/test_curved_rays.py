"""Rays over arcs against image sources, Fermat's principle, physical optics, reciprocity and the full-wave solver."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from floor_plans import make_scene, segment
from numpy.typing import NDArray
from scipy.constants import speed_of_light

from mirrorfold.errors import InputError
from mirrorfold.simulation import simulate
from mirrorfold.simulation.rays.curved import CurvedChain, CurvedPaths, trace_curved
from mirrorfold.simulation.rays.outline import Outline, outline_of
from mirrorfold.simulation.rays.paths import Points

Array = NDArray[np.float64]


def arc(center: tuple[float, float], radius: float, middle: float, half: float) -> dict[str, Any]:
    """An arc by its middle and half its span [degree]."""
    angles = {"start_angle": middle - half, "stop_angle": middle + half}
    return {"kind": "arc", "center": center, "radius": radius, **angles}


def outline_with(*surfaces: dict[str, Any]) -> Outline:
    return outline_of(make_scene(*surfaces))


def traced(
    outline: Outline, mirrors_and_sides: tuple[tuple[int, int], ...], antenna: Array, point: Array
) -> CurvedPaths:
    return trace_curved(
        CurvedChain(mirrors_and_sides, np.atleast_2d(antenna), outline), Points.free(np.atleast_2d(point))
    )


def on_arc(surface: dict[str, Any], count: int) -> tuple[Array, Array, float]:
    """Points on an arc, their outward normals and the step [m]."""
    angle = np.radians(np.linspace(surface["start_angle"], surface["stop_angle"], count))
    outward = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return np.array(surface["center"]) + surface["radius"] * outward, outward, surface["radius"] * (angle[1] - angle[0])


def test_convex_path_is_the_shortest_one_and_spreads_as_geometrical_optics_says() -> None:
    pillar = arc((0.2, 1.3), 0.2, -90.0, 90.0)
    a, p = np.array([0.0, 0.0]), np.array([0.9, 0.6])
    paths = traced(outline_with(pillar), ((0, 1),), a, p)
    points, outward, _ = on_arc(pillar, 400001)
    to_a, to_p = (np.linalg.norm(points - end, axis=1) for end in (a, p))
    best = int(np.argmin(to_a + to_p))
    assert paths.length.size == 1
    np.testing.assert_allclose(paths.length[0], (to_a + to_p)[best], rtol=1e-10)
    cosine = float((a - points[best]) @ outward[best]) / to_a[best]
    np.testing.assert_allclose(paths.cosine[0, 0], cosine, rtol=1e-4)
    expected = to_a[best] + to_p[best] + 2.0 * to_a[best] * to_p[best] / (0.2 * cosine)
    np.testing.assert_allclose(paths.spreading[0], expected, rtol=1e-4)
    assert paths.caustics[0] == 0


@pytest.mark.slow
def test_concave_paths_are_all_stationary_ones() -> None:
    # Behind the caustic of a wide arc, a point is seen more than once.
    bay = arc((0.0, 0.0), 1.0, 90.0, 80.0)
    outline, a = outline_with(bay), np.array([-0.2, -0.3])
    points, _, _ = on_arc(bay, 200_001)
    random = np.random.default_rng(1)
    numbers = []
    for p in random.uniform([-0.6, -0.5], [0.6, 0.5], (40, 2)):
        paths = traced(outline, ((0, -1),), a, p)
        length = np.linalg.norm(points - a, axis=1) + np.linalg.norm(points - p, axis=1)
        turns = np.flatnonzero(np.diff(np.sign(np.diff(length)))) + 1
        np.testing.assert_allclose(np.sort(paths.length), np.sort(length[turns]), rtol=1e-9)
        # A path is longest, seen along the arc, behind one caustic, and shortest before it.
        longest = length[turns] > length[np.maximum(turns - 1, 0)]
        assert int(paths.caustics.sum()) == np.count_nonzero(longest)
        numbers.append(len(turns))
    assert {0, 1, 2} <= set(numbers)


@pytest.mark.parametrize("seed", range(6))
def test_paths_over_flat_and_curved_mirrors_are_reciprocal_and_stationary(seed: int) -> None:
    random = np.random.default_rng(seed)
    pillar = arc((0.6 + random.uniform(-0.1, 0.1), 1.3), random.uniform(0.05, 0.4), 200.0, 89.0)
    wall = {"kind": "segment", "start": (-0.8, 0.3), "end": (-0.9 + random.uniform(-0.1, 0.1), 2.9)}
    other = arc((-0.2, 2.6), random.uniform(0.05, 0.2), -70.0, 89.0)
    outline = outline_with(wall, pillar, other)
    a, p = np.array([0.0, 0.0]), np.array([random.uniform(-0.5, 0.3), random.uniform(1.6, 2.0)])
    found = 0
    for mirrors_and_sides in (
        ((1, 1), (0, 0)),
        ((0, 0), (1, 1)),
        ((1, 1), (2, 1)),
        ((2, 1), (1, 1)),
        ((1, 1), (0, 0), (2, 1)),
    ):
        there = traced(outline, mirrors_and_sides, a, p)
        back = traced(outline, mirrors_and_sides[::-1], p, a)
        assert there.length.size == back.length.size <= 1
        if there.length.size:
            np.testing.assert_allclose(there.length, back.length, rtol=1e-12)
            np.testing.assert_allclose(there.spreading, back.spreading, rtol=1e-6)
            np.testing.assert_allclose(there.cosine[:, 0], back.cosine[::-1, 0], rtol=1e-6)
            found += 1
    assert found >= 2


def test_gently_curved_mirror_is_a_flat_one() -> None:
    target = {"kind": "segment", "start": (-0.601, 1.2), "end": (-0.599, 1.2)}
    rough = {"roughness": {"rms_height": 0.1e-3, "correlation_length": 0.2e-3}}
    screen = {"kind": "segment", "start": (-0.5, 0.7), "end": (-0.25, 0.85)}
    radius = 1e5
    wall = arc((0.7 + radius, 1.0), radius, 180.0, float(np.degrees(0.8 / radius)))
    flat = {"kind": "segment", "start": (0.7, 0.2), "end": (0.7, 1.8)}
    sweeps = [
        simulate(make_scene({**target, **rough}, screen, mirror), bounces=1)["s"].values for mirror in (wall, flat)
    ]
    alone = [simulate(make_scene(screen, mirror), bounces=1)["s"].values for mirror in (wall, flat)]
    ghosts = [sweep - rest for sweep, rest in zip(sweeps, alone, strict=True)]
    assert np.abs(ghosts[1]).max() > 1e-4
    # The sagitta is 3 um, a hundredth of a wavelength: some degrees of phase over both ways.
    assert np.abs(ghosts[0] - ghosts[1]).max() < 0.15 * np.abs(ghosts[1]).max()


@pytest.mark.parametrize("distance", [0.2, 0.42, 0.9, 1.6], ids=["near", "before", "behind", "far"])
def test_field_of_a_concave_mirror_is_that_of_physical_optics(distance: float) -> None:
    bay = arc((0.0, 0.0), 1.0, 90.0, 50.0)
    a = np.array([-0.3, -0.4])
    hit = np.array([0.0, 1.0])
    way = (hit - a) / np.linalg.norm(hit - a)
    p = hit + distance * way * [1.0, -1.0]
    paths = traced(outline_with(bay), ((0, -1),), a, p)
    wavelength = 1e-3
    k = 2.0 * np.pi / wavelength
    points, outward, step = on_arc(bay, 400001)
    to_a, to_p = (np.linalg.norm(points - end, axis=1) for end in (a, p))
    cosine = np.abs(np.sum((points - a) * outward, axis=1)) / to_a
    taper = np.cos(0.5 * np.pi * np.linspace(-1.0, 1.0, to_a.size)) ** 0.1
    integrand = taper * cosine * np.exp(-1j * k * (to_a + to_p)) / np.sqrt(to_a * to_p)
    expected = integrand.sum() * step * np.sqrt(k / (2.0 * np.pi)) * np.exp(0.25j * np.pi)
    field = np.sum(paths.spread(np.array([[wavelength]]))[0] * np.exp(-1j * k * paths.length))
    assert abs(field - expected) < 0.05 * abs(expected)


@pytest.mark.slow
def test_field_where_two_paths_meet_stays_finite() -> None:
    # Seen askew, the caustic is a fold: at it both paths are limited by Airy's integral.
    bay = arc((0.0, 0.0), 1.0, 90.0, 60.0)
    outline, a = outline_with(bay), np.array([-0.6, 0.1])
    hit = np.array([np.sin(0.2), np.cos(0.2)])
    way = (hit - a) / np.linalg.norm(hit - a)
    out = way - 2.0 * (way @ hit) * hit
    to_a, cosine = float(np.linalg.norm(hit - a)), float(way @ hit)
    focus = 1.0 / (2.0 / cosine - 1.0 / to_a)
    wavelength = 1e-3
    k = 2.0 * np.pi / wavelength
    points, outward, step = on_arc(bay, 400001)
    taper = np.cos(0.5 * np.pi * np.linspace(-1.0, 1.0, len(points))) ** 0.1
    levels = []
    for distance in (0.97 * focus, 0.999 * focus, 1.001 * focus, 1.03 * focus):
        p = hit + distance * out
        paths = traced(outline, ((0, -1),), a, p)
        to_points = [np.linalg.norm(points - end, axis=1) for end in (a, p)]
        incidence = np.sum((points - a) * outward, axis=1) / to_points[0]
        integrand = taper * incidence * np.exp(-1j * k * sum(to_points)) / np.sqrt(to_points[0] * to_points[1])
        expected = integrand.sum() * step * np.sqrt(k / (2.0 * np.pi)) * np.exp(0.25j * np.pi)
        field = np.sum(paths.spread(np.array([[wavelength]]))[0] * np.exp(-1j * k * paths.length))
        levels.append(20.0 * np.log10(abs(field) / abs(expected)))
    # On the dark side the wave fades within some wavelengths, where geometrical optics has none of it.
    assert np.abs(levels).max() < 4.0


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*strong echoes come from")
@pytest.mark.parametrize("radius", [0.1, 0.2])
def test_ghost_in_a_pillar_is_that_of_full_waves(radius: float) -> None:
    center = np.array([0.25, 1.0])
    normal = np.array([np.cos(np.radians(215.0)), np.sin(np.radians(215.0))])
    hit = center + radius * normal
    way = hit / np.linalg.norm(hit)
    out = way - 2.0 * (way @ normal) * normal
    across, middle = np.array([-out[1], out[0]]), hit + 0.6 * out
    strip = {"start": tuple(middle - 0.15 * across), "end": tuple(middle + 0.15 * across)}
    scene = make_scene(
        {"kind": "circle", "center": tuple(center), "radius": radius},
        {"kind": "segment", **strip},
        elements=2,
        pitch=10e-3,
        band={"start": 46e9, "stop": 54e9, "points": 81},
    )
    length = 2.0 * (float(np.linalg.norm(hit)) + 0.6)
    k = 2.0 * np.pi * scene.band.frequency / speed_of_light
    window = np.hanning(k.size + 2)[1:-1] / np.hanning(k.size + 2).sum()
    path = length + np.linspace(-0.05, 0.05, 1001)
    focus = window[:, None] * np.exp(1j * np.outer(k, path))
    rays, waves = (
        np.einsum("fnm,fp->nmp", simulate(scene, **options)["s"].values, focus)
        for options in ({"bounces": 2}, {"solver": "fullwave"})
    )
    for n, m in ((0, 0), (0, 1), (1, 1)):
        peak = np.abs(rays[n, m]).argmax()
        ratio = rays[n, m, peak] / waves[n, m, peak]
        assert abs(20.0 * np.log10(abs(ratio))) < 0.5
        assert abs(np.degrees(np.angle(ratio))) < 5.0
        assert abs(path[peak] - path[np.abs(waves[n, m]).argmax()]) < 2e-3


def test_an_arc_may_turn_its_outer_side_to_some_of_the_antennas_only() -> None:
    # The circle of the arc passes through the middle of the array: half of the antennas lie inside of it.
    scene = make_scene(arc((-0.5, 0.0), 0.5, 20.0, 18.0), segment((0.4, 0.1), (0.4, 1.0)), elements=41)
    s = simulate(scene)["s"].values
    assert np.isfinite(s).all()
    np.testing.assert_allclose(s, s.transpose(0, 2, 1), atol=1e-6 * np.abs(s).max())


@pytest.mark.parametrize("seed", range(8))
def test_sweeps_of_arcs_and_circles_are_reciprocal(seed: int) -> None:
    random = np.random.default_rng(seed)
    found = 0
    for _ in range(5):
        surfaces = []
        # The circles do not overlap.
        for kind, x in zip(random.permutation(["arc", "arc", "circle", "circle"]), (-0.5, 0.0, 0.5), strict=False):
            center, radius = (x + random.uniform(-0.1, 0.1), random.uniform(0.5, 1.6)), random.uniform(0.03, 0.15)
            surfaces.append({"kind": "circle", "center": center, "radius": radius})
            if kind == "arc":
                radius, middle = random.uniform(0.2, 2.0), random.uniform(0.0, 2.0 * np.pi)
                center = (center[0] - radius * np.cos(middle), center[1] - radius * np.sin(middle))
                surfaces[-1] = arc(center, radius, np.degrees(middle), random.uniform(10.0, 60.0))
        scene = make_scene(*surfaces, elements=5, pitch=5e-3, band={"start": 28e9, "stop": 30e9, "points": 2})
        try:
            s = simulate(scene, bounces=2)["s"].values
        except InputError:  # an antenna sees nothing, or stands within a surface
            continue
        np.testing.assert_allclose(s, s.transpose(0, 2, 1), rtol=0.0, atol=1e-5 * np.abs(s).max())
        found += 1
    assert found >= 3
