"""Half-transparent walls are sampled as often as they are likely, so that standard errors hold."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.constants import speed_of_light

from mirrorfold.common.slabs import POLARIZATIONS, slab
from mirrorfold.tree.half_transparent import wall_posterior
from mirrorfold.tree.half_transparent.panes import Pairs, Pane
from mirrorfold.tree.half_transparent.wall_glints import Glints
from mirrorfold.tree.half_transparent.wall_posterior import measured_pane

K = 2.0 * np.pi * (122e9 + 12e9 * np.linspace(-0.42, 0.42, 15)) / speed_of_light
TAPER, VALUES = np.cos(np.pi * np.linspace(-0.42, 0.42, 15)) ** 2, 5
NOTHING = Pane(4.0, 5e-3, 0.0, 0.0, evidence=0.0, against_metal=50.0, share=0.5)


def gaussian(random, *shape):
    return random.standard_normal((*shape, 2)) @ np.array([1.0, 1.0j]) / np.sqrt(2.0)


def deviations(random, count):
    """Of spectra, (count, m), with as many independent values as the window that cuts out an echo leaves."""
    knots, at = gaussian(random, count, VALUES), np.linspace(0.0, VALUES - 1.0, K.size)
    return np.stack([np.interp(at, np.arange(VALUES), row) for row in knots])


def echoes(eps, thickness, angle, passed, seed):
    """Glints behind a wall, as rays show them in random scenes.

    Their spectra deviate by 4 % in both polarizations alike and by 1 % in each, and TM against TE by 1 dB.
    """
    random = np.random.default_rng(seed)
    glint = gaussian(random, angle.size, 1) * TAPER * (1.0 + 0.04 * deviations(random, angle.size))
    ratio = np.exp(0.12 * random.standard_normal((angle.size, 2)) @ np.array([1.0, 1.0j]))[:, None]
    found = []
    for name, level in zip(POLARIZATIONS, (1.0, -ratio), strict=True):
        wall = slab(eps, thickness, K, angle[:, None], name, rms_height=6e-5)
        wave = level * glint * np.where(passed[:, None], wall[1], wall[0]) ** 2
        found.append(wave * (1.0 + 0.01 * deviations(random, angle.size)))
    pairs = Pairs(*found, angle, K, np.full(angle.size, 1e-5), float(VALUES), 0.025)
    return Glints(
        pairs, np.stack(found), np.stack(found), TAPER, np.arange(angle.size)[:, None] * np.array([10.0, 10.0])
    )


def walls_at(phase, share):
    """The logarithm of a likelihood with two peaks of such shares, one turn of the phase apart, and their widths."""
    width, middle = np.array([0.02, 0.005, 0.15, 0.02]), np.array([1.5, 0.03, phase, 0.1])

    def likelihood(walls, space):
        loss = -walls.permittivity.imag / walls.permittivity.real
        numbers = space.numbers(walls.permittivity.real, loss, walls.thickness, walls.rms_height * space.wavenumber)
        each = [np.log(part) - 0.5 * np.sum(((numbers - middle - [0.0, 0.0, turn, 0.0]) / width) ** 2, axis=1)
                for part, turn in ((share, 0.0), (1.0 - share, 2.0 * np.pi))]  # fmt: skip
        return np.logaddexp(*each)

    return likelihood, middle, width


@pytest.mark.parametrize("share", [0.5, 0.8])
def test_turns_of_the_phase_are_sampled_as_often_as_they_are_likely(share):
    angle = np.radians(np.linspace(30.0, 50.0, 4))
    glints = echoes(4.5 - 0.1j, 7e-3, angle, np.ones(4, dtype=bool), 0)
    space = wall_posterior._Space(glints)
    likelihood, middle, width = walls_at(70.0, share)
    trials = wall_posterior._trials(glints, space)
    coarse = likelihood(space.walls(trials), space)
    walls, height = wall_posterior._sampled(space, trials, coarse, lambda some: likelihood(some, space))
    first = np.abs(walls[:, 2] - middle[2]) < np.pi
    assert first.mean() == pytest.approx(share, abs=0.1)
    here = np.abs(walls[first])  # negative losses and heights count as positive ones
    np.testing.assert_array_less(np.abs(here.mean(axis=0) - middle), 0.3 * width)
    np.testing.assert_allclose(here.std(axis=0), width, rtol=0.25)
    np.testing.assert_allclose(height, likelihood(space.walls(walls), space), atol=1e-6)


@pytest.mark.slow
def test_standard_errors_hold_for_walls_of_all_kinds():
    """Over random panes and boards the error over its standard error is about one in the mean square."""
    random, normalised = np.random.default_rng(5), []
    for seed in range(8):
        eps, thickness = random.uniform(2.5, 6.5) * (1.0 - 1j * random.uniform(0.002, 0.03)), random.uniform(4e-3, 1e-2)
        angle = np.radians(random.uniform(22.0, 66.0) + np.linspace(-7.0, 7.0, 7))
        pane = measured_pane(echoes(eps, thickness, angle, random.random(7) < 0.5, seed), NOTHING)
        off = pane.permittivity.real - eps.real, pane.thickness - thickness
        normalised.append(np.divide(off, (pane.permittivity_error, pane.thickness_error)))
    rms = np.sqrt(np.mean(np.square(normalised), axis=0))
    assert (rms > 0.5).all(), normalised
    assert (rms < 1.5).all(), normalised
