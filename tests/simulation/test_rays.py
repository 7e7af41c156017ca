"""The ray solver against image sources, Lambert's law, physical optics, its own symmetries and a slow twin."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest
from scipy.constants import speed_of_light

from mirrorfold.common.geometry import Isometry, reflect, segment_normal
from mirrorfold.errors import InputError
from mirrorfold.scenes.floor_plan import Scene, parse_scene
from mirrorfold.scenes.materials import coherent_factor, material
from mirrorfold.simulation import simulate
from mirrorfold.simulation.rays.outline import Outline, outline
from mirrorfold.simulation.rays.scatterers import VOLUME_SHARE, DiffuseLaw, scatterers, specular_coefficient
from mirrorfold.simulation.rays.sweep import scattered_field

ROUGH = {"rms_height": 0.1e-3, "correlation_length": 0.2e-3}
BAND = {"start": 290e9, "stop": 300e9, "points": 5}


def make_scene(*surfaces: dict[str, Any], elements: int = 3, pitch: float = 0.5e-3, **entries: Any) -> Scene:
    """A scene of surfaces given as in a scene file, with an array at the origin unless told otherwise."""
    named = [{"name": f"surface {i}", **surface} for i, surface in enumerate(surfaces)]
    array = {"elements": elements, "pitch": pitch, **entries.pop("array", {})}
    return parse_scene({"name": "test", "array": array, "band": BAND, "surface": named, **entries})


def segment(start: tuple[float, float], end: tuple[float, float], **entries: Any) -> dict[str, Any]:
    return {"kind": "segment", "start": start, "end": end, **entries}


def wavenumber(scene: Scene) -> np.ndarray:
    return 2.0 * np.pi * scene.band.frequency / speed_of_light


def distances(points: np.ndarray, others: np.ndarray) -> np.ndarray:
    return np.linalg.norm(points[:, None] - others[None], axis=-1)


def optics(scene: Scene, bounces: int = 3) -> np.ndarray:
    """The sweep by geometrical optics alone, as if no mirror had ends that radiate."""
    return scattered_field(scene, bounces=bounces, seed=0, edges=False)


# Specular paths


@pytest.mark.nojit
@pytest.mark.parametrize("name", ["pec", "concrete"])
def test_smooth_wall_is_an_image_source(name: str) -> None:
    scene = make_scene(segment((-1.0, 1.2), (1.0, 0.9), material=name), elements=5, pitch=0.02)
    s = optics(scene)
    tx = scene.array.tx_position[:, :2]
    wall = np.array([[-1.0, 1.2], [1.0, 0.9]])
    normal = segment_normal(*wall)
    image = reflect(tx, wall[0], normal)
    d = distances(image, tx)
    cosine = np.abs((tx[None] - image[:, None]) @ normal) / d
    frequency = scene.band.frequency[:, None, None]
    expected = material(name).reflection(frequency, np.arccos(cosine)) / np.sqrt(d)
    expected = expected * np.exp(-1j * wavenumber(scene)[:, None, None] * d)
    np.testing.assert_allclose(s, expected, atol=2e-6)


def test_roughness_weakens_the_mirror_by_the_coherent_factor() -> None:
    wall = {"start": (-0.05, 1.0), "end": (0.05, 1.0)}
    rough = {"rms_height": 0.02e-3, "correlation_length": 0.5e-3}
    smooth = optics(make_scene(segment(**wall), elements=1))
    scene = make_scene(segment(**wall, roughness=rough), elements=1)
    # Without mirrors only the diffuse part is left.
    specular = optics(scene, bounces=1) - optics(scene, bounces=0)
    factor = coherent_factor(0.02e-3, scene.band.frequency, 0.0, correlation_length=0.5e-3)
    assert 0.96 < factor[0] < 0.99
    np.testing.assert_allclose(specular / smooth, factor[:, None, None], rtol=1e-5)


@pytest.mark.nojit
def test_path_over_three_mirrors_has_the_length_of_the_folded_path() -> None:
    loop = [
        segment((1.9, -0.1), (2.1, 0.1)),
        segment((1.9, 2.1), (2.1, 1.9)),
        segment((-0.1, 1.9), (0.1, 2.1)),
    ]
    scene = make_scene(*loop, elements=1, array={"rx": {"elements": 1, "pitch": 1e-3, "center": (0.0, 1.0)}})
    s = optics(scene, bounces=2)[:, 0, 0]
    np.testing.assert_allclose(s, -np.exp(-7j * wavenumber(scene)) / np.sqrt(7.0), atol=2e-6)
    assert not optics(scene, bounces=1).any()


@pytest.mark.nojit
def test_dihedral_corner_sends_everything_back_to_where_it_came_from() -> None:
    corner = {"kind": "polyline", "points": [(-0.3, 0.7), (0.0, 1.0), (0.3, 0.7)]}
    scene = make_scene(corner, elements=7, pitch=0.01)
    s = optics(scene)
    tx = scene.array.tx_position[:, :2]
    # The image of a point in a dihedral is the point beyond its vertex.
    d = distances(2.0 * np.array([0.0, 1.0]) - tx, tx)
    expected = np.exp(-1j * wavenumber(scene)[:, None, None] * d) / np.sqrt(d)
    # On the diagonal the path meets the vertex itself, where each order of reflection counts half.
    np.testing.assert_allclose(s, expected, atol=2e-6)


@pytest.mark.nojit
def test_blocker_removes_the_mirror_and_its_edge_falls_between_elements() -> None:
    wall = segment((-1.0, 2.0), (1.0, 2.0))
    scene = make_scene(wall, elements=21, pitch=0.01)
    clear = np.abs(optics(scene)[0])
    blocker = segment((0.0005, 1.0), (0.5, 1.1))
    half = np.abs(optics(make_scene(wall, blocker, elements=21, pitch=0.01))[0])
    assert np.all((half == 0.0) | np.isclose(half, clear, rtol=1e-6))
    x = scene.array.tx_position[:, 0]
    # Leg heights 0 -> 2 -> 0: the blocker's edge is met at half height on both ways.
    leg_out, leg_back = 0.75 * x[:, None] + 0.25 * x[None], 0.25 * x[:, None] + 0.75 * x[None]
    np.testing.assert_array_equal(half == 0.0, np.maximum(leg_out, leg_back) > 0.0005)


@pytest.mark.nojit
def test_collinear_walls_do_not_mirror_each_other() -> None:
    scene = make_scene(segment((-1.0, 1.0), (-0.1, 1.0)), segment((0.1, 1.0), (1.0, 1.0)), elements=3)
    assert not optics(scene).any()


# Glints


@pytest.mark.nojit
def test_circle_glint_follows_geometrical_optics() -> None:
    radius, distance = 0.1, 8.0
    scene = make_scene({"kind": "circle", "center": (0.0, distance + radius), "radius": radius}, elements=1)
    s = simulate(scene)["s"].values[:, 0, 0]
    expected = -np.exp(-2j * wavenumber(scene) * distance) / np.sqrt(2 * distance + 2 * distance**2 / radius)
    np.testing.assert_allclose(s, expected, rtol=1e-4)
    assert abs(np.abs(s[0]) * distance / np.sqrt(radius / 2) - 1.0) < 0.01


@pytest.mark.filterwarnings("ignore:Neighbouring antennas stand")
@pytest.mark.parametrize(
    ("center", "radius", "side"),
    [((0.1, 1.5), 0.5, -90.0), ((0.02, -0.1), 1.0, 90.0), ((0.0, 0.5), 0.5, 90.0)],
    ids=["convex", "concave before the caustic", "concave behind the caustic"],
)
def test_arc_glint_agrees_with_physical_optics(center: tuple[float, float], radius: float, side: float) -> None:
    arc = {"kind": "arc", "center": center, "radius": radius, "start_angle": side - 55, "stop_angle": side + 55}
    scene = make_scene(arc, elements=2, pitch=0.04)
    angle = np.radians(side) + np.linspace(-1.0, 1.0, 40001) * np.radians(55)
    points = np.array(center) + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    normal = (points - center) / radius
    tx = scene.array.tx_position[:, :2]
    # A taper keeps the ends of the arc, which geometrical optics does not know, out of the integral.
    taper = np.cos(0.5 * np.pi * np.linspace(-1.0, 1.0, angle.size)) ** 0.1
    reference = np.empty((2, 2), complex)
    k = wavenumber(scene)[0]
    for n, m in itertools.product(range(2), repeat=2):
        to_tx, to_rx = np.linalg.norm(points - tx[n], axis=1), np.linalg.norm(points - tx[m], axis=1)
        cosine = np.abs(np.einsum("pi,pi->p", points - tx[n], normal)) / to_tx
        integrand = -taper * cosine * np.exp(-1j * k * (to_tx + to_rx)) / np.sqrt(to_tx * to_rx)
        reference[n, m] = np.trapezoid(integrand, angle * radius) * np.sqrt(k / (2 * np.pi)) * np.exp(0.25j * np.pi)
    np.testing.assert_allclose(simulate(scene)["s"].values[0], reference, rtol=0.03)


def test_focus_of_a_concave_arc_is_limited_by_its_aperture() -> None:
    radius, degrees = 1.0, 20.0
    arc = {"kind": "arc", "center": (0.0, 2e-4), "radius": radius}
    scene = make_scene({**arc, "start_angle": 90 - degrees, "stop_angle": 90 + degrees}, elements=1)
    width = 2 * np.radians(degrees) * radius
    # Next to the center, all of the arc adds in phase.
    expected = np.sqrt(wavenumber(scene) / (2 * np.pi)) * width / radius
    np.testing.assert_allclose(np.abs(simulate(scene)["s"].values[:, 0, 0]), expected, rtol=1e-3)


@pytest.mark.nojit
def test_glint_seen_in_a_mirror_is_the_glint_of_the_mirrored_circle() -> None:
    wall = segment((1.0, -1.0), (1.0, 3.0))
    hidden = {"kind": "circle", "center": (-0.5, 2.0), "radius": 0.2}
    screen = segment((-0.6, 1.0), (-0.05, 1.0))
    # By way of one mirror alone: over more, the circle is a mirror itself that shows the back of the screen.
    seen = simulate(make_scene(wall, hidden, screen, elements=4, pitch=0.01), bounces=1)["s"].values
    direct = simulate(make_scene({**hidden, "center": (2.5, 2.0)}, elements=4, pitch=0.01))["s"].values
    plain = simulate(make_scene(wall, screen, elements=4, pitch=0.01), bounces=1)["s"].values
    np.testing.assert_allclose(seen - plain, direct, atol=2e-6)


# Diffuse scattering


@pytest.mark.nojit
def test_single_scatterer_has_the_two_way_amplitude_and_phase() -> None:
    scene = make_scene(segment((-0.0001, 1.0), (0.0001, 1.0), roughness=ROUGH), elements=4, pitch=0.01)
    bare = make_scene(segment((-0.0001, 1.0), (0.0001, 1.0)), elements=4, pitch=0.01)
    s = scattered_field(scene, bounces=0, seed=3)
    rough = scatterers(scene, outline(scene), spacing=1e-3, seed=3)
    below = rough.points.normal[:, 1] < 0.0
    assert below.sum() == 1
    offset = rough.points.position[below][0] - scene.array.tx_position[:, :2]
    d = np.linalg.norm(offset, axis=1)
    one_way = np.exp(-1j * wavenumber(scene)[:, None] * d) / np.sqrt(d)
    one_way = one_way * rough.weight[below][0] * rough.laws[0].factor(scene.band.frequency[:, None], offset[:, 1] / d)
    expected = one_way[:, :, None] * one_way[:, None, :]
    np.testing.assert_allclose(s, expected, rtol=1e-4)
    assert not scattered_field(bare, bounces=0, seed=3).any()


@pytest.mark.parametrize("rms_height", [0.01e-3, 0.1e-3, 1e-3])
@pytest.mark.parametrize("inside", [False, True])
def test_scattered_power_is_what_the_specular_beam_has_lost(rms_height: float, inside: bool) -> None:
    rough = {"rms_height": rms_height, "correlation_length": 0.5e-3}
    scene = make_scene(segment((0, 1), (1, 1), material="plasterboard", roughness=rough, volume_depth=0.01))
    law = DiffuseLaw(scene.surface[0], inside=inside)
    frequency = np.array([[300e9]])
    incidence = np.radians([0.0, 20.0, 50.0, 75.0])
    scattered = np.radians(np.linspace(-90.0, 90.0, 4001))
    one_way, other_way = law.factor(frequency, np.cos(incidence))[0], law.factor(frequency, np.cos(scattered))[0]
    power = np.trapezoid((one_way[:, None] * other_way) ** 2, scattered, axis=1)
    smooth = np.abs(material("plasterboard").reflection(300e9, incidence)) ** 2
    lost = smooth - np.abs(specular_coefficient(scene.surface[0], 300e9, np.cos(incidence))) ** 2
    np.testing.assert_allclose(power, np.cos(incidence) * (VOLUME_SHARE * (1 - smooth) if inside else lost), rtol=1e-3)


@pytest.mark.slow
def test_receivers_around_a_rough_wall_collect_the_power_it_lost() -> None:
    length, height = 0.2, 4.0
    wall = segment((-length / 2, 0.0), (length / 2, 0.0), roughness=ROUGH)
    receivers = {"elements": 1200, "pitch": 0.01, "center": (0.0, -0.5)}
    scene = make_scene(wall, elements=1, array={"center": (0.0, -height), "rx": receivers})
    rx = scene.array.rx_position[:, :2]
    collected = 0.0
    for seed in range(20):
        s = scattered_field(scene, bounces=0, seed=seed)
        flux = np.mean(np.abs(s[:, 0]) ** 2, axis=0) * 0.5 / np.linalg.norm(rx, axis=1)
        collected += np.sum(flux) * 0.01 / 20
    lost = 1.0 - coherent_factor(0.1e-3, 295e9, 0.0, correlation_length=0.2e-3) ** 2
    # The receivers span +-85 degrees; 4000 Gaussian strengths leave a deviation of 2 percent.
    assert collected == pytest.approx(lost * length / height, rel=0.06)


@pytest.mark.slow
def test_mean_power_does_not_depend_on_the_density_of_scatterers() -> None:
    scene = make_scene(segment((-0.2, 1.0), (0.2, 1.3), roughness=ROUGH), elements=8, pitch=0.02)

    def power(spacing: float) -> float:
        runs = [scattered_field(scene, bounces=0, seed=n, spacing=spacing) for n in range(40)]
        return float(np.mean(np.abs(runs) ** 2))

    assert power(0.5e-3) == pytest.approx(power(4e-3), rel=0.15)


def test_nothing_passes_through_a_wall_that_is_rough_on_both_sides() -> None:
    wall = segment((-2.0, 1.0), (2.0, 1.0), roughness=ROUGH)
    behind = {"center": (0.0, 2.0), "rx": {"elements": 2, "pitch": 0.1, "center": (0.0, 0.0)}}
    # A mirror on each side lets image paths arrive there too.
    mirrors = [segment((1.5, -1.0), (1.5, 0.9)), segment((1.5, 1.1), (1.5, 3.0))]
    assert not scattered_field(make_scene(wall, *mirrors, elements=2, array=behind), bounces=2, seed=0).any()


@pytest.mark.slow
def test_inside_of_a_wall_returns_after_its_face_and_more() -> None:
    depth = 0.03
    wall = segment((-0.05, 1.0), (0.05, 1.0), material="plasterboard", volume_depth=depth)
    band = {"start": 270e9, "stop": 300e9, "points": 401}
    array = {"center": (-0.8, 0.0)}
    profiles = {}
    for name, surface in (("inside", wall), ("face", {**wall, "volume_depth": 0.0, "roughness": ROUGH})):
        runs = [
            scattered_field(make_scene(surface, elements=1, array=array, band=band), bounces=1, seed=n)
            for n in range(8)
        ]
        profiles[name] = np.mean([np.abs(np.fft.ifft(s[:, 0, 0])) ** 2 for s in runs], axis=0)
    one_way_range = np.arange(401) * speed_of_light / 2 / (30e9 * 401 / 400)
    last_of_face = np.hypot(0.85, 1.0)
    late = (one_way_range > last_of_face + 0.006) & (one_way_range < last_of_face + 0.05)
    assert profiles["inside"].sum() > 2 * profiles["face"].sum()
    assert profiles["inside"][late].sum() > 5 * profiles["face"][late].sum()
    with pytest.raises(InputError, match="no wave enters"):
        simulate(make_scene({**wall, "material": "pec"}))


# Symmetries


def busy_scene(move: Isometry | None = None, rx: dict[str, Any] | None = None, **entries: Any) -> Scene:
    """Walls, a corner and an arc, moved by a rotation and a shift."""
    move = move or Isometry.identity()
    turn = np.degrees(np.arctan2(move.linear[1, 0], move.linear[0, 0]))

    def at(*point: float) -> tuple[float, float]:
        x, y = move(np.array(point))
        return float(x), float(y)

    rough = {"rms_height": 0.5e-3, "correlation_length": 2e-3}
    surfaces = [
        segment(at(0.8, 0.2), at(0.9, 2.6), roughness=rough, material="concrete"),
        segment(at(-0.7, 0.9), at(0.1, 1.0), roughness=rough),
        {"kind": "polyline", "points": [at(-0.35, 1.7), at(-0.6, 1.65), at(-0.55, 1.4)], "roughness": rough},
        {"kind": "arc", "center": at(0.2, 2.2), "radius": 0.2, "start_angle": -120 + turn, "stop_angle": 40 + turn},
        segment(at(-0.9, 0.1), at(-1.0, 1.2), material="plasterboard", volume_depth=0.02),
    ]
    surfaces[3]["roughness"] = rough
    array = {"center": at(0, 0), "direction": tuple(move.linear @ [1.0, 0.0]), "rx": rx}
    band = {"start": 30e9, "stop": 31e9, "points": 6}
    return make_scene(*surfaces, pitch=0.03, array=array, band=band, **entries)


@pytest.mark.filterwarnings("ignore:Neighbouring antennas stand")
def test_sweep_is_reciprocal() -> None:
    s = simulate(busy_scene(elements=9))["s"].values
    assert np.abs(s - s.transpose(0, 2, 1)).max() < 1e-6 * np.abs(s).max()
    apart = {"elements": 4, "pitch": 0.02, "center": (0.2, -0.1)}
    other = {"elements": 5, "pitch": 0.03, "center": (-0.2, 0.1), "direction": (1.0, 0.2)}
    surfaces = [
        segment((0.8, 0.2), (0.9, 2.6), roughness=ROUGH),
        {"kind": "circle", "center": (-0.2, 1.5), "radius": 0.2, "roughness": ROUGH},
    ]
    there = simulate(make_scene(*surfaces, array={**apart, "rx": other}))["s"].values
    back = simulate(make_scene(*surfaces, array={**other, "rx": apart}))["s"].values
    np.testing.assert_allclose(there, back.transpose(0, 2, 1), atol=1e-5 * np.abs(there).max())


@pytest.mark.slow
def test_moving_the_whole_world_changes_nothing() -> None:
    angle = 0.7
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    here = simulate(busy_scene(elements=5))["s"].values
    there = simulate(busy_scene(Isometry(turn, np.array([3.0, -2.0])), elements=5))["s"].values
    np.testing.assert_allclose(there, here, atol=1e-5 * np.abs(here).max())


@pytest.mark.slow
def test_seed_makes_the_speckle_reproducible() -> None:
    scene = busy_scene(elements=3)
    first, again, other = (simulate(scene, seed=n, snr_db=20.0)["s"].values for n in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert np.abs(first - other).max() > 0.01 * np.abs(first).max()


# The slow twin


def twin_crossings(p: np.ndarray, q: np.ndarray, world: Outline, obstacle: int) -> int:
    """How often the way p -> q crosses an obstacle away from its ends."""
    ray = q - p
    length = np.linalg.norm(ray)
    if obstacle < len(world.facets):
        start, end = world.facets[obstacle]
        matrix = np.stack([ray, start - end], axis=1)
        if np.linalg.det(matrix) == 0.0:
            return 0
        t, u = np.linalg.solve(matrix, start - p)
        return int(1e-6 < t * length < length - 1e-6 and 0.0 <= u <= 1.0)
    x, y, radius, first, span = world.arcs[obstacle - len(world.facets)]
    offset = p - [x, y]
    count = 0
    for t in np.roots([ray @ ray, 2 * ray @ offset, offset @ offset - radius**2]):
        if np.isreal(t) and 1e-6 < t.real * length < length - 1e-6:
            hit = offset + t.real * ray
            count += (np.arctan2(hit[1], hit[0]) - first) % (2 * np.pi) <= span
    return count


def twin_path(antenna, point, chain, world, through=-1):
    """Length, cosines at the mirrors, the last leg's other end; None where the point is not seen."""
    images = [antenna]
    for facet in chain:
        images.append(reflect(images[-1], world.facets[facet][0], segment_normal(*world.facets[facet])))
    corners, cosines = [point], []
    for facet, image in zip(reversed(chain), reversed(images), strict=False):
        start, end = world.facets[facet]
        matrix = np.stack([image - corners[-1], start - end], axis=1)
        if np.linalg.det(matrix) == 0.0:
            return None
        t, u = np.linalg.solve(matrix, start - corners[-1])
        if not (1e-9 < t < 1 and 0 <= u <= 1):
            return None
        ray = image - corners[-1]
        cosines.insert(0, abs(ray @ segment_normal(start, end)) / np.linalg.norm(ray))
        corners.append(corners[-1] + t * ray)
    corners.append(antenna)
    for leg, (p, q) in enumerate(itertools.pairwise(corners)):
        for obstacle in range(len(world.surface)):
            inside = leg == 0 and obstacle == through
            if twin_crossings(p, q, world, obstacle) != inside:
                return None
    return np.linalg.norm(images[-1] - point), cosines, corners[1]


