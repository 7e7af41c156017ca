"""What two polarizations tell of a wall: which echoes passed through it, its permittivity and thickness."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from through_slabs import delay, shift

from mirrorfold.common.slabs import POLARIZATIONS, slab
from mirrorfold.detection.mirrors.line_mirror import LineMirror
from mirrorfold.detection.views.image_view import ImageView
from mirrorfold.tree.half_transparent.exchanged import exchanged
from mirrorfold.tree.half_transparent.panes import Pairs, Pane, find_pane
from mirrorfold.tree.half_transparent.transparent import AGAINST_METAL, EVIDENCE, agreed_odds, incidence, placed

K = 2.0 * np.pi * np.linspace(117e9, 127e9, 15) / 299792458.0
GLASS, THICKNESS = 5.79 - 0.17j, 6e-3


def echoes(passed, angle, eps=GLASS, thickness=THICKNESS, level=0.02, seed=0):
    """Echoes of random scatterers behind a wall; so much noise, of any spectrum, against the echo."""
    random = np.random.default_rng(seed)

    def gaussian(shape):
        return random.standard_normal((*shape, 2)) @ np.array([1.0, 1.0j]) / np.sqrt(2.0)

    scatterer = gaussian((angle.size, 1)) * np.exp(2j * random.uniform(-0.02, 0.02, (angle.size, 1)) * (K - K[0]))
    found = []
    for name in POLARIZATIONS:
        coefficient = [one**2 for one in slab(eps, thickness, K, angle[:, None], name)]
        wave = scatterer * np.where(passed[:, None], coefficient[1], coefficient[0])
        found.append(wave + level * np.sqrt(np.mean(np.abs(wave) ** 2)) * gaussian(wave.shape))
    return Pairs(found[0], found[1], angle, K, np.full(angle.size, level**2), 5.0, 0.025)


@pytest.mark.slow
@pytest.mark.parametrize("low", [20.0, 45.0])
def test_echoes_are_sorted_and_the_wall_is_measured(low):
    angle = np.radians(np.linspace(low, low + 25.0, 24))
    passed = np.arange(24) % 3 == 0
    pairs = echoes(passed, angle)
    pane = find_pane(pairs)
    assert pane.evidence > 10.0
    assert pane.against_metal > 20.0
    np.testing.assert_array_equal(pairs.log_odds(pane)[0] > 0.0, passed)
    assert pane.permittivity.real == pytest.approx(GLASS.real, rel=0.03)
    assert pane.thickness == pytest.approx(THICKNESS, rel=0.02)
    assert abs(pane.thickness - THICKNESS) < 3.0 * pane.thickness_error
    assert abs(pane.permittivity.real - GLASS.real) < 3.0 * pane.permittivity_error


@pytest.mark.slow
def test_a_mirror_of_metal_is_no_window():
    random = np.random.default_rng(1)
    wave = random.standard_normal((8, K.size, 2)) @ np.array([1.0, 1.0j])
    level = np.full(8, 1e-4)
    angle = np.radians(np.linspace(20.0, 60.0, 8))
    pane = find_pane(Pairs(wave, -wave, angle, K, level, 5.0, 0.025))
    assert pane.against_metal < 5.0
    # Nor one whose objects prefer one polarization by a decibel.
    pane = find_pane(Pairs(wave, 0.9 * wave, angle, K, level, 5.0, 0.025))
    assert pane.against_metal < 5.0


@pytest.mark.slow
@pytest.mark.parametrize("low", [30.0, 45.0])
@pytest.mark.parametrize("every", [1, 3, 100])
def test_exchanged_names_are_noticed(low, every):
    """Whether all echoes passed, every third, or a single one."""
    angle = np.radians(np.linspace(low, low + 20.0, 24))
    pairs = echoes(np.arange(24) % every == 0, angle)
    assert not exchanged([pairs])
    assert exchanged([swapped(pairs)])


@pytest.mark.slow
@pytest.mark.parametrize("prefer_db", [-2.0, 0.0, 2.0])
def test_metal_and_small_angles_do_not_tell_the_names(prefer_db):
    random = np.random.default_rng(1)
    wave = random.standard_normal((24, K.size, 2)) @ np.array([1.0, 1.0j])
    ratio = 10.0 ** ((prefer_db + random.standard_normal((24, 1))) / 20.0)
    angle = np.radians(np.linspace(20.0, 60.0, 24))
    assert not exchanged([Pairs(wave, -ratio * wave, angle, K, np.full(24, 1e-4), 5.0, 0.025)])
    nearly_normal = echoes(np.arange(24) % 3 == 0, np.radians(np.linspace(0.0, 8.0, 24)))
    assert not exchanged([nearly_normal, swapped(nearly_normal)])
    assert not exchanged([])


def swapped(pairs):
    return replace(pairs, te=pairs.tm, tm=pairs.te)


@pytest.mark.slow
def test_many_objects_behind_metal_that_prefer_a_polarization_make_no_window():
    """All by 2 dB, each by another decibel, at angles at which a thin pane lets both pass nearly alike."""
    random = np.random.default_rng(2)
    wave = random.standard_normal((36, K.size, 2)) @ np.array([1.0, 1.0j])
    ratio = 10.0 ** ((2.0 + random.standard_normal((36, 1))) / 20.0)
    angle = np.radians(np.linspace(16.0, 40.0, 36))
    pane = find_pane(Pairs(wave, -ratio * wave, angle, K, np.full(36, 1e-4), 5.0, 0.025))
    assert pane.against_metal < AGAINST_METAL


@pytest.mark.slow
def test_a_few_reflections_among_much_that_passed_are_no_metal():
    """What passes a thin pane at small angles might be shown by metal; what it reflects at 38 degrees might not."""
    angle = np.radians(np.append(np.linspace(16.0, 34.0, 30), np.linspace(37.0, 40.0, 5)))
    passed = np.arange(35) < 30
    pairs = echoes(passed, angle, eps=2.6 - 0.05j, thickness=5.7e-3)
    pane = find_pane(pairs)
    assert pane.evidence > EVIDENCE
    assert pane.against_metal > AGAINST_METAL
    np.testing.assert_array_equal(pairs.log_odds(pane)[0] > 0.0, passed)


@pytest.mark.slow
def test_rough_objects_that_scatter_polarizations_unlike_are_decided_by_their_neighbours():
    angle = np.radians(np.linspace(50.0, 58.0, 12))
    passed = np.arange(12) >= 6
    pairs = echoes(passed, angle)
    pane = find_pane(pairs)
    weaker = np.where(np.arange(12)[:, None] == 9, 0.2, 1.0)
    pairs = replace(pairs, tm=weaker * pairs.tm)  # of one echo that passed by 14 dB, nearly as if it were reflected
    odds, neither = pairs.log_odds(pane)
    assert odds[9] < 0.0
    np.testing.assert_array_equal(np.flatnonzero(neither), [9])
    place = np.stack([np.arange(12.0), np.zeros(12)], axis=1)
    np.testing.assert_array_equal(agreed_odds(place, odds) > 0.0, passed)
    np.testing.assert_array_equal(agreed_odds(2.0 * place, odds), odds)


@pytest.mark.slow
def test_a_mirror_of_glass_alone_is_no_window():
    angle = np.radians(np.linspace(30.0, 60.0, 10))
    assert find_pane(echoes(np.zeros(10, dtype=bool), angle)).evidence < 5.0


def test_what_is_seen_through_a_wall_is_put_where_an_array_would_see_it_without():
    # The ways from an array to a point through a plate, by Snell's law: an image focuses where these are best matched.
    along, broadside = np.array([1.0, 0.0]), np.array([0.0, 1.0])
    view = ImageView(np.zeros(2), along, broadside, np.linspace(0.1, 4.0, 40), np.linspace(-0.9, 0.9, 40),
                     np.ones((40, 40)), 1.0, 0.02, 0.01, 50.0, 50.0)  # fmt: skip
    mirror = LineMirror(start=np.array([0.4, 0.2]), end=np.array([0.4, 2.0]))
    eps, thickness, true = 5.79, 8e-3, np.array([1.0, 1.5])
    antennas = np.stack([np.linspace(-0.07, 0.07, 41), np.zeros(41)], axis=1)
    away = true - antennas
    length = np.linalg.norm(away, axis=1) + delay(eps, thickness, np.arccos(away[:, 0] / np.linalg.norm(away, axis=1)))

    def mismatch(place):
        short = np.linalg.norm(place - antennas, axis=1) - length
        return float(np.ptp(short)), float(abs(short.mean()))

    angle = incidence(view, true[None], mirror)
    late, aside = delay(eps, thickness, angle)[0], shift(eps, thickness, angle)[0]
    sight = true / np.linalg.norm(true)
    across = np.array([-sight[1], sight[0]])  # where the angle of incidence on a wall along y grows
    image = true + late * sight + aside * across
    assert mismatch(image)[0] < 2e-4
    assert mismatch(image)[1] < 1e-4
    assert mismatch(true)[1] > 5e-3
    # A pane without reflections inside: nothing but the delay of a single passage.
    soft = Pane(eps * (1.0 - 0.2j), thickness, 0.0, 0.0, 0.0, 0.0, 0.5)
    found = placed(view, image[None], mirror, soft, K)[0]
    assert np.linalg.norm(found - true) < 1e-3
