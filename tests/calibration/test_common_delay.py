"""Metres of unknown cable, elements of any gain and phase: a family of random instruments before a sphere."""

from __future__ import annotations

import numpy as np
import pytest
from instruments import Instrument, line
from scipy.constants import speed_of_light

import mirrorfold as mf

DISPLACEMENTS = ((0.0, 0.0, 0.015), (0.0, -0.005, 0.0), (0.1, 0.0, 0.0), (0.0, 0.0, 0.0))
"""Of the receivers against the transmitters [m]: above them, behind them, beside them, and at the same places."""


def drawn(seed, *, coupling_db=None, walls=0):
    """A random instrument, the place and radius of a sphere, and two sweeps at 10 dB SNR: of the sphere, and without.

    Coupling is given against the sphere's echo, at the shortest straight way.
    """
    random = np.random.default_rng([seed, 3])
    counts = random.integers(7, 31, 2)
    pitch = random.uniform(0.4e-3, 1.5e-3)
    band, points = random.choice([5e9, 10e9, 30e9]), int(random.choice([101, 201]))
    start = random.uniform(60e9, 270e9)
    tx = line(counts[0], pitch=pitch)
    rx = line(counts[1], pitch=pitch, centre=DISPLACEMENTS[seed % len(DISPLACEMENTS)])
    coupling = 0.0 if coupling_db is None else 0.01 * 10 ** (coupling_db / 20)
    instrument = Instrument.random(tx, rx, np.linspace(start, start + band, points), seed, coupling=coupling, drift=0.2)
    # Within the ambiguous range; at its end an echo cannot be told from coupling.
    away, angle = random.uniform(0.3, 0.8) * min(0.5 * instrument.period, 2.0), random.uniform(-0.6, 0.6)
    centre, radius = (away * np.sin(angle), away * np.cos(angle)), random.choice([0.0, 0.01, 0.025])
    echo = instrument.sphere(centre, radius)
    room = np.zeros_like(echo)
    for _ in range(walls):
        room += instrument.sphere(np.array(centre) + random.uniform([-0.5, 0.2], [0.5, 1.0]))
    noise = 10**-0.5 * np.sqrt(np.mean(np.abs(instrument.tx_gain) ** 2) * np.mean(np.abs(instrument.rx_gain) ** 2))
    sphere = instrument.measure(echo + room, seed, noise=noise)
    return instrument, centre, radius, sphere, instrument.measure(room, seed + 1000, noise=0.3 * noise)


def errors(found, instrument):
    """Of the sums t + r (tx, rx), cable and all, modulo the period; in range resolutions, c / (2 B)."""
    truth = instrument.cable + instrument.tx_delay[:, None] + instrument.rx_delay
    error = found.tx_delay[:, None] + found.rx_delay - truth
    error = (error + 0.5 * instrument.period) % instrument.period - 0.5 * instrument.period
    return error / (speed_of_light / (2.0 * np.ptp(instrument.frequency)))


