"""Materials: how they reflect, what roughness takes from it, and how deep they scatter inside, in both simulators."""

from __future__ import annotations

from typing import get_args

import numpy as np
import pytest

from mirrorfold.errors import InputError
from mirrorfold.scenes.floor_plan import parse_scene
from mirrorfold.scenes.materials import VolumeProfile, coherent_factor, material, permittivity, scattering_depth
from mirrorfold.simulation.raster.meshes import solids
from mirrorfold.simulation.raster.speckle import draw_scatterers as draw_scatterers_in_space
from mirrorfold.simulation.rays.outline import outline_of
from mirrorfold.simulation.rays.scatterers import draw_scatterers

DEPTH = 0.02
BAND = {"start": 270e9, "stop": 300e9, "points": 11}
BOARD = {"name": "board", "material": "plasterboard", "volume_depth": DEPTH}
STEPS = {"start": -5.0, "stop": 5.0, "points": 3}
SCANNER = {"azimuth": STEPS, "elevation": STEPS, "spot_radius": 0.017, "focus_distance": 3.6}
E2 = np.exp(-2.0)

MEAN = {"exponential": 0.5 - E2 / (1.0 - E2), "uniform": 0.5, "layers": 2.0 / 3.0 * 0.05 + 1.0 / 3.0 * 0.95}
ABOVE_TENTH = {"exponential": (1.0 - np.exp(-0.2)) / (1.0 - E2), "uniform": 0.1, "layers": 2.0 / 3.0}
ABOVE_HALF = {"exponential": (1.0 - np.exp(-1.0)) / (1.0 - E2), "uniform": 0.5, "layers": 2.0 / 3.0}
"""Mean depth over the depth of the wall, and shares of the power from above a tenth and a half of it."""


def test_every_profile_is_judged():
    assert set(MEAN) == set(get_args(VolumeProfile))


@pytest.mark.parametrize("profile", MEAN)
def test_profile_has_its_mean_depth_and_its_shares(profile):
    depth = scattering_depth(profile, DEPTH, (np.arange(30_000) + 0.5) / 30_000)
    assert depth.min() >= 0.0
    assert depth.max() <= DEPTH
    assert depth.mean() == pytest.approx(MEAN[profile] * DEPTH, rel=1e-3)
    assert np.mean(depth <= 0.1 * DEPTH) == pytest.approx(ABOVE_TENTH[profile], abs=1e-3)
    assert np.mean(depth <= 0.5 * DEPTH) == pytest.approx(ABOVE_HALF[profile], abs=1e-3)


def plan(**finish):
    wall = BOARD | {"kind": "segment", "start": [-1.0, 1.0], "end": [1.0, 1.0]} | finish
    array = {"kind": "linear", "elements": 3, "pitch": 0.5e-3}
    return parse_scene({"name": "plan", "array": array, "band": BAND, "surface": [wall]})


def space(**finish):
    wall = BOARD | {"kind": "panel", "center": [0.0, 2.0, 0.0], "normal": [0.0, -1.0, 0.0], "width": 1.0, "height": 1.0}
    content = {"name": "space", "dimensions": 3, "scanner": SCANNER, "band": BAND, "surface": [wall | finish]}
    return parse_scene(content)


def inside_of_plan(scene):
    """Depths [m] and powers [m] of the scatterers of both sides of a wall at y = 1 m."""
    frozen = draw_scatterers(scene, outline_of(scene), spacing=2e-4, seed=1)
    return np.abs(frozen.points.position[:, 1] - 1.0), np.abs(frozen.weight) ** 4


def inside_of_space(scene):
    """Depths [m] and powers [m^2] of the scatterers of a panel."""
    frozen = draw_scatterers_in_space(scene, solids(scene), seed=1)
    return frozen.depth, np.abs(frozen.strength) ** 2


@pytest.mark.parametrize(("make", "look", "size"), [(plan, inside_of_plan, 4.0), (space, inside_of_space, 2.0)])
def test_simulators_scatter_the_same_power_from_the_depths_that_the_profile_says(make, look, size):
    powers = []
    for profile in MEAN:
        depth, power = look(make(volume_profile=profile))
        powers.append(power.sum())
        assert np.average(depth, weights=power) == pytest.approx(MEAN[profile] * DEPTH, rel=0.05)
    assert powers == pytest.approx([size] * len(MEAN), rel=0.05)


def test_exponential_is_what_old_scene_files_mean():
    for make in (plan, space):
        assert make() == make(volume_profile="exponential")


def test_unknown_profile_is_refused_by_its_name():
    for make in (plan, space):
        with pytest.raises(InputError, match="volume_profile"):
            make(volume_profile="linear")


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


def test_outside_of_its_fit_a_material_names_the_frequency_that_is():
    for band, wrong in ((np.array([0.5e9, 2e9]), "at 0.5 GHz"), (np.array([400e9, 500e9]), "at 500 GHz")):
        with pytest.raises(InputError, match=f"{wrong}, its fit holds from 1 to 450 GHz"):
            permittivity("glass", band)
