"""The raster simulator against the plain sum, closed forms and the symmetries of space."""

from __future__ import annotations

import numpy as np
import pytest
from scans import STEEL, ball, content, panel, periscope, scene, turned
from scipy.constants import speed_of_light

import mirrorfold as mf
from mirrorfold.common.beams import beam_direction
from mirrorfold.scenes.floor_plan import parse_scene
from mirrorfold.simulation import estimate
from mirrorfold.simulation.raster.echoes import find_echoes
from mirrorfold.simulation.raster.speckle import diffuse_share, specular_amplitude
from mirrorfold.simulation.raster.sweep import measure, needed_points


def plain_sum(world, echoes):
    """Every echo in every beam and at every frequency, in float64."""
    azimuth, elevation = world.scanner.angles
    frequency = world.band.frequency
    width, narrow = echoes.width, echoes.narrow
    wave = np.exp(-4j * np.pi / speed_of_light * np.outer(frequency, echoes.range))
    result = np.empty((frequency.size, azimuth.size, elevation.size), dtype=complex)
    for i, a in enumerate(azimuth):
        for j, e in enumerate(elevation):
            turned = np.cross(echoes.position, beam_direction(a, e))
            aside = np.sum(turned * echoes.across, axis=1)
            along = np.sqrt(np.maximum(np.sum(turned**2, axis=1) - aside**2, 0.0))
            intensity = 2.0 / (np.pi * width * narrow) * np.exp(-2.0 * ((along / width) ** 2 + (aside / narrow) ** 2))
            result[:, i, j] = wave @ (intensity * echoes.amplitude)
    return result


@pytest.mark.nojit
def test_fast_sum_equals_the_plain_one():
    world = scene(panel(), ball(), half=1.5, beams=6, points=128)
    echoes, _ = find_echoes(world, bounces=1, seed=3, density=0.05)
    assert set(echoes.bounces) == {0, 1}
    expected = plain_sum(world, echoes)
    # With so few frequencies echoes wrap around, in both sums alike.
    error = np.abs(measure(world, echoes) - expected).max() / np.abs(expected).max()
    assert error < 1e-4


@pytest.mark.slow
@pytest.mark.parametrize(("distance", "turn"), [(3.0, 0.0), (2.2, 40.0)])
def test_diffuse_wall_that_fills_the_beam_returns_what_lambert_says(distance, turn):
    """``P = lambda^2 Q cos(t) / (pi^2 w^2)``: the integral of the squared intensity over an endless Lambert wall."""
    normal = (-np.sin(np.radians(turn)), -np.cos(np.radians(turn)), 0.0)
    finish = {"material": "pec", "diffuse_fraction": 0.6}
    world = scene(panel("wall", (0.0, distance, 0.0), normal, 3.0, 3.0, **finish), half=6.0, beams=33, points=64)
    azimuth, elevation = world.scanner.angles
    sweep = mf.simulate(world, bounces=0, seed=1, force=True)
    power = (np.abs(sweep["s"].values) ** 2).mean(axis=0)
    sight = beam_direction(azimuth[:, None], elevation)
    cosine = -sight @ np.array(normal)
    range_ = distance * np.cos(np.radians(turn)) / cosine
    wavelength = speed_of_light / world.band.frequency.mean()
    width = world.scanner.radius(range_, wavelength)
    share = diffuse_share(world.surface[0], world.band.frequency.mean(), cosine, inside=False)
    expected = wavelength**2 * share * cosine / (np.pi * width) ** 2
    assert abs(10.0 * np.log10(power.mean() / expected.mean())) < 0.3


def test_a_mirror_shows_its_image_dimmed_by_twice_the_reflection():
    """What a mirror shows is what stands behind it, turned, times the coefficient there and back."""
    wall = panel("wall", (0.0, 2.0, 0.0), (-1.0, -1.0, 0.0), 1.6, 1.6, material="plasterboard")
    seen = scene(wall, ball("ball", (-1.0, 2.0, 0.0)), half=3.0, beams=9, points=801)
    alone = scene(ball("ball", (0.0, 3.0, 0.0)), half=3.0, beams=9, points=801)
    through, _ = find_echoes(seen, bounces=1, seed=0)
    direct, _ = find_echoes(alone, bounces=0, seed=0)
    through_power = np.sum(np.abs(through.amplitude[through.bounces == 1]) ** 2)
    direct_power = np.sum(np.abs(direct.amplitude) ** 2)
    expected = abs(specular_amplitude(seen.surface[0], 285e9, np.array(np.sqrt(0.5)))) ** 4
    assert through_power / direct_power == pytest.approx(expected, rel=0.05)
    for axis in range(3):
        middle = through.position[through.bounces == 1, axis].mean()
        assert middle == pytest.approx(direct.position[:, axis].mean(), abs=0.004)