@pytest.mark.parametrize("seed", range(8))
def test_metres_of_unknown_cable_are_found_to_a_tenth_of_the_range_resolution(seed):
    instrument, centre, radius, sphere, empty = drawn(seed, coupling_db=(None, 0.0, 20.0, 30.0)[seed // 2 % 4], walls=2)
    left = mf.calibrate.subtract_background(sphere, empty)
    found = mf.calibrate.estimate_elements(left, at=centre, radius=radius)
    assert found.tx_valid.all()
    assert found.rx_valid.all()
    error = errors(found, instrument)
    assert abs(error.mean()) < 0.1
    assert np.quantile(np.abs(error), 0.9) < 0.1  # of single weak elements noise may tell a little less
    assert 0.0 <= found.common_delay + 2e-3 < instrument.period


@pytest.mark.parametrize("seed", [0, 1, 4, 5])
def test_coupling_much_louder_than_the_sphere_helps_to_find_it(seed):
    """Without a background. Lines side by side are left out: there coupling comes like an echo from the side."""
    instrument, centre, radius, sphere, _ = drawn(seed, coupling_db=25.0)
    found = mf.calibrate.estimate_elements(sphere, at=centre, radius=radius)
    assert abs(errors(found, instrument).mean()) < 0.1


def test_a_calibrated_sweep_is_that_of_an_instrument_without_cables():
    instrument, centre, radius, sphere, _ = drawn(0)
    found = mf.calibrate.estimate_elements(sphere, at=centre, radius=radius)
    clean = mf.calibrate.apply_elements(sphere, found)
    ideal = instrument.sphere(centre, radius)
    share = abs(np.vdot(clean["s"].values, ideal)) / np.linalg.norm(clean["s"]) / np.linalg.norm(ideal)
    assert share > 0.85  # noise at 10 dB SNR leaves 0.95 of elements of equal gain
    assert f"{found.common_delay:.6g} m of cable (modulo {instrument.period:.6g} m)" in clean.attrs["processing"][-1]


def test_an_element_that_heard_nothing_has_the_cables_of_the_others():
    instrument, centre, radius, sphere, _ = drawn(3)
    sphere["s"].values[:, 2] = 0.0
    found = mf.calibrate.estimate_elements(sphere, at=centre, radius=radius)
    assert np.flatnonzero(~found.tx_valid).tolist() == [2]
    assert found.tx_delay[2] == pytest.approx(np.delete(found.tx_delay, 2).mean())
    assert np.abs(np.delete(errors(found, instrument), 2, axis=0)).max() < 0.1


@pytest.mark.slow
def test_several_places_agree_on_one_cable_at_the_end_of_the_period():
    """A cable of just a period less: one place may tell nearly all of it, another a little less than none."""
    frequency = np.linspace(90e9, 100e9, 101)
    period = speed_of_light / (frequency[1] - frequency[0])
    tx, rx = line(11), line(11, centre=(0.0, 0.0, 0.015))
    for cable in (period - 0.034, period - 0.001, 0.001):
        instrument = Instrument.random(tx, rx, frequency, 1, cable=cable)
        places = [(-0.3, 0.6), (0.0, 0.8), (0.4, 0.7)]
        sweeps = [instrument.measure(instrument.sphere(where), n, noise=0.3) for n, where in enumerate(places)]
        found = mf.calibrate.estimate_elements(sweeps, at=places)
        assert abs((found.common_delay - cable + 0.5 * period) % period - 0.5 * period) < 3e-3
        displacement, length = mf.calibrate.estimate_displacement(sweeps, at=places)
        assert np.abs(displacement[:2]).max() < 2e-3
        assert abs((length - cable + 0.5 * period) % period - 0.5 * period) < 2e-3


def test_a_stated_delay_is_looked_for_nearby_only():
    instrument, centre, radius, sphere, _ = drawn(1)
    sphere = mf.calibrate.remove_cable(sphere, instrument.cable - 0.05)
    near = mf.calibrate.estimate_elements(sphere, at=centre, radius=radius, largest_common=0.1)
    assert near.common_delay == pytest.approx(0.05, abs=2e-3)
    with pytest.raises(mf.InputError, match="not heard"):
        mf.calibrate.estimate_elements(
            mf.calibrate.remove_cable(sphere, -0.4), at=centre, radius=radius, largest_common=0.1
        )
    with pytest.raises(mf.InputError, match="largest_common is -1"):
        mf.calibrate.estimate_elements(sphere, at=centre, largest_common=-1)


def test_the_gate_of_a_reference_finds_it_behind_metres_of_cable():
    """What stands elsewhere in the reference must not be divided by; where the reflector is, the cable decides."""
    frequency = np.linspace(140e9, 150e9, 201)
    tx, rx = line(9), line(9, centre=(0.0, 0.0, 0.015))
    ones = np.ones(9)
    instrument = Instrument(tx, rx, frequency, 3.21, 0.0 * ones, 0.0 * ones, ones, ones)
    at, target = (0.0, 0.8), instrument.sphere((0.1, 0.6))
    reference = instrument.measure(instrument.sphere(at) + 0.3 * instrument.sphere((0.2, 1.5)), 0)
    measured = instrument.measure(target, 1)
    found = mf.calibrate.normalise_by_reference(measured, reference, at=at, gate=0.2)["s"].values[20:-20]
    share = abs(np.vdot(found, target[20:-20])) / np.linalg.norm(found) / np.linalg.norm(target[20:-20])
    assert share > 0.99
