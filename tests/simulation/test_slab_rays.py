"""Half-transparent walls in the ray simulator against exact solutions, and against the same scenes without them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.constants import speed_of_light

from mirrorfold.common.slabs import POLARIZATIONS, slab
from mirrorfold.errors import InputError
from mirrorfold.scenes.floor_plan import Scene, parse_scene
from mirrorfold.scenes.materials import Substance, permittivity
from mirrorfold.simulation import simulate
from mirrorfold.simulation.rays.slabs import transmitted
from mirrorfold.simulation.rays.sweep import scattered_field

Complex = NDArray[np.complex128]

PANE = Substance(permittivity=5.79, conductivity=0.5)
GLASS = {"name": "glass", "kind": "segment", "material": {"permittivity": 5.79, "conductivity": 0.5}, "thickness": 6e-3}
DISC = {"name": "disc", "kind": "circle", "center": [0.0, 2.0], "radius": 0.1}


def make_scene(*surfaces: dict[str, Any], points: int = 41, **more: Any) -> Scene:
    array = {"elements": 3, "pitch": 0.5e-3}
    band = {"start": 290e9, "stop": 300e9, "points": points}
    return parse_scene({"name": "test", "array": array, "band": band, "surface": list(surfaces), **more})


def line_source(wavenumber: NDArray[np.float64], distance: float, angle: float, which: int, name: str) -> Complex:
    """The field of a line source, ``exp(-j k D) / sqrt(D)`` far away, after a pane of 6 mm: its spectrum of
    plane waves, each reflected or transmitted, summed along the path of steepest descent.
    """
    found = []
    for k in wavenumber:
        step = np.linspace(-12.0, 12.0, 4001) / np.sqrt(k * distance)
        w = angle + step * np.exp(0.25j * np.pi)
        eps = permittivity(PANE, k * speed_of_light / (2.0 * np.pi))
        wave = slab(eps, 6e-3, k, w, name)[which] * np.exp(-1j * k * distance * np.cos(w - angle))
        found.append(np.sqrt(0.5 * k / np.pi) * np.sum(wave) * (step[1] - step[0]))
    return np.array(found)


@pytest.mark.parametrize("name", POLARIZATIONS)
@pytest.mark.parametrize("degrees", [0.0, 30.0, 60.0])
def test_reflection_of_a_line_source_is_that_of_its_plane_waves(name, degrees):
    angle = np.radians(degrees)
    # So far from each other, a transmitter and a receiver see each other by way of a wall at 1 m at this angle.
    apart = 2.0 * np.tan(angle)
    array = {
        "elements": 1,
        "pitch": 0.5e-3,
        "center": [0.0, 0.0],
        "rx": {"elements": 1, "pitch": 0.5e-3, "center": [apart, 0.0]},
    }
    wall = GLASS | {"start": [-3.0, 1.0], "end": [8.0, 1.0]}
    scene = parse_scene({
        "name": "t", "array": array, "band": {"start": 290e9, "stop": 300e9, "points": 41}, "surface": [wall],
        "polarization": name,
    })  # fmt: skip
    found = scattered_field(scene, bounces=1, seed=0, edges=False)[:, 0, 0]
    k = 2.0 * np.pi * scene.band.frequency / speed_of_light
    distance = 2.0 / np.cos(angle)
    # The outline is the middle of the slab; R is that at the front face.
    exact = line_source(k, distance - 6e-3 * np.cos(angle), angle, 0, name)
    plane = slab(permittivity(PANE, scene.band.frequency), 6e-3, k, angle, name)[0]
    plane = plane * np.exp(-1j * k * (distance - 6e-3 * np.cos(angle))) / np.sqrt(distance)
    np.testing.assert_allclose(found, plane, atol=1.5e-3 / np.sqrt(distance))  # what is left out
    np.testing.assert_allclose(found, exact, atol=7e-3 * np.abs(exact).max())


@pytest.mark.parametrize("name", POLARIZATIONS)
@pytest.mark.parametrize("degrees", [0.0, 45.0, 65.0])
def test_transmission_of_a_line_source_is_that_of_its_plane_waves(name, degrees):
    angle, frequency = np.radians(degrees), np.linspace(290e9, 300e9, 41)
    k = 2.0 * np.pi * frequency / speed_of_light
    exact = line_source(k, 2.0, angle, 1, name)
    knots = frequency[[0, 20, 40], None]
    surface = make_scene(GLASS | {"start": [-1, 1], "end": [1, 1]}).surface[0]
    series = transmitted(surface, knots, np.array([np.cos(angle)]), name)
    found = sum(
        np.interp(frequency, knots[:, 0], amplitude[:, 0]) * np.exp(-1j * k * extra[0]) for amplitude, extra in series
    )
    plane = slab(permittivity(PANE, frequency), 6e-3, k, angle, name)[1]
    np.testing.assert_allclose(found, plane, atol=3e-3)
    error = np.abs(found * np.exp(-1j * k * 2.0) / np.sqrt(2.0) - exact).max() / np.abs(exact).max()
    assert error < {0.0: 0.002, 45.0: 0.014, 65.0: 0.04}[degrees]


@pytest.mark.parametrize("name", POLARIZATIONS)
def test_glint_behind_a_wall_is_that_without_times_the_square_of_the_transmission(name):
    wall = GLASS | {"start": [-2.0, 1.0], "end": [2.0, 1.0]}
    both = scattered_field(make_scene(wall, DISC, polarization=name), bounces=0, seed=0, edges=False)
    alone = scattered_field(make_scene(DISC, polarization=name), bounces=0, seed=0, edges=False)
    scene = make_scene(wall, polarization=name)
    face = scattered_field(scene, bounces=0, seed=0, edges=False)
    k = 2.0 * np.pi * scene.band.frequency / speed_of_light
    through = slab(permittivity(PANE, scene.band.frequency), 6e-3, k, 0.0, name)[1]
    found, expected = (both - face)[:, 1, 1], alone[:, 1, 1] * through**2
    np.testing.assert_allclose(found, expected, atol=8e-3 * np.abs(expected).max())


def test_wall_without_a_thickness_is_opaque_and_both_polarizations_are_those_alone():
    wall = {key: value for key, value in GLASS.items() if key != "thickness"} | {
        "start": [-2.0, 1.0],
        "end": [2.0, 1.0],
    }
    alone = scattered_field(make_scene(wall), bounces=1, seed=0)
    np.testing.assert_array_equal(scattered_field(make_scene(wall, DISC), bounces=1, seed=0), alone)
    both = simulate(make_scene(wall, DISC, polarization="both"))
    assert both["s"].dims == ("polarization", "frequency", "tx", "rx")
    for name in POLARIZATIONS:
        one = simulate(make_scene(wall, DISC, polarization=name))
        np.testing.assert_array_equal(both["s"].sel(polarization=name).values, one["s"].values)


def test_reciprocity_and_rough_walls_lose_coherence():
    rough = {"rms_height": 0.05e-3, "correlation_length": 0.2e-3}
    wall = GLASS | {"start": [-1.0, 1.3], "end": [1.0, 0.9]}
    other = {"name": "target", "kind": "segment", "start": [-0.5, 2.0], "end": [0.4, 2.2], "roughness": rough}
    found = scattered_field(make_scene(wall, other, DISC | {"roughness": rough}, points=5), bounces=2, seed=1)
    np.testing.assert_allclose(found, found.transpose(0, 2, 1), atol=1e-5 * np.abs(found).max())
    knots = np.array([[290e9], [295e9], [300e9]])
    smooth, coarse = (
        transmitted(make_scene(wall | finish).surface[0], knots, np.ones(1), "TE")
        for finish in ({}, {"roughness": rough})
    )
    height = 2.0 * np.pi * 295e9 / speed_of_light * 0.05e-3 * (np.sqrt(5.79) - 1.0)
    assert abs(coarse[0][0][1, 0] / smooth[0][0][1, 0]) == pytest.approx(np.exp(-(height**2)), rel=1e-3)


@pytest.mark.parametrize(
    ("wall", "said"),
    [
        ({"material": "pec"}, "no permittivity"),
        ({"volume_depth": 0.01}, "volume_depth"),
        ({"thickness": 0.0}, "thickness"),
        ({"material": {"permittivity": 0.5}}, "permittivity"),
        ({"kind": "circle", "center": [0, 2], "radius": 0.1}, "thickness"),
    ],
)
def test_walls_that_cannot_be_are_refused(wall, said):
    ends = {} if "kind" in wall else {"start": [-1, 1], "end": [1, 1]}
    with pytest.raises(InputError, match=said):
        make_scene(GLASS | ends | wall)


def test_material_without_permittivity_at_the_band_is_refused():
    """Where waves pass through it; opaque walls may be extrapolated, which is told."""
    band, wall = {"start": 800e9, "stop": 900e9, "points": 11}, {"start": [-1, 1], "end": [1, 1]}
    with pytest.raises(InputError, match="no permittivity at 900 GHz"):
        make_scene(GLASS | wall | {"material": "glass"}, band=band)
    with pytest.warns(UserWarning, match="extrapolated to 900 GHz"):
        make_scene(GLASS | wall | {"material": "glass", "thickness": None}, band=band)
    make_scene(GLASS | wall, band=band)
    make_scene(GLASS | wall | {"material": "pec", "thickness": None}, band=band)
