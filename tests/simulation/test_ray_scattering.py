"""Diffuse scattering of rays: the power that a rough wall takes from the mirror, Lambert's law, the inside of walls."""

from __future__ import annotations

import numpy as np
import pytest
from floor_plans import ROUGH, make_scene, segment, wavenumber
from scipy.constants import speed_of_light

from mirrorfold.errors import InputError
from mirrorfold.scenes.materials import coherent_factor, material
from mirrorfold.simulation import simulate
from mirrorfold.simulation.rays.outline import outline_of
from mirrorfold.simulation.rays.scatterers import VOLUME_SHARE, DiffuseLaw, draw_scatterers, specular_coefficient
from mirrorfold.simulation.rays.sweep import scattered_field


@pytest.mark.nojit
def test_single_scatterer_has_the_two_way_amplitude_and_phase() -> None:
    scene = make_scene(segment((-0.0001, 1.0), (0.0001, 1.0), roughness=ROUGH), elements=4, pitch=0.01)
    bare = make_scene(segment((-0.0001, 1.0), (0.0001, 1.0)), elements=4, pitch=0.01)
    s = scattered_field(scene, bounces=0, seed=3)
    rough = draw_scatterers(scene, outline_of(scene), spacing=1e-3, seed=3)
    below = rough.points.normal[:, 1] < 0.0
    assert below.sum() == 1
    offset = rough.points.position[below][0] - scene.array.tx_position[:, :2]
    d = np.linalg.norm(offset, axis=1)
    one_way = np.exp(-1j * wavenumber(scene)[:, None] * d) / np.sqrt(d)
    one_way = one_way * rough.weight[below][0] * rough.laws[0].factor(scene.band.frequency[:, None], offset[:, 1] / d)
    expected = one_way[:, :, None] * one_way[:, None, :]
    np.testing.assert_allclose(s, expected, rtol=1e-4)
    assert not scattered_field(bare, bounces=0, seed=3).any()


def test_a_rough_conductor_met_once_returns_both_polarizations_alike() -> None:
    """H of a wave that comes back has the opposite sign, be it a glint or scattered: so has all of TM."""
    disc = {"kind": "circle", "center": (0.0, 0.4), "radius": 0.03, "roughness": ROUGH}
    smooth = scattered_field(make_scene({**disc, "roughness": None}), bounces=0, seed=1)
    te, tm = (scattered_field(make_scene(disc, polarization=name), bounces=0, seed=1) for name in ("TE", "TM"))
    assert np.abs(te - smooth).max() > 0.1 * np.abs(smooth).max()  # there is a glint, and there is scattering
    np.testing.assert_allclose(tm, -te, atol=1e-5 * np.abs(te).max())


@pytest.mark.parametrize("rms_height", [0.01e-3, 0.1e-3, 1e-3])
@pytest.mark.parametrize("inside", [False, True])
def test_scattered_power_is_what_the_specular_beam_has_lost(rms_height: float, inside: bool) -> None:
    rough = {"rms_height": rms_height, "correlation_length": 0.5e-3}
    scene = make_scene(segment((0, 1), (1, 1), material="plasterboard", roughness=rough, volume_depth=0.01))
    law = DiffuseLaw(scene.surface[0], inside=inside)
    frequency = np.array([[300e9]])
    incidence = np.radians([0.0, 20.0, 50.0, 75.0])
    scattered = np.radians(np.linspace(-90.0, 90.0, 4001))
    one_way, other_way = law.factor(frequency, np.cos(incidence))[0], law.factor(frequency, np.cos(scattered))[0]
    power = np.trapezoid((one_way[:, None] * other_way) ** 2, scattered, axis=1)
    smooth = np.abs(material("plasterboard").reflection(300e9, incidence)) ** 2
    lost = smooth - np.abs(specular_coefficient(scene.surface[0], 300e9, np.cos(incidence))) ** 2
    np.testing.assert_allclose(power, np.cos(incidence) * (VOLUME_SHARE * (1 - smooth) if inside else lost), rtol=1e-3)


@pytest.mark.slow
def test_receivers_around_a_rough_wall_collect_the_power_it_lost() -> None:
    length, height = 0.2, 4.0
    wall = segment((-length / 2, 0.0), (length / 2, 0.0), roughness=ROUGH)
    receivers = {"elements": 1200, "pitch": 0.01, "center": (0.0, -0.5)}
    scene = make_scene(wall, elements=1, array={"center": (0.0, -height), "rx": receivers})
    rx = scene.array.rx_position[:, :2]
    collected = 0.0
    for seed in range(20):
        s = scattered_field(scene, bounces=0, seed=seed)
        flux = np.mean(np.abs(s[:, 0]) ** 2, axis=0) * 0.5 / np.linalg.norm(rx, axis=1)
        collected += np.sum(flux) * 0.01 / 20
    lost = 1.0 - coherent_factor(0.1e-3, 295e9, 0.0, correlation_length=0.2e-3) ** 2
    # The receivers span +-85 degrees; 4000 Gaussian strengths leave a deviation of 2 percent.
    assert collected == pytest.approx(lost * length / height, rel=0.06)


@pytest.mark.slow
def test_mean_power_does_not_depend_on_the_density_of_scatterers() -> None:
    scene = make_scene(segment((-0.2, 1.0), (0.2, 1.3), roughness=ROUGH), elements=8, pitch=0.02)

    def power(spacing: float) -> float:
        runs = [scattered_field(scene, bounces=0, seed=n, spacing=spacing) for n in range(40)]
        return float(np.mean(np.abs(runs) ** 2))

    assert power(0.5e-3) == pytest.approx(power(4e-3), rel=0.15)


def test_nothing_passes_through_a_wall_that_is_rough_on_both_sides() -> None:
    wall = segment((-2.0, 1.0), (2.0, 1.0), roughness=ROUGH)
    behind = {"center": (0.0, 2.0), "rx": {"elements": 2, "pitch": 0.1, "center": (0.0, 0.0)}}
    # A mirror on each side lets image paths arrive there too.
    mirrors = [segment((1.5, -1.0), (1.5, 0.9)), segment((1.5, 1.1), (1.5, 3.0))]
    assert not scattered_field(make_scene(wall, *mirrors, elements=2, array=behind), bounces=2, seed=0).any()


@pytest.mark.slow
def test_inside_of_a_wall_returns_after_its_face_and_more() -> None:
    depth = 0.03
    wall = segment((-0.05, 1.0), (0.05, 1.0), material="plasterboard", volume_depth=depth)
    band = {"start": 270e9, "stop": 300e9, "points": 401}
    array = {"center": (-0.8, 0.0)}
    profiles = {}
    for name, surface in (("inside", wall), ("face", {**wall, "volume_depth": 0.0, "roughness": ROUGH})):
        runs = [
            scattered_field(make_scene(surface, elements=1, array=array, band=band), bounces=1, seed=n)
            for n in range(8)
        ]
        profiles[name] = np.mean([np.abs(np.fft.ifft(s[:, 0, 0])) ** 2 for s in runs], axis=0)
    one_way_range = np.arange(401) * speed_of_light / 2 / (30e9 * 401 / 400)
    last_of_face = np.hypot(0.85, 1.0)
    late = (one_way_range > last_of_face + 0.006) & (one_way_range < last_of_face + 0.05)
    assert profiles["inside"].sum() > 2 * profiles["face"].sum()
    assert profiles["inside"][late].sum() > 5 * profiles["face"][late].sum()
    with pytest.raises(InputError, match="no wave enters"):
        simulate(make_scene({**wall, "material": "pec"}))
