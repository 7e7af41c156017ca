"""Half-spaces and slabs against closed forms: Brewster's angle, energy, Stokes, thin and thick slabs, Snell."""

from __future__ import annotations

import numpy as np
import pytest

from mirrorfold.common.slabs import POLARIZATIONS, fresnel, slab
from mirrorfold.scenes.materials import permittivity

ANGLES = np.radians(np.linspace(0.0, 85.0, 18))
K = 2.0 * np.pi / 1e-3


@pytest.mark.parametrize("eps", [1.5, 2.56, 5.79])
def test_brewster_angle_takes_tm_alone(eps):
    brewster = np.arctan(np.sqrt(eps))
    assert abs(fresnel(eps, brewster, "TM")) < 1e-12
    assert abs(slab(eps, 7e-3, K, brewster, "TM")[0]) < 1e-12
    assert abs(slab(eps, 7e-3, K, brewster, "TM")[1]) == pytest.approx(1.0, abs=1e-12)
    # Reflected and refracted ray are at right angles there, which leaves cos(2 t') to TE.
    assert abs(fresnel(eps, brewster, "TE")) == pytest.approx(np.cos(2.0 * (np.pi / 2.0 - brewster)), abs=1e-12)


def test_at_45_degrees_tm_is_twice_te_in_decibels():
    for eps in (2.0, 5.79, 3.0 - 0.5j):
        te, tm = (fresnel(eps, np.pi / 4.0, name) for name in POLARIZATIONS)
        assert tm == pytest.approx(te**2, abs=1e-12) or tm == pytest.approx(-(te**2), abs=1e-12)


@pytest.mark.parametrize("name", POLARIZATIONS)
def test_slab_without_losses_keeps_the_energy_and_one_with_losses_takes_some(name):
    thickness = np.linspace(0.1e-3, 9e-3, 40)[:, None]
    reflection, transmission = slab(4.0, thickness, K, ANGLES, name)
    np.testing.assert_allclose(np.abs(reflection) ** 2 + np.abs(transmission) ** 2, 1.0, rtol=1e-12)
    lossy = slab(4.0 - 0.1j, thickness, K, ANGLES, name)
    assert np.all(np.abs(lossy[0]) ** 2 + np.abs(lossy[1]) ** 2 < 1.0)


@pytest.mark.parametrize("name", POLARIZATIONS)
def test_thick_lossy_slab_is_a_half_space_and_half_waves_are_windows(name):
    reflection, transmission = slab(4.0 - 0.5j, 0.1, K, ANGLES, name)
    np.testing.assert_allclose(reflection, fresnel(4.0 - 0.5j, ANGLES, name), atol=1e-9)
    assert np.abs(transmission).max() < 1e-9
    half_wave = np.pi / (K * np.sqrt(4.0 - np.sin(ANGLES) ** 2))
    np.testing.assert_allclose(np.abs(slab(4.0, 3.0 * half_wave, K, ANGLES, name)[1]), 1.0, rtol=1e-12)
    np.testing.assert_allclose(slab(1.0, 5e-3, K, ANGLES, name)[1], 1.0, atol=1e-12)


@pytest.mark.parametrize("name", POLARIZATIONS)
def test_slab_is_the_solution_of_the_boundary_conditions(name):
    # Fields and their slopes (over eps for H) are continuous at both faces: four equations, without any series.
    eps, thickness, angle = 5.79 - 0.1j, 3.3e-3, 0.9
    q, cosine = K * np.sqrt(eps - np.sin(angle) ** 2), K * np.cos(angle)
    p = np.exp(-1j * q * thickness)
    slope = q / eps if name == "TM" else q
    # Unknown: R, both waves inside (at the front face), T at the back face.
    matrix = np.array(
        [[-1, 1, 1, 0], [cosine, slope, -slope, 0], [0, p, 1 / p, -1], [0, slope * p, -slope / p, -cosine]]
    )
    r, _, _, t = np.linalg.solve(matrix, [1, cosine, 0, 0])
    found = slab(eps, thickness, K, angle, name)
    assert found[0] == pytest.approx(r, abs=1e-12)
    assert found[1] == pytest.approx(t * np.exp(1j * cosine * thickness), abs=1e-12)


def test_glass_reflects_and_transmits_as_its_permittivity_says():
    eps = permittivity("glass", 295e9)
    assert eps.real == pytest.approx(5.79)
    assert -eps.imag == pytest.approx(0.0004 * 295**1.658 / (2 * np.pi * 295e9 * 8.8541878e-12), rel=1e-6)
