"""Chips of a few antennas whose positions in the file are not those of the antennas."""

from __future__ import annotations

import numpy as np
import pytest
from instruments import line
from scipy.constants import speed_of_light

import mirrorfold as mf
from mirrorfold.diagnosis import diagnose

FREQUENCY = np.linspace(77e9, 81e9, 128)
HALF = 0.5 * speed_of_light / 79e9
CHIPS = {"3 x 4": (3, 4), "4 x 4": (4, 4), "1 x 16": (1, 16)}


def chip(name, seed, *, snr_db=20.0):
    """Samples (frequencies, tx, rx) of a dozen points before a virtual array of half a wavelength, and its antennas."""
    random = np.random.default_rng([seed, 23])
    transmitters, receivers = CHIPS[name]
    tx = line(transmitters, pitch=receivers * HALF, centre=(-0.012, 0.0, 0.0))
    rx = line(receivers, pitch=HALF)
    distance, angle = random.uniform(0.8, 4.0, 12), random.uniform(-1.0, 1.0, 12)
    points = distance[:, None] * np.stack([np.sin(angle), np.cos(angle), 0.0 * angle], axis=1)
    k = 2 * np.pi * FREQUENCY[:, None, None] / speed_of_light
    out, back = (np.exp(-1j * k * np.linalg.norm(places[:, None] - points, axis=2)) for places in (tx, rx))
    s = np.einsum("fip,fkp,p->fik", out, back, random.standard_normal((2, 12)).T @ [1.0, 1j])
    noise = (random.standard_normal((2, *s.shape)).T @ [1.0, 1j]).T
    return s + noise * np.sqrt(0.5 * np.mean(np.abs(s) ** 2)) * 10 ** (-snr_db / 20), tx, rx


def found_in(s, tx, rx):
    found = diagnose(mf.make_sweep(s, frequency=FREQUENCY, tx_position=tx, rx_position=rx))[0]
    return [finding.what for finding in found if finding.name == "antenna-order"]


def exchanged(places, i, k):
    order = np.arange(len(places))
    order[[i, k]] = k, i
    return places[order]


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("name", CHIPS)
def test_right_chips_uncalibrated_ones_and_mirrored_scenes_are_not_accused(name, seed):
    s, tx, rx = chip(name, seed, snr_db=(10.0, 30.0)[seed % 2])
    random = np.random.default_rng(seed)
    phase = 2 * np.pi * random.random((2, *s.shape[1:]))
    assert found_in(s, tx, rx) == []
    assert found_in(s.conj(), tx, rx) == []
    assert found_in(s, tx[::-1], rx[::-1]) == []
    assert found_in(s * np.exp(1j * (phase[0, :, :1] + phase[1, :1])), tx, rx) == []


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("name", ["3 x 4", "4 x 4"])
def test_antennas_in_another_order_are_named(name, seed):
    s, tx, rx = chip(name, seed)
    for found in (found_in(s, tx[::-1], rx), found_in(s, tx, rx[::-1])):
        assert len(found) == 1
        assert "opposite order" in found[0]
    assert "receivers 2 and 3 are exchanged" in found_in(s, tx, exchanged(rx, 1, 2))[0]
    assert "transmitters 1 and 2 are exchanged" in found_in(s, exchanged(tx, 0, 1), rx)[0]


@pytest.mark.parametrize("seed", range(4))
def test_receivers_exchanged_in_a_row_and_a_pitch_that_is_doubled_are_named(seed):
    s, tx, rx = chip("1 x 16", seed)
    assert "receivers 3 and 9 are exchanged" in found_in(s, tx, exchanged(rx, 2, 8))[0]
    s, tx, rx = chip("4 x 4", seed)
    assert "transmitters stand twice as far apart, or the others half as far" in found_in(s, tx, 2.0 * rx)[0]
