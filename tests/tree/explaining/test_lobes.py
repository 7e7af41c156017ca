"""Grating lobes of arrays with missing antennas are told from echoes, in images of points."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.constants import speed_of_light
from scipy.spatial.distance import cdist

import mirrorfold as mf
from mirrorfold.detection import find_echoes, see
from mirrorfold.sweep import make_sweep
from mirrorfold.tree.explaining.lobes import LOBE
from mirrorfold.tree.explaining.misplaced import misplaced
from mirrorfold.tree.explaining.waves import SweepWaves

FREQUENCY = np.linspace(285e9, 295e9, 101)
BRIGHT = np.array([0.3, 0.8, 0.0])


def made(missing, *points, pitch=0.5):
    """The view, its echoes and which of them are lobes: of points (x, y, z) [m] with amplitudes, and every
    third antenna missing, or none.
    """
    wavelength = speed_of_light / FREQUENCY.mean()
    number = np.arange(96)
    some = number[number % missing != 1] if missing else number
    elements = pitch * wavelength * (some[:, None] - 47.5) * [1.0, 0.0, 0.0]
    k = 2.0 * np.pi * FREQUENCY[:, None, None] / speed_of_light
    s = np.zeros((FREQUENCY.size, len(elements), len(elements)), dtype=complex)
    for amplitude, place in points:
        way = np.exp(-1j * k * cdist(elements, place[None]))
        s += amplitude * way @ way.swapaxes(1, 2)
    sweep = make_sweep(s, frequency=FREQUENCY, tx_position=elements, rx_position=elements)
    grid = {"x": np.arange(-0.9, 0.9, 0.005), "y": np.arange(0.1, 1.1, 0.005)}
    view = see(mf.focus(sweep, **grid))
    echoes = find_echoes(view)
    return view, echoes, misplaced(echoes, SweepWaves(sweep), view) == LOBE


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


@pytest.mark.slow
def test_of_lobes_as_high_as_the_main_one_nobody_is_accused():
    """Of antennas a wavelength apart, nothing tells an echo from its ghost."""
    view, echoes, found = made(None, (1.0, BRIGHT), pitch=1.0)
    distance, u = np.linalg.norm(BRIGHT), BRIGHT[0] / np.linalg.norm(BRIGHT) - 1.0
    twin = distance * np.array([u, np.sqrt(1.0 - u**2), 0.0])
    for place in (BRIGHT, twin):
        there = near(view, echoes, place)
        assert there.any()
        assert not found[there & (echoes.amplitude > 0.5 * echoes.amplitude[there].max())].any()