def twin_chains(facets: int, longest: int):
    for count in range(longest + 1):
        for chain in itertools.product(range(facets), repeat=count):
            if all(a != b for a, b in itertools.pairwise(chain)):
                yield chain


def twin_reflection(scene, world, chain, cosines, frequency):
    product = 1.0 + 0.0j
    for facet, cosine in zip(chain, cosines, strict=True):
        product = product * specular_coefficient(scene.surface[world.surface[facet]], frequency, cosine)
    return product


def twin_glints(scene, world, arc_index, tx, rx, chains, frequency):
    """Glints of one arc between two antennas, from a dense scan of the path length."""
    arc = world.arcs[arc_index]
    surface = scene.surface[world.surface[len(world.facets) + arc_index]]
    k = 2 * np.pi * frequency / speed_of_light
    total = 0.0

    def image(antenna, chain):
        for facet in chain:
            antenna = reflect(antenna, world.facets[facet][0], segment_normal(*world.facets[facet]))
        return antenna

    def at(angle):
        return arc[:2] + arc[2] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)

    for out, back in itertools.product(chains, repeat=2):
        a, b = image(tx, out), image(rx, back)

        def length(angle, a=a, b=b):
            return np.linalg.norm(at(angle) - a, axis=-1) + np.linalg.norm(at(angle) - b, axis=-1)

        angles = np.linspace(arc[3], arc[3] + arc[4], 3001)
        values = length(angles)
        step = angles[1] - angles[0]
        turns = np.flatnonzero(np.diff(values)[:-1] * np.diff(values)[1:] <= 0.0) + 1
        for i in turns:
            curvature = values[i + 1] - 2 * values[i] + values[i - 1]
            angle = angles[i] - step * 0.5 * (values[i + 1] - values[i - 1]) / curvature
            point, outward = at(angle), np.array([np.cos(angle), np.sin(angle)])
            if ((a - point) @ outward) * ((b - point) @ outward) <= 0.0:
                continue
            one, two = twin_path(tx, point, out, world), twin_path(rx, point, back, world)
            if one is None or two is None:
                continue
            cosine = abs((a - point) @ outward) / one[0]
            bend = np.sign((a - point) @ outward)
            q = one[0] + two[0] + bend * 2 * one[0] * two[0] / (arc[2] * cosine)
            limit = np.sqrt(k / (2 * np.pi)) * cosine * arc[2] * arc[4] / np.sqrt(one[0] * two[0])
            total = total + (
                twin_reflection(scene, world, out, one[1], frequency)
                * twin_reflection(scene, world, back, two[1], frequency)
                * specular_coefficient(surface, frequency, cosine)
                * min(1 / np.sqrt(abs(q)), limit.min())
                * (1j if q < 0 else 1)
                * np.exp(-1j * k * (one[0] + two[0]))
            )
    return total


