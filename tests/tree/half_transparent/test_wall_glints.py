"""Glints behind a wall measure it: its permittivity and thickness, and what of them passed through it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mirrorfold.common.slabs import POLARIZATIONS, slab
from mirrorfold.tree.half_transparent.panes import Pairs, Pane
from mirrorfold.tree.half_transparent.transparent import EVIDENCE
from mirrorfold.tree.half_transparent.wall_glints import Glints, Walls
from mirrorfold.tree.half_transparent.wall_posterior import measured_pane

K = 2.0 * np.pi * np.linspace(117e9, 127e9, 15) / 299792458.0
TAPER = np.cos(np.pi * np.linspace(-0.42, 0.42, 15)) ** 2
ANGLE = np.radians([24.0, 29.0, 33.0, 38.0, 44.0, 51.0, 57.0, 62.0])
PASSED = np.array([True, False, False, True, False, True, False, True])
NOTHING = Pane(4.0, 5e-3, 0.0, 0.0, evidence=0.0, against_metal=50.0, share=0.5)


def gaussian(random, shape):
    return random.standard_normal((*shape, 2)) @ np.array([1.0, 1.0j]) / np.sqrt(2.0)


def echoes(
    eps, thickness, *, rms_height=80e-6, seed=0, passed=PASSED, rough=(), snr_db=20.0, power=-1.0, k=K, cell=0.025
):
    """Glints of conductors behind a wall, but for those that are rough, with noise in each of 481 frequencies.

    An image averages over frequencies and antennas: the noise of 15 samples of a spectrum is that of 481 over 32.
    """
    random = np.random.default_rng(seed)
    delay = np.exp(2j * random.uniform(-0.01, 0.01, (ANGLE.size, 1)) * (k - k.mean()))
    scatterer = gaussian(random, (ANGLE.size, 1)) * (k / k.mean()) ** power * delay
    scatterer[list(rough)] = gaussian(random, (len(rough), k.size))
    level = 10.0 ** (-0.05 * snr_db) / np.sqrt(481.0 / 15.0)
    found = []
    for name, sign in zip(POLARIZATIONS, (1.0, -1.0), strict=True):
        coefficient = slab(eps, thickness, k, ANGLE[:, None], name, rms_height=rms_height)
        wave = sign * scatterer * np.where(passed[:, None], coefficient[1], coefficient[0]) ** 2 * TAPER
        noise = level * np.sqrt(np.mean(np.abs(wave) ** 2, axis=1))[:, None]
        found.append(wave + noise * gaussian(random, wave.shape))
    pairs, both = Pairs(*found, ANGLE, k, np.full(ANGLE.size, level**2), 5.0, cell), np.stack(found)
    return Glints(pairs, both, both, TAPER, np.arange(ANGLE.size)[:, None] * np.array([10.0, 10.0]))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("eps", "thickness"),
    [(5.79 - 0.17j, 6e-3), (5.79 - 0.17j, 9.7e-3), (2.6 - 0.02j, 8e-3), (3.8 - 0.07j, 4.2e-3)],
    ids=["glass", "thick glass", "acrylic", "board"],
)
def test_permittivity_and_thickness_of_walls_of_several_materials(eps, thickness):
    glints = echoes(eps, thickness, rough=(4, 5))
    pane = measured_pane(glints, NOTHING)
    assert pane.permittivity.real == pytest.approx(eps.real, rel=0.03)
    assert pane.thickness == pytest.approx(thickness, rel=0.02)
    assert abs(pane.permittivity.real - eps.real) < 3.0 * pane.permittivity_error + 0.005 * eps.real
    assert abs(pane.thickness - thickness) < 3.0 * pane.thickness_error + 0.005 * thickness
    assert pane.evidence > EVIDENCE
    np.testing.assert_array_equal(glints.log_odds(pane) > 0.0, PASSED)


@pytest.mark.slow
def test_a_board_much_thinner_than_a_coarse_cell_is_measured():
    """Between 77 and 81 GHz a board of 4 mm is a wave and a half thick, and a tenth of a range cell."""
    eps, thickness, k = 2.6 - 0.02j, 4e-3, 2.0 * np.pi * np.linspace(77.3e9, 80.7e9, 15) / 299792458.0
    pane = measured_pane(echoes(eps, thickness, rms_height=50e-6, k=k, cell=0.075), NOTHING)
    assert abs(pane.permittivity.real - eps.real) < 3.0 * pane.permittivity_error < 0.1 * eps.real
    assert abs(pane.thickness - thickness) < 3.0 * pane.thickness_error < 0.1 * thickness


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
def test_a_wall_that_absorbs_is_as_uncertain_as_it_is(seed):
    """Little of its back is seen: another turn of the phase between its faces is as likely, and the error says so."""
    eps, thickness = 6.4 - 0.3j, 5e-3
    pane = measured_pane(echoes(eps, thickness, rough=(4, 5), seed=seed), NOTHING)
    assert pane.permittivity.real == pytest.approx(eps.real, rel=0.03)
    assert abs(pane.thickness - thickness) < 3.0 * pane.thickness_error


@pytest.mark.slow
def test_a_wall_of_the_wrong_material_or_thickness_does_not_fit():
    eps, thickness = 5.79 - 0.17j, 6e-3
    glints = echoes(eps, thickness)
    others = np.array([eps, 1.2 * eps, 0.8 * eps, eps, eps]), thickness * np.array([1.0, 1.0, 1.0, 1.12, 0.88])
    score = glints.mixed(Walls(*others, np.full(5, 80e-6)))[0]
    assert (score[1:] < score[0] - 20.0).all()


@pytest.mark.slow
def test_where_nothing_passed_there_is_no_evidence_that_anything_did():
    for seed in range(3):
        glints = echoes(5.79 - 0.17j, 6e-3, passed=np.zeros(ANGLE.size, dtype=bool), rough=(1, 6), seed=seed)
        assert measured_pane(glints, NOTHING).evidence < EVIDENCE


@pytest.mark.slow
def test_noise_makes_the_wall_less_certain():
    errors = [measured_pane(echoes(5.79 - 0.17j, 6e-3, snr_db=snr), NOTHING).thickness_error for snr in (20.0, -5.0)]
    assert errors[0] < 0.5 * errors[1]


def test_rough_faces_dim_what_the_back_reflects_and_leave_a_smooth_wall_as_it_was():
    smooth, rough = (slab(5.79, 6e-3, K, 0.7, "TE", rms_height=height)[0] for height in (0.0, 80e-6))
    assert np.ptp(np.abs(rough)) < 0.8 * np.ptp(np.abs(smooth))
    np.testing.assert_allclose(smooth, slab(5.79, 6e-3, K, 0.7, "TE")[0])


def test_echoes_that_overlap_share_one_weight_by_their_power():
    glints = echoes(5.79 - 0.17j, 6e-3)
    np.testing.assert_array_equal(glints.weight, 1.0)
    noise = np.append(1e-2, np.full(ANGLE.size - 1, 2e-2))  # the first one is twice as bright as the others
    at_one_place = np.zeros((ANGLE.size, 2))
    together = replace(glints, pairs=replace(glints.pairs, noise=noise), place=at_one_place)
    np.testing.assert_allclose(together.weight, np.append(2.0, np.ones(ANGLE.size - 1)) / (ANGLE.size + 1.0))
    assert together.brightest(3).whole.shape == (2, 3, K.size)
