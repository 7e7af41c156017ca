"""Outlines of true solids: sections and silhouettes of a sphere are circles."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from numpy.testing import assert_allclose

from mirrorfold.common.arcs import mirror_outlines
from mirrorfold.plotting.outlines import as_polylines, covered, cut, cut_triangles, silhouette
from mirrorfold.reporting.document import truth_lines
from mirrorfold.scenes.floor_plan import parse_scene

trimesh = pytest.importorskip("trimesh")

CENTER, RADIUS = np.array([0.3, 1.0, -0.2]), 0.25


@pytest.fixture(scope="module")
def ball():
    mesh = trimesh.creation.icosphere(subdivisions=5, radius=RADIUS)
    return np.asarray(mesh.vertices) + CENTER, np.asarray(mesh.faces)


@pytest.mark.parametrize("normal", [[0.0, 0.0, 1.0], [1.0, -2.0, 0.5]])
@pytest.mark.parametrize("height", [0.0, 0.1, -0.2])
def test_a_plane_cuts_a_ball_in_a_circle(ball, normal, height):
    away = np.array(normal) / np.linalg.norm(normal)
    lines = cut_triangles(*ball, CENTER + height * away, np.array(normal))
    assert_allclose((lines - CENTER) @ away, height, atol=1e-12)
    distance = np.linalg.norm(lines - CENTER - height * away, axis=-1)
    assert_allclose(distance, np.sqrt(RADIUS**2 - height**2), atol=3e-4)
    length = np.linalg.norm(lines[:, 1] - lines[:, 0], axis=-1).sum()
    assert_allclose(length, 2.0 * np.pi * np.sqrt(RADIUS**2 - height**2), rtol=2e-3)


def test_a_plane_beside_it_cuts_nothing(ball):
    assert cut_triangles(*ball, CENTER + np.array([0.0, 0.0, 0.3]), np.array([0.0, 0.0, 1.0])).shape == (0, 2, 3)


@pytest.fixture(scope="module")
def scene():
    return parse_scene(
        {
            "name": "a wall and a ball",
            "dimensions": 3,
            "scanner": {"azimuth": {"start": -5, "stop": 5, "points": 21},
                        "elevation": {"start": -5, "stop": 5, "points": 21},
                        "spot_radius": 0.017, "focus_distance": 3.6},
            "band": {"start": 270e9, "stop": 300e9, "points": 101},
            "surface": [
                {"name": "wall", "kind": "panel", "center": [0, 2, 0], "normal": [0, -1, 0], "width": 1, "height": 1},
                {"name": "ball", "kind": "sphere", "center": [0, 1, 2], "radius": 0.2},
            ],
        }
    )  # fmt: skip


def test_a_scene_is_cut_by_the_names_of_its_surfaces(scene):
    found = cut(scene, np.zeros(3), np.array([0.0, 0.0, 1.0]))
    assert set(found) == {"wall"}
    assert_allclose(found["wall"][..., 1], 2.0)
    assert_allclose(np.abs(found["wall"][..., 0]).max(), 0.5)


def test_the_silhouette_of_a_ball_is_a_disc(ball):
    u, v = np.arange(-0.5, 0.5, 0.01), np.arange(-0.6, 0.3, 0.01)
    right, up = np.array([0.6, -0.8, 0.0]), np.array([0.0, 0.0, 1.0])
    mask = silhouette(*ball, right, up, u, v)
    assert mask.shape == (v.size, u.size)
    center = CENTER @ right, CENTER @ up
    away = np.hypot(u[None, :] - center[0], v[:, None] - center[1])
    assert mask[away < RADIUS - 0.01].all()
    assert not mask[away > RADIUS + 0.01].any()


def test_single_gaps_are_closed_and_wide_ones_stay():
    u = v = np.arange(0.0, 0.2, 0.01)
    places = np.stack(np.meshgrid(u[2:12], v[2:12]), axis=-1).reshape(-1, 2)
    gone = np.all(np.abs(places - 0.06) < 0.001, axis=1)
    mask = covered(places[~gone], u, v)
    assert mask[2:12, 2:12].all()
    assert mask.sum() == 100
    assert covered(places[:0], u, v).sum() == 0


def test_round_things_are_drawn_as_truth_too(scene):
    wall, *ball = (np.array(line) for line in truth_lines(scene))
    assert_allclose(wall[:, 1], 2.0)
    assert len(ball) == 5
    for line in ball:
        assert_allclose(line[0], line[-1])
        assert_allclose(np.linalg.norm(line - [0.0, 1.0, 2.0], axis=1), 0.2, atol=5e-3)


def test_segments_in_any_order_become_closed_lines():
    angle = np.linspace(0.0, 2.0 * np.pi, 13)
    circle = np.stack([np.cos(angle), np.sin(angle), np.zeros(13)], axis=1)
    both = np.concatenate([np.stack([line[:-1], line[1:]], axis=1) for line in (circle, circle + 3.0)])
    order = np.random.default_rng(0).permutation(len(both))
    lines = as_polylines(both[order])
    assert [len(line) for line in lines] == [13, 13]
    assert all((line[0] == line[-1]).all() for line in lines)


@pytest.mark.parametrize("axis", [[0.0, 0.6, 0.8], [0.0, 0.0, 0.0]])
def test_round_mirrors_are_outlined_on_their_faces(axis):
    """All points of the outlines are as far from the axis, or from the middle, as the face is."""
    axis, face, right = np.array(axis), np.array([0.0, -0.8, 0.6]), np.array([1.0, 0.0, 0.0])
    up = axis if axis.any() else np.array([0.0, 0.6, 0.8])
    left, mid, far = (CENTER + RADIUS * (np.cos(t) * face + np.sin(t) * right) for t in (-0.9, 0.0, 0.9))
    corners = np.array([left - 0.2 * up, far - 0.2 * up, far + 0.2 * up, left + 0.2 * up])
    if not axis.any():
        low, high = (CENTER + RADIUS * (np.cos(t) * face + np.sin(t) * up) for t in (-0.7, 0.7))
        corners = np.array([left, low, far, high])
    columns = {f"corner_{name}": (("mirror", "corner"), corners[None, :, i]) for i, name in enumerate("xyz")}
    columns |= {f"{name}m": ("mirror", mid[None, i]) for i, name in enumerate("xyz")}
    columns |= {f"axis_{name}": ("mirror", axis[None, i]) for i, name in enumerate("xyz")}
    (lines,) = mirror_outlines(xr.Dataset({**columns, "curvature": ("mirror", [1.0 / RADIUS])}))
    points = np.concatenate(lines) - CENTER
    assert len(points) > 50
    assert_allclose(np.linalg.norm(points - np.outer(points @ axis, axis), axis=1), RADIUS)
