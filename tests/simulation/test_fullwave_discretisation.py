"""The discretised integral equation against exact series, refined references and known statistics."""

from __future__ import annotations

import numpy as np
import pytest
from fullwave_scenes import (
    ANTENNAS,
    SHAPES,
    TARGET,
    WALL,
    WAVELENGTH,
    K,
    cylinder,
    distance,
    exact_field,
    exact_matrix,
    nodes_of,
    scene_of,
)
from scipy.stats import kurtosis, skew

from mirrorfold.errors import InputError
from mirrorfold.scenes.surfaces import Roughness
from mirrorfold.simulation.fullwave.discretisation import matrix
from mirrorfold.simulation.fullwave.roughness import rough_heights


def test_cylinder_series_and_order_of_convergence():
    center = np.array([0.0, 0.02])
    circle = scene_of({"kind": "circle", "center": list(center), "radius": 3e-3})
    receivers = np.array([[0.002, 0.001], [0.02, 0.03], [0.0, 0.04], [0.0, 0.0165]])
    reference = cylinder(3e-3, center, ANTENNAS, receivers)
    error = {
        density: distance(exact_field(nodes_of(circle, density), ANTENNAS, receivers, K), reference)
        for density in (8, 12, 16)
    }
    assert error[12] < 1e-4
    order = np.log(error[8] / error[16]) / np.log(2.0)
    assert 4.5 < order < 6.0


@pytest.mark.parametrize("name", SHAPES)
def test_edges_and_vertices_converge(name):
    scene = scene_of(SHAPES[name])
    reference = exact_field(nodes_of(scene, 48), ANTENNAS, ANTENNAS, K)
    coarse, fine = (
        distance(exact_field(nodes_of(scene, density), ANTENNAS, ANTENNAS, K), reference) for density in (12, 24)
    )
    assert coarse < 3e-4
    assert fine < min(2e-5, coarse / 4)


def test_polyline_without_a_bend_is_a_segment():
    bent = scene_of({"kind": "polyline", "points": [[-0.004, 0.02], [0.0, 0.021], [0.004, 0.022]]})
    straight = scene_of({"kind": "segment", "start": [-0.004, 0.02], "end": [0.004, 0.022]})
    np.testing.assert_allclose(nodes_of(bent, 12).position, nodes_of(straight, 12).position, atol=1e-12)


def test_curve_through_points_of_a_circle_is_that_circle():
    angle = np.linspace(0, 2 * np.pi, 65)
    points = np.stack([3e-3 * np.cos(angle), 0.02 + 3e-3 * np.sin(angle)], axis=1)
    points[-1] = points[0]
    spline = scene_of({"kind": "curve", "points": points.tolist()})
    reference = cylinder(3e-3, np.array([0.0, 0.02]), ANTENNAS, ANTENNAS)
    assert distance(exact_field(nodes_of(spline, 14), ANTENNAS, ANTENNAS, K), reference) < 2e-4


@pytest.mark.nojit
@pytest.mark.parametrize(
    "surface",
    [SHAPES["strip"], {**SHAPES["strip"], "roughness": WALL, "end": [0.008, 0.022]}, SHAPES["right angle"]],
    ids=["strip", "rough", "polyline"],
)
def test_fast_matrix_is_the_formula_and_symmetric(surface):
    nodes = nodes_of(scene_of(surface), 12)
    everything = np.arange(nodes.size)
    fast = matrix(nodes, everything, everything, K)
    np.testing.assert_allclose(fast, exact_matrix(nodes, K), rtol=2e-6)
    np.testing.assert_array_equal(fast, fast.T)
    some, others = everything[5:40:3], everything[::-2]
    np.testing.assert_array_equal(matrix(nodes, some, others, K), fast[np.ix_(some, others)])


def test_weights_add_up_to_the_length_and_grow_with_roughness():
    smooth = {"kind": "segment", "start": [0.0, 0.05], "end": [0.04, 0.05]}
    assert nodes_of(scene_of(smooth), 12).weight.sum() == pytest.approx(0.04, rel=1e-4)
    rough = nodes_of(scene_of({**smooth, "roughness": TARGET}), 16).weight.sum()
    # Mean of sqrt(1 + slope^2) for normal slopes of rms sqrt(2) h / L.
    slope = np.sqrt(2) * 0.5 * np.random.default_rng(0).standard_normal(200_000)
    assert rough / 0.04 == pytest.approx(np.sqrt(1 + slope**2).mean(), rel=0.03)