def twin_field(scene: Scene, *, bounces: int, seed: int, spacing: float) -> np.ndarray:
    """The scattered field path by path in float64, with every amplitude evaluated at every frequency."""
    world = outline(scene)
    frequency = scene.band.frequency
    k = wavenumber(scene)
    tx, rx = scene.array.tx_position[:, :2], scene.array.rx_position[:, :2]
    rough = scatterers(scene, world, spacing=spacing, seed=seed)
    one_way = np.zeros((frequency.size, len(tx) + len(rx), len(rough.weight)), complex)
    near = list(twin_chains(len(world.facets), bounces))
    both = np.concatenate([tx, rx])
    for (n, antenna), (p, point) in itertools.product(enumerate(both), enumerate(rough.points.position)):
        for chain in near:
            path = twin_path(antenna, point, chain, world, rough.points.through[p])
            if path is None or (path[2] - point) @ rough.points.normal[p] <= 0.0:
                continue
            cosine = (path[2] - point) @ rough.points.normal[p] / np.linalg.norm(path[2] - point)
            factor = rough.laws[rough.law[p]].factor(frequency[:, None], np.array([cosine]))[:, 0] * rough.weight[p]
            reflection = twin_reflection(scene, world, chain, path[1], frequency)
            one_way[:, n, p] += factor * reflection * np.exp(-1j * k * path[0]) / np.sqrt(path[0])
    s = one_way[:, : len(tx)] @ one_way[:, len(tx) :].transpose(0, 2, 1)
    for (n, sender), (m, receiver) in itertools.product(enumerate(tx), enumerate(rx)):
        for chain in twin_chains(len(world.facets), 2 * bounces):
            path = twin_path(sender, receiver, chain, world) if chain else None
            if path is not None:
                reflection = twin_reflection(scene, world, chain, path[1], frequency)
                s[:, n, m] += reflection * np.exp(-1j * k * path[0]) / np.sqrt(path[0])
        for arc in range(len(world.arcs)):
            s[:, n, m] += twin_glints(scene, world, arc, sender, receiver, near, frequency)
    return s


