"""Grating lobes of arrays with missing antennas are told from echoes, in images of points."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.constants import speed_of_light
from scipy.spatial.distance import cdist

import mirrorfold as mf
from mirrorfold.detection import find_echoes, see
from mirrorfold.scenes.families import FAMILIES, draw, radars_of
from mirrorfold.sweep import make_sweep
from mirrorfold.tree.explaining.lobes import LOBE
from mirrorfold.tree.explaining.misplaced import misplaced
from mirrorfold.tree.explaining.waves import SweepWaves

FREQUENCY = np.linspace(285e9, 295e9, 101)
BRIGHT = np.array([0.3, 0.8, 0.0])


def made(missing, *points, pitch=0.5, frequency=FREQUENCY):
    """The view, its echoes and which of them are lobes: of points (x, y, z) [m] with amplitudes, and every
    third antenna missing, or none.
    """
    wavelength = speed_of_light / frequency.mean()
    number = np.arange(96)
    some = number[number % missing != 1] if missing else number
    elements = pitch * wavelength * (some[:, None] - 47.5) * [1.0, 0.0, 0.0]
    k = 2.0 * np.pi * frequency[:, None, None] / speed_of_light
    s = np.zeros((frequency.size, len(elements), len(elements)), dtype=complex)
    for amplitude, place in points:
        way = np.exp(-1j * k * cdist(elements, place[None]))
        s += amplitude * way @ way.swapaxes(1, 2)
    sweep = make_sweep(s, frequency=frequency, tx_position=elements, rx_position=elements)
    grid = {"x": np.arange(-0.9, 0.9, 0.005), "y": np.arange(0.1, 1.1, 0.005)}
    view = see(mf.focus(sweep, **grid))
    echoes = find_echoes(view)
    return view, echoes, misplaced(echoes, SweepWaves(sweep), view, {}) == LOBE


def near(view, echoes, place):
    """Which echoes are a cell and a half from a place at most."""
    return np.linalg.norm(echoes.position - place[:2], axis=1) < 1.5 * view.cell_at(place[:2])


def ghost():
    """Where two of three antennas, half a wavelength apart, show the bright point once more: at u less 2/3."""
    distance = np.linalg.norm(BRIGHT)
    u = BRIGHT[0] / distance - 2.0 / 3.0
    return distance * np.array([u, np.sqrt(1.0 - u**2), 0.0])


@pytest.mark.slow
def test_a_full_array_has_none():
    view, echoes, found = made(None, (1.0, BRIGHT))
    assert near(view, echoes, BRIGHT).any()
    assert not found.any()


@pytest.mark.slow
def test_of_a_thinned_array_the_echo_stays_and_its_ghost_goes():
    view, echoes, found = made(3, (1.0, BRIGHT))
    assert near(view, echoes, ghost()).any()
    assert not found[near(view, echoes, BRIGHT)].any()
    aside = np.abs(view.to_polar(echoes.position)[1] - view.to_polar(BRIGHT[:2])[1]) > 0.2
    assert found[aside & (echoes.amplitude > 1e-2 * echoes.amplitude.max())].all()


@pytest.mark.slow
@pytest.mark.parametrize(("amplitude", "stays"), [(1.0, True), (0.1, False)])
def test_what_stands_there_must_outshine_the_lobe(amplitude, stays):
    """Which is 12 dB below the bright point."""
    view, echoes, found = made(3, (1.0, BRIGHT), (amplitude, ghost()))
    there = near(view, echoes, ghost())
    assert there.any()
    assert (~found[there]).any() == stays
    assert not found[near(view, echoes, BRIGHT)].any()


def of_a_wavelength(frequency, *points):
    """As `made` by antennas a wavelength apart, and where they show the bright point once more: at u less 1."""
    distance = np.linalg.norm(BRIGHT)
    u = BRIGHT[0] / distance - 1.0
    twin = distance * np.array([u, np.sqrt(1.0 - u**2), 0.0])
    places = {"bright": BRIGHT, "twin": twin}
    return twin, *made(None, *((amplitude, places[name]) for amplitude, name in points), pitch=1.0, frequency=frequency)


def strong(view, echoes, place):
    """Which echoes within a cell of a place are at most 3 dB weaker than the brightest one there."""
    apart = np.abs(view.in_cells(echoes.position) - view.in_cells(place[None, :2])).max(axis=1)
    there = apart < 1.0
    assert there.any()
    return there & (echoes.amplitude > 0.7 * echoes.amplitude[there].max())


@pytest.mark.slow
def test_of_lobes_as_high_as_the_main_one_nobody_is_accused():
    """Of antennas a wavelength apart, nothing tells an echo from its ghost in a narrow band."""
    narrow = np.linspace(289.5e9, 290.5e9, 41)
    twin, view, echoes, found = of_a_wavelength(narrow, (1.0, "bright"))
    for place in (BRIGHT, twin):
        assert not found[strong(view, echoes, place)].any()


@pytest.mark.slow
@pytest.mark.parametrize(("amplitude", "stays"), [(0.0, False), (0.1, False), (1.0, True)])
def test_lobes_that_wander_over_the_band_are_lower_than_their_echo(amplitude, stays):
    """In a band of 3 % the lobe moves by more than its width: the image shows it lower and longer in range."""
    twin, view, echoes, found = of_a_wavelength(FREQUENCY, (1.0, "bright"), (amplitude, "twin"))
    assert not found[strong(view, echoes, BRIGHT)].any()
    assert (~found[strong(view, echoes, twin)]).any() == stays


@pytest.mark.slow
def test_a_room_seen_by_antennas_a_wavelength_apart_is_not_filled_with_lobes():
    """Of walls, too, which were taken for mirrors."""
    family = FAMILIES["three bounces"]
    array, band = {"kind": "linear", "elements": 64, "pitch": 1e-3}, {"start": 290e9, "stop": 300e9, "points": 301}
    scene = draw(family, 991, radar=replace(radars_of(family)[0], array=array, band=band))
    sweep = mf.simulate(scene)
    score = mf.score(mf.fold(mf.focus(sweep), sweep=sweep), scene)
    assert score.f_score_cells > 0.95
    assert score.invented_fraction < 0.01
    assert score.hidden.f_score_cells > 0.9
