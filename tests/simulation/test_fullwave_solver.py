"""The compressed solution against the dense one, its symmetries, and the near field."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from fullwave_scenes import TARGET, TOP, WALL, WAVELENGTH, K, distance, exact_field, scene_of, small_two_walls
from scipy.special import hankel2

import mirrorfold as mf
from mirrorfold.errors import InputError
from mirrorfold.simulation.fullwave.compression import interpolation, sampled_field
from mirrorfold.simulation.fullwave.preparation import prepare
from mirrorfold.simulation.fullwave.solver import System, currents, residual, scattered

LOW = K * 290 / 300


@pytest.fixture(scope="module")
def two_walls() -> System:
    """4300 nodes in groups of three levels."""
    system = prepare(small_two_walls(0.1), tolerance=1e-3)
    assert max(len(group.children) for root in system.roots for group in root.walk()) > 1
    assert sum(len(root.skeleton) for root in system.roots) < system.nodes.size / 8
    return system


@pytest.fixture(scope="module")
def dense(two_walls: System) -> np.ndarray:
    return scattered(replace(two_walls, roots=()), LOW)


@pytest.mark.slow
def test_compressed_is_dense_to_the_tolerance(two_walls, dense):
    assert distance(scattered(two_walls, LOW), dense) < 1e-3


@pytest.mark.slow
def test_error_follows_the_tolerance():
    coarse, fine = (
        prepare(small_two_walls(0.06), tolerance=tolerance, nodes_per_wavelength=16) for tolerance in (1e-2, 1e-4)
    )
    reference = scattered(replace(fine, roots=()), LOW)
    assert distance(scattered(fine, LOW), reference) < 1e-4
    assert 1e-4 < distance(scattered(coarse, LOW), reference) < 1e-2


def test_nodes_follow_the_tolerance():
    scene = scene_of(
        {"kind": "segment", "start": [-0.01, 0.03], "end": [0.004, 0.034], "roughness": WALL},
        {
            "kind": "arc",
            "center": [0.01, 0.02],
            "radius": 8e-3,
            "start_angle": 0,
            "stop_angle": 90,
            "roughness": TARGET,
        },
    )

    def dense_field(system: System) -> np.ndarray:
        return scattered(replace(system, roots=()), K)

    reference = dense_field(prepare(scene, nodes_per_wavelength=40))
    coarse, fine = (distance(dense_field(prepare(scene, tolerance=tolerance)), reference) for tolerance in (1e-3, 2e-4))
    assert coarse < 2e-3
    assert fine < 4e-4


@pytest.mark.slow
def test_single_precision_is_enough():
    system = prepare(small_two_walls(0.055), tolerance=1e-3)
    system = replace(system, roots=())
    assert distance(scattered(system, K), exact_field(system.nodes, system.tx, system.rx, K).T) < 2e-5


@pytest.mark.slow
@pytest.mark.parametrize("k", [LOW, K], ids=["low", "high"])
def test_reciprocity(two_walls, k):
    s = scattered(two_walls, k)
    assert distance(s.T, s) < 1e-4


@pytest.mark.slow
def test_residual_of_the_whole_system(two_walls):
    assert residual(two_walls, LOW, seed=0) < 1e-3
    assert residual(replace(two_walls, roots=()), LOW, seed=0) < 1e-5


@pytest.mark.slow
def test_residual_tells_bad_skeletons(two_walls):
    worse = prepare(small_two_walls(0.1), tolerance=0.05)
    assert residual(worse, LOW, seed=0) > 3 * residual(two_walls, LOW, seed=0)


@pytest.mark.slow
def test_currents_radiate_what_is_scattered(two_walls):
    excitation = np.eye(len(two_walls.tx), dtype=np.complex64)
    flowing = currents(two_walls, excitation, LOW)
    r = np.linalg.norm(two_walls.rx[:, None] - two_walls.nodes.position, axis=2)
    assert distance(hankel2(0, LOW * r) @ flowing, scattered(two_walls, LOW).T) < 1e-3


def test_skeletons_reproduce_the_field_where_they_were_not_sampled(two_walls):
    group = two_walls.roots[0].children[0]
    everywhere = np.flatnonzero(two_walls.nodes.surface == 2)
    to_skeleton = interpolation(group, two_walls.nodes, two_walls.antennas, K)
    field = sampled_field(two_walls.nodes, everywhere, two_walls.antennas, group.members, K)
    assert distance(field[:, group.skeleton] @ to_skeleton, field) < 2e-3


@pytest.mark.slow
def test_separate_receivers():
    scene = small_two_walls(0.1)
    receiving = replace(scene.array, elements=4, center=(0.01, 0.002))
    system = prepare(replace(scene, array=replace(scene.array, rx=receiving)), tolerance=1e-3)
    assert scattered(system, K).shape == (9, 4)
    assert distance(scattered(system, K), scattered(replace(system, roots=()), K)) < 1e-3


def test_turning_and_shifting_the_world_changes_nothing():
    wall = {"kind": "segment", "start": [-0.01, 0.05], "end": [0.012, 0.06], "roughness": WALL}
    scene = scene_of(wall)
    turn = np.array([[0.28, -0.96], [0.96, 0.28]])
    shift = np.array([0.3, -0.2])
    moved_wall = {**wall, **{end: (turn @ wall[end] + shift).tolist() for end in ("start", "end")}}
    moved = scene_of(moved_wall)
    array = replace(scene.array, center=tuple(shift), direction=tuple(turn @ [1.0, 0.0]))
    moved = replace(moved, array=array)
    assert distance(scattered(prepare(moved), K), scattered(prepare(scene), K)) < 1e-4


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*strong echoes")
def test_long_smooth_wall_is_the_image_of_the_source():
    wall = scene_of({"kind": "segment", "start": [-0.3, 0.1], "end": [0.3, 0.1]}, elements=3, points=2)
    s = mf.simulate(wall, solver="fullwave", tolerance=1e-3)["s"].values[-1]
    x = wall.array.tx_position[:, 0]
    path = np.hypot(x[:, None] - x, 0.2)
    image = -np.exp(-1j * K * path) / np.sqrt(path)
    assert distance(s, image) < 0.01  # what the edges diffract
    rays = mf.simulate(wall, solver="rays")["s"].values[-1]
    assert distance(s, rays) < 0.015


# The near field


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*strong echoes")
def test_near_field_vanishes_on_conductors_and_matches_the_sweep():
    scene = scene_of({"kind": "circle", "center": [0.0, 0.02], "radius": 4e-3}, elements=3)
    receiver = scene.array.rx_position[0, :2]
    field = mf.near_field(scene, TOP, ([receiver[0]], [receiver[1]]), source=2)
    s = mf.simulate(scene, solver="fullwave", direct=True)["s"].values[-1]
    assert abs(field.values[0, 0] - s[2, 0]) < 2e-3 * abs(s[2, 0])
    inside = mf.near_field(scene, TOP, (np.linspace(-2e-3, 2e-3, 5), np.linspace(0.018, 0.022, 5)))
    outside = mf.near_field(scene, TOP, (np.linspace(-2e-3, 2e-3, 5), np.linspace(0.01, 0.014, 5)))
    assert np.abs(inside).max() < 1e-3 * np.abs(outside).max()


def test_near_field_is_a_standing_wave_before_a_wall():
    scene = scene_of({"kind": "segment", "start": [-0.1, 0.05], "end": [0.1, 0.05]}, elements=1)
    y = 0.05 - WAVELENGTH * np.array([0.5, 0.75, 1.0, 1.25])
    field = np.abs(mf.near_field(scene, TOP, ([0.0], y)).values[:, 0])
    assert field.dtype == np.float32
    assert max(field[0], field[2]) < 0.1 * min(field[1], field[3])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((-1.0, ([0.0], [0.0])), "frequency is -1.0"),
        ((TOP, ([[0.0]], [0.0])), r"x has shape \(1, 1\)"),
        ((TOP, ([0.0], [np.nan])), "row of finite coordinates"),
    ],
)
def test_near_field_refuses(arguments, message):
    scene = scene_of({"kind": "segment", "start": [-0.01, 0.05], "end": [0.01, 0.05]})
    with pytest.raises(InputError, match=message):
        mf.near_field(scene, *arguments)
    with pytest.raises(InputError, match="source is 9"):
        mf.near_field(scene, TOP, ([0.0], [0.0]), source=9)