def test_rough_surface_converges():
    scene = scene_of({"kind": "segment", "start": [-0.006, 0.03], "end": [0.006, 0.032], "roughness": TARGET})
    reference = exact_field(nodes_of(scene, 32), ANTENNAS, ANTENNAS, K)
    coarse, fine = (
        distance(exact_field(nodes_of(scene, density), ANTENNAS, ANTENNAS, K), reference) for density in (11, 22)
    )
    assert coarse < 1e-2
    assert fine < coarse / 10


# What roughness is


def profile(seed: int, length: float = 0.4, periodic: bool = False) -> tuple[np.ndarray, np.ndarray]:
    return rough_heights(length, Roughness(**WALL), generator=np.random.default_rng(seed), periodic=periodic)


def test_heights_have_the_statistics_asked_for():
    distances, heights = profile(3)
    step = distances[1]
    rms, correlation = WALL["rms_height"], WALL["correlation_length"]
    assert heights.std() == pytest.approx(rms, rel=0.04)  # 1600 independent heights
    for lag in (0.5, 1.0, 1.5, 3.0):
        shift = round(lag * correlation / step)
        covariance = np.mean(heights[shift:] * heights[:-shift]) / rms**2
        assert covariance == pytest.approx(np.exp(-((shift * step / correlation) ** 2)), abs=0.08)
    independent = heights[:: round(2 * correlation / step)] / rms
    assert abs(skew(independent)) < 0.25
    assert abs(kurtosis(independent)) < 0.5
    slope = np.gradient(heights, step).std()
    assert slope == pytest.approx(np.sqrt(2) * rms / correlation, rel=0.05)


def test_mean_power_over_seeds_is_unbiased_also_at_the_ends():
    heights = np.array([profile(seed, length=0.02)[1] for seed in range(200)])
    power = np.mean(heights**2, axis=0) / WALL["rms_height"] ** 2
    assert power.mean() == pytest.approx(1.0, abs=0.03)
    assert power[0] == pytest.approx(1.0, abs=0.35)
    assert power[-1] == pytest.approx(1.0, abs=0.35)


def test_seeds_decide_and_surfaces_are_independent():
    wall = {"kind": "segment", "start": [0.0, 0.05], "end": [0.02, 0.05], "roughness": WALL}
    other = {"kind": "segment", "start": [0.0, 0.07], "end": [0.02, 0.07], "roughness": WALL}
    same = nodes_of(scene_of(wall, other), 12, seed=1).position
    np.testing.assert_array_equal(nodes_of(scene_of(wall, other), 12, seed=1).position, same)
    assert not np.array_equal(nodes_of(scene_of(wall, other), 12, seed=2).position[:50], same[:50])
    smoother = {**other, "roughness": {**WALL, "rms_height": 0.01e-3}}
    np.testing.assert_array_equal(nodes_of(scene_of(wall, smoother), 12, seed=1).position[:200], same[:200])
    half = len(same) // 2
    assert abs(np.corrcoef(same[:half, 1], same[half:, 1])[0, 1]) < 0.3


def test_closed_surfaces_have_closed_profiles():
    _, heights = profile(0, length=0.05, periodic=True)
    assert heights[0] == heights[-1]
    nodes = nodes_of(scene_of({"kind": "circle", "center": [0, 0.05], "radius": 8e-3, "roughness": WALL}), 12)
    gap = np.linalg.norm(nodes.position - nodes.position[nodes.after], axis=1)
    assert gap.max() < 1.05 * WAVELENGTH / 12


def test_rough_pieces_meet_at_their_vertex():
    corner = {"kind": "polyline", "points": [[-0.015, 0.035], [0.0, 0.05], [0.015, 0.035]], "roughness": TARGET}
    nodes = nodes_of(scene_of(corner), 16)
    assert np.min(np.linalg.norm(nodes.position - [0.0, 0.05], axis=1)) < 1e-3 * WAVELENGTH


def test_too_short_for_roughness_is_refused():
    short = scene_of({"kind": "segment", "start": [0.0, 0.05], "end": [0.005, 0.05], "roughness": WALL})
    with pytest.raises(InputError, match=r"surface 0.*25.0 correlation lengths.*at least 50"):
        nodes_of(short, 12)


def test_too_rough_for_the_curvature_is_refused():
    rough = {"rms_height": 0.5e-3, "correlation_length": 0.1e-3}
    tight = scene_of({"kind": "circle", "center": [0.0, 0.05], "radius": 1.5e-3, "roughness": rough})
    with pytest.raises(InputError, match=r"too large for a radius of curvature of 0.0015 m"):
        nodes_of(tight, 12)
