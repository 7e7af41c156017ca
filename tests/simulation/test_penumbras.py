"""Penumbras of shadows and mirrors, against Fresnel integrals, physical optics and full waves."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from floor_plans import make_scene, segment
from scipy.special import fresnel

from mirrorfold.scenes.floor_plan import Scene, parse_scene
from mirrorfold.simulation import simulate
from mirrorfold.simulation.rays.outline import outline_of
from mirrorfold.simulation.rays.paths import Points, chains, trace
from mirrorfold.simulation.rays.penumbras import FADES
from mirrorfold.simulation.rays.sweep import scattered_field

PLACES = np.linspace(-0.3, 0.3, 601)


def knife_edge(v: np.ndarray) -> np.ndarray:
    """The share of a wave that passes an edge, which reaches into its path by v (negative: stays beside it)."""
    sine, cosine = fresnel(v)
    return np.asarray(0.5 * (1.0 + 1.0j) * ((0.5 - cosine) - 1.0j * (0.5 - sine)))


def shares(scene: Scene, antenna: tuple[float, float], places: np.ndarray, mirrors: tuple[int, ...] = ()) -> np.ndarray:
    """Share of the amplitude that arrives from an antenna over mirrors at each place."""
    outline = outline_of(scene, penumbras=True)
    chain = next(c for c in chains(np.array([antenna]), outline, len(mirrors)) if c.facets == mirrors)
    paths = trace(chain, Points.free(places), outline)
    found = np.zeros(len(places), complex)
    found[paths.point] = paths.share
    return found


def detours(antenna: np.ndarray, edge: np.ndarray, places: np.ndarray) -> np.ndarray:
    lengths = np.linalg.norm(edge - antenna) + np.linalg.norm(places - edge, axis=1)
    return lengths - np.linalg.norm(places - antenna, axis=1)


@pytest.mark.nojit
def test_the_edge_of_a_shadow_is_a_fresnel_integral() -> None:
    scene = make_scene(segment((0.0, 0.5), (1.0, 0.5)), elements=1)
    antenna, places = np.zeros(2), np.column_stack([PLACES, np.full(PLACES.size, 1.2)])
    found = shares(scene, (0.0, 0.0), places)
    wavelength = outline_of(scene, penumbras=True).wavelength
    v = np.sqrt(4.0 * detours(antenna, np.array([0.0, 0.5]), places) / wavelength) * np.sign(PLACES)
    penumbra = np.abs(v) < FADES[0]
    assert penumbra.sum() > 20
    np.testing.assert_allclose(found[penumbra], knife_edge(v[penumbra]), atol=3e-3)
    assert np.all(found[v < -FADES[1]] == 1.0)
    assert np.all(found[v > FADES[1]] == 0.0)
    assert abs(found[PLACES.size // 2]) == pytest.approx(0.5, abs=1e-3)


@pytest.mark.nojit
def test_what_a_mirror_shows_ends_as_behind_a_slit() -> None:
    scene = make_scene(segment((-0.05, 1.0), (0.05, 1.0)), elements=1)
    places = np.column_stack([PLACES, np.full(PLACES.size, 0.2)])
    found = shares(scene, (0.0, 0.0), places, (0,))
    image, wavelength = np.array([0.0, 2.0]), outline_of(scene, penumbras=True).wavelength
    expected = -1.0 + 0.0j
    for end in (-0.05, 0.05):
        aside = PLACES - end * 1.8  # from the image at a height of 2 past the end at 1 to the height of 0.2
        v = np.sqrt(4.0 * detours(image, np.array([end, 1.0]), places) / wavelength) * np.sign(end * aside)
        expected = expected + knife_edge(v)
    near = np.abs(np.abs(PLACES) - 0.09) < 0.02
    np.testing.assert_allclose(found[near], expected[near], atol=0.05)  # the waves of both ends are faded out
    assert np.all(found[np.abs(PLACES) < 0.02] == pytest.approx(1.0, abs=0.1))
    assert np.all(found[np.abs(PLACES) > 0.28] == 0.0)


@pytest.mark.nojit
@pytest.mark.parametrize("shape", ["straight", "bent towards the wave", "bent away", "folded back"])
def test_no_wave_leaks_through_the_joints_of_an_outline(shape: str) -> None:
    further = {
        "straight": (1.0, 0.5),
        "bent towards the wave": (1.0, 0.1),
        "bent away": (1.0, 0.9),
        "folded back": (-1.0, 0.6),
    }
    surface = {"name": "outline", "kind": "polyline", "points": [(-1.0, 0.5), (0.0, 0.5), further[shape]]}
    places = np.column_stack([PLACES, np.full(PLACES.size, 1.2)])
    found = shares(make_scene(surface, elements=1), (0.0, 0.0), places)
    if shape == "folded back":  # the joint is the edge of the shadow
        alone = shares(make_scene(segment((-1.0, 0.5), (0.0, 0.5)), elements=1), (0.0, 0.0), places)
        np.testing.assert_allclose(np.abs(found), np.abs(alone), atol=1e-6)
    else:
        assert not found.any()


@pytest.mark.nojit
def test_the_mirrors_of_a_corner_share_what_passes_their_vertex() -> None:
    corner = {"name": "corner", "kind": "polyline", "points": [(-0.5, 0.7), (0.0, 1.2), (0.5, 0.7)]}
    scene = make_scene(corner, elements=1)
    places = np.array([[-0.03, 0.0], [0.0, 0.0], [0.03, 0.0]])
    both = [shares(scene, (0.0, 0.0), places, order) for order in ((0, 1), (1, 0))]
    np.testing.assert_allclose(both[0] + both[1], 1.0, atol=1e-6)


PLANS: dict[str, tuple[float, list[dict[str, Any]]]] = {
    "a wall shades a mirror": (0.04, [
        segment((-0.3, 1.0), (0.5, 0.95), name="mirror"),
        segment((-0.4, 0.45), (-0.02, 0.5), name="wall"),
    ]),
    "a mirror shows a corner": (0.3, [
        segment((-0.3, 0.9), (0.3, 1.1), name="mirror"),
        {"name": "corner", "kind": "polyline", "points": [(0.62, 0.5), (0.75, 0.37), (0.88, 0.5)]},
        segment((0.1, 0.35), (0.4, 0.3), name="screen"),
    ]),
    "a mirror shows a disc": (0.25, [
        segment((-0.25, 0.8), (0.05, 1.1), name="mirror"),
        {"name": "disc", "kind": "circle", "center": (0.6, 0.6), "radius": 0.1},
        segment((0.25, 0.3), (0.5, 0.35), name="screen"),
    ]),
}  # fmt: skip
"""Largest relative error of the rays, and surfaces. Not in the rays: what several edges in turn do to a wave."""


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*strong echoes come from up to")
@pytest.mark.parametrize("plan", PLANS)
def test_penumbras_are_nearer_to_full_waves_than_sharp_edges(plan: str) -> None:
    largest, surfaces = PLANS[plan]
    scene = parse_scene({
        "name": plan,
        "array": {"kind": "linear", "elements": 61, "pitch": 1.9e-3},
        "band": {"start": 78e9, "stop": 80e9, "points": 21},
        "surface": surfaces,
    })  # fmt: skip
    assert isinstance(scene, Scene)
    waves = simulate(scene, solver="fullwave", tolerance=1e-3)["s"].values

    def error(edges: bool) -> float:
        rays = scattered_field(scene, bounces=3, seed=0, edges=edges)
        return float(np.linalg.norm(waves - rays) / np.linalg.norm(waves))

    assert error(edges=True) < min(largest, 0.6 * error(edges=False))