@pytest.mark.slow
@pytest.mark.parametrize(("bounces", "spacing"), [(1, 0.04), (2, 0.1)])
def test_agrees_with_the_slow_twin(bounces: int, spacing: float) -> None:
    # Apart from the transmitters, because their own paths in a corner all meet its vertex, which the twin cannot judge.
    scene = busy_scene(elements=2, rx={"elements": 2, "pitch": 0.013, "center": (0.021, 0.004)})
    fast = scattered_field(scene, bounces=bounces, seed=5, spacing=spacing, edges=False, curved=False)
    slow = twin_field(scene, bounces=bounces, seed=5, spacing=spacing)
    assert np.abs(fast - slow).max() < 1e-5 * np.abs(slow).max()


@pytest.mark.slow
def test_phasors_stay_exact_over_many_frequencies() -> None:
    band = {"start": 270e9, "stop": 300e9, "points": 401}
    rough = {"rms_height": 0.05e-3, "correlation_length": 0.2e-3}
    scene = make_scene(segment((-0.01, 3.0), (0.01, 3.0), roughness=rough), elements=2, pitch=0.1, band=band)
    fast = scattered_field(scene, bounces=1, seed=0, spacing=4e-3, edges=False)
    slow = twin_field(scene, bounces=1, seed=0, spacing=4e-3)
    # Most of it is the interpolation of amplitudes over this band of 10 percent.
    assert np.abs(fast - slow).max() < 2e-5 * np.abs(slow).max()