@pytest.mark.parametrize("distance", [2.0, 3.0])
def test_a_face_at_a_right_angle_returns_the_beam_to_itself(distance):
    """S11 is the overlap of the beam with its mirror image, here by quadrature in the plane of the mirror."""
    plate = panel("plate", (0.0, distance, 0.0), (0, -1, 0), 1.0, 1.0, material="pec")
    world = scene(plate, half=1.0, beams=5, points=801)
    sweep = mf.simulate(world, bounces=1)
    wavelength = speed_of_light / 285e9
    width = float(world.scanner.radius(distance, wavelength))
    x = np.linspace(-0.25, 0.25, 4001)
    for column, angle in enumerate(np.radians([-1.0, -0.5, 0.0, 0.5, 1.0])):
        offset = distance * np.sin(angle)
        along, across = (
            np.exp(-2.0 * (x - a) ** 2 / width**2 - 1j * 2.0 * np.pi / wavelength * x**2 / distance).sum()
            * (x[1] - x[0])
            for a in (offset, 0.0)
        )
        expected = abs(2.0 / (np.pi * width**2) * along * across)
        assert np.abs(sweep["s"].values[:, column, 2]).mean() == pytest.approx(expected, rel=0.03, abs=1e-4)
    # What remains of the phase when the way to the plate and back is taken off does not depend on frequency.
    rest = sweep["s"].values[:, 2, 2] * np.exp(4j * np.pi * world.band.frequency * distance / speed_of_light)
    assert np.ptp(np.angle(rest * np.conj(rest[0]))) < 1e-3


def test_a_rough_conductor_returns_both_polarizations_alike():
    """H of a wave that comes back has the opposite sign, be it a glint or scattered: so has all of TM."""
    plate = panel("plate", (0.0, 2.0, 0.0), (0.0, -1.0, 0.0), 0.3, 0.3, material="pec", diffuse_fraction=0.5)
    smooth = panel("plate", (0.0, 2.0, 0.0), (0.0, -1.0, 0.0), 0.3, 0.3, material="pec")
    glint, te, tm = (
        find_echoes(
            parse_scene(content(face, half=1.0, beams=5, points=801) | {"polarization": name}), bounces=1, seed=1
        )[0]
        for face, name in ((smooth, "TE"), (plate, "TE"), (plate, "TM"))
    )
    assert len(glint.amplitude) == 1 < len(te.amplitude)  # scatterers, besides the glint
    np.testing.assert_allclose(tm.amplitude, -te.amplitude, rtol=1e-12)


def test_a_glint_comes_by_way_of_a_mirror_too():
    world = scene(panel("wall", (0.0, 1.5, 0.0), (-1, -1, 0), 1.0, 1.0, material="pec"),
                  panel("end", (-1.0, 1.5, 0.0), (1, 0, 0), 1.0, 1.0, material="pec"), half=3.0)  # fmt: skip
    echoes, _ = find_echoes(world, bounces=3, seed=0)
    assert echoes.bounces.tolist() == [3]
    assert echoes.position[0] == pytest.approx([0.0, 2.5, 0.0], abs=1e-9)
    assert find_echoes(world, bounces=2, seed=0)[0].range.size == 0


@pytest.mark.slow
def test_three_mirrors_in_turn():
    world = scene(*periscope())
    echoes, counts = find_echoes(world, bounces=3, seed=0)
    last = echoes.position[echoes.bounces == 3]
    assert counts["chains"] >= 4
    # The ball: 1 + 0.8 + 0.8 + 0.7 m straight ahead, its near side 15 cm closer.
    assert np.linalg.norm(last, axis=1).min() == pytest.approx(3.15, abs=0.003)
    assert np.abs(last[:, [0, 2]]).max() < 0.16
    fewer, _ = find_echoes(world, bounces=2, seed=0)
    assert fewer.bounces.max() == 2
    assert fewer.range.size == np.count_nonzero(echoes.bounces < 3)


def test_things_cast_shadows():
    free, _ = find_echoes(scene(ball("far", (0.0, 2.5, 0.0)), half=4.0), bounces=0, seed=0)
    hidden = scene(panel("screen", (0.0, 1.5, 0.0), (0, -1, 0), 0.6, 0.6), ball("far", (0.0, 2.5, 0.0)), half=4.0)
    echoes, _ = find_echoes(hidden, bounces=0, seed=0)
    assert free.range.size > 1000
    assert np.count_nonzero(echoes.range > 1.7) == 0


@pytest.mark.slow
def test_turning_scene_and_scan_together_changes_nothing():
    """The frozen speckle turns with the surfaces, also with what is seen in a mirror."""
    walls = [panel(), panel("other", (-1.0, 2.0, 0.0), (1.0, 0.2, 0.0), 0.8, 0.8)]
    here = scene(*walls, half=3.0, beams=13)
    there = scene(*(turned(wall, 25.0) for wall in walls), half=3.0, beams=13, azimuth=25.0)
    first, second = (mf.simulate(world, bounces=1, seed=5)["s"].values for world in (here, there))
    assert find_echoes(here, bounces=1, seed=5)[0].bounces.max() == 1
    assert np.abs(first - second).max() < 1e-4 * np.abs(first).max()


