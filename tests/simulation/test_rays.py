"""The ray solver against image sources and physical optics; its symmetries; what a user sees of it."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest
from floor_plans import ROUGH, busy_scene, make_scene, segment, wavenumber
from scipy.constants import speed_of_light

from mirrorfold.common.geometry import Isometry, reflect, segment_normal
from mirrorfold.errors import InputError
from mirrorfold.scenes.floor_plan import Scene, parse_scene
from mirrorfold.scenes.materials import coherent_factor, material
from mirrorfold.simulation import simulate
from mirrorfold.simulation.rays.sweep import scattered_field


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


@pytest.mark.slow
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


# Symmetries


@pytest.mark.slow
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


# What the user sees


@pytest.mark.slow
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
        ({"solver": "magic"}, "solver is 'magic', expected one of rays"),
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


def circle(radius: float, name: str, **kind: Any) -> dict[str, Any]:
    return {"name": name, "kind": "circle", "center": (0.0, 1.0), "radius": radius, **kind}


@pytest.mark.parametrize(
    "surfaces",
    [
        (segment((-1, 1), (1, 1.2)), segment((0, 1.1), (2, 1.3), name="b")),
        (segment((-1, 1), (1, 1.2)), segment((1, 1.2), (-1, 1), name="b")),
        (circle(0.2, "a"), circle(0.2, "b", kind="arc", start_angle=350, stop_angle=400)),
    ],
)
def test_surfaces_that_lie_on_one_another_are_refused_and_not_counted_twice(surfaces: Any) -> None:
    with pytest.raises(InputError, match="lie on one another"):
        simulate(make_scene(*surfaces))


def test_surfaces_that_meet_in_a_point_or_face_each_other_are_none_on_one_another() -> None:
    quarter = {"kind": "arc", "start_angle": 180, "stop_angle": 270}
    simulate(
        make_scene(
            segment((-1, 1), (0, 1.2)),
            segment((0, 1.2), (1, 1.4), name="b"),
            segment((0, 0.8), (0, 1.2), name="c"),
            circle(0.1, "d", **quarter),
            circle(0.1, "e", **{**quarter, "start_angle": 270, "stop_angle": 360}),
            circle(0.1, "f", **{**quarter, "start_angle": 0, "stop_angle": 180}),
        )
    )


def test_an_antenna_in_the_middle_of_a_circle_is_told_that_rays_do_not_tell_its_echo() -> None:
    around = {"name": "drum", "kind": "circle", "center": (0.0, 0.0), "radius": 1.0}
    with pytest.raises(
        InputError, match=r"antenna at \(0, 0\) m stands where a curved surface gathers all of its rays"
    ):
        simulate(make_scene(around, elements=5))


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
