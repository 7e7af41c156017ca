"""Families of full waves: valid and hidden over many seeds, as large as they say, sized to any radar."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.constants import speed_of_light

from mirrorfold.errors import InputError
from mirrorfold.scenes.arrays import LinearArray
from mirrorfold.scenes.families import RADARS, draw, radars_of, waves
from mirrorfold.scenes.families.waves import FAMILIES, HIDDEN, fitting
from mirrorfold.scenes.visibility import visible_truth
from mirrorfold.simulation import estimate
from mirrorfold.simulation.fullwave.contours import contours, outline_length
from mirrorfold.simulation.fullwave.discretisation import discretise
from mirrorfold.simulation.fullwave.preparation import density

QUICK = [(family, 100) for family in FAMILIES]
KINDS = [family for family in FAMILIES if "wrapped" not in family.name]
MANY = [pytest.param(family, seed, marks=pytest.mark.slow) for family in KINDS for seed in range(101, 105)]


def unknowns(scene, tolerance=waves.TOLERANCE):
    """The nodes that the solver takes, counted without solving."""
    wavelength = speed_of_light / scene.band.stop
    arms = contours(scene, seed=0)
    densities = [density(scene.surface[arm.surface], wavelength, tolerance, None, "") for arm in arms]
    return discretise(arms, wavelength=wavelength, per_wavelength=densities).size


def unit(scene):
    """The length that scenes are drawn in [m]: walls are about one unit long, all surfaces together three or four."""
    return speed_of_light / scene.band.stop * 300.0


@pytest.mark.slow
@pytest.mark.parametrize(("family", "seed"), [*QUICK, *MANY], ids=lambda value: getattr(value, "name", value))
def test_scenes_are_hidden_shown_and_as_large_as_they_say(family, seed):
    scene = draw(family, seed)
    assert 10_000 < unknowns(scene) < 12_500
    share = 0.9 if "wrapped" in family.name else 5.5
    assert share * unit(scene) < scene.band.ambiguous_range
    places = scene.array.tx_position[:, :2]
    hidden = [surface for surface in scene.surface if surface.name.startswith(HIDDEN)]
    assert hidden
    for surface in hidden:
        points, normals, _ = surface.sample(0.002)
        direct, shown = visible_truth(scene, points, normals, bounces=family.bounces)
        assert not direct.any()
        for place in places[[0, 33, -1]]:  # no more than the sliver between two samples
            seen_from = replace(scene, array=LinearArray(elements=1, pitch=1.0, center=tuple(place)))
            assert visible_truth(seen_from, points, normals, bounces=0)[0].mean() < 0.05
        assert shown.mean() > 0.1
    for surface in scene.surface:
        if surface.name.startswith("clear"):
            points, normals, _ = surface.sample(0.002)
            assert visible_truth(scene, points, normals, bounces=0)[0].mean() > 0.2


@pytest.mark.slow
def test_there_are_eight_kinds_and_a_seed_gives_its_scene():
    assert len({family.make for family in FAMILIES}) >= 8
    assert draw(FAMILIES[0], 100) == draw("full-wave two walls", 100)
    assert draw(FAMILIES[0], 100).surface != draw(FAMILIES[0], 101).surface


@pytest.mark.slow
def test_by_way_of_fewer_mirrors_what_is_deep_is_not_seen():
    for name, bounces in (("three bounces", 2), ("mirror in mirror in mirror", 3)):
        scene = draw(f"full-wave {name}", 100)
        points, normals, _ = scene.surface[-1].sample(0.004)
        shown = [visible_truth(scene, points, normals, bounces=b)[1].mean() for b in range(bounces + 1)]
        assert shown[0] == 0.0
        assert shown[bounces] > shown[bounces - 1] + 0.09


@pytest.mark.slow
def test_scenes_grow_with_the_wavelength_of_the_radar():
    for radar in ("300 GHz", "79 GHz"):
        scene = draw("full-wave two walls", 100, radar=radar)
        length = sum(outline_length(surface) for surface in scene.surface)
        assert length == pytest.approx(1000.0 * speed_of_light / RADARS[radar].band["stop"], rel=0.01)
        heights = {surface.roughness.rms_height * scene.band.stop / speed_of_light for surface in scene.surface}
        assert sorted(heights) == pytest.approx([0.05, 0.09])


def test_the_wrapping_radar_alone_is_too_coarse_in_frequency():
    ranges = {family.name: radars_of(family)[0].cell * (radars_of(family)[0].band["points"] - 1) for family in FAMILIES}
    assert ranges["full-wave wrapped corridor"] < 0.6 * ranges["full-wave corridor"]


@pytest.mark.slow
def test_solver_takes_the_scene_and_agrees_about_its_size():
    scene = draw("full-wave curved", 100)
    cost = estimate(scene, solver="fullwave", tolerance=waves.TOLERANCE)
    assert cost.unknowns == unknowns(scene)
    assert cost.memory_gb < 1.0


def test_impossible_ranges_get_one_sentence(monkeypatch):
    monkeypatch.setattr(waves, "MOST_DRAWS", 3)
    never = fitting()(lambda random: waves.two(random))
    with pytest.raises(InputError, match="none of 3 draws is valid for radar '300 GHz'"):
        never(np.random.default_rng(0), RADARS["300 GHz"])
    assert all(family.what and radars_of(family) == [family.radar] for family in FAMILIES)
