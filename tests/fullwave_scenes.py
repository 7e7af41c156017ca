"""Small scenes, and the slow solution in double precision, for the tests of the full-wave solver."""

from __future__ import annotations

import numpy as np
from scipy.constants import speed_of_light
from scipy.special import h2vp, hankel2, j0, jv, jvp, y0

from mirrorfold.scenes.floor_plan import Scene, parse_scene
from mirrorfold.simulation.fullwave.contours import contours
from mirrorfold.simulation.fullwave.discretisation import ZETA, Nodes, discretise

TOP = 300e9
WAVELENGTH = speed_of_light / TOP
K = 2 * np.pi / WAVELENGTH
WALL = {"rms_height": 0.05e-3, "correlation_length": 0.2e-3}
TARGET = {"rms_height": 0.10e-3, "correlation_length": 0.2e-3}
STRIP = {"kind": "segment", "start": [-0.01, 0.05], "end": [0.01, 0.055]}
ANTENNAS = np.stack([np.linspace(-4e-3, 4e-3, 9), np.zeros(9)], axis=1)

SHAPES = {
    "strip": {"kind": "segment", "start": [-0.004, 0.02], "end": [0.005, 0.022]},
    "right angle": {"kind": "polyline", "points": [[-0.004, 0.02], [0.0, 0.024], [0.005, 0.019]]},
    "sharp angle": {"kind": "polyline", "points": [[-0.004, 0.02], [0.0, 0.0205], [-0.004, 0.022]]},
    "triangle": {"kind": "polyline", "points": [[-0.002, 0.02], [0.002, 0.02], [0.0, 0.023], [-0.002, 0.02]]},
    "arc": {"kind": "arc", "center": [0.0, 0.02], "radius": 2e-3, "start_angle": 20, "stop_angle": 200},
}


def scene_of(*surfaces: dict, elements: int = 9, points: int = 3, pitch: float = 0.5e-3) -> Scene:
    named = [{"name": f"surface {index}", **surface} for index, surface in enumerate(surfaces)]
    return parse_scene(
        {
            "name": "test",
            "array": {"elements": elements, "pitch": pitch},
            "band": {"start": 290e9, "stop": TOP, "points": points},
            "surface": named,
        }
    )


def small_two_walls(scale: float, *, elements: int = 9, points: int = 3) -> Scene:
    """Two walls, a corner and an arc, the published experiment's ingredients, made smaller."""

    def at(*numbers: float) -> list[float]:
        return [scale * number for number in numbers]

    return scene_of(
        {"kind": "segment", "start": at(0.15, 1.0), "end": at(-0.8311, 1.1935), "roughness": WALL},
        {"kind": "segment", "start": at(0.5505, 1.8771), "end": at(0.8495, 0.9229), "roughness": WALL},
        {
            "kind": "polyline",
            "points": [at(-0.0509, 2.1685), at(-0.25, 2.15), at(-0.2315, 1.9509)],
            "roughness": TARGET,
        },
        {
            "kind": "arc",
            "center": at(-0.75, 1.75),
            "radius": 0.25 * scale,
            "start_angle": -70.896,
            "stop_angle": 43.696,
            "roughness": TARGET,
        },
        elements=elements,
        points=points,
    )


def nodes_of(scene: Scene, per_wavelength: float, seed: int = 0) -> Nodes:
    arms = contours(scene, seed=seed)
    return discretise(arms, wavelength=WAVELENGTH, per_wavelength=[per_wavelength] * len(arms))


def exact_matrix(nodes: Nodes, k: float) -> np.ndarray:
    """The matrix entry by entry, as the formulas read, in double precision."""
    a = np.empty((nodes.size, nodes.size), dtype=complex)
    for i in range(nodes.size):
        r = np.linalg.norm(nodes.position - nodes.position[i], axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            a[i] = j0(k * r) - 1j * y0(k * r)
        a[i, i] = 1 - 2j / np.pi * (np.log(k * nodes.weight[i] / (4 * np.pi)) + np.euler_gamma)
        a[i, i] += 2 * 2j / np.pi * ZETA
        for neighbour in (nodes.before[i], nodes.after[i]):
            if neighbour >= 0:
                a[i, neighbour] -= 2j / np.pi * ZETA * j0(k * r[neighbour])
    return a


def exact_field(nodes: Nodes, sources: np.ndarray, receivers: np.ndarray, k: float) -> np.ndarray:
    """Scattered field (receivers, sources) of sources ``H0^(2)(k r)`` by a dense solution in double precision."""

    def waves(targets: np.ndarray, points: np.ndarray) -> np.ndarray:
        x = k * np.linalg.norm(targets[:, None] - points, axis=2)
        return j0(x) - 1j * y0(x)

    currents = np.linalg.solve(exact_matrix(nodes, k), waves(nodes.position, sources))
    return -waves(receivers, nodes.position) @ currents


def distance(a: np.ndarray, b: np.ndarray) -> float:
    """Relative distance in the mean square."""
    return float(np.linalg.norm(a - b) / np.linalg.norm(b))


def cylinder(
    radius: float,
    center: np.ndarray,
    sources: np.ndarray,
    receivers: np.ndarray,
    *,
    permittivity: complex | None = None,
    polarization: str = "TE",
) -> np.ndarray:
    """Field scattered by a cylinder, of a conductor by default: Harrington, Time-Harmonic Electromagnetic Fields, 5-9.

    E along the axis in TE, H in TM.
    """
    order = np.arange(-60, 61)
    (rs, s), (rr, r) = (
        (np.linalg.norm(p - center, axis=1), np.arctan2(*(p - center).T[::-1])) for p in (sources, receivers)
    )
    x = K * radius
    j, h = jv(order, x), hankel2(order, x)
    dj, dh = jvp(order, x), h2vp(order, x)
    if permittivity is None:
        factor = -j / h if polarization == "TE" else -dj / dh
    else:
        index = np.sqrt(complex(permittivity))
        inner, slope = jv(order, index * x), jvp(order, index * x)
        slope = slope * (index if polarization == "TE" else 1 / index)
        factor = -(dj * inner - j * slope) / (dh * inner - h * slope)
    from_sources = hankel2(order, K * rs[:, None]) * np.exp(-1j * order * s[:, None])
    return (hankel2(order, K * rr[:, None]) * np.exp(1j * order * r[:, None]) * factor) @ from_sources.T