@pytest.mark.slow
def test_a_patch_changes_the_finish_and_nothing_else():
    foil = {"name": "foil", "kind": "patch", "on": "ball", "direction": [0, -1, 0], **STEEL,
            "outline": [[-0.05, -0.05], [0.05, -0.05], [0.05, 0.05], [-0.05, 0.05]]}  # fmt: skip
    cloth = {"material": {"permittivity": 2.5}, "diffuse_fraction": 0.2}
    bare, _ = find_echoes(scene(ball("ball", (0.0, 2.5, 0.0), 0.2, **cloth), half=5.0), bounces=0, seed=2)
    dressed, _ = find_echoes(scene(ball("ball", (0.0, 2.5, 0.0), 0.2, **cloth), foil, half=5.0), bounces=0, seed=2)
    assert np.array_equal(bare.position, dressed.position)
    ratio = np.abs(dressed.amplitude) / np.abs(bare.amplitude)
    covered = np.all(np.abs(bare.position[:, [0, 2]]) < 0.05, axis=1)
    assert np.allclose(ratio[~covered], 1.0)
    assert ratio[covered].min() > 3.0


def test_leakage_is_an_echo_at_its_range():
    world = scene(ball("ball", (0.0, 2.5, 0.0)), half=2.0, beams=9, leakage={"level_db": -20.0, "range": 0.5})
    without = scene(ball("ball", (0.0, 2.5, 0.0)), half=2.0, beams=9)
    difference = mf.simulate(world)["s"].values - mf.simulate(without)["s"].values
    expected = 0.1 * np.exp(-4j * np.pi * world.band.frequency * 0.5 / speed_of_light)
    assert np.allclose(difference, expected[:, None, None], atol=1e-7)


def test_noise_has_the_power_that_is_asked_for():
    world = scene(ball("ball", (0.0, 2.5, 0.0)), half=2.0, beams=9)
    clean, noisy = mf.simulate(world)["s"].values, mf.simulate(world, snr_db=6.0)["s"].values
    ratio = np.mean(np.abs(clean) ** 2) / np.mean(np.abs(noisy - clean) ** 2)
    assert 10.0 * np.log10(ratio) == pytest.approx(6.0, abs=0.1)


@pytest.mark.slow
def test_speckle_belongs_to_the_seed():
    world = scene(panel(), half=2.0, beams=9)
    first, again, other = (mf.simulate(world, seed=seed)["s"].values for seed in (1, 1, 2))
    assert np.array_equal(first, again)
    correlation = np.vdot(first, other) / np.linalg.norm(first) / np.linalg.norm(other)
    assert abs(correlation) < 0.2


def test_too_few_frequencies_are_refused_with_the_number_needed():
    world = scene(ball("ball", (0.0, 3.0, 0.0)), half=2.0, beams=9, points=301)
    echoes, _ = find_echoes(world, bounces=0, seed=0)
    needed = needed_points(world, echoes)
    assert needed == 1 + np.ceil(2 * 30e9 * echoes.range.max() / speed_of_light)
    with pytest.raises(mf.InputError, match=f"at least {needed}"):
        mf.simulate(world)
    assert mf.simulate(world, force=True).sizes["frequency"] == 301
    leaking = scene(
        ball("ball", (0.0, 1.0, 0.0)), half=2.0, beams=9, points=301, leakage={"level_db": -20, "range": 2.0}
    )
    with pytest.raises(mf.InputError, match="wrap around"):
        mf.simulate(leaking)


def test_a_scan_step_wider_than_the_beam_is_refused():
    world = scene(ball("ball", (0.0, 2.5, 0.0)), half=8.0, beams=9)
    with pytest.raises(mf.InputError, match="scan step in azimuth is 2 degrees"):
        mf.simulate(world)
    assert mf.simulate(world, force=True)["s"].shape == (801, 9, 9)


def test_a_scene_that_returns_nothing_is_refused():
    with pytest.raises(mf.InputError, match="nothing to simulate"):
        mf.simulate(scene(ball("ball", (0.0, -2.0, 0.0)), half=2.0, beams=9))
    smooth = parse_scene(content(panel("wall", material="pec"), half=2.0, beams=9))
    with pytest.raises(mf.InputError, match="give surfaces a roughness"):
        mf.simulate(smooth)
    assert mf.simulate(smooth, snr_db=0.0)["s"].values.std() == pytest.approx(1.0, rel=0.02)


@pytest.mark.slow
def test_estimate_knows_what_will_be_done():
    world = scene(panel(), ball(), half=3.0, beams=13)
    found = estimate(world, bounces=1)
    echoes, counts = find_echoes(world, bounces=1, seed=0)
    assert found["echoes"] == echoes.range.size
    assert found["chains"] == counts["chains"] == 2
    assert found["needed_frequencies"] == needed_points(world, echoes)
    assert found["sweep_bytes"] == mf.simulate(world, bounces=1)["s"].nbytes
    assert found["seconds"] > 0
