"""Dielectric bodies and both polarizations in the full-wave solver: kernels, series, slabs, skeletons, scenes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from fullwave_scenes import ANTENNAS, SHAPES, TOP, WAVELENGTH, K, cylinder, distance, nodes_of, scene_of
from scipy.constants import epsilon_0
from scipy.special import hankel2

import mirrorfold as mf
from mirrorfold.common.slabs import slab
from mirrorfold.errors import InputError
from mirrorfold.scenes.floor_plan import Scene, parse_scene
from mirrorfold.scenes.materials import Dielectric
from mirrorfold.simulation import estimate
from mirrorfold.simulation.fullwave.boundaries import Boundaries
from mirrorfold.simulation.fullwave.checkpoint import fingerprint
from mirrorfold.simulation.fullwave.compression import MOST_UNKNOWNS, compress
from mirrorfold.simulation.fullwave.media import medium
from mirrorfold.simulation.fullwave.preparation import prepare
from mirrorfold.simulation.fullwave.solver import System, residual, scattered

LOSSY = 5.17 - 0.43j
"""Concrete at 300 GHz."""

POLARIZATIONS = pytest.mark.parametrize("polarization", ["TE", "TM"])


def substance(permittivity: complex) -> dict[str, float]:
    """The material of a scene file that has this permittivity at the top of the band."""
    eps = complex(permittivity)
    return {"permittivity": eps.real, "conductivity": -eps.imag * 2 * np.pi * TOP * epsilon_0}


def dielectric(permittivity: complex) -> Dielectric:
    values = substance(permittivity)
    return Dielectric(values["permittivity"], 0.0, values["conductivity"], 0.0)


def wall(length: float, thickness: float, permittivity: complex, polarization: str = "TE", **more: object) -> Scene:
    """A slab 5 cm before the array; lengths in wavelengths."""
    x = 0.5 * length * WAVELENGTH
    surface = {
        "kind": "segment",
        "start": [-x, 0.05],
        "end": [x, 0.05],
        "material": substance(permittivity),
        "thickness": thickness * WAVELENGTH,
        **more,
    }
    return replace(scene_of(surface), polarization=polarization)


def circle(radius: float) -> Scene:
    return scene_of({"kind": "circle", "center": [0.0, 0.02], "radius": radius})


def exact_block(equation: Boundaries, rows: np.ndarray, columns: np.ndarray, k: float, eps: complex) -> np.ndarray:
    """Waves of monopoles and dipoles at others, by numerical differentiation of nothing but H0^(2)."""
    inner, nodes = np.sqrt(complex(eps)) * k, equation.nodes
    step = 1e-3 / k

    def ends(unknown: int) -> list[tuple[complex, np.ndarray]]:
        place, normal = nodes.position[equation.node[unknown]], nodes.normal[equation.node[unknown]]
        if not equation.dipole[unknown]:
            return [(1.0, place)]
        return [(0.5 / (step * k), place + step * normal), (-0.5 / (step * k), place - step * normal)]

    out = np.zeros((len(rows), len(columns)), complex)
    for i, row in enumerate(rows):
        for j, column in enumerate(columns):
            b = 1.0 if equation.polarization == "TE" else eps
            weight = b ** (2 - int(equation.dipole[row]) - int(equation.dipole[column]))
            for w, p in ends(row):
                for v, q in ends(column):
                    r = np.linalg.norm(p - q)
                    out[i, j] += w * v * (hankel2(0, k * r) - weight * hankel2(0, inner * r))
    return out


# The equations and their quadrature


@pytest.mark.nojit
@POLARIZATIONS
@pytest.mark.parametrize("eps", [2.56, LOSSY])
def test_matrix_is_the_formula_away_from_the_diagonal_and_symmetric(polarization, eps):
    equation = Boundaries(nodes_of(circle(1e-3), 20), (dielectric(eps),), polarization)
    rows, columns = np.arange(0, 24, 5), np.arange(40, 70, 3)
    fast = equation.matrix(rows, columns, K)
    assert np.abs(fast - exact_block(equation, rows, columns, K, eps)).max() < 1e-4 * np.abs(fast).max()
    assert distance(equation.matrix(columns, rows, K).T, fast) < 1e-6


def test_waves_of_a_medium_that_absorbs():
    nodes = nodes_of(circle(3e-3), 12)
    equation = Boundaries(nodes, (dielectric(LOSSY),), "TE")
    points = np.array([[0.0, 0.02], [1e-3, 0.021], [0.0, 0.0228]])
    monopoles = np.flatnonzero(~equation.dipole)
    k = medium(K, LOSSY).k
    assert k.imag < 0
    r = np.linalg.norm(nodes.position[:, None] - points, axis=2)
    assert distance(equation.at_points(points, monopoles, K, body=0), -hankel2(0, k * r)) < 1e-5


RECEIVERS = np.array([[0.002, 0.001], [0.02, 0.03], [0.0, 0.04], [0.0, 0.018]])


def body_field(permittivity: complex | None, polarization: str, per_wavelength: float) -> np.ndarray:
    """Scattered by a cylinder, with nodes per wavelength inside."""
    index = 1.0 if permittivity is None else abs(np.sqrt(complex(permittivity)))
    filling = None if permittivity is None else dielectric(permittivity)
    equation = Boundaries(nodes_of(circle(1.5e-3), per_wavelength * index), (filling,), polarization)
    return scattered(System(equation, ANTENNAS, RECEIVERS, ()), K).T


@POLARIZATIONS
@pytest.mark.parametrize("eps", [None, 2.56, 5.79, LOSSY], ids=["conductor", "plasterboard", "glass", "concrete"])
def test_cylinder_series(eps, polarization):
    center = np.array([0.0, 0.02])
    series = cylinder(1.5e-3, center, ANTENNAS, RECEIVERS, permittivity=eps, polarization=polarization)
    coarse, fine = (distance(body_field(eps, polarization, n), series) for n in (8, 12))
    assert fine < 3e-4
    assert np.log(coarse / fine) / np.log(12 / 8) > 4.0


@POLARIZATIONS
def test_a_body_of_air_is_not_there(polarization):
    assert np.abs(body_field(1.0, polarization, 12)).max() < 1e-5


@pytest.mark.parametrize("name", ["strip", "arc"])
def test_edges_in_tm_converge(name):
    def field(per_wavelength: float) -> np.ndarray:
        equation = Boundaries(nodes_of(scene_of(SHAPES[name]), per_wavelength), (None,), "TM")
        return scattered(System(equation, ANTENNAS, ANTENNAS, ()), K)

    reference = field(36)
    assert distance(field(12), reference) < 3e-4
    assert distance(field(24), reference) < 1e-5


def test_slow_flow_through_a_slit_in_tm():
    # The potential of flow around a flat plate: f = sqrt(a^2 - x^2), whose Hadamard integral over 1 / r^2 is -pi.
    scene = scene_of({"kind": "segment", "start": [-1e-3, 0.0], "end": [1e-3, 0.0]})
    equation = Boundaries(nodes_of(scene, 12), (None,), "TM")
    everything, k = np.arange(equation.size), 10.0
    jump = np.sqrt(1e-6 - equation.nodes.position[:, 0] ** 2) * equation.nodes.weight
    assert np.abs(equation.matrix(everything, everything, k) @ jump * k**2 / -2j - 1).max() < 3e-4


@POLARIZATIONS
def test_a_mirror_reflects_h_as_it_is_and_e_reversed(polarization):
    scene = replace(scene_of({"kind": "segment", "start": [-0.1, 0.03], "end": [0.1, 0.03]}), polarization=polarization)
    s = scattered(prepare(scene), K)
    x = scene.array.tx_position[:, 0]
    image = hankel2(0, K * np.hypot(x[:, None] - x, 0.06))
    assert distance(s, image if polarization == "TM" else -image) < 0.03  # what the edges diffract


# Slabs


@pytest.mark.slow
@POLARIZATIONS
@pytest.mark.parametrize("angle", [0, 50])
def test_slab_reflects_and_transmits_as_the_closed_form(angle, polarization):
    """Beams of a slab of sources, received by beams of receivers, against the sum of plane waves that they are."""
    eps, thickness, far = 2.56 - 0.03j, 1.3 * WAVELENGTH, 15 * WAVELENGTH
    equation = prepare(wall(60, 1.3, eps, polarization)).equation
    x = (np.arange(41) - 20) * 0.5 * WAVELENGTH
    aside, tilt = far * np.tan(np.radians(angle)), K * np.sin(np.radians(angle))
    beam = np.exp(-((x / (4 * WAVELENGTH)) ** 2) - 1j * tilt * x)
    before, behind = 0.05 - thickness / 2 - far, 0.05 + thickness / 2 + far
    line = lambda along, y: np.stack([along + x, np.full(41, y)], axis=1)  # noqa: E731
    tx, reflected, through = line(-aside, before), line(aside, before), line(aside, behind)
    rx = np.concatenate([reflected, through])
    roots = compress(equation, np.concatenate([tx, rx]), k=K, tolerance=1.5e-4)
    s = scattered(System(equation, tx, rx, roots), K)
    straight = hankel2(0, K * np.linalg.norm(tx[:, None] - through, axis=2))
    sine = np.linspace(-1, 1, 20001)[1:-1]
    cosine = np.sqrt(1 - sine**2)
    coefficients = slab(eps, thickness, K, np.arcsin(sine), polarization)
    measured = [beam @ s[:, :41] @ beam.conj(), beam @ (s[:, 41:] + straight) @ beam.conj()]
    for got, place, coefficient, path in zip(
        measured, (reflected, through), coefficients, (2 * far, 2 * far + thickness), strict=True
    ):
        sent = beam @ np.exp(1j * K * np.outer(tx[:, 0], sine))
        heard = beam.conj() @ np.exp(-1j * K * np.outer(place[:, 0], sine))
        waves = coefficient * np.exp(-1j * K * cosine * path) / cosine
        expected = np.sum(sent * heard * waves) * (sine[1] - sine[0]) / np.pi
        assert abs(20 * np.log10(abs(got / expected))) < 0.01  # 0.05 was asked
        assert abs(np.angle(got / expected)) < 1e-3


def test_the_outline_of_a_slab_is_smooth_and_where_it_is_said_to_be():
    nodes = prepare(wall(20, 2.0, 2.56)).nodes
    x, y = nodes.position.T / WAVELENGTH
    assert max(abs(x)) == pytest.approx(10.0, abs=1e-2)
    assert max(y) - min(y) == pytest.approx(2.0, abs=1e-6)
    assert np.sum(nodes.curvature * nodes.weight) == pytest.approx(2 * np.pi, rel=1e-4)
    outward = nodes.normal[np.abs(x) < 8, 1] * np.sign(y[np.abs(x) < 8] - y.mean())
    assert np.all(outward > 0.999)
    assert np.abs(np.diff(nodes.curvature)).max() < 0.2 * nodes.curvature.max()


# Skeletons


@pytest.fixture(scope="module", params=["TE", "TM"])
def slab_and_strip(request) -> System:
    """A slab with a metal strip behind it."""
    scene = wall(60, 1.2, 2.56 - 0.05j, request.param)
    strip = {"kind": "segment", "start": [-0.006, 0.058], "end": [0.008, 0.06]}
    return prepare(replace(scene, surface=scene.surface + scene_of(strip | {"name": "strip"}).surface))


@pytest.mark.slow
def test_compressed_is_dense_to_the_tolerance_and_reciprocal(slab_and_strip):
    system = slab_and_strip
    assert max(len(group.children) for root in system.roots for group in root.walk()) > 1
    assert sum(len(root.skeleton) for root in system.roots) < system.equation.size / 15
    s = scattered(system, 0.97 * K)
    assert distance(s, scattered(replace(system, roots=()), 0.97 * K)) < 1e-3
    assert distance(s.T, s) < 1e-3
    assert residual(system, 0.97 * K, seed=0) < 2e-3


def test_a_foil_is_cut_into_groups_that_stay_small_and_give_the_dense_solution():
    # 8 nodes over 1/40 of a wavelength are 320 nodes per wavelength on either side.
    system = prepare(wall(3, 0.025, 2.56))
    leaves = [len(group.members) for root in system.roots for group in root.walk() if not group.children]
    assert len(leaves) > 4
    assert max(leaves) < 1.2 * MOST_UNKNOWNS
    s = scattered(system, K)
    assert distance(s, scattered(replace(system, roots=()), K)) < 1e-3


# Scenes


@pytest.mark.slow
def test_the_fields_meet_at_the_face_of_a_slab():
    scene = wall(12, 2.0, 2.56)
    face = 0.05 - WAVELENGTH
    steps = np.linspace(0.09, 0.19, 6)
    for polarization, eps in (("TE", 1.0), ("TM", 2.56)):
        y = np.concatenate([-steps, steps])
        at = ([0.0], face + y * WAVELENGTH)
        field = mf.near_field(replace(scene, polarization=polarization), TOP, at, tolerance=3e-5).values[:, 0]
        outside, inside = (np.polyfit(y[side], field[side], 5) for side in (slice(6), slice(6, 12)))
        assert abs(outside[-1] - inside[-1]) < 0.03 * np.abs(field).max()
        assert abs(outside[-2] - inside[-2] / eps) < 0.1 * abs(outside[-2])  # slopes, extrapolated


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*strong echoes")
def test_both_polarizations_in_one_sweep(tmp_path):
    scene = replace(wall(12, 1.0, 2.56), polarization="both")
    sweep = mf.simulate(scene, solver="fullwave", checkpoint=tmp_path / "results")
    assert sweep["s"].dims == ("polarization", "frequency", "tx", "rx")
    assert list(sweep["polarization"].values) == ["TE", "TM"]
    for polarization in ("TE", "TM"):
        field = scattered(prepare(replace(scene, polarization=polarization)), K)
        field = field * np.sqrt(0.5 * np.pi * K) * np.exp(-0.25j * np.pi)
        assert distance(sweep["s"].sel(polarization=polarization).values[-1], field) < 1e-4
    again = mf.simulate(scene, solver="fullwave", checkpoint=tmp_path / "results", resume=True)
    assert np.array_equal(again["s"], sweep["s"])
    cost = estimate(scene, solver="fullwave")
    assert cost.unknowns == prepare(replace(scene, polarization="TM")).equation.size


def test_results_of_another_polarization_or_material_are_not_resumed():
    frequency = np.array([TOP])
    prints = {
        fingerprint(prepare(wall(12, 1.0, eps, polarization)), frequency, direct=False)
        for eps, polarization in ((2.56, "TE"), (2.56, "TM"), (2.56 - 1e-3j, "TE"))
    }
    assert len(prints) == 3


@pytest.mark.parametrize(
    ("surface", "polarization", "message"),
    [
        ({"material": "glass"}, "TE", "of dielectrics segments with a thickness"),
        ({"material": "glass", "thickness": 0.03}, "TE", "must be longer than"),
        (
            {"material": "glass", "thickness": 0.012, "start": [-0.02, 0.003], "end": [0.02, 0.003]},
            "TE",
            "stands inside",
        ),
        (SHAPES["right angle"], "TM", "sharp vertices.*round them"),
    ],
)
def test_refuses(surface, polarization, message):
    plain = {"kind": "segment", "start": [-0.01, 0.05], "end": [0.01, 0.05]}
    with pytest.raises(InputError, match=message):
        prepare(
            replace(scene_of({**plain, **surface} if "kind" not in surface else surface), polarization=polarization)
        )


def test_refuses_what_lies_inside_a_slab():
    scene = wall(30, 8.0, 2.56)
    strip = scene_of({"kind": "segment", "start": [-0.002, 0.05], "end": [0.002, 0.05], "name": "strip"}).surface
    with pytest.raises(InputError, match=r"'strip' lies inside surface\[0\]"):
        prepare(replace(scene, surface=scene.surface + strip))


def test_a_scene_file_says_it_all():
    scene = parse_scene(
        {
            "name": "glass",
            "array": {"elements": 3, "pitch": 0.5e-3},
            "band": {"start": 290e9, "stop": TOP, "points": 2},
            "polarization": "TM",
            "surface": [
                {
                    "name": "pane",
                    "kind": "segment",
                    "start": [-0.01, 0.03],
                    "end": [0.01, 0.03],
                    "material": "glass",
                    "thickness": 2e-3,
                }
            ],
        }
    )
    system = prepare(scene)
    assert isinstance(system.equation, Boundaries)
    assert system.equation.size == 2 * system.nodes.size
