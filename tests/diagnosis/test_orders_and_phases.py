"""Antennas in another order than their samples, and elements with phases of their own, in sweeps of many kinds."""

from __future__ import annotations

import numpy as np
import pytest
from instruments import line
from scipy.constants import speed_of_light

import mirrorfold as mf
from mirrorfold.diagnosis import diagnose, physics
from mirrorfold.diagnosis.wavefronts import wavefronts

FREQUENCY = np.linspace(142e9, 158e9, 96)
WAVELENGTH = speed_of_light / 150e9
PITCH = 0.45 * WAVELENGTH


def echoes(tx, rx, seed, *, frequency=FREQUENCY, points=12, direct=0.0):
    """Samples (frequencies, tx, rx) of random points at 0.5 to 2 m, and of direct waves between the antennas."""
    random = np.random.default_rng([seed, 5])
    distance, angle = random.uniform(0.5, 2.0, points), random.uniform(-0.9, 0.9, points)
    place = distance[:, None] * np.stack([np.sin(angle), np.cos(angle), 0.0 * angle], axis=1)
    strength = random.standard_normal((2, points)).T @ [1.0, 1j]
    k = 2 * np.pi * frequency[:, None, None] / speed_of_light
    s = direct * np.exp(-1j * k * (0.02 + np.linalg.norm(tx[:, None] - rx, axis=-1)))
    for point, amplitude in zip(place, strength, strict=True):
        path = np.linalg.norm(tx - point, axis=1)[:, None] + np.linalg.norm(rx - point, axis=1)
        s = s + amplitude * np.exp(-1j * k * path)
    noise = random.standard_normal((2, *s.shape))
    return s + 0.2 * (noise[0] + 1j * noise[1])


def sweep(s, tx, rx, **attrs):
    return mf.make_sweep(s, frequency=FREQUENCY, tx_position=tx, rx_position=rx, **attrs)


def named(found):
    return [finding.name for finding in diagnose(found)[0]]


def two_stages(seed):
    """Two lines of antennas: one above the other, farther than they are long, or beside each other."""
    height = 0.04 if seed % 2 else 0.01
    if seed < 2:
        return line(33, pitch=PITCH), line(33, pitch=PITCH, centre=(0.0, 0.0, height))
    return line(33, pitch=PITCH, centre=(-0.03, 0.0, 0.0)), line(37, pitch=PITCH, centre=(0.03, 0.0, 0.0))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_a_stage_that_ran_the_other_way_is_named(seed):
    tx, rx = two_stages(seed)
    s = echoes(tx, rx, seed)
    assert named(sweep(s, tx, rx)) == []
    assert named(sweep(s, tx[::-1], rx)) == ["positions-reversed"]
    assert named(sweep(s, tx, rx[::-1])) == ["positions-reversed"]


@pytest.mark.slow
def test_rows_measured_to_and_fro_and_lists_folded_by_columns_are_named():
    tx, rx = two_stages(2)
    s = echoes(tx, rx, 2)
    s[:, 1::2] = s[:, 1::2, ::-1]
    to_and_fro = diagnose(sweep(s, tx, rx))[0]
    assert [finding.name for finding in to_and_fro] == ["samples-unordered"]
    assert "every other row" in to_and_fro[0].what
    s = echoes(tx, rx, 3)
    s = np.swapaxes(s, 1, 2).reshape(len(FREQUENCY), len(tx), len(rx))
    by_columns = diagnose(sweep(s, tx, rx))[0]
    assert [finding.name for finding in by_columns] == ["samples-unordered"]
    assert "order='F'" in by_columns[0].remedy


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_elements_with_phases_of_their_own_are_named(seed):
    tx, rx = two_stages(seed)
    s = echoes(tx, rx, seed)
    random = np.random.default_rng(seed)
    turned = np.exp(2j * np.pi * random.random(len(rx)))
    assert named(sweep(s * turned, tx, rx)) == ["element-phases"]
    assert named(sweep(s[:, :, random.permutation(len(rx))], tx, rx)) == ["element-phases"]
    (found,) = diagnose(sweep(s * turned, tx, rx))[0]
    assert "Neighbouring receivers" in found.what
    assert "--sphere" in found.remedy


@pytest.mark.parametrize("arc", [False, True], ids=["line", "arc"])
def test_a_moving_antenna_with_a_phase_at_each_stop_is_named(arc):
    place = line(90, pitch=0.22 * WAVELENGTH)
    if arc:
        place = 0.8 * np.stack([np.sin(place[:, 0] / 0.8), 1.0 - np.cos(place[:, 0] / 0.8), 0.0 * place[:, 0]], axis=1)
    s = np.einsum("fii->fi", echoes(place, place, 4, points=4))
    turned = np.exp(2j * np.pi * np.random.default_rng(4).random(len(place)))
    right, wrong = (
        mf.make_monostatic_sweep(one, frequency=FREQUENCY, antenna_position=place) for one in (s, s * turned)
    )
    assert named(right) == []
    assert named(wrong) == ["element-phases"]


@pytest.mark.slow
@pytest.mark.parametrize("displaced", [False, True])
def test_direct_waves_alone_are_not_taken_for_a_reversed_stage(displaced):
    """Their length depends on the distance of the antennas, as that of echoes from the side does if one is reversed."""
    tx, rx = two_stages(2) if displaced else two_stages(0)
    assert named(sweep(echoes(tx, rx, 6, points=0, direct=10.0), tx, rx)) == []
    assert named(sweep(echoes(tx, rx, 6, direct=10.0), tx, rx)) == []


@pytest.mark.parametrize("spacing", ["wide", "uneven", "noise"])
def test_phases_are_not_judged_where_neighbours_hear_other_echoes(spacing):
    random = np.random.default_rng(8)
    tx = rx = line(24, pitch=(5.0 if spacing == "wide" else 0.45) * WAVELENGTH)
    if spacing == "uneven":
        tx = rx = np.sort(random.uniform(-20.0, 20.0, (24, 1)) * WAVELENGTH, axis=0) * [1.0, 0.0, 0.0]
    s = echoes(tx, rx, 8, points=0 if spacing == "noise" else 12)
    assert "element-phases" not in named(sweep(s, tx, rx))


def test_what_returns_inside_the_instrument_of_a_moving_antenna_is_no_echo(monkeypatch):
    """It is a flat wave from near range zero, which looked like one of conjugated samples from the far end."""
    place = line(90, pitch=0.22 * WAVELENGTH)
    s = np.einsum("fii->fi", echoes(place, place, 4, points=4))
    leakage = 100.0 * np.exp(-2j * np.pi * FREQUENCY[:, None] / speed_of_light * 0.1)
    looked = []
    monkeypatch.setattr(physics, "wavefronts", lambda *a, **k: looked.append(wavefronts(*a, **k)) or looked[-1])
    for samples in (s, s + leakage):
        assert named(mf.make_monostatic_sweep(samples, frequency=FREQUENCY, antenna_position=place)) == []
    np.testing.assert_array_equal(looked[1].gate, looked[0].gate)
    np.testing.assert_allclose(looked[1].coherence, looked[0].coherence, atol=0.01)
