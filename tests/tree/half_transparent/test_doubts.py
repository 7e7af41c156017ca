"""How likely it is that echoes passed through a wall, where polarizations tell and where they do not."""

from __future__ import annotations

import numpy as np
import pytest

from mirrorfold.common.slabs import POLARIZATIONS, slab
from mirrorfold.tree.half_transparent.doubts import passage_by_polarization
from mirrorfold.tree.half_transparent.panes import Pairs

K = 2.0 * np.pi * np.linspace(117e9, 127e9, 15) / 299792458.0
GLASS, BOARD = (5.79 - 0.17j, 6e-3), (2.9 - 0.03j, 8e-3)
LEVEL = 0.05
"""Amplitude of the noise over that of the echo."""


def probability(wall, degrees, passed=False, prefer_db=0.0):
    """That each echo passed: echoes of random objects that metal (None) or a wall reflected, or that `passed` it.

    Objects return TM stronger than TE by `prefer_db`.
    """
    random, angle = np.random.default_rng(0), np.radians(degrees)

    def gaussian(frequencies):
        return random.standard_normal((angle.size, frequencies, 2)) @ np.array([1.0, 1.0j])

    scatterer = gaussian(1) * np.exp(2j * random.uniform(-0.02, 0.02, (angle.size, 1)) * (K - K[0]))
    waves = []
    for sign, name in zip((1.0, -1.0), POLARIZATIONS, strict=True):
        mirrored, through = (sign, 0.0) if wall is None else slab(*wall, K, angle[:, None], name)
        waves.append(scatterer * np.where(np.broadcast_to(passed, angle.size)[:, None], through, mirrored) ** 2 * sign)
    waves[1] = waves[1] * 10.0 ** (np.reshape(prefer_db, (-1, 1)) / 20.0)
    power = np.mean(np.abs(waves) ** 2, axis=(0, 2))[:, None]
    te, tm = (wave + LEVEL * np.sqrt(0.5 * power) * gaussian(K.size) for wave in waves)
    window, each = passage_by_polarization(Pairs(te, tm, angle, K, np.full(angle.size, LEVEL**2), 5.0, 0.025))
    return window * each


@pytest.mark.parametrize(("wall", "passed"), [(None, False), (GLASS, False), (GLASS, True), (BOARD, True)])
def test_at_small_angles_nothing_is_decided(wall, passed):
    """There, walls treat both polarizations alike: whatever the echoes are, they may be of either kind."""
    told = probability(wall, np.linspace(2.0, 8.0, 4), passed)
    assert told.min() > 0.1
    assert told.max() < 0.6


@pytest.mark.parametrize("wall", [None, GLASS, BOARD])
def test_at_large_angles_what_a_wall_reflects_did_not_pass(wall):
    assert probability(wall, np.linspace(40.0, 60.0, 9)).max() < 0.1


@pytest.mark.parametrize("wall", [GLASS, BOARD])
def test_a_few_echoes_of_both_kinds_are_told_apart(wall):
    passed = np.arange(9) < 5
    told = probability(wall, np.linspace(40.0, 52.0, 9), passed)
    assert told[passed].min() > 0.7
    assert told[~passed].max() < 0.1


def test_what_objects_prefer_is_no_proof_of_metal():
    """Much that passed a board, by objects that return TM stronger, and a little that it reflected."""
    passed = np.arange(39) < 32
    degrees = np.append(np.linspace(26.0, 33.0, 32), np.linspace(40.0, 44.0, 7))
    told = probability((4.9 - 0.03j, 4.4e-3), degrees, passed, np.random.default_rng(1).normal(1.5, 1.0, 39))
    assert told[passed].min() > 0.3
    assert told[~passed].max() < 0.3