# What the user sees


def test_sweep_keeps_the_contract_and_reports_progress() -> None:
    scene = busy_scene(elements=4)
    calls: list[tuple[int, int]] = []
    sweep = simulate(scene, seed=7, snr_db=10.0, progress=lambda done, total: calls.append((done, total)))
    assert sweep["s"].dims == ("frequency", "tx", "rx")
    assert sweep["s"].dtype == np.complex64
    np.testing.assert_array_equal(sweep["frequency"], scene.band.frequency)
    np.testing.assert_array_equal(sweep["rx_position"], scene.array.rx_position)
    assert sweep.attrs["title"] == "test"
    assert (sweep.attrs["solver"], sweep.attrs["bounces"], sweep.attrs["seed"]) == ("rays", 3, 7)
    assert sweep.attrs["snr_db"] == 10.0
    assert calls[-1] == (6, 6)


@pytest.mark.slow
def test_inside_of_a_closed_room_with_a_circle() -> None:
    corners = [(-1.0, -0.5), (1.1, -0.5), (1.1, 2.0), (-1.0, 2.0), (-1.0, -0.5)]
    room = {"kind": "polyline", "points": corners}
    pillar = {"kind": "circle", "center": (0.3, 1.0), "radius": 0.15, "roughness": ROUGH}
    s = simulate(make_scene(room, pillar), bounces=3)["s"].values
    assert np.isfinite(s).all()
    assert np.abs(s).max() > 0.1


def test_empty_scene_is_noise_or_refused() -> None:
    scene = make_scene(elements=20, band={"start": 290e9, "stop": 300e9, "points": 101})
    s = simulate(scene, snr_db=0.0, seed=1)["s"].values
    assert np.mean(np.abs(s) ** 2) == pytest.approx(1.0, rel=0.02)
    assert abs(np.mean(s)) < 0.02
    with pytest.raises(InputError, match="it has no surfaces"):
        simulate(scene)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"solver": "magic"}, "solver is 'magic', expected one of: rays"),
        ({"bounces": -1}, "bounces is -1"),
        ({"bounces": 1.5}, "bounces is 1.5"),
        ({"seed": -3}, "seed is -3"),
        ({"snr_db": float("nan")}, "snr_db is nan"),
    ],
)
def test_wrong_arguments_are_named(arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        simulate(make_scene(segment((-1, 1), (1, 1))), **arguments)


def test_antennas_outside_the_plane_are_refused() -> None:
    with pytest.raises(InputError, match=r"z = 0\.5 m"):
        simulate(make_scene(segment((-1, 1), (1, 1)), array={"center": (0.0, 0.0, 0.5)}))


# Materials


@pytest.mark.parametrize(
    ("name", "normal_db", "oblique_db"),
    [("concrete", -8.2, -5.9), ("plasterboard", -12.7, -9.3), ("glass", -7.7, -5.5), ("wood", -16.5, -12.4)],
)
def test_building_materials_reflect_as_recommended(name: str, normal_db: float, oblique_db: float) -> None:
    reflection = material(name).reflection(285e9, np.radians([0.0, 45.0, 90.0]))
    np.testing.assert_allclose(20 * np.log10(np.abs(reflection)), [normal_db, oblique_db, 0.0], atol=0.06)


def test_fine_roughness_weakens_a_mirror_less_than_coarse_roughness() -> None:
    angle = np.radians([0.0, 30.0, 60.0])
    ament = coherent_factor(0.05e-3, 300e9, angle)
    np.testing.assert_allclose(coherent_factor(0.05e-3, 300e9, angle, correlation_length=15e-3), ament, rtol=1e-3)
    fine = coherent_factor(0.05e-3, 300e9, angle, correlation_length=0.2e-3)
    assert np.log(fine[0]) / np.log(ament[0]) == pytest.approx(0.5, abs=0.03)
    # Heights without any correlation scatter into evanescent waves alone.
    np.testing.assert_allclose(coherent_factor(0.05e-3, 300e9, angle, correlation_length=1e-9), 1.0, atol=1e-4)


@pytest.mark.parametrize("end", [-0.02, 0.0, 0.015, 0.1])
def test_a_mirror_that_ends_returns_what_physical_optics_gives(end):
    start, stop = np.array([-0.5, 1.0]), np.array([end, 1.1])
    scene = parse_scene(
        {
            "name": "half a mirror",
            "array": {"elements": 9, "pitch": 5e-3},
            "band": {"start": 290e9, "stop": 300e9, "points": 11},
            "surface": [{"name": "mirror", "kind": "segment", "start": list(start), "end": list(stop)}],
        }
    )
    s = simulate(scene)["s"].values
    antenna = scene.array.tx_position[[2, 6], :2]
    length = np.linalg.norm(stop - start)
    normal = np.array([start[1] - stop[1], stop[0] - start[0]]) / length
    share = (np.arange(100_000) + 0.5) / 100_000
    place = start + share[:, None] * (stop - start)
    distance = np.linalg.norm(place - antenna[:, None], axis=-1)
    cosine = np.abs((place - antenna[:, None]) @ normal) / distance
    for m in (0, 10):
        k = 2.0 * np.pi * scene.band.frequency[m] / speed_of_light
        wave = cosine.mean(axis=0) * np.exp(-1j * k * distance.sum(axis=0)) / np.sqrt(distance.prod(axis=0))
        integral = -np.sqrt(0.5j * k / np.pi) * wave.sum() * length / share.size
        assert abs(s[m, 2, 6] - integral) <= 3e-3 * abs(integral)
